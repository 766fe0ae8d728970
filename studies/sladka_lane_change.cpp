#include "studies/sladka_lane_change.h"

#include "lib/vehicle/motion.h"
#include "lib/vehicle/sladka2010_car.h"
#include "lib/vehicle/trajectory.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

TrueDrive true_drive(const SevereLaneChange& manoeuvre, double from_speed, double to_speed) {
  const SingleTrack<> car = linear_car(sladka2010_car());
  constexpr int kFine = 100;  // steps of the true car between two samples
  const Index fine = (kSladka2010Samples - 1) * kFine + 1;
  const VectorXd time = VectorXd::LinSpaced(fine, 0.0, kSladka2010Step * (kSladka2010Samples - 1));
  const VectorXd angle = steering(manoeuvre, time);
  const VectorXd vx = VectorXd::LinSpaced(fine, from_speed, to_speed);
  MatrixXd states(2, fine);
  simulate(car, drive(time, angle, vx, {decay_rate_times_speed(car)}), 0.0, 0.0,
           [&](Index t, const Motion& motion, double) { states.col(t) << motion.vy, motion.r; });
  const auto samples = Eigen::seqN(0, kSladka2010Samples, kFine);
  TrueDrive out;
  out.time = time(samples);
  out.steering = angle(samples);
  out.vx = vx(samples);
  out.states = states(Eigen::all, samples);
  out.track = track(time, vx, states.row(0), states.row(1))(Eigen::all, samples);
  return out;
}

Model sladka2010_model(const std::vector<std::string>& outputs) {
  const VehicleParameters<double> car = sladka2010_car();
  const auto parameter = [](const char* name, const char* unit, double value) {
    Parameter p;
    p.name = name;
    p.unit = unit;
    p.value = MatrixXd::Constant(1, 1, value);
    p.fixed = true;
    return p;
  };
  const auto unknown = [&](const char* name, const char* unit, double start, double min,
                           double max) {
    Parameter p = parameter(name, unit, start);
    p.fixed = false;
    p.min = min;
    p.max = max;
    return p;
  };
  Model model;
  model.source = "car.yaml";
  model.name = "lane change";
  model.form = VehicleModel();
  model.parameters = {parameter("m", "kg", car[kMass]),
                      parameter("a", "m", car[kA]),
                      parameter("b", "m", car[kB]),
                      parameter("steering_ratio", "", car[kSteeringRatio]),
                      unknown("Iz", "kg m^2", car[kYawInertia], 800.0, 6000.0),
                      unknown("Cf", "N/rad", 8e4, 1e4, 4e5),
                      unknown("Cr", "N/rad", 8e4, 1e4, 4e5)};
  model.inputs.resize(2);
  model.inputs[0].name = "steering_wheel_angle";
  model.inputs[1].name = "vx";
  for (const std::string& name : outputs) {
    ChannelSource source;
    source.name = name;
    model.outputs.push_back(source);
  }
  return model;
}

}  // namespace identikal
