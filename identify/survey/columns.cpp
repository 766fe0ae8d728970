#include "identify/survey/columns.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include <fmt/format.h>

#include "identify/survey/internal/aligned_signals.h"
#include "identify/survey/internal/column_names.h"
#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "lib/base/median.h"
#include "lib/base/quantile.h"
#include "lib/data/units.h"
#include "lib/statistics/paired_correlation.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

struct ColumnCandidate {
  const Column* column = nullptr;
  std::size_t file = 0;
  SignalKind kind = SignalKind::r;
  double score = 0.0;
  std::string unit;  // empty: not given
  bool constant = false;
  Words words;
};

struct Clock {
  VectorXd time;  // s
  std::string column, unit;
  int runs = 1;
  int repeated = 0;      // stamps that are those of the row before
  bool guessed = false;  // no name says that it is time
};

Eigen::Map<const VectorXd> raw_values(const Column& column) {
  return {column.values.data(), static_cast<Index>(column.values.size())};
}

// Steps between rows; nothing where the column cannot be time, which mostly increases.
std::vector<double> steps_of(const Column& column) {
  std::vector<double> steps;
  if (column.text_cells > 0 || column.missing > 0 || column.values.size() < 2) return steps;
  for (std::size_t i = 1; i < column.values.size(); ++i) {
    steps.push_back(column.values[i] - column.values[i - 1]);
  }
  const auto back = std::count_if(steps.begin(), steps.end(), [](double s) { return !(s > 0.0); });
  if (static_cast<double>(back) > 0.1 * static_cast<double>(steps.size())) steps.clear();
  return steps;
}

// Of a column that no name calls time: it increases from row to row, by much the same.
bool behaves_like_time(const std::vector<double>& steps) {
  if (steps.size() < 8 || *std::min_element(steps.begin(), steps.end()) <= 0.0) return false;
  const double usual = median(steps);
  const auto near = std::count_if(steps.begin(), steps.end(),
                                  [&](double s) { return s > 0.3 * usual && s < 3.0 * usual; });
  return static_cast<double>(near) > 0.9 * static_cast<double>(steps.size());
}

// A recorder's step lies between a tenth of a millisecond and a few seconds.
std::string unit_by_step(double step) {
  return step < 5.0 ? "s" : step < 5e3 ? "ms" : step < 5e6 ? "us" : "ns";
}

// Runs one after the other.
Clock clock_from(const Column& column, const std::string& unit, const std::vector<double>& steps) {
  Clock out;
  out.column = column.name;
  out.unit = unit;
  const double scale = parse_unit(unit)->scale, usual = median(steps);
  out.time.resize(static_cast<Index>(column.values.size()));
  double shift = 0.0;
  out.time[0] = column.values[0] * scale;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i] < 0.0) {
      // Far enough that nothing is interpolated across, nor compared with the run before.
      shift += -steps[i] + std::max(20.0 * usual, 6.0 / scale);
      ++out.runs;
    } else if (steps[i] == 0.0) {
      shift += 1e-6 * usual;  // a row that is given twice, or rounded stamps: time goes on
      ++out.repeated;
    }
    out.time[i + 1] = (column.values[i + 1] + shift) * scale;
  }
  return out;
}

// The first column that is called time; else the file's first one, where it behaves so.
Clock read_clock(const Table& table) {
  for (const Column& column : table.columns) {
    if (!looks_like_time(column)) continue;
    if (const auto steps = steps_of(column); !steps.empty()) {
      return clock_from(column, time_unit(column), steps);
    }
  }
  if (table.columns.empty() || !table.columns[0].unit.empty()) return {};
  const std::vector<double> steps = steps_of(table.columns[0]);
  if (!behaves_like_time(steps)) return {};
  Clock out = clock_from(table.columns[0], unit_by_step(median(steps)), steps);
  out.guessed = true;
  return out;
}

std::vector<ColumnCandidate> candidates_of(const std::vector<Table>& tables,
                                           const std::vector<Clock>& clocks) {
  std::vector<ColumnCandidate> out;
  for (std::size_t f = 0; f < tables.size(); ++f) {
    for (const Column& column : tables[f].columns) {
      if (!holds_numbers(column) || column.name == clocks[f].column ||
          column.missing == column.values.size()) {
        continue;
      }
      const std::vector<std::string> words = words_of(column.name);
      const Words set(words);
      for (const NameGuess& guess : kinds_of(set)) {
        ColumnCandidate c{&column, f, guess.kind, guess.score, "", false, set};
        const std::optional<Unit> unit = parse_unit(column.unit);
        if (!column.unit.empty() && unit) {
          if (!same_dimension(*unit, *parse_unit(si_unit(guess.kind)))) continue;
          c.unit = column.unit;
          c.score += 1.0;
        } else {
          c.unit = unit_in_name(words, guess.kind);
        }
        double low = kInfinity, high = -kInfinity;
        for (const double x : column.values) {
          if (std::isnan(x)) continue;
          low = std::min(low, x);
          high = std::max(high, x);
        }
        c.constant = !(low < high);
        // A commanded angle that lives is better than a measured one that does not.
        if (c.constant && low == 0.0) c.score -= 6.0;
        out.push_back(std::move(c));
      }
    }
  }
  std::stable_sort(out.begin(), out.end(), [](const ColumnCandidate& a, const ColumnCandidate& b) {
    return a.score > b.score;
  });
  return out;
}

// --- Kinematics between columns of different files ---

struct SamplingGrid {
  VectorXd time;
  double step = 0.01;
};

VectorXd averaged(const VectorXd& x, Index half) {
  VectorXd out(x.size());
  for (Index i = 0; i < x.size(); ++i) {
    const Index first = std::max<Index>(0, i - half), last = std::min(x.size() - 1, i + half);
    out[i] = x.segment(first, last - first + 1).mean();  // NaN where any is missing
  }
  return out;
}

// What hardly has samples, or never changes, is like nothing.
PairedCorrelation likeness(const VectorXd& x, const VectorXd& y) {
  PairedCorrelation out = paired_correlation(x, y);
  if (out.count < 20 || std::isnan(out.correlation)) {
    out.correlation = 0.0;
    out.slope = kNaN;
  }
  return out;
}

// Nearly the largest size, so that single wild samples do not count.
double high_quantile(const VectorXd& x) { return quantile(surveying::present(x.cwiseAbs()), 0.98); }

// How far a number lies outside a range, in factors (logarithm).
double outside(double value, double low, double high) {
  if (std::isnan(value)) return 0.0;
  if (!(value > 0.0)) return 20.0;
  return value < low ? std::log(low / value) : value > high ? std::log(value / high) : 0.0;
}

class Guess {
 public:
  explicit Guess(const std::vector<Table>& files) : tables_(files) {
    for (const Table& table : files) clocks_.push_back(read_clock(table));
    candidates_ = candidates_of(files, clocks_);
  }
  VehicleSignals run();

 private:
  const ColumnCandidate* best(SignalKind kind) const {
    for (const ColumnCandidate& c : candidates_) {
      if (c.kind == kind) return &c;
    }
    return nullptr;
  }
  VectorXd sampled(const Column& column, std::size_t file) const {
    const VectorXd& t = clocks_[file].time;
    const auto x = raw_values(column);
    const VectorXd on = interpolate_linearly(t, x, grid_.time, kBridgedPeriods * own_period(t, x));
    return averaged(on, static_cast<Index>(std::lround(0.15 / grid_.step)));
  }
  VectorXd sampled(const ColumnCandidate& c) const { return sampled(*c.column, c.file); }
  const ColumnCandidate* best_speed() const {
    const ColumnCandidate* c = best(SignalKind::vx);
    return c != nullptr ? c : best(SignalKind::wheel_speed);
  }
  void choose_units();
  void choose_steering_unit();
  void try_unnamed();
  std::string file_name(std::size_t file) const;
  void check_clocks();
  std::size_t base_file() const;
  std::size_t first_timed() const;
  VehicleSignal signal_of(const ColumnCandidate& c);
  std::vector<ColumnCandidate> unnamed_columns() const;
  void take_unnamed(ColumnCandidate c, SignalKind kind, const std::string& why);
  void guess_speed_with_rates();
  void guess_by_correlation(SignalKind kind, SignalKind with, bool times_speed, double least);
  // Of a second column of the same kind: the unit in which it is as large as the first.
  std::string unit_like(const ColumnCandidate& c, const ColumnCandidate& first) const {
    const double like = high_quantile(sampled(first)) * parse_unit(units_.at(c.kind))->scale;
    std::string best_unit = si_unit(c.kind);
    double nearest = kInfinity;
    for (const std::string& unit : usual_units(c.kind)) {
      const double off =
          std::abs(std::log(high_quantile(sampled(c)) * parse_unit(unit)->scale / like));
      if (!(off < nearest)) continue;
      nearest = off;
      best_unit = unit;
    }
    return best_unit;
  }
  double scale_of(SignalKind kind) const {
    const auto unit = units_.find(kind);
    return unit == units_.end() ? 1.0 : parse_unit(unit->second)->scale;
  }
  std::string called(const ColumnCandidate& c) const {
    std::string name = c.column->name;
    int files = 0;
    for (const Table& table : tables_) {
      for (const Column& column : table.columns) files += column.name == name ? 1 : 0;
    }
    if (files > 1) name = std::filesystem::path(tables_[c.file].path).stem().string() + "." + name;
    return name;
  }

  const std::vector<Table>& tables_;
  std::vector<Clock> clocks_;
  std::vector<ColumnCandidate> candidates_, unnamed_;
  SamplingGrid grid_;
  std::map<SignalKind, std::string> units_;
  bool at_wheel_ = true;
  VehicleSignals out_;
};

// Units that are not given: those in which the kinematics are those of a car.
void Guess::choose_units() {
  const ColumnCandidate* speed = best_speed();
  const ColumnCandidate* r = best(SignalKind::r);
  const ColumnCandidate* ay = best(SignalKind::ay);
  const auto choices = [](const ColumnCandidate* c) {
    if (c == nullptr) return std::vector<std::string>{""};
    return c->unit.empty() ? usual_units(c->kind) : std::vector<std::string>{c->unit};
  };
  const VectorXd v = speed == nullptr ? VectorXd() : sampled(*speed);
  const VectorXd yaw = r == nullptr ? VectorXd() : sampled(*r);
  const VectorXd side = ay == nullptr ? VectorXd() : sampled(*ay);
  PairedCorrelation alike;
  if (speed != nullptr && r != nullptr && ay != nullptr) {
    alike = likeness(v.cwiseProduct(yaw), side);
  }
  const double top_v = high_quantile(v), top_r = high_quantile(yaw), top_ay = high_quantile(side);
  double least = kInfinity;
  for (const std::string& uv : choices(speed)) {
    for (const std::string& ur : choices(r)) {
      for (const std::string& ua : choices(ay)) {
        const double sv = unit_or_dimensionless(uv).scale;
        const double sr = unit_or_dimensionless(ur).scale;
        const double sa = unit_or_dimensionless(ua).scale;
        double cost = outside(sv * top_v, 1.0, 90.0) + outside(sr * top_r, 0.02, 2.0) +
                      outside(sa * top_ay, 0.2, 25.0);
        // Without lateral acceleration: the one that vx and r imply.
        if (speed != nullptr && r != nullptr) {
          cost += outside(sv * sr * high_quantile(v.cwiseProduct(yaw)), 0.2, 15.0);
        }
        if (std::abs(alike.correlation) > 0.6) {
          cost += 3.0 * std::abs(std::log(alike.slope * sa / (sv * sr)));
        }
        // Of equals the first: SI. mph is the rarest.
        cost += uv == "mph" ? 0.3 : 0.0;
        if (!(cost < least - 1e-9)) continue;
        least = cost;
        if (speed != nullptr) units_[speed->kind] = uv;
        if (r != nullptr) units_[SignalKind::r] = ur;
        if (ay != nullptr) units_[SignalKind::ay] = ua;
      }
    }
  }
  // The rest follows one of these.
  const double kmh = speed == nullptr ? 1.0 : scale_of(speed->kind);
  for (const SignalKind kind : {SignalKind::vx, SignalKind::vy, SignalKind::wheel_speed,
                                SignalKind::ax, SignalKind::beta}) {
    const ColumnCandidate* c = best(kind);
    if (c == nullptr || units_.contains(kind)) continue;
    units_[kind] = c->unit;
    if (!c->unit.empty()) continue;
    const VectorXd x = sampled(*c);
    double nearest = kInfinity;
    for (const std::string& unit : usual_units(kind)) {
      const double s = parse_unit(unit)->scale;
      double cost = 0.0;
      if (kind == SignalKind::beta) {
        cost = outside(s * high_quantile(x), 0.005, 0.35);
      } else if (kind == SignalKind::ax) {
        cost = unit == (units_.contains(SignalKind::ay) ? units_[SignalKind::ay] : "m/s^2") ? 0 : 1;
      } else if (kind == SignalKind::vy) {
        cost = std::abs(std::log(s / kmh));
      } else {
        cost = std::abs(std::log(s * high_quantile(x) / (kmh * top_v)));
      }
      if (!(cost < nearest)) continue;
      nearest = cost;
      units_[kind] = unit;
    }
  }
}

// Steering wheel or road wheel, rad or deg: wheelbase times ratio, or wheelbase, of a car.
void Guess::choose_steering_unit() {
  const ColumnCandidate* c = best(SignalKind::steering);
  if (c == nullptr) return;
  const Words& w = c->words;
  const bool says_road = w.any({"rwa", "road"}) || w.part({"roadwheel", "delta"});
  const bool says_wheel = !says_road && (w.any({"swa", "sw", "hwa", "stw"}) || w.part({"wheel"}));
  at_wheel_ = !says_road;
  units_[SignalKind::steering] = c->unit.empty() ? "rad" : c->unit;
  const ColumnCandidate* speed = best_speed();
  const ColumnCandidate* r = best(SignalKind::r);
  const VectorXd delta = sampled(*c);
  double length = kNaN;  // in units of the angle
  if (speed != nullptr && r != nullptr) {
    const VectorXd v = sampled(*speed) * scale_of(speed->kind);
    const VectorXd yaw = sampled(*r) * scale_of(SignalKind::r);
    VectorXd x = v.cwiseProduct(delta);
    for (Index i = 0; i < x.size(); ++i) {
      if (!(v[i] > 1.5) || std::abs(v[i] * yaw[i]) > 4.0) x[i] = kNaN;
    }
    length = 1.0 / likeness(x, yaw).slope;
  }
  double least = kInfinity;
  for (const std::string& unit :
       c->unit.empty() ? usual_units(SignalKind::steering) : std::vector<std::string>{c->unit}) {
    for (const bool wheel : {true, false}) {
      const double s = parse_unit(unit)->scale;
      const double top = s * high_quantile(delta);
      double cost = wheel ? outside(s * length, 20.0, 90.0) + outside(top, 0.03, 10.0)
                          : outside(s * length, 1.5, 6.0) + outside(top, 0.003, 0.7);
      if (wheel ? says_road : says_wheel) cost += 0.7;
      if (!(cost < least)) continue;
      least = cost;
      units_[SignalKind::steering] = unit;
      at_wheel_ = wheel;
    }
  }
}

// A column with a unit of another kind of quantity is not that signal: a curvature in 1/m is no yaw
// rate.
bool may_be(const ColumnCandidate& c, SignalKind kind) {
  const std::optional<Unit> unit = parse_unit(c.unit);
  return c.unit.empty() || !unit || same_dimension(*unit, *parse_unit(si_unit(kind)));
}

// Columns whose names are not known.
std::vector<ColumnCandidate> Guess::unnamed_columns() const {
  std::vector<ColumnCandidate> out;
  for (std::size_t f = 0; f < tables_.size(); ++f) {
    if (clocks_[f].time.size() == 0) continue;
    for (const Column& column : tables_[f].columns) {
      const bool taken = !holds_numbers(column) || column.name == clocks_[f].column ||
                         std::any_of(candidates_.begin(), candidates_.end(),
                                     [&](const ColumnCandidate& c) { return c.column == &column; });
      if (is_curvature(Words(words_of(column.name)))) continue;
      if (taken || column.missing > column.values.size() / 2) continue;
      out.push_back({&column, f, SignalKind::r, 1.0, column.unit, false, {}});
    }
  }
  return out;
}

// @param c  a copy: what it is taken from loses it
void Guess::take_unnamed(ColumnCandidate c, SignalKind kind, const std::string& why) {
  out_.findings.push_back(
      make_finding(FindingCode::guessed_by_physics, {c.column->name},
                   fmt::format("'{}' is taken as {}: {}", c.column->name, to_string(kind), why),
                   "check it: its name does not say so"));
  std::erase_if(unnamed_, [&](const ColumnCandidate& each) { return each.column == c.column; });
  c.kind = kind;
  if (!parse_unit(c.unit)) c.unit.clear();
  candidates_.push_back(std::move(c));
}

// Speed, yaw rate and lateral acceleration at once: v r goes with ay, better than r alone does, and
// v is never negative.
void Guess::guess_speed_with_rates() {
  double top = 0.9;
  const ColumnCandidate *v = nullptr, *r = nullptr, *ay = nullptr;
  std::vector<VectorXd> x;
  for (const ColumnCandidate& c : unnamed_) x.push_back(sampled(c));
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!(x[i].array().isNaN() || x[i].array() > -0.3).all() || high_quantile(x[i]) < 1.0) continue;
    for (std::size_t j = 0; j < x.size(); ++j) {
      for (std::size_t k = 0; k < x.size(); ++k) {
        if (i == j || i == k || j == k) continue;
        if (!may_be(unnamed_[i], SignalKind::vx) || !may_be(unnamed_[j], SignalKind::r) ||
            !may_be(unnamed_[k], SignalKind::ay)) {
          continue;
        }
        const double with = std::abs(likeness(x[i].cwiseProduct(x[j]), x[k]).correlation);
        const double without = std::abs(likeness(x[j], x[k]).correlation);
        if (with <= top || with < without + 1e-4) continue;
        top = with;
        v = &unnamed_[i];
        r = &unnamed_[j];
        ay = &unnamed_[k];
      }
    }
  }
  if (v == nullptr) return;
  const ColumnCandidate one = *v, two = *r, three = *ay;
  const std::string why = fmt::format("'{}' times '{}' goes with '{}' (correlation {:.3f})",
                                      one.column->name, two.column->name, three.column->name, top);
  take_unnamed(one, SignalKind::vx, why);
  take_unnamed(two, SignalKind::r, why);
  take_unnamed(three, SignalKind::ay, why);
}

// The unnamed column that goes best with a quantity that is there, one of the two times the speed.
void Guess::guess_by_correlation(SignalKind kind, SignalKind with, bool times_speed, double least) {
  if (best(kind) != nullptr || best(with) == nullptr) return;
  const VectorXd v = sampled(*best_speed()), y = sampled(*best(with));
  const ColumnCandidate* found = nullptr;
  double top = least;
  for (const ColumnCandidate& c : unnamed_) {
    if (!may_be(c, kind)) continue;
    const VectorXd one = sampled(c);
    const double here = std::abs(times_speed ? likeness(v.cwiseProduct(one), y).correlation
                                             : likeness(one, v.cwiseProduct(y)).correlation);
    if (here <= top) continue;
    top = here;
    found = &c;
  }
  if (found == nullptr) return;
  take_unnamed(
      *found, kind,
      fmt::format("{} goes with {} (correlation {:.3f})", times_speed ? "speed times it" : "it",
                  times_speed ? to_string(with) : "speed times " + to_string(with), top));
}

// Quantities that no name gives.
void Guess::try_unnamed() {
  unnamed_ = unnamed_columns();
  if (unnamed_.empty() || unnamed_.size() > 16) return;
  if (best_speed() == nullptr && best(SignalKind::r) == nullptr) guess_speed_with_rates();
  if (best_speed() == nullptr) return;
  guess_by_correlation(SignalKind::r, SignalKind::ay, true, 0.9);
  guess_by_correlation(SignalKind::ay, SignalKind::r, false, 0.9);
  guess_by_correlation(SignalKind::steering, SignalKind::r, true, 0.8);
}

std::string Guess::file_name(std::size_t file) const {
  return std::filesystem::path(tables_[file].path).filename().string();
}

void Guess::check_clocks() {
  for (std::size_t f = 0; f < tables_.size(); ++f) {
    if (clocks_[f].time.size() == 0) {
      const std::string file = file_name(f);
      out_.findings.push_back(make_finding(
          FindingCode::no_time, {file}, fmt::format("no column of {} is an increasing time", file),
          "name it 'time' or 't'; time: {step: ...} in a model file"));
    }
    if (clocks_[f].guessed) {
      out_.findings.push_back(make_finding(
          FindingCode::guessed_by_physics, {clocks_[f].column},
          fmt::format(
              "'{}' of {} is taken as time in {}: the first column, and it increases evenly",
              clocks_[f].column, file_name(f), clocks_[f].unit),
          "check it: its name does not say so"));
    }
    if (clocks_[f].repeated > 0) {
      const std::string file = file_name(f);
      out_.findings.push_back(
          make_finding(FindingCode::repeated_stamps, {file},
                       fmt::format("{} time stamps of {} are those of the row before",
                                   clocks_[f].repeated, file),
                       "remove the rows, or write time with all its digits"));
    }
    if (clocks_[f].runs > 1) {
      const std::string file = file_name(f);
      out_.findings.push_back(make_finding(
          FindingCode::several_runs, {file},
          fmt::format("time runs back {} times: {} runs in one file", clocks_[f].runs - 1,
                      clocks_[f].runs),
          "time: {..., runs: restart} in the model file; this survey puts them one after the "
          "other"));
      out_.findings.back().changes = {{"", "time: {runs: restart}"}};
    }
  }
}

// The file on whose clock columns of all files are compared.
std::size_t Guess::base_file() const {
  for (const SignalKind kind : {SignalKind::r, SignalKind::ay, SignalKind::vx}) {
    if (const ColumnCandidate* c = best(kind)) return c->file;
  }
  return first_timed();
}

std::size_t Guess::first_timed() const {
  const auto timed = std::find_if(clocks_.begin(), clocks_.end(),
                                  [](const Clock& c) { return c.time.size() > 0; });
  return static_cast<std::size_t>(timed - clocks_.begin());
}

VehicleSignal Guess::signal_of(const ColumnCandidate& c) {
  const ColumnCandidate* first = best(c.kind);
  VehicleSignal s;
  s.kind = c.kind;
  s.column = called(c);
  s.unit = first == &c ? units_[c.kind] : c.unit;
  if (s.unit.empty()) s.unit = unit_like(c, *first);
  s.source = file_name(c.file);
  s.at_wheel = at_wheel_;
  s.axis = c.words.any({"down", "right"}) ? -1.0 : 1.0;
  s.time = clocks_[c.file].time;
  s.value = raw_values(*c.column) * unit_or_dimensionless(s.unit).scale;
  return s;
}

VehicleSignals Guess::run() {
  out_.name = tables_.empty() ? "" : file_name(0);
  check_clocks();
  std::erase_if(candidates_,
                [&](const ColumnCandidate& c) { return clocks_[c.file].time.size() == 0; });
  if (first_timed() == clocks_.size()) return std::move(out_);
  grid_.time = clocks_[base_file()].time;
  grid_.step = own_period(grid_.time, grid_.time);
  try_unnamed();
  choose_units();
  choose_steering_unit();

  out_.time_column = clocks_[first_timed()].column;
  out_.time_unit = clocks_[first_timed()].unit;
  out_.restarts = clocks_[first_timed()].runs > 1;
  std::set<const Column*> used;
  std::string unclear;
  for (const ColumnCandidate& c : candidates_) {
    if (!used.insert(c.column).second) continue;
    const VehicleSignal& s = out_.signals.emplace_back(signal_of(c));
    if (!c.unit.empty()) continue;
    unclear += fmt::format("{}{} {}", unclear.empty() ? "" : ", ", s.column, s.unit);
  }
  if (!unclear.empty()) {
    out_.findings.push_back(make_finding(
        FindingCode::unit_unclear, {},
        "the file gives no unit of some columns; these make the kinematics of a car: " + unclear,
        "check them"));
  }
  return std::move(out_);
}

}  // namespace

VehicleSignals guess_vehicle(const std::vector<Table>& tables) { return Guess(tables).run(); }

}  // namespace identikal
