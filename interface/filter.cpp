// The filter of ik_filter_open(): a model from a result or from text, and one sample after the other.
#include <algorithm>
#include <memory>
#include <new>
#include <string>

#include "interface/run.h"
#include "interface/sample_filter.h"
#include "jobs/track_settings.h"
#include <Eigen/Core>
#include <fmt/format.h>

#include "identify/model/model_file.h"
#include "identify/result/estimated_model.h"
#include "lib/base/error.h"

struct ik_filter {
  std::unique_ptr<identikal::SampleFilter> filter;
  std::string message;
};

namespace identikal {
namespace {

std::unique_ptr<SampleFilter> filter_of_model(const Model& model) {
  if (is_regression(model)) return regression_sample_filter(regression_settings(model));
  if (!is_linear(model)) {
    throw InputError({model.source, 0, 0}, "the model is not linear",
                     "a linear model, or a regression");
  }
  if (model.student) {
    throw InputError({model.source, 0, 0}, "the measurement noise is Student's t",
                     "normal noise: no kind: student under noise");
  }
  return kalman_sample_filter(model);
}

std::unique_ptr<SampleFilter> filter_of_text(const char* model_yaml) {
  const Model model = parse_model_file(model_yaml, model_name_in_memory());
  // A result has the recording's period.
  if (is_linear(model) && !(model.time.step > 0.0)) {
    throw InputError({model.source, 0, 0}, "the sampling period is not known",
                     "time: {step: 0.1 s}");
  }
  return filter_of_model(model);
}

// What `track` ran over its recording, from the start; of other verbs the model that they found.
std::unique_ptr<SampleFilter> filter_of_result(const ik_result& result) {
  if (const auto& track = result.outcome.track) {
    if (track->regression) return regression_sample_filter(*track->regression);
    return noise_sample_filter(track->model, track->noise.value());
  }
  if (!result.outcome.json.exists()) {
    throw InputError(
        {},
        fmt::format("the result is of '{}' and holds no model (code {})", result.verb, result.code),
        "one of tune, track, shape or fit with code 0, 1, 3 or 4");
  }
  Inputs inputs;
  inputs.keep_result(result_name_in_memory(0), result.outcome.json.text(), "");
  const StoredResult stored = inputs.result(result_name_in_memory(0));
  const Model model = estimated_model(stored.estimate, stored.path);
  if (!model.recordings.empty()) {
    throw InputError({}, "parameters with values of their own in each recording",
                     "a model whose numbers hold for the samples to come");
  }
  return filter_of_model(model);
}

std::unique_ptr<SampleFilter> opened_filter(const ik_result* result, const char* model_yaml) {
  if ((result == nullptr) == (model_yaml == nullptr)) {
    throw InputError({},
                     result == nullptr ? "neither a result nor a model" : "a result and a model",
                     "one of the two");
  }
  return result != nullptr ? filter_of_result(*result) : filter_of_text(model_yaml);
}

void copy(const Eigen::VectorXd& from, double* to) {
  if (to != nullptr) Eigen::Map<Eigen::VectorXd>(to, from.size()) = from;
}

size_t size_of(const ik_filter* filter, Eigen::Index SampleFilter::*count) {
  if (filter == nullptr || filter->filter == nullptr) return 0;
  return static_cast<size_t>((*filter->filter).*count);
}

}  // namespace
}  // namespace identikal

using identikal::SampleFilter;

int ik_filter_open(const ik_result* result, const char* model_yaml, ik_filter** filter) {
  if (filter == nullptr) return 2;
  *filter = new (std::nothrow) ik_filter;
  if (*filter == nullptr) return 5;
  ik_result outcome;
  identikal::guarded(outcome, [&] {
    (*filter)->filter = identikal::opened_filter(result, model_yaml);
    outcome.code = 0;
  });
  (*filter)->message = outcome.message;
  return outcome.code;
}

int ik_filter_step(ik_filter* filter, const double* y, const double* u, double* state, double* sd,
                   double* innovation) {
  if (filter == nullptr || filter->filter == nullptr || y == nullptr) return 2;
  SampleFilter& of = *filter->filter;
  if (u == nullptr && of.inputs > 0) return 2;
  try {
    if (!of.step(y, u)) return 1;
  } catch (...) {  // no memory for the samples since a change
    return 5;
  }
  identikal::copy(of.state(), state);
  identikal::copy(of.sd(), sd);
  identikal::copy(of.innovation(), innovation);
  return 0;
}

size_t ik_filter_states(const ik_filter* filter) {
  return identikal::size_of(filter, &SampleFilter::states);
}

size_t ik_filter_inputs(const ik_filter* filter) {
  return identikal::size_of(filter, &SampleFilter::inputs);
}

size_t ik_filter_outputs(const ik_filter* filter) {
  return identikal::size_of(filter, &SampleFilter::outputs);
}

size_t ik_filter_parameters(const ik_filter* filter, double* value, double* sd) {
  if (filter == nullptr || filter->filter == nullptr) return 0;
  const SampleFilter& of = *filter->filter;
  identikal::copy(of.parameter_values(), value);
  identikal::copy(of.parameter_sd(), sd);
  return of.parameters.size();
}

const char* ik_filter_parameter_name(const ik_filter* filter, size_t index) {
  if (filter == nullptr || filter->filter == nullptr) return "";
  const auto& names = filter->filter->parameters;
  return index < names.size() ? names[index].c_str() : "";
}

const char* ik_filter_message(const ik_filter* filter) {
  return filter == nullptr ? "there is no filter" : filter->message.c_str();
}

void ik_filter_free(ik_filter* filter) { delete filter; }
