#include "identify/filter/model_filter.h"

#include <Eigen/Eigenvalues>

#include "identify/filter/changing_recordings.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/filter/student_filter.h"
#include "identify/filter/student_weights.h"

namespace identikal {
namespace {

using Eigen::Index;

SmootherResult filtered_states(const FilterResult& filter) {
  SmootherResult out;
  out.status = filter.status;
  if (filter.status != FilterStatus::ok) return out;
  out.log_likelihood = filter.log_likelihood;
  out.x = filter.x_filt;
  out.sd.resize(out.x.rows(), out.x.cols());
  for (Index t = 0; t < out.x.cols(); ++t) {
    const auto variance = filter.P_filt[t].diagonal();
    out.sd.col(t) = variance.cwiseMax(0.0).cwiseSqrt();
  }
  return out;
}

}  // namespace

namespace {

FilterResult run_any_filter(const Model& model, const ParameterSet& parameters,
                            const Dataset& recording, Keep keep) {
  if (model.student) return StudentFilter(model, recording).run(parameters, keep).filter;
  if (changes(model)) return changing_filter(model, parameters, recording, keep);
  if (is_formula_model(model)) {
    return nonlinear_filter(model, parameters, recording, keep);
  }
  const LinearModel& linear = as_linear(model);
  return kalman_filter(instantiate(linear, parameters), linear.initial, recording.y,
                       model_inputs(linear, recording.u), keep);
}

}  // namespace

FilterResult run_filter(const Model& model, const ParameterSet& parameters,
                        const Dataset& recording, Keep keep) {
  FilterResult out = run_any_filter(model, parameters, recording, keep);
  const Eigen::VectorXd jacobian = log_jacobian(recording);
  if (jacobian.size() > 0 && out.status == FilterStatus::ok) {
    out.log_likelihood += jacobian.tail(jacobian.size() - out.first_proper).sum();
  }
  return out;
}

namespace {

// What rounding has left of the variances of states that are known exactly may be below zero.
Eigen::MatrixXd without_negative_variances(const Eigen::MatrixXd& P) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modes(P);
  const Eigen::VectorXd root = modes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  const Eigen::MatrixXd factor = modes.eigenvectors() * root.asDiagonal();
  return factor * factor.transpose();
}

}  // namespace

std::optional<Model> going_on(Model model, const ParameterSet& parameters, const Dataset& recording,
                              Index from) {
  if (from == 0) return std::nullopt;
  const FilterResult before = run_filter(model, parameters, first_samples(recording, from + 1));
  if (before.status != FilterStatus::ok || before.first_proper > from) return std::nullopt;
  LinearModel& start = noise_model(model);
  start.initial = InitialState::given;
  start.stationary.clear();
  start.known.clear();
  start.x0 = constant_matrix(before.x_pred.col(from));
  start.P0 =
      constant_matrix(without_negative_variances(before.P_pred[static_cast<std::size_t>(from)]));
  return model;
}

SmootherResult run_smoother(const Model& model, const ParameterSet& parameters,
                            const Dataset& recording, std::optional<Index> lag) {
  if (model.student && lag == Index{0}) {
    return filtered_states(run_filter(model, parameters, recording, Keep::everything));
  }
  if (model.student) {
    return run_smoother(normal_model(model), parameters,
                        student_weighted(model, parameters, {recording}).front(), lag);
  }
  if (changes(model)) return changing_smoother(model, parameters, recording, lag);
  if (is_formula_model(model)) {
    return lag == Index{0}
               ? filtered_states(nonlinear_filter(model, parameters, recording, Keep::everything))
               : nonlinear_smoother(model, parameters, recording, lag);
  }
  const LinearModel& linear = as_linear(model);
  const StateSpace system = instantiate(linear, parameters);
  const Eigen::MatrixXd u = model_inputs(linear, recording.u);
  return lag ? smooth_with_lag(system, linear.initial, recording.y, u, *lag,
                               SmootherKeep::deviations)
             : smooth(system, linear.initial, recording.y, u, SmootherKeep::deviations);
}

bool has_disturbance_smoother(const Model& model) {
  if (!is_linear(model) && !changes(model)) return false;
  const ParametrisedMatrix& S = noise_model(model).S;
  return S.constant.isZero(0.0) && S.entries.empty() && S.formulas.empty() && S.block < 0;
}

DisturbanceResult run_disturbance_smoother(const Model& model, const ParameterSet& parameters,
                                           const Dataset& recording) {
  if (changes(model)) return changing_disturbances(model, parameters, recording);
  const LinearModel& linear = as_linear(model);
  return smooth_disturbances(instantiate(linear, parameters), linear.initial, recording.y,
                             model_inputs(linear, recording.u));
}

SimulatedPath run_simulated_path(const Model& model, const ParameterSet& parameters,
                                 const Dataset& recording, Random& random) {
  if (changes(model)) return changing_path(model, parameters, recording, random);
  const LinearModel& linear = as_linear(model);
  return simulate_path(instantiate(linear, parameters), linear.initial, recording.y,
                       model_inputs(linear, recording.u), random);
}

}  // namespace identikal
