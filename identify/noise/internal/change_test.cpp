#include "identify/noise/internal/change_test.h"

#include <algorithm>
#include <cmath>

#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// What the noise might have become: the present one with one variance, one matrix, or all of it
// larger or smaller.
std::vector<ParameterSet> neighbours(const ParameterSet& present) {
  const double factors[] = {0.1, std::sqrt(0.1), std::sqrt(10.0), 10.0};
  std::vector<ParameterSet> out;
  for (const double factor : factors) {
    ParameterSet all = present;
    for (std::size_t p = 0; p < present.size(); ++p) {
      if (present[p].fixed) continue;
      all[p].value *= factor;
      ParameterSet one = present;
      one[p].value *= factor;
      out.push_back(one);
      const bool separate =
          present[p].domain == Domain::diagonal || present[p].domain == Domain::positive_definite;
      for (Index i = 0; separate && present[p].value.rows() > 1 && i < present[p].value.rows();
           ++i) {
        one = present;
        one[p].value.row(i) *= std::sqrt(factor);
        one[p].value.col(i) *= std::sqrt(factor);
        out.push_back(one);
      }
    }
    out.push_back(all);
  }
  return out;
}

}  // namespace

ChangeTest::ChangeTest(const Model& model, const ParameterPrior& prior,
                       const std::function<FilterStart(const StateSpace&)>& start, double threshold,
                       Random& random)
    : model_(as_linear(model)), threshold_(threshold) {
  constexpr Index kFromPrior = 200;
  near_ = static_cast<Index>(neighbours(model.parameters).size());
  const Index members = near_ + kFromPrior;
  bank_ = filter_bank(instantiate(model_, model.parameters), members);
  for (Index i = near_; i < members; ++i) {
    const VectorXd x = prior.draw(random);
    const StateSpace noise =
        instantiate(model_, with_entries(model.parameters, entries_at(prior, model.parameters, x)));
    const FilterStart from = start(noise);
    set_noise(bank_, i, noise);
    set_state(bank_, i, from.x, from.P);
  }
  statistic_ = VectorXd::Constant(members, -kInfinity);
  sum_ = VectorXd::Zero(members);
  since_.assign(static_cast<std::size_t>(members), 0);
  log_share_.resize(members);
  log_share_.head(near_).setConstant(-std::log(2.0 * static_cast<double>(near_)));
  log_share_.tail(kFromPrior).setConstant(-std::log(2.0 * static_cast<double>(kFromPrior)));
  density_.resize(members);
  weighed_.resize(members);
}

void ChangeTest::centre_on(const ParameterSet& present, const Mixture& state) {
  const std::vector<ParameterSet> sets = neighbours(present);
  for (Index i = 0; i < near_; ++i) {
    set_noise(bank_, i, instantiate(model_, sets[static_cast<std::size_t>(i)]));
    set_state(bank_, i, state.x, state.P);
  }
}

double ChangeTest::observe(Index t, const Eigen::Ref<const VectorXd>& y,
                           const Eigen::Ref<const VectorXd>& u, double present) {
  const double most = threshold_ / 3.0;
  step(bank_, y, u, density_);
  for (Index i = 0; i < statistic_.size(); ++i) {
    const double evidence = std::min(density_[i] - present, most);
    double& S = statistic_[i];
    S = (S > 0.0 ? S + std::log1p(std::exp(-S)) : std::log1p(std::exp(S))) + evidence;
    // The most likely begin of a change into this noise is where its cumulative sum was lowest.
    if (!(sum_[i] > 0.0)) {
      sum_[i] = 0.0;
      since_[static_cast<std::size_t>(i)] = t;
    }
    sum_[i] += evidence;
  }
  weighed_ = statistic_ + log_share_;
  const double largest = weighed_.maxCoeff();
  return largest > -kInfinity ? largest + std::log((weighed_.array() - largest).exp().sum())
                              : -kInfinity;
}

Index ChangeTest::since() const {
  constexpr double kAsWell = 3.0;  // in log-likelihood
  const double most = sum_.maxCoeff();
  Index out = 0;
  for (Index i = 0; i < sum_.size(); ++i) {
    if (sum_[i] > most - kAsWell) out = std::max(out, since_[static_cast<std::size_t>(i)]);
  }
  return out;
}

Index ChangeTest::earliest_since(Index next) const {
  Index out = next;
  for (Index i = 0; i < sum_.size(); ++i) {
    if (sum_[i] > 0.0) out = std::min(out, since_[static_cast<std::size_t>(i)]);
  }
  return out;
}

MatrixXd ChangeTest::state_covariance() const {
  Index best = 0;
  sum_.maxCoeff(&best);
  return mixture(bank_, VectorXd::Unit(sum_.size(), best)).P;
}

void ChangeTest::restart() {
  statistic_.setConstant(-kInfinity);
  sum_.setZero();
}

}  // namespace identikal
