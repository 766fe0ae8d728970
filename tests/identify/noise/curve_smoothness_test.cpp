// Smooth curves: as smooth as marginal likelihood has it, against dense algebra, and bands that
// hold the truth.
#include "identify/noise/internal/curve_smoothness.h"

#include <cmath>
#include <string>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "identify/model/builder.h"
#include "identify/model/model_file.h"
#include "identify/noise/als.h"
#include "identify/noise/ml.h"
#include "lib/base/error.h"
#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNoise = 0.2;

// y = f(u) + noise.
Model model_of_curve(const std::string& curve,
                     const std::string& parameters = "s: {value: 0.2, fixed: true}") {
  return parse_model_file("identikal: 1\nmodel: static\nparameters: {" + parameters +
                              "}\ninputs: [{name: u}]\nlet: {f: " + curve +
                              "}\noutputs: {y: {equals: f}}\nnoise: {measurement: {sd: {y: s}}}\n",
                          "curve.yaml");
}

const std::string kCurve =
    "{spline: u, knots: [-2, -1.5, -1, -0.5, 0, 0.5, 1, 1.5, 2], smooth: true}";

struct Record {
  VectorXd y, u;
};

Record recorded(double (*f)(double), std::uint64_t seed, Index rows = 150) {
  Random random(seed);
  Record out{VectorXd(rows), VectorXd(rows)};
  for (Index t = 0; t < rows; ++t) {
    out.u[t] = -2.0 + 4.0 * random.uniform();
    out.y[t] = f(out.u[t]) + kNoise * random.normal();
  }
  return out;
}

NoiseEstimate fitted(const Model& model, const Record& record) {
  return tune_ml(model, {recording(model, record.y, 1.0, record.u)});
}

// Free numbers at the weight of largest marginal likelihood, by a fine grid of weights.
double freedom_by_grid(const SplineCurve& curve, const Record& record) {
  const auto k = static_cast<Index>(curve.knots.size());
  MatrixXd B(record.u.size(), k);
  for (Index t = 0; t < B.rows(); ++t)
    B.row(t) =
        spline_weights(curve.knots, (record.u[t] - curve.origin) / curve.distance).transpose();
  const MatrixXd R = spline_roughness(curve.knots), G = B.transpose() * B / (kNoise * kNoise);
  const VectorXd b = B.transpose() * record.y / (kNoise * kNoise);
  double most = -1e300, out = 0.0;
  for (double log_w = -10.0; log_w < 20.0; log_w += 0.002) {
    const MatrixXd P = G + std::exp(log_w) * R;
    const Eigen::LLT<MatrixXd> factor(P);
    const double evidence = 0.5 * static_cast<double>(k - 2) * log_w -
                            factor.matrixLLT().diagonal().array().log().sum() +
                            0.5 * b.dot(factor.solve(b));
    if (evidence < most) continue;
    most = evidence;
    out = factor.solve(G).trace();
  }
  return out;
}

TEST(CurveSmoothness, IsThatOfLargestMarginalLikelihood) {
  const Model model = model_of_curve(kCurve);
  ASSERT_EQ(model.curves.size(), 1u);
  for (const auto f :
       {+[](double u) { return std::sin(2.0 * u); }, +[](double u) { return 0.1 * u * u; }}) {
    const Record record = recorded(f, 1);
    const NoiseEstimate e = fitted(model, record);
    ASSERT_EQ(e.curves.size(), 1u);
    EXPECT_NEAR(e.curves[0].freedom, freedom_by_grid(model.curves[0], record), 0.05);
  }
}

TEST(CurveSmoothness, AStraightLineStaysOne) {
  const Record record = recorded(
      +[](double u) { return 1.0 + 0.5 * u; }, 4);
  const NoiseEstimate e = fitted(model_of_curve(kCurve, "s: {value: 1, min: 0}"), record);
  EXPECT_LT(e.curves[0].freedom, 3.0);
  EXPECT_EQ(e.status, Status::ok) << e.message;
}

TEST(CurveSmoothness, BandsHoldTheTruth) {
  // 95 % bands at 41 places of 40 curves: over the curve, they hold 95 % on average (Wahba 1983).
  // The mean of 40 curves, of some five independent values each, has a standard deviation of 1.5 %:
  // below 90 or above 99 % in less than 1 % of such tests.
  const Model model = model_of_curve(kCurve, "s: {value: 1, min: 0}");
  double held = 0.0, places = 0.0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const auto f = +[](double u) { return std::sin(1.5 * u) + 0.3 * u; };
    const EstimatedCurve curve = fitted(model, recorded(f, 100 + seed)).curves[0];
    for (Index k = 10; k <= 50; ++k) {
      held += std::abs(curve.value[k] - f(curve.at[k])) < 1.96 * curve.se[k] ? 1.0 : 0.0;
      places += 1.0;
    }
  }
  std::printf("bands hold %.1f %%\n", 100.0 * held / places);
  EXPECT_GT(held / places, 0.90);
  EXPECT_LT(held / places, 0.99);
}

TEST(CurveSmoothness, IsSmootherThanWithoutAndNearerToTheTruth) {
  const auto f = +[](double u) { return std::tanh(u); };
  std::string rough = kCurve;
  rough.replace(rough.find(", smooth: true"), 14, "");
  double with = 0.0, without = 0.0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Record record = recorded(f, 200 + seed, 60);
    const auto squares = [&](const std::string& curve) {
      const EstimatedCurve found = fitted(model_of_curve(curve), record).curves[0];
      double sum = 0.0;
      for (Index k = 0; k < found.at.size(); ++k)
        sum += std::pow(found.value[k] - f(found.at[k]), 2);
      return sum;
    };
    with += squares(kCurve);
    without += squares(rough);
  }
  std::printf("squared error of the curve: %.3f of that without smoothness\n", with / without);
  EXPECT_LT(with, 0.7 * without);
}

TEST(CurveSmoothness, IsRefusedWhereItHasNoPlace) {
  EXPECT_THROW(model_of_curve("{table: u, knots: [-1, 0, 1], smooth: true}"), InputError);
  EXPECT_THROW(model_of_curve("{spline: u, knots: [-1, 0, 1], smooth: maybe}"), InputError);
}

}  // namespace
}  // namespace identikal
