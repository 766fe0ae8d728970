#include "identify/noise/internal/interval_end.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <Eigen/Cholesky>

#include "solvers/curvature_correction.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What the observed information has beyond the expected one, as far as it differs as at the maximum.
MatrixXd excess_at(const Profiled& at) {
  if (at.excess.rows() != at.information.rows()) {
    return MatrixXd::Zero(at.information.rows(), at.information.cols());
  }
  const VectorXd scale = at.information.diagonal().cwiseMax(0.0).cwiseSqrt();
  return scale.asDiagonal() * at.excess * scale.asDiagonal();
}

// A place that an end is searched from.
struct Place {
  VectorXd x, gradient;
  MatrixXd information;
  double L = 0.0;
};

// In which form of the coordinate the root of the drop is near to linear: that of a variance in its
// logarithm where it is well known, in its cube root where it may all but vanish.
enum class EndForm { plain, cube_root, logarithm };

EndForm form_of(const Profiled& at, Index j, double first) {
  const double value = at.x[j];
  if (at.problem.lower[j] != 0.0 || !(value > 0.0)) return EndForm::plain;
  return std::abs(first) < 0.8 * value ? EndForm::logarithm : EndForm::cube_root;
}

// Where a step comes to that is as long as `step` where it begins, and straight in that form.
double moved(EndForm form, double from, double step) {
  const double share = step / from;
  if (form == EndForm::plain || !(from > 0.0)) return from + step;
  if (form == EndForm::logarithm) return from * std::exp(std::min(share, 1.0));
  const double root = std::max(0.0, 1.0 + share / 3.0);
  return from * root * root * root;
}

// The step that comes there.
double step_between(EndForm form, double from, double to) {
  if (form == EndForm::logarithm) return from * std::log(to / from);
  if (form == EndForm::cube_root) return 3.0 * from * (std::cbrt(to / from) - 1.0);
  return to - from;
}

// What one evaluation says about the profile: how the others move to their maximum and what they
// gain there, how far the profile has fallen there, and its slope.
struct Glimpse {
  VectorXd move;
  double drop = 0.0, slope = 0.0, gain = 0.0;
};

// Where a profile reaches its end, by Newton's method on the coordinate and the others at once
// (Venzon and Moolgavkar 1988, Appl. Statist. 37): one evaluation a step, where searching at every
// value takes several. The observed information is the one that the maximum is known to have,
// and what the gradients since say about it.
class EndSearch {
 public:
  // @param target  the root of twice the drop there
  // @param linear  that root is near to linear in the coordinate; else the drop
  // @param opposite  where the other end is, or null
  EndSearch(const Profiled& at, double first, double target, bool linear, const VectorXd* opposite)
      : at_(at),
        i_(at.i),
        sign_(first < 0.0 ? -1.0 : 1.0),
        target_(target),
        linear_(linear),
        form_(form_of(at, at.i, first)),
        correction_(excess_at(at)),
        here_{at.x, VectorXd::Zero(at.x.size()), at.information, at.L},
        inside_(at.x[at.i]) {
    first_move_ = first_move(first, opposite);
    step_ = first_move_[i_];
  }

  // Nothing where that does not come to an end soon.
  std::optional<VectorXd> run() {
    constexpr int kMost = 25;
    constexpr double kShortest = 0.01, kLongest = 64.0;
    double share = 1.0;  // of the move
    std::optional<VectorXd> move = first_move_;
    for (int k = 0; k < kMost && move; ++k) {
      if (!go(share * *move)) {
        share *= 0.25;
        if (share < kShortest) return std::nullopt;
        continue;
      }
      if (ends_at_bound()) return here_.x;
      const double before = gain_;
      const std::optional<Glimpse> seen = glimpse();
      if (!seen) return std::nullopt;
      const double left = missing(*seen);
      if (seen->gain <= kEnough && is_stopped(left)) return here_.x;
      const std::optional<double> step = next_step(*seen);
      if (!step) return std::nullopt;
      if (seen->gain <= kEnough && std::abs(left) < (linear_ ? kLastStep : kLastStepOfDrop)) {
        return end_after(*step);
      }
      // Others that go on alone with as much to gain as before lie along a valley.
      const bool crawls = step_ == 0.0 && *step == 0.0 && seen->gain > 0.5 * before;
      share = crawls ? std::min(2.0 * std::max(share, 1.0), kLongest) : 1.0;
      step_ = *step;
      move = step_ == 0.0 ? seen->move : move_with(step_);
    }
    return std::nullopt;
  }

 private:
  static constexpr double kEnough = 1e-3;    // of what the others have to gain: it is added
  static constexpr double kLastStep = 0.02;  // of the root: the step that is left misses its square
  static constexpr double kLastStepOfDrop = 0.005;  // from zero on a profile bends more
  static constexpr double kFar = 0.3;  // what they have to gain where the quadratic means little
  static constexpr double kSettled = 0.05;  // and where it need not shrink
  static constexpr double kSure = 0.02;     // what they may have to gain where a side is known
  static constexpr double kNearby = 1.0;    // log-likelihoods between which curvature is one

  double within(double value) const {
    return std::clamp(value, at_.problem.lower[i_], at_.problem.upper[i_]);
  }
  double bound() const { return sign_ < 0.0 ? at_.problem.lower[i_] : at_.problem.upper[i_]; }

  // Moves there, unless others that move alone lose by it, or the likelihood falls far below what
  // is sought.
  bool go(const VectorXd& move) {
    Place next;
    next.x = (here_.x + move).cwiseMax(at_.problem.lower).cwiseMin(at_.problem.upper);
    const bool defined = at_.problem.evaluate(next.x, next.L, &next.gradient, &next.information);
    if (!defined || !std::isfinite(next.L)) return false;
    constexpr double kTooFar = 4.0;
    const bool alone = next.x[i_] == here_.x[i_];
    if (alone ? next.L < here_.L
              : next.L < std::min(here_.L, at_.L - kTooFar * target_ * target_)) {
      return false;
    }
    correction_.scale(growth(here_.information, next.information));
    if (here_.L != at_.L && std::abs(next.L - here_.L) < kNearby) {
      correction_.learn(next.x - here_.x, here_.gradient - next.gradient, next.information);
    }
    here_ = std::move(next);
    return true;
  }

  // The others that are not held at a bound.
  std::vector<Index> free_others() const {
    std::vector<Index> out;
    for (Index k = 0; k < here_.x.size(); ++k) {
      const bool held = (here_.x[k] <= at_.problem.lower[k] && here_.gradient[k] <= 0.0) ||
                        (here_.x[k] >= at_.problem.upper[k] && here_.gradient[k] >= 0.0);
      if (k != i_ && !held && here_.information(k, k) > 0.0) out.push_back(k);
    }
    return out;
  }

  // How the others move to where the quadratic is largest once the coordinate has moved by `step`,
  // all of them within their bounds.
  std::optional<VectorXd> move_with(double step) const {
    VectorXd move = step * VectorXd::Unit(here_.x.size(), i_);
    std::vector<Index> free = free_others();
    const MatrixXd information = curvature();
    while (!free.empty()) {
      const Eigen::LDLT<MatrixXd> others(MatrixXd(information(free, free)));
      if (others.info() != Eigen::Success || !others.isPositive()) return std::nullopt;
      const VectorXd slope = here_.gradient - information * move;
      const VectorXd there = others.solve(VectorXd(slope(free)));
      if (!there.allFinite()) return std::nullopt;
      std::vector<Index> inside;
      for (Index k = 0; k < there.size(); ++k) {
        const Index j = free[static_cast<std::size_t>(k)];
        const double to = here_.x[j] + there[k];
        if (to < at_.problem.lower[j]) {
          move[j] = at_.problem.lower[j] - here_.x[j];
        } else if (to > at_.problem.upper[j]) {
          move[j] = at_.problem.upper[j] - here_.x[j];
        } else {
          inside.push_back(j);
        }
      }
      if (inside.size() == free.size()) {
        move(free) = there;
        break;
      }
      free = inside;
    }
    return move;
  }

  MatrixXd curvature() const {
    return correction_.apply(here_.information, free_others()).value_or(here_.information);
  }

  // Of every coordinate's size, as information has it.
  static VectorXd growth(const MatrixXd& before, const MatrixXd& after) {
    const auto grown = after.diagonal().cwiseMax(0.0).cwiseSqrt().eval();
    return (before.diagonal().array() > 0.0)
        .select(grown.cwiseQuotient(before.diagonal().cwiseMax(1e-300).cwiseSqrt()), 0.0);
  }

  std::optional<Glimpse> glimpse() const {
    const std::optional<VectorXd> move = move_with(0.0);
    if (!move) return std::nullopt;
    Glimpse out;
    out.move = *move;
    const VectorXd bent = curvature() * *move;
    out.gain = here_.gradient.dot(*move) - 0.5 * move->dot(bent);
    out.drop = at_.L - here_.L - out.gain;
    out.slope = here_.gradient[i_] - bent[i_];
    return out;
  }

  bool is_stopped(double missing) const { return here_.x[i_] == bound() && missing > 0.0; }

  double missing(const Glimpse& seen) const {
    return target_ - std::sqrt(2.0 * std::max(0.0, seen.drop));
  }

  // Of the coordinate; none where the others have to move alone first.
  std::optional<double> next_step(const Glimpse& seen) {
    const double left = missing(seen), value = here_.x[i_];
    const bool settling = seen.gain < kSettled || seen.gain < 0.8 * gain_;
    gain_ = seen.gain;
    if (seen.gain > kFar || !settling || is_stopped(left)) return 0.0;
    if (!(seen.drop > 0.0) || !(-sign_ * seen.slope > 0.0)) return std::nullopt;
    const double wanted = 0.5 * target_ * target_;
    // What the others still gain might decide on which side of the end this is.
    if (seen.gain < std::min(kSure, 0.1 * std::abs(seen.drop - wanted)))
      (left > 0.0 ? inside_ : outside_) = value;
    const double root = target_ - left;
    double step = (linear_ ? left * root : wanted - seen.drop) / -seen.slope;
    step = moved(form_, value, step) - value;
    // Between what is known to lie inside and outside, at most four times as far.
    const double reach = 4.0 * std::abs(value - at_.x[i_]);
    double next = value + std::clamp(step, -reach, reach);
    const bool past = sign_ * (next - inside_) <= 0.0 ||
                      (std::isfinite(outside_) && sign_ * (next - outside_) >= 0.0);
    if (past && std::isfinite(outside_)) next = 0.5 * (inside_ + outside_);
    return within(next) - value;
  }

  // The others can only gain there.
  bool ends_at_bound() const {
    return here_.x[i_] == bound() && at_.L - here_.L < 0.5 * target_ * target_;
  }

  // From the maximum by `first` of the coordinate, in the form of every number; where the other end
  // is known, the root of the drop and the others are parabolas through both.
  VectorXd first_move(double first, const VectorXd* opposite) const {
    constexpr double kWell = 1.5;  // times the value: what may well be zero is asked there
    const double value = at_.x[i_];
    const VectorXd along = along_with(i_, free_others(), curvature());
    const bool to_zero = form_ == EndForm::cube_root && -first > kWell * value;
    const double back = opposite != nullptr ? step_to(form_, i_, *opposite) : 0.0;
    const double step = back != 0.0 ? bent(first, std::abs(back)) : first;
    VectorXd move(at_.x.size());
    for (Index j = 0; j < move.size(); ++j) {
      const double line = along[j] * first;
      const EndForm form = j == i_ ? form_ : form_of(at_, j, line);
      const double behind = back != 0.0 && j != i_ ? step_to(form, j, *opposite) : 0.0;
      const double square = behind != 0.0 ? (behind - along[j] * back) / (back * back) : 0.0;
      const double to = moved(form, at_.x[j], along[j] * step + square * step * step);
      move[j] = std::clamp(to, at_.problem.lower[j], at_.problem.upper[j]) - at_.x[j];
    }
    if (to_zero) move[i_] = -value;
    return move;
  }

  // In the form of that number; zero where a bound decided.
  double step_to(EndForm form, Index j, const VectorXd& end) const {
    const bool bounded = end[j] <= at_.problem.lower[j] || end[j] >= at_.problem.upper[j];
    return bounded ? 0.0 : step_between(form, at_.x[j], end[j]);
  }

  // Where w / line + bend w^2 = 1 if it is -1 at -other. At most twice as far as a straight line has
  // it, and at least half as far.
  double bent(double first, double other) const {
    const double line = std::abs(first);
    const double bend = (1.0 / line - 1.0 / other) / other;
    const double root = std::sqrt(std::max(0.0, 1.0 / (line * line) + 4.0 * bend));
    return sign_ * std::clamp(2.0 / (1.0 / line + root), 0.5 * line, 2.0 * line);
  }

  VectorXd end_after(double step) const {
    VectorXd end = here_.x + move_with(step).value_or(step * VectorXd::Unit(here_.x.size(), i_));
    return end.cwiseMax(at_.problem.lower).cwiseMin(at_.problem.upper);
  }

  const Profiled& at_;
  Index i_;
  double sign_, target_;
  bool linear_;
  EndForm form_;
  CurvatureCorrection correction_;
  Place here_;
  VectorXd first_move_;
  double step_ = 0.0;
  double gain_ = std::numeric_limits<double>::infinity();  // of the others, before
  double inside_, outside_ = std::numeric_limits<double>::infinity();
};

}  // namespace

VectorXd along_with(Index i, const std::vector<Index>& free, const MatrixXd& information) {
  VectorXd out = VectorXd::Unit(information.rows(), i);
  if (free.empty()) return out;
  const Eigen::LDLT<MatrixXd> others(MatrixXd(information(free, free)));
  if (others.info() != Eigen::Success || !others.isPositive()) return out;
  const VectorXd along = -others.solve(VectorXd(information(free, i)));
  if (along.allFinite()) out(free) = along;
  return out;
}

std::optional<VectorXd> end_at_once(const Profiled& at, double first, double target, bool linear,
                                    const VectorXd* opposite) {
  return EndSearch(at, first, target, linear, opposite).run();
}

}  // namespace identikal
