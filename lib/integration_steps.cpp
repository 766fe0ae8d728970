#include "lib/integration_steps.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "lib/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The inputs of one interval in any number of steps. A smooth curve between two samples depends on
// one neighbour on either side (lib/interpolation.h), so that four samples make it.
class OneInterval {
 public:
  OneInterval(const VectorXd& time, const MatrixXd& u, InputPath path, Index k)
      : begin_(std::max<Index>(k - 1, 0)), at_(k - begin_), path_(path) {
    const Index count = std::min<Index>(k + 3, time.size()) - begin_;
    time_ = time.segment(begin_, count);
    u_ = u.middleCols(begin_, count);
    steps_.assign(static_cast<std::size_t>(count - 1), 1);
  }
  InputNodes in_steps(int count) {
    steps_[static_cast<std::size_t>(at_)] = count;
    return input_nodes(time_, u_, path_, steps_);
  }
  Index at() const { return at_; }

 private:
  Index begin_, at_;
  InputPath path_;
  VectorXd time_;
  MatrixXd u_;
  std::vector<int> steps_;
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
  if (p.size() != model.parameters || x0.size() != model.states || u.rows() != model.inputs ||
      u.cols() != N || !(tolerance.relative > 0.0) || !(tolerance.floor > 0.0) ||
      tolerance.most < 1) {
    std::ostringstream text;
    text << "integration_steps: " << p.size() << " parameters, " << x0.size() << " states, u "
         << u.rows() << " x " << u.cols() << " at " << N << " times, tolerance "
         << tolerance.relative << " with floor " << tolerance.floor << " in " << tolerance.most
         << " steps at most; the model has " << model.parameters << " parameters, " << model.states
         << " states and " << model.inputs << " inputs";
    throw std::invalid_argument(text.str());
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
      const auto moved = [&](int steps) {
        VectorXd end = x;
        step(model, memory, interval.in_steps(steps), interval.at(), end);
        return end;
      };
      int steps = 1;
      VectorXd end = moved(1), finer = moved(2);
      double by = relative_change(end, finer, tolerance.floor * largest);
      while (!(by <= tolerance.relative) && 2 * steps <= tolerance.most) {
        steps *= 2;
        end = finer;
        finer = moved(2 * steps);
        by = relative_change(end, finer, tolerance.floor * largest);
      }
      if (!finer.allFinite() || !end.allFinite()) return {StepStatus::not_finite, k, {}, by};
      if (!(by <= tolerance.relative) && out.status == StepStatus::ok) {
        out.status = StepStatus::capped;
        out.sample = k;
      }
      out.steps.push_back(steps);
      out.largest_change = std::max(out.largest_change, by);
      x = finer;
      if (!again) largest = largest.cwiseMax(x.cwiseAbs());
    }
  }
  return out;
}

}  // namespace identikal
