#include "lib/model/discretise.h"

#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

void check(const StateSpace& m, ProcessNoise noise, double step) {
  check_shapes(m);
  if (!(step > 0.0)) throw std::invalid_argument("discretise: the step is not positive");
  if (noise == ProcessNoise::density && !m.S.isZero(0.0)) {
    throw std::invalid_argument("discretise: S does not apply to a noise density");
  }
}

// At most so many terms of a series in a matrix whose norm is one half, and of its derivative.
constexpr int kMostTerms = 24;

// What a step of length h does: Phi = e^(A h), S = int_0^h e^(A s) ds, R = int_0^h e^(A (h - s)) s ds,
// Q = int_0^h e^(A s) W e^(A' s) ds. Each is a series in A over a step so short that no term is large,
// and that step is doubled, which keeps the digits of fast poles:
//
//   Phi = sum P_k, P_k = h/k A P_(k-1);  Q = sum T_k, T_k = h/(k+1) (A T_(k-1) + T_(k-1) A')
//   Q(2h) = Q + Phi Q Phi',  S(2h) = S + Phi S,  R(2h) = R + Phi R + h S
//
// Derivatives follow term by term. Matrices of up to `Most` rows lie in place.
template <int Rows, int Most = Rows>
class Stepping {
 public:
  using Square = Eigen::Matrix<double, Rows, Rows, 0, Most, Most>;
  struct Values {
    Square Phi, S, R, Q;
  };

  Stepping(const MatrixXd& A, const MatrixXd& W, double step, InputHold hold)
      : A_(A), ramp_(hold == InputHold::linear), noise_(W.size() > 0) {
    const double norm = A.size() == 0 ? 0.0 : 2.0 * A.cwiseAbs().rowwise().sum().maxCoeff();
    const double size = step * norm;
    const int halvings =
        size > 1.0 && std::isfinite(size) ? static_cast<int>(std::ceil(std::log2(size))) : 0;
    h_ = std::ldexp(step, -halvings);
    for (double term = 1.0; term > 1e-18 && terms_ < kMostTerms - 2;) term *= h_ * norm / ++terms_;
    terms_ += 2;  // derivatives converge later
    take_series(W);
    for (int i = 0; i < halvings; ++i) double_step();
  }

  const Values& values() const { return levels_.back(); }

  // In the direction dA, dW.
  Values derivative(const MatrixXd& dA, const MatrixXd& dW) const {
    const bool rests = dA.isZero(0.0);
    Values d = rests ? zero() : motion_derivative(dA);
    if (rests && (!noise_ || dW.isZero(0.0))) return d;
    if (noise_) noise_derivative(dA, dW, d);
    double h = h_;
    for (std::size_t i = 0; i + 1 < levels_.size(); ++i, h *= 2.0) {
      const Values& v = levels_[i];
      const Square F = d.Phi;
      if (noise_) {
        const Square moved = F * Square(v.Q * v.Phi.transpose());
        d.Q = (d.Q + v.Phi * Square(d.Q * v.Phi.transpose()) + moved + moved.transpose()).eval();
      }
      if (ramp_) d.R = (d.R + F * v.R + v.Phi * d.R + h * d.S).eval();
      d.S = (d.S + F * v.S + v.Phi * d.S).eval();
      d.Phi = (F * v.Phi + v.Phi * F).eval();
    }
    return d;
  }

 private:
  Values zero() const {
    const Square none = Square::Zero(A_.rows(), A_.cols());
    return {none, none, none, none};
  }

  void take_series(const MatrixXd& W) {
    const Index n = A_.rows();
    Values v = zero();
    P_[0] = v.Phi = Square::Identity(n, n);
    v.S = h_ * v.Phi;
    v.R = 0.5 * h_ * h_ * v.Phi;
    for (int k = 1; k <= terms_; ++k) {
      P_[k].noalias() = (h_ / k) * (A_ * P_[k - 1]);
      v.Phi += P_[k];
      v.S += (h_ / (k + 1)) * P_[k];
      v.R += (h_ * h_ / ((k + 1) * (k + 2))) * P_[k];
    }
    if (noise_) {
      v.Q = T_[0] = h_ * W;
      for (int k = 1; k <= terms_; ++k) {
        const Square moved = A_ * T_[k - 1];
        T_[k] = (h_ / (k + 1)) * (moved + moved.transpose());
        v.Q += T_[k];
      }
    }
    levels_.push_back(std::move(v));
  }

  void double_step() {
    const Values& v = levels_.back();
    const double h = std::ldexp(h_, static_cast<int>(levels_.size()) - 1);
    Values to;
    to.Q = noise_ ? Square(v.Q + v.Phi * Square(v.Q * v.Phi.transpose())) : v.Q;
    to.R = v.R + v.Phi * v.R + h * v.S;
    to.S = v.S + v.Phi * v.S;
    to.Phi = v.Phi * v.Phi;
    levels_.push_back(std::move(to));
  }

  Values motion_derivative(const Square& dA) const {
    Values d = zero();
    Square dP = d.Phi;
    for (int k = 1; k <= terms_; ++k) {
      dP = ((h_ / k) * (dA * P_[k - 1] + A_ * dP)).eval();
      d.Phi += dP;
      d.S += (h_ / (k + 1)) * dP;
      if (ramp_) d.R += (h_ * h_ / ((k + 1) * (k + 2))) * dP;
    }
    return d;
  }

  void noise_derivative(const Square& dA, const Square& dW, Values& d) const {
    Square dT = h_ * dW;
    d.Q = dT;
    for (int k = 1; k <= terms_; ++k) {
      const Square moved = dA * T_[k - 1] + A_ * dT;
      dT = (h_ / (k + 1)) * (moved + moved.transpose());
      d.Q += dT;
    }
  }

  Square A_;
  bool ramp_, noise_;
  double h_ = 0.0;
  int terms_ = 0;
  std::array<Square, kMostTerms + 1> P_, T_;
  std::vector<Values> levels_;
};

// B of the sampled model from that of continuous time, by what a step does to inputs.
template <typename Square>
MatrixXd input_matrix(const Square& S, const Square& R, const MatrixXd& B, double step,
                      InputHold hold) {
  const MatrixXd Gamma = S * B;
  if (hold == InputHold::constant) return Gamma;
  const MatrixXd Gamma1 = R * B / step;
  MatrixXd out(B.rows(), 2 * B.cols());
  out << Gamma - Gamma1, Gamma1;
  return out;
}

MatrixXd feed_through(const MatrixXd& D, InputHold hold) {
  if (hold == InputHold::constant) return D;
  MatrixXd out = MatrixXd::Zero(D.rows(), 2 * D.cols());
  out.leftCols(D.cols()) = D;
  return out;
}

struct Sampling {
  ProcessNoise noise;
  double step;
  InputHold hold;

  template <int Rows, int Most = Rows>
  void take(const StateSpace& m, const std::vector<StateSpace>& by, StateSpace& out,
            std::vector<StateSpace>& derivatives) const {
    const bool density = noise == ProcessNoise::density;
    const MatrixXd W = density ? MatrixXd(m.G * m.Q * m.G.transpose()) : MatrixXd();
    const Stepping<Rows, Most> stepping(m.A, W, step, hold);
    const auto& v = stepping.values();
    out = m;
    out.dt = step;
    out.A = v.Phi;
    out.B = input_matrix(v.S, v.R, m.B, step, hold);
    out.D = feed_through(m.D, hold);
    if (density) {
      out.Q = 0.5 * (v.Q + v.Q.transpose());
      out.G = MatrixXd::Identity(m.states(), m.states());
      out.S = MatrixXd::Zero(m.states(), m.outputs());
    }
    derivatives.resize(by.size());
    for (std::size_t i = 0; i < by.size(); ++i) direction(m, stepping, by[i], derivatives[i]);
  }

  template <int Rows, int Most>
  void direction(const StateSpace& m, const Stepping<Rows, Most>& stepping, const StateSpace& by,
                 StateSpace& out) const {
    const bool density = noise == ProcessNoise::density;
    MatrixXd dW;
    if (density) {
      const MatrixXd cross = by.G * m.Q * m.G.transpose();
      dW = cross + cross.transpose() + m.G * by.Q * m.G.transpose();
    }
    const auto& v = stepping.values();
    const auto d = stepping.derivative(by.A, dW);
    out = by;
    out.dt = step;
    out.A = d.Phi;
    out.B = input_matrix(d.S, d.R, m.B, step, hold) + input_matrix(v.S, v.R, by.B, step, hold);
    out.D = feed_through(by.D, hold);
    if (!density) return;
    out.Q = 0.5 * (d.Q + d.Q.transpose());
    out.G = MatrixXd::Zero(m.states(), m.states());
    out.S = MatrixXd::Zero(m.states(), m.outputs());
  }
};

}  // namespace

void discretise(const StateSpace& continuous, const std::vector<StateSpace>& by, ProcessNoise noise,
                double step, InputHold hold, StateSpace& out,
                std::vector<StateSpace>& derivatives) {
  check(continuous, noise, step);
  const Sampling sampling{noise, step, hold};
  switch (continuous.states()) {
    case 1:
      return sampling.take<1>(continuous, by, out, derivatives);
    case 2:
      return sampling.take<2>(continuous, by, out, derivatives);
    case 3:
      return sampling.take<3>(continuous, by, out, derivatives);
    case 4:
      return sampling.take<4>(continuous, by, out, derivatives);
    default:
      break;
  }
  constexpr int kAny = Eigen::Dynamic;
  if (continuous.states() <= 8) return sampling.take<kAny, 8>(continuous, by, out, derivatives);
  sampling.take<kAny>(continuous, by, out, derivatives);
}

StateSpace discretise(const StateSpace& continuous, ProcessNoise noise, double step,
                      InputHold hold) {
  StateSpace out;
  std::vector<StateSpace> none;
  discretise(continuous, {}, noise, step, hold, out, none);
  return out;
}

StateSpace discretise_derivative(const StateSpace& continuous, const StateSpace& by,
                                 ProcessNoise noise, double step, InputHold hold) {
  StateSpace ignored;
  std::vector<StateSpace> out;
  discretise(continuous, {by}, noise, step, hold, ignored, out);
  return std::move(out.front());
}

MatrixXd with_next_sample(const MatrixXd& u) {
  const Index nu = u.rows(), N = u.cols();
  MatrixXd out(2 * nu, N);
  out.topRows(nu) = u;
  if (N == 0) return out;
  out.bottomRows(nu).leftCols(N - 1) = u.rightCols(N - 1);
  out.bottomRows(nu).col(N - 1) = u.col(N - 1);
  return out;
}

}  // namespace identikal
