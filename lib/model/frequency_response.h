// How does a discrete-time system pass on a sine?
#pragma once

#include <Eigen/Core>

namespace identikal {

/// (e^(i omega) I - A)^-1 B: what a sine through each column of B makes of the states of
/// x(t+1) = A x + B u.
///
/// Example:
///
///     const Eigen::MatrixXcd gain =
///         model.C.cast<std::complex<double>>() * state_response(model.A, 0.1, model.B);
///
/// @param A      n x n
/// @param omega  [rad] per sample
/// @param B      n x m
/// @return n x m; infinite or NaN where A has the eigenvalue e^(i omega)
/// @throws std::invalid_argument when the sizes of A and B disagree
Eigen::MatrixXcd state_response(const Eigen::MatrixXd& A, double omega, const Eigen::MatrixXd& B);

}  // namespace identikal
