#include "studies/published_systems.h"

#include <stdexcept>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "lib/filter/simulation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

const MatrixXd& fourth_order() {
  static const MatrixXd A =
      (MatrixXd(4, 4) << 0.9, 0, 1, 1, 0, -0.8, 0, -1, 0, -0.1, 0.85, 1, -0.2, 0, 0, -0.9)
          .finished();
  return A;
}

}  // namespace

PublishedSystem published_system(int number) {
  const MatrixXd two = (MatrixXd(2, 2) << 0.8, 1, 0, -0.9).finished();
  switch (number) {
    case 1:
      return {MatrixXd::Constant(1, 1, 0.5), MatrixXd::Ones(1, 1), MatrixXd::Ones(1, 1)};
    case 2:
      return {two, MatrixXd::Ones(2, 1), MatrixXd::Ones(1, 2)};
    case 3:
      return {(MatrixXd(3, 3) << 0.8, 1, 0, 0, -0.9, 1, 0, 0, 0.9).finished(), MatrixXd::Ones(3, 1),
              MatrixXd::Ones(1, 3)};
    case 4:
      return {fourth_order(), MatrixXd::Ones(4, 1), MatrixXd::Ones(1, 4)};
    case 5:
      return {fourth_order(), Eigen::Vector4d(0.1, 1, 10, 0.1), Eigen::RowVector4d(1, 0, 0, 1)};
    case 6:
      return {two, MatrixXd::Identity(2, 2), MatrixXd::Identity(2, 2)};
    case 7:
      return {fourth_order(), (MatrixXd(4, 3) << 0, 0, 0.1, 1, 0, 0, 0, 1, 0, 0, 0, 1).finished(),
              (MatrixXd(2, 4) << 1, 0, 0, 1, 0, 1, 1, 0).finished()};
    default:
      throw std::invalid_argument(fmt::format("the source has no System {}", number));
  }
}

Model model_of(const PublishedSystem& system, double q0, double r0) {
  Model out;
  out.source = "study";
  LinearModel& m = as_linear(out);
  const Index n = system.A.rows(), nw = system.G.cols(), ny = system.C.rows();
  m.A.constant = system.A;
  m.G.constant = system.G;
  m.C.constant = system.C;
  m.B.constant.resize(n, 0);
  m.D.constant.resize(ny, 0);
  m.S.constant = MatrixXd::Zero(nw, ny);
  for (const auto& [name, size, value] : {std::tuple{"Q", nw, q0}, std::tuple{"R", ny, r0}}) {
    Parameter p;
    p.name = name;
    p.domain = Domain::diagonal;
    p.value = value * MatrixXd::Identity(size, size);
    out.parameters.push_back(p);
  }
  m.Q.block = 0;
  m.R.block = 1;
  m.initial = InitialState::stationary;
  for (Index i = 0; i < ny; ++i) {
    ChannelSource source;
    source.name = fmt::format("y{}", i + 1);
    out.outputs.push_back(source);
  }
  return out;
}

Model with_variances(Model model, const VectorXd& variances) {
  model.parameters = with_entries(std::move(model.parameters), variances);
  return model;
}

PublishedSystem oscillating_system() {
  return {(MatrixXd(2, 2) << 0.9, -0.8, 0.2, 0.8).finished(), Eigen::Vector2d(0.1, 0.05),
          Eigen::RowVector2d(4.0, 0.1)};
}

ShapingFilter oscillating_noise_filter() {
  return {Eigen::Vector2d(-0.6, 0.84), VectorXd::Constant(1, 0.125)};
}

StateSpace system_with_damped_sine_noise() {
  StateSpace m;
  m.A = (MatrixXd(4, 4) << 1.979, 1, 0, 0, -0.998, 0, 0, 0, 0.008, 0, 1.94, 1, -0.0724, 0, -0.94, 0)
            .finished();
  m.B.resize(4, 0);
  m.C = Eigen::RowVector4d(0, 0, 1, 0);
  m.D.resize(1, 0);
  m.G = Eigen::Vector4d(0.04, 0.04, 0, 0);
  m.Q = MatrixXd::Constant(1, 1, 0.001);
  m.R = MatrixXd::Constant(1, 1, 0.05);
  m.S = MatrixXd::Zero(1, 1);
  m.x0 = VectorXd::Zero(4);
  m.P0 = MatrixXd::Zero(4, 4);
  return m;
}

Model model_without_noise_filter() {
  Model out = model_of({(MatrixXd(2, 2) << 1.94, 1, -0.94, 0).finished(),
                        Eigen::Vector2d(0.008, -0.0724), Eigen::RowVector2d(1, 0)},
                       0.05, 0.05);
  as_linear(out).initial = InitialState::diffuse;
  return out;
}

Dataset recording(const StateSpace& system, InitialState initial, Index samples, Random& random,
                  MatrixXd* states) {
  Dataset out;
  out.name = "simulated";
  out.dt = 1.0;
  out.time = VectorXd::LinSpaced(samples, 0.0, static_cast<double>(samples - 1));
  out.y = simulate_outputs(system, initial, {}, samples, random, states);
  out.u.resize(0, samples);
  for (Index i = 0; i < out.y.rows(); ++i) out.outputs.push_back({fmt::format("y{}", i + 1), ""});
  return out;
}

Dataset recording(const Model& model, Index samples, Random& random) {
  return recording(instantiate(as_linear(model), model.parameters), as_linear(model).initial,
                   samples, random);
}

}  // namespace identikal
