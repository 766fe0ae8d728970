#include "identify/report/console.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "identify/report/handling_text.h"
#include "identify/report/internal/bound_text.h"
#include "identify/report/internal/shaping_text.h"
#include "identify/report/internal/text_layout.h"
#include "identify/report/internal/verdict_text.h"
#include "identify/result/schema.h"

namespace identikal {
namespace {

std::string head_text(const Estimate& estimate) {
  const std::string& method = estimate.objective.method;
  std::string out =
      wrapped(fmt::format("{}: {}{}", estimate.verb, estimate.model_name,
                          method == estimate.verb ? "" : fmt::format(" ({})", method)),
              4);
  for (const InputRecord& input : estimate.inputs) {
    out += fmt::format("data   {}: {} rows, {} used\n", input.path, input.rows, input.used);
  }
  return out + "\n";
}

// Of the likelihood profile where there is one: the symmetric interval of a variance reaches below
// zero.
const std::array<double, 2>& interval_of(const EstimatedParameter& p) {
  return std::isnan(p.profile95[0]) ? p.ci95 : p.profile95;
}

std::string known_text(const Estimate& estimate) {
  std::string known;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.neutral || !p.fixed) continue;
    known += fmt::format("{} {} = {:.6g}{}{}", known.empty() ? "known " : ",", p.name, p.value,
                         p.unit.empty() ? "" : " ", p.unit);
  }
  return known.empty() ? known : wrapped(known, 7);
}

std::string origin_of_errors(const Estimate& estimate) {
  if (estimate.covariance_kind.empty()) return "";
  std::vector<std::string> profiled;
  std::size_t intervals = 0;
  for (const EstimatedParameter& p : estimate.parameters) {
    intervals += !p.fixed && !std::isnan(interval_of(p)[0]) ? 1 : 0;
    if (!std::isnan(p.profile95[0])) profiled.push_back(p.name);
  }
  std::string out = "se from " + estimate.covariance_kind;
  if (!profiled.empty()) {
    const bool all = profiled.size() == intervals;
    out += fmt::format("; 95 % {}{} from {}", intervals == 1 ? "interval" : "intervals",
                       all ? "" : " of " + comma_list(profiled),
                       profiled.size() == 1 ? "the likelihood profile" : "likelihood profiles");
  }
  return wrapped(out, 8);
}

// The free parameters as a table, what is known in one sentence below it.
std::string parameter_text(const Estimate& estimate) {
  std::vector<std::vector<std::string>> rows;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    const auto [low, high] = interval_of(p);
    const bool none = std::isnan(low) || std::isnan(high);
    rows.push_back({p.name, p.unit.empty() ? "-" : p.unit, value_text(p.value), error_text(p.se),
                    none ? "-" : fmt::format("{:.5g} .. {:.5g}", low, high), error_text(p.crb_se),
                    verdict_text(p)});
  }
  std::string out;
  if (!rows.empty()) {
    out = text_table({{"parameter", true},
                      {"unit", true},
                      {"value"},
                      {"se"},
                      {"95 % interval"},
                      {"bound se"},
                      {"verdict", true}},
                     rows);
  }
  return out + known_text(estimate) + origin_of_errors(estimate);
}

// Where a Bayesian estimate comes from.
std::string posterior_text(const ResultSections& result) {
  if (result.posterior == nullptr) return "";
  const Estimate& estimate = *result.core;
  const Posterior& p = *result.posterior;
  std::string most, prior;
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    if (estimate.parameters[i].fixed) continue;
    const auto& [name, map, prior_in_words] = p.parameters[i];
    most += fmt::format("{} {} {:.5g}", most.empty() ? "most probable" : ",", name, map);
    prior += fmt::format("{} {} {}", prior.empty() ? "prior" : ",", name, prior_in_words);
  }
  return wrapped(most, 14) + wrapped(prior, 6) +
         wrapped(fmt::format("posterior by {}: {} points, {:.0f} {}; log evidence {:.3f}", p.method,
                             p.points, p.effective,
                             p.method == "sequential Monte Carlo" ? "distinct" : "effective",
                             p.log_evidence),
                 10);
}

std::string excess_text(const ResultSections& result) {
  if (result.excess_mean_square_error == nullptr) return "";
  const ExcessMeanSquareError& excess = *result.excess_mean_square_error;
  if (!excess.reason.empty()) {
    return wrapped("excess mean-square error not known: " + excess.reason, 7);
  }
  const std::string percent = percent_text(100.0 * excess.relative);
  std::string out =
      result.bound != nullptr
          ? fmt::format("excess mean-square error at least {} % of tr P, from the bound", percent)
          : fmt::format(
                "excess mean-square error {} % of tr P, as expected from the standard errors",
                percent);
  if (!excess.without.empty()) {
    out += "; without the share of " + comma_list(excess.without) + ", zero here";
  }
  return wrapped(out, 7);
}

// The trade-off between fit and rank of Q.
std::string rank_text(const RankSelection& s) {
  std::string out = fmt::format("\n{:>10} {:>12} {:>12} {:>8} {:>10} {:>10}\n", "penalty",
                                "objective", "tr Q", "rank", "excess", "allowed");
  for (const RankSelection::Step& step : s.curve) {
    out += fmt::format("{:>10.3g} {:>12.6g} {:>12.6g} {:>8} {:>10} {:>10}\n", step.penalty,
                       step.objective, step.trace, step.rank,
                       std::isnan(step.excess) ? "-" : fmt::format("{:.2f}", step.excess),
                       std::isnan(step.allowed) ? "-" : fmt::format("{:.2f}", step.allowed));
  }
  return out + wrapped(fmt::format("rank {} of {}: the smallest whose fit without penalty is not "
                                   "significantly worse (chi-square, 99 %)",
                                   s.rank, s.of),
                       5);
}

std::string noise_text(const ResultSections& result) {
  if (result.noise == nullptr) return "";
  const Noise& noise = *result.noise;
  // Where no noise moves the states there is no filter to lose anything.
  const bool moves = !noise.Q.isZero(0.0) || noise.K_steady.size() > 0;
  return (moves ? matrix_text("Q", noise.Q) : "") + matrix_text("R", noise.R) +
         matrix_text("S", noise.S) + matrix_text("K", noise.K_steady) +
         (moves ? excess_text(result) : "") +
         (result.minimum_rank != nullptr ? rank_text(*result.minimum_rank) : "") +
         (noise.Q.size() > 0 ? "\n" : "");
}

std::string derived_text(const Estimate& estimate) {
  std::string out;
  std::size_t width = 22;
  for (const DerivedValue& d : estimate.derived) width = std::max(width, d.name.size());
  for (const DerivedValue& d : estimate.derived) {
    const bool tiny = d.unit == "%" && d.value >= 0.0 && percent_text(d.value)[0] == '<';
    out += fmt::format("{:<{}} {:>10} {:<12} {}\n", d.name, width,
                       tiny ? percent_text(d.value) : value_text(d.value), d.unit,
                       std::isnan(d.se) ? "" : "+- " + error_text(d.se));
  }
  return out.empty() ? out : out + "\n";
}

// When the noise or a coefficient changed, and into what.
std::string history_text(const TimeHistory& history) {
  std::string out;
  constexpr std::size_t kShown = 10;
  for (std::size_t c = 0; c < std::min(kShown, history.changes.size()); ++c) {
    const TimeHistory::Change& change = history.changes[c];
    std::string line =
        fmt::format("change at {:.6g} s, detected at {:.6g} s:", change.since, change.found);
    for (std::size_t i = 0; i < history.names.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      line += fmt::format("{} {} {:.4g} -> {:.4g}{}", i > 0 ? "," : "", history.names[i],
                          change.before[at], change.after[at],
                          history.units[i].empty() ? "" : " " + history.units[i]);
    }
    out += wrapped(line, 7);
  }
  if (history.changes.size() > kShown) {
    out += fmt::format("and {} more changes\n", history.changes.size() - kShown);
  }
  return out.empty() ? "" : out + "\n";
}

// "steady-state filter" of "steady_state_filter": two words before a noun take a hyphen.
std::string evaluation_in_words(const std::string& method) {
  if (method == "time_varying_filter") return "time-varying filter";
  if (method == "steady_state_filter") return "steady-state filter";
  return in_words(method);
}

std::string objective_text(const Objective& objective) {
  std::string out;
  if (!std::isnan(objective.log_likelihood)) {
    out += fmt::format("log-likelihood {:.6f}", objective.log_likelihood);
    if (!std::isnan(objective.log_likelihood_start))
      out += fmt::format(" (start {:.6f})", objective.log_likelihood_start);
    if (!std::isnan(objective.aic))
      out += fmt::format(", AIC {:.2f}, BIC {:.2f}", objective.aic, objective.bic);
    out += "\n";
  }
  if (objective.starts > 0) {
    const std::string starts = objective.starts == 1
                                   ? "from 1 start"
                                   : fmt::format("{} of {} starts reached the same optimum",
                                                 objective.starts_at_optimum, objective.starts);
    const std::string by = objective.evaluation_method.empty()
                               ? ""
                               : " by " + evaluation_in_words(objective.evaluation_method);
    out += wrapped(fmt::format("search {}, {} iterations, {} evaluations{}", starts,
                               objective.iterations, objective.evaluations, by),
                   7);
  }
  return out;
}

std::string fit_text(const char* kind, const std::vector<ChannelFit>& fits, int width) {
  std::string out;
  for (const ChannelFit& fit : fits) {
    out +=
        fmt::format("fit    {:<{}} {:<12} {:>7} %   rmse {}{}{}\n", kind, width, fit.channel,
                    std::isfinite(fit.fit_percent) ? fmt::format("{:.2f}", fit.fit_percent) : "-",
                    std::isfinite(fit.rmse) ? fmt::format("{:.4g}", fit.rmse) : "-",
                    fit.unit.empty() ? "" : " ", fit.unit);
  }
  return out;
}

std::string fits_text(const RecordingFit& fit) {
  const int width = fit.hold_out_one_step.empty() ? 12 : 18;
  return fit_text("one step", fit.one_step, width) + fit_text("simulation", fit.simulation, width) +
         fit_text("hold-out", fit.hold_out, width) +
         fit_text("one step, hold-out", fit.hold_out_one_step, width);
}

std::string references_text(const std::vector<ReferenceFit>& references) {
  std::string out;
  for (const ReferenceFit& r : references) {
    const std::string unit = r.unit.empty() ? "" : " " + r.unit;
    out += fmt::format(
        "states {:<12} rmse {:.4g}{}, bias {:.3g}, sd {:.4g}, NEES {:.3g}, {:.1f} % "
        "in the 95 % band, log-score {:.3f}\n",
        r.name, r.rmse, unit, r.bias, r.sd, r.nees, 100.0 * r.coverage, r.log_score);
  }
  return out;
}

std::string tests_text(const std::vector<TestResult>& tests) {
  std::string out;
  for (const TestResult& test : tests) {
    out += fmt::format(
        "test   {:<17} {:<10} {:>9.4g}{}{}  {}\n", test.id, test.channel, test.value,
        std::isnan(test.interval[0])
            ? ""
            : fmt::format(" in {:.4g} .. {:.4g}", test.interval[0], test.interval[1]),
        std::isnan(test.p) ? "" : fmt::format("  p {:.2g}", test.p), test.pass ? "pass" : "FAIL");
  }
  return out;
}

// What fits is left as it is: a table's columns.
std::string notes_text(const Estimate& estimate) {
  std::string out;
  for (const std::string& note : estimate.notes) {
    out += note.size() <= kLineWidth ? note + "\n" : wrapped(note, 7);
  }
  return out;
}

std::string status_text(const Estimate& estimate) {
  return "\n" + wrapped("status " + to_string(estimate.status) + ": " + estimate.message, 7);
}

std::string bound_report(const ResultSections& result) {
  const Estimate& estimate = *result.core;
  std::string out =
      wrapped(fmt::format("bound: {}, {} samples", estimate.model_name, result.bound->samples), 4);
  for (const InputRecord& input : estimate.inputs) out += "inputs " + input.path + "\n";
  return out + "\n" + bound_text(result) + excess_text(result) + unidentifiable_text(estimate) +
         status_text(estimate);
}

std::string handling_report(const ResultSections& result) {
  const Estimate& estimate = *result.core;
  return head_text(estimate) + handling_text(*result.handling) + notes_text(estimate) +
         findings_text(printed(estimate.findings)) + status_text(estimate);
}

}  // namespace

std::string console_report(const ResultSections& result) {
  if (result.bound != nullptr) return bound_report(result);
  if (result.handling != nullptr) return handling_report(result);
  const Estimate& estimate = *result.core;
  // The table of a comparison has its tests.
  const bool has_tests = result.tests != nullptr && estimate.objective.method != "compare";
  return head_text(estimate) + parameter_text(estimate) + posterior_text(result) + "\n" +
         noise_text(result) + derived_text(estimate) +
         (result.time_history != nullptr ? history_text(*result.time_history) : "") +
         (result.shaping != nullptr ? shaping_text(*result.shaping) : "") +
         objective_text(estimate.objective) +
         (result.fit != nullptr ? fits_text(*result.fit) + references_text(result.fit->references)
                                : "") +
         (has_tests ? tests_text(*result.tests) : "") + notes_text(estimate) +
         unidentifiable_text(estimate) + findings_text(printed(estimate.findings)) +
         status_text(estimate);
}

}  // namespace identikal
