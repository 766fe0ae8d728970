// What a motion lacks and process noise takes over is found by its score, and a right model is left alone.
#include "identify/noise/curved_motion.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "identify/model/extension.h"
#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;

// A drive with losses that grow with its speed.
const char* const kDrive = R"(identikal: 1
name: drive
time: {kind: continuous, column: t, unit: s, step: 0.1 s}
states: {w: rad/s}
parameters:
  k: {value: 2 rad/s^2, min: 0}
  b: {value: 1 1/s, min: 0}
  q: {value: 0.1, min: 0}
  r: {value: 0.01, min: 0}
inputs: {u: {column: u}}
outputs: {speed: {column: w, unit: rad/s, equals: w}}
dynamics: {w: k*u - b*w}
noise: {process: {kind: density, variance: {w: q}}, measurement: {variance: {speed: r}}}
initial: {mean: {w: 0}, sd: {w: 0.1 rad/s}}
)";

// w' = 3 u - 0.5 w - damping w |w| - friction sign(w), ten steps a sample.
Dataset driven(double damping, double friction, std::uint64_t seed) {
  constexpr Index kRows = 1500, kSteps = 10;
  constexpr double kStep = 0.01;
  Random random(seed);
  Dataset out;
  out.name = "drive";
  out.dt = 0.1;
  out.time = Eigen::VectorXd::LinSpaced(kRows, 0.0, 0.1 * static_cast<double>(kRows - 1));
  out.y.resize(1, kRows);
  out.u.resize(1, kRows);
  out.outputs = {{"speed", "rad/s"}};
  out.inputs = {{"u", ""}};
  double w = 0.0, u = 0.0;
  for (Index t = 0; t < kRows; ++t) {
    if (t % 40 == 0) u = random.normal();
    out.u(0, t) = u;
    out.y(0, t) = w + 0.05 * random.normal();
    for (Index k = 0; k < kSteps; ++k) {
      const double losses = 0.5 * w + damping * w * std::abs(w) + friction * std::tanh(w / 0.02);
      w += kStep * (3.0 * u - losses) + 0.3 * std::sqrt(kStep) * random.normal();
    }
  }
  return out;
}

NoiseEstimate judged(const Dataset& recording) {
  const YamlNode root = parse_yaml(kDrive, "drive.yaml");
  const Model model = model_of(root, "drive.yaml");
  NoiseMlOptions options;
  options.starts = 1;
  options.profiles = false;
  NoiseEstimate out = tune_ml(model, {recording}, options);
  judge_by_curves(root, model, {recording}, out, {});
  return out;
}

const Finding* nonlinear(const NoiseEstimate& estimate) {
  const auto at = std::find_if(estimate.findings.begin(), estimate.findings.end(),
                               [](const Finding& f) { return f.code == FindingCode::nonlinear; });
  return at == estimate.findings.end() ? nullptr : &*at;
}

// Asked at p = 0.001 of both curves together: one of forty is named with a probability of 4 %.
TEST(CurvedMotion, ARightModelIsLeftAlone) {
  int named = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    if (nonlinear(judged(driven(0.0, 0.0, seed)))) ++named;
  }
  std::printf("named %d of 40 right models\n", named);
  EXPECT_EQ(named, 0);
}

// Where innovations are coloured by it they refuse the model before.
TEST(CurvedMotion, DampingAndFrictionAreNamedWhereAnEstimateIsOff) {
  for (const auto& [damping, friction] : {std::pair{0.03, 0.0}, std::pair{0.0, 0.3}}) {
    int named = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const NoiseEstimate estimate = judged(driven(damping, friction, seed));
      const Finding* found = nonlinear(estimate);
      EXPECT_EQ(estimate.status, Status::untrusted);
      if (found == nullptr) continue;
      ++named;
      EXPECT_EQ(found->severity, Severity::serious) << found->text;
      EXPECT_NE(found->text.find("b would be"), std::string::npos) << found->text;
    }
    std::printf("damping %g, friction %g: named %d of 10\n", damping, friction, named);
    EXPECT_GE(named, 5);
  }
}

TEST(CurvedMotion, IsWrittenInTheUnitsOfTheState) {
  const YamlNode root = parse_yaml(kDrive, "drive.yaml");
  const YamlNode damped = extended(root, {ExtensionKind::quadratic_damping, {"w"}, {2.0}}, 0.1);
  EXPECT_NE(model_file_text(damped).find("drag_w*w*abs(w)"), std::string::npos);
  const YamlNode rubbing = extended(root, {ExtensionKind::dry_friction, {"w"}, {2.0}}, 0.1);
  EXPECT_NE(model_file_text(rubbing).find("friction_w*tanh(w/slow_w)"), std::string::npos);
  for (const YamlNode& more : {damped, rubbing}) {
    const Model model = model_of(more, "drive.yaml");  // units fit
    EXPECT_TRUE(is_formula_model(model));
    EXPECT_FALSE(is_linear(model));
  }
}

}  // namespace
}  // namespace identikal
