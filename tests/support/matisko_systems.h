// Systems 1, 5, 6 and 7 of Matisko (2013), chapter 6, and two others that papers on noise
// estimation use, with Q and R diagonal and free.
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/filter/steady_state.h"

namespace identikal {

struct MatiskoSystem {
  int number = 0;  ///< 0 = not one of the source's
  Eigen::Index samples;
  Model model;            ///< every variance starts at 1
  Eigen::VectorXd truth;  ///< diagonal of Q, then of R
};

/// What follows from A, G, C and the variances.
inline void complete(MatiskoSystem& system, const Eigen::VectorXd& q, const Eigen::VectorXd& r) {
  LinearModel& m = as_linear(system.model);
  const Eigen::Index n = m.A.constant.rows(), ny = m.C.constant.rows();
  m.B.constant.resize(n, 0);
  m.D.constant.resize(ny, 0);
  m.S.constant = Eigen::MatrixXd::Zero(q.size(), ny);
  for (const auto& [name, size] : {std::pair{"Q", q.size()}, std::pair{"R", ny}}) {
    Parameter block;
    block.name = name;
    block.domain = Domain::diagonal;
    block.value = Eigen::MatrixXd::Identity(size, size);
    system.model.parameters.push_back(block);
  }
  m.Q.block = 0;
  m.R.block = 1;
  m.initial = InitialState::stationary;
  system.truth.resize(q.size() + r.size());
  system.truth << q, r;
}

inline MatiskoSystem matisko_system(int number) {
  using Eigen::MatrixXd;
  MatiskoSystem out;
  out.number = number;
  LinearModel& m = as_linear(out.model);
  out.model.name = "System " + std::to_string(number);
  Eigen::VectorXd q, r;
  const MatrixXd four =
      (MatrixXd(4, 4) << 0.9, 0, 1, 1, 0, -0.8, 0, -1, 0, -0.1, 0.85, 1, -0.2, 0, 0, -0.9)
          .finished();
  if (number == 1) {
    out.samples = 1000;
    m.A.constant = MatrixXd::Constant(1, 1, 0.5);
    m.G.constant = m.C.constant = MatrixXd::Identity(1, 1);
    q = Eigen::VectorXd::Constant(1, 10.0);
    r = Eigen::VectorXd::Constant(1, 1.0);
  } else if (number == 5) {
    out.samples = 2000;
    m.A.constant = four;
    m.G.constant = Eigen::Vector4d(0.1, 1, 10, 0.1);
    m.C.constant = Eigen::RowVector4d(1, 0, 0, 1);
    q = Eigen::VectorXd::Constant(1, 10.0);
    r = Eigen::VectorXd::Constant(1, 1.0);
  } else if (number == 6) {
    out.samples = 3000;
    m.A.constant = (MatrixXd(2, 2) << 0.8, 1, 0, -0.9).finished();
    m.G.constant = m.C.constant = MatrixXd::Identity(2, 2);
    q = Eigen::Vector2d(10, 5);
    r = Eigen::Vector2d(1.5, 3);
  } else {
    out.samples = 3000;
    m.A.constant = four;
    m.G.constant = (MatrixXd(4, 3) << 0, 0, 0.1, 1, 0, 0, 0, 1, 0, 0, 0, 1).finished();
    m.C.constant = (MatrixXd(2, 4) << 1, 0, 0, 1, 0, 1, 1, 0).finished();
    q = Eigen::Vector3d(10, 3, 7);
    r = Eigen::Vector2d(1.5, 3);
  }
  complete(out, q, r);
  return out;
}

/// The adaptive filter of section 3.4, example 2.
inline MatiskoSystem matisko_adaptive() {
  MatiskoSystem out;
  LinearModel& m = as_linear(out.model);
  out.model.name = "adaptive";
  out.samples = 2000;
  m.A.constant =
      (Eigen::MatrixXd(4, 4) << 0.85, 1, 0, 0, 0, -0.6, 1, 0, -0.2, 0, 0.8, -1, 0, 0, 0, 0.9)
          .finished();
  m.G.constant = Eigen::MatrixXd::Identity(4, 4);
  m.C.constant = Eigen::RowVector4d(1, 0.8, -1, 0);
  complete(out, Eigen::Vector4d(10, 3, 4, 2), Eigen::VectorXd::Ones(1));
  out.model.parameters[0].value *= 0.01;
  out.model.parameters[1].value *= 100.0;
  return out;
}

/// A double integrator, position measured: Zhang et al. (2020), IEEE Access 8, case 1.
inline MatiskoSystem zhang_kinematic() {
  MatiskoSystem out;
  LinearModel& m = as_linear(out.model);
  out.model.name = "kinematic";
  out.samples = 1000;
  m.A.constant = (Eigen::MatrixXd(2, 2) << 1, 0.1, 0, 1).finished();
  m.G.constant = Eigen::Vector2d(0.005, 0.1);
  m.C.constant = Eigen::RowVector2d(1, 0);
  complete(out, Eigen::VectorXd::Constant(1, 0.0025), Eigen::VectorXd::Constant(1, 0.01));
  for (Parameter& p : out.model.parameters) p.value.setConstant(0.1);  // as published
  m.initial = InitialState::diffuse;
  return out;
}

/// An inertial navigation system: Mehra (1970), IEEE Trans. Automatic Control 15.
inline MatiskoSystem mehra_inertial() {
  MatiskoSystem out;
  LinearModel& m = as_linear(out.model);
  out.model.name = "inertial";
  out.samples = 10000;
  m.A.constant = (Eigen::MatrixXd(5, 5) << 0.75, -1.74, -0.3, 0, -0.15, 0.09, 0.91, -0.0015, 0,
                  -0.008, 0, 0, 0.95, 0, 0, 0, 0, 0, 0.55, 0, 0, 0, 0, 0, 0.905)
                     .finished();
  m.G.constant = Eigen::MatrixXd::Zero(5, 3);
  m.G.constant(2, 0) = 24.64;
  m.G.constant(3, 1) = 0.835;
  m.G.constant(4, 2) = 1.83;
  m.C.constant = (Eigen::MatrixXd(2, 5) << 1, 0, 0, 0, 1, 0, 1, 0, 1, 0).finished();
  complete(out, Eigen::VectorXd::Ones(3), Eigen::VectorXd::Ones(2));
  out.model.parameters[0].value.diagonal() = Eigen::Vector3d(0.25, 0.5, 0.75);
  out.model.parameters[1].value.diagonal() = Eigen::Vector2d(0.4, 0.6);
  return out;
}

/// Every process variance started at q, every measurement variance at r.
inline MatiskoSystem started_at(MatiskoSystem system, double q, double r) {
  system.model.parameters[0].value.diagonal().setConstant(q);
  system.model.parameters[1].value.diagonal().setConstant(r);
  return system;
}

/// The model at its true values.
inline StateSpace true_system(const MatiskoSystem& system) {
  return instantiate(as_linear(system.model), with_entries(system.model.parameters, system.truth));
}

/// A realisation that starts stationary, or at zero where there is no stationary state.
inline Eigen::MatrixXd simulate_matisko(const MatiskoSystem& system, Random& random) {
  const StateSpace m = true_system(system);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(m.states());
  if (as_linear(system.model).initial == InitialState::stationary) {
    const Eigen::MatrixXd P = *solve_discrete_lyapunov(m.A, m.G * m.Q * m.G.transpose());
    x = semidefinite_factor(P) * random.normal(m.states());
  }
  const Eigen::MatrixXd Lq = m.G * semidefinite_factor(m.Q), Lr = semidefinite_factor(m.R);
  Eigen::MatrixXd y(m.outputs(), system.samples);
  for (Eigen::Index t = 0; t < system.samples; ++t) {
    y.col(t) = m.C * x + Lr * random.normal(m.outputs());
    x = (m.A * x + Lq * random.normal(m.Q.rows())).eval();
  }
  return y;
}

}  // namespace identikal
