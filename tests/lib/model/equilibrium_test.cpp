// Steady states against closed forms.

#include "lib/model/equilibrium.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "tests/support/written_model.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd numbers(std::initializer_list<double> values) {
  return Eigen::Map<const VectorXd>(values.begin(), static_cast<Eigen::Index>(values.size()));
}

Equilibrium rest_of(const Written& written, const VectorXd& p, const VectorXd& x,
                    const VectorXd& u = VectorXd(0)) {
  const NonlinearModel model = make_nonlinear_model(formulas_of(written));
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  return equilibrium(model, memory, x, u);
}

// Produced at u, lost at k, and what is bound to a receptor: its time is 1e-6 of the other's.
TEST(Equilibrium, IsTheRatioOfRatesWhateverTheirTimes) {
  for (const double fast : {1.0, 1e6, 1e-6}) {
    const Written written{{"x", "z"}, {"u"}, {"k", "on"}, {"u - k*x", "on*(x*x - z)"},
                          {"x"},      {},    true};
    const Equilibrium rest =
        rest_of(written, numbers({0.25, fast}), numbers({0.0, 0.0}), numbers({3.0}));
    ASSERT_TRUE(rest.found);
    EXPECT_NEAR(rest.x[0], 12.0, 1e-8);
    EXPECT_NEAR(rest.x[1], 144.0, 1e-6);
    EXPECT_NEAR(rest.wrt_p(0, 0), -48.0, 1e-6);    // -u/k^2
    EXPECT_NEAR(rest.wrt_p(1, 0), -1152.0, 1e-4);  // 2 x dx/dk
    EXPECT_NEAR(rest.wrt_p(1, 1) * fast, 0.0, 1e-6);
    EXPECT_LT(rest.wrt_x.cwiseAbs().maxCoeff(), 1e-9);
  }
}

// A <-> B: what there is in all stays, so that the start counts and f has no single root.
TEST(Equilibrium, KeepsWhatTheMotionConserves) {
  const Written written{{"A", "B"}, {}, {"on", "off"}, {"off*B - on*A", "on*A - off*B"},
                        {"A"},      {}, true};
  const Equilibrium rest = rest_of(written, numbers({3.0, 1.0}), numbers({1.0, 7.0}));
  ASSERT_TRUE(rest.found);
  EXPECT_NEAR(rest.x[0], 2.0, 1e-9);
  EXPECT_NEAR(rest.x[1], 6.0, 1e-9);
  EXPECT_NEAR(rest.wrt_x(0, 1), 0.25, 1e-8);
  EXPECT_NEAR(rest.wrt_p(0, 0), -0.5, 1e-7);  // -8 off/(on + off)^2
}

// Of a switch's two: the one that its start leads to.
TEST(Equilibrium, IsTheOneThatTheMotionReaches) {
  const Written written{{"x"}, {}, {"a"}, {"a*x - x^3"}, {"x"}, {}, true};
  for (const double from : {0.3, 5.0, -0.001}) {
    const Equilibrium rest = rest_of(written, numbers({4.0}), numbers({from}));
    ASSERT_TRUE(rest.found) << from;
    EXPECT_NEAR(rest.x[0], std::copysign(2.0, from), 1e-9);
    EXPECT_NEAR(rest.wrt_p(0, 0), std::copysign(0.25, from), 1e-7);
  }
}

TEST(Equilibrium, IsNotFoundFromWhereThereAreNoNumbers) {
  const Written written{{"x"}, {}, {"k"}, {"-k*x"}, {"x"}, {}, true};
  for (const double x : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_FALSE(rest_of(written, numbers({1.0}), numbers({x})).found);
  }
}

TEST(Equilibrium, IsNotFoundWhereNothingComesToRest) {
  const Written runaway{{"x"}, {}, {"a"}, {"a*x"}, {"x"}, {}, true};
  EXPECT_FALSE(rest_of(runaway, numbers({0.1}), numbers({1.0})).found);
  const Written ramp{{"x"}, {}, {"a"}, {"a"}, {"x"}, {}, true};
  EXPECT_FALSE(rest_of(ramp, numbers({0.1}), numbers({1.0})).found);
  const Written turns{{"x", "y"}, {}, {"w"}, {"w*y", "-w*x"}, {"x"}, {}, true};
  EXPECT_FALSE(rest_of(turns, numbers({2.0}), numbers({1.0, 0.0})).found);
  const Written map{{"x"}, {}, {"a"}, {"a*x"}, {"x"}, {}, false};
  EXPECT_THROW(rest_of(map, numbers({0.5}), numbers({1.0})), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
