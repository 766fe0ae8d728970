// How likely are these recordings under this model? The same exact answer by three evaluation
// methods of very different cost; every estimator evaluates through here.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lib/filter/kalman.h"
#include "lib/filter/recording_digest.h"

namespace identikal {

/// Evaluation methods of the same log-likelihood.
enum class EvaluationMethod {
  automatic,        ///< the cheapest that is exact for the model and the recording
  time_varying,     ///< the full recursion at every sample
  steady_state,     ///< constant gain once covariance and derivatives have settled to rounding
  autocovariances,  ///< gapless segments from their sample autocovariances, at a cost that does
                    ///< not depend on their length
};
const char* to_string(EvaluationMethod method);

/// Why a part of the recordings was not evaluated from sample autocovariances.
enum class FallbackReason {
  none,
  not_requested,      ///< another evaluation method was requested
  short_segment,      ///< a gapless segment is shorter than the filter's memory, or than 40 samples
                      ///< for each of seven states or more
  long_memory,        ///< the filter's pole is so close to 1 that sample autocovariances would cost
                      ///< more than they save
  no_steady_state,    ///< the gain does not converge to a stable filter
  cancellation,       ///< innovations so much smaller than the signal that sample
                      ///< autocovariances lose digits
  too_many_channels,  ///< more than 15 outputs and inputs
  unknown_start,      ///< x0 or P0 depends on a parameter: its information is that of few samples
  known_start,        ///< x0 is known so much better than a steady filter knows it that its first
                      ///< samples count for more than the others; or it is diffuse and the first
                      ///< sample of the segment has gone by
};
/// A sentence for people.
const char* describe(FallbackReason fallback);

struct EvaluationTaken {
  /// Which most samples were evaluated by.
  EvaluationMethod method = EvaluationMethod::time_varying;
  FallbackReason fallback = FallbackReason::none;
  double pole = 0.0;  ///< largest absolute eigenvalue of A - K C; 0 when not computed
};

/// Recordings prepared for many evaluations. Holds workspace: one engine per thread. It keeps
/// references to the recordings, which must outlive it. After a move the source may only be
/// assigned to or destroyed.
///
/// Example:
///
///     LikelihoodEngine engine;
///     engine.add_recording(y, u);
///     const Likelihood& at = engine.evaluate(model, InitialState::stationary, derivatives);
///     const Eigen::VectorXd scoring_step = at.information.ldlt().solve(at.gradient);
class LikelihoodEngine {
 public:
  LikelihoodEngine();
  ~LikelihoodEngine();
  LikelihoodEngine(LikelihoodEngine&&) noexcept;
  LikelihoodEngine& operator=(LikelihoodEngine&&) noexcept;

  /// @param y  ny x N, NaN = missing     @param u  nu x N
  /// @throws std::invalid_argument when the shapes differ from those of earlier recordings.
  void add_recording(const Eigen::MatrixXd& y, const Eigen::MatrixXd& u);
  // Temporaries would not outlive it.
  void add_recording(const Eigen::MatrixXd&& y, const Eigen::MatrixXd& u) = delete;
  void add_recording(const Eigen::MatrixXd& y, const Eigen::MatrixXd&& u) = delete;
  void add_recording(const Eigen::MatrixXd&& y, const Eigen::MatrixXd&& u) = delete;
  /// A recording that is no longer there: of a filter that remembers longer than the digest the
  /// likelihood is unknown, FilterStatus::beyond_digest.
  /// @throws std::invalid_argument as add_recording()
  void add_digest(const RecordingDigest& digest);

  /// The sum over all recordings of log_likelihood() in lib/filter/kalman.h, to 1e-9 of itself,
  /// whatever the method; every recording starts from `initial`. Derivatives have the model's
  /// shapes, x0 and P0 included where the start is given. Where sample autocovariances are used,
  /// the information is the Fisher information of a stationary filter: the expectation
  ///   N [ 1/2 tr(Sigma^-1 dSigma_i Sigma^-1 dSigma_j) + tr(M dK_i Sigma dK_j') ]
  /// when all parameters are of the noise, else with the sums that the recording supplied for x, z
  /// from its own start on, less what is not known of that start
  /// (lib/filter/internal/compressed_information.h). No memory is allocated from the second
  /// evaluation of a model of up to 6 states on, when all parameters are of the noise and
  /// EvaluationMethod::autocovariances is possible.
  /// @throws std::invalid_argument when shapes disagree or there is no recording.
  const Likelihood& evaluate(const StateSpace& model, InitialState initial,
                             const std::vector<StateSpace>& derivatives = {},
                             EvaluationMethod method = EvaluationMethod::automatic);

  /// The sum over all recordings of score_products() in lib/filter/kalman.h; empty when a filter
  /// does not run.
  Eigen::MatrixXd score_products(const StateSpace& model, InitialState initial,
                                 const std::vector<StateSpace>& derivatives) const;

  const EvaluationTaken& evaluation_taken() const;  ///< of the last evaluation

 private:
  struct Recordings;
  std::unique_ptr<Recordings> recordings_;
};

}  // namespace identikal
