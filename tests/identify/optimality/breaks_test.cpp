// Levels that shift are found where they shift; false alarms at their stated rate, with Q that is
// wrong too.
#include "identify/optimality/breaks.h"

#include <cmath>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/model/check.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "identify/optimality/check.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr Index kSamples = 200;

Model local_level(const std::string& q) {
  return parse_model_file(R"(identikal: 1
time: {step: 1 s}
components: {level: {kind: level, unit: degC, variance: )" +
                              q + R"(}}
outputs: {y: {column: y, unit: degC}}
noise: {measurement: {variance: {y: 1}}}
)",
                          "level.yaml");
}

// A level with q = 0.04 and r = 1 that jumps behind sample 120, 0-based; y at 60 is `outlier` off.
Dataset series(const Model& model, Random& random, double jump, double outlier = 0.0) {
  MatrixXd y(1, kSamples);
  double level = 3.0;
  for (Index t = 0; t < kSamples; ++t) {
    y(0, t) = level + random.normal() + (t == 60 ? outlier : 0.0);
    level += 0.2 * random.normal() + (t == 120 ? jump : 0.0);
  }
  return recording(model, y, 1.0);
}

// 1 % of 400 is 4; 11 and more come with a probability of 0.3 %.
TEST(Breaks, FalseAlarmsAreAtMostOneInAHundred) {
  Random random(5);
  for (const char* q : {"0.04", "0.0004", "4"}) {
    const Model model = local_level(q);
    int alarms = 0;
    for (int run = 0; run < 400; ++run) {
      const Dataset data = series(model, random, 0.0);
      alarms += static_cast<int>(find_breaks(checked(model, {data}), {data}).size());
    }
    std::printf("q = %s in place of 0.04: %d false alarms in 400\n", q, alarms);
    EXPECT_LE(alarms, 10) << q;
  }
}

TEST(Breaks, AShiftIsFoundWhereItIsAndAnOutlierIsNone) {
  Random random(6);
  const Model model = local_level("0.04");
  int found = 0, outliers = 0;
  double sum = 0.0;
  for (int run = 0; run < 200; ++run) {
    const Dataset shifted = series(model, random, 5.0);
    for (const Break& b : find_breaks(checked(model, {shifted}), {shifted})) {
      found += std::abs(static_cast<int>(b.sample) - 120) <= 1 ? 1 : 0;
      sum += b.jump;
    }
    const Dataset off = series(model, random, 0.0, 8.0);
    outliers += static_cast<int>(find_breaks(checked(model, {off}), {off}).size());
  }
  std::printf("%d of 200 shifts, by %.3g on average; %d of 200 outliers taken for shifts\n", found,
              sum / 200.0, outliers);
  EXPECT_GE(found, 190);
  EXPECT_NEAR(sum / 200.0, 5.0, 0.25);
  EXPECT_LE(outliers, 8);
}

TEST(Breaks, CheckSaysWhichStateJumpsByHowMuchAndWhen) {
  Random random(7);
  const Model model = local_level("0.04");
  const OptimalityReport report = check(model, {series(model, random, 6.0)});
  EXPECT_THAT(report.notes, testing::Contains(testing::AllOf(
                                testing::HasSubstr("state 'level'"),
                                testing::HasSubstr("degC between 120 and 121 s: t = "))));
}

// A level with a model that changes: the variance from a column.
TEST(Breaks, AreFoundInModelsThatChange) {
  const Model model = parse_model_file(R"(identikal: 1
time: {step: 1 s}
inputs: {acc: {column: acc}}
components: {level: {kind: level, variance: 0.04}}
outputs: {y: {column: y}}
noise: {measurement: {variance: {y: acc^2}}}
)",
                                       "level.yaml");
  Random random(8);
  MatrixXd y(1, kSamples), acc(1, kSamples);
  double level = 3.0;
  for (Index t = 0; t < kSamples; ++t) {
    acc(0, t) = 0.5 + std::abs(random.normal());
    y(0, t) = level + acc(0, t) * random.normal();
    level += 0.2 * random.normal() - (t == 120 ? 7.0 : 0.0);
  }
  const Dataset data = recording(model, y, 1.0, acc);
  const std::vector<Break> found = find_breaks(checked(model, {data}), {data});
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].jump, -7.0, 1.5);
  EXPECT_NEAR(static_cast<double>(found[0].sample), 120.0, 1.0);
}

}  // namespace
}  // namespace identikal
