#include "lib/filter/internal/steady_run.h"

#include <cstddef>
#include <utility>

#include "lib/filter/internal/simd_kernels.h"
#include "lib/internal/powers.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double log_determinant(const Eigen::LLT<MatrixXd>& Sigma) {
  return 2.0 * Sigma.matrixLLT().diagonal().array().log().sum();
}

SteadyRun::SteadyRun(const SettledFilter& filter, const Eigen::Ref<const MatrixXd>& y,
                     const Eigen::Ref<const MatrixXd>& u, VectorXd x)
    : filter_(filter),
      y_(y),
      u_(u),
      x_(std::move(x)),
      next_(x_.size()),
      e_(y.rows()),
      z_(y.rows()) {
  stack_derivatives();
}

void SteadyRun::stack_derivatives() {
  const Index n = filter_.model.states(), ny = filter_.model.outputs(), nu = u_.rows();
  const auto k = static_cast<Index>(filter_.by.size());
  K_theta_.resize(n * k, ny);
  A_theta_.resize(n * k, n);
  B_theta_.resize(n * k, nu);
  C_theta_.resize(ny * k, n);
  D_theta_.resize(ny * k, nu);
  dX_.resize(n, k);
  for (Index i = 0; i < k; ++i) {
    const Sensitivity& s = filter_.by[i];
    K_theta_.middleRows(i * n, n) = s.K;
    A_theta_.middleRows(i * n, n) = s.A - filter_.K * s.now.C;
    B_theta_.middleRows(i * n, n) = s.B - filter_.K * s.now.D;
    C_theta_.middleRows(i * ny, ny) = s.now.C;
    D_theta_.middleRows(i * ny, ny) = s.now.D;
    dX_.col(i) = s.Z.col(0);
  }
  // Most often only noise is unknown, and these vanish.
  dynamics_ = !(A_theta_.isZero(0.0) && C_theta_.isZero(0.0));
  inputs_ = nu > 0 && !(B_theta_.isZero(0.0) && D_theta_.isZero(0.0));
  dE_.resize(ny, k);
  dX_next_.resize(n, k);
  Sie_.resize(ny);
  moved_.resize(n * k);
  seen_.resize(ny * k);
  slope_.setZero(k);
  power_.setZero(ny, ny);
  spread_.setZero(k, k);
}

Index SteadyRun::run(Index t, FilterResult* store, const VectorXd& e_sd) {
  const StateSpace& m = filter_.model;
  const Index begin = t, nu = u_.rows();
  for (; t < y_.cols() && !y_.col(t).hasNaN(); ++t) {
    e_ = y_.col(t);
    e_.noalias() -= m.C * x_;
    if (nu > 0) e_.noalias() -= m.D * u_.col(t);
    z_ = e_;
    filter_.Sigma.matrixL().solveInPlace(z_);
    squares_ += z_.squaredNorm();
    if (store != nullptr) {
      store->e.col(t) = e_;
      store->standardised.col(t) = z_;
      store->e_sd.col(t) = e_sd;
    }
    if (dX_.cols() > 0) {
      advance_derivatives(t);
      power_.noalias() += Sie_ * Sie_.transpose();
      filter_.Sigma.matrixL().solveInPlace(dE_);
      spread_.noalias() += dE_.transpose() * dE_;
    }
    next_.noalias() = m.A * x_;
    next_.noalias() += filter_.K * e_;
    if (nu > 0) next_.noalias() += m.B * u_.col(t);
    x_.swap(next_);
  }
  count_ += static_cast<double>(t - begin);
  return t;
}

// dE = d(e)/d(theta) of this sample, dX = d(x)/d(theta) of the next one.
void SteadyRun::advance_derivatives(Index t) {
  const Index n = dX_.rows(), ny = dE_.rows(), k = dX_.cols();
  Sie_ = z_;
  filter_.Sigma.matrixU().solveInPlace(Sie_);
  dE_.noalias() = -filter_.model.C * dX_;
  dX_next_.noalias() = filter_.F * dX_;
  moved_.noalias() = K_theta_ * e_;
  if (dynamics_) {
    moved_.noalias() += A_theta_ * x_;
    seen_.noalias() = C_theta_ * x_;
    dE_ -= seen_.reshaped(ny, k);
  }
  if (inputs_) {
    moved_.noalias() += B_theta_ * u_.col(t);
    seen_.noalias() = D_theta_ * u_.col(t);
    dE_ -= seen_.reshaped(ny, k);
  }
  dX_next_ += moved_.reshaped(n, k);
  dX_.swap(dX_next_);
  slope_.noalias() -= dE_.transpose() * Sie_;
}

void SteadyRun::add_to(Likelihood& out) const {
  out.value -= 0.5 * (count_ * log_determinant(filter_.Sigma) + squares_);
  out.gradient += slope_;
  out.information += spread_;
  std::vector<MatrixXd> relative;  // Sigma^-1 dSigma
  for (Index i = 0; i < dX_.cols(); ++i) {
    const Sensitivity& s = filter_.by[i];
    relative.push_back(filter_.Sigma.solve(s.Sigma));
    out.gradient[i] +=
        0.5 * (s.Sigma.cwiseProduct(power_).sum() - count_ * relative.back().trace());
    for (Index j = 0; j <= i; ++j) {
      const double term =
          0.5 * count_ * relative[j].transpose().cwiseProduct(relative.back()).sum();
      out.information(i, j) += term;
      if (i != j) out.information(j, i) += term;
    }
  }
}

namespace {

void fill_lanes(const Eigen::Ref<const MatrixXd>& y, Index length, Index lanes, Segment& segment) {
  const Index ny = y.rows();
  segment.lanes.assign(static_cast<std::size_t>(1 + length * ny * lanes), 0.0);
  for (Index c = 0; c < lanes; ++c) {
    for (Index s = 0; s < length; ++s) {
      for (Index j = 0; j < ny; ++j) {
        segment.lanes[1 + (s * ny + j) * lanes + c] = y(j, segment.begin + c * length + s);
      }
    }
  }
}

}  // namespace

Index run_in_lanes(const SettledFilter& filter, const Eigen::Ref<const MatrixXd>& y,
                   Segment& segment, Index t, VectorXd& x, double& value) {
  constexpr Index kWorthIt = 64;
  const Index n = filter.model.states(), ny = filter.model.outputs();
  const auto lanes = static_cast<Index>(simd::lanes());
  const Index length = segment.sums.samples() / lanes, skip = t - segment.begin;
  if (n > simd::kMostLaneStates || ny > simd::kMostLaneOutputs || length < kWorthIt ||
      skip >= length) {
    return t;
  }
  Powers<Eigen::Dynamic> powers;
  if (!powers.compute(filter.F) || powers.memory() > length) return t;
  if (segment.lanes.empty()) fill_lanes(y, length, lanes, segment);
  MatrixXd squares(ny, ny);
  const simd::LaneFilter lane_filter{static_cast<int>(n), static_cast<int>(ny), filter.F.data(),
                                     filter.K.data(), filter.model.C.data()};
  simd::sum_squares_in_lanes(lane_filter, segment.lanes.data() + 1,
                             static_cast<std::size_t>(length),
                             static_cast<std::size_t>(powers.memory()),
                             static_cast<std::size_t>(skip), x.data(), squares.data());
  const Index count = length * lanes - skip;
  value -= 0.5 * (static_cast<double>(count) * log_determinant(filter.Sigma) +
                  filter.Sigma.solve(squares).trace());
  return t + count;
}

}  // namespace identikal
