#include "identify/report/internal/shaping_text.h"

#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "identify/report/internal/text_layout.h"

namespace identikal {
namespace {

std::string candidates_text(const std::vector<Shaping::Candidate>& candidates) {
  std::string out = "\nnoise        channels     poles zeros  log-likelihood           BIC\n";
  for (const Shaping::Candidate& c : candidates) {
    const auto count = [&c](int n) { return c.order > 0 ? std::to_string(n) : ""; };
    out += fmt::format("{:<12} {:<12} {:>5} {:>5}  {:>14.3f}  {:>12.2f}\n", c.noise_source,
                       c.channels, count(c.order), count(c.zeros), c.log_likelihood, c.bic);
  }
  return out;
}

std::string held_out_text(const Shaping& s) {
  std::string out;
  int steps_before = 0;
  for (const Shaping::Prediction& p : s.predictions) {
    if (p.steps <= steps_before || steps_before == 0) {
      out +=
          fmt::format("\nheld out: rms prediction error of {}{}\n  steps   white    shaped  gain\n",
                      p.channel, p.unit.empty() ? "" : " [" + p.unit + "]");
    }
    steps_before = p.steps;
    if (std::isnan(p.rmse_without) || std::isnan(p.rmse_with)) continue;
    out += fmt::format("  {:>5}  {:<8.4g} {:<8.4g} {:>3.0f} %\n", p.steps, p.rmse_without,
                       p.rmse_with, 100.0 * (1.0 - p.rmse_with / p.rmse_without));
  }
  if (std::isnan(s.held_out_log_likelihood_with)) return out;
  return out + fmt::format(
                   "  log-likelihood {:.2f} white, {:.2f} shaped\n"
                   "  shaped: what the rest alone asks for ({})\n",
                   s.held_out_log_likelihood_without, s.held_out_log_likelihood_with,
                   s.held_out_choice);
}

}  // namespace

std::string shaping_text(const Shaping& s) {
  constexpr double kTurn = 2.0 * std::numbers::pi;  // rad
  std::string out;
  if (!std::isnan(s.peak)) {
    out += wrapped(fmt::format("whiteness p {:.2g}; highest peak of the innovations' spectrum "
                               "with white noise at {:.4g} rad/s ({:.4g} Hz), p {:.2g}",
                               s.whiteness_p, s.peak, s.peak / kTurn, s.peak_p),
                   7);
  }
  if (s.candidates.size() > 1) out += candidates_text(s.candidates);
  for (const Shaping::Pole& pole : s.poles) {
    out += fmt::format("pole   {:.4g} rad/s ({:.4g} Hz), radius {:.5f}\n", pole.frequency,
                       pole.frequency / kTurn, pole.radius);
  }
  if (!std::isnan(s.output_peak)) {
    out += fmt::format("peak   of the outputs' spectrum at {:.4g} rad/s ({:.4g} Hz)\n",
                       s.output_peak, s.output_peak / kTurn);
  }
  return out + held_out_text(s) + "\n";
}

}  // namespace identikal
