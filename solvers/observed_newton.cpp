#include "solvers/observed_newton.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

#include "solvers/internal/likelihood_start.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Place {
  VectorXd x, gradient;
  double L = 0.0;
};

bool look_at(const LikelihoodProblem& problem, Place& at, SolverSummary& summary) {
  ++summary.evaluations;
  return problem.evaluate(at.x, at.L, &at.gradient, nullptr) && std::isfinite(at.L) &&
         at.gradient.allFinite();
}

std::vector<Index> that_can_move(const LikelihoodProblem& problem, const Place& at) {
  std::vector<Index> out;
  for (Index i = 0; i < at.x.size(); ++i) {
    const bool held = problem.lower[i] >= problem.upper[i] ||
                      (at.x[i] <= problem.lower[i] && at.gradient[i] <= 0.0) ||
                      (at.x[i] >= problem.upper[i] && at.gradient[i] >= 0.0);
    if (!held) out.push_back(i);
  }
  return out;
}

// The observed information by differences over a share of each coordinate's own standard deviation,
// which is found along with it.
class ObservedInformation {
 public:
  explicit ObservedInformation(const VectorXd& x) : step_(1e-4 * x.cwiseAbs().cwiseMax(1e-4)) {}

  // false where the likelihood is undefined beside `at`
  bool find(const LikelihoodProblem& problem, const Place& at, const std::vector<Index>& free,
            SolverSummary& summary) {
    const auto m = static_cast<Index>(free.size());
    H = MatrixXd::Zero(m, m);
    for (Index j = 0; j < m; ++j) {
      constexpr int kTries = 4;
      constexpr double kShare = 1e-3, kTooLong = 4.0;  // of a standard deviation
      for (int k = 0; k < kTries; ++k) {
        double& h = step_[free[j]];
        if (!column(problem, at, free, j, h, summary)) return false;
        const double right = kShare / std::sqrt(std::abs(H(j, j)) + 1e-300);
        const bool too_long = h > kTooLong * right;
        if (right < kLongest * std::max(1.0, std::abs(at.x[free[j]]))) h = right;
        if (!too_long) break;
      }
    }
    H = (0.5 * (H + H.transpose())).eval();
    return true;
  }

  MatrixXd H;  // of the free coordinates

 private:
  static constexpr double kLongest = 1e-2;

  // Of a coordinate at its bound the difference is one-sided.
  bool column(const LikelihoodProblem& problem, const Place& at, const std::vector<Index>& free,
              Index j, double h, SolverSummary& summary) {
    const Index i = free[j];
    Place up = at, down = at;
    up.x[i] = std::min(problem.upper[i], at.x[i] + h);
    down.x[i] = std::max(problem.lower[i], at.x[i] - h);
    const double apart = up.x[i] - down.x[i];
    if (!(apart > 0.0)) return false;
    if (!look_at(problem, up, summary) || !look_at(problem, down, summary)) return false;
    H.col(j) = (down.gradient - up.gradient)(free) / apart;
    return true;
  }

  VectorXd step_;  // by coordinate
};

// H scaled to unit diagonal, by its eigenvectors.
class Curvature {
 public:
  Curvature(const MatrixXd& H, const std::vector<Index>& free, const VectorXd& gradient)
      : free_(free), scale_(H.rows()) {
    const double least = 1e-30 * std::max(1e-300, H.diagonal().cwiseAbs().maxCoeff());
    for (Index i = 0; i < H.rows(); ++i) {
      scale_[i] = 1.0 / std::sqrt(std::max(std::abs(H(i, i)), least));
    }
    eigen_.compute(scale_.asDiagonal() * H * scale_.asDiagonal());
    const VectorXd h = eigen_.eigenvalues();
    const double floor = kFlat * std::max(1e-300, h.cwiseAbs().maxCoeff());
    root_ = h.cwiseAbs().cwiseMax(floor).cwiseSqrt();
    along_ = (eigen_.eigenvectors().transpose() * scale_.cwiseProduct(gradient(free)))
                 .cwiseQuotient(root_);
    is_maximum_ = h.minCoeff() > -floor;
  }

  // The gain of the full step, by the quadratic.
  double expected_gain() const { return 0.5 * along_.squaredNorm(); }
  bool is_maximum() const { return is_maximum_; }

  VectorXd step(Index size, double radius) const {
    const double length = along_.norm();
    const VectorXd t = (length > radius ? radius / length : 1.0) * along_;
    VectorXd out = VectorXd::Zero(size);
    out(free_) = scale_.cwiseProduct(eigen_.eigenvectors() * t.cwiseQuotient(root_));
    return out;
  }

 private:
  static constexpr double kFlat = 1e-12;

  std::vector<Index> free_;
  VectorXd scale_, root_, along_;  // along_: t of the full step, in standard deviations
  Eigen::SelfAdjointEigenSolver<MatrixXd> eigen_;
  bool is_maximum_ = false;
};

}  // namespace

Solution maximise_by_curvature(const LikelihoodProblem& problem, const VectorXd& start,
                               const SolverOptions& options) {
  constexpr double kLongest = 2.0, kShortest = 1e-8;  // standard deviations
  check_start(problem, start, "maximise_by_curvature");
  const auto begin = std::chrono::steady_clock::now();
  Solution out;
  out.x = start;
  SolverSummary& summary = out.summary;
  const auto finish = [&](Termination termination, const char* message) {
    summary.termination = termination;
    summary.message = message;
    return out;
  };
  Place at{start, {}, 0.0};
  if (!look_at(problem, at, summary)) {
    return finish(Termination::start_undefined, "the likelihood is undefined at the start");
  }
  summary.initial_objective = summary.objective = at.L;
  ObservedInformation information(start);
  double radius = kLongest;
  while (true) {
    const std::vector<Index> free = that_can_move(problem, at);
    if (free.empty()) return finish(Termination::converged, "nothing can move");
    if (!information.find(problem, at, free, summary)) {
      return finish(Termination::no_progress, "the likelihood is undefined beside the end");
    }
    const Curvature curvature(information.H, free, at.gradient);
    summary.expected_gain = curvature.expected_gain();
    const bool arrived =
        curvature.is_maximum() && summary.expected_gain < options.acceptable_decrement;
    if (curvature.is_maximum() && summary.expected_gain < options.decrement_tolerance) {
      return finish(Termination::converged, "the increase still expected is below the tolerance");
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    const bool late = spent.count() > options.max_seconds;
    if (late || summary.iterations >= options.max_iterations) {
      if (arrived) break;
      return late ? finish(Termination::time_limit, "the time limit was reached")
                  : finish(Termination::iteration_limit, "the iteration limit was reached");
    }
    Place next;
    bool gained = false;
    while (!gained && radius > kShortest) {
      const VectorXd step = curvature.step(start.size(), radius);
      next.x = (at.x + step).cwiseMax(problem.lower).cwiseMin(problem.upper);
      gained = look_at(problem, next, summary) && next.L > at.L;
      radius *= gained ? 4.0 : 0.25;
    }
    if (!gained) {
      if (arrived) break;
      return finish(Termination::no_progress, "no step increases the likelihood");
    }
    radius = std::min(kLongest, radius);
    at = std::move(next);
    out.x = at.x;
    summary.objective = at.L;
    ++summary.iterations;
    if (options.progress && !options.progress(summary.iterations, at.L)) {
      return finish(Termination::stopped, "stopped by the caller");
    }
  }
  return finish(Termination::converged, "the increase still expected is negligible");
}

}  // namespace identikal
