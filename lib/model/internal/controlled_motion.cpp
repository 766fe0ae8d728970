#include "lib/model/internal/controlled_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/LU>

#include "lib/model/internal/rates.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRadauStages = 3;
constexpr int kMostIterations = 12;      // of Newton's method in a step
constexpr int kMostTrials = 20000;       // steps, rejected ones included, in an interval
constexpr double kShortestStep = 1e-14;  // of the interval
// The same: what is off by no more than such a step is off by nothing. At a kink of the rates from a
// state that is exactly zero, no step is small against what it has moved.
constexpr double kCrossed = 1e-10;
constexpr double kFloor = 1e-3;   // of the largest a state has been: below, errors count like there
constexpr double kSolved = 1e-2;  // of the tolerated error, by Newton's method

const double kRoot6 = std::sqrt(6.0);
const double kReach[kRadauStages] = {(4.0 - kRoot6) / 10.0, (4.0 + kRoot6) / 10.0, 1.0};
const double kA[kRadauStages][kRadauStages] = {
    {(88.0 - 7.0 * kRoot6) / 360.0, (296.0 - 169.0 * kRoot6) / 1800.0,
     (3.0 * kRoot6 - 2.0) / 225.0},
    {(296.0 + 169.0 * kRoot6) / 1800.0, (88.0 + 7.0 * kRoot6) / 360.0,
     (-2.0 - 3.0 * kRoot6) / 225.0},
    {(16.0 - kRoot6) / 36.0, (16.0 + kRoot6) / 36.0, 1.0 / 9.0}};
// Of the embedded formula of order 3: its weights of the stages, and the real eigenvalue of A^-1.
const double kError[kRadauStages] = {-(13.0 + 7.0 * kRoot6) / 3.0, (7.0 * kRoot6 - 13.0) / 3.0,
                                     -1.0 / 3.0};
constexpr double kEigenvalue = 3.6378342527444957;

class ControlledMotion {
 public:
  ControlledMotion(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
                   Index k)
      : model_(model),
        m_(memory),
        inputs_(inputs),
        k_(k),
        n_(model.states),
        length_(inputs.time[k + 1] - inputs.time[k]),
        // The estimate is of a lower order than the solution, and far above its error.
        tolerance_(0.1 * std::pow(inputs.tolerance, 2.0 / 3.0)),
        u_(model.inputs) {}

  void move(Eigen::Ref<VectorXd> x, Jacobian* jacobian) {
    StepControl& control = m_.control;
    if (k_ == 0 || control.sample != k_) control = {k_, length_, x.cwiseAbs()};
    control.largest = control.largest.cwiseMax(x.cwiseAbs());
    if (jacobian != nullptr) {
      slopes_ = MatrixXd::Identity(n_, n_ + model_.columns);
    }
    x_ = x;
    double at = 0.0, h = std::min(control.step, length_);
    bool rejected = true, finite = x_.allFinite() && set_start(0.0, jacobian != nullptr);
    for (int trial = 0; finite && at < length_; finite = finite && ++trial < kMostTrials) {
      const double rest = length_ - at;
      const bool last = h > rest * (1.0 - 1e-10);
      if (last) h = rest;
      const double error = try_step(at, h, rejected);
      const bool crossed = error > 1.0 && std::isfinite(error) && h <= kCrossed * length_;
      if (error <= 1.0 || crossed) {
        if (jacobian != nullptr) add_slopes(at, h);
        x_ += Z_.tail(n_);
        control.largest = control.largest.cwiseMax(x_.cwiseAbs());
        const double next =
            h * (crossed ? 8.0 : std::clamp(0.9 * std::pow(error, -0.25), 0.2, 8.0));
        // What the interval's end cut short says nothing of the next one's first step.
        control.step = last ? std::max(control.step, next) : next;
        at = last ? length_ : at + h;
        h = next;
        rejected = false;
        finite = at >= length_ || set_start(at, jacobian != nullptr);
      } else {
        h *= std::isfinite(error) ? std::clamp(0.9 * std::pow(error, -0.25), 0.1, 0.8) : 0.25;
        control.step = h;
        rejected = true;
        finite = h > kShortestStep * length_;
      }
    }
    if (!finite) x_.setConstant(std::numeric_limits<double>::quiet_NaN());
    x = x_;
    control.sample = k_ + 1;
    if (jacobian == nullptr) return;
    jacobian->wrt_x = slopes_.leftCols(n_);
    jacobian->wrt_p = slopes_.rightCols(model_.columns);
  }

 private:
  const double* inputs_at(double at) {
    const Index first = inputs_.first[static_cast<std::size_t>(k_)];
    const double share = at / length_;
    for (Index i = 0; i < u_.size(); ++i) {
      u_[i] =
          inputs_.curves.empty()
              ? inputs_.u(i, first) + share * (inputs_.u(i, first + 2) - inputs_.u(i, first))
              : inputs_.curves[static_cast<std::size_t>(i)].in_interval(k_, inputs_.time[k_] + at);
    }
    return u_.data();
  }

  // f, and its derivatives, at x where a step begins.
  bool set_start(double at, bool slopes) {
    evaluate_rate_slopes(model_, m_, x_.data(), inputs_at(at), inputs_.time[k_] + at);
    rate_ = m_.rate.head(n_);
    J_ = m_.J.leftCols(n_);
    if (!slopes) {  // they only help to solve, where they are
      J_ = J_.unaryExpr([](double slope) { return std::isfinite(slope) ? slope : 0.0; });
    }
    return rate_.allFinite() && J_.allFinite();
  }

  VectorXd tolerated(const VectorXd& x) const {
    const VectorXd size =
        x_.cwiseAbs().cwiseMax(x.cwiseAbs()).cwiseMax(kFloor * m_.control.largest);
    return (tolerance_ * size).cwiseMax(std::numeric_limits<double>::min());
  }

  static double norm(const VectorXd& error, const VectorXd& tolerated) {
    return error.cwiseQuotient(tolerated).cwiseAbs().maxCoeff();
  }

  // The stages of a step from `at`. @return its error over what is tolerated; infinite: no solution
  double try_step(double at, double h, bool rejected) {
    if (!solve_stages(at, h)) return std::numeric_limits<double>::infinity();
    const VectorXd allowed = tolerated(x_ + Z_.tail(n_));
    VectorXd by_stages = VectorXd::Zero(n_);
    for (Index i = 0; i < kRadauStages; ++i) by_stages += kError[i] / h * Z_.segment(i * n_, n_);
    MatrixXd implicit = -J_;
    implicit.diagonal().array() += kEigenvalue / h;
    const Eigen::PartialPivLU<MatrixXd> solver(implicit);
    VectorXd error = solver.solve(VectorXd(rate_ + by_stages));
    double out = norm(error, allowed);
    if (out > 1.0 && rejected) {
      // Once more through the implicit equations: a fast part that dies out is no error.
      const VectorXd beside = x_ + error;
      evaluate_rates(model_, m_, beside.data(), inputs_at(at), inputs_.time[k_] + at);
      error = solver.solve(VectorXd(m_.rate.head(n_) + by_stages));
      out = norm(error, allowed);
    }
    if (std::isnan(out)) return std::numeric_limits<double>::infinity();
    return std::max(out, 1e-10);
  }

  // Newton's method with the derivatives at the step's begin.
  bool solve_stages(double at, double h) {
    MatrixXd implicit(kRadauStages * n_, kRadauStages * n_);
    for (Index i = 0; i < kRadauStages; ++i) {
      for (Index j = 0; j < kRadauStages; ++j)
        implicit.block(i * n_, j * n_, n_, n_) = -h * kA[i][j] * J_;
    }
    implicit.diagonal().array() += 1.0;
    const Eigen::PartialPivLU<MatrixXd> solver(implicit);
    Z_.setZero(kRadauStages * n_);
    double before = std::numeric_limits<double>::infinity();
    for (int iteration = 0; iteration < kMostIterations; ++iteration) {
      VectorXd residual = -Z_;
      for (Index j = 0; j < kRadauStages; ++j) {
        const VectorXd there = x_ + Z_.segment(j * n_, n_);
        const double time = at + kReach[j] * h;
        evaluate_rates(model_, m_, there.data(), inputs_at(time), inputs_.time[k_] + time);
        for (Index i = 0; i < kRadauStages; ++i) {
          residual.segment(i * n_, n_) += h * kA[i][j] * m_.rate.head(n_);
        }
      }
      const VectorXd change = solver.solve(residual);
      if (!change.allFinite()) return false;
      Z_ += change;
      const VectorXd allowed = tolerated(x_ + Z_.tail(n_));
      double size = 0.0;
      for (Index i = 0; i < kRadauStages; ++i) {
        size = std::max(size, norm(change.segment(i * n_, n_), allowed));
      }
      const double rate = size / before;
      if (size <= kSolved * std::min(1.0, std::max(1e-3, 1.0 - rate))) return true;
      if (rate > 0.9 && iteration > 1) return false;
      before = size;
    }
    return false;
  }

  // From the begin of the interval to the end of the step that ends in Z_.
  void add_slopes(double at, double h) {
    const Index columns = n_ + model_.columns;
    MatrixXd implicit(kRadauStages * n_, kRadauStages * n_),
        rhs = MatrixXd::Zero(kRadauStages * n_, columns);
    for (Index j = 0; j < kRadauStages; ++j) {
      const VectorXd there = x_ + Z_.segment(j * n_, n_);
      const double time = at + kReach[j] * h;
      evaluate_rate_slopes(model_, m_, there.data(), inputs_at(time), inputs_.time[k_] + time);
      MatrixXd by = m_.J.leftCols(n_) * slopes_;
      by.rightCols(model_.columns) += m_.J.rightCols(model_.columns);
      for (Index i = 0; i < kRadauStages; ++i) {
        implicit.block(i * n_, j * n_, n_, n_) = -h * kA[i][j] * m_.J.leftCols(n_);
        rhs.middleRows(i * n_, n_) += h * kA[i][j] * by;
      }
    }
    implicit.diagonal().array() += 1.0;
    slopes_ += Eigen::PartialPivLU<MatrixXd>(implicit).solve(rhs).bottomRows(n_);
  }

  const NonlinearModel& model_;
  ModelMemory& m_;
  const InputNodes& inputs_;
  Index k_, n_;
  double length_, tolerance_;
  VectorXd u_, x_, rate_, Z_;
  MatrixXd J_, slopes_;
};

}  // namespace

void move_controlled(const NonlinearModel& model, ModelMemory& memory, const InputNodes& inputs,
                     Index k, Eigen::Ref<VectorXd> x, Jacobian* jacobian) {
  ControlledMotion(model, memory, inputs, k).move(x, jacobian);
}

}  // namespace identikal
