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
  Eigen::VectorXd y, u;        ///< SI; 0 where recordings do not tell it from 0
  Eigen::VectorXd y_sd, u_sd;  ///< above 0
};

struct ScaledRecordings {
  OperatingPoint point;
  std::vector<Eigen::MatrixXd> y, u;  ///< of every recording p x N and m x N
  Eigen::Index rows() const;
};

/// The operating point is the mean of all rows, unless every channel's mean is within two of its standard errors
/// of zero: then they are deviations already, and a mean would be noise.
/// @throws InputError for a channel that never changes, by its name, and for an input with gaps
ScaledRecordings scaled(const std::vector<Dataset>& recordings);

/// The first `share` of every recording, and the rest.
struct SplitRecordings {
  ScaledRecordings first, rest;
};
SplitRecordings split(const ScaledRecordings& all, double share);

/// The first rows of recordings, at most so many of all together; the last recording of them may be shortened.
ScaledRecordings first_rows(const ScaledRecordings& all, Eigen::Index rows);

/// A model of scaled recordings in SI: of deviations from the operating point.
InnovationForm in_units(InnovationForm model, const OperatingPoint& point);

}  // namespace identikal
