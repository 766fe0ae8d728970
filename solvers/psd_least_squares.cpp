#include "solvers/psd_least_squares.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#include "lib/base/constants.h"
#include "lib/base/message.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Blocks = std::vector<PsdBlock>;
using Clock = std::chrono::steady_clock;
using Matrices = std::vector<MatrixXd>;  // one per block

constexpr double kFloor = 1e-6;      // of the natural objective: see minimise()
constexpr double kRounding = 1e-13;  // of the largest eigenvalue of H: below it is rounding
constexpr int kPatience = 10;        // steps without a smaller gap
// Curvatures that keep flat directions bounded, in the same unit. The first bears rounding best;
// the others are for solutions that lie far out along a flat direction.
constexpr double kFlatCurvatures[] = {1e-11, 1e-13, 1e-15, 1e-17};

// minimise 1/2 |root y - target|^2 with all blocks positive semidefinite; root is invertible.
struct ConicProblem {
  MatrixXd root, inverse_transpose;
  VectorXd target;
  Blocks blocks;
  Index rank = 0;  // of H; the first rows of root are flat directions
};

// A point inside the cone: X = L L', Z = F F'.
struct Iterate {
  VectorXd y;
  Matrices L, F;
};

VectorXd eigenvalues(const MatrixXd& M) {
  return Eigen::SelfAdjointEigenSolver<MatrixXd>(M, Eigen::EigenvaluesOnly).eigenvalues();
}

bool factorise(const Blocks& blocks, const VectorXd& y, Matrices& L) {
  L.clear();
  for (const PsdBlock& block : blocks) {
    const Eigen::LLT<MatrixXd> llt(value(block, y));
    if (llt.info() != Eigen::Success) return false;
    L.push_back(llt.matrixL());
  }
  return true;
}

// The objective at y minus the dual objective at Z = F F', as sums of what cannot be negative.
double duality_gap(const ConicProblem& p, const VectorXd& y, const Matrices& F) {
  double gap = 0.0;
  VectorXd slope = VectorXd::Zero(y.size());  // sum_i <B_ik, Z_i>
  for (std::size_t i = 0; i < F.size(); ++i) {
    const MatrixXd Z = F[i] * F[i].transpose();
    gap += value(p.blocks[i], y).cwiseProduct(Z).sum();
    for (const PsdBlock::Entry& e : p.blocks[i].entries) {
      slope[e.unknown] += (e.row == e.col ? 1.0 : 2.0) * e.value * Z(e.row, e.col);
    }
  }
  return gap + 0.5 * (p.root * y - p.target - p.inverse_transpose * slope).squaredNorm();
}

// The largest step along which diag(lambda) + step * d stays positive semidefinite.
double step_to_boundary(const VectorXd& lambda, const MatrixXd& d) {
  const VectorXd w = lambda.cwiseSqrt().cwiseInverse();
  const double lowest = eigenvalues(w.asDiagonal() * d * w.asDiagonal())[0];
  return lowest < 0.0 ? -1.0 / lowest : kInfinity;
}

// One predictor-corrector step. In Nesterov and Todd's coordinates X and Z are the same diagonal
// matrix lambda, and the Newton equations are a least-squares problem whose residual is the new Z:
//   min |root (y + dy) - target|^2 + |X(dy) - lambda - D|^2.
// QR solves it; normal equations would square the condition, which grows like 1 / gap.
// @return false when no step stays inside the cone.
bool advance(const ConicProblem& p, Iterate& at) {
  const std::size_t n = p.blocks.size();
  std::vector<Index> offset(1, 0);  // of each block in stacked matrices
  Index degree = 0;
  for (const PsdBlock& block : p.blocks) {
    offset.push_back(offset.back() + block.size * block.size);
    degree += block.size;
  }
  const auto part = [&](VectorXd& stacked, std::size_t i) {
    return Eigen::Map<MatrixXd>(stacked.data() + offset[i], p.blocks[i].size, p.blocks[i].size);
  };
  // The cone's rows grow without limit and come first: Householder QR is then stable row by row.
  const Index cone = offset.back();
  MatrixXd system = MatrixXd::Zero(cone + p.root.rows(), at.y.size());
  system.bottomRows(p.root.rows()) = p.root;
  std::vector<VectorXd> lambda(n);
  Matrices inverse(n);  // inverse X inverse' = lambda
  VectorXd centre(cone), D(cone), dX, dZ, dy;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::JacobiSVD<MatrixXd> svd(at.F[i].transpose() * at.L[i], Eigen::ComputeFullU);
    lambda[i] = svd.singularValues();
    if (!(lambda[i].minCoeff() > 0.0)) return false;
    inverse[i] =
        lambda[i].cwiseSqrt().cwiseInverse().asDiagonal() * (at.F[i] * svd.matrixU()).transpose();
    part(centre, i) = lambda[i].asDiagonal();
    for (const PsdBlock::Entry& e : p.blocks[i].entries) {
      const MatrixXd image = e.value * inverse[i].col(e.row) * inverse[i].col(e.col).transpose();
      auto rows = system.col(e.unknown).segment(offset[i], image.size());
      rows += image.reshaped();
      if (e.row != e.col) rows += image.transpose().reshaped();
    }
  }
  const Eigen::HouseholderQR<MatrixXd> qr(system);
  const auto newton_step = [&] {  // for D; returns the largest step that stays inside
    VectorXd rhs(system.rows());
    rhs << centre + D, p.target - p.root * at.y;
    dy = qr.solve(rhs);
    dX = system.topRows(cone) * dy;
    dZ = D - dX;
    double step = kInfinity;
    for (std::size_t i = 0; i < n; ++i) {
      step = std::min({step, step_to_boundary(lambda[i], part(dX, i)),
                       step_to_boundary(lambda[i], part(dZ, i))});
    }
    return step;
  };

  D = -centre;
  const double remaining = 1.0 - std::min(1.0, newton_step());
  const double target = std::pow(remaining, 3) * centre.squaredNorm() /
                        static_cast<double>(std::max<Index>(degree, 1));
  for (std::size_t i = 0; i < n; ++i) {
    const Index m = lambda[i].size();
    const MatrixXd product = part(dX, i) * part(dZ, i);
    const MatrixXd sum = lambda[i].replicate(1, m) + lambda[i].transpose().replicate(m, 1);
    part(D, i) = (-product - product.transpose()).cwiseQuotient(sum);
    part(D, i).diagonal() += target * lambda[i].cwiseInverse() - lambda[i];
  }
  for (double step = std::min(1.0, 0.99 * newton_step()); step > 1e-6; step *= 0.5) {
    Iterate next{at.y + step * dy, {}, Matrices(n)};
    bool inside = factorise(p.blocks, next.y, next.L);
    for (std::size_t i = 0; inside && i < n; ++i) {
      const Eigen::LLT<MatrixXd> llt(part(centre, i) + step * part(dZ, i));
      inside = llt.info() == Eigen::Success;
      next.F[i] = inverse[i].transpose() * MatrixXd(llt.matrixL());
    }
    if (!inside) continue;
    at = std::move(next);
    return true;
  }
  return false;
}

// Follows the central path until done(at, gap); at becomes the point with the smallest gap.
template <typename Done>
void follow_path(const ConicProblem& p, Iterate& at, const SolverOptions& options,
                 Clock::time_point begin, const Done& done, SolverSummary& summary) {
  double smallest = kInfinity;
  const auto finish = [&](Termination termination, const char* message) {
    summary.termination = termination;
    summary.message = message;
  };
  Iterate next = at;
  for (int since_best = 0;; ++since_best) {
    const double gap = duality_gap(p, next.y, next.F);
    const bool enough = done(next.y, gap);
    ++summary.evaluations;
    if (enough || gap < smallest) {
      smallest = gap;
      at = next;
      since_best = 0;
    }
    const std::chrono::duration<double> spent = Clock::now() - begin;
    if (enough) return finish(Termination::converged, "the duality gap is below the tolerance");
    if (summary.iterations >= options.max_iterations) {
      return finish(Termination::iteration_limit, "the iteration limit was reached");
    }
    if (spent.count() > options.max_seconds) {
      return finish(Termination::time_limit, "the time limit was reached");
    }
    if (since_best > kPatience || !advance(p, next)) {
      return finish(Termination::no_progress, "rounding keeps the duality gap above the tolerance");
    }
    ++summary.iterations;
    const VectorXd fitted = p.root * next.y;
    const double objective = fitted.dot(0.5 * fitted - p.target);
    if (options.progress && !options.progress(summary.iterations, objective)) {
      return finish(Termination::stopped, "stopped by the caller");
    }
  }
}

double largest_constant(const Blocks& blocks) {
  double out = 0.0;
  for (const PsdBlock& b : blocks) {
    if (b.constant.size() > 0) out = std::max(out, b.constant.cwiseAbs().maxCoeff());
  }
  return out;
}

// A y with all blocks positive definite, scaled to `size` where the cone allows it. The minimum of
// (t + 1)^2 / 2 + small |y|^2 with X_i(y) + t I positive semidefinite has t < 0 if and only if
// there is one.
std::optional<VectorXd> interior_point(const Blocks& blocks, Index k, double size) {
  const double constant = largest_constant(blocks);
  VectorXd weight = VectorXd::Constant(k + 1, 1e-2 / std::max(1.0, constant));
  weight[k] = 1.0;
  ConicProblem p{weight.asDiagonal(), weight.cwiseInverse().asDiagonal(), -VectorXd::Unit(k + 1, k),
                 blocks};
  Iterate at{VectorXd::Unit(k + 1, k), {}, {}};
  for (PsdBlock& block : p.blocks) {
    for (Index i = 0; i < block.size; ++i) block.entries.push_back({k, i, i, 1.0});
    const double lowest = eigenvalues(value(block, VectorXd::Zero(k + 1)))[0];
    at.y[k] = std::max(at.y[k], 1.0 - lowest);
  }
  factorise(p.blocks, at.y, at.L);
  for (const MatrixXd& L : at.L) {
    at.F.push_back(L.transpose().inverse() *
                   (at.y[k] / std::sqrt(static_cast<double>(L.rows()) * blocks.size())));
  }
  SolverSummary summary;
  const auto done = [k](const VectorXd& y, double gap) { return y[k] < -0.1 || gap < 1e-10; };
  follow_path(p, at, {}, Clock::now(), done, summary);
  if (at.y[k] > -1e-6) return std::nullopt;
  if (constant > 0.0) return at.y.head(k);
  return size * at.y.head(k) / std::max(1e-300, at.y.head(k).cwiseAbs().maxCoeff());
}

bool is_semidefinite(const MatrixXd& X) {
  return X.size() == 1 ? X(0, 0) >= 0.0 : Eigen::LLT<MatrixXd>(X).info() == Eigen::Success;
}

// What the path only tends to. The apex x = 0 is one; an unknown that a block of size 1 holds at
// its boundary is another, as long as all other blocks allow it.
void round_to_boundary(const Blocks& blocks, bool apex, Iterate& at) {
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (blocks[i].size > 1 || blocks[i].entries.size() != 1) continue;
    if (!(at.L[i](0, 0) < at.F[i](0, 0))) continue;
    const PsdBlock::Entry& entry = blocks[i].entries[0];
    const double constant = blocks[i].constant.size() > 0 ? blocks[i].constant(0, 0) : 0.0;
    VectorXd rounded = at.y;
    rounded[entry.unknown] = constant == 0.0 ? 0.0 : -constant / entry.value;
    const bool allowed = std::all_of(blocks.begin(), blocks.end(), [&](const PsdBlock& block) {
      return std::none_of(block.entries.begin(), block.entries.end(),
                          [&](const auto& e) { return e.unknown == entry.unknown; }) ||
             is_semidefinite(value(block, rounded));
    });
    if (allowed) at.y = rounded;
  }
  if (apex) at.y.setZero();
}

// Where all blocks are bounds of single unknowns, the path shows which of them hold: with those held
// the rest is plain least squares, without the path's rounding. Bounds that pull are let go, and
// broken ones held. Nothing when that does not settle, or there are other blocks.
std::optional<Iterate> held_at_bounds(const ConicProblem& p, const Iterate& from) {
  constexpr int kMostChanges = 50;
  const Index k = from.y.size();
  std::vector<std::optional<std::size_t>> holder(static_cast<std::size_t>(k));
  for (std::size_t i = 0; i < p.blocks.size(); ++i) {
    if (p.blocks[i].size > 1 || p.blocks[i].entries.size() != 1) return std::nullopt;
    if (from.L[i](0, 0) < from.F[i](0, 0)) holder[p.blocks[i].entries[0].unknown] = i;
  }
  for (int change = 0; change < kMostChanges; ++change) {
    Iterate at{from.y, from.L, Matrices(p.blocks.size(), MatrixXd::Zero(1, 1))};
    std::vector<Index> free, held;
    for (Index e = 0; e < k; ++e) {
      (holder[e] ? held : free).push_back(e);
      if (!holder[e]) continue;
      const PsdBlock& block = p.blocks[*holder[e]];
      const double constant = block.constant.size() > 0 ? block.constant(0, 0) : 0.0;
      at.y[e] = constant == 0.0 ? 0.0 : -constant / block.entries[0].value;
    }
    const VectorXd rest = p.target - p.root(Eigen::all, held) * at.y(held);
    if (!free.empty()) {
      at.y(free) = MatrixXd(p.root(Eigen::all, free)).colPivHouseholderQr().solve(rest).eval();
    }
    const VectorXd slope = p.root.transpose() * (p.root * at.y - p.target);
    bool settled = true;
    for (std::size_t i = 0; settled && i < p.blocks.size(); ++i) {
      const PsdBlock::Entry& entry = p.blocks[i].entries[0];
      auto& by = holder[entry.unknown];
      const double multiplier = slope[entry.unknown] / entry.value;
      if (by == i && multiplier < 0.0) {
        by.reset();
        settled = false;
      } else if (by == i) {
        at.F[i](0, 0) = std::sqrt(multiplier);
      } else if (!by && value(p.blocks[i], at.y)(0, 0) < 0.0) {
        by = i;
        settled = false;
      }
    }
    if (settled) return at;
  }
  return std::nullopt;
}

// Powers of two, so that scaling does not round: a Cholesky factor scaled is one unscaled.
double power_of_two(double x) { return std::exp2(std::round(std::log2(x))); }

// The problem in y: x = size .* y, X = diag(1 / row) scaled X diag(1 / row).
struct Scaled : PsdLeastSquares {
  VectorXd size;
  std::vector<VectorXd> row;
};

// Unknowns get the size that H gives them (unit diagonal) and, when the cone will matter, none
// beyond the room that the diagonals of their blocks leave.
Scaled scale(const PsdLeastSquares& problem, bool within_blocks) {
  Scaled s{problem, problem.H.diagonal().cwiseSqrt().cwiseInverse(), {}};
  for (PsdBlock& block : s.blocks) {
    VectorXd diagonal = VectorXd::Zero(block.size);
    for (const PsdBlock::Entry& e : block.entries) {
      const double size = s.size[e.unknown];
      if (e.row == e.col && size < kInfinity) diagonal[e.row] += std::abs(e.value) * size;
    }
    s.row.push_back(diagonal.unaryExpr(
        [](double d) { return d > 0.0 ? power_of_two(1.0 / std::sqrt(d)) : 1.0; }));
    for (PsdBlock::Entry& e : block.entries) e.value *= s.row.back()[e.row] * s.row.back()[e.col];
    if (block.constant.size() > 0) {
      const auto row = s.row.back().asDiagonal();
      block.constant = (row * block.constant * row).eval();
    }
  }
  for (const PsdBlock& block : s.blocks) {
    for (const PsdBlock::Entry& e : block.entries) {
      double& size = s.size[e.unknown];
      if (within_blocks) size = std::min(size, 1.0 / std::abs(e.value));
    }
  }
  s.size = s.size.unaryExpr([](double d) { return d < kInfinity ? power_of_two(d) : 1.0; });
  for (PsdBlock& block : s.blocks) {
    for (PsdBlock::Entry& e : block.entries) e.value *= s.size[e.unknown];
  }
  s.H = s.size.asDiagonal() * s.H * s.size.asDiagonal();
  s.g = s.size.cwiseProduct(s.g);
  return s;
}

template <typename... What>
void require(bool good, const What&... what) {
  require_argument(good, {"minimise: ", what...});
}

void check(const PsdLeastSquares& problem) {
  const MatrixXd& H = problem.H;
  const Index k = problem.g.size();
  require(H.rows() == k && H.cols() == k, "H is ", H.rows(), " x ", H.cols(), ", g has ", k,
          " rows");
  require(H.allFinite() && problem.g.allFinite(), "H or g is not finite");
  for (Index i = 0; i < k; ++i) {
    require(H(i, i) >= 0.0, "H(", i, ", ", i, ") = ", H(i, i), " is negative");
    for (Index j = 0; j < i; ++j) {
      require(std::abs(H(i, j) - H(j, i)) <= 1e-10 * std::sqrt(H(i, i) * H(j, j)), "H(", i, ", ", j,
              ") = ", H(i, j), " but H(", j, ", ", i, ") = ", H(j, i));
    }
  }
  Blocks all = problem.blocks;
  all.insert(all.end(), problem.limits.begin(), problem.limits.end());
  for (std::size_t b = 0; b < all.size(); ++b) {
    const Index m = all[b].size;
    require(m > 0, "block ", b, " has size ", m);
    const MatrixXd& constant = all[b].constant;
    require(constant.size() == 0 || (constant.rows() == m && constant.cols() == m &&
                                     constant.allFinite() && constant == constant.transpose()),
            "the constant of block ", b, " is not a symmetric ", m, " x ", m, " matrix");
    for (const PsdBlock::Entry& e : all[b].entries) {
      require(e.unknown >= 0 && e.unknown < k && std::min(e.row, e.col) >= 0 &&
                  std::max(e.row, e.col) < m && std::isfinite(e.value),
              "block ", b, " of size ", m, " has ", e.value, " x[", e.unknown, "] at (", e.row,
              ", ", e.col, "); there are ", k, " unknowns");
    }
  }
}

// H = root' root and g = root' target, flat directions having the curvature (times the largest).
ConicProblem conic(const Scaled& s, double curvature) {
  const Index k = s.g.size();
  if (k == 0) return {{}, {}, {}, s.blocks};
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(s.H);
  const VectorXd& values = eigen.eigenvalues();
  const double largest = std::max(1e-300, values[k - 1]);
  require(values[0] > -1e-8 * largest, "H scaled has the eigenvalue ", values[0]);
  const auto flat = values.array() <= kRounding * largest;
  const VectorXd root = flat.select(curvature * largest, values).cwiseSqrt();
  const MatrixXd Vt = eigen.eigenvectors().transpose();
  return {root.asDiagonal() * Vt, root.cwiseInverse().asDiagonal() * Vt,
          (Vt * s.g).cwiseQuotient(root), s.blocks, k - flat.count()};
}

// Whether the pivots of all blocks at y are safely positive.
bool inside_with_margin(const Blocks& blocks, const VectorXd& y) {
  Matrices L;
  return factorise(blocks, y, L) && std::all_of(L.begin(), L.end(), [](const MatrixXd& l) {
           return (l.diagonal().array().square() > 1e-10 * l.rowwise().squaredNorm().array()).all();
         });
}

// All blocks of the problem, and no limits.
PsdSolution minimise_blocks(const PsdLeastSquares& problem, const SolverOptions& options) {
  const Clock::time_point begin = Clock::now();
  Scaled s = scale(problem, false);
  ConicProblem p = conic(s, kFlatCurvatures[0]);
  const bool homogeneous = largest_constant(s.blocks) == 0.0;
  const double natural =
      0.5 * std::pow(std::max(s.g.lpNorm<Eigen::Infinity>(), largest_constant(s.blocks)), 2);
  PsdSolution out;
  out.rank = p.rank;
  out.gap = kInfinity;
  SolverSummary& summary = out.summary;
  summary.initial_objective = 0.0;
  const auto objective = [&](const VectorXd& y) { return y.dot(0.5 * (s.H * y) - s.g); };
  const auto small = [&](const VectorXd& y, double gap) {
    return gap <= options.function_tolerance * std::max(std::abs(objective(y)), kFloor * natural);
  };
  const auto finish = [&](const Iterate& at, Termination termination, const std::string& message) {
    summary.termination = termination;
    summary.message = message;
    summary.objective = objective(at.y);
    out.x = s.size.cwiseProduct(at.y);
    for (std::size_t i = 0; i < s.blocks.size(); ++i) {
      const MatrixXd F = s.row[i].asDiagonal() * at.F[i], X = value(problem.blocks[i], out.x);
      // Scaled, X and Z are of one size, and of each pair of eigenvalues one tends to zero.
      const VectorXd primal = eigenvalues(value(s.blocks[i], at.y));
      const VectorXd dual = eigenvalues(at.F[i] * at.F[i].transpose()).reverse();
      out.blocks.push_back(
          {X, F * F.transpose(), eigenvalues(X)[0], (primal.array() < dual.array()).count()});
    }
    return out;
  };

  Iterate plain{p.inverse_transpose.bottomRows(p.rank).transpose() * p.target.tail(p.rank), {}, {}};
  for (const PsdBlock& b : s.blocks) plain.F.push_back(MatrixXd::Zero(b.size, b.size));
  const double plain_gap = duality_gap(p, plain.y, plain.F);
  summary.evaluations = 1;
  if (natural == 0.0 || (small(plain.y, plain_gap) && inside_with_margin(s.blocks, plain.y))) {
    out.gap = plain_gap;
    return finish(plain, Termination::converged, "no constraint is active");
  }

  s = scale(problem, true);
  Iterate best{VectorXd::Zero(s.g.size()), {}, plain.F};
  const double size =  // of X and Z
      std::max(s.g.lpNorm<Eigen::Infinity>(), largest_constant(s.blocks));
  const std::optional<VectorXd> start = interior_point(s.blocks, s.g.size(), size);
  if (!start) {
    return finish(best, Termination::start_undefined, "no x makes all blocks positive definite");
  }
  for (const double curvature : kFlatCurvatures) {
    p = conic(s, curvature);
    Iterate at{*start, {}, {}};
    factorise(s.blocks, at.y, at.L);
    for (const MatrixXd& L : at.L) at.F.push_back(size * L.transpose().inverse());
    const auto done = [&](const VectorXd& y, double gap) { return small(y, 2.0 * gap); };
    follow_path(p, at, options, begin, done, summary);
    round_to_boundary(s.blocks, homogeneous && objective(at.y) >= 0.0, at);
    const auto take = [&](const Iterate& point) {
      const double added = 0.5 * (p.root * point.y).head(s.g.size() - p.rank).squaredNorm();
      const double gap = duality_gap(p, point.y, point.F) + added;
      if (!(gap < out.gap)) return;
      best = point;
      out.gap = gap;
    };
    take(at);
    if (!small(best.y, out.gap)) {
      if (const auto held = held_at_bounds(p, at)) take(*held);
    }
    if (small(best.y, out.gap)) {
      return finish(best, Termination::converged, "the duality gap is below the tolerance");
    }
    if (!summary.usable()) return finish(best, summary.termination, summary.message);
  }
  return finish(best, Termination::no_progress,
                "the objective still falls along a flat direction of H, far out");
}

}  // namespace

PsdBlock full_block(Index first, Index size) {
  PsdBlock block{size, {}, {}};
  for (Index j = 0; j < size; ++j) {
    for (Index i = j; i < size; ++i) block.entries.push_back({first++, i, j, 1.0});
  }
  return block;
}

PsdBlock lower_bound_block(Index unknown, double lower) {
  return {1, {{unknown, 0, 0, 1.0}}, MatrixXd::Constant(1, 1, -lower)};
}

PsdBlock upper_bound_block(Index unknown, double upper) {
  return {1, {{unknown, 0, 0, -1.0}}, MatrixXd::Constant(1, 1, upper)};
}

std::vector<PsdBlock> independent_blocks(const MatrixXd& constant,
                                         const std::vector<MatrixXd>& basis) {
  const Index n = constant.rows();
  MatrixXd used = constant.cwiseAbs();
  for (const MatrixXd& B : basis) used += B.cwiseAbs();
  std::vector<Index> part(static_cast<std::size_t>(n));
  std::iota(part.begin(), part.end(), 0);
  for (Index j = 0; j < n; ++j) {
    for (Index i = 0; i < j; ++i) {
      if (used(i, j) == 0.0) continue;
      const Index from = part[j], to = part[i];
      std::replace(part.begin(), part.end(), from, to);
    }
  }
  std::vector<PsdBlock> out;
  for (Index p = 0; p < n; ++p) {
    std::vector<Index> rows;
    for (Index i = 0; i < n; ++i) {
      if (part[i] == p) rows.push_back(i);
    }
    PsdBlock block;
    block.size = static_cast<Index>(rows.size());
    const MatrixXd own = constant(rows, rows);
    if (!own.isZero(0.0)) block.constant = own;
    for (std::size_t e = 0; e < basis.size(); ++e) {
      for (Index c = 0; c < block.size; ++c) {
        for (Index r = c; r < block.size; ++r) {
          const double value = basis[e](rows[r], rows[c]);
          if (value != 0.0) block.entries.push_back({static_cast<Index>(e), r, c, value});
        }
      }
    }
    if (!block.entries.empty()) out.push_back(std::move(block));
  }
  return out;
}

MatrixXd value(const PsdBlock& block, const VectorXd& x) {
  MatrixXd X = MatrixXd::Zero(block.size, block.size);
  if (block.constant.size() > 0) X = block.constant;
  for (const PsdBlock::Entry& e : block.entries) {
    X(e.row, e.col) += e.value * x[e.unknown];
    if (e.row != e.col) X(e.col, e.row) += e.value * x[e.unknown];
  }
  return X;
}

PsdSolution minimise(const PsdLeastSquares& problem, const SolverOptions& options) {
  check(problem);
  PsdLeastSquares relaxed = problem;
  const std::size_t own = problem.blocks.size();
  std::vector<std::size_t> taken;  // of the limits, in the order in which they were broken
  for (;;) {
    const PsdSolution found = minimise_blocks(relaxed, options);
    const std::size_t before = taken.size();
    for (std::size_t i = 0; found.summary.usable() && i < problem.limits.size(); ++i) {
      if (std::find(taken.begin(), taken.end(), i) != taken.end()) continue;
      if (eigenvalues(value(problem.limits[i], found.x))[0] >= 0.0) continue;
      relaxed.blocks.push_back(problem.limits[i]);
      taken.push_back(i);
    }
    // What is least under fewer conditions, and meets them all, is least under all.
    if (taken.size() > before) continue;
    PsdSolution out = found;
    out.blocks.resize(own);
    for (std::size_t i = 0; i < problem.limits.size(); ++i) {
      const auto at = std::find(taken.begin(), taken.end(), i);
      const MatrixXd X = value(problem.limits[i], found.x);
      out.blocks.push_back(
          at != taken.end()
              ? found.blocks[own + static_cast<std::size_t>(at - taken.begin())]
              : PsdBlockSolution{X, MatrixXd::Zero(X.rows(), X.cols()), eigenvalues(X)[0], 0});
    }
    return out;
  }
}

}  // namespace identikal
