// Estimates in the place of a model file's starts, however the user wrote it.
#include "identify/result/estimated_model.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;

EstimatedParameter estimated(const std::string& name, double value, const std::string& unit = "",
                             bool fixed = false) {
  EstimatedParameter p;
  p.name = name;
  p.unit = unit;
  p.value = value;
  p.fixed = fixed;
  return p;
}

StoredEstimate estimate_with(const std::string& model, std::vector<EstimatedParameter> parameters) {
  StoredEstimate out;
  out.model_file = {"model.yaml", "", model, {}};
  out.parameters = std::move(parameters);
  return out;
}

const std::string kTwoStates = R"(identikal: 1   # a comment: with {braces}, [brackets]
time: {step: 1 s}
parameters: {"a": {value: '0.5', min: 0.1, max: 0.9}, k: 2}
A: [[a, 0], [0, 0.5*k]]
C: [[1, 1]]
)";

TEST(EstimatedModel, FillsFlowsQuotesAndBlocks) {
  const StoredEstimate e =
      estimate_with(kTwoStates + R"(Q:
  structure: diagonal
  start:
    - 1    # of the first
    - 2
R: {start: [[1]], structure: full}
outputs: [{name: "ÜÖ", column: y}]
)",
                    {estimated("a", 0.1), estimated("k", 0.25, "", true), estimated("Q(1,1)", 3.25),
                     estimated("Q(2,2)", 0.0), estimated("R(1,1)", 1.0 / 3.0)});
  const auto text = estimated_model_text(e, "result.json");
  ASSERT_TRUE(text);
  EXPECT_THAT(*text, HasSubstr("{\"a\": {value: 0.1, min: 0.1, max: 0.9}, k: 0.25}"));
  EXPECT_THAT(*text, HasSubstr("    [3.25, 0]\nR: {start: [[0.3333333333333333]],"));
  EXPECT_THAT(*text, HasSubstr("# a comment: with {braces}, [brackets]\n"));
  const Model model = parse_model_file(*text, "again.yaml");
  EXPECT_EQ(model.parameters[0].scalar(), 0.1);
  EXPECT_FALSE(model.parameters[0].fixed);
  EXPECT_TRUE(model.parameters[1].fixed);
  EXPECT_EQ(model.parameters[2].value, Eigen::Vector2d(3.25, 0.0).asDiagonal().toDenseMatrix());
}

TEST(EstimatedModel, ASingularMatrixIsFixed) {
  const std::vector<EstimatedParameter> values{estimated("a", 0.5),    estimated("k", 2, "", true),
                                               estimated("Q(1,1)", 4), estimated("Q(2,1)", 2),
                                               estimated("Q(2,2)", 1), estimated("R", 1)};
  for (const std::string Q : {"{structure: full}", "{fixed: false, structure: full, start: 3}"}) {
    const auto text = estimated_model_text(
        estimate_with(kTwoStates + "Q: " + Q +
                          "\nR: {structure: scaled-identity}\noutputs: [{name: y, column: y}]\n",
                      values),
        "result.json");
    ASSERT_TRUE(text) << Q;
    const Model model = parse_model_file(*text, "again.yaml");
    EXPECT_TRUE(model.parameters[2].fixed) << *text;
    EXPECT_EQ(model.parameters[2].value(1, 0), 2.0);
    EXPECT_FALSE(model.parameters[3].fixed);
  }
}

TEST(EstimatedModel, LargestForcesThatTheFileDoesNotName) {
  const std::string car = R"(identikal: 1
model: single-track
time: {column: t, unit: s}
parameters:
  m: 1446 kg
  a: 0.987 m
  b: 1.525 m
  Iz: 2319 kg m^2
  Cf: {value: 80 kN/rad}
  Cr: 8e4 N/rad
tyre: {curve: tanh}
inputs: {road_wheel_angle: {column: d}, vx: {column: v}}
outputs: {r: {column: r}}
)";
  StoredEstimate e = estimate_with(car, {});
  e.tyre_curve = "tanh";
  for (const Parameter& p : parse_model_file(car, "car.yaml").parameters) {
    e.parameters.push_back(estimated(p.name, p.name == "Cf" ? 91.5 : p.scalar(), p.unit, p.fixed));
    if (p.name == "Ff_max") e.parameters.back().value = 9000.0;
    if (p.name == "Fr_max") e.parameters.back().value = std::numeric_limits<double>::infinity();
  }
  const auto text = estimated_model_text(e, "result.json");
  ASSERT_TRUE(text);
  EXPECT_THAT(*text, HasSubstr("parameters:\n  Ff_max: {value: 9000 N}\n  m: 1446 kg\n"));
  EXPECT_THAT(*text, HasSubstr("  Cf: {value: 91.5 kN/rad}\n  Cr: 8e4 N/rad\n"));
}

// Their parameters stand in front of the file's own, and keep the bounds that `sensors` gives them.
TEST(EstimatedModel, SensorsByName) {
  const StoredEstimate e = estimate_with(
      R"(identikal: 1
time: {kind: continuous, step: 0.1 s}
parameters: {q: {value: 1, min: 0}}
states: [p]
dynamics: {p: -p}
outputs: {z: {column: z, equals: p}}
sensors: {z: {bias: {value: 1, max: 5}, error: markov}}
noise: {process: {kind: density, variance: {p: q}}, measurement: {variance: {z: 0.1}}}
initial: stationary
)",
      {estimated("q", 0.5), estimated("bias_z", 2.5), estimated("sd_z", 0.25),
       estimated("tau_z", 7.0)});
  const auto text = estimated_model_text(e, "result.json");
  ASSERT_TRUE(text);
  const Model model = parse_model_file(*text, "again.yaml");
  ASSERT_EQ(model.parameters.size(), 4u);
  for (const Parameter& p : model.parameters) {
    if (p.name == "bias_z") {
      EXPECT_EQ(p.scalar(), 2.5);
      EXPECT_EQ(p.max, 5.0);
    }
    EXPECT_EQ(p.name == "sd_z" ? p.min : 0.0, 0.0);
    EXPECT_EQ(p.name == "tau_z" ? p.scalar() : 7.0, 7.0);
  }
}

TEST(EstimatedModel, RefusesWhatIsNotOfTheModel) {
  StoredEstimate e = estimate_with(kTwoStates +
                                       "Q: [[1, 0], [0, 1]]\nR: [[1]]\noutputs: [{name: y, "
                                       "column: y}]\n",
                                   {estimated("k", 2.0, "", true)});
  EXPECT_THROW(estimated_model(e, "result.json"), InputError);  // a is missing
  e.parameters.push_back(estimated("a", 0.5));
  EXPECT_EQ(estimated_model(e, "result.json").parameters[0].scalar(), 0.5);
  e.parameters.push_back(estimated("b", 0.5));
  EXPECT_THROW(estimated_model(e, "result.json"), InputError);
  e.model_file.reset();
  EXPECT_THROW(estimated_model(e, "result.json"), InputError);
  // A value over two lines reads well, but nothing is put in its place.
  e = estimate_with(
      "identikal: 1\ntime: {step: 1 s}\nparameters:\n  r: {value: 3\n     m, min: 0}\nA: [[1]]\n"
      "C: [[1]]\nQ: [[1]]\nR: [[r]]\noutputs: [{name: y, column: y}]\n",
      {estimated("r", 4.0, "m")});
  EXPECT_EQ(estimated_model(e, "result.json").parameters[0].scalar(), 4.0);
  EXPECT_FALSE(estimated_model_text(e, "result.json"));
}

}  // namespace
}  // namespace identikal
