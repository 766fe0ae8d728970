// Autocovariance least squares: the full-matrix form against its Kronecker formulas written out,
// the number of noise sources, and what errors of the noise cost the filter.
#include "identify/noise/als.h"

#include <cmath>
#include <cstdio>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <gtest/gtest.h>

#include "identify/model/model_file.h"
#include "identify/optimality/bound.h"
#include "lib/base/error.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/autocovariance.h"
#include "tests/support/bounded_als.h"
#include "tests/support/few_sources.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd kronecker(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd out(a.rows() * b.rows(), a.cols() * b.cols());
  for (Index i = 0; i < a.rows(); ++i) {
    for (Index j = 0; j < a.cols(); ++j) {
      out.block(i * b.rows(), j * b.cols(), b.rows(), b.cols()) = a(i, j) * b;
    }
  }
  return out;
}

// vec of N equal blocks on a diagonal, from vec of the block.
MatrixXd repeated_on_diagonal(Index size, Index N) {
  MatrixXd out = MatrixXd::Zero(size * N * size * N, size * size);
  for (Index b = 0; b < N; ++b) {
    for (Index j = 0; j < size; ++j) {
      for (Index i = 0; i < size; ++i) {
        out((b * size + j) * size * N + b * size + i, j * size + i) = 1.0;
      }
    }
  }
  return out;
}

// Odelson, Rajamani & Rawlings (2006), eq. (13): vec of the matrix of autocovariances, N x N
// blocks, of vec Q and vec R.
struct KroneckerForm {
  MatrixXd of_Q, of_R;
};
KroneckerForm kronecker_form(const StateSpace& m, const MatrixXd& L, Index N) {
  const Index n = m.states(), ny = m.outputs();
  const MatrixXd F = m.A - L * m.C;
  MatrixXd O(N * ny, n), Gamma = MatrixXd::Zero(N * ny, N * n),
                         Psi = MatrixXd::Zero(N * ny, N * ny);
  MatrixXd power = MatrixXd::Identity(n, n);
  for (Index i = 0; i < N; ++i) {
    O.middleRows(i * ny, ny) = m.C * power;
    for (Index j = 0; i + j + 1 < N; ++j) {
      Gamma.block((i + j + 1) * ny, j * n, ny, n) = m.C * power;
      Psi.block((i + j + 1) * ny, j * ny, ny, ny) = -m.C * power * L;
    }
    power = (F * power).eval();
  }
  const MatrixXd steady =
      (MatrixXd::Identity(n * n, n * n) - kronecker(F, F)).inverse();  // vec P of vec drive
  const MatrixXd I = MatrixXd::Identity(N * ny, N * ny);
  KroneckerForm out;
  const MatrixXd of_drive =
      kronecker(O, O) * steady + kronecker(Gamma, Gamma) * repeated_on_diagonal(n, N);
  out.of_Q = of_drive * kronecker(m.G, m.G);
  out.of_R = of_drive * kronecker(L, L) +
             (kronecker(Psi, I) + kronecker(I, Psi) + MatrixXd::Identity(I.size(), I.size())) *
                 repeated_on_diagonal(ny, N);
  return out;
}

TEST(TuneAls, FullMatrixEqualsTheKroneckerForm) {
  double worst = 0.0;
  int compared = 0;
  for (const int number : {1, 6, 7}) {
    const MatiskoSystem system = matisko_system(number);
    Random random(static_cast<std::uint64_t>(number));
    const MatrixXd y = simulate_matisko(system, random);
    const StateSpace m = instantiate(as_linear(system.model), system.model.parameters);
    const Index lags = 6, ny = m.outputs(), nw = m.Q.rows();
    NoiseAlsOptions options;
    options.weighted = false;
    options.full_matrix = true;
    options.lags = lags;
    const NoiseEstimate estimate = tune_als(system.model, {dataset_of(y)}, options);

    const MatrixXd L = steady_state(m)->K;
    const KroneckerForm form = kronecker_form(m, L, lags);
    MatrixXd design(form.of_Q.rows(), nw + ny);
    for (Index i = 0; i < nw; ++i) design.col(i) = form.of_Q.col(i * nw + i);
    for (Index i = 0; i < ny; ++i) design.col(nw + i) = form.of_R.col(i * ny + i);
    const Autocovariances sample = samples_of(m, L, y, lags);
    MatrixXd matrix(lags * ny, lags * ny);
    for (Index i = 0; i < lags; ++i) {
      for (Index j = 0; j < lags; ++j) {
        const MatrixXd& Y = sample[std::abs(i - j)];
        matrix.block(i * ny, j * ny, ny, ny) = i >= j ? Y : MatrixXd(Y.transpose());
      }
    }
    const VectorXd theta = design.colPivHouseholderQr().solve(VectorXd(matrix.reshaped()));
    ASSERT_GT(theta.minCoeff(), 0.0) << number;
    for (Index i = 0; i < theta.size(); ++i) {
      const double value = estimate.parameters[i].value;
      worst = std::max(worst, std::abs(value / theta[i] - 1.0));
      ++compared;
    }
  }
  std::printf("full matrix: %d parameters within %.1e of the Kronecker form\n", compared, worst);
  EXPECT_LT(worst, 1e-7);
}

// Speed and a bias that drifts: what a negative density of the speed takes off, the bias gives back
// within a sample, and the covariance of the sampled noise stays positive definite.
TEST(TuneAls, KeepsADensityWithinItsBounds) {
  const auto speed_and_bias = [](const std::string& bounds) {
    return parse_model_file(
        "identikal: 1\n"
        "time: {kind: continuous, step: 20 ms}\n"
        "parameters: {qv: {value: 1e-3" +
            bounds +
            "}, qb: {value: 0.05, min: 0}, "
            "r: {value: 0.04, min: 0}}\n"
            "states: {v: m/s, b: m/s^2}\n"
            "dynamics: {v: -b, b: 0}\n"
            "outputs: {wheel: {unit: m/s, equals: v}}\n"
            "noise: {process: {kind: density, variance: {v: qv, b: qb}}, measurement: {variance: "
            "{wheel: r}}}\n"
            "initial: diffuse\n",
        "speed.yaml");
  };
  Model truth = speed_and_bias(", min: 0");
  truth.parameters[0].value.setZero();
  int zero = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    Random random(seed);
    const StateSpace sampled = instantiate(as_linear(truth), truth.parameters);
    Dataset simulated = dataset_of(outputs_from_rest(sampled, random, 3000));
    simulated.dt = 0.02;
    simulated.time *= 0.02;
    const std::vector<Dataset> data = {simulated};
    for (const bool weighted : {true, false}) {
      for (const std::string bounds : {", min: 0", ""}) {
        const NoiseEstimate e = tune_als(speed_and_bias(bounds), data, {.weighted = weighted});
        EXPECT_GE(e.parameters[0].value, 0.0) << seed << weighted << bounds;
        if (e.parameters[0].value > 0.0) continue;
        EXPECT_EQ(e.parameters[0].verdict, Verdict::at_bound);
        EXPECT_GT(e.parameters[0].ci95[1], 0.0);
        ++zero;
      }
      const NoiseEstimate between =
          tune_als(speed_and_bias(", min: 1e-4, max: 0.01"), data, {.weighted = weighted});
      EXPECT_GE(between.parameters[0].value, 1e-4);
      EXPECT_LE(between.parameters[0].value, 0.01);
      const NoiseEstimate fewest =
          tune_als(speed_and_bias(", min: 1e-4"), data, {.weighted = weighted, .min_rank = true});
      EXPECT_GE(fewest.parameters[0].value, 1e-4);
    }
  }
  std::printf("density at zero in %d of 40\n", zero);
  EXPECT_GT(zero, 4);
}

TEST(TuneAls, EndsAtTheLeastMisfitWithinItsBounds) {
  const BoundedAls found = judge_bounded_als(200, 1);
  std::printf("%d solved, %d at a bound, conditions to %.1e; %d not converged\n", found.solved,
              found.at_bound, found.worst, found.not_converged);
  EXPECT_EQ(found.outside, 0);
  EXPECT_EQ(found.not_converged, 0) << found.why;
  EXPECT_LT(found.refused, found.solved / 50);
  EXPECT_GT(found.at_bound, 100);
  EXPECT_LT(found.worst, 1e-4);
}

TEST(TuneAls, TooManyAutocovariancesAreRefused) {
  const MatiskoSystem system = matisko_system(6);
  Random random(1);
  const std::vector<Dataset> data = {dataset_of(simulate_matisko(system, random))};
  NoiseAlsOptions options;
  options.lags = 1501;
  EXPECT_THROW(tune_als(system.model, data, options), InputError);
}

TEST(TuneAls, AnswersWithWhatItsErrorsCost) {
  const MatiskoSystem system = matisko_system(6);
  Random random(1);
  const NoiseEstimate estimate =
      tune_als(system.model, {dataset_of(simulate_matisko(system, random))});
  ASSERT_TRUE(estimate.excess_mean_square_error.has_value());
  EXPECT_EQ(estimate.excess_mean_square_error->reason, "");
  Model truth = system.model;
  truth.parameters = with_entries(truth.parameters, system.truth);
  BoundOptions options;
  options.samples = system.samples;
  const CramerRaoBound bound = bound_of(truth, options, nullptr);
  ASSERT_TRUE(bound.excess_mean_square_error.has_value());
  EXPECT_GT(bound.excess_mean_square_error->relative, 0.0);
  EXPECT_LT(estimate.excess_mean_square_error->relative,
            3.0 * bound.excess_mean_square_error->relative);
  EXPECT_GT(estimate.excess_mean_square_error->relative,
            bound.excess_mean_square_error->relative / 3.0);
}

// One output of two states cannot tell two full covariances apart; a free A is not noise.
TEST(ExcessMeanSquareError, IsNotKnownWhereItHasNoGround) {
  MatiskoSystem system = matisko_system(6);
  system.model.parameters[0].domain = Domain::positive_definite;
  LinearModel& linear = as_linear(system.model);
  linear.C.constant = Eigen::RowVector2d(1.0, 0.0);
  linear.D.constant.resize(1, 0);
  linear.S.constant = MatrixXd::Zero(2, 1);
  system.model.parameters[1].value = MatrixXd::Identity(1, 1);
  BoundOptions options;
  options.samples = 1000;
  const CramerRaoBound flat = bound_of(system.model, options, nullptr);
  ASSERT_TRUE(flat.excess_mean_square_error.has_value());
  EXPECT_TRUE(std::isnan(flat.excess_mean_square_error->relative));
  EXPECT_NE(flat.excess_mean_square_error->reason.find("do not determine"), std::string::npos)
      << flat.excess_mean_square_error->reason;

  Model model = scalar_model(0.5, 1.0, 1.0);
  Parameter a = model.parameters[0];
  a.name = "a";
  a.value(0, 0) = 0.5;
  model.parameters.push_back(a);
  as_linear(model).A.constant.setZero();
  as_linear(model).A.entries = {{0, 0, 2, 1.0}};
  const CramerRaoBound free = bound_of(model, options, nullptr);
  ASSERT_TRUE(free.excess_mean_square_error.has_value());
  EXPECT_TRUE(std::isnan(free.excess_mean_square_error->relative));
  EXPECT_NE(free.excess_mean_square_error->reason.find("other than noise"), std::string::npos)
      << free.excess_mean_square_error->reason;
}

// R of System 5 ends at zero on this recording: its error is left out by name.
TEST(ExcessMeanSquareError, LeavesOutWhatLiesAtTheBoundary) {
  const MatiskoSystem system = matisko_system(5);
  for (std::uint64_t seed = 1; seed < 20; ++seed) {
    Random random(seed);
    const NoiseEstimate estimate =
        tune_als(system.model, {dataset_of(simulate_matisko(system, random))});
    if (estimate.parameters[1].verdict != Verdict::at_bound) continue;
    ASSERT_TRUE(estimate.excess_mean_square_error.has_value());
    EXPECT_EQ(estimate.excess_mean_square_error->without,
              std::vector<std::string>{estimate.parameters[1].name});
    EXPECT_GE(estimate.excess_mean_square_error->relative, 0.0);
    return;
  }
  FAIL() << "no recording with R at zero";
}

TEST(MinimumRank, FollowsThePenaltyToFewerSources) {
  const MatiskoSystem system = few_sources(3, 1, 3);
  Random random(7);
  const std::vector<Dataset> data = {dataset_of(simulate_matisko(system, random))};
  for (const bool weighted : {true, false}) {
    NoiseAlsOptions options;
    options.weighted = weighted;
    options.min_rank = true;
    const NoiseEstimate estimate = tune_als(system.model, data, options);
    ASSERT_TRUE(estimate.minimum_rank.has_value());
    const RankSelection& s = *estimate.minimum_rank;
    EXPECT_EQ(s.of, 3);
    EXPECT_EQ(s.rank, 1);
    EXPECT_EQ(s.curve.front().rank, 0);
    EXPECT_EQ(s.curve.back().penalty, 0.0);
    for (std::size_t i = 1; i < s.curve.size(); ++i) {
      // Convex: as the penalty falls, so does the misfit, and the trace grows.
      EXPECT_LE(s.curve[i].penalty, s.curve[i - 1].penalty);
      EXPECT_LE(s.curve[i].objective, s.curve[i - 1].objective * (1.0 + 1e-6));
      EXPECT_GE(s.curve[i].trace, s.curve[i - 1].trace * (1.0 - 1e-6) - 1e-6);
    }
    const VectorXd eigenvalues =
        Eigen::SelfAdjointEigenSolver<MatrixXd>(estimate.noise.Q, Eigen::EigenvaluesOnly)
            .eigenvalues();
    EXPECT_LT(std::abs(eigenvalues[1]), 1e-8 * eigenvalues[2]);
    EXPECT_TRUE(std::isnan(
        estimate.excess_mean_square_error->relative));  // the errors of a singular Q are not known
    EXPECT_NE(estimate.excess_mean_square_error->reason.find("boundary"), std::string::npos)
        << estimate.excess_mean_square_error->reason;
    // Without the penalty's bias.
    EXPECT_NEAR(eigenvalues[2] / 4.0, 1.0, 0.2);
  }
}

// Of a diagonal Q the penalty drops variances: they are zero exactly.
TEST(MinimumRank, DropsVariancesOfADiagonalQ) {
  MatiskoSystem system = few_sources(3, 1, 3);
  system.model.parameters[0].domain = Domain::diagonal;
  system.truth = VectorXd::Ones(6);
  system.truth.head(3) = Eigen::Vector3d(0.0, 4.0, 0.0);
  Random random(7);
  NoiseAlsOptions options;
  options.min_rank = true;
  const NoiseEstimate estimate =
      tune_als(system.model, {dataset_of(simulate_matisko(system, random))}, options);
  EXPECT_EQ(estimate.minimum_rank->rank, 1);
  EXPECT_EQ(estimate.noise.Q(0, 0), 0.0);
  EXPECT_EQ(estimate.noise.Q(2, 2), 0.0);
  EXPECT_NEAR(estimate.noise.Q(1, 1), 4.0, 1.0);
}

}  // namespace
}  // namespace identikal
