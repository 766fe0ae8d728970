#include "identify/validation/internal/vehicle_refit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/output_error.h"
#include "identify/vehicle/series.h"
#include "identify/vehicle/usable_data.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFound = 2.8;  // standard errors: 1.96 + 0.84

/// Of the car, wherever it is driven and whatever it is measured with.
bool of_the_car(VehicleParameter parameter) {
  return must_be_positive(parameter) || parameter == kSteeringGain;
}

/// Those that the result has estimated, free between the widest bounds; the others known.
VehicleUnknowns estimated_unknowns(const Estimate& result, const Model& model) {
  const VehicleUnknowns written = vehicle_unknowns(model);
  VehicleUnknowns out;
  out.value = written.value;
  out.curve = written.curve;
  for (const VehicleParameter parameter : written.free) {
    const EstimatedParameter* p = reported(result, name_of(parameter));
    if (p != nullptr && std::isfinite(p->se) && p->se > 0.0) set_free(out, parameter);
  }
  return out;
}

/// Orthonormal basis of what is orthogonal to the columns of A, as columns.
MatrixXd complement_of(const MatrixXd& A) {
  const Index n = A.rows();
  if (A.cols() == 0) return MatrixXd::Identity(n, n);
  const Eigen::ColPivHouseholderQR<MatrixXd> qr(A);
  const MatrixXd Q = qr.householderQ() * MatrixXd::Identity(n, n);
  return Q.rightCols(n - qr.rank());
}

/// What the refit has changed of the car, relative to the values that are known.
struct Changes {
  std::vector<VehicleRefit::Change> named;
  VectorXd d;
  MatrixXd V;     // covariance of d: errors of both fits
  MatrixXd flat;  // columns: directions that the recording does not determine
};

Changes changes_of_the_car(const Estimate& result, const VehicleUnknowns& unknowns,
                           const VehicleParameters<double>& refitted,
                           const VehicleCovariance& here) {
  std::vector<Index> judged;  // of here.inner
  for (std::size_t i = 0; i < here.inner.size(); ++i) {
    if (of_the_car(unknowns.free[here.inner[i]])) {
      judged.push_back(static_cast<Index>(i));
    }
  }
  const auto k = static_cast<Index>(judged.size());
  Changes out{{}, VectorXd(k), MatrixXd(k, k), MatrixXd(k, here.null_space.cols())};
  VectorXd slope(k), own(k);  // own: standard errors of the result
  for (Index i = 0; i < k; ++i) {
    const Index at = here.inner[judged[i]];
    const VehicleParameter parameter = unknowns.free[at];
    const UserValue now = in_user_terms(parameter, refitted[parameter]),
                    then = in_user_terms(parameter, unknowns.value[parameter]);
    out.d[i] = now.value / then.value - 1.0;
    slope[i] = now.slope / then.value;
    out.flat.row(i) = here.null_space.row(judged[i]) * unknowns.scale[at] * slope[i];
    const EstimatedParameter& of_result = *reported(result, name_of(parameter));
    own[i] = of_result.se / of_result.value;
    const Unit unit = unit_or_dimensionless(of_result.unit);
    VehicleRefit::Change change;
    change.name = of_result.name;
    change.unit = of_result.unit;
    change.known = unit.from_si(then.value);
    change.refitted = unit.from_si(now.value);
    out.named.push_back(change);
  }
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j < k; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      out.V(i, j) = here.covariance(judged[a], judged[b]) * slope[i] * slope[j] +
                    correlation_of(result, out.named[a].name, out.named[b].name) * own[i] * own[j];
    }
  }
  for (Index i = 0; i < k; ++i) {
    VehicleRefit::Change& change = out.named[i];
    const bool determined = out.flat.cols() == 0 || out.flat.row(i).norm() <= 1e-6;
    if (!determined) continue;
    change.se = std::sqrt(out.V(i, i)) * std::abs(change.known);
    change.detectable = kFound * std::sqrt(out.V(i, i));
  }
  return out;
}

/// Are they more than chance? Hotelling's test on what the recording determines of them.
void test_changes(const Changes& found, double freedom, VehicleRefit& out) {
  const MatrixXd L = complement_of(found.flat);
  if (L.cols() == 0) return;
  const VectorXd Ld = L.transpose() * found.d;
  const double wald = Ld.dot((L.transpose() * found.V * L).ldlt().solve(Ld));
  out.dof = static_cast<double>(L.cols());
  out.freedom = std::max(1.0, freedom - out.dof + 1.0);
  out.statistic = wald / out.dof * std::min(1.0, out.freedom / freedom);
  out.p = f_upper_tail(out.statistic, out.dof, out.freedom);
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

VehicleRefit refit_vehicle(const Estimate& result, const Model& model,
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
  const Changes found = changes_of_the_car(result, unknowns, parameters_at(problem, best.z), here);
  if (found.d.size() == 0) return out;
  out.changes = found.named;
  test_changes(found, std::fmin(here.freedom, result.covariance_freedom), out);

  out.moves = moves_between(validate_vehicle(model, recordings, unknowns, known, robust).series,
                            vehicle_series(problem, best.z));
  return out;
}

}  // namespace identikal
