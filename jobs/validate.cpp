// validate: does a result hold on other data?
#include "identify/validation/validate.h"

#include <memory>
#include <utility>

#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/result/estimated_model.h"
#include "identify/result/file.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct ValidationOptions {
  std::string result_path, least_fit;
  RecordingOptions recordings;
  ResultOptions result;
  bool robust = false;
};

// In percent.
double least_fit(const std::string& text) {
  const double percent = 100.0 * percentage("--fit", text);
  if (!(percent <= 100.0)) {
    throw InputError({}, fmt::format("--fit '{}' cannot be reached", text), "at most 100%");
  }
  if (!(percent > 0.0)) {
    throw InputError({}, fmt::format("--fit '{}' has no effect", text), "above 0%");
  }
  return percent;
}

void refuse_what_estimates_nothing(const StoredResult& result, const Model& model) {
  if (is_regression(model)) {
    throw InputError({result.path, 0, 0}, "a result about a regression",
                     "a result of tune, check or fit");
  }
  if (result.estimate.verb == "bound") {
    throw InputError({result.path, 0, 0}, "a result of 'bound', which has estimated nothing",
                     "a result of tune, check or fit");
  }
}

Outcome validate_result(const ValidationOptions& given, Call& call) {
  const StoredResult result = call.inputs.result(given.result_path);
  const Run run{"validate", call, "", files_of(result, given.result_path), given.result};
  Model model = estimated_model(result.estimate, result.path);
  refuse_what_estimates_nothing(result, model);
  const bool vehicle = is_vehicle(model);
  if (!vehicle) require_filter(model, run.verb);
  if (given.robust && !vehicle) {
    throw InputError({}, "--robust does not apply to a filter", "a result about a vehicle");
  }
  ValidateOptions options;
  options.robust = given.robust;
  if (!given.least_fit.empty()) options.least_fit = least_fit(given.least_fit);
  Recordings recordings = load_recordings(given.recordings, model, run.verb, call.inputs);
  if (!vehicle) {
    take_period(model, recordings.data.front());
    model = joint_model(std::move(model), recordings);
    model = going_on_from_rows_before(std::move(model), given.recordings, recordings, call.inputs);
  }
  KeptResult validation = kept(std::make_shared<Validation>(
      validate(sections_of(result.estimate), model, recordings.data, recordings.records, options)));
  if (result.estimate.model_file) validation.take(*result.estimate.model_file);
  return finish(run, recordings, std::move(validation));
}

}  // namespace

Verb validate_verb() {
  const auto options = std::make_shared<ValidationOptions>();
  Verb verb{"validate",
            "Score a result on other data without a refit; exit status 1 when it "
            "does not hold."};
  add_argument(verb, "RESULT", options->result_path,
               "Result to validate: result.json, or its folder.");
  add_recordings(verb, options->recordings);
  add_text(verb, "--fit", options->least_fit,
           "Require this least fit of every channel, e.g. 70%. Without it, a filter has to pass "
           "its tests; a vehicle has to explain 50% of the yaw rate and the rest better than its "
           "mean, and to be the car that a refit finds.");
  add_flag(verb, "--robust", options->robust,
           "Vehicle: Take the noise to follow Student's t instead of a normal distribution.");
  add_range(verb, options->recordings.range);
  add_result(verb, options->result);
  verb.run = [options](Call& call) { return validate_result(*options, call); };
  return verb;
}

}  // namespace identikal
