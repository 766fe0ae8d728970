#include "identify/result/csv.h"

#include <cmath>

#include <fmt/format.h>

namespace identikal {
std::string csv_cell(const std::string& text) {
  if (!text.starts_with('#') && text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + "\"";
}

std::string csv_cell(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : std::string();
}

std::string csv_heading(const std::string& name, const std::string& unit) {
  return csv_cell(name + (unit.empty() ? "" : " [" + unit + "]"));
}

std::string course_csv(const TimeHistory& course, const Series& series) {
  std::string out = "time [s]";
  for (std::size_t i = 0; i < course.names.size(); ++i) {
    out += "," + csv_heading(course.names[i], course.units[i]) + "," +
           csv_heading(course.names[i] + "_sd", course.units[i]);
  }
  out += ",log_alarm\n";
  for (Eigen::Index t = 0; t < course.mean.cols(); ++t) {
    out += fmt::format("{:.12g}", series.time[t]);
    for (Eigen::Index i = 0; i < course.mean.rows(); ++i) {
      out += "," + csv_cell(course.mean(i, t)) + "," + csv_cell(course.sd(i, t));
    }
    out += "," + csv_cell(course.log_alarm[t]) + "\n";
  }
  return out;
}

std::string spectrum_csv(const Shaping& s) {
  std::string out = "frequency [rad/s],band_low,band_high";
  for (const std::string& channel : s.channels) {
    out += "," + csv_heading(channel + "_white", "");
    if (s.spectrum_shaped.size() > 0) out += "," + csv_heading(channel + "_shaped", "");
  }
  out += "\n";
  for (Eigen::Index k = 0; k < s.spectrum_white.cols(); ++k) {
    out += csv_cell(s.frequency[k]) + "," + csv_cell(s.band[0]) + "," + csv_cell(s.band[1]);
    for (Eigen::Index i = 0; i < s.spectrum_white.rows(); ++i) {
      out += "," + csv_cell(s.spectrum_white(i, k));
      if (s.spectrum_shaped.size() > 0) out += "," + csv_cell(s.spectrum_shaped(i, k));
    }
    out += "\n";
  }
  return out;
}

std::string residuals_csv(const Series& s) {
  const bool several = !s.recording.empty() && s.recording.back() > 1;
  std::string out = several ? "recording,time [s]" : "time [s]";
  for (std::size_t i = 0; i < s.channels.size(); ++i) {
    for (const char* kind : {"", "_predicted"}) {
      out += "," + csv_heading(s.channels[i] + kind, s.units[i]);
    }
    out += "," + csv_heading(s.channels[i] + "_standardised", "");
  }
  out += "\n";
  for (Eigen::Index t = 0; t < s.time.size(); ++t) {
    if (several) out += fmt::format("{},", s.recording[t]);
    out += fmt::format("{:.12g}", s.time[t]);
    for (Eigen::Index i = 0; i < s.measured.rows(); ++i) {
      out += "," + csv_cell(s.measured(i, t)) + "," + csv_cell(s.predicted(i, t)) + ",";
      if (s.standardised.size() > 0) out += csv_cell(s.standardised(i, t));
    }
    out += "\n";
  }
  return out;
}

}  // namespace identikal
