// Random numbers that are the same on every machine and library for the same seed.
#pragma once

#include <cstdint>
#include <random>

#include <Eigen/Core>

namespace identikal {

/// Mersenne Twister (its output is fixed by the C++ standard) with our own transforms, because
/// those of `<random>` differ between standard libraries.
///
/// Example:
///
///     Random random(1);
///     const Eigen::MatrixXd L = semidefinite_factor(Eigen::Matrix2d{{2.0, 0.5}, {0.5, 1.0}});
///     const Eigen::VectorXd w = L * random.normal(2);  // of that covariance
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// Uniform on (0, 1).
  double uniform();
  /// Standard normal (Marsaglia's polar method).
  double normal();
  Eigen::VectorXd normal(Eigen::Index n);

 private:
  std::mt19937_64 engine_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

/// A factor L with L L' = M for a symmetric positive semidefinite M (eigenvalues below zero by
/// rounding count as zero).
/// @throws std::invalid_argument when M has an eigenvalue below -1e-9 of its largest.
Eigen::MatrixXd semidefinite_factor(const Eigen::Ref<const Eigen::MatrixXd>& M);

}  // namespace identikal
