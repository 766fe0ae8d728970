#include "identify/report/handling_text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "identify/report/internal/text_layout.h"

namespace identikal {
namespace {

using Value = HandlingSheet::Value;

/// Sentences that the table refers to by their numbers.
class Footnotes {
 public:
  /// "[2]"; nothing for an empty sentence.
  std::string mark(const std::string& sentence) {
    if (sentence.empty()) return "";
    auto at = std::find(sentences_.begin(), sentences_.end(), sentence);
    if (at == sentences_.end()) at = sentences_.insert(at, sentence);
    return fmt::format("[{}]", at - sentences_.begin() + 1);
  }
  std::string text() const {
    std::string out;
    for (std::size_t i = 0; i < sentences_.size(); ++i) {
      out += wrapped(fmt::format("  [{}] {}", i + 1, sentences_[i]), 6);
    }
    return out;
  }

 private:
  std::vector<std::string> sentences_;
};

/// Two digits of the error, and as many of the value as that leaves.
/// @param most  decimals
std::string with_error(const Value& v, int most = 9) {
  if (!std::isfinite(v.value)) return "-";
  if (!std::isfinite(v.se)) return fmt::format("{:.4g}", v.value);
  if (!(v.se > 0.0)) return fmt::format("{:.4g} +- 0", v.value);
  const int decimals = std::clamp(1 - static_cast<int>(std::floor(std::log10(v.se))), 0, most);
  return fmt::format("{:.{}f} +- {:.{}f}", v.value, decimals, v.se, decimals);
}

std::string figures_text(const HandlingSheet::Section& section) {
  std::string out = section.standard + " " + section.title + "\n";
  Footnotes notes;
  if (!section.figures.empty()) {
    std::size_t name = 6, log = 3;
    std::vector<std::array<std::string, 3>> rows;
    for (const HandlingSheet::Figure& f : section.figures) {
      const auto cell = [&](const Value& v) {
        const std::string mark = notes.mark(v.why);
        return with_error(v) + (mark.empty() ? "" : " " + mark);
      };
      rows.push_back({f.name, cell(f.log), cell(f.model)});
      name = std::max(name, f.name.size());
      log = std::max(log, rows.back()[1].size());
    }
    out +=
        fmt::format("  {:<{}}  {:<7}  {:<{}}  {}\n", "figure", name, "unit", "log", log, "model");
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const std::string& unit = section.figures[i].unit;
      out += fmt::format("  {:<{}}  {:<7}  {:<{}}  {}\n", rows[i][0], name,
                         unit.empty() ? "-" : unit, rows[i][1], log, rows[i][2]);
    }
  }
  out += notes.text();
  for (const std::string& remark : section.remarks) out += wrapped("  " + remark, 2);
  return out + "\n";
}

std::string curve_text(const HandlingSheet& sheet) {
  if (sheet.curve.empty()) return "";
  std::string out = fmt::format("  characteristic curve, angle of the {}\n", sheet.steering);
  const auto line = [](const auto&... cells) {
    return fmt::format("  {:>5} {:>3} {:>14} {:>6} {:>16} {:>6} {:>15} {:>6}\n", cells...);
  };
  out +=
      line("ay", "t", "angle, log", "model", "yaw gain, log", "model", "sideslip, log", "model") +
      line("m/s^2", "s", "deg", "deg", "1/s", "1/s", "deg", "deg");
  const auto model = [](const Value& v) {
    return std::isfinite(v.value) ? fmt::format("{:.3g}", v.value) : std::string("-");
  };
  for (const HandlingSheet::CurvePoint& p : sheet.curve) {
    out += line(fmt::format("{:.2f}", p.ay), fmt::format("{:.0f}", p.seconds),
                with_error(p.angle_log, 2), model(p.angle_model), with_error(p.yaw_gain_log, 4),
                model(p.yaw_gain_model), with_error(p.sideslip_log, 3), model(p.sideslip_model));
  }
  return out + "\n";
}

constexpr std::array kShown = {0.2, 0.5, 0.8, 1.0, 1.4, 2.0, 2.4, 3.0};  // [Hz]

std::string response_text(const HandlingSheet& sheet) {
  std::string out =
      wrapped(fmt::format("  response to the angle of the {}: at {:.3g} km/h, the log's where "
                          "its coherence is 0.9 or more",
                          sheet.steering, 3.6 * sheet.speed),
              2);
  const auto line = [](const auto&... cells) {
    return fmt::format("  {:>4} {:>5} {:>20} {:>20} {:>12} {:>12}\n", cells...);
  };
  for (const HandlingSheet::Response& r : sheet.responses) {
    const std::string unit = r.unit == "-" ? "" : ", " + r.unit;
    out += line("Hz", "coh.", r.output + ", log" + unit, "model", "phase, log", "model, deg");
    for (const HandlingSheet::ResponsePoint& p : r.points) {
      const bool is_shown = std::any_of(kShown.begin(), kShown.end(),
                                        [&](double f) { return std::abs(p.frequency - f) < 1e-6; });
      if (!is_shown) continue;
      out += line(fmt::format("{:.1f}", p.frequency),
                  std::isfinite(p.coherence) ? fmt::format("{:.3f}", p.coherence) : "-",
                  with_error(p.gain_log), with_error(p.gain_model), with_error(p.phase_log, 1),
                  with_error(p.phase_model, 1));
    }
  }
  return out + "\n";
}

}  // namespace

std::string handling_text(const HandlingSheet& sheet) {
  std::string out;
  for (const HandlingSheet::Section& section : sheet.sections) {
    out += figures_text(section);
    if (section.standard == "ISO 4138") out += curve_text(sheet);
    if (section.standard == "ISO 7401") out += response_text(sheet);
  }
  for (const std::string& remark : sheet.remarks) out += wrapped(remark, 2);
  if (!sheet.remarks.empty()) out += "\n";
  return out + "Behind +- stand standard errors.\n";
}

}  // namespace identikal
