#include "identify/vehicle/internal/robust_noise.h"

#include <cmath>
#include <numbers>

#include "lib/base/constants.h"
#include "lib/base/median.h"

namespace identikal {

NoiseCost noise_cost(bool robust, double r) {
  constexpr double nu = kStudentFreedom;
  if (!robust) return {r * r, 1.0};
  return {(nu + 1.0) * std::log1p(r * r / nu), (nu + 1.0) / (nu + r * r)};
}

double noise_information(bool robust) {
  return robust ? (kStudentFreedom + 1.0) / (kStudentFreedom + 3.0) : 1.0;
}

double log_norm_of_noise(bool robust) {
  constexpr double nu = kStudentFreedom;
  return robust ? 0.5 * std::log(nu * std::numbers::pi) + std::lgamma(0.5 * nu) -
                      std::lgamma(0.5 * (nu + 1.0))
                : 0.5 * kLogTwoPi;
}

double most_likely_scale(const Eigen::VectorXd& e) {
  constexpr int kRounds = 200;  // each brings the scale a third nearer at least
  const auto n = static_cast<double>(e.size());
  double sd = std::sqrt(e.squaredNorm() / n);
  for (int round = 0; round < kRounds && sd > 0.0; ++round) {
    double sum = 0.0;
    for (const double value : e) sum += noise_cost(true, value / sd).weight * value * value;
    const double next = std::sqrt(sum / n), change = std::abs(next - sd);
    sd = next;
    if (change <= 1e-10 * sd) break;
  }
  return sd;
}

Eigen::VectorXd error_weights(bool robust, const Eigen::VectorXd& e) {
  Eigen::VectorXd out = Eigen::VectorXd::Ones(e.size());
  if (!robust || e.size() == 0) return out;
  // The most likely scale grows with the outliers, the median does not; weights of the cost itself
  // would make normal noise look a seventh smaller than it is.
  const Eigen::VectorXd size = e.cwiseAbs();
  const double most = 3.0 * kDeviationPerMedian * median({size.begin(), size.end()});
  if (!(most > 0.0)) return out;
  for (Eigen::Index i = 0; i < e.size(); ++i) {
    if (std::abs(e[i]) > most) out[i] = std::pow(most / e[i], 2);
  }
  return out;
}

}  // namespace identikal
