#include "identify/filter/leading_samples.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_check.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// log p(y(t) | y(1), ..., y(t-1)) of a sample behind a diffuse start.
double log_density(const FilterResult& filter, Index t) {
  std::vector<Index> present;
  for (Index i = 0; i < filter.standardised.rows(); ++i) {
    if (!std::isnan(filter.standardised(i, t))) present.push_back(i);
  }
  if (present.empty()) return 0.0;
  const VectorXd e = filter.standardised(present, t);
  double log_determinant = 2.0 * std::log(filter.e_sd(present[0], t));
  if (present.size() > 1) {
    const MatrixXd Sigma = filter.Sigma[static_cast<std::size_t>(t)](present, present);
    log_determinant = 2.0 * Sigma.llt().matrixLLT().diagonal().array().log().sum();
  }
  return -0.5 * (log_determinant + e.squaredNorm() +
                 static_cast<double>(present.size()) * std::log(2.0 * std::numbers::pi));
}

}  // namespace

VectorXd log_likelihood_by_row(const FilterResult& filter, const Dataset& data) {
  VectorXd out = VectorXd::Constant(filter.e.cols(), kNone);
  const VectorXd jacobian = log_jacobian(data);
  for (Index t = filter.first_proper; t < out.size(); ++t) {
    out[t] = log_density(filter, t) + (jacobian.size() > 0 ? jacobian[t] : 0.0);
  }
  return out;
}

namespace {

// Of one recording, log p(y(1), ..., y(k)) for k = 1 ... count.
VectorXd running_sum(const FilterResult& filter, const Dataset& data, Index count) {
  const VectorXd rows = log_likelihood_by_row(filter, data);
  VectorXd out = VectorXd::Constant(count, kNone);
  double sum = filter.log_likelihood;
  for (Index k = count; k >= std::max<Index>(1, filter.first_proper); --k) {
    out[k - 1] = sum;
    sum -= rows[k - 1];
  }
  return out;
}

}  // namespace

LeadingSamples leading_samples(const Model& model, const ParameterSet& parameters,
                               const std::vector<Dataset>& recordings) {
  constexpr Index kFewest = 30;
  Index count = std::max<Index>(kFewest, 2 * static_cast<Index>(model.states.size()));
  if (is_linear(model)) count = std::max(count, 2 * as_linear(model).A.constant.rows());
  for (const Dataset& data : recordings) count = std::min(count, data.size());
  // The density of one output asks no covariance matrix.
  const Keep keep = model.outputs.size() == 1 ? Keep::innovations : Keep::everything;
  LeadingSamples out;
  VectorXd sum = VectorXd::Zero(count);
  for (const Dataset& data : recordings) {
    const FilterResult filter = run_filter(model, parameters, first_samples(data, count), keep);
    if (filter.status != FilterStatus::ok) return out;
    sum += running_sum(filter, data, count);
    out.diffuse = std::max(out.diffuse, filter.first_proper);
  }
  out.log_likelihood = sum;
  return out;
}

double log_likelihood_behind(const Objective& objective, Index k) {
  if (k == 0) return objective.log_likelihood;
  if (k > objective.leading.size()) return kNone;
  return objective.log_likelihood - objective.leading[k - 1];
}

}  // namespace identikal
