#include "fleet/table.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <fmt/format.h>

#include "identify/result/csv.h"

namespace identikal {
namespace {

std::string as_name(std::string text) {
  std::replace(text.begin(), text.end(), ' ', '_');
  return text;
}

// Names in the order in which they first come.
class Names {
 public:
  void add(const std::string& name) {
    if (seen_.insert(name).second) list_.push_back(name);
  }
  const std::vector<std::string>& list() const { return list_; }

 private:
  std::vector<std::string> list_;
  std::unordered_set<std::string> seen_;
};

struct Columns {
  bool options = false, where = false;
  std::string by;
  Names covariates, parameters, fits, tests;
};

Columns columns_of(FleetStore& store) {
  Columns out;
  out.by = store.task().by;
  store.for_each_row([&](const StoredRow& row) {
    out.options = out.options || !row.job.options.empty();
    out.where = out.where || !row.job.where.empty();
    for (const auto& [name, value] : row.job.covariates) out.covariates.add(name);
    for (const RowParameter& p : parameters_of(row.row.parameters)) out.parameters.add(p.name);
    for (const RowFit& fit : fits_of(row.row.fits)) out.fits.add(fit.channel);
    for (const RowTest& test : tests_of(row.row.tests)) out.tests.add(test.name);
  });
  return out;
}

std::string header(const Columns& columns) {
  std::string out = "recording,unit,group";
  if (columns.options) out += ",options";
  if (columns.where) out += ",where";
  for (const std::string& name : columns.covariates.list()) out += "," + csv_cell(name);
  if (!columns.by.empty()) out += "," + csv_cell(columns.by);
  out += ",status,exit_code,rows,log_likelihood";
  for (const std::string& name : columns.parameters.list()) {
    for (const char* end : {"", "_se", "_low", "_high"}) out += "," + csv_cell(as_name(name) + end);
  }
  for (const std::string& name : columns.fits.list()) out += "," + csv_cell("fit_percent_" + name);
  for (const std::string& name : columns.tests.list()) out += "," + csv_cell(as_name(name) + "_p");
  return out + ",findings,message\n";
}

template <typename Item>
std::unordered_map<std::string, Item> by_name(std::vector<Item> items, std::string Item::*name) {
  std::unordered_map<std::string, Item> out;
  for (Item& item : items) {
    std::string key = item.*name;
    out.emplace(std::move(key), std::move(item));
  }
  return out;
}

std::string codes(const std::string& findings) {
  std::string out;
  for (const RowFinding& finding : findings_of(findings)) {
    out += (out.empty() ? "" : ";") + finding.code;
  }
  return out;
}

std::string line(const StoredRow& row, const Columns& columns) {
  const FleetRow& of = row.row;
  std::string out =
      csv_cell(row.job.recording) + "," + csv_cell(row.job.unit) + "," + csv_cell(row.job.group);
  if (columns.options) out += "," + csv_cell(row.job.options);
  if (columns.where) out += "," + csv_cell(row.job.where);
  for (const std::string& name : columns.covariates.list()) {
    const auto known = std::find_if(row.job.covariates.begin(), row.job.covariates.end(),
                                    [&](const auto& each) { return each.first == name; });
    out += "," + (known == row.job.covariates.end() ? std::string() : csv_cell(known->second));
  }
  if (!columns.by.empty()) out += "," + csv_cell(of.part);
  out += fmt::format(",{},{},{},{}", of.status, of.exit_code, of.rows, csv_cell(of.log_likelihood));
  const auto parameters = by_name(parameters_of(of.parameters), &RowParameter::name);
  for (const std::string& name : columns.parameters.list()) {
    const auto p = parameters.find(name);
    if (p == parameters.end()) {
      out += ",,,,";
      continue;
    }
    for (const double value : {p->second.value, p->second.se, p->second.low, p->second.high}) {
      out += "," + csv_cell(value);
    }
  }
  const auto fits = by_name(fits_of(of.fits), &RowFit::channel);
  for (const std::string& name : columns.fits.list()) {
    const auto fit = fits.find(name);
    out += ",";
    if (fit == fits.end()) continue;
    out +=
        csv_cell(std::isnan(fit->second.one_step) ? fit->second.simulation : fit->second.one_step);
  }
  const auto tests = by_name(tests_of(of.tests), &RowTest::name);
  for (const std::string& name : columns.tests.list()) {
    const auto test = tests.find(name);
    out += "," + (test == tests.end() ? std::string() : csv_cell(test->second.p));
  }
  return out + "," + csv_cell(codes(of.findings)) + "," + csv_cell(of.message) + "\n";
}

}  // namespace

void write_table(FleetStore& store, const std::function<void(const std::string& text)>& write) {
  constexpr std::size_t kPiece = 1 << 16;
  const Columns columns = columns_of(store);
  std::string text = header(columns);
  store.for_each_row([&](const StoredRow& row) {
    text += line(row, columns);
    if (text.size() < kPiece) return;
    write(text);
    text.clear();
  });
  write(text);
}

}  // namespace identikal
