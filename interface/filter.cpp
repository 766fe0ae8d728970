// The filter of ik_filter_open(): a linear model from a result or from text, and one sample after the other.
#include <algorithm>
#include <new>
#include <optional>
#include <string>

#include "interface/run.h"
#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "identify/result/estimated_model.h"
#include "lib/base/error.h"
#include "lib/filter/online_filter.h"

struct ik_filter {
  std::optional<identikal::OnlineFilter> online;
  Eigen::VectorXd
      inputs;  ///< of the sample at hand; behind the caller's 1 where the model has an offset
  Eigen::Index given = 0;  ///< of them, the caller's
  std::string message;
};

namespace identikal {
namespace {

Model model_of_filter(const ik_result* result, const char* model_yaml) {
  if ((result == nullptr) == (model_yaml == nullptr)) {
    throw InputError({},
                     result == nullptr ? "neither a result nor a model" : "a result and a model",
                     "one of the two");
  }
  if (model_yaml != nullptr) return parse_model_file(model_yaml, model_name_in_memory());
  Inputs inputs;
  inputs.keep_result(result_name_in_memory(0), result->outcome.json, "");
  const StoredResult stored = inputs.result(result_name_in_memory(0));
  return estimated_model(stored.estimate, stored.path);
}

void open(const ik_result* result, const char* model_yaml, ik_filter& filter) {
  const Model model = model_of_filter(result, model_yaml);
  if (!is_linear(model)) {
    throw InputError({model.source, 0, 0}, "the model is not linear", "a linear model");
  }
  const LinearModel& linear = as_linear(model);
  // A result has the recording's period.
  if (result == nullptr && !(model.time.step > 0.0)) {
    throw InputError({model.source, 0, 0}, "the sampling period is not known",
                     "time: {step: 0.1 s}");
  }
  if (linear.hold == InputHold::linear) {
    throw InputError({model.source, 0, 0},
                     "inputs are straight between samples, which takes the next",
                     "time: {inputs: zoh}");
  }
  filter.online = start_online_filter(instantiate(linear, model.parameters), linear.initial);
  filter.inputs = Eigen::VectorXd::Ones(filter.online->model.inputs());
  filter.given = filter.inputs.size() - (linear.offset ? 1 : 0);
}

}  // namespace
}  // namespace identikal

int ik_filter_open(const ik_result* result, const char* model_yaml, ik_filter** filter) {
  if (filter == nullptr) return 2;
  *filter = new (std::nothrow) ik_filter;
  if (*filter == nullptr) return 5;
  ik_result outcome;
  identikal::guarded(outcome, [&] {
    identikal::open(result, model_yaml, **filter);
    outcome.code = 0;
  });
  (*filter)->message = outcome.message;
  return outcome.code;
}

int ik_filter_step(ik_filter* filter, const double* y, const double* u, double* state, double* sd,
                   double* innovation) {
  if (filter == nullptr || !filter->online || y == nullptr) return 2;
  identikal::OnlineFilter& online = *filter->online;
  if (u == nullptr && filter->given > 0) return 2;
  std::copy_n(u, filter->given, filter->inputs.data());
  const Eigen::Map<const Eigen::VectorXd> outputs(y, online.model.outputs());
  if (!step(online, outputs, filter->inputs)) return 1;
  const auto copy = [](const Eigen::VectorXd& from, double* to) {
    if (to != nullptr) Eigen::Map<Eigen::VectorXd>(to, from.size()) = from;
  };
  copy(online.state, state);
  copy(online.state_sd, sd);
  copy(online.innovation, innovation);
  return 0;
}

size_t ik_filter_states(const ik_filter* filter) {
  return filter != nullptr && filter->online ? static_cast<size_t>(filter->online->model.states())
                                             : 0;
}

size_t ik_filter_inputs(const ik_filter* filter) {
  return filter != nullptr && filter->online ? static_cast<size_t>(filter->online->model.inputs())
                                             : 0;
}

size_t ik_filter_outputs(const ik_filter* filter) {
  return filter != nullptr && filter->online ? static_cast<size_t>(filter->online->model.outputs())
                                             : 0;
}

const char* ik_filter_message(const ik_filter* filter) {
  return filter == nullptr ? "there is no filter" : filter->message.c_str();
}

void ik_filter_free(ik_filter* filter) { delete filter; }
