// What does the user mean to be estimated? Equations, parameters, channels and time.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lib/base/error.h"
#include "lib/data/dataset.h"
#include "lib/formula/expression.h"
#include "lib/model/linear_model.h"
#include "lib/model/nonlinear_model.h"
#include "lib/model/parameter.h"
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

/// What the built-in single-track vehicle needs beyond its parameters.
struct VehicleSettings {
  /// The input is the road-wheel angle, and steering_ratio is not used.
  bool steering_at_road_wheel = false;
  std::map<std::string, SensorPosition> sensors;  ///< by output name
  std::vector<double> measurement_sd;             ///< SI, per output; NaN = not given
  double min_speed = 3.0;                         ///< rows with vx below it are not used [m/s]
  TyreCurve curve = TyreCurve::linear;            ///< of both axles
};

/// SI unit of a vehicle's parameter as people write it, "N/rad"; empty where it has none.
std::string vehicle_unit(const std::string& parameter);

/// How recursive least squares runs. What is not given is chosen from the recording.
struct RegressionSettings {
  std::optional<Eigen::Index> inputs, feedback;  ///< orders (lib/regression/lagged_regressors.h)
  std::optional<double> forgetting;              ///< lambda
  std::optional<double> delta;                   ///< P(0) = I / delta
  /// Samples: > 0 makes lambda variable (lib/regression/recursive_least_squares.h).
  double memory = 0.0;
  bool reset = false;  ///< lambda drops for one sample when a change is found
};

/// A state that formulas name.
struct StateName {
  std::string name;
  std::string unit;  ///< the user's; empty: none
};

/// How the formulas of a model file are used.
struct FormulaSettings {
  InputPath inputs = InputPath::constant;
  bool irregular = false;     ///< time stamps are taken as they are
  double longest_step = 0.0;  ///< of the integration [s]; 0: as accuracy needs
  NonlinearMethod filter = NonlinearMethod::extended;
  /// Condition on the inputs under which a row is used; its symbols are states, then inputs.
  std::optional<Expression> use_when;
  /// Form::nonlinear, with second derivatives. Its parameters are the first of the ParameterSet;
  /// what noise and start depend on is in `linear`.
  NonlinearModel model;
};

/// As the command line and results name it.
const char* to_string(NonlinearMethod method);
/// @throws InputError at this place for another word
NonlinearMethod nonlinear_method(const std::string& name, const Location& at);

struct ModelFile {
  enum class Form { linear, nonlinear, single_track, regression };
  std::string path;
  std::string name;
  Form form = Form::linear;
  TimeSource time;
  ParameterSet parameters;
  std::vector<ChannelSource> inputs;   ///< single-track: [0] is the steering angle, [1] is vx
  std::vector<ChannelSource> outputs;  ///< single-track: any of r, vy, ay, beta; regression: one
  LinearModel linear;                  ///< Form::linear; Form::nonlinear: G, Q, R, x0 and P0 alone
  std::vector<StateName> states;       ///< of a model that is written as formulas; else empty
  FormulaSettings formulas;            ///< the same
  VehicleSettings vehicle;             ///< Form::single_track only
  RegressionSettings regression;       ///< Form::regression; Form::single_track when tracked
};

}  // namespace identikal
