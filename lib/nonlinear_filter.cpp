#include "lib/nonlinear_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "lib/constants.h"
#include "lib/small_product.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
// The derivatives of a matrix by all directions: row i + rows j holds those of entry (i, j), so
// that every operation runs along the directions.
using Stack = ModelMemory::Rows;

constexpr double kUpdateSettled = 1e-10;  // of a standard deviation, iterated update
constexpr double kNoCost = 1e-10;         // of a sum of squares of standard deviations: rounding
constexpr double kLeastPivot =
    1e-14;                          // of a variance; below it a covariance counts as semidefinite
constexpr double kNegative = 1e-9;  // of a variance; a pivot further below zero is no rounding

void check_noise(const NonlinearModel& model, const FilterNoise& noise, const char* whose) {
  const Index nx = model.states, ny = model.outputs;
  if (noise.Q.rows() == nx && noise.Q.cols() == nx && noise.R.rows() == ny &&
      noise.R.cols() == ny && noise.x0.size() == nx && noise.P0.rows() == nx &&
      noise.P0.cols() == nx) {
    return;
  }
  std::ostringstream text;
  text << "nonlinear filter: " << whose << " Q is " << noise.Q.rows() << " x " << noise.Q.cols()
       << ", R " << noise.R.rows() << " x " << noise.R.cols() << ", x0 " << noise.x0.size()
       << ", P0 " << noise.P0.rows() << " x " << noise.P0.cols() << "; the model has " << nx
       << " states and " << ny << " outputs";
  throw std::invalid_argument(text.str());
}

void check_arguments(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                     const FilterNoise& noise, const std::vector<FilterDirection>& directions,
                     const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                     const NonlinearFilterOptions& options) {
  const Index N = inputs.time.size();
  if (p.size() != model.parameters || y.rows() != model.outputs || y.cols() != N ||
      inputs.at_sample.rows() != model.inputs || inputs.at_sample.cols() != N) {
    std::ostringstream text;
    text << "nonlinear filter: " << p.size() << " parameters, y " << y.rows() << " x " << y.cols()
         << ", inputs " << inputs.at_sample.rows() << " x " << inputs.at_sample.cols() << " at "
         << N << " times; the model has " << model.parameters << " parameters, " << model.outputs
         << " outputs and " << model.inputs << " inputs";
    throw std::invalid_argument(text.str());
  }
  check_noise(model, noise, "the");
  for (const FilterDirection& direction : directions) {
    check_noise(model, direction.noise, "a direction's");
    if (direction.parameter < -1 || direction.parameter >= model.parameters) {
      std::ostringstream text;
      text << "nonlinear filter: a direction moves parameter " << direction.parameter << " of "
           << model.parameters;
      throw std::invalid_argument(text.str());
    }
  }
  if (options.noise == ProcessNoise::density && !model.continuous) {
    throw std::invalid_argument("nonlinear filter: a noise density in discrete time");
  }
  const UnscentedWeights& w = options.weights;
  if (options.iterations < 1 ||
      !(w.alpha * w.alpha * (static_cast<double>(model.states) + w.kappa) > 0.0)) {
    std::ostringstream text;
    text << "nonlinear filter: " << options.iterations << " iterations, alpha " << w.alpha
         << ", kappa " << w.kappa;
    throw std::invalid_argument(text.str());
  }
}

bool is_zero(const MatrixXd& M) { return M.isZero(0.0); }

// Does the state follow from the start and the inputs alone?
bool is_output_error(const FilterNoise& noise, const std::vector<FilterDirection>& directions) {
  return is_zero(noise.Q) && is_zero(noise.P0) &&
         std::all_of(directions.begin(), directions.end(), [](const FilterDirection& d) {
           return is_zero(d.noise.Q) && is_zero(d.noise.P0);
         });
}

// out(i, j) = out(j, i) = sum_l A(i, l) B(l, j): a product that is known to be symmetric.
template <class A, class B>
void set_symmetric_product(MatrixXd& out, const A& a, const B& b) {
  const Index n = a.rows();
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i <= j; ++i) {
      double sum = 0.0;
      for (Index l = 0; l < a.cols(); ++l) sum += a.coeff(i, l) * b.coeff(l, j);
      out(i, j) = out(j, i) = sum;
    }
  }
}

// Derivatives by the directions of what has derivatives `by` [x; p], when x has dx.
class Chain {
 public:
  explicit Chain(const NonlinearModel& model, const std::vector<FilterDirection>& directions)
      : nx_(model.states), directions_(directions) {}
  // out += ...
  template <class ByX, class ByP>
  void add(const ByX& by_x, const ByP& by_p, const Stack& dx, Stack& out, Index first = 0,
           double sign = 1.0) const {
    for (Index r = 0; r < by_x.rows(); ++r) {
      auto&& row = out.row(first + r);
      for (Index l = 0; l < nx_; ++l) row += (sign * by_x(r, l)) * dx.row(l);
      for (std::size_t i = 0; i < directions_.size(); ++i) {
        const Index p = directions_[i].parameter;
        if (p >= 0) row[static_cast<Index>(i)] += sign * by_p(r, p);
      }
    }
  }
  void set(const MatrixXd& by, const Stack& dx, Stack& out) const {
    out.setZero();
    add(by.leftCols(nx_), by.rightCols(by.cols() - nx_), dx, out);
  }

 private:
  Index nx_;
  const std::vector<FilterDirection>& directions_;
};

// The lower triangular L with L L' = S, false unless S is positive definite.
bool set_factor(const MatrixXd& S, MatrixXd& L) {
  const Index n = S.rows();
  for (Index j = 0; j < n; ++j) {
    double pivot = S(j, j);
    for (Index l = 0; l < j; ++l) pivot -= L(j, l) * L(j, l);
    if (!(pivot > 0.0)) return false;
    L(j, j) = std::sqrt(pivot);
    for (Index i = j + 1; i < n; ++i) {
      double sum = S(i, j);
      for (Index l = 0; l < j; ++l) sum -= L(i, l) * L(j, l);
      L(i, j) = sum / L(j, j);
    }
  }
  return true;
}

// L^-1 of every column of a stack of n x cols, in place.
void solve_rows(const MatrixXd& L, Stack& V, Index cols) {
  const Index n = L.rows();
  for (Index j = 0; j < cols; ++j) {
    for (Index i = 0; i < n; ++i) {
      auto&& row = V.row(i + n * j);
      for (Index l = 0; l < i; ++l) row -= L(i, l) * V.row(l + n * j);
      row *= 1.0 / L(i, i);
    }
  }
}
// ... (L^-1)' from the right of a stack of n x n.
void solve_columns(const MatrixXd& L, Stack& V) {
  const Index n = L.rows();
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < n; ++i) {
      auto&& row = V.row(i + n * j);
      for (Index l = 0; l < j; ++l) row -= L(j, l) * V.row(i + n * l);
      row *= 1.0 / L(j, j);
    }
  }
}

class NonlinearRecursion {
 public:
  NonlinearRecursion(const NonlinearModel& model, ModelMemory& memory,
                     const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                     const std::vector<FilterDirection>& directions, const InputNodes& inputs,
                     const Eigen::Ref<const MatrixXd>& y, const NonlinearFilterOptions& options)
      : model_(model),
        memory_(memory),
        noise_(noise),
        inputs_(inputs),
        y_(y),
        options_(options),
        chain_(model, directions),
        nx_(model.states),
        ny_(model.outputs),
        k_(static_cast<Index>(directions.size())),
        density_(options.noise == ProcessNoise::density) {
    check_arguments(model, p, noise, directions, inputs, y, options);
    set_parameters(model, memory, p);
    output_error_ = is_output_error(noise, directions);
    unscented_ = options.method == NonlinearMethod::unscented;
    order_ = k_ > 0 && !output_error_ ? Derivatives::second : Derivatives::first;
    const bool needs_second = order_ == Derivatives::second && (!unscented_ || density_);
    if (needs_second && model.order == Derivatives::first) {
      throw std::invalid_argument(
          "nonlinear filter: the gradient needs a model with second derivatives");
    }
    prepare(directions);
  }

  Likelihood run(FilterResult* store, Keep keep, MatrixXd* score_products) {
    store_ = store;
    states_ = store != nullptr && keep == Keep::everything;
    score_products_ = score_products;
    if (score_products != nullptr) score_products->setZero(k_, k_);
    const Index N = y_.cols();
    for (Index t = 0; t < N && status_ == FilterStatus::ok; ++t) {
      find_present(t);
      if (states_) {
        store_->x_pred.col(t) = x_;
        store_->P_pred[static_cast<std::size_t>(t)] = P_;
      }
      if (output_error_) {
        if (present_count_ > 0 || states_) simulated_output(t);
      } else if (present_count_ > 0 || states_) {
        unscented_ ? measure_by_points(t) : measure_by_slopes(t);
      }
      if (status_ != FilterStatus::ok) break;
      if (states_) {
        store_->x_filt.col(t) = x_;
        store_->P_filt[static_cast<std::size_t>(t)] = P_;
      }
      if (t + 1 == N) break;
      if (output_error_) {
        simulate(t);
      } else {
        unscented_ ? predict_by_points(t) : predict_by_slopes(t);
      }
    }
    return finish();
  }

 private:
  void prepare(const std::vector<FilterDirection>& directions) {
    const Index nn = nx_ * nx_, rr = ny_ * ny_;
    x_ = noise_.x0;
    P_ = noise_.P0;
    dx_.setZero(nx_, k_);
    dP_.setZero(nn, k_);
    dQ_.setZero(nn, k_);
    dR_.setZero(rr, k_);
    gramians_.densities = noise_.Q.reshaped(nn, 1);
    for (Index i = 0; i < k_; ++i) {
      const FilterNoise& d = directions[static_cast<std::size_t>(i)].noise;
      dx_.col(i) = d.x0;
      dP_.col(i) = d.P0.reshaped();
      dQ_.col(i) = d.Q.reshaped();
      dR_.col(i) = d.R.reshaped();
      if (density_ && !is_zero(d.Q)) {
        moving_densities_.push_back(i);
        gramians_.densities.conservativeResize(nn, gramians_.densities.cols() + 1);
        gramians_.densities.rightCols(1) = d.Q.reshaped();
      }
    }
    W_ = noise_.Q;
    dW_ = dQ_;
    noise_moves_ = !dR_.isZero(0.0);
    present_.assign(static_cast<std::size_t>(ny_), -1);
    h_.setZero(ny_);
    e_ = eps_ = w_ = h_;
    M_.setZero(nx_, ny_);
    K_ = M_;
    Sigma_.setZero(ny_, ny_);
    factor_ = R_factor_ = Sigma_;
    whitened_.setZero(ny_);
    T_.setZero(nx_, nx_);
    X_ = T_;
    next_P_ = T_;
    next_x_ = xi_ = x_;
    de_.setZero(ny_, k_);
    q_ = Z_ = de_;
    dM_.setZero(nx_ * ny_, k_);
    dH_.setZero(ny_ * nx_, k_);
    dSigma_.setZero(rr, k_);
    V_ = dSigma_;
    dPhi_.setZero(nn, k_);
    dT_ = dPhi_;
    next_dP_ = dPhi_;
    next_dx_ = dx_;
    dxi_ = dx_;
    score_.setZero(k_);
    out_.gradient.setZero(k_);
    out_.information.setZero(k_, k_);
    held_information_ = out_.information;
    if (!unscented_ || output_error_) return;
    const UnscentedWeights& w = options_.weights;
    const auto n = static_cast<double>(nx_);
    const double square = w.alpha * w.alpha * (n + w.kappa);
    reach_ = std::sqrt(square);
    outer_weight_ = 0.5 / square;
    middle_weight_ = (square - n) / square + 1.0 - w.alpha * w.alpha + w.beta;
    L_.setZero(nx_, nx_);
    dL_.setZero(nn, k_);
    for (SigmaPoints* points : {&moved_, &seen_}) {
      const Index rows = points == &moved_ ? nx_ : ny_;
      points->values.setZero(rows, 2 * nx_ + 1);
      points->dvalues.setZero(rows * (2 * nx_ + 1), k_);
      points->mean.setZero(rows);
      points->dmean.setZero(rows, k_);
      points->A.setZero(rows, nx_);
      points->dA.setZero(rows * nx_, k_);
      points->rest.setZero(rows, rows);
      points->drest.setZero(rows * rows, k_);
      points->deviation.setZero(rows, nx_ + 1);
      points->ddeviation.setZero(rows * (nx_ + 1), k_);
    }
  }

  void find_present(Index t) {
    bool changed = false;
    present_count_ = 0;
    for (Index a = 0; a < ny_; ++a) {
      const int here = std::isnan(y_(a, t)) ? 0 : 1;
      int& before = present_[static_cast<std::size_t>(a)];
      changed = changed || here != before;
      before = here;
      present_count_ += here;
    }
    samples_ += present_count_;
    pattern_changed_ = pattern_changed_ || changed;
  }
  bool is_present(Index a) const { return present_[static_cast<std::size_t>(a)] != 0; }

  // A channel that is missing measures nothing, with noise one: it adds no term, and K is zero
  // there. Innovation, M = cov(x, y), Sigma and their derivatives are those of all channels before.
  void leave_out_missing() {
    if (present_count_ == ny_) return;
    for (Index a = 0; a < ny_; ++a) {
      if (is_present(a)) continue;
      e_[a] = 0.0;
      M_.col(a).setZero();
      Sigma_.row(a).setZero();
      Sigma_.col(a).setZero();
      Sigma_(a, a) = 1.0;
      if (k_ == 0) continue;
      de_.row(a).setZero();
      dM_.middleRows(nx_ * a, nx_).setZero();
      dSigma_.middleRows(ny_ * a, ny_).setZero();
      for (Index b = 0; b < ny_; ++b) dSigma_.row(a + ny_ * b).setZero();
    }
  }

  // Factor of Sigma and standardised innovation.
  bool standardise() {
    if (!Sigma_.allFinite() || !e_.allFinite()) {
      status_ = FilterStatus::not_finite;
    } else if (!set_factor(Sigma_, factor_)) {
      status_ = FilterStatus::indefinite;
    }
    if (status_ != FilterStatus::ok) return false;
    standardise_innovation();
    return true;
  }
  void standardise_innovation() {
    for (Index a = 0; a < ny_; ++a) {
      double sum = e_[a];
      for (Index b = 0; b < a; ++b) sum -= factor_(a, b) * eps_[b];
      eps_[a] = sum / factor_(a, a);
    }
  }

  // K = M Sigma^-1, w = Sigma^-1 e.
  void set_gain() {
    w_ = eps_;
    for (Index a = ny_ - 1; a >= 0; --a) {
      for (Index b = a + 1; b < ny_; ++b) w_[a] -= factor_(b, a) * w_[b];
      w_[a] /= factor_(a, a);
    }
    K_ = M_;
    for (Index a = 0; a < ny_; ++a) {
      for (Index b = 0; b < a; ++b) K_.col(a) -= factor_(a, b) * K_.col(b);
      K_.col(a) /= factor_(a, a);
    }
    for (Index a = ny_ - 1; a >= 0; --a) {
      for (Index b = a + 1; b < ny_; ++b) K_.col(a) -= factor_(b, a) * K_.col(b);
      K_.col(a) /= factor_(a, a);
    }
  }

  // next_x = x + K e and its derivatives, in which K's own is never needed:
  // d(M Sigma^-1 e) = dM w + K (de - dSigma w).
  void correct() {
    next_x_ = x_;
    for (Index a = 0; a < ny_; ++a) next_x_ += M_.col(a) * w_[a];
    if (k_ == 0) return;
    for (Index a = 0; a < ny_; ++a) {
      auto&& row = q_.row(a);
      row = de_.row(a);
      for (Index b = 0; b < ny_; ++b) row -= w_[b] * dSigma_.row(a + ny_ * b);
    }
    for (Index i = 0; i < nx_; ++i) {
      auto&& row = next_dx_.row(i);
      row = dx_.row(i);
      for (Index a = 0; a < ny_; ++a) {
        row += w_[a] * dM_.row(i + nx_ * a) + K_(i, a) * q_.row(a);
      }
    }
  }

  // The terms of a sample. Sigma's derivatives are whitened, or as they were (`held`).
  void add_terms(Index t, bool held) {
    double term = eps_.squaredNorm();
    for (Index a = 0; a < ny_; ++a) term += 2.0 * std::log(factor_(a, a));
    out_.value -= 0.5 * term;
    if (store_ != nullptr) {
      for (Index a = 0; a < ny_; ++a) {
        if (!is_present(a)) continue;
        store_->e(a, t) = e_[a];
        store_->standardised(a, t) = eps_[a];
      }
    }
    if (k_ == 0) return;
    Z_ = de_;
    solve_rows(factor_, Z_, 1);
    score_.setZero();
    for (Index a = 0; a < ny_; ++a) score_ -= eps_[a] * Z_.row(a);
    for (Index a = 0; a < ny_; ++a) add_outer(out_.information, Z_.row(a), 1.0);
    if (!held) {
      V_ = dSigma_;
      solve_rows(factor_, V_, ny_);
      solve_columns(factor_, V_);
      add_noise_information(out_.information, 1.0);
    }
    if (!held || noise_moves_) {
      for (Index b = 0; b < ny_; ++b) {
        for (Index a = 0; a < ny_; ++a) {
          const double weight = 0.5 * (eps_[a] * eps_[b] - (a == b ? 1.0 : 0.0));
          score_ += weight * V_.row(a + ny_ * b);
        }
      }
    }
    out_.gradient += score_;
    if (score_products_ != nullptr) add_outer(*score_products_, score_, 1.0);
  }
  // Upper triangle only.
  template <class Row>
  static void add_outer(MatrixXd& to, const Row& v, double weight) {
    for (Index j = 0; j < to.cols(); ++j) {
      const double factor = weight * v[j];
      for (Index i = 0; i <= j; ++i) to(i, j) += factor * v[i];
    }
  }
  void add_noise_information(MatrixXd& to, double weight) const {
    for (Index b = 0; b < ny_; ++b) {
      add_outer(to, V_.row(b + ny_ * b), 0.5 * weight);
      for (Index a = 0; a < b; ++a) add_outer(to, V_.row(a + ny_ * b), weight);
    }
  }

  Likelihood finish() {
    release_held_information();
    out_.value -= 0.5 * std::log(2.0 * std::numbers::pi) * static_cast<double>(samples_);
    if (status_ == FilterStatus::ok &&
        !(std::isfinite(out_.value) && out_.gradient.allFinite() && out_.information.allFinite())) {
      status_ = FilterStatus::not_finite;
    }
    out_.information.triangularView<Eigen::StrictlyLower>() = out_.information.transpose();
    if (score_products_ != nullptr) {
      score_products_->triangularView<Eigen::StrictlyLower>() = score_products_->transpose();
    }
    out_.status = status_;
    return out_;
  }

  auto inputs_at(Index t) const { return inputs_.at_sample.col(t); }

  // Output error.

  void simulated_output(Index t) {
    if (k_ > 0) {
      observe(model_, memory_, x_, inputs_at(t), inputs_.time[t], h_, seen_slopes_);
      de_.setZero();
      chain_.add(seen_slopes_.by_x, seen_slopes_.by_p, dx_, de_, 0, -1.0);
    } else {
      observe(model_, memory_, x_, inputs_at(t), inputs_.time[t], h_);
    }
    if (states_) store_->Sigma[static_cast<std::size_t>(t)] = noise_.R;
    if (present_count_ == 0) return;
    e_ = y_.col(t) - h_;
    if (pattern_changed_) {
      release_held_information();
      Sigma_ = noise_.R;
      dSigma_ = dR_;
      leave_out_missing();
      if (!standardise()) return;
      pattern_changed_ = false;
      if (noise_moves_) {
        V_ = dSigma_;
        solve_rows(factor_, V_, ny_);
        solve_columns(factor_, V_);
        add_noise_information(held_information_, 1.0);
      }
    } else {
      if (present_count_ < ny_) {
        for (Index a = 0; a < ny_; ++a) {
          if (is_present(a)) continue;
          e_[a] = 0.0;
          de_.row(a).setZero();
        }
      }
      if (!e_.allFinite()) {
        status_ = FilterStatus::not_finite;
        return;
      }
      standardise_innovation();
    }
    ++held_samples_;
    add_terms(t, true);
  }
  // The information of R in samples that have the same channels is the same.
  void release_held_information() {
    if (held_samples_ > 0.0 && noise_moves_) out_.information += held_samples_ * held_information_;
    held_information_.setZero();
    held_samples_ = 0.0;
  }

  void simulate(Index t) {
    if (k_ == 0) {
      step(model_, memory_, inputs_, t, x_);
      return;
    }
    step(model_, memory_, inputs_, t, x_, moved_slopes_);
    next_dx_.setZero();
    chain_.add(moved_slopes_.by_x, moved_slopes_.by_p, dx_, next_dx_);
    dx_.swap(next_dx_);
  }

  // Extended and iterated.

  void measure_by_slopes(Index t) {
    xi_ = x_;
    dxi_ = dx_;
    const bool iterated = options_.method == NonlinearMethod::iterated && present_count_ > 0;
    const MatrixXd& H = seen_slopes_.by_x;
    if (iterated) begin_iterations();
    for (int i = iterated ? options_.iterations : 1; i > 0; --i) {
      observe(model_, memory_, xi_, inputs_at(t), inputs_.time[t], h_, seen_slopes_, order_);
      e_ = y_.col(t) - h_;
      if (iterated && i > 1 && steps_back(i == 2)) continue;
      set_product(M_, P_, H.transpose());
      set_symmetric_product(Sigma_, H, M_);
      Sigma_ += noise_.R;
      for (Index l = 0; l < nx_; ++l) e_ -= H.col(l) * (x_[l] - xi_[l]);
      if (k_ > 0) linearisation_derivatives();
      if (states_) store_->Sigma[static_cast<std::size_t>(t)] = Sigma_;
      if (present_count_ == 0) return;
      leave_out_missing();
      if (!standardise()) return;
      set_gain();
      correct();
      if (i == 1 || has_settled()) break;
      advance();
    }
    add_terms(t, false);
    // T = I - K H
    set_product(T_, K_, H, -1.0);
    T_.diagonal().array() += 1.0;
    set_product(X_, P_, T_.transpose());
    set_symmetric_product(next_P_, T_, X_);
    add_gain_noise(noise_.R);
    if (k_ > 0) {
      // K minimises P+, so its own derivative drops out: T dP T' - (K dH) X - X' (K dH)' + K dR K'.
      set_congruence(T_, dP_);
      for (Index l = 0; l < nx_; ++l) {  // dT = -K dH
        for (Index i = 0; i < nx_; ++i) {
          auto&& row = dT_.row(i + nx_ * l);
          row.setZero();
          for (Index a = 0; a < ny_; ++a) row -= K_(i, a) * dH_.row(a + ny_ * l);
        }
      }
      add_turned(dT_, X_);
      add_gain_noise_derivatives(dR_);
      dP_.swap(next_dP_);
      dx_.swap(next_dx_);
    }
    P_.swap(next_P_);
    x_.swap(next_x_);
  }

  // The iterations look for the least of 1/2 |y - h(xi)|^2 / R + 1/2 |xi - x|^2 / P. They stay
  // where xi = x + P way, so that no inverse of P is needed; without one of R they are not damped.
  void begin_iterations() {
    way_.setZero(nx_);
    share_ = 1.0;
    promised_ = -1.0;
    if (!pattern_changed_) return;
    pattern_changed_ = false;
    present_R_ = noise_.R;
    for (Index a = 0; a < ny_; ++a) {
      if (is_present(a)) continue;
      present_R_.row(a).setZero();
      present_R_.col(a).setZero();
      present_R_(a, a) = 1.0;
    }
    R_is_regular_ = set_factor(present_R_, R_factor_);
  }
  // R^-1/2 times a residual, squared.
  template <class Residual>
  double squares(const Residual& r) {
    for (Index a = 0; a < ny_; ++a) {
      double sum = is_present(a) ? r[a] : 0.0;
      for (Index b = 0; b < a; ++b) sum -= R_factor_(a, b) * whitened_[b];
      whitened_[a] = sum / R_factor_(a, a);
    }
    return whitened_.squaredNorm();
  }
  // Does xi, with the residual e, fall short of a quarter of what its linearisation promised? Then
  // it is put half way back to the last point, or all the way when it is the `last` to be
  // linearised at, and steps stay that short.
  bool steps_back(bool last) {
    if (!R_is_regular_) return false;
    const double cost = 0.5 * (way_.dot(xi_ - x_) + squares(e_));
    if (promised_ < 0.0 || cost <= cost_ - 0.25 * share_ * promised_ + kNoCost * (1.0 + cost_)) {
      cost_ = cost;
      return false;
    }
    const double part = last ? 0.0 : 0.5;
    share_ *= 0.5;
    xi_ = base_x_ + part * (xi_ - base_x_);
    dxi_ = base_dx_ + part * (dxi_ - base_dx_);
    way_ = base_way_ + part * (way_ - base_way_);
    return true;
  }
  // From xi by a share of the way to next_x.
  void advance() {
    const MatrixXd& H = seen_slopes_.by_x;
    base_x_ = xi_;
    base_dx_ = dxi_;
    base_way_ = way_;
    way_.setZero();
    for (Index a = 0; a < ny_; ++a) {
      if (is_present(a)) way_ += w_[a] * H.row(a).transpose();
    }
    xi_ = next_x_ - base_x_;
    if (R_is_regular_) {
      h_.noalias() = H.lazyProduct(xi_);
      promised_ = xi_.dot(way_ - base_way_) + squares(h_);
    }
    way_ = base_way_ + share_ * (way_ - base_way_);
    xi_ = base_x_ + share_ * xi_;
    dxi_ = base_dx_ + share_ * (next_dx_ - base_dx_);
  }

  void linearisation_derivatives() {
    const MatrixXd& H = seen_slopes_.by_x;
    chain_.set(seen_slopes_.by_x_slopes, dxi_, dH_);
    // e = y - h(xi) - H (x - xi): what xi moves by itself cancels in the first order.
    de_.setZero();
    chain_.add(H, seen_slopes_.by_p, dx_, de_, 0, -1.0);
    for (Index l = 0; l < nx_; ++l) {
      const double away = x_[l] - xi_[l];
      if (away != 0.0) de_ -= away * dH_.middleRows(ny_ * l, ny_);
    }
    for (Index a = 0; a < ny_; ++a) {
      for (Index i = 0; i < nx_; ++i) {
        auto&& row = dM_.row(i + nx_ * a);
        row.setZero();
        for (Index l = 0; l < nx_; ++l) {
          row += H(a, l) * dP_.row(i + nx_ * l) + P_(i, l) * dH_.row(a + ny_ * l);
        }
      }
    }
    for (Index b = 0; b < ny_; ++b) {
      for (Index a = 0; a < ny_; ++a) {
        auto&& row = dSigma_.row(a + ny_ * b);
        row = dR_.row(a + ny_ * b);
        for (Index l = 0; l < nx_; ++l) {
          row += H(a, l) * dM_.row(l + nx_ * b) + M_(l, b) * dH_.row(a + ny_ * l);
        }
      }
    }
  }

  bool has_settled() const {
    for (Index i = 0; i < nx_; ++i) {
      const double limit = kUpdateSettled * std::sqrt(P_(i, i)) + 1e-15 * std::abs(xi_[i]);
      if (!(std::abs(next_x_[i] - xi_[i]) <= limit)) return false;
    }
    return true;
  }

  void predict_by_slopes(Index t) {
    step(model_, memory_, inputs_, t, x_, moved_slopes_, order_, density_ ? &gramians_ : nullptr);
    take_noise();
    const MatrixXd& Phi = moved_slopes_.by_x;
    set_product(X_, P_, Phi.transpose());
    set_symmetric_product(next_P_, Phi, X_);
    next_P_ += W_;
    if (k_ > 0) {
      chain_.set(moved_slopes_.by_x_slopes, dx_, dPhi_);
      set_congruence(Phi, dP_);
      add_turned(dPhi_, X_);
      next_dP_ += dW_;
      dP_.swap(next_dP_);
      next_dx_.setZero();
      chain_.add(Phi, moved_slopes_.by_p, dx_, next_dx_);
      dx_.swap(next_dx_);
    }
    P_.swap(next_P_);
  }

  // W and its derivatives, from the Gramians of the step from x with dx.
  void take_noise() {
    if (!density_) return;
    W_ = gramians_.values.col(0).reshaped(nx_, nx_);
    if (k_ == 0) return;
    chain_.set(gramians_.slopes, dx_, dW_);
    for (std::size_t j = 0; j < moving_densities_.size(); ++j) {
      dW_.col(moving_densities_[j]) += gramians_.values.col(static_cast<Index>(j) + 1);
    }
  }

  // next_dP = A dP A'.
  void set_congruence(const MatrixXd& A, const Stack& dP) {
    for (Index j = 0; j < nx_; ++j) {
      for (Index i = 0; i < nx_; ++i) {
        auto&& row = dT_.row(i + nx_ * j);
        row = A(i, 0) * dP.row(nx_ * j);
        for (Index l = 1; l < nx_; ++l) row += A(i, l) * dP.row(l + nx_ * j);
      }
    }
    for (Index j = 0; j < nx_; ++j) {
      for (Index i = 0; i <= j; ++i) {
        auto&& row = next_dP_.row(i + nx_ * j);
        row = A(j, 0) * dT_.row(i);
        for (Index l = 1; l < nx_; ++l) row += A(j, l) * dT_.row(i + nx_ * l);
        if (i != j) next_dP_.row(j + nx_ * i) = row;
      }
    }
  }
  // next_dP += D X + (D X)'.
  void add_turned(const Stack& D, const MatrixXd& X) {
    for (Index j = 0; j < nx_; ++j) {
      for (Index i = 0; i <= j; ++i) {
        auto&& row = next_dP_.row(i + nx_ * j);
        for (Index l = 0; l < X.rows(); ++l) {
          row += X(l, j) * D.row(i + nx_ * l) + X(l, i) * D.row(j + nx_ * l);
        }
        if (i != j) next_dP_.row(j + nx_ * i) = row;
      }
    }
  }
  // next_P += K N K'.
  void add_gain_noise(const MatrixXd& N) {
    for (Index j = 0; j < nx_; ++j) {
      for (Index i = 0; i <= j; ++i) {
        double sum = 0.0;
        for (Index b = 0; b < ny_; ++b) {
          for (Index a = 0; a < ny_; ++a) sum += K_(i, a) * N(a, b) * K_(j, b);
        }
        next_P_(i, j) += sum;
        if (i != j) next_P_(j, i) = next_P_(i, j);
      }
    }
  }
  // next_dP += K dN K'.
  void add_gain_noise_derivatives(const Stack& dN) {
    for (Index j = 0; j < nx_; ++j) {
      for (Index i = 0; i <= j; ++i) {
        auto&& row = next_dP_.row(i + nx_ * j);
        for (Index b = 0; b < ny_; ++b) {
          for (Index a = 0; a < ny_; ++a) row += (K_(i, a) * K_(j, b)) * dN.row(a + ny_ * b);
        }
        if (i != j) next_dP_.row(j + nx_ * i) = row;
      }
    }
  }

  // Unscented.

  // A function's values at the sigma points x, x + c L_1, .., x + c L_n, x - c L_1, .. and what
  // follows: their covariance is A A' + rest, and that with x is L A', where A has the columns
  // (g(x + c L_j) - g(x - c L_j)) / (2 c) and rest is what a linear function does not have. In that
  // form nothing cancels and the covariance after a measurement is a sum of squares.
  struct SigmaPoints {
    MatrixXd values, A, rest, deviation;
    VectorXd mean;
    Stack dvalues, dmean, dA, drest, ddeviation;
  };

  // L and its derivatives. A variance of zero has a column of zeros, one that the others determine
  // a column as small as rounding.
  bool factor_covariance() {
    for (Index j = 0; j < nx_; ++j) {
      const double scale = P_(j, j);
      double pivot = scale;
      for (Index l = 0; l < j; ++l) pivot -= L_(j, l) * L_(j, l);
      if (!std::isfinite(pivot)) status_ = FilterStatus::not_finite;
      if (pivot < -kNegative * std::abs(scale)) status_ = FilterStatus::indefinite;
      if (scale == 0.0) {
        for (Index i = j; i < nx_; ++i) {
          // Points that coincide do not tell how they would part.
          if (P_(i, j) != 0.0 || !dP_.row(i + nx_ * j).isZero(0.0)) {
            status_ = FilterStatus::indefinite;
          }
          L_(i, j) = 0.0;
          dL_.row(i + nx_ * j).setZero();
        }
        if (status_ != FilterStatus::ok) return false;
        continue;
      }
      if (status_ != FilterStatus::ok) return false;
      L_(j, j) = std::sqrt(std::max(pivot, kLeastPivot * scale));
      for (Index i = j + 1; i < nx_; ++i) {
        double sum = P_(i, j);
        for (Index l = 0; l < j; ++l) sum -= L_(i, l) * L_(j, l);
        L_(i, j) = sum / L_(j, j);
      }
      if (k_ == 0) continue;
      for (Index i = j; i < nx_; ++i) {
        auto&& row = dL_.row(i + nx_ * j);
        row = dP_.row(i + nx_ * j);
        for (Index l = 0; l < j; ++l) {
          row -= L_(j, l) * dL_.row(i + nx_ * l) + L_(i, l) * dL_.row(j + nx_ * l);
        }
        if (i == j) {
          row *= 0.5 / L_(j, j);
        } else {
          row -= L_(i, j) * dL_.row(j + nx_ * j);
          row *= 1.0 / L_(j, j);
        }
      }
    }
    return true;
  }

  // Point q and its derivatives into xi.
  void set_point(Index q) {
    xi_ = x_;
    if (k_ > 0) dxi_ = dx_;
    if (q == 0) return;
    const Index j = (q - 1) % nx_;
    const double way = q <= nx_ ? reach_ : -reach_;
    xi_ += way * L_.col(j);
    if (k_ > 0) dxi_ += way * dL_.middleRows(nx_ * j, nx_);
  }

  void set_moments(SigmaPoints& s) {
    const Index n = nx_, rows = s.values.rows();
    const double c = reach_, w = outer_weight_;
    // Deviations from the middle point first: sum_j (g+ + g- - 2 g0) / 2.
    s.mean.setZero();
    for (Index j = 0; j < n; ++j) {
      s.A.col(j) = (s.values.col(1 + j) - s.values.col(1 + n + j)) / (2.0 * c);
      s.deviation.col(j) = 0.5 * (s.values.col(1 + j) + s.values.col(1 + n + j)) - s.values.col(0);
      s.mean += 2.0 * w * s.deviation.col(j);
    }
    for (Index j = 0; j < n; ++j) s.deviation.col(j) -= s.mean;
    s.deviation.col(n) = -s.mean;
    s.mean += s.values.col(0);
    for (Index b = 0; b < rows; ++b) {
      for (Index a = 0; a <= b; ++a) {
        double sum = middle_weight_ * s.deviation(a, n) * s.deviation(b, n);
        for (Index j = 0; j < n; ++j) sum += 2.0 * w * s.deviation(a, j) * s.deviation(b, j);
        s.rest(a, b) = s.rest(b, a) = sum;
      }
    }
    if (k_ == 0) return;
    const auto at = [rows](Stack& stack, Index column) {
      return stack.middleRows(rows * column, rows);
    };
    s.dmean.setZero();
    for (Index j = 0; j < n; ++j) {
      at(s.dA, j) = (at(s.dvalues, 1 + j) - at(s.dvalues, 1 + n + j)) / (2.0 * c);
      at(s.ddeviation, j) =
          0.5 * (at(s.dvalues, 1 + j) + at(s.dvalues, 1 + n + j)) - at(s.dvalues, 0);
      s.dmean += 2.0 * w * at(s.ddeviation, j);
    }
    for (Index j = 0; j < n; ++j) at(s.ddeviation, j) -= s.dmean;
    at(s.ddeviation, n) = -s.dmean;
    s.dmean += at(s.dvalues, 0);
    for (Index b = 0; b < rows; ++b) {
      for (Index a = 0; a <= b; ++a) {
        auto&& row = s.drest.row(a + rows * b);
        row.setZero();
        for (Index j = 0; j <= n; ++j) {
          const double weight = j < n ? 2.0 * w : middle_weight_;
          row += (weight * s.deviation(a, j)) * s.ddeviation.row(b + rows * j) +
                 (weight * s.deviation(b, j)) * s.ddeviation.row(a + rows * j);
        }
        if (a != b) s.drest.row(b + rows * a) = row;
      }
    }
  }

  void measure_by_points(Index t) {
    if (!factor_covariance()) return;
    SigmaPoints& s = seen_;
    for (Index q = 0; q <= 2 * nx_; ++q) {
      set_point(q);
      if (k_ == 0) {
        observe(model_, memory_, xi_, inputs_at(t), inputs_.time[t], s.values.col(q));
        continue;
      }
      observe(model_, memory_, xi_, inputs_at(t), inputs_.time[t], s.values.col(q), seen_slopes_);
      s.dvalues.middleRows(ny_ * q, ny_).setZero();
      chain_.add(seen_slopes_.by_x, seen_slopes_.by_p, dxi_, s.dvalues, ny_ * q);
    }
    set_moments(s);
    s.rest += noise_.R;
    if (k_ > 0) s.drest += dR_;
    e_ = y_.col(t) - s.mean;
    set_product(M_, L_, s.A.transpose());
    set_symmetric_product(Sigma_, s.A, s.A.transpose());
    Sigma_ += s.rest;
    if (states_) store_->Sigma[static_cast<std::size_t>(t)] = Sigma_;
    if (present_count_ == 0) return;
    if (k_ > 0) {
      de_ = -s.dmean;
      for (Index a = 0; a < ny_; ++a) {
        for (Index i = 0; i < nx_; ++i) {
          auto&& row = dM_.row(i + nx_ * a);
          row.setZero();
          for (Index l = 0; l < nx_; ++l) {
            row += s.A(a, l) * dL_.row(i + nx_ * l) + L_(i, l) * s.dA.row(a + ny_ * l);
          }
        }
        for (Index b = 0; b < ny_; ++b) {
          auto&& row = dSigma_.row(a + ny_ * b);
          row = s.drest.row(a + ny_ * b);
          for (Index l = 0; l < nx_; ++l) {
            row += s.A(a, l) * s.dA.row(b + ny_ * l) + s.A(b, l) * s.dA.row(a + ny_ * l);
          }
        }
      }
    }
    leave_out_missing();
    if (!standardise()) return;
    set_gain();
    correct();
    add_terms(t, false);
    // P+ = T T' + K rest K' with T = L - K A, in which the derivative of K again drops out.
    T_ = L_;
    add_product(T_, K_, s.A, -1.0);
    set_symmetric_product(next_P_, T_, T_.transpose());
    add_gain_noise(s.rest);
    if (k_ > 0) {
      for (Index l = 0; l < nx_; ++l) {
        for (Index i = 0; i < nx_; ++i) {
          auto&& row = dT_.row(i + nx_ * l);
          row = dL_.row(i + nx_ * l);
          for (Index a = 0; a < ny_; ++a) row -= K_(i, a) * s.dA.row(a + ny_ * l);
        }
      }
      next_dP_.setZero();
      X_ = T_.transpose();
      add_turned(dT_, X_);
      add_gain_noise_derivatives(s.drest);
      dP_.swap(next_dP_);
      dx_.swap(next_dx_);
    }
    P_.swap(next_P_);
    x_.swap(next_x_);
  }

  void predict_by_points(Index t) {
    if (!factor_covariance()) return;
    SigmaPoints& s = moved_;
    for (Index q = 0; q <= 2 * nx_; ++q) {
      set_point(q);
      const bool noisy = q == 0 && density_;
      if (k_ == 0 && !noisy) {
        step(model_, memory_, inputs_, t, xi_);
      } else {
        step(model_, memory_, inputs_, t, xi_, moved_slopes_, noisy ? order_ : Derivatives::first,
             noisy ? &gramians_ : nullptr);
        if (noisy) take_noise();
      }
      s.values.col(q) = xi_;
      if (k_ == 0) continue;
      s.dvalues.middleRows(nx_ * q, nx_).setZero();
      chain_.add(moved_slopes_.by_x, moved_slopes_.by_p, dxi_, s.dvalues, nx_ * q);
    }
    set_moments(s);
    x_ = s.mean;
    set_symmetric_product(P_, s.A, s.A.transpose());
    P_ += s.rest + W_;
    if (k_ == 0) return;
    dx_ = s.dmean;
    next_dP_ = s.drest + dW_;
    X_ = s.A.transpose();
    add_turned(s.dA, X_);
    dP_.swap(next_dP_);
  }

  const NonlinearModel& model_;
  ModelMemory& memory_;
  const FilterNoise& noise_;
  const InputNodes& inputs_;
  const Eigen::Ref<const MatrixXd>& y_;
  const NonlinearFilterOptions& options_;
  const Chain chain_;
  const Index nx_, ny_, k_;
  const bool density_;
  bool output_error_ = false, unscented_ = false, noise_moves_ = false;
  Derivatives order_ = Derivatives::first;

  FilterResult* store_ = nullptr;
  bool states_ = false;
  MatrixXd* score_products_ = nullptr;
  FilterStatus status_ = FilterStatus::ok;
  Likelihood out_;
  Index samples_ = 0;
  std::vector<int> present_;  // per channel
  Index present_count_ = 0;
  bool pattern_changed_ = true;
  MatrixXd held_information_;
  double held_samples_ = 0.0;

  VectorXd base_x_, way_, base_way_;  // of the iterations
  Stack base_dx_;
  MatrixXd present_R_, R_factor_;
  bool R_is_regular_ = false;
  double cost_ = 0.0, promised_ = 0.0,
         share_ = 1.0;  // of the last point; what a full step promises
  VectorXd whitened_;

  VectorXd x_, next_x_, xi_;  // xi: where h is linearised, a sigma point
  MatrixXd P_, next_P_, W_;
  Stack dx_, next_dx_, dxi_, dP_, next_dP_, dW_, dQ_, dR_;
  Slopes moved_slopes_, seen_slopes_;  // of step() and h
  Gramians gramians_;
  std::vector<Index> moving_densities_;  // directions with a column of their own there
  VectorXd h_, e_, eps_, w_;             // eps = L^-1 e, w = Sigma^-1 e
  MatrixXd M_, K_, Sigma_, factor_, T_, X_;
  Stack de_, q_, Z_, dM_, dH_, dSigma_, V_, dPhi_, dT_;
  Eigen::RowVectorXd score_;

  double reach_ = 0.0, outer_weight_ = 0.0, middle_weight_ = 0.0;
  MatrixXd L_;
  Stack dL_;
  SigmaPoints moved_, seen_;
};

}  // namespace

FilterNoise zero_noise(const NonlinearModel& model) {
  const Index nx = model.states, ny = model.outputs;
  return {MatrixXd::Zero(nx, nx), MatrixXd::Zero(ny, ny), VectorXd::Zero(nx),
          MatrixXd::Zero(nx, nx)};
}

FilterResult nonlinear_filter(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                              const FilterNoise& noise, const InputNodes& inputs,
                              const Eigen::Ref<const MatrixXd>& y,
                              const NonlinearFilterOptions& options, Keep keep) {
  ModelMemory memory = make_memory(model);
  const std::vector<FilterDirection> none;
  NonlinearRecursion recursion(model, memory, p, noise, none, inputs, y, options);
  FilterResult out;
  const Index N = y.cols();
  out.e = MatrixXd::Constant(y.rows(), N, kNaN);
  out.standardised = out.e;
  if (keep == Keep::everything) {
    out.x_pred = MatrixXd::Constant(model.states, N, kNaN);
    out.x_filt = out.x_pred;
    out.P_pred.resize(static_cast<std::size_t>(N));
    out.P_filt.resize(static_cast<std::size_t>(N));
    out.Sigma.resize(static_cast<std::size_t>(N));
  }
  const Likelihood likelihood = recursion.run(&out, keep, nullptr);
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
  return out;
}

Likelihood nonlinear_likelihood(const NonlinearModel& model, ModelMemory& memory,
                                const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                                const std::vector<FilterDirection>& directions,
                                const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                                const NonlinearFilterOptions& options, MatrixXd* score_products) {
  NonlinearRecursion recursion(model, memory, p, noise, directions, inputs, y, options);
  return recursion.run(nullptr, Keep::innovations, score_products);
}

}  // namespace identikal
