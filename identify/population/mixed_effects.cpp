#include "identify/population/mixed_effects.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCore>

#include "identify/estimate/distribution.h"
#include "identify/estimate/none.h"
#include "lib/base/constants.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDifference = 1e-3;  // of a standard error
constexpr double kSmallestSpread =
    1e-5;  // of where it began: numbers that divide by it stay finite
constexpr int kMostTurns = 60, kHalvings = 30;
constexpr std::size_t kMostObserved = 60;  // directions of differences
constexpr double kClose = 1e-15;           // gain still expected of the effects, in nats
constexpr double kRounding = 1e-12;        // of a log-likelihood

// The likelihood of the data by shared coordinates and effects in the scale that they are normal in.
struct DataDerivatives {
  double value = 0.0;
  VectorXd by_shared;             // p
  MatrixXd by_effects;            // q x U
  MatrixXd shared;                // p x p, Fisher information
  std::vector<MatrixXd> effects;  // U of q x q
  std::vector<MatrixXd> crossed;  // U, a row for each shared coordinate that concerns the unit
};

// The shared coordinates that concern each unit: those of all, and its own.
std::vector<std::vector<Index>> shared_by_unit(const MixedEffectsProblem& problem) {
  std::vector<Index> of_all;
  std::vector<std::vector<Index>> own(static_cast<std::size_t>(problem.effects.cols()));
  for (std::size_t k = 0; k < problem.shared.size(); ++k) {
    const Index unit = problem.unit_of_shared.empty() ? -1 : problem.unit_of_shared[k];
    (unit < 0 ? of_all : own[static_cast<std::size_t>(unit)]).push_back(static_cast<Index>(k));
  }
  for (std::vector<Index>& list : own) list.insert(list.begin(), of_all.begin(), of_all.end());
  return own;
}

class Data {
 public:
  explicit Data(const MixedEffectsProblem& problem)
      : of_(problem), shared_by_unit_(shared_by_unit(problem)) {}

  const std::vector<Index>& shared_of(Index unit) const {
    return shared_by_unit_[static_cast<std::size_t>(unit)];
  }

  VectorXd coordinates(const VectorXd& theta, const MatrixXd& B) const {
    VectorXd x(of_.data.lower.size());
    for (Index k = 0; k < theta.size(); ++k) x[of_.shared[static_cast<std::size_t>(k)]] = theta[k];
    for (Index i = 0; i < B.cols(); ++i) {
      for (Index j = 0; j < B.rows(); ++j) {
        x[of_.effects(j, i)] = is_log(j) ? std::exp(B(j, i)) : B(j, i);
      }
    }
    return x;
  }

  bool at(const VectorXd& theta, const MatrixXd& B, DataDerivatives& out) {
    const VectorXd x = coordinates(theta, B);
    if (!x.allFinite() || !of_.data.evaluate(x, out.value, &gradient_, &information_)) return false;
    if (!std::isfinite(out.value)) return false;
    const Index p = theta.size(), q = B.rows(), U = B.cols();
    out.by_shared.resize(p);
    out.shared.resize(p, p);
    out.by_effects.resize(q, U);
    out.effects.assign(static_cast<std::size_t>(U), MatrixXd(q, q));
    out.crossed.clear();
    const auto place = [&](Index k) { return of_.shared[static_cast<std::size_t>(k)]; };
    for (Index k = 0; k < p; ++k) {
      out.by_shared[k] = gradient_[place(k)];
      for (Index l = 0; l < p; ++l) out.shared(k, l) = information_(place(k), place(l));
    }
    for (Index i = 0; i < U; ++i) {
      const auto unit = static_cast<std::size_t>(i);
      const std::vector<Index>& concerned = shared_by_unit_[unit];
      out.crossed.emplace_back(concerned.size(), q);
      for (Index j = 0; j < q; ++j) {
        const Index a = of_.effects(j, i);
        const double by = is_log(j) ? x[a] : 1.0;
        out.by_effects(j, i) = by * gradient_[a];
        for (Index l = 0; l < q; ++l) {
          const Index b = of_.effects(l, i);
          out.effects[unit](j, l) = by * (is_log(l) ? x[b] : 1.0) * information_(a, b);
        }
        Index row = 0;
        for (const Index k : concerned) {
          out.crossed[unit](row++, j) = by * information_(place(k), a);
        }
      }
    }
    return true;
  }

 private:
  bool is_log(Index j) const { return of_.logarithmic[static_cast<std::size_t>(j)]; }

  const MixedEffectsProblem& of_;
  std::vector<std::vector<Index>> shared_by_unit_;
  VectorXd gradient_;
  MatrixXd information_;
};

// How Omega is moved: by its variances, or by the entries of its root.
class Spread {
 public:
  Spread(const VectorXd& start, bool correlated) : q_(start.size()), correlated_(correlated) {
    smallest_ = kSmallestSpread * start;
  }

  Index size() const { return correlated_ ? q_ * (q_ + 1) / 2 : q_; }

  VectorXd start(const VectorXd& sd) const {
    if (!correlated_) return sd.cwiseAbs2();
    VectorXd out = VectorXd::Zero(size());
    for (Index c = 0, j = 0; j < q_; c += q_ - j, ++j) out[c] = sd[j];
    return out;
  }
  VectorXd lower() const {
    if (!correlated_) return smallest_.cwiseAbs2();
    VectorXd out = VectorXd::Constant(size(), -kInfinity);
    for (Index c = 0, j = 0; j < q_; c += q_ - j, ++j) out[c] = smallest_[j];
    return out;
  }
  MatrixXd root(const VectorXd& c) const {
    if (!correlated_) return c.cwiseSqrt().asDiagonal();
    MatrixXd L = MatrixXd::Zero(q_, q_);
    for (Index e = 0, j = 0; j < q_; ++j) {
      for (Index i = j; i < q_; ++i) L(i, j) = c[e++];
    }
    return L;
  }
  // d root / d c
  std::vector<MatrixXd> root_slopes(const VectorXd& c) const {
    std::vector<MatrixXd> out;
    for (Index j = 0; j < q_; ++j) {
      for (Index i = j; i < (correlated_ ? q_ : j + 1); ++i) {
        out.push_back(MatrixXd::Zero(q_, q_));
        out.back()(i, j) = correlated_ ? 1.0 : 0.5 / std::sqrt(c[j]);
      }
    }
    return out;
  }
  bool at_zero(const VectorXd& c, Index j) const {
    const MatrixXd L = root(c);
    return L.row(j).norm() <= 1.5 * smallest_[j];
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Index q_;
  bool correlated_;
  VectorXd smallest_;
};

// The marginal likelihood by theta, mu and what Omega is moved by.
class Marginal {
 public:
  Marginal(const MixedEffectsProblem& problem, const MixedEffectsStart& start)
      : data_(problem),
        lower_(problem.data.lower(problem.shared)),
        upper_(problem.data.upper(problem.shared)),
        p_(start.shared.size()),
        q_(start.mean.size()),
        U_(problem.effects.cols()),
        spread_(start.spread, problem.correlated),
        unit_of_shared_(problem.unit_of_shared),
        Z_(MatrixXd::Zero(q_, U_)) {
    if (unit_of_shared_.empty()) unit_of_shared_.assign(problem.shared.size(), -1);
  }

  Index size() const { return p_ + q_ + spread_.size(); }
  const Spread& spread() const { return spread_; }
  int evaluations() const { return evaluations_; }

  VectorXd start(const MixedEffectsStart& from) const {
    VectorXd out(size());
    out << from.shared, from.mean, spread_.start(from.spread);
    return out;
  }

  LikelihoodProblem problem() {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    LikelihoodProblem out;
    out.lower.resize(size());
    out.lower << lower_, VectorXd::Constant(q_, -kInfinity), spread_.lower();
    out.upper = VectorXd::Constant(size(), kInfinity);
    out.upper.head(p_) = upper_;
    out.evaluate = [this](const VectorXd& psi, double& M, VectorXd* g, MatrixXd* J) {
      return evaluate(psi, M, g, J);
    };
    return out;
  }

  bool evaluate(const VectorXd& psi, double& M, VectorXd* gradient, MatrixXd* information) {
    if (!find_effects(psi)) return false;
    M = value_;
    for (const MatrixXd& H : H_)
      M -= Eigen::LLT<MatrixXd>(H).matrixL().toDenseMatrix().diagonal().array().log().sum();
    if (information != nullptr) *information = expected_information();
    return gradient == nullptr || take_gradient(*gradient);
  }

  // After evaluate() with a gradient, the most probable effects and how they move with psi.
  MatrixXd effects() const { return effects_at(Z_); }
  const MatrixXd& standardised() const { return Z_; }
  const std::vector<MatrixXd>& H() const { return H_; }
  /// By the coordinates that concern a unit, q x as many.
  const MatrixXd& moves(Index unit) const { return moves_[static_cast<std::size_t>(unit)]; }
  std::vector<Index> concerning(Index unit) const {
    std::vector<Index> out = data_.shared_of(unit);
    for (Index e = p_; e < size(); ++e) out.push_back(e);
    return out;
  }
  const std::vector<Index>& unit_of_shared() const { return unit_of_shared_; }
  MatrixXd conditional_covariance(Index unit) const {
    const MatrixXd Hi = H_[static_cast<std::size_t>(unit)].inverse();
    return L_ * Hi * L_.transpose();
  }
  VectorXd coordinates(const VectorXd& psi) const {
    return data_.coordinates(psi.head(p_), effects());
  }

 private:
  MatrixXd effects_at(const MatrixXd& Z) const { return (L_ * Z).colwise() + mu_; }

  bool data_at(const VectorXd& theta, const MatrixXd& B, DataDerivatives& out) {
    ++evaluations_;
    return data_.at(theta, B, out);
  }

  // The most probable effects of all units: each unit's steps are its own, their length is shared.
  bool find_effects(const VectorXd& psi) {
    theta_ = psi.head(p_);
    mu_ = psi.segment(p_, q_);
    c_ = psi.tail(spread_.size());
    L_ = spread_.root(c_);
    MatrixXd Z = Z_;
    DataDerivatives here;
    if (!data_at(theta_, effects_at(Z), here)) {
      Z.setZero();
      if (!data_at(theta_, effects_at(Z), here)) return false;
    }
    double F = here.value - 0.5 * Z.squaredNorm();
    for (int turn = 0; turn < kMostTurns; ++turn) {
      MatrixXd step(q_, U_);
      double expected = 0.0;
      for (Index i = 0; i < U_; ++i) {
        const VectorXd g = L_.transpose() * here.by_effects.col(i) - Z.col(i);
        step.col(i) = curvature(here, i).ldlt().solve(g);
        expected += 0.5 * g.dot(step.col(i));
      }
      if (!(expected > kClose)) break;
      double share = 1.0;
      bool moved = false;
      for (int halving = 0; halving < kHalvings && !moved; ++halving, share *= 0.5) {
        const MatrixXd next = Z + share * step;
        DataDerivatives there;
        if (!data_at(theta_, effects_at(next), there)) continue;
        const double F_there = there.value - 0.5 * next.squaredNorm();
        if (F_there < F - kRounding * (1.0 + std::abs(F))) continue;
        moved = true;
        Z = next;
        F = F_there;
        here = std::move(there);
      }
      if (!moved) break;
    }
    Z_ = Z;
    here_ = std::move(here);
    value_ = F;
    H_.clear();
    for (Index i = 0; i < U_; ++i) H_.push_back(curvature(here_, i));
    return true;
  }

  MatrixXd curvature(const DataDerivatives& at, Index unit) const {
    MatrixXd H = L_.transpose() * at.effects[static_cast<std::size_t>(unit)] * L_;
    H.diagonal().array() += 1.0;
    return H;
  }

  // As of a linear model with the same information: of shared and mean, and of Omega.
  MatrixXd expected_information() const {
    const Index s = spread_.size();
    MatrixXd J = MatrixXd::Zero(size(), size());
    J.topLeftCorner(p_, p_) = here_.shared;
    const std::vector<MatrixXd> slopes = spread_.root_slopes(c_);
    std::vector<MatrixXd> dOmega;
    for (const MatrixXd& dL : slopes) {
      dOmega.push_back(dL * L_.transpose() + L_ * dL.transpose());
    }
    for (Index i = 0; i < U_; ++i) {
      const auto unit = static_cast<std::size_t>(i);
      const MatrixXd& I = here_.effects[unit];
      const MatrixXd& X = here_.crossed[unit];
      const MatrixXd K = conditional_covariance(i);
      const MatrixXd W = I - I * K * I;
      const std::vector<Index>& concerned = data_.shared_of(i);
      J(concerned, concerned) -= X * K * X.transpose();
      J(concerned, Eigen::seqN(p_, q_)) += X - X * K * I;
      J.block(p_, p_, q_, q_) += W;
      for (Index a = 0; a < s; ++a) {
        const MatrixXd WA = W * dOmega[static_cast<std::size_t>(a)];
        for (Index b = 0; b <= a; ++b) {
          J(p_ + q_ + a, p_ + q_ + b) +=
              0.5 * (WA * W * dOmega[static_cast<std::size_t>(b)]).trace();
        }
      }
    }
    J.block(p_, 0, q_, p_) = J.block(0, p_, p_, q_).transpose();
    for (Index a = 0; a < s; ++a) {
      for (Index b = 0; b < a; ++b) J(p_ + q_ + b, p_ + q_ + a) = J(p_ + q_ + a, p_ + q_ + b);
    }
    return J;
  }

  // What the data's derivatives become along one direction, of all units at once: per unit the slope
  // of the gradient by its effects, and that of the information on them.
  struct Along {
    MatrixXd gradient;                  // q x U
    std::vector<MatrixXd> information;  // U of q x q
  };

  // @param above, below  the coordinates there  @param width  between them, per unit
  bool along(const VectorXd& theta_above, const VectorXd& theta_below, const MatrixXd& above,
             const MatrixXd& below, const VectorXd& width, Along& out) {
    DataDerivatives up, down;
    if (!data_at(theta_above, above, up) || !data_at(theta_below, below, down)) return false;
    out.gradient = (up.by_effects - down.by_effects) * width.cwiseInverse().asDiagonal();
    out.information.clear();
    for (std::size_t i = 0; i < up.effects.size(); ++i) {
      out.information.push_back((up.effects[i] - down.effects[i]) / width[static_cast<Index>(i)]);
    }
    return true;
  }

  // Of the coordinates of a turn; a unit sees one of them alone.
  bool along_shared(const std::vector<Index>& turn, Along& out) {
    VectorXd above = theta_, below = theta_, width = VectorXd::Ones(U_);
    for (const Index k : turn) {
      const double J = here_.shared(k, k);
      const double step =
          J > 0.0 ? kDifference / std::sqrt(J) : kDifference * (1.0 + std::abs(theta_[k]));
      above[k] = std::min(theta_[k] + step, upper_[k]);
      below[k] = std::max(theta_[k] - step, lower_[k]);
      if (const Index unit = unit_of_shared_[static_cast<std::size_t>(k)]; unit >= 0) {
        width[unit] = above[k] - below[k];
      } else {
        width.setConstant(above[k] - below[k]);
      }
    }
    const MatrixXd B = effects();
    return along(above, below, B, B, width, out);
  }

  bool along_effect(Index j, Along& out) {
    MatrixXd above = effects(), below = above;
    VectorXd width(U_);
    for (Index i = 0; i < U_; ++i) {
      const double J = here_.effects[static_cast<std::size_t>(i)](j, j);
      const double prior = L_.row(j).squaredNorm();
      const double step = kDifference / std::sqrt(std::max(J, 0.0) + 1.0 / prior);
      above(j, i) += step;
      below(j, i) -= step;
      width[i] = above(j, i) - below(j, i);
    }
    return along(theta_, theta_, above, below, width, out);
  }

  bool take_gradient(VectorXd& out) {
    const std::vector<std::vector<Index>> turns = moved_together(unit_of_shared_);
    std::vector<Along> by_turn(turns.size()), by_effect(static_cast<std::size_t>(q_));
    std::vector<const Along*> by_shared(static_cast<std::size_t>(p_));
    for (std::size_t t = 0; t < turns.size(); ++t) {
      if (!along_shared(turns[t], by_turn[t])) return false;
      for (const Index k : turns[t]) by_shared[static_cast<std::size_t>(k)] = &by_turn[t];
    }
    for (Index j = 0; j < q_; ++j) {
      if (!along_effect(j, by_effect[static_cast<std::size_t>(j)])) return false;
    }
    out = VectorXd::Zero(size());
    out.head(p_) = here_.by_shared;
    moves_.clear();
    const std::vector<MatrixXd> slopes = spread_.root_slopes(c_);
    for (Index i = 0; i < U_; ++i) {
      std::vector<const Along*> of_unit;
      for (const Index k : data_.shared_of(i)) {
        of_unit.push_back(by_shared[static_cast<std::size_t>(k)]);
      }
      VectorXd of_concerned = VectorXd::Zero(static_cast<Index>(of_unit.size()) + size() - p_);
      add_unit(i, of_unit, by_effect, slopes, of_concerned);
      out(concerning(i)) += of_concerned;
    }
    return true;
  }

  // @param by_shared  of those that concern the unit
  // @param out        of concerning(i)
  void add_unit(Index i, const std::vector<const Along*>& by_shared,
                const std::vector<Along>& by_effect, const std::vector<MatrixXd>& slopes,
                VectorXd& out) {
    const auto unit = static_cast<std::size_t>(i);
    const auto p = static_cast<Index>(by_shared.size());
    const VectorXd z = Z_.col(i), g = here_.by_effects.col(i);
    const MatrixXd& I = here_.effects[unit];
    MatrixXd O(q_, q_);  // minus the second derivatives by the effects
    for (Index j = 0; j < q_; ++j)
      O.col(j) = -by_effect[static_cast<std::size_t>(j)].gradient.col(i);
    O = (0.5 * (O + O.transpose())).eval();
    const Index n = out.size();
    // How the condition L'g = z is upset, and the effects move with z at rest, by each of psi.
    MatrixXd upset(q_, n), direct = MatrixXd::Zero(q_, n);
    for (Index k = 0; k < p; ++k) {
      upset.col(k) = L_.transpose() * by_shared[static_cast<std::size_t>(k)]->gradient.col(i);
    }
    for (Index j = 0; j < q_; ++j) {
      direct(j, p + j) = 1.0;
      upset.col(p + j) = -L_.transpose() * O.col(j);
    }
    for (std::size_t c = 0; c < slopes.size(); ++c) {
      const Index e = p + q_ + static_cast<Index>(c);
      direct.col(e) = slopes[c] * z;
      upset.col(e) = slopes[c].transpose() * g - L_.transpose() * O * direct.col(e);
    }
    MatrixXd A = L_.transpose() * O * L_;
    A.diagonal().array() += 1.0;
    moves_.push_back(direct + L_ * A.fullPivLu().solve(upset));
    const MatrixXd Hi = H_[unit].inverse();
    const MatrixXd K = L_ * Hi * L_.transpose();
    out.tail(n - p) += direct.rightCols(n - p).transpose() * g;
    for (Index e = 0; e < n; ++e) {
      MatrixXd dI = MatrixXd::Zero(q_, q_);
      if (e < p) dI = by_shared[static_cast<std::size_t>(e)]->information[unit];
      for (Index j = 0; j < q_; ++j) {
        dI += moves_.back()(j, e) * by_effect[static_cast<std::size_t>(j)].information[unit];
      }
      out[e] -= 0.5 * (K * dI).trace();
    }
    for (std::size_t c = 0; c < slopes.size(); ++c) {
      out[p + q_ + static_cast<Index>(c)] -= (Hi * L_.transpose() * I * slopes[c]).trace();
    }
  }

  Data data_;
  VectorXd lower_, upper_;
  Index p_, q_, U_;
  Spread spread_;
  std::vector<Index> unit_of_shared_;
  MatrixXd Z_;  // of the last point: where the next search begins
  VectorXd theta_, mu_, c_;
  MatrixXd L_;
  DataDerivatives here_;
  double value_ = 0.0;
  std::vector<MatrixXd> H_, moves_;
  int evaluations_ = 0;
};

void check(const MixedEffectsProblem& problem, const MixedEffectsStart& start) {
  const Index n = problem.data.lower.size(), q = problem.effects.rows();
  const auto p = static_cast<Index>(problem.shared.size());
  const bool sizes =
      p + problem.effects.size() == n && start.shared.size() == p && start.mean.size() == q &&
      start.spread.size() == q && q > 0 && static_cast<Index>(problem.logarithmic.size()) == q &&
      (problem.unit_of_shared.empty() || problem.unit_of_shared.size() == problem.shared.size());
  if (!sizes) throw std::invalid_argument("mixed effects: sizes disagree");
  if (problem.effects.cols() < 2)
    throw std::invalid_argument("mixed effects: fewer than two units");
  if (!(start.spread.minCoeff() > 0.0) || !start.spread.allFinite()) {
    throw std::invalid_argument("mixed effects: a spread that is not positive");
  }
}

// By shared, mean, and the standard deviations.
Eigen::SparseMatrix<double> by_deviations(const Marginal& marginal, const VectorXd& psi, Index p,
                                          Index q) {
  const Index n = psi.size(), s = n - p - q;
  MatrixXd T = MatrixXd::Zero(p + 2 * q, n);
  T.topLeftCorner(p + q, p + q).setIdentity();
  const MatrixXd L = marginal.spread().root(psi.tail(s));
  const std::vector<MatrixXd> slopes = marginal.spread().root_slopes(psi.tail(s));
  for (Index c = 0; c < s; ++c) {
    for (Index j = 0; j < q; ++j) {
      T(p + q + j, p + q + c) =
          slopes[static_cast<std::size_t>(c)].row(j).dot(L.row(j)) / L.row(j).norm();
    }
  }
  return T.sparseView();
}

std::optional<MatrixXd> observed_at(const LikelihoodProblem& problem, const VectorXd& psi,
                                    const std::vector<Index>& inside, const MatrixXd& expected,
                                    const std::vector<Index>& unit) {
  VectorXd step(static_cast<Index>(inside.size()));
  for (Index e = 0; e < step.size(); ++e) {
    const Index at = inside[static_cast<std::size_t>(e)];
    step[e] = std::min({3e-3 / std::sqrt(std::max(expected(at, at), 1e-300)),
                        0.5 * (psi[at] - problem.lower[at]), 0.5 * (problem.upper[at] - psi[at])});
  }
  const auto gradient_at = [&](const VectorXd& x, VectorXd& g) {
    VectorXd whole = psi, all;
    whole(inside) = x;
    double ignored = 0.0;
    if (!problem.evaluate(whole, ignored, &all, nullptr)) return false;
    g = all(inside);
    return true;
  };
  return observed_information(gradient_at, psi(inside), step, unit);
}

// The information at the maximum on what is not at a bound; the others have no error.
MatrixXd covariance_of(Marginal& marginal, const VectorXd& psi, bool& is_observed) {
  const LikelihoodProblem problem = marginal.problem();
  double M = 0.0;
  VectorXd gradient;
  MatrixXd expected;
  if (!problem.evaluate(psi, M, &gradient, &expected)) return {};
  std::vector<Index> inside;
  for (Index e = 0; e < psi.size(); ++e) {
    const double room = std::min(psi[e] - problem.lower[e], problem.upper[e] - psi[e]);
    const bool at_bound = !(room > 1e-3 / std::sqrt(std::max(expected(e, e), 1e-300)));
    if (!at_bound) inside.push_back(e);
  }
  if (inside.empty()) return {};
  const std::vector<Index>& of_shared = marginal.unit_of_shared();
  std::vector<Index> unit;
  for (const Index e : inside) {
    const auto k = static_cast<std::size_t>(e);
    unit.push_back(k < of_shared.size() ? of_shared[k] : -1);
  }
  std::optional<MatrixXd> inverse;
  if (moved_together(unit).size() <= kMostObserved) {
    const auto observed = observed_at(problem, psi, inside, expected, unit);
    if (observed) inverse = scaled_inverse(*observed, 1e-10);
  }
  is_observed = inverse.has_value();
  if (!inverse) inverse = scaled_inverse(expected(inside, inside), 1e-10);
  if (!inverse) return {};
  MatrixXd out = MatrixXd::Zero(psi.size(), psi.size());
  out(inside, inside) = *inverse;
  return out;
}

MarginalEstimate around(double value, double se, double quantile) {
  return {value, se, value - quantile * se, value + quantile * se};
}

// The largest variance that a likelihood that falls from its end with this slope and information
// does not rule out (one-sided 95 %).
double upper_limit_of_variance(double slope, double information) {
  constexpr double kDrop = 1.352772;  // half the square of 1.6449
  const double g = std::max(0.0, -slope);
  return (-g + std::sqrt(g * g + 2.0 * kDrop * information)) / information;
}

void take_spreads(Marginal& marginal, const VectorXd& psi, const MixedEffectsProblem& problem,
                  const VectorXd& se, MixedEffects& out) {
  const double quantile = normal_quantile(0.975);
  const Index p = static_cast<Index>(problem.shared.size()), q = problem.effects.rows();
  const VectorXd c = psi.tail(marginal.spread().size());
  double M = 0.0;
  VectorXd gradient;
  MatrixXd information;
  const bool known = marginal.evaluate(psi, M, &gradient, &information);
  for (Index j = 0; j < q; ++j) {
    const bool zero = marginal.spread().at_zero(c, j);
    out.spread_at_zero.push_back(zero);
    MarginalEstimate of;
    if (zero) {
      of = {0.0, kNone, 0.0, kNone};
      const Index e = p + q + j;  // diagonal: its variance
      if (known && !problem.correlated && information(e, e) > 0.0) {
        of.high = std::sqrt(upper_limit_of_variance(gradient[e], information(e, e)));
      }
    } else {
      const double sd = std::sqrt(out.Omega(j, j)), error = se.size() > 0 ? se[p + q + j] : kNone;
      of = {sd, error, sd * std::exp(-quantile * error / sd), sd * std::exp(quantile * error / sd)};
    }
    out.spread.push_back(of);
  }
}

void take_correlations(const Marginal& marginal, const VectorXd& psi, const MatrixXd& covariance,
                       MixedEffects& out) {
  const Index q = out.Omega.rows(), s = marginal.spread().size();
  const MatrixXd L = marginal.spread().root(psi.tail(s));
  const std::vector<MatrixXd> slopes = marginal.spread().root_slopes(psi.tail(s));
  for (Index j = 0; j < q; ++j) {
    for (Index i = j + 1; i < q; ++i) {
      const double ii = out.Omega(i, i), jj = out.Omega(j, j);
      const double r = out.Omega(i, j) / std::sqrt(ii * jj);
      VectorXd by(s);
      for (Index c = 0; c < s; ++c) {
        const MatrixXd& dL = slopes[static_cast<std::size_t>(c)];
        const MatrixXd d = dL * L.transpose() + L * dL.transpose();
        by[c] = d(i, j) / std::sqrt(ii * jj) - 0.5 * r * (d(i, i) / ii + d(j, j) / jj);
      }
      MarginalEstimate of{r, kNone, kNone, kNone};
      if (covariance.size() > 0) {
        of.se = std::sqrt(by.dot(covariance.bottomRightCorner(s, s) * by));
        const double half = normal_quantile(0.975) * of.se / (1.0 - r * r);
        of.low = std::tanh(std::atanh(r) - half);
        of.high = std::tanh(std::atanh(r) + half);
      }
      out.correlation.push_back(of);
    }
  }
}

// Each unit's most probable effects, their errors, and how far from the others they are.
void take_units(const Marginal& marginal, const MatrixXd& covariance, MixedEffects& out) {
  const MatrixXd& Z = marginal.standardised();
  out.effects = marginal.effects();
  out.effects_se.resize(Z.rows(), Z.cols());
  out.p_value.resize(Z.cols());
  for (Index i = 0; i < Z.cols(); ++i) {
    const auto unit = static_cast<std::size_t>(i);
    MatrixXd V = marginal.conditional_covariance(i);
    const MatrixXd& S = marginal.moves(i);
    const std::vector<Index> by = marginal.concerning(i);
    if (covariance.size() > 0) V += S * covariance(by, by) * S.transpose();
    out.effects_se.col(i) = V.diagonal().cwiseMax(0.0).cwiseSqrt();
    // Of effects drawn from the population the most probable ones scatter by 1 - H^-1.
    const MatrixXd scatter = MatrixXd::Identity(Z.rows(), Z.rows()) - marginal.H()[unit].inverse();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scatter);
    const VectorXd along = eigen.eigenvectors().transpose() * Z.col(i);
    double square = 0.0, freedom = 0.0;
    for (Index j = 0; j < along.size(); ++j) {
      constexpr double kTold = 0.05;  // of a unit that says less of an effect nothing is known
      if (eigen.eigenvalues()[j] < kTold) continue;
      square += along[j] * along[j] / eigen.eigenvalues()[j];
      freedom += 1.0;
    }
    out.p_value[i] = freedom > 0.0 ? chi_square_upper_tail(square, freedom) : 1.0;
  }
}

}  // namespace

MixedEffects maximise_marginal(const MixedEffectsProblem& problem, const MixedEffectsStart& start,
                               const SolverOptions& options, bool with_errors) {
  check(problem, start);
  Marginal marginal(problem, start);
  const Index p = start.shared.size(), q = start.mean.size(), U = problem.effects.cols();
  const Solution found = maximise(marginal.problem(), marginal.start(start), options);
  MixedEffects out;
  out.summary = found.summary;
  double M = 0.0;
  VectorXd gradient;
  if (!marginal.evaluate(found.x, M, &gradient, nullptr)) return out;
  const MatrixXd L = marginal.spread().root(found.x.tail(marginal.spread().size()));
  out.Omega = L * L.transpose();
  MatrixXd covariance;
  if (with_errors && found.summary.usable())
    covariance = covariance_of(marginal, found.x, out.observed);
  VectorXd se;
  if (covariance.size() > 0) {
    const Eigen::SparseMatrix<double> T = by_deviations(marginal, found.x, p, q);
    out.covariance = MatrixXd(T * covariance) * T.transpose();
    se = out.covariance.diagonal().cwiseMax(0.0).cwiseSqrt();
  }
  const auto error_of = [&](Index e) { return se.size() > 0 ? se[e] : kNone; };
  for (Index k = 0; k < p; ++k) {
    out.shared.push_back(around(found.x[k], error_of(k), normal_quantile(0.975)));
  }
  const double t = student_t_quantile(0.975, static_cast<double>(U - 1));
  for (Index j = 0; j < q; ++j) out.mean.push_back(around(found.x[p + j], error_of(p + j), t));
  take_spreads(marginal, found.x, problem, se, out);
  if (!marginal.evaluate(found.x, M, &gradient, nullptr)) return out;
  if (problem.correlated) take_correlations(marginal, found.x, covariance, out);
  take_units(marginal, covariance, out);
  out.x = marginal.coordinates(found.x);
  out.summary.evaluations = marginal.evaluations();
  return out;
}

}  // namespace identikal
