#include "identify/simulation/manoeuvres.h"

#include <cmath>

#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/vehicle/lane_change.h"
#include "lib/vehicle/manoeuvre.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kSourceRatio = 21.0;  // of the steering, Sladká (2010), table 8.1

std::vector<ManoeuvreSetting> course_settings() {
  const CarBody body;
  return {{"width", "m", body.width, "of the car without mirrors: the gates follow from it"},
          {"front", "m", body.front, "from the centre of gravity to the front end"},
          {"rear", "m", body.rear, "from the centre of gravity to the rear end"},
          {"approach", "m", 20.0, "of the centre of gravity before the first gate"}};
}

std::vector<ManoeuvreSetting> circle_settings() {
  const SteadyCircle circle;
  return {{"radius", "m", circle.radius, "of the circle at the begin"},
          {"rise", "m/s^3", circle.rise, "of the lateral acceleration on that radius"}};
}

std::vector<Manoeuvre> known_manoeuvres() {
  const ManoeuvreSetting start{"start", "s", 1.0, "of the steering", false};
  const auto ay = [](double value) {
    return ManoeuvreSetting{"ay", "m/s^2", value, "steady lateral acceleration that the angle has",
                            false};
  };
  const SevereLaneChange open;
  const StepSteer step;
  const SineSteer sine;
  const SweepSteer sweep;
  const SineWithDwell dwell;
  return {{"severe-lane-change",
           "after ISO 3888-2",
           "open loop: a smooth swing of steering out of the lane and one back",
           60.0,
           7.0,
           {{"amplitude", "deg", unit_or_dimensionless("deg").from_si(open.amplitude),
             "of the steering wheel", false},
            {"start", "s", open.start, "of the first swing", false},
            {"period", "s", open.period, "of each swing"},
            {"pause", "s", open.pause, "between them", false}}},
          {"obstacle-avoidance", "ISO 3888-2", "severe lane change through gates, by a driver",
           60.0, 7.0, course_settings()},
          {"double-lane-change", "ISO 3888-1", "lane change and back through gates, by a driver",
           80.0, 8.0, course_settings()},
          {"step-steer",
           "ISO 7401",
           "an angle as fast as can be, then held",
           100.0,
           5.0,
           {ay(4.0), start, {"rise", "s", step.rise, "duration of the step"}}},
          {"sine",
           "ISO 7401",
           "one period of a sine",
           100.0,
           6.0,
           {ay(4.0),
            start,
            {"frequency", "Hz", sine.frequency, ""},
            {"periods", "", sine.periods, ""}}},
          {"sweep",
           "ISO 7401",
           "a sine of rising frequency",
           100.0,
           42.0,
           {ay(4.0),
            start,
            {"length", "s", sweep.duration, "of the sweep"},
            {"from", "Hz", sweep.from, ""},
            {"to", "Hz", sweep.to, ""},
            {"fade", "s", sweep.fade, "in and out"}}},
          {"steady-circle", "ISO 4138", "a circle of constant radius, speed rising slowly", 30.0,
           40.0, circle_settings()},
          {"constant-steering", "ISO 4138", "an angle held, speed rising slowly", 30.0, 40.0,
           circle_settings()},
          {"weave",
           "ISO 13674-1",
           "a slow sine about straight ahead",
           100.0,
           42.0,
           {ay(2.0), start, {"frequency", "Hz", 0.2, ""}, {"periods", "", 8.0, ""}}},
          {"sine-with-dwell",
           "ISO 19365",
           "a sine held at its second peak",
           80.0,
           6.0,
           {ay(0.3 * kStandardGravity),
            {"factor", "", 1.5, "amplitude over the angle of that acceleration"},
            start,
            {"frequency", "Hz", dwell.frequency, ""},
            {"dwell", "s", dwell.dwell, "at the second peak"}}}};
}

template <typename Named>
const Named& find_named(const std::vector<Named>& all, const std::string& name,
                        const std::string& what) {
  std::vector<std::string> names;
  std::string list;
  for (const Named& each : all) {
    if (each.name == name) return each;
    names.push_back(each.name);
    list += (list.empty() ? "" : ", ") + each.name;
  }
  throw InputError({}, fmt::format("unknown {} '{}'", what, name), list, did_you_mean(name, names));
}

/// A request with everything that it leaves open filled in.
struct Resolved {
  const Manoeuvre& manoeuvre;
  const ManoeuvreRequest& request;

  double speed() const {
    return request.speed.value_or(unit_or_dimensionless("km/h").to_si(manoeuvre.speed));
  }
  double operator[](const std::string& name) const {
    const auto given = request.settings.find(name);
    const ManoeuvreSetting& setting = find_setting(manoeuvre, name);
    return given != request.settings.end()
               ? given->second
               : unit_or_dimensionless(setting.unit).to_si(setting.value);
  }
};

std::string described(const Resolved& what) {
  std::string out =
      fmt::format("manoeuvre: {} ({}), {:.6g} km/h", what.manoeuvre.name, what.manoeuvre.standard,
                  unit_or_dimensionless("km/h").from_si(what.speed()));
  for (const ManoeuvreSetting& s : what.manoeuvre.settings) {
    out +=
        fmt::format(", {} = {:.6g}{}", s.name, unit_or_dimensionless(s.unit).from_si(what[s.name]),
                    s.unit.empty() ? "" : " " + s.unit);
  }
  return out;
}

DrivenRecord on_course(const Resolved& what, const std::vector<Gate>& course, TyreCurve curve,
                       const VehicleParameters<double>& p, const VectorXd& time) {
  if (p[kSteeringDelay] != 0.0 || p[kRelaxationLength] != 0.0) {
    throw InputError(
        {},
        fmt::format("{} has a driver, who cannot handle a steering delay or a relaxation length",
                    what.manoeuvre.name),
        "a car without them, or an open-loop manoeuvre");
  }
  const CarBody body{what["width"], what["front"], what["rear"]};
  DrivenRecord out;
  out.time = time;
  out.vx = VectorXd::Constant(time.size(), what.speed());
  out.steering.resize(time.size());
  const Eigen::Matrix3Xd poses = drive_along(
      car_with(curve, p), planned_path(course, body.width), PreviewDriver{}, time, out.vx,
      -what["approach"], [&out](Index row, const Motion& motion, double, double steering) {
        out.steering[row] = steering;
        out.motion.push_back(motion);
      });
  const std::vector<GatePassage> passages = gate_passages(course, body, poses);
  for (std::size_t g = 0; g < course.size(); ++g) {
    // Left behind only when the whole car is.
    const bool through = poses(0, poses.cols() - 1) > course[g].end + body.rear;
    const double clearance = passages[g].clearance;
    std::string how = "not reached";
    if (!std::isnan(clearance)) {
      how = fmt::format("{}, clearance {:.3f} m at X = {:.1f} m",
                        clearance < 0.0 ? "cones hit"
                        : through       ? "passed"
                                        : "not left behind",
                        clearance, passages[g].at);
    }
    out.notes.push_back(fmt::format("gate {}, {:g} to {:g} m, {:.3f} m wide: {}", g + 1,
                                    course[g].begin, course[g].end,
                                    course[g].left - course[g].right, how));
  }
  return out;
}

}  // namespace

const std::vector<Manoeuvre>& manoeuvres() {
  static const std::vector<Manoeuvre> all = known_manoeuvres();
  return all;
}

const Manoeuvre& find_manoeuvre(const std::string& name) {
  return name.empty() ? manoeuvres().front() : find_named(manoeuvres(), name, "manoeuvre");
}

const ManoeuvreSetting& find_setting(const Manoeuvre& manoeuvre, const std::string& name) {
  return find_named(manoeuvre.settings, name, "setting of " + manoeuvre.name);
}

std::string manoeuvre_help() {
  std::string out = "Manoeuvres, with what --with changes and its defaults:\n";
  for (const Manoeuvre& m : manoeuvres()) {
    out += fmt::format("  {} ({}): {}; {:g} km/h, {:g} s\n", m.name, m.standard, m.summary, m.speed,
                       m.duration);
    for (const ManoeuvreSetting& s : m.settings) {
      const std::string value =
          fmt::format("{}={:.6g}{}", s.name, s.value, s.unit.empty() ? "" : " " + s.unit);
      out += s.meaning.empty() ? fmt::format("      {}\n", value)
                               : fmt::format("      {:<22} {}\n", value, s.meaning);
    }
  }
  return out;
}

DrivenRecord drive_inputs(TyreCurve curve, const VehicleParameters<double>& p, const VectorXd& time,
                          const VectorXd& steering, const VectorXd& vx, bool from_steady_state) {
  DrivenRecord out{time, steering, vx, {}, {}};
  const SingleTrack<> linear = linear_car(p);
  const DrivenSegment driven =
      drive(time, steering, vx, {decay_rate_times_speed(linear), p[kRelaxationLength]},
            p[kSteeringDelay], p[kLagOfSteering]);
  const Eigen::Vector2d start = from_steady_state ? steady_state(linear, driven.nodes.front())
                                                  : Eigen::Vector2d(Eigen::Vector2d::Zero());
  simulate(car_with(curve, p), driven, start[0], start[1],
           [&out](Index, const Motion& motion, double) { out.motion.push_back(motion); });
  return out;
}

DrivenRecord drive_manoeuvre(const ManoeuvreRequest& request, TyreCurve curve,
                             const VehicleParameters<double>& p, bool steering_at_road_wheel) {
  const SingleTrack<> car = linear_car(p);
  const Manoeuvre& manoeuvre = find_manoeuvre(request.name);
  for (const auto& [name, value] : request.settings) {
    if (find_setting(manoeuvre, name).positive && !(value > 0.0)) {
      throw InputError({}, fmt::format("{} of {} is {:g}", name, manoeuvre.name, value),
                       "a positive value");
    }
  }
  const Resolved what{manoeuvre, request};
  const double rows = request.duration.value_or(manoeuvre.duration) * request.rate;
  if (!(what.speed() > 0.0 && request.rate > 0.0 && rows >= 2.0 && rows <= 1e8)) {
    throw InputError({}, "--speed, --rate and --duration describe no recording",
                     "positive values and 2 to 1e8 rows");
  }
  const auto N = static_cast<Index>(std::llround(rows));
  const VectorXd time = VectorXd::LinSpaced(N, 0.0, static_cast<double>(N - 1) / request.rate);
  const VectorXd constant_speed = VectorXd::Constant(N, what.speed());
  const double per_delta = car.steering_ratio / car.steering_gain;
  const std::string& name = manoeuvre.name;

  // Sensor angle of a lateral acceleration that is held.
  const auto angle_of = [&](double ay) {
    return per_delta * ay * road_wheel_angle(car, 1.0, what.speed()) /
           (what.speed() * what.speed());
  };
  const auto open_loop = [&](const auto& steer) {
    return drive_inputs(curve, p, time, steering(steer, time), constant_speed);
  };
  DrivenRecord out;
  if (name == "severe-lane-change") {
    const double at_wheel = steering_at_road_wheel ? kSourceRatio : 1.0;
    out = open_loop(SevereLaneChange{what["amplitude"] / at_wheel, what["start"], what["period"],
                                     what["pause"]});
  } else if (name == "obstacle-avoidance") {
    out = on_course(what, obstacle_avoidance_course(what["width"]), curve, p, time);
  } else if (name == "double-lane-change") {
    out = on_course(what, double_lane_change_course(what["width"]), curve, p, time);
  } else if (name == "step-steer") {
    out = open_loop(StepSteer{angle_of(what["ay"]), what["start"], what["rise"]});
  } else if (name == "sine" || name == "weave") {
    out = open_loop(
        SineSteer{angle_of(what["ay"]), what["start"], what["frequency"], what["periods"]});
  } else if (name == "sweep") {
    out = open_loop(SweepSteer{angle_of(what["ay"]), what["start"], what["length"], what["from"],
                               what["to"], what["fade"]});
  } else if (name == "sine-with-dwell") {
    out = open_loop(SineWithDwell{what["factor"] * angle_of(what["ay"]), what["start"],
                                  what["frequency"], what["dwell"]});
  } else {
    const SteadyCircle circle{what["radius"], what.speed(), what["rise"]};
    const VectorXd vx = time.unaryExpr([&](double t) { return speed(circle, t); });
    const bool radius_held = name == "steady-circle";
    const VectorXd angle = vx.unaryExpr([&](double u) {
      const double delta = road_wheel_angle(car, circle.radius, radius_held ? u : what.speed());
      return per_delta * delta - car.steering_offset;
    });
    out = drive_inputs(curve, p, time, angle, vx, true);
  }
  out.notes.insert(out.notes.begin(), described(what));
  return out;
}

}  // namespace identikal
