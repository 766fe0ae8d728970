#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "lib/base/random.h"
#include "lib/formula/expression.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTolerance = 1e-9;

NonlinearModel model_of(const std::vector<std::string>& rates, int parameters) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < rates.size(); ++i) names.push_back("x" + std::to_string(i));
  names.push_back("u");
  for (int i = 0; i < parameters; ++i) names.push_back("p" + std::to_string(i));
  names.push_back("t");
  ModelFormulas formulas;
  formulas.states = static_cast<int>(rates.size());
  formulas.inputs = 1;
  formulas.parameters = parameters;
  for (const std::string& rate : rates) formulas.dynamics.push_back(parse_expression(rate, names));
  formulas.outputs.push_back(parse_expression("x0", names));
  return make_nonlinear_model(formulas);
}

struct Path {
  MatrixXd x;     // nx x N
  VectorXd by_p;  // of the last state, by p0
};

Path path_of(const NonlinearModel& model, const VectorXd& p, VectorXd x, const InputNodes& inputs) {
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  Path out{MatrixXd(x.size(), inputs.time.size()), VectorXd::Zero(x.size())};
  out.x.col(0) = x;
  Jacobian slopes;
  for (Index k = 0; k + 1 < inputs.time.size(); ++k) {
    step(model, memory, inputs, k, x, slopes);
    out.by_p = slopes.wrt_x * out.by_p + slopes.wrt_p.col(0);
    out.x.col(k + 1) = x;
  }
  return out;
}

InputNodes nodes(const VectorXd& time, double tolerance = kTolerance) {
  return controlled_nodes(time, MatrixXd::Zero(1, time.size()), InputPath::linear, tolerance);
}

// x' = -p0 V diag(rates) V^-1 x, whose solution is known whatever the rates' ratio.
TEST(ControlledMotion, AThousandLinearSystemsOfAnyStiffness) {
  Random random(1);
  double worst = 0.0, worst_slope = 0.0;
  for (int trial = 0; trial < 1000; ++trial) {
    const Index n = 2 + trial % 3;
    const MatrixXd V = MatrixXd::Identity(n, n) +
                       0.4 * MatrixXd::NullaryExpr(n, n, [&] { return random.normal(); });
    VectorXd rates(n);
    for (double& rate : rates) rate = std::pow(10.0, 8.0 * random.uniform() - 2.0);
    const MatrixXd A = -V * rates.asDiagonal() * V.inverse();
    if (!(V.fullPivLu().rcond() > 0.05)) continue;
    std::vector<std::string> formulas;
    for (Index i = 0; i < n; ++i) {
      std::string sum = "p0*(0";
      for (Index j = 0; j < n; ++j) {
        char term[60];
        std::snprintf(term, sizeof term, "%+.17g*x%d", A(i, j), static_cast<int>(j));
        sum += term;
      }
      formulas.push_back(sum + ")");
    }
    const VectorXd x0 = V * VectorXd::Ones(n), p = VectorXd::Ones(1);
    const VectorXd time = VectorXd::LinSpaced(6, 0.0, 10.0);
    const Path path = path_of(model_of(formulas, 1), p, x0, nodes(time));
    const double size = x0.cwiseAbs().maxCoeff();
    for (Index k = 1; k < time.size(); ++k) {
      const VectorXd exact = V * (-rates * time[k]).array().exp().matrix();
      worst = std::max(worst, (path.x.col(k) - exact).cwiseAbs().maxCoeff() / size);
    }
    const VectorXd t_rates = rates * time[5];
    const VectorXd slope = V * (-t_rates.array() * (-t_rates.array()).exp()).matrix();
    worst_slope = std::max(worst_slope, (path.by_p - slope).cwiseAbs().maxCoeff() / size);
  }
  std::printf("linear systems, rates 0.01 to 1e6: error %.1e of the start, of slopes %.1e\n", worst,
              worst_slope);
  EXPECT_LT(worst, 1e-7);
  EXPECT_LT(worst_slope, 1e-6);
}

// Robertson (1966), at t = 40 and 4e5 s as by Hairer & Wanner (1996), section IV.10, in more digits
// by RADAU5 at 1e-13.
TEST(ControlledMotion, Robertson) {
  const NonlinearModel model =
      model_of({"-p0*x0 + 1e4*x1*x2", "p0*x0 - 1e4*x1*x2 - 3e7*x1^2", "3e7*x1^2"}, 1);
  const Path path = path_of(model, VectorXd::Constant(1, 0.04), Eigen::Vector3d(1.0, 0.0, 0.0),
                            nodes(Eigen::Vector3d(0.0, 40.0, 4e5)));
  EXPECT_NEAR(path.x(0, 1), 0.7158270687, 1e-9);
  EXPECT_NEAR(path.x(1, 1), 9.185534765e-6, 1e-14);
  EXPECT_NEAR(path.x(0, 2), 4.938274e-3, 3e-8);
  EXPECT_NEAR(path.x.col(2).sum(), 1.0, 1e-9);
}

TEST(ControlledMotion, SlopesAreThoseOfDifferences) {
  const NonlinearModel model = model_of({"x1", "p0*(1 - x0^2)*x1 - x0 + u"}, 1);
  const VectorXd time = VectorXd::LinSpaced(21, 0.0, 10.0);
  const MatrixXd u = (0.7 * time.array()).sin().matrix().transpose();
  for (const InputPath way : {InputPath::constant, InputPath::linear, InputPath::pchip}) {
    const InputNodes inputs = controlled_nodes(time, u, way, 1e-12);
    const auto end = [&](double p) {
      return path_of(model, VectorXd::Constant(1, p), Eigen::Vector2d(2.0, 0.0), inputs);
    };
    const double h = 1e-3;
    const VectorXd differences =
        (8.0 * (end(30.0 + h).x - end(30.0 - h).x) - end(30.0 + 2 * h).x + end(30.0 - 2 * h).x)
            .rightCols(1) /
        (12.0 * h);
    const VectorXd exact = end(30.0).by_p;
    EXPECT_LT((differences - exact).norm(), 1e-5 * exact.norm());
    std::vector<int> many(20, 3000);
    const Path fixed = path_of(model, VectorXd::Constant(1, 30.0), Eigen::Vector2d(2.0, 0.0),
                               input_nodes(time, u, way, many));
    EXPECT_LT((fixed.x - end(30.0).x).cwiseAbs().maxCoeff(), 1e-8);
  }
}

TEST(ControlledMotion, FindsJumpsAndSaysWhatOverflows) {
  const VectorXd time = VectorXd::LinSpaced(4, 0.0, 3.0);
  const VectorXd one = VectorXd::Ones(1);
  const NonlinearModel jump = model_of({"if(t > 1.234567, p0, -p0*x0)"}, 1);
  const Path path = path_of(jump, one, one, nodes(time));
  // Across a jump the error is that which is estimated, 0.1 tolerance^(2/3).
  EXPECT_NEAR(path.x(0, 3), std::exp(-1.234567) + 3.0 - 1.234567, 1e-7);
  const NonlinearModel explodes = model_of({"p0*x0^2"}, 1);  // at 1 s
  const Path away = path_of(explodes, one, one, nodes(time));
  EXPECT_FALSE(away.x.col(2).allFinite());
  const NonlinearModel undefined = model_of({"log(x0 - 2*p0)"}, 1);
  EXPECT_FALSE(path_of(undefined, one, one, nodes(time)).x.col(1).allFinite());
}

// At the kink no step is small against a state that is exactly zero before.
TEST(ControlledMotion, LeavesADeadZoneFromRest) {
  const NonlinearModel model = model_of({"max(0, t - 0.337)*p0", "x0 - 2*x1"}, 1);
  const VectorXd time = VectorXd::LinSpaced(11, 0.0, 1.0);
  const Path path = path_of(model, VectorXd{{3.0}}, VectorXd::Zero(2), nodes(time));
  for (Index k = 0; k < time.size(); ++k) {
    const double s = std::max(0.0, time[k] - 0.337);
    EXPECT_NEAR(path.x(0, k), 1.5 * s * s, 1e-8) << k;
    // x1' = 1.5 s^2 - 2 x1
    EXPECT_NEAR(path.x(1, k), 1.5 * (s * s / 2.0 - s / 2.0 + 0.25 - 0.25 * std::exp(-2.0 * s)),
                1e-8)
        << k;
  }
  EXPECT_NEAR(path.by_p[0], 0.5 * 0.663 * 0.663, 1e-7);
}

TEST(ControlledMotion, Refuses) {
  const VectorXd time = VectorXd::LinSpaced(4, 0.0, 3.0);
  EXPECT_THROW(nodes(time, 0.0), std::invalid_argument);
  EXPECT_THROW(nodes(time, 0.1), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
