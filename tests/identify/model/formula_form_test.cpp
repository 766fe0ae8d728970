#include "identify/model/internal/formula_form.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "identify/filter/recordings_likelihood.h"
#include "identify/model/model_file.h"
#include "identify/model/row_selection.h"
#include "lib/base/random.h"
#include "lib/filter/simulation.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using ::testing::HasSubstr;

const std::string kPendulum = R"(identikal: 1
name: pendulum
time: {kind: continuous, step: 20 ms}
parameters:
  l: {value: 0.8 m, min: 0.1, max: 5}
  d: {value: 0.1 1/s, min: 0}
  m: 0.5 kg
  w0: {value: 0.1 rad/s}
  s: {value: 0.2, min: 0}
states: {phi: rad, w: rad/s}
inputs: {torque: {column: torque, unit: N m}}
let:
  J: m*l^2
dynamics:
  phi: w
  w: -g/l*sin(phi) - d*w + torque/J
outputs: {angle: {column: angle, unit: deg, equals: phi}}
noise: {process: {kind: density, sd: {w: s}}, measurement: {sd: {angle: 0.5 deg}}}
initial: {mean: {phi: 20 deg, w: w0}, sd: {phi: 5 deg}}
use_when: "torque < 3"
)";

const std::string kSystem7 = R"(identikal: 1
time: {kind: discrete, step: 1 s}
parameters:
  q1: {value: 10, min: 0}
  q2: {value: 3, min: 0}
  q3: {value: 7, min: 0}
  r1: {value: 1.5, min: 0}
  r2: {value: 3, min: 0}
states: [x1, x2, x3, x4]
dynamics:
  x1: 0.9*x1 + x3 + x4
  x2: -0.8*x2 - x4
  x3: -0.1*x2 + 0.85*x3 + x4
  x4: -0.2*x1 - 0.9*x4
outputs: {y1: {column: 1, equals: x1 + x4}, y2: {column: 2, equals: x2 + x3}}
G: [[0, 0, 0.1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
Q: [[q1, 0, 0], [0, q2, 0], [0, 0, q3]]
R: [[r1, 0], [0, r2]]
initial: stationary
)";

std::string with(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("'" + from + "' is not in the text");
  return text.substr(0, at) + to + text.substr(at + from.size());
}

class FormulaForm : public testing::Test {
 protected:
  FormulaForm()
      : path_((std::filesystem::temp_directory_path() /
               ("formula_form_" + std::to_string(getpid()) + ".yaml"))
                  .string()) {}
  ~FormulaForm() override { std::filesystem::remove(path_); }

  Model read(const std::string& text) const {
    std::ofstream(path_, std::ios::binary) << text;
    return read_model_file(path_);
  }
  // The message without the file's path.
  std::string refusal(const std::string& text) const {
    try {
      read(text);
    } catch (const InputError& error) {
      return std::string(error.what()).substr(path_.size() + 1);
    }
    return "accepted";
  }

  std::string path_;
};

TEST_F(FormulaForm, APendulumIsNonlinear) {
  const Model model = read(kPendulum);
  EXPECT_TRUE(is_formula_model(model));
  ASSERT_EQ(model.states.size(), 2U);
  EXPECT_EQ(model.states[1].name, "w");
  EXPECT_EQ(model.states[1].unit, "rad/s");
  EXPECT_EQ(as_formulas(model).equations.states, 2);
  EXPECT_EQ(as_formulas(model).equations.parameters, 5);
  const StateSpace noise = written_matrices(noise_model(model), model.parameters);
  const double degree = 3.14159265358979323846 / 180.0;
  EXPECT_TRUE(noise.x0.isApprox(Eigen::Vector2d(20.0 * degree, 0.1), 1e-14));
  EXPECT_NEAR(noise.P0(0, 0), 25.0 * degree * degree, 1e-15);
  EXPECT_EQ(noise.P0(1, 1), 0.0);
  EXPECT_EQ(noise.Q(0, 0), 0.0);
  EXPECT_NEAR(noise.Q(1, 1), 0.04, 1e-15);
  EXPECT_NEAR(noise.R(0, 0), 0.25 * degree * degree, 1e-18);
  EXPECT_EQ(noise_model(model).noise, ProcessNoise::density);
}

TEST_F(FormulaForm, System7AsFormulasIsTheSameLinearModel) {
  const Model model = read(kSystem7);
  ASSERT_TRUE(is_linear(model));
  const StateSpace s = instantiate(as_linear(model), model.parameters);
  EXPECT_EQ(s.A,
            (MatrixXd(4, 4) << 0.9, 0, 1, 1, 0, -0.8, 0, -1, 0, -0.1, 0.85, 1, -0.2, 0, 0, -0.9)
                .finished());
  EXPECT_EQ(s.C, (MatrixXd(2, 4) << 1, 0, 0, 1, 0, 1, 1, 0).finished());
  EXPECT_EQ(s.Q.diagonal(), Eigen::Vector3d(10, 3, 7));
  EXPECT_EQ(s.B.cols(), 0);
  EXPECT_TRUE(is_linear_in_parameters(as_linear(model), model.parameters));
}

TEST_F(FormulaForm, System7AsFormulasTakesTheCompressedPath) {
  const Model model = read(kSystem7);
  Random random(7);
  Dataset data;
  data.name = "system7";
  data.dt = 1.0;
  data.time = Eigen::VectorXd::LinSpaced(3000, 0.0, 2999.0);
  data.u.resize(0, 3000);
  data.y = simulate_outputs(instantiate(as_linear(model), model.parameters),
                            InitialState::stationary, MatrixXd(), 3000, random);
  const std::vector<Dataset> recordings{data};
  RecordingsLikelihood formulas(model, recordings);
  const Likelihood* found = formulas.evaluate(model.parameters, true);
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(formulas.evaluation_taken().method, EvaluationMethod::autocovariances);
  RecordingsLikelihood direct(model, recordings, EvaluationMethod::time_varying);
  const Likelihood* expected = direct.evaluate(model.parameters, true);
  std::printf("System 7 as formulas: path %s, log-likelihood %.10g, %.1e from the direct path\n",
              to_string(formulas.evaluation_taken().method), found->value,
              found->value / expected->value - 1.0);
  EXPECT_NEAR(found->value / expected->value, 1.0, 1e-9);
}

TEST_F(FormulaForm, AThermalNetworkIsLinearWithAnOffset) {
  const Model model = read(R"(identikal: 1
time: {kind: continuous, step: 1 min, inputs: foh}
parameters:
  R: {value: 2 K/W, min: 0.1}
  C: {value: 5 kJ/K, min: 0.1}
  outside: {value: 7 degC}
  r: {value: 0.01, min: 0}
states: {T: K}
inputs: {power: {column: P, unit: kW}}
dynamics: {T: (outside - T)/(R*C) + power/C}
outputs: {inside: {column: T, unit: degC, equals: T}}
noise: {measurement: {variance: {inside: r}}}
initial: {mean: {T: 20 degC}, sd: {T: 2 K}}
)");
  ASSERT_TRUE(is_linear(model));
  EXPECT_TRUE(as_linear(model).offset);
  EXPECT_EQ(as_linear(model).hold, InputHold::linear);
  const StateSpace s = written_matrices(as_linear(model), model.parameters);
  EXPECT_NEAR(s.A(0, 0), -1e-4, 1e-18);
  EXPECT_NEAR(s.B(0, 1), 1e-4 * 280.15, 1e-15);
  EXPECT_NEAR(s.x0[0], 293.15, 1e-12);
}

TEST_F(FormulaForm, SmoothInputsAndIrregularSamplesTakeTheGeneralFilter) {
  const std::string text =
      with(with(kPendulum, "sin(phi)", "phi"), "use_when: \"torque < 3\"\n", "");
  EXPECT_TRUE(is_linear(read(text)));
  EXPECT_TRUE(is_formula_model(read(with(text, "step: 20 ms", "step: 20 ms, inputs: pchip"))));
  EXPECT_TRUE(is_formula_model(read(with(text, "step: 20 ms", "column: t, sampling: irregular"))));
}

struct FormulaMistake {
  const char* from;      // this part of the pendulum's file
  const char* to;        // becomes this
  const char* expected;  // line:column: message
};
constexpr FormulaMistake kMistakes[] = {
    {"sin(phi)", "sin(fi)", "16:15: unknown name 'fi'; expected a name that the model declares"},
    {"sin(phi)", "sinus(phi)", "16:11: unknown function 'sinus'"},
    {"- d*w", "- d*phi", "16:20: "},
    {"phi: w\n", "phi: phi\n", "15:8: "},
    {"J: m*l^2", "J: m + l", "13:8: "},
    {"J: m*l^2", "l: m*l^2",
     "13:3: a definition is 'l' again; expected a name of its own; the first "
     "is on line 5, column 3"},
    {"J: m*l^2", "J: m*b\n  b: l^2",
     "13:8: 'b' is defined later; expected names defined before it; move 'J' below it"},
    {"J: m*l^2", "J: m*J", "13:8: 'J' is defined by itself; expected names defined before it"},
    {"J: m*l^2", "J: m*l^2\n  b: l^2", "14:3: definition 'b' is not used anywhere"},
    {"m: 0.5 kg", "sin: 0.5 kg", "7:3: a parameter name is 'sin', a word of formulas"},
    {"m: 0.5 kg", "t: 0.5 kg",
     "7:3: a parameter is 't', the time; expected another name; formulas may use t; a column that "
     "holds it is named by time: {column: ...}"},
    {"w: rad/s}", "w: rad/x}", "10:23: state 'w' has the unknown unit 'rad/x'"},
    {"equals: phi", "equals: w",
     "17:53: the formula is a rate (1/s); expected a number (no dimension)"},
    {", equals: phi", "", "17:18: output 'angle' is no state; expected equals: formula"},
    {"phi: w\n", "", "15:5: dynamics of state 'phi' are missing"},
    {"angle: 0.5 deg", "angle: 0.5 m", "18:73: the standard deviation of 'angle' is '0.5 m'"},
    {"angle: 0.5 deg", "angle: -1 deg",
     "18:73: the standard deviation of 'angle' '-1 deg' is "
     "negative"},
    {"kind: density, ", "", "18:18: 'kind' is missing in process"},
    {"w: w0}", "w: l}", "19:34: the formula is a length (m); expected a rate (1/s)"},
    {"mean: {phi: 20 deg, w: w0}", "mean: {phi: 20 deg}", "19:17: mean of 'w' is missing"},
    {"{mean: {phi: 20 deg, w: w0}, sd: {phi: 5 deg}}", "diffuse",
     "19:10: a nonlinear model has no such start"},
    {"torque < 3", "phi < 3", "20:12: 'phi' is no input"},
    {"torque < 3", "torque", "20:12: a number where a condition belongs"},
    {"use_when: \"torque < 3\"", "A: [[1]]", "20:1: 'A' is a duplicate of the formulas"},
    {"- d*w + torque/J", "+ torque/J", "6:3: parameter 'd' is not used anywhere"},
    {"use_when: \"torque < 3\"", "doses: {w: torque/J*(1 s)}",
     "20:8: doses are given at rows, which a step would move"},
    {"use_when: \"torque < 3\"", "doses: {v: torque}", "20:9: unknown key 'v' in doses"},
    {"{mean: {phi: 20 deg, w: w0}, sd: {phi: 5 deg}}", "steady",
     "19:10: initial is 'steady'; expected one of stationary, diffuse, steady-state"},
};

TEST_F(FormulaForm, MistakesAreShownWhereTheyStand) {
  for (const FormulaMistake& mistake : kMistakes) {
    EXPECT_THAT(refusal(with(kPendulum, mistake.from, mistake.to)),
                testing::StartsWith(mistake.expected))
        << mistake.from << " -> " << mistake.to;
  }
}

TEST_F(FormulaForm, AFormulaOverSeveralLinesKeepsItsPlaces) {
  const std::string text = with(kPendulum, "  w: -g/l*sin(phi) - d*w + torque/J\n",
                                "  w: \"-g/l*sin(phi)\n    - d*w\n    + torqe/J\"\n");
  EXPECT_THAT(refusal(text), testing::StartsWith("18:7: unknown name 'torqe'"));
  const std::string plain = with(kPendulum, "  w: -g/l*sin(phi) - d*w + torque/J\n",
                                 "  w: -g/l*sin(phi)\n    - d*w\n    + torqe/J\n");
  EXPECT_THAT(refusal(plain), testing::StartsWith("18:7: unknown name 'torqe'"));
}

TEST_F(FormulaForm, FilesMayIncludeOthers) {
  const std::string common = path_ + ".common.yaml";
  std::ofstream(common) << "identikal: 1\nparameters:\n  m: 0.5 kg\n  l: 9 m\nlet:\n  J: m*l^2\n";
  std::string text = with(kPendulum, "  m: 0.5 kg\n", "");
  text = with(text, "let:\n  J: m*l^2\n", "");
  const std::string name = std::filesystem::path(common).filename().string();
  const Model model = read("include: " + name + "\n" + text);
  EXPECT_EQ(model.parameters[find_parameter(model.parameters, "m")].scalar(), 0.5);
  EXPECT_EQ(model.parameters[find_parameter(model.parameters, "l")].scalar(), 0.8);
  EXPECT_THAT(refusal("include: absent.yaml\n" + text), HasSubstr("1:10: include 'absent.yaml'"));
  std::ofstream(common) << "include: " << std::filesystem::path(path_).filename().string() << "\n";
  try {
    read("include: " + name + "\n" + text);
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("comes back to itself"));
  }
  std::filesystem::remove(common);
}

TEST_F(FormulaForm, RowsThatCannotBeUsedSplitTheRecording) {
  const Model model = read(kPendulum);
  Dataset data;
  data.name = "swing.csv";
  data.dt = 0.02;
  data.time = Eigen::VectorXd::LinSpaced(10, 0.0, 0.18);
  data.u = MatrixXd::Zero(1, 10);
  data.y = MatrixXd::Ones(1, 10);
  data.u(0, 4) = 5.0;
  data.u(0, 6) = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Dataset> parts = usable_segments(model, data);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].size(), 4);
  EXPECT_EQ(parts[1].size(), 3);
  EXPECT_DOUBLE_EQ(parts[1].time[0], 0.14);
  ASSERT_EQ(parts[0].notes.size(), 1U);
  EXPECT_EQ(parts[0].notes[0], "7 of 10 rows used, in 2 segments");
}

}  // namespace
}  // namespace identikal
