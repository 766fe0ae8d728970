#include "lib/filter/simulation_smoother.h"

#include <vector>

#include "lib/filter/simulation.h"
#include "lib/filter/smoother.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// x+ has the start's mean in it, so that the rest starts from zero.
StateSpace without_mean(StateSpace model) {
  if (model.x0.size() > 0) model.x0.setZero();
  return model;
}

ModelAt without_mean(const ModelAt& model) {
  return [model](Index t, StateSpace& now, std::vector<StateSpace>* derivatives) {
    model(t, now, derivatives);
    if (now.x0.size() > 0) now.x0.setZero();
  };
}

template <typename Model>
SimulatedPath drawn(const Model& model, InitialState initial, const Eigen::Ref<const MatrixXd>& y,
                    const Eigen::Ref<const MatrixXd>& u, Random& random) {
  SimulatedPath out;
  MatrixXd x;
  const MatrixXd simulated = simulate_outputs(model, initial, u, y.cols(), random, &x);
  const MatrixXd rest = y - simulated, none = MatrixXd::Zero(u.rows(), u.cols());
  const SmootherResult of_rest =
      smooth(without_mean(model), initial, rest, none, SmootherKeep::deviations);
  out.status = of_rest.status;
  if (out.status == FilterStatus::ok) out.x = x + of_rest.x;
  return out;
}

}  // namespace

SimulatedPath simulate_path(const StateSpace& model, InitialState initial,
                            const Eigen::Ref<const MatrixXd>& y,
                            const Eigen::Ref<const MatrixXd>& u, Random& random) {
  return drawn(model, initial, y, u, random);
}

SimulatedPath simulate_path(const ModelAt& model, InitialState initial,
                            const Eigen::Ref<const MatrixXd>& y,
                            const Eigen::Ref<const MatrixXd>& u, Random& random) {
  return drawn(model, initial, y, u, random);
}

}  // namespace identikal
