#include "solvers/internal/matrix_root.h"

#include <cmath>
#include <functional>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;
using SparseFactor = Eigen::SimplicialLLT<Sparse, Eigen::Lower, Eigen::AMDOrdering<int>>;
using DenseFactor = Eigen::LLT<MatrixXd>;

// A share of entries above which products of blocks are faster.
constexpr double kDense = 0.1;

// The largest eigenvalue of a symmetric operator, from the Krylov space of a vector in which every
// direction has a part; orthogonalised twice, so that it comes up once.
double largest_by_lanczos(Index n, const std::function<VectorXd(const VectorXd&)>& product) {
  constexpr Index kMost = 60;
  constexpr double kSettled = 1e-12;
  MatrixXd basis(n, std::min(n, kMost));
  MatrixXd T = MatrixXd::Zero(basis.cols(), basis.cols());
  VectorXd next(n);
  for (Index i = 0; i < n; ++i) next[i] = 1.0 + 0.5 * std::sin(1.0 + 7.0 * static_cast<double>(i));
  double largest = 0.0;
  for (Index k = 0; k < basis.cols(); ++k) {
    const double length = next.norm();
    if (!(length > 0.0)) break;
    if (k > 0) T(k, k - 1) = T(k - 1, k) = length;
    basis.col(k) = next / length;
    next = product(basis.col(k));
    T(k, k) = basis.col(k).dot(next);
    const auto before = basis.leftCols(k + 1);
    for (int twice = 0; twice < 2; ++twice) next -= before * (before.transpose() * next);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> ritz(T.topLeftCorner(k + 1, k + 1));
    const double found = ritz.eigenvalues()[k];
    // What is left of the operator outside of the space moves it by no more than this.
    const double left = next.norm() * std::abs(ritz.eigenvectors()(k, k));
    largest = found;
    if (k > 0 && left <= kSettled * std::abs(found)) break;
  }
  return largest;
}

}  // namespace

bool has_many_zeros(const MatrixXd& M) {
  return static_cast<double>((M.array() != 0.0).count()) < kDense * static_cast<double>(M.size());
}

struct MatrixRoot::Factor {
  Index size = 0;
  std::variant<SparseFactor, DenseFactor> root;
};

MatrixRoot::~MatrixRoot() = default;
MatrixRoot::MatrixRoot(MatrixRoot&&) noexcept = default;
MatrixRoot::MatrixRoot(std::unique_ptr<Factor> factor) : factor_(std::move(factor)) {}

std::optional<MatrixRoot> MatrixRoot::of(const MatrixXd& M) {
  auto factor = std::make_unique<Factor>();
  factor->size = M.rows();
  if (!has_many_zeros(M)) factor->root.emplace<DenseFactor>();
  const bool found = std::visit(
      [&M](auto& root) {
        if constexpr (std::is_same_v<std::decay_t<decltype(root)>, SparseFactor>) {
          root.compute(M.sparseView());
        } else {
          root.compute(M);
        }
        return root.info() == Eigen::Success;
      },
      factor->root);
  if (!found) return std::nullopt;
  return MatrixRoot(std::move(factor));
}

MatrixXd MatrixRoot::solve(const MatrixXd& b) const {
  return std::visit([&b](const auto& root) { return MatrixXd(root.solve(b)); }, factor_->root);
}

double MatrixRoot::smallest_eigenvalue() const {
  const double largest_of_inverse =
      largest_by_lanczos(factor_->size, [this](const VectorXd& v) { return VectorXd(solve(v)); });
  return 1.0 / largest_of_inverse;
}

double largest_eigenvalue(const MatrixXd& M) {
  if (has_many_zeros(M)) {
    const Sparse sparse = M.sparseView();
    return largest_by_lanczos(M.rows(), [&](const VectorXd& v) { return VectorXd(sparse * v); });
  }
  return largest_by_lanczos(M.rows(), [&](const VectorXd& v) { return VectorXd(M * v); });
}

struct DampedRoots::System {
  Index size;
  std::vector<Index> moving;
  VectorXd d;
  Sparse sparse;   // lower triangle of M on them, with its diagonal;
  MatrixXd dense;  // or, where it has few zeros, all of it
  SparseFactor factor;
  bool analysed = false;

  VectorXd diagonal() const {
    return dense.size() > 0 ? VectorXd(dense.diagonal()) : VectorXd(sparse.diagonal());
  }

  // Of M + lambda diag(d) scaled to unit diagonal.
  std::optional<VectorXd> solve_scaled(const VectorXd& scale, const VectorXd& g) {
    constexpr double kSmallestPivot = 1e-5;
    if (dense.size() > 0) {
      MatrixXd scaled = scale.asDiagonal() * dense * scale.asDiagonal();
      scaled.diagonal().setOnes();
      const DenseFactor root(scaled);
      if (root.info() != Eigen::Success) return std::nullopt;
      const double pivot = root.matrixLLT().diagonal().cwiseAbs2().minCoeff();
      if (!(pivot > kSmallestPivot)) return std::nullopt;
      return VectorXd(root.solve(g));
    }
    Sparse scaled = scale.asDiagonal() * sparse * scale.asDiagonal();
    scaled.diagonal().setOnes();
    if (!analysed) factor.analyzePattern(scaled);
    analysed = true;
    factor.factorize(scaled);
    if (factor.info() != Eigen::Success) return std::nullopt;
    const VectorXd pivots = factor.matrixL().nestedExpression().diagonal();
    if (!(pivots.cwiseAbs2().minCoeff() > kSmallestPivot)) return std::nullopt;
    return VectorXd(factor.solve(g));
  }
};

DampedRoots::~DampedRoots() = default;

DampedRoots::DampedRoots(const MatrixXd& M, const std::vector<Index>& free, const VectorXd& d)
    : system_(std::make_unique<System>()) {
  System& out = *system_;
  out.size = M.rows();
  for (const Index i : free) {
    if (M(i, i) > 0.0) out.moving.push_back(i);
  }
  out.d = d(out.moving);
  const auto m = static_cast<Index>(out.moving.size());
  std::vector<Eigen::Triplet<double>> entries;
  for (Index j = 0; j < m; ++j) {
    for (Index i = j; i < m; ++i) {
      const double value = M(out.moving[i], out.moving[j]);
      if (value != 0.0) entries.emplace_back(i, j, value);
    }
    if (static_cast<double>(entries.size()) > 0.5 * kDense * static_cast<double>(m * m)) {
      out.dense = M(out.moving, out.moving);
      return;
    }
  }
  out.sparse.resize(m, m);
  out.sparse.setFromTriplets(entries.begin(), entries.end());
}

std::optional<VectorXd> DampedRoots::solve(const VectorXd& g, double lambda) {
  System& of = *system_;
  VectorXd out = VectorXd::Zero(of.size);
  if (of.moving.empty()) return out;
  const VectorXd scale = (of.diagonal() + lambda * of.d).cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return std::nullopt;
  const std::optional<VectorXd> step =
      of.solve_scaled(scale, scale.cwiseProduct(VectorXd(g(of.moving))));
  if (!step) return std::nullopt;
  out(of.moving) = scale.cwiseProduct(*step);
  return out;
}

}  // namespace identikal
