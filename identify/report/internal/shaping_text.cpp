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
  for (std::size_t i = 0; s.with.size() > 0 && i < s.channels.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    out +=
        fmt::format("\nheld out: rms prediction error of {}{}\n  steps   white    shaped  gain\n",
                    s.channels[i], s.units[i].empty() ? "" : " [" + s.units[i] + "]");
    for (std::size_t h = 0; h < s.horizons.size(); ++h) {
      const auto column = static_cast<Eigen::Index>(h);
      const double without = s.without(row, column), with = s.with(row, column);
      if (std::isnan(without) || std::isnan(with)) continue;
      out += fmt::format("  {:>5}  {:<8.4g} {:<8.4g} {:>3.0f} %\n", s.horizons[h], without, with,
                         100.0 * (1.0 - with / without));
    }
  }
  if (std::isnan(s.held_out_with)) return out;
  return out + fmt::format("  log-likelihood {:.2f} white, {:.2f} shaped\n", s.held_out_without,
                           s.held_out_with);
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
