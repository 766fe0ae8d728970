#include "identify/report/survey_text.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "identify/report/internal/text_layout.h"
#include "identify/report/internal/verdict_text.h"

namespace identikal {
namespace {

// Names of columns may be of any length.
std::string fitting(const std::string& name, std::size_t width) {
  return name.size() <= width ? name : name.substr(0, width - 2) + "..";
}

std::string printed(double value, const char* format = "{:.4g}") {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : "-";
}

std::string share(double value) { return printed(100.0 * value, "{:.0f}") + " %"; }

// Plain where YAML takes it as text; quoted otherwise.
std::string yaml(const std::string& text) {
  bool plain = !text.empty() && (std::isalpha(static_cast<unsigned char>(text[0])) != 0);
  for (const char c : text) {
    plain = plain && (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '.' ||
                      c == '/' || c == '^');
  }
  if (plain) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += c;
  }
  return out + "\"";
}

}  // namespace

std::string mapping_text(const VehicleSurvey& survey) {
  std::string out;
  if (!survey.time_column.empty()) {
    out += fmt::format("time: {{column: {}{}{}}}\n", yaml(survey.time_column),
                       survey.time_unit.empty() ? "" : ", unit: " + yaml(survey.time_unit),
                       survey.restarts ? ", runs: restart" : "");
  }
  for (const char* list : {"inputs", "outputs"}) {
    std::string lines;
    for (const VehicleSurvey::Proposal& p : survey.mapping) {
      if (p.list != list) continue;
      lines += fmt::format("  {}: {{column: {}", p.name, yaml(p.column));
      if (!p.unit.empty()) lines += ", unit: " + yaml(p.unit);
      if (p.scale != 1.0) lines += fmt::format(", scale: {:g}", p.scale);
      if (p.offset != 0.0) lines += fmt::format(", offset: {:.6g}", p.offset);
      if (p.delay != 0.0) lines += fmt::format(", delay: {:.3g} s", p.delay);
      lines += "}\n";
    }
    if (!lines.empty()) out += fmt::format("{}:\n{}", list, lines);
  }
  return out + fmt::format("use_when: \"vx > {:g}\"\n", survey.least_speed);
}

namespace {

std::string signals_text(const VehicleSurvey& survey) {
  if (survey.signals.empty()) return "";
  std::string out = fmt::format("{:<19} {:<11} {:<7} {:>6} {:>9} {:>9} {:>5} {:>7}\n", "column",
                                "taken as", "unit", "Hz", "min", "max", "held", "step");
  std::string straight;
  for (const VehicleSurvey::Signal& s : survey.signals) {
    out += fmt::format("{:<19} {:<11} {:<7} {:>6} {:>9} {:>9} {:>5} {:>7}\n", fitting(s.column, 19),
                       s.quantity, s.unit, printed(s.rate), printed(s.min), printed(s.max),
                       std::isfinite(s.held) ? fmt::format("{:.0f}%", 100.0 * s.held) : "-",
                       printed(s.quantum, "{:.2g}"));
    if (!std::isfinite(s.straight)) continue;
    straight += fmt::format("{}{} {:.3g} {}", straight.empty() ? "straight on: " : ", ", s.column,
                            s.straight, s.unit);
  }
  return straight.empty() ? out : out + wrapped(straight + " (median)", 2);
}

std::string relations_text(const VehicleSurvey& survey) {
  if (survey.relations.empty()) return "";
  std::string out = fmt::format("\n{:<11} {:<11} {:>11} {:>8} {:>17} {:>17}\n", "expected", "seen",
                                "correlation", "slope", "seen later by", "next peak");
  for (const VehicleSurvey::Relation& r : survey.relations) {
    out += fmt::format("{:<11} {:<11} {:>11} {:>8} {:>17} {:>17}\n", r.expected, r.seen,
                       printed(r.correlation, "{:.3f}"), printed(r.slope, "{:.3g}"),
                       std::isfinite(r.lag)
                           ? fmt::format("{:.3f} +- {} s", r.lag, printed(r.lag_se, "{:.3f}"))
                           : "-",
                       std::isfinite(r.other_lag)
                           ? fmt::format("{:.2f} at {:.2f} s", r.other_correlation, r.other_lag)
                           : "-");
  }
  return out;
}

std::string lateral_text(const VehicleSurvey& survey) {
  if (!(survey.lateral_acceleration[0] > 0.0)) return "";
  constexpr const char* kBins[] = {"1", "2", "3", "4", "6", "8", "more"};
  std::string line = "[m/s^2] up to";
  double far = 0.0;
  for (std::size_t k = 0; k < survey.lateral_acceleration.size(); ++k) {
    line += fmt::format(" {}: {}", kBins[k], share(survey.lateral_acceleration[k]));
    if (k >= 4) far += survey.lateral_acceleration[k];
  }
  const std::string out = in_lines("|ay|    ", line, 8);
  if (!(far > 0.05)) return out;
  return out + in_lines("        ",
                        fmt::format("{} lies above 4 m/s^2, where tyres leave the linear range: a "
                                    "curve for the tyre, or those rows left out",
                                    share(far)),
                        8);
}

std::string driving_text(const VehicleSurvey& survey) {
  std::string out;
  if (std::isfinite(survey.duration)) {
    out +=
        fmt::format("time    {:.1f} s, {:.1f} s of it above {:g} m/s; standing {}, reversing {}\n",
                    survey.duration, survey.moving, survey.least_speed, share(survey.standstill),
                    share(survey.reversing));
  }
  if (std::isfinite(survey.speed[2])) {
    out += fmt::format(
        "turning at {:.3g} to {:.3g} m/s, 5 to 95 % {:.3g} to {:.3g}; {} to the left\n",
        survey.speed[0], survey.speed[4], survey.speed[1], survey.speed[3], share(survey.left));
  }
  out += lateral_text(survey);
  if (std::isfinite(survey.steering_above_0_5_hz)) {
    out += fmt::format(
        "steering power above 0.5 Hz {:.2g} %, above 1.5 Hz {:.2g} %; held {} of turning\n",
        100.0 * survey.steering_above_0_5_hz, 100.0 * survey.steering_above_1_5_hz,
        share(survey.steady));
  }
  return out;
}

}  // namespace

std::string survey_text(const VehicleSurvey& survey) {
  std::string out = signals_text(survey) + relations_text(survey) + "\n" + driving_text(survey);
  out += "\nwhat this recording can determine, before any fit\n";
  for (const VehicleSurvey::Verdict& v : survey.identifiable) {
    out += in_lines(fmt::format("  {:<14} {:<11} ", v.of, v.answer), v.why, 29);
  }
  out += "\n" + findings_text(survey.findings);
  if (survey.findings.empty()) out += "no faults found\n";
  if (survey.mapping.empty()) return out;
  return out + "\nproposed for the model file (no file is changed):\nmodel: single-track\n" +
         mapping_text(survey);
}

std::string proposed_model(const VehicleSurvey& survey, const std::string& recording) {
  std::string out = fmt::format(
      "# Proposed after a survey of {}. What has no value here, no recording tells.\n", recording);
  for (const Finding& finding : survey.findings) {
    if (finding.severity != Severity::serious) continue;
    out +=
        fmt::format("# To be settled first: {} ({})\n", finding.text, kind_of(finding.code).name);
  }
  out += fmt::format("identikal: 1\nname: {}\nmodel: single-track\n",
                     yaml(std::filesystem::path(recording).stem().string()));
  out +=
      "parameters:\n"
      "  m:                 # kg, as driven: weigh the car\n"
      "  a:                 # m, front axle to centre of gravity: wheelbase times the rear axle's "
      "share of m\n"
      "  b:                 # m, centre of gravity to rear axle\n";
  const bool at_wheel = std::any_of(
      survey.mapping.begin(), survey.mapping.end(),
      [](const VehicleSurvey::Proposal& p) { return p.name == "steering_wheel_angle"; });
  if (at_wheel) {
    out += "  steering_ratio:    # angle of the steering wheel over that of the road wheels\n";
  }
  out +=
      "  Iz: {value: 2000 kg m^2}\n"
      "  Cf: {value: 80000 N/rad}\n"
      "  Cr: {value: 80000 N/rad}\n";
  return out + mapping_text(survey);
}

}  // namespace identikal
