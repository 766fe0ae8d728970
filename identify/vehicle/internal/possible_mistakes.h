// What may somebody have got wrong, and what would the recording look like then?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/internal/structure_causes.h"

namespace identikal {

/// Something that is usually right, or nearly so, and sometimes quite wrong.
struct PossibleMistake {
  std::string name, unit;
  double usual;  ///< standard deviation where nobody made a mistake
  double sd;     ///< where somebody did
  bool positive = false, of_car = false;
  std::string separated_by;
  Eigen::VectorXd by;  ///< derivative of the errors with respect to its size
};

/// Mistakes that leave a trace in the errors which no property of a car does: sensors that are late or
/// filtered, and another car (tyres, load) in the later half of the recording; none that the model
/// file frees. What is as good as another car, such as a wrong ratio, is not among them.
///
/// @param at          the point where the derivatives are taken
/// @param errors      there
/// @param by_unknown  their derivatives with respect to `unknowns`
std::vector<PossibleMistake> possible_mistakes(const VehicleProblem& problem, const StudyPoint& at,
                                               const std::vector<StudyUnknown>& unknowns,
                                               const Eigen::VectorXd& errors,
                                               const Eigen::MatrixXd& by_unknown);

}  // namespace identikal
