// A constant-velocity tracker in eight lines: which q and r do these positions ask for?
#include <cstdio>

#include "identify/model/builder.h"
#include "identify/noise/ml.h"
#include "lib/base/random.h"

namespace {

identikal::NoiseEstimate tuned_tracker(const Eigen::VectorXd& positions, double dt) {
  using namespace identikal;
  const Model tracker = linear_model()
                            .A({{1, dt}, {0, 1}})
                            .G({{dt * dt / 2}, {dt}})
                            .C({{1, 0}})
                            .process_noise(variance("q"))
                            .measurement_noise(variance("r"))
                            .diffuse();
  return tune_ml(tracker, {recording(tracker, positions, dt)});
}

// Of a body with accelerations of variance 0.09, measured with an error of variance 0.25.
Eigen::VectorXd positions(Eigen::Index count, double dt) {
  identikal::Random random(1);
  Eigen::VectorXd out(count);
  double position = 0.0, speed = 0.0;
  for (double& measured : out) {
    measured = position + 0.5 * random.normal();
    const double acceleration = 0.3 * random.normal();
    position += dt * speed + dt * dt / 2 * acceleration;
    speed += dt * acceleration;
  }
  return out;
}

}  // namespace

int main() {
  const identikal::NoiseEstimate estimate = tuned_tracker(positions(2000, 0.1), 0.1);
  for (const identikal::EstimatedParameter& p : estimate.parameters) {
    std::printf("%s = %.4f +- %.4f\n", p.name.c_str(), p.value, p.se);
  }
  return exit_code(estimate, false);
}
