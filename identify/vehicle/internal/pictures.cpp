#include "identify/vehicle/internal/pictures.h"

#include <algorithm>
#include <cmath>

#include "identify/noise/likelihood_profile.h"
#include "identify/vehicle/starts.h"
#include "lib/data/units.h"
#include "lib/vehicle/trajectory.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

// Profiles repeat the search some twenty times for every parameter.
constexpr Index kMostResiduals = 20000;

struct Slips {
  double front = 0.0, rear = 0.0;  // largest [rad]
};

AxlePicture axle_picture(const std::string& name, const Axle<>& axle, double largest_slip,
                         VectorXd slip, VectorXd force) {
  constexpr Index kCurvePoints = 81;
  AxlePicture out;
  out.name = name;
  const double reach =
      1.05 * std::max(largest_slip, slip.size() > 0 ? slip.cwiseAbs().maxCoeff() : 0.0);
  const AxleCurve curve(axle);
  out.curve_slip = VectorXd::LinSpaced(kCurvePoints, -reach, reach);
  out.curve_force.resize(kCurvePoints);
  // In the balances slip angles have the sign of the force.
  for (Index k = 0; k < kCurvePoints; ++k) out.curve_force[k] = curve.force(-out.curve_slip[k]);
  out.slip = std::move(slip);
  out.force = std::move(force);
  return out;
}

void picture_axles(const VehicleProblem& problem, const VehicleParameters<double>& p,
                   const Slips& largest, Pictures& out) {
  const VehicleRun& run = *problem.run;
  const VehicleBalances balances = vehicle_balances(run, p);
  const SingleTrack<> car = car_with(problem.unknowns.curve, p);
  const double L = p[kA] + p[kB];
  const VectorXd force = p[kMass] * balances.acceleration,
                 moment = p[kYawInertia] * balances.yaw_acceleration;
  out.axles = {axle_picture("front", car.front, largest.front, balances.slip_front,
                            (p[kB] * force + moment) / L),
               axle_picture("rear", car.rear, largest.rear, balances.slip_rear,
                            (p[kA] * force - moment) / L)};
  out.high_pass_filtered = balances.time.size() > 0 && run.find(VehicleQuantity::vy) < 0 &&
                           run.find(VehicleQuantity::beta) < 0;
}

// Lateral velocity of the centre of gravity as measured; empty where no sensor measures it.
VectorXd measured_vy(const VehicleRun& run, const VehicleParameters<double>& p, const VectorXd& r,
                     const VehicleRun::Segment& segment) {
  const Index jv = run.find(VehicleQuantity::vy), jb = run.find(VehicleQuantity::beta);
  if (jv < 0 && jb < 0) return {};
  const Index j = jv >= 0 ? jv : jb;
  const VehicleSensor& sensor = run.outputs[j].sensor;
  const double angle = sensor.angle + p[kMountingAngle];
  VectorXd out(segment.rows);
  for (Index k = 0; k < segment.rows; ++k) {
    const double vx = run.vx[segment.first + k] - r[k] * sensor.y;
    const double y = run.y(j, segment.first + k);
    const double at_sensor = jv >= 0 ? (y - p[kBiasVy] + vx * std::sin(angle)) / std::cos(angle)
                                     : vx * std::tan(y + angle);
    out[k] = at_sensor - r[k] * sensor.x;
  }
  return out;
}

// Of the longest segment.
void picture_tracks(const VehicleProblem& problem, const VehicleParameters<double>& p,
                    const VectorXd& vy, const VectorXd& r, Pictures& out) {
  const VehicleRun& run = *problem.run;
  const auto longest =
      std::max_element(run.segments.begin(), run.segments.end(),
                       [](const auto& left, const auto& right) { return left.rows < right.rows; });
  const Index first = longest->first, rows = longest->rows;
  const auto add = [&](const std::string& name, const VectorXd& time, const VectorXd& vx,
                       const VectorXd& lateral, const VectorXd& yaw_rate) {
    const Eigen::Matrix3Xd path = track(time, vx, lateral, yaw_rate);
    out.tracks.push_back({name, path.row(0).transpose(), path.row(1).transpose()});
  };
  add("simulated", run.time.segment(first, rows), run.vx.segment(first, rows),
      vy.segment(first, rows), r.segment(first, rows));
  const Index jr = run.find(VehicleQuantity::r);
  if (jr < 0) return;
  const VectorXd yaw_rate = run.y.row(jr).segment(first, rows).transpose().array() - p[kBiasR];
  const VectorXd lateral = measured_vy(run, p, yaw_rate, *longest);
  if (lateral.size() == 0) return;
  // Rows where a sensor has nothing are stepped over.
  std::vector<Index> whole;
  for (Index k = 0; k < rows; ++k) {
    if (std::isfinite(yaw_rate[k]) && std::isfinite(lateral[k])) whole.push_back(k);
  }
  if (whole.size() < 2) return;
  add("measured", VectorXd(run.time.segment(first, rows))(whole),
      VectorXd(run.vx.segment(first, rows))(whole), lateral(whole), yaw_rate(whole));
}

void picture_start(const VehicleProblem& problem, const VehicleCovariance& covariance,
                   Pictures& out) {
  VectorXd e;
  if (problem.parameters() == 0 ||
      !output_error(problem, coordinates_of(problem, problem.unknowns.value), e, nullptr)) {
    return;
  }
  out.standardised_before =
      Eigen::MatrixXd::Constant(problem.run->y.rows(), problem.run->time.size(), kNone);
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    const Index j = problem.output[i];
    out.standardised_before(j, problem.row[i]) = -e[i] / covariance.sd[j];
  }
}

void picture_profiles(const VehicleSearch& found, VehicleEstimate& estimate) {
  const VehicleProblem& problem = found.problem;
  if (problem.residuals() > kMostResiduals || !found.best.converged) return;
  for (std::size_t n = 0; n < problem.unknowns.free.size(); ++n) {
    const EstimatedParameter& p = estimate.parameters[problem.unknowns.position[n]];
    if (!std::isfinite(p.crb_se) || p.crb_se <= 0.0) continue;
    const auto i = static_cast<Index>(n);
    const VehicleParameter parameter = problem.unknowns.free[n];
    const double at = found.best.z[i] * problem.unknowns.scale[i];
    const Unit unit = unit_or_dimensionless(p.unit);
    const double slope = std::abs(in_user_terms(parameter, at).slope) / unit.scale;
    VehicleProblem held = problem;
    VectorXd z = found.best.z;
    LikelihoodProfile profile = walk_profile(
        found.best.z[i], p.crb_se / (slope * problem.unknowns.scale[i]), problem.lower[i],
        problem.upper[i], [&](double value, bool turned) -> std::optional<double> {
          if (turned) z = found.best.z;
          held.lower[i] = held.upper[i] = z[i] = value;
          const VehicleOptimum optimum = maximise_likelihood(held, z, SolverOptions{});
          if (!optimum.converged) return std::nullopt;
          z = optimum.z;
          return 2.0 * std::max(0.0, found.best.log_likelihood - optimum.log_likelihood);
        });
    if (profile.value.size() < 3) continue;
    profile.name = p.name;
    for (double& value : profile.value) {
      value = unit.from_si(in_user_terms(parameter, value * problem.unknowns.scale[i]).value);
    }
    if (profile.value.front() > profile.value.back()) {  // the user's term falls with ours
      std::reverse(profile.value.begin(), profile.value.end());
      std::reverse(profile.drop.begin(), profile.drop.end());
    }
    estimate.pictures.profiles.push_back(std::move(profile));
  }
}

}  // namespace

void picture_vehicle(const VehicleSearch& found, const VehicleCovariance& covariance,
                     VehicleEstimate& estimate) {
  const VehicleProblem& problem = found.problem;
  const VehicleParameters<double> p = parameters_at(problem, found.best.z);
  Pictures& out = estimate.pictures;
  out.simulation = estimate.series.predicted;
  Slips largest;
  VectorXd vy = VectorXd::Constant(problem.run->time.size(), kNone), r = vy;
  replay(problem, found.best.z, [&](Index t, const Motion& motion, double) {
    largest.front = std::max(largest.front, std::abs(motion.slip_front));
    largest.rear = std::max(largest.rear, std::abs(motion.slip_rear));
    vy[t] = motion.vy;
    r[t] = motion.r;
  });
  picture_axles(problem, p, largest, out);
  picture_tracks(problem, p, vy, r, out);
  picture_start(problem, covariance, out);
  picture_profiles(found, estimate);
}

}  // namespace identikal
