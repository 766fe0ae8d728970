#include "solvers/recursive_posterior.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "lib/base/constants.h"
#include "solvers/internal/resampling.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

void place(const NoiseProblem& problem, const VectorXd& x, FilterBank& bank, Index member,
           double& log_likelihood) {
  const StateSpace noise = problem.noise(x);
  const FilterStart start = problem.start(noise);
  set_noise(bank, member, noise);
  set_state(bank, member, start.x, start.P);
  log_likelihood = start.log_density;
}

// What Metropolis steps propose, with the filters that go with it.
struct Proposals {
  MatrixXd draws;
  VectorXd log_prior, log_likelihood, recent;
  FilterBank bank;
};

// Runs the proposals' filters over all samples; `recent` is their log-likelihood from equal_at on.
void run_over_samples(const RecursivePosterior& posterior, const NoiseProblem& problem,
                      Proposals& proposals) {
  const Index m = proposals.draws.cols();
  for (Index i = 0; i < m; ++i) {
    // A proposal outside the prior runs along in its predecessor's place, and is not looked at.
    if (proposals.log_prior[i] > -kInfinity) {
      place(problem, proposals.draws.col(i), proposals.bank, i, proposals.log_likelihood[i]);
    } else {
      proposals.log_likelihood[i] = -kInfinity;
    }
  }
  // What was seen before the first sample belongs to the first draws' weights.
  if (posterior.renewals == 0) {
    proposals.recent = proposals.log_likelihood;
  } else {
    proposals.recent.setZero();
  }
  VectorXd density(m);
  for (Index t = 0; t < posterior.samples; ++t) {
    step(proposals.bank, posterior.y.col(t), posterior.u.col(t), density);
    proposals.log_likelihood += density;
    if (t >= posterior.equal_at) proposals.recent += density;
  }
}

// One round of Metropolis steps towards the posterior in which the samples since equal_at count
// `temperature` times. @return the share accepted
double move_all(RecursivePosterior& posterior, const NoiseProblem& problem, double temperature,
                double scale, const MatrixXd& factor, Proposals& proposals) {
  const Index m = posterior.draws.cols(), d = posterior.draws.rows();
  VectorXd threshold(m);
  for (Index i = 0; i < m; ++i) {
    proposals.draws.col(i) = posterior.draws.col(i) + scale * (factor * posterior.random.normal(d));
    proposals.log_prior[i] = problem.log_prior(proposals.draws.col(i));
    threshold[i] = std::log(posterior.random.uniform());
  }
  run_over_samples(posterior, problem, proposals);
  Index accepted = 0;
  for (Index i = 0; i < m; ++i) {
    // Samples before equal_at count once, those since then `temperature` times.
    const double here = posterior.log_prior[i] + posterior.log_likelihood[i] +
                        (temperature - 1.0) * posterior.log_weight[i];
    const double there = proposals.log_prior[i] + proposals.log_likelihood[i] +
                         (temperature - 1.0) * proposals.recent[i];
    if (!(proposals.log_likelihood[i] > -kInfinity) || !(there - here > threshold[i])) continue;
    posterior.draws.col(i) = proposals.draws.col(i);
    posterior.log_prior[i] = proposals.log_prior[i];
    posterior.log_likelihood[i] = proposals.log_likelihood[i];
    posterior.log_weight[i] = proposals.recent[i];
    copy_member(proposals.bank, i, posterior.bank, i);
    ++accepted;
  }
  return static_cast<double>(accepted) / static_cast<double>(m);
}

void keep(RecursivePosterior& posterior, const std::vector<Index>& kept) {
  const FilterBank before = posterior.bank;
  for (std::size_t i = 0; i < kept.size(); ++i) {
    copy_member(before, kept[i], posterior.bank, static_cast<Index>(i));
  }
  posterior.draws = MatrixXd(posterior.draws(Eigen::all, kept));
  posterior.log_prior = VectorXd(posterior.log_prior(kept));
  posterior.log_likelihood = VectorXd(posterior.log_likelihood(kept));
  posterior.log_weight = VectorXd(posterior.log_weight(kept));
}

// Starting a filter counts as a few samples.
constexpr Index kSamplesOfAStart = 20;

bool may_work_on(const RecursivePosterior& posterior) {
  constexpr Index kPerSample = 300;
  return posterior.work <
         kPerSample * (posterior.samples_before + posterior.samples + kSamplesOfAStart);
}

// Makes the draws equally likely: by stages, where the last samples have left but a few of them.
void renew(RecursivePosterior& posterior, const NoiseProblem& problem) {
  constexpr double kEnough = 0.2;  // share of effective draws that one stage may leave
  constexpr double kMoves = 2.0;   // accepted by every draw, on average
  constexpr int kMostRounds = 12;
  const Index m = posterior.draws.cols();
  Proposals proposals{posterior.draws, VectorXd(m), VectorXd(m), VectorXd(m), posterior.bank};
  double temperature = 0.0;
  double scale = 2.38 / std::sqrt(static_cast<double>(posterior.draws.rows()));
  while (temperature < 1.0) {
    const double left = 1.0 - temperature;
    const bool at_once = effective_share(tempered_weights(posterior.log_weight, left)) >= kEnough;
    const double rise = at_once ? left : next_step(posterior.log_weight, left);
    const bool rises = temperature + rise > temperature;
    if (!may_work_on(posterior) || !rises) {
      keep(posterior, resampled(tempered_weights(posterior.log_weight, left), posterior.random));
      ++posterior.left_behind;
      break;
    }
    keep(posterior, resampled(tempered_weights(posterior.log_weight, rise), posterior.random));
    temperature = rise >= left ? 1.0 : temperature + rise;
    const MatrixXd factor = spread(posterior.draws);
    double accepted = 0.0;
    for (int round = 0; round < kMostRounds && accepted < kMoves; ++round) {
      const double rate = move_all(posterior, problem, temperature, scale, factor, proposals);
      accepted += rate;
      posterior.work += posterior.samples + kSamplesOfAStart;
      scale *= std::clamp(std::exp(rate - 0.3), 0.6, 1.6);
    }
  }
  posterior.log_weight.setZero();
  posterior.equal_at = posterior.samples;
  ++posterior.renewals;
}

void remember(RecursivePosterior& posterior, const Eigen::Ref<const VectorXd>& y,
              const Eigen::Ref<const VectorXd>& u) {
  if (posterior.samples == posterior.y.cols()) {
    const Index room = std::max<Index>(256, 2 * posterior.samples);
    posterior.y.conservativeResize(y.size(), room);
    posterior.u.conservativeResize(u.size(), room);
  }
  posterior.y.col(posterior.samples) = y;
  posterior.u.col(posterior.samples) = u;
  ++posterior.samples;
}

}  // namespace

RecursivePosterior start_posterior(const NoiseProblem& problem, Index draws, std::uint64_t seed) {
  RecursivePosterior out;
  out.random = Random(seed);
  out.bank = filter_bank(problem.shared, draws);
  out.log_weight = VectorXd::Zero(draws);
  out.log_likelihood.resize(draws);
  out.log_prior.resize(draws);
  for (Index i = 0; i < draws; ++i) {
    const VectorXd x = problem.draw_prior(out.random);
    if (i == 0) out.draws.resize(x.size(), draws);
    out.draws.col(i) = x;
    out.log_prior[i] = problem.log_prior(x);
    place(problem, x, out.bank, i, out.log_likelihood[i]);
  }
  // What was seen before the first sample weighs as well.
  out.log_weight = out.log_likelihood;
  return out;
}

void weights(const RecursivePosterior& posterior, VectorXd& out) {
  tempered_weights(posterior.log_weight, 1.0, out);
  out /= out.sum();
}

VectorXd weights(const RecursivePosterior& posterior) {
  VectorXd out;
  weights(posterior, out);
  return out;
}

double observe(RecursivePosterior& posterior, const NoiseProblem& problem,
               const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
  VectorXd& density = posterior.density;
  weights(posterior, posterior.before);
  density.resize(posterior.draws.cols());
  step(posterior.bank, y, u, density);
  const double largest = density.maxCoeff();
  if (!(largest > -kInfinity)) return -kInfinity;
  posterior.log_weight += density;
  posterior.log_likelihood += density;
  density = (density.array() - largest).exp();
  const double mean = posterior.before.dot(density);
  if (density.size() == 1) return largest + std::log(mean);  // there is nothing to move
  remember(posterior, y, u);
  tempered_weights(posterior.log_weight, 1.0, posterior.share);
  if (effective_share(posterior.share) < 0.5) renew(posterior, problem);
  return largest + std::log(mean);
}

}  // namespace identikal
