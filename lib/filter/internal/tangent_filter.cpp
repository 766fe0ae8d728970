#include "lib/filter/internal/tangent_filter.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include <Eigen/Cholesky>

#include "lib/base/constants.h"
#include "lib/filter/internal/sensitivity.h"
#include "lib/internal/lane_count.h"
#include "lib/internal/stationary_start.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Up to here the kernel is made for the number of states and F is dense.
constexpr Index kUnrolled = simd::kUnrolledStates;

MatrixXd rows_of(const MatrixXd& M, const std::vector<int>& rows) {
  MatrixXd out(static_cast<Index>(rows.size()), M.cols());
  for (Index i = 0; i < out.rows(); ++i) out.row(i) = M.row(rows[static_cast<std::size_t>(i)]);
  return out;
}

MatrixXd columns_of(const MatrixXd& M, const std::vector<int>& columns) {
  return rows_of(M.transpose(), columns).transpose();
}

}  // namespace

// ---- The model in lanes

// Of an element, counted row by row, in lane l.
std::size_t TangentFilter::place(Index elements, Index element, std::size_t l) const {
  return (l / lanes_ * static_cast<std::size_t>(elements) + static_cast<std::size_t>(element)) *
             lanes_ +
         l % lanes_;
}

void TangentFilter::take_square(const double* of, Index size, std::size_t l, MatrixXd& out) const {
  out.resize(size, size);
  for (Index i = 0; i < size; ++i) {
    for (Index j = 0; j < size; ++j) out(i, j) = of[place(size * size, i * size + j, l)];
  }
}

void TangentFilter::take_vector(const double* of, Index size, std::size_t l, VectorXd& out) const {
  out.resize(size);
  for (Index i = 0; i < size; ++i) out[i] = of[place(size, i, l)];
}

// Of a state and its responses, column by column.
void TangentFilter::take_columns(const double* of, Index columns, std::size_t l,
                                 MatrixXd& out) const {
  out.resize(n_, columns);
  for (Index i = 0; i < out.size(); ++i) out.data()[i] = of[place(out.size(), i, l)];
}

MatrixXd TangentFilter::matrix(const double* of, std::size_t l) const {
  MatrixXd out;
  take_square(of, n_, l, out);
  return out;
}

VectorXd TangentFilter::vector(const double* of, Index size, std::size_t l) const {
  VectorXd out;
  take_vector(of, size, l, out);
  return out;
}

void TangentFilter::set_matrix(double* of, std::size_t l, const MatrixXd& value) const {
  for (Index i = 0; i < n_; ++i) {
    for (Index j = 0; j < n_; ++j) of[place(n_ * n_, i * n_ + j, l)] = value(i, j);
  }
}

void TangentFilter::set_vector(double* of, std::size_t l, const VectorXd& value) const {
  const Index size = value.size();
  for (Index i = 0; i < size; ++i) of[place(size, i, l)] = value[i];
}

// Lane 0 comes first and clears the others.
void TangentFilter::fill(Lanes& to, std::size_t l, const MatrixXd& value) const {
  if (l == 0) to.assign(static_cast<std::size_t>(value.size()) * lanes_ * blocks_, 0.0);
  for (Index i = 0; i < value.rows(); ++i) {
    for (Index j = 0; j < value.cols(); ++j) {
      to[place(value.size(), i * value.cols() + j, l)] = value(i, j);
    }
  }
}

bool TangentFilter::is_quick_from_stationary(const StateSpace& model, InitialState initial) {
  return initial == InitialState::stationary && model.states() > kUnrolled;
}

void TangentFilter::prepare(const StateSpace& model, const std::vector<StateSpace>& derivatives) {
  changing_ = false;
  model_ = &model;
  derivatives_ = &derivatives;
  n_ = model.states(), ny_ = model.outputs(), nu_ = model.inputs();
  lanes_ = static_cast<std::size_t>(simd::lane_count(static_cast<int>(derivatives.size())));
  blocks_ = derivatives.size() / lanes_ + 1;
  find_structure();
  fill_A();
  fill_common();
  for (Pattern& p : patterns_) {
    p.ready = false;
    p.in_vain = 0;
    for (Passage& passage : p.passages) passage.known = false;
  }
}

// Which entries of A may differ from zero: of a model that changes, all.
void TangentFilter::find_structure() {
  A_row_.assign(1, 0);
  A_column_.clear();
  for (Index i = 0; i < n_; ++i) {
    for (Index j = 0; j < n_; ++j) {
      if (changing_ || model_->A(i, j) != 0.0) A_column_.push_back(static_cast<int>(j));
    }
    // A row of a product has one at least.
    const bool empty = A_row_.back() == static_cast<int>(A_column_.size());
    if (empty && n_ > kUnrolled) A_column_.push_back(static_cast<int>(i));
    A_row_.push_back(static_cast<int>(A_column_.size()));
  }
}

void TangentFilter::fill_A() {
  A_entry_.clear();
  for (std::size_t i = 0; i + 1 < A_row_.size(); ++i) {
    for (int at = A_row_[i]; at < A_row_[i + 1]; ++at) {
      A_entry_.push_back(model_->A(static_cast<Index>(i), A_column_[static_cast<std::size_t>(at)]));
    }
  }
  A_.clear();
  for (Index i = 0; n_ <= kUnrolled && i < n_; ++i) {
    for (Index j = 0; j < n_; ++j) A_.push_back(model_->A(i, j));
  }
}

void TangentFilter::fill_common() {
  const StateSpace& m = *model_;
  const std::vector<StateSpace>& by = *derivatives_;
  const MatrixXd GQ = m.G * m.Q;
  Sw_.resize(1 + by.size());
  Sw_[0] = m.G * m.S;
  fill(W_, 0, GQ * m.G.transpose());
  fill(B_, 0, m.B);
  crossed_ = !Sw_[0].isZero(0.0);
  diagonal_R_ = m.R.isDiagonal(0.0);
  dynamics_ = false;
  for (std::size_t i = 0; i < by.size(); ++i) {
    const StateSpace& d = by[i];
    const bool moves_G = !d.G.isZero(0.0);
    if (moves_G || !d.Q.isZero(0.0)) {
      MatrixXd W = m.G * d.Q * m.G.transpose();
      if (moves_G) {
        const MatrixXd half = d.G * GQ.transpose();
        W += half + half.transpose();
      }
      fill(W_, 1 + i, W);
    }
    fill(B_, 1 + i, d.B);
    Sw_[1 + i] = d.G * m.S + m.G * d.S;
    crossed_ = crossed_ || !Sw_[1 + i].isZero(0.0);
    diagonal_R_ = diagonal_R_ && d.R.isDiagonal(0.0);
    dynamics_ = dynamics_ || !d.A.isZero(0.0) || !d.C.isZero(0.0);
  }
  if (!dynamics_) return;
  std::vector<int> all(static_cast<std::size_t>(n_));
  std::iota(all.begin(), all.end(), 0);
  A_theta_ = moved_entries(by, &StateSpace::A, all, lanes_);
}

// All but the channels.
simd::TangentModel TangentFilter::common_model() const {
  simd::TangentModel out;
  out.n = static_cast<int>(n_), out.nu = static_cast<int>(nu_);
  out.blocks = static_cast<int>(blocks_), out.lanes = static_cast<int>(lanes_);
  out.derivatives = static_cast<int>(derivatives_->size());
  out.A = A_.data();
  out.A_row = A_row_.data(), out.A_column = A_column_.data(), out.A_entry = A_entry_.data();
  out.W = W_.data(), out.B = B_.data();
  out.A_theta_row = A_theta_.row.data(), out.A_theta_column = A_theta_.column.data();
  out.A_theta = dynamics_ ? A_theta_.by.data() : nullptr;
  out.diagonal_R = diagonal_R_;
  return out;
}

void TangentFilter::fill_pattern(Pattern& p, const std::vector<int>& channels) const {
  const StateSpace& m = *model_;
  const bool all = static_cast<Index>(channels.size()) == ny_;
  const MatrixXd C = all ? m.C : rows_of(m.C, channels);
  p.C_row.assign(1, 0);
  p.C_column.clear();
  p.C.clear();
  for (Index i = 0; i < C.rows(); ++i) {
    for (Index j = 0; j < n_; ++j) {
      if (C(i, j) == 0.0) continue;
      p.C_column.push_back(static_cast<int>(j));
      p.C.push_back(C(i, j));
    }
    p.C_row.push_back(static_cast<int>(p.C.size()));
  }
  const std::vector<StateSpace>& by = *derivatives_;
  for (std::size_t l = 0; l <= by.size(); ++l) {
    const StateSpace& of = l == 0 ? m : by[l - 1];
    fill(p.R, l, all ? of.R : columns_of(rows_of(of.R, channels), channels));
    fill(p.S, l, all ? Sw_[l] : columns_of(Sw_[l], channels));
    fill(p.D, l, all ? of.D : rows_of(of.D, channels));
  }
  if (dynamics_) p.C_theta = moved_entries(by, &StateSpace::C, channels, lanes_);
  simd::TangentModel& to = p.model;
  to = common_model();
  to.m = static_cast<int>(C.rows());
  to.C_row = p.C_row.data(), to.C_column = p.C_column.data(), to.C = p.C.data();
  to.channel = channels.data();
  to.R = p.R.data(), to.S = crossed_ ? p.S.data() : nullptr, to.D = p.D.data();
  to.C_theta_row = p.C_theta.row.data(), to.C_theta_column = p.C_theta.column.data();
  to.C_theta = dynamics_ ? p.C_theta.by.data() : nullptr;
  p.ready = true;
}

// ---- State and workspace

void TangentFilter::reserve() {
  const std::size_t n = static_cast<std::size_t>(n_), m = static_cast<std::size_t>(ny_);
  const std::size_t all = lanes_ * blocks_, d = static_cast<std::size_t>(scale_.size());
  const std::size_t columns = 1 + d;
  const std::size_t white = m * (m + 1) / 2 + m,
                    entries = std::max(n * n, A_column_.size() + n * m);
  const bool moves = dynamics_ || changing_;
  std::size_t used = 0;
  const auto lay_out = [&](double*& to, std::size_t size) {
    if (!memory_.empty()) to = memory_.data() + used;
    used += (size + 7) / 8 * 8;  // whole lines
  };
  const auto lay_out_all = [&] {
    used = 0;
    simd::TangentRun& r = run_;
    for (double** each : {&r.P, &r.next_P}) lay_out(*each, n * n * all);
    lay_out(r.T, n * (n + m) * all);
    lay_out(r.CP, m * n * lanes_);
    for (double** each : {&r.x, &r.next_x}) lay_out(*each, columns * n * all);
    for (double** each : {&r.PC, &r.K_theta}) lay_out(*each, n * m * all);
    lay_out(r.Sigma, m * m * all);
    lay_out(r.E, columns * m * all);
    lay_out(r.white, white * all);
    lay_out(r.white_lanes, std::max(n * m, all));
    lay_out(r.F, entries);
    lay_out(r.K, n * m);
    lay_out(r.L_inverse, m * m);
    lay_out(r.Sigma_inverse, m * m);
    lay_out(r.Sie, m);
    lay_out(r.dC_PF, moves ? m * n * lanes_ : 0);
    lay_out(r.dC_PC, moves ? m * m * lanes_ : 0);
    lay_out(r.work, m * m + m * m * lanes_);
    simd::TangentRun::Stationary& s = r.stationary;
    for (double** each : {&s.Y, &s.next_Y, &s.N, &s.YH}) lay_out(*each, n * m * all);
    for (double** each : {&s.M, &s.G, &s.H}) lay_out(*each, m * m * all);
    lay_out(s.largest, all);
    lay_out(s.first_Sigma, m);
    lay_out(r.gradient, all);
    lay_out(r.information, (1 + derivatives_->size()) * all);
    lay_out(r.half_traces, all);
    lay_out(r.delta_information, d * d * all);
    lay_out(r.delta_score, d * all);
  };
  memory_.clear();
  lay_out_all();
  memory_.assign(used, 0.0);
  lay_out_all();
  run_.columns = static_cast<int>(columns);
  run_.informed = d == 0;
  run_.squares = run_.log_det = 0.0;
  run_.determinant = 1.0;
}

bool TangentFilter::start_stationary() {
  using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  StationaryStart start;
  if (!start.compute(model_->A, matrix(W_.data(), 0))) return false;
  if (start_register(start)) return true;
  const Powers<Eigen::Dynamic>* by = start.powers();
  if (by == nullptr) return false;
  std::vector<double> powers;
  powers.reserve(static_cast<std::size_t>(by->count() * n_ * n_));
  for (int q = 0; q < by->count(); ++q) {
    const RowMatrix power = by->power(q);
    powers.insert(powers.end(), power.data(), power.data() + power.size());
  }
  const RowMatrix P = start.P(), PA = start.PA();
  simd::start_stationary_tangents(common_model(), run_, powers.data(), by->count(), P.data(),
                                  PA.data());
  return true;
}

// false: a derivative leaves no register.
bool TangentFilter::start_register(StationaryStart& start) {
  std::vector<MatrixXd> dP;
  for (std::size_t l = 1; l <= derivatives_->size(); ++l) {
    const MatrixXd &dA = (*derivatives_)[l - 1].A, dW = matrix(W_.data(), l);
    if (!start.is_quick(dA, dW)) return false;
    dP.push_back(start.derivative(dA, dW));
  }
  set_matrix(run_.P, 0, start.P());
  for (std::size_t l = 0; l < dP.size(); ++l) set_matrix(run_.P, 1 + l, dP[l]);
  return true;
}

FilterStatus TangentFilter::begin(InitialState initial) {
  diffuse_ = initial == InitialState::diffuse || initial == InitialState::partly_diffuse;
  rejected_ = late_ = false;
  samples_ = folded_ = jumped_ = until_folded_ = 0;
  start_squares_ = 0.0;
  e_sd_.setZero(ny_);
  if (diffuse_) return start_diffuse(initial);
  scale_.resize(0);
  reserve();
  const std::size_t k = derivatives_->size();
  if (initial == InitialState::given) {
    for (std::size_t l = 0; l <= k; ++l) {
      const StateSpace& of = l == 0 ? *model_ : (*derivatives_)[l - 1];
      set_matrix(run_.P, l, of.P0);
      set_vector(run_.x, l, of.x0);
    }
  } else {
    if (!start_stationary()) return FilterStatus::unstable;
  }
  return FilterStatus::ok;
}

FilterStatus TangentFilter::start_diffuse(InitialState initial) {
  const std::optional<ProperStart> start = proper_start(*model_, initial);
  if (!start) return FilterStatus::unstable;
  scale_ = start->scale;
  start_.begin(scale_, derivatives_->size());
  reserve();
  diffuse_ = scale_.size() > 0;
  set_matrix(run_.P, 0, start->P);
  const Index columns = 1 + scale_.size();
  set_vector(run_.x, 0, start->Z.reshaped());
  if (initial == InitialState::diffuse) return FilterStatus::ok;
  for (std::size_t l = 1; l <= derivatives_->size(); ++l) {
    const StateSpace& d = (*derivatives_)[l - 1];
    set_matrix(run_.P, l, d.P0);
    VectorXd x = VectorXd::Zero(columns * n_);
    x.head(n_) = d.x0;
    set_vector(run_.x, l, x);
  }
  return FilterStatus::ok;
}

// ---- The recording

void TangentFilter::take_channels(const Presence& presence) {
  if (channels_ == presence.channels) return;
  channels_ = presence.channels;
  patterns_.assign(channels_.size(), {});
}

// From sample t of a part on, to its end or some sample before.
FilterStatus TangentFilter::go_on(const TangentRecording& recording, const Presence::Part& part,
                                  Index& t, Index end, Likelihood& out) {
  Pattern& p = patterns_[part.pattern];
  if (!p.ready) fill_pattern(p, channels_[part.pattern]);
  if (diffuse_) return run_diffuse(p, recording, t, end, out);
  const bool may_come_back = recording.watcher == nullptr;  // it is shown the covariance, too
  if (may_come_back && end - t <= kLongestPassage && recording.presence.parts.size() > 1) {
    if (p.in_vain < kPatience) return run_passage(p, recording, t, end, out);
    if (++p.in_vain == kPatience + kRest) p.in_vain = 0;
  }
  return run_stretch(p, recording, t, end, out);
}

FilterStatus TangentFilter::run(const TangentRecording& recording, InitialState initial,
                                Likelihood& out) {
  take_channels(recording.presence);
  FilterStatus status = begin(initial);
  stationary_ = is_quick_from_stationary(*model_, initial) && recording.presence.parts.size() == 1;
  scored_ = out.gradient;
  std::size_t next = 0;
  for (const Presence::Part& part : recording.presence.parts) {
    for (Index t = part.begin; t < part.end && status == FilterStatus::ok;) {
      const std::vector<Segment>& segments = recording.segments;
      while (next < segments.size() && segments[next].begin < t) ++next;
      Index end = part.end;
      if (recording.kernel != nullptr && next < segments.size()) {
        const Segment& segment = segments[next];
        if (segment.begin == t && run_by_kernel(segment, *recording.kernel, out)) {
          t += segment.sums.samples();
          continue;
        }
        if (segment.begin > t) end = std::min(end, segment.begin);
      }
      status = go_on(recording, part, t, end, out);
    }
    if (status != FilterStatus::ok) return status;
  }
  if (status != FilterStatus::ok) return status;
  if (diffuse_) return FilterStatus::undetermined;
  add_sums(out);
  return FilterStatus::ok;
}

std::vector<double> TangentFilter::predicted() const {
  const std::size_t all = lanes_ * blocks_, n = static_cast<std::size_t>(n_);
  std::vector<double> out(run_.x, run_.x + n * all);
  out.insert(out.end(), run_.P, run_.P + n * n * all);
  return out;
}

void TangentFilter::go_back_to(const std::vector<double>& state) {
  const std::size_t x = static_cast<std::size_t>(n_) * lanes_ * blocks_;
  std::copy_n(state.begin(), x, run_.x);
  std::copy(state.begin() + static_cast<std::ptrdiff_t>(x), state.end(), run_.P);
}

// The pattern of one sample, which may be new.
std::size_t TangentFilter::pattern_of(const VectorXd& y) {
  std::vector<int> present;
  for (Index i = 0; i < y.size(); ++i) {
    if (!std::isnan(y[i])) present.push_back(static_cast<int>(i));
  }
  const auto at = std::find(channels_.begin(), channels_.end(), present);
  const auto out = static_cast<std::size_t>(at - channels_.begin());
  if (at == channels_.end()) {
    channels_.push_back(std::move(present));
    patterns_.emplace_back();
  }
  return out;
}

// The parts of samples from .. end - 1.
std::vector<Presence::Part> TangentFilter::parts_between(const MatrixXd& y, Index from, Index end) {
  const auto same = [&y](Index t, Index s) {
    return (y.col(t).array().isNaN() == y.col(s).array().isNaN()).all();
  };
  std::vector<Presence::Part> out;
  for (Index t = from; t < end; ++t) {
    if (t > from && same(t, t - 1)) {
      out.back().end = t + 1;
    } else {
      out.push_back({t, t + 1, pattern_of(y.col(t))});
    }
  }
  return out;
}

FilterStatus TangentFilter::go_to(const MatrixXd& y, const MatrixXd& u, FilterResult& store,
                                  Index& t, Index end) {
  const Presence here{{}, parts_between(y, t, end)};
  const std::vector<Segment> whole;
  const TangentRecording recording{y, u, here, whole, nullptr, &store, nullptr};
  Likelihood unused;
  const bool began_diffuse = diffuse_;
  for (const Presence::Part& part : here.parts) {
    while (t < part.end && diffuse_ == began_diffuse) {
      const FilterStatus status = go_on(recording, part, t, part.end, unused);
      if (status != FilterStatus::ok) return status;
    }
  }
  return FilterStatus::ok;
}

simd::TangentEnd TangentFilter::step(const Pattern& p, const TangentRecording& recording, Index& t,
                                     Index end) {
  const Index before = t;
  long at = t;
  const bool complete = p.model.m == static_cast<int>(ny_) && ny_ > 0;
  const simd::TangentEnd how =
      simd::run_tangents(p.model, run_, recording.y.data(), static_cast<int>(ny_),
                         recording.u.data(), at, end, complete && !diffuse_ && !changing_);
  t = at;
  samples_ += (t - before) * p.model.m;
  return how;
}

// false: sums would lose digits, and have.
bool TangentFilter::run_stationary(const Pattern& p, const TangentRecording& recording, Index& t,
                                   bool& settled) {
  long at = 0;
  const simd::TangentEnd how =
      simd::run_stationary_tangents(p.model, run_, recording.y.data(), static_cast<int>(ny_),
                                    recording.u.data(), at, recording.y.cols());
  if (how == simd::TangentEnd::imprecise) return false;
  t = at;
  samples_ = t * ny_;
  settled = how == simd::TangentEnd::settled;
  return true;
}

FilterStatus TangentFilter::run_stretch(const Pattern& p, const TangentRecording& recording,
                                        Index& t, Index end, Likelihood& out) {
  const bool complete = p.model.m == static_cast<int>(ny_) && ny_ > 0;
  const bool kept = recording.store != nullptr && recording.score_products == nullptr &&
                    recording.watcher == nullptr && complete;
  const bool watched =
      !kept && (recording.store != nullptr || recording.score_products != nullptr ||
                recording.watcher != nullptr);
  if (kept) {
    run_.kept_e = recording.store->e.data();
    run_.kept_white = recording.store->standardised.data();
    run_.kept_sd = recording.store->e_sd.data();
  }
  bool settled = false;
  FilterStatus status = FilterStatus::ok;
  if (stationary_ && complete && !watched && t == 0 && end == recording.y.cols() &&
      !run_stationary(p, recording, t, settled)) {
    status = begin(InitialState::stationary);
  }
  while (t < end && status == FilterStatus::ok) {
    const Index to = watched ? t + 1 : end;
    const bool same = settled;
    if (settled) {
      simd::run_settled_tangents(p.model, run_, recording.y.data(), static_cast<int>(ny_),
                                 recording.u.data(), t, to);
      samples_ += (to - t) * p.model.m;
      t = to;
    } else {
      const simd::TangentEnd how = step(p, recording, t, to);
      if (how == simd::TangentEnd::indefinite) status = FilterStatus::indefinite;
      settled = how == simd::TangentEnd::settled;
      if (recording.store != nullptr && !kept) find_innovation_sd();
    }
    if (!watched || status != FilterStatus::ok) continue;
    leave_sample(p, recording, t - 1, out);
    if (recording.watcher != nullptr) show_filtered(p, t - 1, same, *recording.watcher);
  }
  run_.kept_e = run_.kept_white = run_.kept_sd = nullptr;
  return status;
}

// Sample by sample, until all of the start is determined.
FilterStatus TangentFilter::run_diffuse(const Pattern& p, const TangentRecording& recording,
                                        Index& t, Index end, Likelihood& out) {
  while (t < end && diffuse_) {
    if (step(p, recording, t, t + 1) == simd::TangentEnd::indefinite) {
      return FilterStatus::indefinite;
    }
    const bool last = t == recording.y.cols();
    if (samples_ < scale_.size()) continue;
    take_square(run_.delta_information, scale_.size(), 0, start_.information);
    if (!start_.is_determined(last)) continue;
    if (!fold_in(out)) {
      if (last) return FilterStatus::undetermined;
      continue;
    }
    if (recording.store != nullptr) recording.store->first_proper = t;
    add_score_product(recording, out);
  }
  return FilterStatus::ok;
}

bool TangentFilter::fold_in(Likelihood& out) {
  const Index d = scale_.size(), columns = 1 + d;
  const std::size_t k = derivatives_->size();
  take_vector(run_.delta_score, d, 0, start_.score);
  take_square(run_.P, n_, 0, P_);
  take_columns(run_.x, columns, 0, Z_);
  sensitivities_.resize(k);
  for (std::size_t i = 0; i < k; ++i) {
    take_square(run_.delta_information, d, 1 + i, start_.by[i].information);
    take_vector(run_.delta_score, d, 1 + i, start_.by[i].score);
    take_square(run_.P, n_, 1 + i, sensitivities_[i].P);
    take_columns(run_.x, columns, 1 + i, sensitivities_[i].Z);
  }
  if (!start_.fold_in(P_, Z_, sensitivities_, out)) return false;
  run_.columns = 1;
  run_.informed = true;
  set_matrix(run_.P, 0, P_);
  set_vector(run_.x, 0, Z_.col(0));
  for (std::size_t i = 0; i < k; ++i) {
    set_matrix(run_.P, 1 + i, sensitivities_[i].P);
    set_vector(run_.x, 1 + i, sensitivities_[i].Z.col(0));
  }
  folded_ = d;
  until_folded_ = samples_;
  start_squares_ = start_.score.dot(start_.information.llt().solve(start_.score));
  diffuse_ = false;
  return true;
}

// false: the segment is too short, or sums would lose digits.
bool TangentFilter::run_by_kernel(const Segment& segment, SegmentKernel& kernel, Likelihood& out) {
  if (segment.sums.samples() <= kernel.memory()) return false;
  // Only an untouched start is known to the kernel.
  if (diffuse_ && (samples_ > 0 || segment.begin > 0 || scale_.size() < n_)) {
    late_ = true;
    return false;
  }
  const std::size_t k = derivatives_->size();
  FilterState state;
  state.x_theta.resize(k);
  state.P_theta.resize(k);
  if (!diffuse_) {
    state.x = vector(run_.x, n_, 0);
    state.P = matrix(run_.P, 0);
    for (std::size_t i = 0; i < k; ++i) {
      state.x_theta[i] = vector(run_.x, n_, 1 + i);
      state.P_theta[i] = matrix(run_.P, 1 + i);
    }
  }
  if (diffuse_ ? !kernel.add_from_model(segment, InitialState::diffuse, out)
               : !kernel.add_from_state(segment, state, out)) {
    rejected_ = true;
    return false;
  }
  if (diffuse_) folded_ = n_;
  diffuse_ = false;
  run_.columns = 1;
  run_.informed = true;
  kernel.end_of_segment(segment, state);
  for (std::size_t l = 0; l <= k; ++l) {
    set_vector(run_.x, l, l == 0 ? state.x : state.x_theta[l - 1]);
    set_matrix(run_.P, l, l == 0 ? state.P : state.P_theta[l - 1]);
  }
  samples_ += segment.sums.samples() * ny_;
  jumped_ += segment.sums.samples();
  return true;
}

void TangentFilter::add_sums(Likelihood& out) const {
  const std::size_t all = lanes_ * blocks_;
  out.value -= 0.5 * (run_.log_det + std::log(run_.determinant) + run_.squares +
                      kLogTwoPi * static_cast<double>(samples_ - folded_));
  for (std::size_t i = 1; i <= derivatives_->size(); ++i) {
    const auto row = static_cast<Index>(i) - 1;
    out.gradient[row] += run_.gradient[i];
    for (std::size_t j = 1; j <= i; ++j) {
      const auto column = static_cast<Index>(j) - 1;
      const double sum = run_.information[i * all + j];
      out.information(row, column) += sum;
      if (i != j) out.information(column, row) += sum;
    }
  }
}

FactorSums TangentFilter::factor_sums() const {
  FactorSums out{run_.squares - start_squares_, samples_ - folded_, samples_ - until_folded_, {}};
  out.half_traces.resize(static_cast<Index>(derivatives_->size()));
  for (Index i = 0; i < out.half_traces.size(); ++i) out.half_traces[i] = run_.half_traces[i + 1];
  return out;
}

}  // namespace identikal
