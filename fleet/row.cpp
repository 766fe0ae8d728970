#include "fleet/row.h"

#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "lib/base/error.h"

namespace identikal {
namespace {

using Json = nlohmann::ordered_json;

// Absent values are left out: they are many.
void set(Json& to, const char* key, double value) {
  if (std::isfinite(value)) to[key] = value;
}

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json parameters_json(const Estimate& estimate) {
  Json out = Json::object();
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.fixed) continue;
    Json& to = out[p.name] = Json::object();
    set(to, "value", p.value);
    set(to, "se", p.se);
    set(to, "low", p.ci95[0]);
    set(to, "high", p.ci95[1]);
    if (!p.unit.empty() && p.unit != "1") to["unit"] = p.unit;
    if (p.bounds[0] >= 0.0) to["positive"] = true;
    to["verdict"] = to_string(p.verdict);
  }
  return out;
}

std::string correlation_json(const Estimate& estimate) {
  if (estimate.correlation.size() == 0) return "";
  Json out = {{"names", estimate.correlation_names}, {"rows", Json::array()}};
  for (const auto& row : estimate.correlation.rowwise()) {
    Json& to = out["rows"].emplace_back(Json::array());
    for (const double value : row) to.push_back(std::isfinite(value) ? Json(value) : Json());
  }
  return text_of(out);
}

Json fits_json(const RecordingFit& fit) {
  Json out = Json::object();
  for (const ChannelFit& channel : fit.one_step) {
    set(out[channel.channel], "one_step", channel.fit_percent);
    set(out[channel.channel], "rmse", channel.rmse);
  }
  for (const ChannelFit& channel : fit.simulation) {
    set(out[channel.channel], "simulation", channel.fit_percent);
    if (fit.one_step.empty()) set(out[channel.channel], "rmse", channel.rmse);
  }
  return out;
}

Json tests_json(const RecordingFit& fit) {
  Json out = Json::object();
  for (const TestResult& test : fit.tests) {
    Json& to = out[test.channel.empty() ? test.id : test.id + " " + test.channel] = Json::object();
    set(to, "value", test.value);
    set(to, "p", test.p);
    to["pass"] = test.pass;
  }
  return out;
}

std::string findings_json(const Findings& findings) {
  Json out = Json::array();
  for (const Finding& finding : findings) {
    Json& to = out.emplace_back(Json{{"code", name_of(finding)}});
    to["severity"] = to_string(finding.severity);
    if (finding.severity != Severity::note) to["text"] = finding.text;
  }
  return out.empty() ? "" : text_of(out);
}

long rows_used(const Estimate& estimate) {
  long out = 0;
  for (const InputRecord& input : estimate.inputs) out += input.used;
  return out;
}

// An object or array that a store holds; nothing where its text is empty.
Json parsed(const std::string& text) {
  if (text.empty()) return Json::object();
  Json out = Json::parse(text, nullptr, false);
  if (out.is_discarded()) {
    throw InputError({}, "a row of the store that holds no JSON", "what 'fleet' has written");
  }
  return out;
}

double number(const Json& of, const char* key) {
  const auto at = of.is_object() ? of.find(key) : of.end();
  return at != of.end() && at->is_number() ? at->get<double>() : kNone;
}

std::string word(const Json& of, const char* key) {
  const auto at = of.is_object() ? of.find(key) : of.end();
  return at != of.end() && at->is_string() ? at->get<std::string>() : std::string();
}

}  // namespace

FleetRow row_of(const Outcome& out) {
  FleetRow row;
  row.exit_code = out.exit_code;
  const Estimate& estimate = *out.estimate;
  row.status = to_string(estimate.status);
  row.message = estimate.message;
  row.rows = rows_used(estimate);
  row.log_likelihood = estimate.objective.log_likelihood;
  row.parameters = text_of(parameters_json(estimate));
  row.correlation = correlation_json(estimate);
  if (out.fit) {
    row.fits = text_of(fits_json(*out.fit));
    row.tests = text_of(tests_json(*out.fit));
  }
  row.findings = findings_json(estimate.findings);
  return row;
}

FleetRow failed_row(int exit_code, const std::string& message) {
  FleetRow row;
  row.exit_code = exit_code;
  row.status = "failed";
  row.message = message;
  return row;
}

std::vector<RowParameter> parameters_of(const std::string& json) {
  std::vector<RowParameter> out;
  const Json all = parsed(json);
  for (const auto& [name, p] : all.items()) {
    out.push_back({name, word(p, "unit"), word(p, "verdict"), number(p, "value"), number(p, "se"),
                   number(p, "low"), number(p, "high"), p.is_object() && p.contains("positive")});
  }
  return out;
}

std::vector<RowTest> tests_of(const std::string& json) {
  std::vector<RowTest> out;
  const Json all = parsed(json);
  for (const auto& [name, test] : all.items()) {
    const auto pass = test.is_object() ? test.find("pass") : test.end();
    out.push_back({name, number(test, "value"), number(test, "p"),
                   pass != test.end() && *pass == Json(true)});
  }
  return out;
}

std::vector<RowFit> fits_of(const std::string& json) {
  std::vector<RowFit> out;
  const Json all = parsed(json);
  for (const auto& [channel, fit] : all.items()) {
    out.push_back(
        {channel, number(fit, "one_step"), number(fit, "simulation"), number(fit, "rmse")});
  }
  return out;
}

std::vector<RowFinding> findings_of(const std::string& json) {
  std::vector<RowFinding> out;
  const Json all = parsed(json);
  for (const auto& finding : all) {
    out.push_back({word(finding, "code"), word(finding, "severity"), word(finding, "text")});
  }
  return out;
}

}  // namespace identikal
