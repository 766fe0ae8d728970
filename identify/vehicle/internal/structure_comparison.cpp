#include "identify/vehicle/internal/structure_comparison.h"

#include <cmath>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/vehicle/series.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

constexpr double kSignificant = 0.995;  // one-sided, with a sandwich that allows for correlation
constexpr double kBetterFit = 0.10;     // of the root mean square residual of an output
constexpr double kSlightlyBetterFit = 0.03;
constexpr double kReversedFit = 0.4;  // of the residual: what the other sign of sideslip takes away
constexpr double kFittingWell = 90.0;  // [%]
constexpr double kComparable = 1e-4;   // in log-likelihood, of what is compared
constexpr int kShownBy = 3;            // iterations, if the other sign is right
constexpr double kHopeless = 0.05;     // in log-likelihood per sample
constexpr double kWrongRatio = 0.02;   // relative; steering ratios are known to about 1 %

struct Alternative {
  bool usable = false;  ///< converged, and at no bound that the original is not at
  VehicleSearch found;
  VehicleParameters<double> p;
  double better = 0.0;  ///< largest drop of an output's residual, relative
  std::string text;     ///< what moved
};

bool ends_at_new_bound(const VehicleSearch& original, const VehicleSearch& other) {
  for (std::size_t i = 0; i < other.problem.unknowns.free.size(); ++i) {
    if (!is_at_bound(other.problem, other.best.z, static_cast<Eigen::Index>(i))) continue;
    const Eigen::Index before = original.problem.unknowns.find(other.problem.unknowns.free[i]);
    if (before < 0 || !is_at_bound(original.problem, original.best.z, before)) return true;
  }
  return false;
}

/// @param run   must outlive the result
/// @param near  the answer lies near the original one: no other starts are tried
Alternative fit_alternative(const VehicleSearch& original, const VehicleRun& run,
                            const VehicleUnknowns& unknowns, bool near,
                            VehicleSearchOptions options, const VehicleEstimate& estimate) {
  const VehicleParameters<double> before = parameters_at(original.problem, original.best.z);
  Alternative out;
  if (near) {
    out.found.problem = make_vehicle_problem(run, unknowns, original.problem.demand);
    out.found.problem.robust = options.robust;
    SolverOptions solver;
    solver.progress = options.progress;
    solver.decrement_tolerance = kComparable;
    out.found.best =
        maximise_likelihood(out.found.problem, coordinates_of(out.found.problem, before), solver);
  } else {
    options.starts = 1;
    out.found = search_vehicle(run, unknowns, options, &before);
  }
  if (!out.found.best.converged || ends_at_new_bound(original, out.found)) return out;
  out.usable = true;
  out.p = parameters_at(out.found.problem, out.found.best.z);
  for (std::size_t i = 0; i < original.problem.unknowns.free.size(); ++i) {
    const VehicleParameter parameter = original.problem.unknowns.free[i];
    if (parameter != kCf && parameter != kCr && parameter != kYawInertia) continue;
    const EstimatedParameter& p = estimate.parameters[original.problem.unknowns.position[i]];
    const Unit unit = unit_or_dimensionless(p.unit);
    out.text += fmt::format(", {} {:.4g} {} (was {:.4g})", p.name, unit.from_si(out.p[parameter]),
                            p.unit, p.value);
  }
  const std::vector<ChannelFit> fits =
      channel_fits(vehicle_series(out.found.problem, out.found.best.z), options.robust);
  for (std::size_t j = 0; j < fits.size(); ++j) {
    out.better = std::max(out.better, 1.0 - fits[j].rmse / estimate.simulation[j].rmse);
    out.text += fmt::format(", fit of {} {:.1f} % (was {:.1f})", fits[j].channel,
                            fits[j].fit_percent, estimate.simulation[j].fit_percent);
  }
  return out;
}

/// VehicleEstimate and standard error of the parameter that the alternative freed, and whether it is
/// away from the value it had.
struct Freed {
  double value, se;
  bool significant;
};

Freed freed(const Alternative& alternative, VehicleParameter parameter, double was) {
  const VehicleProblem& problem = alternative.found.problem;
  const VehicleCovariance covariance = vehicle_covariance(problem, alternative.found.best);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(problem.parameters());
  gradient[problem.unknowns.find(parameter)] = 1.0;
  const double se = standard_error(problem, covariance, gradient);
  const double value = alternative.p[parameter];
  const double quantile = student_t_quantile(kSignificant, covariance.freedom);
  return {value, se, std::abs(value - was) > quantile * se};
}

// Where the equation-error start of reversed channels is not right at once, they are not.
VehicleSearchOptions options_of_reversed(const VehicleSearch& found, VehicleSearchOptions options) {
  const double hopeless =
      found.best.log_likelihood - kHopeless * static_cast<double>(found.problem.residuals());
  options.searched = 1;
  options.progress = [hopeless, told = options.progress](int iteration, double L) {
    return !(iteration >= kShownBy && L < hopeless) && (!told || told(iteration, L));
  };
  return options;
}

}  // namespace

Findings check_sensor_misalignment(const VehicleSearch& found, const VehicleSearchOptions& options,
                                   const VehicleEstimate& estimate) {
  Findings out;
  const VehicleRun& run = *found.problem.run;
  for (const VehicleQuantity quantity : {VehicleQuantity::vy, VehicleQuantity::beta}) {
    const Eigen::Index j = run.find(quantity);
    if (j < 0) continue;
    const ChannelFit& now = estimate.simulation[j];
    if (now.fit_percent > kFittingWell) continue;
    VehicleRun reversed = run;
    reversed.y.row(j) *= -1.0;
    const Alternative other = fit_alternative(found, reversed, found.problem.unknowns, false,
                                              options_of_reversed(found, options), estimate);
    if (!other.usable || !(other.found.best.log_likelihood > found.best.log_likelihood)) continue;
    const ChannelFit then =
        channel_fits(vehicle_series(other.found.problem, other.found.best.z), options.robust)[j];
    if (then.rmse > (1.0 - kReversedFit) * now.rmse) continue;
    out.push_back(make_finding(
        FindingCode::wrong_sign, {now.channel},
        fmt::format("{} has the wrong sign: with it reversed{}", now.channel, other.text.substr(1)),
        fmt::format(
            "ISO 8855: {} to the left is positive; {}: {{..., scale: -1}} in the model file",
            now.channel, now.channel)));
  }
  return out;
}

AlternativeForms compare_alternatives(const VehicleSearch& found,
                                      const VehicleSearchOptions& options,
                                      const VehicleEstimate& estimate) {
  AlternativeForms out;
  const VehicleUnknowns& unknowns = found.problem.unknowns;
  const double step = found.problem.run->step;
  for (const VehicleParameter parameter : {kSteeringGain, kSteeringDelay}) {
    // A free ratio is a free gain; it does not stand for a delay.
    const bool ratio = parameter == kSteeringGain && unknowns.find(kSteeringRatio) >= 0;
    if (unknowns.find(parameter) >= 0 || ratio) continue;
    VehicleUnknowns more = unknowns;
    set_free(more, parameter);
    const Alternative other =
        fit_alternative(found, *found.problem.run, more, true, options, estimate);
    if (!other.usable) continue;
    const double was = unknowns.value[parameter];
    const Freed now = freed(other, parameter, was);
    if (!now.significant) continue;
    const bool gain = parameter == kSteeringGain;
    const std::string name(name_of(parameter));
    const std::string text = fmt::format("with {} free it is {:.3g} +- {:.2g}{}{}", name, now.value,
                                         now.se, gain ? "" : " s", other.text);
    const bool large = gain ? std::abs(now.value / was - 1.0) > kWrongRatio
                            : std::abs(now.value - was) > 0.5 * step;
    if (!large || other.better < kSlightlyBetterFit) {
      out.notes.push_back(text);
      continue;
    }
    out.findings.push_back(
        {gain ? FindingCode::steering_gain : FindingCode::steering_delay,
         other.better > kBetterFit ? Severity::serious : Severity::warning,
         {name},
         text,
         gain ? "the recording contradicts the given steering ratio: free steering_gain, or "
                "correct the ratio"
              : "the steering channel's clock or the steering itself lags: free steering_delay"});
  }
  if (unknowns.curve != TyreCurve::linear && unknowns.find(kCurveShape) < 0 &&
      unknowns.find(kCurveCurvature) < 0) {
    const VehicleUnknowns curved = with_curve(
        unknowns, unknowns.curve == TyreCurve::tanh ? TyreCurve::fiala : TyreCurve::tanh);
    const Alternative other =
        fit_alternative(found, *found.problem.run, curved, true, options, estimate);
    if (other.usable) {
      out.notes.push_back(fmt::format("with the curve {} instead{}; log-likelihood {:+.4g}",
                                      name_of(curved.curve), other.text,
                                      other.found.best.log_likelihood - found.best.log_likelihood));
    }
  }
  return out;
}

}  // namespace identikal
