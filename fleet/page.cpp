#include "fleet/page.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "lib/base/quantile.h"

namespace identikal {
namespace {

constexpr double kWidth = 640.0, kHeight = 220.0, kLeft = 60.0, kBottom = 30.0;
constexpr std::size_t kMostDrawn = 2000;  // units of a figure
constexpr std::size_t kMostListed = 500;  // rows of a table

const char* const kStyle =
    "<style>body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:60rem;padding:0 "
    "1rem;"
    "color:#222}table{border-collapse:collapse;font-size:14px}td,th{padding:.2rem .7rem;text-align:"
    "left;border-bottom:1px solid #ddd}td.n{text-align:right;font-variant-numeric:tabular-nums}"
    "svg{display:block;margin:.5rem 0}code{background:#f3f3f3;padding:0 .2rem}"
    "@media(prefers-color-scheme:dark){body{background:#181818;color:#ddd}td,th{border-color:#444}"
    "code{background:#333}svg text{fill:#ddd}}</style>\n";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// A straight scale: data to drawing.
struct Axis {
  double low, high, from, to;

  Axis(double least, double most, double begin, double end)
      : low(least), high(most > least ? most : least + 1.0), from(begin), to(end) {}
  double at(double value) const {
    return from + (std::clamp(value, low, high) - low) / (high - low) * (to - from);
  }
};

std::string tick(double x, double y, double value, const char* anchor) {
  return fmt::format("<text x='{:.1f}' y='{:.1f}' font-size='12' text-anchor='{}'>{:.4g}</text>\n",
                     x, y, anchor, value);
}

std::string line(double x1, double y1, double x2, double y2, const char* colour) {
  return fmt::format("<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='{}'/>\n", x1,
                     y1, x2, y2, colour);
}

std::string figure(const std::string& title, const std::string& content) {
  return fmt::format(
      "<figure><figcaption>{}</figcaption><svg width='{}' height='{}' viewBox='0 0 {} "
      "{}' role='img' aria-label='{}'>\n{}</svg></figure>\n",
      title, kWidth, kHeight, kWidth, kHeight, title, content);
}

double in_unit(const PopulationParameter& of, double value) {
  return of.logarithm ? std::exp(value) : value;
}

// Values between which all but one in a hundred lie.
std::pair<double, double> usual_range(std::vector<double> values) {
  const double low = quantile(values, 0.005), high = quantile(values, 0.995);
  const double margin = 0.1 * std::max(high - low, 1e-12 * std::abs(high));
  return {low - margin, high + margin};
}

std::string histogram(const PopulationParameter& of) {
  std::vector<double> values;
  for (const PopulationUnit& unit : of.units) values.push_back(unit.value);
  const auto [low, high] = usual_range(values);
  const auto bins = static_cast<std::size_t>(
      std::clamp(2.0 * std::cbrt(static_cast<double>(values.size())), 5.0, 60.0));
  std::vector<std::size_t> counts(bins, 0);
  for (const double value : values) {
    const double share = (value - low) / (high - low);
    const double bin =
        std::clamp(share * static_cast<double>(bins), 0.0, static_cast<double>(bins) - 1.0);
    ++counts[static_cast<std::size_t>(bin)];
  }
  const std::size_t most = *std::max_element(counts.begin(), counts.end());
  const Axis x(low, high, kLeft, kWidth - 10.0);
  const Axis y(0.0, static_cast<double>(most), kHeight - kBottom, 10.0);
  std::string out;
  const double width = (kWidth - 10.0 - kLeft) / static_cast<double>(bins);
  for (std::size_t i = 0; i < bins; ++i) {
    const double top = y.at(static_cast<double>(counts[i]));
    out += fmt::format(
        "<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='#4878a8'/>\n",
        kLeft + width * static_cast<double>(i), top, width * 0.92, kHeight - kBottom - top);
  }
  out += line(x.at(of.effects.beta[0]), 10.0, x.at(of.effects.beta[0]), kHeight - kBottom, "#c44");
  out += tick(x.at(low), kHeight - 10.0, in_unit(of, low), "start");
  out += tick(x.at(high), kHeight - 10.0, in_unit(of, high), "end");
  out += tick(kLeft - 8.0, 20.0, static_cast<double>(most), "end");
  return figure(fmt::format("{}: how many units have which value; red: the mean of the population",
                            escaped(of.name)),
                out);
}

// Every unit with its interval, in order of value; red: those that do not belong.
std::string units_figure(const PopulationParameter& of) {
  std::vector<std::size_t> order(of.units.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return of.units[a].value < of.units[b].value; });
  const std::size_t step = order.size() / kMostDrawn + 1;
  std::vector<double> ends;
  for (const PopulationUnit& unit : of.units) {
    ends.push_back(unit.value - 2.0 * unit.se);
    ends.push_back(unit.value + 2.0 * unit.se);
  }
  const auto [low, high] = usual_range(ends);
  const Axis x(0.0, static_cast<double>(order.size()), kLeft, kWidth - 10.0);
  const Axis y(low, high, kHeight - kBottom, 10.0);
  std::string out;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const PopulationUnit& unit = of.units[order[k]];
    const bool belongs = of.effects.belongs[order[k]];
    if (k % step != 0 && belongs) continue;
    const char* const colour = belongs ? "#4878a8" : "#c44";
    const double at = x.at(static_cast<double>(k) + 0.5);
    out +=
        line(at, y.at(unit.value - 1.96 * unit.se), at, y.at(unit.value + 1.96 * unit.se), colour);
    out += fmt::format(
        "<circle cx='{:.1f}' cy='{:.1f}' r='2.5' fill='{}'><title>{}: {:.5g}</title>"
        "</circle>\n",
        at, y.at(unit.value), colour, escaped(unit.name), in_unit(of, unit.value));
  }
  out += tick(kLeft - 8.0, kHeight - kBottom, in_unit(of, low), "end");
  out += tick(kLeft - 8.0, 20.0, in_unit(of, high), "end");
  return figure(
      fmt::format("{}: each unit with its 95 % interval; red: does not belong", escaped(of.name)),
      out);
}

std::string trend_figure(const PopulationParameter& of, const PopulationTrend& trend) {
  std::vector<double> c, values;
  for (const PopulationUnit& unit : of.units) {
    c.push_back(unit.covariates.at(trend.covariate));
    values.push_back(unit.value);
  }
  const auto [low, high] = usual_range(values);
  const auto [first, last] = std::minmax_element(c.begin(), c.end());
  const Axis x(*first, *last, kLeft, kWidth - 10.0), y(low, high, kHeight - kBottom, 10.0);
  std::string out;
  const std::size_t step = c.size() / kMostDrawn + 1;
  for (std::size_t i = 0; i < c.size(); i += step) {
    out += fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='2.5' fill='#4878a8'/>\n", x.at(c[i]),
                       y.at(values[i]));
  }
  out += tick(kLeft, kHeight - 10.0, *first, "start") +
         tick(kWidth - 10.0, kHeight - 10.0, *last, "end");
  out += tick(kLeft - 8.0, kHeight - kBottom, in_unit(of, low), "end");
  out += tick(kLeft - 8.0, 20.0, in_unit(of, high), "end");
  return figure(fmt::format("{} over {} (p of no trend {:.2g})", escaped(of.name),
                            escaped(trend.covariate), trend.p),
                out);
}

std::string statuses(const FleetCounts& counts) {
  std::string out = fmt::format("<p>{} of {} recordings are done, {} rows.</p>\n<table>",
                                counts.done, counts.jobs, counts.rows);
  for (const auto& [status, count] : counts.by_status) {
    out += fmt::format("<tr><td>{}</td><td class='n'>{}</td></tr>\n", status, count);
  }
  return out + "</table>\n";
}

// The page of a single recording is made by the verb alone.
std::string command_for(const FleetTask& task, const std::string& recording) {
  return fmt::format("identikal {} {} {} --report page.html", task.verb, task.model, recording);
}

std::string doubtful_rows(FleetStore& store) {
  const FleetTask task = store.task();
  std::string out;
  std::size_t listed = 0, more = 0;
  store.for_each_row([&](const StoredRow& row) {
    if (row.row.status == "ok") return;
    if (++listed > kMostListed) {
      ++more;
      return;
    }
    out += fmt::format("<tr><td title='{}'>{}{}</td><td>{}</td><td>{}</td></tr>\n",
                       escaped(command_for(task, row.job.recording)), escaped(row.job.recording),
                       row.row.part.empty() ? "" : " " + escaped(row.row.part), row.row.status,
                       escaped(row.row.message));
  });
  if (out.empty()) return "";
  return "<h2>Recordings to look at</h2><table><tr><th>recording</th><th>status</th><th>why</th>"
         "</tr>\n" +
         out + "</table>\n" + (more > 0 ? fmt::format("<p>And {} more.</p>\n", more) : "");
}

}  // namespace

std::string fleet_page(FleetStore& store, const Population& population) {
  const FleetTask task = store.task();
  std::string out =
      "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'><meta "
      "name='viewport' content='width=device-width'><title>Fleet: " +
      escaped(task.verb + " " + task.model) + "</title>\n" + kStyle +
      "</head><body>\n<h1>Fleet: " + escaped(task.verb + " " + task.model) + "</h1>\n" +
      statuses(store.counts());
  out += "<h2>Population</h2>\n<pre>" + escaped(population_text(population)) + "</pre>\n";
  for (const PopulationParameter& each : population.parameters) {
    out += histogram(each) + units_figure(each);
    for (const PopulationTrend& trend : each.trends) out += trend_figure(each, trend);
  }
  return out + doubtful_rows(store) + "<p>A single recording has a page of its own: <code>" +
         escaped(command_for(task, "RECORDING")) + "</code></p>\n</body></html>\n";
}

}  // namespace identikal
