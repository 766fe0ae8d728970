#include "solvers/covariance.h"

#include <array>
#include <map>

#include <Eigen/Eigenvalues>

#include "solvers/internal/matrix_root.h"

namespace identikal {
namespace {

// Nothing where the smallest eigenvalue is below `tolerance` times the largest.
std::optional<Eigen::MatrixXd> inverse_by_root(const Eigen::MatrixXd& scaled, double tolerance) {
  const std::optional<MatrixRoot> root = MatrixRoot::of(scaled);
  if (!root || root->smallest_eigenvalue() <= tolerance * largest_eigenvalue(scaled)) {
    return std::nullopt;
  }
  const Eigen::MatrixXd inverse =
      root->solve(Eigen::MatrixXd::Identity(scaled.rows(), scaled.rows()));
  return 0.5 * (inverse + inverse.transpose());
}

}  // namespace

std::optional<Eigen::MatrixXd> scaled_inverse(const Eigen::Ref<const Eigen::MatrixXd>& information,
                                              double tolerance) {
  if (information.size() == 0) return Eigen::MatrixXd(information);
  if (!information.allFinite() || information.diagonal().minCoeff() <= 0.0) return std::nullopt;
  const Eigen::VectorXd scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * information * scale.asDiagonal();
  if (scaled.rows() > kManyUnknowns) {
    const std::optional<Eigen::MatrixXd> inverse = inverse_by_root(scaled, tolerance);
    if (inverse) return scale.asDiagonal() * *inverse * scale.asDiagonal();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  if (eigen.eigenvalues().minCoeff() <= tolerance * eigen.eigenvalues().maxCoeff()) {
    return std::nullopt;
  }
  const Eigen::MatrixXd half = scale.asDiagonal() * eigen.eigenvectors() *
                               eigen.eigenvalues().cwiseSqrt().cwiseInverse().asDiagonal();
  return half * half.transpose();
}

std::optional<std::array<double, 2>> extreme_eigenvalues(const Eigen::MatrixXd& M) {
  const std::optional<MatrixRoot> root = MatrixRoot::of(M);
  if (!root) return std::nullopt;
  return std::array<double, 2>{root->smallest_eigenvalue(), largest_eigenvalue(M)};
}

std::vector<std::vector<Eigen::Index>> moved_together(const std::vector<Eigen::Index>& owner) {
  std::vector<std::vector<Eigen::Index>> out;
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i] < 0) out.push_back({static_cast<Eigen::Index>(i)});
  }
  const std::size_t first = out.size();
  std::map<Eigen::Index, std::size_t> taken;  // of each owner
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i] < 0) continue;
    const std::size_t turn = first + taken[owner[i]]++;
    if (turn == out.size()) out.emplace_back();
    out[turn].push_back(static_cast<Eigen::Index>(i));
  }
  return out;
}

std::optional<Eigen::MatrixXd> observed_information(
    const std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>& gradient,
    const Eigen::VectorXd& x, const Eigen::VectorXd& step,
    const std::vector<Eigen::Index>& owner_or_none) {
  const Eigen::Index n = x.size();
  const std::vector<Eigen::Index> owner =
      owner_or_none.empty() ? std::vector<Eigen::Index>(static_cast<std::size_t>(n), -1)
                            : owner_or_none;
  const auto owner_of = [&](Eigen::Index i) { return owner[static_cast<std::size_t>(i)]; };
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd above, below;
  for (const std::vector<Eigen::Index>& together : moved_together(owner)) {
    Eigen::VectorXd h = Eigen::VectorXd::Zero(n);
    for (const Eigen::Index i : together) h[i] = step[i];
    if (!gradient(x + h, above) || !gradient(x - h, below)) return std::nullopt;
    for (const Eigen::Index i : together) {
      for (Eigen::Index k = 0; k < n; ++k) {
        if (owner_of(i) >= 0 && owner_of(k) != owner_of(i)) continue;
        H(k, i) = (below[k] - above[k]) / (2.0 * step[i]);
      }
    }
  }
  // What an owner's coordinates have in common with those of all was seen from there.
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < n; ++k) {
      if (owner_of(i) >= 0 && owner_of(k) < 0) H(k, i) = H(i, k);
    }
  }
  return 0.5 * (H + H.transpose());
}

}  // namespace identikal
