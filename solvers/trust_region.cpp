#include "solvers/trust_region.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include <Eigen/Eigenvalues>

#include "solvers/covariance.h"
#include "solvers/internal/matrix_root.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNoCurvature = 1e-15;         // eigenvalues of a matrix of unit diagonal
constexpr double kLeastShare = 1e-4;           // of the promised reduction, of a step that is taken
constexpr double kSmallest = 1e-15;            // radius, over |D x|
constexpr double kVanished = 1e-12;            // curvature, over the largest that it has been
constexpr double kRadii[] = {1.0, 0.1, 10.0};  // at the start, over |D x|

// S over what it was at the start, halved and times n, with its slope and curvature.
struct Squares {
  VectorXd x, slope;
  MatrixXd curvature;
  double L = 0.0, value = 0.0;
};

class TrustRegion {
 public:
  /// @param samples       0: the noise is known, and what is minimised is -L itself
  /// @param first_radius  over |D x|
  TrustRegion(const LikelihoodProblem& problem, double samples, double first_radius)
      : problem_(problem), samples_(samples), first_radius_(first_radius) {}

  Solution run(const VectorXd& start, const SolverOptions& options) {
    Solution out;
    out.x = start;
    SolverSummary& summary = out.summary;
    const auto finish = [&](Termination termination, const char* message) {
      summary.termination = termination;
      summary.message = message;
      return out;
    };
    Squares at;
    summary.evaluations = 1;
    if (!evaluate(start, at)) {
      return finish(Termination::start_undefined, "the likelihood is undefined at the start");
    }
    summary.initial_objective = summary.objective = at.L;
    scale_ = VectorXd::Zero(start.size());
    double radius = -1.0;
    while (true) {
      const VectorXd now = at.curvature.diagonal().cwiseMax(0.0).cwiseSqrt();
      scale_ = scale_.cwiseMax(now);
      const VectorXd weight = now.cwiseProduct(at.x.cwiseAbs());
      largest_weight_ = first_look() ? weight : VectorXd(largest_weight_.cwiseMax(weight));
      vanished_ = (weight.array() < std::sqrt(kVanished) * largest_weight_.array()).any();
      const VectorXd D = (scale_.array() > 0.0).select(scale_, 1.0);
      const double size = D.cwiseProduct(at.x).norm();
      const bool first = radius < 0.0;
      if (first) radius = first_radius_ * (size > 0.0 ? size : 1.0);
      const VectorXd step = boxed_step(at, D, radius);
      const double length = D.cwiseProduct(step).norm();
      if (first) radius = std::min(radius, length);
      const double promised = -at.slope.dot(step) - 0.5 * step.dot(at.curvature * step);
      summary.expected_gain = is_known() ? promised : promised / at.value * 0.5 * samples_;
      const bool rounded = promised < 0.0 && -summary.expected_gain > options.decrement_tolerance;
      if (rounded && radius > kSmallest * size) {
        // What the curvature hardly tells is lost in rounding: a shorter step is not.
        radius = 0.1 * std::min(radius, length);
        continue;
      }
      if (!(summary.expected_gain > options.decrement_tolerance)) {
        if (cut_) return finish(Termination::no_progress, "no step increases the likelihood");
        return finish(Termination::converged, "the increase still expected is below the tolerance");
      }
      if (!(radius > kSmallest * size)) {
        return finish(Termination::no_progress, "no step increases the likelihood");
      }
      if (summary.iterations >= options.max_iterations) {
        return finish(Termination::iteration_limit, "the iteration limit was reached");
      }
      ++summary.iterations;
      ++summary.evaluations;
      Squares next;
      const bool defined = evaluate(at.x + step, next);
      const double came = defined ? at.value - next.value : -1.0;
      if (came < 0.25 * promised) {
        const bool near = defined && (is_known() || next.value < 100.0 * at.value);
        radius = (near ? 0.5 : 0.1) * std::min(radius, 10.0 * length);
      } else if (came > 0.75 * promised) {
        radius = 2.0 * length;
      }
      if (!(came > kLeastShare * promised)) continue;
      at = std::move(next);
      out.x = at.x;
      summary.objective = at.L;
      if (options.progress && !options.progress(summary.iterations, at.L)) {
        return finish(Termination::stopped, "stopped by the caller");
      }
    }
  }

  /// Has a coordinate lost what it did? Then the end may be a plateau, where the slope is nothing
  /// because the model is.
  bool is_on_plateau() const { return vanished_; }

 private:
  bool is_known() const { return samples_ == 0.0; }

  bool evaluate(const VectorXd& x, Squares& out) {
    out.x = x.cwiseMax(problem_.lower).cwiseMin(problem_.upper);
    if (!problem_.evaluate(out.x, out.L, &out.slope, &out.curvature) || !std::isfinite(out.L)) {
      return false;
    }
    if (!begun_) begin_ = out.L;
    begun_ = true;
    const double squares = is_known() ? 1.0 : std::exp(-2.0 * (out.L - begin_) / samples_);
    out.value = is_known() ? begin_ - out.L : 0.5 * samples_ * squares;
    out.slope *= -squares;
    out.curvature *= squares;
    return std::isfinite(out.value) && out.slope.allFinite() && out.curvature.allFinite();
  }

  bool first_look() const { return largest_weight_.size() == 0; }

  // (curvature + lambda D^2)^-1 (-slope) on these coordinates, for several lambda.
  class DampedSystem {
   public:
    DampedSystem(const MatrixXd& curvature, const VectorXd& slope, const VectorXd& D,
                 const std::vector<Index>& free)
        : curvature_(curvature), slope_(slope), free_(free), squares_(D.cwiseAbs2()) {
      if (static_cast<Index>(free.size()) > kManyUnknowns)
        roots_.emplace(curvature, free, squares_);
    }

    VectorXd step(double lambda) {
      if (roots_) {
        if (auto out = roots_->solve(-slope_, lambda)) return *out;
      }
      return along_axes(lambda);
    }

   private:
    VectorXd along_axes(double lambda) const {
      MatrixXd M = curvature_(free_, free_);
      M.diagonal() += lambda * VectorXd(squares_(free_));
      VectorXd by = M.diagonal().cwiseMax(0.0).cwiseSqrt();
      by = (by.array() > 0.0).select(by.cwiseInverse(), 0.0);
      const Eigen::SelfAdjointEigenSolver<MatrixXd> axes(by.asDiagonal() * M * by.asDiagonal());
      VectorXd along = axes.eigenvectors().transpose() * -by.cwiseProduct(VectorXd(slope_(free_)));
      const double floor = kNoCurvature * std::max(1e-300, axes.eigenvalues().maxCoeff());
      for (Index i = 0; i < along.size(); ++i) {
        const double value = axes.eigenvalues()[i];
        along[i] = value > floor ? along[i] / value : 0.0;
      }
      VectorXd out = VectorXd::Zero(slope_.size());
      out(free_) = by.cwiseProduct(VectorXd(axes.eigenvectors() * along));
      return out;
    }

    const MatrixXd& curvature_;
    VectorXd slope_;
    std::vector<Index> free_;
    VectorXd squares_;
    std::optional<DampedRoots> roots_;
  };

  // The smallest lambda whose step stays within the radius, to a tenth.
  static double damping(DampedSystem& system, const MatrixXd& curvature, const VectorXd& D,
                        double radius) {
    const auto length = [&](double lambda) { return D.cwiseProduct(system.step(lambda)).norm(); };
    if (length(0.0) <= 1.1 * radius) return 0.0;
    const double largest =
        std::max(1e-300, curvature.diagonal().cwiseQuotient(D.cwiseAbs2()).maxCoeff());
    double low = std::log(largest) - 80.0, high = std::log(largest) + 40.0;
    while (high - low > 1e-3) {
      const double middle = 0.5 * (low + high), there = length(std::exp(middle));
      (there > radius ? low : high) = middle;
      if (there <= radius && there > 0.9 * radius) break;
    }
    return std::exp(high);
  }

  // Coordinates that would leave the box stop at it, and the others are solved for again.
  VectorXd boxed_step(const Squares& at, const VectorXd& D, double radius) {
    std::vector<Index> free;
    for (Index i = 0; i < at.x.size(); ++i) {
      const bool held = (at.x[i] <= problem_.lower[i] && at.slope[i] >= 0.0) ||
                        (at.x[i] >= problem_.upper[i] && at.slope[i] <= 0.0);
      if (!held) free.push_back(i);
    }
    VectorXd stopped = VectorXd::Zero(at.x.size());
    if (free.empty()) return stopped;
    std::optional<DampedSystem> system(std::in_place, at.curvature, at.slope, D, free);
    const double lambda = damping(*system, at.curvature, D, radius);
    cut_ = lambda > 0.0;
    while (!free.empty()) {
      const VectorXd step = system->step(lambda);
      std::vector<Index> within;
      for (const Index i : free) {
        const double to = std::clamp(at.x[i] + step[i], problem_.lower[i], problem_.upper[i]);
        if (to == at.x[i] + step[i]) {
          within.push_back(i);
        } else {
          stopped[i] = to - at.x[i];
        }
      }
      if (within.size() == free.size()) return step + stopped;
      free = within;
      system.emplace(at.curvature, at.slope + at.curvature * stopped, D, free);
    }
    return stopped;
  }

  const LikelihoodProblem& problem_;
  const double samples_, first_radius_;
  double begin_ = 0.0;
  bool begun_ = false, vanished_ = false, cut_ = false;
  VectorXd largest_weight_;  // of the coordinates: what moving by all of themselves would change
  VectorXd scale_;           // D
};

Solution best_of_radii(const LikelihoodProblem& problem, const VectorXd& start, double samples,
                       const SolverOptions& options) {
  if (problem.lower.size() != start.size() || problem.upper.size() != start.size()) {
    throw std::invalid_argument("trust region: start and bounds differ in size");
  }
  if ((start.array() < problem.lower.array()).any() ||
      (start.array() > problem.upper.array()).any()) {
    throw std::invalid_argument("trust region: the start lies outside the bounds");
  }
  Solution best;
  SolverOptions left = options;
  for (const double radius : kRadii) {
    TrustRegion search(problem, samples, radius);
    Solution found = search.run(start, left);
    const bool stopped = found.summary.termination == Termination::stopped;
    left.max_iterations -= found.summary.iterations;
    found.summary.iterations += best.summary.iterations;
    found.summary.evaluations += best.summary.evaluations;
    const bool better = found.summary.objective > best.summary.objective;
    if (best.x.size() > 0 && !better && !stopped) {
      best.summary.iterations = found.summary.iterations;
      best.summary.evaluations = found.summary.evaluations;
    } else {
      best = std::move(found);
    }
    if (stopped || !search.is_on_plateau() || left.max_iterations <= 0) break;
  }
  return best;
}

}  // namespace

Solution maximise_from_afar(const LikelihoodProblem& problem, const VectorXd& start, double samples,
                            const SolverOptions& options) {
  if (!(samples > 0.0)) throw std::invalid_argument("maximise_from_afar: no samples");
  return best_of_radii(problem, start, samples, options);
}

Solution maximise_of_known_noise(const LikelihoodProblem& problem, const VectorXd& start,
                                 const SolverOptions& options) {
  return best_of_radii(problem, start, 0.0, options);
}

}  // namespace identikal
