#include "identify/validation/compare_results.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <tuple>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/test_result.h"
#include "identify/filter/leading_samples.h"
#include "identify/validation/internal/nested_structure.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

constexpr double kLevel = 0.05;
// Of a log-likelihood: searches end no closer to the maximum.
constexpr double kSearchError = 1e-3;

[[noreturn]] void refuse(const StoredResult& result, const std::string& what,
                         const std::string& expected, const std::string& hint = "") {
  throw InputError({result.path, 0, 0}, what, expected, hint);
}

// As the user names it: the folder.
std::string name_of(const StoredResult& result) {
  const std::string file = "/result.json";
  return result.path.ends_with(file) ? result.path.substr(0, result.path.size() - file.size())
                                     : result.path;
}

// What kind of likelihood a result is at the maximum of; empty: none.
std::string likelihood_kind(const StoredEstimate& e) {
  const std::string& method = e.objective.method;
  if (method == "ml" || method == "auto" || method == "shape") return "one step of a filter";
  if (method == "output_error" || method == "prediction_error" || method == "trajectory") {
    return method;
  }
  return "";
}

double unknowns(const Objective& o) {
  return std::round(0.5 * o.aic + log_likelihood_behind(o, o.diffuse_samples));
}

// The samples that determine the diffuse start of every result: likelihoods compare behind them.
Eigen::Index beginning_of_all(const std::vector<StoredResult>& results) {
  long out = 0;
  for (const StoredResult& result : results) {
    out = std::max(out, result.estimate.objective.diffuse_samples);
  }
  return out;
}

std::vector<std::tuple<std::string, long, std::array<double, 2>>> data_of(const StoredEstimate& e) {
  std::vector<std::tuple<std::string, long, std::array<double, 2>>> out;
  for (const InputRecord& input : e.inputs) {
    out.emplace_back(input.sha256, input.used, input.range);
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::vector<std::string> channels_of(const StoredEstimate& e) {
  std::vector<std::string> out;
  for (const ChannelFit& fit : e.one_step.empty() ? e.simulation : e.one_step) {
    out.push_back(fit.channel + " [" + fit.unit + "]");
  }
  std::sort(out.begin(), out.end());
  return out;
}

void check_comparable(const std::vector<StoredResult>& results) {
  if (results.size() < 2) {
    throw InputError({}, "one result cannot be compared", "identikal compare RESULT RESULT...");
  }
  const StoredResult& first = results[0];
  for (const StoredResult& result : results) {
    const StoredEstimate &e = result.estimate, &f = first.estimate;
    if (likelihood_kind(e).empty() || !std::isfinite(e.objective.aic)) {
      refuse(result,
             fmt::format("'{}' ({}) maximises no likelihood, so it has no AIC to be ranked by",
                         e.verb, e.objective.method),
             "results of tune --method ml, shape, or fit",
             "'identikal compare A.yaml B.yaml DATA' ranks any filters");
    }
    if (likelihood_kind(e) != likelihood_kind(f)) {
      refuse(result,
             fmt::format("its likelihood is of another kind ({}) than that of {} ({})",
                         e.objective.method, name_of(first), f.objective.method),
             "one method of fit for all");
    }
    if (data_of(e) != data_of(f)) {
      refuse(result, "is of other data, or other rows of them, than " + name_of(first),
             "results of the same recordings");
    }
    if (channels_of(e) != channels_of(f)) {
      refuse(
          result,
          fmt::format("is about other outputs ({}) than {} ({})", fmt::join(channels_of(e), ", "),
                      name_of(first), fmt::join(channels_of(f), ", ")),
          "the same outputs in the same units");
    }
    if (e.objective.samples != f.objective.samples) {
      refuse(result,
             fmt::format("uses {} measured values, {} uses {}", e.objective.samples, name_of(first),
                         f.objective.samples),
             "the same values for all", "--reject-outliers leaves some out");
    }
    const Eigen::Index beginning = beginning_of_all(results);
    const bool earlier = e.objective.initial == "diffuse" && e.objective.diffuse_samples == 0;
    if (earlier || !std::isfinite(log_likelihood_behind(e.objective, beginning))) {
      refuse(result,
             "does not say how likely its first samples are, which determine a diffuse start",
             !earlier ? fmt::format("recordings longer than the first {} samples", beginning)
                      : "results of this version",
             "'identikal compare A.yaml B.yaml DATA' ranks any filters");
    }
  }
}

// How a larger model becomes the smaller one.
struct Nesting {
  std::vector<std::string> extra, at_bound;  // free in the larger one only; known at a bound
  bool common_at_bound = false;              // a common one ended on its bound
};

bool same_value(double a, double b) { return std::abs(a - b) <= 1e-9 * std::abs(a); }

// False when `small` is no special case of `large`.
bool is_nested(const StoredEstimate& small, const StoredEstimate& large, Nesting& out) {
  if (small.objective.initial != large.objective.initial) return false;
  std::map<std::string, const EstimatedParameter*> in_small;
  for (const EstimatedParameter& p : small.parameters) in_small[p.name] = &p;
  for (const EstimatedParameter& l : large.parameters) {
    const auto found = in_small.find(l.name);
    const EstimatedParameter* const s = found == in_small.end() ? nullptr : found->second;
    if (s != nullptr) in_small.erase(found);
    if (l.fixed) {
      if (s == nullptr || !s->fixed || s->unit != l.unit || !same_value(s->value, l.value)) {
        return false;
      }
      continue;
    }
    if (s != nullptr && !s->fixed) {
      out.common_at_bound =
          out.common_at_bound || s->verdict == Verdict::at_bound || l.verdict == Verdict::at_bound;
      continue;
    }
    if (s != nullptr && s->unit != l.unit) return false;
    const double known = s == nullptr ? 0.0 : s->value;
    out.extra.push_back(l.name);
    // A straight tyre is one whose largest force is beyond any bound.
    const bool straight =
        s == nullptr && small.tyre_curve == "linear" && (l.name == "Ff_max" || l.name == "Fr_max");
    if (straight || known == l.bounds[0] || known == l.bounds[1]) out.at_bound.push_back(l.name);
  }
  return in_small.empty() && !out.extra.empty();
}

// Within the width of the console.
std::string shortened(const std::string& path, std::size_t width) {
  return path.size() <= width ? path : "..." + path.substr(path.size() - width + 3);
}

// What a result is worth on held-out rows: a simulation says little of noise.
struct HeldOutValue {
  const char* id;
  double value;
  std::string text;
};

std::optional<HeldOutValue> held_out_value(const StoredEstimate& e) {
  if (std::isfinite(e.objective.held_out)) {
    return HeldOutValue{"held_out", e.objective.held_out,
                        fmt::format("{:>8.4f}  ", e.objective.held_out)};
  }
  if (e.hold_out.empty()) return std::nullopt;
  double sum = 0.0;
  for (const ChannelFit& fit : e.hold_out) sum += fit.fit_percent;
  const double mean = sum / static_cast<double>(e.hold_out.size());
  return HeldOutValue{"held_out_fit", mean, fmt::format("{:>6.1f} %  ", mean)};
}

double critical_value(int extra, int at_bound) {
  double low = 0.0, high = 1000.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (likelihood_ratio_p(middle, extra, at_bound) > kLevel ? low : high) = middle;
  }
  return high;
}

void compare_nested(const StoredResult& small, const StoredResult& large, Comparison& out) {
  Nesting nesting;
  if (!is_nested(small.estimate, large.estimate, nesting)) return;
  const Objective &of_small = small.estimate.objective, &of_large = large.estimate.objective;
  const double gain = of_large.log_likelihood - of_small.log_likelihood;
  // Parameters that the data leave open count for nothing in both.
  const int extra = static_cast<int>(unknowns(of_large) - unknowns(of_small));
  const auto at_bound = std::min(extra, static_cast<int>(nesting.at_bound.size()));
  const std::string pair = shortened(name_of(small), 30) + " in " + shortened(name_of(large), 30);
  if (extra < 1) return;
  const NestedStructure structure = structure_at(small, large);
  if (structure == NestedStructure::other) {
    out.notes.push_back(
        fmt::format("{}: no likelihood ratio, the models differ in more than what is known of {}",
                    pair, fmt::join(nesting.extra, ", ")));
    return;
  }
  if (of_small.diffuse_samples != of_large.diffuse_samples) {
    out.notes.push_back(
        fmt::format("{}: no likelihood ratio, {} and {} samples determine their diffuse starts",
                    pair, of_small.diffuse_samples, of_large.diffuse_samples));
    return;
  }
  const bool converged = small.estimate.status != Status::not_converged &&
                         large.estimate.status != Status::not_converged;
  if (!converged || gain < -kSearchError) {
    out.notes.push_back(
        fmt::format("{}: no likelihood ratio, {}", pair,
                    converged ? "the larger model is less likely, so its search missed the maximum"
                              : "a search has not converged"));
    return;
  }
  const double ratio = std::max(0.0, 2.0 * gain);
  const TestResult test = test_result("likelihood_ratio", name_of(small) + " in " + name_of(large),
                                      ratio, {0.0, critical_value(extra, at_bound)},
                                      likelihood_ratio_p(ratio, extra, at_bound), kLevel);
  out.tests.push_back(test);
  std::string line =
      fmt::format("{}: {} free as well, LR {:.4g}, p {}{:.2g} ({})", pair,
                  fmt::join(nesting.extra, ", "), test.value, at_bound > 1 ? "<= " : "", test.p,
                  test.pass ? "the smaller model will do" : "it pays");
  if (at_bound == 1) {
    line += fmt::format(
        "; with {} at a bound in the smaller one, p is half of chi-square with {} and half with {} "
        "degrees of freedom",
        fmt::join(nesting.at_bound, ", "), extra - 1, extra);
  }
  if (at_bound > 1) {
    line += fmt::format("; with {} at bounds in the smaller one, a mixture of chi-squares",
                        fmt::join(nesting.at_bound, ", "));
  }
  if (nesting.common_at_bound) line += "; another parameter ended at a bound: p is approximate";
  if (structure == NestedStructure::unknown) {
    line += "; that one lies in the other is taken from the names of their parameters alone";
  }
  out.notes.push_back(line);
}

}  // namespace

double likelihood_ratio_p(double value, int extra, int at_bound) {
  if (!(value > 0.0)) return 1.0;
  const double whole = chi_square_upper_tail(value, extra);
  if (at_bound == 0) return whole;
  const double less = extra > 1 ? chi_square_upper_tail(value, extra - 1) : 0.0;
  return 0.5 * (less + whole);
}

Comparison compare_results(const std::vector<StoredResult>& results) {
  check_comparable(results);
  const Eigen::Index beginning = beginning_of_all(results);
  const auto likelihood = [&](const StoredResult* result) {
    return log_likelihood_behind(result->estimate.objective, beginning);
  };
  const auto aic = [&](const StoredResult* result) {
    return 2.0 * (unknowns(result->estimate.objective) - likelihood(result));
  };
  const auto bic = [&](const StoredResult* result) {
    const Objective& o = result->estimate.objective;
    const long counted = o.rows > 0 ? o.rows : o.samples;
    return unknowns(o) * std::log(static_cast<double>(counted)) - 2.0 * likelihood(result);
  };
  std::vector<const StoredResult*> order;
  for (const StoredResult& result : results) order.push_back(&result);
  std::stable_sort(order.begin(), order.end(),
                   [&](const StoredResult* a, const StoredResult* b) { return aic(a) < aic(b); });
  const StoredEstimate& best = order[0]->estimate;
  const StoredResult* least_bic = order[0];
  bool held_out = false, converged = true;
  for (const StoredResult* result : order) {
    if (bic(result) < bic(least_bic)) least_bic = result;
    held_out = held_out || held_out_value(result->estimate).has_value();
    converged = converged && result->estimate.status != Status::not_converged;
  }

  Comparison out;
  out.verb = "compare";
  out.model_name = fmt::format("{} results", results.size());
  out.objective.method = "compare";
  out.objective.log_likelihood = likelihood(order[0]);
  out.inputs = best.inputs;
  out.notes.push_back(
      fmt::format("rank    k log-likelihood      dAIC      dBIC {}status        result",
                  held_out ? "held out  " : ""));
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const StoredResult& result = *order[rank];
    const Objective& o = result.estimate.objective;
    const double dAIC = aic(order[rank]) - aic(order[0]);
    const double dBIC = bic(order[rank]) - bic(least_bic);
    const std::optional<HeldOutValue> unseen = held_out_value(result.estimate);
    out.tests.push_back(reported_figure("aic", name_of(result), dAIC, dAIC == 0.0));
    out.tests.push_back(reported_figure("bic", name_of(result), dBIC, dBIC == 0.0));
    out.tests.push_back(
        reported_figure("log_likelihood", name_of(result), likelihood(&result), rank == 0));
    if (unseen)
      out.tests.push_back(reported_figure(unseen->id, name_of(result), unseen->value, true));
    const std::string held = !held_out ? "" : unseen ? unseen->text : "       -  ";
    out.notes.push_back(fmt::format("{:>4} {:>4.0f} {:>14.3f} {:>9.2f} {:>9.2f} {}{:<13} {}",
                                    rank + 1, unknowns(o), likelihood(&result), dAIC, dBIC, held,
                                    to_string(result.estimate.status),
                                    shortened(name_of(result), held_out ? 11 : 21)));
  }
  for (const StoredResult* large : order) {
    for (const StoredResult* small : order) {
      if (small != large) compare_nested(*small, *large, out);
    }
  }
  if (beginning > 0) {
    out.notes.push_back(fmt::format(
        "log-likelihoods are those of the samples behind the first {}, which determine a diffuse "
        "start",
        beginning));
  }
  const double lead = aic(order[1]) - aic(order[0]);
  if (!converged) {
    out.findings.push_back(
        make_finding(FindingCode::unconverged_results, {}, "; but not every search has converged"));
  }
  if (best.status != Status::ok) {
    out.findings.push_back(
        make_finding(FindingCode::best_in_doubt, {},
                     fmt::format("; but it is itself '{}'", to_string(best.status))));
  }
  const std::string first =
      fmt::format("{} has the lowest AIC{}{}", name_of(*order[0]),
                  lead < 2.0 ? fmt::format(", by {:.2g} only", lead) : "",
                  least_bic == order[0] ? (lead < 2.0 ? ", and the lowest BIC" : " and BIC")
                                        : ", " + name_of(*least_bic) + " the lowest BIC");
  conclude(out, first, Basis::tests);
  return out;
}

}  // namespace identikal
