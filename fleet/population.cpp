#include "fleet/population.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>

#include "fleet/internal/plain_number.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "identify/estimate/distribution.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kShownUnits = 5;

/// One estimate of a parameter, before the recordings of a unit are put together.
struct Sample {
  std::string unit, group;
  double value, se;
  std::map<std::string, double> covariates;
};

struct Samples {
  std::string name, unit;
  bool positive = false;
  std::vector<Sample> all;
  std::int64_t without_error = 0;
};

std::string unit_of(const StoredRow& row) {
  if (!row.job.unit.empty()) return row.job.unit;
  return row.row.part.empty() ? row.job.recording : row.row.part;
}

struct Collected {
  std::int64_t rows = 0, used = 0;
  std::vector<Samples> parameters;
};

Collected collect(FleetStore& store) {
  Collected out;
  std::unordered_map<std::string, std::size_t> known;
  store.for_each_row([&](const StoredRow& row) {
    ++out.rows;
    if (row.row.status != "ok") return;
    ++out.used;
    std::map<std::string, double> covariates;
    for (const auto& [name, text] : row.job.covariates) {
      if (const auto value = plain_number(text)) covariates[name] = *value;
    }
    for (const RowParameter& p : parameters_of(row.row.parameters)) {
      const auto [at, is_new] = known.try_emplace(p.name, out.parameters.size());
      if (is_new) out.parameters.push_back({p.name, p.unit, true, {}, 0});
      Samples& samples = out.parameters[at->second];
      samples.positive = samples.positive && p.positive && p.value > 0.0;
      if (std::isfinite(p.value) && p.se > 0.0 && std::isfinite(p.se)) {
        samples.all.push_back({unit_of(row), row.job.group, p.value, p.se, covariates});
      } else {
        ++samples.without_error;
      }
    }
  });
  return out;
}

// Recordings of the same unit as one, with the mean of their covariates.
void take_units(const Samples& samples, PopulationParameter& out) {
  std::unordered_map<std::string, int> known;
  std::vector<int> unit;
  std::vector<double> count;
  VectorXd y(static_cast<Index>(samples.all.size())), v(y.size());
  for (std::size_t i = 0; i < samples.all.size(); ++i) {
    const Sample& sample = samples.all[i];
    const auto [at, is_new] = known.try_emplace(sample.unit, static_cast<int>(out.units.size()));
    if (is_new) {
      out.units.push_back({sample.unit, sample.group, kNone, kNone, {}});
      count.push_back(0.0);
    }
    std::string& group = out.units[static_cast<std::size_t>(at->second)].group;
    if (group != sample.group) group.clear();
    unit.push_back(at->second);
    count[static_cast<std::size_t>(at->second)] += 1.0;
    // By the delta method, of the logarithm se / value.
    y[static_cast<Index>(i)] = out.logarithm ? std::log(sample.value) : sample.value;
    const double se = out.logarithm ? sample.se / sample.value : sample.se;
    v[static_cast<Index>(i)] = se * se;
  }
  const CombinedUnits combined = combine_units(y, v, unit, static_cast<int>(out.units.size()));
  out.within_sd = combined.within_sd;
  for (std::size_t u = 0; u < out.units.size(); ++u) {
    out.units[u].value = combined.y[static_cast<Index>(u)];
    out.units[u].se = std::sqrt(combined.v[static_cast<Index>(u)]);
  }
  for (std::size_t i = 0; i < samples.all.size(); ++i) {
    const auto u = static_cast<std::size_t>(unit[i]);
    for (const auto& [name, value] : samples.all[i].covariates) {
      out.units[u].covariates[name] += value / count[u];
    }
  }
}

// The covariates that all units have, and that differ.
std::vector<std::string> usable_covariates(const std::vector<PopulationUnit>& units) {
  std::vector<std::string> out;
  for (const auto& [name, first] : units.front().covariates) {
    bool everywhere = true, differs = false;
    for (const PopulationUnit& unit : units) {
      const auto at = unit.covariates.find(name);
      everywhere = everywhere && at != unit.covariates.end();
      differs = differs || (at != unit.covariates.end() && at->second != first);
    }
    if (everywhere && differs) out.push_back(name);
  }
  return out;
}

PopulationTrend trend_of(const std::string& covariate, const VectorXd& y, const VectorXd& v,
                         const std::vector<PopulationUnit>& units) {
  VectorXd c(y.size());
  for (Index i = 0; i < y.size(); ++i) {
    c[i] = units[static_cast<std::size_t>(i)].covariates.at(covariate);
  }
  // Centred and scaled, so that no unit of the covariate matters.
  const double mean = c.mean(), scale = std::sqrt((c.array() - mean).square().mean());
  MatrixXd X(y.size(), 2);
  X.col(0).setOnes();
  X.col(1) = (c.array() - mean) / scale;
  const RandomEffects effects = random_effects(y, v, X);
  return {covariate, effects.beta[1] / scale, effects.se[1] / scale, effects.p_value[1]};
}

// Means of groups, each by its own column of X, and whether they are one.
void compare_groups(const VectorXd& y, const VectorXd& v, PopulationParameter& out) {
  std::map<std::string, Index> columns;
  for (const PopulationUnit& unit : out.units) {
    if (unit.group.empty()) return;
    columns.try_emplace(unit.group, 0);
  }
  const auto groups = static_cast<Index>(columns.size());
  if (groups < 2 || y.size() < groups + 2) return;
  Index next = 0;
  for (auto& [name, column] : columns) {
    column = next++;
    out.groups.push_back({name});
  }
  MatrixXd X = MatrixXd::Zero(y.size(), groups);
  for (Index i = 0; i < y.size(); ++i) {
    const Index column = columns.at(out.units[static_cast<std::size_t>(i)].group);
    X(i, column) = 1.0;
    ++out.groups[static_cast<std::size_t>(column)].units;
  }
  const RandomEffects effects = random_effects(y, v, X);
  // The columns have no row in common, so that their means are independent.
  const VectorXd weight = effects.se.cwiseAbs2().cwiseInverse();
  const double mean = weight.dot(effects.beta) / weight.sum();
  out.groups_f =
      weight.dot((effects.beta.array() - mean).square().matrix()) / static_cast<double>(groups - 1);
  out.groups_p = f_upper_tail(out.groups_f, static_cast<double>(groups - 1), effects.freedom);
  for (Index g = 0; g < groups; ++g) {
    PopulationGroup& group = out.groups[static_cast<std::size_t>(g)];
    group.mean = effects.beta[g];
    group.se = effects.se[g];
    group.interval = effects.interval[static_cast<std::size_t>(g)];
  }
}

PopulationParameter analysed(const Samples& samples) {
  PopulationParameter out;
  out.name = samples.name;
  out.unit = samples.unit;
  out.logarithm = samples.positive;
  take_units(samples, out);
  const auto n = static_cast<Index>(out.units.size());
  VectorXd y(n), v(n);
  for (Index i = 0; i < n; ++i) {
    const PopulationUnit& unit = out.units[static_cast<std::size_t>(i)];
    y[i] = unit.value;
    v[i] = unit.se * unit.se;
  }
  out.effects = random_effects(y, v, MatrixXd::Ones(n, 1));
  compare_groups(y, v, out);
  if (n < 4) return out;
  for (const std::string& covariate : usable_covariates(out.units)) {
    out.trends.push_back(trend_of(covariate, y, v, out.units));
  }
  return out;
}

// A number of the analysis in the parameter's own unit.
double shown(const PopulationParameter& of, double value) {
  return of.logarithm ? std::exp(value) : value;
}

std::string groups_text(const PopulationParameter& of) {
  if (of.groups.empty()) return "";
  std::string out;
  for (const PopulationGroup& group : of.groups) {
    out += fmt::format("{}{} {:.6g} ({:.6g} to {:.6g}, {} unit{})", out.empty() ? "" : ", ",
                       group.name, shown(of, group.mean), shown(of, group.interval[0]),
                       shown(of, group.interval[1]), group.units, group.units == 1 ? "" : "s");
  }
  return fmt::format("    groups {} (F {:.3g}, p {:.2g}): {}\n",
                     of.groups_p < 0.01 ? "differ" : "may all be the same", of.groups_f,
                     of.groups_p, out);
}

// "sd 8.2 % (6.1 to 11.4 %)"
std::string spread_text(const PopulationParameter& of) {
  const auto& [low, high] = of.effects.sd_interval;
  if (of.logarithm) {
    return fmt::format("{:.3g} % ({:.3g} to {:.3g} %)", 100.0 * of.effects.sd, 100.0 * low,
                       100.0 * high);
  }
  return fmt::format("{:.4g} ({:.4g} to {:.4g})", of.effects.sd, low, high);
}

std::string strangers_text(const PopulationParameter& of) {
  std::vector<std::size_t> strangers;
  for (std::size_t i = 0; i < of.units.size(); ++i) {
    if (!of.effects.belongs[i]) strangers.push_back(i);
  }
  if (strangers.empty()) return "";
  std::sort(strangers.begin(), strangers.end(), [&](std::size_t a, std::size_t b) {
    return std::abs(of.effects.distance[static_cast<Index>(a)]) >
           std::abs(of.effects.distance[static_cast<Index>(b)]);
  });
  std::string out;
  for (std::size_t i = 0; i < std::min(kShownUnits, strangers.size()); ++i) {
    const PopulationUnit& unit = of.units[strangers[i]];
    out +=
        fmt::format("{}{} ({:.4g}, {:+.1f} sd)", i > 0 ? ", " : "", unit.name,
                    shown(of, unit.value), of.effects.distance[static_cast<Index>(strangers[i])]);
  }
  if (strangers.size() > kShownUnits) {
    out += fmt::format(" and {} more", strangers.size() - kShownUnits);
  }
  return fmt::format("    do not belong (at most 5 % of them wrongly so): {}\n", out);
}

std::string parameter_text(const PopulationParameter& of) {
  const RandomEffects& e = of.effects;
  std::string out =
      fmt::format("{}{}: {:.6g} (95 % {:.6g} to {:.6g}), between units {}\n", of.name,
                  of.unit.empty() ? "" : " [" + of.unit + "]", shown(of, e.beta[0]),
                  shown(of, e.interval[0][0]), shown(of, e.interval[0][1]), spread_text(of));
  out += fmt::format(
      "    {} units; {} (Q {:.4g} of {:.0f} degrees of freedom, p {:.2g})\n", of.units.size(),
      e.q_p_value < 0.01 ? "they differ by more than their errors" : "they may all be the same",
      e.q, e.freedom, e.q_p_value);
  if (of.within_sd > 0.0) {
    out += of.logarithm
               ? fmt::format("    recordings of a unit differ by {:.3g} % beyond their errors\n",
                             100.0 * of.within_sd)
               : fmt::format("    recordings of a unit differ by {:.4g} beyond their errors\n",
                             of.within_sd);
  }
  out += groups_text(of);
  for (const PopulationTrend& trend : of.trends) {
    out += fmt::format("    with {}: {:.4g} +- {:.2g} by one unit{} (p {:.2g})\n", trend.covariate,
                       of.logarithm ? 100.0 * trend.slope : trend.slope,
                       of.logarithm ? 100.0 * trend.se : trend.se, of.logarithm ? " [%]" : "",
                       trend.p);
  }
  return out + strangers_text(of);
}

nlohmann::ordered_json parameter_json(const PopulationParameter& of) {
  const RandomEffects& e = of.effects;
  nlohmann::ordered_json out = {{"name", of.name},
                                {"unit", of.unit},
                                {"logarithm", of.logarithm},
                                {"mean", e.beta[0]},
                                {"se", e.se[0]},
                                {"interval", e.interval[0]},
                                {"sd", e.sd},
                                {"sd_interval", e.sd_interval},
                                {"within_sd", of.within_sd},
                                {"q", e.q},
                                {"freedom", e.freedom},
                                {"q_p", e.q_p_value}};
  auto& trends = out["trends"] = nlohmann::ordered_json::array();
  for (const PopulationTrend& trend : of.trends) {
    trends.push_back(
        {{"covariate", trend.covariate}, {"slope", trend.slope}, {"se", trend.se}, {"p", trend.p}});
  }
  if (!of.groups.empty()) {
    out["groups_f"] = of.groups_f;
    out["groups_p"] = of.groups_p;
    auto& groups = out["groups"] = nlohmann::ordered_json::array();
    for (const PopulationGroup& group : of.groups) {
      groups.push_back({{"group", group.name},
                        {"units", group.units},
                        {"mean", group.mean},
                        {"se", group.se},
                        {"interval", group.interval}});
    }
  }
  auto& units = out["units"] = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < of.units.size(); ++i) {
    const auto at = static_cast<Index>(i);
    units.push_back({{"unit", of.units[i].name},
                     {"value", of.units[i].value},
                     {"se", of.units[i].se},
                     {"shrunken", e.shrunken[at]},
                     {"shrunken_se", e.shrunken_se[at]},
                     {"distance", e.distance[at]},
                     {"belongs", static_cast<bool>(e.belongs[i])}});
  }
  return out;
}

}  // namespace

Population population_of(FleetStore& store) {
  const Collected collected = collect(store);
  Population out;
  out.rows = collected.rows;
  out.used = collected.used;
  for (const Samples& samples : collected.parameters) {
    if (samples.without_error > 0) {
      out.remarks.push_back(fmt::format("{}: {} estimates without a standard error are left out",
                                        samples.name, samples.without_error));
    }
    try {
      out.parameters.push_back(analysed(samples));
    } catch (const std::invalid_argument& error) {
      out.remarks.push_back(fmt::format("{}: {}", samples.name, error.what()));
    }
  }
  return out;
}

std::string population_text(const Population& population) {
  std::string out = fmt::format("population of {} rows, of which {} with status ok count\n",
                                population.rows, population.used);
  for (const PopulationParameter& each : population.parameters) out += parameter_text(each);
  for (const std::string& remark : population.remarks) out += "  " + remark + "\n";
  return out;
}

std::string population_json(const Population& population) {
  nlohmann::ordered_json out = {{"rows", population.rows}, {"used", population.used}};
  auto& parameters = out["parameters"] = nlohmann::ordered_json::array();
  for (const PopulationParameter& each : population.parameters) {
    parameters.push_back(parameter_json(each));
  }
  out["remarks"] = population.remarks;
  return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

}  // namespace identikal
