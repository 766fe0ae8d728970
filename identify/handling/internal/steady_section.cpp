#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "identify/handling/internal/carried_errors.h"
#include "identify/handling/internal/sections.h"
#include "identify/handling/internal/steady_turns.h"
#include "lib/base/constants.h"
#include "lib/vehicle/steady_turn.h"
#include "lib/vehicle/steering_response.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Value = HandlingSheet::Value;
using Figure = HandlingSheet::Figure;
using Seconds = std::vector<SteadySecond>;

constexpr double kLeastTurn = 1.0;  // [m/s^2]
constexpr double kDegreePerG = kDegreesPerRadian * kStandardGravity;

template <typename Quantity>
Value of_car(const KnownVehicle& car, Quantity&& quantity) {
  return with_carried_errors(car, [&](const VehicleParameters<double>& p) {
    return VectorXd::Constant(1, quantity(car_with(car.curve, p)));
  })[0];
}

/// As the fit has printed it, whose error knows more of the structure than a covariance can say.
Value as_derived(const KnownVehicle& car, const char* name, Value value) {
  const auto found = std::find_if(car.derived.begin(), car.derived.end(),
                                  [&](const DerivedValue& d) { return d.name == name; });
  if (found == car.derived.end() || !std::isfinite(found->se)) return value;
  if (std::abs(found->value - value.value) > 1e-6 * std::abs(value.value)) return value;
  if (std::isfinite(value.se) && found->se < value.se) return value;
  return of_log(value.value, found->se, car.freedom);
}

/// What the log says of the linear range.
struct SteadyLog {
  Seconds all, linear;
  std::string why;      ///< there is no regression; empty: there is
  std::string no_beta;  ///< there is none of the sideslip
  SteadyLine K;
};

SteadyLog steady_log(const KnownVehicle& car, const std::optional<HandlingLog>& log) {
  SteadyLog out;
  if (!log) {
    out.why = out.no_beta = kNoLog;
    return out;
  }
  if (log->run.find(VehicleQuantity::r) < 0) {
    out.why = out.no_beta = "The log has no yaw rate.";
    return out;
  }
  out.all = steady_seconds(log->signals, linear_car(car.p));
  out.linear = linear_seconds(out.all);
  out.why = out.no_beta = too_little_turning(out.linear);
  if (!out.why.empty()) return out;
  out.K = understeer_line(out.linear, car.p[kA] + car.p[kB]);
  const bool no_beta = std::any_of(out.linear.begin(), out.linear.end(),
                                   [](const SteadySecond& s) { return std::isnan(s.beta); });
  if (no_beta) out.no_beta = "The log has neither vy nor beta.";
  return out;
}

Value line_value(const SteadyLine& line, double per_si) {
  if (!std::isfinite(line.slope)) return blank("The regression has no slope.");
  return in_units(of_log(line.slope, line.slope_se, line.freedom), per_si);
}

/// K of a car with bending tyres over the log's own turns, by the log's own regression.
Value gradient_over(const KnownVehicle& car, const Seconds& seconds) {
  return with_carried_errors(car, [&](const VehicleParameters<double>& p) {
    const SingleTrack<> at = car_with(car.curve, p);
    Seconds turned = seconds;
    for (SteadySecond& s : turned) s.angle = steady_turn(at, s.ay(), s.vx).road_wheel_angle;
    return VectorXd::Constant(1, kDegreePerG * understeer_line(turned, at.a + at.b).slope);
  })[0];
}

void add_gradients(const KnownVehicle& car, const SteadyLog& log, HandlingSheet::Section& out) {
  const auto from_log = [&](const SteadyLine& line, double per_si, const std::string& why) {
    return why.empty() ? line_value(line, per_si) : blank(why);
  };
  Figure K{"understeer gradient K", "deg/g", from_log(log.K, kDegreePerG, log.why), {}};
  K.model =
      as_derived(car, "K per g",
                 of_car(car, [](const auto& c) { return kDegreePerG * understeer_gradient(c); }));
  out.figures.push_back(K);
  if (car.curve != TyreCurve::linear && log.why.empty()) {
    out.figures.push_back({"K of the model over these turns", "deg/g",
                           blank("It is the figure above."), gradient_over(car, log.linear)});
  }
  SteadyLine front, rear;
  if (log.no_beta.empty()) {
    rear = sideslip_line(log.linear, car.p[kB]);
    Seconds slip = log.linear;
    for (SteadySecond& s : slip) s.angle -= s.beta;
    front = understeer_line(slip, car.p[kA]);
  }
  Figure DF{"front axle compliance", "deg/g", from_log(front, kDegreePerG, log.no_beta), {}};
  DF.model = as_derived(
      car, "DF", of_car(car, [](const auto& c) { return kDegreePerG * front_compliance(c); }));
  Figure DR{"rear axle compliance", "deg/g", from_log(rear, -kDegreePerG, log.no_beta), {}};
  DR.model = as_derived(
      car, "DR", of_car(car, [](const auto& c) { return kDegreePerG * rear_compliance(c); }));
  out.figures.push_back(DF);
  out.figures.push_back(DR);
}

/// sqrt(L / |K|), where K is surely not zero.
void add_special_speed(const KnownVehicle& car, const SteadyLog& log, HandlingSheet::Section& out) {
  constexpr double kSure = 2.0;  // standard errors
  const double L = car.p[kA] + car.p[kB];
  const bool understeers = understeer_gradient(linear_car(car.p)) > 0.0;
  Figure speed{understeers ? "characteristic speed" : "critical speed", "km/h", blank(log.why), {}};
  if (log.why.empty()) {
    const double K = log.K.slope, se = log.K.slope_se;
    if ((K > 0.0) != understeers || !(std::abs(K) > kSure * se)) {
      speed.log = blank(understeers ? "The log's K is not significantly above zero."
                                    : "The log's K is not significantly below zero.");
    } else {
      const double v = std::sqrt(L / std::abs(K));
      speed.log = in_units(of_log(v, 0.5 * v * se / std::abs(K), log.K.freedom), 3.6);
    }
  }
  const Value& K = out.figures.front().model;
  speed.model =
      std::abs(K.value) <= kSure * K.se
          ? blank("The model's K is not significantly different from zero.")
          : as_derived(car, understeers ? "v_ch" : "v_cr",
                       of_car(car, [](const auto& c) { return 3.6 * characteristic_speed(c); }));
  out.figures.push_back(speed);
}

Value friction_of(const KnownVehicle& car, bool front) {
  return of_car(car, [&](const SingleTrack<>& c) {
    const double load = c.m * kStandardGravity * (front ? c.b : c.a) / (c.a + c.b);
    return largest_force(front ? c.front : c.rear) / load;
  });
}

void add_limit(const KnownVehicle& car, const SteadyLog& log, HandlingSheet::Section& out) {
  Figure limit{"largest steady ay", "m/s^2", blank(log.why), {}};
  const auto largest = std::max_element(log.all.begin(), log.all.end(),
                                        [](const SteadySecond& a, const SteadySecond& b) {
                                          return std::abs(a.ay()) < std::abs(b.ay());
                                        });
  if (largest != log.all.end()) {
    const double held = std::abs(largest->ay());
    limit.log = held >= kLeastTurn ? of_log(held, largest->ay_se)
                                   : blank("The log holds no quasi-steady turning above 1 m/s^2.");
  }
  const bool linear = car.curve == TyreCurve::linear;
  const std::string no_limit =
      linear ? "The model's tyres are linear: it has no limit."
             : "The fit shows no largest force: as far as it was driven the axle stays straight.";
  const auto or_no_limit = [&](const Value& value) {
    return std::isfinite(value.value) ? value : blank(no_limit);
  };
  limit.model = or_no_limit(
      of_car(car, [](const SingleTrack<>& c) { return largest_steady_acceleration(c); }));
  out.figures.push_back(limit);
  if (linear) return;
  const std::string no_force = "A log alone shows no largest force of an axle.";
  out.figures.push_back(
      {"friction of the front axle", "", blank(no_force), or_no_limit(friction_of(car, true))});
  out.figures.push_back(
      {"friction of the rear axle", "", blank(no_force), or_no_limit(friction_of(car, false))});
}

/// Means of the seconds of one bin.
struct Bin {
  Seconds seconds;
  double mean(double (*of)(const SteadySecond&)) const {
    double sum = 0.0;
    for (const SteadySecond& s : seconds) sum += of(s);
    return sum / static_cast<double>(seconds.size());
  }
  /// Of the mean: the scatter of `e` about zero, of so many seconds correlated by f.
  double se(double scatter, double f) const {
    return scatter * std::sqrt(f / static_cast<double>(seconds.size()));
  }
};

/// Deviations from a straight line through the seconds of a bin: what is left is noise.
double scatter_in(const std::map<int, Bin>& bins, double (*y)(const SteadySecond&)) {
  double squares = 0.0, freedom = 0.0;
  for (const auto& [number, bin] : bins) {
    const auto n = static_cast<Index>(bin.seconds.size());
    if (n < 4) continue;
    VectorXd ay(n), values(n);
    for (Index i = 0; i < n; ++i) {
      ay[i] = bin.seconds[i].ay();
      values[i] = y(bin.seconds[i]);
    }
    const SteadyLine line = steady_line(ay, values);
    if (!std::isfinite(line.sd)) continue;
    squares += line.sd * line.sd * static_cast<double>(n - 2);
    freedom += static_cast<double>(n - 2);
  }
  return freedom > 0.0 ? std::sqrt(squares / freedom) : kNone;
}

void add_curve(const KnownVehicle& car, const SteadyLog& log, HandlingSheet& sheet) {
  constexpr double kWidth = 1.0;  // [m/s^2]
  std::map<int, Bin> bins;
  for (const SteadySecond& s : log.all) {
    bins[static_cast<int>(std::lround(s.ay() / kWidth))].seconds.push_back(s);
  }
  const double L = car.p[kA] + car.p[kB], per_wheel = car.p[kSteeringRatio] / car.p[kSteeringGain];
  const auto beta_of = [](const SteadySecond& s) { return s.beta; };
  // The curvature of the road moves the angle; what is left of it does not.
  std::map<int, Bin> freed = bins;
  for (auto& [number, bin] : freed) {
    for (SteadySecond& s : bin.seconds) {
      s.angle -= L * s.r / s.vx;
      s.beta -= car.p[kB] * s.r / s.vx;
    }
  }
  const double angle_sd = scatter_in(freed, [](const SteadySecond&s) { return s.angle; }),
               beta_sd = scatter_in(freed, beta_of);
  for (const auto& entry : bins) {
    const auto number = entry.first;
    const Bin& bin = entry.second;
    HandlingSheet::CurvePoint point;
    point.ay = bin.mean([](const SteadySecond& s) { return s.ay(); });
    point.seconds = static_cast<double>(bin.seconds.size());
    point.speed = bin.mean([](const SteadySecond& s) { return s.vx; });
    const double angle = bin.mean([](const SteadySecond&s) { return s.steering; }),
                 r = bin.mean([](const SteadySecond&s) { return s.r; }), beta = bin.mean(beta_of);
    const double angle_se = bin.se(per_wheel * angle_sd, log.K.correlation);
    point.angle_log = in_units(of_log(angle, angle_se), kDegreesPerRadian);
    point.sideslip_log =
        std::isfinite(beta)
            ? in_units(of_log(beta, bin.se(beta_sd, log.K.correlation)), kDegreesPerRadian)
            : blank("The log has neither vy nor beta.");
    const std::vector<Value> model =
        with_carried_errors(car, [&](const VehicleParameters<double>& p) {
          const SingleTrack<> c = car_with(car.curve, p);
          // Means as those of the log: what is turned at several speeds has no speed of its own.
          double steering = 0.0, sideslip = 0.0;
          for (const SteadySecond& second : bin.seconds) {
            const SteadyTurn turn = steady_turn(c, second.ay(), second.vx);
            steering += turn.road_wheel_angle * c.steering_ratio / c.steering_gain;
            sideslip += turn.sideslip;
          }
          steering /= point.seconds;
          sideslip /= point.seconds;
          return VectorXd(Eigen::Vector3d(kDegreesPerRadian * steering, r / steering,
                                          kDegreesPerRadian * sideslip));
        });
    point.angle_model = model[0];
    point.sideslip_model = model[2];
    // Straight on a gain is noise over noise.
    if (number == 0) {
      point.yaw_gain_log = point.yaw_gain_model = blank("The car drives nearly straight on.");
    } else {
      point.yaw_gain_log = of_log(r / angle, std::abs(r / angle * angle_se / angle));
      point.yaw_gain_model = model[1];
    }
    sheet.curve.push_back(point);
  }
}

}  // namespace

void add_steady_section(const KnownVehicle& car, const std::optional<HandlingLog>& log,
                        HandlingSheet& sheet) {
  HandlingSheet::Section out{"ISO 4138", "steady-state circular driving", {}, {}};
  const SteadyLog steady = steady_log(car, log);
  add_gradients(car, steady, out);
  add_special_speed(car, steady, out);
  add_limit(car, steady, out);
  if (steady.why.empty()) {
    out.remarks.push_back(fmt::format(
        "K and the compliances of the log are slopes over {} s of quasi-steady driving up to 4 "
        "m/s^2 (vx r), with the steering ratio, wheelbase and centre of gravity of the model; "
        "errors are those of {:.3g} independent seconds.",
        steady.linear.size(), static_cast<double>(steady.linear.size()) / steady.K.correlation));
    add_curve(car, steady, sheet);
  }
  sheet.sections.push_back(std::move(out));
}

}  // namespace identikal
