#include "lib/filter/internal/independent_parts.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "lib/filter/likelihood.h"
#include "tests/support/random_model.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd stacked(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd out = MatrixXd::Zero(a.rows() + b.rows(), a.cols() + b.cols());
  out.topLeftCorner(a.rows(), a.cols()) = a;
  out.bottomRightCorner(b.rows(), b.cols()) = b;
  return out;
}

MatrixXd above(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd out(a.rows() + b.rows(), a.cols());
  out << a, b;
  return out;
}

// Two models side by side that share inputs.
StateSpace side_by_side(const StateSpace& a, const StateSpace& b) {
  StateSpace out;
  out.A = stacked(a.A, b.A), out.C = stacked(a.C, b.C), out.G = stacked(a.G, b.G);
  out.Q = stacked(a.Q, b.Q), out.R = stacked(a.R, b.R), out.S = stacked(a.S, b.S);
  out.B = above(a.B, b.B), out.D = above(a.D, b.D);
  out.x0 = above(a.x0, b.x0), out.P0 = stacked(a.P0, b.P0);
  return out;
}

Eigen::PermutationMatrix<Eigen::Dynamic> shuffled(Random& random, Index size) {
  Eigen::PermutationMatrix<Eigen::Dynamic> out(static_cast<int>(size));
  out.setIdentity();
  for (Index i = size - 1; i > 0; --i) {
    std::swap(out.indices()[i],
              out.indices()[static_cast<Index>(random.uniform() * static_cast<double>(i + 1))]);
  }
  return out;
}

struct Shuffle {
  Eigen::PermutationMatrix<Eigen::Dynamic> states, outputs, noises;

  StateSpace of(const StateSpace& m) const {
    const auto &x = states, &y = outputs, &w = noises;
    StateSpace out = m;
    out.A = x * m.A * x.transpose(), out.B = x * m.B, out.C = y * m.C * x.transpose();
    out.D = y * m.D, out.G = x * m.G * w.transpose(), out.Q = w * m.Q * w.transpose();
    out.R = y * m.R * y.transpose(), out.S = w * m.S * y.transpose();
    out.x0 = x * m.x0, out.P0 = x * m.P0 * x.transpose();
    return out;
  }
};

struct SplitCase {
  StateSpace model;
  std::vector<StateSpace> derivatives;
  MatrixXd y, u;
};

// Two or three random models in one, in random order, with gaps of single outputs. The first
// derivatives are of one part each, the last moves all of them.
SplitCase random_split_case(std::uint64_t seed, Index N) {
  Random random(seed);
  const auto pick = [&](int from, int to) {
    return static_cast<Index>(from + static_cast<int>(random.uniform() * (to - from + 1)));
  };
  SplitCase out;
  const Index nu = pick(0, 1);
  const int count = seed % 3 == 0 ? 3 : 2;
  std::vector<StateSpace> parts, directions;
  for (int i = 0; i < count; ++i) {
    const Index n = pick(1, 3);
    parts.push_back(random_model(random, n, nu, pick(1, 2), pick(1, static_cast<int>(n))));
    directions.push_back(seed % 2 == 0 ? random_direction(random, parts.back())
                                       : noise_direction(random, parts.back()));
  }
  const auto joined = [&](const std::vector<StateSpace>& all) {
    StateSpace whole = all[0];
    for (std::size_t i = 1; i < all.size(); ++i) whole = side_by_side(whole, all[i]);
    return whole;
  };
  const auto zero = [](StateSpace m) {
    for (MatrixXd* M : {&m.A, &m.B, &m.C, &m.D, &m.G, &m.Q, &m.R, &m.S, &m.P0}) M->setZero();
    m.x0.setZero();
    return m;
  };
  const StateSpace whole = joined(parts);
  const Shuffle shuffle{shuffled(random, whole.states()), shuffled(random, whole.outputs()),
                        shuffled(random, whole.G.cols())};
  for (int i = 0; i < count; ++i) {
    std::vector<StateSpace> only;
    for (int j = 0; j < count; ++j) {
      const auto at = static_cast<std::size_t>(j);
      only.push_back(i == j ? directions[at] : zero(directions[at]));
    }
    out.derivatives.push_back(shuffle.of(joined(only)));
  }
  out.derivatives.push_back(shuffle.of(joined(directions)));
  out.model = shuffle.of(whole);
  out.u = random_matrix(random, nu, N);
  out.y = simulate_outputs(random, out.model, out.u, N);
  for (Index i = 0; i < out.y.rows(); ++i) {
    const Index begin = pick(20, static_cast<int>(N) - 60);
    for (Index t = begin; t < begin + 50; t += i + 1) out.y(i, t) = kNaN;
  }
  return out;
}

double relative_change(const MatrixXd& a, const MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(1e-300, b.cwiseAbs().maxCoeff());
}

TEST(IndependentParts, AreFoundWhateverTheOrder) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const SplitCase c = random_split_case(seed, 100);
    IndependentParts parts;
    EXPECT_TRUE(parts.link(c.model, InitialState::given, c.derivatives));
    EXPECT_EQ(parts.parts().size(), seed % 3 == 0 ? 3u : 2u) << seed;
    EXPECT_FALSE(parts.link(c.model, InitialState::given, {}));
  }
}

TEST(IndependentParts, TheirLikelihoodsAreThatOfTheWhole) {
  double value = 0.0, gradient = 0.0;
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const SplitCase c = random_split_case(seed, 1500);
    for (const InitialState initial :
         {InitialState::given, InitialState::stationary, InitialState::diffuse}) {
      LikelihoodEngine apart, whole;
      apart.add_recording(c.y, c.u), whole.add_recording(c.y, c.u);
      // Twice: the second evaluation finds parts and workspace made.
      apart.evaluate(c.model, initial);
      const Likelihood a = apart.evaluate(c.model, initial, c.derivatives);
      const Likelihood b =
          whole.evaluate(c.model, initial, c.derivatives, EvaluationMethod::time_varying);
      ASSERT_EQ(a.status, b.status) << seed;
      if (b.status != FilterStatus::ok) continue;
      ++compared;
      value = std::max(value, std::abs(a.value / b.value - 1.0));
      gradient = std::max(gradient, relative_change(a.gradient, b.gradient));
      EXPECT_LT(relative_change(a.information, b.information), 0.2) << seed;
    }
  }
  printf("%d likelihoods by parts: value to %.1e, gradient to %.1e of the full recursion's\n",
         compared, value, gradient);
  EXPECT_GT(compared, 50);
  EXPECT_LT(value, 1e-9);
  EXPECT_LT(gradient, 1e-8);
}

TEST(IndependentParts, AParameterThatIsZeroNowMayLinkThem) {
  SplitCase c = random_split_case(4, 500);
  LikelihoodEngine engine, whole;
  engine.add_recording(c.y, c.u), whole.add_recording(c.y, c.u);
  engine.evaluate(c.model, InitialState::given);
  StateSpace d = c.derivatives.back();
  d.R.setConstant(0.01);
  const Likelihood a = engine.evaluate(c.model, InitialState::given, {d});
  const Likelihood b =
      whole.evaluate(c.model, InitialState::given, {d}, EvaluationMethod::time_varying);
  EXPECT_LT(relative_change(a.gradient, b.gradient), 1e-8);
  IndependentParts parts;
  parts.link(c.model, InitialState::given, {});
  EXPECT_FALSE(parts.is_whole());
  EXPECT_TRUE(parts.link(c.model, InitialState::given, {d}));
  EXPECT_TRUE(parts.is_whole());
}

TEST(IndependentParts, AStateThatNoOutputSeesKeepsAllTogether) {
  SplitCase c = random_split_case(3, 200);
  StateSpace hidden = c.model;
  hidden.C.setZero();
  const StateSpace whole = side_by_side(c.model, hidden);
  StateSpace seen = whole;
  seen.C = whole.C.topRows(c.model.outputs()), seen.D = whole.D.topRows(c.model.outputs());
  seen.R = whole.R.topLeftCorner(c.model.outputs(), c.model.outputs());
  seen.S = whole.S.leftCols(c.model.outputs());
  IndependentParts parts;
  parts.link(seen, InitialState::diffuse, {});
  EXPECT_TRUE(parts.is_whole());
  LikelihoodEngine engine;
  engine.add_recording(c.y, c.u);
  EXPECT_EQ(engine.evaluate(seen, InitialState::diffuse).status, FilterStatus::undetermined);
}

}  // namespace
}  // namespace identikal
