#include "lib/nonlinear_smoother.h"

#include <cmath>
#include <vector>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// L L' = P, L lower triangular; the column of a state that those before it determine is zero.
MatrixXd semidefinite_factor(const MatrixXd& P) {
  MatrixXd L = MatrixXd::Zero(P.rows(), P.cols());
  for (Index j = 0; j < P.rows(); ++j) {
    const VectorXd rest = P.col(j).tail(P.rows() - j) -
                          L.bottomLeftCorner(P.rows() - j, j) * L.row(j).head(j).transpose();
    if (!(rest[0] > 1e-14 * P(j, j))) continue;
    L.col(j).tail(P.rows() - j) = rest / std::sqrt(rest[0]);
  }
  return L;
}

// f(x) = slopes x + offset + what has the covariance `rest`.
struct Line {
  MatrixXd slopes;
  VectorXd offset;
  MatrixXd rest;
};

// The line that has the moments of x and f(x) as sigma points give them, x of covariance P about
// `middle`.
template <typename Function>
Line line_of_points(const VectorXd& middle, const MatrixXd& P, const UnscentedWeights& weights,
                    Index rows, Function&& f) {
  const Index n = middle.size();
  const double square = weights.alpha * weights.alpha * (static_cast<double>(n) + weights.kappa);
  const double reach = std::sqrt(square), outer = 0.5 / square,
               share = (square - static_cast<double>(n)) / square;
  const MatrixXd L = semidefinite_factor(P);
  MatrixXd above(rows, n), below(rows, n);
  const VectorXd at_middle = f(middle);
  for (Index j = 0; j < n; ++j) {
    above.col(j) = f(middle + reach * L.col(j));
    below.col(j) = f(middle - reach * L.col(j));
  }
  const VectorXd mean = share * at_middle + outer * (above + below).rowwise().sum();
  const VectorXd off = at_middle - mean;
  above.colwise() -= mean;
  below.colwise() -= mean;
  Line out;
  out.rest = (share + 1.0 - weights.alpha * weights.alpha + weights.beta) * off * off.transpose() +
             outer * (above * above.transpose() + below * below.transpose());
  // cov(y, x) = D L', so that slopes L = D.
  MatrixXd D = outer * reach * (above - below);
  out.slopes = MatrixXd::Zero(rows, n);
  for (Index j = n - 1; j >= 0; --j) {
    if (L(j, j) == 0.0) continue;
    out.slopes.col(j) =
        (D.col(j) - out.slopes.rightCols(n - 1 - j) * L.col(j).tail(n - 1 - j)) / L(j, j);
  }
  out.offset = mean - out.slopes * middle;
  out.rest -= out.slopes * P * out.slopes.transpose();
  return out;
}

// The straight lines that a filter has followed.
class Followed {
 public:
  Followed(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
           const FilterNoise& noise, const InputNodes& inputs,
           const NonlinearFilterOptions& options, const FilterResult& filter)
      : model_(model),
        memory_(make_memory(model)),
        noise_(noise),
        inputs_(inputs),
        options_(options),
        filter_(filter),
        y_(model.outputs) {
    set_parameters(model, memory_, p);
    gramians_.densities = noise.Q.reshaped(model.states * model.states, 1);
  }

  // The model of sample t; its inputs are offset()'s.
  void set(Index t, StateSpace& out) {
    const Index nx = model_.states, ny = model_.outputs;
    const Line seen = seen_at(t), moved = moved_from(t);
    out.A = moved.slopes;
    out.B.setIdentity(nx, nx + ny);
    out.C = seen.slopes;
    out.D.setZero(ny, nx + ny);
    out.D.rightCols(ny).setIdentity();
    out.G.setIdentity(nx, nx);
    out.Q = moved.rest;
    out.R = seen.rest;
    out.S.setZero(nx, ny);
    out.x0 = noise_.x0;
    out.P0 = noise_.P0;
  }

  VectorXd offset(Index t) {
    VectorXd out(model_.states + model_.outputs);
    out << moved_from(t).offset, seen_at(t).offset;
    return out;
  }

 private:
  bool unscented() const { return options_.method == NonlinearMethod::unscented; }

  // h, with R.
  Line seen_at(Index t) {
    const auto u = inputs_.at_sample.col(t);
    const double time = inputs_.time[t];
    Line out;
    if (unscented()) {
      out = line_of_points(filter_.x_pred.col(t), filter_.P_pred[static_cast<std::size_t>(t)],
                           options_.weights, model_.outputs, [&](const VectorXd& x) {
                             observe(model_, memory_, x, u, time, y_);
                             return y_;
                           });
      out.rest += noise_.R;
      return out;
    }
    const bool iterated = options_.method == NonlinearMethod::iterated;
    x_ = (iterated ? filter_.x_filt : filter_.x_pred).col(t);
    observe(model_, memory_, x_, u, time, y_, slopes_);
    return {slopes_.by_x, y_ - slopes_.by_x * x_, noise_.R};
  }

  // The way to the next sample, with W; nothing follows the last.
  Line moved_from(Index t) {
    const Index nx = model_.states;
    if (t + 1 == filter_.x_pred.cols()) {
      return {MatrixXd::Identity(nx, nx), VectorXd::Zero(nx), MatrixXd::Zero(nx, nx)};
    }
    const bool density = model_.continuous && options_.noise == ProcessNoise::density;
    x_ = filter_.x_filt.col(t);
    step(model_, memory_, inputs_, t, x_, slopes_, Derivatives::first,
         density ? &gramians_ : nullptr);
    const MatrixXd W = density ? MatrixXd(gramians_.values.reshaped(nx, nx)) : noise_.Q;
    if (!unscented()) return {slopes_.by_x, x_ - slopes_.by_x * filter_.x_filt.col(t), W};
    Line out = line_of_points(filter_.x_filt.col(t), filter_.P_filt[static_cast<std::size_t>(t)],
                              options_.weights, nx, [&](VectorXd x) {
                                step(model_, memory_, inputs_, t, x);
                                return x;
                              });
    out.rest += W;
    return out;
  }

  const NonlinearModel& model_;
  ModelMemory memory_;
  const FilterNoise& noise_;
  const InputNodes& inputs_;
  const NonlinearFilterOptions& options_;
  const FilterResult& filter_;
  Slopes slopes_;
  Gramians gramians_;
  VectorXd x_, y_;
};

}  // namespace

SmootherResult nonlinear_smoother(const NonlinearModel& model, const Eigen::Ref<const VectorXd>& p,
                                  const FilterNoise& noise, const InputNodes& inputs,
                                  const Eigen::Ref<const MatrixXd>& y,
                                  const NonlinearFilterOptions& options, std::optional<Index> lag,
                                  SmootherKeep keep) {
  const FilterResult filter = nonlinear_filter(model, p, noise, inputs, y, options);
  if (filter.status != FilterStatus::ok) {
    SmootherResult out;
    out.status = filter.status;
    return out;
  }
  Followed lines(model, p, noise, inputs, options, filter);
  MatrixXd u(model.states + model.outputs, y.cols());
  for (Index t = 0; t < y.cols(); ++t) u.col(t) = lines.offset(t);
  const ModelAt at = [&](Index t, StateSpace& out, std::vector<StateSpace>*) { lines.set(t, out); };
  return lag ? smooth_with_lag(at, InitialState::given, y, u, *lag, keep)
             : smooth(at, InitialState::given, y, u, keep);
}

}  // namespace identikal
