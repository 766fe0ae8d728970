#include "identify/filter/recordings_likelihood.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "identify/filter/leading_samples.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_check.h"
#include "identify/model/parameter_prior.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Is M positive semidefinite, to rounding?
bool semidefinite(const MatrixXd& M) {
  if (M.size() == 0) return true;
  if (!M.allFinite()) return false;
  if (Eigen::LLT<MatrixXd>(M).info() == Eigen::Success) return true;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff() >= -1e-12 * eigen.eigenvalues().cwiseAbs().maxCoeff();
}

bool admissible(const StateSpace& model) {
  if (model.S.isZero(0.0)) return semidefinite(model.Q) && semidefinite(model.R);
  return semidefinite(joint_covariance(model));
}

const std::vector<Dataset> kNoRecordings;

}  // namespace

RecordingsLikelihood::RecordingsLikelihood(const Model& model,
                                           const std::vector<RecordingDigest>& digests)
    : RecordingsLikelihood(model, kNoRecordings) {
  digests_ = &digests;
  for (const RecordingDigest& digest : digests) engine_.add_digest(digest);
}

RecordingsLikelihood::RecordingsLikelihood(const Model& model,
                                           const std::vector<Dataset>& recordings,
                                           EvaluationMethod method)
    : model_(model), method_(method), recordings_(recordings) {
  for (const Parameter& p : model.parameters) {
    curved_ = curved_ || (!p.fixed && p.domain == Domain::positive_definite);
  }
  if (changes(model)) {
    changing_.emplace(model, recordings);
    return;
  }
  if (is_formula_model(model)) {
    nonlinear_.emplace(model, recordings);
    return;
  }
  const LinearModel& linear = as_linear(model);
  constant_derivatives_ = !linear.continuous && is_linear_in_parameters(linear, model.parameters);
  derivatives_ = model_derivatives(linear, model.parameters);
  for (const Dataset& data : recordings) inputs_.push_back(model_inputs(linear, data.u));
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    engine_.add_recording(recordings[i].y, inputs_[i]);
  }
}

std::unique_ptr<RecordingsLikelihood> RecordingsLikelihood::another() const {
  if (digests_ != nullptr) {
    auto out = std::make_unique<RecordingsLikelihood>(model_, *digests_);
    out->prior_box_ = prior_box_;
    return out;
  }
  auto out = std::make_unique<RecordingsLikelihood>(model_, recordings_, method_);
  if (nonlinear_) out->nonlinear_.emplace(*nonlinear_);  // as fine as this one
  if (!first_outputs_.empty()) out->condition_on_beginning();
  out->prior_box_ = prior_box_;
  return out;
}

bool RecordingsLikelihood::set_system(const ParameterSet& at, bool with_derivatives) {
  if (changing_) return true;  // the filter judges them, sample by sample
  instantiate(noise_model(model_), at, system_);
  if (!admissible(system_)) return false;
  if (with_derivatives && !constant_derivatives_) {
    derivatives_ = model_derivatives(noise_model(model_), at);
  }
  return true;
}

void RecordingsLikelihood::condition_on_beginning() {
  if (!is_stationary() || !first_outputs_.empty()) return;
  const LinearModel& linear = as_linear(model_);
  if (linear.initial != InitialState::diffuse) return;
  if (is_known(linear.A, model_.parameters) && is_known(linear.C, model_.parameters)) return;
  const LeadingSamples leading = leading_samples(model_, model_.parameters, recordings_);
  if (leading.log_likelihood.size() == 0) return;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    first_outputs_.push_back(recordings_[i].y.leftCols(leading.diffuse));
    first_inputs_.push_back(inputs_[i].leftCols(leading.diffuse));
  }
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    beginning_.add_recording(first_outputs_[i], first_inputs_[i]);
  }
}

double RecordingsLikelihood::log_likelihood_of_beginning(const ParameterSet& at) {
  if (first_outputs_.empty()) return 0.0;
  if (!set_system(at, false)) return kNone;
  const Likelihood& first = beginning_.evaluate(system_, as_linear(model_).initial);
  return first.status == FilterStatus::ok ? first.value : kNone;
}

const Likelihood& RecordingsLikelihood::behind_beginning(const Likelihood& all,
                                                         bool with_gradient) {
  const Likelihood& first =
      beginning_.evaluate(system_, as_linear(model_).initial, with_gradient ? derivatives_ : none_);
  conditional_ = all;
  conditional_.status = all.status == FilterStatus::ok ? first.status : all.status;
  if (conditional_.status != FilterStatus::ok) return conditional_;
  conditional_.value -= first.value;
  if (!with_gradient) return conditional_;
  conditional_.gradient -= first.gradient;
  conditional_.information -= first.information;
  return conditional_;
}

void RecordingsLikelihood::weigh_by_priors() {
  if (!names_with_priors(model_.parameters).empty()) prior_box_ = prior_box(model_);
}

const Likelihood& RecordingsLikelihood::with_priors(const Likelihood& of_data,
                                                    const ParameterSet& at, bool with_gradient) {
  const PriorTerms prior = stated_priors_at(at);
  posterior_ = of_data;
  posterior_.value += prior.value;
  if (!std::isfinite(prior.value)) posterior_.status = FilterStatus::indefinite;
  if (posterior_.status != FilterStatus::ok || !with_gradient) return posterior_;
  posterior_.gradient += prior.gradient;
  posterior_.information.diagonal() += prior.information;
  return posterior_;
}

const Likelihood* RecordingsLikelihood::evaluate(const ParameterSet& at, bool with_gradient) {
  if (!set_system(at, with_gradient && is_stationary())) return nullptr;
  const Likelihood& all = changing_ ? changing_->evaluate(at, with_gradient)
                          : nonlinear_
                              ? nonlinear_->evaluate(at, with_gradient)
                              : engine_.evaluate(system_, as_linear(model_).initial,
                                                 with_gradient ? derivatives_ : none_, method_);
  const Likelihood& of_data = first_outputs_.empty() ? all : behind_beginning(all, with_gradient);
  const Likelihood& result = prior_box_ ? with_priors(of_data, at, with_gradient) : of_data;
  return result.status == FilterStatus::ok ? &result : nullptr;
}

FilterStatus RecordingsLikelihood::watch(const ParameterSet& at, bool with_derivatives,
                                         std::size_t recording, const FilteredStateWatcher& see) {
  if (model_.student) return watch_student(at, recording, see);
  if (!set_system(at, with_derivatives && is_stationary())) return FilterStatus::indefinite;
  if (changing_) return changing_->watch(at, with_derivatives, recording, see);
  if (nonlinear_) return nonlinear_->watch(at, with_derivatives, recording, see);
  return watch_filtered_states(system_, as_linear(model_).initial, recordings_[recording].y,
                               inputs_[recording], with_derivatives ? derivatives_ : none_, see)
      .status;
}

FilterStatus RecordingsLikelihood::watch_student(const ParameterSet& at, std::size_t recording,
                                                 const FilteredStateWatcher& see) {
  const FilterResult filter = run_filter(model_, at, recordings_[recording]);
  if (filter.status != FilterStatus::ok) return filter.status;
  for (Eigen::Index t = filter.first_proper; t < filter.x_filt.cols(); ++t) {
    see({t, filter.x_filt.col(t), filter.P_filt[static_cast<std::size_t>(t)], {}, {}});
  }
  return filter.status;
}

LikelihoodProblem RecordingsLikelihood::problem() {
  LikelihoodProblem out;
  const Box box = prior_box_ ? *prior_box_ : coordinate_box(model_.parameters);
  out.lower = box.lower;
  out.upper = box.upper;
  out.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
    const Likelihood* result =
        evaluate(with_coordinates(model_.parameters, x), gradient != nullptr);
    if (result == nullptr) return false;
    L = result->value;
    if (gradient == nullptr) return true;
    *gradient = result->gradient;
    if (information != nullptr) *information = result->information;
    if (!curved_) return true;
    const MatrixXd J = entry_jacobian(model_.parameters, x);
    *gradient = J.transpose() * result->gradient;
    if (information != nullptr) {
      *information = J.transpose() * result->information * J +
                     coordinate_curvature(model_.parameters, result->gradient);
    }
    return true;
  };
  return out;
}

MatrixXd RecordingsLikelihood::score_products(const ParameterSet& at) {
  if (!set_system(at, is_stationary())) return {};
  if (is_stationary()) {
    const InitialState initial = as_linear(model_).initial;
    const MatrixXd all = engine_.score_products(system_, initial, derivatives_);
    if (first_outputs_.empty() || all.size() == 0) return all;
    const MatrixXd first = beginning_.score_products(system_, initial, derivatives_);
    return first.size() > 0 ? MatrixXd(all - first) : first;
  }
  MatrixXd out;
  const Likelihood& all =
      changing_ ? changing_->evaluate(at, true, &out) : nonlinear_->evaluate(at, true, &out);
  return all.status == FilterStatus::ok ? out : MatrixXd();
}

double RecordingsLikelihood::samples() const {
  if (digests_ != nullptr) {
    double out = 0.0;
    for (const RecordingDigest& digest : *digests_) {
      out += static_cast<double>(digest.samples * digest.outputs);
    }
    return out;
  }
  return static_cast<double>(samples_present(recordings_));
}

FilterStatus RecordingsLikelihood::status_at_start() {
  if (!set_system(model_.parameters, false)) return FilterStatus::indefinite;
  if (changing_) return changing_->evaluate(model_.parameters, false).status;
  if (nonlinear_) return nonlinear_->evaluate(model_.parameters, false).status;
  return engine_.evaluate(system_, as_linear(model_).initial, none_, method_).status;
}

}  // namespace identikal
