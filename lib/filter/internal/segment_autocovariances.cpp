#include "lib/filter/internal/segment_autocovariances.h"

#include <algorithm>
#include <utility>

#include "lib/filter/internal/simd_kernels.h"

namespace identikal {

using Eigen::Index;

SegmentAutocovariances::SegmentAutocovariances(const Eigen::Ref<const Eigen::MatrixXd>& z)
    : channels_(z.rows()),
      samples_(z.cols()),
      kept_(z.cols()),
      gap_(z.cols()),
      channel_major_(static_cast<std::size_t>(z.size())) {
  Eigen::Map<Eigen::MatrixXd>(channel_major_.data(), samples_, channels_) = z.transpose();
}

SegmentAutocovariances::SegmentAutocovariances(const Eigen::Ref<const Eigen::MatrixXd>& head,
                                               const Eigen::Ref<const Eigen::MatrixXd>& tail,
                                               Index samples, std::vector<double> sums)
    : channels_(head.rows()),
      samples_(samples),
      lags_(static_cast<Index>(sums.size()) / (head.rows() * head.rows())),
      kept_(head.cols() + tail.cols()),
      gap_(head.cols()),
      absent_(samples - kept_),
      channel_major_(static_cast<std::size_t>(channels_ * kept_)),
      sums_(std::move(sums)) {
  Eigen::Map<Eigen::MatrixXd> all(channel_major_.data(), kept_, channels_);
  all.topRows(head.cols()) = head.transpose();
  all.bottomRows(tail.cols()) = tail.transpose();
}

void SegmentAutocovariances::extend_to(Index lags) {
  lags = std::min(lags, samples_);
  if (lags <= lags_ || absent_ > 0) return;
  sums_.resize(static_cast<std::size_t>(lags * channels_ * channels_), 0.0);
  // In pieces, each with the samples that follow it, zeros behind the last.
  constexpr Index kPiece = 1 << 16;
  const auto after = lags + static_cast<Index>(simd::padding());
  Eigen::MatrixXd piece(std::min(kPiece, samples_) + after, channels_);
  const Eigen::Map<const Eigen::MatrixXd> all(channel_major_.data(), samples_, channels_);
  std::vector<const double*> pointers(static_cast<std::size_t>(channels_));
  for (Index c = 0; c < channels_; ++c) {
    pointers[c] = piece.col(c).data();
  }
  for (Index begin = 0; begin < samples_; begin += kPiece) {
    const Index filled = std::min(piece.rows(), samples_ - begin);
    piece.topRows(filled) = all.middleRows(begin, filled);
    piece.bottomRows(piece.rows() - filled).setZero();
    simd::add_autocovariance_sums(pointers.data(), static_cast<std::size_t>(channels_),
                                  static_cast<std::size_t>(std::min(kPiece, samples_ - begin)),
                                  static_cast<std::size_t>(lags_),
                                  static_cast<std::size_t>(lags - lags_),
                                  sums_.data() + lags_ * channels_ * channels_);
  }
  lags_ = lags;
}

}  // namespace identikal
