#include "tests/campaigns/vehicle_drive_bound.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"

namespace identikal {
namespace {

/// A car that may have driven so.
struct Guess {
  SingleTrack<> car;
  SecondaryEffects effects{};
  double speed = 0.0;  // [m/s]
};

bool measures(const VehicleDrive& drive, std::string_view name) {
  const auto& outputs = drive.recording.outputs;
  return std::any_of(outputs.begin(), outputs.end(),
                     [&](const auto& output) { return output.name == name; });
}

/// What the measured outputs show without noise, over its standard deviation, one behind the other,
/// and without what a bias would change.
Eigen::VectorXd shown(const Guess& guess, const VehicleDrive& drive,
                      const DriveFaults& faults = {}) {
  const DrivenSegment driven = identikal::drive(
      drive.recording.time, drive.steering,
      Eigen::VectorXd::Constant(drive.steering.size(), guess.speed), {.longest_step = 0.005});
  const double arm = faults.has(DriveFault::lever_arm) ? faults.arm : 0.0;
  const double turn = faults.has(DriveFault::turned_sensor) ? faults.turn : 0.0;
  const Eigen::Index samples = drive.steering.size();
  Eigen::MatrixX3d all(samples, 3);
  simulate_with_effects(
      guess.car, guess.effects, driven, 0.0, 0.0, [&](Eigen::Index k, const Motion& at, double vx) {
        all.row(k) << at.r, at.vy + arm * at.r - turn * vx, at.ay + arm * at.yaw_acceleration;
      });
  constexpr std::array<std::string_view, 3> kNames = {"r", "vy", "ay"};
  const double small = drive.car.m < 50.0 ? 0.1 : 1.0;
  const std::array<double, 3> sd = {0.12 / kDegreesPerRadian, 0.025 * small, 0.06};
  const std::string& chosen =
      drive.recording.outputs[static_cast<std::size_t>(faults.channel)].name;
  Eigen::VectorXd out(samples * static_cast<Eigen::Index>(drive.recording.outputs.size()));
  Eigen::Index at = 0;
  for (std::size_t j = 0; j < 3; ++j) {
    if (!measures(drive, kNames[j])) continue;
    Eigen::VectorXd of = all.col(static_cast<Eigen::Index>(j)) / sd[j];
    if (faults.has(DriveFault::gain) && kNames[j] == chosen) of *= faults.gain;
    if (kNames[j] != "vy") of.array() -= of.mean();  // vy has no bias
    out.segment(at, samples) = of;
    at += samples;
  }
  return out;
}

struct Unknown {
  SecondaryEffect effect;
  double sd;  // as draw_vehicle_drive() has it: none of it in two of five cars
  bool positive;
};

/// Standard deviation of what is zero in two of five, else even from low to high.
double drawn(double low, double high) {
  const double mean = 0.5 * (low + high), spread = (high - low) * (high - low) / 12.0;
  return std::sqrt(0.6 * (mean * mean + spread) - 0.36 * mean * mean);
}

std::vector<Unknown> unknown_effects(const SingleTrack<>& car) {
  const double wheelbase = car.a + car.b;
  const double front = car.m * car.b / wheelbase / car.front.stiffness;
  const double rear = car.m * car.a / wheelbase / car.rear.stiffness;
  return {{kTyreRelaxation, drawn(0.02, 0.2) * wheelbase, true},
          {kSteeringLag, drawn(0.0, 0.02), true},
          {kRollGradient, drawn(0.0, 0.012), true},
          {kRollSteerFront, drawn(-0.15, 0.15) * front, false},
          {kRollSteerRear, drawn(-0.15, 0.15) * rear, false},
          {kTyreSoftening, 0.9 / std::sqrt(12.0), true}};
}

// Unknowns are Iz, Cf, Cr, the offset of the steering, then effects over their standard deviations.
constexpr Eigen::Index kFirstEffect = 4;
enum Known : Eigen::Index { kIz, kOffset, kFront, kRear };

Guess moved(Guess guess, const std::vector<Unknown>& effects, const Eigen::VectorXd& step) {
  guess.car.Iz *= std::exp(step[kIz]);
  guess.car.steering_offset += step[kOffset];
  guess.car.front.stiffness *= std::exp(step[kFront]);
  guess.car.rear.stiffness *= std::exp(step[kRear]);
  for (std::size_t i = 0; i < effects.size(); ++i) {
    double& effect = guess.effects[effects[i].effect];
    effect += effects[i].sd * step[kFirstEffect + static_cast<Eigen::Index>(i)];
    if (effects[i].positive) effect = std::max(0.0, effect);
  }
  return guess;
}

Eigen::MatrixXd jacobian(const Guess& guess, const std::vector<Unknown>& effects,
                         const VehicleDrive& drive) {
  const Eigen::VectorXd at = shown(guess, drive);
  const Eigen::Index unknowns = kFirstEffect + static_cast<Eigen::Index>(effects.size());
  Eigen::MatrixXd out(at.size(), unknowns);
  for (Eigen::Index i = 0; i < unknowns; ++i) {
    const double by = i < kFirstEffect ? 1e-3 : 0.05;
    const Guess other = moved(guess, effects, by * Eigen::VectorXd::Unit(unknowns, i));
    out.col(i) = (shown(other, drive) - at) / by;
  }
  return out;
}

Eigen::MatrixXd information_of(const Eigen::MatrixXd& J) {
  Eigen::MatrixXd out = J.transpose() * J;
  for (Eigen::Index i = kFirstEffect; i < out.rows(); ++i) out(i, i) += 1.0;
  return out;
}

/// Of effects, how far they are from those of the car, over their standard deviations.
Eigen::VectorXd distance(const Guess& guess, const VehicleDrive& drive,
                         const std::vector<Unknown>& effects) {
  Eigen::VectorXd out(static_cast<Eigen::Index>(effects.size()));
  for (std::size_t i = 0; i < effects.size(); ++i) {
    const SecondaryEffect which = effects[i].effect;
    out[static_cast<Eigen::Index>(i)] =
        (guess.effects[which] - drive.effects[which]) / effects[i].sd;
  }
  return out;
}

/// A Gauss-Newton step; effects that would become negative stay at zero.
Eigen::VectorXd step_from(const Guess& guess, const std::vector<Unknown>& effects,
                          const Eigen::MatrixXd& information, const Eigen::VectorXd& gradient) {
  std::vector<Eigen::Index> open;
  for (Eigen::Index i = 0; i < gradient.size(); ++i) open.push_back(i);
  while (true) {
    const Eigen::MatrixXd of_open = information(open, open);
    const Eigen::VectorXd x = of_open.ldlt().solve(Eigen::VectorXd(-gradient(open)));
    Eigen::VectorXd step = Eigen::VectorXd::Zero(gradient.size());
    step(open) = x;
    const auto is_held = [&](Eigen::Index i) {
      if (i < kFirstEffect) return false;
      const Unknown& unknown = effects[static_cast<std::size_t>(i - kFirstEffect)];
      return unknown.positive && guess.effects[unknown.effect] == 0.0 && step[i] < 0.0;
    };
    const auto held = std::remove_if(open.begin(), open.end(), is_held);
    if (held == open.end()) return step;
    open.erase(held, open.end());
  }
}

}  // namespace

std::array<double, 3> least_errors(const VehicleDrive& drive, Insight insight) {
  const std::vector<Unknown> effects =
      insight == Insight::everything ? std::vector<Unknown>{} : unknown_effects(drive.car);
  const Eigen::MatrixXd information =
      information_of(jacobian({drive.car, drive.effects, drive.speed}, effects, drive));
  const Eigen::VectorXd variance =
      information.ldlt()
          .solve(Eigen::MatrixXd::Identity(information.rows(), information.cols()))
          .diagonal();
  return {std::sqrt(variance[kFront]), std::sqrt(variance[kRear]), std::sqrt(variance[kIz])};
}

double least_misfit(const VehicleDrive& drive, const SingleTrack<>& written, double speed) {
  constexpr int kMostSteps = 30;
  constexpr double kLeastShare = 1e-3, kSettled = 1e-2;
  const std::vector<Unknown> effects = unknown_effects(drive.car);
  const Eigen::VectorXd seen = shown({drive.car, drive.effects, drive.speed}, drive, drive.faults);
  Guess at{written, drive.effects, speed};
  // Side slip by lateral acceleration of either axle stays.
  at.car.front.stiffness *= written.b / drive.car.b;
  at.car.rear.stiffness *= written.a / drive.car.a;
  Eigen::VectorXd error = shown(at, drive) - seen;
  const auto cost = [&](const Guess& guess, const Eigen::VectorXd& e) {
    return e.squaredNorm() + distance(guess, drive, effects).squaredNorm();
  };
  double least = cost(at, error);
  for (int n = 0; n < kMostSteps; ++n) {
    const Eigen::MatrixXd J = jacobian(at, effects, drive);
    Eigen::VectorXd gradient = J.transpose() * error;
    gradient.tail(gradient.size() - kFirstEffect) += distance(at, drive, effects);
    const Eigen::VectorXd step = step_from(at, effects, information_of(J), gradient);
    const double before = least;
    for (double share = 1.0; share > kLeastShare; share *= 0.5) {
      const Guess next = moved(at, effects, share * step);
      const Eigen::VectorXd there = shown(next, drive) - seen;
      if (!(cost(next, there) < least)) continue;
      at = next;
      error = there;
      least = cost(at, error);
      break;
    }
    if (before - least < kSettled) break;
  }
  return least;
}

double least_misfit(const VehicleDrive& drive) {
  const DriveFaults& faults = drive.faults;
  const bool handled = std::none_of(faults.kinds.begin(), faults.kinds.end(),
                                    [](DriveFault kind) { return revealed_by(kind).empty(); });
  if (!handled) return kInfinity;
  SingleTrack<> written = drive.car;
  if (faults.has(DriveFault::swapped_axles)) std::swap(written.a, written.b);
  if (faults.has(DriveFault::ratio)) written.steering_ratio *= faults.ratio;
  return least_misfit(drive, written,
                      drive.speed * (faults.has(DriveFault::speed_scale) ? faults.speed : 1.0));
}

std::string_view revealed_by(DriveFault fault) {
  switch (fault) {
    case DriveFault::swapped_axles:
      return "weighing the axles";
    case DriveFault::ratio:
      return "a turn table";
    case DriveFault::speed_scale:
      return "GPS";
    case DriveFault::lever_arm:
      return "measuring where the sensor sits";
    case DriveFault::gain:
      return "a calibration";
    case DriveFault::turned_sensor:
      return "driving straight on";
    default:
      return {};
  }
}

}  // namespace identikal
