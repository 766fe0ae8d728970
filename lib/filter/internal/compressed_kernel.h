// Likelihood, gradient and information of a gapless segment at a cost that does not depend on its
// length. Internal to the filter, for a number of states known at compile time (or Dynamic).
//
// The whole segment runs on the constant gain. A start that is not the steady one, x(0) ~ N(m0,
// P0), is the steady one plus delta ~ N(0, Pi), Pi = P0 - P, which is integrated out exactly: with
// M = sum_t F'^t C' Sigma^-1 C F^t and s = sum_t F'^t C' Sigma^-1 e(t), its smoothed value is
// delta = (I + Pi M)^-1 Pi s and
//
//   -2 log L = N log|Sigma| + tr(Sigma^-1 S_e) + log|I + Pi M| + delta' Pi^-1 delta + N ny log 2pi
//
// where S_e = sum e e' of the filter started from m0 + delta. A diffuse start is the limit of large
// Pi (de Jong 1991). S_e follows from the sample autocovariances of z = [y; u]
// (lib/filter/internal/segment_autocovariances.h): with x+ = F x + Kz z and e = H z - C x,
//
//   Y = sum_t z x' = sum_m Gamma_m Kz' F'^(m-1) + sum_t z(t) (F^t x0)',
//   X = sum_t x x' = F X F' + Kz Gamma_0 Kz' + Kz Y F' + F Y' Kz' + x0 x0' - xN xN',
//   S_e = H Gamma_0 H' - H Y C' - C Y' H' + C X C'.
//
// Where z drifts, or is much larger than e, those sums lose digits. Then x is the difference to a
// nominal filter and z its innovations (lib/filter/internal/segment.h): Kz = K - K0, H = I.
//
// Gradient and information follow in compressed_gradient.h and compressed_information.h.
#pragma once

#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/diffuse_start.h"
#include "lib/filter/internal/segment.h"
#include "lib/filter/internal/steady_filter.h"
#include "lib/internal/small_product.h"

namespace identikal {

/// What is known of the state before the first sample of a segment.
template <int n>
struct SegmentStart {
  using Square = Eigen::Matrix<double, n, n>;
  using State = Eigen::Matrix<double, n, 1>;
  InitialState kind = InitialState::stationary;
  State mean;
  Square P;                       // given, stationary
  std::vector<State> mean_theta;  // given: derivatives
  std::vector<Square> P_theta;
};

template <int n>
class CompressedKernel final : public SegmentKernel {
 public:
  using Square = Eigen::Matrix<double, n, n>;
  using State = Eigen::Matrix<double, n, 1>;
  using Columns = ChannelColumns<n>;

  bool prepare(const StateSpace& model, const std::vector<StateSpace>& derivatives,
               Eigen::Index longest) override {
    model_ = &model;
    derivatives_ = &derivatives;
    if (!filter_.solve(model, longest)) return false;
    set_product(CW_, filter_.Ct, filter_.Sigma_inverse);
    set_product(M_, CW_, filter_.Ct.transpose());
    filter_.powers.sum_backward(M_);
    return find_directions();
  }

  bool slow() const override { return filter_.slow; }
  Eigen::MatrixXd gain() const override { return filter_.K; }
  Eigen::Index memory() const override { return filter_.powers.memory(); }
  double pole() const override { return filter_.powers.radius(); }
  RejectReason reject_reason() const override { return reject_reason_; }

  bool add_from_model(const Segment& segment, InitialState initial, Likelihood& out) override {
    const auto states = filter_.A.rows();
    start_.kind = initial;
    start_.mean.setZero(states);
    if (initial == InitialState::stationary) {
      if (!open_loop_.compute(filter_.A)) return false;
      start_.P = filter_.W;
      open_loop_.sum_forward(start_.P);
    } else if (initial == InitialState::given) {
      start_.mean = model_->x0;
      start_.P = model_->P0;
      start_.mean_theta.resize(derivatives_->size());
      start_.P_theta.resize(derivatives_->size());
      for (std::size_t i = 0; i < derivatives_->size(); ++i) {
        start_.mean_theta[i] = (*derivatives_)[i].x0;
        start_.P_theta[i] = (*derivatives_)[i].P0;
      }
    }
    return add(segment, start_, out);
  }

  bool add_from_state(const Segment& segment, const FilterState& state, Likelihood& out) override {
    start_.kind = InitialState::given;
    start_.mean = state.x;
    start_.P = state.P;
    start_.mean_theta.assign(state.x_theta.begin(), state.x_theta.end());
    start_.P_theta.assign(state.P_theta.begin(), state.P_theta.end());
    return add(segment, start_, out);
  }

  void end_of_segment(const Segment& segment, FilterState& state) override;

 private:
  struct Direction {
    bool dynamics;  // anything but noise and initial state
    Square W, P;
    Columns K, Sw;
    SmallMatrix Sigma;
  };

  /// How state and innovations answer to a parameter, and the sums that its information needs.
  struct Response {
    Square a, dx_x, g_x, M_a, on_dx_x;
    Columns b, dx_z, g_z, M_b, on_dx_z;
    Eigen::Matrix<double, Eigen::Dynamic, n, Eigen::ColMajor, kMaxChannels, n> dC, W_dC, c_x;
    SmallMatrix g, W_g, c_z, relative;
    State dx0, dxN, s;
  };

  /// What a start adds to -2 log L: log|I + Pi M|, or log|M| where it is diffuse, and
  /// delta' Pi^-1 delta.
  struct StartTerms {
    double log_det = 0.0, penalty = 0.0;
  };

  /// Derivatives of tr(Sigma^-1 S_e) + log|I + Pi M| + delta' Pi^-1 delta by what they are made of.
  struct Adjoints {
    Square F, P0;
    Square Lambda;  // stationary start: of its W
    Columns Kz, Yt, Ct, K;
    SmallMatrix H, Sigma;
    State x0;
  };

  bool find_directions();
  void respond(std::size_t i, const Segment& segment, Response& r) const;
  State last_response(const Response& r) const;
  bool add(const Segment& segment, const SegmentStart<n>& start, Likelihood& out);
  void augment(const Segment& segment);
  State score_of_start(const SegmentAutocovariances& sums, const State& mean);
  bool find_diffuse_delta(const State& s, StartTerms& terms);
  bool find_delta(const SegmentStart<n>& start, const State& s, StartTerms& terms);
  void sum_states_with_channels(const SegmentAutocovariances& sums);
  void find_last_state(const SegmentAutocovariances& sums);
  template <class Sums>
  void sum_states(const Sums& Gamma_0);
  template <class Sums>
  void sum_innovations(const Sums& Gamma_0);
  bool well_conditioned(const Square& Pi) const;
  template <class Sums>
  double size_of_terms(const Sums& Gamma_0);
  void sum_lags(const SegmentAutocovariances& sums, Eigen::Index lags);

  // The gradient: compressed_gradient.h.
  void add_gradient(const Segment& segment, const SegmentStart<n>& start, Likelihood& out);
  template <class Sums>
  void begin_adjoints(const Sums& Gamma_0, const Square& M_F, Adjoints& bar);
  void back_through_lags(const SegmentAutocovariances& sums, Adjoints& bar) const;
  void back_through_first_states(const SegmentAutocovariances& sums, Adjoints& bar) const;
  void back_through_last_states(const SegmentAutocovariances& sums, Adjoints& bar) const;
  void back_through_determinants(double samples, const Square& M_F, Adjoints& bar);
  void back_through_gain(const Segment& segment, Adjoints& bar) const;
  void back_through_start(const SegmentStart<n>& start, Adjoints& bar) const;
  double derivative(std::size_t i, const SegmentStart<n>& start, const Adjoints& bar);

  // The information: compressed_information.h.
  void add_noise_information(double samples, Likelihood& out) const;
  void add_full_information(const Segment& segment, const SegmentStart<n>& start, Likelihood& out);
  void find_first_states(const SegmentAutocovariances& sums);
  void follow_start(const Segment& segment, Response& r);
  void sum_response(std::size_t i, const Segment& segment, const SegmentStart<n>& start);

  RejectReason reject_reason_ = RejectReason::none;
  Eigen::Matrix<double, Eigen::Dynamic, n, Eigen::ColMajor, kMaxChannels, n> white_C_;
  SmallMatrix white_H_;
  const StateSpace* model_ = nullptr;
  const std::vector<StateSpace>* derivatives_ = nullptr;
  SteadySolution<n> filter_;
  Powers<n> open_loop_;
  Columns CW_;  // C' Sigma^-1
  Square M_;
  std::vector<Direction> directions_;
  std::vector<Response> responses_;
  SegmentStart<n> start_;
  Eigen::MatrixXd product_;
  Columns work_;
  SmallMatrix small_;

  // Of the segment at hand.
  const SegmentAutocovariances* sums_ = nullptr;
  const NominalInnovations* nominal_ = nullptr;  // what the sums are of, if not outputs and inputs
  Eigen::Index lags_ = 0, channels_ = 0;
  Columns Kz_, Yt_;  // Yt = sum x z'
  SmallMatrix H_, S_e_, SiSeSi_;
  Square X_, Z_, inverse_;  // Z = (I + Pi M)^-1 Pi, inverse = (I + Pi M)^-1
  State x0_, xN_, v_, delta_;
  using States =
      Eigen::Matrix<double, n, Eigen::Dynamic, n == 1 ? Eigen::RowMajor : Eigen::ColMajor>;
  States T_;           // T_m = Kz Gamma_m' + F T_(m+1), all m
  States head_;        // F^t x0
  States first_;       // state over the first samples
  States tail_;        // state over the last samples
  Eigen::MatrixXd e_;  // first innovations, or their derivatives
};

template <int n>
bool CompressedKernel<n>::find_directions() {
  const StateSpace& m = *model_;
  const SteadySolution<n>& f = filter_;
  directions_.resize(derivatives_->size());
  Square F_P, half;
  set_product(F_P, f.F, f.P);
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    const StateSpace& d = (*derivatives_)[i];
    Direction& out = directions_[i];
    const bool dA = !d.A.isZero(0.0), dC = !d.C.isZero(0.0), dG = !d.G.isZero(0.0);
    const bool dQ = !d.Q.isZero(0.0), dR = !d.R.isZero(0.0), dS = !d.S.isZero(0.0);
    out.dynamics = changes_dynamics(d);
    out.W.setZero(f.A.rows(), f.A.cols());
    if (dQ) {
      set_product(product_, m.G, d.Q);
      add_product(out.W, product_, m.G.transpose());
    }
    if (dG) {
      set_product(product_, m.G, m.Q);
      set_product(half, product_, d.G.transpose());
      add_with_transpose(out.W, half);
    }
    out.Sw.setZero(f.A.rows(), m.outputs());
    if (dS) add_product(out.Sw, m.G, d.S);
    if (dG) add_product(out.Sw, d.G, m.S);
    // The gain minimises P, so its own derivative drops out of dP.
    out.P = out.W;
    if (dA) {
      set_product(half, F_P, d.A.transpose());
      add_with_transpose(out.P, half);
    }
    if (dC) {
      set_product(work_, F_P, d.C.transpose());
      set_product(half, work_, f.K.transpose());
      add_with_transpose(out.P, half, -1.0);
    }
    if (dS || dG) {
      set_product(half, f.K, out.Sw.transpose());
      add_with_transpose(out.P, half, -1.0);
    }
    if (dR) {
      set_product(work_, f.K, d.R);
      add_product(out.P, work_, f.K.transpose());
    }
    f.powers.sum_forward(out.P);

    // K Sigma = A P C' + G S
    set_product(work_, out.P, f.Ct);
    set_product(out.Sigma, f.Ct.transpose(), work_);
    if (dR) out.Sigma += d.R;
    Columns& KS = out.K;
    KS = out.Sw;
    if (dC) {
      set_product(small_, d.C, f.PCt);
      add_with_transpose(out.Sigma, small_);
      add_product(work_, f.P, d.C.transpose());
    }
    add_product(KS, f.A, work_);
    if (dA) add_product(KS, d.A, f.PCt);
    add_product(KS, f.K, out.Sigma, -1.0);
    set_product(work_, KS, f.Sigma_inverse);
    out.K = work_;
    if (!out.P.allFinite()) return false;
  }
  return true;
}

/// Filter and output matrices for the segment's channels; the last one is 1 where the mean is out.
template <int n>
void CompressedKernel<n>::augment(const Segment& segment) {
  const StateSpace& m = *model_;
  const Eigen::Index ny = m.outputs(), nu = m.inputs();
  channels_ = sums_->channels();
  Kz_.resize(m.states(), channels_);
  H_.setZero(ny, channels_);
  Kz_.leftCols(ny) = filter_.K;
  H_.leftCols(ny).setIdentity();
  if (nominal_ != nullptr) {
    Kz_ -= nominal_->gain;
    return;
  }
  if (nu > 0) {
    Kz_.middleCols(ny, nu) = m.B;
    add_product(Kz_.middleCols(ny, nu), filter_.K, m.D, -1.0);
    H_.middleCols(ny, nu) = -m.D;
  }
  if (segment.mean.size() > 0) {
    set_product(Kz_.col(channels_ - 1), Kz_.leftCols(ny + nu), segment.mean);
    set_product(H_.col(channels_ - 1), H_.leftCols(ny + nu), segment.mean);
  }
}

/// T_m for all m, by Horner's rule from the oldest lag on.
template <int n>
void CompressedKernel<n>::sum_lags(const SegmentAutocovariances& sums, Eigen::Index lags) {
  lags_ = lags;
  if (T_.cols() < (lags + 1) * channels_) T_.resize(model_->states(), (lags + 1) * channels_);
  T_.middleCols(lags * channels_, channels_).setZero();
  for (Eigen::Index m = lags - 1; m > 0; --m) {
    const auto Gamma = sums.at(m);
    for (Eigen::Index c = 0; c < channels_; ++c) {
      State column;
      set_product(column, filter_.F, T_.col((m + 1) * channels_ + c));
      for (Eigen::Index j = 0; j < channels_; ++j) column += Gamma(c, j) * Kz_.col(j);
      T_.col(m * channels_ + c) = column;
    }
  }
}

/// Can I + Pi M be inverted without loss? With M = L L' its eigenvalues are those of I + L' Pi L; a
/// start known much better than the steady state, Pi = P0 - P < 0, brings them near zero, and its
/// first samples then tell more than the steady ones that the information counts.
template <int n>
bool CompressedKernel<n>::well_conditioned(const Square& Pi) const {
  constexpr double kLeast = 1e-2;
  Square M = M_;
  M.diagonal().array() += 1e-14 * M_.trace();  // states that are not seen leave it singular
  const Eigen::LLT<Square> root(M);
  if (root.info() != Eigen::Success) return false;
  const Square L = root.matrixL();
  Square half, relative = (1.0 - kLeast) * Square::Identity(Pi.rows(), Pi.cols());
  set_product(half, Pi, L);
  add_product(relative, L.transpose(), half);
  symmetrise(relative);
  return Eigen::LLT<Square>(relative).info() == Eigen::Success;
}

/// tr(Sigma^-1 S_e) with every product of S_e = C X C' - C Yt H' - H Yt' C' + H Gamma_0 H' taken
/// positive, whitened by L^-1, Sigma = L L': how large the numbers are that cancel in it.
template <int n>
template <class Sums>
double CompressedKernel<n>::size_of_terms(const Sums& Gamma_0) {
  const SteadySolution<n>& f = filter_;
  white_C_ = f.Ct.transpose();
  f.llt.matrixL().solveInPlace(white_C_);
  white_C_ = white_C_.cwiseAbs();
  white_H_ = H_;
  f.llt.matrixL().solveInPlace(white_H_);
  white_H_ = white_H_.cwiseAbs();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < white_C_.rows(); ++i) {
    for (Eigen::Index k = 0; k < white_C_.cols(); ++k) {
      double row = 0.0;
      for (Eigen::Index j = 0; j < white_C_.cols(); ++j) row += std::abs(X_(k, j)) * white_C_(i, j);
      for (Eigen::Index c = 0; c < channels_; ++c) {
        row += 2.0 * std::abs(Yt_(k, c)) * white_H_(i, c);
      }
      sum += white_C_(i, k) * row;
    }
    for (Eigen::Index c = 0; c < channels_; ++c) {
      for (Eigen::Index d = 0; d < channels_; ++d) {
        sum += white_H_(i, c) * std::abs(Gamma_0(c, d)) * white_H_(i, d);
      }
    }
  }
  return sum;
}

/// s = sum_t F'^t C' Sigma^-1 e(t) of the innovations from the mean of the start: the first ones say
/// where it really was.
template <int n>
auto CompressedKernel<n>::score_of_start(const SegmentAutocovariances& sums, const State& mean)
    -> State {
  const SteadySolution<n>& f = filter_;
  const Eigen::Index states = model_->states(), ny = model_->outputs(), L = memory();
  head_.resize(states, std::max(L, head_.cols()));
  e_.resize(ny, std::max(L, e_.cols()));
  State x = mean, next;
  for (Eigen::Index t = 0; t < L; ++t) {
    set_product(e_.col(t), f.Ct.transpose(), x, -1.0);
    set_product(next, f.F, x);
    for (Eigen::Index c = 0; c < channels_; ++c) {
      const double z = sums.sample(c, t);
      if (c < ny) {
        e_(c, t) += z;
      } else {
        e_.col(t) += z * H_.col(c);
      }
      next += z * Kz_.col(c);
    }
    x = next;
  }
  State s = State::Zero(states);
  for (Eigen::Index t = L - 1; t >= 0; --t) {
    set_product(next, f.F.transpose(), s);
    add_product(next, CW_, e_.col(t));
    s = next;
  }
  return s;
}

/// delta, where nothing is known of it before; false where the segment does not determine it.
template <int n>
bool CompressedKernel<n>::find_diffuse_delta(const State& s, StartTerms& terms) {
  const Eigen::Index states = model_->states();
  const Eigen::LLT<Square> llt(M_);
  if (llt.info() != Eigen::Success) return false;
  for (Eigen::Index i = 0; i < states; ++i) {
    const double pivot = llt.matrixLLT()(i, i);
    if (!(pivot * pivot > kDetermined * M_(i, i))) return false;
    terms.log_det += 2.0 * std::log(pivot);
  }
  Z_.setIdentity(states, states);
  llt.solveInPlace(Z_);
  set_product(delta_, Z_, s);
  v_.setZero(states);
  return true;
}

/// delta ~ N(0, Pi); false where I + Pi M cannot be inverted without loss.
template <int n>
bool CompressedKernel<n>::find_delta(const SegmentStart<n>& start, const State& s,
                                     StartTerms& terms) {
  const Eigen::Index states = model_->states();
  const Square Pi = start.P - filter_.P;
  Square sum = Square::Identity(states, states);
  add_product(sum, Pi, M_);
  const Eigen::PartialPivLU<Square> lu(sum);
  const double determinant = lu.determinant();
  if (!(determinant > 0.0) || !std::isfinite(determinant)) return false;
  if (start.kind == InitialState::given && !well_conditioned(Pi)) {
    reject_reason_ = RejectReason::known_start;
    return false;
  }
  terms.log_det = std::log(determinant);
  inverse_ = lu.inverse();
  set_product(Z_, inverse_, Pi);
  symmetrise(Z_);
  set_product(delta_, Z_, s);
  v_ = s;
  add_product(v_, M_, delta_, -1.0);
  terms.penalty = delta_.dot(v_);
  return true;
}

/// Yt = sum x z', with F^t x0 kept.
template <int n>
void CompressedKernel<n>::sum_states_with_channels(const SegmentAutocovariances& sums) {
  const Eigen::Index L = memory();
  sum_lags(sums, std::min(L, sums.lags()));
  Yt_ = T_.middleCols(channels_, channels_);
  State x = x0_, next;
  for (Eigen::Index t = 0; t < L; ++t) {
    head_.col(t) = x;
    for (Eigen::Index c = 0; c < channels_; ++c) Yt_.col(c) += sums.sample(c, t) * x;
    set_product(next, filter_.F, x);
    x = next;
  }
}

/// The states over the last samples, up to the one behind them.
template <int n>
void CompressedKernel<n>::find_last_state(const SegmentAutocovariances& sums) {
  const Eigen::Index states = model_->states(), L = memory(), N = sums.samples();
  tail_.resize(states, std::max(L + 1, tail_.cols()));
  State x = State::Zero(states), next;
  for (Eigen::Index t = 0; t < L; ++t) {
    tail_.col(t) = x;
    set_product(next, filter_.F, x);
    for (Eigen::Index c = 0; c < channels_; ++c) next += sums.sample(c, N - L + t) * Kz_.col(c);
    x = next;
  }
  xN_ = x;
}

/// X = sum x x'
template <int n>
template <class Sums>
void CompressedKernel<n>::sum_states(const Sums& Gamma_0) {
  const SteadySolution<n>& f = filter_;
  Square half;
  set_product(work_, f.F, Yt_);
  set_product(half, work_, Kz_.transpose());
  X_.setZero(f.A.rows(), f.A.rows());
  add_with_transpose(X_, half);
  set_product(work_, Kz_, Gamma_0);
  add_product(X_, work_, Kz_.transpose());
  add_product(X_, x0_, x0_.transpose());
  add_product(X_, xN_, xN_.transpose(), -1.0);
  f.powers.sum_forward(X_);
}

/// S_e = sum e e'
template <int n>
template <class Sums>
void CompressedKernel<n>::sum_innovations(const Sums& Gamma_0) {
  const SteadySolution<n>& f = filter_;
  set_product(work_, X_, f.Ct);
  set_product(S_e_, f.Ct.transpose(), work_);
  set_product(work_, Yt_, H_.transpose());
  set_product(small_, f.Ct.transpose(), work_);
  add_with_transpose(S_e_, small_, -1.0);
  set_product(small_, H_, Gamma_0);
  const SmallMatrix G_H = small_;
  set_product(small_, G_H, H_.transpose());
  S_e_ += small_;
}

template <int n>
bool CompressedKernel<n>::add(const Segment& segment, const SegmentStart<n>& start,
                              Likelihood& out) {
  const SteadySolution<n>& f = filter_;
  bool dynamics = false;
  for (const Direction& d : directions_) dynamics = dynamics || d.dynamics;
  nominal_ = segment.nominal && !dynamics ? &*segment.nominal : nullptr;
  sums_ = nominal_ != nullptr ? &nominal_->sums : &segment.sums;
  const SegmentAutocovariances& sums = *sums_;
  const auto samples = static_cast<double>(sums.samples());
  augment(segment);
  reject_reason_ = RejectReason::cancellation;
  StartTerms terms;
  State mean = start.mean;
  // A diffuse start is as well about the nominal one.
  if (nominal_ != nullptr && start.kind != InitialState::diffuse) mean -= nominal_->start;
  const State s = score_of_start(sums, mean);
  if (start.kind == InitialState::diffuse ? !find_diffuse_delta(s, terms)
                                          : !find_delta(start, s, terms)) {
    return false;
  }
  x0_ = mean + delta_;
  sum_states_with_channels(sums);
  find_last_state(sums);
  const auto Gamma_0 = sums.at(0);
  sum_states(Gamma_0);
  sum_innovations(Gamma_0);
  // What is left of the terms must be more than the rounding of the largest.
  constexpr double kWorstCancellation = 1e5;
  const double squares = inner_product(S_e_, f.Sigma_inverse);
  if (!(squares > 0.0) || size_of_terms(Gamma_0) > kWorstCancellation * squares) return false;

  reject_reason_ = RejectReason::none;
  const double log_det_Sigma = 2.0 * f.llt.matrixLLT().diagonal().array().log().sum();
  out.value -= 0.5 * (samples * log_det_Sigma + squares + terms.log_det + terms.penalty);
  if (directions_.empty()) return true;
  add_gradient(segment, start, out);
  if (dynamics) {
    add_full_information(segment, start, out);
  } else {
    add_noise_information(samples, out);
  }
  return true;
}

/// dx+ = F dx + a x + b z,  de = g z - dC x - C dx
template <int n>
void CompressedKernel<n>::respond(std::size_t i, const Segment& segment, Response& r) const {
  const StateSpace& m = *model_;
  const StateSpace& by = (*derivatives_)[i];
  const Direction& d = directions_[i];
  const Eigen::Index ny = m.outputs(), nu = m.inputs();
  r.a = by.A;
  add_product(r.a, d.K, m.C, -1.0);
  add_product(r.a, filter_.K, by.C, -1.0);
  r.dC = by.C;
  r.b.setZero(m.states(), channels_);
  r.g.setZero(ny, channels_);
  r.b.leftCols(ny) = d.K;
  if (nominal_ != nullptr) return;
  if (nu > 0) {
    r.b.middleCols(ny, nu) = by.B;
    add_product(r.b.middleCols(ny, nu), d.K, m.D, -1.0);
    add_product(r.b.middleCols(ny, nu), filter_.K, by.D, -1.0);
    r.g.middleCols(ny, nu) = -by.D;
  }
  if (segment.mean.size() > 0) {
    set_product(r.b.col(channels_ - 1), r.b.leftCols(ny + nu), segment.mean);
    set_product(r.g.col(channels_ - 1), r.g.leftCols(ny + nu), segment.mean);
  }
}

/// dx behind the last sample.
template <int n>
auto CompressedKernel<n>::last_response(const Response& r) const -> State {
  const Eigen::Index L = memory(), N = sums_->samples();
  State dx = State::Zero(model_->states()), next;
  for (Eigen::Index t = 0; t < L; ++t) {
    set_product(next, filter_.F, dx);
    add_product(next, r.a, tail_.col(t));
    for (Eigen::Index c = 0; c < channels_; ++c) {
      next += sums_->sample(c, N - L + t) * r.b.col(c);
    }
    dx = next;
  }
  return dx;
}

template <int n>
void CompressedKernel<n>::end_of_segment(const Segment& segment, FilterState& state) {
  state.x = xN_;
  if (nominal_ != nullptr) state.x += nominal_->end;
  state.P = filter_.P;
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    Response r;
    respond(i, segment, r);
    state.x_theta[i] = last_response(r);
    state.P_theta[i] = directions_[i].P;
  }
}

}  // namespace identikal
