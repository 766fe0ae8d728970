#include "identify/vehicle_fit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/distribution.h"
#include "identify/tyre_saturation.h"
#include "identify/vehicle_checks.h"
#include "identify/vehicle_covariance.h"
#include "identify/vehicle_problem.h"
#include "identify/vehicle_run.h"
#include "identify/vehicle_starts.h"
#include "lib/dual.h"
#include "lib/error.h"
#include "lib/units.h"

namespace identikal {
namespace {

constexpr std::size_t kOptimised = 3;  // of the starts, those with the best likelihood
constexpr double kSameVehicle = 0.01;  // in log-likelihood
constexpr double kTooStiffForSteps =
    1.6;  // decay rate over what the integration steps were made for

struct VehicleSearch {
  VehicleProblem problem;
  VehicleOptimum best;
  int starts = 0, agree = 0, iterations = 0, evaluations = 0;
};

VehicleProblem problem_for(const VehicleRun& run, const VehicleUnknowns& unknowns,
                           const VehicleParameters<double>& p) {
  return make_vehicle_problem(run, unknowns, false, decay_rate_times_speed(linear_car(p)));
}

/// Ranks the starts by likelihood, climbs from the best few and keeps the best summit.
VehicleSearch search(const VehicleRun& run, const VehicleUnknowns& unknowns,
                     const VehicleFitOptions& options) {
  const std::vector<VehicleParameters<double>> starts =
      vehicle_starts(run, unknowns, options.starts, options.seed);
  // Any start may be far off; integration steps are made for the least stiff, and remade for the
  // answer.
  VehicleSearch out;
  const auto softest =
      std::min_element(starts.begin(), starts.end(), [](const auto& p, const auto& q) {
        return decay_rate_times_speed(linear_car(p)) < decay_rate_times_speed(linear_car(q));
      });
  out.problem = problem_for(run, unknowns, *softest);

  struct Candidate {
    Eigen::VectorXd z;
    double log_likelihood;
  };
  std::vector<Candidate> candidates;
  for (const VehicleParameters<double>& p : starts) {
    const Eigen::VectorXd z = coordinates_of(out.problem, p);
    Eigen::VectorXd e;
    if (!output_error(out.problem, z, e, nullptr)) continue;
    candidates.push_back({z, log_likelihood(out.problem, e, noise_sd(out.problem, e))});
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.log_likelihood > b.log_likelihood;
  });
  if (unknowns.free.empty()) candidates.resize(std::min<std::size_t>(candidates.size(), 1));
  if (candidates.size() > kOptimised) candidates.resize(kOptimised);

  SolverOptions solver;
  solver.progress = options.progress;
  std::vector<VehicleOptimum> summits;
  for (const Candidate& candidate : candidates) {
    summits.push_back(maximise_likelihood(out.problem, candidate.z, solver));
    out.iterations += summits.back().iterations;
    out.evaluations += summits.back().evaluations;
  }
  out.best.message = "the car runs away from every start";
  for (const VehicleOptimum& summit : summits) {
    if (summit.log_likelihood > out.best.log_likelihood) out.best = summit;
  }
  out.starts = static_cast<int>(summits.size());
  for (const VehicleOptimum& summit : summits) {
    if (summit.log_likelihood > out.best.log_likelihood - kSameVehicle) ++out.agree;
  }
  if (out.best.z.size() == 0) return out;

  const VehicleParameters<double> p = parameters_at(out.problem, out.best.z);
  if (decay_rate_times_speed(linear_car(p)) > kTooStiffForSteps * out.problem.decay_rate) {
    out.problem = problem_for(run, unknowns, p);
    out.best = maximise_likelihood(out.problem, out.best.z, solver);
    out.iterations += out.best.iterations;
    out.evaluations += out.best.evaluations;
  }
  return out;
}

/// The model file's parameters in its units; free ones still stand at their start.
void list_parameters(const ModelFile& model, Estimate& estimate) {
  for (const Parameter& given : model.parameters) {
    EstimatedParameter result;
    result.name = given.name;
    result.unit = given.unit;
    result.fixed = given.fixed;
    result.start = parse_unit(given.unit).value_or(Unit{}).from_si(given.scalar());
    result.value = result.start;
    estimate.parameters.push_back(result);
  }
}

void report_parameters(const VehicleSearch& found, const VehicleCovariance& covariance,
                       Estimate& estimate) {
  const VehicleUnknowns& unknowns = found.problem.unknowns;
  const VehicleParameters<double> p = parameters_at(found.problem, found.best.z);
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    EstimatedParameter& result = estimate.parameters[unknowns.position[i]];
    result.value = parse_unit(result.unit).value_or(Unit{}).from_si(p[unknowns.free[i]]);
  }

  // A parameter at a bound has no interval; the others are judged as if it were known.
  const auto k = static_cast<Eigen::Index>(covariance.inner.size());
  Eigen::VectorXd to_user(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const auto n = static_cast<std::size_t>(covariance.inner[static_cast<std::size_t>(i)]);
    const std::string& unit = estimate.parameters[unknowns.position[n]].unit;
    to_user[i] = 1.0 / parse_unit(unit).value_or(Unit{}).scale;
  }
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    if (!covariance.at_bound[i]) continue;
    EstimatedParameter& result = estimate.parameters[unknowns.position[i]];
    result.verdict = Verdict::at_bound;
    estimate.warnings.push_back(
        {"at_bound",
         unknowns.free[i] == kCf || unknowns.free[i] == kCr ? "serious" : "warning",
         {result.name},
         fmt::format("{} ended at its bound {:.6g}; the errors of the others take it as known",
                     result.name, result.value),
         "widen the bound in the model file if it is not physical"});
  }
  if (k > 0) {
    const Eigen::MatrixXd information = to_user.cwiseInverse().asDiagonal() *
                                        covariance.information *
                                        to_user.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd in_user_units =
        to_user.asDiagonal() * covariance.covariance * to_user.asDiagonal();
    judge_parameters(estimate, information, in_user_units,
                     student_t_quantile(0.975, covariance.freedom));
  }
  for (Eigen::Index i = 0; i < k; ++i) {
    const auto n = static_cast<std::size_t>(covariance.inner[static_cast<std::size_t>(i)]);
    EstimatedParameter& result = estimate.parameters[unknowns.position[n]];
    if (!std::isnan(result.se)) result.crb_se = std::sqrt(covariance.white(i, i)) * to_user[i];
  }
  estimate.covariance_kind =
      covariance.coloured
          ? fmt::format("sandwich, residuals correlated over {:.2g} s", covariance.memory)
          : "inverse information, white residuals (Cramer-Rao)";
}

void report_series(const VehicleSearch& found, const VehicleCovariance& covariance,
                   Estimate& estimate) {
  const VehicleProblem& problem = found.problem;
  const VehicleRun& run = *problem.run;
  const Eigen::Index N = run.time.size(), ny = run.y.rows();
  Series& series = estimate.series;
  series.time = run.time;
  series.measured = Eigen::MatrixXd::Constant(ny, N, kNone);
  series.predicted = series.measured;
  series.standardised = series.measured;
  const SingleTrack<double> car = linear_car(parameters_at(problem, found.best.z));
  std::vector<Unit> units;
  for (const VehicleRun::Output& output : run.outputs) {
    units.push_back(parse_unit(output.unit).value_or(Unit{}));
    series.channels.push_back(output.name);
    series.units.push_back(output.unit);
  }
  replay(problem, found.best.z, [&](Eigen::Index t, const Motion<double>& motion, double vx) {
    for (Eigen::Index j = 0; j < ny; ++j) {
      const auto n = static_cast<std::size_t>(j);
      series.predicted(j, t) = units[n].from_si(measured(run.outputs[n].sensor, car, motion, vx));
      series.measured(j, t) = units[n].from_si(run.y(j, t));
    }
  });
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    // Residual as the rest of the program has it: measured minus predicted.
    series.standardised(problem.output[i], problem.row[i]) =
        -covariance.residuals[static_cast<Eigen::Index>(i)];
  }
  for (Eigen::Index j = 0; j < ny; ++j) {
    double sum = 0.0, mean = 0.0, spread = 0.0, n = 0.0;
    for (Eigen::Index t = 0; t < N; ++t) {
      if (std::isnan(series.measured(j, t))) continue;
      sum += std::pow(series.measured(j, t) - series.predicted(j, t), 2);
      mean += series.measured(j, t);
      n += 1.0;
    }
    mean /= n;
    for (Eigen::Index t = 0; t < N; ++t) {
      if (!std::isnan(series.measured(j, t))) spread += std::pow(series.measured(j, t) - mean, 2);
    }
    ChannelFit fit;
    fit.channel = series.channels[static_cast<std::size_t>(j)];
    fit.unit = series.units[static_cast<std::size_t>(j)];
    fit.rmse = std::sqrt(sum / n);
    fit.fit_percent = 100.0 * (1.0 - std::sqrt(sum / spread));
    estimate.simulation.push_back(fit);
  }
}

/// Characteristic values that the data determine, whichever single parameters they leave open.
void report_derived(const VehicleSearch& found, const VehicleCovariance& covariance,
                    Estimate& estimate) {
  const VehicleProblem& problem = found.problem;
  const VehicleParameters<double> p = parameters_at(problem, found.best.z);
  const double u = problem.run->median_speed;
  const std::array<double, 6> x = {p[kMass], p[kA], p[kB], p[kYawInertia], p[kCf], p[kCr]};

  const auto add = [&](const std::string& name, const std::string& unit, double per_si,
                       auto&& quantity) {
    const auto [value, gradient] = value_and_gradient(x, [&](const auto& q) {
      using T = typename std::decay_t<decltype(q)>::value_type;
      SingleTrack<T> car;
      car.m = q[kMass];
      car.a = q[kA];
      car.b = q[kB];
      car.Iz = q[kYawInertia];
      car.front.stiffness = q[kCf];
      car.rear.stiffness = q[kCr];
      return T(quantity(car));
    });
    if (!std::isfinite(value) || !gradient.allFinite()) return;
    Eigen::VectorXd by_free(problem.parameters());
    for (Eigen::Index i = 0; i < by_free.size(); ++i) {
      const VehicleParameter parameter = problem.unknowns.free[static_cast<std::size_t>(i)];
      by_free[i] = parameter <= kCr ? gradient[parameter] : 0.0;
    }
    double se = kNone;
    if (by_free.size() > 0 && by_free.norm() > 0.0) {
      se = standard_error(problem, covariance, by_free);
      if (std::isnan(se)) return;
    }
    estimate.derived.push_back({name, unit, value * per_si, se * per_si});
  };

  constexpr double kDegreePerG = 57.295779513082323 * kStandardGravity;
  add("K", "rad/(m/s^2)", 1.0, [](const auto& car) { return understeer_gradient(car); });
  add("K per g", "deg/g", kDegreePerG, [](const auto& car) { return understeer_gradient(car); });
  add("DF", "deg/g", kDegreePerG, [](const auto& car) { return front_compliance(car); });
  add("DR", "deg/g", kDegreePerG, [](const auto& car) { return rear_compliance(car); });
  const bool understeers = p[kB] * p[kCr] > p[kA] * p[kCf];
  add(understeers ? "v_ch" : "v_cr", "km/h", 3.6,
      [](const auto& car) { return characteristic_speed(car); });
  const std::string at = fmt::format(" at {:.0f} km/h", 3.6 * u);
  add("yaw gain" + at, "1/s", 1.0,
      [u](const auto& car) { return steering_response(car, u).yaw_gain; });
  add("wn" + at, "rad/s", 1.0,
      [u](const auto& car) { return steering_response(car, u).natural_frequency; });
  add("zeta" + at, "", 1.0, [u](const auto& car) { return steering_response(car, u).damping; });
  add("Tz" + at, "s", 1.0,
      [u](const auto& car) { return steering_response(car, u).yaw_lead_time; });
  const auto& free = problem.unknowns.free;
  if (std::find(free.begin(), free.end(), kMass) != free.end()) {
    // Steering moves the car by these alone, so they may be known where the mass is not.
    add("Cf/m", "N/(rad kg)", 1.0, [](const auto& car) { return car.front.stiffness / car.m; });
    add("Cr/m", "N/(rad kg)", 1.0, [](const auto& car) { return car.rear.stiffness / car.m; });
    add("Iz/m", "m^2", 1.0, [](const auto& car) { return car.Iz / car.m; });
  }
  for (std::size_t j = 0; j < problem.run->outputs.size(); ++j) {
    const VehicleRun::Output& output = problem.run->outputs[j];
    const double sd = in_unit(output, covariance.sd[static_cast<Eigen::Index>(j)]);
    const bool given = !std::isnan(output.given_sd);
    const double se = sd / std::sqrt(2.0 * static_cast<double>(output.samples));
    estimate.derived.push_back({"sd(" + output.name + ")", output.unit, sd, given ? kNone : se});
  }
}

/// @param flat  how many directions the data leave open: they count as no parameters
void report_objective(const VehicleSearch& found, Eigen::Index flat, Estimate& estimate) {
  const VehicleProblem& problem = found.problem;
  Objective& objective = estimate.objective;
  objective.method = "output_error";
  objective.log_likelihood = found.best.log_likelihood;
  Eigen::VectorXd e;
  if (output_error(problem, coordinates_of(problem, problem.unknowns.value), e, nullptr)) {
    objective.log_likelihood_start = log_likelihood(problem, e, noise_sd(problem, e));
  }
  auto estimated = static_cast<double>(problem.coordinates() - flat);
  for (const VehicleRun::Output& output : problem.run->outputs) {
    if (std::isnan(output.given_sd)) estimated += 1.0;
  }
  objective.aic = 2.0 * (estimated - found.best.log_likelihood);
  objective.bic = estimated * std::log(static_cast<double>(problem.residuals())) -
                  2.0 * found.best.log_likelihood;
  objective.iterations = found.iterations;
  objective.evaluations = found.evaluations;
  objective.starts = found.starts;
  objective.starts_agree = found.agree;
}

std::string listed(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

void conclude(const VehicleSearch& found, Estimate& estimate) {
  std::vector<std::string> open, serious;
  std::size_t free = 0;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    ++free;
    if (p.verdict == Verdict::flat || p.verdict == Verdict::unexcited) open.push_back(p.name);
  }
  // A stiffness, mass or length whose interval holds zero is not determined either.
  const VehicleUnknowns& unknowns = found.problem.unknowns;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[unknowns.position[i]];
    if (must_be_positive(unknowns.free[i]) && p.ci95[0] <= 0.0) open.push_back(p.name);
  }
  for (const Warning& warning : estimate.warnings) {
    if (warning.severity == "serious") serious.push_back(warning.code);
  }
  if (!found.best.converged) {
    estimate.status = Status::not_converged;
    estimate.message = "the search did not converge: " + found.best.message;
  } else if (!open.empty()) {
    estimate.status = Status::answer_no;
    estimate.message = "this recording does not determine " + listed(open) + " separately";
  } else if (!serious.empty()) {
    estimate.status = Status::untrusted;
    estimate.message = "do not use these values: " + listed(serious);
  } else {
    estimate.status = Status::ok;
    estimate.message =
        free == 0 ? fmt::format("simulated {} rows, nothing to fit", found.problem.run->used)
                  : fmt::format("{} parameter{} fitted to {} samples", free, free == 1 ? "" : "s",
                                found.problem.residuals());
  }
}

}  // namespace

Estimate fit_vehicle(const ModelFile& model, const Dataset& data,
                     const VehicleFitOptions& options) {
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleRun run = usable_run(model, data);
  Estimate estimate;
  estimate.verb = "fit";
  estimate.model_name = model.name;
  estimate.inputs.push_back(
      {data.name, "", static_cast<long>(data.size()), static_cast<long>(run.used)});
  estimate.warnings = run.warnings;
  estimate.notes = run.notes;

  list_parameters(model, estimate);

  const std::size_t sought = unknowns.free.size() + 2 * run.stretches.size();
  Eigen::Index samples = 0;
  for (const VehicleRun::Output& output : run.outputs) samples += output.samples;
  if (samples <= static_cast<Eigen::Index>(sought)) {
    throw InputError(
        Location{data.name, 0, 0},
        fmt::format("{} samples of the outputs for {} unknowns (parameters and initial states)",
                    samples, sought),
        "more samples than unknowns");
  }
  const VehicleSearch found = search(run, unknowns, options);
  if (found.best.z.size() == 0) {
    conclude(found, estimate);
    return estimate;
  }
  const VehicleParameters<double> p = parameters_at(found.problem, found.best.z);
  const VehicleCovariance covariance = vehicle_covariance(found.problem, found.best);
  estimate.tests = covariance.whiteness;
  report_objective(found, covariance.null_space.cols(), estimate);
  report_parameters(found, covariance, estimate);
  report_series(found, covariance, estimate);
  report_derived(found, covariance, estimate);

  check_signs(run, p, estimate);
  Eigen::VectorXd e;
  output_error(found.problem, found.best.z, e, nullptr);
  check_fit(found.problem, rms_per_output(found.problem, e), estimate);
  check_tyres(found.problem, test_tyre_saturation(found.problem, found.best, covariance), estimate);
  check_whiteness(covariance, estimate);
  check_plausibility(found.problem, p, estimate);
  describe_acceleration(found.problem, found.best, estimate);
  conclude(found, estimate);
  return estimate;
}

}  // namespace identikal
