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
  VectorXd end;     // of those
};

// Doubles the steps until that changes nothing. Through a jump in the rates no sensible number of
// steps would do, and a few are taken.
Settled settle(const NonlinearModel& model, ModelMemory& memory, OneInterval& interval,
               const VectorXd& x, const VectorXd& least, const StepTolerance& tolerance) {
  // A smooth motion's change falls by 4096 with eight times the steps, that through a jump by 8.
  constexpr double kSlow = 1e-2, kNear = 1e-2;
  const auto moved = [&](int steps) {
    VectorXd end = x;
    step(model, memory, interval.in_steps(steps), interval.at(), end);
    return end;
  };
  Settled out;
  VectorXd end = moved(1);
  out.end = moved(2);
  out.by = relative_change(end, out.end, least);
  std::array<double, 3> before{kInfinity, kInfinity, kInfinity};  // by 1/8, 1/4, 1/2 of the steps
  while (!(out.by <= tolerance.relative) && 2 * out.steps <= tolerance.most) {
    before = {before[1], before[2], out.by};
    out.steps *= 2;
    end = out.end;
    out.end = moved(2 * out.steps);
    out.by = relative_change(end, out.end, least);
    if (before[0] > kNear || !(out.by > kSlow * before[0])) continue;
    out.steps = std::min(out.steps, kFew);
    end = moved(out.steps);
    out.end = moved(2 * out.steps);
    out.by = relative_change(end, out.end, least);
    break;
  }
  if (!out.end.allFinite() || !end.allFinite()) {
    out.status = StepStatus::not_finite;
  } else if (!(out.by <= tolerance.relative)) {
    out.status = StepStatus::capped;
  }
  return out;
}

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
      const Settled settled =
          settle(model, memory, interval, x, tolerance.floor * largest, tolerance);
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
      const Settled at_middle = settle(model, memory, inputs, middle, size, here);
      note(out, at_middle.status, k);
      int needed = at_middle.steps;
      double by = at_middle.by;
      // Sigma points are themselves the states around.
      const bool known = options.method != NonlinearMethod::unscented &&
                         looked.speaks_for(k, length, P, here.relative) &&
                         LookedAround::is_nothing(at_middle, here.relative);
      if (!known && set_covariance_factor(P, none, L, no_jacobian) != FilterStatus::ok) break;
      for (Index point = 0; !known && point < 2 * nx; ++point) {
        const VectorXd x = middle + (point < nx ? 1.0 : -1.0) * L.col(point % nx);
        const Settled settled = settle(model, memory, inputs, x, size, here);
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
