#include "lib/nonlinear/internal/innovation_update.h"

#include <cmath>

#include "lib/base/constants.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

OutputMoments make_output_moments(Index nx, Index ny, Index k) {
  OutputMoments out;
  out.e.setZero(ny);
  out.M.setZero(nx, ny);
  out.Sigma.setZero(ny, ny);
  out.de.setZero(ny, k);
  out.dM.setZero(nx * ny, k);
  out.dSigma.setZero(ny * ny, k);
  return out;
}

InnovationUpdate::InnovationUpdate(Index nx, Index ny, Index k)
    : nx_(nx), ny_(ny), k_(k), present_(static_cast<std::size_t>(ny), -1) {
  factor_.setZero(ny, ny);
  K_.setZero(nx, ny);
  eps_.setZero(ny);
  w_.setZero(ny);
  q_.setZero(ny, k);
  Z_.setZero(ny, k);
  V_.setZero(ny * ny, k);
  score_.setZero(k);
  out_.gradient.setZero(k);
  out_.information.setZero(k, k);
  constant_information_.setZero(k, k);
}

Index InnovationUpdate::look_at(const Eigen::Ref<const VectorXd>& y) {
  present_count_ = 0;
  for (Index a = 0; a < ny_; ++a) {
    const int here = std::isnan(y[a]) ? 0 : 1;
    int& before = present_[a];
    changed_ = changed_ || here != before;
    before = here;
    present_count_ += here;
  }
  samples_ += present_count_;
  return present_count_;
}

bool InnovationUpdate::take_change() {
  const bool changed = changed_;
  changed_ = false;
  return changed;
}

void InnovationUpdate::leave_out_missing(OutputMoments& m) const {
  if (present_count_ == ny_) return;
  for (Index a = 0; a < ny_; ++a) {
    if (is_present(a)) continue;
    m.e[a] = 0.0;
    m.M.col(a).setZero();
    m.Sigma.row(a).setZero();
    m.Sigma.col(a).setZero();
    m.Sigma(a, a) = 1.0;
    if (k_ == 0) continue;
    m.de.row(a).setZero();
    m.dM.middleRows(nx_ * a, nx_).setZero();
    m.dSigma.middleRows(ny_ * a, ny_).setZero();
    for (Index b = 0; b < ny_; ++b) m.dSigma.row(a + ny_ * b).setZero();
  }
}

FilterStatus InnovationUpdate::factorise(const OutputMoments& m) {
  if (!m.Sigma.allFinite() || !m.e.allFinite()) return FilterStatus::not_finite;
  if (!set_factor(m.Sigma, factor_)) return FilterStatus::indefinite;
  log_determinant_ = 2.0 * factor_.diagonal().array().log().sum();
  standardise(m.e);
  return FilterStatus::ok;
}

void InnovationUpdate::standardise(const VectorXd& e) {
  for (Index a = 0; a < ny_; ++a) {
    double sum = e[a];
    for (Index b = 0; b < a; ++b) sum -= factor_(a, b) * eps_[b];
    eps_[a] = sum / factor_(a, a);
  }
}

FilterStatus InnovationUpdate::set(OutputMoments& moments) {
  leave_out_missing(moments);
  return factorise(moments);
}

FilterStatus InnovationUpdate::set_constant(OutputMoments& m, const MatrixXd& R, const Stack& dR) {
  constant_ = true;
  if (take_change()) {
    release_constant_information();
    constant_moves_ = !dR.isZero(0.0);
    m.Sigma = R;
    m.dSigma = dR;
    leave_out_missing(m);
    const FilterStatus status = factorise(m);
    if (status != FilterStatus::ok) return status;
    if (constant_moves_) {
      whiten(m.dSigma);
      add_noise_information(constant_information_);
    }
  } else {
    for (Index a = 0; a < ny_; ++a) {
      if (is_present(a)) continue;
      m.e[a] = 0.0;
      m.de.row(a).setZero();
    }
    if (!m.e.allFinite()) return FilterStatus::not_finite;
    standardise(m.e);
  }
  ++constant_samples_;
  return FilterStatus::ok;
}

// K = M Sigma^-1, w = Sigma^-1 e.
void InnovationUpdate::set_gain(const MatrixXd& M) {
  w_ = eps_;
  for (Index a = ny_ - 1; a >= 0; --a) {
    for (Index b = a + 1; b < ny_; ++b) w_[a] -= factor_(b, a) * w_[b];
    w_[a] /= factor_(a, a);
  }
  K_ = M;
  for (Index a = 0; a < ny_; ++a) {
    for (Index b = 0; b < a; ++b) K_.col(a) -= factor_(a, b) * K_.col(b);
    K_.col(a) /= factor_(a, a);
  }
  for (Index a = ny_ - 1; a >= 0; --a) {
    for (Index b = a + 1; b < ny_; ++b) K_.col(a) -= factor_(b, a) * K_.col(b);
    K_.col(a) /= factor_(a, a);
  }
}

// K's own derivative is never needed: d(M Sigma^-1 e) = dM w + K (de - dSigma w).
void InnovationUpdate::correct(const OutputMoments& m, const VectorXd& x, const Stack& dx,
                               VectorXd& next_x, Stack& next_dx) {
  set_gain(m.M);
  next_x = x;
  for (Index a = 0; a < ny_; ++a) next_x += m.M.col(a) * w_[a];
  if (k_ == 0) return;
  for (Index a = 0; a < ny_; ++a) {
    q_.row(a) = m.de.row(a);
    for (Index b = 0; b < ny_; ++b) add_row(q_, a, -w_[b], m.dSigma, a + ny_ * b);
  }
  for (Index i = 0; i < nx_; ++i) {
    next_dx.row(i) = dx.row(i);
    for (Index a = 0; a < ny_; ++a) {
      add_row(next_dx, i, w_[a], m.dM, i + nx_ * a);
      add_row(next_dx, i, K_(i, a), q_, a);
    }
  }
}

void InnovationUpdate::whiten(const Stack& dSigma) {
  V_ = dSigma;
  solve_rows(factor_, V_, ny_);
  solve_columns(factor_, V_);
}

void InnovationUpdate::add_terms(const OutputMoments& m, MatrixXd* score_products) {
  out_.value -= 0.5 * (eps_.squaredNorm() + log_determinant_);
  if (k_ == 0) return;
  Z_ = m.de;
  solve_rows(factor_, Z_, 1);
  score_.setZero();
  for (Index a = 0; a < ny_; ++a) score_.noalias() -= eps_[a] * Z_.row(a);
  for (Index a = 0; a < ny_; ++a) add_outer(out_.information, Z_.row(a), 1.0);
  if (!constant_) {
    whiten(m.dSigma);
    add_noise_information(out_.information);
  }
  if (!constant_ || constant_moves_) {
    for (Index b = 0; b < ny_; ++b) {
      for (Index a = 0; a < ny_; ++a) {
        if (!is_present(a) || !is_present(b)) continue;
        const double weight = 0.5 * (eps_[a] * eps_[b] - (a == b ? 1.0 : 0.0));
        score_ += weight * V_.row(a + ny_ * b);
      }
    }
  }
  out_.gradient += score_;
  if (score_products != nullptr) add_outer(*score_products, score_, 1.0);
}

void InnovationUpdate::add_noise_information(MatrixXd& to) const {
  for (Index b = 0; b < ny_; ++b) {
    if (!is_present(b)) continue;
    add_outer(to, V_.row(b + ny_ * b), 0.5);
    for (Index a = 0; a < b; ++a) {
      if (is_present(a)) add_outer(to, V_.row(a + ny_ * b), 1.0);
    }
  }
}

void InnovationUpdate::release_constant_information() {
  if (constant_samples_ > 0.0 && constant_moves_) {
    out_.information += constant_samples_ * constant_information_;
  }
  constant_information_.setZero();
  constant_samples_ = 0.0;
}

Likelihood InnovationUpdate::finish(FilterStatus status) {
  release_constant_information();
  out_.value -= 0.5 * kLogTwoPi * static_cast<double>(samples_);
  if (status == FilterStatus::ok &&
      !(std::isfinite(out_.value) && out_.gradient.allFinite() && out_.information.allFinite())) {
    status = FilterStatus::not_finite;
  }
  out_.information.triangularView<Eigen::StrictlyLower>() = out_.information.transpose();
  out_.status = status;
  return out_;
}

}  // namespace identikal
