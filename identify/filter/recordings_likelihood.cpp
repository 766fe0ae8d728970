#include "identify/filter/recordings_likelihood.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

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

}  // namespace

RecordingsLikelihood::RecordingsLikelihood(const Model& model,
                                           const std::vector<Dataset>& recordings,
                                           EvaluationMethod method)
    : model_(model), method_(method) {
  for (const Parameter& p : model.parameters) {
    curved_ = curved_ || (!p.fixed && p.domain == Domain::positive_definite);
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

bool RecordingsLikelihood::set_system(const ParameterSet& at, bool with_derivatives) {
  instantiate(noise_model(model_), at, system_);
  if (!admissible(system_)) return false;
  if (with_derivatives && !constant_derivatives_) {
    derivatives_ = model_derivatives(noise_model(model_), at);
  }
  return true;
}

const Likelihood* RecordingsLikelihood::evaluate(const ParameterSet& at, bool with_gradient) {
  if (!set_system(at, with_gradient && !nonlinear_)) return nullptr;
  const Likelihood& result = nonlinear_
                                 ? nonlinear_->evaluate(at, with_gradient)
                                 : engine_.evaluate(system_, as_linear(model_).initial,
                                                    with_gradient ? derivatives_ : none_, method_);
  return result.status == FilterStatus::ok ? &result : nullptr;
}

LikelihoodProblem RecordingsLikelihood::problem() {
  LikelihoodProblem out;
  const Box box = coordinate_box(model_.parameters);
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
  if (!set_system(at, !nonlinear_)) return {};
  if (!nonlinear_) return engine_.score_products(system_, as_linear(model_).initial, derivatives_);
  MatrixXd out;
  if (nonlinear_->evaluate(at, true, &out).status != FilterStatus::ok) return {};
  return out;
}

FilterStatus RecordingsLikelihood::status_at_start() {
  if (!set_system(model_.parameters, false)) return FilterStatus::indefinite;
  if (nonlinear_) return nonlinear_->evaluate(model_.parameters, false).status;
  return engine_.evaluate(system_, as_linear(model_).initial, none_, method_).status;
}

}  // namespace identikal
