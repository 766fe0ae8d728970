#include "identify/shooting/shooting.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "identify/shooting/internal/attempt.h"
#include "solvers/parallel.h"

namespace identikal {
namespace {

constexpr double kAgreement = 0.8;  // of the starts: as many make no other path necessary
constexpr double kFar = 2.0;        // errors this many times the best's are of another place

using Eigen::Index;
using Eigen::VectorXd;

using Attempts = std::vector<std::unique_ptr<Attempt>>;

// Per attempt the first one that has led to the same place, or itself.
std::vector<int> same_places(const Attempts& attempts) {
  std::vector<int> out;
  for (std::size_t i = 0; i < attempts.size(); ++i) {
    int same = static_cast<int>(i);
    for (std::size_t j = 0; j < i && same == static_cast<int>(i); ++j) {
      const bool leads = out[j] == static_cast<int>(j);
      if (leads && attempts[i]->meets(*attempts[j])) same = static_cast<int>(j);
    }
    out.push_back(same);
  }
  return out;
}

std::size_t lowest(const Attempts& attempts) {
  const auto less = [](const auto& a, const auto& b) { return a->loss() < b->loss(); };
  return static_cast<std::size_t>(std::min_element(attempts.begin(), attempts.end(), less) -
                                  attempts.begin());
}

// The beginning of each recording; none where that is too little for the unknowns.
std::vector<Dataset> beginnings(const std::vector<Dataset>& recordings, double share,
                                Index unknowns) {
  constexpr double kPerUnknown = 5.0;
  std::vector<Dataset> out;
  Index measured = 0;
  for (const Dataset& data : recordings) {
    const auto rows = static_cast<Index>(std::ceil(share * static_cast<double>(data.size())));
    out.push_back(first_samples(data, rows));
    measured += (out.back().y.array() == out.back().y.array()).count();
  }
  if (static_cast<double>(measured) < kPerUnknown * static_cast<double>(unknowns)) out.clear();
  return out;
}

void follow_path(Attempt& attempt, const std::function<bool()>& go_on) {
  attempt.begin_path();
  while (go_on() && attempt.next_stage()) {
  }
  if (go_on()) attempt.search_from_path();
}

// From the candidates, and by the path where that does not follow about as closely as this.
// @param error  Attempt::error()
void search_closely(Attempt& attempt, double error, const std::function<bool()>& go_on) {
  constexpr double kAsClosely = 1.3;
  attempt.search_from_candidates();
  if (!(attempt.error() < kAsClosely * error)) follow_path(attempt, go_on);
}

// Where growing parts of the recordings lead: from the candidates on the shortest, from there on the
// next. Null where that is nowhere, or where the parts are too short.
std::unique_ptr<Attempt> by_parts(const Model& model, const std::vector<Dataset>& recordings,
                                  const std::vector<ParameterSet>& candidates,
                                  const std::function<bool()>& go_on) {
  const Index unknowns = free_entries(candidates.front()).size();
  std::vector<ParameterSet> from = candidates;
  double error = 0.0;
  for (const double share : {0.125, 0.25, 0.5}) {
    const std::vector<Dataset> parts = beginnings(recordings, share, unknowns);
    if (parts.empty()) continue;
    Attempt attempt(model, parts, from);
    search_closely(attempt, error, go_on);
    if (!go_on() || !std::isfinite(attempt.loss())) return nullptr;
    attempt.refine();
    error = attempt.error();
    from = {attempt.end().parameters};
  }
  if (error == 0.0) return nullptr;  // no part was long enough
  auto out = std::make_unique<Attempt>(model, recordings, from);
  search_closely(*out, error, go_on);
  return out;
}

// Several starts at a time, until told to stop.
class SeveralAttempts {
 public:
  SeveralAttempts(const Model& model, const std::vector<Dataset>& recordings,
                  const std::vector<std::vector<ParameterSet>>& candidates,
                  const ShootingOptions& options)
      : model_(model),
        recordings_(recordings),
        candidates_(candidates),
        options_(options),
        attempts_(candidates.size()),
        by_parts_(candidates.size(), 0) {
    for_each([&](std::unique_ptr<Attempt>& attempt, int i) {
      const std::vector<ParameterSet>& from = candidates[static_cast<std::size_t>(i)];
      attempt = std::make_unique<Attempt>(model, recordings, from);
      if (go_on(i)) attempt->search_from_candidates();
    });
    refine_lowest();
  }

  // The path for all that are not at the best place, where too few are.
  void follow_paths() {
    for_those_elsewhere([&](std::unique_ptr<Attempt>& attempt, int i) {
      follow_path(*attempt, [&] { return go_on(i); });
    });
  }

  // Parts of the recordings that grow, for the same.
  void grow_recordings() {
    for_those_elsewhere([&](std::unique_ptr<Attempt>& attempt, int i) {
      if (attempt->is_confirmed() && attempts_.size() == 1) return;
      const auto start = static_cast<std::size_t>(i);
      std::unique_ptr<Attempt> other =
          by_parts(model_, recordings_, candidates_[start], [&] { return go_on(i); });
      if (!other || !other->is_below(*attempt)) return;
      attempt = std::move(other);
      by_parts_[start] = 1;
    });
  }

  const Attempts& all() const { return attempts_; }
  bool is_by_parts(std::size_t start) const { return by_parts_[start] != 0; }

 private:
  template <typename Task>
  void for_those_elsewhere(const Task& task) {
    const std::vector<int> same = same_places(attempts_);
    const int best = same[lowest(attempts_)];
    const auto agree = static_cast<double>(std::count(same.begin(), same.end(), best));
    const bool alone = attempts_.size() == 1;
    if (agree >= kAgreement * static_cast<double>(attempts_.size()) && !alone) return;
    for_each([&](std::unique_ptr<Attempt>& attempt, int i) {
      if (alone || same[static_cast<std::size_t>(i)] != best) task(attempt, i);
    });
    refine_lowest();
  }

  template <typename Task>
  void for_each(const Task& task) {
    in_parallel(static_cast<int>(attempts_.size()), options_.threads,
                [&](int i) { task(attempts_[static_cast<std::size_t>(i)], i); });
  }

  bool go_on(int start) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Attempt& attempt = *attempts_[static_cast<std::size_t>(start)];
    stopped_ = stopped_ || (options_.progress &&
                            !options_.progress(start, attempt.iterations(), attempt.loss()));
    return !stopped_;
  }

  // Those that may be at the best place; of those that are together, one.
  void refine_lowest() {
    const std::size_t at = lowest(attempts_);
    if (!go_on(static_cast<int>(at))) return;
    attempts_[at]->refine();
    const Attempt& best = *attempts_[at];
    for_each([&](std::unique_ptr<Attempt>& attempt, int i) {
      const bool may_be_best = attempt->worse_than(best.loss()) < kFar && !attempt->meets(best);
      if (may_be_best && go_on(i)) attempt->refine();
    });
  }

  const Model& model_;
  const std::vector<Dataset>& recordings_;
  const std::vector<std::vector<ParameterSet>>& candidates_;
  const ShootingOptions& options_;
  Attempts attempts_;
  std::vector<char> by_parts_;  // of each: growing parts of the recordings have led it
  std::mutex mutex_;
  bool stopped_ = false;
};

bool has_no_noise_but_of_outputs(const StateSpace& matrices) {
  return matrices.Q.isZero(0.0) && matrices.P0.isZero(0.0) && matrices.R.isDiagonal(0.0);
}

}  // namespace

bool allows_multiple_shooting(const Model& model, const std::vector<Dataset>& recordings) {
  if (!is_formula_model(model) || as_formulas(model).linear) return false;
  if (as_formulas(model).noise_scales) return false;
  const LinearModel& noise = as_formulas(model).noise;
  if (noise.initial != InitialState::given || as_formulas(model).equations.states == 0) {
    return false;
  }
  const std::vector<StateSpace> by = model_derivatives(noise, model.parameters);
  if (!has_no_noise_but_of_outputs(written_matrices(noise, model.parameters)) ||
      !std::all_of(by.begin(), by.end(), has_no_noise_but_of_outputs)) {
    return false;
  }
  const bool own_starts = std::any_of(
      recordings.begin(), recordings.end(),
      [](const Dataset& data) { return data.start_mean.size() > 0 || !data.own.empty(); });
  return !own_starts && !recordings.empty() && TrajectoryProblem(model, recordings).moves_states();
}

VectorXd known_output_sd(const Model& model) {
  if (!is_formula_model(model) || as_formulas(model).linear || as_formulas(model).noise_scales) {
    return {};
  }
  const LinearModel& noise = as_formulas(model).noise;
  const StateSpace written = written_matrices(noise, model.parameters);
  const std::vector<StateSpace> by = model_derivatives(noise, model.parameters);
  const bool known = std::all_of(by.begin(), by.end(), [](const StateSpace& each) {
    return has_no_noise_but_of_outputs(each) && each.R.isZero(0.0);
  });
  if (!known || !has_no_noise_but_of_outputs(written)) return {};
  return written.R.diagonal().cwiseSqrt();
}

std::vector<ShootingEnd> shoot(const Model& model, const std::vector<Dataset>& recordings,
                               const std::vector<std::vector<ParameterSet>>& candidates,
                               const ShootingOptions& options) {
  if (!allows_multiple_shooting(model, recordings) ||
      std::any_of(candidates.begin(), candidates.end(), [](const auto& c) { return c.empty(); })) {
    throw std::invalid_argument(
        "shooting: expected formulas without process noise, recordings, and candidates");
  }
  if (candidates.empty()) return {};
  SeveralAttempts attempts(model, recordings, candidates, options);
  attempts.follow_paths();
  attempts.grow_recordings();
  const std::vector<int> same = same_places(attempts.all());
  std::vector<ShootingEnd> out;
  for (std::size_t i = 0; i < same.size(); ++i) {
    out.push_back(attempts.all()[i]->end());
    out.back().same_as = same[i];
    out.back().by_parts = attempts.is_by_parts(i);
  }
  return out;
}

}  // namespace identikal
