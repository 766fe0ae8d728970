#include "identify/regression/order.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/regression/recursive_least_squares.h"
#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostOrder = 5;
constexpr Index kRowsPerCoefficient = 10;  // of the longest order tried
constexpr double kWorth = 2.0;             // in log-likelihood
constexpr double kFactors[] = {1.0, 0.999, 0.998, 0.995, 0.99, 0.98, 0.95, 0.9};
constexpr double kMemoryPerCoefficient = 5.0;  // samples, at the least
constexpr double kUsualDelta = -3.0;           // log10, of the mean square
constexpr double kDeltaRange[] = {-9.0, 2.0};

Index lead_of(Index coefficients) { return 3 * coefficients; }

bool worth_it(double before, double after, Index errors) {
  return 0.5 * static_cast<double>(errors) * std::log(before / after) > kWorth;
}

// The best of the grid, and 1 where that is not much worse.
struct Tried {
  double lambda = 1.0, criterion = kInfinity;
};
Tried best_factor(const MatrixXd& phi, const VectorXd& y, double delta, double least, Index lead) {
  Tried none, best;
  for (const double lambda : kFactors) {
    if (lambda < least) break;
    const Tried tried{lambda, predictive_squares(phi, y, delta, lambda, lead)};
    if (lambda == 1.0) none = tried;
    if (tried.criterion < best.criterion) best = tried;
  }
  return worth_it(none.criterion, best.criterion, y.size() - lead) ? best : none;
}

// Coordinates sqrt(1 - lambda) and log10 of delta over the mean square.
struct Refined {
  double lambda, delta, criterion;
};
/// What is refined, and how far.
struct Refinement {
  bool lambda = false, delta = false;
  double least_lambda = 0.0;
  double delta_scale = 1.0;  // the mean square
};
Refined refine(const MatrixXd& phi, const VectorXd& y, Index lead, const Refined& from,
               const Refinement& free) {
  Refined best = from;
  Minimization problem;
  const Index n = (free.lambda ? 1 : 0) + (free.delta ? 1 : 0);
  problem.lower.resize(n);
  problem.upper.resize(n);
  VectorXd start(n);
  if (free.lambda) {
    problem.lower[0] = 0.0;
    problem.upper[0] = std::sqrt(1.0 - free.least_lambda);
    start[0] = std::sqrt(1.0 - from.lambda);
  }
  if (free.delta) {
    problem.lower[n - 1] = kDeltaRange[0];
    problem.upper[n - 1] = kDeltaRange[1];
    start[n - 1] = std::log10(from.delta / free.delta_scale);
  }
  problem.evaluate = [&](const VectorXd& x, double& f, VectorXd*) {
    Refined tried = from;
    if (free.lambda) tried.lambda = std::max(free.least_lambda, 1.0 - x[0] * x[0]);
    if (free.delta) tried.delta = free.delta_scale * std::pow(10.0, x[n - 1]);
    f = tried.criterion = predictive_squares(phi, y, tried.delta, tried.lambda, lead);
    if (f < best.criterion) best = tried;
    return true;
  };
  SolverOptions options;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-3;
  options.max_iterations = 10;
  solve_without_gradient(problem, start, options);
  return worth_it(from.criterion, best.criterion, y.size() - lead) ? best : from;
}

}  // namespace

RegressionChoice choose_regression(const RegressionModel& settings,
                                   const Eigen::Ref<const MatrixXd>& u,
                                   const Eigen::Ref<const VectorXd>& y, const std::string& data,
                                   const std::function<bool(const RegressionOrder&)>& progress) {
  RegressionChoice out;
  const Index m = u.rows();
  const auto shortest = RegressionOrder{settings.inputs.value_or(1), settings.feedback.value_or(0)};
  const auto coefficients = [m](const RegressionOrder& o) { return m * o.inputs + o.feedback; };
  out.longest = shortest;
  out.order_chosen = !settings.inputs || !settings.feedback;
  for (Index most = 1; out.order_chosen && most <= kMostOrder; ++most) {
    const RegressionOrder tried{settings.inputs.value_or(most), settings.feedback.value_or(most)};
    if (lagged_rows(u, y, tried).y.size() < kRowsPerCoefficient * coefficients(tried)) break;
    out.longest = tried;
  }
  const Index lead = lead_of(coefficients(out.longest));
  const LaggedRows all = lagged_rows(u, y, out.longest);
  if (all.y.size() < lead + kRowsPerCoefficient) {
    throw InputError(
        {data, 0, 0},
        fmt::format("{} complete row{} for {} coefficients", all.y.size(),
                    all.y.size() == 1 ? "" : "s", coefficients(out.longest)),
        fmt::format("at least {} samples in a row with all inputs and the output, again and again",
                    lead + kRowsPerCoefficient));
  }
  double scale = all.phi.squaredNorm() / static_cast<double>(all.phi.size());
  if (!(scale > 0.0)) scale = 1.0;
  out.delta = settings.delta.value_or(scale * std::pow(10.0, kUsualDelta));
  out.counted = all.y.size() - lead;
  const bool free_lambda = !settings.forgetting && settings.memory == 0.0;
  const double lambda =
      settings.memory > 0.0 ? 1.0 - 1.0 / settings.memory : settings.forgetting.value_or(1.0);

  struct Candidate {
    RegressionOrder order;
    Tried tried;
  };
  std::vector<Candidate> candidates;
  double least = kInfinity;
  for (Index inputs = shortest.inputs; inputs <= out.longest.inputs; ++inputs) {
    for (Index feedback = shortest.feedback; feedback <= out.longest.feedback; ++feedback) {
      const RegressionOrder order{inputs, feedback};
      out.stopped = out.stopped || (progress && !progress(order));
      if (out.stopped && !candidates.empty()) continue;
      const LaggedRows rows = lagged_rows(u, y, order, out.longest);
      candidates.push_back(
          {order,
           free_lambda
               ? best_factor(rows.phi, rows.y, out.delta, least_forgetting(rows.phi.rows()), lead)
               : Tried{lambda, predictive_squares(rows.phi, rows.y, out.delta, lambda, lead)}});
      least = std::min(least, candidates.back().tried.criterion);
    }
  }
  out.candidates = static_cast<Index>(candidates.size());
  // The fewest coefficients that are not much worse than the best; of these the best.
  std::erase_if(candidates, [&](const Candidate& c) {
    return worth_it(c.tried.criterion, least, out.counted);
  });
  const Candidate& chosen = *std::min_element(
      candidates.begin(), candidates.end(), [&](const Candidate& one, const Candidate& other) {
        const Index a = coefficients(one.order), b = coefficients(other.order);
        return a != b ? a < b : one.tried.criterion < other.tried.criterion;
      });
  out.order = chosen.order;
  out.forgetting = chosen.tried.lambda;
  out.criterion = chosen.tried.criterion;
  const LaggedRows rows = lagged_rows(u, y, out.order, out.longest);
  if ((free_lambda || !settings.delta) && !out.stopped) {
    const Refined refined =
        refine(rows.phi, rows.y, lead, {out.forgetting, out.delta, out.criterion},
               {free_lambda, !settings.delta, least_forgetting(rows.phi.rows()), scale});
    out.forgetting = refined.lambda;
    out.delta = refined.delta;
    out.criterion = refined.criterion;
  }
  out.forgetting_chosen = free_lambda;
  return out;
}

double least_forgetting(Index coefficients) {
  return 1.0 - 1.0 / (kMemoryPerCoefficient * static_cast<double>(coefficients));
}

double choose_forgetting(const Eigen::Ref<const MatrixXd>& phi, const Eigen::Ref<const VectorXd>& y,
                         double delta, double least) {
  const Index lead = lead_of(phi.rows());
  const Tried tried = best_factor(phi, y, delta, least, lead);
  return refine(phi, y, lead, {tried.lambda, delta, tried.criterion}, {true, false, least, 1.0})
      .lambda;
}

}  // namespace identikal
