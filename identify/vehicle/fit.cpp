#include "identify/vehicle/fit.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/constraint_findings.h"
#include "identify/estimate/distribution.h"
#include "identify/estimate/effective_inertia.h"
#include "identify/estimate/parameter_table.h"
#include "identify/model/check.h"
#include "identify/vehicle/checks.h"
#include "identify/vehicle/covariance.h"
#include "identify/vehicle/driven_range.h"
#include "identify/vehicle/internal/characteristic_values.h"
#include "identify/vehicle/internal/open_parameters.h"
#include "identify/vehicle/internal/pictures.h"
#include "identify/vehicle/internal/steady_cornering.h"
#include "identify/vehicle/internal/structure_comparison.h"
#include "identify/vehicle/internal/structure_judgement.h"
#include "identify/vehicle/internal/structure_study.h"
#include "identify/vehicle/internal/trajectory.h"
#include "identify/vehicle/output_error.h"
#include "identify/vehicle/search.h"
#include "identify/vehicle/series.h"
#include "identify/vehicle/steering_noise.h"
#include "identify/vehicle/steering_steps.h"
#include "identify/vehicle/tyre_saturation.h"
#include "identify/vehicle/usable_data.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

/// The model file's parameters in its units; free ones still stand at their start.
void list_parameters(const Model& model, VehicleEstimate& estimate) {
  for (const Parameter& given : model.parameters) {
    EstimatedParameter result;
    result.name = given.name;
    result.unit = given.unit;
    result.fixed = given.fixed;
    const Unit unit = unit_or_dimensionless(given.unit);
    result.start = unit.from_si(given.scalar());
    result.bounds = {unit.from_si(given.min), unit.from_si(given.max)};
    result.value = result.start;
    const auto parameter = vehicle_parameter(given.name);
    result.neutral = given.fixed && given.scalar() == neutral_vehicle()[*parameter];
    estimate.parameters.push_back(result);
  }
}

/// A wrong bound of these biases the stiffnesses.
bool biases_the_others(VehicleParameter p) {
  return p == kCf || p == kCr || p == kYawInertia || p == kInverseSaturationFront ||
         p == kInverseSaturationRear;
}

void report_values(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p,
                   VehicleEstimate& estimate) {
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    EstimatedParameter& result = estimate.parameters[unknowns.position[i]];
    const UserValue user = in_user_terms(unknowns.free[i], p[unknowns.free[i]]);
    result.value = unit_or_dimensionless(result.unit).from_si(user.value);
  }
}

/// A parameter at a bound has no interval; the others are judged as if it were known.
void report_bounds(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p,
                   const VehicleCovariance& covariance, VehicleEstimate& estimate) {
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    if (!covariance.at_bound[i]) continue;
    EstimatedParameter& result = estimate.parameters[unknowns.position[i]];
    result.verdict = Verdict::at_bound;
    if (is_straight(unknowns, i, p[unknowns.free[i]])) result.value = kInfinity;
  }
}

/// @param estimate  with the values that report_bounds() gave
Findings check_bounds(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p,
                      const VehicleCovariance& covariance, const VehicleEstimate& estimate) {
  Findings out;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    if (!covariance.at_bound[i]) continue;
    const EstimatedParameter& result = estimate.parameters[unknowns.position[i]];
    if (is_straight(unknowns, i, p[unknowns.free[i]])) {
      out.push_back(make_finding(
          FindingCode::no_saturation, {result.name},
          fmt::format(
              "{} is larger than this recording can determine: the force of that axle is linear",
              result.name),
          "record harder cornering; a linear tyre fits this recording as well"));
      continue;
    }
    out.push_back(
        {FindingCode::at_bound,
         biases_the_others(unknowns.free[i]) ? Severity::serious : Severity::warning,
         {result.name},
         fmt::format(
             "{} ended at its bound {:.6g}; the standard errors of the others take it as known",
             result.name, result.value),
         "widen the bound in the model file if it is not physical"});
  }
  for (std::size_t i = 0; i < covariance.open.size(); ++i) {
    if (!covariance.open[i]) continue;
    const EstimatedParameter& result = estimate.parameters[unknowns.position[i]];
    out.push_back(make_finding(
        FindingCode::at_bound, {result.name},
        fmt::format("{} ended at its bound {:.6g}, but this recording does not determine it",
                    result.name, result.value)));
  }
  return out;
}

void report_errors(const VehicleUnknowns& unknowns, const VehicleParameters<double>& p,
                   const VehicleCovariance& covariance, VehicleEstimate& estimate) {
  const auto k = static_cast<Eigen::Index>(covariance.inner.size());
  if (k == 0) return;
  Eigen::VectorXd to_user(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    const Eigen::Index n = covariance.inner[i];
    const std::string& unit = estimate.parameters[unknowns.position[n]].unit;
    to_user[i] = in_user_terms(unknowns.free[n], p[unknowns.free[n]]).slope / unit_scale(unit);
  }
  const Eigen::MatrixXd information = to_user.cwiseInverse().asDiagonal() * covariance.information *
                                      to_user.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd in_user_units =
      to_user.asDiagonal() * covariance.covariance * to_user.asDiagonal();
  judge_parameters(estimate, information, in_user_units,
                   student_t_quantile(0.975, covariance.freedom));
  estimate.covariance_freedom = covariance.freedom;
  for (Eigen::Index i = 0; i < k; ++i) {
    EstimatedParameter& result = estimate.parameters[unknowns.position[covariance.inner[i]]];
    if (!std::isnan(result.se)) {
      result.crb_se = std::sqrt(covariance.white(i, i)) * std::abs(to_user[i]);
    }
  }
}

std::string kind_of(const VehicleCovariance& covariance, bool robust) {
  if (covariance.draws > 0) {
    return fmt::format("block bootstrap, {} draws of {} blocks", covariance.draws,
                       covariance.blocks);
  }
  if (covariance.coloured) {
    return fmt::format("sandwich, residuals correlated over {:.2g} s", covariance.memory);
  }
  return robust ? "sandwich, robust cost" : "inverse information, white residuals (Cramer-Rao)";
}

void report_series(const VehicleSearch& found, const VehicleCovariance& covariance,
                   VehicleEstimate& estimate) {
  const VehicleProblem& problem = found.problem;
  estimate.series = vehicle_series(problem, found.best.z);
  estimate.simulation = channel_fits(estimate.series, problem.robust);
  if (problem.robust) {
    estimate.notes.push_back("fit and rmse count outliers as three standard deviations");
  }
  if (problem.prediction) {
    Series one_step = estimate.series;
    Eigen::VectorXd e;
    output_error(problem, found.best.z, e, nullptr);
    for (std::size_t i = 0; i < problem.row.size(); ++i) {
      const Eigen::Index j = problem.output[i];
      one_step.predicted(j, problem.row[i]) =
          one_step.measured(j, problem.row[i]) + in_unit(problem.run->outputs[j], e[i]);
    }
    estimate.one_step = channel_fits(one_step, problem.robust);
    estimate.pictures.one_step = std::move(one_step.predicted);
  }
  Eigen::MatrixXd& standardised = estimate.series.standardised;
  standardised = Eigen::MatrixXd::Constant(problem.run->y.rows(), problem.run->time.size(), kNone);
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    // Residual as the rest of the program has it: measured minus predicted.
    standardised(problem.output[i], problem.row[i]) = -covariance.residuals[i];
  }
}

/// The simulation that the study ended with stands for that of the model as it is written.
void report_errors_of(const StructureStudy& study, const VehicleProblem& problem,
                      VehicleEstimate& estimate) {
  Series& series = estimate.series;
  for (std::size_t i = 0; i < problem.row.size(); ++i) {
    const Eigen::Index j = problem.output[i], t = problem.row[i];
    series.predicted(j, t) =
        series.measured(j, t) +
        in_unit(problem.run->outputs[j], study.errors[static_cast<Eigen::Index>(i)]);
  }
  estimate.simulation = channel_fits(series, problem.robust);
}

/// The noise of every output, the given one without an error.
void report_noise(const VehicleProblem& problem, const VehicleCovariance& covariance,
                  VehicleEstimate& estimate) {
  for (std::size_t j = 0; j < problem.run->outputs.size(); ++j) {
    const VehicleRun::Output& output = problem.run->outputs[j];
    const double sd = in_unit(output, covariance.sd[j]);
    const bool given = !std::isnan(output.given_sd);
    const double se = sd / std::sqrt(2.0 * static_cast<double>(output.samples));
    estimate.derived.push_back({"sd(" + output.name + ")", output.unit, sd, given ? kNone : se});
  }
}

/// @param flat  how many directions the data do not determine: they count as no parameters
void report_objective(const VehicleSearch& found, Eigen::Index flat, VehicleEstimate& estimate) {
  const VehicleProblem& problem = found.problem;
  Objective& objective = estimate.objective;
  objective.log_likelihood = found.best.log_likelihood;
  Eigen::VectorXd e;
  if (output_error(problem, coordinates_of(problem, problem.unknowns.value), e, nullptr)) {
    objective.log_likelihood_start = log_likelihood(
        problem, coordinates_of(problem, problem.unknowns.value), e, noise_sd(problem, e));
  }
  const Eigen::Index equalities = problem.unknowns.constraints.equalities();
  auto estimated = static_cast<double>(problem.coordinates() - flat - equalities);
  for (const VehicleRun::Output& output : problem.run->outputs) {
    if (std::isnan(output.given_sd)) estimated += 1.0;
  }
  objective.aic = 2.0 * (estimated - found.best.log_likelihood);
  objective.samples = static_cast<long>(problem.residuals());
  objective.bic = estimated * std::log(static_cast<double>(objective.samples)) -
                  2.0 * found.best.log_likelihood;
  objective.iterations = found.iterations;
  objective.evaluations = found.evaluations;
  objective.starts = found.starts;
  objective.starts_at_optimum = found.starts_at_optimum;
}

/// Goes on from the best simulation with a filter gain that starts at zero. Where the gain raises
/// the likelihood no more than chance would, there is no process noise, and the simulation stays.
void predict_instead(const VehicleSearchOptions& options, VehicleSearch& found,
                     VehicleEstimate& estimate) {
  Eigen::VectorXd z = found.best.z;
  const VehicleProblem problem = predicting(found.problem, found.best.sd, z);
  SolverOptions solver;
  if (options.iterations > 0) solver.max_iterations = options.iterations;
  solver.progress = options.progress;
  const VehicleOptimum best = maximise_likelihood(problem, z, solver);
  found.iterations += best.iterations;
  found.evaluations += best.evaluations;
  found.paths.push_back(best.path);
  const double gain = 2.0 * (best.log_likelihood - found.best.log_likelihood);
  if (gain < chi_square_quantile(0.99, static_cast<double>(problem.gains()))) {
    estimate.notes.push_back(
        "no process noise detected: the filter gain is not significant, values are those of the "
        "simulation");
    return;
  }
  found.problem = problem;
  found.best = best;
}

/// Held-out rows, simulated by the fitted car. Their residuals are on the scale of the others where
/// these are a simulation's too.
void report_hold_out(Series held, const VehicleSearch& found, const VehicleCovariance& covariance,
                     bool simulation, VehicleEstimate& estimate) {
  Pictures& pictures = estimate.pictures;
  estimate.hold_out = channel_fits(held, found.problem.robust);
  if (simulation) {
    pictures.held_standardised = held.measured - held.predicted;
    for (Eigen::Index j = 0; j < held.measured.rows(); ++j) {
      pictures.held_standardised.row(j) /= in_unit(found.problem.run->outputs[j], covariance.sd[j]);
    }
  }
  pictures.held_time = std::move(held.time);
  pictures.held_recording = std::move(held.recording);
  pictures.held_measured = std::move(held.measured);
  pictures.held_out_simulation = std::move(held.predicted);
}

/// Goes on from the best simulation with the whole path unknown.
VehicleCovariance follow_trajectory(const VehicleFitOptions& options,
                                    const VehicleSearchOptions& search, VehicleSearch& found,
                                    VehicleEstimate& estimate) {
  if (options.bootstrap > 0) {
    throw InputError({}, "--bootstrap with --method trajectory",
                     "one of them: blocks of a path are not independent");
  }
  SolverOptions solver;
  if (search.iterations > 0) solver.max_iterations = search.iterations;
  solver.progress = search.progress;
  VehicleTrajectory trajectory = fit_trajectory(found.problem, found.best, solver);
  found.best = trajectory.best;
  found.iterations += trajectory.best.iterations;
  found.evaluations += trajectory.best.evaluations;
  estimate.derived.push_back({"process noise of vy", "m/s^2 s^0.5", trajectory.process[0], kNone});
  estimate.derived.push_back({"process noise of r", "rad/s^2 s^0.5", trajectory.process[1], kNone});
  if (trajectory.left_out > 0) {
    estimate.notes.push_back(fmt::format("{} samples left out as outliers", trajectory.left_out));
  }
  return trajectory.covariance;
}

std::string what_was_fitted(const VehicleSearch& found, const VehicleEstimate& estimate) {
  const auto free = std::count_if(estimate.parameters.begin(), estimate.parameters.end(),
                                  [](const EstimatedParameter& p) { return !p.fixed; });
  if (free == 0) return fmt::format("simulated {} rows, nothing to fit", found.problem.run->used);
  return fmt::format("{} parameter{} fitted to {} samples", free, free == 1 ? "" : "s",
                     found.problem.residuals());
}

/// A fit with what its reports and checks need.
struct VehicleFit {
  const Model& model;
  const std::vector<Dataset>& recordings;
  const VehicleFitOptions& options;
  VehicleSearch found;
  VehicleCovariance covariance, of_noise = {};  ///< the latter without the structure's part
  bool stopped = false;  ///< by the caller: this search, and all that would follow
  bool structure_asked = false;
  std::optional<StructureStudy> structure = {};  ///< none where it is not asked, or fails
  SteeringNoise noise = {};
  /// Values of the free parameters, SI: of the simulation without the steering's noise, and of the
  /// method that went on from it.
  Eigen::VectorXd simulated = {}, as_written = {};

  bool takes_structure() const {
    return structure && options.structure == VehicleFitOptions::Structure::automatic;
  }
  bool simulates() const { return options.method == VehicleFitOptions::Method::output_error; }
  bool second_opinion() const { return options.second_opinion && !stopped; }
  /// With the structure as written, or allowed for.
  VehicleParameters<double> parameters(bool allowed_for) const {
    VehicleParameters<double> p = parameters_at(found.problem, found.best.z);
    const VehicleUnknowns& unknowns = found.problem.unknowns;
    for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
      const auto n = static_cast<Eigen::Index>(i);
      if (noise.corrected) p[unknowns.free[i]] -= noise.shift[n];
      if (allowed_for) p[unknowns.free[i]] = structure->value[n];
    }
    return p;
  }
  VehicleParameters<double> parameters() const { return parameters(takes_structure()); }
  StructuredAnswer answer() const {
    if (!structure) return {parameters()};
    return {parameters(), &*structure, takes_structure(), parameters(!takes_structure())};
  }
};

VehicleEstimate begun(const Model& model, const std::vector<Dataset>& recordings,
                      const VehicleRun& run) {
  VehicleEstimate out;
  out.verb = "fit";
  out.model_name = model.name;
  out.tyre_curve = name_of(as_vehicle(model).curve);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    out.inputs.push_back({recordings[i].name, "", static_cast<long>(recordings[i].size()),
                          static_cast<long>(run.used_of[i])});
  }
  out.findings = run.findings;
  out.notes = run.notes;
  list_parameters(model, out);
  return out;
}

/// Steady-state cornering without sideslip, both stiffnesses free: fills the answer that it has.
bool is_answered_by_steady_cornering(const Model& model, const VehicleRun& run,
                                     const VehicleUnknowns& unknowns, VehicleEstimate& estimate) {
  // With sideslip, or one stiffness known, a circle determines the stiffnesses.
  const bool open = unknowns.find(kCf) >= 0 && unknowns.find(kCr) >= 0 &&
                    run.find(VehicleQuantity::vy) < 0 && run.find(VehicleQuantity::beta) < 0;
  if (!open || !is_steady(run)) return false;
  const auto known = [&](VehicleParameter p) {
    return unknowns.find(p) < 0 ? unknowns.value[p] : 0.0;
  };
  const std::optional<SteadyTurning> turning =
      steady_turning(run, known(kSteeringOffset), known(kBiasR));
  if (!turning) return false;
  append(estimate.findings, check_signs(run, unknowns.value));
  report_steady(model, *turning, estimate);
  append(estimate.findings, check_steady(model, *turning));
  conclude(estimate, "");
  return true;
}

void require_samples(const std::vector<Dataset>& recordings, const VehicleRun& run,
                     const VehicleUnknowns& unknowns) {
  const std::size_t unknown = unknowns.free.size() + 2 * run.segments.size();
  Eigen::Index samples = 0;
  for (const VehicleRun::Output& output : run.outputs) samples += output.samples;
  if (samples > static_cast<Eigen::Index>(unknown)) return;
  throw InputError(
      Location{recordings.front().name, 0, 0},
      fmt::format("{} samples of the outputs for {} unknowns (parameters and initial states)",
                  samples, unknown),
      "more samples than unknowns");
}

bool rolls(const VehicleRun& run, const VehicleUnknowns& unknowns) {
  return run.roll.size() > 0 || unknowns.find(kRollPerAcceleration) >= 0 ||
         unknowns.value[kRollPerAcceleration] > 0.0;
}

/// Filters of samples that correct the state know what the sensors show now, not what they showed.
void require_simulation(const Model& model, const VehicleFitOptions& options, const VehicleRun& run,
                        const VehicleUnknowns& unknowns) {
  if (options.method == VehicleFitOptions::Method::output_error) return;
  if (as_vehicle(model).steering_noise > 0.0) {
    throw InputError({}, "noise of the steering angle with a method that filters",
                     "--method output-error");
  }
  if (rolls(run, unknowns)) {
    throw InputError({}, "roll with a method that filters", "--method output-error");
  }
  if (!has_late_sensor(run, unknowns)) return;
  throw InputError({}, "a delay or lag in 'sensors' with a method that filters",
                   "--method output-error",
                   "or a known delay beside the column: {column: ..., delay: 80 ms}");
}

/// What causes that the model does not have would change, where a stiffness or the inertia is free.
bool asks_for_structure(const VehicleFit& fit) {
  const std::vector<VehicleParameter>& free = fit.found.problem.unknowns.free;
  const bool any = std::any_of(free.begin(), free.end(), [](VehicleParameter p) {
    return p == kCf || p == kCr || p == kYawInertia;
  });
  using Structure = VehicleFitOptions::Structure;
  return any && fit.second_opinion() && fit.options.structure != Structure::ignored;
}

std::optional<StructureStudy> structure_of(const VehicleFit& fit) {
  if (!fit.structure_asked) return {};
  StructureStudy study = study_structure(fit.found.problem, fit.found.best);
  if (study.covariance.size() == 0 || !study.covariance.allFinite()) return {};
  return study;
}

Eigen::VectorXd free_values(const VehicleSearch& found) {
  return found.best.z.head(found.problem.parameters()).cwiseProduct(found.problem.unknowns.scale);
}

/// Values and errors with the structure in view.
void allow_for_structure(VehicleFit& fit) {
  if (!fit.structure) return;
  fit.as_written = free_values(fit.found);
  if (fit.noise.corrected) fit.as_written -= fit.noise.shift;
  if (fit.takes_structure()) {
    take_structure(*fit.structure, fit.found.problem.unknowns, fit.as_written, fit.covariance);
  } else {
    widen_by_structure(*fit.structure, fit.as_written, fit.simulated, fit.covariance);
  }
}

/// Where the covariance is taken: at the optimum, or at the study's values where these are the answer
/// and no more at a bound that the model as written ends at.
VehicleOptimum where_errors_are_taken(const VehicleFit& fit) {
  VehicleOptimum at = fit.found.best;
  if (!fit.takes_structure()) return at;
  const VehicleProblem& problem = fit.found.problem;
  const Eigen::VectorXd taken = fit.structure->value.cwiseQuotient(problem.unknowns.scale);
  bool leaves = false;
  for (Eigen::Index i = 0; i < taken.size(); ++i) {
    leaves = leaves || (is_at_bound(problem, at.z, i) && !is_at_bound(problem, taken, i));
  }
  if (leaves) at.z.head(taken.size()) = taken;
  return at;
}

/// Known noise is corrected for; what is found is stated, and part of the error.
void look_for_steering_noise(VehicleFit& fit) {
  const double known = as_vehicle(fit.model).steering_noise;
  if (!(known > 0.0) && !fit.second_opinion()) return;
  fit.noise = study_steering_noise(fit.found.problem, fit.found.best, known);
  fit.noise.corrected = known > 0.0;
  if (fit.noise.any()) fit.simulated -= fit.noise.shift;
}

/// The best simulation, from there on what the method adds to it, then the covariance.
/// @return false when the simulation diverges from every start
bool find_optimum(const VehicleRun& run, const VehicleUnknowns& unknowns, VehicleFit& fit,
                  VehicleEstimate& estimate) {
  using Method = VehicleFitOptions::Method;
  VehicleSearchOptions watched = fit.options.search;
  watched.progress = [&](int iteration, double L) {
    const auto& progress = fit.options.search.progress;
    fit.stopped = fit.stopped || (progress && !progress(iteration, L));
    return !fit.stopped;
  };
  VehicleSearch& found = fit.found = search_vehicle(run, unknowns, watched);
  if (found.best.z.size() == 0) return false;
  fit.simulated = free_values(found);
  look_for_steering_noise(fit);
  fit.structure_asked = asks_for_structure(fit);
  fit.structure = structure_of(fit);
  if (fit.options.method == Method::trajectory) {
    fit.covariance = follow_trajectory(fit.options, watched, found, estimate);
  } else {
    if (fit.options.method == Method::prediction_error) predict_instead(watched, found, estimate);
    fit.covariance = vehicle_covariance(found.problem, where_errors_are_taken(fit));
  }
  estimate.pictures.searches = found.paths;
  // Whatever one start found, the search was not finished.
  if (fit.stopped) {
    found.best.converged = false;
    found.best.message = "stopped by the caller";
  }
  if (fit.options.bootstrap > 0 && !fit.stopped) {
    bootstrap_errors(found.problem, fit.options.bootstrap, fit.options.search.seed, fit.covariance);
  }
  fit.of_noise = fit.covariance;
  allow_for_structure(fit);
  return true;
}

/// Everything but findings and conclusion.
void report_fit(const VehicleFit& fit, const VehicleUnknowns& unknowns, VehicleEstimate& estimate) {
  using Method = VehicleFitOptions::Method;
  const VehicleSearch& found = fit.found;
  const VehicleCovariance& covariance = fit.covariance;
  const VehicleParameters<double> p = fit.parameters();
  estimate.tests = covariance.whiteness;
  estimate.objective.method = fit.options.method == Method::output_error       ? "output_error"
                              : fit.options.method == Method::prediction_error ? "prediction_error"
                                                                               : "trajectory";
  report_objective(found, covariance.null_space.cols(), estimate);
  report_values(found.problem.unknowns, p, estimate);
  report_bounds(found.problem.unknowns, p, covariance, estimate);
  append(estimate.findings, check_bounds(found.problem.unknowns, p, covariance, estimate));
  append(estimate.findings, check_constraints(unknowns.constraints, found.best.multipliers,
                                              fit.model.parameters, false));
  report_errors(found.problem.unknowns, p, covariance, estimate);
  estimate.covariance_kind =
      fit.options.method == Method::trajectory
          ? "inverse information, path eliminated; process and measurement noise taken as white"
          : kind_of(covariance, found.problem.robust);
  if (fit.takes_structure()) {
    estimate.covariance_kind = "the fit with lags, roll and bending tyres allowed for";
  } else if (fit.structure) {
    estimate.covariance_kind += ", and what lags, roll and bending tyres may add";
  }
  report_series(found, covariance, estimate);
  estimate.driven = driven_ranges(found.problem, found.best.z);
  std::vector<std::string> driven;
  for (const DrivenRange& range : estimate.driven) driven.push_back(in_words(range));
  estimate.notes.push_back(fmt::format("fitted to {}", fmt::join(driven, ", ")));
  report_characteristic_values(found.problem, fit.answer(), fit.of_noise, estimate);
  report_noise(found.problem, covariance, estimate);
  if (fit.structure) {
    report_structure(*fit.structure, fit.takes_structure(), unknowns, fit.of_noise, covariance,
                     estimate);
    if (std::any_of(estimate.parameters.begin(), estimate.parameters.end(), is_effective_inertia)) {
      estimate.notes.emplace_back(
          "Iz is effective: it holds what lags, roll and bending tyres do to the yaw motion; it is "
          "not the inertia of a drawing");
    }
  }
  if (fit.takes_structure()) report_errors_of(*fit.structure, found.problem, estimate);
  if (fit.options.hold_out.empty()) return;
  report_hold_out(
      validate_vehicle(fit.model, fit.options.hold_out, unknowns, p, fit.options.search.robust)
          .series,
      found, covariance, fit.simulates(), estimate);
}

/// Where the errors allow for bending tyres, delays and ratio, these are no reasons to refuse.
Findings informing(Findings findings) {
  for (Finding& finding : findings) {
    const FindingCode code = finding.code;
    const bool in_errors = code == FindingCode::tyre_saturation ||
                           code == FindingCode::steering_delay ||
                           code == FindingCode::steering_gain;
    if (!in_errors || finding.severity != Severity::serious) continue;
    finding.severity = Severity::warning;
    finding.remedy =
        "the errors allow for it; other causes may explain it as well, and --structure "
        "auto weighs them";
    finding.changes = {{"--structure auto", ""}};
  }
  return findings;
}

/// Channels that fit with the other sign, and the lines of the model file that reverse them.
Findings check_reversed_channels(const VehicleFit& fit, const VehicleEstimate& estimate) {
  Findings out = check_sensor_misalignment(fit.found, fit.options.search, estimate);
  for (Finding& finding : out) {
    for (const ChannelSource& output : fit.model.outputs) {
      if (output.name != finding.about.front()) continue;
      finding.changes = {
          {"", fmt::format("outputs: {{{}: {{scale: {}}}}}", output.name, -output.scale)}};
    }
  }
  return out;
}

/// What other forms of the model say, where their fits can be compared with this one.
Findings check_other_forms(const VehicleFit& fit, VehicleEstimate& estimate) {
  AlternativeForms other = compare_alternatives(fit.found, fit.options.search, estimate);
  estimate.notes.insert(estimate.notes.end(), other.notes.begin(), other.notes.end());
  return fit.structure ? informing(std::move(other.findings)) : std::move(other.findings);
}

/// The findings. Those on channels come first: where a channel is misread, other forms of the model
/// and another tyre would only explain the error away.
void check_vehicle_fit(const VehicleFit& fit, const VehicleUnknowns& unknowns,
                       VehicleEstimate& estimate) {
  const VehicleProblem& problem = fit.found.problem;
  const VehicleParameters<double> p = fit.parameters();
  Findings& found = estimate.findings;
  const bool other_forms = fit.second_opinion() && fit.simulates() && !unknowns.free.empty();
  append(found, check_hold_out(estimate));
  append(found, check_signs(*problem.run, p));
  if (fit.second_opinion()) {
    append(found, check_by_survey(fit.model, fit.recordings, estimate));
    append(found, check_hold_out_by_survey(fit.model, fit.options.hold_out, estimate.findings));
  }
  if (other_forms && !has_misreading(found)) {
    append(found, check_reversed_channels(fit, estimate));
  }
  Eigen::VectorXd e;
  output_error(problem, fit.found.best.z, e, nullptr);
  append(found, check_fit(problem, rms_per_output(problem, e), estimate));
  if (unknowns.curve == TyreCurve::linear && fit.simulates() && !has_misreading(found)) {
    Findings tyres = check_tyres(
        problem, test_tyre_saturation(problem, fit.found.best, fit.covariance), estimate);
    append(found, fit.structure ? informing(std::move(tyres)) : std::move(tyres));
  }
  append(found, check_whiteness(fit.covariance));
  if (!has_misreading(found)) {
    append(found,
           check_steering_noise(fit.model, fit.found, fit.noise, fit.takes_structure(), estimate));
  }
  if (fit.structure && !has_misreading(found)) {
    append(found, check_structure(*fit.structure, unknowns, estimate));
  } else if (fit.structure_asked && !fit.structure) {
    append(found, check_structure_unknown(unknowns, estimate));
  }
  append(found, check_steering_gain(problem, fit.covariance, p,
                                    as_vehicle(fit.model).steering_at_road_wheel));
  if (other_forms && !has_misreading(found)) append(found, check_other_forms(fit, estimate));
  if (other_forms && !has_misreading(found)) {
    if (!fit.noise.any()) append(found, check_steering_steps(fit.model, fit.found, estimate));
  }
  append(found, check_plausibility(p, estimate));
  append(found, check_weakest_direction(problem, fit.covariance, p, estimate));
}

}  // namespace

// The order, in which each step reads what those before it filled: the optimum; reports, of which
// verdicts and fits are what the checks judge by; findings; the conclusion from them, which puts
// causes before consequences; pictures of it all.
VehicleEstimate fit_vehicle(const Model& given, const std::vector<Dataset>& recordings,
                            const VehicleFitOptions& options) {
  if (options.search.starts < 1) {
    throw std::invalid_argument(
        fmt::format("{} starts; expected at least 1", options.search.starts));
  }
  if (options.method == VehicleFitOptions::Method::trajectory) {
    refuse_constraints(given, "--method trajectory");
  }
  if (options.bootstrap > 0) refuse_constraints(given, "--bootstrap");
  const Model model = checked(given, recordings);
  if (options.search.robust && options.method == VehicleFitOptions::Method::prediction_error) {
    throw InputError({}, "--robust with --method prediction-error",
                     "--method trajectory: the gain would carry outliers into the state");
  }
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  const VehicleRun run = usable_run(model, recordings);
  require_simulation(model, options, run, unknowns);
  VehicleEstimate estimate = begun(model, recordings, run);
  if (is_answered_by_steady_cornering(model, run, unknowns, estimate)) return estimate;
  require_samples(recordings, run, unknowns);

  VehicleFit fit{model, recordings, options, {}, {}};
  if (!find_optimum(run, unknowns, fit, estimate)) {
    for (EstimatedParameter& each : estimate.parameters) {
      if (!each.fixed) each.verdict = Verdict::unfitted;
    }
    append(estimate.findings, check_search(fit.found, {}, estimate));
    conclude(estimate, "");
    return estimate;
  }
  report_fit(fit, unknowns, estimate);
  check_vehicle_fit(fit, unknowns, estimate);
  note_errors_by_acceleration(fit.found.problem, fit.found.best, estimate);
  append(estimate.findings, check_search(fit.found, fit.covariance, estimate));
  conclude(estimate, what_was_fitted(fit.found, estimate));
  if (options.pictures) picture_vehicle(fit.found, fit.covariance, estimate);
  return estimate;
}

}  // namespace identikal
