// What is a large symmetric matrix, most of it zero, worth?
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Triangular root of a symmetric positive definite matrix whose diagonal is about one: P M P' = L L'
/// with an order P that leaves zeros zero, where there are many. Unknowns that recordings have of their
/// own see each other only through those of all, and the root's cost is then linear in them.
class MatrixRoot {
 public:
  ~MatrixRoot();
  MatrixRoot(MatrixRoot&&) noexcept;

  /// @return nothing when M, n x n, is not positive definite
  static std::optional<MatrixRoot> of(const Eigen::MatrixXd& M);

  /// M^-1 b. @param b  n x any
  Eigen::MatrixXd solve(const Eigen::MatrixXd& b) const;
  /// Of M, by Lanczos's method on its inverse.
  double smallest_eigenvalue() const;

 private:
  struct Factor;
  explicit MatrixRoot(std::unique_ptr<Factor> factor);
  std::unique_ptr<Factor> factor_;
};

/// Are nine of ten entries zero?
bool has_many_zeros(const Eigen::MatrixXd& M);

/// Of a symmetric matrix, by Lanczos's method.
double largest_eigenvalue(const Eigen::MatrixXd& M);

/// (M + lambda diag(d))^-1 g of many unknowns, of one M and for several lambda.
class DampedRoots {
 public:
  /// @param M     n x n, symmetric
  /// @param free  coordinates that move; those of which M knows nothing, M(i, i) <= 0, do not
  /// @param d     n, >= 0
  DampedRoots(const Eigen::MatrixXd& M, const std::vector<Eigen::Index>& free,
              const Eigen::VectorXd& d);
  ~DampedRoots();

  /// @param g  n
  /// @return n, zero of what does not move; nothing where the matrix is not positive definite, or so
  ///   close to singular that directions without information have to be looked for
  std::optional<Eigen::VectorXd> solve(const Eigen::VectorXd& g, double lambda);

 private:
  struct System;
  std::unique_ptr<System> system_;
};

}  // namespace identikal
