// Which changes of a model's matrices are more than another basis of its states?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// Orthonormal directions of [vec A; vec B; vec C; vec D] beside those by which a change of basis T moves it: A by T A - A T, B
/// by T B, C by -C T. theta x (theta - n^2).
Eigen::MatrixXd directions_beside_basis_changes(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B,
                                                const Eigen::MatrixXd& C, Eigen::Index of_D);

}  // namespace identikal
