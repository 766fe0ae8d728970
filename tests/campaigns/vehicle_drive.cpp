#include "tests/campaigns/vehicle_drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/vehicle/secondary_effects.h"
#include "lib/vehicle/steering_response.h"
#include "studies/sladka_lane_change.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using testing::known;
using testing::unknown;

constexpr double kRate = 50.0, kSeconds = 30.0;  // [Hz], [s]
constexpr double kPerDegree = 1.0 / kDegreesPerRadian;

struct Car {
  const char* name;
  double m, a, b, Iz, Cf, Cr, ratio, slow, fast;  // speeds [km/h]
};

constexpr std::array<Car, 6> kCars = {{
    {"sedan", 1500, 1.15, 1.55, 2500, 95e3, 120e3, 16, 50, 110},
    {"electric car", 2300, 1.45, 1.50, 4200, 150e3, 190e3, 15, 50, 120},
    {"lorry", 18000, 2.6, 1.9, 90e3, 600e3, 900e3, 20, 40, 80},
    {"race car", 800, 1.6, 1.2, 900, 110e3, 160e3, 12, 80, 160},
    {"model car", 3.7, 0.16, 0.17, 0.047, 94, 101, 1, 12, 20},
    {"oversteering car", 1300, 1.35, 1.15, 1900, 100e3, 95e3, 17, 40, 75},
}};

/// All that is drawn before the drive is simulated.
struct Setting {
  SingleTrack<> car;
  SecondaryEffects effects{};
  double speed = 0.0;
  int manoeuvre = 0;
  std::vector<std::string> outputs;
  double angle = 0.0;  // size of the manoeuvre, at the wheel that is measured [rad]
};

double between(Random& random, double low, double high) {
  return low + (high - low) * random.uniform();
}

// Evenly in its logarithm, of either sign.
double signed_size(Random& random, double low, double high) {
  const double size = low * std::pow(high / low, random.uniform());
  return random.uniform() < 0.5 ? -size : size;
}

SingleTrack<> as_single_track(const Car& car) {
  VehicleParameters<double> p = neutral_vehicle();
  p[kMass] = car.m;
  p[kA] = car.a;
  p[kB] = car.b;
  p[kYawInertia] = car.Iz;
  p[kCf] = car.Cf;
  p[kCr] = car.Cr;
  p[kSteeringRatio] = car.ratio;
  return linear_car(p);
}

Setting draw_setting(Random& random, std::string& words) {
  const Car& kind = kCars[static_cast<std::size_t>(random.uniform() * kCars.size())];
  Setting out;
  out.car = as_single_track(kind);
  const double wheelbase = kind.a + kind.b;
  if (random.uniform() < 0.6) {
    out.effects[kTyreRelaxation] = between(random, 0.02, 0.2) * wheelbase;
    out.effects[kSteeringLag] = between(random, 0.0, 0.02);
    out.effects[kRollGradient] = between(random, 0.0, 0.012);
    out.effects[kRollSteerFront] =
        between(random, -0.15, 0.15) * kind.m * kind.b / wheelbase / kind.Cf;
    out.effects[kRollSteerRear] =
        between(random, -0.15, 0.15) * kind.m * kind.a / wheelbase / kind.Cr;
  }
  out.effects[kTyreSoftening] = between(random, 0.3, 1.2);
  out.speed = between(random, kind.slow, kind.fast) / 3.6;
  out.manoeuvre = static_cast<int>(4.0 * random.uniform());
  const std::array<std::vector<std::string>, 3> channels = {
      {{"r", "ay"}, {"r", "vy"}, {"r", "ay", "vy"}}};
  out.outputs = channels[static_cast<std::size_t>(3.0 * random.uniform())];
  // Steady lateral acceleration per wheel angle.
  const double K = understeer_gradient(out.car);
  const double per_angle =
      out.speed * out.speed / (wheelbase + K * out.speed * out.speed) / kind.ratio;
  out.angle = between(random, 1.5, 4.0) / std::abs(per_angle);
  constexpr std::array<const char*, 4> kManoeuvres = {"sweep", "steps", "slalom", "daily"};
  words = fmt::format("{}, {} at {:.0f} km/h, {}{}", kind.name, kManoeuvres[out.manoeuvre],
                      3.6 * out.speed, out.outputs.size() == 3 ? "r ay vy" : "r " + out.outputs[1],
                      out.effects[kTyreRelaxation] > 0.0 ? ", lags and rolls" : "");
  return out;
}

Eigen::VectorXd driven_angle(const Setting& setting, const Eigen::VectorXd& time, Random& random) {
  const double A = setting.angle, pi = std::numbers::pi;
  Eigen::VectorXd out(time.size());
  double daily = 0.0, wanted = 0.0;
  for (Eigen::Index k = 0; k < time.size(); ++k) {
    const double t = time[k];
    switch (setting.manoeuvre) {
      case 0:
        out[k] = 0.7 * A * std::sin(2.0 * pi * (0.15 + 0.5 * 0.09 * t) * t);
        break;
      case 1: {
        const double within = std::fmod(t, 5.0), sign = static_cast<int>(t / 5.0) % 2 == 0 ? 1 : -1;
        out[k] = A * sign * std::clamp(within / 0.25, 0.0, 1.0) *
                 std::clamp((4.0 - within) / 0.25, 0.0, 1.0);
        break;
      }
      case 2:
        out[k] = 0.8 * A * std::sin(2.0 * pi * (0.35 + 0.01 * t) * t);
        break;
      default:
        if (k % 75 == 0) wanted = 0.6 * A * random.normal();
        daily += (wanted - daily) / (0.35 * kRate);
        out[k] = daily;
    }
  }
  return out;
}

/// The channels as they are, SI: steering, vx, r, ay, vy.
struct Channels {
  Eigen::VectorXd time, steering, vx, r, ay, vy;
  Eigen::VectorXd& output(const std::string& name) {
    return name == "r" ? r : name == "ay" ? ay : vy;
  }
};

Eigen::VectorXd shifted(const Eigen::VectorXd& x, double by) {
  Eigen::VectorXd out(x.size());
  for (Eigen::Index k = 0; k < x.size(); ++k) {
    const double at =
        std::clamp(static_cast<double>(k) - by * kRate, 0.0, static_cast<double>(x.size() - 1));
    const auto i = std::min(static_cast<Eigen::Index>(at), x.size() - 2);
    out[k] = x[i] + (at - static_cast<double>(i)) * (x[i + 1] - x[i]);
  }
  return out;
}

std::string size_of(DriveFault kind, const DriveFaults& faults, const Setting& setting) {
  const std::string& channel = setting.outputs[static_cast<std::size_t>(faults.channel)];
  switch (kind) {
    case DriveFault::late_steering:
      return fmt::format(" {:.0f} ms", 1e3 * faults.delay);
    case DriveFault::late_output:
      return fmt::format(" {} {:.0f} ms", channel, 1e3 * faults.delay);
    case DriveFault::sign:
      return " " + (faults.front ? "steering" : channel);
    case DriveFault::gain:
      return fmt::format(" {} {:.3f}", channel, faults.gain);
    case DriveFault::ratio:
      return fmt::format(" {:.3f}", faults.ratio);
    case DriveFault::lever_arm:
      return fmt::format(" {:.2f} m", faults.arm);
    case DriveFault::turned_sensor:
      return fmt::format(" {:.1f} deg", faults.turn * kDegreesPerRadian);
    case DriveFault::low_pass:
      return fmt::format(" {} {:.1f} Hz", channel, faults.corner);
    case DriveFault::spikes:
      return " " + channel;
    case DriveFault::speed_scale:
      return fmt::format(" {:.3f}", faults.speed);
    case DriveFault::other_tyres:
      return fmt::format(" {} {:.2f}", faults.front ? "front" : "rear", faults.softer);
    case DriveFault::heavier:
      return fmt::format(" {:.2f}", faults.heavier);
    case DriveFault::bank:
      return fmt::format(" {:.1f} deg", faults.bank * kDegreesPerRadian);
    default:
      return "";
  }
}

DriveFaults draw_faults(Random& random, int count, const Setting& setting, std::string& words) {
  DriveFaults out;
  while (static_cast<int>(out.kinds.size()) < count) {
    const auto kind = static_cast<DriveFault>(
        static_cast<int>(random.uniform() * static_cast<double>(DriveFault::kinds)));
    const bool has_vy =
        std::find(setting.outputs.begin(), setting.outputs.end(), "vy") != setting.outputs.end();
    if (kind == DriveFault::turned_sensor && !has_vy) continue;
    if (!out.has(kind)) out.kinds.push_back(kind);
  }
  out.channel = static_cast<int>(random.uniform() * static_cast<double>(setting.outputs.size()));
  out.delay = 0.02 * std::pow(15.0, random.uniform());
  out.gain = 1.0 + signed_size(random, 0.01, 0.15);
  out.ratio = 1.0 + signed_size(random, 0.01, 0.15);
  out.arm = signed_size(random, 0.1, 2.0) * (setting.car.a + setting.car.b) / 2.7;
  out.turn = signed_size(random, 1.0, 5.0) * kPerDegree;
  out.corner = between(random, 1.0, 5.0);
  out.speed = 1.0 + signed_size(random, 0.01, 0.1);
  out.softer = between(random, 0.6, 0.85);
  out.heavier = between(random, 1.1, 1.25);
  out.bank = signed_size(random, 1.0, 4.0) * kPerDegree;
  out.front = random.uniform() < 0.5;
  out.hold = static_cast<int>(between(random, 5.0, 10.99));
  for (const DriveFault kind : out.kinds) {
    words += fmt::format(", {}{}", to_string(kind), size_of(kind, out, setting));
  }
  return out;
}

void simulate_part(const SingleTrack<>& car, const Setting& setting, Eigen::Index from,
                   Eigen::Index to, double& vy, double& r, Channels& channels,
                   Eigen::VectorXd& yaw_acceleration) {
  const Eigen::Index n = to - from;
  const DrivenSegment driven =
      drive(channels.time.segment(from, n), channels.steering.segment(from, n),
            channels.vx.segment(from, n),
            {.decay_rate = decay_rate_times_speed(car), .longest_step = 0.005});
  simulate_with_effects(car, setting.effects, driven, vy, r,
                        [&](Eigen::Index k, const Motion& motion, double) {
                          channels.r[from + k] = motion.r;
                          channels.vy[from + k] = motion.vy;
                          channels.ay[from + k] = motion.ay;
                          yaw_acceleration[from + k] = motion.yaw_acceleration;
                        });
  vy = channels.vy[to - 1];
  r = channels.r[to - 1];
}

Channels simulated(const Setting& setting, const DriveFaults& faults, Random& random) {
  const auto n = static_cast<Eigen::Index>(kSeconds * kRate);
  Channels out;
  out.time = Eigen::VectorXd::LinSpaced(n, 0.0, static_cast<double>(n - 1) / kRate);
  out.steering = driven_angle(setting, out.time, random);
  out.vx = Eigen::VectorXd::Constant(n, setting.speed);
  out.r = out.ay = out.vy = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd yaw_acceleration = out.r;
  SingleTrack<> first = setting.car;
  if (faults.has(DriveFault::bank)) first.bank = faults.bank;
  SingleTrack<> second = first;
  if (faults.has(DriveFault::other_tyres))
    (faults.front ? second.front : second.rear).stiffness *= faults.softer;
  if (faults.has(DriveFault::heavier)) {
    second.m *= faults.heavier;
    second.Iz *= faults.heavier;
  }
  double vy = 0.0, r = 0.0;
  simulate_part(first, setting, 0, n / 2, vy, r, out, yaw_acceleration);
  simulate_part(second, setting, n / 2 - 1, n, vy, r, out, yaw_acceleration);
  if (faults.has(DriveFault::lever_arm)) {
    out.ay += faults.arm * yaw_acceleration;
    out.vy += faults.arm * out.r;
  }
  if (faults.has(DriveFault::turned_sensor)) out.vy -= faults.turn * out.vx;
  return out;
}

/// What the sensors make of it: filters, delays, noise, steps.
void measure(const Setting& setting, const DriveFaults& faults, Random& random,
             Channels& channels) {
  Eigen::VectorXd& chosen =
      channels.output(setting.outputs[static_cast<std::size_t>(faults.channel)]);
  if (faults.has(DriveFault::low_pass)) {
    const double T = 1.0 / (2.0 * std::numbers::pi * faults.corner);
    double input = chosen[0];
    for (Eigen::Index k = 1; k < chosen.size(); ++k) {
      const double now = chosen[k];
      chosen[k] = lagged(chosen[k - 1], input, now, 1.0 / kRate, T);
      input = now;
    }
  }
  if (faults.has(DriveFault::late_output)) chosen = shifted(chosen, faults.delay);
  if (faults.has(DriveFault::late_steering))
    channels.steering = shifted(channels.steering, -faults.delay);
  const bool small = setting.car.m < 50.0;
  const double step = 0.1 * kPerDegree;
  const double offset = (small ? 0.1 : 0.4) * kPerDegree;
  for (Eigen::Index k = 0; k < channels.time.size(); ++k) {
    const double angle = channels.steering[k] + offset + 0.3 * step * random.normal();
    channels.steering[k] = step * std::round(angle / step);
    channels.vx[k] *= 1.0 + 0.001 * random.normal();
    channels.r[k] += (0.06 + 0.12 * random.normal()) * kPerDegree;
    channels.ay[k] += 0.04 + 0.06 * random.normal();
    channels.vy[k] += 0.025 * random.normal() * (small ? 0.1 : 1.0);
  }
  if (faults.has(DriveFault::gain)) chosen *= faults.gain;
  if (faults.has(DriveFault::sign)) {
    (faults.front ? channels.steering : chosen) *= -1.0;
  }
  if (faults.has(DriveFault::speed_scale)) channels.vx *= faults.speed;
  if (faults.has(DriveFault::held_samples)) {
    for (Eigen::Index k = 0; k < channels.time.size(); ++k) {
      channels.steering[k] = channels.steering[k - k % faults.hold];
    }
  }
  if (!faults.has(DriveFault::spikes)) return;
  const double size = chosen.cwiseAbs().maxCoeff();
  for (int i = 0; i < 8; ++i) {
    chosen[static_cast<Eigen::Index>(random.uniform() * static_cast<double>(chosen.size()))] +=
        signed_size(random, 1.0, 4.0) * size;
  }
}

Model model_of(const Setting& setting, const DriveFaults& faults) {
  const SingleTrack<>& car = setting.car;
  const bool swapped = faults.has(DriveFault::swapped_axles);
  const double a = swapped ? car.b : car.a, b = swapped ? car.a : car.b;
  const double ratio = car.steering_ratio * (faults.has(DriveFault::ratio) ? faults.ratio : 1.0);
  const double Iz = car.m * a * b, C = 0.5 * (car.front.stiffness + car.rear.stiffness);
  Model out = sladka2010_model(setting.outputs);
  out.name = "drive";
  out.parameters = {known("m", "kg", car.m),
                    known("a", "m", a),
                    known("b", "m", b),
                    known("steering_ratio", "", ratio),
                    unknown("Cf", "N/rad", C, 0.1 * C, 5.0 * C),
                    unknown("Cr", "N/rad", C, 0.1 * C, 5.0 * C),
                    unknown("Iz", "kg m^2", Iz, Iz / 4.0, Iz * 4.0),
                    unknown("steering_offset", "rad", 0.0, -0.1, 0.1)};
  const auto measured = [&](const char* name) {
    return std::find(setting.outputs.begin(), setting.outputs.end(), name) != setting.outputs.end();
  };
  if (measured("ay")) out.parameters.push_back(unknown("bias_ay", "m/s^2", 0.0, -1.0, 1.0));
  if (measured("vy")) out.parameters.push_back(unknown("bias_r", "rad/s", 0.0, -0.05, 0.05));
  return out;
}

Dataset dataset_of(const Setting& setting, Channels& channels) {
  Dataset out;
  out.name = "drive.csv";
  out.time = channels.time;
  out.dt = 1.0 / kRate;
  out.inputs = {{"steering_wheel_angle", "deg"}, {"vx", "km/h"}};
  out.u.resize(2, channels.time.size());
  out.u << channels.steering.transpose(), channels.vx.transpose();
  out.y.resize(static_cast<Eigen::Index>(setting.outputs.size()), channels.time.size());
  for (std::size_t j = 0; j < setting.outputs.size(); ++j) {
    const std::string& name = setting.outputs[j];
    out.outputs.push_back({name, name == "r" ? "rad/s" : name == "ay" ? "m/s^2" : "m/s"});
    out.y.row(static_cast<Eigen::Index>(j)) = channels.output(name).transpose();
  }
  return out;
}

}  // namespace

std::string to_string(DriveFault fault) {
  constexpr std::array<const char*, static_cast<std::size_t>(DriveFault::kinds)> kNames = {
      "late steering", "late output", "sign",          "gain",     "ratio",
      "swapped axles", "lever arm",   "turned sensor", "low pass", "held samples",
      "spikes",        "speed scale", "other tyres",   "heavier",  "bank"};
  return kNames[static_cast<std::size_t>(fault)];
}

VehicleDrive draw_vehicle_drive(std::uint64_t seed, int count) {
  Random random(seed);
  VehicleDrive out;
  const Setting setting = draw_setting(random, out.words);
  const DriveFaults faults = draw_faults(random, count, setting, out.words);
  Channels channels = simulated(setting, faults, random);
  out.steering = channels.steering;
  measure(setting, faults, random, channels);
  out.model = model_of(setting, faults);
  out.recording = dataset_of(setting, channels);
  out.truth = {setting.car.front.stiffness, setting.car.rear.stiffness, setting.car.Iz};
  out.car = setting.car;
  out.effects = setting.effects;
  out.speed = setting.speed;
  out.faults = faults;
  return out;
}

}  // namespace identikal
