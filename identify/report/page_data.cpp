#include "identify/report/page_data.h"

#include <algorithm>
#include <cmath>

#include "identify/estimate/distribution.h"
#include "lib/data/units.h"
#include "lib/statistics/spectrum.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kNumbers = 45000.0;  // of all lines over time: some 400 kB as text
constexpr Index kMostColumns = 2000, kFewestColumns = 150;
constexpr double kGap = 1.5;  // of the usual step
constexpr std::size_t kMostGaps = 20;
constexpr std::size_t kMostRuns = 200;
constexpr Index kMostPoints = 1200;  // of a cloud or a track
constexpr int kLagsOfReport = 40;
constexpr Index kSegment = 1024;  // rows of a spectrum
constexpr Index kFewestForSpectrum = 64;
constexpr int kTapersOfReport = 5;

// Which rows stand behind each column.
struct Columns {
  Index rows = 0, each = 1, count = 0;
  Columns(Index rows_in, Index most) : rows(rows_in) {
    each = std::max<Index>(1, (rows + most - 1) / most);
    count = (rows + each - 1) / each;
  }
};

Line thinned(const Columns& columns, const Eigen::Ref<const VectorXd>& x) {
  Line out;
  if (columns.each == 1) {
    out.low = x;
    return out;
  }
  out.low = out.high = VectorXd::Constant(columns.count, kNone);
  for (Index t = 0; t < columns.rows; ++t) {
    if (std::isnan(x[t])) continue;
    double& low = out.low[t / columns.each];
    double& high = out.high[t / columns.each];
    if (std::isnan(low) || x[t] < low) low = x[t];
    if (std::isnan(high) || x[t] > high) high = x[t];
  }
  return out;
}

// What is missing or empty has no line; rows that a shorter matrix lacks are NaN.
Line row_line(const Columns& columns, const MatrixXd& X, Index i, Index from = 0) {
  if (i >= X.rows() || X.row(i).array().isNaN().all()) return {};
  VectorXd x = VectorXd::Constant(columns.rows, kNone);
  x.segment(from, X.cols()) = X.row(i).transpose();
  return thinned(columns, x);
}

// Rows of all recordings one after the other, and the held-out ones behind them.
struct RowAxis {
  VectorXd time;
  std::vector<double> joints;
  Index fitted = 0;
};

RowAxis laid_end_to_end(const RecordingFit& fit) {
  const Series& series = fit.series;
  const VectorXd& held = fit.pictures.held_time;
  const std::vector<int>& held_recording = fit.pictures.held_recording;
  RowAxis out;
  out.fitted = series.time.size();
  out.time.resize(out.fitted + held.size());
  out.time << series.time, held;
  double usual = out.fitted > 1 ? std::abs(series.time[1] - series.time[0]) : 1.0, shift = 0.0;
  // Those of held-out rows are told from the others by their sign.
  const auto recording = [&](Index t) {
    if (t >= out.fitted) {
      return held_recording.empty() ? -1 : -held_recording[t - out.fitted];
    }
    return series.recording.empty() ? 0 : series.recording[t];
  };
  for (Index t = 1; t < out.time.size(); ++t) {
    const bool joint = recording(t) != recording(t - 1);
    double now = out.time[t] + shift;
    if (joint && now <= out.time[t - 1]) {
      shift += out.time[t - 1] + usual - now;
      now = out.time[t - 1] + usual;
    }
    if (joint) out.joints.push_back(now);
    out.time[t] = now;
  }
  return out;
}

RecordingSheet sheet_of(const Dataset& data) {
  RecordingSheet out;
  out.name = data.name;
  out.rows = data.size() - static_cast<Index>(data.absent.size());
  out.step = data.dt;
  if (out.rows == 0) return out;
  out.from = data.time[0];
  out.to = data.time[data.size() - 1];
  auto absent = data.absent.begin();
  Index before = -1;  // the last row that was recorded
  for (Index t = 0; t < data.size(); ++t) {
    if (absent != data.absent.end() && *absent == t) {
      ++absent;
      continue;
    }
    if (before >= 0) {
      const double step = data.time[t] - data.time[before];
      if (!(out.longest_step > step)) out.longest_step = step;
      if (step > kGap * data.dt) out.gaps.push_back({data.time[before], data.time[t]});
    }
    before = t;
  }
  out.gap_count = static_cast<Index>(out.gaps.size());
  std::stable_sort(out.gaps.begin(), out.gaps.end(),
                   [](const auto& a, const auto& b) { return a.to - a.from > b.to - b.from; });
  if (out.gaps.size() > kMostGaps) out.gaps.resize(kMostGaps);
  const auto add = [&](const std::vector<Channel>& channels, const MatrixXd& X, bool input) {
    for (std::size_t n = 0; n < channels.size(); ++n) {
      const Unit unit = unit_or_dimensionless(channels[n].unit);
      RecordingSheet::ChannelSheet sheet;
      sheet.name = channels[n].name;
      sheet.unit = channels[n].unit;
      sheet.input = input;
      sheet.missing = -static_cast<Index>(data.absent.size());
      double sum = 0.0, count = 0.0, low = HUGE_VAL, high = -HUGE_VAL;
      for (const double x : X.row(static_cast<Index>(n))) {
        if (std::isnan(x)) {
          ++sheet.missing;
          continue;
        }
        sum += x;
        count += 1.0;
        low = std::min(low, x);
        high = std::max(high, x);
      }
      if (count > 0.0) {
        sheet.low = unit.from_si(low);
        sheet.high = unit.from_si(high);
        sheet.mean = unit.from_si(sum / count);
      }
      out.channels.push_back(std::move(sheet));
    }
  };
  add(data.inputs, data.u, true);
  add(data.outputs, data.y, false);
  return out;
}

// Runs of rows with a prediction, in one-row steps of the axis.
std::vector<std::array<double, 2>> runs_of(const VectorXd& time, const std::vector<bool>& inside) {
  std::vector<std::array<double, 2>> out;
  for (std::size_t t = 0; t < inside.size(); ++t) {
    if (!inside[t]) continue;
    const double now = time[t];
    if (t > 0 && inside[t - 1]) {
      out.back()[1] = now;
    } else {
      out.push_back({now, now});
    }
  }
  // Too many to draw: the shortest breaks are bridged.
  while (out.size() > kMostRuns) {
    std::vector<double> breaks;
    for (std::size_t k = 1; k < out.size(); ++k) breaks.push_back(out[k][0] - out[k - 1][1]);
    std::nth_element(breaks.begin(), breaks.begin() + static_cast<long>(kMostRuns) / 2,
                     breaks.end(), std::greater<>());
    const double least = breaks[kMostRuns / 2];
    std::vector<std::array<double, 2>> fewer{out[0]};
    for (std::size_t k = 1; k < out.size(); ++k) {
      if (out[k][0] - fewer.back()[1] > least) {
        fewer.push_back(out[k]);
      } else {
        fewer.back()[1] = out[k][1];
      }
    }
    out = std::move(fewer);
  }
  return out;
}

// With missing samples between one recording and the next, so that no lag reaches across.
MatrixXd apart(const MatrixXd& X, const std::vector<int>& recording, Index gap) {
  if (recording.empty() || X.cols() == 0) return X;
  const int last = recording.back();
  MatrixXd out = MatrixXd::Constant(X.rows(), X.cols() + gap * std::max(0, last - 1), kNone);
  Index shift = 0;
  for (Index t = 0; t < X.cols(); ++t) {
    if (t > 0 && recording[t] != recording[t - 1]) shift += gap;
    out.col(t + shift) = X.col(t);
  }
  return out;
}

// corr(e(t), u(t - k)) at k = -lags .. lags, over the pairs that are there; the fewer these are,
// the smaller it is made, so that every lag has the variance 1 / N where e is white.
VectorXd cross_correlation(const VectorXd& e, const VectorXd& u, int lags) {
  const auto standardised = [](const VectorXd& x) {
    double n = 0.0, sum = 0.0, squares = 0.0;
    for (const double v : x) {
      if (std::isnan(v)) continue;
      n += 1.0;
      sum += v;
    }
    VectorXd out = x.array() - sum / n;
    for (const double v : out) squares += std::isnan(v) ? 0.0 : v * v;
    return VectorXd(out / std::sqrt(squares / n));
  };
  const VectorXd a = standardised(e), b = standardised(u);
  const Eigen::Array<bool, Eigen::Dynamic, 1> has_a = a.array().isFinite(),
                                              has_b = b.array().isFinite();
  const VectorXd a0 = has_a.select(a, 0.0), b0 = has_b.select(b, 0.0);
  const VectorXd in_a = has_a.cast<double>(), in_b = has_b.cast<double>();
  VectorXd out = VectorXd::Constant(2 * lags + 1, kNone);
  const Index N = e.size();
  const double both = in_a.dot(in_b);
  for (Index k = -lags; k <= lags; ++k) {
    const Index n = N - std::abs(k), from_a = std::max<Index>(0, k),
                from_b = std::max<Index>(0, -k);
    if (n < 2) continue;
    const double pairs = in_a.segment(from_a, n).dot(in_b.segment(from_b, n));
    if (pairs > 0.0)
      out[k + lags] = a0.segment(from_a, n).dot(b0.segment(from_b, n)) / std::sqrt(pairs * both);
  }
  return out;
}

struct Spectra {
  VectorXd omega;  // rad per sample
  MatrixXd level;
  Index segments = 0, segment = 0;
};

// Means over segments, so that a long recording has narrow bands instead of a million frequencies.
Spectra spectra_of(const MatrixXd& standardised) {
  Spectra out;
  const Index N = standardised.cols();
  out.segment = N < 2 * kSegment ? N : kSegment;
  if (out.segment < kFewestForSpectrum) return out;
  for (Index from = 0; from + out.segment <= N; from += out.segment) {
    const MatrixXd e = standardised.middleCols(from, out.segment);
    const auto present = e.array().isFinite().cast<Index>().rowwise().sum();
    if (present.minCoeff() < out.segment / 2) continue;
    const Spectrum s = multitaper(e, kTapersOfReport);
    if (out.segments == 0) {
      out.omega = s.omega;
      out.level = MatrixXd::Zero(e.rows(), s.omega.size());
    }
    for (Index k = 0; k < s.omega.size(); ++k) {
      out.level.col(k) += s.S[k].diagonal().real();
    }
    ++out.segments;
  }
  if (out.segments > 0) out.level /= static_cast<double>(out.segments);
  return out;
}

InnovationPicture innovation_picture(const VectorXd& e, int lags) {
  InnovationPicture out;
  std::vector<double> x;
  for (const double v : e) {
    if (std::isfinite(v)) x.push_back(v);
  }
  out.samples = static_cast<Index>(x.size());
  if (x.size() < 4) return out;
  const auto n = static_cast<double>(x.size());
  const Eigen::Map<const VectorXd> values(x.data(), out.samples);
  out.mean = values.mean();
  out.sd = std::sqrt((values.array() - out.mean).square().sum() / (n - 1.0));
  VectorXd pairs;
  out.autocorrelation = autocorrelation(e, lags, &pairs).cwiseProduct((pairs / n).cwiseSqrt());

  constexpr double kReach = 4.5;
  const auto bins = static_cast<Index>(std::clamp(std::sqrt(n), 10.0, 54.0));
  out.edges = VectorXd::LinSpaced(bins + 1, -kReach, kReach);
  out.count = VectorXd::Zero(bins);
  for (const double v : x) {
    const double at = std::floor((v + kReach) / (2.0 * kReach) * static_cast<double>(bins));
    if (at < 0.0 || at >= static_cast<double>(bins)) {
      ++out.outside;
    } else {
      out.count[static_cast<Index>(at)] += 1.0;
    }
  }

  // The outermost on each side one by one, the rest evenly.
  constexpr Index kQuantiles = 200, kOutermost = 20;
  std::sort(x.begin(), x.end());
  std::vector<Index> ranks;
  if (out.samples <= kQuantiles) {
    for (Index i = 0; i < out.samples; ++i) ranks.push_back(i);
  } else {
    for (Index i = 0; i < kOutermost; ++i) ranks.push_back(i);
    const Index between = kQuantiles - 2 * kOutermost;
    const double stride = static_cast<double>(out.samples - 2 * kOutermost) / between;
    for (Index i = 0; i < between; ++i) {
      ranks.push_back(kOutermost + static_cast<Index>((static_cast<double>(i) + 0.5) * stride));
    }
    for (Index i = out.samples - kOutermost; i < out.samples; ++i) ranks.push_back(i);
  }
  out.normal.resize(static_cast<Index>(ranks.size()));
  out.seen.resize(out.normal.size());
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    const auto at = static_cast<Index>(i);
    out.normal[at] = normal_quantile((static_cast<double>(ranks[i]) + 0.5) / n);
    out.seen[at] = x[ranks[i]];
  }
  return out;
}

ReportData::Nis nis_of(const MatrixXd& standardised, const VectorXd& time) {
  constexpr Index kMostBlocks = 300, kSmallestBlock = 5;
  ReportData::Nis out;
  const Index N = standardised.cols();
  if (N < kSmallestBlock) return out;
  out.block = std::max(kSmallestBlock, (N + kMostBlocks - 1) / kMostBlocks);
  std::vector<std::array<double, 4>> points;
  for (Index from = 0; from + out.block <= N; from += out.block) {
    const auto part = standardised.middleCols(from, out.block).array();
    const auto there = part.isFinite();
    const auto dof = static_cast<double>(there.count());
    if (dof < 1.0) continue;
    points.push_back({0.5 * (time[from] + time[from + out.block - 1]),
                      there.select(part.square(), 0.0).sum() / dof,
                      chi_square_quantile(0.025, dof) / dof,
                      chi_square_quantile(0.975, dof) / dof});
  }
  const auto n = static_cast<Index>(points.size());
  out.time.resize(n);
  out.value.resize(n);
  out.low.resize(n);
  out.high.resize(n);
  for (Index k = 0; k < n; ++k) {
    const auto& p = points[k];
    out.time[k] = p[0];
    out.value[k] = p[1];
    out.low[k] = p[2];
    out.high[k] = p[3];
  }
  return out;
}

VectorXd every(const VectorXd& x, Index most) {
  const Index stride = std::max<Index>(1, (x.size() + most - 1) / most);
  VectorXd out((x.size() + stride - 1) / stride);
  for (Index k = 0; k < out.size(); ++k) out[k] = x[k * stride];
  return out;
}

Index rows_of(const std::vector<Dataset>& recordings) {
  Index rows = 0;
  for (const Dataset& data : recordings) rows += data.size();
  return rows;
}

// @param fitted  rows of the recordings; the held-out ones follow
void add_inputs(const std::vector<Dataset>& recordings, const std::vector<Dataset>& held_out,
                const Columns& columns, Index fitted, ReportData& out) {
  if (recordings.empty() || rows_of(recordings) != fitted) return;
  const bool held_too = rows_of(held_out) == columns.rows - fitted;
  for (std::size_t n = 0; n < recordings[0].inputs.size(); ++n) {
    const Unit unit = unit_or_dimensionless(recordings[0].inputs[n].unit);
    VectorXd x = VectorXd::Constant(columns.rows, kNone);
    Index at = 0;
    const auto append = [&](const std::vector<Dataset>& parts) {
      for (const Dataset& data : parts) {
        for (Index t = 0; t < data.size(); ++t) {
          x[at++] = unit.from_si(data.u(static_cast<Index>(n), t));
        }
      }
    };
    append(recordings);
    if (held_too) append(held_out);
    out.inputs.push_back(
        {recordings[0].inputs[n].name, recordings[0].inputs[n].unit, thinned(columns, x)});
  }
}

// @param time  of the rows, laid end to end
void add_whiteness(const RecordingFit& fit, const std::vector<Dataset>& recordings,
                   const VectorXd& time, ReportData& out) {
  const Series& series = fit.series;
  if (series.standardised.size() == 0) return;
  out.nis = nis_of(series.standardised, time);
  const Index N = series.time.size();
  out.lags = static_cast<int>(std::clamp<Index>(N / 4, 1, kLagsOfReport));
  const MatrixXd after = apart(series.standardised, series.recording, out.lags);
  const MatrixXd before = apart(fit.pictures.standardised_before, series.recording, out.lags);
  const Spectra now = spectra_of(after), then = before.size() > 0 ? spectra_of(before) : Spectra{};
  if (now.segments > 0 && !recordings.empty()) {
    out.frequency = now.omega / (2.0 * M_PI * recordings[0].dt);
    out.segment = now.segment;
    out.segments = now.segments;
    const double dof = 2.0 * kTapersOfReport * static_cast<double>(now.segments);
    out.level_band = {chi_square_quantile(0.025, dof) / dof, chi_square_quantile(0.975, dof) / dof};
  }
  MatrixXd u;
  if (rows_of(recordings) == N && !recordings.empty() && recordings[0].u.rows() > 0) {
    u.resize(recordings[0].u.rows(), N);
    Index at = 0;
    for (const Dataset& data : recordings) {
      u.middleCols(at, data.size()) = data.u;
      at += data.size();
    }
    u = apart(u, series.recording, out.lags);
  }
  for (std::size_t n = 0; n < out.channels.size(); ++n) {
    const auto i = static_cast<Index>(n);
    ReportChannel& channel = out.channels[n];
    channel.innovations_after = innovation_picture(after.row(i).transpose(), out.lags);
    for (Index j = 0; j < u.rows(); ++j) {
      channel.innovations_after.from_input.push_back(
          cross_correlation(after.row(i).transpose(), u.row(j).transpose(), out.lags));
    }
    if (now.segments > 0) channel.innovations_after.level = now.level.row(i).transpose();
    if (before.size() == 0) continue;
    channel.innovations_before = innovation_picture(before.row(i).transpose(), out.lags);
    if (then.segments > 0) channel.innovations_before.level = then.level.row(i).transpose();
  }
}

void add_history(const TimeHistory& history, const Columns& columns, ReportData& out) {
  if (history.mean.cols() != columns.rows) return;
  const MatrixXd low = history.mean - 2.0 * history.sd, high = history.mean + 2.0 * history.sd;
  for (std::size_t n = 0; n < history.names.size(); ++n) {
    const auto i = static_cast<Index>(n);
    out.time_history.push_back({history.names[n], history.units[n],
                                row_line(columns, history.mean, i), row_line(columns, low, i),
                                row_line(columns, high, i)});
  }
  if (history.log_alarm.size() == columns.rows) {
    out.log_alarm = row_line(columns, history.log_alarm.transpose(), 0);
    out.log_threshold = history.log_threshold;
  }
}

// Which rows have a number in any of the matrix's channels.
std::vector<bool> seen_in(const MatrixXd& X, Index rows) {
  std::vector<bool> out(rows, false);
  for (Index t = 0; t < std::min(rows, X.cols()); ++t) {
    out[t] = X.col(t).array().isFinite().any();
  }
  return out;
}

void add_pictures(const Pictures& pictures, ReportData& out) {
  out.searches = pictures.searches;
  out.profiles = pictures.profiles;
  out.high_pass_filtered = pictures.high_pass_filtered;
  for (AxlePicture axle : pictures.axles) {
    axle.slip = every(axle.slip, kMostPoints);
    axle.force = every(axle.force, kMostPoints);
    out.axles.push_back(std::move(axle));
  }
  for (const TrackPicture& track : pictures.tracks) {
    out.tracks.push_back({track.name, every(track.X, kMostPoints), every(track.Y, kMostPoints)});
  }
}

// As many as keep the page small, whatever the number of lines that are drawn on them.
Columns columns_of(const ResultSections& result, const std::vector<Dataset>& recordings,
                   Index rows) {
  const std::size_t of_inputs = recordings.empty() ? 0 : recordings[0].inputs.size();
  const double lines =
      7.0 * static_cast<double>(result.fit->series.channels.size()) +
      static_cast<double>(of_inputs) +
      (result.time_history ? 3.0 * static_cast<double>(result.time_history->names.size()) : 0.0);
  return {rows,
          std::clamp(static_cast<Index>(kNumbers / (2.0 * lines)), kFewestColumns, kMostColumns)};
}

void add_time(const RowAxis& axis, const Columns& columns, ReportData& out) {
  out.rows = columns.rows;
  out.columns = columns.count;
  out.joints = axis.joints;
  if (axis.time.size() > axis.fitted) out.held_from = axis.time[axis.fitted];
  out.time.resize(columns.count);
  for (Index k = 0; k < columns.count; ++k) {
    const Index from = k * columns.each, to = std::min(columns.rows, from + columns.each) - 1;
    out.time[k] = 0.5 * (axis.time[from] + axis.time[to]);
  }
}

MatrixXd with_held_out(const MatrixXd& X, const MatrixXd& held) {
  if (held.size() == 0 || X.size() == 0) return X;
  MatrixXd both(X.rows(), X.cols() + held.cols());
  both << X, held;
  return both;
}

void add_channels(const RecordingFit& fit, const RowAxis& axis, const Columns& columns,
                  ReportData& out) {
  const Pictures& pictures = fit.pictures;
  const Series& series = fit.series;
  MatrixXd low, high;
  if (pictures.simulation_sd.size() > 0) {
    low = pictures.simulation - 2.0 * pictures.simulation_sd;
    high = pictures.simulation + 2.0 * pictures.simulation_sd;
  }
  const MatrixXd& one_step = pictures.one_step.size() == 0 && pictures.simulation.size() == 0
                                 ? series.predicted
                                 : pictures.one_step;
  const MatrixXd measured = with_held_out(series.measured, pictures.held_measured),
                 simulation = with_held_out(pictures.simulation, pictures.held_out_simulation),
                 standardised = with_held_out(series.standardised, pictures.held_standardised);
  for (std::size_t n = 0; n < series.channels.size(); ++n) {
    const auto i = static_cast<Index>(n);
    ReportChannel channel;
    channel.name = series.channels[n];
    channel.unit = series.units[n];
    channel.measured = row_line(columns, measured, i);
    channel.one_step = row_line(columns, one_step, i);
    channel.simulation = row_line(columns, simulation, i);
    channel.forecast_low = row_line(columns, low, i);
    channel.forecast_high = row_line(columns, high, i);
    channel.before = row_line(columns, pictures.standardised_before, i);
    channel.after = row_line(columns, standardised, i);
    out.channels.push_back(std::move(channel));
  }
  if (low.size() > 0) out.forecasts = runs_of(axis.time, seen_in(low, axis.fitted));
  out.used = runs_of(axis.time, seen_in(series.predicted, axis.fitted));
}

}  // namespace

ReportData report_data(const ResultSections& result, const std::vector<Dataset>& recordings,
                       const std::vector<Dataset>& held_out, Provenance provenance) {
  ReportData out;
  out.provenance = std::move(provenance);
  for (const Dataset& data : recordings) out.recordings.push_back(sheet_of(data));
  for (const Dataset& data : held_out) {
    out.recordings.push_back(sheet_of(data));
    out.recordings.back().held = true;
  }
  if (result.fit == nullptr) return out;
  const RecordingFit& fit = *result.fit;
  add_pictures(fit.pictures, out);
  if (fit.series.time.size() == 0) return out;
  const RowAxis axis = laid_end_to_end(fit);
  const Columns columns = columns_of(result, recordings, axis.time.size());
  add_time(axis, columns, out);
  add_channels(fit, axis, columns, out);
  add_inputs(recordings, held_out, columns, axis.fitted, out);
  add_whiteness(fit, recordings, axis.time, out);
  if (result.time_history != nullptr) add_history(*result.time_history, columns, out);
  return out;
}

}  // namespace identikal
