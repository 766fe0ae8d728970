// Which rows of the recordings can the vehicle be fitted to?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/estimate.h"
#include "identify/model/model_file.h"
#include "lib/data/dataset.h"
#include "lib/vehicle/sensor.h"

namespace identikal {

/// The usable part of one or several recordings, SI. Columns of `y` and entries of the vectors
/// follow the recordings' rows, one recording after the other.
struct VehicleRun {
  struct Output {
    std::string name;
    std::string unit;  ///< of the user's channel
    VehicleSensor sensor;
    Eigen::Index channel = 0;  ///< row in Dataset::y
    double given_sd = kNone;   ///< measurement noise given in the model file
    Eigen::Index samples = 0;  ///< present in the usable rows
  };
  struct Segment {
    Eigen::Index first, rows;
  };

  std::vector<Output> outputs;  ///< those that carry information
  Eigen::VectorXd time, steering, vx;
  Eigen::VectorXd roll;               ///< of the body [rad]; empty where it is not measured
  std::vector<int> recording;         ///< 0, 1, ... of each row
  Eigen::MatrixXd y;                  ///< outputs x N; NaN where missing or not usable
  std::vector<Segment> segments;      ///< runs of usable rows, each with a separate initial state
  Eigen::Index used = 0;              ///< rows in segments
  std::vector<Eigen::Index> used_of;  ///< the same of each recording
  double step = kNone;                ///< median time between rows [s]
  double median_speed = kNone;        ///< [m/s], over the rows used
  Findings findings;
  std::vector<std::string> notes;

  /// Row of `y` that measures this quantity, or -1.
  Eigen::Index find(VehicleQuantity quantity) const;
};

/// Splits the recordings where steering, vx or a measured roll is missing, vx is below the minimum
/// speed by a tenth or for more than 0.25 s, the model's condition does not hold, a flag that it does
/// not ask is set, the car spins or, with linear tyres, is held in a slide, or time jumps by more than
/// the model's max_gap and three sampling periods; across shorter holes steering, vx and roll go
/// straight. Leaves out segments under 1 s or 8 rows and outputs that are dead. A segment never
/// reaches from one recording into the next.
///
/// Example:
///
///     const VehicleRun run = usable_run(car, recordings);
///     std::printf("%td rows in %zu segments\n", run.used, run.segments.size());
///
/// @throws InputError when a recording holds nothing usable or the steering never moves;
///   std::invalid_argument without a recording
VehicleRun usable_run(const Model& model, const std::vector<Dataset>& recordings);

}  // namespace identikal
