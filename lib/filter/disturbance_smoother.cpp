#include "lib/filter/disturbance_smoother.h"

#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"
#include "lib/filter/internal/recursion.h"
#include "lib/filter/smoother.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What the backward recursion takes from a sample.
struct Step {
  MatrixXd F, score, information;
};

// The filter's steps, and what all of them say of a diffuse start.
struct Run {
  std::vector<Step> steps;
  VectorXd delta;
  MatrixXd delta_covariance;

  void see(const FilterStep& seen, Index N) {
    steps.push_back({seen.F, seen.score, seen.information});
    if (seen.t + 1 != N || seen.delta_information.size() == 0) return;
    const Eigen::LLT<MatrixXd> llt(seen.delta_information);
    delta = -llt.solve(seen.delta_score);
    delta_covariance = llt.solve(MatrixXd::Identity(delta.size(), delta.size()));
  }
};

VectorXd root(const VectorXd& variance) { return variance.cwiseMax(0.0).cwiseSqrt(); }

// a / b, and NaN where b is nothing beside `scale`.
VectorXd t_values(const VectorXd& a, const VectorXd& b, const VectorXd& scale) {
  constexpr double kNothing = 1e-7;
  return (b.array() > kNothing * scale.array()).select(a.cwiseQuotient(b), kNaN);
}

// Of sample t, with the model that links it to the next one.
void set_process(const StateSpace& m, const VectorXd& r, const VectorXd& variance_scale,
                 const MatrixXd& N, Index t, DisturbanceResult& out) {
  const MatrixXd QG = m.Q * m.G.transpose();
  out.w.col(t) = QG * r;
  out.w_sd.col(t) = root((QG * N * QG.transpose()).diagonal());
  out.state_t.col(t) = t_values(r, root(N.diagonal()), root(variance_scale));
  out.state_jump.col(t) = out.state_t.col(t).cwiseQuotient(root(N.diagonal()));
}

void set_measurement(const StateSpace& m, const SmootherResult& smooth,
                     const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                     Index t, DisturbanceResult& out) {
  VectorXd v = y.col(t) - m.C * smooth.x.col(t);
  if (u.rows() > 0) v -= m.D * u.col(t);
  const MatrixXd& P = smooth.P[static_cast<std::size_t>(t)];
  const VectorXd left = m.R.diagonal() - (m.C * P * m.C.transpose()).diagonal();
  const auto missing = v.array().isNaN();
  out.v.col(t) = v;
  out.v_sd.col(t) = missing.select(kNaN, root(left));
  out.output_t.col(t) = t_values(v, out.v_sd.col(t), root(m.R.diagonal()));
}

// @param at  sets the model of a sample
DisturbanceResult smoothed(const ModelAt& at, const SmootherResult& smooth, const Run& run,
                           const Eigen::Ref<const MatrixXd>& y,
                           const Eigen::Ref<const MatrixXd>& u) {
  DisturbanceResult out;
  StateSpace m;
  at(0, m, nullptr);
  const Index N = y.cols(), n = m.states();
  out.w = out.w_sd = MatrixXd::Constant(m.G.cols(), N, kNaN);
  out.state_t = out.state_jump = MatrixXd::Constant(n, N, kNaN);
  out.v = out.v_sd = out.output_t = MatrixXd::Constant(y.rows(), N, kNaN);
  MatrixXd R = MatrixXd::Zero(n, 1), information = MatrixXd::Zero(n, n);
  for (Index t = N; t-- > 0;) {
    at(t, m, nullptr);
    if (!m.S.isZero(0.0)) throw std::invalid_argument("smooth_disturbances: S is not zero");
    set_measurement(m, smooth, y, u, t, out);
    if (t + 1 < N) {
      VectorXd r = R.col(0);
      MatrixXd variance = information;
      if (const Index d = R.cols() - 1; d > 0 && run.delta.size() == d) {
        r += R.rightCols(d) * run.delta;
        variance -= R.rightCols(d) * run.delta_covariance * R.rightCols(d).transpose();
      }
      set_process(m, r, information.diagonal(), variance, t, out);
    }
    const Step& step = run.steps[static_cast<std::size_t>(t)];
    if (step.score.cols() > R.cols()) {
      const Index had = R.cols();
      R.conservativeResize(Eigen::NoChange, step.score.cols());
      R.rightCols(step.score.cols() - had).setZero();
    }
    R = (step.F.transpose() * R).eval();
    R.leftCols(step.score.cols()) += step.score;
    information = (step.information + step.F.transpose() * information * step.F).eval();
  }
  return out;
}

}  // namespace

DisturbanceResult smooth_disturbances(const ModelAt& model, InitialState initial,
                                      const Eigen::Ref<const MatrixXd>& y,
                                      const Eigen::Ref<const MatrixXd>& u) {
  const SmootherResult path = smooth(model, initial, y, u);
  DisturbanceResult out;
  out.status = path.status;
  if (path.status != FilterStatus::ok) return out;
  Run run;
  watch_filter(model, initial, y, u, [&](const FilterStep& seen) { run.see(seen, y.cols()); });
  return smoothed(model, path, run, y, u);
}

DisturbanceResult smooth_disturbances(const StateSpace& model, InitialState initial,
                                      const Eigen::Ref<const MatrixXd>& y,
                                      const Eigen::Ref<const MatrixXd>& u) {
  const auto constant = [&model](Index t, StateSpace& now, std::vector<StateSpace>*) {
    if (t == 0 || now.A.size() == 0) now = model;
  };
  return smooth_disturbances(ModelAt(constant), initial, y, u);
}

}  // namespace identikal
