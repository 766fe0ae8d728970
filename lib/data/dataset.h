// A recording as the mathematics sees it: SI units, time along columns, NaN where a sample is
// missing.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lib/base/alignment.h"
#include "lib/base/error.h"
#include "lib/data/csv.h"
#include "lib/data/transform.h"

namespace identikal {

/// One channel of a Dataset. The unit is the one the user works in; values are SI.
struct Channel {
  std::string name;
  std::string unit;
  bool is_pseudo = false;  ///< an output that nobody measures: its number stands in the model
  Transform transform = Transform::none;  ///< of the values that are in the Dataset
};

/// A parameter that has a value of its own in a recording.
struct OwnParameter {
  int parameter = 0;  ///< of the model, 0-based
  int source = 0;     ///< the one whose value it takes
};

/// An input that a model takes as late by an unknown time: what was recorded of it, with the
/// samples before and behind those that are used.
struct LateRecord {
  int input = 0;           ///< 0-based
  Eigen::VectorXd time;    ///< M [s], rising
  Eigen::VectorXd values;  ///< M, SI
};

struct Dataset {
  std::string name;      ///< of the file, without its folder
  double dt = 0.0;       ///< sampling period [s]: the step given, else the median step
  Eigen::VectorXd time;  ///< N [s], strictly increasing
  /// N [s]: as recorded, where `time` differs; else empty. Infinite where the state has come to
  /// rest, behind all others.
  Eigen::VectorXd stamps;
  std::vector<Eigen::Index> absent;  ///< rows that it has put in where none was recorded, rising
  Eigen::MatrixXd u;                 ///< nu x N, SI, NaN = missing
  Eigen::MatrixXd y;                 ///< ny x N, SI, NaN = missing
  /// ny x N, above 0: what the standard deviation of each sample's measurement noise is times its
  /// model's. Where all are 1: 0 x 0.
  Eigen::MatrixXd noise_scale;
  /// Where the filter of a nonlinear model begins, in place of the model's start: mean, n, and
  /// covariance, n x n. Empty: the model's.
  Eigen::VectorXd start_mean;
  Eigen::MatrixXd start_covariance;
  /// Parameters whose values here are those of others (identify/model/own_parameters.h).
  std::vector<OwnParameter> own;
  std::vector<LateRecord> late;  ///< none: what u holds
  std::vector<Channel> inputs;   ///< nu
  std::vector<Channel> outputs;  ///< ny
  /// nr x N, SI, NaN = missing: what another instrument measured, for comparison alone. Where there
  /// is none: 0 x 0.
  Eigen::MatrixXd reference;
  std::vector<Channel> references;         ///< nr
  std::vector<std::string> notes;          ///< what was done to recorded values beyond their units
  std::vector<std::string> unknown_units;  ///< sentences on those that the model file overrules
  /// "after a missing input": why rows before are not in it; empty: it has all.
  std::string begins;
  Eigen::Index size() const { return time.size(); }
};

/// Where one channel of a model comes from.
struct ChannelSource {
  std::string name;     ///< the model's name of it
  std::string column;   ///< column of the file; by name, or its number from 1
  std::string unit;     ///< unit the column is in; empty = take the file's, else SI
  std::string si_unit;  ///< what the model works in, e.g. "rad/s"; empty = anything, no check
  Location at;          ///< where the model file says so, for error messages
  // value = scale * recorded + offset in the column's unit, then SI.
  double scale = 1.0;
  double offset = 0.0;  ///< in the column's unit
  double delay = 0.0;   ///< [s]: what is recorded at t was there at t - delay
  bool wraps = false;   ///< an angle: values that are a turn apart are the same
  /// A pseudo-measurement: this number, SI, in place of a column.
  std::optional<double> value = std::nullopt;
  bool empty_is_zero = false;  ///< a missing value is 0, as of doses
  Transform transform = Transform::none;
};

/// Where time comes from: a column, or a fixed step.
struct TimeSource {
  std::string column;  ///< empty: no time column, rows are `step` apart and the first is at 0
  std::string unit;    ///< unit of the column; empty = the file's, else s
  double step = 0.0;   ///< [s]; with a column: the expected step, or 0 to take the median
  Location at;
  bool restarts = false;  ///< several runs in one file: each begins where the stamps go back
  /// Rows may be absent: stamps that are different whole numbers of `step` apart are taken,
  /// wherever their median lies.
  bool rows_absent = false;
  /// Rows may have one time: each is a sample of its own, behind the one before by next to nothing.
  bool replicates = false;
  bool infinite = false;  ///< the last rows may have the time infinity: the state has come to rest
};

/// Which rows to use, in seconds from the first row's time, both ends included. Infinite = no
/// limit.
struct TimeRange {
  double from;
  double to;
  TimeRange();
};

/// True for a name like "t", "t_s", "Time" or "INS_time_sec".
bool looks_like_time(const Column& column);

/// The unit of such a column: its own where that is one of time, else the last word of the unit
/// ("GPS ns") or of the name ("t_ms"), else what makes the first stamp a time between 1973 and 2286
/// that counts from 1970; "s" where nothing says so.
std::string time_unit(const Column& column);

/// A column's values from the first one on, to the last digit that is written: of epoch times in ns
/// doubles hold every 256th alone. As they are where doubles hold all of them.
///
/// Example:
///
///     const Table table = read_csv("drive.csv");
///     const std::vector<double> ns = exact_stamps(*table.find("stamp"));
///     std::printf("%g ns long\n", ns.back() - ns.front());
std::vector<double> exact_stamps(const Column& column);

/// The runs of a table whose time stamps restart: one table wherever a stamp is not above the one
/// before it; itself when time.restarts is false. Throws InputError for a run of one row alone.
std::vector<Table> split_runs(const Table& table, const TimeSource& time);

/// Time stamps of a table in seconds.
/// @param time  its column must be named
/// @throws InputError as make_dataset() for the column, its unit and its stamps
Eigen::VectorXd time_stamps(const Table& table, const TimeSource& time);

/// Builds the dataset of a table: picks the columns, converts to SI, checks time. Time stamps are
/// kept as recorded: nothing is shifted, interpolated or resampled, but for a channel with a delay:
/// its value at t is what was recorded at t + delay, interpolated linearly between neighbouring
/// samples no further apart than kBridgedPeriods of the channel's own period, else missing. Scale,
/// offset and delay that are not neutral are reported in the notes.
///
/// The unit of a column is the model's, else the file's, else SI. When both give one they must
/// agree: two scales for one column (deg and rad) are a conflict that only the user can settle.
///
/// Example:
///
///     const Table table = read_csv("drive.csv");
///     const ChannelSource r{.name = "r", .column = "yaw_rate", .si_unit = "rad/s"};
///     const Dataset data = make_dataset(table, {.column = "time"}, {}, {r});
///
/// @throws InputError for a column that does not exist (nearest name offered), text in a used
/// column
///   (line and column of the first), an unknown unit, a unit of another dimension than si_unit, a
///   unit in the file that contradicts the model's, a missing, duplicate or backward time stamp
///   (its line), a median step more than 1 % off the step given (but for rows_absent), neither time column nor step, a
///   column without any number in the range, fewer than two time stamps, no row inside the
///   range, a time that is infinite where it may not be, or a value whose logarithm is to be taken and
///   that is not above zero (its line).
/// @param references  columns that may be absent or without numbers: a note says so
/// @throws std::invalid_argument when an si_unit is not a unit.
Dataset make_dataset(const Table& table, const TimeSource& time,
                     const std::vector<ChannelSource>& inputs,
                     const std::vector<ChannelSource>& outputs, const TimeRange& range = {},
                     const std::vector<ChannelSource>& references = {});

/// The first row whose time is infinity, 0-based; size() where there is none.
Eigen::Index first_at_rest(const Dataset& data);

/// By how much the log-density of each row as it was recorded, SI, is above that of its transformed
/// values: the sum of log |dz/dy| of what was measured, -log y of z = log y. Empty where no output
/// is transformed.
Eigen::VectorXd log_jacobian(const Dataset& data);

/// The first `count` rows, or all when there are fewer.
Dataset first_samples(const Dataset& data, Eigen::Index count);

/// The rows from number `first` (0-based) on.
Dataset samples_from(const Dataset& data, Eigen::Index first);

/// Are the times whole numbers of steps apart, to 1 % of a step, and not all a multiple of one
/// number? Then rows are absent from a grid of that step: 0.2 s and 0.3 s of one of 0.1 s, where
/// 0.2 s throughout are a grid of their own.
///
/// Example:
///
///     const Eigen::VectorXd stamps{{0.0, 0.2, 0.5}};
///     if (has_rows_absent(stamps, 0.1)) std::puts("a grid of 0.1 s, rows are absent");
bool has_rows_absent(const Eigen::VectorXd& time, double step);

/// Puts a recording onto the uniform sampling grid that a discrete-time model needs: rows whose
/// time stamps are a whole number of steps apart keep their values, rows that are absent become
/// missing samples. Each distance between neighbours counts, so a clock that runs slightly fast or
/// slow stays on the sampling grid; the result's time is exactly first + k step, its stamps are the
/// recorded ones, and whole steps behind the row before where a row is absent.
/// @param step       [s], positive
/// @param tolerance  how far a distance may be from a whole number of steps, in steps
/// @throws InputError when a time stamp is not on the sampling grid, or the filled record would
/// exceed ten
///   times the rows.
/// @throws std::invalid_argument when step is not positive and finite.
Dataset on_uniform_grid(const Dataset& data, double step, double tolerance = 0.01);

}  // namespace identikal
