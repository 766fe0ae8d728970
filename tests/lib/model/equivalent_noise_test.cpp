// Coloured process noise turned into coloured measurement noise leaves every output as it was.
#include "lib/model/equivalent_noise.h"

#include <gtest/gtest.h>

#include "lib/filter/simulation.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Of random systems, filters of two states in front of every noise.
StateSpace with_filters(Random& random, Index n, Index nw, Index ny) {
  const StateSpace system = random_model(random, n, 1, ny, nw);
  const Index filter = 2 * nw;
  StateSpace m = system;
  m.A = MatrixXd::Zero(filter + n, filter + n);
  m.A.bottomRightCorner(n, n) = system.A;
  MatrixXd c = MatrixXd::Zero(nw, filter), g = MatrixXd::Zero(filter, nw);
  for (Index k = 0; k < nw; ++k) {
    m.A.block(2 * k, 2 * k, 2, 2) << 0.6 + 0.1 * static_cast<double>(k), 1.0, -0.84, 0.0;
    g.block(2 * k, k, 2, 1) << 0.7, -0.8;
    c(k, 2 * k) = 1.0;
  }
  m.A.bottomLeftCorner(n, filter) = system.G * c;
  m.B = MatrixXd::Zero(filter + n, 1);
  m.B.bottomRows(n) = system.B;
  m.C = MatrixXd::Zero(ny, filter + n);
  m.C.rightCols(n) = system.C;
  m.G.resize(filter + n, nw);
  m.G << g, system.G;
  m.x0.resize(0);
  m.P0.resize(0, 0);
  return m;
}

TEST(ColourPlace, OutputsAreTheSame) {
  Random random(41);
  for (const auto& [n, nw, ny] : {std::array<Index, 3>{1, 1, 1}, {3, 1, 1}, {4, 2, 2}}) {
    const StateSpace process = with_filters(random, n, nw, ny);
    const auto measurement = colour_in_measurement(process, 2 * nw);
    ASSERT_TRUE(measurement.has_value());
    EXPECT_TRUE(measurement->A.bottomLeftCorner(n, 2 * nw).isZero(0.0));
    const MatrixXd u = random_matrix(random, 1, 200);
    Random one(5), same(5);
    const MatrixXd y = simulate_outputs(process, InitialState::diffuse, u, 200, one);
    const MatrixXd z = simulate_outputs(*measurement, InitialState::diffuse, u, 200, same);
    EXPECT_LT((y - z).norm(), 1e-10 * y.norm());
  }
}

TEST(ColourPlace, ACommonPoleIsRefused) {
  Random random(42);
  StateSpace m = with_filters(random, 2, 1, 1);
  m.A.bottomRightCorner(2, 2) = m.A.topLeftCorner(2, 2);
  EXPECT_FALSE(colour_in_measurement(m, 2).has_value());
  m.A(0, 3) = 0.1;
  EXPECT_THROW(colour_in_measurement(m, 2), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
