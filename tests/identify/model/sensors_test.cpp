// What sensors do, written by name, is the model with the same written out by hand.
#include "identify/model/sensors.h"

#include <string>

#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

std::string tracker(const std::string& outputs, const std::string& rest,
                    const std::string& kind = "continuous") {
  return "identikal: 1\nname: tracker\ntime: {kind: " + kind +
         ", step: 0.1 s, column: t}\n"
         "parameters: {q: {value: 0.02, min: 0}, r: {value: 0.02, min: 0}}\n"
         "states: {p: m, v: m/s}\ninputs: {a: {column: a, unit: m/s^2}}\n"
         "dynamics: {p: v, v: a}\n" +
         outputs + "initial: {mean: {p: 0, v: 0}, sd: {p: 1 m, v: 1 m/s}}\n" +
         "noise: {process: {kind: " + (kind == "continuous" ? "density" : "per-sample") +
         ", variance: {v: \"q*1\"}}, measurement: {variance: {z: r}}}\n" + rest;
}

const char* const kPlain = "outputs: {z: {column: z, unit: m, equals: p}}\n";

Model modelled(const std::string& text) { return parse_model_file(text, "tracker.yaml"); }

std::string refused_sensors(const std::string& text) {
  try {
    modelled(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string without_units(std::string text) {
  for (const auto& [from, to] : {std::pair<std::string, std::string>{"{p: m, v: m/s}", "[p, v]"},
                                 {", unit: m/s^2", ""},
                                 {", unit: m", ""},
                                 {"1 m/s", "1"},
                                 {"1 m", "1"}}) {
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from)) {
      text.replace(at, from.size(), to);
    }
  }
  return text;
}

TEST(SensorsByName, AreWhatTheSameByHandIs) {
  const std::string given =
      without_units(tracker(kPlain,
                            "sensors: {z: {delay: {value: 0.05, min: 0}, scale: 1.1, bias: free, "
                            "error: {sd: {value: 0.3, "
                            "min: 0}, tau: 5}}, a: {bias: free, scale: {value: 1.02}}}\n"));
  Model named = modelled(given);
  std::string text = without_units(tracker(
      "outputs: {z: {column: z, unit: m, equals: \"scale_z*(p - delay_z*v) + bias_z + e\"}}\n",
      ""));
  const auto replace = [&](const std::string& from, const std::string& to) {
    ASSERT_NE(text.find(from), std::string::npos) << from;
    text.replace(text.find(from), from.size(), to);
  };
  replace("r: {value: 0.02, min: 0}}",
          "r: {value: 0.02, min: 0}, delay_z: {value: 0.05, min: 0}, scale_z: 1.1, bias_z: {value: "
          "0}, sd_z: {value: 0.3, min: 0}, tau_z: 5, bias_a: {value: 0}, scale_a: {value: 1.02}}");
  replace("[p, v]", "[p, v, e]");
  replace("v: a}", "v: (a - bias_a)/scale_a, e: -e/tau_z}");
  replace("\"q*1\"", "\"q*1\", e: \"2*sd_z^2/tau_z\"");
  replace("v: 0}, sd: {p: 1, v: 1}", "v: 0, e: 0}, sd: {p: 1, v: 1, e: sd_z}");
  Model by_hand = modelled(text);
  ASSERT_TRUE(is_linear(named) && is_linear(by_hand));
  ASSERT_EQ(named.parameters.size(), by_hand.parameters.size());
  for (Model* each : {&named, &by_hand}) {
    as_linear(*each).dt = 0.1;
    for (Parameter& p : each->parameters) {
      if (p.name == "bias_z") p.value.setConstant(0.7);
      if (p.name == "bias_a") p.value.setConstant(-0.2);
    }
  }
  const StateSpace a = instantiate(as_linear(named), named.parameters),
                   b = instantiate(as_linear(by_hand), by_hand.parameters);
  EXPECT_LT((a.A - b.A).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((a.B - b.B).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((a.C - b.C).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_LT((a.Q - b.Q).cwiseAbs().maxCoeff(), 1e-14);
}

TEST(SensorsByName, MarkovIsBothNumbersFree) {
  const Model model = modelled(tracker(kPlain, "sensors: {z: {error: markov}}\n"));
  const auto at = static_cast<std::size_t>(find_parameter(model.parameters, "sd_z"));
  EXPECT_EQ(model.parameters.at(at).scalar(), 1.0);
  EXPECT_FALSE(model.parameters.at(at).fixed);
  EXPECT_NEAR(
      model.parameters.at(static_cast<std::size_t>(find_parameter(model.parameters, "tau_z")))
          .scalar(),
      3.0, 1e-12);
  EXPECT_EQ(model.states.size(), 3u);
}

TEST(SensorsByName, ParametersGoFirst) {
  std::string text = tracker(kPlain, "sensors: {z: {bias: {value: 3 m, max: 5}, error: markov}}\n");
  text.replace(text.find("parameters: {"), 13,
               "parameters: {bias_z: {value: 1 m}, tau_z: {value: 8 s}, sd_z: 0.25 m, ");
  const Model model = modelled(text);
  const auto named = [&](const char* name) {
    return model.parameters.at(static_cast<std::size_t>(find_parameter(model.parameters, name)));
  };
  EXPECT_EQ(named("bias_z").scalar(), 1.0);
  EXPECT_EQ(named("bias_z").max, 5.0);
  EXPECT_EQ(named("tau_z").scalar(), 8.0);
  EXPECT_NEAR(named("tau_z").min, 0.2, 1e-12);
  EXPECT_TRUE(named("sd_z").fixed);
}

TEST(SensorsByName, SayWhatIsWrong) {
  const auto with = [](const std::string& sensors) {
    return refused_sensors(tracker(kPlain, "sensors: " + sensors + "\n"));
  };
  EXPECT_NE(with("{y: {bias: free}}").find("tracker.yaml:11:11: no sensor 'y'"), std::string::npos)
      << with("{y: {bias: free}}");
  EXPECT_NE(with("{z: {biass: free}}").find("biass"), std::string::npos);
  EXPECT_NE(with("{z: {error: white}}").find("markov"), std::string::npos);
  EXPECT_NE(with("{z: {error: {sd: free, tu: 1 s}}}").find("tu"), std::string::npos);
  EXPECT_NE(with("{a: {delay: free}}").find("a delay of 'a'"), std::string::npos);
  EXPECT_NE(with("{z: {bias: {vlue: 3 m}}}").find("tracker.yaml:11:22: unknown key 'vlue'"),
            std::string::npos)
      << with("{z: {bias: {vlue: 3 m}}}");
  EXPECT_NE(with("{z: {bias: 3 s}}").find("tracker.yaml:8:"), std::string::npos)
      << with("{z: {bias: 3 s}}");
  EXPECT_NE(with("[z]"), "");
  std::string list = tracker(kPlain, "sensors: {z: {bias: free}}\n");
  const std::size_t begin = list.find("parameters:");
  list.replace(begin, list.find('\n', begin) - begin, "parameters: [1, 2]");
  EXPECT_NE(refused_sensors(list).find("parameters is a list"), std::string::npos)
      << refused_sensors(list);
  EXPECT_NE(refused_sensors(tracker(kPlain, "sensors: {z: {delay: free}}\n", "discrete"))
                .find("a delay of 'z'"),
            std::string::npos);
  std::string still = tracker(kPlain, "sensors: {z: {delay: free}}\n");
  still.replace(still.find("p: v,"), 5, "p: 0,");
  EXPECT_NE(refused_sensors(still).find("a delay of 'z'"), std::string::npos)
      << refused_sensors(still);
  std::string taken = tracker(kPlain, "sensors: {z: {error: markov}}\n");
  taken.replace(taken.find("dynamics: {"), 11, "dynamics: {error_z: 0, ");
  EXPECT_NE(refused_sensors(taken).find("makes a state 'error_z', which is there"),
            std::string::npos)
      << refused_sensors(taken);
  EXPECT_NE(
      refused_sensors("identikal: 1\ntime: {step: 1 s}\nA: [[0.9]]\nC: [[1]]\nQ: [[1]]\nR: [[1]]\n"
                      "outputs: [{name: y}]\nsensors: {y: {bias: free}}\n")
          .find("belongs to models of formulas"),
      std::string::npos);
}

}  // namespace
}  // namespace identikal
