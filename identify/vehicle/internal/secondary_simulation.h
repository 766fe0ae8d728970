// What would the sensors say of a car with secondary effects?
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "identify/vehicle/internal/structure_causes.h"
#include "lib/vehicle/late_sensor.h"
#include "lib/vehicle/motion.h"

namespace identikal {

/// Whether it is a sensor's, so that the car moves the same whatever it is.
bool is_of_sensor(const StudyUnknown& unknown);

/// The problem's run, simulated with secondary effects. A point where the car moves as at the point
/// before is not simulated again.
class SecondarySimulation {
 public:
  /// @param delay  of the steering, most likely
  SecondarySimulation(const VehicleProblem& problem, double delay);

  /// Simulated minus measured, SI, as the problem's residuals.
  Eigen::VectorXd errors(const StudyPoint& point);

 private:
  struct Sample {
    Motion motion;
    double vx;
  };

  void move(const StudyPoint& point, const SingleTrack<>& car, std::size_t s);
  void show(const StudyPoint& point, const SingleTrack<>& car,
            const std::vector<VehicleReading>& sensors, std::size_t s, Eigen::Index& n,
            Eigen::VectorXd& e) const;
  void show_late(const SingleTrack<>& car, std::size_t s, const SignalRows& value,
                 Eigen::Index begin, Eigen::Index end, Eigen::VectorXd& e) const;

  const VehicleProblem& problem_;
  std::vector<DrivenSegment> driven_;
  std::optional<StudyPoint> moved_at_;
  std::vector<std::vector<Sample>> moved_;  // of the segments' rows
};

}  // namespace identikal
