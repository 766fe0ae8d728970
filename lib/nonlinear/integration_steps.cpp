#include "lib/nonlinear/integration_steps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <list>
#include <stdexcept>
#include <utility>

#include "lib/base/constants.h"
#include "lib/base/median.h"
#include "lib/base/message.h"
#include "lib/nonlinear/internal/sigma_points.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kFew = 16;  // where nothing says how many would do

// The inputs of one interval in any number of steps. A smooth curve between two samples depends on
// one neighbour on either side (lib/base/interpolation.h), so that four samples make it.
class OneInterval {
 public:
  OneInterval(const VectorXd& time, const MatrixXd& u, InputPath path, Index k)
      : begin_(std::max<Index>(k - 1, 0)), at_(k - begin_), path_(path) {
    const Index count = std::min<Index>(k + 3, time.size()) - begin_;
    time_ = time.segment(begin_, count);
    u_ = u.middleCols(begin_, count);
    steps_.assign(static_cast<std::size_t>(count - 1), 1);
  }
  const InputNodes& in_steps(int count) {
    for (const auto& [steps, nodes] : known_) {
      if (steps == count) return nodes;
    }
    steps_[at_] = count;
    known_.emplace_back(count, input_nodes(time_, u_, path_, steps_));
    return known_.back().second;
  }
  Index at() const { return at_; }

 private:
  Index begin_, at_;
  InputPath path_;
  VectorXd time_;
  MatrixXd u_;
  std::vector<int> steps_;
  std::list<std::pair<int, InputNodes>> known_;  // of more than one point
};

// By how much x differs from the finer one, against the tolerance's measure.
double relative_change(const VectorXd& x, const VectorXd& finer, const VectorXd& least) {
  double out = 0.0;
  for (Index i = 0; i < x.size(); ++i) {
    const double difference = std::abs(x[i] - finer[i]);
    if (difference == 0.0) continue;
    out = std::max(out, difference / std::max(std::abs(finer[i]), least[i]));
  }
  return x.allFinite() ? out : kInfinity;
}

// Where one interval's motion has settled, and in how many steps.
struct Settled {
  StepStatus status = StepStatus::ok;
  int steps = 1;
  double by = 0.0;  // changed by twice as many
  VectorXd end;     // of those; empty where nobody needs it
};

// Doubles the steps until that changes nothing. Where the changes fall as those of a smooth motion
// do, to a sixteenth by every doubling, they tell how many it takes. Through a jump in the rates no
// sensible number of steps would do, and a few are taken.
class Settling {
 public:
  Settling(const NonlinearModel& model, ModelMemory& memory, OneInterval& interval,
           const VectorXd& x, const VectorXd& least, const StepTolerance& tolerance)
      : model_(model),
        memory_(memory),
        interval_(interval),
        x_(x),
        least_(least),
        tolerance_(tolerance) {}

  Settled run(bool needs_end) {
    begin_at(1);
    while (!(out_.by <= tolerance_.relative) && 2 * out_.steps <= tolerance_.most) {
      if (is_smooth() && foresee(needs_end)) return out_;
      // A smooth motion's change falls by 4096 with eight times the steps, that through a jump by 8.
      constexpr double kSlow = 1e-2, kNear = 1e-2;
      double_steps();
      if (before_[0] > kNear || !(out_.by > kSlow * before_[0])) continue;
      begin_at(std::min(out_.steps, kFew));
      break;
    }
    if (!out_.end.allFinite() || !coarse_.allFinite()) {
      out_.status = StepStatus::not_finite;
    } else if (!(out_.by <= tolerance_.relative)) {
      out_.status = StepStatus::capped;
    }
    return out_;
  }

 private:
  VectorXd moved(int steps) {
    VectorXd end = x_;
    step(model_, memory_, interval_.in_steps(steps), interval_.at(), end);
    return end;
  }
  void begin_at(int steps) {
    out_.steps = steps;
    coarse_ = moved(steps);
    out_.end = moved(2 * steps);
    out_.by = relative_change(coarse_, out_.end, least_);
  }
  void double_steps() {
    before_ = {before_[1], before_[2], out_.by};
    out_.steps *= 2;
    coarse_ = std::move(out_.end);
    out_.end = moved(2 * out_.steps);
    out_.by = relative_change(coarse_, out_.end, least_);
  }
  bool is_smooth() const {
    constexpr double kLeast = 11.0, kMost = 23.0;
    const auto falls = [](double before, double by) {
      return std::isfinite(before) && before > kLeast * by && before < kMost * by;
    };
    return falls(before_[1], before_[2]) && falls(before_[2], out_.by);
  }
  // @return are there as many steps as it takes? Not where it is a close thing.
  bool foresee(bool needs_end) {
    constexpr double kFall = 16.0, kClose = 1.4;
    int steps = out_.steps;
    double by = out_.by;
    for (; !(by <= tolerance_.relative); by /= kFall) steps *= 2;
    const bool close =
        by * kClose > tolerance_.relative || by * kFall < kClose * tolerance_.relative;
    if (close || steps > tolerance_.most) return false;
    out_.steps = steps;
    out_.by = by;
    out_.end = needs_end ? moved(2 * steps) : VectorXd();
    return out_.end.allFinite();
  }

  const NonlinearModel& model_;
  ModelMemory& memory_;
  OneInterval& interval_;
  const VectorXd &x_, &least_;
  const StepTolerance& tolerance_;
  Settled out_;
  VectorXd coarse_;                                                // with half as many as out_.end
  std::array<double, 3> before_{kInfinity, kInfinity, kInfinity};  // by 1/8, 1/4, 1/2 of the steps
};

void check_tolerance(const StepTolerance& tolerance) {
  const bool possible = tolerance.most >= 1 && tolerance.most <= kMostSteps;
  if (tolerance.relative > 0.0 && tolerance.floor > 0.0 && possible) return;
  throw std::invalid_argument(
      message({"integration_steps: tolerance ", tolerance.relative, " with floor ", tolerance.floor,
               " in ", tolerance.most, " steps at most"}));
}

void note(IntegrationSteps& out, StepStatus status, Index sample) {
  if (status <= out.status) return;
  out.status = status;
  out.sample = sample;
}

// The interval whose states were last looked at all around, by which those behind it are judged: where
// twice as many steps changed next to nothing there, and neither the interval nor what is uncertain
// is larger, the middle alone tells whether that is still so.
class LookedAround {
 public:
  bool speaks_for(Index sample, double interval, const MatrixXd& P, double tolerance) const {
    return sample < sample_ + kFor && by_ <= kNothing * tolerance &&
           interval <= kLonger * interval_ &&
           (P.diagonal().array() <= kMoreUncertain * spread_.array()).all();
  }
  static bool is_nothing(const Settled& settled, double tolerance) {
    return settled.steps == 1 && settled.by <= kNothing * tolerance;
  }
  void set(Index sample, double interval, const MatrixXd& P, double by) {
    sample_ = sample;
    interval_ = interval;
    spread_ = P.diagonal();
    by_ = by;
  }

 private:
  static constexpr Index kFor = 16;  // intervals
  static constexpr double kNothing = 1e-2, kLonger = 1.05, kMoreUncertain = 1.5;
  Index sample_ = -kFor;
  double interval_ = 0.0, by_ = kInfinity;
  VectorXd spread_;
};

// The usual interval between samples; there are two samples or more.
double median_interval(const VectorXd& time) {
  std::vector<double> all;
  for (Index k = 0; k + 1 < time.size(); ++k) all.push_back(time[k + 1] - time[k]);
  return median(std::move(all));
}

}  // namespace

const char* describe(StepStatus status) {
  switch (status) {
    case StepStatus::ok:
      return "the steps are fine enough";
    case StepStatus::capped:
      return "the model changes faster than the steps allowed between two samples can follow";
    case StepStatus::not_finite:
      return "the state grows beyond all numbers, or a function leaves its domain";
  }
  return "";
}

IntegrationSteps integration_steps(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                                   const Eigen::Ref<const VectorXd>& x0, const VectorXd& time,
                                   const MatrixXd& u, InputPath path,
                                   const StepTolerance& tolerance) {
  const Index N = time.size();
  check_tolerance(tolerance);
  if (p.size() != model.parameters || x0.size() != model.states || u.rows() != model.inputs ||
      u.cols() != N) {
    throw std::invalid_argument(
        message({"integration_steps: ", p.size(), " parameters, ", x0.size(), " states, u ",
                 u.rows(), " x ", u.cols(), " at ", N, " times; the model has ", model.parameters,
                 " parameters, ", model.states, " states and ", model.inputs, " inputs"}));
  }
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  IntegrationSteps out;
  const auto intervals = static_cast<std::size_t>(std::max<Index>(N - 1, 0));
  if (!model.continuous) {
    out.steps.assign(intervals, 1);
    return out;
  }
  // How large the states get is known at the end only: the second run measures by what the first
  // one found.
  VectorXd largest = x0.cwiseAbs();
  for (const bool again : {false, true}) {
    out = {};
    VectorXd x = x0;
    for (Index k = 0; k + 1 < N; ++k) {
      OneInterval interval(time, u, path, k);
      const VectorXd least = tolerance.floor * largest;
      const Settled settled = Settling(model, memory, interval, x, least, tolerance).run(true);
      if (settled.status == StepStatus::not_finite) {
        return {StepStatus::not_finite, k, {}, settled.by};
      }
      note(out, settled.status, k);
      out.steps.push_back(settled.steps);
      out.largest_change = std::max(out.largest_change, settled.by);
      x = settled.end;
      if (!again) largest = largest.cwiseMax(x.cwiseAbs());
    }
  }
  return out;
}

IntegrationSteps integration_steps(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                                   const FilterNoise& noise, const VectorXd& time,
                                   const MatrixXd& u, InputPath path,
                                   const Eigen::Ref<const MatrixXd>& y,
                                   const NonlinearFilterOptions& options,
                                   const StepTolerance& tolerance) {
  constexpr int kRounds = 8;
  check_tolerance(tolerance);
  const Index N = time.size(), nx = model.states;
  IntegrationSteps out;
  out.steps.assign(static_cast<std::size_t>(std::max<Index>(N - 1, 0)), 1);
  if (!model.continuous || N < 2) return out;
  ModelMemory memory = make_memory(model);
  const double usual = median_interval(time);
  const Stack none(nx * nx, 0);
  Stack no_jacobian = none;
  MatrixXd L = MatrixXd::Zero(nx, nx);
  std::vector<int> steps = out.steps;
  for (int round = 0; round < kRounds; ++round) {
    const FilterResult filter =
        nonlinear_filter(model, p, noise, input_nodes(time, u, path, steps), y, options);
    set_parameters(model, memory, p);
    VectorXd largest = VectorXd::Zero(nx);
    for (Index k = 0; k < N; ++k) {
      if (filter.x_filt.col(k).allFinite()) {
        largest = largest.cwiseMax(filter.x_filt.col(k).cwiseAbs());
      }
    }
    out = {};
    bool grown = false;
    LookedAround looked;
    for (Index k = 0; k + 1 < N; ++k) {
      const auto interval = static_cast<std::size_t>(k);
      const VectorXd middle = filter.x_filt.col(k);
      if (!middle.allFinite() || !filter.x_pred.col(k + 1).allFinite()) break;
      // Where the state is certain, noise on the way moves it.
      const MatrixXd P = filter.P_filt[interval] + filter.P_pred[interval + 1];
      const double length = time[k + 1] - time[k];
      OneInterval inputs(time, u, path, k);
      StepTolerance here = tolerance;
      here.most = static_cast<int>(
          std::min<double>(kMostSteps, tolerance.most * std::max(1.0, length / usual)));
      const VectorXd size = largest.cwiseMax(P.diagonal().cwiseMax(0.0).cwiseSqrt());
      const Settled at_middle = Settling(model, memory, inputs, middle, size, here).run(false);
      note(out, at_middle.status, k);
      int needed = at_middle.steps;
      double by = at_middle.by;
      // Sigma points are themselves the states around.
      const bool known = options.method != NonlinearMethod::unscented &&
                         looked.speaks_for(k, length, P, here.relative) &&
                         LookedAround::is_nothing(at_middle, here.relative);
      if (!known && set_covariance_factor(P, none, L, no_jacobian) != FilterStatus::ok) break;
      for (Index point = 0; !known && point < 2 * nx; ++point) {
        if (L.col(point % nx).isZero(0.0)) continue;  // the middle itself
        const VectorXd x = middle + (point < nx ? 1.0 : -1.0) * L.col(point % nx);
        const Settled settled = Settling(model, memory, inputs, x, size, here).run(false);
        // What a point far out does is the filter's affair, where it comes to it.
        if (settled.status == StepStatus::not_finite) continue;
        note(out, settled.status, k);
        needed = std::max(needed, settled.steps);
        by = std::max(by, settled.by);
      }
      out.largest_change = std::max(out.largest_change, by);
      if (!known) looked.set(k, length, P, needed == 1 ? by : kInfinity);
      grown = grown || needed > steps[interval];
      steps[interval] = std::max(steps[interval], needed);
    }
    if (filter.status != FilterStatus::ok && !grown) {
      // Nothing says where it would need more: a few everywhere.
      for (int& count : steps) {
        if (2 * count > std::min(tolerance.most, kFew)) continue;
        count *= 2;
        grown = true;
      }
    }
    if (!grown) break;
  }
  out.steps = steps;
  return out;
}

}  // namespace identikal
