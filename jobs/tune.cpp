// tune: which Q and R has the filter that these recordings ask for?
#include <algorithm>
#include <memory>

#include "jobs/digest_inputs.h"
#include "jobs/filter_estimation.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/filter/pictures.h"
#include "identify/model/heavy_tails.h"
#include "identify/model/model_file.h"
#include "identify/noise/als.h"
#include "identify/noise/auto.h"
#include "identify/noise/bayes.h"
#include "identify/noise/curved_motion.h"
#include "identify/noise/expected_errors.h"
#include "identify/noise/extend.h"
#include "identify/noise/reference_tuning.h"
#include "identify/result/file_digest.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

const char* const kAutomatic = "automatic";
const char* const kLikelihood = "likelihood";
const char* const kEstimates = "estimates";
const char* const kAsInFile = "as-in-file";
const char* const kStudent = "student";

// How the likelihood is evaluated: as --evaluation says it today, and as --path said it.
struct Evaluation {
  std::string name, old_name;
  EvaluationMethod method;
};

const std::vector<Evaluation>& evaluations() {
  static const std::vector<Evaluation> all = {
      {kAutomatic, "automatic", EvaluationMethod::automatic},
      {"time-varying", "direct", EvaluationMethod::time_varying},
      {"steady-state", "steady", EvaluationMethod::steady_state},
      {"autocovariances", "compressed", EvaluationMethod::autocovariances}};
  return all;
}

struct TuneOptions {
  ModelOptions model;
  RecordingOptions recordings;
  ResultOptions result;
  SearchOptions search;
  std::string method = "ml", evaluation = kAutomatic, purpose = kLikelihood, noise = kAsInFile;
  bool reject_outliers = false;
  std::int64_t lags = 0, draws = 0, seconds = 0;
  bool iterate = false, min_rank = false, full_matrix = false, extend = false, no_profiles = false;

  bool is_als() const { return method == "als" || method == "als-weighted"; }
};

NoiseEstimate by_autocovariances(const TuneOptions& given, const Model& model,
                                 const std::vector<Dataset>& recordings, const Run&) {
  NoiseAlsOptions options;
  options.weighted = given.method == "als-weighted";
  options.lags = given.lags;
  options.iterate = given.iterate;
  options.full_matrix = given.full_matrix;
  options.min_rank = given.min_rank;
  return tune_als(model, recordings, options);
}

NoiseEstimate by_posterior(const TuneOptions& given, const Model& model,
                           const std::vector<Dataset>& recordings, const Run& run) {
  NoiseBayesOptions options;
  if (given.draws > 0) options.draws = given.draws;
  if (given.seconds > 0) options.max_seconds = static_cast<double>(given.seconds);
  options.seed = given.search.seed_number();
  options.progress = [&](double share) {
    return report_progress(run.call,
                           fmt::format("from prior to posterior: {:.0f} %", 100.0 * share), share);
  };
  return tune_bayes(model, recordings, options);
}

NoiseMlOptions ml_options(const TuneOptions& given, const Run& run) {
  NoiseMlOptions options = likelihood_options(given.search, run);
  options.profiles = !given.no_profiles;
  for (const Evaluation& each : evaluations()) {
    if (given.evaluation == each.name) options.evaluation = each.method;
  }
  return options;
}

NoiseEstimate by_likelihood(const TuneOptions& given, const Model& model,
                            const std::vector<Dataset>& recordings, const Run& run) {
  return tune_ml(model, recordings, ml_options(given, run));
}

NoiseEstimate by_both(const TuneOptions& given, const Model& model,
                      const std::vector<Dataset>& recordings, const Run& run) {
  return tune_auto(model, recordings, ml_options(given, run));
}

NoiseEstimate by_references(const TuneOptions& given, const Model& model,
                            const std::vector<Dataset>& recordings, const Run& run) {
  ReferenceTuningOptions options;
  options.starts = static_cast<int>(given.search.starts);
  options.seed = given.search.seed_number();
  const int starts = given.search.number_of_starts();
  options.progress = [&](int start, int iteration, double criterion) {
    const std::string what = fmt::format("start {} of {}, iteration {}, criterion {:.6f}", start,
                                         starts, iteration, criterion);
    return report_progress(run.call, what, static_cast<double>(start - 1) / starts, -criterion);
  };
  return tune_to_references(model, recordings, options);
}

struct Method {
  std::string name, what;
  bool linear_only;
  NoiseEstimate (*run)(const TuneOptions& given, const Model& model,
                       const std::vector<Dataset>& recordings, const Run& run);
};

// What --method may be: help and dispatch follow.
const std::vector<Method>& methods() {
  static const std::vector<Method> all = {
      {"ml", "maximum likelihood", false, by_likelihood},
      {"als", "autocovariance least squares", true, by_autocovariances},
      {"als-weighted", "the same, weighted by its covariance", true, by_autocovariances},
      {"auto", "ml from the start that als-weighted finds, and both compared", true, by_both},
      {"bayes", "posterior", false, by_posterior}};
  return all;
}

const Method& method_of(const TuneOptions& options) {
  return *std::find_if(methods().begin(), methods().end(),
                       [&](const Method& method) { return method.name == options.method; });
}

void check_method(const TuneOptions& options, const Model& model, const Call& call) {
  if (method_of(options).linear_only) require_linear(model, "tune --method " + options.method);
  const bool als = options.is_als(), bayes = options.method == "bayes";
  const bool chosen = options.evaluation != kAutomatic;
  struct Case {
    bool given, applies;
    const char *option, *expected;
  };
  const bool estimates = options.purpose == kEstimates;
  if (estimates && options.method != "ml") {
    throw InputError({},
                     fmt::format("--for estimates does not apply to --method {}", options.method),
                     "no --method: the references take the place of the likelihood");
  }
  for (const Case& each :
       {Case{options.lags > 0, als, "--lags", "--method als or als-weighted"},
        Case{options.iterate, als, "--iterate", "--method als or als-weighted"},
        Case{options.min_rank, als, "--min-rank", "--method als or als-weighted"},
        Case{options.draws > 0, bayes, "--draws", "--method bayes"},
        Case{options.seconds > 0, !als || call.unattended, "--time-limit",
             "--method ml, auto or bayes"},
        Case{options.search.seed >= 0, !als, "--seed", "--method ml, auto or bayes"},
        Case{options.search.starts > 0, !als && !bayes, "--starts", "--method ml or auto"},
        Case{options.search.iterations > 0, !als && !bayes && !estimates, "--iterations",
             "--method ml or auto"},
        Case{options.search.threads > 0, !als && !bayes && !estimates, "--threads",
             "--method ml or auto"},
        Case{options.no_profiles, !als && !bayes && !estimates, "--no-profiles",
             "--method ml or auto"},
        Case{chosen, !als && !bayes && !estimates, "--evaluation", "--method ml or auto"}}) {
    if (!each.given || each.applies) continue;
    throw InputError({},
                     fmt::format("{} does not apply to {}", each.option,
                                 estimates ? "--for estimates" : "--method " + options.method),
                     (estimates ? "no --for estimates, and " : "") + std::string(each.expected));
  }
  if (is_formula_model(model) && chosen) {
    throw InputError({}, "--evaluation does not apply to this model", "a linear model",
                     "the likelihood of a nonlinear one is evaluated in one way");
  }
  if (options.full_matrix && options.method != "als") {
    throw InputError({}, "--full-matrix does not apply to --method " + options.method,
                     "--method als: it is a choice of weights, and als-weighted has its own");
  }
}

constexpr const char* kExtendedModel = "extended.yaml";

void refuse_beside_extensions(const TuneOptions& options) {
  for (const auto& [given, name] : {std::pair{options.method != "ml", "--method"},
                                    std::pair{options.purpose == kEstimates, "--for estimates"},
                                    std::pair{options.reject_outliers, "--reject-outliers"},
                                    std::pair{!options.search.hold_out.empty(), "--hold-out"},
                                    std::pair{!options.model.settings.empty(), "--set"},
                                    std::pair{!options.model.filter.empty(), "--filter"}}) {
    if (!given) continue;
    throw InputError({}, fmt::format("{} does not apply with --extend", name),
                     "one of the two: extensions of the model file, as it is, are compared by "
                     "likelihood on the last 30 % of each recording");
  }
}

Outcome tune_further(const TuneOptions& options, const Run& run, Model model) {
  refuse_beside_extensions(options);
  const Recordings recordings =
      load_recordings(options.recordings, model, run.verb, run.call.inputs);
  take_period(model, recordings.data.front());
  ExtendOptions of_search;
  of_search.search = ml_options(options, run);
  of_search.progress = [&run](const std::string& what) {
    return report_progress(run.call, "trying " + what);
  };
  const YamlNode root = written_out(run);
  ExtendResult result = tune_extended(root, model, recordings.data, of_search);
  const auto estimate = std::make_shared<NoiseEstimate>(std::move(result.estimate));
  std::vector<ResultFile> files;
  KeptResult out = kept(estimate);
  if (!result.text.empty()) {
    model = parse_model_file(result.text, kExtendedModel);
    files.push_back({kExtendedModel, result.text});
    out.take({kExtendedModel, sha256_of_text(result.text), result.text, {}});
  }
  if (run.wants_pictures()) picture_filter(model, recordings.data, *estimate);
  return finish(run, recordings, std::move(out), files);
}

constexpr const char* kStudentModel = "student.yaml";

void refuse_beside_student(const TuneOptions& options) {
  for (const auto& [given, name] : {std::pair{options.method != "ml", "--method"},
                                    std::pair{options.purpose == kEstimates, "--for estimates"},
                                    std::pair{options.reject_outliers, "--reject-outliers"},
                                    std::pair{options.evaluation != kAutomatic, "--evaluation"},
                                    std::pair{!options.search.hold_out.empty(), "--hold-out"},
                                    std::pair{options.extend, "--extend"}}) {
    if (!given) continue;
    throw InputError({}, fmt::format("{} does not apply to Student's t", name),
                     "one of the two: it is fitted by maximum likelihood, and compared with normal "
                     "noise on the last 30 % of each recording");
  }
}

// With the model file that says so: what reads the result needs it.
Outcome tune_student_noise(const TuneOptions& options, const Run& run) {
  const std::string& path = options.model.file;
  const YamlNode root = with_student_noise(run.call.inputs.model_tree(path));
  const std::string text = model_file_text(root);
  Model model = model_of(root, path);
  for (const std::string& assignment : options.model.settings) set_parameter(model, assignment);
  const Recordings recordings =
      load_recordings(options.recordings, model, run.verb, run.call.inputs);
  take_period(model, recordings.data.front());
  const auto estimate =
      std::make_shared<NoiseEstimate>(tune_ml(model, recordings.data, ml_options(options, run)));
  KeptResult out = kept(estimate);
  out.take({kStudentModel, sha256_of_text(text), text, {}});
  if (run.wants_pictures()) picture_filter(model, recordings.data, *estimate);
  return finish(run, recordings, std::move(out), {{kStudentModel, text}});
}

void refuse_beside_own_parameters(const TuneOptions& options, const Model& model) {
  for (const auto& [given, what] :
       {std::pair{options.noise == kStudent || model.student.has_value(), "Student's t"},
        std::pair{options.purpose == kEstimates, "--for estimates"},
        std::pair{options.extend, "--extend"}}) {
    if (!given) continue;
    throw InputError(
        {model.source, 0, 0},
        fmt::format("{} and parameters with values of their own in each recording", what),
        "one of the two");
  }
}

// What the recordings' digests have kept of them is all that maximum likelihood asks.
Outcome tune_digests(const TuneOptions& options, const Run& run, Model model) {
  refuse_beside_digests({{options.method != "ml", "--method"},
                         {options.purpose == kEstimates, "--for estimates"},
                         {options.reject_outliers, "--reject-outliers"},
                         {options.evaluation != kAutomatic, "--evaluation"},
                         {!options.search.hold_out.empty(), "--hold-out"},
                         {!options.recordings.range.empty(), "--range"},
                         {options.noise != kAsInFile, "--noise"},
                         {!options.result.page.empty(), "--report"},
                         {options.extend, "--extend"}});
  const LoadedDigests loaded = load_digests(options.recordings.files, model, run.call.inputs);
  const auto estimate = std::make_shared<NoiseEstimate>(
      tune_ml_digests(model, loaded.digests, ml_options(options, run)));
  return finish(run, loaded.recordings, kept(estimate));
}

// Of the model file as it is, and where the likelihood chose.
bool weighs_further_parts(const TuneOptions& options, const Model& model) {
  return options.method == "ml" && !options.reject_outliers && options.model.filter.empty() &&
         takes_further_parts(model);
}

void judge_by_further_parts(const TuneOptions& options, const Run& run, const Model& model,
                            const std::vector<Dataset>& recordings, NoiseEstimate& out) {
  if (!innovations_contradict(out) && !may_lack_a_curve(model, out)) return;
  const YamlNode root = written_out(run);
  ExpectedErrorsOptions further;
  further.threads = static_cast<int>(options.search.threads);
  further.progress = told_of_parts(run);
  judge_by_expected_errors(root, model, recordings, out, further);
  judge_by_curves(root, model, recordings, out, further.progress);
}

Outcome tune(const TuneOptions& options, Call& call) {
  Run run{"tune", call, options.model.file, {}, options.result};
  Model model = load_model(options.model, run.verb, call.inputs);
  require_filter(model, run.verb);
  check_method(options, model, call);
  if (options.is_als()) {
    if (call.unattended) call.unattended(options.seconds);
  } else if (options.method != "bayes") {
    limit_time(call, options.seconds);
  }
  if (are_digests(options.recordings.files)) {
    run.options.has_page = false;
    return tune_digests(options, run, std::move(model));
  }
  const bool becomes_student = options.noise == kStudent && !model.student;
  if (!model.recordings.empty()) refuse_beside_own_parameters(options, model);
  if (becomes_student || model.student) refuse_beside_student(options);
  if (becomes_student) return tune_student_noise(options, run);
  if (options.extend) return tune_further(options, run, std::move(model));
  const auto estimator = [&](const Model& of, const std::vector<Dataset>& recordings) {
    if (options.purpose == kEstimates) return by_references(options, of, recordings, run);
    NoiseEstimate out = method_of(options).run(options, of, recordings, run);
    if (weighs_further_parts(options, of))
      judge_by_further_parts(options, run, of, recordings, out);
    return out;
  };
  return estimate_filter(run, std::move(model), options.recordings, options.search.hold_out,
                         options.reject_outliers, estimator);
}

void add_evaluation(Verb& verb, std::string& evaluation) {
  std::vector<std::string> names;
  std::vector<std::pair<std::string, std::string>> old_names;
  for (const Evaluation& each : evaluations()) {
    names.push_back(each.name);
    old_names.emplace_back(each.old_name, each.name);
  }
  add_choice(verb, "--evaluation", evaluation, names,
             "Choose what evaluates the likelihood: the time-varying or the steady-state filter, "
             "or sample autocovariances.");
  add_old_choice(verb, "--path", "--evaluation", evaluation, old_names);
}

}  // namespace

Verb tune_verb() {
  const auto options = std::make_shared<TuneOptions>();
  Verb verb{"tune", "Estimate the noise covariances Q and R of a Kalman filter."};
  add_model(verb, options->model);
  add_recordings(verb, options->recordings);
  add_settings(verb, options->model);
  add_range(verb, options->recordings.range);
  add_result_with_page(verb, options->result);
  add_filter_choice(verb, options->model);
  add_search(verb, options->search);
  std::vector<std::string> names;
  std::string texts;
  for (const Method& method : methods()) {
    names.push_back(method.name);
    texts += (texts.empty() ? "" : "; ") + method.name + ": " + method.what;
  }
  add_choice(verb, "--method", options->method, names, "Choose the estimator. " + texts + ".");
  add_choice(verb, "--for", options->purpose, {kLikelihood, kEstimates},
             "Choose what the noise is for: to make the recordings likely, or to bring the states "
             "closest to the references that the model file names.");
  add_choice(verb, "--noise", options->noise, {kAsInFile, kStudent},
             "Choose the distribution of the measurement noise: student is Student's t with 4 "
             "degrees of freedom, compared with normal noise on rows held out; -o writes that "
             "model as student.yaml.");
  add_flag(verb, "--extend", options->extend,
           "Try biases, scales, delays and lasting errors of the sensors, further process noise, "
           "white or coloured, damping, friction and curves of the motion, and noise that changes "
           "where the innovations' size does, on rows held out, and adopt what predicts better; -o "
           "writes that model as extended.yaml.");
  add_number(verb, "--lags", options->lags, 0, 1000,
             "als: Use this many autocovariances; 0 stands for as many as are informative.");
  add_number(verb, "--draws", options->draws, 10, 1000000,
             "bayes: Number of draws from the posterior.", "2000");
  add_number(verb, "--time-limit", options->seconds, 1, 1000000,
             "Stop with the best so far after this many seconds; als and bayes: without a result; "
             "bayes after 300 where it is not given.",
             "none");
  add_flag(verb, "--no-profiles", options->no_profiles,
           "Leave out the intervals of likelihood profiles, which take half of the time "
           "of a short recording.");
  add_flag(verb, "--reject-outliers", options->reject_outliers,
           "Find samples that are outliers and leave them out.");
  add_old_flag(verb, "--robust", "--reject-outliers", options->reject_outliers);
  add_flag(verb, "--iterate", options->iterate, "als: Repeat with the gain of the estimate.");
  add_old_flag(verb, "--regain", "--iterate", options->iterate);
  add_flag(verb, "--min-rank", options->min_rank,
           "als: Estimate the Q of minimum rank that the data allow.");
  add_old_flag(verb, "--sources", "--min-rank", options->min_rank);
  add_flag(verb, "--full-matrix", options->full_matrix,
           "als: Fit the whole matrix of autocovariances instead of one column.");
  add_evaluation(verb, options->evaluation);
  verb.run = [options](Call& call) { return tune(*options, call); };
  return verb;
}

}  // namespace identikal
