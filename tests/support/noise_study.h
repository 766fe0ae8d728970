// An estimator of noise over many recordings with known truth: bias, spread against the Cramer-Rao
// bound, coverage, and what the filters it makes lose.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

#include "identify/estimate/estimate.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"
#include "lib/filter/information.h"
#include "lib/filter/steady_state.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"
#include "tests/support/shared_data.h"

namespace identikal {

struct NoiseStudy {
  Eigen::VectorXd mean;                      // / truth
  Eigen::VectorXd percent;                   // standard deviation in % of the truth
  Eigen::VectorXd ratio;                     // standard deviation / bound
  Eigen::VectorXd coverage;                  // of 95 % intervals
  double mean_loss = 0.0, worst_loss = 0.0;  // tr P of the tuned filter over the optimal, - 1
  double loss_error = 0.0;                   // standard error of mean_loss
  double expected_loss = 0.0;                // the mean of what the estimates say themselves
  int runs = 0, not_ok = 0, indefinite = 0;
  int vanished = 0;  // results with a measurement noise of zero
};

/// A right model is refused in 1 % of the recordings (tests/campaigns): at most so many of them,
/// with a probability of .999.
inline int refused_by_chance(int runs) {
  const double expected = 0.01 * runs;
  return static_cast<int>(expected + 3.1 * std::sqrt(expected) + 1.0);
}

/// The Cramer-Rao standard deviations at the truth.
inline Eigen::VectorXd bound_sd(const MatiskoSystem& system) {
  const ExpectedInformation information = expected_information(
      true_system(system), as_linear(system.model).initial, system.samples,
      model_derivatives(as_linear(system.model), system.model.parameters), Eigen::MatrixXd());
  return information.total.inverse().diagonal().cwiseSqrt();
}

/// tr P of the true system under the steady gain of a tuned one.
inline double predicted_spread(const StateSpace& truth, const StateSpace& tuned) {
  const auto steady = steady_state(tuned);
  if (!steady) return HUGE_VAL;
  const Eigen::MatrixXd F = truth.A - steady->K * truth.C;
  const auto P = solve_discrete_lyapunov(
      F, truth.G * truth.Q * truth.G.transpose() + steady->K * truth.R * steady->K.transpose());
  return P ? P->trace() : HUGE_VAL;
}

/// 50 recordings of a system from the reference data.
inline std::vector<Eigen::MatrixXd> reference_recordings(const MatiskoSystem& system) {
  const Table table = read_csv(shared_file("noise/sys" + std::to_string(system.number) + ".csv"));
  const Eigen::Index ny = as_linear(system.model).C.constant.rows();
  std::vector<Eigen::MatrixXd> out;
  for (std::size_t c = 0; c < table.columns.size(); c += static_cast<std::size_t>(ny)) {
    Eigen::MatrixXd y(ny, static_cast<Eigen::Index>(table.rows));
    for (Eigen::Index i = 0; i < ny; ++i) {
      y.row(i) = Eigen::Map<const Eigen::RowVectorXd>(
          table.columns[c + static_cast<std::size_t>(i)].values.data(), y.cols());
    }
    out.push_back(y);
  }
  if (out.size() != 50) throw std::runtime_error("the reference data are not 50 recordings");
  return out;
}

inline std::vector<Eigen::MatrixXd> simulated_recordings(const MatiskoSystem& system, int runs,
                                                         std::uint64_t seed) {
  Random random(seed);
  std::vector<Eigen::MatrixXd> out;
  for (int run = 0; run < runs; ++run) out.push_back(simulate_matisko(system, random));
  return out;
}

/// Runs the estimator over all recordings and prints what came of it.
inline NoiseStudy study(
    const std::string& title, const MatiskoSystem& system,
    const std::vector<Eigen::MatrixXd>& recordings,
    const std::function<NoiseEstimate(const std::vector<Dataset>&)>& estimator) {
  const Eigen::Index k = system.truth.size();
  const auto runs = static_cast<Eigen::Index>(recordings.size());
  Eigen::MatrixXd estimates(k, runs);
  NoiseStudy out;
  out.runs = static_cast<int>(runs);
  out.coverage = Eigen::VectorXd::Zero(k);
  const StateSpace truth = true_system(system);
  const double optimal = predicted_spread(truth, truth);
  double squares = 0.0, saying = 0.0;
  for (Eigen::Index run = 0; run < runs; ++run) {
    const NoiseEstimate e = estimator({dataset_of(recordings[static_cast<std::size_t>(run)])});
    // A measurement noise of zero is no fault of the model: refused by rule, and so not counted here.
    const bool vanished = std::any_of(e.findings.begin(), e.findings.end(), [](const Finding& f) {
      return f.code == FindingCode::no_measurement_noise;
    });
    out.not_ok += e.status != Status::ok && !vanished;
    out.vanished += vanished;
    for (Eigen::Index i = 0; i < k; ++i) {
      const EstimatedParameter& p = e.parameters[static_cast<std::size_t>(i)];
      estimates(i, run) = p.value;
      out.coverage[i] += (p.ci95[0] <= system.truth[i] && system.truth[i] <= p.ci95[1]) /
                         static_cast<double>(runs);
    }
    out.indefinite += (estimates.col(run).array() < 0.0).any();
    const StateSpace tuned = instantiate(as_linear(system.model),
                                         with_entries(system.model.parameters, estimates.col(run)));
    const double loss = predicted_spread(truth, tuned) / optimal - 1.0;
    out.mean_loss += loss / static_cast<double>(runs);
    squares += loss * loss / static_cast<double>(runs);
    if (e.excess_mean_square_error && std::isfinite(e.excess_mean_square_error->relative)) {
      out.expected_loss += e.excess_mean_square_error->relative;
      saying += 1.0;
    }
    out.worst_loss = std::max(out.worst_loss, loss);
  }
  out.expected_loss /= saying;
  out.loss_error =
      std::sqrt(std::max(0.0, squares - out.mean_loss * out.mean_loss) / static_cast<double>(runs));
  const Eigen::VectorXd mean = estimates.rowwise().mean();
  const Eigen::VectorXd sd =
      ((estimates.colwise() - mean).rowwise().squaredNorm() / static_cast<double>(runs - 1))
          .cwiseSqrt();
  out.mean = mean.cwiseQuotient(system.truth);
  out.percent = 100.0 * sd.cwiseQuotient(system.truth);
  out.ratio = sd.cwiseQuotient(bound_sd(system));
  std::printf(
      "%s: %d runs, %d not ok, %d indefinite, filter loss %.3f +- %.3f %% (they "
      "say %.3f %%; worst %.2f %%)\n",
      title.c_str(), out.runs, out.not_ok, out.indefinite, 100.0 * out.mean_loss,
      100.0 * out.loss_error, 100.0 * out.expected_loss, 100.0 * out.worst_loss);
  const auto line = [](const char* what, const Eigen::VectorXd& values) {
    std::printf("  %-13s", what);
    for (const double v : values) std::printf(" %7.3f", v);
    std::printf("\n");
  };
  line("mean / truth", out.mean);
  line("sd in %", out.percent);
  line("sd / bound", out.ratio);
  line("coverage", out.coverage);
  return out;
}

}  // namespace identikal
