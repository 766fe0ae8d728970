// A model that is another one at every sample.
#include <algorithm>
#include <stdexcept>

#include "lib/filter/internal/tangent_filter.h"

namespace identikal {

using Eigen::Index;

// Of a model that changes, what the model is now.
void TangentFilter::take_sample(bool motion_changes) {
  const std::vector<StateSpace>& by = *derivatives_;
  const auto has_size = [this](const StateSpace& m) {
    return m.states() == n_ && m.outputs() == ny_ && m.inputs() == nu_;
  };
  if (!has_size(*model_) || !std::all_of(by.begin(), by.end(), has_size)) {
    throw std::invalid_argument("kalman filter: the sizes of the model change with time");
  }
  if (motion_changes) {
    fill_A();
    fill_common();
    return;
  }
  diagonal_R_ = model_->R.isDiagonal(0.0);
  bool moves_output = false;
  for (const StateSpace& d : by) {
    diagonal_R_ = diagonal_R_ && d.R.isDiagonal(0.0);
    moves_output = moves_output || !d.C.isZero(0.0);
  }
  if (moves_output && !dynamics_) fill_common();
}

FilterStatus TangentFilter::run_changing(const Changing& changing,
                                         const TangentRecording& recording, InitialState initial,
                                         Likelihood& out) {
  StateSpace now;
  std::vector<StateSpace> by;
  std::vector<StateSpace>* const wanted = changing.with_derivatives ? &by : nullptr;
  changing.model(0, now, wanted);
  take_channels(recording.presence);
  prepare(now, by);
  changing_ = true;
  find_structure();
  fill_A();
  FilterStatus status = begin(initial);
  scored_ = out.gradient;
  for (const Presence::Part& part : recording.presence.parts) {
    Pattern& p = patterns_[part.pattern];
    for (Index t = part.begin; t < part.end && status == FilterStatus::ok; ++t) {
      if (t > 0) {
        changing.model(t, now, wanted);
        take_sample(changing.motion_changes);
      }
      fill_pattern(p, channels_[part.pattern]);
      Index at = t;
      if (diffuse_) {
        status = run_diffuse(p, recording, at, t + 1, out);
      } else if (step(p, recording, at, t + 1) == simd::TangentEnd::indefinite) {
        status = FilterStatus::indefinite;
      } else {
        add_score_product(recording, out);
        if (recording.watcher != nullptr) show_filtered(p, t, false, *recording.watcher);
      }
    }
  }
  if (status != FilterStatus::ok) return status;
  if (diffuse_) return FilterStatus::undetermined;
  add_sums(out);
  return FilterStatus::ok;
}

}  // namespace identikal
