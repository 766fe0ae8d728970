#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include <ceres/cost_function.h>
#include <ceres/iteration_callback.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include "lib/base/message.h"
#include "solvers/internal/ceres_options.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

void check(const LeastSquares& problem, const Eigen::VectorXd& start) {
  const Eigen::Index n = start.size();
  require_argument(
      n > 0 && problem.residuals > 0 && problem.lower.size() == n && problem.upper.size() == n,
      {"least squares: ", problem.residuals, " residuals, start of size ", n, ", bounds of sizes ",
       problem.lower.size(), " and ", problem.upper.size()});
  for (Eigen::Index i = 0; i < n; ++i) {
    require_argument(start[i] >= problem.lower[i] && start[i] <= problem.upper[i],
                     {"least squares: start ", start[i], " of coordinate ", i, " lies outside [",
                      problem.lower[i], ", ", problem.upper[i], "]"});
  }
}

/// The box of a problem, and which coordinates are held at its sides. Ceres projects its steps onto
/// the box without taking the active bounds out of the linear system; a minimum on a bound is then
/// approached at a crawl. So coordinates that press against a bound are held there, and let go when
/// the gradient turns.
class ActiveSet {
 public:
  explicit ActiveSet(const LeastSquares& problem) : problem_(problem), held_(problem.lower.size()) {
    for (Eigen::Index i = 0; i < held_.size(); ++i) {
      held_[i] = problem.lower[i] == problem.upper[i];
    }
  }

  bool held(Eigen::Index i) const { return held_[i]; }

  /// -1 at the lower bound, 1 at the upper one, 0 inside.
  int side(const Eigen::VectorXd& x, Eigen::Index i) const {
    return x[i] <= problem_.lower[i] ? -1 : x[i] >= problem_.upper[i] ? 1 : 0;
  }

  /// Number of coordinates not held that press against a bound: downhill leads out of the box.
  Eigen::Index pressing(const Eigen::VectorXd& x, const Eigen::VectorXd& gradient) const {
    Eigen::Index count = 0;
    for (Eigen::Index i = 0; i < held_.size(); ++i) {
      count += !held_[i] && side(x, i) * gradient[i] < 0.0 ? 1 : 0;
    }
    return count;
  }

  void hold_pressing(const Eigen::VectorXd& x, const Eigen::VectorXd& gradient) {
    for (Eigen::Index i = 0; i < held_.size(); ++i) {
      held_[i] = held_[i] || side(x, i) * gradient[i] < 0.0;
    }
  }

  /// Lets the coordinate go that gains most by leaving its bound, if one does: of a Gauss-Newton
  /// step of that coordinate alone, the gain is (gradient / column norm)^2 / 2.
  bool release_one(const Eigen::VectorXd& x, const Eigen::VectorXd& gradient,
                   const Eigen::VectorXd& column_norm, double least_gain) {
    Eigen::Index best = -1;
    for (Eigen::Index i = 0; i < held_.size(); ++i) {
      if (!held_[i] || problem_.lower[i] == problem_.upper[i]) continue;
      if (!(side(x, i) * gradient[i] > 0.0)) continue;
      const double gain = 0.5 * std::pow(gradient[i] / column_norm[i], 2);
      if (!(gain > least_gain)) continue;
      least_gain = gain;
      best = i;
    }
    if (best >= 0) held_[best] = false;
    return best >= 0;
  }

 private:
  const LeastSquares& problem_;
  Eigen::Array<bool, Eigen::Dynamic, 1> held_;
};

/// Ceres asks for a class; it passes the call on and keeps the gradient.
class Residuals : public ceres::CostFunction {
 public:
  Residuals(const LeastSquares& problem, Eigen::Index n)
      : problem_(problem), x_(n), r_(problem.residuals), gradient_(Eigen::VectorXd::Zero(n)) {
    set_num_residuals(static_cast<int>(problem.residuals));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(n));
  }

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override {
    const Eigen::Index n = x_.size(), m = r_.size();
    x_ = Eigen::Map<const Eigen::VectorXd>(parameters[0], n);
    const bool with_jacobian = jacobians != nullptr && jacobians[0] != nullptr;
    if (with_jacobian) J_.resize(m, n);
    ++evaluations_;
    if (!problem_.evaluate(x_, r_, with_jacobian ? &J_ : nullptr)) return false;
    if (!r_.allFinite() || (with_jacobian && !J_.allFinite())) return false;
    Eigen::Map<Eigen::VectorXd>(residuals, m) = r_;
    if (with_jacobian) {
      Eigen::Map<LeastSquares::RowMatrix>(jacobians[0], m, n) = J_;
      gradient_.noalias() = J_.transpose() * r_;
    }
    return true;
  }

  /// At the last point where the Jacobian was asked for: the best one so far, when an iteration
  /// ends.
  const Eigen::VectorXd& gradient() const { return gradient_; }
  int evaluations() const { return evaluations_; }

 private:
  const LeastSquares& problem_;
  mutable Eigen::VectorXd x_, r_, gradient_;
  mutable LeastSquares::RowMatrix J_;
  mutable int evaluations_ = 0;
};

/// Reports progress, and interrupts when a coordinate has pressed against its bound twice in a row.
class Watch : public ceres::IterationCallback {
 public:
  Watch(const SolverOptions& options, const Residuals& residuals, const ActiveSet& active,
        const Eigen::VectorXd& x, int iterations_before)
      : options_(options),
        residuals_(residuals),
        active_(active),
        x_(x),
        before_(iterations_before) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& summary) override {
    if (options_.progress && !options_.progress(before_ + summary.iteration, summary.cost)) {
      stopped_by_caller_ = true;
      return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
    }
    pressed_ = active_.pressing(x_, residuals_.gradient()) > 0 ? pressed_ + 1 : 0;
    return pressed_ >= 2 ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

  bool stopped_by_caller() const { return stopped_by_caller_; }

 private:
  const SolverOptions& options_;
  const Residuals& residuals_;
  const ActiveSet& active_;
  const Eigen::VectorXd& x_;
  int before_, pressed_ = 0;
  bool stopped_by_caller_ = false;
};

ceres::Solver::Options dense_options(const SolverOptions& options) {
  ceres::Solver::Options out = ceres_options(options);
  out.linear_solver_type =
      options.normal_equations ? ceres::DENSE_NORMAL_CHOLESKY : ceres::DENSE_QR;
  out.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
  out.jacobi_scaling = true;
  out.update_state_every_iteration = true;
  return out;
}

/// Runs Ceres with the held coordinates constant; x moves.
ceres::Solver::Summary run(const LeastSquares& problem, const ActiveSet& active,
                           const ceres::Solver::Options& options, Residuals& residuals,
                           Eigen::VectorXd& x) {
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem ceres_problem(ownership);
  ceres_problem.AddResidualBlock(&residuals, nullptr, x.data());
  std::vector<int> constant;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const int k = static_cast<int>(i);
    if (active.held(i)) {
      constant.push_back(k);
      continue;
    }
    if (std::isfinite(problem.lower[i])) {
      ceres_problem.SetParameterLowerBound(x.data(), k, problem.lower[i]);
    }
    if (std::isfinite(problem.upper[i])) {
      ceres_problem.SetParameterUpperBound(x.data(), k, problem.upper[i]);
    }
  }
  if (static_cast<Eigen::Index>(constant.size()) == x.size()) {
    ceres_problem.SetParameterBlockConstant(x.data());
  } else if (!constant.empty()) {
    ceres_problem.SetManifold(x.data(),
                              new ceres::SubsetManifold(static_cast<int>(x.size()), constant));
  }
  ceres::Solver::Summary summary;
  ceres::Solve(options, &ceres_problem, &summary);
  return summary;
}

}  // namespace

Solution solve(const LeastSquares& problem, const Eigen::VectorXd& start,
               const SolverOptions& options) {
  check(problem, start);
  Solution solution;
  Eigen::VectorXd& x = solution.x;
  SolverSummary& summary = solution.summary;
  x = start;

  Eigen::VectorXd r(problem.residuals);
  if (!problem.evaluate(start, r, nullptr) || !r.allFinite()) {
    summary.termination = Termination::start_undefined;
    summary.message = "the residuals are undefined at the start";
    return solution;
  }
  summary.initial_objective = summary.objective = 0.5 * r.squaredNorm();

  const auto begin = std::chrono::steady_clock::now();
  Residuals residuals(problem, start.size());
  ActiveSet active(problem);
  ceres::Solver::Options how = dense_options(options);
  // Every round holds at least one coordinate more or lets one go; a set that keeps changing is
  // given up on.
  const Eigen::Index most_rounds = 20 + 4 * start.size();
  for (Eigen::Index round = 0; round < most_rounds; ++round) {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    if (std::isfinite(options.max_seconds)) {
      how.max_solver_time_in_seconds = std::max(0.0, options.max_seconds - elapsed.count());
    }
    how.max_num_iterations = options.max_iterations - summary.iterations;
    Watch watch(options, residuals, active, x, summary.iterations);
    how.callbacks = {&watch};
    const ceres::Solver::Summary ran = run(problem, active, how, residuals, x);

    summary.termination = termination_of(ran, how);
    summary.message = ran.message;
    summary.iterations += ran.num_successful_steps + ran.num_unsuccessful_steps;
    summary.objective = ran.final_cost;
    if (watch.stopped_by_caller()) {
      summary.termination = Termination::stopped;
      summary.message = "stopped by the caller";
      break;
    }
    if (summary.termination == Termination::stopped) {  // by the watch: the bounds held may change
      summary.termination = Termination::iteration_limit;
    }
    const bool more =
        summary.iterations < options.max_iterations && elapsed.count() < options.max_seconds;
    if (active.pressing(x, residuals.gradient()) > 0) {
      active.hold_pressing(x, residuals.gradient());
      if (more) continue;
      summary.termination = Termination::iteration_limit;
    } else if (summary.termination == Termination::converged && more) {
      LeastSquares::RowMatrix J(problem.residuals, x.size());
      if (problem.evaluate(x, r, &J) &&
          active.release_one(x, J.transpose() * r, J.colwise().norm().transpose(),
                             options.function_tolerance * summary.objective)) {
        continue;
      }
    }
    break;
  }
  summary.evaluations = residuals.evaluations() + 1;
  return solution;
}

}  // namespace identikal
