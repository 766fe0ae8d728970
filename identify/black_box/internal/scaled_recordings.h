// Which deviations from which operating point, in units of their own scatter, stand for recordings?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/data/dataset.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {

/// More rows than these change no choice, no error and no picture.
inline constexpr Eigen::Index kEnoughRows = 200000;

/// z = (recorded - at) / sd of every channel, outputs first.
struct OperatingPoint {
  Eigen::VectorXd y, u;        ///< SI
  Eigen::VectorXd y_sd, u_sd;  ///< above 0
};

struct ScaledRecordings {
  OperatingPoint point;
  std::vector<Eigen::MatrixXd> y, u;  ///< of every recording p x N and m x N
  Eigen::Index rows() const;
};

/// With the mean of all rows as operating point.
/// @throws InputError for a channel that never changes, by its name, and for an input with gaps
ScaledRecordings scaled(const std::vector<Dataset>& recordings);

/// The largest mean of a channel, by the channel's own scatter: how far from zero recordings are.
double farthest_mean(const OperatingPoint& point);
/// The same recordings with zero as operating point.
ScaledRecordings from_zero(ScaledRecordings recordings);

/// The first `share` of every recording, and the rest.
struct SplitRecordings {
  ScaledRecordings first, rest;
};
SplitRecordings split(const ScaledRecordings& all, double share);
/// Both as deviations from the means of the first part: held-out rows are not to tell their own.
SplitRecordings about_first_means(SplitRecordings parts);

/// The first rows of recordings, at most so many of all together; the last recording of them may be shortened.
ScaledRecordings first_rows(const ScaledRecordings& all, Eigen::Index rows);

/// A model of scaled recordings in SI: of deviations from the operating point.
InnovationForm in_units(InnovationForm model, const OperatingPoint& point);

}  // namespace identikal
