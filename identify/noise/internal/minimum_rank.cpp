#include "identify/noise/internal/minimum_rank.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "identify/estimate/distribution.h"
#include "solvers/psd_least_squares.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kVanished = 1e-6;  // of Q's largest eigenvalue without penalty
constexpr double kSourcesLevel = 0.99;

double objective(const Misfit& misfit, const VectorXd& theta) {
  return 0.5 * (misfit.design * theta - misfit.target).squaredNorm();
}

PsdLeastSquares normal_equations(const Misfit& misfit, std::vector<PsdBlock> blocks,
                                 std::vector<PsdBlock> limits) {
  return {misfit.design.transpose() * misfit.design, misfit.design.transpose() * misfit.target,
          std::move(blocks), std::move(limits)};
}

MatrixXd joint_at(const MinimumRankProblem& p, const VectorXd& theta) {
  MatrixXd out = p.constant;
  for (std::size_t e = 0; e < p.basis.size(); ++e) out += theta[e] * p.basis[e];
  return out;
}

// theta = offset + directions phi, all with Q(theta) inside a range, and [Q S; S' R] seen from it.
struct Confined {
  VectorXd offset;
  MatrixXd directions;
  std::vector<PsdBlock> blocks, limits;  // of phi
  Index given_up = 0;                    // unknowns
};

// Those of theta, seen from phi; nothing when what the range holds lies outside of them.
std::optional<std::vector<PsdBlock>> limits_of_directions(const MinimumRankProblem& p,
                                                          const Confined& to) {
  std::vector<PsdBlock> out;
  for (const PsdBlock& limit : p.limits) {
    PsdBlock seen{limit.size, {}, value(limit, to.offset)};
    for (const PsdBlock::Entry& e : limit.entries) {
      for (Index c = 0; c < to.directions.cols(); ++c) {
        const double share = to.directions(e.unknown, c);
        if (share != 0.0) seen.entries.push_back({c, e.row, e.col, e.value * share});
      }
    }
    if (seen.entries.empty() && seen.constant.diagonal().minCoeff() < 0.0) return std::nullopt;
    if (!seen.entries.empty()) out.push_back(std::move(seen));
  }
  return out;
}

// Nothing when a constant of Q or S leaves the range, or the range the bounds. range: orthonormal columns.
std::optional<Confined> confine(const MinimumRankProblem& p, const MatrixXd& range,
                                const MatrixXd& complement) {
  const Index nw = p.process_noises, size = p.constant.rows();
  const auto k = static_cast<Index>(p.basis.size());
  const auto outside = [&](const MatrixXd& joint) {
    return MatrixXd(complement.transpose() * joint.topRows(nw));
  };
  // Unknowns of R alone keep their own coordinates.
  std::vector<Index> touched, alone;
  for (Index e = 0; e < k; ++e) {
    const bool touches = !p.basis[e].topRows(nw).isZero(0.0);
    (touches ? touched : alone).push_back(e);
  }
  const auto count = static_cast<Index>(touched.size());
  MatrixXd leaves(complement.cols() * size, count);
  for (Index c = 0; c < count; ++c) {
    leaves.col(c) = outside(p.basis[touched[c]]).reshaped();
  }
  Confined out{VectorXd::Zero(k), MatrixXd::Zero(k, 0), {}, {}, 0};
  MatrixXd kernel = MatrixXd::Identity(count, count);
  if (leaves.size() > 0) {
    const VectorXd wanted = -outside(p.constant).reshaped();
    const Eigen::JacobiSVD<MatrixXd> svd(leaves, Eigen::ComputeFullV | Eigen::ComputeThinU);
    const double largest = svd.singularValues()[0];
    Index rank = 0;
    while (rank < svd.singularValues().size() &&
           svd.singularValues()[rank] > 1e-9 * std::max(largest, 1e-300)) {
      ++rank;
    }
    kernel = svd.matrixV().rightCols(count - rank);
    if (!wanted.isZero(0.0)) {
      const VectorXd solved = leaves.completeOrthogonalDecomposition().solve(wanted);
      if ((leaves * solved - wanted).norm() > 1e-9 * wanted.norm()) return std::nullopt;
      out.offset(touched) = solved;
    }
  }
  const auto free = static_cast<Index>(alone.size());
  out.given_up = count - kernel.cols();
  out.directions = MatrixXd::Zero(k, kernel.cols() + free);
  for (Index c = 0; c < kernel.cols(); ++c) {
    for (Index r = 0; r < count; ++r) {
      const double value = kernel(r, c);
      if (std::abs(value) > 1e-14) {
        out.directions(touched[r], c) = value;
      }
    }
  }
  for (Index c = 0; c < free; ++c) {
    out.directions(alone[c], kernel.cols() + c) = 1.0;
  }

  MatrixXd map = MatrixXd::Zero(size, range.cols() + size - nw);
  map.topLeftCorner(nw, range.cols()) = range;
  map.bottomRightCorner(size - nw, size - nw).setIdentity();
  // Rounding must not connect blocks that nothing connects.
  const auto seen = [&map](const MatrixXd& joint) {
    const MatrixXd M = map.transpose() * joint * map;
    const double tiny = 1e-13 * std::max(joint.cwiseAbs().maxCoeff(), 1e-300);
    const MatrixXd clean = (M.array().abs() > tiny).select(M, 0.0);
    return MatrixXd(clean.selfadjointView<Eigen::Lower>());
  };
  std::vector<MatrixXd> basis;
  for (Index c = 0; c < out.directions.cols(); ++c) {
    MatrixXd joint = MatrixXd::Zero(size, size);
    for (Index e = 0; e < k; ++e) {
      if (out.directions(e, c) != 0.0) {
        joint += out.directions(e, c) * p.basis[e];
      }
    }
    basis.push_back(seen(joint));
  }
  out.blocks = independent_blocks(seen(joint_at(p, out.offset)), basis);
  auto limits = limits_of_directions(p, out);
  if (!limits) return std::nullopt;
  out.limits = std::move(*limits);
  return out;
}

// Nothing when the range leaves no room between the bounds.
std::optional<VectorXd> refit(const Misfit& misfit, const Confined& to) {
  const Misfit reduced{misfit.design * to.directions, misfit.target - misfit.design * to.offset};
  const PsdSolution solution = minimise(normal_equations(reduced, to.blocks, to.limits));
  if (solution.summary.termination == Termination::start_undefined) return std::nullopt;
  return to.offset + to.directions * solution.x;
}

// The minimum of the fit with a penalty on tr Q.
class PenalisedFit {
 public:
  PenalisedFit(const MinimumRankProblem& p, const std::vector<PsdBlock>& blocks)
      : p_(p),
        plain_(normal_equations(p.fit, blocks, p.limits)),
        slope_(static_cast<Index>(p.basis.size())) {
    for (Index e = 0; e < slope_.size(); ++e) {
      slope_[e] = Q_part(p.basis[e]).trace();
    }
  }

  VectorXd minimum(double penalty) const {
    PsdLeastSquares penalised = plain_;
    penalised.g -= penalty * slope_;
    return minimise(penalised).x;
  }

  MatrixXd Q(const VectorXd& theta) const { return Q_part(joint_at(p_, theta)); }

  // The penalty from which on Q vanishes, or cannot fall any more.
  double largest_penalty(const VectorXd& free) const {
    constexpr int kDoublings = 60;
    const double free_trace = Q(free).trace(), fixed_trace = Q_part(p_.constant).trace();
    double penalty = std::max(objective(p_.fit, free), 1e-300) / std::max(free_trace, 1e-300);
    for (int i = 0; i < kDoublings; ++i) {
      const double left = Q(minimum(penalty)).trace() - fixed_trace;
      if (!(left > kVanished * free_trace)) break;
      penalty *= 2.0;
    }
    return penalty;
  }

 private:
  MatrixXd Q_part(const MatrixXd& joint) const {
    return joint.topLeftCorner(p_.process_noises, p_.process_noises);
  }

  const MinimumRankProblem& p_;
  PsdLeastSquares plain_;
  VectorXd slope_;  // of tr Q
};

// A range that Q may be confined to, and by how much chi-square its re-fit exceeds the minimum over
// all Q.
struct Candidate {
  double excess;
  Confined range;

  // By chance alone.
  double allowed() const {
    return range.given_up > 0
               ? chi_square_quantile(kSourcesLevel, static_cast<double>(range.given_up))
               : 0.0;
  }
};

// Of ranges with as many sources as its place in the list says, the one whose re-fit is best.
using BestRanges = std::vector<std::optional<Candidate>>;

// Tries the leading parts of Q's range.
void try_ranges(const MinimumRankProblem& p, const MatrixXd& eigenvectors, Index rank,
                double least_excess, BestRanges& best) {
  for (Index part = 0; part <= rank; ++part) {
    auto range =
        confine(p, eigenvectors.rightCols(part), eigenvectors.leftCols(p.process_noises - part));
    if (!range) continue;
    const auto theta = refit(p.chance, *range);
    if (!theta) continue;
    const double excess = 2.0 * (objective(p.chance, *theta) - least_excess);
    auto& known = best[part];
    if (!known || excess < known->excess) known = Candidate{excess, std::move(*range)};
  }
}

}  // namespace

MinimumRank minimum_rank(const MinimumRankProblem& p) {
  const Index nw = p.process_noises;
  const std::vector<PsdBlock> blocks = independent_blocks(p.constant, p.basis);
  const PenalisedFit fit(p, blocks);
  const VectorXd free = fit.minimum(0.0);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> of_free(fit.Q(free), Eigen::EigenvaluesOnly);
  const double vanished = kVanished * of_free.eigenvalues()[nw - 1];
  const double least_excess =
      objective(p.chance, minimise(normal_equations(p.chance, blocks, p.limits)).x);

  constexpr int kSteps = 24;  // over four decades
  const double most = fit.largest_penalty(free);
  BestRanges best(static_cast<std::size_t>(nw + 1));
  MinimumRank out;
  RankSelection& report = out.report;
  report.of = nw;
  for (int step = 0; step <= kSteps; ++step) {
    const double penalty =
        step == kSteps ? 0.0 : most * std::pow(10.0, -4.0 * step / (kSteps - 1.0));
    const VectorXd theta = step == kSteps ? free : fit.minimum(penalty);
    const MatrixXd Q = fit.Q(theta);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(Q);
    const Index rank = (eigen.eigenvalues().array() > vanished).count();
    report.curve.push_back({penalty, objective(p.fit, theta), Q.trace(), rank});
    try_ranges(p, eigen.eigenvectors(), rank, least_excess, best);
  }
  for (RankSelection::Step& step : report.curve) {
    const auto& known = best[step.rank];
    if (!known) continue;
    step.excess = std::max(0.0, known->excess);
    step.allowed = known->allowed();
  }
  out.theta = free;
  report.rank = (of_free.eigenvalues().array() > vanished).count();
  for (Index rank = 0; rank < report.rank; ++rank) {
    const auto& known = best[rank];
    if (!known || known->excess > known->allowed()) continue;
    const auto theta = refit(p.fit, known->range);
    if (!theta) continue;
    out.theta = *theta;
    report.rank = rank;
    break;
  }
  return out;
}

}  // namespace identikal
