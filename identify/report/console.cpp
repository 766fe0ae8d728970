#include "identify/report/console.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

namespace identikal {
namespace {

constexpr std::size_t kLineWidth = 80;

// Breaks a sentence at blanks so that no line is longer than the page; following lines are
// indented.
std::string wrapped(const std::string& text, std::size_t indent) {
  std::string out, line, word;
  const auto flush_word = [&] {
    if (!line.empty() && line.size() + 1 + word.size() > kLineWidth) {
      out += line + "\n";
      line = std::string(indent, ' ') + word;
    } else {
      line += (line.empty() || word.empty() ? "" : " ") + word;
    }
    word.clear();
  };
  // Blanks at the begin belong to the layout.
  std::size_t begin = std::min(text.find_first_not_of(' '), text.size());
  line = text.substr(0, begin);
  bool first = true;
  for (std::size_t i = begin; i <= text.size(); ++i) {
    if (i < text.size() && text[i] != ' ') {
      word += text[i];
      continue;
    }
    if (first) {
      line += word;
      word.clear();
      first = false;
    } else {
      flush_word();
    }
  }
  return out + line + "\n";
}

std::string value_text(double value) {
  return !std::isfinite(value) ? "-" : fmt::format("{:.6g}", value);
}
std::string error_text(double value) {
  return !std::isfinite(value) ? "-" : fmt::format("{:.3g}", value);
}

// Below this a loss is rounding, or as good as none.
constexpr double kLeastPercent = 1e-3;

std::string percent_text(double percent) {
  if (percent < kLeastPercent) return fmt::format("< {:g}", kLeastPercent);
  return percent < 100.0 || percent > 1e6 ? fmt::format("{:.2g}", percent)
                                          : fmt::format("{:.0f}", percent);
}

std::string derived_text(const DerivedValue& d) {
  const bool tiny = d.unit == "%" && d.value >= 0.0 && d.value < kLeastPercent;
  return tiny ? percent_text(d.value) : value_text(d.value);
}

// The free parameters as a table, what is known in one sentence below it.
std::string parameter_table(const Estimate& estimate) {
  std::size_t name = 9, unit = 4;
  bool any_free = false;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    any_free = true;
    name = std::max(name, p.name.size());
    unit = std::max(unit, p.unit.size());
  }
  std::string out, known;
  if (any_free) {
    out = fmt::format("{:<{}} {:<{}} {:>10} {:>9} {:>20} {:>9}  {}\n", "parameter", name, "unit",
                      unit, "value", "se", "95 % interval", "bound se", "verdict");
  }
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.neutral) continue;
    if (p.fixed) {
      known += fmt::format("{} {} = {:.6g}{}{}", known.empty() ? "known " : ",", p.name, p.value,
                           p.unit.empty() ? "" : " ", p.unit);
      continue;
    }
    const bool interval = !std::isnan(p.ci95[0]) && !std::isnan(p.ci95[1]);
    std::string verdict = to_string(p.verdict);
    if (!p.with.empty()) {
      verdict += " with";
      for (const std::string& other : p.with) verdict += " " + other;
    }
    out += fmt::format("{:<{}} {:<{}} {:>10} {:>9} {:>20} {:>9}  {}\n", p.name, name,
                       p.unit.empty() ? "-" : p.unit, unit, value_text(p.value), error_text(p.se),
                       interval ? fmt::format("{:.5g} .. {:.5g}", p.ci95[0], p.ci95[1]) : "-",
                       error_text(p.crb_se), verdict);
  }
  std::string profiles;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (std::isnan(p.profile95[0])) continue;
    profiles += fmt::format("{} {} {:.5g} .. {:.5g}", profiles.empty() ? "profile 95 % " : ",",
                            p.name, p.profile95[0], p.profile95[1]);
  }
  if (!profiles.empty()) out += wrapped(profiles, 13);
  return known.empty() ? out : out + wrapped(known, 7);
}

// The table of a bound: there are no estimates, and so no errors.
std::string bound_table(const Estimate& estimate) {
  const Bound& bound = *estimate.bound;
  std::size_t name = 9;
  for (const EstimatedParameter& p : estimate.parameters) name = std::max(name, p.name.size());
  const bool wanted = !std::isnan(bound.accuracy);
  std::string out = fmt::format(
      "{:<{}} {:>10} {:<6} {:>9} {:>8} {:>13}{}  {}\n", "parameter", name, "value", "unit",
      "bound se", "%", "states known",
      wanted ? fmt::format(" {:>12}", fmt::format("n for {:.4g} %", 100.0 * bound.accuracy)) : "",
      "verdict");
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[i];
    if (p.fixed) continue;
    const double percent = 100.0 * p.crb_se / std::abs(p.value);
    std::string verdict = to_string(p.verdict);
    if (!p.with.empty()) {
      verdict += " with";
      for (const std::string& other : p.with) verdict += " " + other;
    }
    out += fmt::format(
        "{:<{}} {:>10} {:<6} {:>9} {:>8} {:>13}{}  {}\n", p.name, name, value_text(p.value),
        p.unit.empty() ? "-" : p.unit, error_text(p.crb_se),
        std::isfinite(percent) ? fmt::format("{:.4g}", percent) : "-",
        error_text(bound.complete_se[i]),
        wanted ? fmt::format(" {:>12}", std::isnan(bound.samples_needed[i])
                                            ? "-"
                                            : fmt::format("{:.0f}", bound.samples_needed[i]))
               : "",
        verdict);
  }
  const std::string what = "bound se: the smallest standard deviation from outputs alone";
  if (bound.simulated == 0) {
    return out + wrapped(what +
                             ". states known: if the states were measured as well, which no "
                             "method can stand in for.",
                         2);
  }
  const std::string within = std::isnan(bound.simulation_se)
                                 ? ""
                                 : fmt::format("; chance leaves it within {:.2g} % of itself",
                                               100.0 * bound.simulation_se);
  return out + wrapped(fmt::format("{}, by the mean information of {} recordings simulated with "
                                   "seed {}, as the filter sees it{}.",
                                   what, bound.simulated, bound.seed, within),
                       2);
}

std::string matrix_text(const std::string& name, const Eigen::MatrixXd& M) {
  if (M.size() == 0) return "";
  std::string out = name + " = [";
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    for (Eigen::Index j = 0; j < M.cols(); ++j) {
      out += fmt::format("{}{:.6g}", j > 0 ? ", " : (i > 0 ? "; " : ""), M(i, j));
    }
  }
  return wrapped(out + "]", 4);
}

// Where a Bayesian estimate comes from.
std::string posterior_text(const Estimate& estimate) {
  if (!estimate.posterior) return "";
  const Posterior& p = *estimate.posterior;
  std::string most, prior;
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    if (estimate.parameters[i].fixed) continue;
    const std::string& name = estimate.parameters[i].name;
    most += fmt::format("{} {} {:.5g}", most.empty() ? "most probable" : ",", name, p.map[i]);
    prior += fmt::format("{} {} {}", prior.empty() ? "prior" : ",", name, p.prior[i]);
  }
  return wrapped(most, 14) + wrapped(prior, 6) +
         wrapped(fmt::format("posterior by {}: {} points, {:.0f} {}; log evidence {:.3f}", p.method,
                             p.points, p.effective,
                             p.method == "sequential Monte Carlo" ? "distinct" : "effective",
                             p.log_evidence),
                 10);
}

// What the uncertainty of the noise means for the filter.
std::string gain_text(const Estimate& estimate) {
  const Bound& bound = *estimate.bound;
  if (bound.gain_se.size() == 0) return "";
  std::string out = "\n" + matrix_text("K", estimate.noise.K_steady) +
                    matrix_text("standard deviation of K", bound.gain_se);
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    if (bound.gain_change[i].size() == 0) continue;
    out += matrix_text("change of K for 1 % more of " + estimate.parameters[i].name,
                       bound.gain_change[i]);
  }
  return out;
}

// When the noise changed, and into what.
std::string course_text(const Estimate& estimate) {
  if (!estimate.time_history) return "";
  const TimeHistory& course = *estimate.time_history;
  std::string out;
  constexpr std::size_t kShown = 10;
  for (std::size_t c = 0; c < std::min(kShown, course.changes.size()); ++c) {
    const TimeHistory::Change& change = course.changes[c];
    std::string line =
        fmt::format("change at {:.6g} s, found at {:.6g} s:", change.since, change.found);
    for (std::size_t i = 0; i < course.names.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      line += fmt::format("{} {} {:.4g} -> {:.4g}{}", i > 0 ? "," : "", course.names[i],
                          change.before[at], change.after[at],
                          course.units[i].empty() ? "" : " " + course.units[i]);
    }
    out += wrapped(line, 7);
  }
  if (course.changes.size() > kShown) {
    out += fmt::format("and {} more changes\n", course.changes.size() - kShown);
  }
  return out.empty() ? "" : out + "\n";
}

// Is there colour, which filter explains it best, and what is it worth?
std::string shaping_text(const Estimate& estimate) {
  if (!estimate.shaping) return "";
  constexpr double kTurn = 6.283185307179586;  // rad
  const Shaping& s = *estimate.shaping;
  std::string out;
  if (!std::isnan(s.peak)) {
    out += wrapped(fmt::format("colour p {:.2g}; highest peak of the white model's innovations at "
                               "{:.4g} rad/s ({:.4g} Hz), p {:.2g}",
                               s.whiteness_p, s.peak, s.peak / kTurn, s.peak_p),
                   7);
  }
  if (s.candidates.size() > 1) {
    out += "\nnoise        channels     poles zeros  log-likelihood           BIC\n";
    for (const Shaping::Candidate& c : s.candidates) {
      const auto count = [&c](int n) { return c.order > 0 ? std::to_string(n) : ""; };
      out += fmt::format("{:<12} {:<12} {:>5} {:>5}  {:>14.3f}  {:>12.2f}\n", c.noise_source,
                         c.channels, count(c.order), count(c.zeros), c.log_likelihood, c.bic);
    }
  }
  for (const Shaping::Pole& pole : s.poles) {
    out += fmt::format("pole   {:.4g} rad/s ({:.4g} Hz), radius {:.5f}\n", pole.frequency,
                       pole.frequency / kTurn, pole.radius);
  }
  if (!std::isnan(s.output_peak)) {
    out += fmt::format("peak   of the outputs' spectrum at {:.4g} rad/s ({:.4g} Hz)\n",
                       s.output_peak, s.output_peak / kTurn);
  }
  for (std::size_t i = 0; s.with.size() > 0 && i < s.channels.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    out += fmt::format("\nheld out: rms error of {} {}\n  steps   white    shaped  gain\n",
                       s.channels[i], s.units[i].empty() ? "" : "[" + s.units[i] + "]");
    for (std::size_t h = 0; h < s.horizons.size(); ++h) {
      const auto column = static_cast<Eigen::Index>(h);
      const double without = s.without(row, column), with = s.with(row, column);
      if (std::isnan(without) || std::isnan(with)) continue;
      out += fmt::format("  {:>5}  {:<8.4g} {:<8.4g} {:>3.0f} %\n", s.horizons[h], without, with,
                         100.0 * (1.0 - with / without));
    }
  }
  if (!std::isnan(s.held_out_with)) {
    out += fmt::format("  log-likelihood {:.2f} white, {:.2f} shaped\n", s.held_out_without,
                       s.held_out_with);
  }
  return out + "\n";
}

std::string loss_text(const Estimate& estimate) {
  if (!estimate.excess_mean_square_error) return "";
  const ExcessMeanSquareError& loss = *estimate.excess_mean_square_error;
  if (!loss.reason.empty()) return wrapped("loss not known: " + loss.reason, 5);
  std::string without;
  for (const std::string& name : loss.without) without += (without.empty() ? "" : ", ") + name;
  return wrapped(
      fmt::format("loss {} % of tr P in the mean, {}{}", percent_text(100.0 * loss.relative),
                  estimate.bound ? "at the least" : "by the errors above",
                  without.empty() ? "" : "; what " + without + ", zero here, adds is not known"),
      5);
}

// The trade-off between fit and number of noise sources.
std::string sources_text(const Estimate& estimate) {
  if (!estimate.minimum_rank) return "";
  const RankSelection& s = *estimate.minimum_rank;
  std::string out = fmt::format("\n{:>10} {:>12} {:>12} {:>8} {:>10} {:>10}\n", "penalty",
                                "objective", "tr Q", "sources", "excess", "allowed");
  for (const RankSelection::Step& step : s.curve) {
    out += fmt::format("{:>10.3g} {:>12.6g} {:>12.6g} {:>8} {:>10} {:>10}\n", step.penalty,
                       step.objective, step.trace, step.rank,
                       std::isnan(step.excess) ? "-" : fmt::format("{:.2f}", step.excess),
                       std::isnan(step.allowed) ? "-" : fmt::format("{:.2f}", step.allowed));
  }
  return out + wrapped(fmt::format("sources {} of {}: the fewest whose fit without penalty is no "
                                   "worse than chance allows (chi-square, 99 %)",
                                   s.rank, s.of),
                       8);
}

// The same with the filter's own quantities as the unknowns.
std::string innovation_form_text(const Estimate& estimate) {
  const Bound::InnovationForm& form = estimate.bound->innovation_form;
  if (form.Sigma.size() == 0) return "";
  std::string out = "\nwith K and Sigma as the unknowns, whatever Q and R make them\n" +
                    matrix_text("Sigma", form.Sigma) +
                    matrix_text("standard deviation of K", form.K_se) +
                    matrix_text("standard deviation of Sigma", form.Sigma_se);
  if (std::isnan(form.published_K_se)) return out;
  std::string line = fmt::format("(6.45) of Matisko (2013): K {:.4g}, Sigma {:.4g}",
                                 form.published_K_se, form.published_Sigma_se);
  for (std::size_t i = 0; i < form.published_se.size(); ++i) {
    if (std::isnan(form.published_se[i])) continue;
    line += fmt::format(", {} {:.4g}", estimate.parameters[i].name, form.published_se[i]);
  }
  return out + wrapped(line +
                           "; it takes the state as seen and counts every innovation twice, so "
                           "that it bounds Sigma only.",
                       2);
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

std::string flat_text(const Estimate& estimate) {
  std::string out;
  for (const Identifiability::Direction& d : estimate.identifiability.unidentifiable_directions) {
    std::string line = "flat   the data do not determine the combination";
    for (std::size_t i = 0; i < d.names.size(); ++i)
      line += fmt::format(" {:+.2f} {}", d.weights[i], d.names[i]);
    out += wrapped(line + " (relative to each one's own error)", 7);
  }
  return out;
}

std::string status_text(const Estimate& estimate) {
  return wrapped("\nstatus " + to_string(estimate.status) + ": " + estimate.message, 7);
}

std::string bound_report(const Estimate& estimate) {
  std::string out = wrapped(
      fmt::format("bound: {}, {} samples", estimate.model_name, estimate.bound->samples), 4);
  for (const InputRecord& input : estimate.inputs) out += "inputs " + input.path + "\n";
  return out + "\n" + bound_table(estimate) + gain_text(estimate) + innovation_form_text(estimate) +
         loss_text(estimate) + flat_text(estimate) + status_text(estimate);
}

}  // namespace

std::string console_report(const Estimate& estimate) {
  if (estimate.bound) return bound_report(estimate);
  const std::string& method = estimate.objective.method;
  std::string out =
      wrapped(fmt::format("{}: {}{}", estimate.verb, estimate.model_name,
                          method == estimate.verb ? "" : fmt::format(" ({})", method)),
              4);
  for (const InputRecord& input : estimate.inputs) {
    out += fmt::format("data   {}: {} rows, {} used\n", input.path, input.rows, input.used);
  }
  out += "\n" + parameter_table(estimate);
  if (!estimate.covariance_kind.empty()) out += wrapped("se from " + estimate.covariance_kind, 8);
  out += posterior_text(estimate) + "\n";
  const Noise& noise = estimate.noise;
  out += matrix_text("Q", noise.Q) + matrix_text("R", noise.R) + matrix_text("S", noise.S) +
         matrix_text("K", noise.K_steady);
  out += loss_text(estimate) + sources_text(estimate);
  if (noise.Q.size() > 0) out += "\n";
  for (const DerivedValue& d : estimate.derived) {
    out += fmt::format("{:<22} {:>10} {:<12} {}\n", d.name, derived_text(d), d.unit,
                       std::isnan(d.se) ? "" : "+- " + error_text(d.se));
  }
  if (!estimate.derived.empty()) out += "\n";
  out += course_text(estimate) + shaping_text(estimate);
  const Objective& objective = estimate.objective;
  if (!std::isnan(objective.log_likelihood)) {
    out += fmt::format("log-likelihood {:.6f}", objective.log_likelihood);
    if (!std::isnan(objective.log_likelihood_start))
      out += fmt::format(" (start {:.6f})", objective.log_likelihood_start);
    if (!std::isnan(objective.aic))
      out += fmt::format(", AIC {:.2f}, BIC {:.2f}", objective.aic, objective.bic);
    out += "\n";
  }
  if (objective.starts > 0) {
    out += fmt::format(
        "search {} of {} starts agree, {} iterations, {} evaluations{}\n",
        objective.starts_at_optimum, objective.starts, objective.iterations, objective.evaluations,
        objective.evaluation_method.empty() ? ""
                                            : ", " + objective.evaluation_method + " likelihood");
  }
  const int width = estimate.hold_out_one_step.empty() ? 12 : 18;
  out += fit_text("one step", estimate.one_step, width) +
         fit_text("simulation", estimate.simulation, width) +
         fit_text("hold-out", estimate.hold_out, width) +
         fit_text("one step, hold-out", estimate.hold_out_one_step, width);
  for (const TestResult& test : estimate.tests) {
    if (objective.method == "compare") break;  // its table says the same
    out += fmt::format(
        "test   {:<17} {:<10} {:>9.4g}{}{}  {}\n", test.id, test.channel, test.value,
        std::isnan(test.interval[0])
            ? ""
            : fmt::format(" in {:.4g} .. {:.4g}", test.interval[0], test.interval[1]),
        std::isnan(test.p) ? "" : fmt::format("  p {:.2g}", test.p), test.pass ? "pass" : "FAIL");
  }
  // What fits is left as it is: a table's columns.
  for (const std::string& note : estimate.notes) {
    out += note.size() <= kLineWidth ? note + "\n" : wrapped(note, 7);
  }
  out += flat_text(estimate);
  for (const Warning& w : estimate.warnings) {
    out += wrapped(fmt::format("{:<7}{}: {}",
                               w.severity == "note"      ? "note"
                               : w.severity == "serious" ? "SERIOUS"
                                                         : "warn",
                               (w.severity == "serious" ? " " : "") + w.code, w.text),
                   7);
    if (!w.remedy.empty()) out += wrapped("       -> " + w.remedy, 10);
  }
  return out + status_text(estimate);
}

}  // namespace identikal
