#include "identify/noise/track.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/parameter_prior.h"
#include "identify/noise/estimate.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/statistics/sequential_probability_ratio.h"
#include "solvers/recursive_posterior.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The filter is a bank of one shared A, C: only noise may be free.
void refuse_free_dynamics(const Model& model) {
  const std::vector<StateSpace> derivatives = model_derivatives(as_linear(model), model.parameters);
  const ReportedEntries entries = reported_entries(model.parameters);
  std::size_t free = 0;
  for (std::size_t e = 0; e < entries.names.size(); ++e) {
    if (model.parameters[entries.parameter[e]].fixed) continue;
    const StateSpace& d = derivatives[free++];
    if (!changes_dynamics(d) && d.x0.isZero(0.0) && d.P0.isZero(0.0)) continue;
    throw InputError(
        {model.source, 0, 0}, fmt::format("'{}' is free and is not noise", entries.names[e]),
        "'track' follows Q, R and S of a known model", "fix it, or estimate it with 'tune'");
  }
}

// A recording as every filter of the bank sees it.
struct Samples {
  const Dataset& data;
  MatrixXd u;
  Index lead = 0;  // samples that a diffuse start takes to determine the state
};

FilterStart start_of_recording(const Model& model, const Samples& samples,
                               const StateSpace& system) {
  MatrixXd y = samples.data.y.leftCols(samples.lead + 1);
  y.col(samples.lead).setConstant(kNone);
  const FilterResult filter =
      kalman_filter(system, as_linear(model).initial, y, samples.u.leftCols(samples.lead + 1));
  if (filter.status != FilterStatus::ok) {
    return {VectorXd::Zero(system.states()), MatrixXd::Zero(system.states(), system.states()),
            -kInfinity};
  }
  return {filter.x_pred.col(samples.lead), filter.P_pred.back(), filter.log_likelihood};
}

Samples samples_of(const Model& model, const Dataset& data) {
  const LinearModel& linear = as_linear(model);
  Samples out{data, model_inputs(linear, data.u), 0};
  const FilterResult filter = kalman_filter(instantiate(linear, model.parameters), linear.initial,
                                            data.y, out.u, Keep::innovations);
  if (filter.status != FilterStatus::ok) refuse_filter(model, {data}, filter.status);
  out.lead = filter.first_proper;
  return out;
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

// The test for a change: filters with other noise, and Shiryaev-Roberts statistics of each.
class ChangeTest {
 public:
  ChangeTest(const Model& model, const ParameterPrior& prior, const Samples& samples,
             double threshold, Random& random)
      : model_(model), threshold_(threshold) {
    constexpr Index kFromPrior = 200;
    near_ = static_cast<Index>(neighbours(model.parameters).size());
    const Index members = near_ + kFromPrior;
    bank_ = filter_bank(instantiate(as_linear(model), model.parameters), members);
    for (Index i = near_; i < members; ++i) {
      const VectorXd x = prior.draw(random);
      const StateSpace noise = instantiate(
          as_linear(model), with_entries(model.parameters, entries_at(prior, model.parameters, x)));
      const FilterStart start = start_of_recording(model, samples, noise);
      set_noise(bank_, i, noise);
      set_state(bank_, i, start.x, start.P);
    }
    statistic_ = VectorXd::Constant(members, -kInfinity);
    sum_ = VectorXd::Zero(members);
    since_.assign(static_cast<std::size_t>(members), 0);
    log_share_.resize(members);
    log_share_.head(near_).setConstant(-std::log(2.0 * static_cast<double>(near_)));
    log_share_.tail(kFromPrior).setConstant(-std::log(2.0 * static_cast<double>(kFromPrior)));
    density_.resize(members);
  }

  // The alternatives nearby go with the present noise.
  void centre_on(const ParameterSet& present, const Mixture& state) {
    const std::vector<ParameterSet> sets = neighbours(present);
    for (Index i = 0; i < near_; ++i) {
      set_noise(bank_, i, instantiate(as_linear(model_), sets[i]));
      set_state(bank_, i, state.x, state.P);
    }
  }

  // Takes sample t, whose log-density under the present noise is given. @return log S
  double observe(Index t, const VectorXd& y, const VectorXd& u, double present) {
    const double most = threshold_ / 3.0;
    step(bank_, y, u, density_);
    for (Index i = 0; i < statistic_.size(); ++i) {
      const double evidence = std::min(density_[i] - present, most);
      double& S = statistic_[i];
      S = (S > 0.0 ? S + std::log1p(std::exp(-S)) : std::log1p(std::exp(S))) + evidence;
      // The most likely begin of a change into this noise is where its cumulative sum was lowest.
      if (!(sum_[i] > 0.0)) {
        sum_[i] = 0.0;
        since_[i] = t;
      }
      sum_[i] += evidence;
    }
    const VectorXd all = statistic_ + log_share_;
    const double largest = all.maxCoeff();
    return largest > -kInfinity ? largest + std::log((all.array() - largest).exp().sum())
                                : -kInfinity;
  }

  // When the change began: the latest begin that explains the samples about as well as any. An
  // early one draws samples of the old noise into what is learnt of the new.
  Index since() const {
    constexpr double kAsWell = 3.0;  // in log-likelihood
    const double most = sum_.maxCoeff();
    Index out = 0;
    for (Index i = 0; i < sum_.size(); ++i) {
      if (sum_[i] > most - kAsWell) out = std::max(out, since_[i]);
    }
    return out;
  }

  // Of the state's prediction under the noise that explains the change best.
  MatrixXd state_covariance() const {
    Index best = 0;
    sum_.maxCoeff(&best);
    return mixture(bank_, VectorXd::Unit(sum_.size(), best)).P;
  }

  void restart() {
    statistic_.setConstant(-kInfinity);
    sum_.setZero();
  }

 private:
  const Model& model_;
  double threshold_;
  Index near_ = 0;
  FilterBank bank_;
  VectorXd statistic_, sum_, log_share_, density_;
  std::vector<Index> since_;
};

// Stores what the mixture of filters says ahead of sample t.
void store_prediction(FilterResult& out, const StateSpace& shared, Index t, const Mixture& state,
                      const VectorXd& y, const VectorXd& u) {
  out.x_pred.col(t) = state.x;
  out.P_pred.push_back(state.P);
  const MatrixXd Sigma = shared.C * state.P * shared.C.transpose() + state.R;
  out.Sigma.push_back(Sigma);
  VectorXd e = y - shared.C * state.x;
  if (u.size() > 0) e -= shared.D * u;
  out.e.col(t) = e;
  std::vector<Index> present;
  for (Index j = 0; j < e.size(); ++j) {
    if (!std::isnan(e[j])) present.push_back(j);
  }
  const Eigen::LLT<MatrixXd> factor(MatrixXd(Sigma(present, present)));
  if (present.empty() || factor.info() != Eigen::Success) return;
  const VectorXd white = factor.matrixL().solve(VectorXd(e(present)));
  for (std::size_t j = 0; j < present.size(); ++j) {
    out.standardised(present[j], t) = white[j];
  }
}

// The same with the first samples alone.
void shorten(NoiseTrack& track, Index samples) {
  for (MatrixXd* each : {&track.mean, &track.sd, &track.filter.x_pred, &track.filter.e,
                         &track.filter.standardised}) {
    *each = each->leftCols(samples).eval();
  }
  track.log_alarm = track.log_alarm.head(samples).eval();
}

NoiseTrack empty_track(const Model& model, const Dataset& recording, Index lead,
                       double log_threshold) {
  const Index N = recording.size(), n = as_linear(model).A.constant.rows(), ny = recording.y.rows();
  const Index k = free_entries(model.parameters).size();
  NoiseTrack out;
  out.mean.resize(k, N);
  out.sd.resize(k, N);
  out.log_alarm = VectorXd::Constant(N, -kInfinity);
  out.log_threshold = log_threshold;
  out.filter.first_proper = lead;
  out.filter.x_pred = MatrixXd::Zero(n, N);
  out.filter.e = MatrixXd::Constant(ny, N, kNone);
  out.filter.standardised = out.filter.e;
  out.filter.P_pred.assign(static_cast<std::size_t>(lead), MatrixXd::Zero(n, n));
  out.filter.Sigma.assign(static_cast<std::size_t>(lead), MatrixXd::Zero(ny, ny));
  return out;
}

// The posterior of the noise as it goes through a recording, begun again where a change is found.
class Learner {
 public:
  Learner(const Model& model, const Dataset& recording, const NoiseTrackOptions& options)
      : model_(model),
        recording_(recording),
        options_(options),
        prior_(parameter_prior(model)),
        samples_(samples_of(model, recording)),
        random_(options.seed) {
    const auto at_start = [this](const StateSpace& noise) {
      return start_of_recording(model_, samples_, noise);
    };
    problem_ = options.adaptive ? known_problem(model, at_start)
                                : learning_problem(model, prior_, at_start);
    posterior_ = start_posterior(problem_, options.adaptive ? 1 : options.draws, options.seed);
    out_ = empty_track(model, recording, samples_.lead, std::log(options.samples_per_false_alarm));
    entries_ = entries_of_draws(model, prior_, posterior_);
    for (Index t = 0; t < samples_.lead; ++t) summarise(t);
    if (options.adaptive) {
      test_.emplace(model, prior_, samples_, out_.log_threshold, random_);
      test_->centre_on(model.parameters, mixture(posterior_.bank, weights(posterior_)));
    }
  }

  Index begin() const { return samples_.lead; }

  void take(Index t) {
    store_prediction(out_.filter, problem_.shared, t, mixture(posterior_.bank, weights(posterior_)),
                     recording_.y.col(t), samples_.u.col(t));
    const int renewals = posterior_.renewals;
    const double density = learn(t);
    if (!(density > -kInfinity)) refuse_filter(model_, {recording_}, FilterStatus::indefinite);
    out_.filter.log_likelihood += density;
    if (test_) look_for_change(t, density, posterior_.renewals != renewals);
    summarise(t);
  }

  // @param samples  taken so far  @param stopped  by the caller
  NoiseTrack finish(Index samples, bool stopped) {
    if (stopped) shorten(out_, samples);
    PosteriorPoints& end = out_.posterior;
    end.entries = entries_;
    end.coordinates = posterior_.draws;
    end.weight = weights(posterior_);
    end.log_density = posterior_.log_prior + posterior_.log_likelihood;
    end.log_evidence = out_.filter.log_likelihood;
    end.effective = 1.0 / end.weight.squaredNorm();
    end.summary.termination = stopped ? Termination::stopped : Termination::converged;
    if (stopped) {
      end.summary.message =
          fmt::format("stopped by the caller after {} of {} samples", samples, recording_.size());
    }
    end.summary.iterations = posterior_.renewals;
    return std::move(out_);
  }

 private:
  void summarise(Index t) {
    const VectorXd w = weights(posterior_);
    out_.mean.col(t) = entries_ * w;
    if (entries_.cols() > 1) {
      out_.sd.col(t) = ((entries_.colwise() - out_.mean.col(t)).cwiseAbs2() * w).cwiseSqrt();
    } else {
      out_.sd.col(t).setConstant(kNone);
    }
  }

  // Takes sample t into the posterior. @return its log-density
  double learn(Index t) {
    const int before = posterior_.renewals;
    const double density = observe(posterior_, problem_, recording_.y.col(t), samples_.u.col(t));
    if (posterior_.renewals != before) entries_ = entries_of_draws(model_, prior_, posterior_);
    return density;
  }

  // @param moved  whether the draws are new since the sample before
  void look_for_change(Index t, double density, bool moved) {
    out_.log_alarm[t] = test_->observe(t, recording_.y.col(t), samples_.u.col(t), density);
    if (out_.log_alarm[t] > out_.log_threshold) {
      start_again(test_->since(), t);
      test_->restart();
      moved = true;
    }
    if (!moved) return;
    const VectorXd w = weights(posterior_);
    test_->centre_on(with_entries(model_.parameters, entries_ * w), mixture(posterior_.bank, w));
  }

  // A new posterior that learns from the samples since the change on.
  void start_again(Index since, Index found) {
    out_.changes.push_back({since, found});
    // The old filter does not know how far the new noise has driven the state by then.
    const FilterStart from{out_.filter.x_pred.col(since),
                           out_.filter.P_pred[since] + test_->state_covariance(), 0.0};
    problem_ = learning_problem(model_, prior_, [from](const StateSpace&) { return from; });
    posterior_ = start_posterior(problem_, options_.draws, options_.seed + out_.changes.size());
    entries_ = entries_of_draws(model_, prior_, posterior_);
    for (Index s = since; s <= found; ++s) learn(s);
  }

  const Model& model_;
  const Dataset& recording_;
  const NoiseTrackOptions& options_;
  ParameterPrior prior_;
  Samples samples_;
  Random random_;
  NoiseProblem problem_;
  RecursivePosterior posterior_;
  MatrixXd entries_;  // of the draws
  NoiseTrack out_;
  std::optional<ChangeTest> test_;
};

}  // namespace

NoiseTrack track_noise(const Model& model, const Dataset& recording,
                       const NoiseTrackOptions& options) {
  refuse_free_dynamics(model);
  Learner learner(model, recording, options);
  const Index N = recording.size();
  Index taken = learner.begin();
  bool stopped = false;  // by the caller
  while (taken < N && !stopped) {
    learner.take(taken++);
    stopped = options.progress && !options.progress(taken, N);
  }
  return learner.finish(taken, stopped);
}

namespace {

// What Wald's sequential test says of the innovations along the way, decision after decision.
void report_whiteness(TrackedNoise& estimate, const FilterResult& filter) {
  SequentialProbabilityRatio test =
      start_sequential_probability_ratio(filter.standardised.rows(), {});
  int white = 0, coloured = 0;
  for (Index t = filter.first_proper; t < filter.standardised.cols(); ++t) {
    const SequentialDecision decision = update(test, filter.standardised.col(t));
    white += decision == SequentialDecision::white;
    coloured += decision == SequentialDecision::coloured;
  }
  estimate.notes.push_back(
      white + coloured == 0
          ? "the sequential test of whiteness has come to no decision"
          : fmt::format("sequential test of whiteness: {} times white, {} times coloured", white,
                        coloured));
}

// Innovations that are not as large as the filter takes them for, all along the recording.
Findings check_size(const TrackedNoise& estimate, bool adaptive) {
  Findings out;
  constexpr Index kEnough = 50;  // below, a mixture of filters has no chi-square
  for (const TestResult& test : estimate.tests) {
    if (test.id != "nis" || test.pass || estimate.series.time.size() < kEnough) continue;
    out.push_back(make_finding(
        FindingCode::innovation_size, {},
        fmt::format("the innovations are {:.3g} times as large (in variance) as the filter "
                    "predicts",
                    test.value),
        adaptive ? "the first samples of every new noise are among them; else widen the priors"
                 : "noise that changes during the recording: --adaptive; else widen the priors"));
  }
  return out;
}

}  // namespace

TrackedNoise track(const Model& given, const Dataset& whole, const NoiseTrackOptions& options) {
  const Model model = checked(given, {whole});
  check_recordings(model, {whole});
  const NoiseTrack course = track_noise(model, whole, options);
  const bool stopped = course.posterior.summary.termination == Termination::stopped;
  const Dataset recording = stopped ? first_samples(whole, course.mean.cols()) : whole;
  TrackedNoise estimate;
  estimate.model_name = model.name;
  estimate.objective.method = options.adaptive ? "adaptive" : "recursive";
  estimate.objective.log_likelihood = course.filter.log_likelihood;
  const PosteriorPoints& points = course.posterior;
  const bool learnt = points.coordinates.rows() > 0;
  if (learnt) {
    estimate.posterior = report_posterior(estimate, model, points, "recursive Monte Carlo");
    append(estimate.findings, check_priors(estimate, *estimate.posterior));
  } else {
    list_parameters(estimate, model.parameters, model.parameters);
    estimate.covariance_kind = "none: the noise of the model file was not rejected";
  }
  SolverSummary summary = points.summary;
  summary.termination = Termination::converged;  // what was learnt up to there stands
  const std::string more =
      learnt && options.adaptive
          ? fmt::format("; the noise was re-estimated {} time{}", course.changes.size(),
                        course.changes.size() == 1 ? "" : "s")
          : "";
  append(estimate.findings, check_search(estimate, summary, more));
  if (stopped) {
    estimate.findings.push_back(make_finding(FindingCode::stopped, {}, points.summary.message));
  }
  const ParameterSet end = with_entries(model.parameters, points.entries * points.weight);
  static_cast<FilterMatrices&>(estimate) = filter_matrices(model, end);
  report_innovations(estimate, {recording}, {course.filter});
  report_whiteness(estimate, course.filter);
  append(estimate.findings, check_innovations(estimate));
  append(estimate.findings, check_size(estimate, options.adaptive));
  if (course.changes.empty()) {
    append(estimate.findings, check_outliers_and_offset(model, end, {recording}, {course.filter}));
  }
  conclude(estimate, learnt ? "converged" + more
                            : fmt::format("the noise of the model file stands after {} samples",
                                          recording.size()));

  TimeHistory& report = estimate.time_history;
  const Index k = course.mean.rows();
  VectorXd unit(k);
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    unit[static_cast<Index>(report.names.size())] = unit_scale(p.unit);
    report.names.push_back(p.name);
    report.units.push_back(p.unit);
  }
  const VectorXd in_units = unit.cwiseInverse();
  report.mean = in_units.asDiagonal() * course.mean;
  report.sd = in_units.asDiagonal() * course.sd;
  report.log_alarm = VectorXd::Constant(recording.size(), kNone);
  if (options.adaptive) {
    report.log_alarm.tail(recording.size() - course.filter.first_proper) =
        course.log_alarm.tail(recording.size() - course.filter.first_proper);
    report.log_threshold = course.log_threshold;
  }
  for (std::size_t c = 0; c < course.changes.size(); ++c) {
    const NoiseChange& change = course.changes[c];
    const Index last =
        c + 1 < course.changes.size() ? course.changes[c + 1].found - 1 : recording.size() - 1;
    report.changes.push_back({recording.time[change.since], recording.time[change.found],
                              report.mean.col(std::max<Index>(change.found - 1, 0)),
                              report.mean.col(last)});
  }
  return estimate;
}

}  // namespace identikal
