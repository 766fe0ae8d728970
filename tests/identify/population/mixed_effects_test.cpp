// Marginal likelihoods of random effects against closed forms, quadrature and simulated populations.
#include "identify/population/mixed_effects.h"

#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

SolverOptions until(double decrement, int iterations = 200) {
  SolverOptions out;
  out.decrement_tolerance = decrement;
  out.max_iterations = iterations;
  return out;
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// y_ij = A_i exp(-k_i t_j) + e_ij, e ~ N(0, v); coordinates v, then A_i, k_i of each unit.
struct Decays {
  VectorXd t;
  MatrixXd y;  // units x times

  bool evaluate(const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) const {
    const double v = x[0];
    if (!(v > 0.0)) return false;
    const Index U = y.rows(), N = t.size();
    if (g != nullptr) *g = VectorXd::Zero(x.size());
    if (J != nullptr) *J = MatrixXd::Zero(x.size(), x.size());
    L = 0.0;
    for (Index i = 0; i < U; ++i) {
      const double A = x[1 + 2 * i], k = x[2 + 2 * i];
      for (Index j = 0; j < N; ++j) {
        const double e = std::exp(-k * t[j]), r = y(i, j) - A * e;
        L -= 0.5 * (std::log(2.0 * M_PI * v) + r * r / v);
        const Eigen::Vector2d by{e, -A * t[j] * e};
        if (g != nullptr) {
          (*g)[0] += 0.5 * (r * r / v - 1.0) / v;
          g->segment(1 + 2 * i, 2) += by * (r / v);
        }
        if (J != nullptr) {
          (*J)(0, 0) += 0.5 / (v * v);
          J->block(1 + 2 * i, 1 + 2 * i, 2, 2) += by * by.transpose() / v;
        }
      }
    }
    return std::isfinite(L);
  }

  MixedEffectsProblem problem(bool correlated = false) const {
    MixedEffectsProblem out;
    const Index n = 1 + 2 * y.rows();
    out.data.lower = VectorXd::Constant(n, -kInfinity);
    out.data.lower[0] = 0.0;
    out.data.upper = VectorXd::Constant(n, kInfinity);
    out.data.evaluate = [this](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
      return evaluate(x, L, g, J);
    };
    out.shared = {0};
    out.effects.resize(2, y.rows());
    for (Index i = 0; i < y.rows(); ++i) out.effects.col(i) << 1 + 2 * i, 2 + 2 * i;
    out.logarithmic = {false, true};
    out.correlated = correlated;
    return out;
  }

  static MixedEffectsStart start() {
    return {VectorXd{{0.05}}, VectorXd{{4.0, std::log(0.3)}}, VectorXd{{0.5, 0.5}}};
  }
};

constexpr double kMeanA = 5.0, kMeanLogK = -0.7, kSpreadA = 0.8, kSpreadK = 0.3, kNoiseSd = 0.2;

Decays simulated(Index units, std::uint64_t seed, double correlation = 0.0) {
  Random random(seed);
  Decays out;
  out.t = VectorXd::LinSpaced(9, 0.0, 4.0);
  out.y.resize(units, out.t.size());
  for (Index i = 0; i < units; ++i) {
    const double a = random.normal(), b = random.normal();
    const double A = kMeanA + kSpreadA * a;
    const double other = correlation * a + std::sqrt(1.0 - correlation * correlation) * b;
    const double k = std::exp(kMeanLogK + kSpreadK * other);
    for (Index j = 0; j < out.t.size(); ++j) {
      out.y(i, j) = A * std::exp(-k * out.t[j]) + kNoiseSd * random.normal();
    }
  }
  return out;
}

// One-way layout, balanced: y_ij ~ N(b_i, v), whose maximum is known in closed form.
TEST(MixedEffects, OfABalancedLayoutAreInClosedForm) {
  constexpr Index kUnits = 7, kRows = 5;
  Random random(3);
  MatrixXd y(kUnits, kRows);
  for (Index i = 0; i < kUnits; ++i) {
    const double b = 2.0 + 1.5 * random.normal();
    for (Index j = 0; j < kRows; ++j) y(i, j) = b + 0.7 * random.normal();
  }
  MixedEffectsProblem problem;
  problem.data.lower = VectorXd::Constant(kUnits + 1, -kInfinity);
  problem.data.lower[0] = 0.0;
  problem.data.upper = VectorXd::Constant(kUnits + 1, kInfinity);
  problem.data.evaluate = [&](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
    const double v = x[0];
    if (!(v > 0.0)) return false;
    const MatrixXd r = y.colwise() - x.tail(kUnits);
    L = -0.5 * (static_cast<double>(y.size()) * std::log(2.0 * M_PI * v) + r.squaredNorm() / v);
    if (g != nullptr) {
      g->resize(kUnits + 1);
      *g << 0.5 * (r.squaredNorm() / v - static_cast<double>(y.size())) / v, r.rowwise().sum() / v;
    }
    if (J != nullptr) {
      *J = MatrixXd::Zero(kUnits + 1, kUnits + 1);
      J->diagonal().setConstant(static_cast<double>(kRows) / v);
      (*J)(0, 0) = 0.5 * static_cast<double>(y.size()) / (v * v);
    }
    return true;
  };
  problem.shared = {0};
  problem.effects.resize(1, kUnits);
  for (Index i = 0; i < kUnits; ++i) problem.effects(0, i) = 1 + i;
  problem.logarithmic = {false};
  const MixedEffects found =
      maximise_marginal(problem, {VectorXd{{1.0}}, VectorXd{{0.0}}, VectorXd{{1.0}}}, until(1e-12));
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  const VectorXd means = y.rowwise().mean();
  const double grand = y.mean();
  const double within = (y.colwise() - means).squaredNorm() / (kUnits * (kRows - 1));
  const double between = (means.array() - grand).square().sum() * kRows / kUnits;
  const double omega2 = (between - within) / kRows;
  EXPECT_NEAR(found.shared[0].value, within, 1e-7);
  EXPECT_NEAR(found.mean[0].value, grand, 1e-7);
  EXPECT_NEAR(found.Omega(0, 0), omega2, 1e-6);
  // Of the dense covariance v I + omega^2 1 1' of each unit.
  const double total = within + kRows * omega2;
  const double log_det = kUnits * ((kRows - 1) * std::log(within) + std::log(total));
  const double squares = (y.colwise() - means).squaredNorm() / within +
                         (means.array() - grand).square().sum() * kRows / total;
  EXPECT_NEAR(found.summary.objective,
              -0.5 * (static_cast<double>(y.size()) * std::log(2.0 * M_PI) + log_det + squares),
              1e-9);
  // The mean's error has the same closed form, and units are shrunken by omega^2 / (omega^2 + v / n).
  EXPECT_NEAR(found.mean[0].se, std::sqrt(total / (kRows * kUnits)), 1e-4 * found.mean[0].se);
  const double shrink = omega2 / (omega2 + within / kRows);
  for (Index i = 0; i < kUnits; ++i) {
    EXPECT_NEAR(found.effects(0, i), grand + shrink * (means[i] - grand), 1e-6);
  }
}

// Laplace's method beside a sum over a fine grid of both effects.
TEST(MixedEffects, OfCurvesAreNearTheIntegral) {
  const Decays data = simulated(4, 5);
  const MixedEffects found = maximise_marginal(data.problem(), Decays::start());
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  double exact = 0.0;
  for (Index i = 0; i < data.y.rows(); ++i) {
    Decays one;
    one.t = data.t;
    one.y = data.y.row(i);
    constexpr int kHalf = 60;
    constexpr double kStep = 0.1;
    double most = -kInfinity;
    std::vector<double> terms;
    for (int a = -kHalf; a <= kHalf; ++a) {
      for (int b = -kHalf; b <= kHalf; ++b) {
        const double za = kStep * a, zb = kStep * b;
        const VectorXd x{{found.shared[0].value, found.mean[0].value + found.spread[0].value * za,
                          std::exp(found.mean[1].value + found.spread[1].value * zb)}};
        double L = 0.0;
        one.evaluate(x, L, nullptr, nullptr);
        terms.push_back(L - 0.5 * (za * za + zb * zb));
        most = std::max(most, terms.back());
      }
    }
    double sum = 0.0;
    for (const double term : terms) sum += std::exp(term - most);
    exact += most + std::log(sum * kStep * kStep / (2.0 * M_PI));
  }
  EXPECT_NEAR(found.summary.objective, exact, 0.02);
}

// The gradient holds how the effects and the determinant move: at the end no direction gains.
TEST(MixedEffects, EndWhereNoDirectionGains) {
  for (const bool correlated : {false, true}) {
    const Decays data = simulated(12, 7, 0.5);
    const MixedEffects found =
        maximise_marginal(data.problem(correlated), Decays::start(), until(1e-10));
    ASSERT_TRUE(found.summary.usable()) << found.summary.message;
    // Begun beside the end, and stopped before the first step, a search says the likelihood there.
    const auto value_at = [&](double mean_A, double mean_k, double sd_A, double sd_k, double v) {
      MixedEffectsProblem problem = data.problem();
      MixedEffectsStart at{VectorXd{{v}}, VectorXd{{mean_A, mean_k}}, VectorXd{{sd_A, sd_k}}};
      return maximise_marginal(problem, at, until(1e-9, 0)).summary.initial_objective;
    };
    if (correlated) {
      EXPECT_GT(found.summary.objective,
                maximise_marginal(data.problem(), Decays::start()).summary.objective);
      ASSERT_EQ(found.correlation.size(), 1u);
      EXPECT_GT(found.correlation[0].value, 0.0);
      continue;
    }
    const double A = found.mean[0].value, k = found.mean[1].value, a = found.spread[0].value,
                 b = found.spread[1].value, v = found.shared[0].value;
    const double best = value_at(A, k, a, b, v);
    EXPECT_NEAR(best, found.summary.objective, 1e-8);
    for (const double h : {-1e-2, 1e-2}) {
      EXPECT_LT(value_at(A + h * found.mean[0].se, k, a, b, v), best);
      EXPECT_LT(value_at(A, k + h * found.mean[1].se, a, b, v), best);
      EXPECT_LT(value_at(A, k, a + h * found.spread[0].se, b, v), best);
      EXPECT_LT(value_at(A, k, a, b + h * found.spread[1].se, v), best);
      EXPECT_LT(value_at(A, k, a, b, v + h * found.shared[0].se), best);
    }
  }
}

TEST(MixedEffects, ThatDoNotDifferHaveALimit) {
  Decays data = simulated(10, 11);
  Random random(12);
  for (Index i = 0; i < data.y.rows(); ++i) {
    for (Index j = 0; j < data.t.size(); ++j) {
      data.y(i, j) = kMeanA * std::exp(-0.5 * data.t[j]) + kNoiseSd * random.normal();
    }
  }
  const MixedEffects found = maximise_marginal(data.problem(), Decays::start());
  ASSERT_TRUE(found.summary.usable()) << found.summary.message;
  for (std::size_t j = 0; j < 2; ++j) {
    if (!found.spread_at_zero[j]) continue;
    EXPECT_EQ(found.spread[j].value, 0.0);
    EXPECT_GT(found.spread[j].high, 0.0);
    EXPECT_LT(found.spread[j].high, 0.3);
  }
  EXPECT_TRUE(found.spread_at_zero[0] || found.spread_at_zero[1]);
}

// 200 populations of 50 units, seed fixed. Each of the ten intervals is right in 95 % of them: of ten
// binomial counts one lies outside of [178, 199] with a chance below 1 %.
TEST(MixedEffects, IntervalsHoldTheTruthOfSimulatedPopulations) {
  constexpr int kFleets = 200;
  const double truth[] = {kNoiseSd * kNoiseSd, kMeanA, kMeanLogK, kSpreadA, kSpreadK};
  int inside[5] = {}, units = 0, named = 0;
  for (int fleet = 0; fleet < kFleets; ++fleet) {
    const MixedEffects found = maximise_marginal(
        simulated(50, 1000 + static_cast<std::uint64_t>(fleet)).problem(), Decays::start());
    ASSERT_TRUE(found.summary.usable()) << fleet << ": " << found.summary.message;
    const MarginalEstimate all[] = {found.shared[0], found.mean[0], found.mean[1], found.spread[0],
                                    found.spread[1]};
    for (int i = 0; i < 5; ++i) inside[i] += all[i].low <= truth[i] && truth[i] <= all[i].high;
    units += 50;
    named += static_cast<int>((found.p_value.array() < 0.05).count());
  }
  for (int i = 0; i < 5; ++i) {
    RecordProperty("inside_" + std::to_string(i), inside[i]);
    std::printf("parameter %d: %d of %d\n", i, inside[i], kFleets);
    EXPECT_GE(inside[i], 178);
    EXPECT_LE(inside[i], 199);
  }
  std::printf("units below p = .05: %d of %d\n", named, units);
  EXPECT_NEAR(static_cast<double>(named) / units, 0.05, 0.01);
}

TEST(MixedEffects, SizesThatDisagreeAreRefused) {
  const Decays data = simulated(4, 5);
  MixedEffectsStart start = Decays::start();
  start.spread[0] = 0.0;
  EXPECT_THROW(maximise_marginal(data.problem(), start), std::invalid_argument);
  MixedEffectsProblem problem = data.problem();
  problem.shared = {};
  EXPECT_THROW(maximise_marginal(problem, Decays::start()), std::invalid_argument);
  const Decays alone = simulated(1, 5);
  EXPECT_THROW(maximise_marginal(alone.problem(), Decays::start()), std::invalid_argument);
}

}  // namespace
}  // namespace identikal
