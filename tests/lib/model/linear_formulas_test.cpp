#include "lib/model/linear_formulas.h"

#include <functional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lib/model/discretise.h"
#include "tests/support/written_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Written car_at_constant_speed() {
  Written w = single_track_formulas();
  w.inputs = {"steer"};
  w.parameters.emplace_back("vx");
  return w;
}

ParameterSet free_parameters(const std::vector<std::pair<std::string, double>>& values) {
  ParameterSet out;
  for (const auto& [name, value] : values) {
    Parameter p;
    p.name = name;
    p.value = MatrixXd::Constant(1, 1, value);
    out.push_back(p);
  }
  return out;
}

// The model with noise that does not matter.
LinearModel completed(LinearModel model) {
  const Index n = model.A.constant.rows(), ny = model.C.constant.rows();
  model.G.constant = model.Q.constant = MatrixXd::Identity(n, n);
  model.R.constant = MatrixXd::Identity(ny, ny);
  model.S.constant = MatrixXd::Zero(n, ny);
  return model;
}

VectorXd flat(const StateSpace& s) {
  VectorXd out(s.A.size() + s.B.size() + s.C.size() + s.D.size());
  out << s.A.reshaped(), s.B.reshaped(), s.C.reshaped(), s.D.reshaped();
  return out;
}

TEST(LinearFormulas, AreRecognisedByTheirForm) {
  EXPECT_TRUE(linear_model_of(formulas_of(car_at_constant_speed())).has_value());
  EXPECT_FALSE(linear_model_of(formulas_of(single_track_formulas())).has_value());  // vx: an input
  const auto linear = [](const std::string& rate) {
    return linear_model_of(formulas_of({{"x"}, {"u"}, {"p"}, {rate}, {"x"}, {}, true})).has_value();
  };
  for (const char* rate : {"-x/p + u", "p*(u - x)", "sqrt(p)*x + sin(p)", "if(p > 0, x, 2*x)", "0",
                           "(x + u)*(p + 1)/p - 3", "-(-x)", "x + 0*t"}) {
    EXPECT_TRUE(linear(rate)) << rate;
  }
  for (const char* rate : {"-x^2", "x*u", "x + t", "t*x", "if(x > 0, 1, 0)", "sign(u)", "abs(x)",
                           "floor(u)", "if(x > 0, x, 2*x)", "x/u", "min(x, p)", "p^x"}) {
    EXPECT_FALSE(linear(rate)) << rate;
  }
}

TEST(LinearFormulas, MatricesOfTheSingleTrack) {
  const LinearModel model = completed(*linear_model_of(formulas_of(car_at_constant_speed())));
  EXPECT_FALSE(model.offset);
  const double m = 1446, a = 0.987, b = 1.525, Iz = 2319, Cf = 8e4, Cr = 9e4, vx = 25;
  const ParameterSet p = free_parameters(
      {{"m", m}, {"a", a}, {"b", b}, {"Iz", Iz}, {"Cf", Cf}, {"Cr", Cr}, {"vx", vx}});
  const StateSpace s = written_matrices(model, p);
  // (7.3) and (7.4) of Sladka, with the sign of row 2, column 1 as the moments give it.
  const MatrixXd A = (MatrixXd(2, 2) << -(Cf + Cr) / (m * vx), -vx + (b * Cr - a * Cf) / (m * vx),
                      (b * Cr - a * Cf) / (Iz * vx), -(a * a * Cf + b * b * Cr) / (Iz * vx))
                         .finished();
  EXPECT_TRUE(s.A.isApprox(A, 1e-14));
  EXPECT_TRUE(s.B.isApprox(Eigen::Vector2d(Cf / (21 * m), a * Cf / (21 * Iz)), 1e-14));
  EXPECT_EQ(s.C.row(0), Eigen::RowVector2d(0, 1));
  EXPECT_FALSE(is_linear_in_parameters(model, p));
  // Sampled, and differentiated with respect to the parameters through the discretisation.
  LinearModel sampled = model;
  sampled.dt = 0.05;
  const std::vector<StateSpace> exact = model_derivatives(sampled, p);
  ASSERT_EQ(exact.size(), 7U);
  for (std::size_t i = 0; i < exact.size(); ++i) {
    const auto slope = [&](double h) {
      const auto moved = [&](double by) {
        ParameterSet out = p;
        out[i].value(0, 0) += by;
        return flat(instantiate(sampled, out));
      };
      return VectorXd((moved(h) - moved(-h)) / (2.0 * h));
    };
    const double h = 1e-3 * p[i].scalar();
    const VectorXd expected = (4.0 * slope(0.5 * h) - slope(h)) / 3.0;
    EXPECT_LT((flat(exact[i]) - expected).norm(), 1e-9 * (expected.norm() + 1e-3)) << p[i].name;
  }
}

TEST(LinearFormulas, OffsetsBecomeAnInputThatIsAlwaysOne) {
  const LinearModel model =
      completed(*linear_model_of(formulas_of({{"T"},
                                              {"power"},
                                              {"R", "C", "outside"},
                                              {"(outside - T)/(R*C) + power/C"},
                                              {"T - 273.15"},
                                              {},
                                              true})));
  ASSERT_TRUE(model.offset);
  const ParameterSet p = free_parameters({{"R", 2.0}, {"C", 5.0}, {"outside", 280.0}});
  const StateSpace s = written_matrices(model, p);
  EXPECT_DOUBLE_EQ(s.A(0, 0), -0.1);
  EXPECT_TRUE(s.B.isApprox(Eigen::RowVector2d(0.2, 28.0), 1e-15));
  EXPECT_TRUE(s.D.isApprox(Eigen::RowVector2d(0.0, -273.15), 1e-15));
  EXPECT_EQ(model_inputs(model, MatrixXd::Constant(1, 3, 7.0)),
            (MatrixXd(2, 3) << 7, 7, 7, 1, 1, 1).finished());
}

TEST(LinearFormulas, NumbersAndMultiplesNeedNoFormula) {
  const LinearModel model =
      *linear_model_of(formulas_of({{"x", "y"},
                                    {},
                                    {"p", "q"},
                                    {"0.9*x + (2*p - q + 1)*y", "(0.5 - 0.1*p)*y - 3*q*x + p*q*x"},
                                    {"x"},
                                    {},
                                    false}));
  EXPECT_EQ(model.A.constant, (MatrixXd(2, 2) << 0.9, 1, 0, 0.5).finished());
  ASSERT_EQ(model.A.entries.size(), 3U);
  ASSERT_EQ(model.A.formulas.size(), 1U);
  EXPECT_EQ(model.A.formulas[0].parameters, (std::vector<int>{0, 1}));
  ParameterSet p = free_parameters({{"p", 0.3}, {"q", 0.2}});
  LinearModel whole = completed(model);
  const StateSpace s = written_matrices(whole, p);
  EXPECT_TRUE(s.A.isApprox((MatrixXd(2, 2) << 0.9, 1.4, -0.54, 0.47).finished(), 1e-15));
  EXPECT_FALSE(is_linear_in_parameters(whole, p));
  p[0].fixed = p[1].fixed = true;
  EXPECT_TRUE(is_linear_in_parameters(whole, p));
  const LinearModel known = with_known_formulas_as_numbers(whole, p);
  EXPECT_TRUE(known.A.formulas.empty());
  EXPECT_TRUE(written_matrices(known, p).A.isApprox(s.A, 1e-15));
}

}  // namespace
}  // namespace identikal
