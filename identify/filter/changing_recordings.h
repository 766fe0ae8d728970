// How does a recording go through a linear model that changes from sample to sample, as a model file
// states it?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"
#include "lib/filter/disturbance_smoother.h"
#include "lib/filter/kalman.h"
#include "lib/filter/simulation_smoother.h"
#include "lib/filter/smoother.h"
#include "lib/model/sampled_model.h"

namespace identikal {

/// A model that changes (identify/model/model.h) with recordings prepared for many evaluations.
/// Keeps references to both; one per thread.
///
/// Example:
///
///     ChangingRecordings prepared(model, recordings);
///     const Likelihood& at = prepared.evaluate(model.parameters, true);
///     if (at.status == FilterStatus::ok) std::printf("log L = %g\n", at.value);
class ChangingRecordings {
 public:
  ChangingRecordings(const Model& model, const std::vector<Dataset>& recordings);

  /// The sum over all recordings of the exact log_likelihood() (lib/filter/kalman.h), each from the
  /// model's start, by the free entries where requested. Valid until the next call.
  /// @param score_products  written when not null: the sum over all samples
  const Likelihood& evaluate(const ParameterSet& at, bool with_derivatives,
                             Eigen::MatrixXd* score_products = nullptr);

  /// watch_filtered_states() (lib/filter/kalman.h) of one of the recordings.
  FilterStatus watch(const ParameterSet& at, bool with_derivatives, std::size_t recording,
                     const FilteredStateWatcher& see);

 private:
  const Model& model_;
  const std::vector<Dataset>& recordings_;
  std::vector<SampledModel> sampled_;
  std::vector<Eigen::MatrixXd> inputs_;
  Likelihood sum_;
};

/// The filter's run over one recording.
FilterResult changing_filter(const Model& model, const ParameterSet& at, const Dataset& recording,
                             Keep keep);

/// The smoother's, deviations only. @param lag  as run_smoother() has it (model_filter.h)
SmootherResult changing_smoother(const Model& model, const ParameterSet& at,
                                 const Dataset& recording, std::optional<Eigen::Index> lag);

/// simulate_path() (lib/filter/simulation_smoother.h) of one recording.
SimulatedPath changing_path(const Model& model, const ParameterSet& at, const Dataset& recording,
                            Random& random);

/// smooth_disturbances() (lib/filter/disturbance_smoother.h) of one recording.
/// @throws std::invalid_argument when S is not zero
DisturbanceResult changing_disturbances(const Model& model, const ParameterSet& at,
                                        const Dataset& recording);

/// Outputs at this recording's times and inputs, drawn from the model at its own values; SI, ny x N.
/// @throws std::invalid_argument when a covariance is not positive semidefinite
Eigen::MatrixXd simulate_changing_outputs(const Model& model, const Dataset& recording,
                                          Random& random);

/// What the outputs would be without noise, from the state x at the first sample; SI, ny x N.
Eigen::MatrixXd noise_free_changing_outputs(const Model& model, const ParameterSet& at,
                                            const Dataset& recording, Eigen::VectorXd x);

/// The product of all transitions, n x n: what becomes of an error of the first state.
Eigen::MatrixXd changing_transition(const Model& model, const ParameterSet& at,
                                    const Dataset& recording);

}  // namespace identikal
