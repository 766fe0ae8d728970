#include "solvers/sparse_least_squares.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include <ceres/cost_function.h>
#include <ceres/evaluation_callback.h>
#include <ceres/iteration_callback.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <ceres/types.h>

#include "solvers/internal/ceres_options.h"

namespace identikal {
namespace {

/// Where the blocks begin in x, and the groups in r and J.
struct Layout {
  std::vector<Eigen::Index> block, residual, derivative;

  explicit Layout(const SparseLeastSquares& problem) : block{0}, residual{0}, derivative{0} {
    for (const Eigen::Index size : problem.block_sizes) block.push_back(block.back() + size);
    for (const SparseLeastSquares::Group& group : problem.groups) {
      Eigen::Index columns = 0;
      for (const Eigen::Index b : group.blocks) {
        if (b < 0 || b + 1 >= static_cast<Eigen::Index>(block.size())) {
          throw std::invalid_argument(
              "sparse least squares: a group names a block that is not there");
        }
        columns += problem.block_sizes[b];
      }
      residual.push_back(residual.back() + group.residuals);
      derivative.push_back(derivative.back() + group.residuals * columns);
    }
  }
};

/// Evaluates all groups at once whenever Ceres moves.
class Evaluation : public ceres::EvaluationCallback {
 public:
  Evaluation(const SparseLeastSquares& problem, const Layout& layout, const Eigen::VectorXd& x)
      : problem_(problem),
        x_(x),
        r_(layout.residual.back()),
        J_(static_cast<std::size_t>(layout.derivative.back())) {}

  void PrepareForEvaluation(bool with_derivatives, bool new_point) override {
    if (!new_point && (have_derivatives_ || !with_derivatives)) return;
    ++evaluations_;
    defined_ = problem_.evaluate(x_, r_, with_derivatives ? &J_ : nullptr) && r_.allFinite();
    have_derivatives_ = with_derivatives;
  }

  bool defined() const { return defined_; }
  const Eigen::VectorXd& r() const { return r_; }
  const std::vector<double>& J() const { return J_; }
  int evaluations() const { return evaluations_; }

 private:
  const SparseLeastSquares& problem_;
  const Eigen::VectorXd& x_;
  Eigen::VectorXd r_;
  std::vector<double> J_;
  bool defined_ = false, have_derivatives_ = false;
  int evaluations_ = 0;
};

/// One group, read off the evaluation.
class GroupCost : public ceres::CostFunction {
 public:
  GroupCost(const SparseLeastSquares& problem, const SparseLeastSquares::Group& group,
            const Evaluation& evaluation, Eigen::Index residual, Eigen::Index derivative)
      : evaluation_(evaluation), residual_(residual), derivative_(derivative) {
    set_num_residuals(static_cast<int>(group.residuals));
    for (const Eigen::Index b : group.blocks) {
      mutable_parameter_block_sizes()->push_back(static_cast<int>(problem.block_sizes[b]));
    }
  }

  bool Evaluate(double const* const*, double* residuals, double** jacobians) const override {
    if (!evaluation_.defined()) return false;
    const int m = num_residuals();
    std::copy_n(evaluation_.r().data() + residual_, m, residuals);
    if (jacobians == nullptr) return true;
    const double* from = evaluation_.J().data() + derivative_;
    for (std::size_t b = 0; b < parameter_block_sizes().size(); ++b) {
      const int size = m * parameter_block_sizes()[b];
      if (jacobians[b] != nullptr) std::copy_n(from, size, jacobians[b]);
      from += size;
    }
    return true;
  }

 private:
  const Evaluation& evaluation_;
  Eigen::Index residual_, derivative_;
};

class Report : public ceres::IterationCallback {
 public:
  explicit Report(const SolverOptions& options) : options_(options) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary& now) override {
    if (!options_.progress || options_.progress(now.iteration, now.cost)) {
      return ceres::SOLVER_CONTINUE;
    }
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }

 private:
  const SolverOptions& options_;
};

void check(const SparseLeastSquares& problem, const Eigen::VectorXd& start) {
  const Eigen::Index n =
      std::accumulate(problem.block_sizes.begin(), problem.block_sizes.end(), Eigen::Index{0});
  if (n == 0 || start.size() != n || problem.lower.size() != n || problem.upper.size() != n) {
    throw std::invalid_argument("sparse least squares: sizes of blocks, start and bounds differ");
  }
  if (!((start.array() >= problem.lower.array()) && (start.array() <= problem.upper.array()))
           .all()) {
    throw std::invalid_argument("sparse least squares: the start lies outside the bounds");
  }
}

/// SuiteSparse where Ceres was built with it, else Eigen's sparse Cholesky: slower on many blocks.
ceres::SparseLinearAlgebraLibraryType sparse_library() {
#ifdef IDENTIKAL_WITHOUT_SUITESPARSE
  return ceres::EIGEN_SPARSE;
#else
  return ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)
             ? ceres::SUITE_SPARSE
             : ceres::EIGEN_SPARSE;
#endif
}

}  // namespace

Solution solve(const SparseLeastSquares& problem, const Eigen::VectorXd& start,
               const SolverOptions& options) {
  check(problem, start);
  const Layout layout(problem);
  Solution solution;
  solution.x = start;
  Evaluation evaluation(problem, layout, solution.x);
  evaluation.PrepareForEvaluation(false, true);
  if (!evaluation.defined()) {
    solution.summary.termination = Termination::start_undefined;
    solution.summary.message = "the residuals are undefined at the start";
    return solution;
  }

  ceres::Problem::Options structure;
  structure.evaluation_callback = &evaluation;
  structure.disable_all_safety_checks = true;  // minutes of them for a million blocks
  ceres::Problem ceres_problem(structure);
  for (std::size_t b = 0; b < problem.block_sizes.size(); ++b) {
    double* block = solution.x.data() + layout.block[b];
    ceres_problem.AddParameterBlock(block, static_cast<int>(problem.block_sizes[b]));
    for (Eigen::Index i = 0; i < problem.block_sizes[b]; ++i) {
      const double low = problem.lower[layout.block[b] + i];
      const double high = problem.upper[layout.block[b] + i];
      if (std::isfinite(low)) ceres_problem.SetParameterLowerBound(block, static_cast<int>(i), low);
      if (std::isfinite(high)) {
        ceres_problem.SetParameterUpperBound(block, static_cast<int>(i), high);
      }
    }
  }
  for (std::size_t g = 0; g < problem.groups.size(); ++g) {
    const SparseLeastSquares::Group& group = problem.groups[g];
    std::vector<double*> blocks;
    for (const Eigen::Index b : group.blocks) {
      blocks.push_back(solution.x.data() + layout.block[b]);
    }
    ceres_problem.AddResidualBlock(
        new GroupCost(problem, group, evaluation, layout.residual[g], layout.derivative[g]),
        nullptr, blocks);
  }

  ceres::Solver::Options how = ceres_options(options);
  how.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  how.sparse_linear_algebra_library_type = sparse_library();
  Report report(options);
  how.callbacks.push_back(&report);
  ceres::Solver::Summary ran;
  ceres::Solve(how, &ceres_problem, &ran);

  SolverSummary& summary = solution.summary;
  summary.termination = termination_of(ran, how);
  summary.message = ran.message;
  summary.iterations = ran.num_successful_steps + ran.num_unsuccessful_steps;
  summary.evaluations = evaluation.evaluations();
  summary.initial_objective = ran.initial_cost;
  summary.objective = ran.final_cost;
  return solution;
}

}  // namespace identikal
