#include "lib/model/recorded_scalar.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/model/linear_formulas.h"
#include "tests/support/written_model.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// The same pendulum as a function and as text.
struct RecordedPendulum {
  template <typename T>
  void dynamics(const T* x, const T* u, const T* p, T t, T* f) const {
    using std::abs;
    using std::sin;
    const T friction = p[1] * x[1] * abs(x[1]);
    f[0] = x[1];
    f[1] =
        -kStandardGravity / p[0] * sin(x[0]) - friction + u[0] / p[2] * (1.0 + 0.1 * sin(3.0 * t));
    f[1] += where(x[0] > 1.0, -p[1], 0.0 * x[0]);
  }
  template <typename T>
  void outputs(const T* x, const T*, const T* p, T, T* y) const {
    using std::sin;
    y[0] = p[0] * sin(x[0]);
  }
};

const Written kSamePendulum{
    {"phi", "w"},
    {"torque"},
    {"l", "c", "J"},
    {"w", "-g/l*sin(phi) - c*w*abs(w) + torque/J*(1 + 0.1*sin(3*t)) + if(phi > 1, -c, 0)"},
    {"l*sin(phi)"},
    {},
    true};

TEST(RecordedScalar, AFunctionIsTheSameModelAsItsFormulas) {
  const NonlinearModel function =
      make_nonlinear_model(trace(RecordedPendulum(), {2, 1, 3, 1, true}), Derivatives::second);
  const NonlinearModel text = make_nonlinear_model(formulas_of(kSamePendulum), Derivatives::second);
  const VectorXd time = (VectorXd(2) << 0.0, 0.1).finished();
  const InputNodes inputs =
      input_nodes(time, (MatrixXd(1, 2) << 0.7, 0.3).finished(), InputPath::linear, 0.02);
  const VectorXd p = (VectorXd(3) << 0.8, 0.2, 0.5).finished();
  for (const double phi : {0.4, 1.6}) {
    const auto moved = [&](const NonlinearModel& model, Jacobian& jacobian) {
      ModelMemory memory = make_memory(model);
      set_parameters(model, memory, p);
      VectorXd x = (VectorXd(2) << phi, -0.6).finished();
      step(model, memory, inputs, 0, x, jacobian, Derivatives::second);
      return x;
    };
    Jacobian a, b;
    EXPECT_LT((moved(function, a) - moved(text, b)).norm(), 1e-14);
    EXPECT_LT((a.wrt_p - b.wrt_p).norm(), 1e-13);
    EXPECT_LT((a.wrt_x_jacobian - b.wrt_x_jacobian).norm(), 1e-12);
  }
}

struct RecordedDecay {
  template <typename T>
  void dynamics(const T* x, const T* u, const T* p, T, T* f) const {
    f[0] = (u[0] - x[0]) / p[0];
  }
  template <typename T>
  void outputs(const T* x, const T*, const T*, T, T* y) const {
    y[0] = x[0];
  }
};

TEST(RecordedScalar, ALinearFunctionIsRecognised) {
  const auto linear = linear_model_of(trace(RecordedDecay(), {1, 1, 1, 1, true}));
  ASSERT_TRUE(linear.has_value());
  EXPECT_EQ(linear->A.formulas.size(), 1U);
  EXPECT_FALSE(linear_model_of(trace(RecordedPendulum(), {2, 1, 3, 1, true})).has_value());
}

TEST(RecordedScalar, ConstantsFoldAndGraphsDoNotMix) {
  FormulaNodes one = empty_nodes({1, 0, 0, 1, true}), other = empty_nodes({1, 0, 0, 1, true});
  const RecordedScalar x = recorded_arguments(one).x[0], y = recorded_arguments(other).x[0];
  EXPECT_TRUE(one.graph.is_number(
      (RecordedScalar(2.0) * 3.0 + exp(RecordedScalar(0.0))).in(one.graph), 7.0));
  EXPECT_THROW(x + y, std::invalid_argument);
}

}  // namespace
}  // namespace identikal
