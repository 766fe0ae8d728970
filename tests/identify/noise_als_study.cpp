// Is autocovariance least squares unbiased, and how near to the bound does it come?
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/noise_als.h"
#include "identify/noise_ml.h"
#include "tests/support/noise_study.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

NoiseStudy als_study(const std::string& title, const MatiskoSystem& system,
                     const std::vector<Eigen::MatrixXd>& recordings,
                     const NoiseAlsOptions& options) {
  return study(
      title + ", " + system.model.name, system, recordings,
      [&](const std::vector<Dataset>& data) { return tune_als(system.model, data, options); });
}

MatiskoSystem with_prior(MatiskoSystem system, double q, double r) {
  system.model.parameters[0].value.diagonal().setConstant(q);
  system.model.parameters[1].value.diagonal().setConstant(r);
  return system;
}

// The spreads that others had on the same recordings, with the lags and priors of the source: of
// Systems 1, 5 and 6 a published package with its constraint (noise/README.md beside the reference
// data), of System 7 numpy and scipy (identity weight, the first 100 innovations dropped). The
// package's own figures for System 7, 8.4 10.5 5.0 17.3 25.1, are reproduced by neither.
TEST(NoiseAlsStudy, SpreadsOfTheReferenceRecordings) {
  struct Row {
    int number;
    double r0;
    Index lags;
    std::vector<double> percent;
  };
  const std::vector<Row> rows = {{1, 1.0, 10, {10.0, 73.8}},
                                 {5, 1.0, 20, {4.4, 633}},
                                 {6, 1.0, 30, {5.8, 5.0, 26.8, 5.3}},
                                 {7, 1.0, 30, {9.8, 5.8, 5.0, 14.0, 27.3}},
                                 {7, 10.0, 30, {18.7, 10.1, 7.1, 24.5, 43.9}}};
  for (const Row& row : rows) {
    const std::string file = "noise/sys" + std::to_string(row.number) + ".csv";
    IDENTIKAL_NEEDS_SHARED_FILE(file);
    const MatiskoSystem system = with_prior(matisko_system(row.number), 1.0, row.r0);
    NoiseAlsOptions options;
    options.weighted = false;
    options.lags = row.lags;
    const NoiseStudy s = als_study("als", system, reference_recordings(system), options);
    EXPECT_EQ(s.not_ok, 0);
    EXPECT_EQ(s.indefinite, 0);
    for (std::size_t i = 0; i < row.percent.size(); ++i) {
      const auto at = static_cast<Index>(i);
      EXPECT_NEAR(s.percent[at] / row.percent[i], 1.0, 0.1) << row.number << " " << i;
      if (row.number == 5 && i == 1) continue;  // cut off at zero, its mean is not the truth
      EXPECT_LT(std::abs(s.mean[at] - 1.0), 4.0 * s.percent[at] / 100.0 / std::sqrt(50.0));
    }
  }
}

TEST(NoiseAlsStudy, WeightedOnTheReferenceRecordings) {
  for (const int number : {1, 5, 6, 7}) {
    const std::string file = "noise/sys" + std::to_string(number) + ".csv";
    IDENTIKAL_NEEDS_SHARED_FILE(file);
    const MatiskoSystem system = matisko_system(number);
    const NoiseStudy s =
        als_study("als-weighted", system, reference_recordings(system), NoiseAlsOptions());
    EXPECT_EQ(s.not_ok, 0);
    EXPECT_EQ(s.indefinite, 0);
    EXPECT_LE(s.ratio.maxCoeff(), 1.35);
  }
}

// 1000 simulations know a mean to 3 % of a standard deviation and a standard deviation to 2.2 %.
TEST(NoiseAlsStudy, WeightedIsUnbiasedAndNearTheBoundWhateverThePrior) {
  for (const int number : {6, 7}) {
    const std::vector<Eigen::MatrixXd> recordings = simulated_recordings(
        matisko_system(number), 1000, static_cast<std::uint64_t>(100 + number));
    for (const double r0 : {1.0, 10.0}) {
      const MatiskoSystem system = with_prior(matisko_system(number), 1.0, r0);
      const NoiseStudy s = als_study("als-weighted, R0 = " + std::to_string(r0), system, recordings,
                                     NoiseAlsOptions());
      EXPECT_EQ(s.not_ok, 0);
      EXPECT_EQ(s.indefinite, 0);
      EXPECT_LE(s.ratio.maxCoeff(), 1.10);
      EXPECT_GE(s.coverage.minCoeff(), 0.93);
      for (Index i = 0; i < s.mean.size(); ++i) {
        const double error = 2.0 * s.percent[i] / 100.0 / std::sqrt(1000.0);
        EXPECT_LT(std::abs(s.mean[i] - 1.0), std::max(0.01, error)) << number << " " << i;
      }
    }
  }
}

// Systems whose scales, or integrators, break the unweighted form. On the kinematic one Q is known
// to a third of itself, so that one filter in fifty loses more than 5 % whatever the method.
TEST(NoiseAlsStudy, HardSystemsStayNearTheBound) {
  for (const MatiskoSystem& system : {zhang_kinematic(), mehra_inertial()}) {
    const std::vector<Eigen::MatrixXd> recordings = simulated_recordings(system, 50, 1);
    NoiseAlsOptions plain;
    plain.weighted = false;
    als_study("als", system, recordings, plain);
    const NoiseStudy weighted = als_study("als-weighted", system, recordings, NoiseAlsOptions());
    NoiseMlOptions one;
    one.starts = 1;
    const NoiseStudy ml =
        study("ml, " + system.model.name, system, recordings,
              [&](const std::vector<Dataset>& data) { return tune_ml(system.model, data, one); });
    for (const NoiseStudy& s : {weighted, ml}) {
      EXPECT_EQ(s.not_ok, 0);
      EXPECT_EQ(s.indefinite, 0);
      EXPECT_LE(s.ratio.maxCoeff(), 1.3);
      EXPECT_LE(s.worst_loss, std::max(0.05, 2.0 * ml.worst_loss));
    }
  }
}

}  // namespace
}  // namespace identikal
