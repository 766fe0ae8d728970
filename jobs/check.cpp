// check: is this filter optimal on these recordings?
#include "identify/optimality/check.h"

#include <memory>
#include <utility>

#include "jobs/compare.h"
#include "jobs/digest_inputs.h"
#include "jobs/filter_estimation.h"
#include "jobs/verbs.h"

#include "identify/filter/pictures.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct CheckOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  bool compare = false;  // as it was typed before there was 'compare' for models
};

Outcome compare(const CheckOptions& given, Call& call) {
  if (!given.result.page.empty()) {
    throw InputError({}, "--report does not apply to a comparison", "'check' of one model");
  }
  CompareOptions options{given.model, given.recordings, given.result};
  options.recordings.files.insert(options.recordings.files.begin(), options.model.file);
  options.result.has_page = false;
  return compare_models(options, call);
}

Outcome check(const CheckOptions& options, Call& call) {
  if (options.compare) return compare(options, call);
  const Run run{"check", call, options.model.file, {}, options.result};
  Model model = load_model(options.model, run.verb, call.inputs);
  require_filter(model, run.verb);
  if (are_digests(options.recordings.files)) {
    refuse_beside_digests({{!options.recordings.range.empty(), "--range"},
                           {!options.result.page.empty(), "--report"}});
    const LoadedDigests loaded = load_digests(options.recordings.files, model, call.inputs);
    Run of_digests = run;
    of_digests.options.has_page = false;
    return finish(of_digests, loaded.recordings,
                  kept(std::make_shared<OptimalityReport>(check(model, loaded.digests))));
  }
  Recordings recordings = load_recordings(options.recordings, model, run.verb, call.inputs);
  take_period(model, recordings.data.front());
  model = joint_model(std::move(model), recordings);
  model = going_on_from_rows_before(std::move(model), options.recordings, recordings, call.inputs);
  const auto estimate = std::make_shared<OptimalityReport>(check(model, recordings.data));
  if (run.wants_pictures()) picture_filter(model, recordings.data, *estimate);
  return finish(run, recordings, kept(estimate));
}

}  // namespace

Verb check_verb() {
  const auto options = std::make_shared<CheckOptions>();
  Verb verb{"check", "Test whether a filter is optimal; exit status 1 when it is not."};
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result_with_page(verb, options->result);
  add_filter_choice(verb, options->model);
  add_old_flag(verb, "--compare", "the verb 'compare'", options->compare);
  verb.run = [options](Call& call) { return check(*options, call); };
  return verb;
}

}  // namespace identikal
