#include "lib/model/nonlinear_model.h"

#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "tests/support/written_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NonlinearModel model_of(const Written& w, Derivatives order = Derivatives::first) {
  return make_nonlinear_model(formulas_of(w), order);
}

Written pendulum() {
  return {{"phi", "w"},
          {"torque"},
          {"l", "c", "J"},
          {"w", "-g/l*sin(phi) - friction + torque/J*(1 + 0.1*sin(3*t))"},
          {"l*sin(phi)", "w + 0.01*torque"},
          {{"friction", "c*w*abs(w)"}},
          true};
}

VectorXd car_parameters() { return (VectorXd(6) << 1446, 0.987, 1.525, 2319, 8e4, 9e4).finished(); }

VectorXd stepped(const NonlinearModel& model, const InputNodes& inputs, Index k, VectorXd x,
                 const VectorXd& p, Jacobian* jacobian = nullptr) {
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  if (jacobian == nullptr) {
    step(model, memory, inputs, k, x);
  } else {
    step(model, memory, inputs, k, x, *jacobian, model.order);
  }
  return x;
}

// Columns of d f / d at by central differences, extrapolated.
MatrixXd numerical_jacobian(const std::function<VectorXd(const VectorXd&)>& f, const VectorXd& at) {
  MatrixXd out;
  for (Index i = 0; i < at.size(); ++i) {
    const auto slope = [&](double h) {
      VectorXd up = at, down = at;
      up[i] += h;
      down[i] -= h;
      return VectorXd((f(up) - f(down)) / (2.0 * h));
    };
    const double h = 1e-3 * std::max(0.1, std::abs(at[i]));
    const VectorXd column = (4.0 * slope(0.5 * h) - slope(h)) / 3.0;
    if (i == 0) out.resize(column.size(), at.size());
    out.col(i) = column;
  }
  return out;
}

void expect_close(const MatrixXd& a, const MatrixXd& b, double tolerance) {
  ASSERT_EQ(a.rows(), b.rows());
  ASSERT_EQ(a.cols(), b.cols());
  for (Index i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a(i), b(i), tolerance * (1.0 + std::abs(b(i)))) << i;
  }
}

TEST(NonlinearModel, StepIsTheClassicalRungeKuttaMethod) {
  const NonlinearModel model = model_of(pendulum());
  const VectorXd p = (VectorXd(3) << 0.8, 0.3, 0.05).finished();
  const VectorXd time = (VectorXd(4) << 0.0, 0.1, 0.25, 0.3).finished();
  const MatrixXd u = (MatrixXd(1, 4) << 0.1, 0.4, -0.2, 0.3).finished();
  const auto rate = [&](const VectorXd& x, double torque, double t) -> VectorXd {
    return (VectorXd(2) << x[1], -9.80665 / p[0] * std::sin(x[0]) - p[1] * x[1] * std::abs(x[1]) +
                                     torque / p[2] * (1.0 + 0.1 * std::sin(3.0 * t)))
        .finished();
  };
  const Pchip smooth(time, u.row(0).transpose());
  for (const InputPath path : {InputPath::constant, InputPath::linear, InputPath::pchip}) {
    const InputNodes inputs = input_nodes(time, u, path, 0.04);
    EXPECT_EQ(inputs.steps, (std::vector<int>{3, 4, 2}));
    for (Index k = 0; k < 3; ++k) {
      const double span = time[k + 1] - time[k];
      const auto torque = [&](double t) {
        if (path == InputPath::constant) return u(0, k);
        if (path == InputPath::pchip) return smooth.in_interval(k, t);
        return u(0, k) + (u(0, k + 1) - u(0, k)) * (t - time[k]) / span;
      };
      VectorXd x = (VectorXd(2) << 0.7, -0.4).finished();
      const int steps = inputs.steps[static_cast<std::size_t>(k)];
      const double h = span / steps;
      for (int i = 0; i < steps; ++i) {
        const double t = time[k] + i * h;
        const VectorXd k1 = rate(x, torque(t), t);
        const VectorXd k2 = rate(x + 0.5 * h * k1, torque(t + 0.5 * h), t + 0.5 * h);
        const VectorXd k3 = rate(x + 0.5 * h * k2, torque(t + 0.5 * h), t + 0.5 * h);
        const VectorXd k4 = rate(x + h * k3, torque(t + h), t + h);
        x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
      }
      expect_close(stepped(model, inputs, k, (VectorXd(2) << 0.7, -0.4).finished(), p), x, 1e-13);
    }
  }
}

TEST(NonlinearModel, DerivativesOfTheStepAgreeWithDifferences) {
  for (const bool car : {false, true}) {
    const NonlinearModel model = model_of(car ? single_track_formulas() : pendulum());
    const VectorXd p = car ? car_parameters() : (VectorXd(3) << 0.8, 0.3, 0.05).finished();
    const VectorXd x = (VectorXd(2) << 0.7, -0.4).finished();
    const VectorXd time = (VectorXd(3) << 0.0, 0.02, 0.05).finished();
    MatrixXd u = (MatrixXd(2, 3) << 0.3, 0.4, -0.2, 20.0, 21.0, 23.0).finished();
    if (!car) u.conservativeResize(1, 3);
    const InputNodes inputs = input_nodes(time, u, InputPath::linear, 0.01);
    for (Index k = 0; k < 2; ++k) {
      Jacobian exact;
      const VectorXd next = stepped(model, inputs, k, x, p, &exact);
      expect_close(next, stepped(model, inputs, k, x, p), 1e-14);
      expect_close(exact.wrt_x,
                   numerical_jacobian(
                       [&](const VectorXd& at) { return stepped(model, inputs, k, at, p); }, x),
                   1e-10);
      expect_close(exact.wrt_p,
                   numerical_jacobian(
                       [&](const VectorXd& at) { return stepped(model, inputs, k, x, at); }, p),
                   1e-10);
    }
  }
}

TEST(NonlinearModel, OutputsAndTheirDerivatives) {
  const NonlinearModel model = model_of(pendulum());
  const VectorXd p = (VectorXd(3) << 0.8, 0.3, 0.05).finished();
  const VectorXd x = (VectorXd(2) << 0.7, -0.4).finished(), u = VectorXd::Constant(1, 2.0);
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  VectorXd y(2);
  Jacobian jacobian;
  observe(model, memory, x, u, 0.0, y, jacobian);
  expect_close(y, (VectorXd(2) << 0.8 * std::sin(0.7), -0.4 + 0.02).finished(), 1e-15);
  expect_close(jacobian.wrt_x, (MatrixXd(2, 2) << 0.8 * std::cos(0.7), 0, 0, 1).finished(), 1e-15);
  expect_close(jacobian.wrt_p, (MatrixXd(2, 3) << std::sin(0.7), 0, 0, 0, 0, 0).finished(), 1e-15);
}

TEST(NonlinearModel, SecondDerivativesAgreeWithDifferencesOfTheFirst) {
  Written growth{{"a", "b"},
                 {"u"},
                 {"p", "q"},
                 {"p*a + q*b/(1 + a^2)", "sin(a*b*p) + u^2*q*b"},
                 {"a*b^2/p", "u*q*a^3"},
                 {},
                 false};
  for (const Written& written : {pendulum(), single_track_formulas(), growth}) {
    SCOPED_TRACE(written.dynamics[0]);
    const NonlinearModel model = model_of(written, Derivatives::second);
    const VectorXd p = model.parameters == 6 ? car_parameters()
                       : model.parameters == 3
                           ? VectorXd((VectorXd(3) << 0.8, 0.3, 0.05).finished())
                           : VectorXd((VectorXd(2) << 0.7, 1.3).finished());
    VectorXd both(2 + p.size());
    both << 0.7, -0.4, p;
    const VectorXd time = (VectorXd(2) << 0.0, 0.03).finished();
    MatrixXd u = (MatrixXd(2, 2) << 0.3, 0.4, 20.0, 21.0).finished();
    u.conservativeResize(model.inputs, 2);
    const InputNodes inputs = input_nodes(time, u, InputPath::linear, 0.01);
    const auto step_wrt_x = [&](const VectorXd& at) -> VectorXd {
      Jacobian jacobian;
      stepped(model, inputs, 0, at.head(2), at.tail(p.size()), &jacobian);
      return jacobian.wrt_x.reshaped();
    };
    const auto output_jacobian = [&](const VectorXd& at, Derivatives order) {
      ModelMemory memory = make_memory(model);
      set_parameters(model, memory, at.tail(p.size()));
      Jacobian jacobian;
      VectorXd y(2);
      observe(model, memory, at.head(2), u.col(1), 0.03, y, jacobian, order);
      return jacobian;
    };
    Jacobian exact;
    stepped(model, inputs, 0, both.head(2), p, &exact);
    expect_close(exact.wrt_x_jacobian, numerical_jacobian(step_wrt_x, both), 1e-9);
    expect_close(output_jacobian(both, Derivatives::second).wrt_x_jacobian,
                 numerical_jacobian(
                     [&](const VectorXd& at) -> VectorXd {
                       return output_jacobian(at, Derivatives::first).wrt_x.reshaped();
                     },
                     both),
                 1e-9);
    Jacobian first;
    stepped(model_of(written), inputs, 0, both.head(2), p, &first);
    expect_close(exact.wrt_p, first.wrt_p, 1e-14);
  }
}

// Two states that decay, one of them driven by an input or by nothing.
Written decay(const std::string& drive) {
  return {{"x", "e"},      {"u"}, {"tau", "c"}, {"-x/tau + c*e" + drive, "-e/c"},
          {"hypot(x, e)"}, {},    true};
}

TEST(NonlinearModel, StepsThatRepeatAreThoseMadeAnew) {
  EXPECT_FALSE(model_of(pendulum()).linear_in_state);
  EXPECT_TRUE(model_of(decay("")).autonomous);
  EXPECT_FALSE(model_of(decay(" + u")).autonomous);
  const VectorXd p = (VectorXd(2) << 0.7, 1.3).finished();
  const VectorXd time = (VectorXd(6) << 0.0, 0.1, 0.3, 0.4, 0.5, 0.7).finished();
  const MatrixXd u = (MatrixXd(1, 6) << 1.0, -2.0, 3.0, 0.5, 4.0, 0.0).finished();
  const InputNodes inputs = input_nodes(time, u, InputPath::linear, 0.05);
  for (const std::string drive : {"", " + u", " + 0.3*u*u*sin(t)"}) {
    const NonlinearModel model = model_of(decay(drive), Derivatives::second);
    EXPECT_TRUE(model.linear_in_state) << drive;
    ModelMemory kept = make_memory(model);
    set_parameters(model, kept, p);
    Gramians W{MatrixXd::Random(4, 2).cwiseAbs(), {}, {}}, W_anew = W;
    VectorXd x = (VectorXd(2) << 2.0, -1.0).finished();
    for (Index k = 0; k + 1 < time.size(); ++k) {
      ModelMemory fresh = make_memory(model);
      set_parameters(model, fresh, p);
      Jacobian J, J_anew;
      VectorXd x_anew = x;
      step(model, fresh, inputs, k, x_anew, J_anew, Derivatives::second, &W_anew);
      step(model, kept, inputs, k, x, J, Derivatives::second, &W);
      EXPECT_LT((x - x_anew).norm(), 1e-14) << drive << k;
      EXPECT_LT((J.wrt_x - J_anew.wrt_x).norm(), 1e-14) << drive << k;
      EXPECT_LT((J.wrt_p - J_anew.wrt_p).norm(), 1e-13) << drive << k;
      EXPECT_LT((J.wrt_x_jacobian - J_anew.wrt_x_jacobian).norm(), 1e-13) << drive << k;
      EXPECT_LT((W.values - W_anew.values).norm(), 1e-14) << drive << k;
      EXPECT_LT((W.jacobian - W_anew.jacobian).norm(), 1e-13) << drive << k;
    }
    EXPECT_EQ(kept.repeated.size(), 2u) << drive;
    set_parameters(model, kept, 2.0 * p);
    EXPECT_TRUE(kept.repeated.empty());
  }
}

// A memory that is new follows the steps one by one; one that has met the interval does not.
TEST(NonlinearModel, StepsThatAreLinearInStateAndInputsAreThoseMadeOneByOne) {
  EXPECT_TRUE(model_of(decay(" + u/tau - 0.3")).affine);
  EXPECT_FALSE(model_of(decay(" + u*u")).affine);
  EXPECT_FALSE(model_of(decay(" + u*x")).affine);
  EXPECT_FALSE(model_of(decay(" + u*t")).affine);
  EXPECT_FALSE(model_of(decay(" + sin(t)")).affine);
  EXPECT_FALSE(model_of(pendulum()).affine);
  const NonlinearModel model = model_of(decay(" + c*u/tau - 300/c"));
  const VectorXd p = (VectorXd(2) << 0.7, 1.3).finished();
  const VectorXd time = (VectorXd(7) << 0.0, 0.1, 0.3, 0.4, 0.5, 0.7, 0.9).finished();
  const MatrixXd u = (MatrixXd(1, 7) << 1.0, -2.0, 3.0, 0.5, 4.0, 0.0, 7.0).finished();
  for (const InputPath path : {InputPath::constant, InputPath::linear, InputPath::pchip}) {
    const InputNodes inputs = input_nodes(time, u, path, 0.05);
    ModelMemory kept = make_memory(model);
    set_parameters(model, kept, p);
    VectorXd x = (VectorXd(2) << 293.0, -1.0).finished(), alone = x;
    for (Index k = 0; k + 1 < time.size(); ++k) {
      ModelMemory fresh = make_memory(model);
      set_parameters(model, fresh, p);
      Jacobian J, J_anew;
      VectorXd x_anew = x;
      step(model, fresh, inputs, k, x_anew, J_anew);
      step(model, kept, inputs, k, alone);
      step(model, kept, inputs, k, x, J);
      expect_close(x, x_anew, 1e-12);
      expect_close(alone, x_anew, 1e-12);
      expect_close(J.wrt_x, J_anew.wrt_x, 1e-12);
      expect_close(J.wrt_p, J_anew.wrt_p, 1e-12);
    }
    EXPECT_EQ(kept.affine.size(), path == InputPath::pchip ? 0u : 2u);
    set_parameters(model, kept, 2.0 * p);
    EXPECT_TRUE(kept.affine.empty());
  }
}

TEST(NonlinearModel, DiscreteTimeTakesTheFormulaAtItsWord) {
  // The scalar growth model of the particle filter literature.
  const NonlinearModel model = model_of(
      {{"x"}, {"u"}, {"a", "b"}, {"a*x + b*x/(1 + x^2) + u*cos(1.2*t)"}, {"x^2/20"}, {}, false});
  const VectorXd p = (VectorXd(2) << 0.5, 25.0).finished(), x = VectorXd::Constant(1, 1.7);
  const InputNodes inputs =
      input_nodes((VectorXd(2) << 3.0, 4.0).finished(), MatrixXd::Constant(1, 2, 8.0),
                  InputPath::constant, kInfinity);
  Jacobian jacobian;
  const VectorXd next = stepped(model, inputs, 0, x, p, &jacobian);
  const double d = 1.0 + 1.7 * 1.7;
  EXPECT_NEAR(next[0], 0.85 + 25.0 * 1.7 / d + 8.0 * std::cos(3.6), 1e-13);
  EXPECT_NEAR(jacobian.wrt_x(0, 0), 0.5 + 25.0 * (1.0 - 1.7 * 1.7) / (d * d), 1e-13);
  EXPECT_NEAR(jacobian.wrt_p(0, 0), 1.7, 1e-13);
  EXPECT_NEAR(jacobian.wrt_p(0, 1), 1.7 / d, 1e-13);
}

// At constant speed the vehicle is linear: a parameter takes the input's place.
TEST(NonlinearModel, WrongShapesAreRefused) {
  const NonlinearModel model = model_of(pendulum());
  ModelMemory memory = make_memory(model);
  VectorXd x = VectorXd::Zero(2);
  const VectorXd time = (VectorXd(2) << 0.0, 0.1).finished();
  const InputNodes two = input_nodes(time, MatrixXd::Zero(2, 2), InputPath::constant, 0.1);
  EXPECT_THROW(step(model, memory, two, 0, x), std::invalid_argument);
  const InputNodes one = input_nodes(time, MatrixXd::Zero(1, 2), InputPath::constant, 0.1);
  EXPECT_THROW(step(model, memory, one, 1, x), std::invalid_argument);
  EXPECT_THROW(input_nodes(time, MatrixXd::Zero(1, 3), InputPath::constant, 0.1),
               std::invalid_argument);
  EXPECT_THROW(input_nodes(time, MatrixXd::Zero(1, 2), InputPath::constant, 0.0),
               std::invalid_argument);
  EXPECT_THROW(input_nodes(time, MatrixXd::Zero(1, 2), InputPath::constant, 1e-9),
               std::invalid_argument);
  Jacobian jacobian;
  EXPECT_THROW(step(model, memory, one, 0, x, jacobian, Derivatives::second),
               std::invalid_argument);
  EXPECT_THROW(input_nodes(time.reverse(), MatrixXd::Zero(1, 2), InputPath::constant, 0.1),
               std::invalid_argument);
}

}  // namespace
}  // namespace identikal
