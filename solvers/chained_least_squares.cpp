#include "solvers/chained_least_squares.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Dense>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFirstDamping = 1e-3, kLeastDamping = 1e-12, kMostDamping = 1e16;
constexpr double kUndamped = 1e-24;  // of states that nothing determines

// Householder's transformation of the rows, in place: A becomes upper triangular.
void triangularise(MatrixXd& A, Index rows, Index columns) {
  for (Index j = 0; j < std::min(columns, rows - 1); ++j) {
    auto column = A.col(j).segment(j, rows - j);
    const double below = column.tail(rows - j - 1).squaredNorm();
    if (below == 0.0) continue;
    const double norm = std::sqrt(column[0] * column[0] + below);
    const double pivot = column[0] > 0.0 ? -norm : norm;
    const double head =
        column[0] - pivot;  // v = [head; what is below], H = I - v v' / (-head pivot)
    const double scale = -1.0 / (head * pivot);
    for (Index k = j + 1; k < columns; ++k) {
      auto other = A.col(k).segment(j, rows - j);
      const double along =
          scale * (head * other[0] + column.tail(rows - j - 1).dot(other.tail(rows - j - 1)));
      other[0] -= along * head;
      other.tail(rows - j - 1) -= along * column.tail(rows - j - 1);
    }
    column[0] = pivot;
    column.tail(rows - j - 1).setZero();
  }
}

// R s_k + N s_(k+1) + P p = z: what is known of one state once the others are.
struct EliminatedState {
  MatrixXd rows;  // [R N P z], state x (2 state + shared + 1)
};

class Elimination {
 public:
  explicit Elimination(const ChainedLeastSquares& problem)
      : problem_(problem), eliminated_(static_cast<std::size_t>(problem.links)) {}

  // Of the problem's step, damped.
  // @param scale  of every state, state x links; of the shared ones
  void eliminate(const std::vector<ChainLink>& links, double damping, const MatrixXd& state_scale,
                 const VectorXd& shared_scale) {
    const Index n = problem_.state, np = problem_.shared;
    const Index width = 2 * n + np + 1;
    const double root = std::sqrt(damping);
    MatrixXd carried = MatrixXd::Zero(0, n + np + 1);  // [s_k p z]
    for (Index k = 0; k < problem_.links; ++k) {
      const ChainLink& link = links[static_cast<std::size_t>(k)];
      const Index m = link.residuals.size(), had = carried.rows();
      const Index rows = had + m + n;
      work_.setZero(rows, width);
      work_.topLeftCorner(had, n) = carried.leftCols(n);
      work_.block(0, 2 * n, had, np + 1) = carried.rightCols(np + 1);
      work_.block(had, 0, m, n) = link.by_state;
      if (k + 1 < problem_.links) work_.block(had, n, m, n) = link.by_next_state;
      work_.block(had, 2 * n, m, np) = link.by_shared;
      work_.block(had, width - 1, m, 1) = -link.residuals;
      for (Index i = 0; i < n; ++i) work_(had + m + i, i) = root * state_scale(i, k);
      triangularise(work_, rows, width);
      eliminated_[static_cast<std::size_t>(k)].rows = work_.topRows(n);
      const Index left = std::min(rows - n, n + np);
      carried = work_.block(n, n, left, n + np + 1);
    }
    finish(carried, root, shared_scale);
  }

  // The step of the shared unknowns within bounds, and with it that of the states.
  void solve(const VectorXd& lower, const VectorXd& upper, MatrixXd& states,
             VectorXd& shared) const {
    const Index n = problem_.state, np = problem_.shared;
    shared = bounded(lower, upper);
    VectorXd next = VectorXd::Zero(n);
    for (Index k = problem_.links - 1; k >= 0; --k) {
      const MatrixXd& rows = eliminated_[static_cast<std::size_t>(k)].rows;
      next = (rows.col(2 * n + np) - rows.middleCols(n, n) * next -
              rows.middleCols(2 * n, np) * shared)
                 .eval();
      rows.leftCols(n).triangularView<Eigen::Upper>().solveInPlace(next);
      states.col(k) = next;
    }
  }

  const MatrixXd& root() const { return R_; }

 private:
  // What is left once no state is: rows of the shared unknowns.
  void finish(const MatrixXd& carried, double root, const VectorXd& shared_scale) {
    const Index np = problem_.shared, had = carried.rows();
    work_.setZero(had + np, np + 1);
    work_.topRows(had) = carried.rightCols(np + 1);
    work_.block(had, 0, np, np).diagonal() = root * shared_scale;
    // The last state's next one does not exist: its columns are zero.
    triangularise(work_, had + np, np + 1);
    R_ = work_.topLeftCorner(np, np).triangularView<Eigen::Upper>();
    z_ = work_.col(np).head(np);
  }

  // minimise ||R x - z|| with lower <= x <= upper: what leaves is held at its bound, what the
  // gradient pulls off one is let go.
  VectorXd bounded(const VectorXd& lower, const VectorXd& upper) const {
    const Index np = problem_.shared;
    VectorXd x = VectorXd::Zero(np);
    std::vector<Index> free;
    std::vector<bool> held(static_cast<std::size_t>(np), false);
    for (Index pass = 0; pass < 4 * np + 4; ++pass) {
      free.clear();
      VectorXd right = z_;
      for (Index i = 0; i < np; ++i) {
        if (held[static_cast<std::size_t>(i)]) {
          right -= R_.col(i) * x[i];
        } else {
          free.push_back(i);
        }
      }
      if (!free.empty()) {
        x(free) = MatrixXd(R_(Eigen::all, free)).colPivHouseholderQr().solve(right);
      }
      Index worst = -1;
      double most = 0.0;
      for (const Index i : free) {
        const double outside = std::max(lower[i] - x[i], x[i] - upper[i]);
        const double size = outside / std::max(std::abs(x[i]), 1e-300);
        if (outside > 0.0 && size > most) most = size, worst = i;
      }
      if (worst >= 0) {
        x[worst] = std::clamp(x[worst], lower[worst], upper[worst]);
        held[static_cast<std::size_t>(worst)] = true;
        continue;
      }
      const VectorXd slope = R_.transpose() * (R_ * x - z_);
      Index released = -1;
      for (Index i = 0; i < np && released < 0; ++i) {
        if (!held[static_cast<std::size_t>(i)] || lower[i] == upper[i]) continue;
        const double least = 1e-9 * R_.col(i).norm() * z_.norm();
        const bool inwards = x[i] <= lower[i] ? slope[i] < -least : slope[i] > least;
        if (inwards) released = i;
      }
      if (released < 0) break;
      held[static_cast<std::size_t>(released)] = false;
    }
    return x.cwiseMax(lower).cwiseMin(upper);
  }

  const ChainedLeastSquares& problem_;
  std::vector<EliminatedState> eliminated_;
  MatrixXd work_, R_;
  VectorXd z_;
};

double sum_of_squares(const std::vector<ChainLink>& links) {
  double out = 0.0;
  for (const ChainLink& link : links) out += link.residuals.squaredNorm();
  return out;
}

// How much less the sum of squares would be, were the residuals straight.
double promised(const ChainedLeastSquares& problem, const std::vector<ChainLink>& links,
                const MatrixXd& states, const VectorXd& shared) {
  double out = 0.0;
  VectorXd moved;
  for (Index k = 0; k < problem.links; ++k) {
    const ChainLink& link = links[static_cast<std::size_t>(k)];
    moved.noalias() = link.by_state * states.col(k);
    moved.noalias() += link.by_shared * shared;
    if (k + 1 < problem.links) moved.noalias() += link.by_next_state * states.col(k + 1);
    out -= moved.dot(2.0 * link.residuals + moved);
  }
  return out;
}

// The largest derivatives so far.
void grow_scales(const ChainedLeastSquares& problem, const std::vector<ChainLink>& links,
                 MatrixXd& state_scale, VectorXd& shared_scale) {
  const Index n = problem.state;
  VectorXd shared = VectorXd::Zero(problem.shared);
  VectorXd before = VectorXd::Zero(n);  // of this state, by the link before
  for (Index k = 0; k < problem.links; ++k) {
    const ChainLink& link = links[static_cast<std::size_t>(k)];
    const VectorXd here = before + link.by_state.colwise().squaredNorm().transpose();
    state_scale.col(k) = state_scale.col(k).cwiseMax(here.cwiseSqrt());
    shared += link.by_shared.colwise().squaredNorm().transpose();
    if (k + 1 < problem.links) before = link.by_next_state.colwise().squaredNorm().transpose();
  }
  shared_scale = shared_scale.cwiseMax(shared.cwiseSqrt());
}

// What nothing depends on stays where it is.
template <typename Scale>
Scale without_zeros(const Scale& scale) {
  return (scale.array() > 0.0).select(scale, 1.0);
}

void check(const ChainedLeastSquares& problem, const MatrixXd& states, const VectorXd& shared) {
  if (problem.links < 1 || states.rows() != problem.state || states.cols() != problem.links ||
      shared.size() != problem.shared || problem.lower.size() != problem.shared ||
      problem.upper.size() != problem.shared) {
    throw std::invalid_argument("chained least squares: start, bounds and problem differ in size");
  }
  if ((shared.array() < problem.lower.array()).any() ||
      (shared.array() > problem.upper.array()).any()) {
    throw std::invalid_argument("chained least squares: the start lies outside the bounds");
  }
}

// Levenberg-Marquardt, from a start that is defined.
class ChainedSearch {
 public:
  ChainedSearch(const ChainedLeastSquares& problem, const SolverOptions& options,
                ChainedSolution& end)
      : problem_(problem), options_(options), end_(end), elimination_(problem) {}

  void run() {
    SolverSummary& summary = end_.summary;
    if (!evaluate(end_.states, end_.shared, true, links_)) {
      summary.termination = Termination::start_undefined;
      summary.message = "the residuals are undefined at the start";
      return;
    }
    sum_ = sum_of_squares(links_);
    summary.initial_objective = 0.5 * sum_;
    state_scale_.setZero(problem_.state, problem_.links);
    shared_scale_.setZero(problem_.shared);
    grow_scales(problem_, links_, state_scale_, shared_scale_);
    summary.termination = Termination::iteration_limit;
    summary.message = "the limit of iterations was reached";
    while (summary.iterations < options_.max_iterations && iterate()) {
    }
    summary.objective = 0.5 * sum_;
    elimination_.eliminate(links_, kUndamped, without_zeros(state_scale_),
                           VectorXd::Zero(problem_.shared));
    end_.root_information = elimination_.root();
  }

 private:
  bool evaluate(const MatrixXd& states, const VectorXd& shared, bool with_derivatives,
                std::vector<ChainLink>& links) {
    ++end_.summary.evaluations;
    links.resize(static_cast<std::size_t>(problem_.links));
    return problem_.evaluate(states, shared, with_derivatives, links) &&
           std::isfinite(sum_of_squares(links));
  }

  void end(Termination why, const char* message) {
    end_.summary.termination = why;
    end_.summary.message = message;
  }

  // @return go on?
  bool iterate() {
    ++end_.summary.iterations;
    MatrixXd ds(problem_.state, problem_.links);
    VectorXd dp;
    while (true) {
      elimination_.eliminate(links_, damping_, without_zeros(state_scale_),
                             without_zeros(shared_scale_));
      elimination_.solve(problem_.lower - end_.shared, problem_.upper - end_.shared, ds, dp);
      const double expected = promised(problem_, links_, ds, dp);
      const bool small = !(expected > options_.function_tolerance * sum_);
      if (small && (damping_ <= kFirstDamping || !(expected > 0.0))) {
        end(Termination::converged, "no step promises less");
        return false;
      }
      const bool straight = problem_.state > 0 || bend(dp);
      const MatrixXd states = end_.states + ds;
      const VectorXd shared = (end_.shared + dp).cwiseMax(problem_.lower).cwiseMin(problem_.upper);
      const bool defined =
          straight && ds.allFinite() && dp.allFinite() && evaluate(states, shared, false, trial_);
      const double there = defined ? sum_of_squares(trial_) : 0.0;
      const double gain = defined ? (sum_ - there) / expected : -1.0;
      if (gain > 1e-4 && evaluate(states, shared, true, links_)) {
        return accept(states, shared, there, gain);
      }
      damping_ *= factor_;
      factor_ *= 2.0;
      if (damping_ > kMostDamping) {
        end(Termination::no_progress, "no step improves the objective");
        return false;
      }
    }
  }

  // Where no state is free, adds to a step what the residuals' curvature along it asks for: steps
  // then follow a valley that bends.
  // @return is that less than the step? Else it leaves where slopes mean anything
  bool bend(VectorXd& dp) {
    constexpr double kProbe = 0.1, kMost = 0.75;
    const VectorXd probe =
        (end_.shared + kProbe * dp).cwiseMax(problem_.lower).cwiseMin(problem_.upper);
    if (!dp.allFinite() || !evaluate(end_.states, probe, false, trial_)) return false;
    curved_ = links_;
    for (std::size_t k = 0; k < curved_.size(); ++k) {
      ChainLink& link = curved_[k];
      const VectorXd change = (trial_[k].residuals - link.residuals) / kProbe;
      link.residuals = (change - link.by_shared * dp) / kProbe;
    }
    const VectorXd scale = without_zeros(shared_scale_);
    MatrixXd none(0, problem_.links);
    VectorXd bent;
    elimination_.eliminate(curved_, damping_, none, scale);
    elimination_.solve(problem_.lower - end_.shared - dp, problem_.upper - end_.shared - dp, none,
                       bent);
    const double step = scale.cwiseProduct(dp).norm(), more = scale.cwiseProduct(bent).norm();
    if (!(2.0 * more <= kMost * step)) return false;
    dp += bent;
    return true;
  }

  bool accept(const MatrixXd& states, const VectorXd& shared, double there, double gain) {
    const double moved = (shared - end_.shared).norm();
    const double reduction = sum_ - there;
    end_.states = states;
    end_.shared = shared;
    const double before = sum_;
    sum_ = there;
    grow_scales(problem_, links_, state_scale_, shared_scale_);
    damping_ *= std::max(1.0 / 5.0, 1.0 - std::pow(2.0 * gain - 1.0, 3));
    damping_ = std::max(damping_, kLeastDamping);
    factor_ = 2.0;
    if (options_.progress && !options_.progress(end_.summary.iterations, 0.5 * sum_)) {
      end(Termination::stopped, "stopped by the caller");
      return false;
    }
    if (sum_ == 0.0 ||
        (reduction <= options_.function_tolerance * before && damping_ <= kFirstDamping)) {
      end(Termination::converged, "the objective changes no more");
      return false;
    }
    if (problem_.shared > 0 && damping_ <= kFirstDamping &&
        moved <= options_.parameter_tolerance * (shared.norm() + options_.parameter_tolerance) &&
        reduction <= std::sqrt(options_.function_tolerance) * before) {
      end(Termination::converged, "the parameters change no more");
      return false;
    }
    return true;
  }

  const ChainedLeastSquares& problem_;
  const SolverOptions& options_;
  ChainedSolution& end_;
  Elimination elimination_;
  std::vector<ChainLink> links_, trial_, curved_;
  MatrixXd state_scale_;
  VectorXd shared_scale_;
  double sum_ = 0.0, damping_ = kFirstDamping, factor_ = 2.0;
};

}  // namespace

ChainedSolution solve(const ChainedLeastSquares& problem, const MatrixXd& states,
                      const VectorXd& shared, const SolverOptions& options) {
  check(problem, states, shared);
  ChainedSolution out{states, shared, {}, {}};
  out.summary.termination = Termination::converged;
  out.summary.message = "";
  out.summary.iterations = out.summary.evaluations = 0;
  ChainedSearch(problem, options, out).run();
  return out;
}

}  // namespace identikal
