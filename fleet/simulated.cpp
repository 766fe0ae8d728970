#include "fleet/simulated.h"

#include <charconv>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>

#include "fleet/manifest.h"
#include "fleet/task.h"
#include "jobs/load.h"
#include "jobs/verbs.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "lib/base/error.h"
#include "lib/data/csv.h"

namespace identikal {
namespace {

constexpr std::string_view kBegin = "simulate:";
constexpr std::int64_t kMostRuns = 10'000'000;

struct Recipe {
  std::int64_t first = 1, last = 1;
  std::string rest;  // " -n 300"
};

std::int64_t seed_in(std::string_view digits, const std::string& recipe) {
  std::int64_t out = -1;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), out);
  if (error != std::errc() || end != digits.data() + digits.size() || out < 0) {
    throw InputError(
        {}, fmt::format("recording '{}'", recipe),
        "simulate:SEED or simulate:FIRST-LAST and options, e.g. 'simulate:1-500 -n 300'");
  }
  return out;
}

Recipe recipe_of(const std::string& text) {
  const std::string_view whole = std::string_view(text).substr(kBegin.size());
  const std::size_t end = std::min(whole.find(' '), whole.size());
  const std::string_view seeds = whole.substr(0, end);
  const std::size_t dash = seeds.find('-');
  Recipe out;
  out.rest = whole.substr(end);
  out.first = seed_in(seeds.substr(0, dash), text);
  out.last = dash == std::string_view::npos ? out.first : seed_in(seeds.substr(dash + 1), text);
  if (out.last < out.first || out.last - out.first >= kMostRuns) {
    throw InputError({}, fmt::format("recording '{}' is of no seeds, or of too many", text),
                     fmt::format("FIRST-LAST, up to {} of them", kMostRuns));
  }
  return out;
}

// 'simulate' with the recipe's words, the model, and the seed.
Verb prepared(const Recipe& recipe, const std::string& model) {
  Verb verb = simulate_verb();
  for (const Option& option : verb.options) {
    if (option.names == "MODEL") take(option, model);
    if (option.called() == "--seed") take(option, std::to_string(recipe.first));
  }
  take_words(verb, option_words(recipe.rest), "DATA");
  return verb;
}

// The values that the model has for these recordings, in the units of results.
std::map<std::string, double> truth_of(const FleetTask& task, const std::string& recording) {
  Inputs inputs;
  ModelOptions options;
  options.file = task.model;
  const std::vector<std::string> words = option_words(recipe_of(recording).rest);
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i].starts_with("--set=")) options.settings.push_back(words[i].substr(6));
    if (words[i] == "--set" && i + 1 < words.size()) options.settings.push_back(words[++i]);
  }
  Estimate values;
  list_known_parameters(values, load_model(options, "simulate", inputs).parameters);
  std::map<std::string, double> out;
  for (const EstimatedParameter& p : values.parameters) out[p.name] = p.value;
  return out;
}

struct Sums {
  std::string unit;
  std::int64_t rows = 0, inside = 0;
  double mean = 0.0, squares = 0.0, variances = 0.0;

  void add(const RowParameter& p, double truth) {
    ++rows;
    const double from = p.value - mean;
    mean += from / static_cast<double>(rows);
    squares += from * (p.value - mean);
    variances += p.se * p.se;
    inside += p.low <= truth && truth <= p.high;
  }
};

std::string of_interval(std::int64_t inside, std::int64_t rows) {
  // Wilson's interval.
  const double z = normal_quantile(0.975), n = static_cast<double>(rows),
               share = static_cast<double>(inside) / n, scale = 1.0 + z * z / n,
               middle = (share + 0.5 * z * z / n) / scale,
               half = z * std::sqrt(share * (1.0 - share) / n + 0.25 * z * z / (n * n)) / scale;
  return fmt::format("{:.1f} % ({:.1f} to {:.1f} %)", 100.0 * share, 100.0 * (middle - half),
                     100.0 * (middle + half));
}

}  // namespace

bool is_simulation(const std::string& recording) { return recording.starts_with(kBegin); }

std::vector<FleetJob> simulations_of(const std::string& text) {
  const Recipe recipe = recipe_of(text);
  std::vector<FleetJob> out;
  out.reserve(static_cast<std::size_t>(recipe.last - recipe.first + 1));
  for (std::int64_t seed = recipe.first; seed <= recipe.last; ++seed) {
    out.push_back({fmt::format("{}{}{}", kBegin, seed, recipe.rest), {}, {}, {}, {}, {}});
  }
  return out;
}

Table simulated_table(const std::string& recording, const std::string& model, Inputs inputs) {
  const Verb verb = prepared(recipe_of(recording), model);
  Call call;
  call.inputs = std::move(inputs);
  return parse_csv(verb.run(call).text, recording);
}

CoverageReport coverage_of(FleetStore& store) {
  CoverageReport out;
  const FleetTask task = store.task();
  std::string recipe;  // without its seed
  std::map<std::string, double> truth;
  std::map<std::string, Sums> sums;
  std::vector<std::string> order;
  store.for_each_row([&](const StoredRow& row) {
    const std::string& recording = row.job.recording;
    if (!is_simulation(recording)) {
      throw InputError({store.path()}, fmt::format("'{}' is not simulated", recording),
                       "recordings 'simulate:FIRST-LAST', whose truth is known");
    }
    const std::string rest = recipe_of(recording).rest;
    if (truth.empty()) {
      recipe = rest;
      truth = truth_of(task, recording);
    }
    if (rest != recipe) {
      throw InputError({store.path()}, fmt::format("'{}' and '{}'", recipe, rest),
                       "simulations by one recipe");
    }
    ++out.rows;
    if (row.row.status != "ok") return;
    ++out.ok;
    for (const RowParameter& p : parameters_of(row.row.parameters)) {
      const auto true_value = truth.find(p.name);
      if (true_value == truth.end() || !std::isfinite(p.value) || std::isnan(p.low)) continue;
      const auto [at, is_new] = sums.try_emplace(p.name);
      if (is_new) order.push_back(p.name);
      at->second.unit = p.unit;
      at->second.add(p, true_value->second);
    }
  });
  for (const std::string& name : order) {
    const Sums& of = sums.at(name);
    const auto n = static_cast<double>(of.rows);
    out.parameters.push_back({name, of.unit, truth.at(name), of.rows, of.mean,
                              of.rows > 1 ? std::sqrt(of.squares / (n - 1.0)) : kNone,
                              std::sqrt(of.variances / n), of.inside});
  }
  return out;
}

std::string coverage_text(const CoverageReport& report) {
  std::string out = fmt::format("{} simulated recordings, of which {} with status ok count\n",
                                report.rows, report.ok);
  for (const Coverage& each : report.parameters) {
    const double error = each.sd / std::sqrt(static_cast<double>(each.rows));
    out += fmt::format("{}{}: truth {:.6g}, mean {:.6g} (bias {:+.2g} +- {:.1g})\n", each.name,
                       each.unit.empty() ? "" : " [" + each.unit + "]", each.truth, each.mean,
                       each.mean - each.truth, error);
    out += fmt::format("    estimates scatter by {:.4g}, their standard errors say {:.4g}\n",
                       each.sd, each.mean_se);
    out += fmt::format("    95 % intervals hold the truth in {} of {}, {}\n", each.inside,
                       each.rows, of_interval(each.inside, each.rows));
  }
  return out;
}

std::string coverage_json(const CoverageReport& report) {
  nlohmann::ordered_json out = {{"rows", report.rows}, {"ok", report.ok}};
  auto& parameters = out["parameters"] = nlohmann::ordered_json::array();
  for (const Coverage& each : report.parameters) {
    parameters.push_back({{"name", each.name},
                          {"unit", each.unit},
                          {"truth", each.truth},
                          {"rows", each.rows},
                          {"mean", each.mean},
                          {"sd", each.sd},
                          {"mean_se", each.mean_se},
                          {"inside", each.inside}});
  }
  return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace identikal
