#include "identify/vehicle_refit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "identify/distribution.h"
#include "identify/vehicle_covariance.h"
#include "identify/vehicle_problem.h"
#include "identify/vehicle_run.h"
#include "identify/vehicle_series.h"
#include "lib/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFound = 2.8;  // standard errors: 1.96 + 0.84

const EstimatedParameter* reported(const Estimate& result, VehicleParameter parameter) {
  for (const EstimatedParameter& p : result.parameters) {
    if (p.name == name_of(parameter)) return &p;
  }
  return nullptr;
}

/// Of the car, wherever it is driven and whatever it is measured with.
bool of_the_car(VehicleParameter parameter) {
  return must_be_positive(parameter) || parameter == kSteeringGain;
}

/// Those that the result has estimated, free between the widest bounds; the others known.
VehicleUnknowns estimated_unknowns(const Estimate& result, const ModelFile& model) {
  const VehicleUnknowns written = vehicle_unknowns(model);
  VehicleUnknowns out;
  out.value = written.value;
  out.curve = written.curve;
  for (const VehicleParameter parameter : written.free) {
    const EstimatedParameter* p = reported(result, parameter);
    if (p != nullptr && std::isfinite(p->se) && p->se > 0.0) set_free(out, parameter);
  }
  return out;
}

/// Degrees of freedom of the Student's t that the result's intervals were made with.
double freedom_of(const Estimate& result) {
  double least = 1e6;
  for (const EstimatedParameter& p : result.parameters) {
    if (!(std::isfinite(p.se) && p.se > 0.0) || std::isnan(p.ci95[1])) continue;
    const double quantile = 0.5 * (p.ci95[1] - p.ci95[0]) / p.se;
    double low = 1.0, high = 1e6;
    while (high > 1.001 * low) {
      const double middle = std::sqrt(low * high);
      (student_t_quantile(0.975, middle) > quantile ? low : high) = middle;
    }
    least = std::min(least, low);
  }
  return least;
}

double correlation_of(const Estimate& result, const std::string& a, const std::string& b) {
  const auto& names = result.correlation_names;
  const auto i = std::find(names.begin(), names.end(), a),
             j = std::find(names.begin(), names.end(), b);
  if (a == b) return 1.0;
  if (i == names.end() || j == names.end()) return 0.0;
  const double r = result.correlation(i - names.begin(), j - names.begin());
  return std::isfinite(r) ? r : 0.0;
}

/// Orthonormal basis of what is orthogonal to the columns of A, as columns.
MatrixXd complement_of(const MatrixXd& A) {
  const Index n = A.rows();
  if (A.cols() == 0) return MatrixXd::Identity(n, n);
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(A);
  const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(n, n);
  return Q.rightCols(n - qr.rank());
}

/// VehicleRefit::moves.
std::vector<double> moves_between(const Series& old, const Series& refitted) {
  std::vector<double> out;
  for (Index j = 0; j < refitted.predicted.rows(); ++j) {
    const auto after = refitted.predicted.row(j).array(), before = old.predicted.row(j).array();
    const auto used = after.isFinite() && before.isFinite();
    const auto n = static_cast<double>(used.count());
    const double mean = used.select(after, 0.0).sum() / n;
    const double size = used.select(after - mean, 0.0).square().sum();
    const double moved = used.select(before - after, 0.0).square().sum();
    out.push_back(size > 0.0 ? std::sqrt(moved / size) : kNone);
  }
  return out;
}

}  // namespace

VehicleRefit refit_vehicle(const Estimate& result, const ModelFile& model,
                           const std::vector<Dataset>& recordings, bool robust) {
  VehicleRefit out;
  const VehicleUnknowns unknowns = estimated_unknowns(result, model);
  if (unknowns.free.empty()) return out;
  out.tried = true;
  VehicleRun run = usable_run(model, recordings);
  for (VehicleRun::Output& output : run.outputs) output.given_sd = kNone;
  const VehicleParameters<double>& known = unknowns.value;
  VehicleProblem problem = make_vehicle_problem(run, unknowns, demand_of(unknowns, known));
  problem.robust = robust;
  const VehicleOptimum best =
      maximise_likelihood(problem, coordinates_of(problem, known), SolverOptions{});
  out.converged = best.converged && best.z.size() > 0;
  if (!out.converged) return out;
  const VehicleCovariance here = vehicle_covariance(problem, best);
  const VehicleParameters<double> p = parameters_at(problem, best.z);

  std::vector<Index> judged;  // of covariance.inner
  for (std::size_t i = 0; i < here.inner.size(); ++i) {
    if (of_the_car(unknowns.free[static_cast<std::size_t>(here.inner[i])])) {
      judged.push_back(static_cast<Index>(i));
    }
  }
  const auto k = static_cast<Index>(judged.size());
  if (k == 0) return out;
  // All relative to the values that are known, in the user's terms.
  VectorXd d(k), slope(k), own(k);  // own: standard errors of the result
  MatrixXd V(k, k), flat(k, here.null_space.cols());
  for (Index i = 0; i < k; ++i) {
    const Index at = here.inner[static_cast<std::size_t>(judged[static_cast<std::size_t>(i)])];
    const VehicleParameter parameter = unknowns.free[static_cast<std::size_t>(at)];
    const UserValue now = in_user_terms(parameter, p[parameter]),
                    then = in_user_terms(parameter, known[parameter]);
    d[i] = now.value / then.value - 1.0;
    slope[i] = now.slope / then.value;
    flat.row(i) =
        here.null_space.row(judged[static_cast<std::size_t>(i)]) * unknowns.scale[at] * slope[i];
    const EstimatedParameter& of_result = *reported(result, parameter);
    own[i] = of_result.se / of_result.value;
    const Unit unit = parse_unit(of_result.unit).value_or(Unit{});
    VehicleRefit::Change change;
    change.name = of_result.name;
    change.unit = of_result.unit;
    change.known = unit.from_si(then.value);
    change.refitted = unit.from_si(now.value);
    out.changes.push_back(change);
  }
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j < k; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      V(i, j) = here.covariance(judged[a], judged[b]) * slope[i] * slope[j] +
                correlation_of(result, out.changes[a].name, out.changes[b].name) * own[i] * own[j];
    }
  }
  for (Index i = 0; i < k; ++i) {
    VehicleRefit::Change& change = out.changes[static_cast<std::size_t>(i)];
    const bool determined = flat.cols() == 0 || flat.row(i).norm() <= 1e-6;
    if (!determined) continue;
    change.se = std::sqrt(V(i, i)) * std::abs(change.known);
    change.visible = kFound * std::sqrt(V(i, i));
  }
  const MatrixXd L = complement_of(flat);
  const Index directions = L.cols();
  if (directions > 0) {
    const VectorXd Ld = L.transpose() * d;
    const double wald = Ld.dot((L.transpose() * V * L).ldlt().solve(Ld));
    const double f = std::min(here.freedom, freedom_of(result));
    out.dof = static_cast<double>(directions);
    out.freedom = std::max(1.0, f - out.dof + 1.0);
    out.statistic = wald / out.dof * std::min(1.0, out.freedom / f);
    out.p = f_upper_tail(out.statistic, out.dof, out.freedom);
  }

  out.moves = moves_between(validate_vehicle(model, recordings, unknowns, known, robust),
                            vehicle_series(problem, best.z));
  return out;
}

}  // namespace identikal
