// A recording as the mathematics sees it: SI units, time along columns, NaN where a sample is missing.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "lib/csv.h"
#include "lib/error.h"

namespace identikal {

/// One channel of a Dataset. The unit is the one the user works in; values are SI.
struct Channel {
  std::string name;
  std::string unit;
};

struct Dataset {
  std::string name;
  double dt = 0.0;              ///< sampling period [s]; the median step when time stamps are given
  Eigen::VectorXd time;         ///< N [s], strictly increasing
  Eigen::MatrixXd u;            ///< nu x N, SI, NaN = missing
  Eigen::MatrixXd y;            ///< ny x N, SI, NaN = missing
  std::vector<Channel> inputs;  ///< nu
  std::vector<Channel> outputs; ///< ny
  Eigen::Index size() const { return time.size(); }
};

/// Where one channel of a model comes from.
struct ChannelSource {
  std::string name;         ///< the model's name of it
  std::string column;       ///< column of the file; by name, or its number from 1
  std::string unit;         ///< unit the column is in; empty = take the file's, else SI
  std::string si_unit;      ///< what the model works in, e.g. "rad/s"; empty = anything, no check
  Location at;              ///< where the model file says so, for error messages
};

/// Where time comes from: a column, or a fixed step.
struct TimeSource {
  std::string column;  ///< empty: no time column, rows are `step` apart
  std::string unit;    ///< unit of the column; empty = the file's, else s
  double step = 0.0;   ///< [s]; with a column: the expected step, or 0 to take the median
  Location at;
};

/// Which rows to use, in seconds from the first row's time. Infinite = no limit.
struct TimeRange {
  double from;
  double to;
  TimeRange();
};

/// Builds the dataset of a table: picks the columns, converts to SI, checks time.
/// Time stamps are kept as recorded (offset so that the first row is at its recorded value). Nothing is interpolated
/// or resampled.
/// @throws InputError for a column that does not exist (nearest name offered), text in a used cell (its line
///   and column), an unknown unit, a unit of another dimension than si_unit, a missing, duplicate or backward time
///   stamp (its line), a column without any number, a file whose header unit and model unit disagree in
///   dimension, or no row inside the range.
Dataset make_dataset(const Table& table, const TimeSource& time,
                     const std::vector<ChannelSource>& inputs,
                     const std::vector<ChannelSource>& outputs, const TimeRange& range = {});

/// Puts a recording onto the uniform raster that a discrete-time model needs: rows whose time stamps are a
/// whole number of steps apart (within `tolerance` of a step) keep their values, rows that are absent become missing samples.
/// @throws InputError when a time stamp is not on the raster, or the filled record would exceed ten times the rows.
Dataset on_uniform_raster(const Dataset& data, double step, double tolerance = 0.01);

}  // namespace identikal
