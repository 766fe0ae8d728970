#include "identify/filter/changing_recordings.h"

#include "identify/model/own_parameters.h"
#include "lib/filter/simulation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// R and S with every standard deviation of the measurement noise times its scale.
void scale_measurement_noise(const Eigen::Ref<const VectorXd>& scale, StateSpace& model) {
  model.R = (scale.asDiagonal() * model.R * scale.asDiagonal()).eval();
  if (model.S.size() > 0) model.S = (model.S * scale.asDiagonal()).eval();
}

// @param scale  Dataset::noise_scale
ModelAt model_at(SampledModel& sampled, const MatrixXd& scale) {
  return [&sampled, &scale](Index t, StateSpace& now, std::vector<StateSpace>* derivatives) {
    sampled.at(t, now, derivatives);
    if (scale.size() == 0) return;
    scale_measurement_noise(scale.col(t), now);
    if (derivatives == nullptr) return;
    for (StateSpace& each : *derivatives) scale_measurement_noise(scale.col(t), each);
  };
}

// One recording, at one set of values.
struct Prepared {
  SampledModel sampled;
  MatrixXd inputs, scale;
  ModelAt model_at_sample;

  Prepared(const Model& model, const ParameterSet& at, const Dataset& recording)
      : sampled(noise_model(model), recording.time, recording.u),
        inputs(model_inputs(noise_model(model), recording.u)),
        scale(recording.noise_scale),
        model_at_sample(model_at(sampled, scale)) {
    sampled.set_parameters(values_in(at, recording), false);
  }
  Prepared(const Prepared&) = delete;
  Prepared& operator=(const Prepared&) = delete;
};

}  // namespace

ChangingRecordings::ChangingRecordings(const Model& model, const std::vector<Dataset>& recordings)
    : model_(model), recordings_(recordings) {
  for (const Dataset& data : recordings) {
    sampled_.emplace_back(noise_model(model), data.time, data.u);
    inputs_.push_back(model_inputs(noise_model(model), data.u));
  }
}

const Likelihood& ChangingRecordings::evaluate(const ParameterSet& at, bool with_derivatives,
                                               MatrixXd* products) {
  const InitialState initial = noise_model(model_).initial;
  const Index k = with_derivatives ? free_entries(at).size() : 0;
  sum_.status = FilterStatus::ok;
  sum_.value = 0.0;
  sum_.gradient.setZero(k);
  sum_.information.setZero(k, k);
  if (products != nullptr) products->setZero(k, k);
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    sampled_[i].set_parameters(at, with_derivatives);
    const ModelAt model = model_at(sampled_[i], recordings_[i].noise_scale);
    const MatrixXd& y = recordings_[i].y;
    const bool scaled = recordings_[i].noise_scale.size() > 0;  // S too
    const Likelihood one = log_likelihood(model, initial, y, inputs_[i], with_derivatives,
                                          scaled || sampled_[i].motion_changes());
    sum_.status = one.status;
    if (one.status != FilterStatus::ok) return sum_;
    sum_.value += one.value;
    if (k == 0) continue;
    sum_.gradient += one.gradient;
    sum_.information += one.information;
    if (products != nullptr) *products += score_products(model, initial, y, inputs_[i]);
  }
  return sum_;
}

FilterStatus ChangingRecordings::watch(const ParameterSet& at, bool with_derivatives,
                                       std::size_t recording, const FilteredStateWatcher& see) {
  sampled_[recording].set_parameters(at, with_derivatives);
  const Dataset& data = recordings_[recording];
  return watch_filtered_states(model_at(sampled_[recording], data.noise_scale),
                               noise_model(model_).initial, data.y, inputs_[recording],
                               with_derivatives, see)
      .status;
}

FilterResult changing_filter(const Model& model, const ParameterSet& at, const Dataset& recording,
                             Keep keep) {
  const Prepared of(model, at, recording);
  return kalman_filter(of.model_at_sample, noise_model(model).initial, recording.y, of.inputs,
                       keep);
}

SmootherResult changing_smoother(const Model& model, const ParameterSet& at,
                                 const Dataset& recording, std::optional<Index> lag) {
  Prepared of(model, at, recording);
  const InitialState initial = noise_model(model).initial;
  return lag ? smooth_with_lag(of.model_at_sample, initial, recording.y, of.inputs, *lag,
                               SmootherKeep::deviations)
             : smooth(of.model_at_sample, initial, recording.y, of.inputs,
                      SmootherKeep::deviations);
}

SimulatedPath changing_path(const Model& model, const ParameterSet& at, const Dataset& recording,
                            Random& random) {
  const Prepared of(model, at, recording);
  return simulate_path(of.model_at_sample, noise_model(model).initial, recording.y, of.inputs,
                       random);
}

DisturbanceResult changing_disturbances(const Model& model, const ParameterSet& at,
                                        const Dataset& recording) {
  const Prepared of(model, at, recording);
  return smooth_disturbances(of.model_at_sample, noise_model(model).initial, recording.y,
                             of.inputs);
}

MatrixXd simulate_changing_outputs(const Model& model, const Dataset& recording, Random& random) {
  const Prepared of(model, model.parameters, recording);
  return simulate_outputs(of.model_at_sample, noise_model(model).initial, of.inputs,
                          recording.time.size(), random);
}

MatrixXd noise_free_changing_outputs(const Model& model, const ParameterSet& at,
                                     const Dataset& recording, VectorXd x) {
  Prepared of(model, at, recording);
  StateSpace now;
  MatrixXd out(noise_model(model).C.constant.rows(), recording.time.size());
  for (Index t = 0; t < out.cols(); ++t) {
    of.sampled.at(t, now, nullptr);
    out.col(t) = now.C * x + now.D * of.inputs.col(t);
    x = (now.A * x + now.B * of.inputs.col(t)).eval();
  }
  return out;
}

MatrixXd changing_transition(const Model& model, const ParameterSet& at, const Dataset& recording) {
  Prepared of(model, at, recording);
  StateSpace now;
  of.sampled.at(0, now, nullptr);
  MatrixXd out = MatrixXd::Identity(now.states(), now.states());
  for (Index t = 0; t + 1 < recording.time.size(); ++t) {
    of.sampled.at(t, now, nullptr);
    out = (now.A * out).eval();
  }
  return out;
}

}  // namespace identikal
