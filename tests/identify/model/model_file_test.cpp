#include "identify/model/model_file.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iomanip>
#include <iterator>
#include <limits>
#include <numbers>
#include <random>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

namespace identikal {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::string kLinear = R"(identikal: 1
name: demo
time: {kind: discrete, step: 0.5 s}
parameters:
  q: {value: 2, min: 0}
  r: 3
A: [[0.9, 0.1], [0, 0.5]]
C: [[1, 0]]
Q: [[q, 0], [0, 1]]
R: [[r]]
outputs: [{name: y, column: level}]
)";

const std::string kVehicle = R"(identikal: 1
name: car
model: single-track
time: {column: t, unit: s}
parameters:
  m: 1446 kg
  a: 987 mm
  b: 1.525 m
  steering_ratio: 21
  Iz: {value: 2000 kg m^2, min: 800, max: 6000}
  Cf: {value: 80 kN/rad}
  Cr: {value: 80, unit: kN/rad, min: 10 kN/rad, max: 4e5 N/rad}
inputs: {vx: {column: speed, unit: km/h}, steering_wheel_angle: {column: swa, unit: deg}}
outputs: {r: {column: 3, unit: deg/s}, vy: {column: vy}}
)";

const std::string kTopKeys =
    "identikal, name, model, time, parameters, inputs, outputs, noise, use_when, reference, "
    "include, recordings, spreads, constraints, A, B, C, "
    "D, G, Q, "
    "R, S, initial, driven_axle, flags, load_transfer, max_gap, roll, sensors, tyre, regression, "
    "states, let, "
    "dynamics, "
    "doses";
const std::string kVehicleKeys =
    "m, a, b, Iz, Cf, Cr, steering_ratio, steering_gain, steering_offset, steering_delay, "
    "steering_lag, bias_r, "
    "bias_vy, bias_ay, mounting_angle, bank, relaxation_length, cg_height, load_sensitivity, "
    "steering_compliance";

std::string replaced(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("'" + from + "' is not in the text");
  return text.substr(0, at) + to + text.substr(at + from.size());
}

// One file per process and test: ctest runs the tests side by side.
class ModelFileTest : public testing::Test {
 protected:
  ModelFileTest()
      : path_((std::filesystem::temp_directory_path() /
               ("model_file_" + std::to_string(getpid()) + ".yaml"))
                  .string()) {}
  ~ModelFileTest() override { std::filesystem::remove(path_); }

  Model read(const std::string& text) const {
    std::ofstream(path_, std::ios::binary) << text;
    return read_model_file(path_);
  }

  /// The message without the path, or "no error".
  std::string error_of(const std::string& text) const {
    try {
      read(text);
    } catch (const InputError& error) {
      const std::string message = error.what();
      return message.starts_with(path_ + ":") ? message.substr(path_.size() + 1) : message;
    }
    return "no error";
  }

  std::string path_;
};

std::string error_of_setting(Model model, const std::string& assignment) {
  try {
    set_parameter(model, assignment);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

std::string example(const std::string& name) {
  return std::string(IDENTIKAL_SOURCE_DIR) + "/examples/" + name;
}

const Parameter& named(const Model& model, const std::string& name) {
  const int index = find_parameter(model.parameters, name);
  if (index < 0) throw std::logic_error("no parameter " + name);
  return model.parameters[index];
}

Eigen::MatrixXd matrix(std::initializer_list<std::initializer_list<double>> rows) {
  Eigen::MatrixXd out(rows.size(), rows.begin()->size());
  Eigen::Index i = 0;
  for (const auto& row : rows) {
    Eigen::Index j = 0;
    for (const double value : row) out(i, j++) = value;
    ++i;
  }
  return out;
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST_F(ModelFileTest, ReadsTheNileExample) {
  const Model model = read_model_file(example("nile.yaml"));
  EXPECT_TRUE(is_linear(model));
  EXPECT_EQ(model.name, "Nile");
  EXPECT_EQ(model.source, example("nile.yaml"));
  EXPECT_EQ(model.time.step, 1.0);
  EXPECT_EQ(model.time.column, "");
  ASSERT_EQ(model.parameters.size(), 2U);
  EXPECT_EQ(model.parameters[0].name, "q");
  EXPECT_EQ(model.parameters[0].scalar(), 1000.0);
  EXPECT_EQ(model.parameters[0].min, 0.0);
  EXPECT_FALSE(model.parameters[0].fixed);
  EXPECT_EQ(model.parameters[1].scalar(), 1000.0);
  EXPECT_EQ(as_linear(model).initial, InitialState::diffuse);
  const StateSpace at = instantiate(as_linear(model), model.parameters);
  check_shapes(at);
  EXPECT_EQ(at.A, matrix({{1}}));
  EXPECT_EQ(at.G, matrix({{1}}));
  EXPECT_EQ(at.Q, matrix({{1000}}));
  EXPECT_EQ(at.R, matrix({{1000}}));
  EXPECT_EQ(at.inputs(), 0);
  ASSERT_EQ(model.outputs.size(), 1U);
  EXPECT_EQ(model.outputs[0].name, "level");
  EXPECT_EQ(model.outputs[0].column, "volume");
  EXPECT_EQ(model.outputs[0].unit, "");
  EXPECT_EQ(model.outputs[0].at.path, model.source);
  EXPECT_EQ(model.outputs[0].at.line, 15);
  EXPECT_EQ(model.outputs[0].at.column, 33);
}

TEST_F(ModelFileTest, ReadsTheSystem7Example) {
  const Model model = read_model_file(example("system7.yaml"));
  ASSERT_EQ(model.parameters.size(), 2U);
  EXPECT_EQ(model.parameters[0].name, "Q");
  EXPECT_EQ(model.parameters[0].domain, Domain::diagonal);
  EXPECT_EQ(model.parameters[0].value, Eigen::MatrixXd::Identity(3, 3));
  EXPECT_EQ(model.parameters[1].name, "R");
  EXPECT_EQ(model.parameters[1].value, Eigen::MatrixXd::Identity(2, 2));
  EXPECT_EQ(as_linear(model).Q.block, 0);
  EXPECT_EQ(as_linear(model).R.block, 1);
  EXPECT_EQ(as_linear(model).initial, InitialState::stationary);
  const StateSpace at = instantiate(as_linear(model), model.parameters);
  check_shapes(at);
  EXPECT_EQ(at.A,
            matrix({{0.9, 0, 1, 1}, {0, -0.8, 0, -1}, {0, -0.1, 0.85, 1}, {-0.2, 0, 0, -0.9}}));
  EXPECT_EQ(at.G, matrix({{0, 0, 0.1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}));
  EXPECT_EQ(at.C, matrix({{1, 0, 0, 1}, {0, 1, 1, 0}}));
  EXPECT_EQ(at.S, Eigen::MatrixXd::Zero(3, 2));
  EXPECT_EQ(model.outputs[1].column, "2");
}

TEST_F(ModelFileTest, ReadsTheLaneChangeExample) {
  const Model model = read_model_file(example("severe_lane_change.yaml"));
  EXPECT_TRUE(is_vehicle(model));
  std::vector<std::string> names, free;
  for (const Parameter& p : model.parameters) {
    names.push_back(p.name);
    if (!p.fixed) free.push_back(p.name);
  }
  EXPECT_THAT(names, ElementsAre("m", "a", "b", "Iz", "Cf", "Cr", "steering_ratio", "steering_gain",
                                 "steering_offset", "steering_delay", "steering_lag", "bias_r",
                                 "bias_vy", "bias_ay", "mounting_angle", "bank",
                                 "relaxation_length", "cg_height", "load_sensitivity"));
  EXPECT_THAT(free, ElementsAre("Iz", "Cf", "Cr"));
  EXPECT_EQ(named(model, "Iz").scalar(), 2000.0);
  EXPECT_EQ(named(model, "Cf").min, 1e4);
  EXPECT_EQ(named(model, "Cr").max, 4e5);
  EXPECT_EQ(model.inputs[0].name, "steering_wheel_angle");
  EXPECT_EQ(model.inputs[0].si_unit, "rad");
  EXPECT_EQ(model.inputs[1].name, "vx");
  EXPECT_EQ(model.inputs[1].unit, "km/h");
  EXPECT_EQ(model.outputs[0].name, "r");
  EXPECT_EQ(model.outputs[0].si_unit, "rad/s");
  EXPECT_EQ(model.outputs[1].name, "vy");
  EXPECT_THAT(as_vehicle(model).measurement_sd, ElementsAre(0.01, 0.03));
  EXPECT_EQ(as_vehicle(model).min_speed, 5.0);
  EXPECT_FALSE(as_vehicle(model).steering_at_road_wheel);
}

TEST_F(ModelFileTest, VehicleValuesAreSiAndKeepTheUsersUnit) {
  const Model model = read(kVehicle);
  EXPECT_DOUBLE_EQ(named(model, "a").scalar(), 0.987);
  EXPECT_EQ(named(model, "a").unit, "mm");
  EXPECT_TRUE(named(model, "a").fixed);
  EXPECT_DOUBLE_EQ(named(model, "Cf").scalar(), 8e4);
  EXPECT_EQ(named(model, "Cf").unit, "kN/rad");
  EXPECT_FALSE(named(model, "Cf").fixed);
  EXPECT_DOUBLE_EQ(named(model, "Cf").min, 80.0) << "a free positive parameter stays above zero";
  EXPECT_EQ(named(model, "Cf").max, kInfinity);
  EXPECT_DOUBLE_EQ(named(model, "Cr").scalar(), 8e4);
  EXPECT_DOUBLE_EQ(named(model, "Cr").min, 1e4);
  EXPECT_DOUBLE_EQ(named(model, "Cr").max, 4e5);
  EXPECT_EQ(named(model, "Iz").min, 800.0);
  EXPECT_EQ(named(model, "steering_gain").scalar(), 1.0);
  EXPECT_EQ(named(model, "steering_gain").unit, "");
  EXPECT_EQ(named(model, "bank").scalar(), 0.0);
  EXPECT_EQ(named(model, "bank").unit, "rad");
  EXPECT_EQ(model.inputs[0].column, "swa") << "steering comes first whatever the file's order";
  EXPECT_EQ(model.inputs[0].at.line, 13);
  EXPECT_EQ(model.outputs[0].column, "3");
  EXPECT_EQ(model.outputs[1].unit, "");
  EXPECT_EQ(as_vehicle(model).min_speed, 3.0);
  ASSERT_EQ(as_vehicle(model).measurement_sd.size(), 2U);
  EXPECT_TRUE(std::isnan(as_vehicle(model).measurement_sd[0]));
  EXPECT_EQ(model.time.column, "t");
  EXPECT_EQ(model.time.at.line, 4);
}

TEST_F(ModelFileTest, VehicleOptions) {
  std::string text = replaced(kVehicle, "name: car\n",
                              "tyre: {curve: linear}\nuse_when: vx > 18 km/h\n"
                              "sensors: {vy: {x: 20 cm, y: -0.1}, r: {x: 1}}\n"
                              "noise: {measurement: {sd: {vy: 3 cm/s}}}\n");
  text = replaced(text, "  steering_ratio: 21\n",
                  "  bias_r: {value: 0 deg/s, min: -1, max: 1}\n  bank: 2 deg\n"
                  "  steering_gain: -1\n  bias_ay: {value: 0.1 m/s^2, fixed: true}\n");
  text = replaced(text, "steering_wheel_angle", "road_wheel_angle");
  text =
      replaced(text, "time: {column: t, unit: s}", "time: {kind: continuous, step: 10, unit: ms}");
  const Model model = read(text);
  EXPECT_THAT(model.name, HasSubstr("model_file_")) << "without a name, the file's";
  EXPECT_DOUBLE_EQ(as_vehicle(model).min_speed, 5.0);
  EXPECT_DOUBLE_EQ(as_vehicle(model).sensors.at("vy").x, 0.2);
  EXPECT_DOUBLE_EQ(as_vehicle(model).sensors.at("vy").y, -0.1);
  EXPECT_EQ(as_vehicle(model).sensors.at("r").y, 0.0);
  EXPECT_TRUE(std::isnan(as_vehicle(model).measurement_sd[0]));
  EXPECT_DOUBLE_EQ(as_vehicle(model).measurement_sd[1], 0.03);
  EXPECT_TRUE(as_vehicle(model).steering_at_road_wheel);
  EXPECT_EQ(model.inputs[0].name, "road_wheel_angle");
  EXPECT_EQ(named(model, "steering_ratio").scalar(), 1.0);
  EXPECT_TRUE(named(model, "steering_ratio").fixed);
  EXPECT_NEAR(named(model, "bias_r").max, std::numbers::pi / 180, 1e-15);
  EXPECT_FALSE(named(model, "bias_r").fixed);
  EXPECT_NEAR(named(model, "bank").scalar(), 2 * std::numbers::pi / 180, 1e-15);
  EXPECT_TRUE(named(model, "bias_ay").fixed);
  EXPECT_DOUBLE_EQ(model.time.step, 0.01);
}

TEST_F(ModelFileTest, LinearDefaults) {
  const Model model = read(kLinear);
  const StateSpace at = instantiate(as_linear(model), model.parameters);
  check_shapes(at);
  EXPECT_EQ(at.G, Eigen::MatrixXd::Identity(2, 2));
  EXPECT_EQ(at.S, Eigen::MatrixXd::Zero(2, 1));
  EXPECT_EQ(at.B.cols(), 0);
  EXPECT_EQ(at.Q, matrix({{2, 0}, {0, 1}}));
  EXPECT_EQ(at.dt, 0.5);
  EXPECT_EQ(as_linear(model).initial, InitialState::stationary);
  EXPECT_TRUE(named(model, "r").fixed) << "a bare number is known";
  EXPECT_EQ(named(model, "r").min, 0.0) << "a variance";
  EXPECT_EQ(named(model, "q").max, kInfinity);
}

TEST_F(ModelFileTest, AColumnIsCalledAsItsChannel) {
  const Model model = read(replaced(kLinear, "{name: y, column: level}", "{name: y}"));
  EXPECT_EQ(model.outputs.front().column, "y");
  EXPECT_EQ(model.outputs.front().at.column, 18);
}

TEST_F(ModelFileTest, EntriesAreMultiplesOfParameters) {
  const Model model = read(
      replaced(replaced(kLinear, "  r: 3\n", "  r: {value: 3, fixed: true}\n  å_1: {value: 0.5}\n"),
               "[[0.9, 0.1], [0, 0.5]]", "[[-å_1, 2*å_1], [å_1 * -3, -1e-1*å_1]]"));
  const StateSpace at = instantiate(as_linear(model), model.parameters);
  EXPECT_EQ(at.A, matrix({{-0.5, 1}, {-1.5, -0.05}}));
  EXPECT_EQ(named(model, "å_1").min, -kInfinity);
  EXPECT_FALSE(named(model, "å_1").fixed);
  EXPECT_TRUE(named(model, "r").fixed);
  EXPECT_EQ(as_linear(model).A.entries.size(), 4U);
}

TEST_F(ModelFileTest, EntriesAreSumsOfMultiplesOfParameters) {
  // Q = q1 B1 + q2 B2, and an A whose entries share a parameter.
  const Model m = read(replaced(
      replaced(
          replaced(kLinear, "q: {value: 2, min: 0}", "q1: {value: 2}\n  q2e: {value: 1, min: 0}"),
          "[[q, 0], [0, 1]]", "[[q1 + 2*q2e, q2e - 1e-1*q1], [-0.1*q1+q2e, q1 + 2e+0]]"),
      "[[0.9, 0.1], [0, 0.5]]", "[[0.9 - 0.2*q2e-.1, 0.1], [0, 1 -0.5 * q2e]]"));
  const StateSpace at = instantiate(as_linear(m), m.parameters);
  EXPECT_TRUE(at.Q.isApprox((Eigen::Matrix2d() << 4, 0.8, 0.8, 4).finished(), 1e-15)) << at.Q;
  EXPECT_TRUE(at.A.isApprox((Eigen::Matrix2d() << 0.6, 0.1, 0, 0.5).finished(), 1e-15)) << at.A;
  const std::vector<StateSpace> d = model_derivatives(as_linear(m), m.parameters);
  EXPECT_TRUE(d[0].Q.isApprox((Eigen::Matrix2d() << 1, -0.1, -0.1, 1).finished(), 1e-15));
  EXPECT_TRUE(d[1].Q.isApprox((Eigen::Matrix2d() << 2, 1, 1, 0).finished(), 1e-15));
  EXPECT_TRUE(d[1].A.isApprox((Eigen::Matrix2d() << -0.2, 0, 0, -0.5).finished(), 1e-15));
  EXPECT_EQ(m.parameters[0].min, -std::numeric_limits<double>::infinity());
}

TEST_F(ModelFileTest, Priors) {
  const auto prior = [&](const std::string& text) {
    return read(replaced(kLinear, "{value: 2, min: 0}", "{value: 20 mm, prior: " + text + "}"))
        .parameters[0]
        .prior;
  };
  EXPECT_EQ(prior("{uniform: [1, 2 m]}").kind, Prior::Kind::uniform);
  EXPECT_DOUBLE_EQ(prior("{uniform: [1, 2 m]}").a, 0.001);
  EXPECT_DOUBLE_EQ(prior("{uniform: [1, 2 m]}").b, 2.0);
  EXPECT_DOUBLE_EQ(prior("{log-normal: {median: 5, factor: 3}}").a, 0.005);
  EXPECT_DOUBLE_EQ(prior("{log-normal: {median: 5, factor: 3}}").b, 3.0);
  const auto of_variance = [&](const std::string& value) {
    return read(replaced(kLinear, "{value: 2, min: 0}", value)).parameters[0].prior;
  };
  const double degree = std::numbers::pi / 180.0;
  for (const char* value : {"{value: 1, unit: deg^2, prior: {sd: 0.1 deg, factor: 2}}",
                            "{value: 1, unit: deg^2, prior: {sd: 0.1, factor: 2}}",
                            "{value: 1, prior: {sd: 0.1 deg, factor: 2}}"}) {
    EXPECT_EQ(of_variance(value).kind, Prior::Kind::log_normal);
    EXPECT_NEAR(of_variance(value).a / std::pow(0.1 * degree, 2), 1.0, 1e-12) << value;
    EXPECT_DOUBLE_EQ(of_variance(value).b, 4.0);
  }
  const Model m = read(replaced(replaced(kLinear, "[[r]]", "[[q + r]]"), "[[q, 0], [0, 1]]",
                                "{structure: diagonal, prior: {log-uniform: [0.01, 15]}}"));
  EXPECT_EQ(m.parameters.back().prior.kind, Prior::Kind::log_uniform);
  EXPECT_EQ(m.parameters.back().prior.b, 15.0);
}

TEST_F(ModelFileTest, InputsHeldBetweenSamples) {
  const std::string text = replaced(replaced(kLinear, "kind: discrete, step: 0.5 s",
                                             "kind: continuous, step: 0.5 s, inputs: foh"),
                                    "outputs:",
                                    "B: [[1], [2]]\nD: [[3]]\ninputs: [{name: u, column: u}]\n"
                                    "noise: {process: per-sample}\noutputs:");
  const Model m = read(text);
  EXPECT_EQ(as_linear(m).hold, InputHold::linear);
  const StateSpace at = instantiate(as_linear(m), m.parameters);
  EXPECT_EQ(at.inputs(), 2);
  EXPECT_EQ(at.D, Eigen::RowVector2d(3, 0));
  EXPECT_EQ(model_inputs(as_linear(m), Eigen::RowVector3d(1, 5, 7)),
            (Eigen::MatrixXd(2, 3) << 1, 5, 7, 5, 7, 7).finished());
  EXPECT_EQ(as_linear(read(replaced(text, "foh", "zoh"))).hold, InputHold::constant);
}

TEST_F(ModelFileTest, ParameterUnitsOfTheLinearFormAreConverted) {
  const Model model = read(replaced(kLinear, "{value: 2, min: 0}",
                                    "{value: 4 cm, min: 1, max: 1 m, role: process-noise}"));
  EXPECT_DOUBLE_EQ(named(model, "q").scalar(), 0.04);
  EXPECT_DOUBLE_EQ(named(model, "q").min, 0.01);
  EXPECT_DOUBLE_EQ(named(model, "q").max, 1.0);
  EXPECT_EQ(named(model, "q").unit, "cm");
}

TEST_F(ModelFileTest, InputsWithBAndD) {
  const Model model =
      read(replaced(kLinear, "C:",
                    "inputs: {u1: {column: a}, u2: {column: b, unit: km/h}}\n"
                    "B: [[1, q], [0, 2]]\nD: [[0, 7]]\nS: [[0.1], [0]]\nG: [[2, 0], [0, 1]]\nC:"));
  const StateSpace at = instantiate(as_linear(model), model.parameters);
  check_shapes(at);
  EXPECT_EQ(at.B, matrix({{1, 2}, {0, 2}}));
  EXPECT_EQ(at.D, matrix({{0, 7}}));
  EXPECT_EQ(at.S, matrix({{0.1}, {0}}));
  EXPECT_EQ(at.G, matrix({{2, 0}, {0, 1}}));
  EXPECT_EQ(model.inputs[1].unit, "km/h");
  EXPECT_EQ(model.inputs[1].si_unit, "");
}

TEST_F(ModelFileTest, BIsNeededOnlyWithInputsAndDDefaultsToZero) {
  const Model model =
      read(replaced(kLinear, "C:", "inputs: [{name: u, column: 2}]\nB:\n  - [1]\n  - [0]\nC:"));
  EXPECT_EQ(instantiate(as_linear(model), model.parameters).D, matrix({{0}}));
}

TEST_F(ModelFileTest, StructuredCovariances) {
  struct Case {
    const char* text;
    Domain domain;
    Eigen::MatrixXd value;
    bool fixed;
  };
  const Case cases[] = {
      {"{structure: full}", Domain::positive_definite, matrix({{1, 0}, {0, 1}}), false},
      {"{structure: full, start: 4}", Domain::positive_definite, matrix({{4, 0}, {0, 4}}), false},
      {"{structure: full, start: [[2, 1], [1, 3]]}", Domain::positive_definite,
       matrix({{2, 1}, {1, 3}}), false},
      {"{structure: full, start: [[1, 1], [1, 1]], fixed: true}", Domain::positive_definite,
       matrix({{1, 1}, {1, 1}}), true},
      {"{structure: diagonal, start: [2, 0]}", Domain::diagonal, matrix({{2, 0}, {0, 0}}), false},
      {"{structure: diagonal, start: [[2, 0], [0, 3]], fixed: false}", Domain::diagonal,
       matrix({{2, 0}, {0, 3}}), false},
      {"{structure: scaled-identity, start: 0}", Domain::scaled_identity, matrix({{0, 0}, {0, 0}}),
       false},
      {"{structure: scaled-identity, start: [5, 5]}", Domain::scaled_identity,
       matrix({{5, 0}, {0, 5}}), false},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.text);
    const Model model = read(
        replaced(replaced(kLinear, "[[q, 0], [0, 1]]", c.text), "  q: {value: 2, min: 0}\n", ""));
    ASSERT_EQ(as_linear(model).Q.block, 1);
    const Parameter& Q = model.parameters[1];
    EXPECT_EQ(Q.name, "Q");
    EXPECT_EQ(Q.domain, c.domain);
    EXPECT_EQ(Q.value, c.value);
    EXPECT_EQ(Q.fixed, c.fixed);
    EXPECT_EQ(instantiate(as_linear(model), model.parameters).Q, c.value);
  }
}

TEST_F(ModelFileTest, AParameterMayNotHaveTheNameOfAStructuredCovariance) {
  EXPECT_EQ(
      error_of(replaced(replaced(kLinear, "  r: 3", "  R: 3"), "R: [[r]]", "R: {structure: full}")),
      "6:6: parameter 'R' has the name of the matrix R; rename it");
}

TEST_F(ModelFileTest, InitialStates) {
  const auto with = [&](const std::string& initial) {
    return read(kLinear + "initial: " + initial + "\n");
  };
  EXPECT_EQ(as_linear(with("diffuse")).initial, InitialState::diffuse);
  EXPECT_EQ(as_linear(with("stationary")).initial, InitialState::stationary);
  const Model by_sd = with("{mean: [1, -q], sd: [2, 0]}");
  EXPECT_EQ(as_linear(by_sd).initial, InitialState::given);
  const StateSpace at = instantiate(as_linear(by_sd), by_sd.parameters);
  check_shapes(at);
  EXPECT_EQ(at.x0, Eigen::Vector2d(1, -2));
  EXPECT_EQ(at.P0, matrix({{4, 0}, {0, 0}}));
  const Model by_covariance = with("{mean: [0, 0], covariance: [[2, 1], [1, 2]]}");
  EXPECT_EQ(instantiate(as_linear(by_covariance), by_covariance.parameters).P0,
            matrix({{2, 1}, {1, 2}}));
}

TEST_F(ModelFileTest, TimeForms) {
  const auto with = [&](const std::string& time) {
    return read(replaced(kLinear, "{kind: discrete, step: 0.5 s}", time)).time;
  };
  EXPECT_EQ(with("{step: 2}").step, 2.0);
  EXPECT_DOUBLE_EQ(with("{step: 20 ms}").step, 0.02);
  EXPECT_DOUBLE_EQ(with("{column: t, unit: ms, step: 20}").step, 0.02);
  const TimeSource column = with("{column: 1, unit: s}");
  EXPECT_EQ(column.column, "1");
  EXPECT_EQ(column.unit, "s");
  EXPECT_EQ(column.step, 0.0);
  EXPECT_EQ(column.at.line, 3);
  EXPECT_EQ(column.at.column, 16);
}

TEST_F(ModelFileTest, ConstantsAndScalarsMakeAModelToo) {
  const Model model = read(
      "identikal: 1\ntime: {step: 1}\nA: 0.5\nC: 1\nQ: 1\nR: 0\nnoise: {process: per-sample}\n"
      "outputs: {\"\\u00fd\": {column: y}}\n");
  EXPECT_TRUE(model.parameters.empty());
  EXPECT_EQ(model.outputs[0].name, "ý");
  EXPECT_EQ(instantiate(as_linear(model), model.parameters).A, matrix({{0.5}}));
}

struct Mistake {
  const char* from;      // this part of the valid file
  const char* to;        // becomes this
  const char* expected;  // line:column: message; {top} and {vehicle} are lists of keys
};

constexpr Mistake kLinearMistakes[] = {
    {"identikal: 1", "identikal: 2", "1:12: identikal is '2'; expected 1"},
    {"identikal: 1\n", "",
     "1:1: 'identikal' is missing in the model file; expected identikal: 1, the version of the "
     "format"},
    {"name: demo", "nmae: demo",
     "2:1: unknown key 'nmae' in the model file; expected one of {top}; did you mean 'name'?"},
    {"name: demo", "name:", "2:1: 'name' in the model file has no value"},
    {"name: demo", "name: [a]", "2:7: name is a list; expected a single value"},
    {"name: demo", "name: \"\"", "2:7: name is ''; expected a single value"},
    {"name: demo", "name: demo\nname: again",
     "3:1: key 'name' is given twice; the first is on line 2"},
    {"name: demo", "model: bicycle",
     "2:8: model is 'bicycle'; expected one of single-track, regression, static"},
    {"name: demo", "model: single-trak",
     "2:8: model is 'single-trak'; expected one of single-track, regression, static; did you mean "
     "'single-track'?"},
    {"name: demo", "states: {vy: m/s}", "7:1: 'A' is a duplicate of the formulas"},
    {"name: demo", "dynamics: {x: y}", "7:1: 'A' is a duplicate of the formulas"},
    {"name: demo", "tyre: {curve: linear}", "2:1: 'tyre' belongs to model: single-track"},
    {"name: demo", "name: \"a\\nb\"",
     "2:7: 'a?b' holds a line break or a control character; expected text on one line"},
    {"name: demo", "anything: 1",
     "2:1: unknown key 'anything' in the model file; expected one of {top}"},
    {"time: {kind: discrete, step: 0.5 s}\n", "",
     "1:1: 'time' is missing in the model file; expected time: {column: t, unit: s} or time: "
     "{step: 0.1 s}"},
    {"kind: discrete, step: 0.5 s", "kind: continuous, step: 0.5 s",
     "1:1: a continuous-time model does not say what its Q is; expected noise: {process: density} "
     "or noise: {process: per-sample}"},
    {"kind: discrete, step: 0.5 s", "kind: discreet, step: 1",
     "3:14: kind is 'discreet'; expected one of discrete, continuous; did you mean 'discrete'?"},
    {"step: 0.5 s", "step: 0.5 kg", "3:30: step is in 'kg'; expected a unit like 's'"},
    {"step: 0.5 s", "step: 0 s", "3:30: step is '0 s'; expected a time above 0"},
    {"step: 0.5 s", "step: 0,5 s",
     "3:32: unknown key '5 s' in time; expected one of kind, step, column, unit, runs, inputs, "
     "sampling"},
    {"{kind: discrete, step: 0.5 s}", "{kind: discrete, step: \"0,5 s\"}",
     "3:30: step is '0,5 s'; expected a finite number, with or without a unit; write a decimal "
     "point"},
    {"step: 0.5 s", "step: -1", "3:30: step is '-1'; expected a time above 0"},
    {"step: 0.5 s", "step: .nan",
     "3:30: step is '.nan'; expected a finite number, with or without a unit"},
    {"step: 0.5 s", "step: 1e999",
     "3:30: step is '1e999'; expected a finite number, with or without a unit"},
    {"step: 0.5 s", "step: 1e308 h", "3:30: step is too large"},
    {"{kind: discrete, step: 0.5 s}", "{kind: discrete}",
     "3:7: time has neither a column nor a step; expected column: NAME with the time stamps, or "
     "step: 0.1 s between rows"},
    {"{kind: discrete, step: 0.5 s}", "{}",
     "3:7: time has neither a column nor a step; expected column: NAME with the time stamps, or "
     "step: 0.1 s between rows"},
    {"step: 0.5 s", "column: t, unit: m", "3:41: time is in 'm'; expected a unit like 's'"},
    {"step: 0.5 s", "column: [t]", "3:32: column is a list; expected a single value"},
    {"{kind: discrete, step: 0.5 s}", "1 s",
     "3:7: time is '1 s'; expected a mapping of 'key: value'"},
    {"step: 0.5 s", "stepp: 1",
     "3:24: unknown key 'stepp' in time; expected one of kind, step, column, unit, runs, inputs, "
     "sampling; "
     "did you "
     "mean "
     "'step'?"},
    {"{value: 2, min: 0}", "{value: 2, min: 3}",
     "5:14: parameter 'q' is 2; expected 3 (min) or above"},
    {"{value: 2, min: 0}", "{value: 2, max: 1}",
     "5:14: parameter 'q' is 2; expected 1 (max) or below"},
    {"{value: 2, min: 0}", "{value: 2, min: 3, max: 3}",
     "5:22: min 3 of parameter 'q' is not below max 3"},
    {"{value: 2, min: 0}", "{value: 2, min: -1}",
     "5:22: parameter 'q' is a variance in Q and its min is negative; expected min: 0 or above"},
    {"{value: 2, min: 0}", "{value: -2}",
     "5:14: parameter 'q' is a variance in Q and its value is negative"},
    {"{value: 2, min: 0}", "{value: 0, max: 0}",
     "5:22: parameter 'q' is a variance in Q; expected a max above 0"},
    {"{value: 2, min: 0}", "{min: 0}",
     "5:6: 'value' is missing in parameter 'q'; expected value: NUMBER, the start"},
    {"{value: 2, min: 0}", "{value: nan}",
     "5:14: parameter 'q' is 'nan'; expected a finite number, with or without a unit"},
    {"{value: 2, min: 0}", "{value: inf}",
     "5:14: parameter 'q' is 'inf'; expected a finite number, with or without a unit"},
    {"{value: 2, min: 0}", "{value: }", "5:7: 'value' in parameter 'q' has no value"},
    {"{value: 2, min: 0}", "{value: two}",
     "5:14: parameter 'q' is 'two'; expected a finite number, with or without a unit"},
    {"{value: 2, min: 0}", "{value: 2 m, unit: m}",
     "5:25: the unit of parameter 'q' is given twice; write it with the value or as 'unit', not "
     "both"},
    {"{value: 2, min: 0}", "{value: 2 furlong}",
     "5:14: parameter 'q' has the unknown unit 'furlong'"},
    {"{value: 2, min: 0}", "{value: 2, unit: furlong}",
     "5:23: parameter 'q' has the unknown unit 'furlong'"},
    {"{value: 2, min: 0}", "{value: 2 m, min: 1 s}",
     "5:24: min of parameter 'q' is in 's'; expected a unit like 'm'"},
    {"{value: 2, min: 0}", "{value: 2, prior: 3}",
     "5:24: prior of parameter 'q' is '3'; expected a mapping of 'key: value'"},
    {"{value: 2, min: 0}", "{value: 2, prior: {uniform: 3}}",
     "5:34: uniform prior of parameter 'q' is '3'; expected uniform: [LOW, HIGH]"},
    {"{value: 2, min: 0}", "{value: 2, prior: {uniform: [3, 2]}}",
     "5:34: prior of parameter 'q' is empty; expected LOW below HIGH"},
    {"{value: 2, min: 0}", "{value: 2, prior: {log-uniform: [0, 2]}}",
     "5:38: prior of parameter 'q' reaches 0; expected above 0"},
    {"{value: 2, min: 0}", "{value: 2, prior: {log-normal: {median: 1, factor: 0.5}}}",
     "5:57: factor of prior of parameter 'q' is '0.5'; expected above 1"},
    {"{value: 2, min: 0}", "{value: 2, prior: {sd: 1}}",
     "5:24: 'factor' is missing in prior of parameter 'q'; expected {sd: 0.1 deg, factor: 2}"},
    {"{value: 2, min: 0}", "{value: 2, prior: {sd: 0, factor: 2}}",
     "5:29: sd of prior of parameter 'q' is '0'; expected above 0"},
    {"{value: 2, min: 0}", "{value: 2 deg, prior: {sd: 0.1 deg, factor: 2}}",
     "5:33: sd of prior of parameter 'q' is in deg, and so is the parameter, which is then no "
     "variance; expected log-normal: {median: M, factor: F}"},
    {"{value: 2, min: 0}", "{value: 2 m, prior: {sd: 0.1 m, factor: 2}}",
     "5:31: sd of prior of parameter 'q' is in m, and so is the parameter, which is then no "
     "variance; expected log-normal: {median: M, factor: F}"},
    {"{value: 2, min: 0}", "{value: 2, prior: {normal: {mean: 1}}}",
     "5:33: 'sd' is missing in prior of parameter 'q'; expected normal: {mean: ..., sd: ...}"},
    {"{value: 2, min: 0}", "{value: 2, prior: {normal: {mean: 1, sd: 1}, uniform: [1, 2]}}",
     "5:24: prior of parameter 'q' has 2 forms; expected one"},
    {"{value: 2, min: 0}", "{value: 2, mim: 3}",
     "5:17: unknown key 'mim' in parameter 'q'; expected one of value, min, max, fixed, unit, "
     "role, prior, per, spread, scale; did you mean 'min'?"},
    {"{value: 2, min: 0}", "{value: 2, fixed: yes}",
     "5:24: fixed is 'yes'; expected one of true, false"},
    {"{value: 2, min: 0}", "{value: 2, role: noise}",
     "5:23: role is 'noise'; expected one of process-noise, measurement-noise"},
    {"{value: 2, min: 0}", "[2]",
     "5:6: parameter 'q' is a list; expected a number, or {value, min, max}"},
    {"{value: 2, min: 0}", "{value: [2]}",
     "5:14: parameter 'q' is a list; expected a single value"},
    {"  r: 3", "  2r: 3",
     "6:3: a parameter name is '2r'; expected letters, digits and '_', beginning with a letter"},
    {"  r: 3", "  r: -3", "6:6: parameter 'r' is a variance in R and its value is negative"},
    {"  r: 3", "  r: 3\n  s: 4", "7:3: parameter 's' is not used anywhere"},
    {"  r: 3", "  r: 3\n  r: 4", "7:3: key 'r' is given twice; the first is on line 6"},
    {"  r: 3", "  r:", "6:3: 'r' in parameters has no value"},
    {"parameters:\n  q: {value: 2, min: 0}\n  r: 3\n", "parameters: 3\n",
     "4:13: parameters is '3'; expected a mapping of 'key: value'"},
    {"parameters:\n  q: {value: 2, min: 0}\n  r: 3\n", "",
     "6:6: unknown name 'q'; expected a name that the model declares"},
    {"A: [[0.9, 0.1], [0, 0.5]]\n", "",
     "1:1: 'A' is missing in the model file; expected A: a list of rows, states x states"},
    {"[0, 0.5]]", "[0]]", "7:17: row 2 of A has length 1; expected 2, as in row 1"},
    {"[[0.9, 0.1], [0, 0.5]]", "[[0.9, 0.1]]",
     "7:4: A is 1 x 2; expected a square matrix (states x states)"},
    {"[[0.9, 0.1], [0, 0.5]]", "[0.9, 0.1]",
     "7:4: A is not a matrix; expected a list of rows such as [[1, 0], [0, 1]]"},
    {"[[0.9, 0.1], [0, 0.5]]", "[]",
     "7:4: A is not a matrix; expected a list of rows such as [[1, 0], [0, 1]]"},
    {"[[0.9, 0.1], [0, 0.5]]", "[[]]",
     "7:4: A is not a matrix; expected a list of rows such as [[1, 0], [0, 1]]"},
    {"[[0.9, 0.1], [0, 0.5]]", "{a: 1}",
     "7:4: A is not a matrix; expected a list of rows such as [[1, 0], [0, 1]]"},
    {"[[0.9, 0.1], [0, 0.5]]", "[[0.9, 0.1], 3]",
     "7:4: A is not a matrix; expected a list of rows such as [[1, 0], [0, 1]]"},
    {"0.1]", "stiffness]",
     "7:11: unknown name 'stiffness'; expected a name that the model declares"},
    {"0.1]", "qq]",
     "7:11: unknown name 'qq'; expected a name that the model declares; did you mean 'q'?"},
    {"0.1]", "q +]", "7:14: the formula ends; expected a number, a name, a function or '('"},
    {"0.1]", ".inf]", "7:11: '.'; expected a number, a name, a function or '('"},
    {"0.1]", "nan]", "7:11: unknown name 'nan'; expected a name that the model declares"},
    {"0.1]", "1 kg]",
     "7:13: 'kg'; expected an operator such as '+', or the end; a product needs '*'; numbers carry "
     "no units"},
    {"step: 0.5 s", "step: 0.5 s, inputs: foh",
     "3:45: a discrete-time model has nothing between samples; expected no 'inputs' here, or "
     "kind: continuous"},
    {"0.1]", "~]", "7:11: an entry of A is empty; expected a single value"},
    {"0.1]", "[1]]", "7:11: an entry of A is a list; expected a single value"},
    {"0.1]", "1e308*q]", "7:4: A is too large"},
    {"0.1]", "sqrt(1 - q)]", "7:4: A is not a number: a formula is undefined at these values"},
    {"C: [[1, 0]]", "C: [[1, 0, 0]]", "8:4: C is 1 x 3; expected 1 x 2 (outputs x states)"},
    {"C: [[1, 0]]", "C: [[1, 0], [0, 1]]", "8:4: C is 2 x 2; expected 1 x 2 (outputs x states)"},
    {"C: [[1, 0]]", "C: 1", "8:4: C is 1 x 1; expected 1 x 2 (outputs x states)"},
    {"C: [[1, 0]]\n", "",
     "1:1: 'C' is missing in the model file; expected C: a list of rows, outputs x states"},
    {"C: [[1, 0]]", "C: [[1, 0]]\nG: [[1, 0]]",
     "9:4: G is 1 x 2; expected 2 x any (states x process noises)"},
    {"C: [[1, 0]]", "C: [[1, 0]]\nG: [[1], [0]]",
     "10:4: Q is 2 x 2; expected 1 x 1 (process noises x process noises)"},
    {"C: [[1, 0]]", "C: [[1, 0]]\nB: [[1], [0]]",
     "9:4: B is given but the model has no inputs; expected inputs: [{name: u, column: u}]"},
    {"C: [[1, 0]]", "C: [[1, 0]]\nD: [[1]]",
     "9:4: D is given but the model has no inputs; expected inputs: [{name: u, column: u}]"},
    {"C: [[1, 0]]", "C: [[1, 0]]\ninputs: [{name: u, column: u}]",
     "1:1: 'B' is missing in the model file; expected B: a list of rows, states x inputs"},
    {"C: [[1, 0]]", "C: [[1, 0]]\ninputs: [{name: u, column: u}]\nB: [[1, 0]]",
     "10:4: B is 1 x 2; expected 2 x 1 (states x inputs)"},
    {"C: [[1, 0]]", "C: [[1, 0]]\ninputs: [{name: u, column: u}]\nB: [[1], [0]]\nD: [[0, 1]]",
     "11:4: D is 1 x 2; expected 1 x 1 (outputs x inputs)"},
    {"C: [[1, 0]]", "C: [[1, 0]]\nS: [[1]]",
     "9:4: S is 1 x 1; expected 2 x 1 (process noises x outputs)"},
    {"C: [[1, 0]]", "C: [[1, 0]]\nS: [[0], [3]]",
     "9:4: the joint covariance of Q, R and S is not positive semidefinite"},
    {"Q: [[q, 0], [0, 1]]\n", "",
     "1:1: 'Q' is missing in the model file; expected Q: covariance of the process noise"},
    {"Q: [[q, 0], [0, 1]]", "Q: q",
     "9:4: Q is 1 x 1; expected 2 x 2 (process noises x process noises)"},
    {"Q: [[q, 0], [0, 1]]", "Q: [[q, 0], [0, -1]]", "9:17: variance '-1' in Q is negative"},
    {"Q: [[q, 0], [0, 1]]", "Q: [[-q, 0], [0, 1]]", "9:6: variance '-q' in Q is negative"},
    {"Q: [[q, 0], [0, 1]]", "Q: [[q, 0], [0.5, 1]]",
     "9:14: Q is not symmetric: '0.5' in row 2, column 1 and '0' across; expected the same entry "
     "on both sides"},
    {"Q: [[q, 0], [0, 1]]", "Q: [[q, r], [q, 1]]",
     "9:14: Q is not symmetric: 'q' in row 2, column 1 and 'r' across; expected the same entry "
     "on both sides"},
    {"Q: [[q, 0], [0, 1]]", "Q: [[q, 2], [2, 1]]", "9:4: Q is not positive semidefinite"},
    {"Q: [[q, 0], [0, 1]]", "Q: [[q, 2*q], [2*q, q]]", "9:4: Q is not positive semidefinite"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: fulll}",
     "9:16: structure is 'fulll'; expected one of full, diagonal, scaled-identity; did you mean "
     "'full'?"},
    {"Q: [[q, 0], [0, 1]]", "Q: {start: 1}",
     "9:4: 'structure' is missing in Q; expected structure: full, diagonal or scaled-identity"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: -1}",
     "9:29: start of Q is not positive semidefinite"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: 0}",
     "9:29: start of Q is singular, and a free full matrix cannot start there"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: diagonal, start: [1]}",
     "9:33: start of Q has length 1; expected 2, the diagonal"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: diagonal, start: [1, -1]}",
     "9:33: start of Q is not positive semidefinite"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: diagonal, start: [1, x]}",
     "9:37: start of Q is 'x'; expected a finite number"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: diagonal, start: [[1, 0.5], [0.5, 1]]}",
     "9:33: start of Q is not diagonal"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: scaled-identity, start: [1, 2]}",
     "9:40: start of Q is not a multiple of the identity"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: [[1, 0.5], [0, 1]]}",
     "9:29: start of Q is not symmetric"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: [[1, 2], [2, 1]]}",
     "9:29: start of Q is not positive semidefinite"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: [[1]]}",
     "9:29: start of Q is 1 x 1; expected 2 x 2 (process noises x process noises)"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: q}",
     "9:29: start of Q is 'q'; expected a finite number"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, start: []}",
     "9:29: start of Q is not a matrix; expected a list of rows such as [[1, 0], [0, 1]]"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, begin: 1}",
     "9:22: unknown key 'begin' in Q; expected one of structure, start, fixed, prior"},
    {"Q: [[q, 0], [0, 1]]", "Q: {structure: full, fixed: 1}",
     "9:29: fixed is '1'; expected one of true, false"},
    {"R: [[r]]", "R: {structure: full}", "6:3: parameter 'r' is not used anywhere"},
    {"R: [[r]]", "R: [[-r]]", "10:6: variance '-r' in R is negative"},
    {"R: [[r]]", "R: -1", "10:4: variance '-1' in R is negative"},
    {"R: [[r]]\n", "",
     "1:1: 'R' is missing in the model file; expected R: covariance of the measurement noise"},
    {"R: [[r]]", "R: [[r]]\nnoise: {process: density}",
     "11:18: process noise is a density in a discrete-time model; expected process: per-sample, or "
     "time: {kind: continuous, ...}"},
    {"R: [[r]]", "R: [[r]]\nnoise: {proces: density}",
     "11:9: unknown key 'proces' in noise; expected one of process, measurement; did you mean "
     "'process'?"},
    {"R: [[r]]", "R: [[r]]\nnoise: {}",
     "11:8: 'process' is missing in noise; expected process: per-sample"},
    {"R: [[r]]", "R: [[r]]\nnoise: per-sample",
     "11:8: noise is 'per-sample'; expected a mapping of 'key: value'"},
    {"R: [[r]]", "R: [[r]]\nnoise: {process: white}",
     "11:18: process is 'white'; expected one of per-sample, density"},
    {"R: [[r]]", "R: [[r]]\ninitial: difuse",
     "11:10: initial is 'difuse'; expected one of stationary, diffuse; did you mean 'diffuse'?"},
    {"R: [[r]]", "R: [[r]]\ninitial: [0, 0]",
     "11:10: initial is a list; expected stationary, diffuse, or {mean: [...], sd: [...]}"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0]}",
     "11:10: initial needs one of 'sd' and 'covariance'; expected initial: {mean: [...], sd: "
     "[...]}"},
    {"R: [[r]]", "R: [[r]]\ninitial: {sd: [0, 0]}",
     "11:10: 'mean' is missing in initial; expected mean: [...], one entry per state"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0], sd: [0, 0]}",
     "11:17: mean has length 1; expected a list of 2, one per state"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], sd: [0]}",
     "11:29: sd has length 1; expected a list of 2, one per state"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], sd: [0, -1]}", "11:33: sd '-1' is negative"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], sd: 1}",
     "11:29: sd is '1'; expected a list of 2, one per state"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], sd: [1e200, 1]}",
     "11:10: the initial covariance is too large"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], covariance: [[1, 2], [2, 1]]}",
     "11:10: the initial covariance is not positive semidefinite"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], covariance: [[1]]}",
     "11:37: covariance is 1 x 1; expected 2 x 2 (states x states)"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, x], covariance: [[1]]}",
     "11:21: unknown name 'x'; expected a name that the model declares"},
    {"R: [[r]]", "R: [[r]]\ninitial: {mean: [0, 0], sd: [1, 1], covariance: [[1, 0], [0, 1]]}",
     "11:10: initial needs one of 'sd' and 'covariance'; expected initial: {mean: [...], sd: "
     "[...]}"},
    {"outputs: [{name: y, column: level}]\n", "",
     "1:1: 'outputs' is missing in the model file; expected outputs: [{name: y, column: y}]"},
    {"outputs: [{name: y, column: level}]", "outputs: y",
     "11:10: outputs is 'y'; expected a list of {name, column, unit}, or a mapping of name: "
     "{column, unit}"},
    {"outputs: [{name: y, column: level}]", "outputs: []",
     "11:10: outputs has 0 entries; expected 1 to 200"},
    {"outputs: [{name: y, column: level}]", "outputs: {}",
     "11:10: outputs has 0 entries; expected 1 to 200"},
    {"outputs: [{name: y, column: level}]", "outputs: [y]",
     "11:11: entry 1 of outputs is 'y'; expected a mapping of 'key: value'"},
    {"column: level", "colum: level",
     "11:21: unknown key 'colum' in entry 1 of outputs; expected one of name, column, unit, "
     "scale, offset, delay, value, sd, when; did you mean 'column'?"},
    {"outputs: [{name: y, column: level}]", "outputs: [{column: level}]",
     "11:11: 'name' is missing in outputs; expected name: NAME of the channel"},
    {"column: level", "column: level, unit: m/ss",
     "11:42: 'y' has the unknown unit 'm/ss'; did you mean 'm/s'?"},
    {"column: level", "column: level, equals: r",
     "11:36: unknown key 'equals' in entry 1 of outputs; expected one of name, column, unit, "
     "scale, offset, delay, value, sd, when"},
    {"[{name: y, column: level}]", "[{name: y, column: a}, {name: y, column: b}]",
     "11:40: outputs names 'y' twice"},
    {"outputs: [{name: y, column: level}]", "outputs: {y: level}",
     "11:14: entry 1 of outputs is 'level'; expected a mapping of 'key: value'"},
    {"outputs: [{name: y, column: level}]", "outputs: {y: }", "11:11: 'y' in outputs has no value"},
    {"outputs: [{name: y, column: level}]", "outputs: [{name: y, column: level}",
     "12:1: not valid YAML: end of sequence flow not found"},
    {"outputs: [{name: y, column: level}]", "outputs: [{name: y, column: level}]\n---\na: 1",
     "12:1: a second YAML document starts here; expected one model per file"},
    {"[{name: y, column: level}]", "[{name: &a y, column: *a}]",
     "11:32: YAML aliases ('*name') are not supported; expected the value itself"},
    {"R: [[r]]", "R: {structure: full}\ninitial: {mean: [r, R], sd: [1, 1]}",
     "11:21: unknown name 'R'; expected a name that the model declares; did you mean 'r'?"},
};

constexpr Mistake kVehicleMistakes[] = {
    {"model: single-track", "model: single-track\nA: [[1]]",
     "4:1: 'A' does not belong to model: single-track"},
    {"model: single-track", "model: single-track\ninitial: diffuse",
     "4:1: 'initial' does not belong to model: single-track"},
    {"{column: t, unit: s}", "{kind: discrete, column: t}",
     "4:14: kind is 'discrete'; expected continuous: the vehicle's equations are"},
    {"{column: t, unit: s}", "{kind: continuous}",
     "4:7: time has neither a column nor a step; expected column: NAME with the time stamps, or "
     "step: 0.1 s between rows"},
    {"  m: 1446 kg\n", "", "6:3: 'm' is missing in parameters; expected m: NUMBER kg"},
    {"  m: 1446 kg", "  m: -1446 kg", "6:6: parameter 'm' is -1446 kg; expected a value above 0"},
    {"  m: 1446 kg", "  m: 0", "6:6: parameter 'm' is 0 kg; expected a value above 0"},
    {"  m: 1446 kg", "  m: 1446 m", "6:6: parameter 'm' is in 'm'; expected a unit like 'kg'"},
    {"  m: 1446 kg", "  M: 1446 m",
     "6:3: unknown key 'M' in parameters; expected one of {vehicle}; did you mean 'm'?"},
    {"  m: 1446 kg", "  m: 1446 kg\n  Ff_max: 3",
     "7:3: 'Ff_max' belongs to tyres that saturate; expected tyre: {curve: tanh}, fiala or "
     "magic-formula"},
    {"  m: 1446 kg", "  m: 1446 kg\n  curve_shape: 1.3",
     "7:3: 'curve_shape' belongs to the magic formula; expected tyre: {curve: magic-formula}"},
    {"  m: 1446 kg", "  m: 1446 kg\n  steering_delay: 3 m",
     "7:19: parameter 'steering_delay' is in 'm'; expected a unit like 's'"},
    {"  m: 1446 kg", "  m: 1446 kg\n  steering_gain: 0",
     "7:18: parameter 'steering_gain' is 0; expected a number other than 0"},
    {"  m: 1446 kg", "  m: 1446 kg\n  steering_delay: 2 s",
     "7:19: parameter 'steering_delay' is 2 s; expected between -1 s and 1 s"},
    {"  m: 1446 kg", "  m: 1446 kg\n  steering_delay: -1001 ms",
     "7:19: parameter 'steering_delay' is -1001 ms; expected between -1 s and 1 s"},
    {"  m: 1446 kg", "  m: 1446 kg\n  relaxation_length: -1 m",
     "7:22: parameter 'relaxation_length' is -1 m; expected 0 m or above"},
    {"  m: 1446 kg", "  m: 1446 kg\n  cg_height: -0.5 m",
     "7:14: parameter 'cg_height' is -0.5 m; expected 0 m or above"},
    {"  m: 1446 kg", "  m: 1446 kg\n  load_sensitivity: -1",
     "7:21: parameter 'load_sensitivity' is -1; expected 0 or above"},
    {"  m: 1446 kg", "  m: 1446 kg\n  bias_r: {value: 0, prior: {log-uniform: [1, 2]}}",
     "7:19: value of parameter 'bias_r' is '0'; expected above 0; its prior is one of the "
     "logarithm"},
    {"  m: 1446 kg",
     "  m: 1446 kg\n  steering_gain: {value: 0.5, min: -1, prior: {log-normal: {median: 1, factor: "
     "2}}}",
     "7:36: min of parameter 'steering_gain' is '-1'; expected above 0; its prior is one of the "
     "logarithm"},
    {"parameters:\n  m: 1446 kg",
     "tyre: {curve: magic-formula}\nparameters:\n  m: 1446 kg\n  curve_shape: 2.5",
     "8:16: parameter 'curve_shape' is 2.5; expected between 1 and 2"},
    {"parameters:\n  m: 1446 kg",
     "tyre: {curve: magic-formula}\nparameters:\n  m: 1446 kg\n  curve_shape: 0.9",
     "8:16: parameter 'curve_shape' is 0.9; expected between 1 and 2"},
    {"parameters:\n  m: 1446 kg",
     "tyre: {curve: magic-formula}\nparameters:\n  m: 1446 kg\n  curve_curvature: 1",
     "8:20: parameter 'curve_curvature' is 1; expected below 1"},
    {"  steering_ratio: 21\n", "",
     "6:3: 'steering_ratio' is missing in parameters; expected steering-wheel angle over "
     "road-wheel angle"},
    {"steering_ratio: 21", "steering_ratio: 21 m",
     "9:19: parameter 'steering_ratio' is in 'm'; expected a number without a unit, or an angle"},
    {"steering_ratio: 21", "steering_ratio: -21",
     "9:19: parameter 'steering_ratio' is -21; expected a value above 0"},
    {"steering_wheel_angle:", "road_wheel_angle:",
     "9:19: steering_ratio is given with the input road_wheel_angle; expected the input "
     "steering_wheel_angle, or no ratio"},
    {"min: 800", "min: 800 kg",
     "10:33: min of parameter 'Iz' is in 'kg'; expected a unit like 'kg m^2'"},
    {"value: 2000 kg m^2", "value: 200 kg m^2",
     "10:15: parameter 'Iz' is 200 kg m^2; expected 800 kg m^2 (min) or above"},
    {"value: 2000 kg m^2", "value: 2000 kg m",
     "10:15: parameter 'Iz' is in 'kg m'; expected a unit like 'kg m^2'"},
    {"unit: kN/rad", "unit: kN m",
     "12:25: parameter 'Cr' is in 'kN m'; expected a unit like 'N/rad'"},
    {"{value: 80 kN/rad}", "{value: 80 kN/rad, max: 0}",
     "11:15: parameter 'Cf' is 80 kN/rad; expected 0 kN/rad (max) or below"},
    {"vx: {column: speed, unit: km/h}, ", "",
     "13:9: inputs are not one steering angle and vx; expected one of steering_wheel_angle and "
     "road_wheel_angle, and vx; roll beside them where it is measured"},
    {"unit: km/h", "unit: km", "13:36: 'vx' is in 'km'; expected a unit like 'm/s'"},
    {"steering_wheel_angle: {column: swa, unit: deg}", "steer: {column: swa}",
     "13:43: unknown key 'steer' in inputs; expected one of steering_wheel_angle, "
     "road_wheel_angle, vx, roll"},
    {", steering_wheel_angle: {column: swa, unit: deg}", "",
     "13:9: inputs are not one steering angle and vx; expected one of steering_wheel_angle and "
     "road_wheel_angle, and vx; roll beside them where it is measured"},
    {", steering_wheel_angle: {column: swa, unit: deg}",
     ", steering_wheel_angle: {column: swa}, road_wheel_angle: {column: rwa}",
     "13:9: inputs are not one steering angle and vx; expected one of steering_wheel_angle and "
     "road_wheel_angle, and vx; roll beside them where it is measured"},
    {"inputs: {vx: {column: speed, unit: km/h}, steering_wheel_angle: {column: swa, unit: deg}}\n",
     "",
     "1:1: 'inputs' is missing in the model file; expected inputs: {steering_wheel_angle: {column: "
     "..., unit: deg}, vx: {column: ..., unit: m/s}}"},
    {"unit: deg/s", "unit: deg", "14:32: 'r' is in 'deg'; expected a unit like 'rad/s'"},
    {"vy: {column: vy}", "vz: {column: vy}",
     "14:40: unknown key 'vz' in outputs; expected one of r, vy, ay, beta; did you mean 'vy'?"},
    {"model: single-track", "model: single-track\nsensors: {ay: {x: 0.2 m}}",
     "4:11: unknown key 'ay' in sensors; expected one of r, vy; did you mean 'vy'?"},
    {"model: single-track", "model: single-track\nsensors: {vy: {x: 0.2 s}}",
     "4:19: x is in 's'; expected a unit like 'm'"},
    {"model: single-track", "model: single-track\nsensors: {vy: {z: 0.2}}",
     "4:16: unknown key 'z' in 'vy'; expected one of gain, delay, lag, x, y, angle"},
    {"model: single-track", "model: single-track\ntyre: {curve: linaer}",
     "4:15: curve is 'linaer'; expected one of linear, tanh, fiala, magic-formula; did you mean "
     "'linear'?"},
    {"model: single-track", "model: single-track\ntyre: {}",
     "4:7: 'curve' is missing in tyre; expected curve: linear"},
    {"model: single-track", "model: single-track\ntyre: linear",
     "4:7: tyre is 'linear'; expected a mapping of 'key: value'"},
    {"model: single-track", "model: single-track\nuse_when: vx > 5 and ay < 3",
     "4:11: use_when is 'vx > 5 and ay < 3': column 12: unknown name 'ay'; expected a name that "
     "the "
     "model declares; did you mean 'vy'?"},
    {"model: single-track", "model: single-track\nuse_when: {condition: vx >= 5, bridge: 1 m}",
     "4:40: bridge of use_when is in 'm'; expected a unit like 's'"},
    {"model: single-track", "model: single-track\nuse_when: {condition: vx >= 5, margin: -1}",
     "4:40: margin of use_when is '-1'; expected between 0 s and 10 s"},
    {"model: single-track", "model: single-track\nroll: {height: 0.4 m}",
     "4:7: roll has neither a gradient nor a stiffness; expected gradient: {value: 0.008 "
     "rad/(m/s^2), min: 0, max: 0.03}"},
    {"model: single-track", "model: single-track\nroll: {stiffness: 1 kN m/rad, height: 0.4 m}",
     "4:19: stiffness of roll is '1 kN m/rad'; expected above m g height = 5672 N m/rad, or the "
     "body "
     "falls over"},
    {"model: single-track", "model: single-track\nuse_when: vx > 5 kg",
     "4:11: use_when is in 'kg'; expected a unit like 'm/s'"},
    {"model: single-track", "model: single-track\nuse_when: vx > 0",
     "4:11: use_when is 'vx > 0'; expected a speed above 0"},
    {"model: single-track", "model: single-track\nnoise: {process: density}",
     "4:9: 'process' is not available yet; known: measurement"},
    {"model: single-track", "model: single-track\nnoise: {measurement: {sd: {ay: 1}}}",
     "4:28: unknown key 'ay' in sd; expected one of r, vy; did you mean 'vy'?"},
    {"model: single-track", "model: single-track\nnoise: {measurement: {sd: {r: 0}}}",
     "4:31: sd of r is '0'; expected a value above 0"},
    {"model: single-track", "model: single-track\nnoise: {measurement: {sd: {r: 1 m}}}",
     "4:31: sd of r is in 'm'; expected a unit like 'rad/s'"},
    {"model: single-track",
     "model: single-track\nnoise: {measurement: {kind: density, sd: {r: 1}}}",
     "4:29: kind is 'density'; expected per-sample"},
    {"model: single-track", "model: single-track\nnoise: {measurement: {kind: per-sample}}",
     "4:22: 'sd' is missing in measurement; expected sd: {r: 0.01 rad/s}"},
    {"model: single-track", "model: single-track\ndriven_axle: middle",
     "4:14: driven_axle is 'middle'; expected one of front, rear, both"},
};

TEST_F(ModelFileTest, EveryMistakeIsNamedWithItsPlace) {
  const auto check = [this](const std::string& base, const Mistake& mistake) {
    std::string expected = mistake.expected;
    for (const auto& [mark, keys] :
         {std::pair{"{top}", kTopKeys}, std::pair{"{vehicle}", kVehicleKeys}}) {
      if (expected.find(mark) != std::string::npos) expected = replaced(expected, mark, keys);
    }
    EXPECT_EQ(error_of(replaced(base, mistake.from, mistake.to)), expected)
        << mistake.from << " -> " << mistake.to;
  };
  for (const Mistake& mistake : kLinearMistakes) check(kLinear, mistake);
  for (const Mistake& mistake : kVehicleMistakes) check(kVehicle, mistake);
}

TEST_F(ModelFileTest, FilesThatAreNoModel) {
  const auto repeated = [](const std::string& text, int times) {
    std::string out;
    for (int i = 0; i < times; ++i) out += text;
    return out;
  };
  const std::pair<std::string, std::string> cases[] = {
      {"", " is empty; expected a model file, which starts with 'identikal: 1'"},
      {"# nothing\n", " is empty; expected a model file, which starts with 'identikal: 1'"},
      {"---\n", " is empty; expected a model file, which starts with 'identikal: 1'"},
      {"t,y\n1,2\n", "1:1: the model file is 't,y 1,2'; expected a mapping of 'key: value'"},
      {"[1, 2]", "1:1: the model file is a list; expected a mapping of 'key: value'"},
      {std::string("\x7f"
                   "ELF\0",
                   5),
       "1:1: byte 0x7f is not text; expected a YAML file in UTF-8"},
      {std::string("a: 1\nab\0", 8), "2:3: byte 0x00 is not text; expected a YAML file in UTF-8"},
      {"a: \xc3\xa5\xff", "1:5: byte 0xff is not text; expected a YAML file in UTF-8"},
      {"a: \xed\xa0\x80", "1:4: byte 0xed is not text; expected a YAML file in UTF-8"},
      {"a: \xc3", "1:4: byte 0xc3 is not text; expected a YAML file in UTF-8"},
      {std::string(1'000'001, ' '), " is larger than 1 MB; expected a model file, not a recording"},
      {repeated("[", 200'000), "1:17: nested too deeply; expected at most 32 levels"},
      {repeated("{", 200'000), "1:32: nested too deeply; expected at most 32 levels"},
      {repeated("- ", 200'000), "1:65: nested too deeply; expected at most 32 levels"},
      {repeated("? ", 200'000), "1:65: nested too deeply; expected at most 32 levels"},
      {"[" + repeated("1,", 200'000) + "]",
       "1:200000: the file holds too many values; expected at most 100000"},
      {"a: &a [x, x]\nb: &b [*a, *a]\n",
       "2:8: YAML aliases ('*name') are not supported; expected the value itself"},
      {"a: 1\n? [b]\n: 2\n", "2:3: a key is a list; expected a word before the colon"},
      {"a: 1\n: 2\n", "2:1: a key is empty; expected a word before the colon"},
      {"a: 1\n\tb: 2\n", "2:1: not valid YAML: illegal tab when looking for indentation"},
      {"a:\n\tb: 1\n", "2:1: a tab in the indentation; expected blanks; illegal map value"},
      {"ěšč: [1, 2]\nř: {á: b, á: c}\n", "2:11: key 'á' is given twice; the first is on line 2"},
      {"\xEF\xBB\xBF"
       "identikal: 2\n",
       "1:12: identikal is '2'; expected 1"},
      {"identikal: 1\r\nname: a\r\nname: b\r\n",
       "3:1: key 'name' is given twice; the first is on line 2"},
  };
  for (const auto& [text, expected] : cases) {
    EXPECT_EQ(error_of(text), expected) << text.substr(0, 40);
  }
}

TEST_F(ModelFileTest, FilesThatCannotBeRead) {
  const auto message = [](const std::string& path) {
    try {
      read_model_file(path);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(message("/nonexistent/model.yaml"),
            "/nonexistent/model.yaml: cannot be opened: No such file or directory");
  const std::string directory = std::filesystem::temp_directory_path().string();
  EXPECT_EQ(message(directory), directory + ": is a directory; expected a model file");
}

TEST_F(ModelFileTest, LongTextIsCutInMessages) {
  std::string text;
  for (int i = 0; i < 5000; ++i) text += "ř";
  const std::string message = error_of(replaced(kLinear, "name: demo", "model: " + text));
  EXPECT_LT(message.size(), 200U);
  EXPECT_THAT(message, HasSubstr("řř...'"));
}

TEST_F(ModelFileTest, TooLargeModelsAreRefused) {
  std::string row = "[1";
  for (int i = 1; i < 201; ++i) row += ", 1";
  EXPECT_EQ(
      error_of(replaced(kLinear, "C: [[1, 0]]", "C: [[1, 0]]\nG: [" + row + "], " + row + "]]")),
      "9:4: G is 2 x 201; expected at most 200 x 200");
  std::string outputs = "outputs:\n";
  for (int i = 0; i < 201; ++i) outputs += "  y" + std::to_string(i) + ": {column: 1}\n";
  EXPECT_EQ(error_of(replaced(kLinear, "outputs: [{name: y, column: level}]\n", outputs)),
            "12:3: outputs has 201 entries; expected 1 to 200");
}

// ---- setting parameters ----

TEST_F(ModelFileTest, SetParameterTakesTheParametersUnitOrItsOwn) {
  Model model = read(kVehicle);
  set_parameter(model, "Cf=90");
  EXPECT_DOUBLE_EQ(named(model, "Cf").scalar(), 9e4);
  set_parameter(model, " Cf = 85000 N/rad ");
  EXPECT_DOUBLE_EQ(named(model, "Cf").scalar(), 8.5e4);
  EXPECT_EQ(named(model, "Cf").unit, "kN/rad");
  set_parameter(model, "a=1 m");
  EXPECT_DOUBLE_EQ(named(model, "a").scalar(), 1.0);
  EXPECT_TRUE(named(model, "a").fixed);
  set_parameter(model, "bank=1 deg");
  EXPECT_NEAR(named(model, "bank").scalar(), std::numbers::pi / 180, 1e-15);
}

TEST_F(ModelFileTest, SetParameterOfALinearModel) {
  Model model = read(kLinear);
  set_parameter(model, "q=1e6");
  EXPECT_EQ(instantiate(as_linear(model), model.parameters).Q(0, 0), 1e6);
  set_parameter(model, "q=0");
  EXPECT_EQ(named(model, "q").scalar(), 0.0);
  Model structured =
      read(replaced(replaced(kLinear, "[[q, 0], [0, 1]]", "{structure: scaled-identity}"),
                    "  q: {value: 2, min: 0}\n", ""));
  set_parameter(structured, "Q=7");
  EXPECT_EQ(instantiate(as_linear(structured), structured.parameters).Q, matrix({{7, 0}, {0, 7}}));
}

TEST_F(ModelFileTest, SetParameterErrors) {
  const Model vehicle = read(kVehicle);
  const Model road = read(replaced(replaced(kVehicle, "  steering_ratio: 21\n", ""),
                                   "steering_wheel_angle", "road_wheel_angle"));
  const Model linear = read(replaced(kLinear, "[[q, 0], [0, 1]]", "[[q, 1], [1, 1]]"));
  const Model full =
      read(replaced(replaced(kLinear, "  q: {value: 2, min: 0}\n  r: 3\n", "  q: 1\n"),
                    "Q: [[q, 0], [0, 1]]\nR: [[r]]",
                    "Q: {structure: full}\nR: {structure: full}\nS: [[q], [0]]"));
  struct Case {
    const Model& model;
    const char* assignment;
    const char* expected;
  };
  const Case cases[] = {
      {vehicle, "Cf", "'Cf'; expected NAME=VALUE"},
      {vehicle, "Cg=5", "'Cg=5': the model has no parameter 'Cg'; did you mean 'Cf'?"},
      {linear, "zzzz=5", "'zzzz=5': the model has no parameter 'zzzz'; expected one of q, r"},
      {vehicle, "=5", "'=5'; expected NAME=VALUE"},
      {vehicle, "Cf=", "'Cf=' is ''; expected a finite number, with or without a unit"},
      {vehicle, "Cf=nan", "'Cf=nan' is 'nan'; expected a finite number, with or without a unit"},
      {vehicle, "Cf=5 kg", "'Cf=5 kg' is in 'kg'; expected a unit like 'kN/rad'"},
      {vehicle, "Cf=5 furlong", "'Cf=5 furlong' has the unknown unit 'furlong'"},
      {vehicle, "Cr=1", "parameter 'Cr' is 1 kN/rad; expected 10 kN/rad (min) or above"},
      {vehicle, "Iz=7000", "parameter 'Iz' is 7000 kg m^2; expected 6000 kg m^2 (max) or below"},
      {vehicle, "m=-1", "parameter 'm' is -1 kg; expected a value above 0"},
      {road, "steering_ratio=16",
       "'steering_ratio=16': the input road_wheel_angle makes no use of it"},
      {linear, "q=-1", "parameter 'q' is -1; expected 0 (min) or above"},
      {linear, "q=0.5", "'q=0.5': Q is not positive semidefinite then"},
      {full, "Q=3", "'Q=3': Q is a matrix; change its start in the model file"},
      {full, "R=-1", "'R=-1': the matrix is not positive semidefinite"},
      {full, "R=0", "'R=0': the matrix is singular, and a free full matrix cannot start there"},
      {full, "R=0.5",
       "'R=0.5': the joint covariance of Q, R and S is not positive semidefinite then"},
  };
  for (const Case& c : cases) EXPECT_EQ(error_of_setting(c.model, c.assignment), c.expected);
}

TEST_F(ModelFileTest, AFailedSettingChangesNothing) {
  Model model = read(replaced(kLinear, "[[q, 0], [0, 1]]", "[[q, 1], [1, 1]]"));
  EXPECT_THROW(set_parameter(model, "q=0.5"), InputError);
  EXPECT_EQ(named(model, "q").scalar(), 2.0);
}

// ---- properties ----

std::string number(double value) {
  std::ostringstream out;
  out << std::setprecision(17) << value;
  return out.str();
}

// Writes a matrix as people do: rows on one line or one per line, entries with or without blanks.
std::string written(const std::string& key, const Eigen::MatrixXd& M, bool block,
                    const std::function<std::string(Eigen::Index, Eigen::Index)>& entry) {
  std::string out = key + ":" + (block ? "\n" : " [");
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    out += block ? "  - [" : (i > 0 ? ",[" : "[");
    for (Eigen::Index j = 0; j < M.cols(); ++j) out += (j > 0 ? ", " : "") + entry(i, j);
    out += block ? "]\n" : "]";
  }
  return out + (block ? "" : "]\n");
}

TEST_F(ModelFileTest, RandomModelsAreReadBackAsWritten) {
  std::mt19937_64 random(20240607);
  const auto uniform = [&](int from, int to) {
    return from + static_cast<int>(random() % static_cast<unsigned>(to - from + 1));
  };
  const auto real = [&] {
    return std::ldexp(static_cast<double>(static_cast<std::int64_t>(random())), -uniform(55, 70));
  };
  const auto random_matrix = [&](Eigen::Index rows, Eigen::Index cols) {
    Eigen::MatrixXd M(rows, cols);
    for (double& x : M.reshaped()) x = uniform(0, 3) == 0 ? 0.0 : real();
    return M;
  };
  for (int trial = 0; trial < 300; ++trial) {
    SCOPED_TRACE(trial);
    const Eigen::Index n = uniform(1, 6), ny = uniform(1, 4), nu = uniform(0, 3),
                       nw = uniform(1, 5);
    StateSpace truth;
    truth.A = random_matrix(n, n);
    truth.B = random_matrix(n, nu);
    truth.C = random_matrix(ny, n);
    truth.D = random_matrix(ny, nu);
    truth.G = random_matrix(n, nw);
    const Eigen::MatrixXd F = random_matrix(nw, nw), H = random_matrix(ny, ny);
    truth.Q = (F * F.transpose()).selfadjointView<Eigen::Lower>();
    truth.R = (H * H.transpose()).selfadjointView<Eigen::Lower>();
    truth.dt = std::abs(real()) + 0.1;

    // Some entries of A, B, C, D and G become parameters or multiples of them.
    ParameterSet parameters;
    std::string declared;
    const auto entry_of = [&](Eigen::MatrixXd& M, bool may_vary) {
      return [&M, may_vary, &parameters, &declared, &uniform, &real](Eigen::Index i,
                                                                     Eigen::Index j) {
        if (!may_vary || uniform(0, 2) != 0) return number(M(i, j));
        Parameter p;
        p.name = "p" + std::to_string(parameters.size());
        p.value = matrix({{real()}});
        p.fixed = uniform(0, 1) == 0;
        if (!p.fixed && uniform(0, 1) == 0) p.min = p.scalar() - 1.0;
        if (!p.fixed && uniform(0, 1) == 0) p.max = p.scalar() + 1.0;
        declared += "  " + p.name + ": ";
        if (p.fixed) {
          declared += number(p.scalar()) + "\n";
        } else {
          declared += "{value: " + number(p.scalar()) +
                      (std::isfinite(p.min) ? ", min: " + number(p.min) : "") +
                      (std::isfinite(p.max) ? ", max: " + number(p.max) : "") + "}\n";
        }
        const double factor = real();
        const std::pair<double, std::string> forms[] = {{1.0, p.name},
                                                        {-1.0, "-" + p.name},
                                                        {factor, number(factor) + "*" + p.name},
                                                        {factor, p.name + " * " + number(factor)}};
        const auto& [multiple, text] = forms[uniform(0, 3)];
        M(i, j) = multiple * p.scalar();
        parameters.push_back(std::move(p));
        return text;
      };
    };
    const auto write = [&](const char* key, Eigen::MatrixXd& M, bool may_vary) {
      return written(key, M, uniform(0, 1) == 0, entry_of(M, may_vary));
    };
    std::vector<std::string> parts = {"identikal: 1\n",
                                      "name: random\n",
                                      "time: {step: " + number(truth.dt) + "}\n",
                                      write("A", truth.A, true),
                                      write("C", truth.C, true),
                                      write("G", truth.G, true),
                                      write("Q", truth.Q, false),
                                      write("R", truth.R, false)};
    if (nu > 0) {
      parts.push_back(write("B", truth.B, true));
      parts.push_back(write("D", truth.D, true));
      std::string inputs = "inputs:\n";
      for (int i = 0; i < nu; ++i) inputs += "- {name: u" + std::to_string(i) + ", column: 1}\n";
      parts.push_back(inputs);
    }
    std::string outputs = "outputs:\n";
    for (int i = 0; i < ny; ++i) outputs += "  y" + std::to_string(i) + ": {column: c}\n";
    parts.push_back(outputs);
    if (!declared.empty()) parts.push_back("parameters:\n" + declared);
    std::string text;
    for (; !parts.empty(); parts.pop_back()) {  // keys may come in any order
      std::swap(parts[uniform(0, static_cast<int>(parts.size()) - 1)], parts.back());
      text += parts.back();
    }

    const Model model = read(text);
    const StateSpace at = instantiate(as_linear(model), model.parameters);
    check_shapes(at);
    EXPECT_EQ(at.A, truth.A);
    EXPECT_EQ(at.B, truth.B);
    EXPECT_EQ(at.C, truth.C);
    EXPECT_EQ(at.D, truth.D);
    EXPECT_EQ(at.G, truth.G);
    EXPECT_EQ(at.Q, truth.Q);
    EXPECT_EQ(at.R, truth.R);
    EXPECT_EQ(at.dt, truth.dt);
    ASSERT_EQ(model.parameters.size(), parameters.size());
    for (const Parameter& p : parameters) {
      const Parameter& read_back = named(model, p.name);
      EXPECT_EQ(read_back.value, p.value);
      EXPECT_EQ(read_back.fixed, p.fixed);
      EXPECT_EQ(read_back.min, p.min);
      EXPECT_EQ(read_back.max, p.max);
    }
  }
}

TEST_F(ModelFileTest, ScaleOffsetAndDelayOfAChannel) {
  const auto with = [&](const std::string& keys) {
    return replaced(kVehicle, "{column: 3, unit: deg/s}", "{column: 3, " + keys + "}");
  };
  const ChannelSource plain = read(kVehicle).outputs[0];
  EXPECT_EQ(plain.scale, 1.0);
  EXPECT_EQ(plain.offset, 0.0);
  EXPECT_EQ(plain.delay, 0.0);
  const ChannelSource r =
      read(with("unit: deg/s, scale: -1, offset: 0.2, delay: 740 ms")).outputs[0];
  EXPECT_EQ(r.scale, -1.0);
  EXPECT_EQ(r.offset, 0.2);
  EXPECT_DOUBLE_EQ(r.delay, 0.74);
  EXPECT_EQ(read(with("delay: -2")).outputs[0].delay, -2.0);
  EXPECT_NEAR(read(with("unit: deg/s, offset: 0.01 rad/s")).outputs[0].offset, 0.572958, 1e-6);
  EXPECT_EQ(error_of(with("scale: 0")),
            "14:33: scale is 0; expected a number that leaves something, e.g. -1");
  EXPECT_EQ(error_of(with("scale: none")), "14:33: scale is 'none'; expected a finite number");
  EXPECT_THAT(error_of(with("unit: deg/s, offset: 2 m")),
              testing::HasSubstr("14:47: offset is in 'm'; expected a unit like 'deg/s'"));
  EXPECT_THAT(error_of(with("delay: 3 m")), testing::HasSubstr("delay is in 'm'"));
  EXPECT_THAT(error_of(with("lag: 3 s")), testing::HasSubstr("'lag'"));
}

// Whatever a file holds, it is read into a consistent model or refused in one line with its path.
TEST_F(ModelFileTest, DamagedFilesAreReadOrRefused) {
  std::vector<std::string> seeds = {kLinear, kVehicle};
  for (const char* name : {"nile.yaml", "system7.yaml", "severe_lane_change.yaml"}) {
    std::ifstream file(example(name));
    seeds.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  const std::vector<std::string> fragments = {"[",
                                              "]",
                                              "{",
                                              "}",
                                              ":",
                                              ": ",
                                              ",",
                                              "- ",
                                              "\n",
                                              "\n  ",
                                              "\t",
                                              "#",
                                              "*",
                                              "&a ",
                                              "*a",
                                              "!",
                                              "!!",
                                              "%",
                                              "|",
                                              ">",
                                              "'",
                                              "\"",
                                              "\\",
                                              "?",
                                              "? ",
                                              "---\n",
                                              "...\n",
                                              "<<: ",
                                              "~",
                                              "null",
                                              "nan",
                                              ".inf",
                                              "1e999",
                                              "-",
                                              "+",
                                              "0",
                                              "1e308",
                                              "-1",
                                              "q",
                                              "r",
                                              "2*q",
                                              "Q",
                                              "R",
                                              "A",
                                              "S",
                                              "kg",
                                              "deg",
                                              "min",
                                              "max",
                                              "value",
                                              "fixed: true",
                                              "unit",
                                              "start",
                                              "structure: full",
                                              "diagonal",
                                              "initial: {mean: [0], sd: [1]}\n",
                                              "\xff",
                                              "\xc3\xa5",
                                              std::string(1, '\0'),
                                              "[[",
                                              "]]",
                                              "[[[[[[[[",
                                              "inputs: {u: {column: 1}}\n",
                                              "B: [[1]]\n",
                                              "\r",
                                              "\xEF\xBB\xBF"};
  std::mt19937_64 random(7);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  int accepted = 0;
  for (int trial = 0; trial < 6000; ++trial) {
    std::string text = seeds[below(seeds.size())];
    for (std::size_t edits = 1 + below(4); edits > 0 && !text.empty(); --edits) {
      const std::size_t at = below(text.size()), other = below(text.size());
      const std::size_t length = std::min(below(20), text.size() - at);
      switch (below(6)) {
        case 0:
          text[at] = static_cast<char>(below(256));
          break;
        case 1:
          text.erase(at, length);
          break;
        case 2:
          text.insert(at, fragments[below(fragments.size())]);
          break;
        case 3:
          text.replace(at, length, fragments[below(fragments.size())]);
          break;
        case 4:
          text.insert(other, text.substr(at, length));
          break;
        default:
          if (below(10) == 0) text.resize(at);
      }
    }
    SCOPED_TRACE(text);
    try {
      Model model = read(text);
      ++accepted;
      ASSERT_FALSE(model.outputs.empty());
      const Eigen::VectorXd start = coordinates(model.parameters);
      const Box box = coordinate_box(model.parameters);
      ASSERT_TRUE(start.allFinite());
      ASSERT_TRUE((start.array() >= box.lower.array()).all() &&
                  (start.array() <= box.upper.array()).all());
      if (is_linear(model)) {
        const StateSpace at = instantiate(as_linear(model), model.parameters);
        check_shapes(at);
        ASSERT_EQ(at.outputs(), static_cast<Eigen::Index>(model.outputs.size()));
        ASSERT_EQ(at.inputs(), static_cast<Eigen::Index>(model.inputs.size()));
      } else {
        ASSERT_EQ(model.parameters.size(), 19U);
        ASSERT_EQ(model.inputs.size(), 2U);
      }
      try {
        const std::string name = below(2) == 0 || model.parameters.empty()
                                     ? "q"
                                     : model.parameters[below(model.parameters.size())].name;
        set_parameter(model, name + "=" + fragments[below(fragments.size())]);
      } catch (const InputError&) {
      }
    } catch (const InputError& error) {
      const std::string message = error.what();
      ASSERT_TRUE(message.starts_with(path_ + ":")) << message;
      ASSERT_EQ(std::count(message.begin(), message.end(), '\n'), 0) << message;
    }
  }
  EXPECT_GT(accepted, 100) << "the mutations are too strong to test anything";
}

// As another program has printed it, with the rounding of its own sums.
TEST(ModelFile, RoundingDoesNotMakeACovarianceAsymmetric) {
  const std::string text =
      "identikal: 1\ntime: {kind: discrete, step: 1 s}\nA: [[0.5, 0], [0, 0.2]]\nC: [[1, 1]]\n"
      "Q: [[3, 1.0000000001], [1, 2]]\nR: [[1]]\noutputs: [{name: y, column: y}]\n";
  const Model model = parse_model_file(text, "model.yaml");
  const Eigen::MatrixXd Q = as_linear(model).Q.constant;
  EXPECT_EQ(Q(0, 1), Q(1, 0));
  EXPECT_NEAR(Q(0, 1), 1.0 + 5e-11, 1e-15);
}

}  // namespace
}  // namespace identikal
