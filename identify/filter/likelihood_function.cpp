#include "identify/filter/likelihood_function.h"

#include <utility>

#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "lib/base/error.h"
#include "lib/model/parameter.h"

namespace identikal {

// The likelihood refers to the model and to the recordings, which therefore keep their places.
struct LikelihoodFunction::State {
  State(Model with, std::vector<Dataset> of)
      : model(std::move(with)), recordings(std::move(of)), likelihood(model, recordings) {
    const ReportedEntries entries = reported_entries(model.parameters);
    for (std::size_t i = 0; i < entries.names.size(); ++i) {
      if (!model.parameters[entries.parameter[i]].fixed) names.push_back(entries.names[i]);
    }
  }

  Model model;
  std::vector<Dataset> recordings;
  RecordingsLikelihood likelihood;
  std::vector<std::string> names;
};

namespace {

Model filter_model(const Model& model, const std::vector<Dataset>& recordings) {
  if (!has_filter(model)) {
    throw InputError({model.source, 0, 0}, "this model has no filter, and so no likelihood",
                     "matrices or formulas with noise");
  }
  Model out = checked(model, recordings);
  check_inputs(recordings);
  return out;
}

}  // namespace

LikelihoodFunction::LikelihoodFunction(const Model& model, std::vector<Dataset> recordings) {
  Model filter = filter_model(model, recordings);
  state_ = std::make_unique<State>(std::move(filter), std::move(recordings));
}
LikelihoodFunction::~LikelihoodFunction() = default;
LikelihoodFunction::LikelihoodFunction(LikelihoodFunction&&) noexcept = default;
LikelihoodFunction& LikelihoodFunction::operator=(LikelihoodFunction&&) noexcept = default;

const std::vector<std::string>& LikelihoodFunction::names() const { return state_->names; }

Eigen::VectorXd LikelihoodFunction::start() const { return free_entries(state_->model.parameters); }

LikelihoodValue LikelihoodFunction::operator()(const Eigen::VectorXd& p, bool derivatives) {
  const Likelihood* result =
      state_->likelihood.evaluate(with_entries(state_->model.parameters, p), derivatives);
  LikelihoodValue out;
  if (result == nullptr) return out;
  out.defined = true;
  out.log_likelihood = result->value;
  if (!derivatives) return out;
  out.gradient = result->gradient;
  out.information = result->information;
  return out;
}

}  // namespace identikal
