// A filter that is known is found, and as often within its band as the band says.
#include "lib/statistics/transfer_function.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStep = 0.05, kPole = 0.8;
constexpr double kTurn = 2.0 * std::numbers::pi;

/// y(t) = 0.8 y(t-1) + u(t) + noise, u an autoregression too.
MatrixXd record(Index N, double noise, std::uint64_t seed) {
  Random random(seed);
  MatrixXd out(2, N);
  double u = 0.0, y = 0.0;
  for (Index t = -200; t < N; ++t) {
    u = 0.7 * u + random.normal();
    y = kPole * y + u;
    if (t >= 0) out.col(t) << u, y + noise * random.normal();
  }
  return out;
}

Complex truth(double frequency) {
  return 1.0 / (1.0 - kPole * std::polar(1.0, -kTurn * frequency * kStep));
}

TEST(TransferFunction, OfARecordWithoutNoiseIsTheFilters) {
  const VectorXd at = Eigen::Vector4d(0.3, 1.0, 2.5, 6.0);
  const auto found = transfer_function({record(4000, 0.0, 1)}, kStep, at, 0.1);
  for (Index i = 0; i < at.size(); ++i) {
    EXPECT_GT(found[i].coherence, 0.99999);
    EXPECT_LT(std::abs(found[i].value - truth(at[i])), 0.001 * std::abs(truth(at[i]))) << at[i];
  }
}

TEST(TransferFunction, IsOfBothRecords) {
  const MatrixXd whole = record(4000, 0.5, 2);
  const VectorXd at = VectorXd::Constant(1, 1.0);
  const auto one = transfer_function({whole.leftCols(2000)}, kStep, at, 0.1),
             both =
                 transfer_function({whole.leftCols(2000), whole.rightCols(2000)}, kStep, at, 0.1);
  // The response is one, the begin and end of each record its own.
  EXPECT_DOUBLE_EQ(both[0].freedom, 2.0 * one[0].freedom + 6.0);
  EXPECT_LT(both[0].relative_se, one[0].relative_se);
}

// 4000 intervals of 95 %: outside 93 to 97 % with a probability below 1e-8 were they independent;
// frequencies of one record nearly are.
TEST(TransferFunction, BandsCover) {
  const VectorXd at = Eigen::Vector4d(0.3, 1.0, 2.5, 6.0);
  int gains = 0, phases = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    const auto found = transfer_function({record(600, 1.0, seed)}, kStep, at, 0.2);
    for (Index i = 0; i < at.size(); ++i) {
      ASSERT_DOUBLE_EQ(found[i].freedom, 16.0);
      constexpr double kQuantile = 2.1199;  // of Student's t, 16 degrees of freedom
      const double gain = std::abs(found[i].value), phase = std::arg(found[i].value / truth(at[i]));
      if (std::abs(gain - std::abs(truth(at[i]))) < kQuantile * gain * found[i].relative_se)
        ++gains;
      if (std::abs(phase) < kQuantile * found[i].relative_se) ++phases;
      ++all;
    }
  }
  EXPECT_NEAR(static_cast<double>(gains) / all, 0.95, 0.02);
  EXPECT_NEAR(static_cast<double>(phases) / all, 0.95, 0.02);
}

TEST(TransferFunction, RefusesWhatIsNoRecord) {
  const VectorXd at = VectorXd::Constant(1, 1.0);
  EXPECT_THROW(transfer_function({MatrixXd::Zero(3, 100)}, kStep, at, 0.1), std::invalid_argument);
  EXPECT_THROW(transfer_function({MatrixXd::Zero(2, 15)}, kStep, at, 0.1), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
