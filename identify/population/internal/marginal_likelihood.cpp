#include "identify/population/internal/marginal_likelihood.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "lib/base/constants.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStepInErrors = 1e-3;  // of a standard error
constexpr double kSmallestSpread =
    1e-5;  // of where it began: numbers that divide by it stay finite
constexpr int kMostTurns = 60, kHalvings = 30;
constexpr double kClose = 1e-15;     // gain still expected of the effects, in nats
constexpr double kRounding = 1e-12;  // of a log-likelihood

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

}  // namespace

DataOfUnits::DataOfUnits(const MixedEffectsProblem& problem)
    : of_(problem), shared_by_unit_(shared_by_unit(problem)) {}

SpreadCoordinates::SpreadCoordinates(const VectorXd& start, bool correlated)
    : q_(start.size()), correlated_(correlated), smallest_(kSmallestSpread * start) {}

MarginalLikelihood::MarginalLikelihood(const MixedEffectsProblem& problem,
                                       const MixedEffectsStart& start)
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

VectorXd DataOfUnits::coordinates(const VectorXd& theta, const MatrixXd& B) const {
  VectorXd x(of_.data.lower.size());
  for (Index k = 0; k < theta.size(); ++k) x[of_.shared[static_cast<std::size_t>(k)]] = theta[k];
  for (Index i = 0; i < B.cols(); ++i) {
    for (Index j = 0; j < B.rows(); ++j) {
      x[of_.effects(j, i)] = is_log(j) ? std::exp(B(j, i)) : B(j, i);
    }
  }
  return x;
}

bool DataOfUnits::at(const VectorXd& theta, const MatrixXd& B, DataDerivatives& out) {
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

VectorXd SpreadCoordinates::start(const VectorXd& sd) const {
  if (!correlated_) return sd.cwiseAbs2();
  VectorXd out = VectorXd::Zero(size());
  for (Index c = 0, j = 0; j < q_; c += q_ - j, ++j) out[c] = sd[j];
  return out;
}

VectorXd SpreadCoordinates::lower() const {
  if (!correlated_) return smallest_.cwiseAbs2();
  VectorXd out = VectorXd::Constant(size(), -kInfinity);
  for (Index c = 0, j = 0; j < q_; c += q_ - j, ++j) out[c] = smallest_[j];
  return out;
}

MatrixXd SpreadCoordinates::root(const VectorXd& c) const {
  if (!correlated_) return c.cwiseSqrt().asDiagonal();
  MatrixXd L = MatrixXd::Zero(q_, q_);
  for (Index e = 0, j = 0; j < q_; ++j) {
    for (Index i = j; i < q_; ++i) L(i, j) = c[e++];
  }
  return L;
}

std::vector<MatrixXd> SpreadCoordinates::root_slopes(const VectorXd& c) const {
  std::vector<MatrixXd> out;
  for (Index j = 0; j < q_; ++j) {
    for (Index i = j; i < (correlated_ ? q_ : j + 1); ++i) {
      out.push_back(MatrixXd::Zero(q_, q_));
      out.back()(i, j) = correlated_ ? 1.0 : 0.5 / std::sqrt(c[j]);
    }
  }
  return out;
}

bool SpreadCoordinates::at_zero(const VectorXd& c, Index j) const {
  const MatrixXd L = root(c);
  return L.row(j).norm() <= 1.5 * smallest_[j];
}

VectorXd MarginalLikelihood::start(const MixedEffectsStart& from) const {
  VectorXd out(size());
  out << from.shared, from.mean, spread_.start(from.spread);
  return out;
}

LikelihoodProblem MarginalLikelihood::problem() {
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

bool MarginalLikelihood::evaluate(const VectorXd& psi, double& M, VectorXd* gradient,
                                  MatrixXd* information) {
  if (!find_effects(psi)) return false;
  M = value_;
  for (const MatrixXd& H : H_)
    M -= Eigen::LLT<MatrixXd>(H).matrixL().toDenseMatrix().diagonal().array().log().sum();
  if (information != nullptr) *information = expected_information();
  return gradient == nullptr || take_gradient(*gradient);
}

std::vector<Index> MarginalLikelihood::concerning(Index unit) const {
  std::vector<Index> out = data_.shared_of(unit);
  for (Index e = p_; e < size(); ++e) out.push_back(e);
  return out;
}

MatrixXd MarginalLikelihood::conditional_covariance(Index unit) const {
  const MatrixXd Hi = H_[static_cast<std::size_t>(unit)].inverse();
  return L_ * Hi * L_.transpose();
}

// The most probable effects of all units: each unit's steps are its own, their length is shared.
bool MarginalLikelihood::find_effects(const VectorXd& psi) {
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

MatrixXd MarginalLikelihood::curvature(const DataDerivatives& at, Index unit) const {
  MatrixXd H = L_.transpose() * at.effects[static_cast<std::size_t>(unit)] * L_;
  H.diagonal().array() += 1.0;
  return H;
}

// As of a linear model with the same information: of shared and mean, and of Omega.
MatrixXd MarginalLikelihood::expected_information() const {
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
        J(p_ + q_ + a, p_ + q_ + b) += 0.5 * (WA * W * dOmega[static_cast<std::size_t>(b)]).trace();
      }
    }
  }
  J.block(p_, 0, q_, p_) = J.block(0, p_, p_, q_).transpose();
  for (Index a = 0; a < s; ++a) {
    for (Index b = 0; b < a; ++b) J(p_ + q_ + b, p_ + q_ + a) = J(p_ + q_ + a, p_ + q_ + b);
  }
  return J;
}

// @param above, below  the coordinates there  @param width  between them, per unit
bool MarginalLikelihood::along(const VectorXd& theta_above, const VectorXd& theta_below,
                               const MatrixXd& above, const MatrixXd& below, const VectorXd& width,
                               Along& out) {
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
bool MarginalLikelihood::along_shared(const std::vector<Index>& turn, Along& out) {
  VectorXd above = theta_, below = theta_, width = VectorXd::Ones(U_);
  for (const Index k : turn) {
    const double J = here_.shared(k, k);
    const double step =
        J > 0.0 ? kStepInErrors / std::sqrt(J) : kStepInErrors * (1.0 + std::abs(theta_[k]));
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

bool MarginalLikelihood::along_effect(Index j, Along& out) {
  MatrixXd above = effects(), below = above;
  VectorXd width(U_);
  for (Index i = 0; i < U_; ++i) {
    const double J = here_.effects[static_cast<std::size_t>(i)](j, j);
    const double prior = L_.row(j).squaredNorm();
    const double step = kStepInErrors / std::sqrt(std::max(J, 0.0) + 1.0 / prior);
    above(j, i) += step;
    below(j, i) -= step;
    width[i] = above(j, i) - below(j, i);
  }
  return along(theta_, theta_, above, below, width, out);
}

bool MarginalLikelihood::take_gradient(VectorXd& out) {
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
void MarginalLikelihood::add_unit(Index i, const std::vector<const Along*>& by_shared,
                                  const std::vector<Along>& by_effect,
                                  const std::vector<MatrixXd>& slopes, VectorXd& out) {
  const auto unit = static_cast<std::size_t>(i);
  const auto p = static_cast<Index>(by_shared.size());
  const VectorXd z = Z_.col(i), g = here_.by_effects.col(i);
  const MatrixXd& I = here_.effects[unit];
  MatrixXd O(q_, q_);  // minus the second derivatives by the effects
  for (Index j = 0; j < q_; ++j) O.col(j) = -by_effect[static_cast<std::size_t>(j)].gradient.col(i);
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

}  // namespace identikal
