// fit: which physical parameters has the model that these recordings follow?
#include "identify/vehicle/fit.h"

#include <memory>

#include "jobs/filter_estimation.h"
#include "jobs/quantity.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/model/own_parameters.h"
#include "identify/model/simulation_model.h"
#include "identify/noise/curved_motion.h"
#include "identify/noise/steps_ahead.h"
#include "identify/regression/batch.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct FitOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  SearchOptions search;
  std::string method;  // of a vehicle; empty: output-error
  std::string structure;
  std::string objective;  // of formulas; empty: one-step
  std::string errors;     // of a filter's model; empty: residuals
  bool robust = false, reject_outliers = false;
  std::int64_t bootstrap = 0, seconds = 0;
};

VehicleFitOptions::Method vehicle_method(const std::string& name) {
  if (name == "prediction-error") return VehicleFitOptions::Method::prediction_error;
  if (name == "trajectory") return VehicleFitOptions::Method::trajectory;
  return VehicleFitOptions{}.method;
}

Outcome fit_a_vehicle(const FitOptions& given, const Run& run, const Model& model) {
  if (given.reject_outliers) {
    throw InputError({model.source, 0, 0}, "--reject-outliers does not apply to a vehicle",
                     "--robust");
  }
  if (given.search.threads > 0) {
    throw InputError({model.source, 0, 0}, "--threads does not apply to a vehicle",
                     "no --threads: its searches follow one another");
  }
  Recordings recordings = load_recordings(given.recordings, model, run.verb, run.call.inputs);
  VehicleFitOptions options;
  options.search.starts = given.search.number_of_starts();
  options.search.iterations = static_cast<int>(given.search.iterations);
  options.search.seed = given.search.seed_number();
  options.search.robust = given.robust;
  options.bootstrap = static_cast<int>(given.bootstrap);
  options.pictures = run.wants_pictures();
  options.method = vehicle_method(given.method);
  if (given.structure == "auto") {
    options.structure = VehicleFitOptions::Structure::automatic;
  }
  for (const HeldOut& held :
       hold_out(given.search.hold_out, model, parse_range(given.recordings.range), recordings,
                run.call.inputs)) {
    options.hold_out.push_back(samples_from(held.recording, held.from));
  }
  recordings.held_out = options.hold_out;
  options.search.progress = [&](int iteration, double) {
    return report_progress(run.call, fmt::format("fitting the vehicle: iteration {}", iteration));
  };
  return finish(
      run, recordings,
      kept(std::make_shared<VehicleEstimate>(fit_vehicle(model, recordings.data, options))));
}

// Free physical parameters of a filter are found by the same likelihood as its noise.
Outcome fit_a_filter(const FitOptions& given, const Run& run, Model model) {
  for (const auto& [is_given, option] :
       {std::pair{given.bootstrap > 0, std::string("--bootstrap")},
        std::pair{!given.method.empty(), "--method " + given.method},
        std::pair{!given.structure.empty(), "--structure " + given.structure}}) {
    if (!is_given) continue;
    throw InputError({model.source, 0, 0}, option + " does not apply to a filter",
                     "model: single-track", "a filter is fitted by maximum likelihood");
  }
  if (given.robust) {
    notice(run.call,
           "--robust of a filter is called --reject-outliers now; the next version will not know "
           "the old name");
  }
  const bool simulation = given.objective == "simulation";
  const int steps = steps_in(given.objective);
  const auto estimator = [&](const Model& of, const std::vector<Dataset>& recordings) {
    NoiseMlOptions options = likelihood_options(given.search, run);
    if (simulation) options.objective = FitObjective::simulation;
    if (given.errors == "likelihood") options.errors = NoiseSize::likelihood;
    if (steps > 1) return fit_steps_ahead(of, recordings, steps, options);
    NoiseEstimate out = tune_ml(of, recordings, options);
    if (options.team != nullptr && options.team->works_for_another()) return out;
    const bool as_it_is = given.model.filter.empty() && !given.reject_outliers && !given.robust;
    if (!simulation && as_it_is && takes_further_parts(of) && may_lack_a_curve(of, out)) {
      judge_by_curves(written_out(run), of, recordings, out, told_of_parts(run));
    }
    return out;
  };
  return estimate_filter(run, std::move(model), given.recordings, given.search.hold_out,
                         given.reject_outliers || given.robust, estimator,
                         simulation ? simulation_model : ModelPreparation());
}

void check_objective(const std::string& objective) {
  constexpr int kMostSteps = 10'000;
  const int steps = steps_in(objective);
  const bool known = objective.empty() || objective == "one-step" || objective == "simulation";
  if (known || (steps >= 1 && steps <= kMostSteps)) return;
  throw InputError(
      {}, fmt::format("--objective {}", in_quotes(objective)),
      fmt::format("one-step, simulation, or a number of steps up to {}, such as 10-step",
                  kMostSteps));
}

// All samples at once: there is nothing to search for.
Outcome fit_coefficients(const FitOptions& given, const Run& run) {
  const Model model = load_any_model(given.model, run.call.inputs);
  for (const auto& [is_given, option] :
       {std::pair{given.bootstrap > 0, std::string("--bootstrap")},
        std::pair{!given.method.empty(), "--method " + given.method},
        std::pair{!given.structure.empty(), "--structure " + given.structure},
        std::pair{!given.objective.empty(), "--objective " + given.objective},
        std::pair{!given.errors.empty(), "--errors " + given.errors},
        std::pair{given.robust, std::string("--robust")},
        std::pair{given.reject_outliers, std::string("--reject-outliers")},
        std::pair{!given.search.hold_out.empty(), std::string("--hold-out")}}) {
    if (!is_given) continue;
    throw InputError({model.source, 0, 0}, option + " does not apply to a regression",
                     "least squares of all samples", "'track' follows coefficients that change");
  }
  const Recordings recordings = load_recordings(given.recordings, model, run.verb, run.call.inputs);
  return finish(run, recordings,
                kept(std::make_shared<RegressionEstimate>(fit_regression(model, recordings.data))));
}

Outcome fit(const FitOptions& options, Call& call) {
  const Run run{"fit", call, options.model.file, {}, options.result};
  limit_time(call, options.seconds);
  const bool simulation = options.objective == "simulation";
  check_objective(options.objective);
  if (is_regression(call.inputs.model(options.model.file))) return fit_coefficients(options, run);
  Model model = load_model(options.model, run.verb, call.inputs,
                           simulation ? FormulaReading::as_written : FormulaReading::linear);
  if (!options.objective.empty() && is_vehicle(model)) {
    throw InputError({model.source, 0, 0}, "--objective does not apply to a vehicle",
                     "--method output-error: a simulation; prediction-error: one step ahead");
  }
  if (!options.errors.empty() && (is_vehicle(model) || simulation)) {
    throw InputError({model.source, 0, 0},
                     fmt::format("--errors does not apply to {}",
                                 simulation ? "--objective simulation" : "a vehicle"),
                     "a model whose errors one step ahead are white");
  }
  const bool one_step = options.objective.empty() || options.objective == "one-step";
  if (!one_step && has_population(model)) {
    throw InputError({model.source, 0, 0}, "a spread with --objective " + options.objective,
                     "errors one sample ahead");
  }
  const bool coloured = simulation || steps_in(options.objective) > 1;
  if (coloured && (options.reject_outliers || options.robust)) {
    throw InputError({model.source, 0, 0},
                     "--reject-outliers with --objective " + options.objective, "one of the two",
                     "errors of several steps are not white, and look like outliers");
  }
  if (!model.recordings.empty() && model.student) {
    throw InputError({model.source, 0, 0},
                     "Student's t and parameters with values of their own in each recording",
                     "one of the two");
  }
  return is_vehicle(model) ? fit_a_vehicle(options, run, model)
                           : fit_a_filter(options, run, std::move(model));
}

}  // namespace

Verb fit_verb() {
  const auto options = std::make_shared<FitOptions>();
  Verb verb{"fit",
            "Estimate the physical parameters of a vehicle or of a filter's model, or a "
            "regression's coefficients."};
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result_with_page(verb, options->result);
  add_filter_choice(verb, options->model);
  add_search(verb, options->search);
  add_time_limit(verb, options->seconds);
  add_choice(verb, "--method", options->method, {"output-error", "prediction-error", "trajectory"},
             "Vehicle: Choose the estimator. output-error: simulation; for cars that wind and road "
             "disturb, prediction-error: with a filter gain, or trajectory: with the states of all "
             "rows unknown.",
             "output-error");
  add_text(
      verb, "--objective", options->objective,
      "Filter: Choose which errors are made small. one-step: those of a filter that predicts the "
      "next sample; 10-step, or another number: those of its predictions as many samples ahead; "
      "simulation (formulas): those of a simulation from a start that is unknown, however "
      "coloured they are.",
      "one-step");
  add_choice(verb, "--errors", options->errors, {"residuals", "likelihood"},
             "Formulas without process noise: Choose the size of the noise in standard errors. "
             "residuals: the sum of squares over n - p, with Student's t, as in regression; "
             "likelihood: over n.",
             "residuals");
  add_choice(verb, "--structure", options->structure, {"as-written", "auto"},
             "Vehicle: Choose what becomes of lags, roll and bending tyres that the model does not "
             "have. as-written: they widen the errors; auto: the values are those with all of them "
             "allowed for.",
             "as-written");
  add_flag(verb, "--robust", options->robust,
           "Vehicle: Take the noise to follow Student's t instead of a normal distribution.");
  add_flag(verb, "--reject-outliers", options->reject_outliers,
           "Filter: Find samples that are outliers and leave them out.");
  add_number(verb, "--bootstrap", options->bootstrap, 20, 100000,
             "Vehicle: Standard errors by a block bootstrap of this many draws, e.g. 500.");
  verb.run = [options](Call& call) { return fit(*options, call); };
  return verb;
}

}  // namespace identikal
