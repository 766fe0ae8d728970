// The smallest estimation problem there is: x+ = a x + w, y = x + v, with the variances q and r
// unknown.
#pragma once

#include <cmath>
#include <string>

#include <Eigen/Core>

#include "identify/model/model_file.h"
#include "lib/base/random.h"
#include "lib/data/dataset.h"

namespace identikal {

inline Dataset dataset_of(const Eigen::MatrixXd& y) {
  Dataset data;
  data.name = "simulated";
  data.dt = 1.0;
  data.y = y;
  data.u.resize(0, y.cols());
  data.time = Eigen::VectorXd::LinSpaced(y.cols(), 0.0, static_cast<double>(y.cols() - 1));
  for (Eigen::Index i = 0; i < y.rows(); ++i)
    data.outputs.push_back({"y" + std::to_string(i + 1), ""});
  return data;
}

// A scalar model x+ = a x + w, y = x + v with Q and R free.
inline Model scalar_model(double a, double q, double r) {
  Model model;
  model.name = "scalar";
  Parameter parameter;
  parameter.min = 0.0;
  parameter.name = "q";
  parameter.value = Eigen::MatrixXd::Constant(1, 1, q);
  model.parameters.push_back(parameter);
  parameter.name = "r";
  parameter.value = Eigen::MatrixXd::Constant(1, 1, r);
  model.parameters.push_back(parameter);
  LinearModel& linear = as_linear(model);
  linear.A.constant = Eigen::MatrixXd::Constant(1, 1, a);
  linear.B.constant.resize(1, 0);
  linear.C.constant = linear.G.constant = Eigen::MatrixXd::Identity(1, 1);
  linear.D.constant.resize(1, 0);
  linear.S.constant = linear.Q.constant = linear.R.constant = Eigen::MatrixXd::Zero(1, 1);
  linear.Q.entries = {{0, 0, 0, 1.0}};
  linear.R.entries = {{0, 0, 1, 1.0}};
  return model;
}

inline Eigen::MatrixXd simulate_scalar(double a, double q, double r, int N, std::uint64_t seed) {
  Random random(seed);
  Eigen::MatrixXd y(1, N);
  double x = std::sqrt(q / (1.0 - a * a)) * random.normal();
  for (int t = 0; t < N; ++t) {
    y(0, t) = x + std::sqrt(r) * random.normal();
    x = a * x + std::sqrt(q) * random.normal();
  }
  return y;
}

}  // namespace identikal
