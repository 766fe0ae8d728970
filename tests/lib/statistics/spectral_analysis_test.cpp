// Spectral analysis and the empirical transfer function against systems that are known.
#include "lib/statistics/spectral_analysis.h"

#include <cmath>
#include <complex>
#include <cstdio>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

struct TwoInputs {
  MatrixXd y, u;
};

// y(t) = 0.8 y(t-1) + 0.4 u1(t-1) and 0.5 u2(t), noise of 0.5.
TwoInputs two_inputs(Index rows, std::uint64_t seed) {
  Random random(seed);
  TwoInputs out{MatrixXd(1, rows), MatrixXd(2, rows)};
  double x = 0.0;
  for (Index t = 0; t < rows; ++t) {
    out.u.col(t) << random.normal(), random.normal();
    out.y(0, t) = x + 0.5 * out.u(1, t) + 0.5 * random.normal();
    x = 0.8 * x + 0.4 * out.u(0, t);
  }
  return out;
}

std::complex<double> first_response(double omega) {
  const std::complex<double> q = std::polar(1.0, -omega);
  return 0.4 * q / (1.0 - 0.8 * q);
}

TEST(SpectralAnalysis, CoversAKnownResponseWithItsErrors) {
  // 50 recordings, five frequencies that are nearly independent, two inputs, real and imaginary part: 1000 numbers; below 927
  // or above 975 with a probability of 1e-3 each if all were independent.
  const VectorXd omega = VectorXd::LinSpaced(5, 0.4, 2.8);
  int covered = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    const TwoInputs record = two_inputs(4000, seed);
    const SpectralResponse found = spectral_analysis({record.y}, {record.u}, 60, omega);
    for (Index k = 0; k < omega.size(); ++k) {
      const auto at = static_cast<std::size_t>(k);
      for (Index j = 0; j < 2; ++j) {
        const std::complex<double> truth = j == 0 ? first_response(omega[k]) : 0.5;
        const std::complex<double> away = found.G[at](0, j) - truth;
        covered += std::abs(away.real()) < 1.96 * found.se[at](0, j);
        covered += std::abs(away.imag()) < 1.96 * found.se[at](0, j);
      }
      EXPECT_GT(found.coherence[at][0], 0.2);
      EXPECT_LT(found.coherence[at][0], 1.0);
    }
  }
  std::printf("covered %d of 1000\n", covered);
  EXPECT_GE(covered, 927);
  EXPECT_LE(covered, 975);
}

TEST(SpectralAnalysis, LeavesOutWhatIsMissing) {
  TwoInputs record = two_inputs(20000, 7);
  const VectorXd omega = VectorXd::Constant(1, 0.5);
  const std::complex<double> whole =
      spectral_analysis({record.y}, {record.u}, 60, omega).G[0](0, 0);
  for (Index t = 0; t < 20000; t += 10) record.y(0, t) = std::numeric_limits<double>::quiet_NaN();
  const SpectralResponse gappy = spectral_analysis({record.y}, {record.u}, 60, omega);
  EXPECT_LT(std::abs(gappy.G[0](0, 0) - whole), 4.0 * gappy.se[0](0, 0));
  EXPECT_THROW(spectral_analysis({record.y}, {record.u}, 20000, omega), std::invalid_argument);
  EXPECT_THROW(spectral_analysis({record.y}, {record.u}, 10, VectorXd::Zero(1)),
               std::invalid_argument);
}

TEST(SpectralAnalysis, HasNoResponseToAnInputThatDoesNotMove) {
  TwoInputs record = two_inputs(500, 8);
  record.u.row(1).setZero();
  const SpectralResponse found =
      spectral_analysis({record.y}, {record.u}, 30, VectorXd::Constant(1, 0.5));
  EXPECT_TRUE(std::isnan(found.G[0](0, 0).real()));
}

TEST(EmpiricalTransferFunction, IsRightInTheMean) {
  const TwoInputs record = two_inputs(8192, 9);
  const VectorXd y = record.y.row(0) - 0.5 * record.u.row(1), u = record.u.row(0);
  const SpectralResponse found = empirical_transfer_function(y, u, 60);
  ASSERT_EQ(found.omega.size(), 4095);
  // Standardised errors: 4000 frequencies; their share within 1.96 has a standard error of 0.0034 for real and imaginary part.
  double covered = 0.0, count = 0.0;
  for (Index k = 40; k < 4040; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const std::complex<double> away = found.G[at](0, 0) - first_response(found.omega[k]);
    covered += std::abs(away.real()) < 1.96 * found.se[at](0, 0);
    covered += std::abs(away.imag()) < 1.96 * found.se[at](0, 0);
    count += 2.0;
  }
  EXPECT_NEAR(covered / count, 0.95, 0.02);
  EXPECT_THROW(empirical_transfer_function(y, u.head(10), 5), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
