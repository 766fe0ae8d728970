#include "identify/noise/noise_tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/internal/change_test.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/filter/kalman.h"
#include "lib/filter/online_filter.h"
#include "solvers/recursive_posterior.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The filter is a bank of one shared A, C: only noise may be free.
const Model& with_free_noise_alone(const Model& model) {
  const std::vector<StateSpace> derivatives = model_derivatives(as_linear(model), model.parameters);
  const ReportedEntries entries = reported_entries(model.parameters);
  std::size_t free = 0;
  for (std::size_t e = 0; e < entries.names.size(); ++e) {
    if (model.parameters[entries.parameter[e]].fixed) continue;
    const StateSpace& d = derivatives[free++];
    if (!changes_dynamics(d) && !changes_start(d)) continue;
    throw InputError(
        {model.source, 0, 0}, fmt::format("'{}' is free and is not noise", entries.names[e]),
        "'track' follows Q, R and S of a known model", "fix it, or estimate it with 'tune'");
  }
  return model;
}

NoiseProblem learning_problem(const Model& model, const ParameterPrior& prior,
                              std::function<FilterStart(const StateSpace&)> start) {
  NoiseProblem problem;
  problem.shared = instantiate(as_linear(model), model.parameters);
  problem.draw_prior = [&prior](Random& random) { return prior.draw(random); };
  problem.log_prior = [&prior](const VectorXd& x) { return prior.log_density(x); };
  problem.noise = [&model, &prior](const VectorXd& x) {
    return instantiate(as_linear(model),
                       with_entries(model.parameters, entries_at(prior, model.parameters, x)));
  };
  problem.start = std::move(start);
  return problem;
}

// The file's own noise: one draw, without coordinates.
NoiseProblem known_problem(const Model& model,
                           std::function<FilterStart(const StateSpace&)> start) {
  NoiseProblem problem;
  problem.shared = instantiate(as_linear(model), model.parameters);
  problem.draw_prior = [](Random&) { return VectorXd(0); };
  problem.log_prior = [](const VectorXd&) { return 0.0; };
  problem.noise = [&model](const VectorXd&) {
    return instantiate(as_linear(model), model.parameters);
  };
  problem.start = std::move(start);
  return problem;
}

MatrixXd entries_of_draws(const Model& model, const ParameterPrior& prior,
                          const RecursivePosterior& posterior) {
  const VectorXd own = free_entries(model.parameters);
  MatrixXd out(own.size(), posterior.draws.cols());
  for (Index i = 0; i < out.cols(); ++i) {
    out.col(i) = posterior.draws.rows() == 0
                     ? own
                     : entries_at(prior, model.parameters, posterior.draws.col(i));
  }
  return out;
}

// Columns that belong to consecutive samples; the first are forgotten where nobody asks for them.
class RecentColumns {
 public:
  void keep(Index sample, const Eigen::Ref<const VectorXd>& column) {
    if (held_ == 0) first_ = sample;
    if (held_ == columns_.cols()) {
      columns_.conservativeResize(column.size(), std::max<Index>(256, 2 * held_));
    }
    columns_.col(held_++) = column;
  }
  // What is forgotten gives its room only when that is worth moving the others.
  void forget_before(Index sample) {
    const Index gone = std::min(sample - first_, held_);
    if (gone <= held_ / 2) return;
    for (Index k = gone; k < held_; ++k) columns_.col(k - gone) = columns_.col(k);
    first_ += gone;
    held_ -= gone;
  }
  auto at(Index sample) const { return columns_.col(sample - first_); }

 private:
  MatrixXd columns_;
  Index first_ = 0, held_ = 0;
};

// Room for what a sample makes of the mixture's prediction.
struct Workspace {
  std::vector<Index> present;
  VectorXd white;       // ny
  MatrixXd PC, L, PCL;  // n x ny, ny x ny, ny x n: P C', factor of Sigma, L^-1 C P
};

}  // namespace

// The posterior of the noise as samples arrive, begun again where a change is found.
class NoiseTracker::Learner {
 public:
  Learner(const Model& model, const NoiseTrackOptions& options)
      : model_(with_free_noise_alone(model)),
        options_(options),
        prior_(parameter_prior(model)),
        random_(options.seed),
        own_(instantiate(as_linear(model_), model_.parameters)),
        early_(start_online_filter(own_, as_linear(model_).initial)) {
    make_room();
    if (!early_.diffuse) begin();
  }

  bool step(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
    if (y.size() != own_.outputs() || u.size() != own_.inputs()) {
      throw std::invalid_argument(
          fmt::format("a sample has {} outputs and {} inputs; expected {} and {}", y.size(),
                      u.size(), own_.outputs(), own_.inputs()));
    }
    if (!u.allFinite() || y.array().isInf().any()) return false;
    now_.change.reset();
    const bool taken = lead_ ? take(y, u) : wait(y, u);
    ++samples_;
    return taken;
  }

  const NoiseTrackSample& now() const { return now_; }
  const StateSpace& model() const { return own_; }
  std::optional<Index> lead() const { return lead_; }

  PosteriorPoints posterior() const {
    PosteriorPoints out;
    out.entries = entries_;
    out.coordinates = posterior_.draws;
    out.weight = weights(posterior_);
    out.log_density = posterior_.log_prior + posterior_.log_likelihood;
    out.effective = 1.0 / out.weight.squaredNorm();
    out.summary.iterations = posterior_.renewals;
    out.left_behind = posterior_.left_behind;
    return out;
  }

 private:
  void make_room() {
    const Index n = own_.states(), ny = own_.outputs(), k = free_entries(model_.parameters).size();
    now_.mean = free_entries(model_.parameters);
    now_.sd = VectorXd::Constant(k, kNaN);
    now_.log_alarm = -kInfinity;
    now_.x_pred = now_.state = now_.state_sd = VectorXd::Zero(n);
    now_.P_pred = MatrixXd::Zero(n, n);
    now_.Sigma = room_.L = MatrixXd::Zero(ny, ny);
    now_.e = now_.standardised = VectorXd::Constant(ny, kNaN);
    room_.white = VectorXd::Zero(ny);
    room_.PC = MatrixXd::Zero(n, ny);
    room_.PCL = MatrixXd::Zero(ny, n);
    room_.present.reserve(static_cast<std::size_t>(ny));
  }

  // A sample of those that a diffuse start takes to determine the state. One noise is in use: the
  // ordinary filter says what there is to say.
  bool wait(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
    if (!identikal::step(early_, y, u)) return false;
    now_.state = early_.state;
    now_.state_sd = early_.state_sd;
    now_.log_density = 0.0;
    const Index t = samples_;
    early_y_.conservativeResize(own_.outputs(), t + 2);
    early_u_.conservativeResize(own_.inputs(), t + 2);
    early_y_.col(t) = y;
    early_u_.col(t) = u;
    // The sample that comes next, of which nothing is known yet.
    early_y_.col(t + 1).setConstant(kNaN);
    early_u_.col(t + 1).setZero();
    if (y.array().isNaN().all()) return true;
    const FilterResult filter =
        kalman_filter(own_, as_linear(model_).initial, early_y_, early_u_, Keep::innovations);
    if (filter.status == FilterStatus::ok && filter.first_proper > 0 &&
        filter.first_proper <= t + 1) {
      begin();
    }
    return filter.status == FilterStatus::ok || filter.status == FilterStatus::undetermined;
  }

  // A filter of this noise after the samples that determine the state.
  FilterStart start_of_recording(const StateSpace& noise) const {
    const Index n = noise.states(), lead = *lead_;
    const FilterResult filter = kalman_filter(noise, as_linear(model_).initial, early_y_, early_u_);
    if (filter.status != FilterStatus::ok) {
      return {VectorXd::Zero(n), MatrixXd::Zero(n, n), -kInfinity};
    }
    return {filter.x_pred.col(lead), filter.P_pred.back(), filter.log_likelihood};
  }

  void begin() {
    lead_ = early_y_.cols() > 0 ? early_y_.cols() - 1 : 0;
    if (*lead_ == 0) {
      early_y_ = MatrixXd::Constant(own_.outputs(), 1, kNaN);
      early_u_ = MatrixXd::Zero(own_.inputs(), 1);
    }
    const auto at_start = [this](const StateSpace& noise) { return start_of_recording(noise); };
    problem_ = options_.adaptive ? known_problem(model_, at_start)
                                 : learning_problem(model_, prior_, at_start);
    posterior_ = start_posterior(problem_, options_.adaptive ? 1 : options_.draws, options_.seed);
    entries_ = entries_of_draws(model_, prior_, posterior_);
    weights(posterior_, weight_);
    summarise();
    if (!options_.adaptive) return;
    log_threshold_ = std::log(options_.samples_per_false_alarm);
    test_.emplace(model_, prior_, at_start, log_threshold_, random_);
    mixture(posterior_.bank, weight_, ahead_);
    test_->centre_on(model_.parameters, ahead_);
  }

  bool take(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
    mixture(posterior_.bank, weight_, ahead_);
    predict(y, u);
    if (test_) remember(y, u);
    const int renewals = posterior_.renewals;
    now_.log_density = learn(y, u);
    if (!(now_.log_density > -kInfinity)) return false;
    if (test_) look_for_change(y, u, posterior_.renewals != renewals);
    weights(posterior_, weight_);
    summarise();
    return true;
  }

  // What the mixture of filters says ahead of the sample, and what the sample makes of it.
  void predict(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
    const MatrixXd& P = now_.P_pred = ahead_.P;
    now_.x_pred = ahead_.x;
    room_.PC.noalias() = P * own_.C.transpose();
    now_.Sigma = ahead_.R;
    now_.Sigma.noalias() += own_.C * room_.PC;
    now_.e = y;
    now_.e.noalias() -= own_.C * now_.x_pred;
    now_.e.noalias() -= own_.D * u;
    now_.standardised.setConstant(kNaN);
    now_.state = now_.x_pred;
    now_.state_sd = P.diagonal();
    room_.present.clear();
    for (Index j = 0; j < y.size(); ++j) {
      if (!std::isnan(y[j])) room_.present.push_back(j);
    }
    if (!room_.present.empty()) update_state();
    now_.state_sd = now_.state_sd.cwiseMax(0.0).cwiseSqrt();
  }

  // By the channels present; a covariance that is not positive definite leaves the prediction.
  void update_state() {
    const auto m = static_cast<Index>(room_.present.size());
    auto L = room_.L.topLeftCorner(m, m);
    auto white = room_.white.head(m);
    auto PCL = room_.PCL.topRows(m);
    for (Index j = 0; j < m; ++j) {
      const Index channel = room_.present[static_cast<std::size_t>(j)];
      for (Index i = 0; i < m; ++i) {
        L(i, j) = now_.Sigma(room_.present[static_cast<std::size_t>(i)], channel);
      }
      white[j] = now_.e[channel];
      PCL.row(j) = room_.PC.col(channel).transpose();
    }
    Eigen::Ref<MatrixXd> in_place(L);
    const Eigen::LLT<Eigen::Ref<MatrixXd>> factor(in_place);
    if (factor.info() != Eigen::Success) return;
    factor.matrixL().solveInPlace(white);
    factor.matrixL().solveInPlace(PCL);
    for (Index j = 0; j < m; ++j) {
      now_.standardised[room_.present[static_cast<std::size_t>(j)]] = white[j];
    }
    now_.state.noalias() += PCL.transpose() * white;
    now_.state_sd -= PCL.colwise().squaredNorm().transpose();
  }

  // What a change that is found later may have to begin with.
  void remember(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
    kept_y_.keep(samples_, y);
    kept_u_.keep(samples_, u);
    kept_x_.keep(samples_, now_.x_pred);
    kept_P_.keep(samples_, Eigen::Map<const VectorXd>(now_.P_pred.data(), now_.P_pred.size()));
  }

  void summarise() {
    now_.mean.noalias() = entries_ * weight_;
    if (entries_.cols() == 1) {
      now_.sd.setConstant(kNaN);
      return;
    }
    for (Index i = 0; i < entries_.rows(); ++i) {
      double variance = 0.0;
      for (Index j = 0; j < entries_.cols(); ++j) {
        const double away = entries_(i, j) - now_.mean[i];
        variance += weight_[j] * away * away;
      }
      now_.sd[i] = std::sqrt(variance);
    }
  }

  // Takes a sample into the posterior. @return its log-density
  double learn(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
    const int before = posterior_.renewals;
    const double density = observe(posterior_, problem_, y, u);
    if (posterior_.renewals != before) entries_ = entries_of_draws(model_, prior_, posterior_);
    return density;
  }

  // @param moved  whether the draws are new since the sample before
  void look_for_change(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u,
                       bool moved) {
    now_.log_alarm = test_->observe(samples_, y, u, now_.log_density);
    if (now_.log_alarm > log_threshold_) {
      start_again(test_->since());
      test_->restart();
      moved = true;
    }
    const Index asked_for = test_->earliest_since(samples_ + 1);
    for (RecentColumns* each : {&kept_y_, &kept_u_, &kept_x_, &kept_P_}) {
      each->forget_before(asked_for);
    }
    if (!moved) return;
    weights(posterior_, weight_);
    mixture(posterior_.bank, weight_, ahead_);
    test_->centre_on(with_entries(model_.parameters, entries_ * weight_), ahead_);
  }

  // A new posterior that learns from the samples since the change on.
  void start_again(Index since) {
    now_.change = {since, samples_};
    ++changes_;
    const Index n = own_.states();
    // The old filter does not know how far the new noise has driven the state by then.
    const FilterStart from{kept_x_.at(since),
                           kept_P_.at(since).reshaped(n, n) + test_->state_covariance(), 0.0};
    problem_ = learning_problem(model_, prior_, [from](const StateSpace&) { return from; });
    const Index work = posterior_.work;
    const int left_behind = posterior_.left_behind;
    posterior_ = start_posterior(problem_, options_.draws, options_.seed + changes_);
    posterior_.work = work;
    posterior_.left_behind = left_behind;
    posterior_.samples_before = since;
    entries_ = entries_of_draws(model_, prior_, posterior_);
    for (Index s = since; s <= samples_; ++s) learn(kept_y_.at(s), kept_u_.at(s));
  }

  const Model model_;
  const NoiseTrackOptions options_;
  const ParameterPrior prior_;
  Random random_;
  const StateSpace own_;
  OnlineFilter early_;
  MatrixXd early_y_, early_u_;  // up to lead_, and one sample more
  std::optional<Index> lead_;
  Index samples_ = 0;
  NoiseProblem problem_;
  RecursivePosterior posterior_;
  MatrixXd entries_;  // of the draws
  VectorXd weight_;
  Mixture ahead_;  // of the next sample
  std::optional<ChangeTest> test_;
  double log_threshold_ = 0.0;
  std::uint64_t changes_ = 0;
  RecentColumns kept_y_, kept_u_, kept_x_, kept_P_;
  NoiseTrackSample now_;
  Workspace room_;
};

NoiseTracker::NoiseTracker(const Model& model, const NoiseTrackOptions& options)
    : learner_(std::make_unique<Learner>(model, options)) {}
NoiseTracker::NoiseTracker(NoiseTracker&&) noexcept = default;
NoiseTracker& NoiseTracker::operator=(NoiseTracker&&) noexcept = default;
NoiseTracker::~NoiseTracker() = default;

bool NoiseTracker::step(const Eigen::Ref<const VectorXd>& y, const Eigen::Ref<const VectorXd>& u) {
  return learner_->step(y, u);
}
const NoiseTrackSample& NoiseTracker::now() const { return learner_->now(); }
const StateSpace& NoiseTracker::model() const { return learner_->model(); }
std::optional<Index> NoiseTracker::lead() const { return learner_->lead(); }
PosteriorPoints NoiseTracker::posterior() const { return learner_->posterior(); }

}  // namespace identikal
