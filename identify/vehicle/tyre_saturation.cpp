#include "identify/vehicle/tyre_saturation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "identify/estimate/distribution.h"
#include "identify/vehicle/internal/initial_states.h"
#include "identify/vehicle/internal/robust_noise.h"
#include "lib/base/quantile.h"

namespace identikal {
namespace {

constexpr double kScoreLevel = 0.01;
constexpr double kLargestSlip = 0.7;  // [rad]
constexpr double kAxleLevel = 0.005;  // one-sided, each of two axles

VehicleProblem saturating_problem(const VehicleProblem& linear) {
  VehicleProblem out = make_vehicle_problem(
      *linear.run, with_curve(linear.unknowns, TyreCurve::tanh), linear.demand);
  out.robust = linear.robust;
  return out;
}

/// The linear optimum as coordinates of the saturating problem.
Eigen::VectorXd with_saturation(const VehicleProblem& linear, const Eigen::VectorXd& z,
                                const Eigen::Vector2d& inverse_saturation) {
  const Eigen::Index k = linear.parameters();
  Eigen::VectorXd out(z.size() + 2);
  out << z.head(k), inverse_saturation, z.tail(z.size() - k);
  return out;
}

}  // namespace

TyreSaturation test_tyre_saturation(const VehicleProblem& linear, const VehicleOptimum& optimum,
                                    const VehicleCovariance& covariance) {
  TyreSaturation out;
  const VehicleProblem problem = saturating_problem(linear);
  const Eigen::Index k = linear.parameters();
  const Eigen::VectorXd at_linear = with_saturation(linear, optimum.z, Eigen::Vector2d::Zero());
  Eigen::VectorXd e;
  LeastSquares::RowMatrix J;
  if (!output_error(problem, at_linear, e, &J)) return out;
  for (std::size_t i = 0; i < problem.output.size(); ++i) {
    const auto n = static_cast<Eigen::Index>(i);
    J.row(n) /= covariance.sd[problem.output[i]];
    e[n] /= covariance.sd[problem.output[i]];
  }
  if (problem.robust) {
    // Scores of the robust cost, brought to unit variance: an outlier has a bounded influence.
    for (double& each : e) each *= noise_cost(true, each).weight;
    e /= std::sqrt(e.squaredNorm() / static_cast<double>(e.size()));
  }

  // What initial states and the other parameters explain is no sign of saturation.
  Eigen::MatrixXd parameters = J.leftCols(k + 2);
  project_out_states(problem, J.rightCols<2>(), parameters);
  const Eigen::MatrixXd X = orthogonal_part(parameters.leftCols(k), parameters.rightCols<2>());
  const Eigen::Matrix2d information = X.transpose() * X;
  // A recording at a crawl does not bend the tyre at all, and two axles may bend it the same way.
  if (!(information.determinant() > 1e-9 * information(0, 0) * information(1, 1))) return out;
  const Eigen::Vector2d score = -X.transpose() * e;
  const double statistic = score.dot(information.inverse() * score);
  if (!std::isfinite(statistic) || statistic < 0.0) return out;
  out.score_p = chi_square_upper_tail(statistic, 2.0);
  if (out.score_p > kScoreLevel) return out;

  // The score suggests a step; where that is none for an axle, the refit may still find that it
  // saturates.
  const Eigen::Vector2d step = (information.inverse() * score).cwiseMax(0.05).cwiseMin(4.0);
  const VehicleOptimum best =
      maximise_likelihood(problem, with_saturation(linear, optimum.z, step), SolverOptions{});
  if (!best.converged) return out;
  std::vector<double> slips[2];
  replay(problem, best.z, [&](Eigen::Index, const Motion& motion, double) {
    slips[0].push_back(std::abs(motion.slip_front));
    slips[1].push_back(std::abs(motion.slip_rear));
  });
  out.front.slip = quantile(slips[0], 0.95);
  out.rear.slip = quantile(slips[1], 0.95);
  // A car that slides sideways most of the time explains a wrong model, not a tyre.
  if (std::max(out.front.slip, out.rear.slip) > kLargestSlip) return out;
  out.refitted = true;
  out.gain = best.log_likelihood - optimum.log_likelihood;
  out.saturating = parameters_at(problem, best.z);
  output_error(problem, best.z, e, nullptr);
  out.rms = rms_per_output(problem, e);

  const VehicleCovariance refit = vehicle_covariance(problem, best);
  for (int axle = 0; axle < 2; ++axle) {
    TyreSaturation::Axle& result = axle == 0 ? out.front : out.rear;
    const double inverse =
        out.saturating[axle == 0 ? kInverseSaturationFront : kInverseSaturationRear];
    const double stiffness = out.saturating[axle == 0 ? kCf : kCr];
    const double linear_force = stiffness * result.slip;
    result.loss =
        1.0 - force_share(TyreCurve::tanh, inverse * linear_force * linear_force, {}).value;
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(problem.parameters());
    gradient[k + axle] = 1.0;
    const double se = standard_error(problem, refit, gradient);
    result.significant = inverse > student_t_quantile(1.0 - kAxleLevel, refit.freedom) * se;
  }
  return out;
}

}  // namespace identikal
