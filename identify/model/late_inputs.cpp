#include "identify/model/late_inputs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Cubics between samples whose slope at a sample is that of the parabola through it and its neighbours
// (cubic convolution: Keys 1981, IEEE Trans. ASSP 29). A likelihood has a derivative by the delay then, as
// it has not with straight lines; and jumps still tell a delay of whole sampling periods, as they do
// not with a curve that keeps to the samples' range and is flat there.
class LateCurve {
 public:
  LateCurve(const VectorXd& time, const VectorXd& values)
      : time_(time), values_(values), slope_(VectorXd::Zero(time.size())) {
    const Index last = time.size() - 1;
    const auto chord = [&](Index k) {
      return (values[k + 1] - values[k]) / (time[k + 1] - time[k]);
    };
    for (Index k = 0; last > 0 && k <= last; ++k) {
      if (k == 0 || k == last) {
        slope_[k] = chord(k == 0 ? 0 : last - 1);
        continue;
      }
      const double before = time[k] - time[k - 1], behind = time[k + 1] - time[k];
      slope_[k] = (chord(k - 1) * behind + chord(k) * before) / (before + behind);
    }
  }

  struct Point {
    double value, slope;
  };
  // @param at  rising from call to call, or anything
  Point at(double at) {
    const Index last = time_.size() - 1;
    if (last < 1 || !(at > time_[0])) return {values_[0], 0.0};
    if (!(at < time_[last])) return {values_[last], 0.0};
    if (at < time_[interval_]) interval_ = 0;
    if (at >= time_[interval_ + 1]) {
      const auto behind = std::upper_bound(time_.begin() + interval_, time_.end(), at);
      interval_ = std::min<Index>(behind - time_.begin() - 1, last - 1);
    }
    return in_interval(interval_, at);
  }

 private:
  // value + s h (slope + s (c2 + s c3)), s = (at - time)/h
  Point in_interval(Index k, double at) const {
    const double h = time_[k + 1] - time_[k], s = (at - time_[k]) / h;
    const double chord = (values_[k + 1] - values_[k]) / h;
    const double c2 = 3.0 * chord - 2.0 * slope_[k] - slope_[k + 1];
    const double c3 = slope_[k] + slope_[k + 1] - 2.0 * chord;
    return {values_[k] + s * h * (slope_[k] + s * (c2 + s * c3)),
            slope_[k] + s * (2.0 * c2 + s * 3.0 * c3)};
  }

  const VectorXd time_, values_;
  VectorXd slope_;
  Index interval_ = 0;
};

// What was recorded of it: in memory, without rows before and behind, what stands in u.
LateCurve curve_of(const Dataset& recording, int input) {
  const auto same = [&](const LateRecord& each) { return each.input == input; };
  const auto at = std::find_if(recording.late.begin(), recording.late.end(), same);
  if (at != recording.late.end()) return {at->time, at->values};
  return {recording.time, recording.u.row(input).transpose()};
}

double delay_of(const ModelFormulas::LateInput& late, const ParameterSet& at) {
  return at[static_cast<std::size_t>(late.parameter)].scalar();
}

// Runs of rows in which the input is there, first and last.
std::vector<std::pair<Index, Index>> runs_of(const Dataset& recording, Index input) {
  std::vector<std::pair<Index, Index>> out;
  const Index N = recording.size();
  for (Index from = 0; from < N;) {
    Index to = from;
    while (to < N && std::isfinite(recording.u(input, to))) ++to;
    if (to > from) out.emplace_back(from, to - 1);
    from = std::max(to, from + 1);
  }
  return out;
}

// Per row the run that holds it with all of its delays, or -1.
std::vector<int> run_of_rows(const VectorXd& time, const std::vector<std::pair<Index, Index>>& runs,
                             const Parameter& delay) {
  std::vector<int> out(static_cast<std::size_t>(time.size()), -1);
  const double least = delay.fixed ? delay.scalar() : delay.min;
  const double most = delay.fixed ? delay.scalar() : delay.max;
  const double rounding = 1e-9 * (time[time.size() - 1] - time[0]);
  for (Index t = 0; t < time.size(); ++t) {
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const bool begun = time[runs[r].first] <= time[t] - most + rounding;
      const bool open = time[t] - least <= time[runs[r].second] + rounding;
      if (begun && open) out[static_cast<std::size_t>(t)] = static_cast<int>(r);
    }
  }
  return out;
}

// In which rows one late input is known, and by which run of its samples.
struct LateRows {
  std::vector<std::pair<Index, Index>> runs;
  std::vector<int> run;  // per row
};

LateRows known_rows(const Model& model, const ModelFormulas::LateInput& late,
                    const Dataset& recording) {
  LateRows out;
  out.runs = runs_of(recording, late.input);
  out.run = run_of_rows(recording.time, out.runs,
                        model.parameters[static_cast<std::size_t>(late.parameter)]);
  return out;
}

LateRecord record_of(const Dataset& recording, int input, std::pair<Index, Index> run) {
  const Index count = run.second - run.first + 1;
  return {input, recording.time.segment(run.first, count),
          recording.u.row(input).segment(run.first, count).transpose()};
}

}  // namespace

MatrixXd inputs_at(const FormulaModel& model, const ParameterSet& at, const Dataset& recording) {
  if (model.late.empty()) return recording.u;
  const Index nu = recording.u.rows();
  MatrixXd out(nu + static_cast<Index>(model.late.size()), recording.size());
  out.topRows(nu) = recording.u;
  for (const ModelFormulas::LateInput& late : model.late) {
    LateCurve curve = curve_of(recording, late.input);
    const double delay = delay_of(late, at);
    for (Index t = 0; t < recording.size(); ++t) {
      const LateCurve::Point point = curve.at(recording.time[t] - delay);
      out(late.input, t) = point.value + point.slope * delay;
      out(late.slope, t) = point.slope;
    }
  }
  return out;
}

std::vector<Dataset> with_late_records(const Model& model, Dataset recording) {
  const std::vector<ModelFormulas::LateInput>& all = as_formulas(model).late;
  if (all.empty()) return {std::move(recording)};
  std::vector<LateRows> rows;
  for (const auto& late : all) rows.push_back(known_rows(model, late, recording));
  const auto known = [&](Index t) {
    return std::all_of(rows.begin(), rows.end(), [&](const LateRows& each) {
      return each.run[static_cast<std::size_t>(t)] >= 0;
    });
  };
  const auto same_runs = [&](Index t, Index other) {
    return std::all_of(rows.begin(), rows.end(), [&](const LateRows& each) {
      return each.run[static_cast<std::size_t>(t)] == each.run[static_cast<std::size_t>(other)];
    });
  };
  std::vector<Dataset> out;
  for (Index from = 0; from < recording.size();) {
    Index to = from;
    while (to < recording.size() && known(to) && same_runs(from, to)) ++to;
    if (to > from) {
      Dataset part = samples_from(first_samples(recording, to), from);
      for (std::size_t i = 0; i < all.size(); ++i) {
        const auto run = static_cast<std::size_t>(rows[i].run[static_cast<std::size_t>(from)]);
        part.late.push_back(record_of(recording, all[i].input, rows[i].runs[run]));
        LateCurve curve(part.late.back().time, part.late.back().values);
        const double delay = delay_of(all[i], model.parameters);
        for (Index t = 0; t < part.size(); ++t) {
          part.u(all[i].input, t) = curve.at(part.time[t] - delay).value;
        }
      }
      out.push_back(std::move(part));
    }
    from = std::max(to, from + 1);
  }
  if (out.empty()) {
    throw InputError({recording.name, 0, 0},
                     "no row in which every input is known as late as it may be",
                     "a recording that is longer than the delays may be, or a smaller max of them");
  }
  return out;
}

}  // namespace identikal
