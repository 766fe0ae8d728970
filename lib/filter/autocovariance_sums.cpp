#include "lib/filter/autocovariance_sums.h"

#include <algorithm>
#include <complex>

#include <unsupported/Eigen/FFT>

#include "lib/filter/internal/segment_autocovariances.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Each piece, continued with zeros, against itself continued with the samples behind it: their
// cross spectra add up over the pieces, and one transform back gives all lags.
std::vector<MatrixXd> by_transform(const Eigen::Ref<const MatrixXd>& z, Index lags) {
  using Spectrum = std::vector<std::complex<double>>;
  const Index N = z.cols();
  Index length = 1;
  while (length < 4 * lags && length < N + lags) length *= 2;
  const Index piece = length - lags + 1;
  const auto ny = static_cast<std::size_t>(z.rows()), F = static_cast<std::size_t>(length);
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<double> series(F);
  std::vector<Spectrum> past(ny), now(ny), cross(ny * ny, Spectrum(F / 2 + 1));
  const auto transform = [&](std::size_t channel, Index begin, Index count, Spectrum& out) {
    count = std::min(count, N - begin);
    std::fill(series.begin(), series.end(), 0.0);
    for (Index t = 0; t < count; ++t) {
      series[t] = z(static_cast<Index>(channel), begin + t);
    }
    fft.fwd(out, series);
  };
  for (Index begin = 0; begin < N; begin += piece) {
    for (std::size_t i = 0; i < ny; ++i) {
      transform(i, begin, piece, past[i]);
      transform(i, begin, length, now[i]);
    }
    for (std::size_t i = 0; i < ny; ++i) {
      for (std::size_t j = 0; j < ny; ++j) {
        Spectrum& sum = cross[i + ny * j];
        for (std::size_t w = 0; w < sum.size(); ++w) sum[w] += now[i][w] * std::conj(past[j][w]);
      }
    }
  }
  std::vector<MatrixXd> out(static_cast<std::size_t>(lags), MatrixXd(z.rows(), z.rows()));
  for (std::size_t i = 0; i < ny; ++i) {
    for (std::size_t j = 0; j < ny; ++j) {
      fft.inv(series, cross[i + ny * j], length);
      for (std::size_t m = 0; m < out.size(); ++m) {
        out[m](static_cast<Index>(i), static_cast<Index>(j)) = series[m];
      }
    }
  }
  return out;
}

}  // namespace

std::vector<MatrixXd> autocovariance_sums(const Eigen::Ref<const MatrixXd>& z, Index lags) {
  const Index filled = std::min(lags, z.cols());
  std::vector<MatrixXd> out;
  if (filled >= kTransformLags) {
    out = by_transform(z, filled);
  } else if (filled > 0) {
    SegmentAutocovariances sums(z);
    sums.extend_to(filled);
    for (Index m = 0; m < filled; ++m) out.emplace_back(sums.at(m));
  }
  out.resize(static_cast<std::size_t>(lags), MatrixXd::Zero(z.rows(), z.rows()));
  return out;
}

}  // namespace identikal
