#include "lib/vehicle/velocity_sensors.h"

#include <cmath>
#include <limits>
#include <string>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;

// HS-CE and V1 of Sladká (2010), section 8.3.
std::vector<VectorSensor> two_sensors() {
  return {{2.109, -0.027, 0.0, 0.05, 0.002}, {-2.760, -0.379, 0.0, 0.08, 0.003}};
}

// What the sensor reads at these velocities of the centre of gravity: speed, slip angle.
Eigen::Vector2d reading(const VectorSensor& sensor, const Eigen::Vector3d& motion) {
  const double forward = motion[0] - motion[2] * sensor.y;
  const double left = motion[1] + motion[2] * sensor.x;
  return {std::hypot(forward, left), std::atan2(left, forward) - sensor.mounting};
}

std::string refusal(const std::vector<VectorSensor>& sensors, Eigen::Index rows) {
  try {
    centre_velocity(sensors, MatrixXd::Ones(rows, 1), MatrixXd::Zero(rows, 1));
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(CentreVelocity, IsExactWithoutNoise) {
  std::vector<VectorSensor> sensors = two_sensors();
  sensors[1].mounting = 0.033;
  sensors.push_back({0.3, 0.8, -1.2, 0.1, 0.01});
  Random random(5);
  for (const std::size_t count : {2U, 3U}) {
    const std::vector<VectorSensor> used(sensors.begin(), sensors.begin() + count);
    const auto S = static_cast<Eigen::Index>(count);
    MatrixXd U(S, 50), alpha(S, 50);
    Eigen::Matrix3Xd truth(3, 50);
    for (Eigen::Index t = 0; t < 50; ++t) {
      truth.col(t) = Eigen::Vector3d(16.0, 0.0, 0.0) + random.normal(3);
      for (Eigen::Index s = 0; s < S; ++s) {
        const Eigen::Vector2d read = reading(used[static_cast<std::size_t>(s)], truth.col(t));
        U(s, t) = read[0];
        alpha(s, t) = read[1];
      }
    }
    EXPECT_LT((centre_velocity(used, U, alpha).value - truth).cwiseAbs().maxCoeff(), 1e-12);
  }
}

// The yaw rate of two sensors is the difference of their lateral velocities over their distance
// along the car, when the lateral offsets are small (VEHICLE.md beside the reference data).
TEST(CentreVelocity, YawRateIsTheLateralDifference) {
  const std::vector<VectorSensor> sensors = two_sensors();
  const MatrixXd U = (MatrixXd(2, 1) << 16.5, 16.2).finished();
  const MatrixXd alpha = (MatrixXd(2, 1) << 0.06, -0.05).finished();
  const CentreVelocity out = centre_velocity(sensors, U, alpha);
  const double difference =
      (U(0) * std::sin(alpha(0)) - U(1) * std::sin(alpha(1))) / (2.109 + 2.760);
  EXPECT_NEAR(out.value(2, 0), difference, 0.03 * difference);
}

// 20000 draws at one motion: means and covariance within four standard deviations of what normal
// draws have, 1 false alarm in 1500 over the nine numbers; the slip angle's curvature moves the
// mean by U sd^2 / 2, which is far below.
TEST(CentreVelocity, CovarianceIsThatOfTheErrors) {
  std::vector<VectorSensor> sensors = two_sensors();
  sensors[0].mounting = 0.1;
  const Eigen::Vector3d truth(16.0, -0.6, 0.35);
  constexpr Eigen::Index kRuns = 20000;
  Random random(17);
  MatrixXd U(2, kRuns), alpha(2, kRuns);
  for (Eigen::Index t = 0; t < kRuns; ++t) {
    for (Eigen::Index s = 0; s < 2; ++s) {
      const VectorSensor& sensor = sensors[static_cast<std::size_t>(s)];
      const Eigen::Vector2d read = reading(sensor, truth);
      U(s, t) = read[0] + sensor.speed_sd * random.normal();
      alpha(s, t) = read[1] + sensor.slip_sd * random.normal();
    }
  }
  const CentreVelocity out = centre_velocity(sensors, U, alpha);
  const Eigen::Matrix3Xd error = out.value.colwise() - truth;
  const Eigen::Matrix3d sample = error * error.transpose() / static_cast<double>(kRuns);
  const Eigen::Matrix3d& P = out.covariance[0];
  const double root = std::sqrt(static_cast<double>(kRuns));
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(error.row(i).mean()), 4.0 * std::sqrt(P(i, i)) / root) << i;
    for (int j = 0; j < 3; ++j) {
      const double sd = std::sqrt((P(i, i) * P(j, j) + P(i, j) * P(i, j))) / root;
      EXPECT_NEAR(sample(i, j), P(i, j), 4.0 * sd + 1e-3 * std::sqrt(P(i, i) * P(j, j))) << i << j;
    }
  }
  // Witness: the formula in full.
  Eigen::Matrix<double, 4, 3> H;
  Eigen::Matrix4d R = Eigen::Matrix4d::Zero();
  for (int s = 0; s < 2; ++s) {
    const VectorSensor& sensor = sensors[static_cast<std::size_t>(s)];
    H.middleRows<2>(2 * s) << 1.0, 0.0, -sensor.y, 0.0, 1.0, sensor.x;
    const double angle = alpha(s, 0) + sensor.mounting;
    Eigen::Matrix2d J;
    J << std::cos(angle), -U(s, 0) * std::sin(angle), std::sin(angle), U(s, 0) * std::cos(angle);
    const Eigen::Vector2d variance(std::pow(sensor.speed_sd, 2), std::pow(sensor.slip_sd, 2));
    R.block<2, 2>(2 * s, 2 * s) = J * variance.asDiagonal() * J.transpose();
  }
  const Eigen::Matrix3d witness = (H.transpose() * R.inverse() * H).inverse();
  EXPECT_LT((witness - P).norm(), 1e-10 * P.norm());
}

TEST(CentreVelocity, LeavesOutWhatIsMissing) {
  MatrixXd U = MatrixXd::Constant(2, 3, 15.0), alpha = MatrixXd::Zero(2, 3);
  U(1, 0) = 0.0;
  alpha(0, 1) = std::numeric_limits<double>::quiet_NaN();
  const CentreVelocity out = centre_velocity(two_sensors(), U, alpha);
  EXPECT_TRUE(out.value.leftCols(2).array().isNaN().all());
  EXPECT_NEAR(out.value(0, 2), 15.0, 1e-12);
}

TEST(CentreVelocity, RefusesInWords) {
  std::vector<VectorSensor> sensors = two_sensors();
  EXPECT_NE(refusal({sensors[0]}, 1).find("one cannot tell turning from sliding"),
            std::string::npos);
  sensors[1].x = sensors[0].x;
  sensors[1].y = sensors[0].y;
  EXPECT_NE(refusal(sensors, 2).find("the yaw rate is open"), std::string::npos);
  sensors = two_sensors();
  sensors[1].slip_sd = 0.0;
  EXPECT_NE(refusal(sensors, 2).find("cannot be weighed"), std::string::npos);
  EXPECT_NE(refusal(two_sensors(), 3).find("3 x 1"), std::string::npos);
}

}  // namespace
}  // namespace identikal
