#include "lib/vehicle/velocity_sensors.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "lib/base/constants.h"
#include "lib/base/message.h"

namespace identikal {
namespace {

using Eigen::Index;

constexpr double kNearest = 1e-3;  // [m] between sensors that can see a turn

void check_sensors(const std::vector<VectorSensor>& sensors) {
  require_argument(sensors.size() >= 2,
                   {sensors.size(),
                    " vector sensor: two at different points are needed, one cannot tell turning "
                    "from sliding"});
  double farthest = 0.0;
  for (const VectorSensor& sensor : sensors) {
    require_argument(sensor.speed_sd > 0.0 && sensor.slip_sd > 0.0,
                     {"vector sensor at (", sensor.x, ", ", sensor.y, ") m: standard deviations ",
                      sensor.speed_sd, " m/s and ", sensor.slip_sd,
                      " rad are not positive, so that its readings cannot be weighed"});
    farthest = std::max(farthest, std::hypot(sensor.x - sensors[0].x, sensor.y - sensors[0].y));
  }
  require_argument(
      farthest >= kNearest,
      {"all ", sensors.size(), " vector sensors sit at (", sensors[0].x, ", ", sensors[0].y,
       ") m: at one point they all measure the same velocity, and the yaw rate is open"});
}

}  // namespace

CentreVelocity centre_velocity(const std::vector<VectorSensor>& sensors,
                               const Eigen::Ref<const Eigen::MatrixXd>& speed,
                               const Eigen::Ref<const Eigen::MatrixXd>& slip) {
  check_sensors(sensors);
  const auto S = static_cast<Index>(sensors.size());
  const Index N = speed.cols();
  require_argument(speed.rows() == S && slip.rows() == S && slip.cols() == N,
                   {S, " vector sensors, speeds ", speed.rows(), " x ", N, ", slip angles ",
                    slip.rows(), " x ", slip.cols()});
  CentreVelocity out;
  out.value = Eigen::Matrix3Xd::Constant(3, N, kNaN);
  out.covariance.assign(static_cast<std::size_t>(N), Eigen::Matrix3d::Constant(kNaN));
  Eigen::Matrix<double, Eigen::Dynamic, 3> H(2 * S, 3);
  Eigen::VectorXd z(2 * S);
  for (Index t = 0; t < N; ++t) {
    bool complete = true;
    for (Index s = 0; s < S; ++s) {
      const VectorSensor& sensor = sensors[s];
      const double U = speed(s, t), direction = slip(s, t) + sensor.mounting;
      complete = complete && U > 0.0 && std::isfinite(U) && std::isfinite(direction);
      // Along and across the measured direction the errors are independent: rows over their sd.
      Eigen::Matrix<double, 2, 3> equations;
      equations << 1.0, 0.0, -sensor.y, 0.0, 1.0, sensor.x;
      const Eigen::DiagonalMatrix<double, 2> weight(1.0 / sensor.speed_sd,
                                                    1.0 / (U * sensor.slip_sd));
      H.middleRows<2>(2 * s) =
          weight * (Eigen::Rotation2Dd(-direction).toRotationMatrix() * equations);
      z.segment<2>(2 * s) << U / sensor.speed_sd, 0.0;
    }
    if (!complete) continue;
    const Eigen::HouseholderQR<Eigen::Matrix<double, Eigen::Dynamic, 3>> qr(H);
    out.value.col(t) = qr.solve(z);
    const Eigen::Matrix3d R = qr.matrixQR().topRows<3>().triangularView<Eigen::Upper>();
    const Eigen::Matrix3d inverse =
        R.triangularView<Eigen::Upper>().solve(Eigen::Matrix3d::Identity());
    out.covariance[t] = inverse * inverse.transpose();
  }
  return out;
}

}  // namespace identikal
