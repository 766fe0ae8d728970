#include "studies/vehicle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "lib/filter/kalman.h"
#include "lib/model/discretise.h"
#include "lib/regression/recursive_least_squares.h"
#include "lib/vehicle/manoeuvre.h"
#include "lib/vehicle/motion.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/trajectory.h"
#include "lib/vehicle/velocity_sensors.h"
#include "studies/logarithm.h"
#include "studies/runs.h"
#include "studies/sladka_lane_change.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3Xd;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double kMemory = 0.999, kStartP = 100.0;    // section 9.3.1: lambda, delta
constexpr double kTurned = 1.9 * kDegree;             // section 9.3.2
constexpr double kAngleSnr = 30.0, kSpeedSnr = 50.0;  // [dB]
constexpr double kTrackSd = 0.02;                     // of the marking device [m]
constexpr Index kFromSample = 30;  // where the source begins to look at coefficients

double rms(const Eigen::Ref<const MatrixXd>& x) {
  return x.norm() / std::sqrt(static_cast<double>(x.size()));
}

// x' of (7.4), and of the m-file in 9.2.2, whose row 2, column 1 has the sign of b Cr turned.
enum class Moment { balanced, as_printed };

Vector2d source_rates(const SingleTrack<>& car, Moment moment, const Vector2d& x, double steering,
                      double vx) {
  SingleTrackMatrices model = single_track_matrices(car, vx);
  if (moment == Moment::as_printed)
    model.A(1, 0) -= 2.0 * car.b * car.rear.stiffness / (car.Iz * vx);
  return model.A * x + model.B * (steering / car.steering_ratio);
}

// 'stateEq' of 9.2.2: Runge-Kutta over one step, a sampling period or less, inputs held.
Vector2d source_step(const SingleTrack<>& car, Moment moment, const Vector2d& x, double steering,
                     double vx, double h = kSladka2010Step) {
  const auto rates = [&](const Vector2d& at) {
    return source_rates(car, moment, at, steering, vx);
  };
  const Vector2d k1 = rates(x), k2 = rates(x + 0.5 * h * k1);
  const Vector2d k3 = rates(x + 0.5 * h * k2), k4 = rates(x + h * k3);
  return x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4);
}

// What the recursive least squares of 9.2.1 makes of one signal and one regressor.
struct ScalarRls {
  VectorXd estimate;     // before the sample is used, as the m-file has it
  VectorXd coefficient;  // after it
};

// Table 6.1 with d = 1.
ScalarRls scalar_rls(const VectorXd& regressor, const VectorXd& y, double start_p) {
  Forgetting forgetting;
  forgetting.factor = kMemory;
  const RegressionHistory course =
      run_recursive_least_squares(regressor.transpose(), y, 1.0 / start_p, forgetting);
  return {y - course.prior_error, course.theta.row(0).transpose()};
}

// One run of the experiment: what is measured, and what both filters estimate.
struct SensorExperiment {
  VectorXd steering;     // measured
  MatrixXd speed, slip;  // 2 x N, of both vector sensors
  Matrix3Xd derived;     // vx, vy, r from them
  MatrixXd simulation;   // 2 x N: states simulated from measured inputs
  std::array<ScalarRls, 2> rls;
  MatrixXd kalman;          // 2 x N, given the samples up to each
  Eigen::Matrix2Xd marked;  // the measured track
};

// vy and r of the car by its measured inputs, one of which sections 9.1 to 9.3 take as regressor.
MatrixXd simulated_states(const SensorExperiment& run, Moment moment, bool from_measured_state) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  MatrixXd out(2, kSladka2010Samples);
  Vector2d state = Vector2d::Zero();
  for (Index t = 0; t < kSladka2010Samples; ++t) {
    if (t > 0) state = source_step(car, moment, state, run.steering[t - 1], run.derived(0, t - 1));
    out(0, t) = state[0];
    out(1, t) = state[1];
    if (from_measured_state) state = run.derived.col(t).tail<2>();
  }
  return out;
}

// The same in steps of 0.01 s, with inputs by 'pchip' between the samples (section 9.1).
MatrixXd finely_simulated_states(const VectorXd& time, const SensorExperiment& run) {
  constexpr int kPieces = 10;
  const SingleTrack<> car = linear_car(sladka2010_car());
  const Pchip steering(time, run.steering), speed(time, run.derived.row(0).transpose());
  MatrixXd out = MatrixXd::Zero(2, kSladka2010Samples);
  Vector2d state = Vector2d::Zero();
  for (Index t = 0; t + 1 < kSladka2010Samples; ++t) {
    const double h = (time[t + 1] - time[t]) / kPieces;
    for (int i = 0; i < kPieces; ++i) {
      const double at = time[t] + i * h;
      state = source_step(car, Moment::balanced, state, steering.in_interval(t, at),
                          speed.in_interval(t, at), h);
    }
    out.col(t + 1) = state;
  }
  return out;
}

MatrixXd kalman_states(const SensorExperiment& run, const CentreVelocity& derived,
                       double steering_sd) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  const VectorXd angle = run.steering / car.steering_ratio;
  // Steering between samples is not the straight line that the model takes it for.
  const VectorXd bend = angle.tail(kSladka2010Samples - 2) -
                        2.0 * angle.segment(1, kSladka2010Samples - 2) +
                        angle.head(kSladka2010Samples - 2);
  const double process_sd = std::hypot(steering_sd / car.steering_ratio, rms(bend) / 8.0);
  const ModelAt model = [&](Index t, StateSpace& at, std::vector<StateSpace>*) {
    const SingleTrackMatrices motion = single_track_matrices(car, derived.value(0, t));
    StateSpace continuous;
    continuous.A = motion.A;
    continuous.B = motion.B;
    continuous.C = Matrix2d::Identity();
    continuous.D = MatrixXd::Zero(2, 1);
    continuous.G = Matrix2d::Identity();
    continuous.Q = Matrix2d::Zero();
    continuous.R = derived.covariance[t].bottomRightCorner<2, 2>();
    continuous.S = Matrix2d::Zero();
    continuous.x0 = Vector2d::Zero();
    continuous.P0 = Vector2d(0.25, 0.04).asDiagonal();
    at = discretise(continuous, ProcessNoise::per_sample, kSladka2010Step, InputHold::linear);
    const Vector2d gain = at.B.rowwise().sum();
    at.Q = process_sd * process_sd * gain * gain.transpose();
  };
  return kalman_filter(model, InitialState::given, derived.value.bottomRows<2>(),
                       with_next_sample(angle.transpose()))
      .x_filt;
}

SensorExperiment experiment(const TrueDrive& truth, Random& random) {
  // Adds white noise, snr [dB] below the signal (awgn with 'measured'); returns its sd.
  const auto noisy = [&random](Eigen::Ref<Eigen::RowVectorXd> signal, double snr) {
    const double sd = std::pow(10.0, -snr / 20.0) * rms(signal);
    for (double& value : signal) value += sd * random.normal();
    return sd;
  };
  SensorExperiment out;
  // HS-CE in front, V1 behind: section 8.3.
  std::vector<VectorSensor> sensors(2);
  sensors[0].x = 2.109;
  sensors[0].y = -0.027;
  sensors[1].x = -2.760;
  sensors[1].y = -0.379;
  out.speed.resize(2, kSladka2010Samples);
  out.slip.resize(2, kSladka2010Samples);
  Eigen::RowVectorXd angle = truth.steering.transpose();
  const double steering_sd = noisy(angle, kAngleSnr);
  out.steering = angle.transpose();
  for (Index s = 0; s < 2; ++s) {
    VectorSensor& sensor = sensors[s];
    const Eigen::RowVectorXd r = truth.states.row(1);
    const Eigen::RowVectorXd forward = truth.vx.transpose() - sensor.y * r;
    const Eigen::RowVectorXd left = truth.states.row(0) + sensor.x * r;
    Eigen::RowVectorXd speed = (forward.array().square() + left.array().square()).sqrt();
    Eigen::RowVectorXd slip =
        left.binaryExpr(forward, [](double y, double x) { return std::atan2(y, x); });
    sensor.speed_sd = noisy(speed, kSpeedSnr);
    sensor.slip_sd = noisy(slip, kAngleSnr);
    out.speed.row(s) = speed;
    out.slip.row(s) = slip;
  }
  const CentreVelocity derived = centre_velocity(sensors, out.speed, out.slip);
  out.derived = derived.value;
  out.simulation = simulated_states(out, Moment::balanced, false);
  for (Index i = 0; i < 2; ++i) {
    out.rls[i] =
        scalar_rls(out.simulation.row(i).transpose(), out.derived.row(1 + i).transpose(), kStartP);
  }
  out.kalman = kalman_states(out, derived, steering_sd);
  out.marked = Eigen::Rotation2Dd(kTurned).toRotationMatrix() * truth.track.topRows<2>();
  for (Index t = 0; t < kSladka2010Samples; ++t) out.marked.col(t) += kTrackSd * random.normal(2);
  return out;
}

TrueDrive source_drive() {
  SevereLaneChange manoeuvre;
  manoeuvre.start = 1.5;  // the source's coefficients settle from about the thirtieth sample
  return true_drive(manoeuvre, 61.0 / 3.6, 58.0 / 3.6);
}

std::vector<SensorExperiment> experiments(const TrueDrive& truth, const StudyOptions& options) {
  std::vector<SensorExperiment> out(static_cast<std::size_t>(options.runs));
  repeat(options, 0, [&](int run, Random& random) { out[run] = experiment(truth, random); });
  return out;
}

std::string set_up(const char* name, const char* what, int runs) {
  return fmt::format(
      "sladka-figure-{}: {}, {} runs\n"
      "The recording was not published. Simulated: car of table 8.1, linear tyres, open-loop "
      "severe lane change,\n"
      "61 to 58 km/h, 70 samples at 10 Hz; white noise {:g} dB below steering and both slip "
      "angles, {:g} dB below both\n"
      "speeds; vx, vy, r from two vector sensors where the source had them.\n",
      name, what, runs, kAngleSnr, kSpeedSnr);
}

// Everything that the first run measured and made of it.
std::string experiment_csv(const TrueDrive& truth, const SensorExperiment& run) {
  std::string out =
      "t [s],steering [deg],U_front [m/s],slip_front [deg],U_rear [m/s],slip_rear [deg],"
      "vx [m/s],vy [m/s],r [rad/s],vx_true [m/s],vy_true [m/s],r_true [rad/s],"
      "vy_rls [m/s],r_rls [rad/s],vy_kalman [m/s],r_kalman [rad/s],"
      "coefficient_vy,coefficient_r,X_marked [m],Y_marked [m]\n";
  for (Index t = 0; t < kSladka2010Samples; ++t) {
    out += fmt::format("{:g},{:.8g},{:.8g},{:.8g},{:.8g},{:.8g}", truth.time[t],
                       run.steering[t] / kDegree, run.speed(0, t), run.slip(0, t) / kDegree,
                       run.speed(1, t), run.slip(1, t) / kDegree);
    for (const double v : run.derived.col(t)) out += fmt::format(",{:.6g}", v);
    out +=
        fmt::format(",{:.6g},{:.6g},{:.6g}", truth.vx[t], truth.states(0, t), truth.states(1, t));
    out += fmt::format(",{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n",
                       run.rls[0].estimate[t], run.rls[1].estimate[t], run.kalman(0, t),
                       run.kalman(1, t), run.rls[0].coefficient[t], run.rls[1].coefficient[t],
                       run.marked(0, t), run.marked(1, t));
  }
  return out;
}

Panel panel_over_time(const std::string& title, const std::string& label,
                      const std::vector<Curve>& curves) {
  Panel panel;
  panel.title = title;
  panel.x = {"time [s]", 0.0, kSladka2010Step * (kSladka2010Samples - 1)};
  panel.y = {label, 0.0, 0.0};
  for (const Curve& curve : curves) {
    panel.y.low = std::min(panel.y.low, curve.y.minCoeff());
    panel.y.high = std::max(panel.y.high, curve.y.maxCoeff());
  }
  const double room = 0.1 * (panel.y.high - panel.y.low);
  panel.y.low -= room;
  panel.y.high += 4.0 * room;  // for the legend
  panel.curves = curves;
  return panel;
}

struct StateFigure {
  const char* name;
  Index state;  // 0: vy, 1: r
  bool with_kalman;
  const char* published;
  const char* agrees;
};

const char* label_of(Index state) {
  return state == 0 ? "lateral velocity [m/s]" : "yaw rate [rad/s]";
}

// How many samples the estimate comes after the truth: where their products sum to the most.
double delay(const VectorXd& estimate, const VectorXd& truth) {
  constexpr Index kFarthest = 10;
  std::array<double, 2 * kFarthest + 1> sum{};
  for (Index lag = -kFarthest; lag <= kFarthest; ++lag) {
    const Index n = kSladka2010Samples - std::abs(lag);
    sum[lag + kFarthest] = estimate.segment(std::max<Index>(lag, 0), n)
                               .dot(truth.segment(std::max<Index>(-lag, 0), n));
  }
  const auto top = std::max_element(sum.begin() + 1, sum.end() - 1);
  // The vertex of the parabola through the largest and its neighbours.
  const double bend = top[-1] - 2.0 * top[0] + top[1];
  return static_cast<double>(top - sum.begin()) - kFarthest + 0.5 * (top[-1] - top[1]) / bend;
}

StudyReport state_figure(const StateFigure& figure, const StudyOptions& options) {
  const TrueDrive truth = source_drive();
  const std::vector<SensorExperiment> runs = experiments(truth, options);
  const Index i = figure.state;
  const VectorXd x = truth.states.row(i).transpose();
  enum { kDerived, kFreeRun, kRls, kKalman, kRows };
  Eigen::Vector4d squares = Eigen::Vector4d::Zero(), late = squares, delays = squares;
  const Index second = kSladka2010Samples - kFromSample;
  const double share = 1.0 / static_cast<double>(runs.size());
  for (const SensorExperiment& run : runs) {
    const std::array<VectorXd, kRows> estimates{run.derived.row(1 + i).transpose(),
                                                run.simulation.row(i).transpose(),
                                                run.rls[i].estimate, run.kalman.row(i).transpose()};
    for (Index k = 0; k < kRows; ++k) {
      const VectorXd& estimate = estimates[k];
      const VectorXd e = estimate - x;
      squares[k] += share * e.squaredNorm() / kSladka2010Samples;
      late[k] += share * e.tail(second).squaredNorm() / static_cast<double>(second);
      delays[k] += share * delay(estimate, x);
    }
  }
  StudyReport out;
  out.text = set_up(figure.name, label_of(i), options.runs) + "published: " + figure.published;
  out.text += fmt::format(
      "\nours: root mean square error against the noise-free truth, {}; largest |truth| {:.4f}\n"
      "  {:<42} {:>9} {:>17} {:>15}\n",
      i == 0 ? "m/s" : "rad/s", x.cwiseAbs().maxCoeff(), "", "all",
      fmt::format("from sample {}", kFromSample + 1), "delay, samples");
  constexpr std::array<const char*, kRows> kWhat{
      "measured: from the two sensors", "simulated from measured inputs (regressor)",
      "RLS: coefficient times the simulated", "Kalman filter"};
  for (Index k = 0; k < kRows; ++k) {
    out.text += fmt::format("  {:<42} {:>9.5f} {:>17.5f} {:>15.2f}\n", kWhat[k],
                            std::sqrt(squares[k]), std::sqrt(late[k]), delays[k]);
  }
  const SensorExperiment& first = runs.front();
  const ScalarRls& rls = first.rls[i];
  std::vector<Curve> curves{
      {"measured", truth.time, first.derived.row(1 + i).transpose(), Curve::Form::points},
      {"truth", truth.time, x, Curve::Form::dashed},
      {"RLS", truth.time, rls.estimate, Curve::Form::solid}};
  if (figure.with_kalman) {
    curves.push_back(
        {"Kalman filter", truth.time, first.kalman.row(i).transpose(), Curve::Form::solid});
  }
  out.text += figure.with_kalman
                  ? "Kalman filter: single-track model at the measured speed, steering straight "
                    "between samples; R from the\n"
                    "sensors' errors, process noise from that of steering and from its bend "
                    "between samples (second difference / 8).\n"
                  : "Late by half a sample, because steering is held from one to the next. One "
                    "coefficient for the whole run scales\n"
                    "the simulated state and cannot follow what the simulation lacks.\n";
  out.text += std::string("agrees? ") + figure.agrees + "\n";
  out.csv = experiment_csv(truth, first);
  out.figure = Figure{{panel_over_time(label_of(i), label_of(i), curves)}};
  return out;
}

StudyReport coefficient_figure(const char* name, Index i, const char* published, const char* agrees,
                               const StudyOptions& options) {
  const TrueDrive truth = source_drive();
  const std::vector<SensorExperiment> runs = experiments(truth, options);
  StudyReport out;
  out.text =
      set_up(name, i == 0 ? "RLS coefficient of lateral velocity" : "RLS coefficient of yaw rate",
             options.runs) +
      "published: " + published +
      fmt::format(
          "\nours, lambda {:g}; what the regressor was, the source does not say. One "
          "coefficient near one: the state\n"
          "of its simulation (9.2.2). Coefficient at the last sample, mean and standard "
          "deviation of the runs, and\n"
          "root mean square of estimate - measured from sample {} on:\n"
          "  {:<52} {:>8} {:>8} {:>9}\n",
          kMemory, kFromSample + 1, "", "mean", "sd", "misfit");
  const auto line = [&](const char* what, double start_p, const auto& of_run) {
    VectorXd last(static_cast<Index>(runs.size()));
    double misfit = 0.0;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const VectorXd y = runs[k].derived.row(1 + i).transpose();
      const MatrixXd phi = of_run(runs[k]);
      const ScalarRls rls = scalar_rls(phi.row(i).transpose(), y, start_p);
      last[k] = rls.coefficient[kSladka2010Samples - 1];
      const double late = rms((rls.estimate - y).tail(kSladka2010Samples - kFromSample));
      misfit += late * late / static_cast<double>(runs.size());
    }
    const double spread = std::sqrt((last.array() - last.mean()).square().sum() /
                                    static_cast<double>(last.size() - 1));
    out.text += fmt::format("  {:<52} {:>8.4f} {:>8.4f} {:>9.5f}\n", what, last.mean(), spread,
                            std::sqrt(misfit));
  };
  line("simulation, moment balance (used in the figures)", kStartP,
       [](const SensorExperiment& run) { return run.simulation; });
  line("the same, P(0) = 1/delta as in table 6.1", 1.0 / kStartP,
       [](const SensorExperiment& run) { return run.simulation; });
  line("one step from the measured state, moment balance", kStartP,
       [](const SensorExperiment& run) { return simulated_states(run, Moment::balanced, true); });
  line("one step from the measured state, (7.4) as printed", kStartP,
       [](const SensorExperiment& run) { return simulated_states(run, Moment::as_printed, true); });
  const MatrixXd printed = simulated_states(runs.front(), Moment::as_printed, false);
  out.text += fmt::format(
      "P(0) = delta I is that of the m-file; with the inverse, as printed in table 6.1, delta = "
      "100 holds the\n"
      "coefficient near 0. Simulated as printed, (7.4) is unstable, its sign in row 2, column 1 "
      "being wrong:\n"
      "{:.2g} {} at the last sample. So the source ran it from measured states, or not as "
      "printed.\n"
      "agrees? {}\n",
      printed.row(i).cwiseAbs()[kSladka2010Samples - 1], i == 0 ? "m/s" : "rad/s", agrees);
  const SensorExperiment& first = runs.front();
  const VectorXd one = VectorXd::Ones(kSladka2010Samples);
  out.csv = experiment_csv(truth, first);
  out.figure =
      Figure{{panel_over_time("Filter coefficient", "coefficient [-]",
                              {{"RLS", truth.time, first.rls[i].coefficient, Curve::Form::marked},
                               {"one", truth.time, one, Curve::Form::dashed}})}};
  return out;
}

// The two windows of the program: lateral velocity with held inputs, and with 'pchip'.
StudyReport program_figure(const StudyOptions& options) {
  const TrueDrive truth = source_drive();
  const std::vector<SensorExperiment> runs = experiments(truth, options);
  struct Window {
    const char* what;
    ScalarRls first;
    double squares = 0.0, errors = 0.0, last = 0.0;
  };
  std::array<Window, 2> windows{
      {{"inputs held from sample to sample", {}}, {"inputs by pchip, in steps of 0.01 s", {}}}};
  const double share = 1.0 / static_cast<double>(runs.size());
  for (const SensorExperiment& run : runs) {
    const VectorXd y = run.derived.row(1).transpose(), x = truth.states.row(0).transpose();
    const std::array<MatrixXd, 2> regressors{run.simulation,
                                             finely_simulated_states(truth.time, run)};
    for (std::size_t w = 0; w < windows.size(); ++w) {
      const ScalarRls rls = scalar_rls(regressors[w].row(0).transpose(), y, kStartP);
      if (&run == runs.data()) windows[w].first = rls;
      windows[w].squares += share * (rls.estimate - x).squaredNorm() / kSladka2010Samples;
      windows[w].errors += share * (rls.estimate - y).squaredNorm() / kSladka2010Samples;
      windows[w].last += share * rls.coefficient[kSladka2010Samples - 1];
    }
  }
  StudyReport out;
  out.text = set_up("9.1", "output of the program for the lateral velocity", options.runs) +
             "published: two windows of curves: output, error and coefficient, without and with "
             "pchip.\n"
             "ours: root mean squares in m/s, and the coefficient at the last sample\n";
  out.text += fmt::format("  {:<36} {:>14} {:>14} {:>12}\n", "", "error signal", "to the truth",
                          "coefficient");
  for (const Window& window : windows) {
    out.text += fmt::format("  {:<36} {:>14.5f} {:>14.5f} {:>12.4f}\n", window.what,
                            std::sqrt(window.errors), std::sqrt(window.squares), window.last);
  }
  out.text += fmt::format(
      "agrees? {}\n", windows[1].squares < windows[0].squares
                          ? "In kind, as curves can: with pchip the estimate is no longer late, "
                            "and nearer to the truth."
                          : "No: pchip brings the estimate no nearer to the truth.");
  const SensorExperiment& first = runs.front();
  const VectorXd y = first.derived.row(1).transpose();
  const auto curve = [&](std::size_t w, const VectorXd& values) {
    return Curve{w == 0 ? "inputs held" : "pchip", truth.time, values,
                 w == 0 ? Curve::Form::dashed : Curve::Form::solid};
  };
  std::vector<Curve> outputs{{"measured", truth.time, y, Curve::Form::points}}, errors,
      coefficients;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    outputs.push_back(curve(w, windows[w].first.estimate));
    errors.push_back(curve(w, y - windows[w].first.estimate));
    coefficients.push_back(curve(w, windows[w].first.coefficient));
  }
  out.csv = experiment_csv(truth, first);
  out.figure = Figure{{panel_over_time("Output", label_of(0), outputs),
                       panel_over_time("Error", label_of(0), errors),
                       panel_over_time("Filter coefficient", "coefficient [-]", coefficients)}};
  return out;
}

Eigen::Matrix2Xd derived_track(const TrueDrive& truth, const SensorExperiment& run, bool kalman,
                               TrackRule rule) {
  const VectorXd vx = run.derived.row(0).transpose();
  const VectorXd vy = kalman ? VectorXd(run.kalman.row(0).transpose()) : run.rls[0].estimate;
  const VectorXd r = kalman ? VectorXd(run.kalman.row(1).transpose()) : run.rls[1].estimate;
  return track(truth.time, vx, vy, r, {}, rule).topRows<2>();
}

StudyReport track_figure(const char* name, bool with_kalman, const char* published,
                         const StudyOptions& options) {
  const TrueDrive truth = source_drive();
  const std::vector<SensorExperiment> runs = experiments(truth, options);
  StudyReport out;
  out.text =
      set_up(name, "track of the centre of gravity", options.runs) +
      fmt::format(
          "The marked track is the true one turned by 1.9 deg, as if the run began in "
          "another direction, with {:g} m of noise.\n"
          "published: {}\n"
          "ours: the turn about the start that fits best, mean and standard deviation of the "
          "runs and the mean of\n"
          "its standard error; distance from the marked track, root mean square, before and "
          "after turning by 1.9 deg\n"
          "  {:<30} {:>9} {:>7} {:>7} {:>11} {:>9}\n",
          kTrackSd, published, "", "turn, deg", "sd", "se", "before, m", "after, m");
  struct Line {
    const char* what;
    bool kalman;
    TrackRule rule;
  };
  for (const Line& line : {Line{"RLS, forward Euler", false, TrackRule::forward_euler},
                           Line{"RLS, arcs", false, TrackRule::arcs},
                           Line{"Kalman filter, forward Euler", true, TrackRule::forward_euler},
                           Line{"Kalman filter, arcs", true, TrackRule::arcs}}) {
    VectorXd angle(static_cast<Index>(runs.size()));
    double se = 0.0, before = 0.0, after = 0.0;
    const double share = 1.0 / static_cast<double>(runs.size());
    for (std::size_t k = 0; k < runs.size(); ++k) {
      const Eigen::Matrix2Xd derived = derived_track(truth, runs[k], line.kalman, line.rule);
      const TrackFit fit = fit_track(derived, runs[k].marked, false);
      const Eigen::Matrix2Xd turned = Eigen::Rotation2Dd(kTurned).toRotationMatrix() * derived;
      angle[k] = fit.angle / kDegree;
      se += share * fit.angle_se / kDegree;
      before += share * (derived - runs[k].marked).squaredNorm() / kSladka2010Samples;
      after += share * (turned - runs[k].marked).squaredNorm() / kSladka2010Samples;
    }
    const double spread =
        std::sqrt((angle.array() - angle.mean()).square().sum() * share / (1.0 - share));
    out.text += fmt::format("  {:<30} {:>9.3f} {:>7.3f} {:>7.3f} {:>11.3f} {:>9.3f}\n", line.what,
                            angle.mean(), spread, se, std::sqrt(before), std::sqrt(after));
  }
  out.text +=
      "The standard error takes the distances for independent; those of an integrated track are "
      "not, and sd is larger.\n";
  out.text += with_kalman
                  ? "agrees? Yes: the Kalman filter's track is nearer, by a third; what is left is "
                    "mostly heading.\n"
                  : "agrees? Yes: the turn that was put in is found to a tenth of a degree.\n";
  const SensorExperiment& first = runs.front();
  Panel panel;
  panel.title = "Track of the centre of gravity";
  const auto curve = [](const std::string& what, const Eigen::Matrix2Xd& points, Curve::Form form) {
    return Curve{what, points.row(0).transpose(), points.row(1).transpose(), form};
  };
  const Matrix2d turn = Eigen::Rotation2Dd(kTurned).toRotationMatrix();
  const Eigen::Matrix2Xd rls = derived_track(truth, first, false, TrackRule::forward_euler);
  panel.curves = {curve("marked", first.marked, Curve::Form::points)};
  if (with_kalman) {
    panel.curves.push_back(curve("RLS, turned", turn * rls, Curve::Form::dashed));
    panel.curves.push_back(curve("Kalman filter, turned",
                                 turn * derived_track(truth, first, true, TrackRule::forward_euler),
                                 Curve::Form::solid));
  } else {
    panel.curves.push_back(curve("from RLS states", rls, Curve::Form::dashed));
    panel.curves.push_back(curve("the same, turned by 1.9 deg", turn * rls, Curve::Form::solid));
  }
  panel.x = {"X [m]", 0.0, 120.0};
  panel.y = {"Y [m]", 0.0, 0.0};
  for (const Curve& each : panel.curves) {
    panel.y.low = std::min(panel.y.low, each.y.minCoeff() - 1.0);
    panel.y.high = std::max(panel.y.high, each.y.maxCoeff() + 3.0);
  }
  out.csv = experiment_csv(truth, first);
  out.figure = Figure{{panel}};
  return out;
}

}  // namespace

std::vector<Study> vehicle_studies() {
  constexpr int kRuns = 200;
  const StateFigure figures[] = {
      {"9.2", 0, false,
       "curves. The filter follows the lateral velocity, but \"does not react on the small "
       "velocity changes\".",
       "Yes: smooth, without what the simulation lacks, farther from the truth than the "
       "measurement."},
      {"9.4", 1, false,
       "curves. As 9.2; from about the 35th sample the yaw rate is \"delayed\" by two to three "
       "samples.",
       "In kind: late, and farther from the truth than the measurement; but half a sample late."},
      {"9.7", 0, true,
       "curves. The Kalman filter \"copies almost exactly\" the measured lateral velocity and is "
       "preferred.",
       "Yes in rank. Ours has a third of the measurement's error; a copy of it would have all."},
      {"9.8", 1, true,
       "curves. The Kalman filter \"copies almost exactly\" the measured yaw rate and is "
       "preferred.",
       "Yes in rank. Ours has two thirds of the measurement's error; a copy would have all."}};
  std::vector<Study> out;
  for (const StateFigure& figure : figures) {
    out.push_back(
        {std::string("sladka-figure-") + figure.name, kRuns,
         [figure](const StudyOptions& options) { return state_figure(figure, options); }});
  }
  out.push_back({"sladka-figure-9.3", kRuns, [](const StudyOptions& options) {
                   return coefficient_figure(
                       "9.3", 0, "a curve near one from about the thirtieth sample on.",
                       "Yes: one but for noise and held steering, as the model is the car.",
                       options);
                 }});
  out.push_back(
      {"sladka-figure-9.5", kRuns, [](const StudyOptions& options) {
         return coefficient_figure(
             "9.5", 1, "a curve about 1.3 from about the 35th sample on.",
             "No: no regressor gives 1.3 where the model is the car. 1.3 would be one that "
             "yaws a third more.",
             options);
       }});
  out.push_back({"sladka-figure-9.6", kRuns, [](const StudyOptions& options) {
                   return track_figure("9.6", false,
                                       "the derived track is \"slightly rotated\"; turned by 1.9 "
                                       "deg it lies on the marked one.",
                                       options);
                 }});
  out.push_back({"sladka-figure-9.9", kRuns, [](const StudyOptions& options) {
                   return track_figure(
                       "9.9", true,
                       "both turned by 1.9 deg, the marked track lies between them; "
                       "the Kalman filter's is nearer.",
                       options);
                 }});
  out.push_back({"sladka-figure-9.1", kRuns, program_figure});
  std::sort(out.begin(), out.end(), [](const Study& a, const Study& b) { return a.name < b.name; });
  out.push_back({"sladka-logarithm", kRuns, logarithm_study});
  return out;
}

}  // namespace identikal
