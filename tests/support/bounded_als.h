// Small random problems of autocovariance least squares with bounds, and whether tune_als() answers
// each with the least misfit that the bounds allow.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <gtest/gtest.h>

#include "identify/noise/als.h"
#include "lib/base/error.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/autocovariance.h"
#include "tests/support/random_model.h"
#include "tests/support/scalar_case.h"

namespace identikal {

/// Sample autocovariances as tune_als() takes them: x(0) from the first innovations, which are then
/// dropped until an initial error has fallen to a thousandth.
inline Autocovariances samples_of(const StateSpace& m, const Eigen::MatrixXd& L,
                                  const Eigen::MatrixXd& y, Eigen::Index lags) {
  using Eigen::Index;
  using Eigen::MatrixXd;
  using Eigen::VectorXd;
  const Index n = m.states(), ny = m.outputs();
  const MatrixXd F = m.A - L * m.C, none(0, y.cols());
  Index first = 0;
  MatrixXd power = MatrixXd::Identity(n, n);
  for (; power.norm() > 1e-3; ++first) power = (F * power).eval();
  const Index window = first + n;
  const MatrixXd e = constant_gain_innovations(m, L, VectorXd::Zero(n), y, none);
  MatrixXd response(window * ny, n);
  power.setIdentity();
  for (Index t = 0; t < window; ++t) {
    response.middleRows(t * ny, ny) = m.C * power;
    power = (F * power).eval();
  }
  const VectorXd x0 = response.colPivHouseholderQr().solve(VectorXd(e.leftCols(window).reshaped()));
  return sample_autocovariances(
             constant_gain_innovations(m, L, x0, y, none).rightCols(y.cols() - first), lags)
      .value;
}

/// One or two states, the first of them or both measured; every variance a named parameter with
/// bounds, and the truth on either side of them. Half of them are in continuous time, with
/// densities.
inline Model random_bounded_model(Random& random) {
  using Eigen::Index;
  using Eigen::MatrixXd;
  Model model;
  model.name = "bounded";
  LinearModel& m = as_linear(model);
  const Index n = random.uniform() < 0.4 ? 1 : 2, ny = random.uniform() < 0.6 ? 1 : n;
  m.continuous = random.uniform() < 0.5;
  m.noise = m.continuous ? ProcessNoise::density : ProcessNoise::per_sample;
  MatrixXd A = random_matrix(random, n, n);
  A *= 0.9 / A.eigenvalues().cwiseAbs().maxCoeff();
  m.A.constant = m.continuous ? MatrixXd(A - 1.2 * MatrixXd::Identity(n, n)) : A;
  m.B.constant.resize(n, 0);
  m.C.constant = MatrixXd::Identity(n, n).topRows(ny);
  m.D.constant.resize(ny, 0);
  m.G.constant = MatrixXd::Identity(n, n);
  m.Q.constant = MatrixXd::Zero(n, n);
  m.R.constant = MatrixXd::Zero(ny, ny);
  m.S.constant = MatrixXd::Zero(n, ny);
  for (Index i = 0; i < n + ny; ++i) {
    Parameter p;
    p.name = "p" + std::to_string(i);
    const double decade = std::pow(10.0, 2.0 * random.uniform() - 1.0);
    p.value = MatrixXd::Constant(1, 1, decade);
    p.min = random.uniform() < 0.6 ? 0.0 : 0.5 * decade;
    if (random.uniform() < 0.3) p.max = 2.0 * decade;
    model.parameters.push_back(p);
    const auto at = static_cast<int>(i < n ? i : i - n);
    (i < n ? m.Q : m.R).entries.push_back({at, at, static_cast<int>(i), 1.0});
  }
  return model;
}

/// Outputs of a model without inputs, from rest.
inline Eigen::MatrixXd outputs_from_rest(const StateSpace& m, Random& random,
                                         Eigen::Index samples) {
  const Eigen::MatrixXd root = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(m.Q).operatorSqrt();
  Eigen::VectorXd x = Eigen::VectorXd::Zero(m.states());
  Eigen::MatrixXd y(m.outputs(), samples);
  for (Eigen::Index t = 0; t < samples; ++t) {
    y.col(t) = m.C * x + m.R.diagonal().cwiseSqrt().cwiseProduct(random.normal(m.outputs()));
    x = m.A * x + m.G * (root * random.normal(m.Q.rows()));
  }
  return y;
}

/// Variances of the truth: a factor of up to ten either way of the start, or none at all.
inline Eigen::MatrixXd bounded_recording(const Model& model, Random& random, Eigen::Index samples) {
  ParameterSet truth = model.parameters;
  for (Parameter& p : truth) {
    p.value *= random.uniform() < 0.3 ? 0.0 : std::pow(10.0, 2.0 * random.uniform() - 1.0);
  }
  const Eigen::MatrixXd y =
      outputs_from_rest(instantiate(as_linear(model), truth), random, samples);
  // What never moves is no recording.
  if (y.rowwise().squaredNorm().minCoeff() > 0.0) return y;
  return outputs_from_rest(instantiate(as_linear(model), model.parameters), random, samples);
}

struct BoundedAls {
  int solved = 0, outside = 0, at_bound = 0, not_converged = 0, refused = 0;
  std::string why;     ///< of those that did not converge
  double worst = 0.0;  ///< of the optimality conditions, in units of the samples' size
};

/// Karush's, Kuhn's and Tucker's conditions of a box: a step down the gradient, taken back into the
/// box, leads nowhere. The gradient is that of the least squares, from their definition.
inline BoundedAls judge_bounded_als(int problems, std::uint64_t seed) {
  using Eigen::Index;
  using Eigen::VectorXd;
  constexpr Index kLags = 6, kSamples = 150;
  BoundedAls out;
  for (int i = 0; i < problems; ++i) {
    Random random(seed + static_cast<std::uint64_t>(i));
    const Model model = random_bounded_model(random);
    const LinearModel& linear = as_linear(model);
    const Eigen::MatrixXd y = bounded_recording(model, random, kSamples);
    NoiseEstimate estimate;
    try {
      estimate = tune_als(model, {dataset_of(y)}, {.weighted = false, .lags = kLags});
    } catch (const InputError&) {  // no noise in any output: there is no filter to report
      ++out.refused;
      continue;
    }
    if (estimate.status == Status::not_converged) {
      ++out.not_converged;
      out.why += std::to_string(i) + ": " + estimate.message + "; ";
      continue;
    }
    const StateSpace start = instantiate(linear, model.parameters);
    const Eigen::MatrixXd L = steady_state(start)->K;
    const VectorXd target = stacked(samples_of(start, L, y, kLags));
    const auto k = static_cast<Index>(model.parameters.size());
    Eigen::MatrixXd design(target.size(), k);
    VectorXd theta(k);
    for (Index e = 0; e < k; ++e) {
      StateSpace noise = instantiate(linear, with_entries(model.parameters, VectorXd::Unit(k, e)));
      design.col(e) = stacked(innovation_autocovariances(noise, L, kLags));
      theta[e] = estimate.parameters[static_cast<std::size_t>(e)].value;
    }
    const VectorXd gradient = design.transpose() * (design * theta - target);
    for (Index e = 0; e < k; ++e) {
      const Parameter& p = model.parameters[static_cast<std::size_t>(e)];
      out.outside += theta[e] < p.min || theta[e] > p.max;
      out.at_bound += theta[e] == p.min || theta[e] == p.max;
      const double curvature = design.col(e).squaredNorm();
      const double there = std::clamp(theta[e] - gradient[e] / curvature, p.min, p.max);
      out.worst =
          std::max(out.worst, std::abs(there - theta[e]) * std::sqrt(curvature) / target.norm());
    }
    ++out.solved;
  }
  return out;
}

}  // namespace identikal
