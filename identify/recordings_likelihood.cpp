#include "identify/recordings_likelihood.h"

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

RecordingsLikelihood::RecordingsLikelihood(const ModelFile& model,
                                           const std::vector<Dataset>& recordings, Path path)
    : model_(model), path_(path), derivatives_(model_derivatives(model.linear, model.parameters)) {
  for (const Dataset& data : recordings) inputs_.push_back(model_inputs(model.linear, data.u));
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    engine_.add_recording(recordings[i].y, inputs_[i]);
  }
  for (const Parameter& p : model.parameters) {
    curved_ = curved_ || (!p.fixed && p.domain == Domain::positive_definite);
  }
}

const Likelihood* RecordingsLikelihood::evaluate(const ParameterSet& at, bool with_gradient) {
  instantiate(model_.linear, at, system_);
  if (!admissible(system_)) return nullptr;
  if (with_gradient && model_.linear.continuous) {
    derivatives_ = model_derivatives(model_.linear, at);
  }
  const Likelihood& result =
      engine_.evaluate(system_, model_.linear.initial, with_gradient ? derivatives_ : none_, path_);
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
  instantiate(model_.linear, at, system_);
  if (!admissible(system_)) return {};
  if (model_.linear.continuous) derivatives_ = model_derivatives(model_.linear, at);
  return engine_.score_products(system_, model_.linear.initial, derivatives_);
}

FilterStatus RecordingsLikelihood::status_at_start() {
  instantiate(model_.linear, model_.parameters, system_);
  if (!admissible(system_)) return FilterStatus::indefinite;
  return engine_.evaluate(system_, model_.linear.initial, none_, path_).status;
}

}  // namespace identikal
