#include "lib/nonlinear/filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "lib/base/message.h"
#include "lib/base/nearest_turn.h"
#include "lib/internal/direction_stack.h"
#include "lib/internal/small_product.h"
#include "lib/nonlinear/internal/chain.h"
#include "lib/nonlinear/internal/innovation_update.h"
#include "lib/nonlinear/internal/scaled_noise.h"
#include "lib/nonlinear/internal/sigma_points.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kUpdateSettled = 1e-10;  // of a standard deviation, iterated update
constexpr double kNoCost = 1e-10;         // of a sum of squares of standard deviations: rounding

void check_noise(const NonlinearModel& model, const FilterNoise& noise, const char* whose) {
  const Index nx = model.states, ny = model.outputs;
  if (noise.Q.rows() == nx && noise.Q.cols() == nx && noise.R.rows() == ny &&
      noise.R.cols() == ny && noise.x0.size() == nx && noise.P0.rows() == nx &&
      noise.P0.cols() == nx) {
    return;
  }
  const auto size = [](const MatrixXd& M) { return message({M.rows(), " x ", M.cols()}); };
  throw std::invalid_argument(
      message({"nonlinear filter: ", whose, " Q is ", size(noise.Q), ", R ", size(noise.R), ", x0 ",
               noise.x0.size(), ", P0 ", size(noise.P0), "; the model has ", nx, " states and ", ny,
               " outputs"}));
}

void check_arguments(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                     const FilterNoise& noise, const std::vector<FilterDirection>& directions,
                     const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                     const NonlinearFilterOptions& options) {
  const Index N = inputs.time.size();
  if (p.size() != model.parameters || y.rows() != model.outputs || y.cols() != N ||
      inputs.at_sample.rows() != model.inputs || inputs.at_sample.cols() != N) {
    throw std::invalid_argument(
        message({"nonlinear filter: ", p.size(), " parameters, y ", y.rows(), " x ", y.cols(),
                 ", inputs ", inputs.at_sample.rows(), " x ", inputs.at_sample.cols(), " at ", N,
                 " times; the model has ", model.parameters, " parameters, ", model.outputs,
                 " outputs and ", model.inputs, " inputs"}));
  }
  check_noise(model, noise, "the");
  for (const FilterDirection& direction : directions) {
    check_noise(model, direction.noise, "a direction's");
    if (direction.parameter == -1) continue;
    const bool there = direction.parameter >= 0 && direction.parameter < model.parameters;
    if (!there || model.column[direction.parameter] == NonlinearModel::kKnown) {
      throw std::invalid_argument(
          message({"nonlinear filter: a direction moves parameter ", direction.parameter, " of ",
                   model.parameters, (there ? ", which the model was made for as known" : "")}));
    }
  }
  if (options.noise == ProcessNoise::density && !model.continuous) {
    throw std::invalid_argument("nonlinear filter: a noise density in discrete time");
  }
  if (const NonlinearModel* scales = options.scales;
      scales != nullptr &&
      (scales->states != model.states || scales->inputs != model.inputs ||
       scales->parameters != model.parameters || scales->outputs != model.outputs)) {
    throw std::invalid_argument("nonlinear filter: scales of a model with other sizes");
  }
  const UnscentedWeights& w = options.weights;
  if (options.iterations < 1 ||
      !(w.alpha * w.alpha * (static_cast<double>(model.states) + w.kappa) > 0.0)) {
    throw std::invalid_argument(message({"nonlinear filter: ", options.iterations,
                                         " iterations, alpha ", w.alpha, ", kappa ", w.kappa}));
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

// The state as far as it is known at a sample, and its derivatives with respect to the directions.
struct Belief {
  VectorXd x;
  MatrixXd P;
  Stack dx, dP;
};

// The iterated filter's way through the points that h is linearised at. It looks for the least of
// 1/2 |y - h(xi)|^2 / R + 1/2 |xi - x|^2 / P, and stays where xi = x + P way, so that no inverse of
// P is needed; without one of R it is not damped.
class DampedIterations {
 public:
  // At xi = x. @param R_moves  from sample to sample
  void begin(const MatrixXd& R, bool R_moves, InnovationUpdate& update) {
    way_.setZero();
    share_ = 1.0;
    promised_ = -1.0;
    if (!update.take_change() && !R_moves) return;
    present_R_ = R;
    for (Index a = 0; a < R.rows(); ++a) {
      if (update.is_present(a)) continue;
      present_R_.row(a).setZero();
      present_R_.col(a).setZero();
      present_R_(a, a) = 1.0;
    }
    is_damped_ = set_factor(present_R_, R_factor_);
  }
  // Does xi, with the residual e, fall short of a quarter of what its linearisation promised? Then
  // it is put half way back to the last point, or all the way when it is the `last` to be
  // linearised at, and steps stay that short.
  bool steps_back(const VectorXd& e, const VectorXd& x, const InnovationUpdate& update, bool last,
                  VectorXd& xi, Stack& dxi) {
    if (!is_damped_) return false;
    const double cost = 0.5 * (way_.dot(xi - x) + squares(e, update));
    if (promised_ < 0.0 || cost <= cost_ - 0.25 * share_ * promised_ + kNoCost * (1.0 + cost_)) {
      cost_ = cost;
      return false;
    }
    const double part = last ? 0.0 : 0.5;
    share_ *= 0.5;
    xi = base_x_ + part * (xi - base_x_);
    dxi = base_dx_ + part * (dxi - base_dx_);
    way_ = base_way_ + part * (way_ - base_way_);
    return true;
  }
  // From xi, where h has the derivatives H, by a share of the way to `next`.
  void advance(const MatrixXd& H, const InnovationUpdate& update, const Belief& next, VectorXd& xi,
               Stack& dxi) {
    base_x_ = xi;
    base_dx_ = dxi;
    base_way_ = way_;
    way_.setZero();
    for (Index a = 0; a < H.rows(); ++a) {
      if (update.is_present(a)) way_ += update.weighted()[a] * H.row(a).transpose();
    }
    xi = next.x - base_x_;
    if (is_damped_) {
      moved_.noalias() = H.lazyProduct(xi);
      promised_ = xi.dot(way_ - base_way_) + squares(moved_, update);
    }
    way_ = base_way_ + share_ * (way_ - base_way_);
    xi = base_x_ + share_ * xi;
    dxi = base_dx_ + share_ * (next.dx - base_dx_);
  }
  void resize(Index nx, Index ny) {
    way_.setZero(nx);
    R_factor_.setZero(ny, ny);
    whitened_.setZero(ny);
  }

 private:
  // R^-1/2 times a residual, squared.
  double squares(const VectorXd& r, const InnovationUpdate& update) {
    for (Index a = 0; a < r.size(); ++a) {
      double sum = update.is_present(a) ? r[a] : 0.0;
      for (Index b = 0; b < a; ++b) sum -= R_factor_(a, b) * whitened_[b];
      whitened_[a] = sum / R_factor_(a, a);
    }
    return whitened_.squaredNorm();
  }

  VectorXd way_, base_x_, base_way_, whitened_, moved_;
  Stack base_dx_;
  MatrixXd present_R_, R_factor_;
  bool is_damped_ = false;
  double cost_ = 0.0, promised_ = 0.0, share_ = 1.0;  // of the last point; of a full step
};

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
        density_(options.noise == ProcessNoise::density),
        output_error_(is_output_error(noise, directions)),
        scaled_(options, p, noise, directions),
        unscented_(options.method == NonlinearMethod::unscented),
        curved_outputs_(!model.output_curved.empty()),
        order_(k_ > 0 && !output_error_ ? Derivatives::second : Derivatives::first),
        outputs_(make_output_moments(nx_, ny_, k_)),
        update_(nx_, ny_, k_) {
    set_parameters(model, memory, p);
    const bool needs_second = order_ == Derivatives::second && (!unscented_ || density_);
    if (needs_second && model.order == Derivatives::first) {
      throw std::invalid_argument(
          "nonlinear filter: the gradient needs a model with second derivatives");
    }
    prepare(directions);
  }

  Likelihood run(FilterResult* store, Keep keep, MatrixXd* score_products,
                 const FilteredStateWatcher* watcher = nullptr) {
    store_ = store;
    states_ = store != nullptr && keep == Keep::everything;
    score_products_ = score_products;
    if (score_products != nullptr) score_products->setZero(k_, k_);
    const Index N = y_.cols();
    for (Index t = 0; t < N && status_ == FilterStatus::ok; ++t) {
      present_count_ = update_.look_at(y_.col(t));
      if (states_) {
        store_->x_pred.col(t) = now_.x;
        store_->P_pred[t] = now_.P;
      }
      if (present_count_ > 0 || store_ != nullptr) measure(t);
      if (status_ != FilterStatus::ok) break;
      if (watcher != nullptr) (*watcher)({t, now_.x, now_.P, now_.dx, now_.dP});
      if (states_) {
        store_->x_filt.col(t) = now_.x;
        store_->P_filt[t] = now_.P;
      }
      if (t + 1 < N) predict(t);
    }
    if (score_products != nullptr) {
      score_products->triangularView<Eigen::StrictlyLower>() = score_products->transpose();
    }
    return update_.finish(status_);
  }

 private:
  void prepare(const std::vector<FilterDirection>& directions) {
    const Index nn = nx_ * nx_;
    now_.x = noise_.x0;
    now_.P = noise_.P0;
    now_.dx.setZero(nx_, k_);
    now_.dP.setZero(nn, k_);
    dQ_.setZero(nn, k_);
    dR_.setZero(ny_ * ny_, k_);
    gramians_.densities = noise_.Q.reshaped(nn, 1);
    for (Index i = 0; i < k_; ++i) {
      const FilterNoise& d = directions[i].noise;
      now_.dx.col(i) = d.x0;
      now_.dP.col(i) = d.P0.reshaped();
      dQ_.col(i) = d.Q.reshaped();
      dR_.col(i) = d.R.reshaped();
      if (density_ && !is_zero(d.Q)) {
        moving_densities_.push_back(i);
        gramians_.densities.conservativeResize(nn, gramians_.densities.cols() + 1);
        gramians_.densities.rightCols(1) = d.Q.reshaped();
      }
    }
    R_ = noise_.R;
    next_ = now_;
    W_ = noise_.Q;
    dW_ = dQ_;
    h_.setZero(ny_);
    T_.setZero(nx_, nx_);
    X_ = T_;
    xi_ = now_.x;
    dxi_ = now_.dx;
    dH_.setZero(ny_ * nx_, k_);
    dPhi_.setZero(nn, k_);
    dT_ = dPhi_;
    half_ = dPhi_;
    iterations_.resize(nx_, ny_);
    if (!unscented_ || output_error_) return;
    weights_ = point_weights(options_.weights, nx_);
    L_.setZero(nx_, nx_);
    dL_.setZero(nn, k_);
    moved_ = make_sigma_points(nx_, nx_, k_);
    seen_ = make_sigma_points(ny_, nx_, k_);
  }

  void measure(Index t) {
    if (scaled_.moves()) {
      const FilterStatus scaled =
          scaled_.set(t, now_.x, now_.dx, inputs_.at_sample.col(t), inputs_.time[t], R_, dR_);
      if (present_count_ > 0 && !is_ok(scaled)) return;
      if (scaled != FilterStatus::ok) R_.setConstant(kNan);  // that no measurement needs
    }
    if (output_error_) {
      measure_simulation(t);
    } else if (unscented_) {
      measure_by_points(t);
    } else {
      measure_by_jacobian(t);
    }
  }
  void predict(Index t) {
    if (output_error_) {
      simulate(t);
    } else if (unscented_) {
      predict_by_points(t);
    } else {
      predict_by_jacobian(t);
    }
  }

  bool is_ok(FilterStatus status) {
    status_ = status;
    return status == FilterStatus::ok;
  }
  void keep_covariance(Index t, const MatrixXd& Sigma) {
    if (store_ == nullptr) return;
    store_->e_sd.col(t) = Sigma.diagonal().cwiseSqrt();
    if (states_) store_->Sigma[t] = Sigma;
  }
  void add_terms(Index t) {
    update_.add_terms(outputs_, score_products_);
    if (store_ == nullptr) return;
    for (Index a = 0; a < ny_; ++a) {
      if (!update_.is_present(a)) continue;
      store_->e(a, t) = outputs_.e[a];
      store_->standardised(a, t) = update_.standardised()[a];
    }
  }
  void take_nearest_turn() {
    for (std::size_t i = 0; i < options_.wraps.size(); ++i) {
      double& e = outputs_.e[static_cast<Index>(i)];
      if (options_.wraps[i]) e = nearest_turn(e);
    }
  }
  auto inputs_at(Index t) const { return inputs_.at_sample.col(t); }

  // Output error.

  void measure_simulation(Index t) {
    if (k_ > 0) {
      observe(model_, memory_, now_.x, inputs_at(t), inputs_.time[t], h_, seen_slopes_);
      outputs_.de.setZero();
      chain_.add(seen_slopes_.wrt_x, seen_slopes_.wrt_p, now_.dx, outputs_.de, 0, -1.0);
    } else {
      observe(model_, memory_, now_.x, inputs_at(t), inputs_.time[t], h_);
    }
    keep_covariance(t, R_);
    if (present_count_ == 0) return;
    outputs_.e = y_.col(t) - h_;
    take_nearest_turn();
    if (is_ok(scaled_.moves() ? set_scaled() : update_.set_constant(outputs_, R_, dR_))) {
      add_terms(t);
    }
  }

  // The innovation of a simulation, by this sample's R.
  FilterStatus set_scaled() {
    outputs_.M.setZero();
    outputs_.dM.setZero();
    outputs_.Sigma = R_;
    outputs_.dSigma = dR_;
    return update_.set(outputs_);
  }

  void simulate(Index t) {
    if (k_ == 0) {
      step(model_, memory_, inputs_, t, now_.x);
      return;
    }
    step(model_, memory_, inputs_, t, now_.x, moved_slopes_);
    next_.dx.setZero();
    chain_.add(moved_slopes_.wrt_x, moved_slopes_.wrt_p, now_.dx, next_.dx);
    now_.dx.swap(next_.dx);
  }

  // Extended and iterated.

  void measure_by_jacobian(Index t) {
    xi_ = now_.x;
    dxi_ = now_.dx;
    const bool iterated = options_.method == NonlinearMethod::iterated && present_count_ > 0;
    const MatrixXd& H = seen_slopes_.wrt_x;
    if (iterated) iterations_.begin(R_, scaled_.moves(), update_);
    for (int i = iterated ? options_.iterations : 1; i > 0; --i) {
      observe(model_, memory_, xi_, inputs_at(t), inputs_.time[t], h_, seen_slopes_, order_);
      outputs_.e = y_.col(t) - h_;
      take_nearest_turn();
      if (iterated && i > 1 &&
          iterations_.steps_back(outputs_.e, now_.x, update_, i == 2, xi_, dxi_)) {
        continue;
      }
      set_product(outputs_.M, now_.P, H.transpose());
      set_symmetric_product(outputs_.Sigma, H, outputs_.M);
      outputs_.Sigma += R_;
      for (Index l = 0; l < nx_; ++l) outputs_.e -= H.col(l) * (now_.x[l] - xi_[l]);
      if (k_ > 0) linearisation_derivatives();
      keep_covariance(t, outputs_.Sigma);
      if (present_count_ == 0) return;
      if (!is_ok(update_.set(outputs_))) return;
      update_.correct(outputs_, now_.x, now_.dx, next_.x, next_.dx);
      if (i == 1 || has_settled()) break;
      iterations_.advance(H, update_, next_, xi_, dxi_);
    }
    add_terms(t);
    const MatrixXd& K = update_.gain();
    // T = I - K H
    set_product(T_, K, H, -1.0);
    T_.diagonal().array() += 1.0;
    set_product(X_, now_.P, T_.transpose());
    set_symmetric_product(next_.P, T_, X_);
    add_gain_noise(K, R_, next_.P);
    if (k_ > 0) {
      // K minimises P+, so its own derivative drops out: T dP T' - (K dH) X - X' (K dH)' + K dR K'.
      set_congruence(T_, now_.dP, dT_, next_.dP);
      if (curved_outputs_) {
        for (Index l = 0; l < nx_; ++l) {  // dT = -K dH
          for (Index i = 0; i < nx_; ++i) {
            dT_.row(i + nx_ * l).setZero();
            for (Index a = 0; a < ny_; ++a) add_row(dT_, i + nx_ * l, -K(i, a), dH_, a + ny_ * l);
          }
        }
        add_turned(dT_, X_, half_, next_.dP);
      }
      add_gain_noise(K, dR_, next_.dP);
    }
    std::swap(now_, next_);
  }

  void linearisation_derivatives() {
    const MatrixXd& H = seen_slopes_.wrt_x;
    if (curved_outputs_) chain_.set(seen_slopes_.wrt_x_jacobian, dxi_, dH_);
    // e = y - h(xi) - H (x - xi): what xi moves by itself cancels in the first order.
    outputs_.de.setZero();
    chain_.add(H, seen_slopes_.wrt_p, now_.dx, outputs_.de, 0, -1.0);
    for (Index l = 0; l < nx_; ++l) {
      const double away = now_.x[l] - xi_[l];
      if (away != 0.0) outputs_.de -= away * dH_.middleRows(ny_ * l, ny_);
    }
    for (Index a = 0; a < ny_; ++a) {  // what is missing is left out later
      if (!update_.is_present(a)) continue;
      for (Index i = 0; i < nx_; ++i) {
        const Index entry = i + nx_ * a;
        outputs_.dM.row(entry).setZero();
        for (Index l = 0; l < nx_; ++l) add_row(outputs_.dM, entry, H(a, l), now_.dP, i + nx_ * l);
        for (Index l = 0; curved_outputs_ && l < nx_; ++l) {
          add_row(outputs_.dM, entry, now_.P(i, l), dH_, a + ny_ * l);
        }
      }
    }
    for (Index b = 0; b < ny_; ++b) {
      for (Index a = 0; a < ny_; ++a) {
        if (!update_.is_present(a) || !update_.is_present(b)) continue;
        const Index entry = a + ny_ * b;
        outputs_.dSigma.row(entry) = dR_.row(entry);
        for (Index l = 0; l < nx_; ++l) {
          add_row(outputs_.dSigma, entry, H(a, l), outputs_.dM, l + nx_ * b);
        }
        for (Index l = 0; curved_outputs_ && l < nx_; ++l) {
          add_row(outputs_.dSigma, entry, outputs_.M(l, b), dH_, a + ny_ * l);
        }
      }
    }
  }

  bool has_settled() const {
    for (Index i = 0; i < nx_; ++i) {
      const double limit = kUpdateSettled * std::sqrt(now_.P(i, i)) + 1e-15 * std::abs(xi_[i]);
      if (!(std::abs(next_.x[i] - xi_[i]) <= limit)) return false;
    }
    return true;
  }

  void predict_by_jacobian(Index t) {
    step(model_, memory_, inputs_, t, now_.x, moved_slopes_, order_,
         density_ ? &gramians_ : nullptr);
    take_noise();
    const MatrixXd& Phi = moved_slopes_.wrt_x;
    set_product(X_, now_.P, Phi.transpose());
    set_symmetric_product(next_.P, Phi, X_);
    next_.P += W_;
    next_.x = now_.x;
    if (k_ > 0) {
      chain_.set(moved_slopes_.wrt_x_jacobian, now_.dx, dPhi_);
      set_congruence(Phi, now_.dP, dT_, next_.dP);
      add_turned(dPhi_, X_, half_, next_.dP);
      next_.dP += dW_;
      next_.dx.setZero();
      chain_.add(Phi, moved_slopes_.wrt_p, now_.dx, next_.dx);
    }
    std::swap(now_, next_);
  }

  // W and its derivatives, from the Gramians of the step from x with dx.
  void take_noise() {
    if (!density_) return;
    W_ = gramians_.values.col(0).reshaped(nx_, nx_);
    if (k_ == 0) return;
    chain_.set(gramians_.jacobian, now_.dx, dW_);
    for (std::size_t j = 0; j < moving_densities_.size(); ++j) {
      dW_.col(moving_densities_[j]) += gramians_.values.col(static_cast<Index>(j) + 1);
    }
  }

  // Unscented.

  void measure_by_points(Index t) {
    if (!is_ok(set_covariance_factor(now_.P, now_.dP, L_, dL_))) return;
    SigmaPoints& s = seen_;
    for (Index q = 0; q <= 2 * nx_; ++q) {
      set_point(q, weights_, now_.x, now_.dx, L_, dL_, xi_, dxi_);
      if (k_ == 0) {
        observe(model_, memory_, xi_, inputs_at(t), inputs_.time[t], s.values.col(q));
        continue;
      }
      observe(model_, memory_, xi_, inputs_at(t), inputs_.time[t], s.values.col(q), seen_slopes_);
      s.dvalues.middleRows(ny_ * q, ny_).setZero();
      chain_.add(seen_slopes_.wrt_x, seen_slopes_.wrt_p, dxi_, s.dvalues, ny_ * q);
    }
    for (std::size_t i = 0; i < options_.wraps.size(); ++i) {
      if (!options_.wraps[i]) continue;
      auto row = s.values.row(static_cast<Index>(i));
      const double middle = row[0];
      for (double& value : row) value = middle + nearest_turn(value - middle);
    }
    set_moments(s, weights_);
    s.rest += R_;
    if (k_ > 0) s.drest += dR_;
    outputs_.e = y_.col(t) - s.mean;
    take_nearest_turn();
    set_product(outputs_.M, L_, s.A.transpose());
    set_symmetric_product(outputs_.Sigma, s.A, s.A.transpose());
    outputs_.Sigma += s.rest;
    keep_covariance(t, outputs_.Sigma);
    if (present_count_ == 0) return;
    if (k_ > 0) point_derivatives();
    if (!is_ok(update_.set(outputs_))) return;
    update_.correct(outputs_, now_.x, now_.dx, next_.x, next_.dx);
    add_terms(t);
    // P+ = T T' + K rest K' with T = L - K A, in which the derivative of K again drops out.
    const MatrixXd& K = update_.gain();
    T_ = L_;
    add_product(T_, K, s.A, -1.0);
    set_symmetric_product(next_.P, T_, T_.transpose());
    add_gain_noise(K, s.rest, next_.P);
    if (k_ > 0) {
      for (Index l = 0; l < nx_; ++l) {
        for (Index i = 0; i < nx_; ++i) {
          auto&& row = dT_.row(i + nx_ * l);
          row = dL_.row(i + nx_ * l);
          for (Index a = 0; a < ny_; ++a) row -= K(i, a) * s.dA.row(a + ny_ * l);
        }
      }
      next_.dP.setZero();
      X_ = T_.transpose();
      add_turned(dT_, X_, half_, next_.dP);
      add_gain_noise(K, s.drest, next_.dP);
    }
    std::swap(now_, next_);
  }

  void point_derivatives() {
    const SigmaPoints& s = seen_;
    outputs_.de = -s.dmean;
    for (Index a = 0; a < ny_; ++a) {
      for (Index i = 0; i < nx_; ++i) {
        auto&& row = outputs_.dM.row(i + nx_ * a);
        row.setZero();
        for (Index l = 0; l < nx_; ++l) {
          row += s.A(a, l) * dL_.row(i + nx_ * l) + L_(i, l) * s.dA.row(a + ny_ * l);
        }
      }
      for (Index b = 0; b < ny_; ++b) {
        auto&& row = outputs_.dSigma.row(a + ny_ * b);
        row = s.drest.row(a + ny_ * b);
        for (Index l = 0; l < nx_; ++l) {
          row += s.A(a, l) * s.dA.row(b + ny_ * l) + s.A(b, l) * s.dA.row(a + ny_ * l);
        }
      }
    }
  }

  void predict_by_points(Index t) {
    if (!is_ok(set_covariance_factor(now_.P, now_.dP, L_, dL_))) return;
    SigmaPoints& s = moved_;
    for (Index q = 0; q <= 2 * nx_; ++q) {
      set_point(q, weights_, now_.x, now_.dx, L_, dL_, xi_, dxi_);
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
      chain_.add(moved_slopes_.wrt_x, moved_slopes_.wrt_p, dxi_, s.dvalues, nx_ * q);
    }
    set_moments(s, weights_);
    now_.x = s.mean;
    set_symmetric_product(now_.P, s.A, s.A.transpose());
    now_.P += s.rest + W_;
    if (k_ == 0) return;
    now_.dx = s.dmean;
    now_.dP = s.drest + dW_;
    X_ = s.A.transpose();
    add_turned(s.dA, X_, half_, now_.dP);
  }

  const NonlinearModel& model_;
  ModelMemory& memory_;
  const FilterNoise& noise_;
  const InputNodes& inputs_;
  const Eigen::Ref<const MatrixXd>& y_;
  const NonlinearFilterOptions& options_;
  const Chain chain_;
  const Index nx_, ny_, k_;
  const bool density_, output_error_;
  ScaledNoise scaled_;
  const bool unscented_, curved_outputs_;
  const Derivatives order_;

  FilterResult* store_ = nullptr;
  bool states_ = false;
  MatrixXd* score_products_ = nullptr;
  FilterStatus status_ = FilterStatus::ok;
  Index present_count_ = 0;

  Belief now_, next_;
  OutputMoments outputs_;
  InnovationUpdate update_;
  DampedIterations iterations_;
  VectorXd xi_;  // where h is linearised, a sigma point
  Stack dxi_;
  Jacobian moved_slopes_, seen_slopes_;  // of step() and h
  VectorXd h_;
  Gramians gramians_;
  std::vector<Index> moving_densities_;  // directions with a column of their own there
  MatrixXd R_, W_, T_, X_;
  Stack dW_, dQ_, dR_, dH_, dPhi_, dT_, half_;
  PointWeights weights_{};
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
  check_arguments(model, p, noise, none, inputs, y, options);
  NonlinearRecursion recursion(model, memory, p, noise, none, inputs, y, options);
  FilterResult out = empty_filter_result(model.states, y.rows(), y.cols(), keep);
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
  check_arguments(model, p, noise, directions, inputs, y, options);
  NonlinearRecursion recursion(model, memory, p, noise, directions, inputs, y, options);
  return recursion.run(nullptr, Keep::innovations, score_products);
}

Likelihood watch_filtered_states(const NonlinearModel& model, ModelMemory& memory,
                                 const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                                 const std::vector<FilterDirection>& directions,
                                 const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                                 const NonlinearFilterOptions& options,
                                 const FilteredStateWatcher& see) {
  check_arguments(model, p, noise, directions, inputs, y, options);
  NonlinearRecursion recursion(model, memory, p, noise, directions, inputs, y, options);
  return recursion.run(nullptr, Keep::innovations, nullptr, &see);
}

}  // namespace identikal
