// How likely are recordings as a function of a model file's free parameters? What every estimator
// of noise maximises.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "identify/filter/changing_recordings.h"
#include "identify/filter/likelihood_team.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/likelihood.h"
#include "lib/filter/recording_digest.h"
#include "solvers/scoring.h"

namespace identikal {

/// The likelihood of all recordings under a linear or nonlinear model, as a function of the free
/// entries or of the optimiser's coordinates (lib/model/parameter.h). Where parameters have values
/// of their own in some recordings (identify/model/own_parameters.h) the cost is that of every
/// recording alone. Keeps references to model and recordings; one per thread.
///
/// Example:
///
///     RecordingsLikelihood likelihood(model, recordings);
///     const Solution best = maximise(likelihood.problem(), coordinates(model.parameters));
///     const ParameterSet estimated = with_coordinates(model.parameters, best.x);
class RecordingsLikelihood {
 public:
  RecordingsLikelihood(const Model& model, const std::vector<Dataset>& recordings,
                       EvaluationMethod method = EvaluationMethod::automatic);
  /// The same of recordings that are no longer there, under a model with constant matrices.
  RecordingsLikelihood(const Model& model, const std::vector<RecordingDigest>& digests);
  RecordingsLikelihood(const Model& model, std::vector<RecordingDigest>&& digests) = delete;
  /// Neither may be a temporary.
  RecordingsLikelihood(const Model& model, std::vector<Dataset>&& recordings,
                       EvaluationMethod method = EvaluationMethod::automatic) = delete;
  RecordingsLikelihood(Model&& model, const std::vector<Dataset>& recordings,
                       EvaluationMethod method = EvaluationMethod::automatic) = delete;
  ~RecordingsLikelihood();

  /// From here on the likelihood of a linear model is
  ///
  ///   log p(y(k+1), ... | y(1), ..., y(k))
  ///
  /// where A or C hold free parameters that multiply states which start diffuse; k samples of every
  /// recording determine the start, at the model's own values. The diffuse likelihood compares no
  /// such models: it rises without limit where two states become one to the outputs, as at a pole
  /// of a shaping filter that comes to lie on one of the system's. Else nothing changes.
  /// Source: Francke, Koopman and de Vos (2010), "Likelihood functions for state space models with
  /// diffuse initial conditions".
  void condition_on_beginning();

  /// log p(y(1), ..., y(k)) of what it is conditioned on; 0 where it is not, NaN where undefined.
  double log_likelihood_of_beginning(const ParameterSet& at);

  /// From here on the priors that the model file states count: their log-density, as
  /// stated_priors_at() (identify/model/parameter_prior.h) has it, is added to the log-likelihood,
  /// and uniform ones bound the optimiser's coordinates. The maximum is then the most probable
  /// point. @throws InputError as prior_box()
  void weigh_by_priors();

  /// Weighs the model's constraints between parameters by what the data say at these values, and
  /// from then on the terms that hold them count (lib/model/constraints.h); after a search, sets
  /// them for the next one.
  /// @return does one not hold there, so that the search has to go on? False without constraints.
  bool tighten_constraints(const ParameterSet& at);

  /// Of the constraints; before tighten_constraints() none.
  const Multipliers& multipliers() const { return multipliers_; }

  /// From here on the roughness of the model's smooth curves counts: to the log-likelihood is added
  /// -1/2 w f' R f of each, f its values at the knots (lib/model/spline_curve.h). @param w  one of
  /// each curve of the model, not negative
  void weigh_roughness(const Eigen::VectorXd& w) { roughness_weights_ = w; }
  bool weighs_roughness() const { return roughness_weights_.size() > 0; }

  /// From here on every process of the team evaluates its share of the recordings, and this one, rank
  /// 0, adds up; what stands beside the data counts here alone. The team has to outlive this.
  void share_with(const LikelihoodTeam& team);

  /// What priors, constraints and roughness have added to the log-likelihood there.
  double log_density_beside_data(const ParameterSet& at) const;

  /// The same function with memory of its own, for another thread.
  std::unique_ptr<RecordingsLikelihood> another() const;

  /// Log-likelihood, and with_gradient its gradient and Fisher information by the free entries.
  /// @return nullptr where it is undefined (Q and R not positive semidefinite together, an unstable
  /// stationary start, ...). Valid until the next call.
  const Likelihood* evaluate(const ParameterSet& at, bool with_gradient);

  /// Shows the filtered states of one of the recordings, by the free entries where requested.
  /// @return indefinite where covariances are none; nothing is shown then
  FilterStatus watch(const ParameterSet& at, bool with_derivatives, std::size_t recording,
                     const FilteredStateWatcher& see);

  /// In the optimiser's coordinates. To the information is added what the coordinates' own
  /// curvature takes from the likelihood, where that is positive. Refers to this object.
  LikelihoodProblem problem();

  /// Makes the integration of a nonlinear model as fine as the filter with these values needs it.
  /// @return is it finer than before? Then the likelihood is a slightly different function.
  bool refine(const ParameterSet& at);

  /// How far the log-likelihood of a nonlinear model with these values is from the exact one, as
  /// far as a finer integration tells.
  double integration_error(const ParameterSet& at);

  const Model& model() const { return model_; }
  const std::vector<Dataset>& recordings() const { return recordings_; }  ///< of digests: none
  double samples() const;                                                 ///< values measured

  /// How the evaluation at the model's own values ends.
  FilterStatus status_at_start();

  /// sum s s' of the samples' scores by the free entries (lib/filter/kalman.h); empty where
  /// undefined, and of digests.
  Eigen::MatrixXd score_products(const ParameterSet& at);

  const EvaluationTaken& evaluation_taken() const { return engine_.evaluation_taken(); }

  /// Is a search over before further threads would have begun? By sums over the recordings, of small
  /// models and few samples, and by a team.
  bool is_cheap() const;

 private:
  friend void work_for_team(const Model& model, const std::vector<Dataset>& recordings,
                            EvaluationMethod method, const LikelihoodTeam& team);
  // One recording by itself, where parameters have values of their own in some
  // (identify/model/own_parameters.h).
  struct Part;
  void part_recordings();
  struct Share;
  const Likelihood& evaluate_by_team(const ParameterSet& at, bool with_gradient);
  const Likelihood& evaluate_parts(const ParameterSet& at, bool with_gradient);
  Eigen::MatrixXd products_of_parts(const ParameterSet& at);
  FilterStatus watch_part(const ParameterSet& at, bool with_derivatives, std::size_t recording,
                          const FilteredStateWatcher& see);
  FilterStatus watch_student(const ParameterSet& at, std::size_t recording,
                             const FilteredStateWatcher& see);
  bool is_stationary() const { return !nonlinear_ && !changing_; }
  // The data's share of evaluate(); what was evaluated last is not evaluated again.
  const Likelihood* of_data(const ParameterSet& at, bool with_gradient);
  bool is_last(const ParameterSet& at, bool with_gradient) const;
  // The matrices at these values, and their derivatives; false where covariances are none.
  bool set_system(const ParameterSet& at, bool with_derivatives);
  const Likelihood& as_recorded(const Likelihood& of_values);
  const Likelihood& behind_beginning(const Likelihood& all, bool with_gradient);
  const Likelihood& with_priors(const Likelihood& of_data, const ParameterSet& at,
                                bool with_gradient);
  const Likelihood& with_constraints(const Likelihood& of_data, const ParameterSet& at,
                                     bool with_gradient);
  const Likelihood& with_roughness(const Likelihood& of_data, const ParameterSet& at,
                                   bool with_gradient);
  // What counts beside the data, put in.
  const Likelihood* complete(const Likelihood& of_data, const ParameterSet& at, bool with_gradient);

  const Model& model_;
  EvaluationMethod method_;
  bool curved_ = false;
  bool constant_derivatives_ = false;
  // Of a model of formulas, one of these.
  std::optional<NonlinearRecordings> nonlinear_;
  std::optional<ChangingRecordings> changing_;
  std::vector<Eigen::MatrixXd> inputs_;  // the engine refers to them
  LikelihoodEngine engine_;
  const std::vector<Dataset>& recordings_;
  const std::vector<RecordingDigest>* digests_ = nullptr;  // in their place
  // What is conditioned on, if anything; the engine refers to the samples.
  std::vector<Eigen::MatrixXd> first_outputs_, first_inputs_;
  LikelihoodEngine beginning_;
  Likelihood conditional_;
  std::optional<Box> prior_box_;  // where priors count
  Likelihood posterior_, constrained_, smoothed_, recorded_;
  double log_jacobian_ = 0.0;  // of the outputs' transforms; of parts: each its own
  Multipliers multipliers_;
  Eigen::VectorXd roughness_weights_;         // empty: it does not count
  std::vector<std::unique_ptr<Part>> parts_;  // empty: all recordings go through one model
  Likelihood of_parts_;
  const LikelihoodTeam* team_ = nullptr;
  std::unique_ptr<Share> share_;  // of the team's work
  Likelihood of_team_;
  const Likelihood* last_ = nullptr;  // of_data()'s, as long as nothing else has been asked
  struct Value {
    Eigen::MatrixXd value;
    bool fixed;
  };
  std::vector<Value> last_values_;
  bool last_has_gradient_ = false;
  StateSpace system_;
  const std::vector<StateSpace> none_;
  std::vector<StateSpace> derivatives_;
};

/// Of every other rank: evaluates its share of the recordings as rank 0 asks, until there is no more to
/// do. What goes wrong rank 0 throws.
void work_for_team(const Model& model, const std::vector<Dataset>& recordings,
                   EvaluationMethod method, const LikelihoodTeam& team);

}  // namespace identikal
