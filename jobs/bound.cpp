// bound: how precise can any estimator be, before anything is recorded?
#include "identify/optimality/bound.h"

#include <memory>
#include <optional>

#include "jobs/digest_inputs.h"
#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/simulation/simulate.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct BoundRequest {
  ModelOptions model;
  std::string inputs, range;  // a recording of the inputs
  ResultOptions result;
  std::int64_t rows = 0, runs = 0;
  std::string accuracy;
  std::vector<std::string> signals;
  std::int64_t seed = 1;
};

double wanted_accuracy(const std::string& text) {
  const double accuracy = percentage("--accuracy", text);
  if (!(accuracy > 0.0)) {
    throw InputError({}, fmt::format("--accuracy '{}' is not above 0", text), "above 0%, e.g. 10%");
  }
  return accuracy;
}

void check_options(const BoundRequest& request, bool nonlinear) {
  const bool recorded = !request.inputs.empty();
  if (recorded == (request.rows > 0)) {
    throw InputError(
        {},
        recorded ? "both -n and a recording of inputs are given" : "the number of rows is missing",
        "-n ROWS, or a recording that holds the inputs");
  }
  if (request.runs > 0 && !nonlinear) {
    throw InputError({}, "--runs does not apply to this model", "a nonlinear model",
                     "the bound of a linear one is exact");
  }
  if (!recorded && !request.range.empty()) {
    throw InputError({}, "--range does not apply without a recording", "a recording of the inputs",
                     "-n gives the number of rows");
  }
  if (recorded && !request.signals.empty()) {
    throw InputError({}, "both --input and a recording of inputs are given", "one of the two");
  }
}

// Of recordings like those of a digest.
Outcome bound_digest(const BoundRequest& request, const Run& run, Model model) {
  refuse_beside_digests({{request.rows > 0, "-n"},
                         {request.runs > 0, "--runs"},
                         {!request.range.empty(), "--range"},
                         {!request.signals.empty(), "--input"}});
  const LoadedDigests loaded = load_digests({request.inputs}, model, run.call.inputs);
  BoundOptions options;
  if (!request.accuracy.empty()) options.accuracy = wanted_accuracy(request.accuracy);
  return finish(
      run, loaded.recordings,
      kept(std::make_shared<CramerRaoBound>(bound_of_digests(model, options, loaded.digests))));
}

Outcome bound(const BoundRequest& request, Call& call) {
  const Run run{"bound", call, request.model.file, {}, request.result};
  Model model = load_model(request.model, run.verb, call.inputs);
  require_filter(model, run.verb);
  if (is_digest_name(request.inputs)) return bound_digest(request, run, std::move(model));
  const bool nonlinear = is_formula_model(model);
  Recordings recordings;
  std::optional<Dataset> planned;
  if (!request.inputs.empty()) {
    const std::vector<Table> files = read_files(request.inputs, call.inputs);
    const TimeRange range = parse_range(request.range);
    planned = load_data(files, model, range, false);
    recordings.add({*planned}, files, range, call.inputs);
  }
  check_options(request, nonlinear);
  if (request.inputs.empty() && !model.recordings.empty()) {
    throw InputError({model.source, 0, 0}, "the bound of parameters with values in recordings",
                     "a recording of the inputs, by whose name they are known");
  }
  if (!planned && (nonlinear || !request.signals.empty())) {
    refuse_twice("--input", request.signals);
    planned = signal_inputs(model, request.signals, request.rows);
  }
  if (planned) {
    take_period(model, *planned);
    model = model_of_recording(std::move(model), *planned);
  }
  BoundOptions options;
  options.samples = request.inputs.empty() ? request.rows : planned->size();
  if (request.runs > 0) options.runs = static_cast<int>(request.runs);
  options.seed = static_cast<std::uint64_t>(request.seed);
  if (!request.accuracy.empty()) options.accuracy = wanted_accuracy(request.accuracy);
  const auto estimate =
      std::make_shared<CramerRaoBound>(bound_of(model, options, planned ? &*planned : nullptr));
  return finish(run, recordings, kept(estimate));
}

}  // namespace

Verb bound_verb() {
  const auto request = std::make_shared<BoundRequest>();
  Verb verb{"bound",
            "Compute the Cramer-Rao bound: the best that any estimator can do, before any data."};
  add_model(verb, request->model, "Model file (YAML); its values are taken as the truth.");
  add_input_recording(verb, request->inputs);
  add_number(verb, "-n,--rows", request->rows, 1, 1000000000,
             "Number of rows of the recording that is planned.");
  add_old_number(verb, "--samples", "--rows", request->rows, 1, 1000000000);
  add_text(verb, "--accuracy", request->accuracy,
           "Tell how many rows give this relative standard error, e.g. 10%.");
  add_signals(verb, request->signals);
  add_number(verb, "--runs", request->runs, 2, 100000,
             "Nonlinear model: Number of simulated recordings for the mean information.", "50");
  add_seed(verb, request->seed, "Nonlinear model: Seed of the simulated noise.");
  add_settings(verb, request->model);
  add_range(verb, request->range);
  add_result(verb, request->result);
  add_quiet(verb, request->result.quiet);
  add_filter_choice(verb, request->model);
  verb.run = [request](Call& call) { return bound(*request, call); };
  return verb;
}

}  // namespace identikal
