#include "lib/statistics/spectrum.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <stdexcept>

#include <unsupported/Eigen/FFT>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Spectrum multitaper(const Eigen::Ref<const MatrixXd>& e, int tapers) {
  const Index ny = e.rows(), N = e.cols();
  if (N < 16 || tapers < 1) throw std::invalid_argument("multitaper: too few samples or tapers");
  MatrixXd x = e;
  for (Index i = 0; i < ny; ++i) {
    double sum = 0.0, count = 0.0;
    for (Index t = 0; t < N; ++t) {
      if (std::isnan(x(i, t))) continue;
      sum += x(i, t);
      count += 1.0;
    }
    const double mean = count > 0.0 ? sum / count : 0.0;
    const double scale = count > 0.0 ? std::sqrt(static_cast<double>(N) / count) : 0.0;
    for (Index t = 0; t < N; ++t) x(i, t) = std::isnan(x(i, t)) ? 0.0 : scale * (x(i, t) - mean);
  }
  const Index K = (N - 1) / 2;
  Spectrum out;
  out.tapers = tapers;
  out.weight = VectorXd::Ones(K);
  out.omega = VectorXd::LinSpaced(K, 1.0, static_cast<double>(K)) *
              (2.0 * std::numbers::pi / static_cast<double>(N));
  out.S.assign(static_cast<std::size_t>(K), MatrixXcd::Zero(ny, ny));
  Eigen::FFT<double> fft;
  std::vector<double> tapered(static_cast<std::size_t>(N));
  std::vector<std::vector<std::complex<double>>> lines(static_cast<std::size_t>(ny));
  for (int taper = 1; taper <= tapers; ++taper) {
    for (Index i = 0; i < ny; ++i) {
      for (Index t = 0; t < N; ++t) {
        const double h = std::sqrt(2.0 / static_cast<double>(N + 1)) *
                         std::sin(std::numbers::pi * taper * static_cast<double>(t + 1) /
                                  static_cast<double>(N + 1));
        tapered[t] = h * x(i, t);
      }
      fft.fwd(lines[i], tapered);
    }
    for (Index k = 0; k < K; ++k) {
      MatrixXcd& S = out.S[k];
      for (Index i = 0; i < ny; ++i) {
        for (Index j = 0; j < ny; ++j) {
          S(i, j) += lines[i][k + 1] * std::conj(lines[j][k + 1]) / static_cast<double>(tapers);
        }
      }
    }
  }
  return out;
}

Spectrum binned(const Spectrum& fine, Index most) {
  constexpr Index kPeaks = 10, kAround = 6;
  const Index K = fine.omega.size();
  if (K <= most) return fine;
  // Frequencies near the highest values of the trace keep a bin of their own.
  VectorXd height(K);
  for (Index k = 0; k < K; ++k) height[k] = fine.S[k].real().trace();
  std::vector<bool> apart(static_cast<std::size_t>(K), false);
  VectorXd left = height;
  for (Index peak = 0; peak < kPeaks; ++peak) {
    Index at = 0;
    left.maxCoeff(&at);
    for (Index k = std::max<Index>(0, at - kAround); k <= std::min(K - 1, at + kAround); ++k) {
      apart[k] = true;
      left[k] = 0.0;
    }
  }
  const Index width = (K + most - 1) / most;
  Spectrum out;
  out.tapers = fine.tapers;
  std::vector<double> omega, weight;
  for (Index k = 0; k < K;) {
    Index end = k + 1;
    if (!apart[k]) {
      while (end < K && end - k < width && !apart[end]) ++end;
    }
    MatrixXcd sum = MatrixXcd::Zero(fine.S[0].rows(), fine.S[0].cols());
    for (Index l = k; l < end; ++l) sum += fine.S[l];
    const auto count = static_cast<double>(end - k);
    omega.push_back(fine.omega.segment(k, end - k).mean());
    weight.push_back(count);
    out.S.push_back(sum / count);
    k = end;
  }
  out.omega = Eigen::Map<VectorXd>(omega.data(), static_cast<Index>(omega.size()));
  out.weight = Eigen::Map<VectorXd>(weight.data(), static_cast<Index>(weight.size()));
  return out;
}

}  // namespace identikal
