// The closed form against dense linear algebra of the state space, lags and delay as states.
#include "lib/vehicle/frequency_response.h"

#include <complex>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

using Complex = std::complex<double>;

SingleTrack<> lagging_car() {
  SingleTrack<> car = linear_car(sladka2010_car());
  car.front.stiffness *= 0.8;
  car.steering_ratio = 16.0;
  car.steering_gain = 1.1;
  car.steering_delay = 0.03;
  car.relaxation_length = 0.4;
  return car;
}

/// x = (vy, r, Ff, Fr), forces as states that follow by the relaxation length.
struct Dense {
  Complex vy, r;
};
Dense dense_response(const SingleTrack<>& car, double u, double omega) {
  const double rate = u / car.relaxation_length;
  Eigen::Matrix4d A;
  A << 0.0, -u, 1.0 / car.m, 1.0 / car.m,         //
      0.0, 0.0, car.a / car.Iz, -car.b / car.Iz,  //
      -rate * car.front.stiffness / u, -rate * car.front.stiffness * car.a / u, -rate, 0.0,
      -rate * car.rear.stiffness / u, rate * car.rear.stiffness * car.b / u, 0.0, -rate;
  const Eigen::Vector4d B(0.0, 0.0, rate * car.front.stiffness, 0.0);
  const Complex s(0.0, omega);
  const Eigen::Matrix4cd pencil = s * Eigen::Matrix4cd::Identity() - A.cast<Complex>();
  const Eigen::Vector4cd x = pencil.partialPivLu().solve(B.cast<Complex>());
  const Complex delta = car.steering_gain / car.steering_ratio * std::exp(-s * car.steering_delay);
  return {x[0] * delta, x[1] * delta};
}

TEST(FrequencyResponse, IsThatOfTheStateSpace) {
  const SingleTrack<> car = lagging_car();
  for (const double u : {8.0, 20.0, 40.0}) {
    for (const double omega : {0.0, 0.7, 3.0, 11.0, 40.0}) {
      const FrequencyResponse found = frequency_response(car, u, omega);
      const Dense dense = dense_response(car, u, omega);
      EXPECT_LT(std::abs(found.r - dense.r), 1e-12 * std::abs(dense.r)) << u << " " << omega;
      EXPECT_LT(std::abs(found.vy - dense.vy), 1e-11 * std::abs(dense.vy)) << u << " " << omega;
      const Complex s(0.0, omega);
      EXPECT_LT(std::abs(found.ay - (s * dense.vy + u * dense.r)), 1e-11 * std::abs(found.ay));
      EXPECT_EQ(found.yaw_acceleration, s * found.r);
    }
  }
}

TEST(FrequencyResponse, WithoutLagsIsTheMatricesOne) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const SingleTrackMatrices model = single_track_matrices(car, 25.0);
  const Complex s(0.0, 5.0);
  const Eigen::Matrix2cd pencil = s * Eigen::Matrix2cd::Identity() - model.A.cast<Complex>();
  const Eigen::Vector2cd x =
      pencil.inverse() * model.B.cast<Complex>() * (car.steering_gain / car.steering_ratio);
  const FrequencyResponse found = frequency_response(car, 25.0, 5.0);
  EXPECT_LT(std::abs(found.vy - x[0]), 1e-12 * std::abs(x[0]));
  EXPECT_LT(std::abs(found.r - x[1]), 1e-12 * std::abs(x[1]));
}

TEST(FrequencyResponse, SteadyGainsAreTheKnownOnes) {
  SingleTrack<> car = linear_car(sladka2010_car());
  car.steering_ratio = 1.0;
  const SteeringResponse<double> known = steering_response(car, 30.0);
  const FrequencyResponse found = frequency_response(car, 30.0, 0.0);
  EXPECT_NEAR(found.r.real(), known.yaw_gain, 1e-12 * known.yaw_gain);
  EXPECT_NEAR(found.ay.real(), known.ay_gain, 1e-12 * known.ay_gain);
  EXPECT_NEAR(found.vy.real() / 30.0, known.sideslip_gain, 1e-12);
}

}  // namespace
}  // namespace identikal
