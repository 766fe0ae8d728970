#include "identify/vehicle/internal/structure_causes.h"

#include <algorithm>
#include <cmath>

#include "lib/base/constants.h"

namespace identikal {
namespace {

constexpr double kSmallAngle = 0.1;  // [rad]

class StudyUnknowns {
 public:
  StudyUnknowns(const VehicleProblem& problem, const VehicleParameters<double>& p)
      : problem_(problem), p_(p) {
    const VehicleUnknowns& u = problem.unknowns;
    for (std::size_t i = 0; i < u.free.size(); ++i) add_free(i);
    add_known(kSteeringDelay, 0.008, 0.25, "s", "the delay of the steering channel at standstill");
    if (u.find(kSteeringRatio) < 0) {
      add_known(kSteeringGain, 0.01, 0.5, "", "the steering ratio on a turn table");
    }
    const double road_wheel = p[kSteeringRatio] / 15.0 / kDegreesPerRadian;
    add_known(kSteeringOffset, 1.5 * road_wheel, 20.0 * road_wheel, "rad", "driving straight on");
    add_sensor_biases();
    add_effects();
  }

  std::vector<StudyUnknown> all;

 private:
  bool measured(VehicleQuantity quantity) const { return problem_.run->find(quantity) >= 0; }

  VehicleQuantity sideslip_sensor() const {
    return measured(VehicleQuantity::vy) ? VehicleQuantity::vy : VehicleQuantity::beta;
  }
  /// Whether the model file says, or frees, this of the sensor.
  bool has(VehicleQuantity quantity, SensorProperty property) const {
    return has(sensor_parameter(quantity, property));
  }
  bool has_roll() const { return problem_.run->roll.size() > 0 || has(kRollPerAcceleration); }
  /// Of what is absent at 0.
  bool has(VehicleParameter parameter) const {
    return problem_.unknowns.find(parameter) >= 0 || p_[parameter] != 0.0;
  }

  void add_free(std::size_t i) {
    const VehicleUnknowns& u = problem_.unknowns;
    const auto n = static_cast<Eigen::Index>(i);
    const bool effect = u.free[i] == kRelaxationLength;
    const double size = std::max(std::abs(p_[u.free[i]]), 0.1 * u.scale[n]);
    all.push_back({effect ? StudyUnknown::Kind::effect : StudyUnknown::Kind::free,
                   effect ? static_cast<int>(kTyreRelaxation) : static_cast<int>(u.free[i]),
                   1e-3 * size, u.lower[n], u.upper[n], 0.0, kInfinity, "", ""});
  }

  void add_known(VehicleParameter parameter, double sd, double limit, const std::string& unit,
                 const std::string& separated_by) {
    if (problem_.unknowns.find(parameter) >= 0) return;
    const double at = p_[parameter];
    all.push_back({StudyUnknown::Kind::known, parameter, 0.1 * sd, at - limit, at + limit, at, sd,
                   unit, separated_by});
  }

  void add_effect(SecondaryEffect effect, double mean, double sd, const std::string& unit,
                  const std::string& separated_by, bool positive = true) {
    all.push_back({StudyUnknown::Kind::effect, effect, 0.1 * sd, positive ? 0.0 : mean - 8.0 * sd,
                   mean + 8.0 * sd, mean, sd, unit, separated_by});
  }

  void add_sensor_biases() {
    const std::string straight = "driving straight on";
    if (measured(VehicleQuantity::r)) {
      add_known(kBiasR, 0.2 / kDegreesPerRadian, 0.1, "rad/s", straight);
    }
    if (measured(VehicleQuantity::ay)) add_known(kBiasAy, 0.1, 2.0, "m/s^2", straight);
    if (measured(VehicleQuantity::vy) || measured(VehicleQuantity::beta)) {
      add_known(kBiasVy, 0.05, 1.0, "m/s", straight);
    }
  }

  void add_effects() {
    const double wheelbase = p_[kA] + p_[kB];
    add_effect(kSteeringSmoothing, 0.0, 0.01, "s", "a finer steering sensor");
    if (!has(kLagOfSteering)) {
      // Most give way by little; an actuator or a column of rubber lags five times as long.
      add_effect(kSteeringLag, 0.0, 0.02, "s", "the angle of a road wheel");
      all.back().heavy_tails = true;
    }
    if (problem_.unknowns.find(kRelaxationLength) < 0 && !(p_[kRelaxationLength] > 0.0)) {
      add_effect(kTyreRelaxation, 0.1 * wheelbase, 0.1 * wheelbase, "m", "two more speeds");
    }
    // A share of the slip angle that belongs to the lateral acceleration.
    const double front = 0.15 * p_[kMass] * p_[kB] / wheelbase / p_[kCf];
    const double rear = 0.15 * p_[kMass] * p_[kA] / wheelbase / p_[kCr];
    if (has_roll()) {
      add_steer_of_roll(front, rear);
    } else {
      add_roll(front, rear);
    }
    if (problem_.unknowns.curve == TyreCurve::linear) {
      const std::string gently = "gentler driving, or `tyre: {curve: tanh}`";
      add_effect(kTyreSoftening, 0.8, 0.5, "", gently);
      add_effect(kRearSoftening, 0.0, 0.15, "", gently, false);
    }
    if (wide_angle(problem_, p_)) add_wide_angles();
    add_sensor_effects(wheelbase);
  }

  /// Angles of a car are wide, those of a simulator may be small of any size.
  void add_wide_angles() {
    add_effect(kWideAngles, 1.0, 0.3, "", "gentler turns");
    all.back().upper = 1.0;
    add_drive();
  }

  /// The driven wheels are known where the file says so; brakes and drag are on the others too.
  void add_drive() {
    const std::optional<double>& known = problem_.unknowns.front_drive;
    add_effect(kFrontDrive, known.value_or(0.5), known ? 0.1 : 0.35, "",
               known ? "a coasting drive" : "`driven_axle` in the model file");
    all.back().upper = 1.0;
  }

  /// @param front, rear  slip angles that may come by roll, over lateral acceleration
  void add_roll(double front, double rear) {
    const std::string roll = "the roll angle, or ay levelled by it";
    add_effect(kRollGradient, 0.005, 0.005, "rad/(m/s^2)", roll);
    add_effect(kRollSteerFront, 0.0, front, "rad/(m/s^2)", roll, false);
    add_effect(kRollSteerRear, 0.0, rear, "rad/(m/s^2)", roll, false);
    add_effect(kRollQuickness, 0.0, 0.5, "", roll, false);
    add_effect(kRollDecay, 0.0, 0.25, "", roll, false);
    const double wheelbase = p_[kA] + p_[kB];
    add_effect(kRollArm, 0.0, kUsualRollArm * wheelbase, "m", roll, false);
    all.back().lower = -2.0 * kUsualRollArm * wheelbase;  // an axis as far above the centre
  }

  /// Of a body whose roll the model has: steer and camber by it, where the file says nothing of them.
  void add_steer_of_roll(double front, double rear) {
    const double gradient =
        std::max(0.002, p_[kRollPerAcceleration] > 0.0 ? p_[kRollPerAcceleration] : 0.005);
    const std::string suspension = "the kinematics of the suspension";
    if (!has(kFrontSteerPerRoll) && !has(kFrontCamberPerRoll)) {
      add_known(kFrontSteerPerRoll, front / gradient, 8.0 * front / gradient, "", suspension);
    }
    if (!has(kRearSteerPerRoll) && !has(kRearCamberPerRoll)) {
      add_known(kRearSteerPerRoll, rear / gradient, 8.0 * rear / gradient, "", suspension);
    }
  }

  void add_sensor_effects(double wheelbase) {
    const bool sideslip = measured(VehicleQuantity::vy) || measured(VehicleQuantity::beta);
    const std::string place = "the place of the sensor";
    if (sideslip && !has(sideslip_sensor(), SensorProperty::x)) {
      add_effect(kArmOfVy, 0.0, 0.02 * wheelbase, "m", place, false);
    }
    if (sideslip) add_effect(kHeightOfVy, 0.0, 0.04 * wheelbase, "m", place, false);
    if (measured(VehicleQuantity::ay)) {
      if (!has(VehicleQuantity::ay, SensorProperty::x)) {
        add_effect(kArmOfAy, 0.0, 0.02 * wheelbase, "m", place, false);
      }
      add_effect(kHeightOfAy, 0.0, 0.1 * wheelbase, "m", place, false);
    }
    const std::string filters = "sensors that are filtered alike";
    const auto add_filter = [&](bool any, VehicleQuantity quantity) {
      if (!any || has(quantity, SensorProperty::lag)) return;
      add_effect(filter_of(quantity), 0.0, 0.004, "s", filters);
    };
    const auto add_gain = [&](VehicleQuantity quantity) {
      add_known(sensor_parameter(quantity, SensorProperty::gain), 0.01, 0.3, "",
                "a calibration of the sensors");
    };
    for (const VehicleRun::Output& output : problem_.run->outputs) add_gain(output.sensor.quantity);
    add_filter(measured(VehicleQuantity::r), VehicleQuantity::r);
    add_filter(sideslip, sideslip_sensor());
    add_filter(measured(VehicleQuantity::ay), VehicleQuantity::ay);
  }

  const VehicleProblem& problem_;
  const VehicleParameters<double>& p_;
};

}  // namespace

double& entry(StudyPoint& point, const StudyUnknown& unknown) {
  return unknown.kind == StudyUnknown::Kind::effect ? point.effects[unknown.index]
                                                    : point.p[unknown.index];
}

double entry(const StudyPoint& point, const StudyUnknown& unknown) {
  return unknown.kind == StudyUnknown::Kind::effect ? point.effects[unknown.index]
                                                    : point.p[unknown.index];
}

std::string name_of(const StudyUnknown& unknown) {
  return std::string(unknown.kind == StudyUnknown::Kind::effect
                         ? name_of(static_cast<SecondaryEffect>(unknown.index))
                         : name_of(static_cast<VehicleParameter>(unknown.index)));
}

std::optional<double> wide_angle(const VehicleProblem& problem,
                                 const VehicleParameters<double>& p) {
  double largest = 0.0;
  for (const VehicleRun::Segment& s : problem.run->segments) {
    largest =
        std::max(largest, problem.run->steering.segment(s.first, s.rows).cwiseAbs().maxCoeff());
  }
  largest *= std::abs(p[kSteeringGain] / p[kSteeringRatio]);
  return largest > kSmallAngle ? std::optional(largest) : std::nullopt;
}

SecondaryEffect filter_of(VehicleQuantity quantity) {
  if (quantity == VehicleQuantity::r) return kLagOfR;
  return quantity == VehicleQuantity::ay ? kLagOfAy : kLagOfVy;
}

std::vector<StudyUnknown> study_unknowns(const VehicleProblem& problem,
                                         const VehicleParameters<double>& p) {
  return StudyUnknowns(problem, p).all;
}

}  // namespace identikal
