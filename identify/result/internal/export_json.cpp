#include "identify/result/internal/export_json.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "identify/result/internal/export_comments.h"

namespace identikal {
namespace {

using Eigen::Index;
using ExportJson = nlohmann::ordered_json;

// What origin_lines() says, for programs.
ExportJson identity(const StoredResult& result, const std::string& date) {
  const StoredEstimate& e = result.estimate;
  ExportJson warnings = ExportJson::array(), data = ExportJson::array();
  for (const Finding& w : printed(e.findings)) {
    warnings.push_back(
        {{"code", name_of(w)}, {"severity", to_string(w.severity)}, {"text", w.text}});
  }
  for (const InputRecord& input : e.inputs) {
    data.push_back({{"path", input.path},
                    {"sha256", input.sha256},
                    {"rows", input.rows},
                    {"used", input.used}});
  }
  const auto known = [](const std::string& text) {
    return text.empty() ? ExportJson(nullptr) : ExportJson(text);
  };
  return {{"model", e.model_name},
          {"verb", e.verb},
          {"method", e.objective.method},
          {"version", result.version},
          {"written", known(date)},
          {"command", known(result.command)},
          {"status", {{"code", to_string(e.status)}, {"message", e.message}}},
          {"warnings", warnings},
          {"model_file", !e.model_file ? ExportJson(nullptr)
                                       : ExportJson{{"path", e.model_file->path},
                                                    {"sha256", e.model_file->sha256}}},
          {"data", data}};
}

}  // namespace

std::string export_json(const StoredResult& result, const ExportContents& c,
                        const std::string& date) {
  const StoredEstimate& e = result.estimate;
  const auto number = [](double x) {
    return std::isfinite(x) ? ExportJson(x) : ExportJson(nullptr);
  };
  const auto parameter = [&](double value, const std::string& unit, double se,
                             const std::string& verdict) {
    return ExportJson{
        {"value", number(value)}, {"unit", unit}, {"se", number(se)}, {"verdict", verdict}};
  };
  ExportJson out = identity(result, date), parameters = ExportJson::object();
  const auto name_channels = [&](const char* key, const std::vector<SteadyFilter::Channel>& list,
                                 const char* unit) {
    out[key] = ExportJson::array();
    for (const SteadyFilter::Channel& channel : list) {
      out[key].push_back({{"name", channel.name}, {unit, channel.unit}});
    }
  };
  if (!c.states.empty()) name_channels("states", c.states, "unit");
  if (c.tyre_curve.empty()) {
    name_channels("outputs", c.outputs, "recorded_in");
    name_channels("inputs", c.inputs, "recorded_in");
  } else {
    out["tyre_curve"] = c.tyre_curve;
    out["straight_axles"] = ExportJson::array();
    for (const EstimatedParameter& p : e.parameters) {
      if (is_straight(p)) out["straight_axles"].push_back(p.name == "Ff_max" ? "front" : "rear");
    }
  }
  if (c.dt) out["dt"] = *c.dt;
  if (c.covariance_factor) out["covariance_factor"] = *c.covariance_factor;
  if (!c.Q_kind.empty()) out["Q_kind"] = c.Q_kind;
  for (const NamedMatrix& m : c.matrices) {
    ExportJson rows = ExportJson::array();
    for (Index i = 0; i < m.value.rows(); ++i) {
      ExportJson row = ExportJson::array();
      for (Index j = 0; j < m.value.cols(); ++j) row.push_back(number(m.value(i, j)));
      rows.push_back(std::move(row));
    }
    out[m.name] = std::move(rows);
  }
  for (const StructMember& m : c.members)
    parameters[m.name] = parameter(m.value, m.unit, m.se, m.verdict);
  if (c.members.empty()) {
    for (const EstimatedParameter& p : e.parameters) {
      parameters[p.name] =
          parameter(p.value, p.unit, p.se, p.fixed ? "known" : to_string(p.verdict));
    }
  }
  out["parameters"] = std::move(parameters);
  return out.dump(-1, ' ', false, ExportJson::error_handler_t::replace) + "\n";
}

}  // namespace identikal
