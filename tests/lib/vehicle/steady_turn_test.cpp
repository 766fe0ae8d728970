// A steady turn is where the simulated motion does not change.
#include "lib/vehicle/steady_turn.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/vehicle/motion.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

constexpr TyreCurve kCurves[] = {TyreCurve::linear, TyreCurve::tanh, TyreCurve::fiala,
                                 TyreCurve::magic_formula};

SingleTrack<> car_of(TyreCurve curve) {
  VehicleParameters<double> p = sladka2010_car();
  p[kInverseSaturationFront] = 1.0 / (7000.0 * 7000.0);
  p[kInverseSaturationRear] = 1.0 / (5500.0 * 5500.0);
  return car_with(curve, p);
}

TEST(SteadyTurn, TheMotionDoesNotChangeThere) {
  for (const TyreCurve curve : kCurves) {
    SingleTrack<> car = car_of(curve);
    car.steering_ratio = 1.0;
    for (const double ay : {-6.0, -1.0, 0.5, 3.0, 6.5}) {
      const double u = 22.0;
      const SteadyTurn turn = steady_turn(car, ay, u);
      DrivenSegment::Node at{turn.road_wheel_angle, u, 1.0 / u};
      const Motion motion = motion_at(car, u * turn.sideslip, ay / u, at);
      EXPECT_NEAR(motion.ay, ay, 1e-9) << name_of(curve) << " " << ay;
      EXPECT_NEAR(motion.yaw_acceleration, 0.0, 1e-9) << name_of(curve) << " " << ay;
    }
  }
}

TEST(SteadyTurn, OfLinearAxlesIsTheUndersteerGradient) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const double u = 30.0, ay = 5.0;
  const double expected = ((car.a + car.b) / (u * u) + understeer_gradient(car)) * ay;
  EXPECT_NEAR(steady_turn(car, ay, u).road_wheel_angle, expected, 1e-15);
  EXPECT_NEAR(steady_turn(car, ay, u).sideslip, car.b * ay / (u * u) - rear_compliance(car) * ay,
              1e-15);
}

TEST(SteadyTurn, EndsAtTheLargestForce) {
  for (const TyreCurve curve : {TyreCurve::tanh, TyreCurve::fiala, TyreCurve::magic_formula}) {
    const SingleTrack<> car = car_of(curve);
    const double limit = largest_steady_acceleration(car);
    EXPECT_TRUE(std::isfinite(steady_turn(car, 0.999 * limit, 20.0).road_wheel_angle));
    EXPECT_TRUE(std::isnan(steady_turn(car, 1.001 * limit, 20.0).road_wheel_angle));
    EXPECT_DOUBLE_EQ(largest_force(car.front), 7000.0);
    // The first axle to give way.
    EXPECT_NEAR(limit,
                std::fmin(7000.0 * (car.a + car.b) / (car.m * car.b),
                          5500.0 * (car.a + car.b) / (car.m * car.a)),
                1e-12);
  }
  EXPECT_TRUE(std::isinf(largest_steady_acceleration(car_of(TyreCurve::linear))));
}

}  // namespace
}  // namespace identikal
