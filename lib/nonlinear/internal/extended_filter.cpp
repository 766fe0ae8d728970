#include "lib/nonlinear/internal/extended_filter.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/base/nearest_turn.h"
#include "lib/internal/direction_stack.h"
#include "lib/internal/fixed_steps.h"
#include "lib/nonlinear/internal/chain.h"
#include "lib/nonlinear/internal/damped_iterations.h"
#include "lib/nonlinear/internal/extended_kernel.h"
#include "lib/nonlinear/internal/extended_pattern.h"
#include "lib/nonlinear/internal/scaled_noise.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kUpdateSettled = 1e-10;  // of a standard deviation, iterated update

bool moves_by_steps(const NonlinearModel& model, const InputNodes& inputs) {
  return model.doses.values > 0 ||
         (model.continuous && (inputs.tolerance > 0.0 || inputs.at_rest >= 0));
}

class ExtendedFilter {
 public:
  ExtendedFilter(const NonlinearModel& model, ModelMemory& memory,
                 const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                 const std::vector<FilterDirection>& directions, const InputNodes& inputs,
                 const Eigen::Ref<const MatrixXd>& y, const NonlinearFilterOptions& options,
                 const FilterOutputs& out)
      : model_(model),
        memory_(memory),
        noise_(noise),
        directions_(directions),
        inputs_(inputs),
        y_(y),
        options_(options),
        out_(out),
        n_(static_cast<std::size_t>(model.states)),
        ny_(static_cast<std::size_t>(model.outputs)),
        k_(directions.size()),
        density_(options.noise == ProcessNoise::density),
        iterated_(options.method == NonlinearMethod::iterated),
        by_steps_(moves_by_steps(model, inputs)),
        order_(k_ > 0 ? Derivatives::second : Derivatives::first),
        places_(model, directions),
        f_(model.rate, model.states, model.states, order_, places_),
        h_(model.output, model.outputs, model.states, order_, places_),
        scaled_(options, p, noise, directions),
        chain_(model, directions) {
    set_parameters(model, memory, p);
    if (k_ > 0 && model.order == Derivatives::first) {
      throw std::invalid_argument(
          "nonlinear filter: the gradient needs a model with second derivatives");
    }
    lay_out();
    reserve();
    fill_start();
  }

  Likelihood run() {
    Index t = 0;
    go_to(t, y_.cols());
    return finish();
  }

  FilterStatus go_to(Index& t, Index end) {
    const Index N = y_.cols();
    for (; t < end && status_ == FilterStatus::ok; ++t) {
      look_at(t);
      samples_ += run_.m;
      keep_prediction(t);
      if (run_.m > 0 || out_.store != nullptr) measure(t);
      if (status_ != FilterStatus::ok) break;
      show(t);
      if (t + 1 < N) predict(t);
    }
    return status_;
  }

  FilterStatus go_to(FilterResult& store, Index& t, Index end) {
    out_.store = &store;
    return go_to(t, end);
  }
  std::vector<double> predicted() const {
    std::vector<double> out(run_.x, run_.x + size(n_));
    out.insert(out.end(), run_.P, run_.P + size(n_ * n_));
    return out;
  }
  void go_back_to(const std::vector<double>& state) {
    const std::size_t x = size(n_);
    std::copy_n(state.begin(), x, run_.x);
    std::copy(state.begin() + static_cast<std::ptrdiff_t>(x), state.end(), run_.P);
    status_ = FilterStatus::ok;
  }

 private:
  std::size_t block_size(std::size_t numbers) const { return numbers * places_.lanes; }
  std::size_t size(std::size_t numbers) const { return places_.blocks * block_size(numbers); }

  // Entries of Q, or of a direction's, that are not zero.
  MatrixXd noisy_entries() const {
    MatrixXd out = noise_.Q.cwiseAbs();
    for (const FilterDirection& each : directions_) out += each.noise.Q.cwiseAbs();
    return out;
  }

  void lay_out() {
    const TransitionSource source = by_steps_           ? TransitionSource::any
                                    : model_.continuous ? TransitionSource::equations
                                                        : TransitionSource::map;
    pattern_ =
        motion_pattern(model_.rate, order_, model_.states, source, noisy_entries(), density_);
    kernel_.n = static_cast<int>(n_);
    kernel_.ny = static_cast<int>(ny_);
    kernel_.blocks = static_cast<int>(places_.blocks);
    kernel_.lanes = static_cast<int>(places_.lanes);
    kernel_.derivatives = static_cast<int>(k_);
    kernel_.f = f_.slopes();
    kernel_.h = h_.slopes();
    kernel_.Phi_entries = static_cast<int>(pattern_.Phi_column.size());
    kernel_.Phi_row = pattern_.Phi_row.data();
    kernel_.Phi_column = pattern_.Phi_column.data();
    kernel_.Phi_moves = pattern_.Phi_moves.data();
    kernel_.W_entries = pattern_.W_entries;
    kernel_.W_index = pattern_.W_index.data();
    kernel_.Phi_terms = pattern_.Phi_terms.terms();
    kernel_.Phi_moved = pattern_.Phi_moved.terms();
    kernel_.W_terms = pattern_.W_terms.terms();
    kernel_.W_moved = pattern_.W_moved.terms();
    all_ = n_ + pattern_.Phi_column.size() + static_cast<std::size_t>(pattern_.W_entries);
  }

  void reserve() {
    const std::size_t n = n_, m = ny_, W = places_.lanes;
    const std::pair<double**, std::size_t> rooms[] = {
        {&run_.x, size(n)},
        {&run_.next_x, size(n)},
        {&run_.P, size(n * n)},
        {&run_.next_P, size(n * n)},
        {&run_.T, size(n * n)},
        {&run_.begin, size(all_)},
        {&run_.stage, size(all_)},
        {&run_.next_stage, size(all_)},
        {&run_.sum, size(all_)},
        {&start_of_step_, size(all_)},
        {&run_.Phi_value, pattern_.Phi_column.size()},
        {&Q_, size(static_cast<std::size_t>(pattern_.W_entries))},
        {&R_, size(m * m)},
        {&run_.M, size(n * m)},
        {&run_.E, size(m)},
        {&run_.Sigma, size(m * m)},
        {&run_.HX, block_size(n * m)},
        {&run_.KR, block_size(n * m)},
        {&run_.K, n * m},
        {&run_.gains, n * n},
        {&run_.L_inverse, m * m},
        {&run_.Sigma_inverse, m * m},
        {&run_.Sie, m},
        {&run_.white_e, m},
        {&run_.white, size(m + m * (m + 1) / 2)},
        {&run_.work, m * m + std::max(m, m * m) * W},
        {&run_.gradient, size(1)},
        {&run_.information, (1 + k_) * size(1)},
    };
    std::size_t all = 0;
    for (const auto& [at, count] : rooms) all += (count + 7) / 8 * 8;
    memory_of_lanes_.assign(all, 0.0);
    double* free = memory_of_lanes_.data();
    for (const auto& [at, count] : rooms) {
      *at = free;
      free += (count + 7) / 8 * 8;
    }
    run_.f = f_.point();
    run_.h = h_.point();
    gain_places_.assign(n * n + 2 * n + 1, 0);
    is_seen_ = std::make_unique<bool[]>(n);
    run_.gain_column = gain_places_.data();
    run_.gain_row = run_.gain_column + n * n;
    run_.gain_at = run_.gain_row + n + 1;
    run_.is_seen = is_seen_.get();
    channel_.reserve(m);
    point_.setZero(static_cast<Index>(n));
    e_.setZero(static_cast<Index>(m));
    kernel_.Q = Q_;
    kernel_.R = R_;
    score_.setZero(static_cast<Index>(k_));
    gradient_ = score_;
    if (out_.score_products != nullptr) out_.score_products->setZero(score_.size(), score_.size());
    if (iterated_) iterations_.emplace(kernel_, size(n));
  }

  // A matrix and its derivatives in lanes, row by row.
  template <class Of>
  void fill(double* to, std::size_t rows, std::size_t columns, const Of& of) const {
    for (std::size_t at = 0; at <= k_; ++at) {
      const auto& from = of(at == 0 ? noise_ : directions_[at - 1].noise);
      for (std::size_t i = 0; i < rows; ++i) {
        for (std::size_t j = 0; j < columns; ++j) {
          to[places_(rows * columns, i * columns + j, at)] =
              from(static_cast<Index>(i), static_cast<Index>(j));
        }
      }
    }
  }

  void fill_start() {
    fill(run_.x, n_, 1, [](const FilterNoise& of) -> const VectorXd& { return of.x0; });
    fill(run_.P, n_, n_, [](const FilterNoise& of) -> const MatrixXd& { return of.P0; });
    fill(R_, ny_, ny_, [](const FilterNoise& of) -> const MatrixXd& { return of.R; });
    kernel_.diagonal_R =
        noise_.R.isDiagonal(0.0) &&
        std::all_of(directions_.begin(), directions_.end(),
                    [](const FilterDirection& d) { return d.noise.R.isDiagonal(0.0); });
    // A step begins with Phi = I, and W = 0 or, where Q is that of a sample, W = Q.
    const auto of_motion = pattern_.Phi_column.size();
    for (std::size_t i = 0; i < n_; ++i) {
      for (int e = pattern_.Phi_row[i]; e < pattern_.Phi_row[i + 1]; ++e) {
        if (pattern_.Phi_column[e] == static_cast<int>(i)) {
          start_of_step_[places_(all_, n_ + static_cast<std::size_t>(e), 0)] = 1.0;
        }
      }
    }
    const auto W = static_cast<std::size_t>(pattern_.W_entries);
    for (std::size_t at = 0; at <= k_; ++at) {
      const MatrixXd& Q = at == 0 ? noise_.Q : directions_[at - 1].noise.Q;
      for (std::size_t i = 0; i < n_; ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
          const int w = pattern_.W_index[i * n_ + j];
          if (w < 0) continue;
          const double value = Q(static_cast<Index>(i), static_cast<Index>(j));
          const auto entry = static_cast<std::size_t>(w);
          if (density_) {
            Q_[places_(W, entry, at)] = value;
          } else {
            start_of_step_[places_(all_, n_ + of_motion + entry, at)] = value;
          }
        }
      }
    }
    if (!by_steps_ || !density_) return;
    const auto nn = static_cast<Index>(n_ * n_);
    gramians_.densities = noise_.Q.reshaped(nn, 1);
    for (std::size_t i = 0; i < k_; ++i) {
      if (directions_[i].noise.Q.isZero(0.0)) continue;
      moving_densities_.push_back(static_cast<Index>(i));
      gramians_.densities.conservativeResize(nn, gramians_.densities.cols() + 1);
      gramians_.densities.rightCols(1) = directions_[i].noise.Q.reshaped();
    }
  }

  bool is_ok(FilterStatus status) {
    status_ = status;
    return status == FilterStatus::ok;
  }

  // The state and what belongs to it, as others see them.

  VectorXd state() const {
    VectorXd out(model_.states);
    for (std::size_t i = 0; i < n_; ++i) out[static_cast<Index>(i)] = run_.x[i * places_.lanes];
    return out;
  }
  MatrixXd covariance() const {
    MatrixXd out(model_.states, model_.states);
    for (std::size_t i = 0; i < n_ * n_; ++i)
      out(static_cast<Index>(i)) = run_.P[i * places_.lanes];
    return out;
  }
  Stack derivatives(const double* of, std::size_t numbers) const {
    Stack out(static_cast<Index>(numbers), static_cast<Index>(k_));
    for (std::size_t i = 0; i < numbers; ++i) {
      for (std::size_t at = 1; at <= k_; ++at) {
        out(static_cast<Index>(i), static_cast<Index>(at) - 1) = of[places_(numbers, i, at)];
      }
    }
    return out;
  }
  void keep_prediction(Index t) {
    if (out_.store == nullptr || out_.keep != Keep::everything) return;
    out_.store->x_pred.col(t) = state();
    out_.store->P_pred[static_cast<std::size_t>(t)] = covariance();
  }
  void show(Index t) {
    if (out_.watcher != nullptr) {
      (*out_.watcher)(
          {t, state(), covariance(), derivatives(run_.x, n_), derivatives(run_.P, n_ * n_)});
    }
    if (out_.store == nullptr || out_.keep != Keep::everything) return;
    out_.store->x_filt.col(t) = state();
    out_.store->P_filt[static_cast<std::size_t>(t)] = covariance();
  }

  // Measurement.

  void look_at(Index t) {
    std::size_t count = 0;
    bool changed = channel_.size() != static_cast<std::size_t>(run_.m);
    channel_.resize(ny_);
    for (std::size_t a = 0; a < ny_; ++a) {
      if (std::isnan(y_(static_cast<Index>(a), t))) continue;
      changed = changed || channel_[count] != static_cast<int>(a);
      channel_[count++] = static_cast<int>(a);
    }
    changed = changed || count != static_cast<std::size_t>(run_.m);
    channel_.resize(count);
    run_.channel = channel_.data();
    run_.m = static_cast<int>(count);
    pattern_changed_ = pattern_changed_ || changed;
  }

  void scale_noise(Index t) {
    const Stack dx = derivatives(run_.x, n_);
    MatrixXd R = noise_.R;
    Stack dR(R.size(), static_cast<Index>(k_));
    const FilterStatus scaled =
        scaled_.set(t, state(), dx, inputs_.at_sample.col(t), inputs_.time[t], R, dR);
    if (run_.m > 0 && !is_ok(scaled)) return;
    if (scaled != FilterStatus::ok) R.setConstant(kNaN);  // that no measurement needs
    for (std::size_t e = 0; e < ny_ * ny_; ++e) {
      R_[places_(ny_ * ny_, e, 0)] = R(static_cast<Index>(e));
      for (std::size_t i = 0; i < k_; ++i) {
        R_[places_(ny_ * ny_, e, 1 + i)] = dR(static_cast<Index>(e), static_cast<Index>(i));
      }
    }
  }

  // h at xi; y - h goes to e_.
  void observe_at(const double* xi, Index t) {
    for (std::size_t i = 0; i < n_; ++i) point_[static_cast<Index>(i)] = xi[i * places_.lanes];
    const SlopesAt at = outputs_at(model_, memory_, order_, point_.data(),
                                   inputs_.at_sample.col(t).data(), inputs_.time[t]);
    h_.take(at);
    for (std::size_t a = 0; a < ny_; ++a) {
      const auto i = static_cast<Index>(a);
      e_[i] = y_(i, t) - at.values[a];
      if (a < options_.wraps.size() && options_.wraps[a]) e_[i] = nearest_turn(e_[i]);
      run_.h.value[a * places_.lanes] = -e_[i];
    }
  }

  void measure(Index t) {
    if (scaled_.moves()) scale_noise(t);
    if (status_ != FilterStatus::ok) return;
    const bool iterated = iterated_ && run_.m > 0;
    run_.xi = run_.x;
    if (iterated) {
      iterations_->begin(R_, pattern_changed_ || scaled_.moves(), run_);
      pattern_changed_ = false;
    }
    const double log_det = run_.log_det, determinant = run_.determinant;
    for (int i = iterated ? options_.iterations : 1; i > 0; --i) {
      observe_at(run_.xi, t);
      if (iterated && i > 1 && iterations_->steps_back(e_, i == 2, run_)) continue;
      keep_innovation_covariance(t);
      if (run_.m == 0) return;
      run_.log_det = log_det;
      run_.determinant = determinant;
      if (!is_ok(status_of(simd::innovate(kernel_, run_)))) return;
      if (i == 1 || has_settled()) break;
      iterations_->advance(run_);
    }
    add_terms(t);
    simd::correct(kernel_, run_);
    std::swap(run_.x, run_.next_x);
  }

  static FilterStatus status_of(simd::SampleEnd end) {
    return end == simd::SampleEnd::done         ? FilterStatus::ok
           : end == simd::SampleEnd::not_finite ? FilterStatus::not_finite
                                                : FilterStatus::indefinite;
  }

  bool has_settled() const {
    for (std::size_t i = 0; i < n_; ++i) {
      const std::size_t at = i * places_.lanes;
      const double limit =
          kUpdateSettled * std::sqrt(run_.P[at * n_ + at]) + 1e-15 * std::abs(run_.xi[at]);
      if (!(std::abs(run_.next_x[at] - run_.xi[at]) <= limit)) return false;
    }
    return true;
  }

  // Sigma of all outputs, measured or not. What was there of the sample before is no more.
  void keep_innovation_covariance(Index t) {
    if (out_.store == nullptr) return;
    out_.store->e.col(t).setConstant(kNaN);
    out_.store->standardised.col(t).setConstant(kNaN);
    const simd::LaneSlopes& h = kernel_.h;
    const auto entry = [&](int a, int c) {
      double sum = R_[static_cast<std::size_t>(a * kernel_.ny + c) * places_.lanes];
      for (int e = h.row[a]; e < h.row[a + 1]; ++e) {
        for (int g = h.row[c]; g < h.row[c + 1]; ++g) {
          sum += run_.h.slope[e] * run_.h.slope[g] *
                 run_.P[static_cast<std::size_t>(h.column[e] * kernel_.n + h.column[g]) *
                        places_.lanes];
        }
      }
      return sum;
    };
    for (int a = 0; a < kernel_.ny; ++a) out_.store->e_sd(a, t) = std::sqrt(entry(a, a));
    if (out_.keep != Keep::everything) return;
    MatrixXd& Sigma = out_.store->Sigma[static_cast<std::size_t>(t)];
    Sigma.resize(model_.outputs, model_.outputs);
    for (int a = 0; a < kernel_.ny; ++a) {
      for (int c = 0; c <= a; ++c) Sigma(a, c) = Sigma(c, a) = entry(a, c);
    }
  }

  void add_terms(Index t) {
    if (out_.score_products != nullptr) std::fill_n(run_.gradient, size(1), 0.0);
    simd::add_sample(kernel_, run_);
    if (out_.score_products != nullptr) {
      for (std::size_t i = 0; i < k_; ++i) {
        score_[static_cast<Index>(i)] = run_.gradient[1 + i];
      }
      gradient_ += score_;
      out_.score_products->noalias() += score_ * score_.transpose();
    }
    if (out_.store == nullptr) return;
    for (int a = 0; a < run_.m; ++a) {
      out_.store->e(run_.channel[a], t) = run_.E[static_cast<std::size_t>(a) * places_.lanes];
      out_.store->standardised(run_.channel[a], t) = run_.white_e[a];
    }
  }

  // Motion.

  void begin_step() {
    std::copy_n(start_of_step_, size(all_), run_.begin);
    for (std::size_t b = 0; b < places_.blocks; ++b) {
      std::copy_n(run_.x + b * block_size(n_), block_size(n_), run_.begin + b * block_size(all_));
    }
  }
  void end_step() {
    for (std::size_t b = 0; b < places_.blocks; ++b) {
      std::copy_n(run_.begin + b * block_size(all_), block_size(n_), run_.x + b * block_size(n_));
    }
    simd::predict_covariance(kernel_, run_);
  }

  void predict(Index t) {
    begin_step();
    if (by_steps_) {
      step_to(t);
    } else if (!model_.continuous) {
      take_rates(run_.begin, inputs_.u.col(inputs_.first[static_cast<std::size_t>(t)]),
                 inputs_.time[t]);
      simd::map_state(kernel_, run_);
    } else if (!model_.linear_in_state) {
      follow_equations(t, false);
    } else if (const Repeated* made = made_before(t)) {
      if (model_.affine && inputs_.straight && made->steps > 1) {
        move_state(t);
      } else {
        follow_equations(t, true);
      }
      for (std::size_t b = 0; b < places_.blocks; ++b) {
        const std::size_t count = block_size(all_ - n_);
        std::copy_n(made->motion.data() + b * count, count,
                    run_.begin + b * block_size(all_) + block_size(n_));
      }
    } else {
      follow_equations(t, false);
      keep_step(t);
    }
    end_step();
  }

  void take_rates(const double* x, const Eigen::Ref<const VectorXd>& u, double time) {
    for (std::size_t i = 0; i < n_; ++i) point_[static_cast<Index>(i)] = x[i * places_.lanes];
    f_.take(rates_at(model_, memory_, order_, point_.data(), u.data(), time));
  }

  void follow_equations(Index t, bool state_alone) {
    const auto interval = static_cast<std::size_t>(t);
    const int steps = inputs_.steps[interval];
    const double length = (inputs_.time[t + 1] - inputs_.time[t]) / steps;
    for (int i = 0; i < steps; ++i) {
      for (const RungeKuttaStage& stage : kRungeKuttaStages) {
        const bool first = stage.node == 0;
        take_rates(first ? run_.begin : run_.stage,
                   inputs_.u.col(inputs_.first[interval] + 2 * i + stage.node),
                   inputs_.time[t] + (i + stage.reach) * length);
        simd::follow_stage(kernel_, run_, stage.weight * length, stage.to_next * length, first,
                           state_alone);
      }
      std::swap(run_.begin, run_.sum);
    }
  }

  // Of a model that is linear in its state: Phi and W are those of every interval of that length.
  struct Repeated {
    double interval = 0.0;
    int steps = 0;
    std::vector<double> motion;
  };
  const Repeated* made_before(Index t) const {
    const double interval = inputs_.time[t + 1] - inputs_.time[t];
    const double rounding = interval_rounding(inputs_.time);
    for (const Repeated& each : repeated_) {
      if (each.steps == inputs_.steps[static_cast<std::size_t>(t)] &&
          std::abs(each.interval - interval) <= rounding) {
        return &each;
      }
    }
    return nullptr;
  }
  void keep_step(Index t) {
    if (repeated_.size() == kMostRepeated) return;
    Repeated made{
        inputs_.time[t + 1] - inputs_.time[t], inputs_.steps[static_cast<std::size_t>(t)], {}};
    for (std::size_t b = 0; b < places_.blocks; ++b) {
      const double* const from = run_.begin + b * block_size(all_) + block_size(n_);
      made.motion.insert(made.motion.end(), from, from + block_size(all_ - n_));
    }
    repeated_.push_back(std::move(made));
  }

  // By step(), which has a product for all steps of rates that are linear.
  void move_state(Index t) {
    VectorXd x = state();
    const Stack dx = derivatives(run_.x, n_);
    step(model_, memory_, inputs_, t, x, moved_);
    Stack next_dx = Stack::Zero(dx.rows(), dx.cols());
    chain_.add(moved_.wrt_x, moved_.wrt_p, dx, next_dx);
    put(run_.begin, 0, x, next_dx);
  }

  // What step() alone knows: doses, steps that are controlled, and rest.
  void step_to(Index t) {
    VectorXd x = state();
    const Stack dx = derivatives(run_.x, n_);
    const auto n = static_cast<Index>(n_), k = static_cast<Index>(k_);
    step(model_, memory_, inputs_, t, x, moved_, order_, density_ ? &gramians_ : nullptr);
    Stack next_dx = Stack::Zero(n, k), dPhi = Stack::Zero(n * n, k), dW = dPhi;
    chain_.add(moved_.wrt_x, moved_.wrt_p, dx, next_dx);
    if (k > 0) chain_.set(moved_.wrt_x_jacobian, dx, dPhi);
    put(run_.begin, 0, x, next_dx);
    const MatrixXd Phi = moved_.wrt_x;
    Stack rows(n * n, k);  // Phi is kept row by row
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j < n; ++j) rows.row(j + n * i) = dPhi.row(i + n * j);
    }
    put(run_.begin, n_, Phi.transpose().reshaped(), rows);
    if (!density_) return;
    if (k > 0) chain_.set(gramians_.jacobian, dx, dW);
    for (std::size_t j = 0; j < moving_densities_.size(); ++j) {
      dW.col(moving_densities_[j]) += gramians_.values.col(static_cast<Index>(j) + 1);
    }
    const Index first = n + n * n;
    for (Index i = 0; i < n; ++i) {
      for (Index j = 0; j <= i; ++j) {
        const int w = pattern_.W_index[static_cast<std::size_t>(i * n + j)];
        put(run_.begin, static_cast<std::size_t>(first + w),
            gramians_.values.col(0).segment(i + n * j, 1), dW.middleRows(i + n * j, 1));
      }
    }
  }
  // Numbers and their derivatives behind the first `at` ones of a step.
  template <class Values, class Derived>
  void put(double* to, std::size_t at, const Values& values, const Derived& derived) const {
    for (Index i = 0; i < values.size(); ++i) {
      const std::size_t number = at + static_cast<std::size_t>(i);
      to[places_(all_, number, 0)] = values(i);
      for (std::size_t l = 0; l < k_; ++l) {
        to[places_(all_, number, 1 + l)] = derived(i, static_cast<Index>(l));
      }
    }
  }

  Likelihood finish() const {
    const auto k = static_cast<Index>(k_);
    Likelihood out;
    out.status = status_;
    out.value = -0.5 * (run_.squares + run_.log_det + std::log(run_.determinant) +
                        kLogTwoPi * static_cast<double>(samples_));
    out.gradient = gradient_;
    if (out_.score_products == nullptr)
      out.gradient += Eigen::Map<const VectorXd>(run_.gradient + 1, k);
    out.information.resize(k, k);
    for (std::size_t i = 0; i < k_; ++i) {
      const auto row = static_cast<Index>(i);
      for (std::size_t j = 0; j <= i; ++j) {
        const auto column = static_cast<Index>(j);
        out.information(row, column) = out.information(column, row) =
            run_.information[(1 + i) * size(1) + 1 + j];
      }
    }
    if (status_ == FilterStatus::ok &&
        !(std::isfinite(out.value) && out.gradient.allFinite() && out.information.allFinite())) {
      out.status = FilterStatus::not_finite;
    }
    return out;
  }

  const NonlinearModel& model_;
  ModelMemory& memory_;
  const FilterNoise& noise_;
  const std::vector<FilterDirection>& directions_;
  const InputNodes& inputs_;
  const Eigen::Ref<const MatrixXd>& y_;
  const NonlinearFilterOptions& options_;
  FilterOutputs out_;
  const std::size_t n_, ny_, k_;
  const bool density_, iterated_, by_steps_;
  const Derivatives order_;
  const LanePlaces places_;
  FormulaLanes f_, h_;
  ScaledNoise scaled_;
  const Chain chain_;
  MotionPattern pattern_;
  simd::ExtendedModel kernel_;
  simd::ExtendedRun run_;
  std::size_t all_ = 0;  // numbers of a step: x, Phi and W
  std::vector<double> memory_of_lanes_;
  std::vector<int> gain_places_, channel_;
  std::unique_ptr<bool[]> is_seen_;
  double *start_of_step_ = nullptr, *Q_ = nullptr, *R_ = nullptr;
  VectorXd point_, e_;
  VectorXd score_, gradient_;  // of a sample and of all, where scores are taken one by one
  Index samples_ = 0;
  bool pattern_changed_ = true;
  std::optional<DampedIterations> iterations_;
  std::vector<Repeated> repeated_;
  Jacobian moved_;
  Gramians gramians_;
  std::vector<Index> moving_densities_;  // directions with a column of their own there
  FilterStatus status_ = FilterStatus::ok;
};

}  // namespace

Likelihood run_extended_filter(const NonlinearModel& model, ModelMemory& memory,
                               const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                               const std::vector<FilterDirection>& directions,
                               const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                               const NonlinearFilterOptions& options,
                               const FilterOutputs& outputs) {
  return ExtendedFilter(model, memory, p, noise, directions, inputs, y, options, outputs).run();
}

GatedFilter gated_extended_filter(const NonlinearModel& model, ModelMemory& memory,
                                  const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                                  const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                                  const NonlinearFilterOptions& options) {
  struct Own {
    Eigen::Ref<const MatrixXd> y;
    std::vector<FilterDirection> none;
    std::optional<ExtendedFilter> filter;
  };
  const auto own = std::make_shared<Own>(Own{y, {}, {}});
  own->filter.emplace(model, memory, p, noise, own->none, inputs, own->y, options, FilterOutputs{});
  GatedFilter out;
  out.go_to = [own](FilterResult& to, Index& t, Index end) {
    return own->filter->go_to(to, t, end);
  };
  out.state = [own] { return own->filter->predicted(); };
  out.go_back_to = [own](const std::vector<double>& state) { own->filter->go_back_to(state); };
  return out;
}

}  // namespace identikal
