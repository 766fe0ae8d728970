#include "lib/nonlinear/smoother.h"

#include <cmath>
#include <vector>

#include "lib/base/nearest_turn.h"
#include "lib/nonlinear/internal/sigma_points.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// f(x) = jacobian x + offset + what has the covariance `rest`.
struct StraightLine {
  MatrixXd jacobian;
  VectorXd offset;
  MatrixXd rest;
};

// The line that has the moments of x and f(x) as sigma points give them, x of covariance P about
// `middle`.
template <typename Function>
StraightLine line_of_points(const VectorXd& middle, const MatrixXd& P,
                            const UnscentedWeights& weights, Index rows, Function&& f) {
  const Index n = middle.size();
  const PointWeights w = point_weights(weights, n);
  Stack none(n * n, 0), no_jacobian(n, 0);
  MatrixXd L = MatrixXd::Zero(n, n);
  set_covariance_factor(P, none, L, none);
  SigmaPoints points = make_sigma_points(rows, n, 0);
  VectorXd x(n);
  for (Index q = 0; q <= 2 * n; ++q) {
    set_point(q, w, middle, no_jacobian, L, none, x, no_jacobian);
    points.values.col(q) = f(x);
  }
  set_moments(points, w);
  // cov(f(x), x) = A L', so that jacobian L = A.
  MatrixXd jacobian = MatrixXd::Zero(rows, n);
  for (Index j = n - 1; j >= 0; --j) {
    if (L(j, j) == 0.0) continue;
    jacobian.col(j) =
        (points.A.col(j) - jacobian.rightCols(n - 1 - j) * L.col(j).tail(n - 1 - j)) / L(j, j);
  }
  return {jacobian, points.mean - jacobian * middle, points.rest};
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
    if (options.scales != nullptr) {
      scale_memory_ = make_memory(*options.scales);
      set_parameters(*options.scales, scale_memory_, p);
    }
    gramians_.densities = noise.Q.reshaped(model.states * model.states, 1);
  }

  struct Lines {
    StraightLine seen, moved;  // y(t) and x(t+1) of x(t)
  };
  Lines at(Index t) { return {seen_at(t), moved_from(t)}; }

  // The model of a sample; its inputs are both offsets.
  void set(const Lines& lines, StateSpace& out) const {
    const Index nx = model_.states, ny = model_.outputs;
    const auto& [seen, moved] = lines;
    out.A = moved.jacobian;
    out.B.setIdentity(nx, nx + ny);
    out.C = seen.jacobian;
    out.D.setZero(ny, nx + ny);
    out.D.rightCols(ny).setIdentity();
    out.G.setIdentity(nx, nx);
    out.Q = moved.rest;
    out.R = seen.rest;
    out.S.setZero(nx, ny);
    out.x0 = noise_.x0;
    out.P0 = noise_.P0;
  }

 private:
  bool unscented() const { return options_.method == NonlinearMethod::unscented; }

  MatrixXd noise_at(Index t) {
    VectorXd scale = VectorXd::Ones(model_.outputs);
    if (options_.noise_scale.size() > 0) scale = options_.noise_scale.col(t);
    if (options_.scales != nullptr) {
      observe(*options_.scales, scale_memory_, filter_.x_pred.col(t), inputs_.at_sample.col(t),
              inputs_.time[t], by_formulas_);
      scale = scale.cwiseProduct(by_formulas_);
    }
    return scale.asDiagonal() * noise_.R * scale.asDiagonal();
  }

  // h, with R.
  StraightLine seen_at(Index t) {
    const auto u = inputs_.at_sample.col(t);
    const double time = inputs_.time[t];
    StraightLine out;
    if (unscented()) {
      VectorXd middle;  // the first point's
      out = line_of_points(filter_.x_pred.col(t), filter_.P_pred[t], options_.weights,
                           model_.outputs, [&](const VectorXd& x) {
                             observe(model_, memory_, x, u, time, y_);
                             if (middle.size() == 0) middle = y_;
                             for (std::size_t i = 0; i < options_.wraps.size(); ++i) {
                               const auto row = static_cast<Index>(i);
                               if (!options_.wraps[i]) continue;
                               y_[row] = middle[row] + nearest_turn(y_[row] - middle[row]);
                             }
                             return y_;
                           });
      out.rest += noise_at(t);
      return out;
    }
    const bool iterated = options_.method == NonlinearMethod::iterated;
    x_ = (iterated ? filter_.x_filt : filter_.x_pred).col(t);
    observe(model_, memory_, x_, u, time, y_, jacobian_);
    return {jacobian_.wrt_x, y_ - jacobian_.wrt_x * x_, noise_at(t)};
  }

  // The way to the next sample, with W; nothing follows the last.
  StraightLine moved_from(Index t) {
    const Index nx = model_.states;
    if (t + 1 == filter_.x_pred.cols()) {
      return {MatrixXd::Identity(nx, nx), VectorXd::Zero(nx), MatrixXd::Zero(nx, nx)};
    }
    // Controlled steps integrate no noise, and need none to where there is none.
    const bool density =
        model_.continuous && options_.noise == ProcessNoise::density && !noise_.Q.isZero(0.0);
    x_ = filter_.x_filt.col(t);
    step(model_, memory_, inputs_, t, x_, jacobian_, Derivatives::first,
         density ? &gramians_ : nullptr);
    const MatrixXd W = density ? MatrixXd(gramians_.values.reshaped(nx, nx)) : noise_.Q;
    if (!unscented()) return {jacobian_.wrt_x, x_ - jacobian_.wrt_x * filter_.x_filt.col(t), W};
    StraightLine out = line_of_points(filter_.x_filt.col(t), filter_.P_filt[t], options_.weights,
                                      nx, [&](VectorXd x) {
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
  Jacobian jacobian_;
  Gramians gramians_;
  ModelMemory scale_memory_;
  VectorXd x_, y_, by_formulas_ = VectorXd(model_.outputs);
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
  Followed followed(model, p, noise, inputs, options, filter);
  std::vector<Followed::Lines> lines;
  lines.reserve(static_cast<std::size_t>(y.cols()));
  MatrixXd u(model.states + model.outputs, y.cols());
  MatrixXd measured = y;
  for (Index t = 0; t < y.cols(); ++t) {
    lines.push_back(followed.at(t));
    const StraightLine& seen = lines.back().seen;
    u.col(t) << lines.back().moved.offset, seen.offset;
    // Of an angle, the turn that the filter took.
    for (std::size_t i = 0; i < options.wraps.size(); ++i) {
      const auto row = static_cast<Index>(i);
      if (!options.wraps[i] || std::isnan(y(row, t))) continue;
      measured(row, t) =
          seen.jacobian.row(row).dot(filter.x_pred.col(t)) + seen.offset[row] + filter.e(row, t);
    }
  }
  const ModelAt at = [&](Index t, StateSpace& out, std::vector<StateSpace>*) {
    followed.set(lines[t], out);
  };
  return lag ? smooth_with_lag(at, InitialState::given, measured, u, *lag, keep)
             : smooth(at, InitialState::given, measured, u, keep);
}

}  // namespace identikal
