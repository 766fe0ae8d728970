#include "identify/noise/internal/likelihood_intervals.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/noise/internal/interval_end.h"
#include "identify/noise/likelihood_profile.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"
#include "solvers/parallel.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// How the others go along when coordinate i moves by one, if they are free to.
VectorXd tangent(const Profiled& at, const VectorXd& x, const MatrixXd& information) {
  std::vector<Index> free;
  for (Index k = 0; k < x.size(); ++k) {
    const bool inside = x[k] > at.problem.lower[k] && x[k] < at.problem.upper[k];
    if (k != at.i && inside && information(k, k) > 0.0) free.push_back(k);
  }
  return along_with(at.i, free, information);
}

// The profile likelihood of one coordinate, along a path: each point begins where the information
// at the one before expects it.
class ProfilePath {
 public:
  explicit ProfilePath(const Profiled& at) : at_(at), held_(at.problem) {
    held_.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient,
                            MatrixXd* information) {
      if (!at_.problem.evaluate(x, L, gradient, information)) return false;
      if (information != nullptr) seen_x_ = x, seen_ = *information;
      return true;
    };
    restart();
  }
  ProfilePath(const ProfilePath&) = delete;
  ProfilePath& operator=(const ProfilePath&) = delete;

  void restart() {
    x_ = at_.x;
    information_ = at_.information;
  }

  // By how much the log-likelihood falls where the coordinate has this value.
  std::optional<double> drop(double value) {
    SolverOptions options;
    options.decrement_tolerance = 2e-4;  // what is left is added
    options.acceptable_decrement = 1e-3;
    options.max_iterations = 30;  // a path that needs more runs along what is not determined
    const Index i = at_.i;
    VectorXd start = x_ + (value - x_[i]) * tangent(at_, x_, information_);
    held_.lower[i] = held_.upper[i] = start[i] = value;
    start = start.cwiseMax(held_.lower).cwiseMin(held_.upper);
    Solution end = maximise(held_, start, options);
    if (end.summary.termination == Termination::start_undefined) {
      start = x_;
      start[i] = value;
      end = maximise(held_, start, options);
    }
    if (!end.summary.usable()) return std::nullopt;
    x_ = end.x;
    if (seen_x_ == x_) information_ = seen_;
    return std::max(0.0, at_.L - end.summary.objective - end.summary.expected_gain);
  }

 private:
  Profiled at_;
  LikelihoodProblem held_;
  VectorXd x_, seen_x_;
  MatrixXd information_, seen_;
};

// Where the drop reaches half of target^2, going out from the coordinate's value by `first`; the
// bound where it does not, or infinity where far out it does not grow any more: a curve that the
// recording shows the beginning of may end anywhere.
// @param linear  the root of the drop is near to linear in the coordinate; else the drop
std::optional<double> end_of_interval(ProfilePath& path, const Profiled& at, double first,
                                      double target, bool linear) {
  constexpr int kMost = 40, kSecants = 10, kUndefined = 4;
  constexpr double kFar = 8.0, kFarther = 1.5, kGrows = 1e-3;
  const double sign = first < 0.0 ? -1.0 : 1.0;
  const double bound = sign < 0.0 ? at.problem.lower[at.i] : at.problem.upper[at.i];
  const double wanted = linear ? target : target * target;
  // Value and size of the drop there, the largest drop below what is wanted and the least above.
  struct End {
    double value, size;
  };
  End inside{at.x[at.i], 0.0}, before = inside;
  std::optional<End> outside;
  int undefined = 0;
  double next = at.x[at.i] + first;
  for (int k = 0; k < kMost; ++k) {
    const bool stopped = !outside && sign * (next - bound) >= 0.0;
    if (stopped) next = bound;
    const std::optional<double> drop = path.drop(next);
    if (!drop && (outside || ++undefined > kUndefined)) return std::nullopt;
    if (!drop) {  // not so far out
      next = 0.5 * (next + inside.value);
      continue;
    }
    const double root = std::sqrt(2.0 * *drop);
    const End here{next, linear ? root : root * root};
    if (std::abs(root - target) < kNearEnd) return next;
    if (here.size < wanted && stopped) return bound;
    const double out = std::abs(here.value - at.x[at.i]);
    const bool farther = out > kFarther * std::abs(inside.value - at.x[at.i]);
    if (!outside && farther && out > kFar * std::abs(first) && here.size < wanted &&
        here.size - inside.size < kGrows * wanted) {
      return sign * kInfinity;
    }
    const double width = std::abs(here.value - inside.value);
    if (here.size < wanted) {
      before = inside;
      inside = here;
    } else {
      outside = here;
    }
    // A line through the two points on both sides, or on, at most four times as far.
    const End& from = outside ? inside : before;
    const End& to = outside ? *outside : inside;
    const double slope = (to.size - from.size) / (to.value - from.value);
    double step = slope * sign > 0.0 ? (wanted - inside.size) / slope : sign * 4.0 * width;
    if (outside && k > kSecants) step = 0.5 * (outside->value - inside.value);
    if (outside) {
      const double gap = outside->value - inside.value;
      step = sign * std::clamp(std::abs(step), 0.02 * std::abs(gap), 0.98 * std::abs(gap));
    } else {
      step = sign * std::clamp(std::abs(step), 1e-3 * width, 4.0 * width);
    }
    next = inside.value + step;
  }
  return std::nullopt;
}

// The end that was found at once, else the one along a path.
std::optional<double> or_by_path(const std::optional<VectorXd>& end, const Profiled& at,
                                 double first, double target, bool linear) {
  if (end) return (*end)[at.i];
  ProfilePath path(at);
  return end_of_interval(path, at, first, target, linear);
}

// Both ends, each where it can be found.
// @param reach  as far as they would be, were the root of the drop linear
std::array<std::optional<double>, 2> interval_of(const Profiled& at, double reach, double target) {
  const auto low = end_at_once(at, -reach, target, true);
  const auto high = end_at_once(at, reach, target, true, low ? &*low : nullptr);
  return {or_by_path(low, at, -reach, target, true), or_by_path(high, at, reach, target, true)};
}

// One parameter that a profile can be taken of.
struct ProfiledParameter {
  EstimatedParameter* reported;
  Index entry;  // among the free entries
  Unit unit;
};

bool holds(const std::vector<CovarianceEntries>& matrices, Index entry) {
  return std::any_of(matrices.begin(), matrices.end(), [&](const CovarianceEntries& each) {
    return std::find(each.entries.begin(), each.entries.end(), entry) != each.entries.end();
  });
}

// Coordinates of a full covariance matrix are not its entries, and get none.
std::vector<ProfiledParameter> with_profile(Estimate& estimate, const ProfiledMaximum& at) {
  const ReportedEntries entries = reported_entries(at.end);
  std::vector<ProfiledParameter> out;
  Index i = -1;
  for (std::size_t k = 0; k < estimate.parameters.size(); ++k) {
    EstimatedParameter& p = estimate.parameters[k];
    if (p.fixed) continue;
    ++i;
    const Domain domain = at.end[entries.parameter[k]].domain;
    if (domain == Domain::positive_definite || holds(at.judged.singular, i)) continue;
    out.push_back({&p, i, unit_or_dimensionless(p.unit)});
  }
  return out;
}

bool has_error(const ProfiledParameter& parameter) { return std::isfinite(parameter.reported->se); }

bool by_sums(const ProfiledMaximum& at) {
  return at.likelihood.evaluation_taken().method == EvaluationMethod::autocovariances;
}

// Of recordings' own values, of which there may be hundreds, each would be a search over all others.
bool is_one_of_many(const ProfiledParameter& parameter, const ProfiledMaximum& at) {
  constexpr Index kMany = 40;
  if (at.best.x.size() <= kMany) return false;
  const ParameterSet& all = at.likelihood.model().parameters;
  const int of = entry_derivatives(all)[static_cast<std::size_t>(parameter.entry)].parameter;
  return all[static_cast<std::size_t>(of)].scope == Scope::recording;
}

// Where an evaluation takes long, only for errors that are large beside the value.
bool is_worth_it(const ProfiledParameter& parameter, const ProfiledMaximum& at) {
  constexpr Index kDear = 20000;  // samples
  constexpr double kLarge = 0.1;
  if (is_one_of_many(parameter, at)) return false;
  return by_sums(at) || at.samples <= kDear || relative_error(*parameter.reported) > kLarge;
}

// Calls task(number, what goes out from the maximum with the coordinate of that entry held).
void for_each_profile(const std::vector<Index>& entries, const ProfiledMaximum& at,
                      const std::function<void(int task, const Profiled& of)>& task) {
  if (entries.empty()) return;
  // Entries of named covariances of full rank move by themselves.
  const VectorXd x = at.factors.to(at.best.x);
  const auto alone = [&](Index entry) { return at.factors.coordinate_of(entry) < 0; };
  const auto information_of = [](const std::optional<Slopes>& slopes, Index size) {
    return slopes ? slopes->information : MatrixXd(MatrixXd::Zero(size, size));
  };
  const MatrixXd information = information_of(at.slopes, at.best.x.size());
  const bool any_alone = std::any_of(entries.begin(), entries.end(), alone);
  const MatrixXd by_itself =
      any_alone ? information_of(slopes_at(at.likelihood.problem(), x), x.size()) : MatrixXd();
  const auto run = [&](int k, const LikelihoodProblem& by_entries) {
    const Index entry = entries[static_cast<std::size_t>(k)];
    const double L = at.best.summary.objective;
    if (alone(entry)) {
      task(k, {by_entries, x, L, by_itself, {}, entry});
    } else {
      task(k, {at.factors.problem(by_entries), at.best.x, L, information, at.judged.excess,
               at.factors.coordinate_of(entry)});
    }
  };
  const bool cheap = at.likelihood.is_cheap();
  in_parallel(static_cast<int>(entries.size()), cheap ? 1 : at.threads, [&](int k) {
    if (cheap) {
      run(k, at.likelihood.problem());
      return;
    }
    const std::unique_ptr<RecordingsLikelihood> own = at.likelihood.another();
    run(k, own->problem());
  });
}

// The root of twice the drop at the ends of a 95 % interval.
double profile_target(const ProfiledMaximum& at) {
  if (!std::isfinite(at.freedom)) return std::sqrt(chi_square_quantile(0.95, 1.0));
  const double t = student_t_quantile(0.975, at.freedom);
  return std::sqrt(static_cast<double>(at.samples) * std::log1p(t * t / at.freedom));
}

}  // namespace

std::optional<Slopes> slopes_at(const LikelihoodProblem& problem, const VectorXd& x) {
  double L = 0.0;
  Slopes out;
  if (!problem.evaluate(x, L, &out.gradient, &out.information)) return std::nullopt;
  return out;
}

void take_profile_intervals(Estimate& estimate, const ProfiledMaximum& at) {
  std::vector<ProfiledParameter> all = with_profile(estimate, at);
  std::erase_if(all, [&](const ProfiledParameter& parameter) {
    return !has_error(parameter) || !is_worth_it(parameter, at);
  });
  std::vector<Index> entries;
  for (const ProfiledParameter& parameter : all) entries.push_back(parameter.entry);
  std::vector<std::array<std::optional<double>, 2>> ends(all.size());
  const double target = profile_target(at);
  for_each_profile(entries, at, [&](int task, const Profiled& of) {
    const auto k = static_cast<std::size_t>(task);
    const double reach = target * all[k].reported->se * all[k].unit.scale;
    ends[k] = interval_of(of, reach, target);
  });
  for (std::size_t k = 0; k < all.size(); ++k) {
    const auto& [low, high] = ends[k];
    if (!low || !high) continue;
    EstimatedParameter& p = *all[k].reported;
    p.profile95 = {all[k].unit.from_si(*low), all[k].unit.from_si(*high)};
    p.ci95 = p.profile95;
  }
}

bool limit_variances_at_zero(Estimate& estimate, const ProfiledMaximum& at) {
  const LikelihoodProblem by_entries = at.likelihood.problem();
  const LikelihoodProblem problem = at.factors.problem(by_entries);
  std::vector<ProfiledParameter> all = with_profile(estimate, at);
  std::erase_if(all, [&](const ProfiledParameter& parameter) {
    const Index i = at.factors.coordinate_of(parameter.entry);
    return i < 0 || problem.lower[i] != 0.0 || at.best.x[i] > 0.0;
  });
  if (all.empty()) return true;
  if (!at.slopes) return false;
  std::vector<Index> entries;
  for (const ProfiledParameter& parameter : all) entries.push_back(parameter.entry);
  std::vector<std::optional<double>> limits(all.size());
  const double target = std::sqrt(chi_square_quantile(0.9, 1.0));
  for_each_profile(entries, at, [&](int task, const Profiled& of) {
    const VectorXd along = tangent(of, of.x, of.information);
    const double slope = std::max(0.0, -at.slopes->gradient.dot(along));
    const double curvature = along.dot(of.information * along);
    // slope v + curvature v^2 / 2 = target^2 / 2
    const double root = std::sqrt(slope * slope + curvature * target * target);
    const double guess = target * target / (slope + root);
    const double first = std::isfinite(guess) ? guess : of.x.cwiseAbs().maxCoeff();
    limits[task] = or_by_path(end_at_once(of, first, target, false), of, first, target, false);
  });
  for (std::size_t k = 0; k < all.size(); ++k) {
    EstimatedParameter& p = *all[k].reported;
    p.ci95 = limits[k] && std::isfinite(*limits[k])
                 ? std::array<double, 2>{0.0, *limits[k] / all[k].unit.scale}
                 : std::array<double, 2>{kNone, kNone};
  }
  return true;
}

namespace {

// How small may the coordinate be? By decades, then by halves of one. Nothing where it may be all but
// zero.
std::optional<double> least_likely(const Profiled& of, double target) {
  constexpr int kDecades = 40, kHalves = 5;
  const double wanted = 0.5 * target * target;
  ProfilePath path(of);
  double inside = of.x[of.i], outside = 0.0;
  const double smallest = std::max(of.problem.lower[of.i], inside * std::pow(10.0, -kDecades));
  if (const auto drop = path.drop(smallest); drop && *drop < wanted) return std::nullopt;
  path.restart();
  for (int k = 0; k < kDecades && outside == 0.0; ++k) {
    const double next = 0.1 * inside;
    if (next <= of.problem.lower[of.i]) return std::nullopt;
    const std::optional<double> drop = path.drop(next);
    if (!drop) return std::nullopt;
    (*drop < wanted ? inside : outside) = next;
  }
  if (outside == 0.0) return std::nullopt;
  for (int k = 0; k < kHalves; ++k) {
    const double next = std::sqrt(inside * outside);
    path.restart();
    const std::optional<double> drop = path.drop(next);
    if (!drop) return std::nullopt;
    (*drop < wanted ? inside : outside) = next;
  }
  return outside;
}

}  // namespace

Findings limit_from_below(Estimate& estimate, const ProfiledMaximum& at) {
  constexpr double kOpen = 1e3;  // standard errors in the value
  std::vector<ProfiledParameter> all = with_profile(estimate, at);
  std::erase_if(all, [&](const ProfiledParameter& parameter) {
    const EstimatedParameter& p = *parameter.reported;
    const bool positive = p.value > 0.0 && p.bounds[0] >= 0.0 && std::isinf(p.bounds[1]);
    const bool open = p.verdict == Verdict::unexcited || relative_error(p) > kOpen;
    return !positive || !open || at.factors.coordinate_of(parameter.entry) < 0;
  });
  std::vector<Index> entries;
  for (const ProfiledParameter& parameter : all) entries.push_back(parameter.entry);
  std::vector<std::optional<double>> limits(all.size());
  const double target = std::sqrt(chi_square_quantile(0.9, 1.0));
  for_each_profile(entries, at, [&](int task, const Profiled& of) {
    limits[static_cast<std::size_t>(task)] = least_likely(of, target);
  });
  Findings out;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!limits[k]) continue;
    EstimatedParameter& p = *all[k].reported;
    p.se = p.se_sandwich = p.crb_se = kNone;
    p.ci95 = p.profile95 = {*limits[k] / all[k].unit.scale, kInfinity};
    if (p.verdict != Verdict::unexcited) --estimate.identifiability.rank;
    p.verdict = Verdict::not_identifiable;
    p.with.clear();
    out.push_back(make_finding(
        FindingCode::at_bound, {p.name},
        fmt::format("{} is bounded from below only: above {:.3g}{}{} (95 %) the recording does not "
                    "tell one value from another",
                    p.name, p.ci95[0], p.unit.empty() ? "" : " ", p.unit)));
  }
  return out;
}

void picture_profiles(NoiseEstimate& estimate, const ProfiledMaximum& at) {
  std::vector<ProfiledParameter> all = with_profile(estimate, at);
  std::erase_if(all, [&](const ProfiledParameter& parameter) {
    return !has_error(parameter) || !is_worth_it(parameter, at);
  });
  std::vector<Index> entries;
  for (const ProfiledParameter& parameter : all) entries.push_back(parameter.entry);
  std::vector<LikelihoodProfile> profiles(all.size());
  for_each_profile(entries, at, [&](int task, const Profiled& of) {
    const ProfiledParameter& parameter = all[static_cast<std::size_t>(task)];
    ProfilePath path(of);
    const auto drop = [&](double value, bool turned) -> std::optional<double> {
      if (turned) path.restart();
      const std::optional<double> fallen = path.drop(value);
      return fallen ? std::optional<double>(2.0 * *fallen) : std::nullopt;
    };
    profiles[task] = walk_profile(of.x[of.i], parameter.reported->se * parameter.unit.scale,
                                  of.problem.lower[of.i], of.problem.upper[of.i], drop);
  });
  for (std::size_t k = 0; k < all.size(); ++k) {
    profiles[k].name = all[k].reported->name;
    for (double& value : profiles[k].value) value = all[k].unit.from_si(value);
    if (profiles[k].value.size() > 2) {
      estimate.pictures.profiles.push_back(std::move(profiles[k]));
    }
  }
}

}  // namespace identikal
