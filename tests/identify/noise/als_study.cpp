// Is autocovariance least squares unbiased, and how near to the bound does it come?
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "identify/filter/outliers.h"
#include "identify/noise/als.h"
#include "identify/noise/ml.h"
#include "identify/optimality/bound.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/autocovariance.h"
#include "solvers/psd_least_squares.h"
#include "tests/support/few_sources.h"
#include "tests/support/noise_study.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

NoiseStudy als_study(const std::string& title, const MatiskoSystem& system,
                     const std::vector<Eigen::MatrixXd>& recordings,
                     const NoiseAlsOptions& options) {
  return study(
      title + ", " + system.model.name, system, recordings,
      [&](const std::vector<Dataset>& data) { return tune_als(system.model, data, options); });
}

// The spreads that others had on the same recordings, with the lags and priors of the source: of
// Systems 1, 5 and 6 a published package with its constraint (noise/README.md beside the reference
// data), of System 7 numpy and scipy (identity weight, the first 100 innovations dropped). The
// package's own figures for System 7, 8.4 10.5 5.0 17.3 25.1, are reproduced by neither.
TEST(NoiseAlsStudy, SpreadsOfTheReferenceRecordings) {
  struct Row {
    int number;
    double r0;
    Index lags;
    std::vector<double> percent;
  };
  const std::vector<Row> rows = {{1, 1.0, 10, {10.0, 73.8}},
                                 {5, 1.0, 20, {4.4, 633}},
                                 {6, 1.0, 30, {5.8, 5.0, 26.8, 5.3}},
                                 {7, 1.0, 30, {9.8, 5.8, 5.0, 14.0, 27.3}},
                                 {7, 10.0, 30, {18.7, 10.1, 7.1, 24.5, 43.9}}};
  for (const Row& row : rows) {
    const std::string file = "noise/sys" + std::to_string(row.number) + ".csv";
    IDENTIKAL_NEEDS_SHARED_FILE(file);
    const MatiskoSystem system = started_at(matisko_system(row.number), 1.0, row.r0);
    NoiseAlsOptions options;
    options.weighted = false;
    options.lags = row.lags;
    const NoiseStudy s = als_study("als", system, reference_recordings(system), options);
    // Made with a gain that is far off, estimates are, and some filters' innovations show it.
    if (row.r0 == 1.0) {
      EXPECT_LE(s.not_ok, refused_by_chance(s.runs));
    }
    EXPECT_EQ(s.indefinite, 0);
    for (std::size_t i = 0; i < row.percent.size(); ++i) {
      const auto at = static_cast<Index>(i);
      EXPECT_NEAR(s.percent[at] / row.percent[i], 1.0, 0.1) << row.number << " " << i;
      if (row.number == 5 && i == 1) continue;  // cut off at zero, its mean is not the truth
      EXPECT_LT(std::abs(s.mean[at] - 1.0), 4.0 * s.percent[at] / 100.0 / std::sqrt(50.0));
    }
  }
}

TEST(NoiseAlsStudy, WeightedOnTheReferenceRecordings) {
  for (const int number : {1, 5, 6, 7}) {
    const std::string file = "noise/sys" + std::to_string(number) + ".csv";
    IDENTIKAL_NEEDS_SHARED_FILE(file);
    const MatiskoSystem system = matisko_system(number);
    const NoiseStudy s =
        als_study("als-weighted", system, reference_recordings(system), NoiseAlsOptions());
    EXPECT_LE(s.not_ok, refused_by_chance(s.runs));
    EXPECT_EQ(s.indefinite, 0);
    EXPECT_LE(s.ratio.maxCoeff(), 1.35);
  }
}

// 1000 simulations know a mean to 3 % of a standard deviation and a standard deviation to 2.2 %.
TEST(NoiseAlsStudy, WeightedIsUnbiasedAndNearTheBoundWhateverThePrior) {
  for (const int number : {6, 7}) {
    const std::vector<Eigen::MatrixXd> recordings = simulated_recordings(
        matisko_system(number), 1000, static_cast<std::uint64_t>(100 + number));
    for (const double r0 : {1.0, 10.0}) {
      const MatiskoSystem system = started_at(matisko_system(number), 1.0, r0);
      const NoiseStudy s = als_study("als-weighted, R0 = " + std::to_string(r0), system, recordings,
                                     NoiseAlsOptions());
      EXPECT_LE(s.not_ok, refused_by_chance(s.runs));
      EXPECT_EQ(s.indefinite, 0);
      EXPECT_LE(s.ratio.maxCoeff(), 1.10);
      EXPECT_GE(s.coverage.minCoeff(), 0.93);
      for (Index i = 0; i < s.mean.size(); ++i) {
        const double error = 2.0 * s.percent[i] / 100.0 / std::sqrt(1000.0);
        EXPECT_LT(std::abs(s.mean[i] - 1.0), std::max(0.01, error)) << number << " " << i;
      }
    }
  }
}

// Systems whose scales, or integrators, break the unweighted form. On the kinematic one Q is known
// to a third of itself, so that one filter in fifty loses more than 5 % whatever the method.
TEST(NoiseAlsStudy, HardSystemsStayNearTheBound) {
  for (const MatiskoSystem& system : {zhang_kinematic(), mehra_inertial()}) {
    const std::vector<Eigen::MatrixXd> recordings = simulated_recordings(system, 50, 1);
    NoiseAlsOptions plain;
    plain.weighted = false;
    als_study("als", system, recordings, plain);
    const NoiseStudy weighted = als_study("als-weighted", system, recordings, NoiseAlsOptions());
    NoiseMlOptions one;
    one.starts = 1;
    const NoiseStudy ml =
        study("ml, " + system.model.name, system, recordings,
              [&](const std::vector<Dataset>& data) { return tune_ml(system.model, data, one); });
    for (const NoiseStudy& s : {weighted, ml}) {
      EXPECT_LE(s.not_ok, refused_by_chance(s.runs));
      EXPECT_EQ(s.indefinite, 0);
      EXPECT_LE(s.ratio.maxCoeff(), 1.3);
      EXPECT_LE(s.worst_loss, std::max(0.05, 2.0 * ml.worst_loss));
    }
  }
}

// The whole matrix of autocovariances counts lag k (lags - k) times: short lags more.
TEST(NoiseAlsStudy, FullMatrixBesideTheSingleColumn) {
  for (const int number : {1, 6}) {
    const std::string file = "noise/sys" + std::to_string(number) + ".csv";
    IDENTIKAL_NEEDS_SHARED_FILE(file);
    const MatiskoSystem system = matisko_system(number);
    NoiseAlsOptions options;
    options.weighted = false;
    options.lags = number == 1 ? 10 : 30;
    const NoiseStudy column =
        als_study("als, single column", system, reference_recordings(system), options);
    options.full_matrix = true;
    const NoiseStudy matrix =
        als_study("als, full matrix", system, reference_recordings(system), options);
    for (const NoiseStudy& s : {column, matrix}) {
      EXPECT_LE(s.not_ok, refused_by_chance(s.runs));
      for (Index i = 0; i < s.mean.size(); ++i) {
        EXPECT_LT(std::abs(s.mean[i] - 1.0), 4.0 * s.percent[i] / 100.0 / std::sqrt(50.0));
      }
    }
  }
}

// What the errors cost, said from the bound and by each estimate, beside what the filters lose. The
// mean of 400 losses has a standard error of about 4 % of itself; five of them, and what the bound
// leaves to estimators that do not quite reach it, are the limit (false alarms: 1 in 1e6).
TEST(NoiseAlsStudy, ExpectedLossIsWhatTheFiltersLose) {
  for (const int number : {6, 7}) {
    const MatiskoSystem system = matisko_system(number);
    const std::vector<Eigen::MatrixXd> recordings =
        simulated_recordings(system, 400, static_cast<std::uint64_t>(500 + number));
    Model truth = system.model;
    truth.parameters = with_entries(truth.parameters, system.truth);
    BoundOptions options;
    options.samples = system.samples;
    const double least = bound_of(truth, options, nullptr).excess_mean_square_error->relative;
    const NoiseStudy als = als_study("als-weighted", system, recordings, NoiseAlsOptions());
    NoiseMlOptions one;
    one.starts = 1;
    const NoiseStudy ml =
        study("ml, " + system.model.name, system, recordings,
              [&](const std::vector<Dataset>& data) { return tune_ml(system.model, data, one); });
    std::printf("expected from the bound: %.3f %%\n", 100.0 * least);
    for (const NoiseStudy& s : {als, ml}) {
      EXPECT_LE(s.not_ok, refused_by_chance(s.runs));
      EXPECT_NEAR(s.mean_loss, s.expected_loss, 5.0 * s.loss_error);
      EXPECT_GT(s.mean_loss, least - 5.0 * s.loss_error);
    }
    EXPECT_NEAR(ml.mean_loss, least, 5.0 * ml.loss_error);
  }
}

// Process noise of one or two sources in systems of three and four states, 100 recordings each.
TEST(NoiseAlsStudy, FindsTheNumberOfSources) {
  for (const Index n : {3, 4}) {
    for (const Index rank : {1, 2}) {
      const MatiskoSystem system = few_sources(n, rank, static_cast<std::uint64_t>(10 * n + rank));
      const std::vector<Eigen::MatrixXd> recordings = simulated_recordings(system, 100, 1);
      for (const bool weighted : {true, false}) {
        NoiseAlsOptions options;
        options.weighted = weighted;
        options.min_rank = true;
        std::vector<int> found(static_cast<std::size_t>(n + 1));
        for (const Eigen::MatrixXd& y : recordings) {
          const NoiseEstimate e = tune_als(system.model, {dataset_of(y)}, options);
          ++found[e.minimum_rank->rank];
        }
        std::printf("%td states, %td sources, %s: found", n, rank,
                    weighted ? "als-weighted" : "als");
        for (const int count : found) std::printf(" %d", count);
        std::printf("\n");
        EXPECT_GE(found[rank], 90);
      }
    }
  }
}

// The alternative to leaving outliers out that was considered, for a scalar system: innovations
// clipped at c robust standard deviations. Clipping shrinks autocovariances; for Gaussian ones by a
// known monotone function of the correlation, E psi(x) psi(y), which is inverted (so lag 0 is
// Huber's proposal 2), and then least squares as in als.
Eigen::Vector2d huber_als(const MatiskoSystem& system, const Eigen::MatrixXd& y, double c,
                          Index lags) {
  const StateSpace m = instantiate(as_linear(system.model), system.model.parameters);
  const Eigen::MatrixXd L = steady_state(m)->K;
  const Index first = 20;
  const Eigen::VectorXd e =
      constant_gain_innovations(m, L, VectorXd::Zero(1), y, Eigen::MatrixXd(0, y.cols()))
          .rightCols(y.cols() - first)
          .transpose();
  const auto psi = [c](const Eigen::ArrayXd& x) { return x.max(-c).min(c).eval(); };
  // E psi(x) psi(y) by the midpoint rule.
  constexpr Index kPoints = 200;
  const auto clipped = [&](double correlation) {
    const Eigen::ArrayXd x = Eigen::ArrayXd::LinSpaced(kPoints, -6.0, 6.0);
    const Eigen::ArrayXd density = (-0.5 * x.square()).exp() / (-0.5 * x.square()).exp().sum();
    double sum = 0.0;
    for (Index i = 0; i < kPoints; ++i) {
      const Eigen::ArrayXd other =
          correlation * x[i] + std::sqrt(1.0 - correlation * correlation) * x;
      sum += density[i] * psi(x)[i] * (density * psi(other)).sum();
    }
    return sum;
  };
  Eigen::VectorXd sizes = e.cwiseAbs();
  std::nth_element(sizes.begin(), sizes.begin() + sizes.size() / 2, sizes.end());
  double scale = 1.4826 * sizes[sizes.size() / 2];
  const double at_zero_lag = clipped(1.0);
  for (int pass = 0; pass < 50; ++pass) {
    scale *= std::sqrt(psi(e.array() / scale).square().mean() / at_zero_lag);
  }
  const Eigen::VectorXd p = psi(e.array() / scale);
  Eigen::VectorXd sample(lags);
  sample[0] = scale * scale;
  for (Index k = 1; k < lags; ++k) {
    const double wanted =
        p.tail(p.size() - k).dot(p.head(p.size() - k)) / static_cast<double>(p.size() - k);
    double low = -0.999, high = 0.999;
    for (int pass = 0; pass < 20; ++pass) {
      const double middle = 0.5 * (low + high);
      (clipped(middle) < wanted ? low : high) = middle;
    }
    sample[k] = scale * scale * 0.5 * (low + high);
  }
  Eigen::MatrixXd design(lags, 2);
  for (Index i = 0; i < 2; ++i) {
    StateSpace noise = m;
    noise.Q.setConstant(i == 0 ? 1.0 : 0.0);
    noise.R.setConstant(i == 1 ? 1.0 : 0.0);
    design.col(i) = stacked(innovation_autocovariances(noise, L, lags));
  }
  return minimise({design.transpose() * design,
                   design.transpose() * sample,
                   {full_block(0, 1), full_block(1, 1)}})
      .x;
}

// System 1 with 1 % outliers of +-20 standard deviations, of the measurement noise (6 of the
// innovations: hard to see) and of the output. Clipping leaves a bias of its own, R 60 % too large
// or more, where leaving out has none; it is nearer only where outliers hide among the innovations,
// and unbiased there neither. So it is not offered.
TEST(NoiseAlsStudy, OutliersLeftOutOrClipped) {
  const MatiskoSystem system = matisko_system(1);
  NoiseAlsOptions options;
  options.weighted = false;
  options.lags = 10;
  const auto als = [&](const std::vector<Dataset>& data) {
    return tune_als(system.model, data, options);
  };
  for (const auto& [what, size] : {std::pair{"none", 0.0}, std::pair{"20 sd of v", 20.0},
                                   std::pair{"20 sd of y", 20.0 * std::sqrt(10.0 / 0.75 + 1.0)}}) {
    std::vector<Eigen::MatrixXd> recordings = simulated_recordings(system, 100, 11);
    Random random(12);
    for (Eigen::MatrixXd& y : recordings) {
      for (double& value : y.reshaped()) {
        if (random.uniform() < 0.01) value += random.uniform() < 0.5 ? size : -size;
      }
    }
    const NoiseStudy plain = study(std::string("als, outliers ") + what, system, recordings, als);
    const NoiseStudy robust = study(
        std::string("als --reject-outliers, outliers ") + what, system, recordings,
        [&](const std::vector<Dataset>& data) { return tune_robust(system.model, data, als); });
    for (const double c : {1.5, 2.5}) {
      Eigen::Matrix2Xd estimates(2, 100);
      for (Index run = 0; run < 100; ++run) {
        estimates.col(run) = huber_als(system, recordings[run], c, options.lags)
                                 .cwiseQuotient(Eigen::Vector2d(system.truth));
      }
      const Eigen::Vector2d mean = estimates.rowwise().mean();
      const Eigen::Vector2d sd =
          ((estimates.colwise() - mean).rowwise().squaredNorm() / 99.0).cwiseSqrt();
      std::printf("clipped at %.1f: mean / truth %.3f %.3f, sd in %% %.1f %.1f\n", c, mean[0],
                  mean[1], 100.0 * sd[0], 100.0 * sd[1]);
    }
    EXPECT_LT(std::abs(robust.mean[0] - 1.0), 5.0 * robust.percent[0] / 1000.0) << what;
  }
}

// 100 states, 10 outputs, 10 process noises.
MatiskoSystem large_system(bool full) {
  Random random(1);
  MatiskoSystem out;
  LinearModel& m = as_linear(out.model);
  out.model.name = "100 states";
  out.samples = 10000;
  m.A.constant = random_matrix(random, 100, 100);
  m.A.constant *= 0.9 / m.A.constant.eigenvalues().cwiseAbs().maxCoeff();
  m.G.constant = random_matrix(random, 100, 10);
  m.C.constant = random_matrix(random, 10, 100);
  Eigen::VectorXd q(10), r(10);
  for (Index i = 0; i < 10; ++i) {
    q[i] = 1.0 + static_cast<double>(i);
    r[i] = 100.0 * (11.0 - static_cast<double>(i));
  }
  complete(out, q, r);
  if (full) {
    out.model.parameters[1].domain = Domain::positive_definite;
    Parameter Q = out.model.parameters[0], R = out.model.parameters[1];
    Q.value.diagonal() = q;
    R.value.diagonal() = r;
    out.truth = free_entries({Q, R});
  }
  return started_at(out, 5.0, 500.0);
}

class LargeSystem : public ::testing::TestWithParam<std::pair<bool, bool>> {};

TEST_P(LargeSystem, FitsIntoMemoryAndAMinute) {
  const auto [weighted, full] = GetParam();
  const MatiskoSystem system = large_system(full);
  Random random(2);
  const std::vector<Dataset> data = {dataset_of(simulate_matisko(system, random))};
  NoiseAlsOptions options;
  options.weighted = weighted;
  const auto begin = std::chrono::steady_clock::now();
  const std::clock_t work = std::clock();
  const NoiseEstimate estimate = tune_als(system.model, data, options);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  const double worked = static_cast<double>(std::clock() - work) / CLOCKS_PER_SEC;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const double gigabytes = static_cast<double>(usage.ru_maxrss) / 1e6;
  double worst = 0.0, mean_square = 0.0;
  for (Index i = 0; i < system.truth.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[i];
    const double z = (p.value - system.truth[i]) / p.se;
    worst = std::max(worst, std::abs(z));
    mean_square += z * z / static_cast<double>(system.truth.size());
  }
  std::printf(
      "100 states, 10 outputs, %td unknowns, %s: %.1f s of the processor (%.1f s in all), "
      "%.2f GB resident at most; errors %.2f standard errors rms, %.1f at most\n",
      system.truth.size(), weighted ? "als-weighted" : "als", worked, spent.count(), gigabytes,
      std::sqrt(mean_square), worst);
  EXPECT_EQ(estimate.status, Status::ok) << estimate.message;
  EXPECT_LT(worked, 60.0);  // what others leave of the machine is not ours to judge
  EXPECT_LT(gigabytes, 2.0);
  EXPECT_LT(worst, 5.0);  // false alarms: 65 in 2e6
}
INSTANTIATE_TEST_SUITE_P(NoiseAlsStudy, LargeSystem,
                         ::testing::Values(std::pair{false, false}, std::pair{true, false},
                                           std::pair{false, true}, std::pair{true, true}));

}  // namespace
}  // namespace identikal
