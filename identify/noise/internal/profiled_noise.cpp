#include "identify/noise/internal/profiled_noise.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "identify/model/parameter_prior.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

bool is_diagonal(const MatrixXd& M) {
  return (M - MatrixXd(M.diagonal().asDiagonal())).isZero(0.0);
}

// The power that R_jj follows the parameter by, the same for all outputs that follow it.
std::optional<double> exponent_of(const MatrixXd& R, const MatrixXd& by, double value) {
  std::optional<double> out;
  for (Index j = 0; j < R.rows(); ++j) {
    if (by(j, j) == 0.0) continue;
    const double here = by(j, j) * value / R(j, j);
    if (!std::isfinite(here) || here == 0.0) return std::nullopt;
    if (out && std::abs(here - *out) > 1e-9 * std::abs(*out)) return std::nullopt;
    out = here;
  }
  return out;
}

// Does the noise follow the parameter by that power wherever it goes?
bool is_power(const LinearModel& noise, ParameterSet parameters, int parameter, double exponent) {
  const MatrixXd R = written_matrices(noise, parameters).R;
  const MatrixXd by = parameters[static_cast<std::size_t>(parameter)].value;
  for (const double factor : {2.0, 1e3, 1e-3}) {
    parameters[static_cast<std::size_t>(parameter)].value = factor * by;
    const MatrixXd there = written_matrices(noise, parameters).R;
    for (Index j = 0; j < R.rows(); ++j) {
      const double scaled = R(j, j) * std::pow(factor, exponent);
      const bool follows = std::abs(there(j, j) - scaled) <= 1e-9 * std::abs(scaled);
      if (!follows && there(j, j) != R(j, j)) return false;
    }
  }
  return true;
}

// Those that outputs without noise depend on.
std::set<int> parameters_of_motion(const Model& model) {
  std::set<int> out;
  const LinearModel& matrices = noise_model(model);
  for (const ParametrisedMatrix* M :
       {&matrices.A, &matrices.B, &matrices.C, &matrices.D, &matrices.x0}) {
    const std::vector<int> here = parameters_in(*M);
    out.insert(here.begin(), here.end());
  }
  if (!is_formula_model(model) || as_formulas(model).linear) return out;
  const std::vector<Index>& column = as_formulas(model).equations.column;
  for (std::size_t p = 0; p < column.size(); ++p) {
    if (column[p] >= 0) out.insert(static_cast<int>(p));
  }
  return out;
}

}  // namespace

std::optional<NoiseScales> noise_scales(const Model& model) {
  if (is_vehicle(model)) return {};
  const ParameterSet& parameters = model.parameters;
  const LinearModel& noise = noise_model(model);
  if (noise.initial != InitialState::given || moves(noise.R)) return {};
  if (!names_with_priors(parameters).empty()) return {};
  const StateSpace written = written_matrices(noise, parameters);
  const std::vector<StateSpace> by = model_derivatives(noise, parameters);
  const std::vector<EntryDerivative> entries = entry_derivatives(parameters);
  if (!written.Q.isZero(0.0) || !written.P0.isZero(0.0) || !is_diagonal(written.R)) return {};
  const std::set<int> of_motion = parameters_of_motion(model);
  NoiseScales out;
  VectorXd scaled_by = VectorXd::Zero(written.R.rows());
  std::vector<double> exponents;
  for (std::size_t i = 0; i < by.size(); ++i) {
    const StateSpace& d = by[i];
    const Parameter& parameter = parameters[static_cast<std::size_t>(entries[i].parameter)];
    if (!d.Q.isZero(0.0) || !d.P0.isZero(0.0) || !is_diagonal(d.R)) return {};
    if (parameter.domain != Domain::scalar) return {};
    if (d.R.isZero(0.0)) {
      out.others.push_back(static_cast<Index>(i));
      continue;
    }
    const auto exponent = exponent_of(written.R, d.R, parameter.scalar());
    if (of_motion.contains(entries[i].parameter) || !exponent ||
        !is_power(noise, parameters, entries[i].parameter, *exponent)) {
      return {};
    }
    scaled_by += VectorXd((d.R.diagonal().array() != 0.0).cast<double>());
    out.scales.push_back(static_cast<Index>(i));
    exponents.push_back(*exponent);
  }
  if (out.scales.empty() || out.others.empty() || scaled_by.minCoeff() < 1.0 ||
      scaled_by.maxCoeff() > 1.0) {
    return {};
  }
  out.exponent = Eigen::Map<const VectorXd>(exponents.data(), static_cast<Index>(exponents.size()));
  return out;
}

ProfiledLikelihood::ProfiledLikelihood(const LikelihoodProblem& problem, NoiseScales which,
                                       const VectorXd& start)
    : of_all_(problem), which_(std::move(which)), at_(start) {}

VectorXd ProfiledLikelihood::all(const VectorXd& others) {
  at_(which_.others) = others;
  VectorXd gradient;
  MatrixXd information;
  double L = 0.0;
  settle(gradient, information, L);
  return at_;
}

// Moves the scales to their maximum.
bool ProfiledLikelihood::settle(VectorXd& gradient, MatrixXd& information, double& L) {
  constexpr int kMost = 6;
  constexpr double kLeast = 1e-16;  // of S/n: below, rounding says nothing
  for (int pass = 0; pass < kMost; ++pass) {
    if (!of_all_.evaluate(at_, L, &gradient, &information) || !std::isfinite(L)) return false;
    double moved = 0.0;
    for (std::size_t i = 0; i < which_.scales.size(); ++i) {
      const Index c = which_.scales[i];
      const double s = at_[c], a = which_.exponent[static_cast<Index>(i)];
      const double n = 2.0 * s * s * information(c, c) / (a * a);
      if (!(n > 0.0)) continue;  // nothing was measured
      const double share = std::max(kLeast, 1.0 + 2.0 * s * gradient[c] / (a * n));
      const double to =
          std::clamp(s * std::pow(share, 1.0 / a), of_all_.lower[c], of_all_.upper[c]);
      if (!std::isfinite(to) || to == 0.0) continue;
      moved = std::max(moved, std::abs(to / s - 1.0));
      at_[c] = to;
    }
    if (moved < 1e-6) return true;
  }
  return true;
}

LikelihoodProblem ProfiledLikelihood::problem() {
  LikelihoodProblem out;
  out.lower = of_all_.lower(which_.others);
  out.upper = of_all_.upper(which_.others);
  out.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
    const VectorXd before = at_;
    at_(which_.others) = x;
    VectorXd g;
    MatrixXd J;
    if (!settle(g, J, L)) {
      at_ = before;
      return false;
    }
    if (gradient != nullptr) *gradient = g(which_.others);
    if (information != nullptr) *information = J(which_.others, which_.others);
    return true;
  };
  return out;
}

}  // namespace identikal
