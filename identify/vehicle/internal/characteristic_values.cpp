#include "identify/vehicle/internal/characteristic_values.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/vehicle/internal/structure_judgement.h"
#include "lib/base/constants.h"
#include "lib/base/dual.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

/// A quantity of the car and its derivatives by the free parameters.
struct Characteristic {
  double value = kNone;
  Eigen::VectorXd by_free;
  bool exists() const { return std::isfinite(value) && by_free.allFinite(); }
};

template <typename Quantity>
Characteristic characteristic(const VehicleProblem& problem, const VehicleParameters<double>& p,
                              const Quantity& quantity) {
  constexpr std::size_t kCompliance = kCr + 1;
  const std::array<double, kCompliance + 1> x = {
      p[kMass], p[kA], p[kB], p[kYawInertia], p[kCf], p[kCr], p[kSteeringCompliance]};
  const auto [value, gradient] = value_and_gradient(x, [&](const auto& q) {
    using T = typename std::decay_t<decltype(q)>::value_type;
    SingleTrack<T> car;
    car.m = q[kMass];
    car.a = q[kA];
    car.b = q[kB];
    car.Iz = q[kYawInertia];
    car.front.stiffness = q[kCf];
    car.front.compliance = q[kCompliance];
    car.rear.stiffness = q[kCr];
    return T(quantity(car));
  });
  Characteristic out{value, Eigen::VectorXd(problem.parameters())};
  for (Eigen::Index i = 0; i < out.by_free.size(); ++i) {
    const VehicleParameter parameter = problem.unknowns.free[i];
    out.by_free[i] = parameter <= kCr                   ? gradient[parameter]
                     : parameter == kSteeringCompliance ? gradient[kCompliance]
                                                        : 0.0;
  }
  return out;
}

/// Not by the parameters' errors: along a shift of the stiffnesses it is far from straight.
double structural_error(const StructuredAnswer& answer, const Characteristic& here,
                        const Characteristic& there) {
  const StructureStudy& study = *answer.study;
  const Eigen::VectorXd& g = answer.adopted ? here.by_free : there.by_free;
  const double shift = shift_share(answer.adopted) * (there.value - here.value);
  return std::sqrt(g.dot(study.covariance * g) + shift * shift);
}

}  // namespace

void report_characteristic_values(const VehicleProblem& problem, const StructuredAnswer& answer,
                                  const VehicleCovariance& of_noise, VehicleEstimate& estimate) {
  const VehicleParameters<double>& p = answer.p;
  const double u = problem.run->median_speed;
  const auto add = [&](const std::string& name, const std::string& unit, double per_si,
                       auto&& quantity) {
    const Characteristic here = characteristic(problem, p, quantity);
    if (!here.exists()) return;
    double se = kNone;
    if (here.by_free.size() > 0 && here.by_free.norm() > 0.0) {
      se = standard_error(problem, of_noise, here.by_free);
      if (std::isnan(se)) return;
      if (answer.study != nullptr) {
        const Characteristic there = characteristic(problem, answer.other, quantity);
        if (!there.exists()) return;
        se = std::hypot(answer.adopted ? 0.0 : se, structural_error(answer, here, there));
      }
    }
    estimate.derived.push_back({name, unit, here.value * per_si, se * per_si});
  };

  constexpr double kDegreePerG = kDegreesPerRadian * kStandardGravity;
  add("K", "rad/(m/s^2)", 1.0, [](const auto& car) { return understeer_gradient(car); });
  add("K per g", "deg/g", kDegreePerG, [](const auto& car) { return understeer_gradient(car); });
  add("DF", "deg/g", kDegreePerG, [](const auto& car) { return front_compliance(car); });
  add("DR", "deg/g", kDegreePerG, [](const auto& car) { return rear_compliance(car); });
  const bool understeers = p[kB] * p[kCr] > p[kA] * p[kCf];
  add(understeers ? "v_ch" : "v_cr", "km/h", 3.6,
      [](const auto& car) { return characteristic_speed(car); });
  const std::string at = fmt::format(" at {:.0f} km/h", 3.6 * u);
  add("yaw gain" + at, "1/s", 1.0,
      [u](const auto& car) { return steering_response(car, u).yaw_gain; });
  add("wn" + at, "rad/s", 1.0,
      [u](const auto& car) { return steering_response(car, u).natural_frequency; });
  add("zeta" + at, "", 1.0, [u](const auto& car) { return steering_response(car, u).damping; });
  add("Tz" + at, "s", 1.0,
      [u](const auto& car) { return steering_response(car, u).yaw_lead_time; });
  const auto& free = problem.unknowns.free;
  if (std::find(free.begin(), free.end(), kMass) != free.end()) {
    // The response to steering depends on these alone: they may be determined where the mass is
    // not.
    add("Cf/m", "N/(rad kg)", 1.0, [](const auto& car) { return car.front.stiffness / car.m; });
    add("Cr/m", "N/(rad kg)", 1.0, [](const auto& car) { return car.rear.stiffness / car.m; });
    add("Iz/m", "m^2", 1.0, [](const auto& car) { return car.Iz / car.m; });
  }
}

}  // namespace identikal
