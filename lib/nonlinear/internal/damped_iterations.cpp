#include "lib/nonlinear/internal/damped_iterations.h"

#include <algorithm>

#include "lib/internal/direction_stack.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr double kNoCost = 1e-10;  // of a sum of squares of standard deviations: rounding

}  // namespace

DampedIterations::DampedIterations(const simd::ExtendedModel& model, std::size_t numbers)
    : model_(model),
      xi_(numbers, 0.0),
      base_(numbers, 0.0),
      way_(VectorXd::Zero(model.n)),
      base_way_(way_),
      residual_(VectorXd::Zero(model.ny)),
      whitened_(residual_),
      present_R_(model.ny, model.ny),
      R_factor_(model.ny, model.ny) {}

void DampedIterations::begin(const double* R, bool R_moves, simd::ExtendedRun& run) {
  std::copy_n(run.x, xi_.size(), xi_.begin());
  run.xi = xi_.data();
  way_.setZero();
  share_ = 1.0;
  promised_ = -1.0;
  if (!R_moves) return;
  present_R_.setIdentity();
  for (int a = 0; a < run.m; ++a) {
    for (int c = 0; c < run.m; ++c) {
      present_R_(a, c) = R[(run.channel[a] * model_.ny + run.channel[c]) * model_.lanes];
    }
  }
  is_damped_ = set_factor(present_R_, R_factor_);
}

// R^-1/2 times the first m residuals, squared.
double DampedIterations::squares(int m) {
  double out = 0.0;
  for (Index a = 0; a < m; ++a) {
    double sum = residual_[a];
    for (Index c = 0; c < a; ++c) sum -= R_factor_(a, c) * whitened_[c];
    whitened_[a] = sum / R_factor_(a, a);
    out += whitened_[a] * whitened_[a];
  }
  return out;
}

bool DampedIterations::steps_back(const VectorXd& e, bool last, simd::ExtendedRun& run) {
  if (!is_damped_) return false;
  for (int a = 0; a < run.m; ++a) residual_[a] = e[run.channel[a]];
  double cost = squares(run.m);
  for (int i = 0; i < model_.n; ++i) {
    cost += way_[i] * (run.xi[i * model_.lanes] - run.x[i * model_.lanes]);
  }
  cost *= 0.5;
  if (promised_ < 0.0 || cost <= cost_ - 0.25 * share_ * promised_ + kNoCost * (1.0 + cost_)) {
    cost_ = cost;
    return false;
  }
  const double part = last ? 0.0 : 0.5;
  share_ *= 0.5;
  for (std::size_t i = 0; i < xi_.size(); ++i) xi_[i] = base_[i] + part * (xi_[i] - base_[i]);
  way_ = base_way_ + part * (way_ - base_way_);
  return true;
}

void DampedIterations::advance(simd::ExtendedRun& run) {
  base_.swap(xi_);
  base_way_.swap(way_);
  way_.setZero();
  residual_.setZero();
  const simd::LaneSlopes& h = model_.h;
  const auto step = [&](int i) {
    const auto at = static_cast<std::size_t>(i * model_.lanes);
    return run.next_x[at] - base_[at];
  };
  for (int a = 0; a < run.m; ++a) {
    for (int e = h.row[run.channel[a]]; e < h.row[run.channel[a] + 1]; ++e) {
      way_[h.column[e]] += run.Sie[a] * run.h.slope[e];
      residual_[a] += run.h.slope[e] * step(h.column[e]);
    }
  }
  if (is_damped_) {
    promised_ = squares(run.m);
    for (int i = 0; i < model_.n; ++i) promised_ += step(i) * (way_[i] - base_way_[i]);
  }
  way_ = base_way_ + share_ * (way_ - base_way_);
  for (std::size_t i = 0; i < xi_.size(); ++i) {
    xi_[i] = base_[i] + share_ * (run.next_x[i] - base_[i]);
  }
  run.xi = xi_.data();
}

}  // namespace identikal
