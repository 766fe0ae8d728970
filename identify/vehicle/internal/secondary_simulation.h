// What would the sensors say of a car with secondary effects?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/internal/structure_causes.h"
#include "lib/vehicle/late_sensor.h"
#include "lib/vehicle/motion.h"

namespace identikal {

/// The problem's run, simulated with secondary effects.
class SecondarySimulation {
 public:
  /// @param delay  of the steering, most likely
  SecondarySimulation(const VehicleProblem& problem, double delay);

  /// Simulated minus measured, SI, as the problem's residuals.
  Eigen::VectorXd errors(const StudyPoint& point);

 private:
  void add_segment(const StudyPoint& point, const SingleTrack<>& car,
                   const std::vector<VehicleReading>& sensors, std::size_t s, Eigen::Index& n,
                   Eigen::VectorXd& e);
  void show_late(const SingleTrack<>& car, std::size_t s, const SignalRows& value,
                 Eigen::Index begin, Eigen::Index end, Eigen::VectorXd& e) const;

  const VehicleProblem& problem_;
  std::vector<DrivenSegment> driven_;
};

}  // namespace identikal
