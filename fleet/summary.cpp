#include "fleet/summary.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "lib/base/quantile.h"

namespace identikal {
namespace {

constexpr std::size_t kShown = 5;  // of those that failed

struct Spread {
  std::string name, unit;
  std::vector<double> values;
};

struct Overview {
  std::vector<Spread> parameters;  // of rows with status ok
  std::vector<StoredRow> failed;   // the first of them
};

Overview overview_of(FleetStore& store) {
  Overview out;
  std::map<std::string, std::size_t> known;
  store.for_each_row([&](const StoredRow& row) {
    if (row.row.status == "failed" && out.failed.size() < kShown) out.failed.push_back(row);
    if (row.row.status != "ok") return;
    for (const RowParameter& p : parameters_of(row.row.parameters)) {
      if (!std::isfinite(p.value)) continue;
      const auto [at, is_new] = known.try_emplace(p.name, out.parameters.size());
      if (is_new) out.parameters.push_back({p.name, p.unit, {}});
      out.parameters[at->second].values.push_back(p.value);
    }
  });
  for (Spread& spread : out.parameters) std::sort(spread.values.begin(), spread.values.end());
  return out;
}

std::string statuses_text(const FleetCounts& counts) {
  std::string out;
  for (const auto& [status, count] : counts.by_status) {
    out += fmt::format("  {:<14} {:>8}\n", status, count);
  }
  return out;
}

std::string failed_text(const std::vector<StoredRow>& failed, std::int64_t count) {
  std::string out;
  for (const StoredRow& row : failed) {
    // The message may begin with the path itself.
    const bool named = row.row.message.find(row.job.recording) != std::string::npos;
    out += fmt::format("  failed: {}{}\n", named ? "" : row.job.recording + ": ", row.row.message);
  }
  const std::int64_t more = count - static_cast<std::int64_t>(failed.size());
  if (more > 0) out += fmt::format("  and {} more, which 'fleet export' lists\n", more);
  return out;
}

std::int64_t failed_count(const FleetCounts& counts) {
  const auto failed = counts.by_status.find("failed");
  return failed == counts.by_status.end() ? 0 : failed->second;
}

std::vector<StoredRow> first_failed(FleetStore& store, const FleetCounts& counts) {
  return failed_count(counts) > 0 ? store.failed_rows(kShown) : std::vector<StoredRow>();
}

std::string spreads_text(const std::vector<Spread>& spreads) {
  std::string out;
  for (const Spread& spread : spreads) {
    out += fmt::format(
        "  {}: median {:.6g}, middle half {:.6g} to {:.6g}{}, of {} with status ok\n", spread.name,
        quantile(spread.values, 0.5), quantile(spread.values, 0.25), quantile(spread.values, 0.75),
        spread.unit.empty() ? "" : " " + spread.unit, spread.values.size());
  }
  return out;
}

}  // namespace

std::string summary_text(FleetStore& store, const FleetSummary& run, bool with_time) {
  const FleetCounts counts = store.counts();
  std::string out = fmt::format("fleet {}: {} recordings, {} done now", store.task().verb, run.jobs,
                                run.done_now);
  if (with_time && run.seconds > 0.0) {
    out += fmt::format(" in {:.3g} s ({:.3g}/s, {} workers)", run.seconds,
                       static_cast<double>(run.done_now) / run.seconds, run.workers);
  }
  if (run.unchanged > 0) out += fmt::format(", {} had been done and hold", run.unchanged);
  if (run.stopped) out += ", stopped before the rest";
  out += "\n" + statuses_text(counts);
  out += failed_text(first_failed(store, counts), failed_count(counts));
  if (run.died > 0) {
    out +=
        fmt::format("  processes that ended before their work: {}; it was done again\n", run.died);
  }
  for (const SlowJob& job : run.slowest) {
    out += fmt::format("  slow: {} took {:.3g} s\n", job.recording, job.seconds);
  }
  return out + fmt::format("{}: 'identikal fleet export {}' prints a row for each\n", store.path(),
                           store.path());
}

std::string status_text(FleetStore& store) {
  const FleetCounts counts = store.counts();
  const Overview overview = overview_of(store);
  std::string out =
      fmt::format("fleet {} {}: {} of {} recordings done, {} rows\n", store.task().verb,
                  store.task().model, counts.done, counts.jobs, counts.rows);
  out += statuses_text(counts);
  out += spreads_text(overview.parameters);
  out += failed_text(overview.failed, failed_count(counts));
  if (counts.done < counts.jobs) {
    out += fmt::format("'identikal fleet resume {}' does the rest\n", store.path());
  }
  return out;
}

std::string status_json(FleetStore& store) {
  const FleetCounts counts = store.counts();
  const Overview overview = overview_of(store);
  nlohmann::ordered_json out = {{"verb", store.task().verb}, {"model", store.task().model},
                                {"recordings", counts.jobs}, {"done", counts.done},
                                {"rows", counts.rows},       {"statuses", counts.by_status}};
  auto& parameters = out["parameters"] = nlohmann::ordered_json::object();
  for (const Spread& spread : overview.parameters) {
    parameters[spread.name] = {
        {"count", spread.values.size()},
        {"median", quantile(spread.values, 0.5)},
        {"quartiles", {quantile(spread.values, 0.25), quantile(spread.values, 0.75)}}};
  }
  return out.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

int exit_code_of(const FleetCounts& counts) {
  if (counts.done < counts.jobs) return 3;
  return counts.rows > 0 && failed_count(counts) == counts.rows ? 2 : 0;
}

}  // namespace identikal
