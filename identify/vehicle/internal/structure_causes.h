// What may be behind a recording beside the model, and how much of it do cars and test equipment
// have?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/output_error.h"
#include "lib/vehicle/secondary_effects.h"

namespace identikal {

/// An unknown of the study: a free parameter of the model, one that it takes as known, or an effect
/// that it does not have.
struct StudyUnknown {
  enum class Kind { free, known, effect } kind;
  int index;    ///< VehicleParameter, or SecondaryEffect
  double step;  ///< for differences
  double lower, upper;
  double mean = 0.0, sd = kInfinity;  ///< of the prior
  std::string unit, separated_by;
  bool heavy_tails = false;  ///< the prior is Student's t with sd as its scale
};

/// Where the search is.
struct StudyPoint {
  VehicleParameters<double> p;
  SecondaryEffects effects{};
  Eigen::VectorXd states;  ///< (vy, r) at the begin of every segment, over kStateScale
};

double& entry(StudyPoint& point, const StudyUnknown& unknown);
double entry(const StudyPoint& point, const StudyUnknown& unknown);
std::string name_of(const StudyUnknown& unknown);

/// What the model frees, in its order, then the causes. Their priors are those of passenger cars to
/// trucks on public roads and of common test equipment: two thirds of them within one standard
/// deviation.
///   @param p  the car as the model fits it
std::vector<StudyUnknown> study_unknowns(const VehicleProblem& problem,
                                         const VehicleParameters<double>& p);

/// The largest angle of the road wheels [rad], where it is no small one: nothing up to 0.1, where
/// sine, tangent and cosine are off by up to 0.5 %; then the study has kWideAngles.
std::optional<double> wide_angle(const VehicleProblem& problem, const VehicleParameters<double>& p);

/// The filter that the study allows a sensor.
SecondaryEffect filter_of(VehicleQuantity quantity);

}  // namespace identikal
