#include "identify/vehicle/internal/late_outputs.h"

#include <vector>

#include "lib/base/constants.h"
#include "lib/vehicle/late_sensor.h"

namespace identikal {
namespace {

using Eigen::Index;

/// Columns of derivatives: the free parameters, then the initial state of the segment.
JacobianColumns columns_of(const VehicleProblem& problem) {
  JacobianColumns out;
  const Index k = problem.parameters();
  for (Index i = 0; i < k; ++i) out.parameter[problem.unknowns.free[i]] = i;
  out.vy = k;
  out.r = k + 1;
  out.columns = k + 2;
  return out;
}

/// What the sensors feel at every integration step, a block of rows each: value, then derivatives.
std::vector<SignalRows> felt(const VehicleProblem& problem, const SingleTrack<>& car,
                             const DrivenSegment& every_step, const Eigen::Vector2d& state,
                             const JacobianColumns* columns) {
  const std::vector<VehicleReading> sensors = readings(*problem.run, car);
  const Index width = 1 + (columns != nullptr ? columns->columns : 0);
  std::vector<SignalRows> out(sensors.size(), SignalRows::Zero(every_step.rows(), width));
  if (columns == nullptr) {
    simulate(car, every_step, state[0], state[1], [&](Index k, const Motion& motion, double vx) {
      for (std::size_t j = 0; j < sensors.size(); ++j) out[j](k, 0) = sensors[j].value(motion, vx);
    });
    return out;
  }
  Eigen::RowVectorXd slope(columns->columns);
  simulate_with_jacobian(
      car, every_step, state[0], state[1], *columns,
      [&](Index k, const Motion& motion, const MotionJacobian& jacobian, double vx) {
        for (std::size_t j = 0; j < sensors.size(); ++j) {
          sensors[j].jacobian(motion, vx, *columns, jacobian, slope);
          out[j](k, 0) = sensors[j].value(motion, vx);
          out[j].row(k).tail(slope.size()) = slope;
        }
      });
  return out;
}

/// What the sensors show at the rows of segment s.
std::vector<SignalRows> shown(const VehicleProblem& problem, const SingleTrack<>& car,
                              const DrivenSegment& driven, const Eigen::VectorXd& z, std::size_t s,
                              const JacobianColumns* columns) {
  const VehicleRun& run = *problem.run;
  const auto [first, rows] = run.segments[s];
  const Eigen::VectorXd time = run.time.segment(first, rows);
  const Eigen::VectorXd step_time = times_of_steps(driven, time);
  const Eigen::Vector2d state = z.segment<2>(problem.state_of(s)).cwiseProduct(kStateScale);
  std::vector<SignalRows> out = felt(problem, car, with_every_step(driven), state, columns);
  for (std::size_t j = 0; j < out.size(); ++j) {
    const VehicleQuantity quantity = run.outputs[j].sensor.quantity;
    const SensorFault<>& fault = car.sensors[static_cast<std::size_t>(quantity)];
    const auto column = [&](SensorProperty property) {
      if (columns == nullptr) return Index{-1};
      const Index at = columns->parameter[sensor_parameter(quantity, property)];
      return at < 0 ? at : at + 1;
    };
    filter_by_lag(step_time, fault.lag, out[j], column(SensorProperty::lag));
    out[j] = late(step_time, out[j], time, fault.delay, column(SensorProperty::delay));
  }
  return out;
}

}  // namespace

void late_segment_errors(const VehicleProblem& problem, const SingleTrack<>& car,
                         const DrivenSegment& driven, const Eigen::VectorXd& z, std::size_t s,
                         std::size_t& residual, Eigen::VectorXd& e, LeastSquares::RowMatrix* J) {
  const auto [first, rows] = problem.run->segments[s];
  const JacobianColumns columns = columns_of(problem);
  const std::vector<SignalRows> outputs =
      shown(problem, car, driven, z, s, J != nullptr ? &columns : nullptr);
  const Index k = problem.parameters();
  for (; residual < problem.row.size() && problem.row[residual] < first + rows; ++residual) {
    const auto n = static_cast<Index>(residual);
    const auto row = outputs[problem.output[residual]].row(problem.row[residual] - first);
    e[n] = row[0] - problem.sample[n];
    if (J == nullptr) continue;
    J->row(n).head(k) = row.segment(1, k).cwiseProduct(problem.unknowns.scale.transpose());
    J->row(n).tail<2>() = row.tail<2>().cwiseProduct(kStateScale.transpose());
  }
}

Eigen::MatrixXd late_outputs(const VehicleProblem& problem, const Eigen::VectorXd& z) {
  const VehicleRun& run = *problem.run;
  Eigen::MatrixXd out = Eigen::MatrixXd::Constant(run.y.rows(), run.time.size(), kNone);
  const VehicleParameters<double> p = parameters_at(problem, z);
  const std::vector<DrivenSegment> moved = moved_by_delay(problem, p);
  const std::vector<DrivenSegment>& driven = moved.empty() ? problem.driven : moved;
  const SingleTrack<> car = car_with(problem.unknowns.curve, p);
  for (std::size_t s = 0; s < driven.size(); ++s) {
    const std::vector<SignalRows> outputs = shown(problem, car, driven[s], z, s, nullptr);
    for (std::size_t j = 0; j < outputs.size(); ++j) {
      out.row(static_cast<Index>(j)).segment(run.segments[s].first, run.segments[s].rows) =
          outputs[j].col(0).transpose();
    }
  }
  return out;
}

}  // namespace identikal
