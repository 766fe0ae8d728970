#include "identify/vehicle/unknowns.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

// Bounds of positive parameters that have none in the model file, in units of the typical size.
// What ends here is reported as at its bound: the likelihood rises towards a rigid car.
constexpr double kSmallest = 1e-3, kLargest = 20.0;
// Relaxation lengths in wheelbases: shorter ones take ever shorter steps for what no drive shows. One
// that is searched for ends at the first unless the model file has a `min`, none may be below the second.
constexpr double kLeastSearched = 0.02, kLeastRelaxation = 0.002;
constexpr double kLongestDelay = 1.0;         // [s], of the steering; and its longest lag
constexpr double kLargestAngle = 0.3;         // [rad], of mounting and bank
constexpr double kLargestRollGradient = 0.1;  // [rad/(m/s^2)], 56 deg/g
constexpr double kLargestDegression = 0.95;   // above 1 nothing would be left
constexpr double kLongestSensorDelay = 0.5;   // [s]
constexpr double kLongestSensorLag = 1.0;     // [s]
constexpr double kLeastFiala = 1e-6;          // inverse saturation in typical sizes

bool is_inverse_saturation(VehicleParameter p) {
  return p == kInverseSaturationFront || p == kInverseSaturationRear;
}

bool is_sensor(VehicleParameter p) { return p >= kFirstOfSensors; }
bool is_sensor(VehicleParameter p, SensorProperty property) {
  return is_sensor(p) && property_of(p) == property;
}

double wheelbase(const VehicleParameters<double>& p) { return p[kA] + p[kB]; }

double typical_size(SensorProperty property, double wheelbase) {
  switch (property) {
    case SensorProperty::gain:
      return 1.0;
    case SensorProperty::delay:
      return 0.05;
    case SensorProperty::x:
    case SensorProperty::y:
      return 0.2 * wheelbase;
    case SensorProperty::lag:
    case SensorProperty::angle:
      break;
  }
  return 0.02;
}

double typical_size(VehicleParameter parameter, const VehicleParameters<double>& p) {
  if (is_sensor(parameter)) return typical_size(property_of(parameter), wheelbase(p));
  switch (parameter) {
    case kYawInertia:
      return p[kMass] * p[kA] * p[kB];
    case kCf:
      return 10.0 * axle_loads(p)[0];
    case kCr:
      return 10.0 * axle_loads(p)[1];
    case kSteeringOffset:
    case kMountingAngle:
    case kBiasR:
    case kBank:
      return 0.02;
    case kSteeringDelay:
    case kLagOfSteering:
      return 0.05;
    case kRollPerAcceleration:
      return 0.005;
    case kRollHeight:
    case kRelaxationLength:
    case kCgHeight:
      return 0.2 * wheelbase(p);
    case kFrontSteerPerRoll:
    case kRearSteerPerRoll:
      return 0.1;
    case kFrontCamberPerRoll:
      return axle_loads(p)[0];
    case kRearCamberPerRoll:
      return axle_loads(p)[1];
    case kBiasVy:
    case kBiasAy:
      return 0.2;
    case kCurveCurvature:
      return 1.0;
    case kSteeringCompliance:
      return 0.1 / typical_size(kCf, p);
    case kDegression:
      return 0.3;
    case kInverseSaturationFront:
      return 1.0 / std::pow(axle_loads(p)[0], 2);
    case kInverseSaturationRear:
      return 1.0 / std::pow(axle_loads(p)[1], 2);
    default:
      return p[parameter] != 0.0 ? std::abs(p[parameter]) : 1.0;
  }
}

std::vector<std::string> parameter_names() {
  std::vector<std::string> out;
  for (int i = 0; i < kVehicleParameters; ++i) {
    out.emplace_back(name_of(static_cast<VehicleParameter>(i)));
  }
  return out;
}

/// Which parameter this is.
/// @return nothing for a steering ratio that an angle at the road wheels does not have
/// @throws InputError when the vehicle does not have it, or it cannot have this value
std::optional<VehicleParameter> checked_parameter(const Model& model, const Parameter& given) {
  const Location at{model.source, 0, 0};
  const auto parameter = vehicle_parameter(given.name);
  if (!parameter) {
    throw InputError(at, "parameter '" + given.name + "'", "one of the single-track vehicle's",
                     did_you_mean(given.name, parameter_names()));
  }
  if (*parameter == kSteeringRatio && as_vehicle(model).steering_at_road_wheel) {
    if (given.fixed) return std::nullopt;
    throw InputError(at, "steering_ratio is to be fitted, but the angle is that of the road wheel",
                     "", "fit steering_gain instead");
  }
  if (must_be_positive(*parameter) && !(given.scalar() > 0.0)) {
    throw InputError(at, fmt::format("parameter '{}' is {:g}", given.name, given.scalar()),
                     "a positive number");
  }
  return parameter;
}

/// @throws InputError for a known relaxation length that takes too short steps
void require_steps(const Model& model, const VehicleParameters<double>& p) {
  const double length = p[kRelaxationLength], least = kLeastRelaxation * wheelbase(p);
  if (!(length > 0.0 && length < least)) return;
  throw InputError(
      {model.source, 0, 0}, fmt::format("parameter 'relaxation_length' is {:g} m", length),
      fmt::format("0 for none, or at least {:g} wheelbases, {:.3g} m", kLeastRelaxation, least));
}

/// The range that the model file allows: bounds, and those of the prior.
std::pair<double, double> allowed_range(const Model& model, const Parameter& given) {
  double low = given.min, high = given.max;
  if (given.prior.kind == Prior::Kind::uniform || given.prior.kind == Prior::Kind::log_uniform) {
    low = std::max(low, given.prior.a);
    high = std::min(high, given.prior.b);
  }
  if (given.prior.kind == Prior::Kind::log_normal) {
    if (!(given.scalar() > 0.0)) {
      throw InputError(
          {model.source, 0, 0},
          fmt::format("parameter '{}' starts at {:g}, where its log-normal prior does not reach",
                      given.name, given.scalar()),
          "a start above 0");
    }
    low = std::max(low, kSmallest * given.prior.a);
  }
  return {low, high};
}

/// Sets the parameter free with prior and bounds of the model file.
void set_free_as_given(const Model& model, std::size_t position, VehicleUnknowns& out) {
  const Parameter& given = model.parameters[position];
  const VehicleParameter parameter = *vehicle_parameter(given.name);
  set_free(out, parameter);
  out.position.back() = position;
  out.is_stated.back() = true;
  out.prior.back() = given.prior;
  const auto [low, high] = allowed_range(model, given);
  const Eigen::Index k = out.scale.size() - 1;
  if (is_inverse_saturation(parameter)) {
    if (std::isfinite(high)) out.lower[k] = 1.0 / (high * high);
    if (low > 0.0) out.upper[k] = 1.0 / (low * low);
    out.upper[k] = std::max(out.upper[k], out.lower[k]);
  } else {
    if (parameter == kRelaxationLength && low > 0.0) {
      out.lower[k] = kLeastRelaxation * wheelbase(out.value);
    }
    out.lower[k] = std::max(out.lower[k], low);
    // What the file allows expressly is allowed.
    if (std::isfinite(high)) out.upper[k] = high;
    const bool bounded_both_ways =
        parameter == kSteeringDelay || parameter == kMountingAngle || parameter == kBank ||
        is_sensor(parameter, SensorProperty::delay) || is_sensor(parameter, SensorProperty::angle);
    if (bounded_both_ways && std::isfinite(low)) out.lower[k] = low;
  }
  double& start = out.value[parameter];
  start = std::min(std::max(start, out.lower[k]), out.upper[k]);
}

}  // namespace

bool must_be_positive(VehicleParameter p) {
  return p == kMass || p == kA || p == kB || p == kYawInertia || p == kCf || p == kCr ||
         p == kSteeringRatio || is_inverse_saturation(p) || p == kCurveShape ||
         p == kRollFrequency || p == kRollDamping || is_sensor(p, SensorProperty::gain);
}

UserValue in_user_terms(VehicleParameter parameter, double value) {
  if (!is_inverse_saturation(parameter)) return {value, 1.0};
  const double force = 1.0 / std::sqrt(value);
  return {force, -0.5 * force / value};
}

double from_user_terms(VehicleParameter parameter, double value) {
  return is_inverse_saturation(parameter) ? 1.0 / (value * value) : value;
}

Eigen::Index VehicleUnknowns::find(VehicleParameter parameter) const {
  const auto at = std::find(free.begin(), free.end(), parameter);
  return at == free.end() ? -1 : at - free.begin();
}

bool is_straight(const VehicleUnknowns& unknowns, std::size_t free, double value) {
  const double least = kLeastFiala * unknowns.scale[free];
  return is_inverse_saturation(unknowns.free[free]) && value <= least * (1.0 + 1e-6);
}

Eigen::Vector2d axle_loads(const VehicleParameters<double>& p) {
  const double weight = p[kMass] * kStandardGravity / (p[kA] + p[kB]);
  return {weight * p[kB], weight * p[kA]};
}

void set_free(VehicleUnknowns& unknowns, VehicleParameter parameter) {
  const VehicleParameters<double>& p = unknowns.value;
  const double scale = typical_size(parameter, p);
  double lower = -kInfinity, upper = kInfinity;
  if (must_be_positive(parameter)) {
    lower = kSmallest * scale;
    upper = kLargest * scale;
  }
  if (is_inverse_saturation(parameter)) {
    // Nobody drives at a friction below 0.1. The derivative of Fiala's curve by the inverse
    // saturation is infinite at 0.
    lower = unknowns.curve == TyreCurve::fiala ? kLeastFiala * scale : 0.0;
    upper = 100.0 * scale;
  }
  if (parameter == kSteeringDelay) {
    lower = -kLongestDelay;
    upper = kLongestDelay;
  }
  if (is_sensor(parameter, SensorProperty::delay)) {
    lower = -kLongestSensorDelay;
    upper = kLongestSensorDelay;
  }
  if (is_sensor(parameter, SensorProperty::lag)) {
    lower = 0.0;
    upper = kLongestSensorLag;
  }
  if (parameter == kMountingAngle || parameter == kBank ||
      is_sensor(parameter, SensorProperty::angle)) {
    lower = -kLargestAngle;
    upper = kLargestAngle;
  }
  if (parameter == kRelaxationLength) lower = kLeastSearched * wheelbase(p);
  if (parameter == kSteeringCompliance || parameter == kDegression) lower = 0.0;
  if (parameter == kDegression) upper = kLargestDegression;
  if (parameter == kCgHeight || parameter == kLoadSensitivity || parameter == kRollHeight) {
    lower = 0.0;
  }
  if (parameter == kLagOfSteering) {
    lower = 0.0;
    upper = kLongestDelay;
  }
  if (parameter == kRollPerAcceleration) {
    lower = 0.0;
    upper = kLargestRollGradient;
  }
  if (parameter == kCurveShape) {
    lower = 1.0;
    upper = 2.0;
  }
  if (parameter == kCurveCurvature) upper = 1.0;
  const auto k = static_cast<Eigen::Index>(unknowns.free.size());
  unknowns.free.push_back(parameter);
  unknowns.position.push_back(0);
  unknowns.is_stated.push_back(false);
  unknowns.prior.emplace_back();
  for (const auto& [vector, value] :
       {std::pair{&unknowns.lower, lower}, {&unknowns.upper, upper}, {&unknowns.scale, scale}}) {
    vector->conservativeResize(k + 1);
    (*vector)[k] = value;
  }
}

VehicleUnknowns vehicle_unknowns(const Model& model) {
  VehicleUnknowns out;
  out.value = neutral_vehicle();
  out.curve = as_vehicle(model).curve;
  out.front_drive = as_vehicle(model).front_drive;
  std::vector<std::size_t> unknown;
  bool searches_relaxation = false;
  for (std::size_t i = 0; i < model.parameters.size(); ++i) {
    const Parameter& given = model.parameters[i];
    const auto parameter = checked_parameter(model, given);
    if (!parameter) continue;
    out.value[*parameter] = from_user_terms(*parameter, given.scalar());
    if (!given.fixed) unknown.push_back(i);
    if (!given.fixed && *parameter == kRelaxationLength) searches_relaxation = true;
  }
  for (int i = 0; i < kVehicleParameters; ++i) {
    const auto parameter = static_cast<VehicleParameter>(i);
    if (std::isnan(out.value[parameter])) {
      throw InputError({model.source, 0, 0},
                       fmt::format("parameter '{}' is missing", name_of(parameter)),
                       "a value or a start for it");
    }
  }
  if (!searches_relaxation) require_steps(model, out.value);
  // Typical sizes need the values of all.
  for (const std::size_t i : unknown) set_free_as_given(model, i, out);
  out.constraints = model.constraints;
  out.stated.resize(static_cast<Eigen::Index>(model.parameters.size()));
  for (Eigen::Index i = 0; i < out.stated.size(); ++i) out.stated[i] = model.parameters[i].scalar();
  return out;
}

VehicleUnknowns with_curve(VehicleUnknowns unknowns, TyreCurve curve) {
  unknowns.curve = curve;
  for (const VehicleParameter parameter : {kInverseSaturationFront, kInverseSaturationRear}) {
    const Eigen::Index at = unknowns.find(parameter);
    if (at < 0) {
      if (unknowns.value[parameter] == 0.0 && curve != TyreCurve::linear) {
        unknowns.value[parameter] = typical_size(parameter, unknowns.value);
        set_free(unknowns, parameter);
      }
    } else if (curve == TyreCurve::fiala) {
      unknowns.lower[at] = std::max(unknowns.lower[at], kLeastFiala * unknowns.scale[at]);
    }
  }
  return unknowns;
}

IntegrationDemand demand_of(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p) {
  IntegrationDemand out;
  out.decay_rate = decay_rate_times_speed(linear_car(p));
  const Eigen::Index relaxation = unknowns.find(kRelaxationLength);
  out.relaxation_length = relaxation < 0 ? p[kRelaxationLength] : unknowns.lower[relaxation];
  return out;
}

}  // namespace identikal
