// handling: which figures do engineers know this car's handling by, from its log and from its model?
#include <algorithm>
#include <memory>

#include "jobs/quantity.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <fmt/format.h>

#include "identify/handling/sheet.h"
#include "identify/result/estimated_model.h"
#include "identify/result/file.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

struct SheetOptions {
  RecordingOptions files;  // a result or a model file, then recordings
  std::string speed;
  ResultOptions result;
};

constexpr const char* kUsage = "identikal handling RESULT [DATA...], or MODEL [DATA...]";

void require_fit_of_vehicle(const StoredResult& result) {
  const StoredEstimate& estimate = result.estimate;
  if (estimate.verb == "fit" && !estimate.tyre_curve.empty()) return;
  throw InputError({result.path, 0, 0},
                   estimate.verb == "fit" ? std::string("a result of fit about a filter")
                                          : fmt::format("a result of '{}'", estimate.verb),
                   "a result of fit about a vehicle (model: single-track)");
}

double model_speed(const std::string& text) {
  if (text.empty()) return kNone;
  const double speed = quantity("--speed", text, "km/h");
  if (!(speed > 0.0)) {
    throw InputError({}, fmt::format("--speed '{}' is not above 0", text), "e.g. '80 km/h'");
  }
  return speed;
}

// Values that were found doubtful are no better on a sheet.
void take_over_doubts(const StoredResult& result, Estimate& out) {
  const Estimate& origin = result.estimate;
  if (origin.status == Status::ok) return;
  out.findings.push_back(make_finding(
      FindingCode::doubtful_result, {},
      fmt::format("{} is itself {}: {}", result.path, to_string(origin.status), origin.message),
      ""));
}

void report_sheet(const KnownVehicle& car, const Model& model, const Recordings& recordings,
                  const HandlingOptions& options, HandlingReport& out) {
  out.model_name = model.name;
  out.verb = out.objective.method = "handling";
  out.handling = handling_sheet(car, model, recordings.data, options);
  append(out.findings, check_log(car, model, recordings.data));
  conclude(out,
           recordings.data.empty() ? "figures of the model" : "figures of the log and the model",
           Basis::tests);
}

Outcome handling(const SheetOptions& given, Call& call) {
  RecordingOptions data = given.files;
  const std::string first = data.files.front();
  data.files.erase(data.files.begin());
  HandlingOptions options;
  options.speed = model_speed(given.speed);
  const auto report = std::make_shared<HandlingReport>();
  const auto recorded = [&](const Model& model) {
    if (!is_vehicle(model)) {
      throw InputError({model.source, 0, 0}, "a model that is no vehicle", "model: single-track");
    }
    if (data.files.empty() && !data.range.empty()) {
      throw InputError({}, "--range does not apply without a recording", kUsage);
    }
    return load_recordings(data, model, "handling", call.inputs);
  };
  if (call.inputs.is_model(first)) {
    const Run run{"handling", call, first, {}, given.result};
    const Model model = call.inputs.model(first);
    const Recordings recordings = recorded(model);
    report_sheet(known_vehicle(model), model, recordings, options, *report);
    return finish(run, recordings, kept(report));
  }
  if (first.ends_with(".csv")) {
    throw InputError({first, 0, 0}, "a recording where a result or a model file is expected",
                     kUsage);
  }
  const StoredResult result = call.inputs.result(first);
  require_fit_of_vehicle(result);
  const Run run{"handling", call, "", files_of(result, first), given.result};
  const Model model = estimated_model(result.estimate, result.path);
  const Recordings recordings = recorded(model);
  take_over_doubts(result, *report);
  report_sheet(known_vehicle(model, result.estimate), model, recordings, options, *report);
  KeptResult out = kept(report);
  if (result.estimate.model_file) out.take(*result.estimate.model_file);
  return finish(run, recordings, std::move(out));
}

}  // namespace

Verb handling_verb() {
  const auto options = std::make_shared<SheetOptions>();
  Verb verb{"handling",
            "Put the handling figures of a vehicle on one sheet, from its log and from its model: "
            "ISO 4138, ISO 7401, ISO 3888."};
  add_arguments(verb, "FILES", options->files.files,
                "Result of a vehicle's fit (result.json or its folder) or model file (YAML), then "
                "recordings (CSV).");
  add_text(verb, "--speed", options->speed,
           "Give the response to steering at this speed, e.g. '100 km/h'.",
           "that of the recordings; without one 80 km/h");
  add_range(verb, options->files.range);
  add_result_with_page(verb, options->result);
  verb.run = [options](Call& call) { return handling(*options, call); };
  return verb;
}

}  // namespace identikal
