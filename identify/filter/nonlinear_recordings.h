// How does a recording go through a model of formulas, as a model file states it?
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/nonlinear/filter.h"
#include "lib/nonlinear/integration_steps.h"
#include "lib/nonlinear/simulation.h"
#include "lib/nonlinear/smoother.h"

namespace identikal {

/// How the equations are integrated from sample to sample.
struct Integration {
  IntegrationSteps steps;
  bool controlled = false;  ///< they are chosen during the integration, see controlled_nodes()
};

/// In as many steps as the filter with these values needs (lib/nonlinear/integration_steps.h), or
/// as the file says; controlled where no noise moves the state and there would be more than 64
/// between two samples, as for stiff equations, or those of the file do not follow; none where it
/// moves linearly.
/// @throws InputError when the file says too many
Integration integration_of(const Model& model, const ParameterSet& at, const Dataset& recording);

/// The recording's inputs with the integration that the filter with these values needs. The model
/// is of formulas that are not linear.
InputNodes filter_nodes(const Model& model, const ParameterSet& at, const Dataset& recording);

/// A nonlinear model file with recordings prepared for many evaluations. Keeps references to both;
/// one per thread.
///
/// Example:
///
///     NonlinearRecordings prepared(model, recordings);  // of a model of formulas
///     const Likelihood& at = prepared.evaluate(model.parameters, true);
///     if (at.status == FilterStatus::ok) std::printf("log L = %g\n", at.value);
class NonlinearRecordings {
 public:
  NonlinearRecordings(const Model& model, const std::vector<Dataset>& recordings);

  /// The sum over all recordings of nonlinear_likelihood(), each from the model's start, by the
  /// free entries where requested. Valid until the next call.
  /// @param score_products  written when not null: the sum over all samples
  const Likelihood& evaluate(const ParameterSet& at, bool with_derivatives,
                             Eigen::MatrixXd* score_products = nullptr);

  /// watch_filtered_states() (lib/nonlinear/filter.h) of one of the recordings.
  FilterStatus watch(const ParameterSet& at, bool with_derivatives, std::size_t recording,
                     const FilteredStateWatcher& see);

  /// Halves the steps wherever the filter with these values needs it; those of the model's own are
  /// taken to begin with. Where that is not enough for the log-likelihood, as far as
  /// integration_error() can tell, steps are controlled from here on, or where noise moves the
  /// state, halved once more.
  /// @return has anything changed? Then the likelihood is a slightly different function.
  bool refine(const ParameterSet& at);

  /// By how much controlled steps, ten times as exact as where they are taken, change the
  /// log-likelihood; where noise moves the state, by how much exact ones would, as far as steps of
  /// half the length tell.
  double integration_error(const ParameterSet& at);

 private:
  Likelihood evaluate_one(const ParameterSet& at, std::size_t recording, const InputNodes& inputs,
                          const StateSpace& written, const std::vector<FilterDirection>& by,
                          Eigen::MatrixXd* score_products);
  double controlled_change(const ParameterSet& at, std::size_t recording);
  double halved_change(const ParameterSet& at, std::size_t recording);
  double integration_change(const ParameterSet& at, std::size_t recording);
  // Inputs as they are with these delays, where a model has any.
  void take_delays(const ParameterSet& at);

  const Model& model_;
  const std::vector<Dataset>& recordings_;
  std::vector<LinearModel> noise_;  // of each recording
  std::vector<std::vector<int>> steps_;
  std::vector<InputNodes> inputs_;
  ModelMemory memory_;
  std::vector<NonlinearFilterOptions> options_;  // of each recording
  bool without_noise_ = false;
  Likelihood sum_;
};

/// The extended filter's way through one recording, step by step, for an update of one's own
/// (student_filter.h). Keeps references to both; one per thread.
///
/// Example:
///
///     NonlinearSteps way(model, recordings[0]);
///     way.set(model.parameters);
///     Eigen::VectorXd x;
///     Eigen::MatrixXd P;
///     way.start(x, P);
class NonlinearSteps {
 public:
  NonlinearSteps(const Model& model, const Dataset& recording);

  void set(const ParameterSet& at);
  void start(Eigen::VectorXd& x, Eigen::MatrixXd& P) const;
  /// At sample t and state x: C = dh/dx, h, and the diagonal of R, without noise_scale.
  void see(Eigen::Index t, const Eigen::VectorXd& x, Eigen::MatrixXd& C, Eigen::VectorXd& h,
           Eigen::VectorXd& R);
  /// Mean and covariance from sample t to the next.
  void move(Eigen::Index t, Eigen::VectorXd& x, Eigen::MatrixXd& P);

 private:
  const Model& model_;
  const Dataset& recording_;
  InputNodes nodes_;
  ModelMemory memory_;
  FilterNoise noise_;
  Jacobian slopes_;
  Gramians gramians_;
};

/// A recording with this one's times and inputs, drawn from the model at its own values.
/// @throws std::invalid_argument when a covariance is not positive semidefinite
NonlinearRealisation simulate_nonlinear_outputs(const Model& model, const Dataset& recording,
                                                Random& random);

/// What the outputs would be without noise, from the state x at the first sample; SI, ny x N.
Eigen::MatrixXd noise_free_outputs(const Model& model, const ParameterSet& at,
                                   const Dataset& recording,
                                   const Eigen::Ref<const Eigen::VectorXd>& x);

/// What becomes of a small error of the state at the first sample until the last: the product of
/// the transitions linearised at these states.
/// @param states  nx x N
/// @return nx x nx; not finite where it overflows
Eigen::MatrixXd transition_along(const Model& model, const ParameterSet& at,
                                 const Dataset& recording,
                                 const Eigen::Ref<const Eigen::MatrixXd>& states);

/// Its innovations behind a gate (lib/filter/gated_innovations.h); the recording's outputs receive NaN
/// where they were refused.
FilterResult gated_innovations(
    const Model& model, const ParameterSet& at, Dataset& recording, Eigen::Index most_in_a_row,
    const std::function<int(Eigen::Index t, const FilterResult& so_far)>& far);

/// The filter's run over one recording.
FilterResult nonlinear_filter(const Model& model, const ParameterSet& at, const Dataset& recording,
                              Keep keep);

/// The smoother's, deviations only. @param lag  as lib/nonlinear/smoother.h has it
SmootherResult nonlinear_smoother(const Model& model, const ParameterSet& at,
                                  const Dataset& recording, std::optional<Eigen::Index> lag);

}  // namespace identikal
