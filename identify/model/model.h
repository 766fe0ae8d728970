// What does the user mean to be estimated? Equations, parameters, channels and time.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "lib/base/error.h"
#include "lib/data/dataset.h"
#include "lib/formula/expression.h"
#include "lib/model/constraints.h"
#include "lib/model/linear_model.h"
#include "lib/model/nonlinear_model.h"
#include "lib/model/parameter.h"
#include "lib/model/spline_curve.h"
#include "lib/nonlinear/filter.h"
#include "lib/vehicle/axle.h"

namespace identikal {

/// Position of a sensor from the centre of gravity: x forward, y to the left [m] (ISO 8855), and by
/// what angle it is turned to the left [rad].
struct SensorPosition {
  double x = 0.0;
  double y = 0.0;
  double angle = 0.0;
};

/// Recursive least squares of one output. What is not given is chosen from the recording.
struct RegressionModel {
  std::optional<Eigen::Index> inputs, feedback;  ///< orders (lib/regression/lagged_regressors.h)
  std::optional<double> forgetting;              ///< lambda
  std::optional<double> delta;                   ///< P(0) = I / delta
  /// Samples: > 0 makes lambda variable (lib/regression/recursive_least_squares.h).
  double memory = 0.0;
  bool reset = false;  ///< lambda drops for one sample when a change is found
};

/// Rows of a recording that are to be used.
struct RowCondition {
  Expression holds;     ///< a formula of the inputs, then the outputs, SI; not 0 where it holds
  double bridge = 0.0;  ///< where it fails for no longer it counts as holding [s]
  double margin = 0.0;  ///< so near to where it fails rows are not used either [s]
};

/// The built-in single-track vehicle. Its parameters are the model's; inputs[0] is the steering
/// angle, inputs[1] is vx, inputs[2] may be roll; further ones are for `use_when`. Outputs are any
/// of r, vy, ay, beta.
struct VehicleModel {
  /// The input is the road-wheel angle, and steering_ratio is not used.
  bool steering_at_road_wheel = false;
  std::map<std::string, SensorPosition> sensors;  ///< by output name
  std::vector<double> measurement_sd;             ///< SI, per output; NaN = not given
  double min_speed = 3.0;                         ///< rows with vx below it are not used [m/s]
  std::optional<RowCondition> use_when;           ///< besides the speed
  double max_gap = 0.1;         ///< longer ones, and than 3 samples, end a segment [s]
  double steering_steps = 0.0;  ///< of the sensor, bridged [rad]; 0: taken as exact
  double steering_noise = 0.0;  ///< white, of the sensor, corrected for [rad]; 0: none known
  TyreCurve curve = TyreCurve::linear;  ///< of both axles
  std::optional<double> front_drive;    ///< share of the front axle in the drive; nothing: unknown
  RegressionModel tracking;             ///< forgetting, memory and reset of `track`
};

/// Whether roll is one of the vehicle's inputs, inputs[2].
struct Model;
bool has_measured_roll(const Model& model);

/// SI unit of a vehicle's parameter as people write it, "N/rad"; empty where it has none.
std::string vehicle_unit(const std::string& parameter);

/// Formulas that are not linear, or a linear model that changes from sample to sample.
struct FormulaModel {
  /// With second derivatives. Its parameters are the first of the ParameterSet.
  NonlinearModel equations;
  /// G, Q, R, x0 and P0 alone, and what Q is; A, B, C and D hold sizes.
  LinearModel noise;
  /// The state moves linearly, by matrices that hold inputs or time, or over intervals of any
  /// length: `noise` has all of them and the filter is Kalman's own (lib/model/sampled_model.h).
  /// `equations` holds sizes.
  bool linear = false;
  InputPath inputs = InputPath::constant;
  bool irregular = false;     ///< time stamps are taken as they are
  double longest_step = 0.0;  ///< of the integration [s]; 0: as accuracy needs
  /// Error of a log-likelihood by its integration, relative: what is above it is refined, or
  /// reported.
  double integration_tolerance = 1e-6;
  std::vector<bool> wraps;  ///< per output: an angle that is measured up to whole turns
  /// Inputs that are late by a parameter (identify/model/late_inputs.h). Equations have a further
  /// input for each, behind the model's.
  std::vector<ModelFormulas::LateInput> late;
  /// Its outputs are what the standard deviations of R are times, formulas of states, inputs,
  /// parameters and time (lib/nonlinear/filter.h). None: 1.
  std::optional<NonlinearModel> noise_scales;
  NonlinearMethod filter = NonlinearMethod::extended;
  /// Per recording: the state at its first sample, in place of noise.x0. Empty: that for all of
  /// them.
  std::vector<ParametrisedMatrix> starts;
  /// The state at the first sample is where the motion from that start rests while inputs stay at
  /// these numbers, SI; an input without one at its first sample. Empty: the start itself.
  std::optional<std::vector<std::optional<double>>> rests_at;
};

/// Matrices as a FormulaModel that is linear.
FormulaModel changing_model(LinearModel matrices, Eigen::Index inputs, std::size_t parameters);

/// Noise and start of one of the recordings, by its place among them.
LinearModel noise_of_recording(const FormulaModel& model, std::size_t recording);

/// As the command line and results name it.
const char* to_string(NonlinearMethod method);
/// The same of a model's filter: "kalman" where the model is linear.
const char* filter_name(const FormulaModel& model);
/// @throws InputError at this place for another word
NonlinearMethod nonlinear_method(const std::string& name, const Location& at);

/// A state that formulas name.
struct StateName {
  std::string name;
  std::string unit;  ///< the user's; empty: none
};

/// Rows in which an output counts; in the others it is missing.
struct OutputCondition {
  Eigen::Index output = 0;
  Expression holds;  ///< a formula of condition_symbols() (output_conditions.h), SI
  std::string text;  ///< as it was written
};

/// Measurement noise that follows Student's t instead of a normal distribution, every output of its
/// own (identify/noise/student.h).
struct StudentNoise {
  double freedom = 4.0;
  int parameter = -1;  ///< that the degrees of freedom are, where they have a name
};

/// What a model file says of recordings one by one: which parameters have values of their own
/// there, and which of these are known (own_parameters.h).
struct RecordingTable {
  struct Own {
    int parameter = 0;
    std::string label;  ///< one value for all recordings of which this says the same; empty: each
    /// The parameter that is the standard deviation between those values, of their logarithms where
    /// the parameter cannot be negative; the parameter itself is their mean. -1: they have nothing
    /// in common.
    int spread = -1;
  };
  struct Row {
    std::string recording;  ///< the file's name, with or without its ending
    Location at;
    std::map<int, double> numbers;              ///< by parameter: known there, SI
    std::map<int, int> sources;                 ///< by parameter: the one whose value it takes
    std::map<std::string, std::string> labels;  ///< what `Own::label` is here
  };
  std::vector<Own> own;
  bool correlated = false;  ///< are values that have spreads, of one recording?
  std::vector<Row> rows;
  std::map<std::string, double> found;  ///< values from an earlier result, by name, SI

  bool empty() const { return own.empty() && rows.empty(); }
};

/// What another instrument measured of the states. No filter sees it; estimates are compared with
/// it (identify/filter/reference_errors.h).
struct StateReferences {
  std::vector<ChannelSource> channels;
  std::vector<double> sd;     ///< of the reference itself, SI; 0: exact
  NonlinearModel quantities;  ///< its outputs: what each reference is of the states, h(x, u, p, t)
};

/// What is estimated, tested or filtered: read from a file (model_file.h), stated by a program
/// (builder.h) or filled by hand.
///
/// Example:
///
///     if (is_linear(model)) std::printf("%td states\n", as_linear(model).A.constant.rows());
///     for (const Parameter& p : model.parameters) if (!p.fixed) std::puts(p.name.c_str());
struct Model {
  std::string name;
  /// How messages name it: the path of its file, or empty. No part of what the model means.
  std::string source;
  TimeSource time;
  ParameterSet parameters;
  std::vector<ChannelSource> inputs;
  std::vector<ChannelSource> outputs;  ///< of a regression: one
  /// Of a model that is written as formulas, which is a LinearModel where they are linear; else
  /// empty.
  std::vector<StateName> states;
  /// The same: condition on the inputs under which a row is used; its symbols are states, then
  /// inputs.
  std::optional<Expression> use_when;
  /// Of a model that has a filter: where outputs count, and further columns that these ask.
  std::vector<OutputCondition> conditions;
  std::vector<ChannelSource> flags;
  StateReferences references;
  RecordingTable recordings;
  Constraints constraints;              ///< between parameters, by their positions
  std::vector<SplineCurve> curves;      ///< of formulas: functions that parameters stand for
  std::optional<StudentNoise> student;  ///< none: the measurement noise is normal
  std::variant<LinearModel, FormulaModel, VehicleModel, RegressionModel> form;
};

bool is_linear(const Model& model);
bool is_formula_model(const Model& model);  ///< a FormulaModel; linear formulas are no such thing
bool changes(const Model& model);           ///< a FormulaModel that is linear
bool is_vehicle(const Model& model);
bool is_regression(const Model& model);
/// A linear model or formulas: there are states, noise, and so a filter.
bool has_filter(const Model& model);

/// The model's form. @throws std::invalid_argument, naming both, when it has another
const LinearModel& as_linear(const Model& model);
LinearModel& as_linear(Model& model);
const FormulaModel& as_formulas(const Model& model);
FormulaModel& as_formulas(Model& model);
const VehicleModel& as_vehicle(const Model& model);
VehicleModel& as_vehicle(Model& model);
const RegressionModel& as_regression(const Model& model);
RegressionModel& as_regression(Model& model);

/// Noise and start of a model that has a filter: the linear model itself, or what stands beside the
/// formulas. @throws std::invalid_argument for another
const LinearModel& noise_model(const Model& model);
LinearModel& noise_model(Model& model);

}  // namespace identikal
