#include "studies/logarithm.h"

#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>
#include <fmt/format.h>
#include <unsupported/Eigen/MatrixFunctions>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/starts.h"
#include "lib/base/random.h"
#include "lib/vehicle/sladka2010_car.h"
#include "studies/runs.h"
#include "studies/sladka_lane_change.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

// x(t+1) = Phi x(t) + Gamma u(t) by least squares, back to continuous time by the logarithm.
struct DiscreteFit {
  Vector2d from_states;    // Cf and Cr by A(1,1) and A(2,1)
  Vector2d from_steering;  // Cf by B(1), then Cr by A(1,1)
  bool real = true;        // else Phi has no real logarithm, and its real part is used
  Vector2d one_step = Vector2d::Zero();  // fit of vy and r [%]
};

// @param x  2 x N: vy, r; @param angle  of the steering wheel
DiscreteFit discrete_fit(const SingleTrack<>& car, const MatrixXd& x, const VectorXd& angle,
                         double vx) {
  const Index n = x.cols() - 1;
  MatrixXd regressors(n, 3);
  regressors << x.leftCols(n).transpose(), angle.head(n) / car.steering_ratio;
  const MatrixXd next = x.rightCols(n).transpose();
  const MatrixXd solution = regressors.householderQr().solve(next);  // [Phi Gamma]'
  const MatrixXd misfit = next - regressors * solution;
  DiscreteFit out;
  for (Index i = 0; i < 2; ++i) {
    const VectorXd about_mean = next.col(i).array() - next.col(i).mean();
    out.one_step[i] = 100.0 * (1.0 - misfit.col(i).norm() / about_mean.norm());
  }
  const Matrix2d Phi = solution.topRows<2>().transpose();
  const Vector2d Gamma = solution.row(2).transpose();
  const Eigen::Matrix2cd logarithm = Eigen::Matrix2cd(Phi.cast<std::complex<double>>()).log();
  out.real = logarithm.imag().norm() < 1e-9;
  const Matrix2d A = logarithm.real() / kSladka2010Step;
  const Vector2d B = A * (Phi - Matrix2d::Identity()).inverse() * Gamma;
  // -(Cf + Cr) = m vx A11, -(a Cf - b Cr) = Iz vx A21, Cf = m B1.
  const double sum = -car.m * vx * A(0, 0), moment = -car.Iz * vx * A(1, 0);
  out.from_states << car.b * sum + moment, car.a * sum - moment;
  out.from_states /= car.a + car.b;
  out.from_steering << car.m * B[0], sum - car.m * B[0];
  return out;
}

}  // namespace

StudyReport logarithm_study(const StudyOptions& options) {
  constexpr double kSdR = 0.01, kSdVy = 0.03, kSpeed = 60.0 / 3.6;  // [rad/s], [m/s], [m/s]
  const SingleTrack<> car = linear_car(sladka2010_car());
  const TrueDrive truth = true_drive(SevereLaneChange{}, kSpeed, kSpeed);
  const ModelFile model = sladka2010_model();
  enum { kStates, kSteering, kEquationError, kOutputError, kMethods };
  constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();
  MatrixXd Cf(options.runs, kMethods), Cr = Cf;
  MatrixXd one_step(options.runs, 2), bound(options.runs, 2);
  VectorXd real(options.runs);
  repeat(options, 0, [&](int run, Random& random) {
    Dataset data;
    data.name = "simulated";
    data.time = truth.time;
    data.dt = kSladka2010Step;
    data.inputs = {{"steering_wheel_angle", "rad"}, {"vx", "m/s"}};
    data.outputs = {{"r", "rad/s"}, {"vy", "m/s"}};
    data.u.resize(2, kSladka2010Samples);
    data.u << truth.steering.transpose(), truth.vx.transpose();
    data.y.resize(2, kSladka2010Samples);
    for (Index t = 0; t < kSladka2010Samples; ++t) {
      data.y(0, t) = truth.states(1, t) + kSdR * random.normal();
      data.y(1, t) = truth.states(0, t) + kSdVy * random.normal();
    }
    const DiscreteFit discrete =
        discrete_fit(car, data.y.colwise().reverse(), truth.steering, kSpeed);
    Cf(run, kStates) = discrete.from_states[0];
    Cr(run, kStates) = discrete.from_states[1];
    Cf(run, kSteering) = discrete.from_steering[0];
    Cr(run, kSteering) = discrete.from_steering[1];
    real[run] = discrete.real ? 1.0 : 0.0;
    one_step.row(run) = discrete.one_step.transpose();

    const VehicleUnknowns unknowns = vehicle_unknowns(model);
    VehicleParameters<double> p = unknowns.value;
    const bool found = vehicle_by_equation_error(usable_run(model, {data}), unknowns, p);
    Cf(run, kEquationError) = found ? p[kCf] : kMissing;
    Cr(run, kEquationError) = found ? p[kCr] : kMissing;

    VehicleFitOptions fit_alone;
    fit_alone.second_opinion = false;
    const Estimate fit = fit_vehicle(model, data, fit_alone);
    for (const EstimatedParameter& each : fit.parameters) {
      if (each.name == "Cf") {
        Cf(run, kOutputError) = each.value;
        bound(run, 0) = each.crb_se;
      } else if (each.name == "Cr") {
        Cr(run, kOutputError) = each.value;
        bound(run, 1) = each.crb_se;
      }
    }
  });
  const double C = car.front.stiffness;
  StudyReport out;
  out.text = fmt::format(
      "sladka-logarithm: cornering stiffnesses of the car of table 8.1 from a severe lane change, "
      "{} runs\n"
      "70 samples at 10 Hz, 60 km/h, sd(vy) {:g} m/s, sd(r) {:g} rad/s; true Cf = Cr = {:g} N/rad\n"
      "published: nothing of the kind; a warning to who would go on from (9.1) to the car.\n"
      "Bias and standard deviation in % of the truth\n"
      "  {:<48} {:>8} {:>8} {:>8} {:>8}\n",
      options.runs, kSdVy, kSdR, C, "", "Cf bias", "sd", "Cr bias", "sd");
  constexpr std::array<const char*, kMethods> kWhat{"discrete least squares, logarithm: from A",
                                                    "the same, Cf from B, Cr from A",
                                                    "continuous equation error", "output error"};
  // Mean and standard deviation over the runs that gave a number.
  const auto spread = [&](const VectorXd& values) {
    std::vector<double> ok;
    for (const double v : values) {
      if (std::isfinite(v)) ok.push_back(100.0 * (v / C - 1.0));
    }
    const Eigen::Map<const VectorXd> kept(ok.data(), static_cast<Index>(ok.size()));
    return Vector2d(kept.mean(), std::sqrt((kept.array() - kept.mean()).square().sum() /
                                           static_cast<double>(ok.size() - 1)));
  };
  for (Index m = 0; m < kMethods; ++m) {
    const Vector2d f = spread(Cf.col(m)), r = spread(Cr.col(m));
    out.text += fmt::format("  {:<48} {:>8.1f} {:>8.2f} {:>8.1f} {:>8.2f}\n",
                            kWhat[static_cast<std::size_t>(m)], f[0], f[1], r[0], r[1]);
  }
  const Eigen::RowVector2d mean_bound = 100.0 / C * bound.colwise().mean();
  const Eigen::RowVector2d mean_fit = one_step.colwise().mean();
  const DiscreteFit clean = discrete_fit(car, truth.states, truth.steering, kSpeed);
  out.text += fmt::format(
      "  {:<48} {:>8} {:>8.2f} {:>8} {:>8.2f}\n"
      "without noise\n"
      "  {:<48} {:>8.1f} {:>8} {:>8.1f}\n"
      "  {:<48} {:>8.1f} {:>8} {:>8.1f}\n"
      "One step ahead the discrete fit looks well: {:.1f} % of r and {:.1f} % of vy, {:.1f} and "
      "{:.1f} % without noise. All the same\n"
      "it is no car: steering is not held between samples, noise in its regressors bends Phi, and "
      "the logarithm\n"
      "makes much of both; in {:.0f} % of the runs Phi has no real logarithm at all (its real part "
      "is used then). This is\n"
      "where recursive least squares with lambda = 1 ends. Equation error and output error seek Iz "
      "too.\n",
      "Cramer-Rao bound", "", mean_bound[0], "", mean_bound[1], kWhat[kStates],
      100.0 * (clean.from_states[0] / C - 1.0), "", 100.0 * (clean.from_states[1] / C - 1.0),
      kWhat[kSteering], 100.0 * (clean.from_steering[0] / C - 1.0), "",
      100.0 * (clean.from_steering[1] / C - 1.0), mean_fit[1], mean_fit[0], clean.one_step[1],
      clean.one_step[0], 100.0 * (1.0 - real.mean()));
  return out;
}

}  // namespace identikal
