#include "identify/noise/internal/zero_noise.h"

#include <algorithm>
#include <cmath>

namespace identikal {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Where the samples tell a variance well.
std::optional<VectorXd> with_variance_raised(const LikelihoodProblem& problem,
                                             const LikelihoodPoint& found, Index i,
                                             double samples) {
  constexpr double kTold = 0.05, kStep = 10.0;  // of the information in `samples` values
  constexpr int kMostSteps = 12;
  if (!(found.information(i, i) > 0.0)) return std::nullopt;
  VectorXd x = found.x;
  x[i] = 1.0 / std::sqrt(found.information(i, i));
  for (int step = 0; step < kMostSteps; ++step) {
    x[i] = std::min(kStep * x[i], problem.upper[i]);
    const std::optional<LikelihoodPoint> at = point_at(problem, x);
    if (!at) return std::nullopt;
    if (at->information(i, i) * x[i] * x[i] > kTold * samples || x[i] >= problem.upper[i]) return x;
  }
  return std::nullopt;
}

}  // namespace

std::optional<LikelihoodPoint> point_at(const LikelihoodProblem& problem, const VectorXd& x) {
  LikelihoodPoint out;
  out.x = x;
  if (!problem.evaluate(x, out.L, &out.gradient, &out.information)) return std::nullopt;
  return out;
}

bool may_be_zero(const LikelihoodProblem& problem, const LikelihoodPoint& at, Index i) {
  constexpr double kTold = 4.0;  // squared value over squared error
  return problem.lower[i] == 0.0 && !(at.x[i] * at.x[i] * at.information(i, i) > kTold);
}

std::vector<VectorXd> variances_raised(const LikelihoodProblem& problem,
                                       const std::optional<LikelihoodPoint>& found, double samples,
                                       bool together) {
  constexpr std::size_t kMost = 6;
  std::vector<VectorXd> out;
  if (!found) return out;
  VectorXd all = found->x;
  for (Index i = 0; i < all.size() && out.size() < kMost; ++i) {
    if (!may_be_zero(problem, *found, i)) continue;
    const std::optional<VectorXd> raised = with_variance_raised(problem, *found, i, samples);
    if (!raised) continue;
    all[i] = (*raised)[i];
    out.push_back(*raised);
  }
  if (together && out.size() > 1) out.push_back(all);
  return out;
}

std::optional<VectorXd> off_zero(const LikelihoodProblem& problem, const VectorXd& from,
                                 const VectorXd& end) {
  constexpr double kHigher = 1e-3;  // log-likelihoods closer than this are the same
  constexpr int kDecades = 5;
  if ((end.array() != 0.0).all()) return std::nullopt;
  const std::optional<LikelihoodPoint> there = point_at(problem, end);
  if (!there) return std::nullopt;
  VectorXd best = end;
  double highest = there->L + kHigher;
  for (Index i = 0; i < end.size(); ++i) {
    if (end[i] != 0.0 || there->gradient[i] != 0.0 || there->information(i, i) != 0.0) continue;
    VectorXd x = best;
    x[i] = from[i] != 0.0 ? from[i] : 1.0;
    for (int decade = 0; decade <= kDecades; ++decade, x[i] /= 10.0) {
      double L = 0.0;
      if (!problem.evaluate(x, L, nullptr, nullptr) || !(L > highest)) continue;
      highest = L;
      best = x;
    }
  }
  if (best == end) return std::nullopt;
  return best;
}

}  // namespace identikal
