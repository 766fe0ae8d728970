#include "identify/noise/internal/coloured_errors.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "identify/shooting/simulation_slopes.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autoregression.h"
#include "lib/statistics/long_run_covariance.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kHighestOrder = 20;

// e(t) = sum A_k e(t-k) + w, of the order that AIC chooses.
struct ErrorModel {
  std::vector<MatrixXd> A;
  MatrixXd S;
};

ErrorModel error_model(const MatrixXd& errors) {
  const Index order = std::min(kHighestOrder, errors.cols() / 10);
  const Autocovariances Y = sample_autocovariances(errors, order + 1, Divisor::samples);
  const bool known =
      std::all_of(Y.begin(), Y.end(), [](const MatrixXd& each) { return each.allFinite(); });
  const Autoregressions models = known ? yule_walker(Y) : Autoregressions{};
  if (models.S.empty()) return {{}, MatrixXd::Zero(errors.rows(), errors.rows())};
  const Index samples = std::max<Index>(3, errors.cols());
  const auto best =
      static_cast<std::size_t>(autoregressive_order(models, samples, Penalty::aic).order);
  return {models.A[best], models.S[best]};
}

// sum_(s,t) M_s' E(e_s e_t') M_t: the adjoint of the autoregression, run back in time and on before the
// first sample until it has faded, makes it a sum over its innovations.
MatrixXd spread_by_autoregression(const std::vector<MatrixXd>& M, const ErrorModel& model,
                                  Index unknowns) {
  const Index ny = model.S.rows();
  const auto order = model.A.size();
  const auto N = static_cast<Index>(M.size());
  std::deque<MatrixXd> later;  // g(t+1), g(t+2), ...
  MatrixXd out = MatrixXd::Zero(unknowns, unknowns);
  for (Index t = N - 1; t > -N; --t) {
    MatrixXd g = t >= 0 ? M[static_cast<std::size_t>(t)] : MatrixXd::Zero(ny, unknowns);
    for (std::size_t k = 0; k < later.size(); ++k) g += model.A[k].transpose() * later[k];
    out += g.transpose() * model.S * g;
    if (order == 0 && t == 0) break;
    later.push_front(std::move(g));
    if (later.size() > order) later.pop_back();
  }
  return out;
}

// R^-1 de/dtheta of every sample of one recording.
std::vector<MatrixXd> weighted_slopes(const SimulationSlopes& along, const VectorXd& R, Index first,
                                      Index count) {
  std::vector<MatrixXd> out;
  for (Index t = first; t < first + count; ++t) {
    MatrixXd M(R.size(), static_cast<Index>(along.unknowns.size()));
    for (Index j = 0; j < R.size(); ++j) {
      M.row(j) = along.slopes[static_cast<std::size_t>(j)].row(t) / R[j];
    }
    out.push_back(std::move(M));
  }
  return out;
}

MatrixXd score_by_sample(const SimulationSlopes& along, const VectorXd& R,
                         const std::vector<StateSpace>& by) {
  MatrixXd out = MatrixXd::Zero(static_cast<Index>(by.size()), along.errors.cols());
  for (Index j = 0; j < along.errors.rows(); ++j) {
    const MatrixXd& slopes = along.slopes[static_cast<std::size_t>(j)];
    for (Index t = 0; t < out.cols(); ++t) {
      const double e = along.errors(j, t);
      if (std::isnan(e)) continue;
      for (std::size_t i = 0; i < along.unknowns.size(); ++i) {
        out(along.unknowns[i], t) -= e / R[j] * slopes(t, static_cast<Index>(i));
      }
      for (std::size_t i = 0; i < by.size(); ++i) {
        out(static_cast<Index>(i), t) += 0.5 * (e * e / R[j] - 1.0) / R[j] * by[i].R(j, j);
      }
    }
  }
  return out;
}

// As wide as the other along every coordinate.
void widen(MatrixXd& covariance, const MatrixXd& to) {
  const VectorXd least = covariance.diagonal().cwiseMax(1e-300);
  const VectorXd by = (to.diagonal().array() / least.array()).max(1.0).sqrt();
  covariance = by.asDiagonal() * covariance * by.asDiagonal();
}

}  // namespace

SimulationScore simulation_score(const Model& model, const std::vector<Dataset>& recordings,
                                 const ParameterSet& at) {
  const SimulationSlopes along = simulation_slopes(model, recordings, at);
  if (along.errors.size() == 0) return {};
  const LinearModel& noise = noise_model(model);
  const VectorXd R = written_matrices(noise, at).R.diagonal();
  const std::vector<StateSpace> by = model_derivatives(noise, at);
  SimulationScore out;
  out.by_sample = score_by_sample(along, R, by);
  out.by_autoregression = MatrixXd::Zero(out.by_sample.rows(), out.by_sample.rows());
  const auto unknowns = static_cast<Index>(along.unknowns.size());
  const ErrorModel errors = error_model(along.errors);
  Index first = 0;
  for (const Dataset& data : recordings) {
    const std::vector<MatrixXd> M = weighted_slopes(along, R, first, data.size());
    out.by_autoregression(along.unknowns, along.unknowns) +=
        spread_by_autoregression(M, errors, unknowns);
    first += data.size();
  }
  return out;
}

ColouredCovariance coloured_covariance(const MatrixXd& white, const SimulationScore& score,
                                       const MatrixXd& by) {
  ColouredCovariance out;
  MatrixXd steps = white * by.transpose() * score.by_sample;
  // At a bound they do not sum to zero.
  steps.colwise() -= VectorXd(steps.rowwise().mean());
  out.covariance = widest_long_run_covariance(steps, white, out.bandwidth);
  const MatrixXd spread = by.transpose() * score.by_autoregression * by;
  // What was fitted takes its own share from the errors.
  const auto samples = static_cast<double>(score.by_sample.cols());
  const double left = std::max(1.0, samples - static_cast<double>(white.rows()));
  widen(out.covariance, samples / left * white * spread * white);
  widen(out.covariance, white);
  // Kiefer & Vogelsang (2005), as for vehicles.
  out.freedom = std::max(1.0, 0.9 * samples / static_cast<double>(out.bandwidth));
  return out;
}

}  // namespace identikal
