// The part of a recording without gaps, and what evaluates the likelihood over it in one go.
// Internal to the filter.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/segment_autocovariances.h"
#include "lib/model/linear_model.h"

namespace identikal {

/// The innovations of a filter with some fixed gain that forgets: x+ = A x + B u + K0 e0 from a
/// start that fits. Those of any other gain are a stable filter of them,
///
///   d+ = (A - K C) d + (K - K0) e0,  e = e0 - C d,
///
/// with d the difference of the states; and they stay small where outputs drift away.
struct NominalInnovations {
  StateSpace model;             ///< A, B, C, D that the filter ran with
  Eigen::MatrixXd gain;         ///< K0, n x ny
  Eigen::VectorXd start, end;   ///< its states before and behind the segment
  SegmentAutocovariances sums;  ///< of e0
};

/// A gapless segment as [y; u], without its mean where that is large: there the last channel is 1.
struct Segment {
  Eigen::Index begin = 0;
  Eigen::VectorXd mean;  ///< ny + nu; empty when it was left in
  SegmentAutocovariances sums;
  /// Lane-interleaved outputs (lib/filter/internal/simd_kernels.h) behind one zero; made when first
  /// needed.
  std::vector<double> lanes;
  /// Made where the sums above would lose digits.
  std::optional<NominalInnovations> nominal;

  Eigen::Index samples() const { return sums.samples(); }
};

/// That of samples begin .. begin + length - 1, all present.
Segment make_segment(const Eigen::MatrixXd& y, const Eigen::MatrixXd& u, Eigen::Index begin,
                     Eigen::Index length);

/// Makes enough sums for a filter that forgets after `memory` samples: 64, 128, ...
void extend_sums(SegmentAutocovariances& sums, Eigen::Index memory);

/// Do outputs of this model drift away?
bool drifts(const StateSpace& model);

/// Prediction of the state at some sample, with derivatives.
struct FilterState {
  Eigen::VectorXd x;
  Eigen::MatrixXd P;
  std::vector<Eigen::VectorXd> x_theta;
  std::vector<Eigen::MatrixXd> P_theta;
};

/// Why a kernel did not add a segment.
enum class RejectReason {
  none,
  cancellation,  ///< it would cost more digits than the result may lose, or the start is undefined
  known_start,   ///< the start is known so much better than a steady filter knows it that the same
                 ///< would happen, and the information would be wrong
};

/// The constant-gain filter of one model over any number of segments.
class SegmentKernel {
 public:
  virtual ~SegmentKernel() = default;

  /// Solves for the constant gain and its derivatives; keeps references. false: there is none, or
  /// it forgets no earlier than after `longest` samples.
  virtual bool prepare(const StateSpace& model, const std::vector<StateSpace>& derivatives,
                       Eigen::Index longest) = 0;
  /// Whether prepare() gave up because of `longest`.
  virtual bool slow() const = 0;
  /// n x ny: the constant gain.
  virtual Eigen::MatrixXd gain() const = 0;
  /// Samples after which the filter has forgotten, to rounding.
  virtual Eigen::Index memory() const = 0;
  /// Largest absolute eigenvalue of F = A - K C.
  virtual double pole() const = 0;

  /// Adds value, gradient and information of a segment, which must be longer than memory() and have
  /// its sample autocovariances extended to it; without the constant
  /// -(samples - diffuse)/2 log 2 pi. Nominal innovations are used where there are any and nothing
  /// but noise has a derivative; they must be those of the model's A, B, C, D.
  /// @return false where reject_reason() then says why; nothing is added.
  virtual bool add_from_model(const Segment& segment, InitialState initial, Likelihood& out) = 0;
  virtual bool add_from_state(const Segment& segment, const FilterState& state,
                              Likelihood& out) = 0;
  /// Of the last segment.
  virtual RejectReason reject_reason() const = 0;
  /// The state after the segment that was added last.
  virtual void end_of_segment(const Segment& segment, FilterState& state) = 0;
};

std::unique_ptr<SegmentKernel> make_segment_kernel(Eigen::Index states);

}  // namespace identikal
