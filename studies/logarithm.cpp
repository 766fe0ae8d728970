#include "studies/logarithm.h"

#include <array>
#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/QR>
#include <fmt/format.h>

#include "identify/vehicle/fit.h"
#include "identify/vehicle/starts.h"
#include "lib/base/constants.h"
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

// The principal logarithm of a 2 x 2 matrix with the eigenvalues mean +- half:
//
//   log Phi = log(mean - half) I + slope (Phi - (mean - half) I),
//   slope = (log(mean + half) - log(mean - half)) / (2 half)
//
// the straight line through the values of the logarithm at the two eigenvalues.
Eigen::Matrix2cd logarithm_of(const Matrix2d& Phi) {
  using Complex = std::complex<double>;
  const double mean = 0.5 * Phi.trace();
  const Complex half = std::sqrt(Complex(mean * mean - Phi.determinant()));
  const Complex ratio = half / mean;
  const Complex slope =
      std::abs(ratio) < 1e-4
          ? (1.0 + ratio * ratio / 3.0) / mean  // eigenvalues that nearly agree: no cancellation
          : (std::log(mean + half) - std::log(mean - half)) / (2.0 * half);
  const Complex least = mean - half;
  const Eigen::Matrix2cd I = Eigen::Matrix2cd::Identity();
  return std::log(least) * I + slope * (Phi.cast<Complex>() - least * I);
}

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
  const Eigen::Matrix2cd logarithm = logarithm_of(Phi);
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

constexpr double kSdR = 0.01, kSdVy = 0.03, kSpeed = 60.0 / 3.6;  // [rad/s], [m/s], [m/s]

enum { kStates, kSteering, kEquationError, kOutputError, kMethods };
constexpr std::array<const char*, kMethods> kWhat{"discrete least squares, logarithm: from A",
                                                  "the same, Cf from B, Cr from A",
                                                  "continuous equation error", "output error"};

Dataset noisy_recording(const TrueDrive& truth, Random& random) {
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
  return data;
}

// What every method makes of one recording.
struct Stiffnesses {
  Eigen::Matrix<double, 2, kMethods> by_method;  // Cf and Cr; NaN where there is none
  Eigen::RowVector2d bound;                      // standard errors of Cf and Cr by the bound
  DiscreteFit discrete;
};

Stiffnesses stiffnesses(const SingleTrack<>& car, const Model& model, const TrueDrive& truth,
                        const Dataset& data) {
  Stiffnesses out;
  out.by_method.setConstant(kNaN);
  out.discrete = discrete_fit(car, data.y.colwise().reverse(), truth.steering, kSpeed);
  out.by_method.col(kStates) = out.discrete.from_states;
  out.by_method.col(kSteering) = out.discrete.from_steering;

  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  VehicleParameters<double> p = unknowns.value;
  if (vehicle_by_equation_error(usable_run(model, {data}), unknowns, p)) {
    out.by_method.col(kEquationError) << p[kCf], p[kCr];
  }

  VehicleFitOptions fit_alone;
  fit_alone.second_opinion = false;
  for (const EstimatedParameter& each : fit_vehicle(model, data, fit_alone).parameters) {
    const Index row = each.name == "Cf" ? 0 : each.name == "Cr" ? 1 : -1;
    if (row < 0) continue;
    out.by_method(row, kOutputError) = each.value;
    out.bound[row] = each.crb_se;
  }
  return out;
}

// Mean and standard deviation of the error in % of the truth, over the runs that gave a number.
Vector2d error_spread(const VectorXd& values, double truth) {
  std::vector<double> ok;
  for (const double v : values) {
    if (std::isfinite(v)) ok.push_back(100.0 * (v / truth - 1.0));
  }
  const Eigen::Map<const VectorXd> kept(ok.data(), static_cast<Index>(ok.size()));
  return {kept.mean(), std::sqrt((kept.array() - kept.mean()).square().sum() /
                                 static_cast<double>(ok.size() - 1))};
}

// What is left without noise, and why the discrete fit is no car.
std::string explanation(const DiscreteFit& clean, double C, const MatrixXd& one_step,
                        const VectorXd& real) {
  const Eigen::RowVector2d mean_fit = one_step.colwise().mean();
  return fmt::format(
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
      kWhat[kStates], 100.0 * (clean.from_states[0] / C - 1.0), "",
      100.0 * (clean.from_states[1] / C - 1.0), kWhat[kSteering],
      100.0 * (clean.from_steering[0] / C - 1.0), "", 100.0 * (clean.from_steering[1] / C - 1.0),
      mean_fit[1], mean_fit[0], clean.one_step[1], clean.one_step[0], 100.0 * (1.0 - real.mean()));
}

}  // namespace

StudyReport logarithm_study(const StudyOptions& options) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const TrueDrive truth = true_drive(SevereLaneChange{}, kSpeed, kSpeed);
  const Model model = sladka2010_model();
  MatrixXd Cf(options.runs, kMethods), Cr = Cf;
  MatrixXd one_step(options.runs, 2), bound(options.runs, 2);
  VectorXd real(options.runs);
  repeat(options, 0, [&](int run, Random& random) {
    const Stiffnesses s = stiffnesses(car, model, truth, noisy_recording(truth, random));
    Cf.row(run) = s.by_method.row(0);
    Cr.row(run) = s.by_method.row(1);
    bound.row(run) = s.bound;
    real[run] = s.discrete.real ? 1.0 : 0.0;
    one_step.row(run) = s.discrete.one_step.transpose();
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
  for (Index m = 0; m < kMethods; ++m) {
    const Vector2d f = error_spread(Cf.col(m), C), r = error_spread(Cr.col(m), C);
    out.text += fmt::format("  {:<48} {:>8.1f} {:>8.2f} {:>8.1f} {:>8.2f}\n", kWhat[m], f[0], f[1],
                            r[0], r[1]);
  }
  const Eigen::RowVector2d mean_bound = 100.0 / C * bound.colwise().mean();
  out.text += fmt::format("  {:<48} {:>8} {:>8.2f} {:>8} {:>8.2f}\n", "Cramer-Rao bound", "",
                          mean_bound[0], "", mean_bound[1]);
  out.text +=
      explanation(discrete_fit(car, truth.states, truth.steering, kSpeed), C, one_step, real);
  return out;
}

}  // namespace identikal
