// How probable are noise covariances as samples arrive, and when did they change?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "identify/noise/bayes.h"
#include "identify/noise/noise_tracker.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"

namespace identikal {

struct NoiseTrack {
  /// k x N: free entries (lib/model/parameter.h) given the samples up to t; sd is NaN while the
  /// file's values are in use.
  Eigen::MatrixXd mean, sd;
  Eigen::VectorXd log_alarm;         ///< N: logarithm of the test statistic; -infinity without test
  double log_threshold = 0.0;        ///< where it rejects
  std::vector<NoiseChange> changes;  ///< in time
  FilterResult filter;               ///< the mixture of the draws' filters, ahead of each sample
  /// At the end; one point while the file's values are in use. Its summary says `stopped` where
  /// progress() returned false: everything here then ends with that sample.
  PosteriorPoints posterior;
};

/// Recursive posterior of the noise (solvers/recursive_posterior.h) along one recording: a
/// NoiseTracker (identify/noise/noise_tracker.h) takes its samples one after the other. The
/// adaptive form compares it, sample by sample, with a bank of filters whose noise is the present
/// estimate with one variance, one matrix or all of it 10 or 3.2 times larger or smaller, and 200
/// draws from the prior:
///
///   S_i(t) = (1 + S_i(t-1)) p_i(y(t) | past) / p(y(t) | past),   reject when sum_i v_i S_i > A
///
/// (Shiryaev & Roberts; Pollak 1985). As every p_i is a density given the past, sum_i v_i S_i(t) -
/// t is a martingale while the noise is what it is taken for, and A is a lower bound of the mean
/// number of samples before a false alarm. One sample can raise log S by a third of log A at most:
/// a single outlier rejects only when it is so large that the samples behind it suffer as well.
/// Unlike a test of whiteness it sees noise that changes its size alone, and needs no window.
///
/// Example:
///
///     const NoiseTrack course = track_noise(model, recordings[0]);
///     const Eigen::VectorXd noise_now = course.mean.rightCols(1), sd = course.sd.rightCols(1);
///
/// Source: Matisko (2013), sections 3.3.4 and 4.6.
/// @throws InputError where the filter cannot run, or something other than noise is free
NoiseTrack track_noise(const Model& model, const Dataset& recording,
                       const NoiseTrackOptions& options = {});

/// The same as a result: the noise at the end with its credible intervals, the changes, the
/// innovations of the filter as it was at each sample, and the whole course
/// (TrackedNoise::time_history).
/// @throws InputError as check_recordings() and track_noise()
TrackedNoise track(const Model& model, const Dataset& recording,
                   const NoiseTrackOptions& options = {});

}  // namespace identikal
