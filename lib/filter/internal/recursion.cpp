#include "lib/filter/internal/recursion.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "lib/base/constants.h"
#include "lib/filter/internal/direct_kernel.h"
#include "lib/filter/internal/simd_kernels.h"
#include "lib/filter/internal/steady_filter.h"
#include "lib/filter/steady_state.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The measurement side of the model, restricted to the channels that are present.
struct Measurement {
  MatrixXd C, D, R, Sw;  // Sw = G S, n x ny
};

Measurement rows_present(const Measurement& full, const std::vector<Index>& present) {
  const auto m = static_cast<Index>(present.size());
  Measurement out{MatrixXd(m, full.C.cols()), MatrixXd(m, full.D.cols()), MatrixXd(m, m),
                  MatrixXd(full.Sw.rows(), m)};
  for (Index i = 0; i < m; ++i) {
    const Index from = present[static_cast<std::size_t>(i)];
    out.C.row(i) = full.C.row(from);
    out.D.row(i) = full.D.row(from);
    out.Sw.col(i) = full.Sw.col(from);
    for (Index j = 0; j < m; ++j) out.R(i, j) = full.R(from, present[static_cast<std::size_t>(j)]);
  }
  return out;
}

// One direction of differentiation: constant derivatives of the model, and the recursion's own.
struct Sensitivity {
  MatrixXd A, B, W;
  Measurement full, now;
  // Derivatives of the running quantities. Z stacks [x, X]: the state and its responses to delta.
  MatrixXd P, Z, Sigma, K, E;
  MatrixXd info;   // of delta
  VectorXd score;  // of delta
};

Measurement measurement_derivative(const StateSpace& model, const StateSpace& d) {
  return {d.C, d.D, d.R, d.G * model.S + model.G * d.S};
}

// A diffuse start has N(0, diag(s)) added to it, which the diffuse part absorbs; s only has to be
// of the size that the states have, or that the first samples tell them by, for the arithmetic to
// be well conditioned. It is no function of the parameters, and follows the states' units.
VectorXd proper_scale(const StateSpace& model, const Eigen::Ref<const MatrixXd>& y) {
  double sum = 0.0, count = 0.0;
  for (Index t = 0; t < y.cols(); ++t) {
    for (Index i = 0; i < y.rows(); ++i) {
      if (std::isnan(y(i, t))) continue;
      sum += y(i, t) * y(i, t);
      count += 1.0;
    }
  }
  const auto outputs = static_cast<double>(y.rows());
  const double power = (count > 0.0 ? sum / count : 1.0) + model.R.trace() / outputs;
  VectorXd seen = VectorXd::Zero(model.states());
  MatrixXd response = model.C;
  for (Index t = 0; t < model.states(); ++t) {
    seen += response.colwise().squaredNorm().transpose() / outputs;
    response = (response * model.A).eval();
  }
  return seen.unaryExpr([power](double gain) {
    const double scale = power / gain;
    return scale > 0.0 && std::isfinite(scale) ? scale : 1.0;
  });
}

class Recursion {
 public:
  Recursion(const StateSpace& model, InitialState initial, const Eigen::Ref<const MatrixXd>& y,
            const Eigen::Ref<const MatrixXd>& u, const std::vector<StateSpace>& derivatives)
      : model_(model), y_(y), u_(u), sensitivities_(derivatives.size()) {
    check_shapes(model, initial, derivatives);
    if (y.rows() != model.outputs() || u.rows() != model.inputs() ||
        (model.inputs() > 0 && u.cols() != y.cols())) {
      std::ostringstream text;
      text << "kalman filter: y is " << y.rows() << " x " << y.cols() << " and u " << u.rows()
           << " x " << u.cols() << ", the model has " << model.outputs() << " outputs and "
           << model.inputs() << " inputs";
      throw std::invalid_argument(text.str());
    }
    take_model(derivatives);
    start(initial, derivatives);
  }

  // Calls `next` before every sample but the first: it changes the model and the derivatives that
  // the recursion was made with.
  void set_model_change(std::function<void(Index)> next,
                        const std::vector<StateSpace>& derivatives) {
    change_model_ = [this, next = std::move(next), &derivatives](Index t) {
      const Index n = model_.states(), nu = model_.inputs(), ny = model_.outputs();
      next(t);
      check_shapes(model_);
      if (model_.states() != n || model_.inputs() != nu || model_.outputs() != ny ||
          derivatives.size() != sensitivities_.size()) {
        throw std::invalid_argument("kalman filter: the sizes of the model change with time");
      }
      take_model(derivatives);
    };
  }

  // Runs over the record, by shortcuts where they are allowed. `store` receives innovations, and
  // states too when `keep` says so, when it is not null.
  Likelihood run(FilterResult* store, Keep keep, RecursionOptions& options) {
    Likelihood out;
    const bool states = store != nullptr && keep == Keep::everything;
    const auto k = static_cast<Index>(sensitivities_.size());
    out.gradient = VectorXd::Zero(k);
    out.information = MatrixXd::Zero(k, k);
    VectorXd scored = out.gradient;  // up to the last sample
    if (options.score_products != nullptr) options.score_products->setZero(k, k);
    std::size_t segment = 0;
    Segment *here = nullptr, *unrolled = nullptr;  // begun last; the same, once run_unrolled() ran
    // A model that changes has no options.
    const bool constant_gain = options.constant_gain && !change_model_;
    for (Index t = 0; t < y_.cols() && status_ == FilterStatus::ok; ++t) {
      if (change_model_ && t > 0) change_model_(t);
      if (options.segments != nullptr && segment < options.segments->size() &&
          (*options.segments)[segment].begin == t) {
        here = &(*options.segments)[segment++];
        if (options.kernel != nullptr && jump(*here, options, out)) {
          t += here->sums.samples() - 1;
          continue;
        }
      }
      if (here != nullptr && here != unrolled && diffuse_ == 0 && sensitivities_.empty() &&
          store == nullptr) {
        unrolled = here;
        const Index end = here->begin + here->sums.samples();
        if (t < end) t = run_unrolled(t, end, constant_gain, out);
        if (status_ != FilterStatus::ok) break;
        if (t >= end) {
          --t;
          continue;
        }
      }
      find_present(t);
      if (present_.empty()) {
        if (states) store_states(*store, t, false);
        if (store != nullptr && diffuse_ == 0) store->e_sd.col(t) = innovation_sd();
        predict_without_measurement(t);
      } else {
        innovate(t);
        if (status_ != FilterStatus::ok) break;
        if (states) store_states(*store, t, true);
        if (store != nullptr && diffuse_ == 0) store_innovation(*store, t);
        add_terms(out);
        update();
      }
      fold_in_when_determined(t, out, store);
      if (options.score_products != nullptr && diffuse_ == 0) {
        const VectorXd score = out.gradient - scored;
        *options.score_products += score * score.transpose();
        scored = out.gradient;
      }
      if (settled_ && diffuse_ == 0 && !states && constant_gain) {
        Index next = t + 1;
        if (here != nullptr && sensitivities_.empty() && store == nullptr && u_.rows() == 0) {
          next = run_in_lanes(next, *here, out);
        }
        t = run_steady(next, out, store, options.score_products) - 1;
        scored = out.gradient;
      }
    }
    finish(out);
    return out;
  }

  // Samples from .. to - 1, each shown before the recursion moves on. delta stays apart until
  // nothing of it is left in the state, or the record ends.
  void watch(Index from, Index to, Likelihood& out, const FilterWatcher& see) {
    for (Index t = from; t < to && status_ == FilterStatus::ok; ++t) {
      if (change_model_ && t > 0) change_model_(t);
      find_present(t);
      gain_kept_ = settled_ && !change_model_ && static_cast<Index>(present_.size()) == y_.rows();
      if (present_.empty()) {
        show(t, see);
        predict_without_measurement(t);
      } else {
        innovate(t);
        if (status_ != FilterStatus::ok) break;
        add_terms(out);
        show(t, see);
        update();
      }
      if (diffuse_ == 0) continue;
      if (t + 1 == y_.cols()) fold_in_when_determined(t, out, nullptr);
      if (diffuse_ > 0 && delta_is_forgotten()) fold_in(t, out, nullptr);
    }
  }

  void finish(Likelihood& out) {
    if (status_ == FilterStatus::ok && diffuse_ > 0) status_ = FilterStatus::undetermined;
    out.value -= 0.5 * log_two_pi_ * static_cast<double>(samples_ - folded_);
    if (status_ == FilterStatus::ok && !(std::isfinite(out.value) && out.gradient.allFinite())) {
      status_ = FilterStatus::not_finite;
    }
    out.status = status_;
  }

  FilterStatus status() const { return status_; }

 private:
  void take_model(const std::vector<StateSpace>& derivatives) {
    full_ = {model_.C, model_.D, model_.R, model_.G * model_.S};
    now_ = full_;
    W_ = model_.G * model_.Q * model_.G.transpose();
    selected_ = {-1};
    for (std::size_t i = 0; i < derivatives.size(); ++i) {
      const StateSpace& d = derivatives[i];
      Sensitivity& s = sensitivities_[i];
      s.A = d.A;
      s.B = d.B;
      const MatrixXd half = d.G * model_.Q * model_.G.transpose();
      s.W = half + half.transpose() + model_.G * d.Q * model_.G.transpose();
      s.full = measurement_derivative(model_, d);
      s.now = s.full;
    }
  }

  void start(InitialState initial, const std::vector<StateSpace>& derivatives) {
    const Index n = model_.states();
    P_ = MatrixXd::Zero(n, n);
    Z_ = MatrixXd::Zero(n, 1);
    for (Sensitivity& s : sensitivities_) {
      s.P = MatrixXd::Zero(n, n);
      s.Z = MatrixXd::Zero(n, 1);
    }
    switch (initial) {
      case InitialState::given:
        P_ = model_.P0;
        Z_.col(0) = model_.x0;
        for (std::size_t i = 0; i < sensitivities_.size(); ++i) {
          sensitivities_[i].P = derivatives[i].P0;
          sensitivities_[i].Z.col(0) = derivatives[i].x0;
        }
        break;
      case InitialState::stationary: {
        const auto P = solve_discrete_lyapunov(model_.A, W_);
        if (!P) {
          status_ = FilterStatus::unstable;
          return;
        }
        P_ = *P;
        for (Sensitivity& s : sensitivities_) {
          const MatrixXd half = s.A * P_ * model_.A.transpose();
          const auto dP = solve_discrete_lyapunov(model_.A, half + half.transpose() + s.W);
          if (!dP) {
            status_ = FilterStatus::unstable;
            return;
          }
          s.P = *dP;
        }
        break;
      }
      case InitialState::diffuse:
        diffuse_ = n;
        scale_ = proper_scale(model_, y_);
        P_ = scale_.asDiagonal();
        Z_ = MatrixXd::Zero(n, 1 + n);
        Z_.rightCols(n).setIdentity();
        info_ = MatrixXd::Zero(n, n);
        score_ = VectorXd::Zero(n);
        for (Sensitivity& s : sensitivities_) {
          s.Z = MatrixXd::Zero(n, 1 + n);
          s.info = MatrixXd::Zero(n, n);
          s.score = VectorXd::Zero(n);
        }
        break;
    }
  }

  void find_present(Index t) {
    present_.clear();
    for (Index i = 0; i < y_.rows(); ++i) {
      if (!std::isnan(y_(i, t))) present_.push_back(i);
    }
    samples_ += static_cast<Index>(present_.size());
    if (present_ == selected_) return;
    selected_ = present_;
    const bool all = static_cast<Index>(present_.size()) == y_.rows();
    now_ = all ? full_ : rows_present(full_, present_);
    for (Sensitivity& s : sensitivities_) s.now = all ? s.full : rows_present(s.full, present_);
  }

  void innovate(Index t) {
    at_ = t;
    E_.noalias() = -now_.C * Z_;
    for (std::size_t i = 0; i < present_.size(); ++i) {
      E_(static_cast<Index>(i), 0) += y_(present_[i], t);
    }
    if (u_.rows() > 0) E_.col(0).noalias() -= now_.D * u_.col(t);
    if (gain_kept_) {
      SiE_ = llt_.solve(E_);
      return;
    }
    PC_.noalias() = P_ * now_.C.transpose();
    Sigma_ = now_.R;
    Sigma_.noalias() += now_.C * PC_;
    llt_.compute(Sigma_);
    if (llt_.info() != Eigen::Success || !Sigma_.allFinite()) {
      status_ = Sigma_.allFinite() ? FilterStatus::indefinite : FilterStatus::not_finite;
      return;
    }
    M_ = now_.Sw;
    M_.noalias() += model_.A * PC_;
    K_ = llt_.solve(M_.transpose()).transpose();
    F_ = model_.A;
    F_.noalias() -= K_ * now_.C;
    SiE_ = llt_.solve(E_);
    for (Sensitivity& s : sensitivities_) {
      s.Sigma = s.now.R;
      s.Sigma.noalias() += now_.C * s.P * now_.C.transpose();
      const MatrixXd half = s.now.C * PC_;
      s.Sigma += half + half.transpose();
      s.E = -s.now.C * Z_;
      s.E.noalias() -= now_.C * s.Z;
      if (u_.rows() > 0) s.E.col(0).noalias() -= s.now.D * u_.col(t);
      MatrixXd dM = s.now.Sw;
      dM.noalias() += s.A * PC_ + model_.A * s.P * now_.C.transpose() +
                      model_.A * P_ * s.now.C.transpose() - K_ * s.Sigma;
      s.K = llt_.solve(dM.transpose()).transpose();
    }
  }

  void add_terms(Likelihood& out) {
    const double log_det = 2.0 * llt_.matrixLLT().diagonal().array().log().sum();
    out.value -= 0.5 * (log_det + E_.col(0).dot(SiE_.col(0)));
    const Index d = Z_.cols() - 1;
    if (d > 0) {
      info_.noalias() += E_.rightCols(d).transpose() * SiE_.rightCols(d);
      score_.noalias() += E_.rightCols(d).transpose() * SiE_.col(0);
    }
    const auto k = static_cast<Index>(sensitivities_.size());
    std::vector<MatrixXd> relative;  // Sigma^-1 dSigma
    std::vector<VectorXd> whitened;  // L^-1 de
    for (Index i = 0; i < k; ++i) {
      Sensitivity& s = sensitivities_[static_cast<std::size_t>(i)];
      const MatrixXd SidS = llt_.solve(s.Sigma);
      out.gradient[i] -= 0.5 * (SidS.trace() + 2.0 * s.E.col(0).dot(SiE_.col(0)) -
                                SiE_.col(0).dot(s.Sigma * SiE_.col(0)));
      if (d > 0) {
        const MatrixXd dS_SiE = s.Sigma * SiE_;
        const MatrixXd half = s.E.rightCols(d).transpose() * SiE_.rightCols(d);
        s.info += half + half.transpose() - SiE_.rightCols(d).transpose() * dS_SiE.rightCols(d);
        s.score += s.E.rightCols(d).transpose() * SiE_.col(0) +
                   SiE_.rightCols(d).transpose() * (s.E.col(0) - dS_SiE.col(0));
        continue;
      }
      relative.push_back(SidS);
      whitened.push_back(llt_.matrixL().solve(s.E.col(0)));
      for (Index j = 0; j <= i; ++j) {
        const auto jj = static_cast<std::size_t>(j);
        const double term = 0.5 * (relative[jj].transpose().cwiseProduct(SidS)).sum() +
                            whitened[jj].dot(whitened.back());
        out.information(i, j) += term;
        if (i != j) out.information(j, i) += term;
      }
    }
  }

  void update() {
    const Index t = at_;
    if (!gain_kept_) settled_ = static_cast<Index>(present_.size()) == y_.rows();
    for (Sensitivity& s : sensitivities_) {
      // The gain minimises P+, so its own derivative drops out of dP+.
      MatrixXd dF = s.A;
      dF.noalias() -= K_ * s.now.C;
      const MatrixXd half = dF * P_ * F_.transpose() - K_ * s.now.Sw.transpose();
      MatrixXd dP =
          F_ * s.P * F_.transpose() + half + half.transpose() + s.W + K_ * s.now.R * K_.transpose();
      dP = 0.5 * (dP + dP.transpose()).eval();
      settled_ = settled_ && has_settled(s.P, dP, 1e-12);
      s.P.swap(dP);
      MatrixXd dZ = s.A * Z_ + model_.A * s.Z + s.K * E_ + K_ * s.E;
      if (u_.rows() > 0) dZ.col(0).noalias() += s.B * u_.col(t);
      s.Z.swap(dZ);
    }
    MatrixXd Z = model_.A * Z_;
    Z.noalias() += K_ * E_;
    if (u_.rows() > 0) Z.col(0).noalias() += model_.B * u_.col(t);
    Z_.swap(Z);
    if (gain_kept_) return;
    const MatrixXd KS = K_ * now_.Sw.transpose();
    MatrixXd P = F_ * P_ * F_.transpose() + W_ - KS - KS.transpose();
    P.noalias() += K_ * now_.R * K_.transpose();
    P = 0.5 * (P + P.transpose()).eval();
    settled_ = settled_ && has_settled(P_, P, 1e-14);
    P_.swap(P);
  }

  void predict_without_measurement(Index t) {
    settled_ = false;
    for (Sensitivity& s : sensitivities_) {
      const MatrixXd half = s.A * P_ * model_.A.transpose();
      s.P = (model_.A * s.P * model_.A.transpose() + half + half.transpose() + s.W).eval();
      s.Z = (s.A * Z_ + model_.A * s.Z).eval();
      if (u_.rows() > 0) s.Z.col(0).noalias() += s.B * u_.col(t);
    }
    Z_ = (model_.A * Z_).eval();
    if (u_.rows() > 0) Z_.col(0).noalias() += model_.B * u_.col(t);
    P_ = (model_.A * P_ * model_.A.transpose() + W_).eval();
  }

  // Once every direction of delta has been seen, it is integrated out and the filter goes on as a
  // proper one.
  void fold_in_when_determined(Index t, Likelihood& out, FilterResult* store) {
    if (diffuse_ == 0 || status_ != FilterStatus::ok) return;
    const bool last = t + 1 == y_.cols();
    if (determined_share(info_, scale_) < (last ? kDetermined : 1e-6)) return;
    fold_in(t, out, store);
  }

  void fold_in(Index t, Likelihood& out, FilterResult* store) {
    const Index d = diffuse_;
    const Eigen::LLT<MatrixXd> llt(info_);
    if (llt.info() != Eigen::Success) return;
    const VectorXd delta = -llt.solve(score_);
    const MatrixXd inverse = llt.solve(MatrixXd::Identity(d, d));
    out.value += -llt.matrixLLT().diagonal().array().log().sum() - 0.5 * score_.dot(delta);
    const MatrixXd X = Z_.rightCols(d);
    for (std::size_t i = 0; i < sensitivities_.size(); ++i) {
      Sensitivity& s = sensitivities_[i];
      out.gradient[static_cast<Index>(i)] += -0.5 * inverse.cwiseProduct(s.info).sum() -
                                             s.score.dot(delta) - 0.5 * delta.dot(s.info * delta);
      const VectorXd ddelta = -llt.solve(s.score + s.info * delta);
      const MatrixXd dX = s.Z.rightCols(d), XI = X * inverse;
      const MatrixXd half = dX * XI.transpose();
      s.P += half + half.transpose() - XI * s.info * XI.transpose();
      s.Z = (s.Z.col(0) + dX * delta + X * ddelta).eval();
    }
    P_ += X * inverse * X.transpose();
    Z_ = (Z_.col(0) + X * delta).eval();
    diffuse_ = 0;
    folded_ = d;
    if (store != nullptr) store->first_proper = t + 1;
  }

  // Of every channel, measured or not.
  VectorXd innovation_sd() const {
    const MatrixXd CP = full_.C * P_;
    return (CP.cwiseProduct(full_.C).rowwise().sum() + full_.R.diagonal()).cwiseSqrt();
  }

  void store_innovation(FilterResult& store, Index t) const {
    store.e_sd.col(t) = innovation_sd();
    const VectorXd z = llt_.matrixL().solve(E_.col(0));
    for (std::size_t i = 0; i < present_.size(); ++i) {
      store.e(present_[i], t) = E_(static_cast<Index>(i), 0);
      store.standardised(present_[i], t) = z[static_cast<Index>(i)];
    }
  }

  // P C' Sigma^-1
  MatrixXd filter_gain() const { return llt_.solve(PC_.transpose()).transpose(); }

  MatrixXd filtered_covariance(const MatrixXd& Kf) const {
    const MatrixXd F = MatrixXd::Identity(P_.rows(), P_.rows()) - Kf * now_.C;
    return F * P_ * F.transpose() + Kf * now_.R * Kf.transpose();
  }

  void show(Index t, const FilterWatcher& see) {
    const bool measured = !present_.empty();
    if (!gain_kept_) {
      step_.F = measured ? F_ : model_.A;
      if (measured) {
        Kf_ = filter_gain();
        step_.P_filt = filtered_covariance(Kf_);
        step_.M = step_.P_filt * model_.A.transpose() - Kf_ * now_.Sw.transpose();
        step_.information = now_.C.transpose() * llt_.solve(now_.C);
      } else {
        step_.P_filt = P_;
        step_.M = P_ * model_.A.transpose();
        step_.information = MatrixXd::Zero(P_.rows(), P_.rows());
      }
    }
    step_.t = t;
    step_.same_gain = gain_kept_;
    step_.Z_filt = Z_;
    step_.score.setZero(Z_.rows(), Z_.cols());
    if (measured) {
      step_.Z_filt.noalias() += Kf_ * E_;
      step_.score.noalias() = now_.C.transpose() * SiE_;
    }
    if (diffuse_ > 0) {
      step_.delta_information = info_;
      step_.delta_score = score_;
      step_.delta_scale = scale_;
    }
    see(step_);
  }

  // Is what delta still moves in the state lost in rounding, for all that is known of delta?
  bool delta_is_forgotten() const {
    // Variances at delta's scale; what is known of it below is no worse than a million times that.
    const MatrixXd moved = Z_.rightCols(diffuse_).cwiseAbs2() * scale_.asDiagonal();
    return (moved.rowwise().maxCoeff().array() <= 1e-46 * P_.diagonal().array()).all() &&
           determined_share(info_, scale_) >= 1e-6;
  }

  void store_states(FilterResult& store, Index t, bool measured) const {
    const auto at = static_cast<std::size_t>(t);
    const Index n = P_.rows(), ny = y_.rows();
    if (diffuse_ > 0) {
      store.P_pred[at] = store.P_filt[at] = MatrixXd::Constant(n, n, kNaN);
      store.Sigma[at] = MatrixXd::Constant(ny, ny, kNaN);
      return;
    }
    VectorXd x = Z_.col(0);
    MatrixXd P = P_;
    store.x_pred.col(t) = x;
    store.P_pred[at] = P;
    if (measured) {
      const MatrixXd Kf = filter_gain();
      x += Kf * E_.col(0);
      P = filtered_covariance(Kf);
    }
    store.x_filt.col(t) = x;
    store.P_filt[at] = P;
    store.Sigma[at] = full_.C * P_ * full_.C.transpose() + full_.R;
  }

  // Has the covariance stopped changing, to rounding? Entries are measured against the standard
  // deviations they belong to. The derivatives settle together with it, a few steps later.
  bool has_settled(const MatrixXd& before, const MatrixXd& after, double tolerance) const {
    const Index n = after.rows();
    const VectorXd sd = P_.diagonal().cwiseSqrt(), own = after.diagonal().cwiseAbs().cwiseSqrt();
    double largest = 0.0;  // against the standard deviations, where there are any
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) {
        const double scale = sd[i] * sd[j];
        if (scale > 0.0) largest = std::max(largest, std::abs(after(i, j)) / scale);
      }
    }
    for (Index j = 0; j < n; ++j) {
      for (Index i = 0; i < n; ++i) {
        const double scale =
            std::max({std::abs(after(i, j)), own[i] * own[j], 1e-3 * largest * sd[i] * sd[j]});
        if (std::abs(after(i, j) - before(i, j)) > tolerance * scale) return false;
      }
    }
    return true;
  }

  // A whole gapless segment at once. false: it is too short, or sums would lose digits.
  bool jump(const Segment& segment, RecursionOptions& options, Likelihood& out) {
    SegmentKernel& kernel = *options.kernel;
    const std::size_t k = sensitivities_.size();
    if (segment.sums.samples() <= kernel.memory()) return false;
    FilterState state;
    state.x_theta.resize(k);
    state.P_theta.resize(k);
    if (diffuse_ > 0) {
      // Only an untouched start is known to the kernel.
      if (samples_ > 0 || segment.begin > 0) {
        options.late = true;
        return false;
      }
      if (!kernel.add_from_model(segment, InitialState::diffuse, out)) {
        options.cancelled = true;
        return false;
      }
      folded_ = diffuse_;
      diffuse_ = 0;
    } else {
      state.x = Z_.col(0);
      state.P = P_;
      for (std::size_t i = 0; i < k; ++i) {
        state.x_theta[i] = sensitivities_[i].Z.col(0);
        state.P_theta[i] = sensitivities_[i].P;
      }
      if (!kernel.add_from_state(segment, state, out)) {
        options.cancelled = true;
        return false;
      }
    }
    kernel.end_of_segment(segment, state);
    Z_ = state.x;
    P_ = state.P;
    for (std::size_t i = 0; i < k; ++i) {
      sensitivities_[i].Z = state.x_theta[i];
      sensitivities_[i].P = state.P_theta[i];
    }
    settled_ = false;
    samples_ += segment.sums.samples() * y_.rows();
    options.jumped += segment.sums.samples();
    return true;
  }

  // Gapless samples t .. end - 1 by code made for these sizes, if there is any. Returns the first
  // sample it did not process.
  Index run_unrolled(Index t, Index end, bool stop_when_settled, Likelihood& out) {
    DirectRun run;
    run.x = Z_.col(0);
    run.P = P_;
    const Index next = run_direct(model_, W_, full_.Sw, y_, u_, t, end, stop_when_settled, run);
    if (!run.definite) {
      status_ = FilterStatus::indefinite;
      return next;
    }
    Z_.col(0) = run.x;
    P_ = run.P;
    out.value += run.value;
    samples_ += (next - t) * y_.rows();
    return next;
  }

  // From sample t of a segment on with constant gain, in chunks side by side. Returns the first
  // sample it did not process: t itself where it does not pay or the filter forgets too slowly.
  Index run_in_lanes(Index t, Segment& segment, Likelihood& out) {
    const Index n = model_.states(), ny = y_.rows();
    const auto lanes = static_cast<Index>(simd::lanes());
    const Index length = segment.sums.samples() / lanes, skip = t - segment.begin;
    constexpr Index kWorthIt = 64;
    if (n > simd::kMostLaneStates || ny > simd::kMostLaneOutputs || length < kWorthIt ||
        skip >= length) {
      return t;
    }
    Powers<Eigen::Dynamic> powers;
    if (!powers.compute(F_) || powers.memory() > length) return t;
    if (segment.lanes.empty()) {
      segment.lanes.assign(static_cast<std::size_t>(1 + length * ny * lanes), 0.0);
      for (Index c = 0; c < lanes; ++c) {
        for (Index s = 0; s < length; ++s) {
          for (Index j = 0; j < ny; ++j) {
            segment.lanes[static_cast<std::size_t>(1 + (s * ny + j) * lanes + c)] =
                y_(j, segment.begin + c * length + s);
          }
        }
      }
    }
    VectorXd x = Z_.col(0);
    MatrixXd squares(ny, ny);
    const simd::LaneFilter filter{static_cast<int>(n), static_cast<int>(ny), F_.data(), K_.data(),
                                  full_.C.data()};
    simd::sum_squares_in_lanes(filter, segment.lanes.data() + 1, static_cast<std::size_t>(length),
                               static_cast<std::size_t>(powers.memory()),
                               static_cast<std::size_t>(skip), x.data(), squares.data());
    const Index count = length * lanes - skip;
    const double log_det = 2.0 * llt_.matrixLLT().diagonal().array().log().sum();
    out.value -= 0.5 * (static_cast<double>(count) * log_det + llt_.solve(squares).trace());
    samples_ += count * ny;
    Z_.col(0) = x;
    return t + count;
  }

  // From sample t on with constant gain, as long as no sample is missing; returns the first sample
  // it did not process. Sensitivities run stacked: column i of dX is dx/d(theta_i).
  Index run_steady(Index t, Likelihood& out, FilterResult* store, MatrixXd* score_products) {
    const Index n = model_.states(), ny = y_.rows(), nu = u_.rows();
    const auto k = static_cast<Index>(sensitivities_.size());
    MatrixXd K_theta(n * k, ny), A_theta(n * k, n), B_theta(n * k, nu), C_theta(ny * k, n),
        D_theta(ny * k, nu), dX(n, k);
    for (Index i = 0; i < k; ++i) {
      const Sensitivity& s = sensitivities_[static_cast<std::size_t>(i)];
      K_theta.middleRows(i * n, n) = s.K;
      A_theta.middleRows(i * n, n) = s.A - K_ * s.now.C;
      B_theta.middleRows(i * n, n) = s.B - K_ * s.now.D;
      C_theta.middleRows(i * ny, ny) = s.now.C;
      D_theta.middleRows(i * ny, ny) = s.now.D;
      dX.col(i) = s.Z.col(0);
    }
    // Most often only noise is unknown, and these vanish.
    const bool dynamics = !(A_theta.isZero(0.0) && C_theta.isZero(0.0));
    const bool inputs = nu > 0 && !(B_theta.isZero(0.0) && D_theta.isZero(0.0));

    const VectorXd e_sd = innovation_sd();
    VectorXd x = Z_.col(0), next(n), e(ny), z(ny), Sie(ny), moved(n * k), seen(ny * k);
    MatrixXd dE(ny, k), dX_next(n, k), power = MatrixXd::Zero(ny, ny);
    MatrixXd spread = MatrixXd::Zero(k, k);
    VectorXd slope = VectorXd::Zero(k);
    double squares = 0.0;
    VectorXd score(k), half_trace(k);
    for (Index i = 0; i < k; ++i) {
      half_trace[i] = 0.5 * llt_.solve(sensitivities_[static_cast<std::size_t>(i)].Sigma).trace();
    }
    const Index begin = t;
    for (; t < y_.cols() && !y_.col(t).hasNaN(); ++t) {
      e = y_.col(t);
      e.noalias() -= full_.C * x;
      if (nu > 0) e.noalias() -= full_.D * u_.col(t);
      z = e;
      llt_.matrixL().solveInPlace(z);
      squares += z.squaredNorm();
      if (store != nullptr) {
        store->e.col(t) = e;
        store->standardised.col(t) = z;
        store->e_sd.col(t) = e_sd;
      }
      if (k > 0) {
        Sie = z;
        llt_.matrixU().solveInPlace(Sie);
        dE.noalias() = -full_.C * dX;
        dX_next.noalias() = F_ * dX;
        moved.noalias() = K_theta * e;
        if (dynamics) {
          moved.noalias() += A_theta * x;
          seen.noalias() = C_theta * x;
          dE -= seen.reshaped(ny, k);
        }
        if (inputs) {
          moved.noalias() += B_theta * u_.col(t);
          seen.noalias() = D_theta * u_.col(t);
          dE -= seen.reshaped(ny, k);
        }
        dX_next += moved.reshaped(n, k);
        dX.swap(dX_next);
        slope.noalias() -= dE.transpose() * Sie;
        if (score_products != nullptr) {
          score.noalias() = -dE.transpose() * Sie - half_trace;
          for (Index i = 0; i < k; ++i) {
            score[i] += 0.5 * Sie.dot(sensitivities_[static_cast<std::size_t>(i)].Sigma * Sie);
          }
          *score_products += score * score.transpose();
        }
        power.noalias() += Sie * Sie.transpose();
        llt_.matrixL().solveInPlace(dE);
        spread.noalias() += dE.transpose() * dE;
      }
      next.noalias() = model_.A * x;
      next.noalias() += K_ * e;
      if (nu > 0) next.noalias() += model_.B * u_.col(t);
      x.swap(next);
    }

    const auto count = static_cast<double>(t - begin);
    samples_ += (t - begin) * ny;
    const double log_det = 2.0 * llt_.matrixLLT().diagonal().array().log().sum();
    out.value -= 0.5 * (count * log_det + squares);
    out.gradient += slope;
    out.information += spread;
    std::vector<MatrixXd> relative;  // Sigma^-1 dSigma
    for (Index i = 0; i < k; ++i) {
      Sensitivity& s = sensitivities_[static_cast<std::size_t>(i)];
      s.Z.col(0) = dX.col(i);
      relative.push_back(llt_.solve(s.Sigma));
      out.gradient[i] +=
          0.5 * (s.Sigma.cwiseProduct(power).sum() - count * relative.back().trace());
      for (Index j = 0; j <= i; ++j) {
        const MatrixXd& other = relative[static_cast<std::size_t>(j)];
        const double term = 0.5 * count * other.transpose().cwiseProduct(relative.back()).sum();
        out.information(i, j) += term;
        if (i != j) out.information(j, i) += term;
      }
    }
    Z_.col(0) = x;
    settled_ = false;
    return t;
  }

  const StateSpace& model_;
  std::function<void(Index)> change_model_;  // empty: it stays as it is
  const Eigen::Ref<const MatrixXd>& y_;
  const Eigen::Ref<const MatrixXd>& u_;
  Measurement full_, now_;
  MatrixXd W_;
  std::vector<Sensitivity> sensitivities_;
  FilterStatus status_ = FilterStatus::ok;

  MatrixXd P_, Z_;  // covariance; [x, X]
  MatrixXd info_;   // information and score of delta, while it is diffuse
  VectorXd score_;
  Index diffuse_ = 0, folded_ = 0, samples_ = 0;
  VectorXd scale_;
  const double log_two_pi_ = std::log(2.0 * std::numbers::pi);

  std::vector<Index> present_, selected_{-1};
  MatrixXd E_, PC_, Sigma_, M_, K_, F_, SiE_;
  Eigen::LLT<MatrixXd> llt_;
  Index at_ = 0;
  bool settled_ = false;    // gain and its derivatives are constant from here on
  bool gain_kept_ = false;  // watch() only: those of the sample before are this sample's
  MatrixXd Kf_;
  FilterStep step_;
};

}  // namespace

namespace {

FilterResult filter(Recursion& recursion, Index n, const Eigen::Ref<const MatrixXd>& y, Keep keep) {
  FilterResult out;
  const Index N = y.cols();
  out.e = MatrixXd::Constant(y.rows(), N, kNaN);
  out.standardised = out.e;
  out.e_sd = out.e;
  if (keep == Keep::everything) {
    out.x_pred = MatrixXd::Constant(n, N, kNaN);
    out.x_filt = out.x_pred;
    out.P_pred.resize(static_cast<std::size_t>(N));
    out.P_filt.resize(static_cast<std::size_t>(N));
    out.Sigma.resize(static_cast<std::size_t>(N));
  }
  RecursionOptions options;
  const Likelihood likelihood = recursion.run(&out, keep, options);
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
  return out;
}

}  // namespace

FilterResult run_filter(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        Keep keep) {
  Recursion recursion(model, initial, y, u, {});
  return filter(recursion, model.states(), y, keep);
}

FilterResult run_filter(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        Keep keep) {
  StateSpace now;
  const std::vector<StateSpace> none;
  model(0, now, nullptr);
  Recursion recursion(now, initial, y, u, none);
  recursion.set_model_change([&](Index t) { model(t, now, nullptr); }, none);
  return filter(recursion, now.states(), y, keep);
}

Likelihood run_recursion(const ModelAt& model, InitialState initial,
                         const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                         bool with_derivatives) {
  StateSpace now;
  std::vector<StateSpace> derivatives;
  std::vector<StateSpace>* const wanted = with_derivatives ? &derivatives : nullptr;
  model(0, now, wanted);
  Recursion recursion(now, initial, y, u, derivatives);
  recursion.set_model_change([&](Index t) { model(t, now, wanted); }, derivatives);
  RecursionOptions options;
  return recursion.run(nullptr, Keep::innovations, options);
}

void check_shapes(const StateSpace& model, InitialState initial,
                  const std::vector<StateSpace>& derivatives) {
  const auto check_start = [&](const StateSpace& m) {
    const Index n = model.states();
    if (initial != InitialState::given) return;
    if (m.x0.size() != n || m.P0.rows() != n || m.P0.cols() != n) {
      throw std::invalid_argument("kalman filter: x0 and P0 do not have the size of the state");
    }
  };
  check_shapes(model);
  check_start(model);
  for (const StateSpace& d : derivatives) {
    check_shapes(d);
    check_start(d);
    if (d.states() != model.states() || d.inputs() != model.inputs() ||
        d.outputs() != model.outputs() || d.G.cols() != model.G.cols()) {
      throw std::invalid_argument("kalman filter: a derivative does not have the model's shape");
    }
  }
}

Likelihood run_recursion(const StateSpace& model, InitialState initial,
                         const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                         const std::vector<StateSpace>& derivatives, RecursionOptions& options) {
  return Recursion(model, initial, y, u, derivatives).run(nullptr, Keep::innovations, options);
}

double determined_share(const MatrixXd& information, const VectorXd& scale) {
  const auto sd = scale.cwiseSqrt().asDiagonal();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(sd * information * sd,
                                                      Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff();
}

Likelihood watch_filter(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        const FilterWatcher& see) {
  const std::vector<StateSpace> none;
  Recursion recursion(model, initial, y, u, none);
  Likelihood out;
  recursion.watch(0, y.cols(), out, see);
  recursion.finish(out);
  return out;
}

Likelihood watch_filter(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        const FilterWatcher& see) {
  StateSpace now;
  const std::vector<StateSpace> none;
  model(0, now, nullptr);
  Recursion recursion(now, initial, y, u, none);
  recursion.set_model_change([&](Index t) { model(t, now, nullptr); }, none);
  Likelihood out;
  recursion.watch(0, y.cols(), out, see);
  recursion.finish(out);
  return out;
}

Likelihood watch_backwards(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           const FilterWatcher& see, const std::function<void()>& block_ends) {
  const std::vector<StateSpace> none;
  Recursion recursion(model, initial, y, u, none);
  const auto block = static_cast<Index>(std::ceil(std::sqrt(static_cast<double>(y.cols()))));
  std::vector<Recursion> begins;
  Likelihood out, again;
  for (Index t = 0; t < y.cols() && recursion.status() == FilterStatus::ok; t += block) {
    begins.push_back(recursion);
    recursion.watch(t, std::min(t + block, y.cols()), out, [](const FilterStep&) {});
  }
  recursion.finish(out);
  for (Index t = block * static_cast<Index>(begins.size()); out.status == FilterStatus::ok && t > 0;
       t -= block) {
    begins.back().watch(t - block, std::min(t, y.cols()), again, see);
    block_ends();
    begins.pop_back();
  }
  return out;
}

}  // namespace identikal
