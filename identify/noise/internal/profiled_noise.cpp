#include "identify/noise/internal/profiled_noise.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/QR>

#include "identify/model/parameter_prior.h"
#include "lib/base/random.h"
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

// Those that outputs without noise depend on, or the noise's size in another way than R.
std::set<int> parameters_of_motion(const Model& model) {
  std::set<int> out;
  const LinearModel& matrices = noise_model(model);
  for (const ParametrisedMatrix* M :
       {&matrices.A, &matrices.B, &matrices.C, &matrices.D, &matrices.x0}) {
    const std::vector<int> here = parameters_in(*M);
    out.insert(here.begin(), here.end());
  }
  if (!is_formula_model(model) || as_formulas(model).linear) return out;
  const auto insert = [&](const std::vector<Index>& column) {
    for (std::size_t p = 0; p < column.size(); ++p) {
      if (column[p] >= 0) out.insert(static_cast<int>(p));
    }
  };
  insert(as_formulas(model).equations.column);
  if (as_formulas(model).noise_scales) insert(as_formulas(model).noise_scales->column);
  return out;
}

// Do formulas of the noise's size hold states or unknowns? One place tells of all.
bool follows_prediction(const NonlinearModel& scales) {
  if (std::any_of(scales.column.begin(), scales.column.end(), [](Index c) { return c >= 0; })) {
    return true;
  }
  Random random(1);
  ModelMemory memory = make_memory(scales);
  set_parameters(scales, memory, random.normal(scales.parameters).cwiseAbs());
  VectorXd out(scales.outputs);
  Jacobian slopes;
  observe(scales, memory, random.normal(scales.states).cwiseAbs(),
          random.normal(scales.inputs).cwiseAbs(), 1.0, out, slopes);
  return !slopes.wrt_x.isZero(0.0);
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
  const bool by_formulas = is_formula_model(model) && !changes(model);
  if (by_formulas && as_formulas(model).noise_scales) {
    out.follow_prediction = follows_prediction(*as_formulas(model).noise_scales);
  }
  return out;
}

namespace {

// The way to the best of what is linear: of several that are as good, the shortest.
VectorXd least_squares_step(const MatrixXd& information, const VectorXd& gradient) {
  const VectorXd scale = information.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
  const Eigen::CompleteOrthogonalDecomposition<MatrixXd> of(scale.asDiagonal() * information *
                                                            scale.asDiagonal());
  return scale.asDiagonal() * of.solve(scale.asDiagonal() * gradient);
}

// Do slopes follow the information where these coordinates are moved by about their size?
bool is_linear_in(const LikelihoodProblem& problem, const VectorXd& at, const VectorXd& gradient,
                  const MatrixXd& information, const std::vector<Index>& which, Random& random) {
  constexpr double kExact = 1e-7;
  VectorXd moved = at, g;
  MatrixXd J;
  for (const Index i : which) {
    moved[i] += std::max(1.0, std::abs(at[i])) * (random.normal() > 0.0 ? 1.0 : -0.6);
  }
  double L = 0.0;
  if (!problem.evaluate(moved, L, &g, &J)) return false;
  const MatrixXd before = information(which, which), after = J(which, which);
  const VectorXd expected = before * (moved - at)(which), change = (gradient - g)(which);
  const VectorXd size =
      before.diagonal().cwiseSqrt() * std::sqrt(expected.dot((moved - at)(which)));
  return (after - before).cwiseAbs().maxCoeff() <= kExact * before.cwiseAbs().maxCoeff() &&
         ((change - expected).array().abs() <= kExact * size.array()).all();
}

}  // namespace

std::vector<Index> linear_coordinates(const LikelihoodProblem& problem, const NoiseScales& which,
                                      const VectorXd& start) {
  double L = 0.0;
  VectorXd gradient;
  MatrixXd information;
  if (!problem.evaluate(start, L, &gradient, &information)) return {};
  Random random(1);
  std::vector<Index> out;
  for (const Index i : which.others) {
    const bool bounded = std::isfinite(problem.lower[i]) || std::isfinite(problem.upper[i]);
    if (bounded || !(information(i, i) > 0.0)) continue;
    out.push_back(i);
    if (!is_linear_in(problem, start, gradient, information, out, random)) out.pop_back();
  }
  // Something has to be left to search for.
  if (out.size() == which.others.size() && !out.empty()) out.pop_back();
  return out;
}

ProfiledLikelihood::ProfiledLikelihood(const LikelihoodProblem& problem, NoiseScales which,
                                       const VectorXd& start, std::vector<Index> linear)
    : of_all_(problem), which_(std::move(which)), linear_(std::move(linear)), at_(start) {
  std::erase_if(which_.others, [&](Index i) {
    return std::find(linear_.begin(), linear_.end(), i) != linear_.end();
  });
}

VectorXd ProfiledLikelihood::all(const VectorXd& others) {
  at_(which_.others) = others;
  VectorXd gradient;
  MatrixXd information;
  double L = 0.0;
  settle(gradient, information, L);
  return at_;
}

// Evaluates, with what is linear at its best.
bool ProfiledLikelihood::settle_linear(VectorXd& gradient, MatrixXd& information, double& L) {
  constexpr int kMost = 3;  // the second for what rounding left
  for (int pass = 0; pass < kMost; ++pass) {
    if (!of_all_.evaluate(at_, L, &gradient, &information) || !std::isfinite(L)) return false;
    if (linear_.empty() || pass + 1 == kMost) return true;
    const VectorXd slope = gradient(linear_);
    const VectorXd step = least_squares_step(information(linear_, linear_), slope);
    if (!step.allFinite() || slope.dot(step) < 1e-9) return true;
    at_(linear_) += step;
  }
  return true;
}

// Moves the scales to their maximum. @return by what share, at most
double ProfiledLikelihood::move_scales(const VectorXd& gradient, const MatrixXd& information) {
  constexpr double kLeast = 1e-16;  // of S/n: below, rounding says nothing
  double moved = 0.0;
  for (std::size_t i = 0; i < which_.scales.size(); ++i) {
    const Index c = which_.scales[i];
    const double s = at_[c], a = which_.exponent[static_cast<Index>(i)];
    const double n = 2.0 * s * s * information(c, c) / (a * a);
    if (!(n > 0.0)) continue;  // nothing was measured
    const double share = std::max(kLeast, 1.0 + 2.0 * s * gradient[c] / (a * n));
    const double to = std::clamp(s * std::pow(share, 1.0 / a), of_all_.lower[c], of_all_.upper[c]);
    if (!std::isfinite(to) || to == 0.0) continue;
    moved = std::max(moved, std::abs(to / s - 1.0));
    at_[c] = to;
  }
  return moved;
}

bool ProfiledLikelihood::settle(VectorXd& gradient, MatrixXd& information, double& L) {
  constexpr int kMost = 6;
  for (int pass = 0; pass < kMost; ++pass) {
    if (!settle_linear(gradient, information, L)) return false;
    if (move_scales(gradient, information) < 1e-6) return true;
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
    if (information == nullptr) return true;
    *information = J(which_.others, which_.others);
    if (linear_.empty()) return true;
    const MatrixXd across = J(linear_, which_.others), within = J(linear_, linear_);
    for (Index i = 0; i < across.cols(); ++i) {
      information->col(i) -= across.transpose() * least_squares_step(within, across.col(i));
    }
    *information = (0.5 * (*information + information->transpose())).eval();
    return true;
  };
  return out;
}

}  // namespace identikal
