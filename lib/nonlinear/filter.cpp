#include "lib/nonlinear/filter.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lib/base/constants.h"
#include "lib/base/message.h"
#include "lib/base/nearest_turn.h"
#include "lib/filter/gated_innovations.h"
#include "lib/internal/direction_stack.h"
#include "lib/internal/small_product.h"
#include "lib/nonlinear/internal/chain.h"
#include "lib/nonlinear/internal/extended_filter.h"
#include "lib/nonlinear/internal/innovation_update.h"
#include "lib/nonlinear/internal/scaled_noise.h"
#include "lib/nonlinear/internal/sigma_points.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

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

// Output error and the unscented filter.
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
        order_(k_ > 0 && !output_error_ ? Derivatives::second : Derivatives::first),
        outputs_(make_output_moments(nx_, ny_, k_)),
        update_(nx_, ny_, k_) {
    set_parameters(model, memory, p);
    const bool needs_second = order_ == Derivatives::second && density_;
    if (needs_second && model.order == Derivatives::first) {
      throw std::invalid_argument(
          "nonlinear filter: the gradient needs a model with second derivatives");
    }
    prepare(directions);
  }

  Likelihood run(const FilterOutputs& out) {
    store_ = out.store;
    states_ = store_ != nullptr && out.keep == Keep::everything;
    score_products_ = out.score_products;
    watcher_ = out.watcher;
    if (score_products_ != nullptr) score_products_->setZero(k_, k_);
    Index t = 0;
    go_to(t, y_.cols());
    if (score_products_ != nullptr) {
      score_products_->triangularView<Eigen::StrictlyLower>() = score_products_->transpose();
    }
    return update_.finish(status_);
  }

  FilterStatus go_to(FilterResult& store, Index& t, Index end) {
    store_ = &store;
    return go_to(t, end);
  }
  std::vector<double> predicted() const {
    std::vector<double> out(now_.x.begin(), now_.x.end());
    out.insert(out.end(), now_.P.reshaped().begin(), now_.P.reshaped().end());
    return out;
  }
  void go_back_to(const std::vector<double>& state) {
    std::copy_n(state.begin(), nx_, now_.x.begin());
    std::copy(state.begin() + nx_, state.end(), now_.P.reshaped().begin());
    status_ = FilterStatus::ok;
  }

 private:
  FilterStatus go_to(Index& t, Index end) {
    const Index N = y_.cols();
    for (; t < end && status_ == FilterStatus::ok; ++t) {
      present_count_ = update_.look_at(y_.col(t));
      if (states_) {
        store_->x_pred.col(t) = now_.x;
        store_->P_pred[t] = now_.P;
      }
      if (present_count_ > 0 || store_ != nullptr) measure(t);
      if (status_ != FilterStatus::ok) break;
      if (watcher_ != nullptr) (*watcher_)({t, now_.x, now_.P, now_.dx, now_.dP});
      if (states_) {
        store_->x_filt.col(t) = now_.x;
        store_->P_filt[t] = now_.P;
      }
      if (t + 1 < N) predict(t);
    }
    return status_;
  }

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
    dT_.setZero(nn, k_);
    half_ = dT_;
    if (output_error_) return;
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
      if (scaled != FilterStatus::ok) R_.setConstant(kNaN);  // that no measurement needs
    }
    if (output_error_) {
      measure_simulation(t);
    } else {
      measure_by_points(t);
    }
  }
  void predict(Index t) {
    if (output_error_) {
      simulate(t);
    } else {
      predict_by_points(t);
    }
  }

  bool is_ok(FilterStatus status) {
    status_ = status;
    return status == FilterStatus::ok;
  }
  void keep_covariance(Index t, const MatrixXd& Sigma) {
    if (store_ == nullptr) return;
    // What was there of the sample before is no more.
    store_->e.col(t).setConstant(kNaN);
    store_->standardised.col(t).setConstant(kNaN);
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
  const Derivatives order_;

  FilterResult* store_ = nullptr;
  bool states_ = false;
  MatrixXd* score_products_ = nullptr;
  const FilteredStateWatcher* watcher_ = nullptr;
  FilterStatus status_ = FilterStatus::ok;
  Index present_count_ = 0;

  Belief now_, next_;
  OutputMoments outputs_;
  InnovationUpdate update_;
  VectorXd xi_;  // a sigma point
  Stack dxi_;
  Jacobian moved_slopes_, seen_slopes_;  // of step() and h
  VectorXd h_;
  Gramians gramians_;
  std::vector<Index> moving_densities_;  // directions with a column of their own there
  MatrixXd R_, W_, T_, X_;
  Stack dW_, dQ_, dR_, dT_, half_;
  PointWeights weights_{};
  MatrixXd L_;
  Stack dL_;
  SigmaPoints moved_, seen_;
};

bool is_extended(const FilterNoise& noise, const std::vector<FilterDirection>& directions,
                 const NonlinearFilterOptions& options) {
  return options.method != NonlinearMethod::unscented && !is_output_error(noise, directions);
}

Likelihood run(const NonlinearModel& model, ModelMemory& memory,
               const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
               const std::vector<FilterDirection>& directions, const InputNodes& inputs,
               const Eigen::Ref<const MatrixXd>& y, const NonlinearFilterOptions& options,
               const FilterOutputs& out) {
  check_arguments(model, p, noise, directions, inputs, y, options);
  if (is_extended(noise, directions, options)) {
    return run_extended_filter(model, memory, p, noise, directions, inputs, y, options, out);
  }
  return NonlinearRecursion(model, memory, p, noise, directions, inputs, y, options).run(out);
}

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
  FilterResult out = empty_filter_result(model.states, y.rows(), y.cols(), keep);
  const Likelihood likelihood =
      run(model, memory, p, noise, {}, inputs, y, options, {.store = &out, .keep = keep});
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
  return out;
}

FilterResult gated_innovations(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                               const FilterNoise& noise, const InputNodes& inputs, MatrixXd& y,
                               const NonlinearFilterOptions& options, Index most_in_a_row,
                               const std::function<int(Index t, const FilterResult& so_far)>& far) {
  ModelMemory memory = make_memory(model);
  const std::vector<FilterDirection> none;
  check_arguments(model, p, noise, none, inputs, y, options);
  if (is_extended(noise, none, options)) {
    return gated_innovations(gated_extended_filter(model, memory, p, noise, inputs, y, options),
                             model.states, y, most_in_a_row, far);
  }
  const Eigen::Ref<const MatrixXd> seen = y;
  NonlinearRecursion filter(model, memory, p, noise, none, inputs, seen, options);
  GatedFilter stepping;
  stepping.go_to = [&](FilterResult& out, Index& t, Index end) {
    return filter.go_to(out, t, end);
  };
  stepping.state = [&] { return filter.predicted(); };
  stepping.go_back_to = [&](const std::vector<double>& state) { filter.go_back_to(state); };
  return gated_innovations(stepping, model.states, y, most_in_a_row, far);
}

Likelihood nonlinear_likelihood(const NonlinearModel& model, ModelMemory& memory,
                                const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                                const std::vector<FilterDirection>& directions,
                                const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                                const NonlinearFilterOptions& options, MatrixXd* score_products) {
  return run(model, memory, p, noise, directions, inputs, y, options,
             {.score_products = score_products});
}

Likelihood watch_filtered_states(const NonlinearModel& model, ModelMemory& memory,
                                 const Eigen::Ref<const VectorXd>& p, const FilterNoise& noise,
                                 const std::vector<FilterDirection>& directions,
                                 const InputNodes& inputs, const Eigen::Ref<const MatrixXd>& y,
                                 const NonlinearFilterOptions& options,
                                 const FilteredStateWatcher& see) {
  return run(model, memory, p, noise, directions, inputs, y, options, {.watcher = &see});
}

}  // namespace identikal
