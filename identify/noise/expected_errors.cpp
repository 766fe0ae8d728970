#include "identify/noise/expected_errors.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "identify/estimate/covariance_factor.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/outliers.h"
#include "identify/filter/report.h"
#include "identify/model/check.h"
#include "identify/model/noise_entries.h"
#include "identify/noise/internal/extension_fit.h"
#include "identify/noise/internal/moved_estimates.h"
#include "identify/noise/internal/possible_extensions.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kSettles = 5;  // a share of a recording: a start is no part of the errors
const char* const kBulk = "its noise tuned without outliers";
constexpr double kSmallExcess = 0.03, kSmallestNees = 2.0 / 3.0, kLargestNees = 1.5;

bool is_of_innovations(const Finding& finding) {
  switch (finding.code) {
    case FindingCode::coloured_innovations:
    case FindingCode::input_in_innovations:
    case FindingCode::outliers:
    case FindingCode::heavy_tails:
      return finding.severity == Severity::serious;
    default:
      return false;
  }
}

// Sums over rows, per state of the first model.
struct Sums {
  VectorXd apart, better, own;  // (x - x*)^2, P*_ii, P_ii
  double rows = 0.0;
};

// Of two filters of one recording.
// @param place  of every state of the first among those of the second; -1: it is none of them
bool add_rows(const FilterResult& own, const FilterResult& better, const std::vector<Index>& place,
              Sums& sums) {
  if (own.status != FilterStatus::ok || better.status != FilterStatus::ok) return false;
  const Index rows = own.x_filt.cols();
  const Index from = std::max({rows / kSettles, own.first_proper, better.first_proper});
  for (Index t = from; t < rows; ++t) {
    const auto at = static_cast<std::size_t>(t);
    for (std::size_t i = 0; i < place.size(); ++i) {
      const auto s = static_cast<Index>(i);
      if (place[i] < 0) continue;
      const double apart = own.x_filt(s, t) - better.x_filt(place[i], t);
      sums.apart[s] += apart * apart;
      sums.better[s] += better.P_filt[at](place[i], place[i]);
      sums.own[s] += own.P_filt[at](s, s);
    }
    sums.rows += 1.0;
  }
  return true;
}

ExpectedErrors errors_of(const Sums& sums, const Model& model) {
  ExpectedErrors out;
  double loss = 0.0, squares = 0.0, states = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < model.states.size(); ++i) {
    const auto s = static_cast<Index>(i);
    if (!(sums.better[s] > 0.0 && sums.own[s] > 0.0))
      continue;  // known without error, or not of both
    const double share = sums.apart[s] / sums.better[s];
    loss += share;
    squares += (sums.apart[s] + sums.better[s]) / sums.own[s];
    states += 1.0;
    if (share > largest) {
      largest = share;
      out.worst_state = model.states[i].name;
    }
  }
  if (states == 0.0) return out;
  out.excess = out.most = std::sqrt(1.0 + loss / states) - 1.0;
  out.nees = squares / states;
  return out;
}

struct Likelier {
  std::string what;
  Model model;
  std::vector<MovedEstimate> moved;
};

// Of the extensions the one with the least BIC, if that is below the model's own.
std::optional<Likelier> likelier_extension(const YamlNode& root, const Model& model,
                                           const std::vector<Dataset>& recordings,
                                           const NoiseEstimate& estimate,
                                           const ExpectedErrorsOptions& options) {
  const std::vector<Dataset> first = rows_to_fit(recordings);
  FittedModel base{root, model, 0.0};
  const auto L = fit_values(base.model, first);
  if (!L) return std::nullopt;
  base.log_likelihood = *L;
  const std::vector<ModelExtension> all = possible_extensions(root, base.model, first);
  auto found = likeliest_extension(base, all, first, options.threads, options.progress);
  if (!found) return std::nullopt;
  std::vector<MovedEstimate> moved = moved_estimates(base.model, found->fitted.model, estimate);
  return Likelier{in_words(all[found->which]), std::move(found->fitted.model), std::move(moved)};
}

// The mean-square error of the states by what the innovations' own past, or inputs, explain of
// them, over the states' part of the innovations.
double unexplained(const Model& model, const std::vector<Dataset>& recordings) {
  FilterEstimate report;
  const std::vector<FilterResult> filters =
      report_filter(report, model, model.parameters, recordings);
  const Eigen::MatrixXd R = instantiate(noise_model(model), model.parameters).R;
  double out = 0.0;
  for (const TestResult& test : report.tests) {
    if (test.pass || std::isnan(test.share)) continue;
    for (std::size_t i = 0; i < model.outputs.size(); ++i) {
      if (model.outputs[i].name != test.channel) continue;
      const auto row = static_cast<Index>(i);
      double innovations = 0.0, count = 0.0;
      for (const FilterResult& filter : filters) {
        for (Index t = 0; t < filter.e_sd.cols(); ++t) {
          if (std::isnan(filter.e(row, t))) continue;
          innovations += filter.e_sd(row, t) * filter.e_sd(row, t);
          count += 1.0;
        }
      }
      const double variance = innovations / std::max(1.0, count),
                   of_states = variance - R(row, row);
      if (of_states > 0.0)
        out = std::max(out, test.share / (1.0 - test.share) * variance / of_states);
    }
  }
  return out;
}

void take_larger(std::optional<ExpectedErrors> errors, const std::string& what,
                 ExpectedErrors& out) {
  if (!errors || (!out.if_right.empty() && errors->excess <= out.excess)) return;
  out = std::move(*errors);
  out.if_right = what;
}

bool is_small(const ExpectedErrors& errors) {
  return errors.most <= kSmallExcess && errors.nees >= kSmallestNees &&
         errors.nees <= kLargestNees && !errors.moved;
}

std::string in_words(const ExpectedErrors& errors) {
  std::string out = fmt::format(
      "the states' errors are expected to be {:.2g} % (up to {:.2g} %) above what is "
      "possible on recordings like these, their squares {:.2g} times the filter's "
      "variances",
      100.0 * errors.excess, 100.0 * errors.most, errors.nees);
  if (errors.if_right.empty()) return out + "; nothing likelier was found among further parts";
  out += "; likelier is the model with " + errors.if_right;
  if (!errors.worst_state.empty())
    out += fmt::format(", it is {} that loses most", errors.worst_state);
  if (errors.moved) out += ", and " + *errors.moved;
  return out;
}

}  // namespace

std::optional<ExpectedErrors> errors_if_right(const Model& model, const Model& better,
                                              const std::vector<Dataset>& recordings) {
  std::vector<Index> place;
  for (const auto& state : model.states) {
    const auto at = std::find_if(better.states.begin(), better.states.end(),
                                 [&](const auto& other) { return other.name == state.name; });
    place.push_back(at == better.states.end() ? -1 : at - better.states.begin());
  }
  const VectorXd none = VectorXd::Zero(static_cast<Index>(place.size()));
  Sums sums{none, none, none, 0.0};
  for (const Dataset& data : recordings) {
    if (!add_rows(run_filter(model, model.parameters, data),
                  run_filter(better, better.parameters, data), place, sums)) {
      return std::nullopt;
    }
  }
  return errors_of(sums, model);
}

ExpectedErrors expected_errors(const YamlNode& root, const Model& model,
                               const std::vector<Dataset>& recordings,
                               const NoiseEstimate& estimate,
                               const ExpectedErrorsOptions& options) {
  ExpectedErrors out;
  Model best = model;
  const auto likelier = likelier_extension(root, model, recordings, estimate, options);
  if (likelier) {
    best = likelier->model;
    take_larger(errors_if_right(model, best, recordings), likelier->what, out);
  }
  const bool has_outliers =
      std::any_of(estimate.findings.begin(), estimate.findings.end(),
                  [](const Finding& f) { return f.code == FindingCode::outliers; });
  if (has_outliers) {
    Model bulk = model;
    if (fit_values(bulk, without(recordings, find_outliers(model, model.parameters, recordings)))) {
      take_larger(errors_if_right(model, bulk, recordings), kBulk, out);
    }
  }
  const double ratio = (1.0 + out.excess) * (1.0 + out.excess);
  out.most = std::sqrt(ratio + unexplained(best, recordings)) - 1.0;
  if (likelier && !likelier->moved.empty()) out.moved = in_words(likelier->moved.front(), estimate);
  return out;
}

void judge_by_undecided(const std::vector<UndecidedPart>& parts, const Model& given,
                        const std::vector<Dataset>& recordings, NoiseEstimate& estimate) {
  if (estimate.status != Status::ok && estimate.status != Status::untrusted) return;
  Model model = checked(given, recordings);
  model.parameters = parameters_of(estimate, model.parameters);
  ExpectedErrors errors;
  for (const UndecidedPart& part : parts) {
    take_larger(errors_if_right(model, part.model, recordings), part.what, errors);
  }
  if (errors.if_right.empty() || is_small(errors)) return;
  estimate.findings.push_back(
      {FindingCode::expected_errors,
       Severity::serious,
       {},
       fmt::format(
           "two sensors differ, and nothing tells which of them is off: half of it is taken "
           "for each. With {}, which is as likely, the states' errors are {:.2g} % above "
           "what is possible, their squares {:.2g} times the filter's variances{}",
           errors.if_right, 100.0 * errors.excess, errors.nees,
           errors.worst_state.empty()
               ? ""
               : fmt::format("; it is {} that loses most", errors.worst_state)),
       "compare both with a third one, and write what is found into the model"});
  conclude(estimate, "converged");
}

bool innovations_contradict(const NoiseEstimate& estimate) {
  const bool doubted =
      std::any_of(estimate.findings.begin(), estimate.findings.end(), is_of_innovations);
  return estimate.status == Status::untrusted && doubted && !has_misreading(estimate.findings);
}

void judge_by_expected_errors(const YamlNode& root, const Model& given,
                              const std::vector<Dataset>& recordings, NoiseEstimate& estimate,
                              const ExpectedErrorsOptions& options) {
  if (!innovations_contradict(estimate)) return;
  Model model = checked(given, recordings);
  if (moves_without_noise(model)) return;
  model.parameters = parameters_of(estimate, model.parameters);
  bool stopped = false;
  ExpectedErrorsOptions watched = options;
  watched.progress = [&](const ModelExtension& extension) {
    stopped = stopped || (options.progress && !options.progress(extension));
    return !stopped;
  };
  const ExpectedErrors errors = expected_errors(root, model, recordings, estimate, watched);
  if (stopped) return;  // what was not tried may be likelier
  estimate.derived.push_back({"excess error of the states", "", errors.excess, kNone});
  estimate.derived.push_back({"excess error of the states, at most", "", errors.most, kNone});
  estimate.derived.push_back({"expected NEES", "", errors.nees, kNone});
  const bool further = !errors.if_right.empty() && errors.if_right != kBulk;
  Finding found = make_finding(FindingCode::expected_errors, {}, in_words(errors),
                               further ? "--extend tries it on rows held out" : "");
  if (!(errors.nees >= kSmallestNees && errors.nees <= kLargestNees)) {
    estimate.derived.push_back(
        {kCovarianceFactor + std::string("a likelier model"), "", errors.nees, kNone});
  }
  if (is_small(errors)) {
    found.severity = Severity::note;
    for (Finding& finding : estimate.findings) {
      if (is_of_innovations(finding)) finding.severity = Severity::warning;
    }
    for (EstimatedParameter& p : estimate.parameters) {
      if (p.verdict == Verdict::untrusted) p.verdict = Verdict::ok;
    }
  }
  estimate.findings.push_back(std::move(found));
  conclude(estimate, "converged");
}

}  // namespace identikal
