#include "lib/nonlinear/simulation.h"

#include <stdexcept>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

NonlinearRealisation simulate_nonlinear_outputs(const NonlinearModel& model,
                                                const Eigen::Ref<const VectorXd>& p,
                                                const FilterNoise& noise, ProcessNoise kind,
                                                const InputNodes& inputs, Random& random,
                                                const NonlinearModel* scales) {
  const Index nx = model.states, ny = model.outputs, N = inputs.time.size();
  if (noise.Q.rows() != nx || noise.R.rows() != ny || noise.x0.size() != nx ||
      noise.P0.rows() != nx || inputs.u.rows() != model.inputs || p.size() != model.parameters) {
    throw std::invalid_argument(
        "simulate_nonlinear_outputs: noise, inputs or p do not fit the model");
  }
  ModelMemory memory = make_memory(model);
  set_parameters(model, memory, p);
  ModelMemory of_scales;
  if (scales != nullptr) {
    of_scales = make_memory(*scales);
    set_parameters(*scales, of_scales, p);
  }
  VectorXd scale = VectorXd::Ones(ny);
  const MatrixXd measurement = semidefinite_factor(noise.R);
  const bool density = kind == ProcessNoise::density && !noise.Q.isZero(0.0);
  const MatrixXd process = density ? MatrixXd() : semidefinite_factor(noise.Q);
  Gramians gramians;
  gramians.densities = noise.Q.reshaped();
  NonlinearRealisation out;
  out.x.resize(nx, N);
  out.y.resize(ny, N);
  VectorXd x = noise.x0 + semidefinite_factor(noise.P0) * random.normal(nx), y(ny);
  Jacobian jacobian;
  for (Index k = 0; k < N; ++k) {
    out.x.col(k) = x;
    observe(model, memory, x, inputs.at_sample.col(k), inputs.time[k], y, jacobian);
    if (scales != nullptr) {
      observe(*scales, of_scales, x, inputs.at_sample.col(k), inputs.time[k], scale);
    }
    out.y.col(k) = y + scale.cwiseProduct(measurement * random.normal(ny));
    if (k + 1 == N) break;
    if (density) {
      step(model, memory, inputs, k, x, jacobian, Derivatives::first, &gramians);
      const MatrixXd W = gramians.values.reshaped(nx, nx);
      if (!W.allFinite()) {
        x.setConstant(W.sum());
        continue;
      }
      x += semidefinite_factor(W) * random.normal(nx);
    } else {
      step(model, memory, inputs, k, x);
      x += process * random.normal(nx);
    }
  }
  return out;
}

}  // namespace identikal
