#include "solvers/scoring.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include <Eigen/Eigenvalues>

#include "solvers/covariance.h"
#include "solvers/curvature_correction.h"
#include "solvers/internal/likelihood_start.h"
#include "solvers/internal/matrix_root.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct Point {
  VectorXd x, gradient;
  MatrixXd information;
  double L = 0.0;
};

// Coordinates that may move: not at a bound, or at one with the gradient pointing inside.
// @param held  besides those at a bound
std::vector<Index> free_coordinates(const LikelihoodProblem& problem, const Point& at,
                                    const std::vector<Index>& held) {
  std::vector<Index> out;
  for (Index i = 0; i < at.x.size(); ++i) {
    const bool at_bound = (at.x[i] <= problem.lower[i] && at.gradient[i] <= 0.0) ||
                          (at.x[i] >= problem.upper[i] && at.gradient[i] >= 0.0);
    if (!at_bound && std::find(held.begin(), held.end(), i) == held.end()) out.push_back(i);
  }
  return out;
}

constexpr double kNoInformation = 1e-13;  // eigenvalues of the scaled system over the largest

// The information on the given coordinates, scaled to unit diagonal: by its eigenvectors, or, of many
// unknowns, by a triangular root where that exists.
class ScaledSystem {
 public:
  // @param information  outlives it
  ScaledSystem(const MatrixXd& information, const std::vector<Index>& free)
      : information_(information), free_(free), scale_(static_cast<Index>(free.size())) {
    for (Index i = 0; i < scale_.size(); ++i) {
      const double d = information(free[i], free[i]);
      scale_[i] = d > 0.0 ? 1.0 / std::sqrt(d) : 0.0;
    }
    if (scale_.size() > kManyUnknowns) roots_.emplace(information, free, information.diagonal());
  }

  // (J + lambda diag J)^-1 g on the coordinates, zero elsewhere. Directions without information get
  // no step: eigenvalues below `least` of the largest are left out.
  VectorXd damped_step(const VectorXd& gradient, double lambda, double least = kNoInformation) {
    if (scale_.size() == 0) return VectorXd::Zero(gradient.size());
    if (roots_) {
      if (auto step = roots_->solve(gradient, lambda)) return *step;
    }
    return step_along_axes(gradient, lambda, least);
  }

  // The gain that the quadratic expects of the full step along directions of at least this
  // information.
  double expected_gain(const VectorXd& gradient, double least) {
    return 0.5 * gradient.dot(damped_step(gradient, 0.0, least));
  }

 private:
  VectorXd step_along_axes(const VectorXd& gradient, double lambda, double least) {
    if (!has_axes_) find_axes();
    VectorXd step = VectorXd::Zero(gradient.size());
    const double floor = least * std::max(1e-300, eigen_.eigenvalues().maxCoeff());
    const VectorXd g = scale_.cwiseProduct(VectorXd(gradient(free_)));
    VectorXd rotated = eigen_.eigenvectors().transpose() * g;
    for (Index i = 0; i < rotated.size(); ++i) {
      const double value = eigen_.eigenvalues()[i];
      rotated[i] = value > floor ? rotated[i] / (value + lambda) : 0.0;
    }
    const VectorXd d = eigen_.eigenvectors() * rotated;
    for (Index i = 0; i < d.size(); ++i) step[free_[i]] = scale_[i] * d[i];
    return step;
  }

  void find_axes() {
    const Index m = scale_.size();
    MatrixXd J(m, m);
    for (Index i = 0; i < m; ++i) {
      for (Index j = 0; j < m; ++j) {
        J(i, j) = information_(free_[i], free_[j]) * scale_[i] * scale_[j];
      }
    }
    eigen_.compute(J);
    has_axes_ = true;
  }

  const MatrixXd& information_;
  std::vector<Index> free_;
  VectorXd scale_;
  std::optional<DampedRoots> roots_;
  Eigen::SelfAdjointEigenSolver<MatrixXd> eigen_;
  bool has_axes_ = false;
};

constexpr double kFarther = 1e6;  // times itself

// Those of the coordinates that still matter. One that may grow without limit (a rate so fast that
// only its being fast is seen) does not, once all of itself more or less changes L by less than this.
std::vector<Index> that_matter(const LikelihoodProblem& problem, const Point& at,
                               std::vector<Index> free, double change) {
  std::erase_if(free, [&](Index i) {
    const double size = std::abs(at.x[i]);
    return problem.lower[i] >= 0.0 && std::isinf(problem.upper[i]) &&
           kFarther * std::abs(at.gradient[i]) * size < change &&
           at.information(i, i) * size * size < change;
  });
  return free;
}

// Coordinates that no longer matter, back towards where they began as far as that changes L by less
// than this: where they have run to, rounding may be all that the others' slopes say.
// @param rest  of the free coordinates, those that matter
// @return those that are held where they are from here on
std::vector<Index> brought_back(const LikelihoodProblem& problem, const VectorXd& start,
                                const std::vector<Index>& free, const std::vector<Index>& rest,
                                double change, Point& at) {
  constexpr int kMost = 8;  // halves of the way, by logarithm
  std::vector<Index> out;
  for (const Index i : free) {
    if (std::find(rest.begin(), rest.end(), i) != rest.end()) continue;
    out.push_back(i);
    for (int k = 0; k < kMost && start[i] > 0.0 && at.x[i] > start[i]; ++k) {
      Point back = at;
      back.x[i] = std::sqrt(start[i] * at.x[i]);
      const bool defined = problem.evaluate(back.x, back.L, &back.gradient, &back.information);
      if (!defined || !(std::abs(back.L - at.L) < change)) break;
      at = std::move(back);
    }
  }
  return out;
}

// The step that stays in the box: coordinates that would leave it stop at the bound and the others
// are solved again without them.
// @param information  and the system of it on the free coordinates
VectorXd boxed_step(const LikelihoodProblem& problem, const Point& at, std::vector<Index> free,
                    const MatrixXd& information, ScaledSystem& system, double lambda) {
  VectorXd stopped = VectorXd::Zero(at.x.size());
  VectorXd step = system.damped_step(at.gradient, lambda);
  while (true) {
    std::vector<Index> still_free;
    for (const Index i : free) {
      const double to = at.x[i] + step[i];
      if (to < problem.lower[i]) {
        stopped[i] = problem.lower[i] - at.x[i];
      } else if (to > problem.upper[i]) {
        stopped[i] = problem.upper[i] - at.x[i];
      } else {
        still_free.push_back(i);
      }
    }
    if (still_free.size() == free.size()) return step + stopped;
    free = still_free;
    if (free.empty()) return stopped;
    step = ScaledSystem(information, free).damped_step(at.gradient - information * stopped, lambda);
  }
}

constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();
constexpr double kNearby = 1.0;     // gain of a step, in units of log-likelihood
constexpr double kNothing = 1e-10;  // gain that no digits of the likelihood tell
constexpr double kLittle = 1.0;     // damping that is tried where a search has all but ended

// What became of one step.
struct Trial {
  Point next;
  double gain = 0.0, predicted = 0.0;
  bool accepted = false;
  bool good = false;       // the step may be damped less
  bool stalled = false;    // nothing moved any more
  double overshoot = 0.0;  // how far the likelihood falls again behind it: the slopes' ratio
};

// The step by the logarithms of what cannot be negative, where it would make it less: scoring is as
// right there, and a variance that is decades too large comes down by factors instead of to zero.
VectorXd shrunk(const LikelihoodProblem& problem, const VectorXd& x, VectorXd step) {
  constexpr double kFarthest = 6.0;
  for (Index i = 0; i < x.size(); ++i) {
    if (problem.lower[i] != 0.0 || !(x[i] > 0.0) || !(step[i] < 0.0)) continue;
    step[i] = x[i] * std::expm1(std::max(step[i] / x[i], -kFarthest));
  }
  return step;
}

// The share of the step between two points at which the likelihood is highest, by the cubic through
// values and slopes; zero where that is none to go to.
double highest_between(const Point& from, const Point& to) {
  if (!std::isfinite(to.L) || !to.gradient.allFinite()) return 0.0;
  const VectorXd way = to.x - from.x;
  const double g0 = -from.gradient.dot(way), g1 = -to.gradient.dot(way);
  const double d1 = g0 + g1 + 3.0 * (to.L - from.L);
  const double root = d1 * d1 - g0 * g1;
  if (!(root >= 0.0) || !(g0 < 0.0)) return 0.0;
  const double d2 = std::sqrt(root);
  const double share = 1.0 - (g1 + d2 - d1) / (g1 - g0 + 2.0 * d2);
  return share < 0.9 ? share : 0.0;
}

bool is_inside(const LikelihoodProblem& problem, const VectorXd& x) {
  return (x.array() > problem.lower.array()).all() && (x.array() < problem.upper.array()).all();
}

// @param factor  how many times as far: the gain of the step itself is what is predicted
Trial try_step(const LikelihoodProblem& problem, const Point& at, const MatrixXd& curvature,
               const VectorXd& step, double factor) {
  Trial out;
  Point& next = out.next;
  const double predicted = at.gradient.dot(step) - 0.5 * step.dot(curvature * step);
  out.predicted = predicted;
  next.x = (at.x + factor * step).cwiseMax(problem.lower).cwiseMin(problem.upper);
  const VectorXd moved = next.x - at.x;
  if (!problem.evaluate(next.x, next.L, &next.gradient, &next.information) ||
      !std::isfinite(next.L)) {
    next.L = kUndefined;
    return out;
  }
  // Near the maximum the increase drowns in the rounding of L; then the gradient decides.
  const double rounding = 1e-14 * (1.0 + std::abs(at.L));
  out.gain = next.L - at.L;
  // A bound ends a step before its highest place, and slopes there say nothing about that.
  if (is_inside(problem, next.x)) {
    out.overshoot = -next.gradient.dot(moved) / at.gradient.dot(moved);
  }
  const bool small = predicted < 1e3 * rounding && out.gain > -1e3 * rounding;
  // Far from the maximum the quadratic overrates a good step by orders of magnitude (a variance
  // much too small), so a gain that counts in units of log-likelihood is enough.
  out.accepted =
      predicted > -1e3 * rounding && (out.gain > 1e-4 * std::min(predicted, 1.0) || small);
  out.good = small || out.gain > 0.5 * std::min(predicted, 1.0);
  out.stalled = small && moved.cwiseAbs().maxCoeff() == 0.0;
  return out;
}

// The gains of the last steps.
class RecentGains {
 public:
  void add(double gain) { gains_[steps_++ % kSteps] = gain; }
  // Did a row of steps bring less than this together?
  bool are_below(double limit) const {
    return steps_ >= kSteps && std::accumulate(gains_.begin(), gains_.end(), 0.0) < limit;
  }

 private:
  static constexpr std::size_t kSteps = 8;
  std::array<double, kSteps> gains_{};
  std::size_t steps_ = 0;
};

// How far a step goes: less far behind one that did not gain or went past the likelihood's highest
// place along it, and farther behind several in a row that gained more than they promised.
class Damping {
 public:
  double lambda = 0.0;  // added to the information
  double factor = 1.0;  // times the step

  void learn(const Trial& trial) {
    if (trial.good) lambda = lambda < 1e-3 ? 0.0 : lambda / 8.0;
    const bool short_of = trial.gain > kMoreThanPromised * trial.predicted && lambda == 0.0;
    in_a_row_ = short_of ? in_a_row_ + 1 : 0;
    if (trial.overshoot > kPast) {
      factor = std::max(kShortest, std::min(1.0, factor) / (1.0 + trial.overshoot));
    } else if (factor < 1.0) {
      factor = trial.gain < kNearby ? 1.0 : std::min(1.0, 2.0 * factor);
    } else {
      factor = in_a_row_ >= kInARow ? std::min(2.0 * factor, kLongest) : 1.0;
    }
  }
  void shorten() {
    if (factor <= 1.0) lambda = std::max(1e-2, 4.0 * lambda);
    factor = 1.0;
  }

 private:
  static constexpr double kMoreThanPromised = 1.3, kLongest = 64.0;
  static constexpr double kPast = 0.5, kShortest = 0.1;
  static constexpr int kInARow = 3;
  int in_a_row_ = 0;
};

// Of a step that did not gain: the share of it at which the likelihood is highest, or, where it falls
// at once, as with a variance that comes to nothing, the step by factors.
std::optional<Trial> amended_step(const LikelihoodProblem& problem, const Point& at,
                                  const MatrixXd& curvature, VectorXd step, const Trial& failed,
                                  Damping& damping, SolverSummary& summary) {
  constexpr double kLeast = 0.1;  // of the way, or of the step
  if (damping.factor > 1.0) return std::nullopt;
  double factor = damping.factor * highest_between(at, failed.next);
  const bool shorter = factor > kLeast * damping.factor;
  if (!shorter) {
    const VectorXd by_factors = shrunk(problem, at.x, step);
    const double change = (by_factors - step).cwiseAbs().maxCoeff();
    if (!(change > kLeast * step.cwiseAbs().maxCoeff())) return std::nullopt;
    step = by_factors;
    factor = 1.0;
  }
  const Trial trial = try_step(problem, at, curvature, step, factor);
  ++summary.evaluations;
  if (!trial.accepted) return std::nullopt;
  if (shorter) damping.factor = factor;
  return trial;
}

// A step that gains, shortened until it does; nothing where that takes more than `most`.
std::optional<Trial> accepted_step(const LikelihoodProblem& problem, const Point& at,
                                   const MatrixXd& curvature,
                                   const std::function<VectorXd()>& damped_step, double most,
                                   Damping& damping, SolverSummary& summary) {
  bool first = true;
  do {
    const VectorXd step = damped_step();
    Trial trial = try_step(problem, at, curvature, step, damping.factor);
    ++summary.evaluations;
    if (trial.accepted) return trial;
    if (most <= kLittle && trial.predicted < kNothing) return std::nullopt;
    std::optional<Trial> other;
    if (first) other = amended_step(problem, at, curvature, step, trial, damping, summary);
    if (other) return other;
    first = false;
    damping.shorten();
  } while (damping.lambda <= most);
  return std::nullopt;
}

// A step that changes some coordinate by a large share of itself.
bool is_far(const VectorXd& from, const VectorXd& to) {
  constexpr double kShare = 0.5;
  return ((to - from).array().abs() > kShare * from.array().abs()).any();
}

}  // namespace

Solution maximise(const LikelihoodProblem& problem, const VectorXd& start,
                  const SolverOptions& options) {
  check_start(problem, start, "maximise");
  const auto begin = std::chrono::steady_clock::now();
  Solution out;
  out.x = start;
  SolverSummary& summary = out.summary;
  const auto finish = [&](Termination termination, const char* message) {
    summary.termination = termination;
    summary.message = message;
    return out;
  };

  Point at;
  at.x = start;
  summary.evaluations = 1;
  if (!problem.evaluate(at.x, at.L, &at.gradient, &at.information) || !std::isfinite(at.L)) {
    return finish(Termination::start_undefined, "the likelihood is undefined at the start");
  }
  summary.initial_objective = summary.objective = at.L;
  if (start.size() == 0) return finish(Termination::converged, "nothing is free");

  const double acceptable = options.acceptable_decrement > 0.0 ? options.acceptable_decrement
                                                               : 1e3 * options.decrement_tolerance;
  Damping damping;
  CurvatureCorrection correction(MatrixXd::Zero(start.size(), start.size()));
  RecentGains recent;
  std::vector<Index> held;
  // What is learnt has no zeros, and its root would cost more than the steps that it saves.
  const bool learns = start.size() <= kManyUnknowns || !has_many_zeros(at.information);
  while (true) {
    const std::vector<Index> free = free_coordinates(problem, at, held);
    ScaledSystem system(at.information, free);
    summary.expected_gain = system.expected_gain(at.gradient, kNoInformation);
    const std::optional<MatrixXd> learnt =
        correction.is_empty() ? std::nullopt : correction.apply(at.information, free);
    const MatrixXd& information = learnt ? *learnt : at.information;
    std::optional<ScaledSystem> of_learnt;
    ScaledSystem& corrected = learnt ? of_learnt.emplace(*learnt, free) : system;
    if (summary.expected_gain <= options.decrement_tolerance) {
      // A step that gains nothing worth an evaluation, but digits of x.
      if (corrected.expected_gain(at.gradient, kNoInformation) <
          std::min(kNothing, options.decrement_tolerance)) {
        const VectorXd last = boxed_step(problem, at, free, information, corrected, 0.0);
        out.x = (at.x + last).cwiseMax(problem.lower).cwiseMin(problem.upper);
      }
      return finish(Termination::converged, "the increase still expected is below the tolerance");
    }
    // What is not determined has no maximum to be away from.
    summary.expected_gain = std::max(system.expected_gain(at.gradient, options.flat),
                                     corrected.expected_gain(at.gradient, options.flat));
    const bool arrived = summary.expected_gain < acceptable;
    const auto end_short = [&](Termination termination, const char* message) {
      if (!arrived) return finish(termination, message);
      return finish(Termination::converged, "the increase still expected is negligible");
    };
    if (arrived && recent.are_below(acceptable)) return end_short(Termination::no_progress, "");
    if (summary.iterations >= options.max_iterations) {
      return end_short(Termination::iteration_limit, "the iteration limit was reached");
    }
    const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
    if (spent.count() > options.max_seconds) {
      return end_short(Termination::time_limit, "the time limit was reached");
    }

    const auto step = [&] {
      return boxed_step(problem, at, free, information, corrected, damping.lambda);
    };
    const bool corrects = learnt.has_value();
    if (corrects) damping.factor = std::max(1.0, damping.factor);  // it knows the step's length
    // But what has been learnt from afar may mislead.
    const bool may_mislead = corrects && system.expected_gain(at.gradient, options.flat) > kNearby;
    const double most_damping = may_mislead ? 0.0 : arrived ? kLittle : 1e12;
    std::optional<Trial> trial =
        accepted_step(problem, at, information, step, most_damping, damping, summary);
    if (!trial && may_mislead) {
      correction.forget();
      damping.lambda = 0.0;
      continue;
    }
    if (!trial) {
      const std::vector<Index> rest = that_matter(problem, at, free, acceptable);
      if (!rest.empty() &&
          ScaledSystem(at.information, rest).expected_gain(at.gradient, options.flat) <
              acceptable) {
        return finish(Termination::converged, "the increase still expected is negligible");
      }
      if (held.empty() && !rest.empty() && rest.size() < free.size()) {
        held = brought_back(problem, start, free, rest, 0.01 * acceptable, at);
        damping = {};
        correction.forget();
        out.x = at.x;
        summary.objective = at.L;
        continue;
      }
      return end_short(Termination::no_progress, "no step increases the likelihood");
    }
    damping.learn(*trial);
    const bool far = !options.learn_from_afar || is_far(at.x, trial->next.x);
    if (trial->gain > kNearby && far) {
      correction.forget();
    } else if (learns) {
      const Point& next = trial->next;
      correction.learn(next.x - at.x, at.gradient - next.gradient, next.information);
    }
    recent.add(trial->gain);
    at = std::move(trial->next);
    out.x = at.x;
    summary.objective = at.L;
    if (trial->stalled) return finish(Termination::converged, "the step is below rounding");
    ++summary.iterations;
    if (options.progress && !options.progress(summary.iterations, at.L)) {
      return finish(Termination::stopped, "stopped by the caller");
    }
  }
}

}  // namespace identikal
