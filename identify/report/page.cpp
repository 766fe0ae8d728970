#include "identify/report/page.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "identify/report/page_template.h"
#include "identify/result/export.h"
#include "identify/result/file.h"
#include "identify/result/schema.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using PageJson = nlohmann::ordered_json;

// Rounds to a power of ten, so that the shortest text of the number is short.
class Rounding {
 public:
  /// To `share` of the range of all finite values, or of the largest where they are all the same.
  Rounding(std::initializer_list<const VectorXd*> parts, double share) {
    double low = HUGE_VAL, high = -HUGE_VAL;
    for (const VectorXd* part : parts) {
      for (const double x : *part) {
        if (!std::isfinite(x)) continue;
        low = std::min(low, x);
        high = std::max(high, x);
      }
    }
    double range = high - low;
    if (!(range > 0.0)) range = std::max(std::abs(low), std::abs(high));
    if (std::isfinite(range) && range > 0.0) {
      exponent_ = static_cast<int>(std::floor(std::log10(range * share)));
    }
  }
  PageJson operator()(double x) const {
    if (!std::isfinite(x)) return nullptr;
    if (std::abs(exponent_) > 200) return x;
    // Division by a whole power of ten gives the double nearest to the decimal number.
    const double power = std::pow(10.0, std::abs(exponent_));
    const double rounded =
        exponent_ < 0 ? std::round(x * power) / power : std::round(x / power) * power;
    if (rounded == std::floor(rounded) && std::abs(rounded) < 1e15) {
      return static_cast<std::int64_t>(rounded);
    }
    return rounded;
  }

 private:
  int exponent_ = -300;
};

constexpr double kLineShare = 5e-5, kTimeShare = 5e-6;

PageJson rounded(const VectorXd& x, const Rounding& rounding) {
  PageJson out = PageJson::array();
  for (const double v : x) out.push_back(rounding(v));
  return out;
}
PageJson rounded(const VectorXd& x, double share = kLineShare) {
  return rounded(x, Rounding({&x}, share));
}
PageJson rounded(const std::vector<double>& x) {
  return rounded(Eigen::Map<const VectorXd>(x.data(), static_cast<Index>(x.size())), 1e-7);
}

// For a logarithmic axis: every number to a share of itself, so that the small ones stay apart.
PageJson rounded_each(const VectorXd& x) {
  PageJson out = PageJson::array();
  for (const double v : x) {
    const VectorXd alone = VectorXd::Constant(1, v);
    out.push_back(Rounding({&alone}, kLineShare)(v));
  }
  return out;
}

PageJson finite(double x) { return std::isfinite(x) ? PageJson(x) : PageJson(nullptr); }

PageJson line(const Line& l) {
  if (l.low.size() == 0) return nullptr;
  const Rounding rounding({&l.low, &l.high}, kLineShare);
  if (l.high.size() == 0) return {{"y", rounded(l.low, rounding)}};
  return {{"lo", rounded(l.low, rounding)}, {"hi", rounded(l.high, rounding)}};
}

PageJson innovations(const InnovationPicture& p) {
  PageJson from_input = PageJson::array();
  for (const VectorXd& r : p.from_input) from_input.push_back(rounded(r));
  return {{"samples", p.samples},        {"mean", finite(p.mean)},
          {"sd", finite(p.sd)},          {"autocorrelation", rounded(p.autocorrelation)},
          {"normal", rounded(p.normal)}, {"seen", rounded(p.seen)},
          {"edges", rounded(p.edges)},   {"count", rounded(p.count, 1e-9)},
          {"outside", p.outside},        {"level", rounded_each(p.level)},
          {"from_input", from_input}};
}

PageJson recording(const RecordingSheet& r) {
  PageJson gaps = PageJson::array(), channels = PageJson::array();
  for (const RecordingSheet::Gap& gap : r.gaps)
    gaps.push_back({{"from", gap.from}, {"to", gap.to}});
  for (const RecordingSheet::ChannelSheet& c : r.channels) {
    channels.push_back({{"name", c.name},
                        {"unit", c.unit},
                        {"input", c.input},
                        {"missing", c.missing},
                        {"low", finite(c.low)},
                        {"mean", finite(c.mean)},
                        {"high", finite(c.high)}});
  }
  return {{"name", r.name},
          {"held", r.held},
          {"rows", r.rows},
          {"from", finite(r.from)},
          {"to", finite(r.to)},
          {"step", finite(r.step)},
          {"longest_step", finite(r.longest_step)},
          {"gap_count", r.gap_count},
          {"gaps", gaps},
          {"channels", channels}};
}

PageJson provenance(const Provenance& p) {
  return {{"command", p.command}, {"model_path", p.model_path}, {"model_sha256", p.model_sha256}};
}

PageJson channel(const ReportChannel& c) {
  return {{"name", c.name},
          {"unit", c.unit},
          {"measured", line(c.measured)},
          {"one_step", line(c.one_step)},
          {"simulation", line(c.simulation)},
          {"forecast_low", line(c.forecast_low)},
          {"forecast_high", line(c.forecast_high)},
          {"before", line(c.before)},
          {"after", line(c.after)},
          {"innovations_before", innovations(c.innovations_before)},
          {"innovations_after", innovations(c.innovations_after)}};
}

PageJson nis(const ReportData::Nis& n) {
  return {{"block", n.block},
          {"time", rounded(n.time, kTimeShare)},
          {"value", rounded(n.value)},
          {"low", rounded(n.low)},
          {"high", rounded(n.high)}};
}

PageJson history_line(const ReportData::HistoryLine& c) {
  return {{"name", c.name},
          {"unit", c.unit},
          {"mean", line(c.mean)},
          {"low", line(c.low)},
          {"high", line(c.high)}};
}

PageJson axle(const AxlePicture& a) {
  return {{"name", a.name},
          {"slip", rounded(a.slip)},
          {"force", rounded(a.force)},
          {"curve_slip", rounded(a.curve_slip)},
          {"curve_force", rounded(a.curve_force)}};
}

template <typename Item>
PageJson list(const std::vector<Item>& items, PageJson (*one)(const Item&)) {
  PageJson out = PageJson::array();
  for (const Item& item : items) out.push_back(one(item));
  return out;
}

// JSON has '<' in strings only, where this is the same character: no text can end the script.
std::string inside_script(const std::string& json) {
  std::string out;
  out.reserve(json.size());
  for (const char c : json) {
    if (c == '<') {
      out += "\\u003c";
    } else {
      out += c;
    }
  }
  return out;
}

// What export prints, by language.
std::string paste_json(const std::string& result, const std::string& data,
                       const ModelSource* model_file) {
  StoredResult stored;
  stored.path = "result.json";
  stored.text = result;
  stored.data_path = kReportDataFile;
  stored.data = data;
  stored = parse_stored_result(std::move(stored));
  if (model_file != nullptr) stored.estimate.model_file = *model_file;
  PageJson out = PageJson::array();
  for (const ExportFormat format : {ExportFormat::matlab, ExportFormat::python, ExportFormat::cpp,
                                    ExportFormat::c, ExportFormat::yaml}) {
    try {
      out.push_back({{"language", describe(format)}, {"text", export_text(stored, format)}});
    } catch (const InputError&) {
      // Nothing to paste, or not as a model file, e.g. as one that it included is gone.
    }
  }
  return out.dump(-1, ' ', false, PageJson::error_handler_t::replace);
}

}  // namespace

std::string report_data_json(const ReportData& data, const std::string& result) {
  PageJson out;
  out["schema_version"] = kSchemaVersion;
  out["result_sha256"] = result_fingerprint(result);
  out["provenance"] = provenance(data.provenance);
  out["recordings"] = list(data.recordings, recording);
  out["rows"] = data.rows;
  out["columns"] = data.columns;
  out["time"] = rounded(data.time, kTimeShare);
  out["joints"] = data.joints;
  out["held_from"] = finite(data.held_from);
  out["forecasts"] = data.forecasts;
  out["used"] = data.used;
  out["channels"] = list(data.channels, channel);
  out["inputs"] = list<ReportData::Input>(data.inputs, [](const ReportData::Input& u) {
    return PageJson{{"name", u.name}, {"unit", u.unit}, {"line", line(u.line)}};
  });
  out["nis"] = nis(data.nis);
  out["frequency"] = rounded(data.frequency);
  out["level_band"] = {finite(data.level_band[0]), finite(data.level_band[1])};
  out["segment"] = data.segment;
  out["segments"] = data.segments;
  out["time_history"] = list(data.time_history, history_line);
  out["log_alarm"] = line(data.log_alarm);
  out["log_threshold"] = finite(data.log_threshold);
  out["searches"] = list<std::vector<double>>(data.searches, [](const std::vector<double>& search) {
    PageJson values = PageJson::array();
    for (const double L : search) values.push_back(finite(L));
    return values;
  });
  out["profiles"] = list<LikelihoodProfile>(data.profiles, [](const LikelihoodProfile& p) {
    return PageJson{{"name", p.name}, {"value", rounded(p.value)}, {"drop", rounded(p.drop)}};
  });
  out["axles"] = list(data.axles, axle);
  out["high_pass_filtered"] = data.high_pass_filtered;
  out["tracks"] = list<TrackPicture>(data.tracks, [](const TrackPicture& t) {
    return PageJson{{"name", t.name}, {"X", rounded(t.X)}, {"Y", rounded(t.Y)}};
  });
  const auto text = [&] { return out.dump(-1, ' ', false, PageJson::error_handler_t::replace); };
  out["sha256"] = nullptr;
  out["sha256"] = report_data_fingerprint(text());
  return text() + "\n";
}

std::string report_page(const std::string& result, const std::string& data,
                        const ModelSource* model_file) {
  const std::pair<std::string_view, std::string> parts[] = {
      {"{{result}}", inside_script(result_in_this_version(result))},
      {"{{data}}", inside_script(page_data_in_this_version(data))},
      {"{{paste}}", inside_script(paste_json(result, data, model_file))},
      {"{{versions}}", inside_script(std::string(report_versions()))}};
  std::string out;
  std::string_view rest = report_template();
  for (const auto& [mark, text] : parts) {
    const std::size_t at = rest.find(mark);
    out += rest.substr(0, at);
    out += text;
    rest.remove_prefix(at + mark.size());
  }
  return out += rest;
}

}  // namespace identikal
