// What may somebody have got wrong, and what would the recording look like then?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/finding.h"
#include "identify/vehicle/internal/secondary_simulation.h"
#include "identify/vehicle/internal/structure_causes.h"

namespace identikal {

/// Something that is usually right, or nearly so, and sometimes quite wrong.
struct PossibleMistake {
  std::string name, unit;
  double usual;  ///< standard deviation where nobody made a mistake
  double sd;     ///< where somebody did
  double mean = 0.0;
  double odds = 1.0 / 49.0;  ///< that somebody made it, to that nobody made any
  bool positive = false;
  bool may_be_a_car = false;                       ///< so that it may be noted, and never refused
  FindingCode code = FindingCode::sensor_differs;  ///< that says so
  std::string separated_by;
  Eigen::VectorXd by;  ///< derivative of the errors with respect to its size
};

/// Mistakes that leave a trace in the errors which no property of a car quite does: sensors that are
/// late or filtered, a sensor of vy that sits elsewhere, a speed of another scale, axle distances that
/// are exchanged, and another car (tyres, load) in the later half of the recording; none that the
/// model file frees. Not among them: a wrong ratio, which bending tyres look like, the place of ay's
/// sensor, which lags look like, and any other place of the centre of gravity, which roll looks like.
///
/// @param simulation  of the problem
/// @param at          the point where the derivatives are taken
/// @param errors      there
/// @param by_unknown  their derivatives with respect to `unknowns`
std::vector<PossibleMistake> possible_mistakes(const VehicleProblem& problem,
                                               SecondarySimulation& simulation,
                                               const StudyPoint& at,
                                               const std::vector<StudyUnknown>& unknowns,
                                               const Eigen::VectorXd& errors,
                                               const Eigen::MatrixXd& by_unknown);

}  // namespace identikal
