#include "identify/vehicle/checks.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/survey/survey.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"
#include "lib/statistics/paired_correlation.h"

namespace identikal {
namespace {

constexpr double kFlippedBelow = -0.2;      // correlation; noise alone stays near 0
constexpr double kGoodFit = 80.0;           // [%]
constexpr double kSeriousForceLoss = 0.10;  // of the linear axle force
// Below it a tyre on a dry road is straight to a few %: with stiffness over load of 12 per rad it
// loses 10 % of its force at 2.7 deg.
constexpr double kStraightSlip = 1.5 / kDegreesPerRadian;
constexpr double kWrongGain = 0.02;
constexpr double kHoldOutFactor = 2.0;  // of what is left unexplained
constexpr double kNoiseFactor = 1.5;    // between residual and given noise

/// Correlation of x with an output, which is there in the usable rows only; 0 when either is
/// constant.
double correlation(const Eigen::VectorXd& x, const Eigen::VectorXd& output) {
  const double found = paired_correlation(x, output).correlation;
  return std::isnan(found) ? 0.0 : found;
}

bool usable(const VehicleEstimate& estimate, const std::string& name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name != name) continue;
    return p.verdict != Verdict::not_identifiable && p.verdict != Verdict::unexcited &&
           !(p.ci95[0] <= 0.0);
  }
  return false;
}

bool is_free(const VehicleEstimate& estimate, const std::string& name) {
  return std::any_of(estimate.parameters.begin(), estimate.parameters.end(),
                     [&](const EstimatedParameter& p) { return p.name == name && !p.fixed; });
}

}  // namespace

double in_unit(const VehicleRun::Output& output, double si) { return si / unit_scale(output.unit); }

Findings check_signs(const VehicleRun& run, const VehicleParameters<double>& p) {
  Findings out;
  const Eigen::Index jr = run.find(VehicleQuantity::r), ja = run.find(VehicleQuantity::ay);
  const Eigen::VectorXd vx = run.vx;
  if (jr >= 0) {
    const double turn = p[kSteeringGain] < 0.0 ? -1.0 : 1.0;
    const double c = turn * correlation(vx.cwiseProduct(run.steering), run.y.row(jr));
    if (c < kFlippedBelow) {
      out.push_back(make_finding(
          FindingCode::sign_steering, {"r", "steering"},
          fmt::format(
              "yaw rate turns against the steering: correlation of vx * angle with r is {:.2f}", c),
          "one of the two has the wrong sign: both are positive to the left (ISO 8855)"));
    }
  }
  if (jr >= 0 && ja >= 0) {
    const double c = correlation(vx.cwiseProduct(run.y.row(jr).transpose()), run.y.row(ja));
    if (c < kFlippedBelow) {
      out.push_back(make_finding(
          FindingCode::sign_ay, {"ay", "r"},
          fmt::format("lateral acceleration points out of the turn: correlation of vx * r with ay "
                      "is {:.2f}",
                      c),
          "one of the two has the wrong sign: both are positive to the left (ISO 8855)"));
    }
  }
  return out;
}

Findings check_plausibility(const VehicleParameters<double>& p, const VehicleEstimate& estimate) {
  // Of published cars (lib/SOURCES.md). With the narrower ranges of textbooks, .8 to 1.3 and 5 to 25
  // 1/rad, most flags stood at right values of published simulators.
  constexpr double kLeastInertia = 0.49, kLargestInertia = 1.3, kLargestStiffness = 31.0;
  Findings out;
  const auto unusual = [&](FindingCode code, const std::string& name, const std::string& text) {
    out.push_back(make_finding(code, {name}, text,
                               "it may be so; else check mass, axle distances, steering ratio, "
                               "units and sensor positions"));
  };
  const double ratio = p[kYawInertia] / (p[kMass] * p[kA] * p[kB]);
  const bool in_range = ratio >= kLeastInertia && ratio <= kLargestInertia;
  if (is_free(estimate, "Iz") && usable(estimate, "Iz") && !in_range) {
    unusual(FindingCode::implausible_Iz, "Iz",
            fmt::format("Iz/(m a b) = {:.2f}; published cars lie between {:g} and {:g}", ratio,
                        kLeastInertia, kLargestInertia));
  }
  const Eigen::Vector2d load = axle_loads(p);
  for (int axle = 0; axle < 2; ++axle) {
    const std::string name = axle == 0 ? "Cf" : "Cr";
    const double per_load = p[axle == 0 ? kCf : kCr] / load[axle];
    if (!is_free(estimate, name) || !usable(estimate, name) ||
        !(std::round(per_load) > kLargestStiffness)) {
      continue;
    }
    unusual(axle == 0 ? FindingCode::implausible_Cf : FindingCode::implausible_Cr, name,
            fmt::format("{} is {:.1f} times its axle load per rad; published cars have up to {:g}",
                        name, per_load, kLargestStiffness));
  }
  return out;
}

Findings check_weakest_direction(const VehicleProblem& problem, const VehicleCovariance& covariance,
                                 const VehicleParameters<double>& p,
                                 const VehicleEstimate& estimate) {
  constexpr double kHardlyKnown = 0.25;  // relative standard error
  constexpr double kTakesPart = 0.2;
  std::vector<std::string> names;
  std::vector<Eigen::Index> rows;
  std::vector<double> values;
  std::vector<std::string> unknown;
  for (std::size_t i = 0; i < covariance.inner.size(); ++i) {
    const VehicleParameter parameter = problem.unknowns.free[covariance.inner[i]];
    if (!must_be_positive(parameter)) continue;
    if (parameter == kCf || parameter == kCr || parameter == kYawInertia) {
      const EstimatedParameter& of =
          estimate.parameters[problem.unknowns.position[covariance.inner[i]]];
      // One that may be zero is rejected.
      if (relative_error(of) > kHardlyKnown && of.ci95[0] > 0.0) unknown.push_back(of.name);
    }
    names.emplace_back(name_of(parameter));
    rows.push_back(static_cast<Eigen::Index>(i));
    // Relative to what the user sees, a largest force.
    const UserValue user = in_user_terms(parameter, p[parameter]);
    values.push_back(user.value / user.slope);
  }
  const auto n = static_cast<Eigen::Index>(rows.size());
  if (n < 2) return {};
  Eigen::MatrixXd relative(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      relative(i, j) = covariance.covariance(rows[a], rows[b]) / (values[a] * values[b]);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(relative);
  const double size = std::sqrt(eigen.eigenvalues()[n - 1]);
  if (!(size > kHardlyKnown)) return {};
  const Eigen::VectorXd along = eigen.eigenvectors().col(n - 1);
  Eigen::Index lead = 0;
  along.cwiseAbs().maxCoeff(&lead);
  std::string text;
  std::vector<std::string> about;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double share = along[i] / along[lead];
    if (std::abs(share) < kTakesPart) continue;
    const std::string& name = names[i];
    about.push_back(name);
    text += fmt::format("{}{} by {:+.0f} %", text.empty() ? "" : ", ", name,
                        100.0 * share * std::abs(along[lead]) * size);
  }
  Finding finding = make_finding(
      FindingCode::weak_direction, unknown.empty() ? about : unknown,
      "poorly determined in combination (one standard error): " + text,
      "fix one of them at a value known from elsewhere, or record more: a sweep above 1.5 Hz, "
      "speeds that differ by 2, sideslip");
  if (!unknown.empty()) finding.severity = Severity::serious;
  return {finding};
}

Findings check_fit(const VehicleProblem& problem, const Eigen::VectorXd& rms,
                   const VehicleEstimate& estimate) {
  Findings out;
  const auto& outputs = problem.run->outputs;
  // The yaw rate has to follow the steering, or else the output that does best; any other may be
  // poor, but no worse than its mean.
  std::size_t leading = 0;
  for (std::size_t j = 1; j < outputs.size(); ++j) {
    if (estimate.simulation[j].fit_percent > estimate.simulation[leading].fit_percent) leading = j;
  }
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    if (outputs[j].sensor.quantity == VehicleQuantity::r) leading = j;
  }
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    const double fit = estimate.simulation[j].fit_percent;
    if (!(fit < (j == leading ? kPoorFit : 0.0))) continue;
    const std::string& name = outputs[j].name;
    const auto test = std::find_if(estimate.tests.begin(), estimate.tests.end(),
                                   [&](const TestResult& t) { return t.channel == name; });
    const bool white = test != estimate.tests.end() && test->pass;
    // A sensor as noisy as the model file gives it is no reason for distrust.
    if (white && rms[j] <= kNoiseFactor * outputs[j].given_sd) continue;
    const bool noisy = outputs.size() == 1 && white;
    out.push_back(make_finding(
        FindingCode::poor_fit, {name},
        fit < 0.0 ? fmt::format("the simulation of {} is farther off than its mean (fit {:.0f} %)",
                                name, fit)
                  : fmt::format("the simulation explains only {:.0f} % of {}{}", fit, name,
                                noisy ? "; the rest is white noise" : ""),
        noisy ? "steer more, or use a better sensor"
              : "check signs, units, clocks and delays of the channels; plot the residuals"));
  }
  for (std::size_t j = 0; j < outputs.size(); ++j) {
    const double given = outputs[j].given_sd, seen = rms[j];
    if (std::isnan(given)) continue;
    if (seen > kNoiseFactor * given || seen < given / kNoiseFactor) {
      out.push_back(make_finding(
          FindingCode::noise_differs, {outputs[j].name},
          fmt::format("residual of {} is {:.3g} {}, the model file gives {:.3g} as its noise",
                      outputs[j].name, in_unit(outputs[j], seen), outputs[j].unit,
                      in_unit(outputs[j], given)),
          "leave the noise out of the model file to have it estimated"));
    }
  }
  return out;
}

Findings check_by_survey(const Model& model, const std::vector<Dataset>& recordings,
                         const VehicleEstimate& estimate) {
  // The survey compares kinematics only, without lever arms and without a model of the car: a good
  // fit is evidence against what it suspects.
  double leading = 0.0;
  for (const ChannelFit& fit : estimate.simulation) leading = std::max(leading, fit.fit_percent);
  for (const ChannelFit& fit : estimate.simulation) {
    if (fit.channel == "r") leading = fit.fit_percent;
  }
  using enum FindingCode;
  constexpr FindingCode kReportedElsewhere[] = {too_short,    no_steering,   no_speed, no_yaw_rate,
                                                dead_channel, sign_steering, sign_ay,  standstill,
                                                one_clock,    spin};
  Findings out;
  for (const Dataset& data : recordings) {
    for (Finding& finding : survey(vehicle_signals(model, data)).findings) {
      const auto same = [&](const Finding& f) {
        return f.code == finding.code && f.about == finding.about;
      };
      const bool elsewhere = std::find(std::begin(kReportedElsewhere), std::end(kReportedElsewhere),
                                       finding.code) != std::end(kReportedElsewhere);
      if (elsewhere || std::any_of(estimate.findings.begin(), estimate.findings.end(), same) ||
          std::any_of(out.begin(), out.end(), same)) {
        continue;
      }
      if (finding.severity == Severity::serious && leading > kGoodFit)
        finding.severity = Severity::warning;
      if (finding.code == reversing) {
        finding.remedy =
            "these rows are left out; if the car drives forward there, scale: -1 for vx";
      }
      out.push_back(std::move(finding));
    }
  }
  return out;
}

Findings check_hold_out_by_survey(const Model& model, const std::vector<Dataset>& hold_out,
                                  const Findings& of_the_fit) {
  Findings out;
  for (const Dataset& data : hold_out) {
    for (Finding& finding : survey(vehicle_signals(model, data)).findings) {
      if (finding.severity != Severity::serious || finding.code == FindingCode::too_short) continue;
      const auto same = [&](const Finding& f) {
        return f.code == finding.code && f.severity != Severity::note;
      };
      if (std::any_of(of_the_fit.begin(), of_the_fit.end(), same) ||
          std::any_of(out.begin(), out.end(), same)) {
        continue;
      }
      finding.severity = Severity::warning;
      finding.text = fmt::format("held-out {}: {}", data.name, finding.text);
      out.push_back(std::move(finding));
    }
  }
  return out;
}

Findings check_hold_out(const VehicleEstimate& estimate) {
  Findings out;
  for (const ChannelFit& held : estimate.hold_out) {
    for (const ChannelFit& own : estimate.simulation) {
      if (own.channel != held.channel || !(own.fit_percent > kPoorFit)) continue;
      if (!(100.0 - held.fit_percent >= kHoldOutFactor * (100.0 - own.fit_percent))) continue;
      out.push_back(make_finding(
          FindingCode::hold_out, {own.channel},
          fmt::format("on held-out data the simulation explains {:.0f} % of {}, {:.0f} % on what "
                      "it was fitted to",
                      held.fit_percent, own.channel, own.fit_percent),
          "the parameters do not hold there: other tyres, load or road, or too many of them free"));
    }
  }
  return out;
}

Findings check_steering_gain(const VehicleProblem& problem, const VehicleCovariance& covariance,
                             const VehicleParameters<double>& p, bool at_road_wheel) {
  const Eigen::Index at = problem.unknowns.find(kSteeringGain);
  if (at < 0) return {};
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(problem.parameters());
  gradient[at] = 1.0;
  if (p[kSteeringGain] < 0.0) {
    return {
        make_finding(FindingCode::sign_steering, {"steering_gain"},
                     fmt::format("the steering gain is {:.3g}: the wheels turn against the angle",
                                 p[kSteeringGain]),
                     "the angle has the wrong sign: it is positive to the left (ISO 8855)")};
  }
  const double gain = p[kSteeringGain], se = standard_error(problem, covariance, gradient);
  const double quantile = student_t_quantile(0.995, covariance.freedom);
  if (!(std::abs(gain - 1.0) > quantile * se) || std::abs(gain - 1.0) < kWrongGain) return {};
  const std::string turned =
      fmt::format("the wheels turn {:.3g} +- {:.2g} times as far as it gives", gain, se);
  return {make_finding(FindingCode::steering_ratio, {"steering_gain"},
                       fmt::format("the given steering ratio is wrong{}: {}; the ratio is {:.4g}",
                                   at_road_wheel ? ", 1 as of an angle at the road wheels" : "",
                                   turned, p[kSteeringRatio] / gain),
                       "correct the ratio, or the calibration of the steering sensor")};
}

Findings check_whiteness(const VehicleCovariance& covariance) {
  if (!covariance.coloured) return {};
  const bool errors = covariance.white.size() > 0;
  double widened = 0.0;
  for (Eigen::Index i = 0; i < covariance.white.rows(); ++i) {
    const double white = covariance.white(i, i);
    if (white > 0.0) widened = std::max(widened, std::sqrt(covariance.covariance(i, i) / white));
  }
  std::vector<std::string> about;
  std::string names;
  for (const TestResult& test : covariance.whiteness) {
    if (test.pass) continue;
    about.push_back(test.channel);
    names += (names.empty() ? "" : ", ") + test.channel;
  }
  return {make_finding(
      FindingCode::coloured_residuals, about,
      fmt::format("residuals of {} are correlated in time: the model is incomplete", names) +
          (errors ? fmt::format(". Standard errors allow for it over {:.2g} s; for white "
                                "residuals they would be up to {:.1f} times smaller",
                                covariance.memory, std::max(widened, 1.0))
                  : ""),
      "plot the residuals; validate on another recording")};
}

Findings check_tyres(const VehicleProblem& problem, const TyreSaturation& saturation,
                     const VehicleEstimate& estimate) {
  if (!saturation.refitted) return {};
  const auto& front = saturation.front;
  const auto& rear = saturation.rear;
  if (!front.significant && !rear.significant) return {};
  const bool serious = (front.significant && front.loss > kSeriousForceLoss) ||
                       (rear.significant && rear.loss > kSeriousForceLoss);
  std::string text = "the tyre force saturates:";
  std::vector<std::string> about;
  for (const bool is_front : {true, false}) {
    const TyreSaturation::Axle& axle = is_front ? front : rear;
    if (!axle.significant) continue;
    about.emplace_back(is_front ? "Cf" : "Cr");
    text += fmt::format("{} {} axle {:.0f} % below the linear force at {:.1f} deg of slip",
                        about.size() > 1 ? "," : "", is_front ? "front" : "rear", 100.0 * axle.loss,
                        kDegreesPerRadian * axle.slip);
  }
  text += ". With tyres that saturate (tanh):";
  const auto& free = problem.unknowns.free;
  for (const VehicleParameter parameter : {kCf, kCr}) {
    if (std::find(free.begin(), free.end(), parameter) == free.end()) continue;
    for (const EstimatedParameter& p : estimate.parameters) {
      if (p.name != name_of(parameter)) continue;
      const Unit unit = unit_or_dimensionless(p.unit);
      text += fmt::format(" {} {:.4g} {},", p.name, unit.from_si(saturation.saturating[parameter]),
                          p.unit);
    }
  }
  text += " residual";
  for (std::size_t j = 0; j < problem.run->outputs.size(); ++j) {
    const VehicleRun::Output& output = problem.run->outputs[j];
    text += fmt::format("{} {} {:.3g} {}", j == 0 ? "" : ",", output.name,
                        in_unit(output, saturation.rms[j]), output.unit);
  }
  text += fmt::format("; log-likelihood {:+.4g}", saturation.gain);
  const auto too_early = [](const TyreSaturation::Axle& axle) {
    return axle.significant && axle.loss > kSeriousForceLoss && axle.slip < kStraightSlip;
  };
  std::string todo = "the linear stiffnesses hold for slip angles of this size";
  if (too_early(front) || too_early(rear)) {
    todo =
        "at slip angles this small tyres saturate on slippery roads only: look for a wrong unit, "
        "gain or offset of steering or speed, and for wrong m, a, b";
  } else if (serious) {
    todo =
        "the linear stiffnesses are averages over this recording's slip angles and hold nowhere "
        "else: use a milder part of it (|ay| below about 4 m/s^2)";
  }
  return {{FindingCode::tyre_saturation, serious ? Severity::serious : Severity::note, about, text,
           todo}};
}

void note_errors_by_acceleration(const VehicleProblem& problem, const VehicleOptimum& optimum,
                                 VehicleEstimate& estimate) {
  const VehicleRun& run = *problem.run;
  const Eigen::Index ja = run.find(VehicleQuantity::ay), jr = run.find(VehicleQuantity::r);
  const Eigen::Index N = run.time.size(), outputs = run.y.rows();
  Eigen::VectorXd ay = Eigen::VectorXd::Constant(N, kNone);
  Eigen::MatrixXd predicted = Eigen::MatrixXd::Constant(outputs, N, kNone);
  replay_outputs(problem, optimum.z,
                 [&](Eigen::Index t, const Motion& motion, double, const Eigen::VectorXd& values) {
                   ay[t] = motion.ay;
                   predicted.col(t) = values;
                 });
  // A car whose tyres saturate does not reach what the linear model predicts: measured values go
  // first.
  if (ja >= 0) {
    ay = run.y.row(ja).transpose();
  } else if (jr >= 0) {
    ay = run.vx.cwiseProduct(run.y.row(jr).transpose());
  }
  const std::vector<double> edges = {0, 1, 2, 3, 4, 6, 8, 12};
  std::string head = "rms of simulated - measured by |";
  head += ja >= 0 ? "ay| [m/s^2]" : jr >= 0 ? "vx r| [m/s^2]" : "simulated ay| [m/s^2]";
  estimate.notes.push_back(head);
  for (std::size_t bin = 0; bin < edges.size(); ++bin) {
    const bool last = bin + 1 == edges.size();
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(outputs), count = sum;
    Eigen::Index rows = 0, present = 0;
    for (Eigen::Index t = 0; t < N; ++t) {
      const double a = std::abs(ay[t]);
      if (std::isnan(a) || std::isnan(predicted(0, t))) continue;
      ++present;
      if (a < edges[bin] || (!last && a >= edges[bin + 1])) continue;
      ++rows;
      for (Eigen::Index j = 0; j < outputs; ++j) {
        const double e = predicted(j, t) - run.y(j, t);
        if (std::isnan(e)) continue;
        sum[j] += e * e;
        count[j] += 1.0;
      }
    }
    if (rows == 0) continue;
    std::string line = last ? fmt::format("  over {:g}", edges[bin])
                            : fmt::format("  {:g} to {:g}", edges[bin], edges[bin + 1]);
    line = fmt::format("{:<10} {:>3.0f} % of rows", line,
                       100.0 * static_cast<double>(rows) / static_cast<double>(present));
    for (Eigen::Index j = 0; j < outputs; ++j) {
      if (count[j] == 0.0) continue;
      const VehicleRun::Output& output = run.outputs[j];
      line += fmt::format("  {} {:.3g} {}", output.name,
                          in_unit(output, std::sqrt(sum[j] / count[j])), output.unit);
    }
    estimate.notes.push_back(line);
  }
}

}  // namespace identikal
