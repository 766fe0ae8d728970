#include "identify/black_box/internal/likeliest_prior.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "solvers/solve.h"

namespace identikal {
namespace {

using Eigen::VectorXd;

double logistic(double x) { return 1.0 / (1.0 + std::exp(-x)); }
double logit(double x) { return std::log(x / (1.0 - x)); }

using EvidenceOf = std::function<double(const VectorXd& x)>;

VectorXd likeliest(const EvidenceOf& evidence, const VectorXd& start, const VectorXd& lower,
                   const VectorXd& upper, int evaluations) {
  Minimization problem;
  problem.evaluate = [&](const VectorXd& x, double& f, VectorXd*) {
    f = -evidence(x);
    return std::isfinite(f);
  };
  problem.lower = lower;
  problem.upper = upper;
  SolverOptions options;
  options.max_iterations = evaluations;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-2;
  const VectorXd inside = start.cwiseMax(lower).cwiseMin(upper);
  return solve_without_gradient(problem, inside, options).x;
}

// Of the logarithm of a size, and of the logit of a decay or correlation.
constexpr double kLeastSize = -10.0, kMostSize = 40.0, kLeastDecay = -4.0, kMostDecay = 5.0;

constexpr double kLeastSlow = 1e-8, kMostSlow = 2.0;  // over the main part's size

struct SlowPart {
  KernelPrior prior;
  double evidence;
};

// By a search over sizes: the evidence may have a maximum at none and another at some.
SlowPart likeliest_slow_part(const ImpulseRegression& regression, const SlowPart& without) {
  SlowPart out = without;
  KernelPrior each = without.prior;
  for (double share = kLeastSlow; share < kMostSlow; share *= 10.0) {
    each.slow_size = share * each.size;
    const double evidence = regression.log_evidence(each);
    if (evidence > out.evidence) out = {each, evidence};
  }
  return out;
}

// The upper end of its size's 95 % interval.
KernelPrior widest_slow_part(const ImpulseRegression& regression, const KernelPrior& likeliest,
                             double evidence) {
  constexpr double kLess = 1.92;  // of log evidence
  constexpr int kHalvings = 6;
  KernelPrior out = likeliest, each = likeliest;
  double high = kMostSlow * out.size;
  out.slow_size = std::max(out.slow_size, kLeastSlow * out.size);
  for (int k = 0; k < kHalvings; ++k) {
    each.slow_size = std::sqrt(out.slow_size * high);
    const bool allowed = regression.log_evidence(each) > evidence - kLess;
    (allowed ? out.slow_size : high) = each.slow_size;
  }
  return out;
}

KernelPriors with_slow_part(const ImpulseRegression& regression, const KernelPrior& main,
                            bool rough_too) {
  const double rough =
      main.kernel == Kernel::diagonal_correlated ? main.correlation : std::sqrt(main.decay);
  const double smooth = std::exp(-2.0 / static_cast<double>(regression.rows()));
  SlowPart without{main, regression.log_evidence(main)};
  std::vector<SlowPart> found;
  for (const double correlation : {smooth, rough}) {
    without.prior.slow_correlation = correlation;
    if (found.empty() || rough_too) found.push_back(likeliest_slow_part(regression, without));
  }
  const SlowPart& best =
      found.back().evidence > found.front().evidence ? found.back() : found.front();
  KernelPriors out{best.prior, {}};
  for (const SlowPart& each : found)
    out.wide.push_back(widest_slow_part(regression, each.prior, best.evidence));
  return out;
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
  return prior_of(likeliest([&](const VectorXd& x) { return regression.log_evidence(prior_of(x)); },
                            from, VectorXd{{kLeastSize, kLeastDecay, kLeastSize, kLeastDecay}},
                            VectorXd{{kMostSize, kMostDecay, kMostSize, kMostDecay}},
                            start != nullptr ? 60 : 150));
}

KernelPriors likeliest_kernel(const ImpulseRegression& regression, bool all_kernels) {
  const auto best_of = [&](Kernel kernel, const VectorXd& start, int evaluations) {
    const auto prior_of = [kernel](const VectorXd& x) {
      KernelPrior out{kernel, std::exp(x[0]), logistic(x[1])};
      if (x.size() > 2) out.correlation = logistic(x[2]);
      return out;
    };
    VectorXd lower{{kLeastSize, kLeastDecay, kLeastDecay}}, upper{{kMostSize, kMostDecay, 8.0}};
    lower.conservativeResize(start.size());
    upper.conservativeResize(start.size());
    return prior_of(
        likeliest([&](const VectorXd& x) { return regression.log_evidence(prior_of(x)); }, start,
                  lower, upper, evaluations));
  };
  KernelPrior best = best_of(Kernel::tuned_correlated, VectorXd{{2.0, 1.0}}, 60);
  if (!all_kernels) return with_slow_part(regression, best, false);
  const double size = std::log(best.size), decay = logit(best.decay);
  // TC is DC with the root of the decay as correlation.
  const double correlation = logit(std::sqrt(best.decay));
  for (const KernelPrior& each :
       {best_of(Kernel::diagonal_correlated, VectorXd{{size, decay, correlation}}, 120),
        best_of(Kernel::stable_spline, VectorXd{{size, decay + 1.0}}, 60)}) {
    if (regression.log_evidence(each) > regression.log_evidence(best)) best = each;
  }
  return with_slow_part(regression, best, true);
}

}  // namespace identikal
