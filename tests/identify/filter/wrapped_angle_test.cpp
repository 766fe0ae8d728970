// An angle that is measured up to whole turns gives the same estimates as the angle itself, in every
// filter; without the word for it the jump is named.
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/model/model_file.h"
#include "identify/noise/ml.h"
#include "identify/optimality/check.h"
#include "lib/base/error.h"
#include "lib/base/nearest_turn.h"
#include "lib/base/random.h"
#include "lib/data/csv.h"

namespace identikal {
namespace {

std::string compass(const std::string& wrap) {
  return R"(identikal: 1
name: compass
time: {kind: continuous, column: t, unit: s, step: 0.1 s}
parameters: {q: {value: 0.01, min: 0}, r: {value: 0.001, min: 0}}
states: {course: rad, rate: rad/s}
dynamics: {course: rate, rate: 0}
outputs: {angle: {column: angle, unit: deg, equals: course)" +
         wrap + R"(}}
noise: {process: {kind: density, variance: {rate: q}}, measurement: {variance: {angle: r}}}
initial: {mean: {course: 0, rate: 0.5}, sd: {course: 1, rate: 1}}
)";
}

// Two turns and a half; wrapped or as it goes on.
Dataset turning(const Model& model, bool wrapped_at_half) {
  Random random(7);
  std::string rows = "t,angle [deg]\n";
  double course = 0.0, rate = 0.5;
  for (int k = 0; k < 300; ++k) {
    double angle = course + 0.03 * random.normal();
    if (wrapped_at_half) angle = nearest_turn(angle);
    rows += std::to_string(0.1 * k) + ",";
    if (k % 7 != 3) rows += std::to_string(angle * 180.0 / std::numbers::pi);
    rows += "\n";
    course += 0.1 * rate;
    rate += 0.005 * random.normal();
  }
  return make_dataset(parse_csv(rows, "turning.csv"), model.time, {}, model.outputs);
}

class WrappedAngle : public testing::TestWithParam<NonlinearMethod> {};

TEST_P(WrappedAngle, IsFollowedThroughEveryTurn) {
  Model model = parse_model_file(compass(", wrap: true"), "compass.yaml");
  ASSERT_TRUE(is_formula_model(model));
  as_formulas(model).filter = GetParam();
  const FilterResult whole = run_filter(model, model.parameters, turning(model, false));
  const FilterResult jumping = run_filter(model, model.parameters, turning(model, true));
  ASSERT_EQ(jumping.status, FilterStatus::ok);
  EXPECT_GT(whole.x_filt(0, 299), 2.0 * std::numbers::pi);
  EXPECT_LT((whole.x_filt - jumping.x_filt).norm(), 1e-5);
  EXPECT_NEAR(whole.log_likelihood, jumping.log_likelihood, 1e-4);
}

TEST_P(WrappedAngle, IsSmoothedThroughEveryTurn) {
  Model model = parse_model_file(compass(", wrap: true"), "compass.yaml");
  as_formulas(model).filter = GetParam();
  for (const std::optional<Eigen::Index> lag :
       {std::optional<Eigen::Index>(), std::optional<Eigen::Index>(5)}) {
    const SmootherResult whole = run_smoother(model, model.parameters, turning(model, false), lag);
    const SmootherResult jumping = run_smoother(model, model.parameters, turning(model, true), lag);
    EXPECT_LT((whole.x - jumping.x).norm(), 1e-5);
  }
}

TEST_P(WrappedAngle, OfALinearModelIsTheKalmanFilter) {
  Model model = parse_model_file(compass(", wrap: true"), "compass.yaml");
  as_formulas(model).filter = GetParam();
  Model plain = parse_model_file(compass(""), "compass.yaml");
  ASSERT_TRUE(is_linear(plain));
  as_linear(plain).dt = 0.1;
  const FilterResult wrapped = run_filter(model, model.parameters, turning(model, true));
  const FilterResult kalman = run_filter(plain, plain.parameters, turning(plain, false));
  EXPECT_NEAR(wrapped.log_likelihood, kalman.log_likelihood, 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Filters, WrappedAngle,
                         testing::Values(NonlinearMethod::extended, NonlinearMethod::iterated,
                                         NonlinearMethod::unscented));

TEST(WrappedAngle, IsNamedWhereNobodySaidSo) {
  const auto turns = [](const std::string& wrap, bool jumps) {
    const Model model = parse_model_file(compass(wrap), "compass.yaml");
    std::string text;
    for (const Finding& finding : check(model, {turning(model, jumps)}).findings) {
      if (finding.code == FindingCode::turn) text = finding.text;
    }
    return text;
  };
  EXPECT_NE(turns("", true).find("'angle' jumps by a turn"), std::string::npos) << turns("", true);
  EXPECT_EQ(turns("", false), "");
  EXPECT_EQ(turns(", wrap: true", true), "");
}

// What atan2 gives is an angle, whatever was said of it; and the likelihood has no cliffs.
TEST(WrappedAngle, IsThatOfAtan2Unsaid) {
  const auto direction = [](const std::string& wrap) {
    std::string text = compass(wrap);
    text.replace(text.find("equals: course"), 14, "equals: 'atan2(sin(course), cos(course))'");
    return parse_model_file(text, "compass.yaml");
  };
  const Model said = parse_model_file(compass(", wrap: true"), "compass.yaml");
  const Model unsaid = direction(""), denied = direction(", wrap: false");
  const auto log_likelihood = [](Model model, double r) {
    model.parameters[1].value(0, 0) = r;
    return run_filter(model, model.parameters, turning(model, true)).log_likelihood;
  };
  double worst = 0.0;
  for (double r = 1e-4; r < 1.0; r *= 1.1) {
    const double L = log_likelihood(said, r);
    EXPECT_NEAR(log_likelihood(unsaid, r), L, 1e-6 * std::abs(L));
    worst = std::min(worst, log_likelihood(denied, r) - L);
  }
  EXPECT_LT(worst, -10.0);
}

TEST(WrappedAngle, IsNamedWhereItScattersBeyondATurn) {
  const Model model = parse_model_file(compass(""), "compass.yaml");
  Dataset data = turning(model, true);
  for (double& angle : data.y.reshaped()) {
    if (angle < -3.0) angle += 2.0 * std::numbers::pi;  // 3.28 beside -3.0
  }
  bool named = false;
  for (const Finding& finding : check(model, {data}).findings)
    named = named || finding.code == FindingCode::turn;
  EXPECT_GT(data.y.array().isNaN().select(0.0, data.y.array()).maxCoeff(), std::numbers::pi);
  EXPECT_TRUE(named);
}

TEST(WrappedAngle, IsAnAngle) {
  std::string text = compass(", wrap: true");
  text.replace(text.find("unit: deg"), 9, "unit: m");
  EXPECT_THROW(parse_model_file(text, "compass.yaml"), InputError);
}

}  // namespace
}  // namespace identikal
