// What stands in result.json as a whole, and where does each part come from?
#pragma once

#include <string>
#include <vector>

#include "identify/result/internal/fields.h"
#include "identify/result/schema.h"
#include "lib/version.h"

namespace identikal {

/// A result with what its file says besides.
struct WholeFile {
  Estimate& core;
  RecordingFit& fit;
  std::vector<TestResult>& tests;
  Noise& noise;
  std::string& tyre_curve;
  Section<SteadyFilter> filter;
  Section<ModelSource> model_file;
  Section<ExcessMeanSquareError> excess_mean_square_error;
  Section<Bound> bound;
  Section<Posterior> posterior;
  Section<TimeHistory> time_history;
  Section<Shaping> shaping;
  Section<RankSelection> minimum_rank;
  Section<VehicleSurvey> survey;
  Section<HandlingSheet> handling;
  Section<Forecast> forecast;
  Section<BlackBox> black_box;
  std::string version = IDENTIKAL_VERSION;  ///< of the program that writes it
  int exit = 0;
  double timing_s = kNone;
  int schema_version = kSchemaVersion;
};

/// For visitors that change nothing. One description serves them and those that fill a result, so
/// it asks for parts that may change. Where a job has no such part, an empty one is written.
template <class T>
T& part_or_empty(const T* part) {
  static const T empty{};
  return const_cast<T&>(part != nullptr ? *part : empty);
}

/// What is written of a result. It refers to the result.
inline WholeFile file_to_write(const ResultSections& r) {
  return {part_or_empty(r.core),       part_or_empty(r.fit),
          part_or_empty(r.tests),      part_or_empty(r.noise),
          part_or_empty(r.tyre_curve), {r.filter, nullptr},
          {r.model_file, nullptr},     {r.excess_mean_square_error, nullptr},
          {r.bound, nullptr},          {r.posterior, nullptr},
          {r.time_history, nullptr},   {r.shaping, nullptr},
          {r.minimum_rank, nullptr},   {r.survey, nullptr},
          {r.handling, nullptr},       {r.forecast, nullptr},
          {r.black_box, nullptr}};
}

/// Where a reader puts what it finds.
inline WholeFile file_to_read(StoredEstimate& e) {
  return {e,
          e,
          e.tests,
          e.noise,
          e.tyre_curve,
          {nullptr, &e.filter},
          {nullptr, &e.model_file},
          {nullptr, &e.excess_mean_square_error},
          {nullptr, &e.bound},
          {nullptr, &e.posterior},
          {nullptr, &e.time_history},
          {nullptr, &e.shaping},
          {nullptr, &e.minimum_rank},
          {nullptr, &e.survey},
          {nullptr, &e.handling},
          {nullptr, &e.forecast},
          {nullptr, &e.black_box}};
}

// Sections that say what the result is and what it rests on.
template <class Fields>
void describe_origin(Fields& fields, WholeFile& file) {
  Estimate& e = file.core;
  fields("schema_version", one_of(file.schema_version, {kSchemaVersion}), "version of this schema");
  fields("version", file.version, "version of the program");
  fields("verb",
         one_of(e.verb, {"tune", "track", "shape", "fit", "check", "bound", "info", "filter",
                         "compare", "validate", "handling", "forecast", "model"}),
         "verb that was run");
  fields("model", e.model_name, "name of the model");
  fields.group("status", "whether the result may be used", [&](auto& status) {
    status("code", e.status, "what may be done with the values");
    status("exit", one_of(file.exit, {0, 1, 3, 4}), "exit code of the program");
    status("message", Present<std::string>{e.message}, "the status in a sentence");
  });
  fields("inputs", e.inputs, "data files");
  fields("model_file", file.model_file, "null where there is none, or several");
}

// Sections that say what was estimated.
template <class Fields>
void describe_estimates(Fields& fields, WholeFile& file) {
  Estimate& e = file.core;
  fields("parameters", e.parameters, "all parameters, known ones too");
  fields("covariance_kind", e.covariance_kind, "where se comes from, in words");
  fields("covariance_freedom", e.covariance_freedom,
         "degrees of freedom of the Student's t behind ci95; null: normal");
  fields.group("correlation", "correlation of the estimates", [&](auto& correlation) {
    correlation("names", e.correlation_names, "parameters of its rows and columns");
    correlation("matrix", e.correlation, "row by row");
  });
  fields.group("noise", "estimated or given noise, in SI", [&](auto& noise) {
    describe(noise, file.noise);
    noise("excess_mean_square_error", file.excess_mean_square_error,
          "null where no noise is estimated");
  });
  fields("filter", file.filter, "null but for linear models");
  fields("tyre_curve", ChoiceOrNull{file.tyre_curve, {"linear", "tanh", "fiala", "magic-formula"}},
         "null but for vehicles");
  fields("objective", e.objective, "the search");
}

// Sections that say how good the estimates are.
template <class Fields>
void describe_quality(Fields& fields, WholeFile& file) {
  fields.group("fit", "how far each output is explained", [&](auto& fit) {
    fit("one_step", ByChannel{file.fit.one_step}, "predicted from everything before");
    fit("simulation", ByChannel{file.fit.simulation}, "predicted without any later correction");
    fit("hold_out", ByChannel{file.fit.hold_out}, "simulation of data that the fit did not see");
    fit("hold_out_one_step", ByChannel{file.fit.hold_out_one_step}, "a filter's fit to them");
  });
  fields("driven", file.fit.driven, "of a vehicle: what 99 % of the rows lie between");
  fields("references", file.fit.references, "estimates against the model's references");
  fields("tests", file.tests, "tests of residuals or innovations");
  fields("identifiability", file.core.identifiability, "what the data determine");
}

// Sections that one job has, and all others leave out.
template <class Fields>
void describe_details(Fields& fields, WholeFile& file) {
  fields("bound", file.bound, "verb bound only");
  fields("posterior", file.posterior, "method bayes and verb track only");
  fields("time_history", file.time_history, "verb track only");
  fields("shaping", file.shaping, "verb shape only");
  fields("minimum_rank", file.minimum_rank, "tune --min-rank only");
  fields("survey", file.survey, "info --vehicle only");
  fields("handling", file.handling, "verb handling only");
  fields("forecast", file.forecast, "verb forecast only");
  fields("black_box", file.black_box, "verb model only");
}

/// Every section in the order of the file.
template <class Fields>
void describe(Fields& fields, WholeFile& file) {
  fields.is("Identikal result",
            "What identikal VERB --json prints and result.json holds. Numbers that do not exist "
            "are null. Deprecated keys are those of version 1, with the same values; version 3 "
            "will not have them (docs/file-formats.md).");
  describe_origin(fields, file);
  describe_estimates(fields, file);
  describe_quality(fields, file);
  describe_details(fields, file);
  fields("derived", file.core.derived, "quantities computed from the parameters");
  fields("curves", file.core.curves, "functions that parameters stand for");
  fields("warnings", Printed{file.core.findings}, "all findings but those that the status says");
  fields("notes", file.core.notes, "tables and remarks of the console, line by line");
  fields("timing_s", file.timing_s, "wall time of the job [s]");
}

}  // namespace identikal
