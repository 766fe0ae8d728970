#include "interface/sample_filter.h"

#include <algorithm>

#include "identify/estimate/parameter_table.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/filter/online_filter.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using Sample = Eigen::Map<const VectorXd>;

void refuse_straight_inputs(const Model& model) {
  if (as_linear(model).hold != InputHold::linear) return;
  throw InputError({model.source, 0, 0},
                   "inputs are straight between samples, which takes the next",
                   "time: {inputs: zoh}");
}

// Inputs of an instantiated model: behind the caller's a 1 where the model has an offset.
class ModelInputs {
 public:
  ModelInputs(const LinearModel& model, Index inputs)
      : inputs_(VectorXd::Ones(inputs)), given_(inputs - (model.offset ? 1 : 0)) {}
  Index given() const { return given_; }
  const VectorXd& take(const double* u) {
    std::copy_n(u, given_, inputs_.data());
    return inputs_;
  }

 private:
  VectorXd inputs_;
  Index given_;
};

class KalmanSampleFilter : public SampleFilter {
 public:
  explicit KalmanSampleFilter(const Model& model)
      : online_(start_online_filter(instantiate(as_linear(model), model.parameters),
                                    as_linear(model).initial)),
        inputs_(as_linear(model), online_.model.inputs()) {
    states = online_.model.states();
    outputs = online_.model.outputs();
    inputs = inputs_.given();
  }
  bool step(const double* y, const double* u) override {
    return identikal::step(online_, Sample(y, outputs), inputs_.take(u));
  }
  const VectorXd& state() const override { return online_.state; }
  const VectorXd& sd() const override { return online_.state_sd; }
  const VectorXd& innovation() const override { return online_.innovation; }

 private:
  OnlineFilter online_;
  ModelInputs inputs_;
};

class RegressionSampleFilter : public SampleFilter {
 public:
  explicit RegressionSampleFilter(const RegressionSettings& settings)
      : online_(start_online_regression(settings)), innovation_(VectorXd::Constant(1, kNaN)) {
    states = online_.coefficients.size();
    outputs = 1;
    inputs = online_.inputs.size();
  }
  bool step(const double* y, const double* u) override {
    if (!identikal::step(online_, *y, Sample(u, inputs))) return false;
    innovation_[0] = online_.innovation;
    return true;
  }
  const VectorXd& state() const override { return online_.coefficients; }
  const VectorXd& sd() const override { return online_.sd; }
  const VectorXd& innovation() const override { return innovation_; }

 private:
  OnlineRegression online_;
  VectorXd innovation_;
};

class NoiseSampleFilter : public SampleFilter {
 public:
  NoiseSampleFilter(const Model& model, const NoiseTrackOptions& options)
      : tracker_(model, options), inputs_(as_linear(model), tracker_.model().inputs()) {
    states = tracker_.model().states();
    outputs = tracker_.model().outputs();
    inputs = inputs_.given();
    const ReportedEntries entries = reported_entries(model.parameters);
    for (std::size_t e = 0; e < entries.names.size(); ++e) {
      if (!model.parameters[entries.parameter[e]].fixed) parameters.push_back(entries.names[e]);
    }
  }
  bool step(const double* y, const double* u) override {
    return tracker_.step(Sample(y, outputs), inputs_.take(u));
  }
  const VectorXd& state() const override { return tracker_.now().state; }
  const VectorXd& sd() const override { return tracker_.now().state_sd; }
  const VectorXd& innovation() const override { return tracker_.now().e; }
  const VectorXd& parameter_values() const override { return tracker_.now().mean; }
  const VectorXd& parameter_sd() const override { return tracker_.now().sd; }

 private:
  NoiseTracker tracker_;
  ModelInputs inputs_;
};

}  // namespace

std::unique_ptr<SampleFilter> kalman_sample_filter(const Model& model) {
  refuse_straight_inputs(model);
  return std::make_unique<KalmanSampleFilter>(model);
}

std::unique_ptr<SampleFilter> regression_sample_filter(const RegressionSettings& settings) {
  return std::make_unique<RegressionSampleFilter>(settings);
}

std::unique_ptr<SampleFilter> noise_sample_filter(const Model& model,
                                                  const NoiseTrackOptions& options) {
  refuse_straight_inputs(model);
  return std::make_unique<NoiseSampleFilter>(model, options);
}

}  // namespace identikal
