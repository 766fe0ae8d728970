#include "identify/filter/observation_weights.h"

#include <cmath>
#include <sstream>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/model/builder.h"
#include "identify/model/recording.h"
#include "lib/base/error.h"
#include "lib/base/random.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Model two_sensors() {
  return linear_model()
      .A({{0.9, 0.2}, {0.0, 0.7}})
      .C({{1, 0}, {0, 1}})
      .process_noise(variances({{"q", 1.0}, {"p", 0.5}}))
      .measurement_noise(variances({{"r", 2.0}, {"s", 0.3}}));
}

MatrixXd drawn(Index ny, Index N) {
  Random random(7);
  return MatrixXd::NullaryExpr(ny, N, [&] { return 3.0 * random.normal(); });
}

// cov(x(t), Y) cov(Y)^-1 of all samples at once, the start stationary.
MatrixXd dense_weights(const Model& model, Index row, Index last, const MatrixXd& y) {
  const StateSpace s = instantiate(as_linear(model), model.parameters);
  const Index n = s.A.rows(), ny = s.C.rows();
  MatrixXd P = MatrixXd::Zero(n, n);
  for (int i = 0; i < 2000; ++i) P = s.A * P * s.A.transpose() + s.G * s.Q * s.G.transpose();
  std::vector<MatrixXd> power{MatrixXd::Identity(n, n)};
  for (Index k = 0; k < y.cols(); ++k) power.push_back(power.back() * s.A);
  const auto between = [&](Index i, Index j) -> MatrixXd {  // of x(i) and x(j)
    return i >= j ? MatrixXd(power[static_cast<std::size_t>(i - j)] * P)
                  : MatrixXd(P * power[static_cast<std::size_t>(j - i)].transpose());
  };
  std::vector<std::pair<Index, Index>> measured;  // row, output
  for (Index k = 0; k <= last; ++k) {
    for (Index i = 0; i < ny; ++i) {
      if (!std::isnan(y(i, k))) measured.emplace_back(k, i);
    }
  }
  const auto m = static_cast<Index>(measured.size());
  MatrixXd of_y(m, m), with_x(n, m), out = MatrixXd::Zero(n, ny * y.cols());
  for (Index a = 0; a < m; ++a) {
    const auto [k, i] = measured[static_cast<std::size_t>(a)];
    with_x.col(a) = between(row, k) * s.C.row(i).transpose();
    for (Index b = 0; b < m; ++b) {
      const auto [l, j] = measured[static_cast<std::size_t>(b)];
      of_y(a, b) = s.C.row(i) * between(k, l) * s.C.row(j).transpose();
      if (k == l) of_y(a, b) += s.R(i, j);
    }
  }
  const MatrixXd solved = of_y.ldlt().solve(with_x.transpose()).transpose();
  for (Index a = 0; a < m; ++a) {
    const auto [k, i] = measured[static_cast<std::size_t>(a)];
    out.col(k * ny + i) = solved.col(a);
  }
  return out;
}

TEST(ObservationWeights, AreThoseOfTheJointNormalDensity) {
  const Model model = two_sensors();
  MatrixXd y = drawn(2, 40);
  y(0, 3) = y(1, 3) = y(1, 20) = std::nan("");
  const Dataset data = recording(model, y, 1.0);
  const MatrixXd smoothed = observation_weights(model, data, 12, std::nullopt).weights;
  EXPECT_LT((smoothed - dense_weights(model, 12, 39, y)).cwiseAbs().maxCoeff(), 1e-12);
  const MatrixXd filtered = observation_weights(model, data, 12, 0).weights;
  EXPECT_LT((filtered - dense_weights(model, 12, 12, y)).cwiseAbs().maxCoeff(), 1e-12);
  const MatrixXd lagged = observation_weights(model, data, 12, 5).weights;
  EXPECT_LT((lagged - dense_weights(model, 12, 17, y)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(ObservationWeights, MakeTheState) {
  const Model model = linear_model()
                          .A({{1, 1}, {0, 1}})
                          .C({{1, 0}})
                          .process_noise(variances({{"q", 1.0}, {"slope", 0.01}}))
                          .measurement_noise(variance("r", 4.0))
                          .diffuse();
  MatrixXd y = drawn(1, 60);
  y(0, 9) = std::nan("");
  const Dataset data = recording(model, y, 1.0);
  const SmootherResult run = run_smoother(model, model.parameters, data, std::nullopt);
  const MatrixXd w = observation_weights(model, data, 30, std::nullopt).weights;
  MatrixXd known = y;
  known(0, 9) = 0.0;
  EXPECT_LT((w * known.transpose() - run.x.col(30)).cwiseAbs().maxCoeff(), 1e-9);
  // A straight line goes through unchanged, whatever the start.
  const VectorXd line = VectorXd::LinSpaced(60, -30.0, 29.0);
  EXPECT_EQ(w(0, 9), 0.0);
  EXPECT_NEAR(w.row(0).sum(), 1.0, 1e-10);
  EXPECT_NEAR(w.row(0).dot(line), 0.0, 1e-9);
  EXPECT_NEAR(w.row(1).sum(), 0.0, 1e-10);
  EXPECT_NEAR(w.row(1).dot(line), 1.0, 1e-9);
}

TEST(ObservationWeights, RefusesWhatHasNone) {
  const Model diffuse = linear_model()
                            .A({{1, 1}, {0, 1}})
                            .C({{1, 0}})
                            .process_noise(variances({{"q", 1.0}, {"slope", 0.01}}))
                            .measurement_noise(variance("r", 4.0))
                            .diffuse();
  const Dataset data = recording(diffuse, drawn(1, 20), 1.0);
  EXPECT_THROW(observation_weights(diffuse, data, 0, 0), InputError);
  const Dataset large = recording(diffuse, drawn(1, 5001), 1.0);
  EXPECT_THROW(observation_weights(diffuse, large, 10, 0), InputError);
}

TEST(ObservationWeights, HaveAColumnForEveryStateAndOutput) {
  const Model model = two_sensors();
  const Dataset data = recording(model, drawn(2, 10), 1.0);
  std::ostringstream csv;
  write_weights_csv(csv, model, data, observation_weights(model, data, 4, 0));
  const std::string text = csv.str();
  EXPECT_EQ(text.substr(0, text.find('\n')), "time [s],y1 by y1,y1 by y2,y2 by y1,y2 by y2");
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 11);
}

}  // namespace
}  // namespace identikal
