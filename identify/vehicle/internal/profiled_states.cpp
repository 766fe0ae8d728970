#include "identify/vehicle/internal/profiled_states.h"

#include <cmath>
#include <utility>

#include "identify/vehicle/internal/robust_noise.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

constexpr int kMostStateSteps = 20;
// In log-likelihood. By the quadratic the former is known to some thousandths of itself; with weights that
// follow the errors it is not.
constexpr double kStatesNearSettled = 0.01, kStatesSettled = 1e-9;

}  // namespace

ProfiledStates::ProfiledStates(const VehicleProblem& problem, const Eigen::VectorXd& start)
    : problem_(problem),
      shared_(problem.parameters() + problem.gains()),
      likeliest_(start),
      highest_(-kInfinity) {}

Eigen::VectorXd ProfiledStates::clipped(Eigen::VectorXd z) const {
  const Eigen::Index states = z.size() - shared_;
  z.tail(states) =
      z.tail(states).cwiseMax(problem_.lower.tail(states)).cwiseMin(problem_.upper.tail(states));
  return z;
}

Eigen::VectorXd ProfiledStates::expected(const Eigen::VectorXd& shared) const {
  Eigen::VectorXd z = likeliest_;
  z.head(shared_) = shared;
  if (by_shared_.size() > 0) {
    z.tail(z.size() - shared_) += by_shared_ * (shared - likeliest_.head(shared_));
  }
  return clipped(std::move(z));
}

bool ProfiledStates::linearise(const Eigen::VectorXd& z, Point& out) {
  out.z = z;
  if (!output_error(problem_, z, out.e, &J_)) return false;
  const Eigen::VectorXd sd = noise_sd(problem_, out.e);
  out.L = log_likelihood(problem_, z, out.e, sd);
  Eigen::VectorXd root(out.e.size());
  for (Eigen::Index n = 0; n < root.size(); ++n) {
    const double scale = sd[problem_.output[n]];
    const double weight = problem_.robust ? noise_cost(true, out.e[n] / scale).weight : 1.0;
    root[n] = std::sqrt(weight) / scale;
  }
  SegmentedEquations equations(problem_);
  add_rows(problem_, J_, out.e, root, 1.0, equations);
  out.eliminated = eliminate_states(equations);
  return std::isfinite(out.L) && out.eliminated.gradient.allFinite();
}

bool ProfiledStates::move_states(const Eigen::VectorXd& shared, double lacking) {
  Eigen::VectorXd z = expected(shared);
  if (!linearise(z, now_)) {
    z.tail(z.size() - shared_) = likeliest_.tail(z.size() - shared_);
    if (!linearise(z, now_)) return false;
  }
  for (int step = 0; step < kMostStateSteps && now_.eliminated.gain > lacking; ++step) {
    z = now_.z;
    z.tail(z.size() - shared_) += now_.eliminated.states;
    if (!linearise(clipped(std::move(z)), next_) || !(next_.L > now_.L)) break;
    std::swap(now_, next_);
  }
  if (!(now_.L < highest_)) {
    highest_ = now_.L;
    likeliest_ = now_.z;
    // And the step that was too short to be made; a longer one has brought nothing.
    if (now_.eliminated.gain <= kStatesNearSettled) {
      likeliest_.tail(likeliest_.size() - shared_) += now_.eliminated.states;
      likeliest_ = clipped(std::move(likeliest_));
    }
    by_shared_ = now_.eliminated.by_shared;
  }
  return true;
}

void ProfiledStates::report(double& L, Eigen::VectorXd& gradient,
                            Eigen::MatrixXd& information) const {
  L = now_.L;
  gradient = -now_.eliminated.gradient;
  information = now_.eliminated.information;
  for (Eigen::Index i = 0; i < problem_.parameters(); ++i) {
    const PriorResidual prior = prior_residual(problem_, now_.z, i);
    gradient[i] -= prior.value * prior.slope;
    information(i, i) += prior.slope * prior.slope;
  }
}

bool ProfiledStates::evaluate(const Eigen::VectorXd& shared, double& L, Eigen::VectorXd& gradient,
                              Eigen::MatrixXd& information) {
  if (!move_states(shared, problem_.robust ? kStatesSettled : kStatesNearSettled)) return false;
  report(L, gradient, information);
  if (now_.eliminated.gain <= kStatesNearSettled) L += now_.eliminated.gain;
  return true;
}

bool ProfiledStates::settle(const Eigen::VectorXd& shared, double& L, Eigen::VectorXd& gradient,
                            Eigen::MatrixXd& information) {
  if (!move_states(shared, kStatesSettled)) return false;
  report(L, gradient, information);
  return true;
}

}  // namespace identikal
