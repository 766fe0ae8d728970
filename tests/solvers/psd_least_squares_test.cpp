#include "solvers/psd_least_squares.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <gtest/gtest.h>

#include "lib/base/random.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd random_matrix(std::mt19937& random, Index rows, Index cols) {
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, cols, [&] { return normal(random); });
}

// A: weights x unknowns of 1/2 |A x - b|^2.
PsdLeastSquares least_squares(const MatrixXd& A, const VectorXd& b, std::vector<PsdBlock> blocks) {
  MatrixXd H = A.transpose() * A;
  H.triangularView<Eigen::StrictlyUpper>() = H.transpose();
  return {H, A.transpose() * b, std::move(blocks)};
}

// Blocks over consecutive unknowns.
std::vector<PsdBlock> full_blocks(const std::vector<Index>& sizes) {
  std::vector<PsdBlock> out;
  Index first = 0;
  for (const Index m : sizes) {
    out.push_back(full_block(first, m));
    first += m * (m + 1) / 2;
  }
  return out;
}

// The smallest eigenvalue of X after scaling it to unit diagonal: no unit hides a negative one.
double smallest_correlation_eigenvalue(const MatrixXd& X) {
  EXPECT_GE(X.diagonal().minCoeff(), 0.0);
  const VectorXd w =
      X.diagonal().unaryExpr([](double d) { return d > 0.0 ? 1 / std::sqrt(d) : 1; });
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(w.asDiagonal() * X * w.asDiagonal())
      .eigenvalues()[0];
}

void expect_feasible(const PsdLeastSquares& problem, const PsdSolution& s) {
  EXPECT_TRUE(s.x.allFinite());
  ASSERT_EQ(s.blocks.size(), problem.blocks.size());
  for (std::size_t i = 0; i < s.blocks.size(); ++i) {
    EXPECT_EQ(s.blocks[i].X, value(problem.blocks[i], s.x));
    EXPECT_GE(smallest_correlation_eigenvalue(s.blocks[i].X), -1e-15);
    EXPECT_GE(smallest_correlation_eigenvalue(s.blocks[i].Z), -1e-15);
  }
}

struct Golden {
  std::string kind;
  double optimum = 0.0, width = 0.0;
  PsdLeastSquares problem;
};
std::vector<Golden> golden_problems() {
  std::ifstream file(IDENTIKAL_SOURCE_DIR "/tests/golden/psd_least_squares/problems.txt");
  std::vector<Golden> out;
  for (std::string line; std::getline(file, line);) {
    std::istringstream in(line);
    Golden g;
    Index k = 0;
    std::size_t blocks = 0;
    in >> g.kind >> k >> g.optimum >> g.width >> blocks;
    std::vector<Index> sizes(blocks);
    for (Index& m : sizes) in >> m;
    g.problem = {MatrixXd(k, k), VectorXd(k), full_blocks(sizes)};
    for (Index i = 0; i < k; ++i) {
      for (Index j = 0; j <= i; ++j) {
        in >> g.problem.H(i, j);
        g.problem.H(j, i) = g.problem.H(i, j);
      }
    }
    for (double& v : g.problem.g) in >> v;
    EXPECT_TRUE(in && in.get() == EOF) << line;
    out.push_back(std::move(g));
  }
  return out;
}

TEST(PsdLeastSquares, AgreesWithCvxopt) {
  const std::vector<Golden> problems = golden_problems();
  ASSERT_EQ(problems.size(), 50u);
  double worst_excess = 0.0, worst_shortfall = 0.0, worst_gap = 0.0;
  int iterations = 0;
  for (const Golden& g : problems) {
    SCOPED_TRACE(g.kind + " " + std::to_string(g.optimum));
    const PsdSolution s = minimise(g.problem);
    EXPECT_EQ(s.summary.termination, Termination::converged) << s.summary.message;
    expect_feasible(g.problem, s);
    const double size = std::abs(g.optimum);
    const double excess = s.summary.objective - g.optimum;
    EXPECT_LT(std::abs(excess), 1e-6 * size);
    EXPECT_LE(s.gap, 1e-9 * size);
    // The certificate is true: the objective is no further from the minimum than the gap.
    EXPECT_LE(excess, s.gap + std::abs(g.width) + 1e-12 * size);
    EXPECT_LE(-excess, std::abs(g.width) + 1e-12 * size);
    worst_excess = std::max(worst_excess, excess / size);
    worst_shortfall = std::max(worst_shortfall, -excess / size);
    worst_gap = std::max(worst_gap, s.gap / size);
    iterations = std::max(iterations, s.summary.iterations);
  }
  std::printf("worst of 50, relative: above CVXOPT %.1e, below %.1e, gap %.1e; %d iterations\n",
              worst_excess, worst_shortfall, worst_gap, iterations);
}

TEST(PsdLeastSquares, ObjectiveAndCertificateInOriginalUnits) {
  std::mt19937 random(3);
  const MatrixXd A = random_matrix(random, 20, 9);
  const VectorXd b = random_matrix(random, 20, 1);
  const PsdLeastSquares problem = least_squares(A, b, full_blocks({3, 2}));
  const PsdSolution s = minimise(problem);
  const VectorXd slope = problem.H * s.x - problem.g;
  EXPECT_NEAR(s.summary.objective, s.x.dot(0.5 * (problem.H * s.x) - problem.g), 1e-13);
  VectorXd adjoint(9);
  Index k = 0;
  double inner = 0.0;
  for (const PsdBlockSolution& block : s.blocks) {
    for (Index j = 0; j < block.Z.cols(); ++j) {
      for (Index i = j; i < block.Z.rows(); ++i) adjoint[k++] = block.Z(i, j) * (i == j ? 1 : 2);
    }
    inner += block.X.cwiseProduct(block.Z).sum();
  }
  EXPECT_LT((slope - adjoint).norm(), 1e-8 * problem.g.norm());
  const VectorXd v = problem.g + adjoint;
  const double bound = -0.5 * v.dot(problem.H.ldlt().solve(v));
  EXPECT_NEAR(s.summary.objective - bound, s.gap, 1e-13);
  EXPECT_LE(inner, s.gap * (1 + 1e-6));
  EXPECT_GT(s.gap, 0.0);
}

// 1/2 |X - M|_F^2 over the upper triangle's unknowns: off-diagonal entries count twice.
PsdLeastSquares projection(const MatrixXd& M) {
  const Index m = M.rows(), k = m * (m + 1) / 2;
  PsdLeastSquares p{MatrixXd::Zero(k, k), VectorXd(k), {full_block(0, m)}};
  for (const PsdBlock::Entry& e : p.blocks[0].entries) {
    p.H(e.unknown, e.unknown) = e.row == e.col ? 1.0 : 2.0;
    p.g[e.unknown] = p.H(e.unknown, e.unknown) * M(e.row, e.col);
  }
  return p;
}

TEST(PsdLeastSquares, NearestMatrixClipsEigenvalues) {
  std::mt19937 random(5);
  double worst = 0.0;
  for (const Index m : {2, 3, 5, 8}) {
    for (int trial = 0; trial < 5; ++trial) {
      const MatrixXd half = random_matrix(random, m, m), M = half + half.transpose();
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M);
      const MatrixXd clipped = eigen.eigenvectors() *
                               eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                               eigen.eigenvectors().transpose();
      SolverOptions options;
      options.function_tolerance = 1e-14;
      const PsdSolution s = minimise(projection(M), options);
      EXPECT_EQ(s.summary.termination, Termination::converged) << s.summary.message;
      worst = std::max(worst, (s.blocks[0].X - clipped).cwiseAbs().maxCoeff() / M.norm());
      // The multiplier is what was clipped.
      EXPECT_LT((s.blocks[0].Z - (clipped - M)).norm(), 1e-6 * M.norm());
      EXPECT_EQ(s.blocks[0].zero_eigenvalues, (eigen.eigenvalues().array() < 0.0).count());
    }
  }
  EXPECT_LT(worst, 1e-7);
  std::printf("worst entry of the nearest matrix, relative: %.1e\n", worst);
}

// X = [p^2, p q; p q, q^2 + r^2] is positive semidefinite for every p, q, r, and all such X are.
TEST(PsdLeastSquares, NoPointOfAFineGridIsBetter) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 6; ++trial) {
    const MatrixXd A = random_matrix(random, 5, 3);
    const VectorXd b = 3.0 * random_matrix(random, 5, 1);
    const PsdLeastSquares problem = least_squares(A, b, {full_block(0, 2)});
    const PsdSolution s = minimise(problem);
    ASSERT_TRUE(s.summary.usable());
    const auto objective = [&](const Eigen::Vector3d& f) {
      const Eigen::Vector3d x(f[0] * f[0], f[0] * f[1], f[1] * f[1] + f[2] * f[2]);
      return x.dot(0.5 * (problem.H * x) - problem.g);
    };
    // A grid around zero, then finer and finer ones around the best point.
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double best = objective(centre);
    for (double width = 4.0; width > 1e-7; width *= 0.6) {
      const Eigen::Vector3d middle = centre;
      for (int i = -10; i <= 10; ++i) {
        for (int j = -10; j <= 10; ++j) {
          for (int k = -10; k <= 10; ++k) {
            const Eigen::Vector3d f = middle + 0.1 * width * Eigen::Vector3d(i, j, k);
            const double value = objective(f);
            if (value < best) {
              best = value;
              centre = f;
            }
          }
        }
      }
    }
    EXPECT_NEAR(s.summary.objective, best, 1e-8 * std::max(1e-3, std::abs(best)));
  }
}

TEST(PsdLeastSquares, InteriorOptimumIsPlainLeastSquares) {
  std::mt19937 random(11);
  double worst = 0.0;
  for (int trial = 0; trial < 20; ++trial) {
    const MatrixXd A = random_matrix(random, 30, 9);
    VectorXd truth(9);
    truth << 3.0, 0.5, -0.2, 2.0, 0.1, 4.0, 1.0, 0.3, 2.0;
    const VectorXd b = A * truth + 0.1 * random_matrix(random, 30, 1);
    const VectorXd units = (VectorXd(9) << 1e6, 1, 1, 1e-6, 1e-6, 1e-6, 1e-3, 1, 1e3).finished();
    const PsdLeastSquares p =
        least_squares(A * units.cwiseInverse().asDiagonal(), b, full_blocks({3, 2}));
    const VectorXd expected = A.householderQr().solve(b);
    if (trial % 2 == 0) {
      const PsdSolution s = minimise(least_squares(A, b, full_blocks({3, 2})));
      EXPECT_EQ(s.summary.iterations, 0);
      EXPECT_TRUE(s.summary.usable());
      EXPECT_EQ(s.blocks[0].Z, MatrixXd::Zero(3, 3));
      EXPECT_EQ(s.blocks[0].zero_eigenvalues, 0);
      worst = std::max(worst, (s.x - expected).norm() / expected.norm());
    } else {  // with units, and only variances
      PsdLeastSquares variances = p;
      variances.blocks = {full_block(0, 1), full_block(3, 1), full_block(8, 1)};
      const VectorXd x = minimise(variances).x.cwiseQuotient(units);
      worst = std::max(worst, (x - expected).norm() / expected.norm());
    }
  }
  EXPECT_LT(worst, 1e-12);
  std::printf("interior optimum against QR, relative: %.1e\n", worst);
}

TEST(PsdLeastSquares, FlatDirectionsStayBoundedAndInside) {
  std::mt19937 random(13);
  // The second row of Q (x[1], x[3], x[4]) and R (x[6]) have no influence, x[0] and x[5] the same.
  MatrixXd A = random_matrix(random, 4, 7);
  A.col(1).setZero();
  A.col(3).setZero();
  A.col(4).setZero();
  A.col(6).setZero();
  A.col(5) = 2.0 * A.col(0);
  for (const double noise : {0.0, 3.0}) {
    const VectorXd truth = (VectorXd(7) << 2, 0, 0.5, 0, 0, 1, 0).finished();
    const VectorXd b = A * truth + noise * random_matrix(random, 4, 1);
    PsdLeastSquares p = least_squares(A, b, full_blocks({3, 1}));
    const PsdSolution s = minimise(p);
    EXPECT_TRUE(s.summary.usable()) << s.summary.message;
    EXPECT_EQ(s.rank, 2);
    expect_feasible(p, s);
    EXPECT_LT(s.x.cwiseAbs().maxCoeff(), 1e3);
    // A penalty on the trace settles what is flat.
    for (const Index k : {0, 3, 5, 6}) p.g[k] -= 0.01;
    const PsdSolution pulled = minimise(p);
    EXPECT_TRUE(pulled.summary.usable()) << pulled.summary.message;
    expect_feasible(p, pulled);
    EXPECT_LT(pulled.x[3], 1e-6);
    EXPECT_EQ(pulled.x[6], 0.0);
  }
}

TEST(PsdLeastSquares, ManyRandomProblemsNeverLeaveTheCone) {
  std::mt19937 random(17);
  int converged = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const std::vector<Index> sizes = {1 + trial % 4, 1 + trial % 3};
    const std::vector<PsdBlock> blocks = full_blocks(sizes);
    const Index k = blocks[1].entries.back().unknown + 1;
    MatrixXd A = random_matrix(random, trial % 5 == 0 ? k - 1 : k + 3, k);
    if (trial % 3 == 0) {  // sizes that no units of the states explain
      for (Index j = 0; j < k; ++j) A.col(j) *= std::pow(10.0, -6.0 + 3.0 * (j * 7 % 5));
    }
    const PsdLeastSquares p = least_squares(A, random_matrix(random, A.rows(), 1), blocks);
    const PsdSolution s = minimise(p);
    expect_feasible(p, s);
    converged += s.summary.usable() ? 1 : 0;
    if (s.summary.usable()) {
      EXPECT_LE(s.summary.objective, 0.0);
    } else {
      EXPECT_EQ(s.summary.termination, Termination::no_progress);
    }
  }
  std::printf("converged: %d of 500\n", converged);
  EXPECT_GE(converged, 498);  // the rest: gaps that rounding keeps above 1e-9
}

TEST(PsdLeastSquares, VarianceAtTheBoundaryIsExactlyZero) {
  const MatrixXd A = (MatrixXd(3, 2) << 1, 1, 1, 0, 1, 1).finished();
  const PsdSolution s = minimise(
      least_squares(A, Eigen::Vector3d(0.4, 1.0, 0.4), {full_block(0, 1), full_block(1, 1)}));
  EXPECT_TRUE(s.summary.usable());
  EXPECT_EQ(s.x[1], 0.0);
  EXPECT_NEAR(s.x[0], 0.6, 1e-9);
  EXPECT_EQ(s.blocks[0].zero_eigenvalues, 0);
  EXPECT_EQ(s.blocks[1].zero_eigenvalues, 1);
  EXPECT_NEAR(s.blocks[1].Z(0, 0), 0.4, 1e-9);  // the slope of the objective there
}

TEST(PsdLeastSquares, BlocksWithAConstantPart) {
  // x >= -1 and the minimum at -3.
  PsdLeastSquares bounded{
      MatrixXd::Identity(1, 1), VectorXd::Constant(1, -3.0), {full_block(0, 1)}};
  bounded.blocks[0].constant = MatrixXd::Ones(1, 1);
  EXPECT_NEAR(minimise(bounded).x[0], -1.0, 1e-8);
  // 2 <= x <= 1e3, far from where the minimum, at 0, lies.
  PsdLeastSquares far{MatrixXd::Identity(1, 1), VectorXd::Zero(1), {full_block(0, 1), {}}};
  far.blocks[0].constant = MatrixXd::Constant(1, 1, -2.0);
  far.blocks[1] = {1, {{0, 0, 0, -1.0}}, MatrixXd::Constant(1, 1, 1e3)};
  EXPECT_NEAR(minimise(far).x[0], 2.0, 1e-7);
  // [x1, 1/2; 1/2, x2] with x near (0.1, 0.1).
  PsdLeastSquares corner{MatrixXd::Identity(2, 2), VectorXd::Constant(2, 0.1), {{2, {}, {}}}};
  corner.blocks[0].entries = {{0, 0, 0, 1.0}, {1, 1, 1, 1.0}};
  corner.blocks[0].constant = (MatrixXd(2, 2) << 0, 0.5, 0.5, 0).finished();
  EXPECT_LT((minimise(corner).x - VectorXd::Constant(2, 0.5)).norm(), 1e-7);
  // No x makes [x, 1; 1, -2] definite.
  PsdLeastSquares none{MatrixXd::Identity(1, 1), VectorXd::Ones(1), {{2, {{0, 0, 0, 1.0}}, {}}}};
  none.blocks[0].constant = (MatrixXd(2, 2) << 0, 1, 1, -2).finished();
  EXPECT_EQ(minimise(none).summary.termination, Termination::start_undefined);

  // Moving the origin of x moves the solution, and nothing else.
  double worst = 0.0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    Random random(seed);
    const Index n = 1 + static_cast<Index>(seed % 4), k = n * (n + 1) / 2;
    MatrixXd A(2 * k, k);
    for (Index j = 0; j < k; ++j) A.col(j) = random.normal(2 * k);
    const VectorXd b = random.normal(2 * k), origin = 3.0 * random.normal(k);
    const PsdLeastSquares plain{A.transpose() * A, A.transpose() * b, {full_block(0, n)}};
    PsdLeastSquares moved{plain.H, plain.g - plain.H * origin, plain.blocks};
    moved.blocks[0].constant = value(plain.blocks[0], origin);
    const VectorXd difference = minimise(moved).x + origin - minimise(plain).x;
    // Along a flat bowl the square root of the objective's accuracy.
    worst = std::max(worst, (A * difference).norm() / (A * minimise(plain).x - b).norm());
  }
  std::printf("with a constant part: %.1e of the moved problem\n", worst);
  EXPECT_LT(worst, 1e-4);
}

TEST(PsdLeastSquares, IndependentBlocksAreThePartsThatNothingConnects) {
  MatrixXd constant = MatrixXd::Zero(4, 4);
  constant(0, 2) = constant(2, 0) = 0.5;
  std::vector<MatrixXd> basis(3, MatrixXd::Zero(4, 4));
  basis[0](0, 0) = basis[0](2, 2) = 1.0;
  basis[1](1, 1) = 2.0;
  basis[2](2, 0) = basis[2](0, 2) = 3.0;  // row 3 has no unknown
  const std::vector<PsdBlock> blocks = independent_blocks(constant, basis);
  ASSERT_EQ(blocks.size(), 2u);
  const VectorXd x = Eigen::Vector3d(5.0, 7.0, 0.25);
  EXPECT_EQ(value(blocks[0], x), (MatrixXd(2, 2) << 5.0, 1.25, 1.25, 5.0).finished());
  EXPECT_EQ(value(blocks[1], x), MatrixXd::Constant(1, 1, 14.0));
}

TEST(PsdLeastSquares, SaysWhatHasNoSolution) {
  // X = x [1, 0; 0, -1] is never definite; x = 0 is all there is.
  PsdLeastSquares p{MatrixXd::Identity(1, 1), VectorXd::Ones(1), {}};
  p.blocks = {{2, {{0, 0, 0, 1.0}, {0, 1, 1, -1.0}}}};
  const PsdSolution none = minimise(p);
  EXPECT_EQ(none.summary.termination, Termination::start_undefined);
  EXPECT_EQ(none.x[0], 0.0);
  // -x falls for ever with H = 0, and x >= 0 is no obstacle.
  PsdLeastSquares open{MatrixXd::Zero(1, 1), VectorXd::Ones(1), {full_block(0, 1)}};
  const PsdSolution falling = minimise(open);
  EXPECT_EQ(falling.summary.termination, Termination::no_progress);
  EXPECT_TRUE(falling.x.allFinite());
  open.g = -open.g;  // and the other way x = 0 is best
  EXPECT_TRUE(minimise(open).summary.usable());
  EXPECT_EQ(minimise(open).x[0], 0.0);
  // A start for blocks whose basis is not the identity: X = x0 [1, 0.99; .] + x1 [1, -2; ., 5].
  PsdLeastSquares skew{MatrixXd::Identity(2, 2), Eigen::Vector2d(1, -3), {}};
  skew.blocks = {{2,
                  {{0, 0, 0, 1.0},
                   {0, 1, 0, 0.99},
                   {0, 1, 1, 1.0},
                   {1, 0, 0, 1.0},
                   {1, 1, 0, -2.0},
                   {1, 1, 1, 5.0}}}};
  const PsdSolution s = minimise(skew);
  EXPECT_TRUE(s.summary.usable()) << s.summary.message;
  expect_feasible(skew, s);
}

TEST(PsdLeastSquares, LimitsAreNotSuccess) {
  std::mt19937 random(19);
  const PsdLeastSquares p =
      least_squares(random_matrix(random, 12, 6), random_matrix(random, 12, 1), full_blocks({3}));
  ASSERT_GT(minimise(p).summary.iterations, 3);
  SolverOptions options;
  options.max_iterations = 3;
  const PsdSolution limited = minimise(p, options);
  EXPECT_EQ(limited.summary.termination, Termination::iteration_limit);
  EXPECT_GE(limited.gap, limited.summary.objective - minimise(p).summary.objective);
  expect_feasible(p, limited);
  options.max_seconds = 0.0;
  EXPECT_EQ(minimise(p, options).summary.termination, Termination::time_limit);
  options = {};
  options.progress = [](int iteration, double) { return iteration < 2; };
  EXPECT_EQ(minimise(p, options).summary.termination, Termination::stopped);
}

TEST(PsdLeastSquares, RefusesWhatIsNoProblem) {
  const PsdLeastSquares good{MatrixXd::Identity(3, 3), VectorXd::Ones(3), {full_block(0, 2)}};
  EXPECT_NO_THROW(minimise(good));
  const auto refuses = [&](auto&& spoil) {
    PsdLeastSquares bad = good;
    spoil(bad);
    EXPECT_THROW(minimise(bad), std::invalid_argument);
  };
  refuses([](PsdLeastSquares& p) { p.g = VectorXd::Ones(2); });
  refuses([](PsdLeastSquares& p) { p.H = MatrixXd::Ones(3, 2); });
  refuses([](PsdLeastSquares& p) { p.H(0, 1) = 0.1; });
  refuses([](PsdLeastSquares& p) { p.H(0, 0) = -1.0; });
  refuses([](PsdLeastSquares& p) { p.H(0, 1) = p.H(1, 0) = 2.0; });  // indefinite
  refuses([](PsdLeastSquares& p) { p.g[0] = NAN; });
  refuses([](PsdLeastSquares& p) { p.blocks[0].size = 0; });
  refuses([](PsdLeastSquares& p) { p.blocks[0].size = 1; });
  refuses([](PsdLeastSquares& p) { p.blocks[0].entries[0].unknown = 3; });
  refuses([](PsdLeastSquares& p) { p.blocks[0].entries[0].row = -1; });
  refuses([](PsdLeastSquares& p) { p.blocks[0].entries[0].value = INFINITY; });
  try {
    minimise({MatrixXd::Identity(3, 3), VectorXd::Ones(2), {}});
  } catch (const std::invalid_argument& e) {
    EXPECT_STREQ(e.what(), "minimise: H is 3 x 3, g has 2 rows");
  }
  EXPECT_TRUE(minimise({MatrixXd(0, 0), VectorXd(0), {}}).summary.usable());
}

TEST(PsdLeastSquares, ManyVariancesTakeAFractionOfASecond) {
  std::mt19937 random(23);
  std::vector<PsdBlock> blocks = {full_block(0, 4)};
  for (Index k = 10; k < 120; ++k) blocks.push_back(full_block(k, 1));
  const PsdLeastSquares p =
      least_squares(random_matrix(random, 240, 120), random_matrix(random, 240, 1), blocks);
  const auto begin = std::chrono::steady_clock::now();
  const PsdSolution s = minimise(p);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  EXPECT_TRUE(s.summary.usable());
  std::printf("120 unknowns, 111 blocks: %.3f s, %d iterations\n", spent.count(),
              s.summary.iterations);
}

}  // namespace
}  // namespace identikal
