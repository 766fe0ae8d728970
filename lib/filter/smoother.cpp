#include "lib/filter/smoother.h"

#include <algorithm>
#include <deque>
#include <memory>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/internal/segment.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What does not depend on y, shared by all samples of one gain.
struct Gain {
  MatrixXd P_filt, M, F, information;
};

struct SmoothedStep {
  Index t;
  std::shared_ptr<const Gain> gain;
  MatrixXd Z_filt, score;
};

SmoothedStep step_of(const FilterStep& seen, const SmoothedStep* before) {
  SmoothedStep out{seen.t, nullptr, seen.Z_filt, seen.score};
  out.gain = seen.same_gain && before != nullptr
                 ? before->gain
                 : std::make_shared<Gain>(Gain{seen.P_filt, seen.M, seen.F, seen.information});
  return out;
}

// What is known of delta.
struct Delta {
  VectorXd mean;
  MatrixXd covariance;
};

// false: not enough is known of it.
bool estimate_delta(const FilterStep& seen, Delta& delta) {
  if (seen.delta_information.size() == 0) return true;
  if (determined_share(seen.delta_information, seen.delta_scale) < kDetermined) return false;
  const Eigen::LLT<MatrixXd> llt(seen.delta_information);
  if (llt.info() != Eigen::Success) return false;
  delta.mean = -llt.solve(seen.delta_score);
  delta.covariance = llt.solve(MatrixXd::Identity(delta.mean.size(), delta.mean.size()));
  return true;
}

// r and N: what the samples that were taken in, the last one first, say of the state before them.
class Adjoint {
 public:
  explicit Adjoint(Index n) : R_(MatrixXd::Zero(n, 1)), N_(MatrixXd::Zero(n, n)) {}

  void take_in(const SmoothedStep& step) {
    const bool same_gain = step.gain == gain_;
    gain_ = step.gain;
    move_r(step);
    kept_ = same_gain && settled_;
    if (kept_) return;
    const Gain& gain = *step.gain;
    MatrixXd N = gain.information;
    N.noalias() += gain.F.transpose() * N_ * gain.F;
    N = 0.5 * (N + N.transpose()).eval();
    const VectorXd size = N.diagonal().cwiseSqrt();
    settled_ = ((N - N_).array().abs() <= 1e-14 * (size * size.transpose()).array()).all();
    N_.swap(N);
  }

  // r alone, where N is not requested.
  void move_r(const SmoothedStep& step) {
    widen(step.score.cols());
    next_.noalias() = step.gain->F.transpose() * R_;
    next_.leftCols(step.score.cols()) += step.score;
    R_.swap(next_);
  }

  // Column at step.t of the result. `again`: the covariance is that of the column placed before.
  void place(const SmoothedStep& step, const Delta& delta, bool again, SmootherResult& out) {
    const Gain& gain = *step.gain;
    const Index d = step.Z_filt.cols() - 1;
    widen(d + 1);
    MatrixXd Z = step.Z_filt;
    Z.noalias() += gain.M * R_.leftCols(d + 1);
    out.x.col(step.t) = Z.col(0);
    if (d > 0) out.x.col(step.t) += Z.rightCols(d) * delta.mean;
    if (!again || P_.size() == 0) {
      P_ = gain.P_filt;
      P_.noalias() -= gain.M * N_ * gain.M.transpose();
      if (d > 0) P_.noalias() += Z.rightCols(d) * delta.covariance * Z.rightCols(d).transpose();
      P_ = 0.5 * (P_ + P_.transpose()).eval();
      sd_ = P_.diagonal().cwiseMax(0.0).cwiseSqrt();
    }
    out.sd.col(step.t) = sd_;
    if (!out.P.empty()) out.P[step.t] = P_;
  }

  // N and the gain of this sample are those of the one placed before.
  bool unchanged(const SmoothedStep& step) const { return kept_ && step.gain == gain_; }

  void restart() {
    R_.setZero(R_.rows(), 1);
    N_.setZero();
    gain_ = nullptr;
    settled_ = kept_ = false;
  }

 private:
  // Samples after the last trace of delta have one column; the responses are zero there.
  void widen(Index columns) {
    const Index had = R_.cols();
    if (columns <= had) return;
    R_.conservativeResize(Eigen::NoChange, columns);
    R_.rightCols(columns - had).setZero();
  }

  MatrixXd R_, N_, next_, P_;
  VectorXd sd_;
  std::shared_ptr<const Gain> gain_;  // of the sample taken in last
  bool settled_ = false, kept_ = false;
};

SmootherResult empty_result(Index n, Index N, SmootherKeep keep) {
  SmootherResult out;
  out.x = MatrixXd::Constant(n, N, kNaN);
  out.sd = out.x;
  if (keep == SmootherKeep::covariances) {
    out.P.assign(static_cast<std::size_t>(N), MatrixXd::Constant(n, n, kNaN));
  }
  return out;
}

void conclude(SmootherResult& out, const Likelihood& likelihood) {
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
}

// The record, shown in blocks from the end.
class IntervalSmoother {
 public:
  IntervalSmoother(Index n, Index N, SmootherKeep keep)
      : result(empty_result(n, N, keep)), adjoint_(n) {}

  void see(const FilterStep& seen) {
    block_.push_back(step_of(seen, block_.empty() ? nullptr : &block_.back()));
    if (seen.t + 1 == result.x.cols()) estimate_delta(seen, delta_);
  }

  void end_of_block() {
    for (std::size_t i = block_.size(); i-- > 0;) {
      const SmoothedStep& step = block_[i];
      adjoint_.place(step, delta_, adjoint_.unchanged(step) && step.Z_filt.cols() == 1, result);
      adjoint_.take_in(step);
    }
    block_.clear();
  }

  SmootherResult result;

 private:
  std::deque<SmoothedStep> block_;
  Adjoint adjoint_;
  Delta delta_;
};

// The record as it goes by.
class LagSmoother {
 public:
  LagSmoother(Index n, Index N, Index lag, SmootherKeep keep)
      : result(empty_result(n, N, keep)), lag_(std::min(lag, N)), adjoint_(n) {}

  void see(const FilterStep& seen) {
    window_.push_back(step_of(seen, window_.empty() ? nullptr : &window_.back()));
    // The covariance is that of the sample before once the gain has not changed since then.
    unchanged_ = seen.same_gain && seen.Z_filt.cols() == 1 ? unchanged_ + 1 : 0;
    const bool last = seen.t + 1 == result.x.cols();
    if (!last && static_cast<Index>(window_.size()) <= lag_) return;
    const bool determined = window_.front().Z_filt.cols() == 1 || estimate_delta(seen, delta_);
    const bool again = unchanged_ > lag_ + 1 && placed_;
    adjoint_.restart();
    for (std::size_t i = window_.size(); i-- > 0;) {
      const SmoothedStep& step = window_[i];
      if (determined && (i == 0 || last)) {
        adjoint_.place(step, delta_, i == 0 && again && !last, result);
        placed_ = true;
      }
      if (i == 0) break;
      if (again && !last) {
        adjoint_.move_r(step);
      } else {
        adjoint_.take_in(step);
      }
    }
    window_.pop_front();
  }

  SmootherResult result;

 private:
  Index lag_, unchanged_ = 0;
  bool placed_ = false;
  std::deque<SmoothedStep> window_;
  Adjoint adjoint_;
  Delta delta_;
};

Index states_of(const StateSpace& model) { return model.states(); }
Index states_of(const ModelAt& model) {
  StateSpace first;
  model(0, first, nullptr);
  return first.states();
}

template <typename Model>
SmootherResult smooth_at_lag(const Model& model, InitialState initial,
                             const Eigen::Ref<const MatrixXd>& y,
                             const Eigen::Ref<const MatrixXd>& u, Index lag, SmootherKeep keep) {
  if (lag < 0) {
    throw std::invalid_argument("smooth_with_lag: the lag is " + std::to_string(lag) +
                                ", it must not be negative");
  }
  LagSmoother smoother(states_of(model), y.cols(), lag, keep);
  conclude(smoother.result,
           watch_filter(model, initial, y, u, [&](const FilterStep& step) { smoother.see(step); }));
  return std::move(smoother.result);
}

}  // namespace

SmootherResult smooth(const StateSpace& model, InitialState initial,
                      const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                      SmootherKeep keep) {
  IntervalSmoother smoother(model.states(), y.cols(), keep);
  conclude(smoother.result,
           watch_backwards(
               model, initial, y, u, [&](const FilterStep& step) { smoother.see(step); },
               [&] { smoother.end_of_block(); }));
  return std::move(smoother.result);
}

SmootherResult smooth(const ModelAt& model, InitialState initial,
                      const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                      SmootherKeep keep) {
  IntervalSmoother smoother(states_of(model), y.cols(), keep);
  conclude(smoother.result,
           watch_filter(model, initial, y, u, [&](const FilterStep& step) { smoother.see(step); }));
  if (smoother.result.status == FilterStatus::ok) smoother.end_of_block();
  return std::move(smoother.result);
}

SmootherResult smooth_with_lag(const StateSpace& model, InitialState initial,
                               const Eigen::Ref<const MatrixXd>& y,
                               const Eigen::Ref<const MatrixXd>& u, Index lag, SmootherKeep keep) {
  return smooth_at_lag(model, initial, y, u, lag, keep);
}

SmootherResult smooth_with_lag(const ModelAt& model, InitialState initial,
                               const Eigen::Ref<const MatrixXd>& y,
                               const Eigen::Ref<const MatrixXd>& u, Index lag, SmootherKeep keep) {
  return smooth_at_lag(model, initial, y, u, lag, keep);
}

}  // namespace identikal
