// What the recordings say of every segment's initial state, and of the rest once that is eliminated.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/output_error.h"

namespace identikal {

/// The normal equations of least squares whose unknowns are shared by all segments, but for the two
/// initial states of each: the matrix is block-arrow, and its size grows as the number of segments.
struct SegmentedEquations {
  struct Segment {
    Eigen::Matrix2d information;                     ///< of its initial states
    Eigen::Matrix<double, 2, Eigen::Dynamic> cross;  ///< with those that are shared
    Eigen::Vector2d gradient;
  };
  Eigen::MatrixXd information;  ///< of the shared unknowns
  Eigen::VectorXd gradient;
  std::vector<Segment> segments;

  explicit SegmentedEquations(const VehicleProblem& problem);
};

/// Adds factor (J' W J) and factor (J' W e), W being the squares of `root`.
/// @param J  as output_error() makes it; `e` and `root` have a row for each of its rows
void add_rows(const VehicleProblem& problem, const LeastSquares::RowMatrix& J,
              const Eigen::VectorXd& e, const Eigen::VectorXd& root, double factor,
              SegmentedEquations& to);

/// The equations of the shared unknowns, the initial states being where they are best for them
/// (Schur's complement). What nothing determines of a segment's states stays as it is.
struct EliminatedStates {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;
  Eigen::VectorXd states;     ///< -inverse gradient: their step where the shared unknowns stay
  Eigen::MatrixXd by_shared;  ///< their derivative by the shared unknowns: 2 segments x shared
  double gain = 0.0;          ///< half the decrease of the sum of squares by that step
};
EliminatedStates eliminate_states(const SegmentedEquations& equations);

/// Takes out of the columns of X what the initial states of each row's segment explain.
/// @param states  m x 2: derivatives by them
/// @param X       m x any
/// @return m x 2, an orthonormal basis of it by segments; a column is zero where a segment's states are told by fewer
Eigen::MatrixX2d project_out_states(const VehicleProblem& problem, const Eigen::MatrixX2d& states,
                                    Eigen::MatrixXd& X);

}  // namespace identikal
