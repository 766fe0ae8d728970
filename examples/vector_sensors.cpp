// Speed and slip angle of two vector sensors to vx, vy and r at the centre of gravity.
#include <cstdio>
#include <vector>

#include "lib/data/csv.h"
#include "lib/data/dataset.h"
#include "lib/vehicle/velocity_sensors.h"

int main(int argc, char** argv) {
  using namespace identikal;
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s data/vector_sensors.csv > velocities.csv\n", argv[0]);
    return 2;
  }
  try {
    // Where the sensors sit and how well they measure: x and y [m], mounting angle [rad], standard
    // deviations of speed [m/s] and slip angle [rad]. Sladká (2010), section 8.3.
    const std::vector<VectorSensor> sensors{{2.109, -0.027, 0.0, 0.05, 0.002},
                                            {-2.760, -0.379, 0.0, 0.05, 0.002}};
    TimeSource time;
    time.column = "t";
    const std::vector<ChannelSource> channels{{"U_front", "U_front", "m/s", "", {}},
                                              {"U_rear", "U_rear", "m/s", "", {}},
                                              {"slip_front", "slip_front", "deg", "", {}},
                                              {"slip_rear", "slip_rear", "deg", "", {}}};
    const Dataset data = make_dataset(read_csv(argv[1]), time, {}, channels);
    const CentreVelocity car =
        centre_velocity(sensors, data.y.topRows<2>(), data.y.bottomRows<2>());
    std::printf("t [s],vx [m/s],vy [m/s],r [rad/s],sd_vx,sd_vy,sd_r\n");
    for (Eigen::Index t = 0; t < data.size(); ++t) {
      const Eigen::Vector3d sd = car.covariance[static_cast<std::size_t>(t)].diagonal().cwiseSqrt();
      std::printf("%g,%.4f,%.4f,%.5f,%.4f,%.4f,%.5f\n", data.time[t], car.value(0, t),
                  car.value(1, t), car.value(2, t), sd[0], sd[1], sd[2]);
    }
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
