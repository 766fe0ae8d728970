#include "lib/filter/internal/diffuse_start.h"

#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// The least share at which delta is folded in while samples are still to come, and at which it may
// be forgotten.
constexpr double kWellDetermined = 1e-6;

MatrixXd scaled(const MatrixXd& information, const VectorXd& scale) {
  const auto sd = scale.cwiseSqrt().asDiagonal();
  return sd * information * sd;
}

double least_eigenvalue(const MatrixXd& M) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff();
}

// Is determined_share() less? Pivots are no smaller than the least eigenvalue, whose inverse is no
// larger than the trace of M's: nearly always that decides, in a tenth of the time. A NaN is no less.
bool is_less_determined(const MatrixXd& information, const VectorXd& scale, double least) {
  const MatrixXd M = scaled(information, scale);
  if (M.diagonal().minCoeff() < least) return true;
  if (M.rows() == 1) return false;
  const Eigen::LLT<MatrixXd> llt(M);
  if (llt.info() == Eigen::Success) {
    const double pivot = llt.matrixLLT().diagonal().minCoeff();
    if (pivot * pivot < least) return true;
    const MatrixXd inverse = llt.matrixL().solve(MatrixXd::Identity(M.rows(), M.cols()));
    if (inverse.squaredNorm() * least <= 1.0) return false;
  }
  return least_eigenvalue(M) < least;
}

}  // namespace

double determined_share(const MatrixXd& information, const VectorXd& scale) {
  return least_eigenvalue(scaled(information, scale));
}

VectorXd proper_scale(const StateSpace& model) {
  const auto outputs = static_cast<double>(model.outputs());
  const MatrixXd W = model.G * model.Q * model.G.transpose();
  VectorXd seen = VectorXd::Zero(model.states());
  MatrixXd response = model.C;
  double power = model.R.trace() / outputs;
  for (Index t = 0; t < model.states(); ++t) {
    seen += response.colwise().squaredNorm().transpose() / outputs;
    power += (response * W).cwiseProduct(response).sum() / outputs;
    if (t + 1 < model.states()) response = (response * model.A).eval();
  }
  return seen.unaryExpr([power](double gain) {
    const double scale = power / gain;
    return scale > 0.0 && std::isfinite(scale) ? scale : 1.0;
  });
}

std::optional<ProperStart> proper_start(const StateSpace& model, InitialState initial) {
  const Index n = model.states();
  const bool all = initial == InitialState::diffuse;
  if (!all && model.P0.hasNaN()) return std::nullopt;
  std::vector<Index> states;  // of delta
  for (Index i = 0; i < n; ++i) {
    if (all || std::isinf(model.P0(i, i))) states.push_back(i);
  }
  const auto d = static_cast<Index>(states.size());
  ProperStart out;
  const VectorXd scale = proper_scale(model);
  out.scale = scale(states);
  out.P = all ? MatrixXd::Zero(n, n) : model.P0;
  out.Z = MatrixXd::Zero(n, 1 + d);
  if (!all) out.Z.col(0) = model.x0;
  for (Index c = 0; c < d; ++c) {
    const Index state = states[static_cast<std::size_t>(c)];
    out.P(state, state) = scale[state];
    out.Z(state, 1 + c) = 1.0;
  }
  return out;
}

DiffuseStart::DiffuseStart(const VectorXd& scale_of_states, std::size_t parameters) {
  begin(scale_of_states, parameters);
}

void DiffuseStart::begin(const VectorXd& scale_of_states, std::size_t parameters) {
  scale = scale_of_states;
  const auto clear = [d = states()](MatrixXd& of_information, VectorXd& of_score) {
    of_information.setZero(d, d);
    of_score.setZero(d);
  };
  clear(information, score);
  by.resize(parameters);
  for (Derivative& each : by) clear(each.information, each.score);
}

void DiffuseStart::add(const MatrixXd& E, const MatrixXd& SiE) {
  const Index d = states();
  information.noalias() += E.rightCols(d).transpose() * SiE.rightCols(d);
  score.noalias() += E.rightCols(d).transpose() * SiE.col(0);
}

void DiffuseStart::add_derivative(std::size_t i, const Sensitivity& s, const MatrixXd& SiE) {
  const Index d = states();
  const MatrixXd dS_SiE = s.Sigma * SiE;
  const MatrixXd half = s.E.rightCols(d).transpose() * SiE.rightCols(d);
  by[i].information += half + half.transpose() - SiE.rightCols(d).transpose() * dS_SiE.rightCols(d);
  by[i].score += s.E.rightCols(d).transpose() * SiE.col(0) +
                 SiE.rightCols(d).transpose() * (s.E.col(0) - dS_SiE.col(0));
}

bool DiffuseStart::is_determined(bool last) const {
  // The filter's end says what became of a NaN.
  return !is_less_determined(information, scale, last ? kDetermined : kWellDetermined);
}

bool DiffuseStart::is_forgotten(const MatrixXd& P, const MatrixXd& Z) const {
  // Variances at delta's scale; what is known of it below is no worse than a million times that.
  const MatrixXd moved = Z.rightCols(states()).cwiseAbs2() * scale.asDiagonal();
  return (moved.rowwise().maxCoeff().array() <= 1e-46 * P.diagonal().array()).all() &&
         determined_share(information, scale) >= kWellDetermined;
}

bool DiffuseStart::fold_in(MatrixXd& P, MatrixXd& Z, std::vector<Sensitivity>& sensitivities,
                           Likelihood& out) const {
  const Index d = states();
  const Eigen::LLT<MatrixXd> llt(information);
  if (llt.info() != Eigen::Success) return false;
  const VectorXd delta = -llt.solve(score);
  MatrixXd inverse = MatrixXd::Identity(d, d);
  llt.solveInPlace(inverse);
  out.value += -llt.matrixLLT().diagonal().array().log().sum() - 0.5 * score.dot(delta);
  const auto X = Z.rightCols(d);
  const MatrixXd XI = X * inverse;
  MatrixXd half, moved;
  VectorXd turned, ddelta;
  for (std::size_t i = 0; i < sensitivities.size(); ++i) {
    Sensitivity& s = sensitivities[i];
    const Derivative& of = by[i];
    turned.noalias() = of.information * delta;
    out.gradient[i] += -0.5 * inverse.cwiseProduct(of.information).sum() - of.score.dot(delta) -
                       0.5 * delta.dot(turned);
    ddelta = -(of.score + turned);
    llt.solveInPlace(ddelta);
    const auto dX = s.Z.rightCols(d);
    half.noalias() = dX * XI.transpose();
    moved.noalias() = XI * of.information;
    s.P += half + half.transpose();
    s.P.noalias() -= moved * XI.transpose();
    s.Z.col(0).noalias() += dX * delta;
    s.Z.col(0).noalias() += X * ddelta;
    s.Z.conservativeResize(Eigen::NoChange, 1);
  }
  P.noalias() += XI * X.transpose();
  Z.col(0).noalias() += X * delta;
  Z.conservativeResize(Eigen::NoChange, 1);
  return true;
}

}  // namespace identikal
