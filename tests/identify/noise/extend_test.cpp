// A part that the model lacks is found on rows held out, one that it does not lack is not, and the
// model file that results reads as the model that was tuned.
#include "identify/noise/extend.h"

#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/model/included_files.h"
#include "identify/model/model_file.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;

std::string two_sensors(const std::string& kind, const std::string& next) {
  const std::string process = kind == "discrete" ? "per-sample" : "density";
  return "identikal: 1\nname: two sensors\ntime: {kind: " + kind +
         ", step: 0.1 s, column: t}\n"
         "parameters: {q: {value: 0.02, min: 0}, ra: {value: 0.02, min: 0}, rb: {value: 0.1, min: "
         "0}}\n"
         "states: [p, v]\n" +
         next +
         "outputs: {a: {column: a, equals: p}, b: {column: b}, p: {column: c}}\n"
         "noise:\n"
         "  process: {kind: " +
         process +
         ", variance: {v: q}}\n"
         "  measurement: {variance: {a: ra, b: rb, p: rb}}\n"
         "initial: {mean: {p: 0, v: 0}, sd: {p: 1, v: 1}}\n";
}

std::string continuous_text() {
  std::string out = two_sensors("continuous", "dynamics: {p: v, v: -0.3*p - 0.2*v}\n");
  return out.replace(out.find("b: {column: b}"), 14, "b: {column: b, equals: p + 0.1*v}");
}

struct World {
  double bias = 0.0, lasting = 0.0;  // of sensor b
  double scale = 1.0;                // of sensor b
  double late = 0.0;                 // is sensor a [s]
  double disturbance = 0.0;          // of v, for 3 s, beside its white noise
};

Dataset simulated(const World& world, std::uint64_t seed, Index rows = 600) {
  Random random(seed);
  Dataset out;
  out.name = "drive";
  out.dt = 0.1;
  out.time = Eigen::VectorXd::LinSpaced(rows, 0.0, 0.1 * static_cast<double>(rows - 1));
  out.y.resize(3, rows);
  out.u.resize(0, rows);
  out.outputs = {{"a", ""}, {"b", ""}, {"p", ""}};
  double p = 0.5, v = 0.0, error = 0.0, disturbance = 0.0;
  std::vector<double> past;
  for (Index t = 0; t < rows; ++t) {
    past.push_back(p);
    const auto before = static_cast<Index>(std::lround(world.late / out.dt));
    const double seen = past[static_cast<std::size_t>(std::max<Index>(t - before, 0))];
    const auto measured = [&](double of, double sd) { return of + sd * random.normal(); };
    out.y.col(t) << measured(seen, 0.1),
        world.scale * (measured(p, 0.3) + 0.1 * v) + world.bias + error, measured(p, 0.3);
    for (int i = 0; i < 10; ++i) {
      const double now = p;
      p += 0.01 * v;
      v += 0.01 * (-0.3 * now - 0.2 * v + disturbance) + 0.1 * 0.15 * random.normal();
    }
    if (world.disturbance > 0.0) {
      const double stay = std::exp(-0.1 / 3.0);
      disturbance =
          stay * disturbance + world.disturbance * std::sqrt(1.0 - stay * stay) * random.normal();
    }
    const double keep = std::exp(-0.1 / 1.5);
    error = keep * error + world.lasting * std::sqrt(1.0 - keep * keep) * random.normal();
  }
  return out;
}

ExtendOptions with_one_start() {
  ExtendOptions out;
  out.search.starts = 1;
  out.search.profiles = false;
  return out;
}

ExtendResult run(const World& world, std::uint64_t seed, ExtendOptions options = {},
                 Index rows = 600) {
  const YamlNode root = parse_yaml(continuous_text(), "two.yaml");
  options.search.starts = 1;
  options.search.profiles = false;
  return tune_extended(root, model_of(root, "two.yaml"), {simulated(world, seed, rows)}, options);
}

std::string adopted(const ExtendResult& result) {
  std::string out;
  for (const ExtensionTrial& trial : result.tried) {
    if (trial.adopted) out += (out.empty() ? "" : "; ") + trial.what;
  }
  return out;
}

// Is the truth within 3.5 standard errors, and these at most `largest`?
// @param bias  of the method itself
void expect_value(const ExtendResult& result, const std::string& name, double truth, double largest,
                  double bias = 0.0) {
  int found = 0;
  for (const EstimatedParameter& p : result.estimate.parameters) {
    if (p.name != name) continue;
    ++found;
    EXPECT_NEAR(p.value, truth, 3.5 * p.se + bias) << name;
    EXPECT_LT(p.se, largest) << name;
  }
  EXPECT_EQ(found, 1) << name;
}

TEST(Extend, FindsTheBiasOfOneSensor) {
  const ExtendResult result = run({.bias = 0.6, .lasting = 0.0}, 1);
  EXPECT_EQ(adopted(result), "a bias of b");
  const Model model = parse_model_file(result.text, "extended.yaml");
  for (const EstimatedParameter& p : result.estimate.parameters) {
    ASSERT_GE(find_parameter(model.parameters, p.name), 0) << p.name;
  }
  expect_value(result, "bias_b", 0.6, 0.05);
}

TEST(Extend, FindsAnErrorThatLasts) {
  const ExtendResult result = run({.bias = 0.0, .lasting = 0.6}, 2);
  EXPECT_EQ(adopted(result), "an error that lasts, of b");
  EXPECT_NE(result.text.find("error_b"), std::string::npos);
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
}

TEST(Extend, FindsTheScaleOfOneSensor) {
  const ExtendResult result = run({.scale = 1.5}, 4, {}, 2000);
  // Its noise is larger by it, too, than that of p, which the model writes alike.
  EXPECT_EQ(adopted(result), "a scale of b; measurement noise of p of a size of its own");
  expect_value(result, "scale_b", 1.5, 0.15);
  expect_value(result, "ratio_p", 1.0 / 2.25, 0.1);
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
}

// Two sensors of one state.
const char* const kTwoAlike = R"(identikal: 1
time: {kind: continuous, column: t, step: 0.1 s}
parameters: {q: {value: 0.02, min: 0}, r: {value: 0.02, min: 0}}
states: [p]
dynamics: {p: -0.2*p}
outputs: {a: {column: a, equals: p}, b: {column: b, equals: p}}
noise: {process: {kind: density, variance: {p: q}}, measurement: {variance: {a: r, b: r}}}
initial: {mean: {p: 0}, sd: {p: 1}}
)";

// @param scale    of b
// @param lasting  sd of errors of both, for 1.5 s
// @param wild     every so many samples of a are off by ten standard deviations; 0: none
Dataset of_two_alike(double scale, double lasting, Index wild) {
  Dataset out = simulated({}, 1, 1500);
  out.y.conservativeResize(2, 1500);
  out.outputs.resize(2);
  Random random(8);
  const double keep = std::exp(-0.1 / 1.5), push = lasting * std::sqrt(1.0 - keep * keep);
  double p = 0.0;
  Eigen::Vector2d error(0.0, 0.0);
  for (Index t = 0; t < 1500; ++t) {
    p = 0.980198673 * p + 0.1 * random.normal();
    out.y.col(t) << p + 0.1 * random.normal(), scale * p + 0.1 * random.normal();
    if (lasting > 0.0) {
      error = keep * error + push * Eigen::Vector2d(random.normal(), random.normal());
      out.y.col(t) += error;
    }
    if (wild > 0 && t % wild == 0) out.y(0, t) += t % 2 == 0 ? 1.0 : -1.0;
  }
  return out;
}

ExtendResult with_one_part(const Dataset& data) {
  const YamlNode root = parse_yaml(kTwoAlike, "two.yaml");
  ExtendOptions options = with_one_start();
  options.most = 1;
  return tune_extended(root, model_of(root, "two.yaml"), {data}, options);
}

// Either may be wrong by a factor: half of it, in opposite directions, moves the state by neither.
TEST(Extend, WhichOfTwoSensorsIsOffIsNotTold) {
  const ExtendResult result = with_one_part(of_two_alike(1.3, 0.0, 0));
  int ambiguous = 0;
  for (const ExtensionTrial& trial : result.tried) {
    if (trial.what.starts_with("a scale of ")) ambiguous += trial.ambiguous ? 1 : 0;
  }
  EXPECT_EQ(ambiguous, 2);
  EXPECT_EQ(adopted(result), "a ratio between a and b, half of it in each");
  expect_value(result, "scale_a_b", 1.0 / std::sqrt(1.3), 0.02);
  EXPECT_NE(result.text.find("scale_a_b*(p)"), std::string::npos);
  EXPECT_NE(result.text.find("(p)/scale_a_b"), std::string::npos);
  // All of it may be one's: the state is off by 13 % then, and its band is a tenth of that.
  EXPECT_EQ(result.estimate.status, Status::untrusted);
  EXPECT_NE(result.estimate.findings.back().text.find("nothing tells which of them is off"),
            std::string::npos);
}

// The speed says how far it went: the sensor that disagrees is known.
TEST(Extend, AnInputTellsWhichOfTwoSensorsIsOff) {
  std::string text = kTwoAlike;
  text.replace(text.find("dynamics: {p: -0.2*p}"), 21,
               "inputs: {u: {column: u}}\ndynamics: {p: u}");
  Dataset data = of_two_alike(1.0, 0.0, 0);
  data.u.resize(1, 1500);
  data.inputs = {{"u", ""}};
  Random random(9);
  double p = 0.0, u = 0.0;
  for (Index t = 0; t < 1500; ++t) {
    data.u(0, t) = u;
    data.y.col(t) << p + 0.1 * random.normal(), 1.1 * p + 0.1 * random.normal();
    p += 0.1 * u + 0.005 * random.normal();
    u = 0.95 * u + 0.3 * random.normal();
  }
  const YamlNode root = parse_yaml(text, "two.yaml");
  const ExtendResult result =
      tune_extended(root, model_of(root, "two.yaml"), {data}, with_one_start());
  EXPECT_EQ(adopted(result), "a scale of b");
  expect_value(result, "scale_b", 1.1, 0.02);
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
}

// A few samples cost a sharper filter hundreds of nats each, and hide what it gains on all others.
TEST(Extend, ErrorsOfSensorsOfOneKindAreAlikeAndWildSamplesDoNotHideThem) {
  const ExtendResult result = with_one_part(of_two_alike(1.0, 0.4, 83));
  EXPECT_EQ(adopted(result), "errors that last, alike, of a, b");
  for (const ExtensionTrial& trial : result.tried) {
    if (trial.what.starts_with("an error that lasts, of ")) {
      EXPECT_FALSE(trial.adopted) << trial.what;
    }
  }
  EXPECT_TRUE(with_one_part(of_two_alike(1.0, 0.0, 83)).text.empty());
}

constexpr double kPlaces[][2] = {{-3.4, 3.0}, {0.0, -3.1}, {3.6, 2.9}, {3.5, -3.0}, {-3.5, -0.1}};

// Distances to five places, each with an error that lasts for 2 s, and a constant.
std::string ranges_text() {
  std::string outputs, noise;
  for (int i = 0; i < 5; ++i) {
    const std::string name = "d" + std::to_string(i);
    outputs += "  " + name + ": {column: " + name + ", equals: \"sqrt((px - (" +
               std::to_string(kPlaces[i][0]) + "))^2 + (py - (" + std::to_string(kPlaces[i][1]) +
               "))^2)\"}\n";
    noise += (i > 0 ? ", " : "") + name + ": r";
  }
  return "identikal: 1\nname: ranges\ntime: {kind: continuous, step: 0.1 s, column: t}\n"
         "parameters: {q: {value: 0.01, min: 0}, r: {value: 0.01, min: 0}}\n"
         "states: [px, py, vx, vy]\ndynamics: {px: vx, py: vy, vx: 0, vy: 0}\noutputs:\n" +
         outputs +
         "noise:\n  process: {kind: density, variance: {vx: q, vy: q}}\n  measurement: {variance: "
         "{" +
         noise +
         "}}\ninitial: {mean: {px: 0, py: 0, vx: 0, vy: 0}, sd: {px: 3, py: 3, vx: 1, vy: 1}}\n";
}

Dataset ranges(double constant, std::uint64_t seed, Index rows) {
  Random random(seed);
  Dataset out;
  out.name = "walk";
  out.dt = 0.1;
  out.time = Eigen::VectorXd::LinSpaced(rows, 0.0, 0.1 * static_cast<double>(rows - 1));
  out.y.resize(5, rows);
  out.u.resize(0, rows);
  for (int i = 0; i < 5; ++i) out.outputs.push_back({"d" + std::to_string(i), ""});
  Eigen::Vector2d p(0.5, 0.2), v(0.0, 0.1);
  Eigen::VectorXd error(5);
  for (double& e : error) e = 0.06 * random.normal();
  for (Index t = 0; t < rows; ++t) {
    for (int i = 0; i < 5; ++i) {
      const double distance = std::hypot(p[0] - kPlaces[i][0], p[1] - kPlaces[i][1]);
      out.y(i, t) = distance + constant * (1.0 + 0.2 * i) + error[i] + 0.03 * random.normal();
      const double keep = std::exp(-0.1 / 2.0);
      error[i] = keep * error[i] + 0.06 * std::sqrt(1.0 - keep * keep) * random.normal();
    }
    p += 0.1 * v;
    for (double& each : v) each += 0.03 * random.normal();
  }
  return out;
}

// While a filter runs on it takes a constant in as an error that lasts: rows held out show nothing of it.
TEST(Extend, FindsConstantsBesideErrorsThatLast) {
  const YamlNode root = parse_yaml(ranges_text(), "ranges.yaml");
  const Model model = model_of(root, "ranges.yaml");
  const std::string lasting = "errors that last, alike, of d0, d1, d2, d3, d4";
  const ExtendResult off = tune_extended(root, model, {ranges(0.2, 1, 400)}, with_one_start());
  EXPECT_EQ(adopted(off), lasting + "; biases of d0, d1, d2, d3, d4");
  expect_value(off, "sd_errors", 0.06, 0.02);
  const ExtendResult right = tune_extended(root, model, {ranges(0.0, 2, 400)}, with_one_start());
  EXPECT_EQ(adopted(right), lasting);
}

TEST(Extend, FindsASensorThatIsLate) {
  const ExtendResult result = run({.late = 0.3}, 5, {}, 2000);
  EXPECT_EQ(adopted(result), "a delay of a");
  expect_value(result, "delay_a", 0.3, 0.1, 0.05);  // to first order in it
}

TEST(Extend, FindsProcessNoiseThatIsNotWhite) {
  const ExtendResult result = run({.disturbance = 1.0}, 6, {}, 2000);
  EXPECT_EQ(adopted(result), "coloured process noise of v");
  expect_value(result, "tau_disturbance_v", 3.0, 1.5);
  expect_value(result, "sd_disturbance_v", 1.0, 0.3);
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
}

// An angle by its gyro, whose bias the model lacks.
TEST(Extend, FindsTheBiasOfAnInput) {
  const YamlNode root = parse_yaml(R"(identikal: 1
time: {kind: continuous, column: t, unit: s, step: 100 ms}
parameters: {q: {value: 1e-4, min: 0}, r: {value: 0.01, min: 0}}
states: {psi: rad}
inputs: {gyro: {column: gyro, unit: rad/s}}
let: {rate: 1*gyro}
dynamics: {psi: rate}
outputs: {level: {column: level, unit: rad, equals: psi}}
noise: {process: {kind: density, variance: {psi: q}}, measurement: {variance: {level: r}}}
initial: {mean: {psi: 0}, sd: {psi: 1}}
)",
                                   "level.yaml");
  Dataset drive;
  drive.name = "drive";
  drive.dt = 0.1;
  drive.time = Eigen::VectorXd::LinSpaced(1000, 0.0, 99.9);
  drive.y.resize(1, 1000);
  drive.u.resize(1, 1000);
  drive.inputs = {{"gyro", ""}};
  drive.outputs = {{"level", ""}};
  Random random(7);
  double psi = 0.0;
  for (Index t = 0; t < 1000; ++t) {
    const double rate = 0.3 * std::sin(0.05 * static_cast<double>(t));
    drive.u(0, t) = rate + 0.2;
    drive.y(0, t) = psi + 0.05 * random.normal();
    psi += 0.1 * rate + 0.003 * random.normal();
  }
  ExtendOptions options = with_one_start();
  const ExtendResult result = tune_extended(root, model_of(root, "level.yaml"), {drive}, options);
  ASSERT_NE(result.text.find("gyro - bias_gyro"), std::string::npos) << result.text;
  expect_value(result, "bias_gyro", 0.2, 0.05, 0.01);
}

// Sensor a is ten times as noisy (in variance) from 60 s on.
TEST(Extend, FindsWhereNoiseChanges) {
  const YamlNode root = parse_yaml(continuous_text(), "two.yaml");
  Dataset drive = simulated({}, 5, 1200);
  Random random(6);
  for (Index t = 600; t < drive.size(); ++t) drive.y(0, t) += 0.3 * random.normal();
  ExtendOptions options = with_one_start();
  const ExtendResult result = tune_extended(root, model_of(root, "two.yaml"), {drive}, options);
  EXPECT_EQ(adopted(result).find("another measurement noise of a from "), 0U) << adopted(result);
  const Model model = parse_model_file(result.text, "extended.yaml");
  const int change = find_parameter(model.parameters, "change_a");
  ASSERT_GE(change, 0) << adopted(result);
  EXPECT_NEAR(model.parameters[static_cast<std::size_t>(change)].scalar(), 60.0, 1.0);
  expect_value(result, "ratio_a", 10.0, 2.0);
  EXPECT_EQ(result.estimate.status, Status::ok) << result.estimate.message;
}

TEST(Extend, ThreadsDoNotChangeTheResult) {
  ExtendOptions options;
  const ExtendResult one = run({.bias = 0.6, .lasting = 0.3}, 3, options);
  options.search.threads = 4;
  const ExtendResult four = run({.bias = 0.6, .lasting = 0.3}, 3, options);
  EXPECT_EQ(one.text, four.text);
  EXPECT_EQ(one.estimate.objective.log_likelihood, four.estimate.objective.log_likelihood);
  ASSERT_EQ(one.tried.size(), four.tried.size());
  for (std::size_t i = 0; i < one.tried.size(); ++i) {
    EXPECT_EQ(one.tried[i].what, four.tried[i].what);
    if (std::isnan(one.tried[i].gain)) {
      EXPECT_TRUE(std::isnan(four.tried[i].gain)) << one.tried[i].what;
    } else {
      EXPECT_EQ(one.tried[i].gain, four.tried[i].gain) << one.tried[i].what;
    }
  }
}

TEST(Extend, StoppedTriesNoMore) {
  for (const int threads : {1, 4}) {
    int told = 0;
    ExtendOptions options;
    options.search.threads = threads;
    options.progress = [&](const std::string&) { return ++told < 3; };
    const ExtendResult result = run({.bias = 0.6, .lasting = 0.0}, 1, options);
    EXPECT_EQ(told, 3);
    EXPECT_EQ(result.tried.size(), 2u);
  }
}

// A gain beyond three of its standard errors, from ten blocks, by chance: some 0.7 % of trials; of
// 20 recordings with eight trials each more than 3 would be 2 in 100.
TEST(Extend, LeavesARightModelAsItIs) {
  int extended = 0;
  for (std::uint64_t seed = 10; seed < 30; ++seed) extended += run({}, seed).text.empty() ? 0 : 1;
  EXPECT_LE(extended, 3);
}

TEST(Extension, ReadsAsTheModelThatItWas) {
  for (const std::string& kind : {std::string("continuous"), std::string("discrete")}) {
    const bool discrete = kind == "discrete";
    std::string text =
        discrete ? two_sensors(kind, "dynamics: {p: p + 0.1*v, v: 0.9*v}\n") : continuous_text();
    if (discrete) text.replace(text.find("b: {column: b}"), 14, "b: {column: b, equals: 2*p}");
    const YamlNode root = parse_yaml(text, "two.yaml");
    const Model plain = model_of(root, "two.yaml");
    const Model again = parse_model_file(model_file_text(root), "two.yaml");
    ASSERT_TRUE(is_linear(again));
    StateSpace a = instantiate(as_linear(plain), plain.parameters);
    StateSpace b = instantiate(as_linear(again), again.parameters);
    EXPECT_EQ(a.A, b.A);
    EXPECT_EQ(a.C, b.C);
    EXPECT_EQ(a.Q, b.Q);
    // exp(-h/tau) from sample to sample, and the stationary variance sd^2.
    const YamlNode more = extended(root, {ExtensionKind::lasting_error, {"b"}, {0.5}}, 0.1);
    Model model = parse_model_file(model_file_text(more), "more.yaml");
    as_linear(model).dt = 0.1;
    const StateSpace m = instantiate(as_linear(model), model.parameters);
    EXPECT_NEAR(m.A(2, 2), std::exp(-1.0 / 30.0), 1e-12);
    const double W = (m.G * m.Q * m.G.transpose())(2, 2);
    EXPECT_NEAR(W / (1.0 - m.A(2, 2) * m.A(2, 2)), 0.25, 1e-9);
    EXPECT_EQ(m.C(1, 2), 1.0);
    EXPECT_EQ(m.C(0, 2), 0.0);
  }
}

TEST(Extension, SensorsOfOneKindShareTheirLastingError) {
  const YamlNode root = parse_yaml(continuous_text(), "two.yaml");
  const auto kinds = outputs_alike(root);
  ASSERT_EQ(kinds.size(), 2u);
  EXPECT_EQ(kinds[1], (std::vector<std::string>{"b", "p"}));
  const ModelExtension both{ExtensionKind::lasting_error, {"b", "p"}, {0.5, 0.5}, true};
  EXPECT_EQ(in_words(both), "errors that last, alike, of b, p");
  const Model model = model_of(extended(root, both, 0.1), "more.yaml");
  EXPECT_EQ(model.states.size(), 4u);
  EXPECT_EQ(model.parameters.size(), model_of(root, "two.yaml").parameters.size() + 2);
  EXPECT_GE(find_parameter(model.parameters, "sd_errors"), 0);
  EXPECT_GE(find_parameter(model.parameters, "tau_errors"), 0);
}

TEST(Extension, ADelayIsThatOfTheStates) {
  const YamlNode more = extended(parse_yaml(continuous_text(), "two.yaml"),
                                 {ExtensionKind::delay, {"b"}, {0.1}}, 0.1);
  EXPECT_NE(model_file_text(more).find("(p - delay_b*(v)) + 0.1*(v - delay_b*(-0.3*p - 0.2*v))"),
            std::string::npos)
      << model_file_text(more);
  std::string greek = continuous_text();
  greek.replace(greek.find("p + 0.1*v"), 9, "pψ + ψ");
  greek.replace(greek.find("dynamics: {"), 11, "dynamics: {pψ: p, ψ: v, ");
  const YamlNode late =
      extended(parse_yaml(greek, "two.yaml"), {ExtensionKind::delay, {"b"}, {0.1}}, 0.1);
  EXPECT_NE(model_file_text(late).find("(pψ - delay_b*(p)) + (ψ - delay_b*(v))"), std::string::npos)
      << model_file_text(late);
  const YamlNode discrete =
      parse_yaml(two_sensors("discrete", "dynamics: {p: p + 0.1*v, v: 0.9*v}\n"), "discrete.yaml");
  EXPECT_FALSE(can_be_late(discrete, "a"));
  EXPECT_THROW(extended(discrete, {ExtensionKind::delay, {"a"}, {0.1}}, 0.1), InputError);
}

TEST(Extension, AnInputIsCorrectedInsideOfCurvesToo) {
  const YamlNode root = parse_yaml(R"(identikal: 1
time: {kind: continuous, step: 0.1 s}
parameters: {q: {value: 1, min: 0}}
states: [p]
inputs: {u: {column: u}}
let: {f: {spline: 2*u, knots: [-1, 0, 1]}, both: {table: [u, p], knots: [[0, 1], [0, 1]]}}
dynamics: {p: f - both + 1e-3*u}
outputs: {z: {column: z, equals: p}}
noise: {process: {kind: density, variance: {p: q}}, measurement: {variance: {z: 0.1}}}
initial: {mean: {p: 0}, sd: {p: 1}}
)",
                                   "curve.yaml");
  const YamlNode more = extended(root, {ExtensionKind::bias, {"u"}, {0.1}}, 0.1);
  const std::string text = model_file_text(more);
  for (const char* part : {"2*(u - bias_u)", "(u - bias_u)\", p]", "1e-3*(u - bias_u)"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " in " << text;
  }
  EXPECT_NO_THROW(parse_model_file(text, "more.yaml")) << text;
}

// The others alone: of a sum of two diffuse states a recording says nothing.
TEST(Extension, LastingErrorsOfADiffuseModelAreNotDiffuse) {
  std::string text = continuous_text();
  text.replace(text.find("initial:"), std::string::npos, "initial: diffuse\n");
  const YamlNode more =
      extended(parse_yaml(text, "two.yaml"), {ExtensionKind::lasting_error, {"b"}, {0.5}}, 0.1);
  EXPECT_NE(model_file_text(more).find("diffuse: [p, v]"), std::string::npos)
      << model_file_text(more);
  EXPECT_NO_THROW(model_of(more, "more.yaml"));
}

TEST(Extension, KeepsTheUnits) {
  const YamlNode root = parse_yaml(R"(identikal: 1
time: {kind: continuous, column: t, unit: s, step: 20 ms}
parameters: {q: {value: 0.01 m^2/s^3, min: 0}, r: {value: 0.01 m^2/s^2, min: 0}}
states: {p: m, v: m/s}
dynamics: {p: v, v: 0}
outputs: {speed: {column: speed, unit: km/h, equals: v}}
noise: {process: {kind: density, variance: {v: q}}, measurement: {variance: {speed: r}}}
initial: diffuse
)",
                                   "speed.yaml");
  for (const ModelExtension& each :
       {ModelExtension{ExtensionKind::bias, {"speed"}, {0.1}},
        ModelExtension{ExtensionKind::lasting_error, {"speed"}, {0.1}},
        ModelExtension{ExtensionKind::scale, {"speed"}, {0.1}},
        ModelExtension{ExtensionKind::process_noise, {"p"}, {0.1}},
        ModelExtension{ExtensionKind::coloured_process_noise, {"v"}, {0.1}},
        ModelExtension{ExtensionKind::measurement_noise_change, {"speed"}, {4.0}, false, 3.0},
        ModelExtension{ExtensionKind::process_noise_change, {"process"}, {4.0}, false, 3.0}}) {
    const std::string text = model_file_text(extended(root, each, 0.02));
    EXPECT_NO_THROW(parse_model_file(text, "more.yaml")) << text;
    std::string discrete = model_file_text(root);
    discrete.replace(discrete.find("continuous"), 10, "discrete");
    discrete.replace(discrete.find("density"), 7, "per-sample");
    discrete.replace(discrete.find("p: v\n"), 5, "p: p + h*v\n");
    discrete.replace(discrete.find("v: 0\n"), 5, "v: v\n");
    discrete.replace(discrete.find("m^2/s^3"), 7, "m^2/s^2");
    discrete.replace(discrete.find("parameters:\n"), 12, "parameters:\n  h: 0.02 s\n");
    const std::string more =
        model_file_text(extended(parse_yaml(discrete, "speed.yaml"), each, 0.02));
    EXPECT_NO_THROW(parse_model_file(more, "more.yaml")) << more;
  }
}

TEST(Extend, TakesFormulasAlone) {
  const std::string matrices =
      "identikal: 1\ntime: {step: 1 s}\nparameters: {q: {value: 1, min: 0}, r: {value: 1, min: "
      "0}}\nA: [[0.9]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\noutputs: [{name: y}]\n";
  const YamlNode root = parse_yaml(matrices, "level.yaml");
  Dataset data = simulated({}, 1);
  data.dt = 1.0;
  data.time *= 10.0;
  data.y = Eigen::MatrixXd(data.y.topRows(1));
  data.outputs.resize(1);
  EXPECT_THROW(tune_extended(root, model_of(root, "level.yaml"), {data}), InputError);
}

}  // namespace
}  // namespace identikal
