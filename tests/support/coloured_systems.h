// Systems with coloured noise: Matisko (2013), chapter 5.
#pragma once

#include <Eigen/Core>

#include "identify/model_file.h"
#include "identify/shaped_model.h"
#include "lib/random.h"
#include "lib/realisation.h"
#include "tests/support/scalar_case.h"

namespace identikal {

/// A, g, c of one output with Q = q and R = r free, both starting at `start`.
inline ModelFile single_output_model(const Eigen::MatrixXd& A, const Eigen::VectorXd& g,
                                     const Eigen::RowVectorXd& c, InitialState initial,
                                     double start) {
  ModelFile out;
  out.name = "single output";
  LinearModel& m = out.linear;
  m.A.constant = A;
  m.B.constant.resize(A.rows(), 0);
  m.G.constant = g;
  m.C.constant = c;
  m.D.constant.resize(1, 0);
  m.S.constant = Eigen::MatrixXd::Zero(1, 1);
  for (const char* name : {"Q", "R"}) {
    Parameter p;
    p.name = name;
    p.domain = Domain::diagonal;
    p.value = Eigen::MatrixXd::Constant(1, 1, start);
    out.parameters.push_back(p);
  }
  m.Q.block = 0;
  m.R.block = 1;
  m.initial = initial;
  ChannelSource y;
  y.name = "y";
  y.column = "1";
  out.outputs.push_back(y);
  out.time.step = 1.0;
  return out;
}

/// (5.17).
inline ModelFile system_5_17() {
  return single_output_model((Eigen::MatrixXd(2, 2) << 0.9, -0.8, 0.2, 0.8).finished(),
                             Eigen::Vector2d(0.1, 0.05), Eigen::RowVector2d(4.0, 0.1),
                             InitialState::stationary, 1.0);
}

/// (5.21), with its zero at -8 moved inside the unit circle, which leaves the spectrum's shape.
inline ShapingFilter filter_5_21() {
  return {Eigen::Vector2d(-0.6, 0.84), Eigen::VectorXd::Constant(1, 0.125)};
}

/// The known part of (5.26): poles at 1 and 0.94.
inline ModelFile system_5_26() {
  return single_output_model((Eigen::MatrixXd(2, 2) << 1.94, 1.0, -0.94, 0.0).finished(),
                             Eigen::Vector2d(0.008, -0.0724), Eigen::RowVector2d(1.0, 0.0),
                             InitialState::diffuse, 0.05);
}

/// The whole of (5.26), w of variance 0.001 and e of 0.05.
inline StateSpace truth_5_26() {
  StateSpace m;
  m.A = (Eigen::MatrixXd(4, 4) << 1.979, 1, 0, 0, -0.998, 0, 0, 0, 0.008, 0, 1.94, 1, -0.0724, 0,
         -0.94, 0)
            .finished();
  m.B.resize(4, 0);
  m.C = Eigen::RowVector4d(0, 0, 1, 0);
  m.D.resize(1, 0);
  m.G = Eigen::Vector4d(0.04, 0.04, 0.0, 0.0);
  m.Q = Eigen::MatrixXd::Constant(1, 1, 0.001);
  m.R = Eigen::MatrixXd::Constant(1, 1, 0.05);
  m.S = Eigen::MatrixXd::Zero(1, 1);
  m.x0 = Eigen::VectorXd::Zero(4);
  m.P0 = Eigen::MatrixXd::Zero(4, 4);
  return m;
}

inline Dataset realised(const StateSpace& m, InitialState initial, Eigen::Index samples,
                        Random& random) {
  return dataset_of(realisation(m, initial, {}, samples, random));
}

}  // namespace identikal
