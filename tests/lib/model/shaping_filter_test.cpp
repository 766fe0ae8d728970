#include "lib/model/shaping_filter.h"

#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/spectrum.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(ShapingFilter, CoordinatesGiveStablePolynomialsOnlyAndAllOfThem) {
  Random random(1);
  for (Index n = 1; n <= 5; ++n) {
    for (int i = 0; i < 50; ++i) {
      const VectorXd zeta = 2.0 * random.normal(n);
      MatrixXd J;
      const VectorXd p = stable_polynomial(zeta, &J);
      for (const Mode& mode : modes(p)) EXPECT_LT(mode.radius, 1.0);
      const VectorXd back = stable_coordinates(p);
      EXPECT_LT((back - zeta).norm(), 1e-6 * std::cosh(zeta.cwiseAbs().maxCoeff()));
      for (Index j = 0; j < n; ++j) {
        VectorXd up = zeta, down = zeta;
        up[j] += 1e-6;
        down[j] -= 1e-6;
        const VectorXd slope = (stable_polynomial(up) - stable_polynomial(down)) / 2e-6;
        EXPECT_LT((slope - J.col(j)).norm(), 1e-8);
      }
    }
  }
  EXPECT_TRUE(stable_coordinates(Eigen::Vector2d(-2.1, 1.1)).array().isNaN().all());
}

TEST(ShapingFilter, StateFormHasTheResponse) {
  const ShapingFilter filter{Eigen::Vector3d(-0.6, 0.84, 0.1), Eigen::Vector2d(0.125, -0.3)};
  const ShapingState s = shaping_state(filter);
  for (const double omega : {0.0, 0.3, 1.19, 3.1}) {
    const std::complex<double> z = std::polar(1.0, omega);
    const Eigen::MatrixXcd resolvent =
        (z * Eigen::MatrixXcd::Identity(3, 3) - s.A.cast<std::complex<double>>()).inverse();
    const std::complex<double> H = (s.c * resolvent * s.g)(0, 0) + 1.0;
    Eigen::VectorXcd dH;
    EXPECT_LT(std::abs(H - response(filter, omega, &dH)), 1e-12);
    for (Index i = 0; i < 5; ++i) {
      ShapingFilter up = filter, down = filter;
      (i < 3 ? up.a[i] : up.b[i - 3]) += 1e-6;
      (i < 3 ? down.a[i] : down.b[i - 3]) -= 1e-6;
      EXPECT_LT(std::abs((response(up, omega) - response(down, omega)) / 2e-6 - dH[i]), 1e-7);
    }
  }
}

TEST(ShapingFilter, ModesOfThePublishedFilter) {
  // (5.21): poles of z^2 - 0.6 z + 0.84, "a peak at 0.19 Hz".
  const std::vector<Mode> found = modes(Eigen::Vector2d(-0.6, 0.84));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].radius, std::sqrt(0.84), 1e-12);
  EXPECT_NEAR(found[0].frequency, std::acos(0.3 / std::sqrt(0.84)), 1e-12);
  EXPECT_NEAR(found[0].frequency / (2.0 * std::numbers::pi), 0.197, 1e-3);
}

TEST(Spectrum, WhiteNoiseHasItsCovarianceAtEveryFrequency) {
  Random random(2);
  const MatrixXd L = (MatrixXd(2, 2) << 2.0, 0.0, 1.0, 0.5).finished();
  MatrixXd e(2, 4096);
  for (Index t = 0; t < e.cols(); ++t) e.col(t) = L * random.normal(2);
  const Spectrum s = multitaper(e, 4);
  Eigen::MatrixXcd mean = Eigen::MatrixXcd::Zero(2, 2);
  for (const Eigen::MatrixXcd& S : s.S) mean += S / static_cast<double>(s.S.size());
  // 2047 frequencies, 4 tapers that overlap: a standard error of about 2 %.
  EXPECT_LT((mean.real() - L * L.transpose()).norm(), 0.1 * (L * L.transpose()).norm());
  EXPECT_LT(mean.imag().norm(), 0.1);
  const Spectrum coarse = binned(s, 100);
  EXPECT_NEAR(coarse.weight.sum(), s.weight.sum(), 1e-9);
  EXPECT_LT(coarse.omega.size(), 400);
  EXPECT_LT(coarse.omega[0], coarse.omega[1]);
}

TEST(Spectrum, ALineStandsWhereItIs) {
  VectorXd e(1000);
  for (Index t = 0; t < e.size(); ++t) e[t] = std::sin(1.19 * static_cast<double>(t));
  const Spectrum s = multitaper(e.transpose(), 3);
  Index best = 0;
  for (Index k = 0; k < s.omega.size(); ++k) {
    if (s.S[static_cast<std::size_t>(k)](0, 0).real() >
        s.S[static_cast<std::size_t>(best)](0, 0).real())
      best = k;
  }
  EXPECT_NEAR(s.omega[best], 1.19, 0.02);
}

}  // namespace
}  // namespace identikal
