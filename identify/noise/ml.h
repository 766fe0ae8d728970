// Which noise covariances make a recording most likely? Maximum likelihood over the innovations.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/filter/likelihood_team.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/likelihood.h"

namespace identikal {

/// What a fit makes small.
enum class FitObjective {
  one_step,    ///< errors one sample ahead, of a filter: the innovations
  simulation,  ///< errors of a simulation from its start (simulation_model.h); they need not be white
};

/// How large is the noise of outputs that errors are made of, where no noise moves the states and its
/// size is unknown?
enum class NoiseSize {
  residuals,  ///< sum e^2 / (n - p), and Student's t with n - p degrees of freedom, as in regression
  likelihood,  ///< sum e^2 / n, its most likely value, and the normal distribution
};

struct NoiseMlOptions {
  FitObjective objective = FitObjective::one_step;
  NoiseSize errors = NoiseSize::residuals;  ///< p counts the unknowns but for sizes of noise

  /// Searches: from the file's values, then from scattered ones. 0: one, and more where its end leaves
  /// a doubt: of variances that may be zero, with each of them raised, and again from what is found
  /// there; of other unknowns, or without convergence, four scattered ones.
  int starts = 0;
  std::uint64_t seed = 1;  ///< of the scattered starts
  int iterations = 0;      ///< at most, of each search; 0: as SolverOptions have it
  EvaluationMethod evaluation = EvaluationMethod::automatic;
  /// Processes that share the recordings; of rank 0 the others have to be there. Then threads is 1.
  const LikelihoodTeam* team = nullptr;
  int threads = 1;        ///< searches and profiles at a time; 0: as many as there are cores
  bool profiles = true;   ///< profile intervals, where an evaluation is cheap
  bool pictures = false;  ///< searches and profiles as curves, RecordingFit::pictures
  /// Whether references would have other noise (check_against_references()), where there are any.
  bool asks_references = true;
  /// Called after every iteration; return false to stop: the best so far, not converged.
  std::function<bool(int start, int iteration, double log_likelihood)> progress;
};

/// Maximises the innovations' log-likelihood (lib/filter/likelihood.h) of all recordings over every
/// free parameter of a linear model: covariances, and any other entry. A prior that the model file
/// states is added to it (identify/model/parameter_prior.h): the estimate is then the most probable
/// point, and errors hold what the priors say. Standard errors from the
/// observed information (differences of the exact gradient); beside them the Cramér-Rao bound from
/// the expected information. Intervals are those of the profile likelihood
/// (identify/noise/internal/likelihood_intervals.h), `se` away where it is too dear; a variance that
/// ends at zero gets an upper limit from it (one-sided 95 %). The search has converged where the gain
/// still expected is below 1e-4; a direction along which the likelihood does not change is said to be
/// not determined. Source: Matisko (2013), section 4.3; Durbin & Koopman
/// (2012), section 7.3. A model whose measurement noise is Student's t goes to tune_student()
/// (student.h).
///
/// Example:
///
///     NoiseMlOptions options;
///     options.starts = 10;
///     const auto estimate = tune_ml(model, recordings, options);
///
/// With FitObjective::simulation the model is one of simulation_model(): its likelihood takes errors
/// as white, as the weights of several outputs; standard errors and the test for inputs in the errors
/// allow for their colour.
///
/// Of another rank of a team it only works for rank 0, and what it returns is empty.
///
/// @throws InputError when nothing is free, samples are fewer than unknowns, an output never
/// changes or an input has gaps; std::invalid_argument without a recording
NoiseEstimate tune_ml(const Model& model, const std::vector<Dataset>& recordings,
                      const NoiseMlOptions& options = {});
/// The same from digests of recordings (lib/filter/recording_digest.h), without what asks for samples:
/// tests of innovations, fits, sandwich errors, series. The likelihood, the estimates and their errors
/// are those of the recordings, to rounding.
/// @throws InputError for a model whose matrices change or whose noise is Student's, a diffuse start
///   with free A or C, and a filter that remembers longer than the digest reaches
NoiseEstimate tune_ml_digests(const Model& model, const std::vector<RecordingDigest>& digests,
                              const NoiseMlOptions& options = {});

}  // namespace identikal
