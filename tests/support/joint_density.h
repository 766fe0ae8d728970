// The likelihood of a short record by brute force: the joint Gaussian density of all its samples.
#pragma once

#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "lib/model/state_space.h"

namespace identikal {

// y stacked over time is M [x1; w1; v1; w2; v2; ...] + known. Its mean, covariance, and the
// response to x1.
struct Stacked {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance, from_x1;
};
inline Stacked stack(const std::function<StateSpace(Eigen::Index)>& model_at,
                     const Eigen::MatrixXd& u, Eigen::Index N, const Eigen::VectorXd& x0,
                     const Eigen::MatrixXd& P0) {
  const StateSpace first = model_at(0);
  const Eigen::Index n = first.states(), ny = first.outputs(), nw = first.G.cols(), block = nw + ny;
  Eigen::MatrixXd noise = Eigen::MatrixXd::Zero(N * block, N * block);
  Eigen::MatrixXd from_noise = Eigen::MatrixXd::Zero(N * ny, N * block),
                  state_noise = Eigen::MatrixXd::Zero(n, N * block);
  Stacked out;
  out.mean.resize(N * ny);
  out.from_x1.resize(N * ny, n);
  Eigen::VectorXd mean = x0;
  Eigen::MatrixXd power = Eigen::MatrixXd::Identity(n, n);
  for (Eigen::Index t = 0; t < N; ++t) {
    const StateSpace m = model_at(t);
    noise.block(t * block, t * block, block, block) << m.Q, m.S, m.S.transpose(), m.R;
    out.mean.segment(t * ny, ny) = m.C * mean;
    if (m.inputs() > 0) out.mean.segment(t * ny, ny) += m.D * u.col(t);
    out.from_x1.middleRows(t * ny, ny) = m.C * power;
    from_noise.middleRows(t * ny, ny) = m.C * state_noise;
    from_noise.block(t * ny, t * block + nw, ny, ny) += Eigen::MatrixXd::Identity(ny, ny);
    state_noise = (m.A * state_noise).eval();
    state_noise.block(0, t * block, n, nw) += m.G;
    mean = (m.A * mean).eval();
    if (m.inputs() > 0) mean += m.B * u.col(t);
    power = (m.A * power).eval();
  }
  out.covariance =
      from_noise * noise * from_noise.transpose() + out.from_x1 * P0 * out.from_x1.transpose();
  return out;
}

inline Stacked stack(const StateSpace& model, const Eigen::MatrixXd& u, Eigen::Index N,
                     const Eigen::VectorXd& x0, const Eigen::MatrixXd& P0) {
  return stack([&model](Eigen::Index) { return model; }, u, N, x0, P0);
}

struct Present {
  std::vector<Eigen::Index> rows;
  Eigen::VectorXd y;
};
inline Present present(const Eigen::MatrixXd& y) {
  Present out;
  for (Eigen::Index i = 0; i < y.size(); ++i) {
    if (!std::isnan(y(i % y.rows(), i / y.rows()))) out.rows.push_back(i);
  }
  out.y.resize(static_cast<Eigen::Index>(out.rows.size()));
  for (Eigen::Index i = 0; i < out.y.size(); ++i)
    out.y[i] = y.reshaped()[out.rows[static_cast<std::size_t>(i)]];
  return out;
}

inline double joint_log_density(const Stacked& s, const Eigen::MatrixXd& y) {
  const Present p = present(y);
  const Eigen::VectorXd e = p.y - s.mean(p.rows);
  const Eigen::MatrixXd V = s.covariance(p.rows, p.rows);
  const Eigen::LLT<Eigen::MatrixXd> llt(V);
  const double log_det = 2.0 * llt.matrixLLT().diagonal().array().log().sum();
  return -0.5 * (log_det + e.dot(llt.solve(e)) +
                 static_cast<double>(e.size()) * std::log(2.0 * std::numbers::pi));
}

// log L + (n/2) log kappa for x1 ~ N(0, kappa I), kappa to infinity, in closed form.
inline double diffuse_log_density(const Stacked& s, const Eigen::MatrixXd& y) {
  const Present p = present(y);
  const Eigen::VectorXd e = p.y - s.mean(p.rows);
  const Eigen::MatrixXd V = s.covariance(p.rows, p.rows), X = s.from_x1(p.rows, Eigen::all);
  const Eigen::LLT<Eigen::MatrixXd> llt(V), info(X.transpose() * llt.solve(X));
  const Eigen::VectorXd r = e - X * info.solve(X.transpose() * llt.solve(e));
  const double log_det = 2.0 * llt.matrixLLT().diagonal().array().log().sum() +
                         2.0 * info.matrixLLT().diagonal().array().log().sum();
  return -0.5 * (log_det + r.dot(llt.solve(r)) +
                 static_cast<double>(e.size() - X.cols()) * std::log(2.0 * std::numbers::pi));
}

}  // namespace identikal
