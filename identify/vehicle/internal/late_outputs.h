// What do sensors that filter, or are late, show along a segment?
#pragma once

#include <Eigen/Core>

#include "identify/vehicle/output_error.h"

namespace identikal {

/// Writes the errors of one segment's residuals, simulated minus measured, and their rows of the
/// Jacobian. The sensors are read at every integration step, filtered, then read again as much later
/// as they are late.
/// @param driven    segment s with its steering in place
/// @param residual  first residual of the segment; moves to the first of the next
/// @param J         by the coordinates; null: none
void late_segment_errors(const VehicleProblem& problem, const SingleTrack<>& car,
                         const DrivenSegment& driven, const Eigen::VectorXd& z, std::size_t s,
                         std::size_t& residual, Eigen::VectorXd& e, LeastSquares::RowMatrix* J);

}  // namespace identikal
