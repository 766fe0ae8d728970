#include "lib/filter/information.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "lib/base/constants.h"
#include "lib/filter/steady_state.h"
#include "lib/internal/powers.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTiny = 1e-300;

// What the innovations' second moments depend on, at one sample, and by one parameter.
struct Direction {
  MatrixXd P, Sigma, K;  // derivatives
};

class Expectation {
 public:
  Expectation(const StateSpace& model, const std::vector<StateSpace>& derivatives)
      : m_(model),
        d_(derivatives),
        n_(model.states()),
        k_(static_cast<Index>(derivatives.size())),
        W_(model.G * model.Q * model.G.transpose()),
        Sw_(model.G * model.S),
        by_(derivatives.size()),
        mean_(VectorXd::Zero(n_ * (k_ + 1))) {
    for (const StateSpace& d : d_) {
      const MatrixXd half = d.G * m_.Q * m_.G.transpose();
      W_theta_.push_back(half + half.transpose() + m_.G * d.Q * m_.G.transpose());
      Sw_theta_.push_back(d.G * m_.S + m_.G * d.S);
    }
  }

  FilterStatus start(InitialState initial) {
    if (initial == InitialState::given) {
      P_ = m_.P0;
      mean_.head(n_) = m_.x0;
      for (Index i = 0; i < k_; ++i) {
        by(i).P = derivative(i).P0;
        mean_.segment(n_ * (i + 1), n_) = derivative(i).x0;
      }
      return FilterStatus::ok;
    }
    // A stationary start is the steady state of a filter that sees nothing: F = A, K = 0.
    MatrixXd F = m_.A, K = MatrixXd::Zero(n_, m_.outputs());
    if (initial != InitialState::stationary) {
      const auto steady = steady_state(m_);
      if (!steady) return FilterStatus::unstable;
      P_ = steady->P;
      K = steady->K;
      F -= K * m_.C;
    } else {
      const auto P = solve_discrete_lyapunov(m_.A, W_);
      if (!P) return FilterStatus::unstable;
      P_ = *P;
    }
    Powers<Eigen::Dynamic> powers;
    if (!powers.compute(F)) return FilterStatus::unstable;
    for (Index i = 0; i < k_; ++i) {
      by(i).P = drive_of_dP(i, F, K);
      powers.sum_forward(by(i).P);
      if (!by(i).P.allFinite()) return FilterStatus::unstable;
    }
    return FilterStatus::ok;
  }

  // Innovation, gain and their derivatives from P. false: Sigma is not positive definite.
  bool innovate() {
    const MatrixXd PC = P_ * m_.C.transpose();
    llt_.compute(m_.C * PC + m_.R);
    if (llt_.info() != Eigen::Success) return false;
    K_ = llt_.solve((m_.A * PC + Sw_).transpose()).transpose();
    F_ = m_.A - K_ * m_.C;
    for (Index i = 0; i < k_; ++i) {
      const StateSpace& d = derivative(i);
      Direction& b = by(i);
      const MatrixXd half = d.C * PC;
      b.Sigma = half + half.transpose() + m_.C * b.P * m_.C.transpose() + d.R;
      const MatrixXd dM = Sw_theta_[i] + d.A * PC + m_.A * b.P * m_.C.transpose() +
                          m_.A * P_ * d.C.transpose() - K_ * b.Sigma;
      b.K = llt_.solve(dM.transpose()).transpose();
    }
    return true;
  }

  GainSensitivity gain() const {
    GainSensitivity out{P_, llt_.reconstructedMatrix(), K_, {}, {}};
    for (const Direction& b : by_) {
      out.K_theta.push_back(b.K);
      out.Sigma_theta.push_back(b.Sigma);
    }
    return out;
  }

  // From now on the covariance of [x, dx_1, ..., dx_k] is run too.
  void follow_states() { Pi_ = MatrixXd::Zero(n_ * (k_ + 1), n_ * (k_ + 1)); }

  // 1/2 tr(Sigma^-1 dSigma_i Sigma^-1 dSigma_j): what the innovations' size tells.
  MatrixXd information_of_size() const {
    MatrixXd relative(m_.outputs() * m_.outputs(), k_), transposed = relative;
    for (Index i = 0; i < k_; ++i) {
      const MatrixXd one = llt_.solve(by(i).Sigma);
      relative.col(i) = one.reshaped();
      transposed.col(i) = one.transpose().reshaped();
    }
    return 0.5 * relative.transpose() * transposed;
  }

  // The same + tr(Sigma^-1 cov(de_i, de_j)).
  MatrixXd information() const {
    MatrixXd out = information_of_size();
    std::vector<MatrixXd> seen;
    for (Index i = 0; i < k_; ++i) seen.push_back(llt_.matrixL().solve(response(i)));
    for (Index i = 0; i < k_; ++i) {
      const MatrixXd weighted = seen[i] * Pi_;
      for (Index j = 0; j < k_; ++j) {
        out(i, j) += weighted.cwiseProduct(seen[j]).sum();
      }
    }
    return out;
  }

  // tr(Y dK_i Sigma dK_j'): what the gain's change at this sample tells at all later ones, if the
  // states it moves weigh Y there. Noise only.
  MatrixXd information_of_gain(const MatrixXd& Y) const {
    MatrixXd moved(n_ * m_.outputs(), k_), weighed = moved;
    for (Index i = 0; i < k_; ++i) {
      const MatrixXd one = by(i).K * llt_.matrixL();
      moved.col(i) = one.reshaped();
      weighed.col(i) = (Y * one).reshaped();
    }
    return moved.transpose() * weighed;
  }

  const MatrixXd& K() const { return K_; }
  // The states as the whitened outputs show them.
  MatrixXd whitened_C() const { return llt_.matrixL().solve(m_.C); }

  // What the mean adds at a sample with input u, which then moves on.
  MatrixXd information_of_mean(const VectorXd& u) {
    const bool inputs = m_.inputs() > 0;
    MatrixXd seen(m_.outputs(), k_);
    VectorXd next(mean_.size());
    const VectorXd x = mean_.head(n_);
    next.head(n_) = m_.A * x;
    if (inputs) next.head(n_) += m_.B * u;
    for (Index i = 0; i < k_; ++i) {
      const StateSpace& d = derivative(i);
      seen.col(i) = response(i) * mean_;
      if (inputs) seen.col(i) -= d.D * u;
      next.segment(n_ * (i + 1), n_) =
          d.A * x + m_.A * mean_.segment(n_ * (i + 1), n_) + K_ * seen.col(i);
      if (inputs) next.segment(n_ * (i + 1), n_) += d.B * u;
    }
    mean_ = next;
    llt_.matrixL().solveInPlace(seen);
    return seen.transpose() * seen;
  }

  bool mean_is_zero() const { return mean_.isZero(0.0); }

  // To the next sample. true: nothing changed but for rounding.
  bool advance() {
    const Index size = n_ * (k_ + 1);
    MatrixXd Phi = MatrixXd::Zero(size, size), Gain(size, m_.outputs());
    Phi.topLeftCorner(n_, n_) = m_.A;
    Gain.topRows(n_) = K_;
    for (Index i = 0; i < k_; ++i) {
      const Index row = n_ * (i + 1);
      Phi.block(row, 0, n_, n_) = derivative(i).A - K_ * derivative(i).C;
      Phi.block(row, row, n_, n_) = F_;
      Gain.middleRows(row, n_) = by(i).K;
    }
    const MatrixXd drive = Gain * llt_.matrixL();
    const double change = move_to(Pi_, Phi * Pi_ * Phi.transpose() + drive * drive.transpose());
    return settled(std::max(change, advance_covariances()));
  }

  // The same without the states.
  bool advance_noise() { return settled(advance_covariances()); }

 private:
  // P and its derivatives. Returns the largest relative change.
  double advance_covariances() {
    double change = 0.0;
    for (Index i = 0; i < k_; ++i) {
      const MatrixXd dP = F_ * by(i).P * F_.transpose() + drive_of_dP(i, F_, K_);
      const double largest = std::max(dP.cwiseAbs().maxCoeff(), kTiny);
      change = std::max(change, (dP - by(i).P).cwiseAbs().maxCoeff() / largest);
      by(i).P = 0.5 * (dP + dP.transpose());
    }
    const MatrixXd KS = K_ * Sw_.transpose();
    const MatrixXd P = F_ * P_ * F_.transpose() + W_ + K_ * m_.R * K_.transpose();
    return std::max(change, move_to(P_, P - KS - KS.transpose()));
  }

  bool settled(double change) {
    // Rounding may keep it above the tolerance for ever.
    since_smallest_ = change < smallest_change_ ? 0 : since_smallest_ + 1;
    smallest_change_ = std::min(smallest_change_, change);
    return change <= 1e-13 || (smallest_change_ <= 1e-9 && since_smallest_ > 100);
  }

  const StateSpace& derivative(Index i) const { return d_[i]; }
  Direction& by(Index i) { return by_[i]; }
  const Direction& by(Index i) const { return by_[i]; }

  // de_i = response(i) [x, dx_1, ..., dx_k].
  MatrixXd response(Index i) const {
    MatrixXd out = MatrixXd::Zero(m_.outputs(), n_ * (k_ + 1));
    out.leftCols(n_) = -derivative(i).C;
    out.middleCols(n_ * (i + 1), n_) -= m_.C;
    return out;
  }

  // dP+ - F dP F': the gain minimises P+, so its own derivative is not in it.
  MatrixXd drive_of_dP(Index i, const MatrixXd& F, const MatrixXd& K) const {
    const StateSpace& d = derivative(i);
    const auto at = static_cast<std::size_t>(i);
    const MatrixXd half = (d.A - K * d.C) * P_ * F.transpose() - K * Sw_theta_[at].transpose();
    return half + half.transpose() + W_theta_[at] + K * d.R * K.transpose();
  }

  // Returns the change against the standard deviations, of each group of n the largest.
  double move_to(MatrixXd& M, const MatrixXd& next) const {
    VectorXd sd(next.rows());
    for (Index i = 0; i < next.rows(); i += n_) {
      const double largest = next.diagonal().segment(i, n_).cwiseAbs().maxCoeff();
      sd.segment(i, n_).setConstant(std::sqrt(std::max(largest, kTiny)));
    }
    const MatrixXd change =
        sd.cwiseInverse().asDiagonal() * (next - M) * sd.cwiseInverse().asDiagonal();
    M = 0.5 * (next + next.transpose());
    return change.cwiseAbs().maxCoeff();
  }

  const StateSpace& m_;
  const std::vector<StateSpace>& d_;
  Index n_, k_;
  MatrixXd W_, Sw_, P_, K_, F_;
  std::vector<MatrixXd> W_theta_, Sw_theta_;
  std::vector<Direction> by_;
  MatrixXd Pi_;    // covariance of [x, dx_1, ..., dx_k], as predicted
  VectorXd mean_;  // its mean
  Eigen::LLT<MatrixXd> llt_;
  double smallest_change_ = kInfinity;
  int since_smallest_ = 0;
};

// Only noise changes. What the gain's change at sample s tells at all later ones is a trace with
//   Y(s+1) = sum_(t > s) Phi(t, s+1)' C' Sigma_t^-1 C Phi(t, s+1),  Phi(t, s) = F_(t-1) ... F_s,
// which runs backwards; so P goes ahead until it is steady, Y comes back, and the derivatives
// follow.
ExpectedInformation information_about_noise(const StateSpace& model, InitialState initial,
                                            Index samples,
                                            const std::vector<StateSpace>& derivatives) {
  const auto k = static_cast<Index>(derivatives.size());
  ExpectedInformation out;
  out.total = MatrixXd::Zero(k, k);
  const std::vector<StateSpace> none;
  Expectation ahead(model, none), expectation(model, derivatives);
  out.status = expectation.start(initial);
  if (out.status != FilterStatus::ok) return out;
  ahead.start(initial);
  std::vector<MatrixXd> K, seen;
  bool settled = false;
  while (!settled && static_cast<Index>(K.size()) < samples) {
    if (!ahead.innovate()) {
      out.status = FilterStatus::indefinite;
      return out;
    }
    K.push_back(ahead.K());
    seen.push_back(ahead.whitened_C());
    settled = ahead.advance_noise();
  }
  // The last of them stands for all that follow: its Y and the sum of theirs.
  const Index steady_at = static_cast<Index>(K.size()) - 1, rest = samples - steady_at;
  const Index n = model.states();
  const MatrixXd steady_F = model.A - K.back() * model.C;
  const MatrixXd steady_weight = seen.back().transpose() * seen.back();
  MatrixXd term = steady_weight, Y = MatrixXd::Zero(n, n), sum = Y;
  for (Index m = 1; m <= rest; ++m) {  // m samples before the end
    if (m < rest) sum += Y + term;     // Y(s+1) of s = samples - 1 - m
    Y += term;
    const MatrixXd half = steady_F.transpose() * term;
    term.noalias() = half * steady_F;
    if (!(term.cwiseAbs().maxCoeff() > 1e-18 * Y.cwiseAbs().maxCoeff())) {
      sum += static_cast<double>(std::max<Index>(0, rest - 1 - m)) * Y;
      break;
    }
  }
  std::vector<MatrixXd> later(K.size());  // Y(s+1) of each sample before
  for (Index s = steady_at; s-- > 0;) {
    const auto at = static_cast<std::size_t>(s);
    later[at] = Y;
    const MatrixXd F = model.A - K[at] * model.C;
    Y = (seen[at].transpose() * seen[at] + F.transpose() * Y * F).eval();
  }
  for (Index s = 0; s < steady_at; ++s) {
    expectation.innovate();
    out.total += expectation.information_of_size() + expectation.information_of_gain(later[s]);
    expectation.advance_noise();
  }
  expectation.innovate();
  out.total += static_cast<double>(rest) * expectation.information_of_size() +
               expectation.information_of_gain(sum);
  if (settled) {
    const auto always = solve_discrete_lyapunov(steady_F.transpose(), steady_weight);
    if (always) {
      out.per_sample = expectation.information_of_size() + expectation.information_of_gain(*always);
    }
  }
  if (!out.total.allFinite()) out.status = FilterStatus::not_finite;
  return out;
}

}  // namespace

ExpectedInformation expected_information(const StateSpace& model, InitialState initial,
                                         Index samples, const std::vector<StateSpace>& derivatives,
                                         const Eigen::Ref<const MatrixXd>& u) {
  check_shapes(model);
  for (const StateSpace& d : derivatives) check_shapes(d);
  if (samples < 1) throw std::invalid_argument("expected information: no samples");
  const bool silent = u.size() == 0;
  if (!silent && (u.rows() != model.inputs() || u.cols() != samples)) {
    throw std::invalid_argument("expected information: u does not fit model and samples");
  }
  if (std::all_of(derivatives.begin(), derivatives.end(), changes_only_noise)) {
    return information_about_noise(model, initial, samples, derivatives);
  }
  const auto k = static_cast<Index>(derivatives.size());
  ExpectedInformation out;
  out.total = MatrixXd::Zero(k, k);
  Expectation expectation(model, derivatives);
  out.status = expectation.start(initial);
  if (out.status != FilterStatus::ok) return out;
  expectation.follow_states();
  const bool excited = (!silent && !u.isZero(0.0)) || !expectation.mean_is_zero();
  MatrixXd information;
  bool settled = false;
  for (Index t = 0; t < samples; ++t) {
    if (!settled) {
      if (!expectation.innovate()) {
        out.status = FilterStatus::indefinite;
        return out;
      }
      information = expectation.information();
      settled = expectation.advance();
      if (settled) out.per_sample = information;
    }
    if (settled && !excited) {
      out.total += static_cast<double>(samples - t) * information;
      break;
    }
    out.total += information;
    if (excited) {
      const VectorXd now = silent ? VectorXd::Zero(model.inputs()) : VectorXd(u.col(t));
      out.total += expectation.information_of_mean(now);
    }
  }
  if (!out.total.allFinite()) out.status = FilterStatus::not_finite;
  return out;
}

std::optional<GainSensitivity> steady_gain_sensitivity(const StateSpace& model,
                                                       const std::vector<StateSpace>& derivatives) {
  check_shapes(model);
  for (const StateSpace& d : derivatives) check_shapes(d);
  Expectation expectation(model, derivatives);
  if (expectation.start(InitialState::diffuse) != FilterStatus::ok) return std::nullopt;
  if (!expectation.innovate()) return std::nullopt;
  return expectation.gain();
}

std::optional<double> expected_filter_loss(const StateSpace& model, const GainSensitivity& gain,
                                           const Eigen::Ref<const MatrixXd>& covariance) {
  const auto k = static_cast<Index>(gain.K_theta.size());
  if (covariance.rows() != k || covariance.cols() != k) {
    throw std::invalid_argument("expected filter loss: the covariance does not fit the gain");
  }
  const Index n = model.states(), ny = model.outputs();
  MatrixXd slopes(n * ny, k);
  for (Index i = 0; i < k; ++i) slopes.col(i) = gain.K_theta[i].reshaped();
  // As a sum of squares: cov = V diag(d) V', and each column of slopes V is an error of the gain.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  slopes = (slopes * eigen.eigenvectors()).eval();
  MatrixXd drive = MatrixXd::Zero(n, n);
  for (Index i = 0; i < k; ++i) {
    const MatrixXd dK = slopes.col(i).reshaped(n, ny);
    drive.noalias() += std::max(0.0, eigen.eigenvalues()[i]) * dK * gain.Sigma * dK.transpose();
  }
  const auto X = solve_discrete_lyapunov(model.A - gain.K * model.C, drive);
  const double loss = X ? X->trace() / gain.P.trace() : kNaN;
  return std::isfinite(loss) ? std::optional(loss) : std::nullopt;
}

std::optional<MatrixXd> complete_data_information(const StateSpace& model,
                                                  const std::vector<StateSpace>& derivatives) {
  const Eigen::LLT<MatrixXd> llt(joint_covariance(model));
  if (llt.info() != Eigen::Success) return std::nullopt;
  std::vector<MatrixXd> relative;
  for (const StateSpace& d : derivatives) relative.push_back(llt.solve(joint_covariance(d)));
  const auto k = static_cast<Index>(derivatives.size());
  MatrixXd out(k, k);
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j < k; ++j) {
      out(i, j) = 0.5 * relative[i].cwiseProduct(relative[j].transpose()).sum();
    }
  }
  return out;
}

std::optional<MatrixXd> innovation_form_information(const Eigen::Ref<const MatrixXd>& A,
                                                    const Eigen::Ref<const MatrixXd>& C,
                                                    const Eigen::Ref<const MatrixXd>& K,
                                                    const Eigen::Ref<const MatrixXd>& Sigma) {
  const Index n = A.rows(), ny = C.rows();
  if (A.cols() != n || C.cols() != n || K.rows() != n || K.cols() != ny || Sigma.rows() != ny ||
      Sigma.cols() != ny) {
    throw std::invalid_argument("innovation form: shapes of A, C, K and Sigma do not agree");
  }
  const Eigen::LLT<MatrixXd> llt(Sigma);
  if (llt.info() != Eigen::Success) return std::nullopt;
  const MatrixXd F = A - K * C;
  const auto O = solve_discrete_lyapunov(F.transpose(), C.transpose() * llt.solve(C));
  if (!O) return std::nullopt;
  const Index gains = n * ny;
  MatrixXd out = MatrixXd::Zero(gains + ny * (ny + 1) / 2, gains + ny * (ny + 1) / 2);
  for (Index i = 0; i < ny; ++i) {
    for (Index j = 0; j < ny; ++j) out.block(i * n, j * n, n, n) = Sigma(i, j) * *O;
  }
  std::vector<MatrixXd> relative;
  for (Index j = 0; j < ny; ++j) {
    for (Index i = j; i < ny; ++i) {
      MatrixXd d = MatrixXd::Zero(ny, ny);
      d(i, j) = d(j, i) = 1.0;
      relative.push_back(llt.solve(d));
    }
  }
  for (std::size_t a = 0; a < relative.size(); ++a) {
    for (std::size_t b = 0; b < relative.size(); ++b) {
      out(gains + static_cast<Index>(a), gains + static_cast<Index>(b)) =
          0.5 * relative[a].cwiseProduct(relative[b].transpose()).sum();
    }
  }
  return out;
}

Eigen::Matrix2d published_innovation_information(double k, double Sigma) {
  if (k == 0.0 || !(Sigma > 0.0)) {
    throw std::invalid_argument("published innovation form: no information at this k and Sigma");
  }
  Eigen::Matrix2d out;
  out << 2.0 / (k * k), 1.0 / (k * Sigma), 1.0 / (k * Sigma), 1.0 / (Sigma * Sigma);
  return out;
}

}  // namespace identikal
