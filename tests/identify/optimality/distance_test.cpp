// The distance from the likeliest noise: gains add up to the whole, and the states' excess is the one
// that simulations with a known state show.
#include "identify/optimality/distance.h"

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/model/model_file.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

Model turning_tracker(const std::string& next = "v") {
  return parse_model_file(
      "identikal: 1\nname: tracker\ntime: {kind: continuous, step: 0.1 s}\n"
      "parameters: {q: {value: 0.02, min: 0}, r: {value: 0.25, min: 0}, k: 1}\n"
      "states: [p, v]\ndynamics: {p: " +
          next +
          ", v: -0.1*k*v}\noutputs: {z: {column: z, equals: p}}\n"
          "noise: {process: {kind: density, variance: {v: q}}, measurement: {variance: {z: r}}}\n"
          "initial: {mean: {p: 0, v: 0}, sd: {p: 1, v: 1}}\n",
      "tracker.yaml");
}

struct Drive {
  Dataset data;
  Eigen::MatrixXd truth;
};

Drive drive(Index rows, std::uint64_t seed) {
  constexpr int kPieces = 10;
  Random random(seed);
  Drive out;
  out.data.name = "drive";
  out.data.dt = 0.1;
  out.data.time = VectorXd::LinSpaced(rows, 0.0, 0.1 * static_cast<double>(rows - 1));
  out.data.u.resize(0, rows);
  out.data.y.resize(1, rows);
  out.data.outputs = {{"z", ""}};
  out.truth.resize(2, rows);
  double p = random.normal(), v = random.normal();
  for (Index t = 0; t < rows; ++t) {
    out.truth.col(t) << p, v;
    out.data.y(0, t) = p + 0.5 * random.normal();
    for (int i = 0; i < kPieces; ++i) {
      p += 0.1 / kPieces * v;
      v += -0.1 * v * 0.1 / kPieces + std::sqrt(0.02 * 0.1 / kPieces) * random.normal();
    }
  }
  return out;
}

TEST(Distance, GainsAddUpToTheWholeInTheirOrder) {
  const Drive here = drive(2000, 1);
  Model model = turning_tracker();
  model.parameters[0].value(0, 0) = 1.0;
  model.parameters[1].value(0, 0) = 0.01;
  const Model freed = with_free_noise(model);
  const Retuned better = retuned(freed, {here.data});
  const std::vector<NoiseGain> changes = changes_in_order(freed, better.parameters, {here.data});
  ASSERT_FALSE(changes.empty());
  double sum = 0.0;
  for (const NoiseGain& each : changes) {
    EXPECT_GT(each.gain, 0.0);
    sum += each.gain;
  }
  EXPECT_NEAR(sum, better.gain, 1e-6 * better.gain);
  EXPECT_EQ(changes.front().what.front().substr(0, 4), "r = ");
  EXPECT_NE(in_order(changes).find("in place of 0.01 gains"), std::string::npos);
}

// What the states lose in truth, linear and through an extended filter.
TEST(Distance, ExcessOfStatesIsTheOneFound) {
  for (const std::string next : {"v", "v + 1e-9*sin(p)"}) {
    double found = 0.0, said = 0.0;
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      const Drive here = drive(1500, seed);
      Model model = turning_tracker(next);
      const ParameterSet right = model.parameters;
      model.parameters[0].value(0, 0) = 2.0;
      const auto errors = [&](const ParameterSet& at) {
        const FilterResult filter = run_filter(model, at, here.data);
        return (filter.x_filt - here.truth).cwiseAbs2().rowwise().sum().eval();
      };
      const VectorXd excess = errors(model.parameters).cwiseQuotient(errors(right));
      found += (excess[1] - 1.0) / 8.0;
      const Retuned better = retuned(with_free_noise(model), {here.data});
      said += state_excess(model, better.parameters, {here.data}).of_state[1] / 8.0;
    }
    EXPECT_GT(found, 0.5);
    EXPECT_NEAR(said / found, 1.0, 0.2) << next;
  }
}

TEST(Distance, OfTheLikeliestItselfIsNothing) {
  const Drive here = drive(1000, 3);
  Model model = turning_tracker();
  const Model freed = with_free_noise(model);
  model.parameters = retuned(freed, {here.data}).parameters;
  const StateExcess excess = state_excess(model, model.parameters, {here.data});
  EXPECT_EQ(excess.of_all, 0.0);
  EXPECT_EQ(in_words(excess, model), "p 0 %, v 0 %");
}

}  // namespace
}  // namespace identikal
