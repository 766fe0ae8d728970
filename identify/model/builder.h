// How does a program state a model without a file?
//
// A builder says the same as a model file (examples/MODEL_FILE.md), with the same checks and the
// same defaults; every number is in SI. What a file is told as path:line:column, a program is told
// as std::invalid_argument.
#pragma once

#include <concepts>
#include <initializer_list>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "identify/model/recording.h"  // its samples are in memory too
#include "identify/model/yaml_reader.h"

namespace identikal {

/// An entry of a matrix: a number, or a formula of named parameters such as "1 - T/tau".
struct Entry {
  Entry(double value);
  Entry(const char* formula) : text(formula) {}
  Entry(std::string formula) : text(std::move(formula)) {}
  template <std::integral Number>
  Entry(Number value) : Entry(static_cast<double>(value)) {}

  std::string text;
};

/// The entries of a matrix: an Eigen expression, rows of entries, or one entry alone.
struct MatrixEntries {
  MatrixEntries(const Eigen::MatrixXd& values);
  template <typename Derived>
  MatrixEntries(const Eigen::MatrixBase<Derived>& values)
      : MatrixEntries(Eigen::MatrixXd(values)) {}
  MatrixEntries(std::initializer_list<std::initializer_list<Entry>> given);
  MatrixEntries(double value) : rows{{value}} {}
  MatrixEntries(const char* formula) : rows{{formula}} {}

  std::vector<std::vector<Entry>> rows;
};

/// The covariance of a noise: known, written with named parameters, or unknown.
struct NoiseCovariance {
  template <typename Entries>
  requires std::constructible_from<MatrixEntries, Entries> NoiseCovariance(const Entries& values)
      : entries(values) {}
  NoiseCovariance(std::initializer_list<std::initializer_list<Entry>> rows) : entries(rows) {}

  enum class Structure { as_written, times_identity, diagonal, full };
  Structure structure = Structure::as_written;
  MatrixEntries entries;                                ///< Structure::full: the start
  std::vector<std::pair<std::string, double>> unknown;  ///< variances and their starts
};

/// q I with one unknown variance q.
NoiseCovariance variance(const std::string& name, double start = 1.0);
/// A diagonal of unknown variances: variances({{"q1", 1.0}, {"q2", 0.1}}).
NoiseCovariance variances(const std::vector<std::pair<std::string, double>>& unknown);
/// A positive definite matrix that is unknown as a whole.
NoiseCovariance full_covariance(const Eigen::MatrixXd& start);

/// Between which values a parameter is searched for.
struct Limits {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};

/// x(t+1) = A x(t) + B u(t) + G w(t), y(t) = C x(t) + D u(t) + v(t), cov(w, v) = S; with
/// continuous(): dx/dt = A x + B u + G w. Not given: B, D and S are zero, G is the identity,
/// channels are named y1, y2, ... and u1, u2, ... (y and u where there is one), the sampling period
/// is the recording's.
///
/// Example:
///
///     const Model tracker = linear_model().A({{1, 0.1}, {0, 1}}).G({{0.005}, {0.1}}).C({{1, 0}})
///         .process_noise(variance("q")).measurement_noise(variance("r")).diffuse();
///
/// Source: Matisko (2013), section 2.1. The conversion checks what a model file's reader checks.
/// @throws std::invalid_argument from the conversion: a matrix missing or of another size (both
///   sizes are named), NaN, an unknown name in a formula, a parameter that nothing uses, a
///   covariance that is not symmetric or has a negative variance, a joint covariance [Q S; S' R]
///   that is indefinite
class LinearModelBuilder {
 public:
  LinearModelBuilder& A(const MatrixEntries& entries);  ///< n x n
  LinearModelBuilder& B(const MatrixEntries& entries);  ///< n x inputs
  LinearModelBuilder& C(const MatrixEntries& entries);  ///< outputs x n
  LinearModelBuilder& D(const MatrixEntries& entries);  ///< outputs x inputs
  LinearModelBuilder& G(const MatrixEntries& entries);  ///< n x process noises
  LinearModelBuilder& S(const MatrixEntries& entries);  ///< process noises x outputs
  LinearModelBuilder& process_noise(NoiseCovariance Q);
  LinearModelBuilder& measurement_noise(NoiseCovariance R);
  /// A parameter that formulas name, and that is estimated from this start.
  LinearModelBuilder& parameter(const std::string& name, double start, const Limits& limits = {});
  /// A parameter that formulas name, and that is known.
  LinearModelBuilder& known(const std::string& name, double value);
  /// Names, one per channel.
  LinearModelBuilder& inputs(const std::vector<std::string>& names);
  LinearModelBuilder& outputs(const std::vector<std::string>& names);
  /// Sampling period [s].
  LinearModelBuilder& step(double seconds);
  /// A, B and G are those of dx/dt; Q is the noise's density, or with per_sample its covariance
  /// over one period.
  LinearModelBuilder& continuous(ProcessNoise noise = ProcessNoise::density);
  LinearModelBuilder& diffuse();     ///< nothing is known of the first state
  LinearModelBuilder& stationary();  ///< the default; A has to be stable
  /// The first state is distributed with this mean, n, and covariance, n x n.
  LinearModelBuilder& initial(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance);
  /// "a + b = 2.6 m", "k1 < k2": what has to hold between parameters, as a model file has it.
  LinearModelBuilder& constraint(const std::string& condition);
  LinearModelBuilder& name(const std::string& text);

  operator Model() const;

 private:
  YamlNode model_;
  std::optional<NoiseCovariance> Q_, R_;
};
inline LinearModelBuilder linear_model() { return {}; }

/// dx/dt = f(x, u, p, t) (with discrete(): x(t+1) = f), y = h(x, u, p, t), written as formulas.
///
/// Example:
///
///     const Model pendulum = formula_model()
///         .state("angle", "rate").state("rate", "-g/l*sin(angle)").output("angle")
///         .parameter("l", 0.8, {0.1, 5}).parameter("q", 0.02, {0}).process_variance("rate", "q")
///         .measurement_variance("angle", 1e-4).initial("angle", 0.3, 0.1).initial("rate", 0, 0.2);
///
/// @throws std::invalid_argument from the conversion, as LinearModelBuilder; a formula's mistake
///   with its column
class FormulaModelBuilder {
 public:
  /// @param dynamics  its rate of change, or with discrete() its next value
  FormulaModelBuilder& state(const std::string& name, const std::string& dynamics);
  FormulaModelBuilder& input(const std::string& name);
  /// One that reaches the model late by a parameter, with min and max, or by "0.1 s".
  FormulaModelBuilder& late_input(const std::string& name, const std::string& delay);
  /// @param equals  a formula; without it the state of that name
  FormulaModelBuilder& output(const std::string& name, const std::string& equals = "");
  /// A name for a formula, that those after it may use.
  FormulaModelBuilder& define(const std::string& name, const std::string& formula);
  FormulaModelBuilder& parameter(const std::string& name, double start, const Limits& limits = {});
  FormulaModelBuilder& known(const std::string& name, double value);
  /// Of the noise in a state's equation: its density, with discrete() its variance. States without
  /// one have none.
  FormulaModelBuilder& process_variance(const std::string& state, const Entry& value);
  FormulaModelBuilder& measurement_variance(const std::string& output, const Entry& value);
  /// The first state's mean and standard deviation; 0 and exact where not given.
  FormulaModelBuilder& initial(const std::string& state, const Entry& mean, const Entry& sd = 0.0);
  FormulaModelBuilder& discrete();
  FormulaModelBuilder& inputs_held(InputPath path);  ///< between samples; constant by default
  FormulaModelBuilder& step(double seconds);         ///< sampling period [s]
  /// "a + b = 2.6 m", "k1 < k2": what has to hold between parameters, as a model file has it.
  FormulaModelBuilder& constraint(const std::string& condition);
  FormulaModelBuilder& name(const std::string& text);

  operator Model() const;

 private:
  YamlNode model_;
  bool discrete_ = false;
};
inline FormulaModelBuilder formula_model() { return {}; }

/// The single-track vehicle (examples/MODEL_FILE.md), axes and signs of ISO 8855. Its inputs are
/// the steering-wheel angle [rad], or with road_wheel_angle() that of the road wheels, and the
/// speed vx [m/s].
///
/// Example:
///
///     const Model car = vehicle_model()
///         .known("m", 1446).known("a", 0.987).known("b", 1.525).known("steering_ratio", 21)
///         .parameter("Iz", 2000).parameter("Cf", 8e4).parameter("Cr", 8e4)
///         .output("r").output("vy");
///
/// @throws std::invalid_argument from the conversion: a parameter that is missing, unknown, or
///   outside of what it may be
class VehicleModelBuilder {
 public:
  /// Estimated from this start: m [kg], a, b [m], Iz [kg m^2], Cf, Cr [N/rad] per axle,
  /// steering_ratio, ...
  VehicleModelBuilder& parameter(const std::string& name, double start, const Limits& limits = {});
  VehicleModelBuilder& known(const std::string& name, double value);
  /// @param name  "r" [rad/s], "vy" [m/s], "ay" [m/s^2] or "beta" [rad]
  /// @param sd    of its noise, above 0; without it the residuals tell
  VehicleModelBuilder& output(const std::string& name, std::optional<double> sd = std::nullopt);
  VehicleModelBuilder& sensor(const std::string& output, const SensorPosition& position);
  VehicleModelBuilder& road_wheel_angle();
  VehicleModelBuilder& tyre(TyreCurve curve);
  VehicleModelBuilder& min_speed(double metres_per_second);  ///< rows below it are not used
  VehicleModelBuilder& max_gap(
      double seconds);  ///< longer ones begin a new segment; 0.1 without it
  /// "a + b = 2.6 m", "k1 < k2": what has to hold between parameters, as a model file has it.
  VehicleModelBuilder& constraint(const std::string& condition);
  VehicleModelBuilder& name(const std::string& text);

  operator Model() const;

 private:
  YamlNode model_;
  std::string steering_ = "steering_wheel_angle";
};
inline VehicleModelBuilder vehicle_model() { return {}; }

}  // namespace identikal
