#include "lib/lag_sums.h"

#include <algorithm>

#include "lib/simd_kernels.h"

namespace identikal {

using Eigen::Index;

LagSums::LagSums(const Eigen::Ref<const Eigen::MatrixXd>& z)
    : channels_(z.rows()), samples_(z.cols()), channel_major_(static_cast<std::size_t>(z.size())) {
  Eigen::Map<Eigen::MatrixXd>(channel_major_.data(), samples_, channels_) = z.transpose();
}

void LagSums::extend_to(Index lags) {
  lags = std::min(lags, samples_);
  if (lags <= lags_) return;
  sums_.resize(static_cast<std::size_t>(lags * channels_ * channels_), 0.0);
  // In pieces, each with its own past: the kernel reads across the begin of the recording.
  constexpr Index kPiece = 1 << 16;
  const auto past = lags + static_cast<Index>(simd::padding());
  Eigen::MatrixXd piece(past + std::min(kPiece, samples_), channels_);
  const Eigen::Map<const Eigen::MatrixXd> all(channel_major_.data(), samples_, channels_);
  std::vector<const double*> pointers(static_cast<std::size_t>(channels_));
  for (Index begin = 0; begin < samples_; begin += kPiece) {
    const Index count = std::min(kPiece, samples_ - begin), before = std::min(past, begin);
    piece.topRows(past - before).setZero();
    piece.middleRows(past - before, before + count) =
        all.middleRows(begin - before, before + count);
    for (Index c = 0; c < channels_; ++c) {
      pointers[static_cast<std::size_t>(c)] = piece.col(c).data() + past;
    }
    simd::add_lag_products(pointers.data(), static_cast<std::size_t>(channels_),
                           static_cast<std::size_t>(count), static_cast<std::size_t>(lags_),
                           static_cast<std::size_t>(lags - lags_),
                           sums_.data() + lags_ * channels_ * channels_);
  }
  lags_ = lags;
}

}  // namespace identikal
