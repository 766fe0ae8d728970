#include "identify/black_box/internal/likeliest_prior.h"

#include <cmath>
#include <functional>

#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }
double logit(double x) { return std::log(x / (1.0 - x)); }

// Pairs of the logarithm of a size and the logit of a decay.
using PriorOf = std::function<PredictorPrior(const VectorXd& x)>;

PredictorPrior likeliest(const PredictorRegression& regression, const PriorOf& prior_of,
                         const VectorXd& start, int evaluations) {
  Minimization problem;
  problem.evaluate = [&](const VectorXd& x, double& f, VectorXd*) {
    f = -regression.log_evidence(prior_of(x));
    return std::isfinite(f);
  };
  const Eigen::Index pairs = start.size() / 2;
  problem.lower = VectorXd{{-10.0, -4.0}}.replicate(pairs, 1);
  problem.upper = VectorXd{{40.0, 5.0}}.replicate(pairs, 1);
  SolverOptions options;
  options.max_iterations = evaluations;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-2;
  const VectorXd inside = start.cwiseMax(problem.lower).cwiseMin(problem.upper);
  return prior_of(solve_without_gradient(problem, inside, options).x);
}

}  // namespace

PredictorPrior likeliest_prior(const PredictorRegression& regression, const PredictorPrior* start) {
  VectorXd from{{2.0, 0.0, 2.0, 0.0}};
  if (start != nullptr) {
    from = VectorXd{{std::log(start->output_size), logit(start->output_decay),
                     std::log(start->input_size), logit(start->input_decay)}};
  }
  const auto prior_of = [](const VectorXd& x) {
    return PredictorPrior{std::exp(x[0]), logistic(x[1]), std::exp(x[2]), logistic(x[3])};
  };
  return likeliest(regression, prior_of, from, start != nullptr ? 60 : 150);
}

PredictorPrior likeliest_impulse_prior(const PredictorRegression& regression) {
  const auto prior_of = [](const VectorXd& x) {
    PredictorPrior out;
    out.input_size = std::exp(x[0]);
    out.input_decay = logistic(x[1]);
    return out;
  };
  return likeliest(regression, prior_of, VectorXd{{2.0, 1.0}}, 60);
}

}  // namespace identikal
