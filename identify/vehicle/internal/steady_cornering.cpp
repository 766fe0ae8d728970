#include "identify/vehicle/internal/steady_cornering.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/LU>
#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "lib/data/units.h"
#include "lib/vehicle/yaw_change.h"

namespace identikal {
namespace {

constexpr double kOneSpeed = 0.1;  // relative spread of one segment
constexpr int kParts = 20;
constexpr double kBothSides = 0.2;  // share of the equations on the rarer side
constexpr double kSeparates = 1e-3;

/// Means of rows [first, first + rows).
struct SteadyMean {
  double angle = 0.0, vx = 0.0, r = 0.0;
  bool complete = false;
};

SteadyMean steady_mean_of(const VehicleRun& run, Eigen::Index yaw, Eigen::Index first,
                          Eigen::Index rows) {
  SteadyMean out;
  double n = 0.0;
  for (Eigen::Index t = first; t < first + rows; ++t) {
    if (std::isnan(run.y(yaw, t))) continue;
    out.angle += run.steering[t];
    out.vx += run.vx[t];
    out.r += run.y(yaw, t);
    n += 1.0;
  }
  out.complete = n > 0.0;
  out.angle /= n;
  out.vx /= n;
  out.r /= n;
  return out;
}

std::vector<SteadyMean> steady_means(const VehicleRun& run, Eigen::Index yaw,
                                     const VehicleRun::Segment& segment, Eigen::Index parts) {
  std::vector<SteadyMean> out;
  for (Eigen::Index part = 0; part < parts; ++part) {
    const Eigen::Index begin = part * segment.rows / parts, end = (part + 1) * segment.rows / parts;
    const SteadyMean mean = steady_mean_of(run, yaw, segment.first + begin, end - begin);
    if (mean.complete) out.push_back(mean);
  }
  return out;
}

std::vector<SteadyMean> equations(const VehicleRun& run, Eigen::Index yaw) {
  std::vector<SteadyMean> out;
  for (const VehicleRun::Segment& segment : run.segments) {
    const auto vx = run.vx.segment(segment.first, segment.rows);
    const double mean = vx.mean();
    const double spread = std::sqrt((vx.array() - mean).square().mean());
    const bool one_speed = spread < kOneSpeed * mean;
    const std::vector<SteadyMean> each = steady_means(run, yaw, segment, one_speed ? 1 : kParts);
    out.insert(out.end(), each.begin(), each.end());
  }
  return out;
}

}  // namespace

bool is_steady(const VehicleRun& run) {
  const Eigen::Index yaw = run.find(VehicleQuantity::r);
  return yaw >= 0 && turns_steadily(run.time, run.y.row(yaw).transpose());
}

std::optional<SteadyTurning> steady_turning(const VehicleRun& run, double offset, double bias_r) {
  const Eigen::Index yaw = run.find(VehicleQuantity::r);
  if (yaw < 0) return std::nullopt;
  const std::vector<SteadyMean> all = equations(run, yaw);
  const auto n = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd X(n, 3);
  Eigen::VectorXd angle(n);
  Eigen::Index left = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const SteadyMean& mean = all[i];
    const double r = mean.r - bias_r;
    X.row(i) << r / mean.vx, r * mean.vx, -1.0;
    angle[i] = mean.angle + offset;
    if (r > 0.0) ++left;
  }
  SteadyTurning out;
  out.equations = n;
  const double rarer = static_cast<double>(std::min(left, n - left));
  out.with_offset = offset == 0.0 && rarer >= kBothSides * static_cast<double>(n);
  const Eigen::Index unknowns = out.with_offset ? 3 : 2;
  const Eigen::MatrixXd used = X.leftCols(unknowns);
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(used *
                                                 used.colwise().norm().cwiseInverse().asDiagonal());
  qr.setThreshold(kSeparates);
  if (n < unknowns || qr.rank() < unknowns) return std::nullopt;
  const Eigen::VectorXd theta = used.colPivHouseholderQr().solve(angle);
  out.value.setZero();
  out.value.head(unknowns) = theta;
  if (offset == 0.0 && !out.with_offset) {
    out.by_offset = used.colPivHouseholderQr().solve(Eigen::VectorXd::Ones(n));
  }
  out.covariance.setConstant(kNone);
  out.freedom = static_cast<double>(n - unknowns);
  if (n > unknowns) {
    const double variance = (angle - used * theta).squaredNorm() / out.freedom;
    out.sd = std::sqrt(variance);
    out.covariance.setZero();
    out.covariance.topLeftCorner(unknowns, unknowns) =
        variance * (used.transpose() * used).inverse();
  }
  return out;
}

void report_steady(const Model& model, const SteadyTurning& found, VehicleEstimate& estimate) {
  for (EstimatedParameter& p : estimate.parameters) {
    if (!p.fixed) p.verdict = Verdict::unexcited;
  }
  const auto se = [&](Eigen::Index i) { return std::sqrt(found.covariance(i, i)); };
  estimate.derived.push_back({"i L", "m", found.value[0], se(0)});
  estimate.derived.push_back({"i K", "rad/(m/s^2)", found.value[1], se(1)});
  const Unit unit = unit_or_dimensionless(model.inputs[0].unit);
  if (found.with_offset) {
    estimate.derived.push_back(
        {"steering_offset", model.inputs[0].unit, found.value[2] / unit.scale, se(2) / unit.scale});
  }
  std::string note =
      fmt::format("angle + offset = i L r/v + i K v r, {} equations", found.equations);
  if (found.freedom > 0.0) {
    note += fmt::format(", scatter {:.3g} {}", found.sd / unit.scale, model.inputs[0].unit);
  }
  estimate.notes.push_back(note);
  if (!found.by_offset.isZero()) {
    estimate.notes.push_back(fmt::format(
        "turns to one side only: 1 {} of an offset of the steering sensor changes i L by {:.2g} m "
        "and "
        "i K by {:.2g} rad/(m/s^2), which no error here holds",
        model.inputs[0].unit.empty() ? "rad" : model.inputs[0].unit,
        unit.scale * found.by_offset[0], unit.scale * found.by_offset[1]));
  }
  estimate.objective.method = "steady_cornering";
  estimate.covariance_kind = "scatter of the circles about the line";
}

Findings check_steady(const Model& model, const SteadyTurning& found) {
  Findings out;
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const double given = unknowns.value[kSteeringRatio] / unknowns.value[kSteeringGain] *
                       (unknowns.value[kA] + unknowns.value[kB]);
  const double se = std::sqrt(found.covariance(0, 0));
  if (found.freedom > 0.0 &&
      std::abs(found.value[0] - given) > student_t_quantile(0.995, found.freedom) * se) {
    out.push_back(make_finding(
        FindingCode::steering_ratio, {"steering_ratio"},
        fmt::format("i L is {:.4g} +- {:.2g} m, but the model file's ratio and axle distances "
                    "make {:.4g} m",
                    found.value[0], se, given),
        "correct the ratio, the wheelbase, or the units and signs of the channels"));
  }
  out.push_back(make_finding(
      FindingCode::only_circles, {},
      "steady-state circles determine only the products i L and i K (steering ratio times "
      "wheelbase, times understeer gradient), no stiffness and no inertia"));
  return out;
}

}  // namespace identikal
