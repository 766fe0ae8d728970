// What of a stationary recording does a constant-gain filter ever need? Its sample autocovariances,
// and its first and last samples.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Sums of the sample autocovariances of one gapless segment z(0..N-1), continued with zeros on
/// both sides:
///
///   Gamma_m = sum_{t=m}^{N-1} z(t) z(t-m)',   m = 0, 1, ..., lags - 1.
///
/// They are computed once, at close to the speed of the processor's multipliers, and extended when
/// a filter with a longer memory asks for more.
class SegmentAutocovariances {
 public:
  /// @param z  channels x N; the sums keep a copy, one channel after the other
  explicit SegmentAutocovariances(const Eigen::Ref<const Eigen::MatrixXd>& z);
  /// Of samples that are no longer there: the first and last of them, and their sums.
  /// @param head, tail  channels x kept, kept <= N / 2     @param sums  lags of channels x channels
  SegmentAutocovariances(const Eigen::Ref<const Eigen::MatrixXd>& head,
                         const Eigen::Ref<const Eigen::MatrixXd>& tail, Eigen::Index samples,
                         std::vector<double> sums);

  /// Makes at least `lags` sums available, at most N, and where the samples are no longer there none
  /// beyond those that are.
  void extend_to(Eigen::Index lags);

  Eigen::Index lags() const { return lags_; }
  Eigen::Index samples() const { return samples_; }
  Eigen::Index channels() const { return channels_; }
  double sample(Eigen::Index channel, Eigen::Index t) const {
    return channel_major_[channel * kept_ + (t < gap_ ? t : t - absent_)];
  }
  /// channels x channels
  Eigen::Map<const Eigen::MatrixXd> at(Eigen::Index m) const {
    return {sums_.data() + m * channels_ * channels_, channels_, channels_};
  }

 private:
  Eigen::Index channels_, samples_, lags_ = 0;
  Eigen::Index kept_, gap_, absent_ = 0;  ///< samples kept; from gap_ on absent_ are not
  std::vector<double> channel_major_;     ///< kept samples of the first channel, then of the next
  std::vector<double> sums_;
};

}  // namespace identikal
