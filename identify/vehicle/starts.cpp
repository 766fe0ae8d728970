#include "identify/vehicle/starts.h"

#include <algorithm>
#include <cmath>

#include <Eigen/QR>

#include "lib/base/random.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

constexpr double kTypicalStiffness = 12.0;  // cornering stiffness per axle load [1/rad]
constexpr double kMeanOver = 0.1;           // [s]
constexpr double kFilterTime = 1.0;         // [s]
constexpr double kHole = 3.0;               // [means and samples]: no derivative over it

bool is_free(const VehicleUnknowns& unknowns, VehicleParameter parameter) {
  return std::find(unknowns.free.begin(), unknowns.free.end(), parameter) != unknowns.free.end();
}

VehicleParameters<double> clipped(const VehicleUnknowns& unknowns, VehicleParameters<double> p) {
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    const auto n = static_cast<Eigen::Index>(i);
    double& value = p[unknowns.free[i]];
    value = std::min(std::max(value, unknowns.lower[n]), unknowns.upper[n]);
  }
  return p;
}

VehicleParameters<double> typical_car(const VehicleUnknowns& unknowns) {
  const VehicleParameters<double> neutral = neutral_vehicle();
  VehicleParameters<double> p = unknowns.value;
  const Eigen::Vector2d load = axle_loads(p);
  for (const VehicleParameter parameter : unknowns.free) {
    if (parameter == kYawInertia) {
      p[parameter] = p[kMass] * p[kA] * p[kB];
    } else if (parameter == kCf) {
      p[parameter] = kTypicalStiffness * load[0];
    } else if (parameter == kCr) {
      p[parameter] = kTypicalStiffness * load[1];
    } else if (!std::isnan(neutral[parameter]) && parameter != kSteeringRatio) {
      p[parameter] = neutral[parameter];
    }
  }
  return clipped(unknowns, p);
}

/// What the balances are made of, at one point of time.
enum Signal { kDelta, kVyOverVx, kROverVx, kSideAcceleration, kYawRate, kVy, kSignals };
using Signals = Eigen::Array<double, kSignals, 1>;

/// First-order high-pass filter of all signals but vy, which is integrated from its rate.
class Washout {
 public:
  Signals filter(const Signals& now, double vy_rate, double vx, double step) {
    if (!running_) {
      low_ = now;
      vy_ = 0.0;
      running_ = true;
    } else {
      const double pass = 1.0 - std::exp(-step / kFilterTime);
      low_ += pass * (now - low_);
      vy_ += pass * (kFilterTime * vy_rate - vy_);
    }
    Signals out = now - low_;
    out[kVyOverVx] = vy_ / vx;
    out[kVy] = vy_;
    return out;
  }

 private:
  Signals low_ = Signals::Zero();
  double vy_ = 0.0;
  bool running_ = false;
};

struct Mean {
  double time = 0.0;
  Signals value = Signals::Zero();
};

/// Means over about 0.1 s of the signals of one segment, at the centre of gravity.
std::vector<Mean> means_of(const VehicleRun& run, const VehicleRun::Segment& segment,
                           const VehicleParameters<double>& p) {
  const Eigen::Index jr = run.find(VehicleQuantity::r), jv = run.find(VehicleQuantity::vy),
                     jb = run.find(VehicleQuantity::beta), ja = run.find(VehicleQuantity::ay);
  const std::vector<VehicleReading> sensors = readings(run, linear_car(p));
  const double gravity = kStandardGravity * std::sin(p[kBank]);
  const bool filtered = jv < 0 && jb < 0;
  Washout washout;
  std::vector<Mean> out;
  Mean sum;
  double count = 0.0, begin = run.time[segment.first], previous = begin;
  for (Eigen::Index t = segment.first; t < segment.first + segment.rows; ++t) {
    const double vx = run.vx[t], r = run.y(jr, t) - p[kBiasR];
    double vy = 0.0;
    if (const Eigen::Index j = jv >= 0 ? jv : jb; j >= 0) {
      vy = sensors[j].lateral_velocity(run.y(j, t), vx, r);
    }
    double ay = 0.0;
    if (ja >= 0) {
      const double y = run.outputs[ja].sensor.y;
      ay = run.y(ja, t) - p[kBiasAy] + r * r * y;
    }
    const double delta =
        p[kSteeringGain] * (run.steering[t] + p[kSteeringOffset]) / p[kSteeringRatio];
    Signals now;
    // Without an accelerometer the entry holds vx r, to which vy' is added later.
    now << delta, vy / vx, r / vx, ja >= 0 ? ay : vx * r + gravity, r, vy;
    if (!now.allFinite()) continue;
    if (filtered) {
      now = washout.filter(now, ay - gravity - vx * r, vx, run.time[t] - previous);
      previous = run.time[t];
    }
    if (count > 0.0 && run.time[t] - begin >= kMeanOver * (1.0 - 1e-6)) {
      out.push_back({sum.time / count, sum.value / count});
      sum = Mean{};
      count = 0.0;
      begin = run.time[t];
    }
    sum.time += run.time[t];
    sum.value += now;
    count += 1.0;
  }
  if (count > 0.0) out.push_back({sum.time / count, sum.value / count});
  return out;
}

/// Fits stiffness, inverse saturation and an offset of the slip angle to the forces of one axle; the curve's
/// other values stay. false when no minimum is found.
bool fit_axle(const Eigen::VectorXd& slip, const Eigen::VectorXd& force, double load,
              Axle<>& axle) {
  const Eigen::Vector3d scale(10.0 * load, 1.0 / (load * load), 0.02);
  LeastSquares problem;
  problem.residuals = slip.size();
  problem.lower = Eigen::Vector3d(1e-3, 1e-3, -5.0);
  problem.upper = Eigen::Vector3d(20.0, 20.0, 5.0);
  problem.evaluate = [&](const Eigen::VectorXd& x, Eigen::VectorXd& r, LeastSquares::RowMatrix* J) {
    Axle<> at = axle;
    at.stiffness = x[0] * scale[0];
    at.softening = x[1] * scale[1];
    const AxleCurve curve(at);
    for (Eigen::Index i = 0; i < slip.size(); ++i) {
      // In the balances slip angles have the sign of the force.
      const AxleForce F = curve.force_and_jacobian(-(slip[i] + x[2] * scale[2]));
      r[i] = (F.value - force[i]) / load;
      if (J == nullptr) continue;
      J->row(i) = Eigen::RowVector3d(F.by_stiffness, F.by_softening, -F.by_slip)
                      .cwiseProduct(scale.transpose()) /
                  load;
    }
    return true;
  };
  SolverOptions coarse;
  coarse.function_tolerance = 1e-6;
  const Solution found = solve(problem, Eigen::Vector3d(0.1 * kTypicalStiffness, 1.0, 0.0), coarse);
  axle.stiffness = found.x[0] * scale[0];
  axle.softening = found.x[1] * scale[1];
  return found.summary.usable();
}

/// Both axles on their own: at the inertia of p their forces follow from the balances. Where an
/// axle saturates, a straight line through its forces is no start.
bool curved_axles_by_equation_error(const VehicleBalances& balances,
                                    const VehicleUnknowns& unknowns, VehicleParameters<double>& p) {
  const Eigen::Vector2d load = axle_loads(p);
  const double L = p[kA] + p[kB];
  const Eigen::VectorXd force = p[kMass] * balances.acceleration,
                        moment = p[kYawInertia] * balances.yaw_acceleration;
  SingleTrack<> car = car_with(unknowns.curve, p);
  if (!fit_axle(balances.slip_front, (p[kB] * force + moment) / L, load[0], car.front) ||
      !fit_axle(balances.slip_rear, (p[kA] * force - moment) / L, load[1], car.rear)) {
    return false;
  }
  p[kCf] = car.front.stiffness;
  p[kCr] = car.rear.stiffness;
  p[kInverseSaturationFront] = car.front.softening;
  p[kInverseSaturationRear] = car.rear.softening;
  return true;
}

}  // namespace

VehicleBalances vehicle_balances(const VehicleRun& run, const VehicleParameters<double>& p) {
  VehicleBalances out;
  const Eigen::Index ja = run.find(VehicleQuantity::ay);
  const bool vy_known = run.find(VehicleQuantity::vy) >= 0 || run.find(VehicleQuantity::beta) >= 0;
  if (run.find(VehicleQuantity::r) < 0 || (!vy_known && ja < 0)) return out;
  const double ay_lever = ja >= 0 ? run.outputs[ja].sensor.x : 0.0;

  std::vector<double> time, slip_front, slip_rear, acceleration, yaw_acceleration;
  for (const VehicleRun::Segment& segment : run.segments) {
    const std::vector<Mean> mean = means_of(run, segment, p);
    const double step = (run.time[segment.first + segment.rows - 1] - run.time[segment.first]) /
                        static_cast<double>(segment.rows - 1);
    for (std::size_t i = 1; i + 1 < mean.size(); ++i) {
      const double span = mean[i + 1].time - mean[i - 1].time;
      if (span > kHole * (kMeanOver + step)) continue;
      const Signals& now = mean[i].value;
      const Signals rate = (mean[i + 1].value - mean[i - 1].value) / span;
      time.push_back(mean[i].time);
      slip_front.push_back(now[kDelta] - now[kVyOverVx] - p[kA] * now[kROverVx]);
      slip_rear.push_back(p[kB] * now[kROverVx] - now[kVyOverVx]);
      acceleration.push_back(now[kSideAcceleration] +
                             (ja >= 0 ? -rate[kYawRate] * ay_lever : rate[kVy]));
      yaw_acceleration.push_back(rate[kYawRate]);
    }
  }
  const auto n = static_cast<Eigen::Index>(time.size());
  const auto as_vector = [n](const std::vector<double>& v) {
    return Eigen::Map<const Eigen::VectorXd>(v.data(), n);
  };
  out.time = as_vector(time);
  out.slip_front = as_vector(slip_front);
  out.slip_rear = as_vector(slip_rear);
  out.acceleration = as_vector(acceleration);
  out.yaw_acceleration = as_vector(yaw_acceleration);
  return out;
}

bool vehicle_by_equation_error(const VehicleRun& run, const VehicleUnknowns& unknowns,
                               VehicleParameters<double>& p) {
  const VehicleBalances balances = vehicle_balances(run, p);
  const Eigen::Index n = balances.time.size();
  if (n < 6) return false;
  const bool curved = is_free(unknowns, kCf) && is_free(unknowns, kCr) &&
                      is_free(unknowns, kInverseSaturationFront) &&
                      is_free(unknowns, kInverseSaturationRear);
  VehicleParameters<double> by_axle = p;
  if (unknowns.curve != TyreCurve::linear && curved &&
      curved_axles_by_equation_error(balances, unknowns, by_axle)) {
    p = clipped(unknowns, by_axle);
    return true;
  }
  Eigen::MatrixXd X(n, 2);
  X << balances.slip_front, balances.slip_rear;
  Eigen::VectorXd force = p[kMass] * balances.acceleration;
  Eigen::Vector2d stiffness(p[kCf], p[kCr]);
  const bool free_front = is_free(unknowns, kCf), free_rear = is_free(unknowns, kCr);
  if (free_front && free_rear) {
    stiffness = X.colPivHouseholderQr().solve(force);
  } else if (free_front) {
    force -= X.col(1) * stiffness[1];
    stiffness[0] = X.col(0).dot(force) / X.col(0).squaredNorm();
  } else if (free_rear) {
    force -= X.col(0) * stiffness[0];
    stiffness[1] = X.col(1).dot(force) / X.col(1).squaredNorm();
  }
  const Eigen::Vector2d load = axle_loads(p);
  for (int axle = 0; axle < 2; ++axle) {
    if (!(stiffness[axle] > load[axle]) || !(stiffness[axle] < 200.0 * load[axle])) return false;
  }
  VehicleParameters<double> found = p;
  found[kCf] = stiffness[0];
  found[kCr] = stiffness[1];
  if (is_free(unknowns, kYawInertia)) {
    const Eigen::VectorXd moment =
        p[kA] * stiffness[0] * X.col(0) - p[kB] * stiffness[1] * X.col(1);
    const double inertia = moment.squaredNorm() / moment.dot(balances.yaw_acceleration);
    const double typical = p[kMass] * p[kA] * p[kB];
    if (!(inertia > 0.1 * typical) || !(inertia < 10.0 * typical)) return false;
    found[kYawInertia] = inertia;
  }
  p = clipped(unknowns, found);
  return true;
}

std::vector<VehicleParameters<double>> vehicle_starts(const VehicleRun& run,
                                                      const VehicleUnknowns& unknowns, int besides,
                                                      unsigned long long seed) {
  std::vector<VehicleParameters<double>> out;
  const VehicleParameters<double> typical = typical_car(unknowns);
  VehicleParameters<double> regression = typical;
  if (vehicle_by_equation_error(run, unknowns, regression)) out.push_back(regression);
  out.push_back(typical);
  if (besides > 1) out.push_back(clipped(unknowns, unknowns.value));
  Random random(seed);
  for (int i = 2; i < besides; ++i) {
    VehicleParameters<double> p = typical;
    for (const VehicleParameter parameter : unknowns.free) {
      // Spreads by a factor of 2 (stiffness) and 1.3 (inertia) either way; small additive
      // quantities keep their neutral value, which is nearly always near the truth.
      if (parameter == kCf || parameter == kCr) p[parameter] *= std::exp2(random.normal());
      if (parameter == kYawInertia) p[parameter] *= std::exp2(0.4 * random.normal());
    }
    out.push_back(clipped(unknowns, p));
  }
  return out;
}

}  // namespace identikal
