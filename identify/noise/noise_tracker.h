// What are the noise and the state of a filter now, with the sample that has just come?
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/noise/bayes.h"

namespace identikal {

struct NoiseTrackOptions {
  Eigen::Index draws = 400;
  std::uint64_t seed = 1;
  /// The filter starts with the file's noise and is tested sample by sample; when the test rejects,
  /// the noise is re-estimated from the samples since the change. Without it the noise is taken as
  /// constant and learnt from the first sample on.
  bool adaptive = false;
  double samples_per_false_alarm = 1e5;  ///< at least, on average, while nothing changes
  /// Of track_noise(); return false to stop.
  std::function<bool(Eigen::Index sample, Eigen::Index of)> progress;
};

struct NoiseChange {
  Eigen::Index since = 0;  ///< first sample to which the new noise belongs, as estimated
  Eigen::Index found = 0;  ///< sample at which the test rejected
};

/// What a sample has shown.
struct NoiseTrackSample {
  /// k: free entries of the noise (lib/model/parameter.h) given the samples up to this one; sd is
  /// NaN while the file's values are in use.
  Eigen::VectorXd mean, sd;
  double log_alarm = 0.0;             ///< logarithm of the test statistic; -infinity without test
  std::optional<NoiseChange> change;  ///< that this sample has shown
  /// n, n x n, ny x ny: state given the samples before, and covariance of the innovation, by the
  /// mixture of the draws' filters; x and P are 0 while the samples do not determine the state
  Eigen::VectorXd x_pred;
  Eigen::MatrixXd P_pred, Sigma;
  /// ny: y minus its prediction, and L^-1 of that with Sigma = L L' over the channels present; NaN
  /// where nothing is measured and while the state is not determined
  Eigen::VectorXd e, standardised;
  double log_density = 0.0;  ///< of the sample given those before
  /// n: given y up to now, x_pred + P C' Sigma^-1 e and what that leaves of P: exact while one noise
  /// is in use, of a mixture the best linear estimate by its two moments
  Eigen::VectorXd state, state_sd;
};

/// The recursion of track_noise() (identify/noise/track.h), sample by sample.
///
/// Example:
///
///     NoiseTracker tracker(model, {.adaptive = true});
///     for (Eigen::Index t = 0; t < y.cols(); ++t) tracker.step(y.col(t), u.col(t));
///     const Eigen::VectorXd state_now = tracker.now().state, noise_now = tracker.now().mean;
///
/// A sample allocates nothing once the state is determined, but when the draws are renewed, when a
/// change has been found (both run filters over all samples since) and when the room for samples
/// doubles. What is kept are the samples since the last change, and since a change that the next
/// samples may still show.
class NoiseTracker {
 public:
  /// @param model  linear; only its noise is free
  /// @throws InputError where something else is free, or the filter cannot start
  NoiseTracker(const Model& model, const NoiseTrackOptions& options);
  NoiseTracker(NoiseTracker&&) noexcept;
  NoiseTracker& operator=(NoiseTracker&&) noexcept;
  ~NoiseTracker();

  /// Takes a sample.
  /// @param y  ny, NaN = missing
  /// @param u  as instantiate()'s model takes it (model_inputs(), lib/model/linear_model.h)
  /// @return false when no noise in use gives the sample a density: the tracker cannot go on
  /// @throws std::invalid_argument for other sizes
  bool step(const Eigen::Ref<const Eigen::VectorXd>& y, const Eigen::Ref<const Eigen::VectorXd>& u);

  const NoiseTrackSample& now() const;
  const StateSpace& model() const;  ///< at the file's values
  /// Samples that a diffuse start has taken to determine the state; nothing while it does not.
  std::optional<Eigen::Index> lead() const;
  /// What is known of the noise now; one point while the file's values are in use.
  PosteriorPoints posterior() const;

 private:
  class Learner;
  std::unique_ptr<Learner> learner_;
};

}  // namespace identikal
