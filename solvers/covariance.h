// What does the curvature at an optimum say about errors?
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// Inverse of a symmetric positive definite matrix, computed after scaling it to unit diagonal.
///
/// Example:
///
///     const Eigen::Matrix2d information{{400.0, 30.0}, {30.0, 25.0}};
///     const std::optional<Eigen::MatrixXd> covariance = scaled_inverse(information);
///     if (covariance) std::printf("se %g\n", std::sqrt((*covariance)(0, 0)));
///
/// @return nothing when an eigenvalue of the scaled matrix is below `tolerance` times the largest:
///   rank loss is refused, not inverted.
std::optional<Eigen::MatrixXd> scaled_inverse(const Eigen::Ref<const Eigen::MatrixXd>& information,
                                              double tolerance = 1e-12);

/// The smallest and the largest eigenvalue of a positive definite matrix, without the others: for some
/// hundred unknowns and more, most of which have nothing in common, at the cost of a few solutions.
///
/// Example:
///
///     const auto ends = extreme_eigenvalues(Eigen::Matrix2d{{2.0, 1.0}, {1.0, 2.0}});
///     if (ends) std::printf("condition %g\n", (*ends)[1] / (*ends)[0]);  // 3
///
/// @param M  n x n, symmetric, of about unit diagonal
/// @return nothing when M is not positive definite
std::optional<std::array<double, 2>> extreme_eigenvalues(const Eigen::MatrixXd& M);

/// From so many unknowns on, eigenvectors of all of them take longer than most likelihoods.
inline constexpr Eigen::Index kManyUnknowns = 100;

/// Minus the Hessian of a log-likelihood, by central differences of its exact gradient.
/// @param gradient  evaluates it at x; false = undefined there
/// @param x         n
/// @param step      n, > 0
/// @param owner     n, or empty: coordinates of different owners have no second derivative in common,
///   and are moved together, one of each owner at a time; -1: of all
/// @return nothing when the gradient is undefined beside x.
std::optional<Eigen::MatrixXd> observed_information(
    const std::function<bool(const Eigen::VectorXd& x, Eigen::VectorXd& gradient)>& gradient,
    const Eigen::VectorXd& x, const Eigen::VectorXd& step,
    const std::vector<Eigen::Index>& owner = {});

/// Coordinates that are moved together: each of no owner by itself, then one of each owner.
std::vector<std::vector<Eigen::Index>> moved_together(const std::vector<Eigen::Index>& owner);

}  // namespace identikal
