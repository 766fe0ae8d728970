#include "identify/noise/internal/common_scale.h"

#include <cmath>
#include <limits>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Do Q, R and S follow those parameters in proportion?
bool are_proportional(const LinearModel& model, ParameterSet parameters,
                      const std::vector<std::size_t>& variances) {
  constexpr double kFactor = 3.0;
  const StateSpace before = written_matrices(model, parameters);
  for (const std::size_t p : variances) parameters[p].value *= kFactor;
  const StateSpace after = written_matrices(model, parameters);
  return after.Q.isApprox(kFactor * before.Q, 1e-12) &&
         after.R.isApprox(kFactor * before.R, 1e-12) &&
         after.S.isApprox(kFactor * before.S, 1e-12) && after.A == before.A &&
         after.C == before.C && after.G == before.G;
}

}  // namespace

CommonScale::CommonScale(const Model& model, const FactorCoordinates& factors, double samples)
    : samples_(samples) {
  if (!is_linear(model)) return;
  const LinearModel& linear = as_linear(model);
  if (linear.initial == InitialState::given || !linear.known.empty() || holds_moving(linear))
    return;
  const std::vector<StateSpace> by = model_derivatives(linear, model.parameters);
  const std::vector<EntryDerivative> entries = entry_derivatives(model.parameters);
  std::vector<Index> found;
  std::vector<std::size_t> variances;
  for (std::size_t i = 0; i < by.size(); ++i) {
    if (by[i].Q.isZero(0.0) && by[i].R.isZero(0.0) && by[i].S.isZero(0.0)) continue;
    const auto p = static_cast<std::size_t>(entries[i].parameter);
    const Index at = factors.coordinate_of(static_cast<Index>(i));
    if (model.parameters[p].domain != Domain::scalar || at < 0) return;
    found.push_back(at);
    variances.push_back(p);
  }
  if (are_proportional(linear, model.parameters, variances)) coordinates_ = found;
}

double CommonScale::rescale(const LikelihoodProblem& problem, VectorXd& at) const {
  constexpr double kNone = -std::numeric_limits<double>::infinity();
  constexpr double kTwice = 2.0;
  const auto is_inside = [&](const VectorXd& x) {
    return (x.array() >= problem.lower.array()).all() && (x.array() <= problem.upper.array()).all();
  };
  double L = 0.0, there = 0.0;
  if (!problem.evaluate(at, L, nullptr, nullptr) || !std::isfinite(L)) return kNone;
  if (coordinates_.empty()) return L;
  VectorXd moved = at;
  moved(coordinates_) *= kTwice;
  if (!is_inside(moved) || !problem.evaluate(moved, there, nullptr, nullptr)) return L;
  const double S = 4.0 * (there - L + 0.5 * samples_ * std::log(kTwice));
  const double size = S / samples_;
  if (!(size > 0.0)) return L;
  moved(coordinates_) = size * at(coordinates_);
  if (!is_inside(moved)) return L;
  at = moved;
  return L - 0.5 * samples_ * (std::log(size) - size + 1.0);
}

}  // namespace identikal
