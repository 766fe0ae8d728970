#include "lib/filter/internal/recursion.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "lib/base/constants.h"
#include "lib/base/message.h"
#include "lib/filter/internal/direct_kernel.h"
#include "lib/internal/stationary_start.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

Measurement rows_present(const Measurement& full, const std::vector<Index>& present) {
  const auto m = static_cast<Index>(present.size());
  Measurement out{MatrixXd(m, full.C.cols()), MatrixXd(m, full.D.cols()), MatrixXd(m, m),
                  MatrixXd(full.Sw.rows(), m)};
  for (Index i = 0; i < m; ++i) {
    const Index from = present[i];
    out.C.row(i) = full.C.row(from);
    out.D.row(i) = full.D.row(from);
    out.Sw.col(i) = full.Sw.col(from);
    for (Index j = 0; j < m; ++j) out.R(i, j) = full.R(from, present[j]);
  }
  return out;
}

Measurement measurement_derivative(const StateSpace& model, const StateSpace& d) {
  return {d.C, d.D, d.R, d.G * model.S + model.G * d.S};
}

}  // namespace

void check_shapes(const StateSpace& model, InitialState initial,
                  const std::vector<StateSpace>& derivatives) {
  const auto check_start = [&](const StateSpace& m) {
    const Index n = model.states();
    if (initial != InitialState::given && initial != InitialState::partly_diffuse) return;
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

void check_sizes(const StateSpace& model, const Eigen::Ref<const MatrixXd>& y,
                 const Eigen::Ref<const MatrixXd>& u) {
  require_argument(
      y.rows() == model.outputs() && u.rows() == model.inputs() &&
          (model.inputs() == 0 || u.cols() == y.cols()),
      {"kalman filter: y is ", y.rows(), " x ", y.cols(), " and u ", u.rows(), " x ", u.cols(),
       ", the model has ", model.outputs(), " outputs and ", model.inputs(), " inputs"});
}

// ---- The start

Recursion::Recursion(const StateSpace& model, InitialState initial,
                     const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                     const std::vector<StateSpace>& derivatives)
    : model_(model), y_(y), u_(u), sensitivities_(derivatives.size()) {
  check_shapes(model, initial, derivatives);
  check_sizes(model, y, u);
  take_model(derivatives);
  const Index n = model_.states();
  P_ = MatrixXd::Zero(n, n);
  Z_ = MatrixXd::Zero(n, 1);
  for (Sensitivity& s : sensitivities_) {
    s.P = P_;
    s.Z = Z_;
  }
  switch (initial) {
    case InitialState::given:
      start_given(derivatives);
      break;
    case InitialState::stationary:
      if (!start_stationary()) status_ = FilterStatus::unstable;
      break;
    case InitialState::diffuse:
    case InitialState::partly_diffuse:
      start_diffuse(initial, derivatives);
      break;
  }
}

void Recursion::start_given(const std::vector<StateSpace>& derivatives) {
  P_ = model_.P0;
  Z_.col(0) = model_.x0;
  for (std::size_t i = 0; i < sensitivities_.size(); ++i) {
    sensitivities_[i].P = derivatives[i].P0;
    sensitivities_[i].Z.col(0) = derivatives[i].x0;
  }
}

// P = A P A' + W; false unless A is stable.
bool Recursion::start_stationary() {
  StationaryStart start;
  if (!start.compute(model_.A, W_)) return false;
  P_ = start.P();
  for (Sensitivity& s : sensitivities_) s.P = start.derivative(s.A, s.W);
  return true;
}

void Recursion::start_diffuse(InitialState initial, const std::vector<StateSpace>& derivatives) {
  const std::optional<ProperStart> start = proper_start(model_, initial);
  if (!start) {
    status_ = FilterStatus::unstable;
    return;
  }
  if (start->diffuse() > 0) diffuse_.emplace(start->scale, sensitivities_.size());
  P_ = start->P;
  Z_ = start->Z;
  for (std::size_t i = 0; i < sensitivities_.size(); ++i) {
    Sensitivity& s = sensitivities_[i];
    s.Z = MatrixXd::Zero(Z_.rows(), Z_.cols());
    if (initial == InitialState::diffuse) continue;
    s.P = derivatives[i].P0;
    s.Z.col(0) = derivatives[i].x0;
  }
}

void Recursion::take_model(const std::vector<StateSpace>& derivatives) {
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

void Recursion::set_model_change(std::function<void(Index)> next,
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

// ---- One sample

void Recursion::find_present(Index t) {
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

void Recursion::innovate(Index t, bool keep_gain) {
  E_.noalias() = -now_.C * Z_;
  for (std::size_t i = 0; i < present_.size(); ++i) E_(i, 0) += y_(present_[i], t);
  if (u_.rows() > 0) E_.col(0).noalias() -= now_.D * u_.col(t);
  if (!keep_gain) find_gain();
  if (status_ != FilterStatus::ok) return;
  SiE_ = llt_.solve(E_);
  if (!keep_gain) innovate_derivatives(t);
}

void Recursion::find_gain() {
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
}

void Recursion::innovate_derivatives(Index t) {
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

void Recursion::add_terms(Likelihood& out) {
  out.value -= 0.5 * (log_determinant(llt_) + E_.col(0).dot(SiE_.col(0)));
  if (diffuse_) diffuse_->add(E_, SiE_);
  std::vector<MatrixXd> relative;  // Sigma^-1 dSigma
  std::vector<VectorXd> whitened;  // L^-1 de
  for (std::size_t i = 0; i < sensitivities_.size(); ++i) {
    const Sensitivity& s = sensitivities_[i];
    const MatrixXd SidS = llt_.solve(s.Sigma);
    out.gradient[i] -= 0.5 * (SidS.trace() + 2.0 * s.E.col(0).dot(SiE_.col(0)) -
                              SiE_.col(0).dot(s.Sigma * SiE_.col(0)));
    if (diffuse_) {
      diffuse_->add_derivative(i, s, SiE_);
      continue;
    }
    relative.push_back(SidS);
    whitened.push_back(llt_.matrixL().solve(s.E.col(0)));
    for (std::size_t j = 0; j <= i; ++j) {
      const double term = 0.5 * (relative[j].transpose().cwiseProduct(SidS)).sum() +
                          whitened[j].dot(whitened.back());
      out.information(i, j) += term;
      if (i != j) out.information(j, i) += term;
    }
  }
}

void Recursion::advance(Index t, bool keep_gain) {
  if (!keep_gain) settled_ = static_cast<Index>(present_.size()) == y_.rows();
  advance_derivatives(t);
  MatrixXd Z = model_.A * Z_;
  Z.noalias() += K_ * E_;
  if (u_.rows() > 0) Z.col(0).noalias() += model_.B * u_.col(t);
  Z_.swap(Z);
  if (keep_gain) return;
  const MatrixXd KS = K_ * now_.Sw.transpose();
  MatrixXd P = F_ * P_ * F_.transpose() + W_ - KS - KS.transpose();
  P.noalias() += K_ * now_.R * K_.transpose();
  P = 0.5 * (P + P.transpose()).eval();
  settled_ = settled_ && has_settled(P_, P, 1e-14);
  P_.swap(P);
}

void Recursion::advance_derivatives(Index t) {
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
}

void Recursion::advance_unmeasured(Index t) {
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

// Has the covariance stopped changing, to rounding? Entries are measured against the standard
// deviations they belong to. The derivatives settle together with it, a few steps later.
bool Recursion::has_settled(const MatrixXd& before, const MatrixXd& after, double tolerance) const {
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

bool Recursion::fold_in(Likelihood& out) {
  if (!diffuse_->fold_in(P_, Z_, sensitivities_, out)) return false;
  folded_ = diffuse_->states();
  diffuse_.reset();
  return true;
}

// ---- The whole recording

Likelihood Recursion::run(RecursionOptions& options, FilterResult* store) {
  Likelihood out;
  const auto k = static_cast<Index>(sensitivities_.size());
  out.gradient = VectorXd::Zero(k);
  out.information = MatrixXd::Zero(k, k);
  // States are wanted at every sample; a model that changes has no constant gain.
  const bool may_run_on =
      options.constant_gain && !change_model_ && (store == nullptr || store->P_pred.empty());
  Place place;
  for (Index t = 0; t < y_.cols() && status_ == FilterStatus::ok;) {
    if (change_model_ && t > 0) change_model_(t);
    const Index skipped_to = skip_segment(t, place, store != nullptr, options, out);
    if (skipped_to > t) {
      t = skipped_to;
      continue;
    }
    if (status_ == FilterStatus::ok) step(t, out, store);
    if (status_ != FilterStatus::ok) break;
    ++t;
    if (settled_ && !diffuse_ && may_run_on) {
      t = run_with_constant_gain(t, place.segment, out, store);
    }
  }
  finish(out);
  return out;
}

// Once every direction of delta is determined, it is folded in.
void Recursion::step(Index t, Likelihood& out, FilterResult* store) {
  find_present(t);
  if (!present_.empty()) innovate(t, false);
  if (status_ != FilterStatus::ok) return;
  if (store != nullptr) {
    if (!store->P_pred.empty()) store_states(*store, t);
    if (!diffuse_) store_innovation(*store, t);
  }
  if (present_.empty()) {
    advance_unmeasured(t);
  } else {
    add_terms(out);
    advance(t, false);
  }
  if (diffuse_ && diffuse_->is_determined(t + 1 == y_.cols()) && fold_in(out) && store != nullptr) {
    store->first_proper = t + 1;
  }
}

// The segment that sample t lies in, where there is a way to take all of it at once. Returns the
// first sample that is not processed.
Index Recursion::skip_segment(Index t, Place& place, bool storing, RecursionOptions& options,
                              Likelihood& out) {
  if (options.segments == nullptr) return t;
  if (place.next < options.segments->size() && (*options.segments)[place.next].begin == t) {
    place.segment = &(*options.segments)[place.next++];
    place.direct_tried = false;
    if (options.kernel != nullptr && run_by_kernel(*place.segment, options, out)) {
      return t + place.segment->sums.samples();
    }
  }
  if (place.segment == nullptr || place.direct_tried || diffuse_ || !sensitivities_.empty() ||
      storing) {
    return t;
  }
  place.direct_tried = true;
  return run_by_direct_code(t, *place.segment, options.constant_gain && !change_model_, out);
}

// false: the segment is too short, or sums would lose digits.
bool Recursion::run_by_kernel(const Segment& segment, RecursionOptions& options, Likelihood& out) {
  SegmentKernel& kernel = *options.kernel;
  const std::size_t k = sensitivities_.size();
  if (segment.sums.samples() <= kernel.memory()) return false;
  FilterState state;
  state.x_theta.resize(k);
  state.P_theta.resize(k);
  // Only an untouched start is known to the kernel.
  if (diffuse_ && (samples_ > 0 || segment.begin > 0 || diffuse_->states() < P_.rows())) {
    options.late = true;
    return false;
  }
  if (!diffuse_) {
    state.x = Z_.col(0);
    state.P = P_;
    for (std::size_t i = 0; i < k; ++i) {
      state.x_theta[i] = sensitivities_[i].Z.col(0);
      state.P_theta[i] = sensitivities_[i].P;
    }
  }
  if (diffuse_ ? !kernel.add_from_model(segment, InitialState::diffuse, out)
               : !kernel.add_from_state(segment, state, out)) {
    options.cancelled = true;
    return false;
  }
  if (diffuse_) {
    folded_ = diffuse_->states();
    diffuse_.reset();
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

// From sample t of a segment on by code made for these sizes, if there is any.
Index Recursion::run_by_direct_code(Index t, const Segment& segment, bool stop_when_settled,
                                    Likelihood& out) {
  const Index end = segment.begin + segment.sums.samples();
  if (t >= end) return t;
  DirectRun run;
  run.x = Z_.col(0);
  run.P = P_;
  const DirectFilter filter{model_, W_, full_.Sw, y_, u_, end, stop_when_settled};
  const Index next = run_direct(filter, t, run);
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

// From sample t on, as long as no sample is missing. Returns the first one that is not processed.
Index Recursion::run_with_constant_gain(Index t, Segment* segment, Likelihood& out,
                                        FilterResult* store) {
  const SettledFilter filter{model_, F_, K_, llt_, sensitivities_};
  const Index begin = t;
  VectorXd x = Z_.col(0);
  if (segment != nullptr && sensitivities_.empty() && store == nullptr && u_.rows() == 0) {
    t = run_in_lanes(filter, y_, *segment, t, x, out.value);
  }
  SteadyRun steady(filter, y_, u_, std::move(x));
  t = steady.run(t, store, innovation_sd());
  steady.add_to(out);
  Z_.col(0) = steady.x();
  for (std::size_t i = 0; i < sensitivities_.size(); ++i) {
    sensitivities_[i].Z.col(0) = steady.x_theta().col(i);
  }
  samples_ += (t - begin) * y_.rows();
  settled_ = false;
  return t;
}

void Recursion::finish(Likelihood& out) {
  if (status_ == FilterStatus::ok && diffuse_) status_ = FilterStatus::undetermined;
  out.value -= 0.5 * kLogTwoPi * static_cast<double>(samples_ - folded_);
  if (status_ == FilterStatus::ok && !(std::isfinite(out.value) && out.gradient.allFinite())) {
    status_ = FilterStatus::not_finite;
  }
  out.status = status_;
}

// ---- What is stored of a sample, or shown

// Of every channel, measured or not.
VectorXd Recursion::innovation_sd() const {
  const MatrixXd CP = full_.C * P_;
  return (CP.cwiseProduct(full_.C).rowwise().sum() + full_.R.diagonal()).cwiseSqrt();
}

// P C' Sigma^-1
MatrixXd Recursion::filter_gain() const { return llt_.solve(PC_.transpose()).transpose(); }

MatrixXd Recursion::filtered_covariance(const MatrixXd& Kf) const {
  const MatrixXd F = MatrixXd::Identity(P_.rows(), P_.rows()) - Kf * now_.C;
  return F * P_ * F.transpose() + Kf * now_.R * Kf.transpose();
}

void Recursion::store_innovation(FilterResult& store, Index t) const {
  store.e_sd.col(t) = innovation_sd();
  if (present_.empty()) return;
  const VectorXd z = llt_.matrixL().solve(E_.col(0));
  for (std::size_t i = 0; i < present_.size(); ++i) {
    store.e(present_[i], t) = E_(i, 0);
    store.standardised(present_[i], t) = z[i];
  }
}

void Recursion::store_states(FilterResult& store, Index t) const {
  const Index n = P_.rows(), ny = y_.rows();
  if (diffuse_) {
    store.P_pred[t] = store.P_filt[t] = MatrixXd::Constant(n, n, kNaN);
    store.Sigma[t] = MatrixXd::Constant(ny, ny, kNaN);
    return;
  }
  VectorXd x = Z_.col(0);
  MatrixXd P = P_;
  store.x_pred.col(t) = x;
  store.P_pred[t] = P;
  if (!present_.empty()) {
    const MatrixXd Kf = filter_gain();
    x += Kf * E_.col(0);
    P = filtered_covariance(Kf);
  }
  store.x_filt.col(t) = x;
  store.P_filt[t] = P;
  store.Sigma[t] = full_.C * P_ * full_.C.transpose() + full_.R;
}

void Recursion::watch(Index from, Index to, Likelihood& out, const FilterWatcher& see) {
  for (Index t = from; t < to && status_ == FilterStatus::ok; ++t) {
    if (change_model_ && t > 0) change_model_(t);
    find_present(t);
    // A gain that has settled at the sample before is this sample's, too.
    const bool same_gain =
        settled_ && !change_model_ && static_cast<Index>(present_.size()) == y_.rows();
    if (present_.empty()) {
      show(t, same_gain, see);
      advance_unmeasured(t);
    } else {
      innovate(t, same_gain);
      if (status_ != FilterStatus::ok) break;
      add_terms(out);
      show(t, same_gain, see);
      advance(t, same_gain);
    }
    if (diffuse_ && t + 1 == y_.cols() && diffuse_->is_determined(true)) fold_in(out);
    if (diffuse_ && diffuse_->is_forgotten(P_, Z_)) fold_in(out);
  }
}

void Recursion::show(Index t, bool same_gain, const FilterWatcher& see) {
  const bool measured = !present_.empty();
  if (!same_gain) {
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
  step_.same_gain = same_gain;
  step_.Z_filt = Z_;
  step_.score.setZero(Z_.rows(), Z_.cols());
  if (measured) {
    step_.Z_filt.noalias() += Kf_ * E_;
    step_.score.noalias() = now_.C.transpose() * SiE_;
  }
  if (diffuse_) {
    step_.delta_information = diffuse_->information;
    step_.delta_score = diffuse_->score;
    step_.delta_scale = diffuse_->scale;
  }
  see(step_);
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
