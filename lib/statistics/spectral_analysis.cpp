#include "lib/statistics/spectral_analysis.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <unsupported/Eigen/FFT>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;
using Eigen::VectorXd;
using Complex = std::complex<double>;

namespace {

constexpr double kNotANumber = std::numeric_limits<double>::quiet_NaN();

// Parzen's window: its transform is nowhere negative.
double window(Index lag, Index lags) {
  const double x = static_cast<double>(lag) / static_cast<double>(lags);
  return x < 0.5 ? 1.0 - 6.0 * x * x * (1.0 - x) : 2.0 * std::pow(1.0 - x, 3);
}

struct Covariances {
  std::vector<MatrixXd> of_lag;  // R_k = mean of z(t) z(t-k)', z = [y; u]
  double rows = 0.0;
};

// A sample that misses counts as zero; every sum is over the products that there are.
Covariances covariances(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u,
                        Index lags) {
  const Index q = y[0].rows() + u[0].rows();
  Covariances out;
  out.of_lag.assign(static_cast<std::size_t>(lags), MatrixXd::Zero(q, q));
  std::vector<MatrixXd> count = out.of_lag;
  for (std::size_t r = 0; r < y.size(); ++r) {
    MatrixXd z(q, y[r].cols());
    z << y[r], u[r];
    const MatrixXd there = z.array().isFinite().cast<double>();
    z = z.array().isFinite().select(z, 0.0);
    out.rows += static_cast<double>(z.cols());
    for (Index k = 0; k < std::min(lags, z.cols()); ++k) {
      const Index n = z.cols() - k;
      const auto at = static_cast<std::size_t>(k);
      out.of_lag[at].noalias() += z.rightCols(n) * z.leftCols(n).transpose();
      count[at].noalias() += there.rightCols(n) * there.leftCols(n).transpose();
    }
  }
  // Of a recording without gaps: divided by all rows at every lag, which keeps the spectrum positive.
  for (std::size_t k = 0; k < count.size(); ++k) {
    const double lost = static_cast<double>(k) * static_cast<double>(y.size());
    const double possible = std::max(out.rows - lost, 1.0);
    const MatrixXd share = (count[k] / possible).cwiseMax(1e-12);
    out.of_lag[k] = out.of_lag[k].cwiseQuotient(share) / out.rows;
  }
  return out;
}

MatrixXcd spectrum(const Covariances& of, double omega) {
  const auto lags = static_cast<Index>(of.of_lag.size());
  MatrixXcd out = of.of_lag[0].cast<Complex>();
  for (Index k = 1; k < lags; ++k) {
    const MatrixXcd term = window(k, lags) * std::polar(1.0, -omega * static_cast<double>(k)) *
                           of.of_lag[static_cast<std::size_t>(k)].cast<Complex>();
    out += term + term.adjoint();
  }
  return out;
}

void check(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u, Index lags,
           const VectorXd& omega) {
  if (y.empty() || y.size() != u.size() || y[0].rows() == 0 || u[0].rows() == 0)
    throw std::invalid_argument("spectral_analysis: recordings of at least one output and input");
  Index longest = 0;
  for (std::size_t r = 0; r < y.size(); ++r) {
    if (y[r].cols() != u[r].cols() || y[r].rows() != y[0].rows() || u[r].rows() != u[0].rows())
      throw std::invalid_argument("spectral_analysis: y and u of a recording have the same rows");
    longest = std::max(longest, y[r].cols());
  }
  if (lags < 1 || lags >= longest)
    throw std::invalid_argument("spectral_analysis: lags from 1, below the rows");
  if (omega.size() == 0 || !(omega.minCoeff() > 0.0) || !(omega.maxCoeff() <= std::numbers::pi))
    throw std::invalid_argument("spectral_analysis: frequencies above 0, up to pi");
}

// Response, noise and errors at one frequency from the joint spectrum of [y; u].
void add_frequency(const MatrixXcd& S, Index p, double window_energy, SpectralResponse& out) {
  const Index m = S.rows() - p;
  const MatrixXcd Su = S.bottomRightCorner(m, m), Syu = S.topRightCorner(p, m);
  const VectorXd power = Eigen::SelfAdjointEigenSolver<MatrixXcd>(Su).eigenvalues();
  if (!(power[0] > 1e-12 * power[m - 1])) {
    out.G.push_back(MatrixXcd::Constant(p, m, Complex(kNotANumber, kNotANumber)));
    out.se.push_back(MatrixXd::Constant(p, m, kNotANumber));
    out.noise.push_back(S.topLeftCorner(p, p));
    out.coherence.push_back(VectorXd::Zero(p));
    return;
  }
  const MatrixXcd inverse = Su.inverse(), G = Syu * inverse;
  MatrixXcd noise = S.topLeftCorner(p, p) - G * Syu.adjoint();
  const VectorXd of_noise = noise.diagonal().real().cwiseMax(0.0);
  noise.diagonal().real() = of_noise;
  const VectorXd of_input = inverse.diagonal().real().cwiseMax(0.0);
  out.G.push_back(G);
  out.se.push_back((0.5 * window_energy * of_noise * of_input.transpose()).cwiseSqrt());
  out.noise.push_back(noise);
  const VectorXd all = S.topLeftCorner(p, p).diagonal().real().cwiseMax(1e-300);
  out.coherence.push_back(VectorXd::Ones(p) - of_noise.cwiseQuotient(all).cwiseMin(1.0));
}

}  // namespace

SpectralResponse spectral_analysis(const std::vector<MatrixXd>& y, const std::vector<MatrixXd>& u,
                                   Index lags, const VectorXd& omega) {
  check(y, u, lags, omega);
  const Covariances of = covariances(y, u, lags);
  double energy = 1.0;
  for (Index k = 1; k < lags; ++k) energy += 2.0 * std::pow(window(k, lags), 2);
  SpectralResponse out;
  out.omega = omega;
  for (const double at : omega) add_frequency(spectrum(of, at), y[0].rows(), energy / of.rows, out);
  return out;
}

SpectralResponse empirical_transfer_function(const VectorXd& y, const VectorXd& u, Index lags) {
  const Index N = y.size(), K = (N - 1) / 2;
  if (N < 16 || u.size() != N || !y.allFinite() || !u.allFinite())
    throw std::invalid_argument("empirical_transfer_function: 16 samples or more without gap");
  const VectorXd omega = VectorXd::LinSpaced(K, 1.0, static_cast<double>(K)) *
                         (2.0 * std::numbers::pi / static_cast<double>(N));
  const MatrixXd rows_y = y.transpose(), rows_u = u.transpose();
  SpectralResponse out = spectral_analysis({rows_y}, {rows_u}, lags, omega);
  Eigen::FFT<double> fft;
  VectorXcd Y, U;
  fft.fwd(Y, y);
  fft.fwd(U, u);
  const double floor = 1e-12 * U.segment(1, K).cwiseAbs().maxCoeff();
  for (Index k = 0; k < K; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double size = std::abs(U[k + 1]);
    const bool driven = size > floor;
    out.G[at](0, 0) = driven ? Y[k + 1] / U[k + 1] : Complex(kNotANumber, kNotANumber);
    // E|V|^2 = N S_v, half of it in the real part.
    const double noise = out.noise[at](0, 0).real() * static_cast<double>(N);
    out.se[at](0, 0) = driven ? std::sqrt(0.5 * noise) / size : kNotANumber;
  }
  return out;
}

}  // namespace identikal
