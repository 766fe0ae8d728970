// Which covariances fit the normal equations best? Least squares with matrices that must be
// positive semidefinite.
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

#include "solvers/problem.h"

namespace identikal {

/// X(x) = constant + sum_k x_k B_k, symmetric size x size, every B_k given by its entries that are
/// not zero.
struct PsdBlock {
  /// X(row, col) += value * x[unknown], and the same to X(col, row) when row != col.
  struct Entry {
    Eigen::Index unknown = 0, row = 0, col = 0;
    double value = 1.0;
  };
  Eigen::Index size = 0;
  std::vector<Entry> entries;
  Eigen::MatrixXd constant = {};  ///< size x size, or empty = zero
};

/// The block whose lower triangle, column by column, is x[first], x[first + 1], ...;
/// size 1 says x[first] >= 0. It takes size (size + 1) / 2 unknowns.
PsdBlock full_block(Eigen::Index first, Eigen::Index size);

/// constant + sum_k x_k basis_k as blocks: one for each part of rows that no entry, constant or
/// unknown, connects with the others; each has to be semidefinite by itself, and parts of one
/// variance are cheaper and exact. Parts without an unknown are left out.
/// @param constant  symmetric n x n     @param basis  k symmetric n x n
std::vector<PsdBlock> independent_blocks(const Eigen::MatrixXd& constant,
                                         const std::vector<Eigen::MatrixXd>& basis);

/// x[unknown] >= lower, and x[unknown] <= upper.
PsdBlock lower_bound_block(Eigen::Index unknown, double lower);
PsdBlock upper_bound_block(Eigen::Index unknown, double upper);

/// X(x), size x size.
Eigen::MatrixXd value(const PsdBlock& block, const Eigen::VectorXd& x);

/// minimise 1/2 x' H x - g' x  with every block X_i(x) positive semidefinite.
/// With H = A' W A and g = A' W b it is weighted least squares; a linear penalty c' x (a trace)
/// makes it g = A' W b - c. A diagonal covariance is one block of size 1 per unknown; covariances
/// of correlated noises are one joint block [Q S; S' R].
struct PsdLeastSquares {
  Eigen::MatrixXd H;  ///< k x k, symmetric positive semidefinite, may be singular
  Eigen::VectorXd g;  ///< k
  std::vector<PsdBlock> blocks;
  /// Further blocks that hold by themselves more often than not, such as bounds far out: one is
  /// taken in when the minimum without it breaks it, so that its size is that of the problem.
  std::vector<PsdBlock> limits = {};
};

/// What became of one block.
struct PsdBlockSolution {
  Eigen::MatrixXd X;  ///< X_i(x), positive semidefinite
  Eigen::MatrixXd Z;  ///< its multiplier, positive semidefinite: H x - g = sum_i <B_ik, Z_i>
  double smallest_eigenvalue = 0.0;   ///< of X
  Eigen::Index zero_eigenvalues = 0;  ///< how many eigenvalues of X the constraint holds at zero
};

struct PsdSolution {
  Eigen::VectorXd x;
  SolverSummary summary;  ///< initial_objective is that of x = 0, which is 0
  /// The objective exceeds the minimum by no more than this (see minimise() for flat directions).
  double gap = std::numeric_limits<double>::quiet_NaN();
  Eigen::Index rank = 0;                 ///< of H scaled to unit diagonal; < k: flat directions
  std::vector<PsdBlockSolution> blocks;  ///< one per block, in order, then one per limit
};

/// Newton's method on the central path of the log-det barrier, primal-dual, with Nesterov and
/// Todd's scaling and Mehrotra's corrector. The primal iterates stay inside the cone: every X_i has
/// a Cholesky factor. Only what can end there without rounding is put at the boundary: an unknown
/// that a block of size 1 holds there, where all other blocks allow it, and x = 0 when nothing is
/// better.
/// When the plain least-squares solution (of least norm) is positive definite, with relative pivots
/// above 1e-10, it is returned as it is, with Z = 0.
///
/// Converged when gap <= options.function_tolerance * max(|objective|, 1e-6 max_k g_k^2 / (2
/// H_kk)). The gap is a proof: whatever Z >= 0 is, the minimum is at least
/// -1/2 (g + B*Z)' H^-1 (g + B*Z) with (B*Z)_k = sum_i <B_ik, Z_i>, and the gap is the distance to
/// that. 1e-9 is what rounding lets it reach on nearly all problems, 1e-12 on most.
/// Otherwise the best point is returned with its gap, and the termination says no_progress,
/// iteration_limit or time_limit; start_undefined, and x = 0, when no x makes all blocks positive
/// definite. Of the options, max_iterations, max_seconds and progress count besides.
///
/// Units may differ freely: unknowns are scaled to unit diagonal of H, and unknowns that the cone
/// confines to less, to that. An unknown without influence must have H_kk = 0 and g_k = 0, not
/// rounding noise, which would be scaled up.
///
/// Flat directions are eigenvectors of the scaled H with eigenvalues below 1e-13 of the largest.
/// Among equally good points the solution is a bounded one of moderate size, not the one of least
/// norm: a flat direction is given the curvature 1e-11 of the largest, and less, down to 1e-17,
/// when the solution lies so far out along it that this would move the objective. What the
/// curvature adds to the objective is part of the gap, which then bounds the excess over all
/// points whose flat part is at most sqrt(2) times as long. An objective that falls without limit
/// along a flat direction ends with no_progress.
///
/// Example:
///
///     PsdLeastSquares problem;  // the covariance nearest to [1 2; 2 1]: [1.5 1.5; 1.5 1.5]
///     problem.H = Eigen::Vector3d{1.0, 2.0, 1.0}.asDiagonal();
///     problem.g = Eigen::Vector3d{1.0, 4.0, 1.0};
///     problem.blocks = {full_block(0, 2)};
///     const Eigen::MatrixXd covariance = minimise(problem).blocks[0].X;
///
/// Sources: Boyd & Vandenberghe (2004), Convex Optimization, ch. 11; Vandenberghe (2010), The
/// CVXOPT linear and quadratic cone program solvers; for the use, Odelson, Rajamani & Rawlings
/// (2006), Automatica 42, and Rajamani & Rawlings (2009), Automatica 45.
/// @throws std::invalid_argument when shapes disagree, an entry lies outside its block, a number is
///   not finite, a constant or H is not symmetric (H to 1e-10 of sqrt(H_ii H_jj)) or not positive
///   semidefinite (a negative diagonal, or an eigenvalue below -1e-8 of the largest after scaling).
PsdSolution minimise(const PsdLeastSquares& problem,
                     const SolverOptions& options = {.function_tolerance = 1e-9, .progress = {}});

}  // namespace identikal
