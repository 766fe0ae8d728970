#include "identify/filter/outliers.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/nonlinear_recordings.h"
#include "lib/base/constants.h"
#include "lib/base/median.h"
#include "lib/data/row_time.h"
#include "lib/data/units.h"
#include "lib/filter/gated_innovations.h"
#include "lib/filter/kalman.h"
#include "lib/filter/steady_state.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kOutlier = 6.0;      // robust standard deviations
constexpr double kOffset = 5.0;       // standard errors of the mean
constexpr double kSerious = 0.05;     // share of the innovations' power
constexpr double kMostLeftOut = 0.1;  // of the samples of an output
// Of a constant offset of the outputs, whitened, what the innovations have to keep in the steady
// state: rounding leaves up to 1e-10 of one that the model integrates away.
constexpr double kSeen = 1e-6;

// Of every recording; innovations are missing where the filter does not run.
std::vector<FilterResult> filtered(const Model& model, const ParameterSet& parameters,
                                   const std::vector<Dataset>& recordings) {
  std::vector<FilterResult> out;
  for (const Dataset& data : recordings) {
    out.push_back(run_filter(model, parameters, data, Keep::innovations));
    if (out.back().status == FilterStatus::ok) continue;
    out.back().e = out.back().standardised = MatrixXd::Constant(data.y.rows(), data.size(), kNone);
  }
  return out;
}

using Still = Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic>;

// Which samples belong to ten or more equal ones in a row: the sensor stands still.
Still still_samples(const Dataset& data) {
  constexpr Index kFewest = 10;
  Still out = Still::Constant(data.y.rows(), data.size(), false);
  for (Index i = 0; i < data.y.rows(); ++i) {
    Index first = 0;  // of the present run
    for (Index t = 1; t <= data.size(); ++t) {
      if (t < data.size() && data.y(i, t) == data.y(i, first)) continue;
      if (t - first >= kFewest) out.row(i).segment(first, t - first).setConstant(true);
      first = t;
    }
  }
  return out;
}

// From the median |e| of one channel over all recordings, but for what stands still; 0 when there
// is nothing.
double robust_deviation(const std::vector<FilterResult>& filters, MatrixXd FilterResult::*e,
                        const std::vector<Still>& still, Index channel) {
  constexpr std::size_t kFewest = 20;
  std::vector<double> all, moving;
  for (std::size_t r = 0; r < filters.size(); ++r) {
    const MatrixXd& of = filters[r].*e;
    for (Index t = 0; t < of.cols(); ++t) {
      const double size = std::abs(of(channel, t));
      if (std::isnan(size)) continue;
      all.push_back(size);
      if (!still[r](channel, t)) moving.push_back(size);
    }
  }
  if (all.empty()) return 0.0;
  return kDeviationPerMedian * median(moving.size() >= kFewest ? moving : all);
}

// Which channel of a sample is farthest off, in deviations.
struct Farthest {
  Index channel = 0;
  double size = kNone;
};

Farthest largest_of(const MatrixXd& e, Index t, const VectorXd& deviation) {
  Farthest out{0, std::abs(e(0, t)) / deviation[0]};
  for (Index i = 1; i < e.rows(); ++i) {
    const double size = std::abs(e(i, t)) / deviation[i];
    if (std::isnan(out.size) || size > out.size) out = {i, size};
  }
  return out;
}

// Robust standard deviations of every output's innovations, as they are and whitened, and what a
// whitened one may be by chance.
struct Deviations {
  VectorXd plain, white;
  double by_chance = 0.0;
};

// In a short recording the median says little: there a sample is off where Student's t of its
// innovation, with its own left out of the variance, is too large for the largest of all. Zero for
// others. Source: Cook & Weisberg (1982), section 2.2.2.
double largest_by_chance(const std::vector<FilterResult>& now, const ParameterSet& parameters) {
  constexpr double kShort = 100.0, kLevel = 1e-3;
  double count = 0.0, squares = 0.0;
  for (const FilterResult& filter : now) {
    const auto square = filter.standardised.array().square();
    count += static_cast<double>((square == square).count());
    squares += square.isNaN().select(0.0, square).sum();
  }
  if (!(count < kShort)) return 0.0;
  const double freedom = count - static_cast<double>(free_entries(parameters).size());
  if (!(freedom > 2.0)) return kInfinity;
  const double t = student_t_quantile(1.0 - 0.5 * kLevel / count, freedom - 1.0);
  return std::sqrt(squares * t * t / (freedom - 1.0 + t * t));
}

Deviations robust_deviations(const std::vector<Dataset>& recordings, const ParameterSet& parameters,
                             const std::vector<FilterResult>& now,
                             const std::vector<Still>& still) {
  const std::vector<Channel>& outputs = recordings[0].outputs;
  const auto ny = static_cast<Index>(outputs.size());
  Deviations out{VectorXd(ny), VectorXd(ny), largest_by_chance(now, parameters)};
  for (Index i = 0; i < ny; ++i) {
    if (outputs[static_cast<std::size_t>(i)].is_pseudo) {
      out.plain[i] = out.white[i] = kNone;  // nothing is larger
      continue;
    }
    // Only tells channels apart.
    out.plain[i] = ny > 1 ? robust_deviation(now, &FilterResult::e, still, i) : 1.0;
    out.white[i] = robust_deviation(now, &FilterResult::standardised, still, i);
  }
  return out;
}

// What is farthest off at a sample, if it lies beyond the limit.
std::optional<Outlier> outlier_at(const FilterResult& now, std::size_t recording, Index t,
                                  const Deviations& deviation) {
  // Whitened: at the start, and after gaps, innovations are larger by rights.
  const auto [farthest, size] = largest_of(now.standardised, t, deviation.white);
  if (!(std::isfinite(size) && size > kOutlier)) return std::nullopt;
  if (size * deviation.white[farthest] < deviation.by_chance) return std::nullopt;
  // One of a sample disturbs the others' whitened values: the channel shows unwhitened.
  return Outlier{recording, largest_of(now.e, t, deviation.plain).channel, t, size};
}

bool any_outlier(const std::vector<FilterResult>& now, const Deviations& deviation) {
  for (std::size_t r = 0; r < now.size(); ++r) {
    for (Index t = 0; t < now[r].standardised.cols(); ++t) {
      if (outlier_at(now[r], r, t, deviation)) return true;
    }
  }
  return false;
}

// One after the other as a filter with a gate meets them. What is off for longer than kMostInARow
// samples is no outlier: the filter follows.
// @param rest, now  change with them
std::vector<Outlier> outliers_by_gate(const Model& model, const ParameterSet& parameters,
                                      const Deviations& deviation, std::vector<Dataset>& rest,
                                      std::vector<FilterResult>& now) {
  constexpr Index kMostInARow = 50;
  std::vector<Outlier> out;
  for (std::size_t r = 0; r < rest.size(); ++r) {
    MatrixXd& y = rest[r].y;
    std::map<std::pair<Index, Index>, double> size;  // by sample and channel
    const auto far = [&](Index t, const FilterResult& so_far) {
      const std::optional<Outlier> here = outlier_at(so_far, r, t, deviation);
      if (here) size[{t, here->channel}] = here->deviations;
      return here ? static_cast<int>(here->channel) : -1;
    };
    if (is_formula_model(model)) {
      now[r] = gated_innovations(model, parameters, rest[r], kMostInARow, far);
    } else {
      const LinearModel& linear = as_linear(model);
      now[r] = gated_innovations(instantiate(linear, parameters), linear.initial, y,
                                 model_inputs(linear, rest[r].u), kMostInARow, far);
    }
    for (const auto& [at, deviations] : size) {
      const auto [t, channel] = at;
      if (std::isnan(y(channel, t))) out.push_back({r, channel, t, deviations});
    }
    if (now[r].status == FilterStatus::ok) continue;
    now[r].e.setConstant(kNone);
    now[r].standardised.setConstant(kNone);
  }
  return out;
}

// One in every segment as long as a disturbed prediction may stay disturbed, and the filter again.
std::vector<Outlier> outliers_by_segment(const Model& model, const ParameterSet& parameters,
                                         const Deviations& deviation, std::vector<Dataset>& rest,
                                         std::vector<FilterResult>& now) {
  constexpr Index apart = 100;
  std::vector<Outlier> out;
  for (std::size_t r = 0; r < rest.size(); ++r) {
    for (Index t = 0; t < rest[r].size(); ++t) {
      const std::optional<Outlier> here = outlier_at(now[r], r, t, deviation);
      if (!here) continue;
      out.push_back(*here);
      t += apart;
    }
  }
  rest = without(std::move(rest), out);
  if (!out.empty()) now = filtered(model, parameters, rest);
  return out;
}

// find_outliers(), where the filters of the recordings are known already.
std::vector<Outlier> outliers_of(const Model& model, const ParameterSet& parameters,
                                 const std::vector<Dataset>& recordings,
                                 std::vector<FilterResult> now) {
  const bool gated = !changes(model) && !(is_formula_model(model) && model.student);
  const int most_passes = gated ? 20 : 200;
  std::vector<Outlier> out;
  std::vector<Dataset> rest = recordings;
  std::vector<Still> still;
  for (const Dataset& data : recordings) still.push_back(still_samples(data));
  for (int pass = 0; pass < most_passes; ++pass) {
    const Deviations deviation = robust_deviations(recordings, parameters, now, still);
    if (!any_outlier(now, deviation)) break;
    const std::vector<Outlier> found =
        gated ? outliers_by_gate(model, parameters, deviation, rest, now)
              : outliers_by_segment(model, parameters, deviation, rest, now);
    if (found.empty()) break;
    out.insert(out.end(), found.begin(), found.end());
  }
  std::sort(out.begin(), out.end(), [](const Outlier& a, const Outlier& b) {
    return std::tie(a.recording, a.sample, a.channel) < std::tie(b.recording, b.sample, b.channel);
  });
  return out;
}

std::string first_times(const std::vector<Dataset>& recordings,
                        const std::vector<Outlier>& outliers) {
  constexpr std::size_t kShown = 3;
  std::string out;
  for (std::size_t i = 0; i < std::min(kShown, outliers.size()); ++i) {
    const Dataset& data = recordings[outliers[i].recording];
    out += fmt::format("{}{}{}", i > 0 ? ", " : "", row_time(data, outliers[i].sample),
                       recordings.size() > 1 ? " of " + data.name : "");
  }
  return out + (outliers.size() > kShown ? ", ..." : "");
}

Findings check_outliers(const Model& model, const ParameterSet& parameters,
                        const std::vector<Dataset>& recordings,
                        const std::vector<FilterResult>& filters, const OutlierEffectOf& effect) {
  Findings out;
  const std::vector<Outlier> outliers = outliers_of(model, parameters, recordings, filters);
  if (outliers.empty()) return out;
  const OutlierEffect done = effect ? effect(without(recordings, outliers)) : OutlierEffect{};
  for (std::size_t c = 0; c < recordings[0].outputs.size(); ++c) {
    std::vector<Outlier> here;
    std::copy_if(outliers.begin(), outliers.end(), std::back_inserter(here),
                 [c](const Outlier& o) { return o.channel == static_cast<Index>(c); });
    if (here.empty()) continue;
    double power = 0.0, of_outliers = 0.0;
    for (const FilterResult& filter : filters) {
      const auto row = filter.e.row(static_cast<Index>(c)).array();
      power += row.isNaN().select(0.0, row.square()).sum();
    }
    for (const Outlier& o : here)
      of_outliers += std::pow(filters[o.recording].e(o.channel, o.sample), 2);
    const double share = of_outliers / power;
    const bool serious = effect ? done.matters : share > kSerious;
    out.push_back(
        {FindingCode::outliers,
         serious ? Severity::serious : Severity::warning,
         {recordings[0].outputs[c].name},
         fmt::format("{} sample{} of '{}' ({}) lie{} up to {:.3g} robust standard deviations off "
                     "and make{} up {:.2g} % of the innovations' power{}",
                     here.size(), here.size() > 1 ? "s" : "", recordings[0].outputs[c].name,
                     first_times(recordings, here), here.size() > 1 ? "" : "s",
                     std::max_element(here.begin(), here.end(),
                                      [](const Outlier& a, const Outlier& b) {
                                        return a.deviations < b.deviations;
                                      })
                         ->deviations,
                     here.size() > 1 ? "" : "s", 100.0 * share, done.text),
         "--reject-outliers leaves them out; or empty their cells: missing samples are exact"});
    // The estimate without them is what it was compared with.
    if (effect && serious) out.back().changes = {{"--reject-outliers", ""}};
  }
  return out;
}

// Innovations with a mean: what constant in the outputs would give it?
Findings check_offset(const Model& model, const ParameterSet& parameters,
                      const std::vector<Dataset>& recordings,
                      const std::vector<FilterResult>& filters) {
  Findings out;
  const std::vector<Channel>& outputs = recordings[0].outputs;
  const auto ny = static_cast<Index>(outputs.size());
  VectorXd mean = VectorXd::Zero(ny), power = mean, count = mean, largest = mean;
  for (const Dataset& data : recordings) {
    const auto present = (data.y.array() == data.y.array());
    largest = largest.cwiseMax(present.select(data.y.cwiseAbs(), 0.0).rowwise().maxCoeff());
  }
  for (const FilterResult& filter : filters) {
    const auto present = (filter.e.array() == filter.e.array());
    mean += present.select(filter.e, 0.0).rowwise().sum();
    power += present.select(filter.e, 0.0).rowwise().squaredNorm();
    count += present.cast<double>().matrix().rowwise().sum();
  }
  mean = mean.cwiseQuotient(count);
  power = power.cwiseQuotient(count);
  VectorXd offset = VectorXd::Constant(ny, kNone);
  // The states take a constant of this output in: the innovations do not show it.
  Eigen::Array<bool, Eigen::Dynamic, 1> hidden =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(ny, false);
  const bool linear = is_linear(model);
  const StateSpace system = instantiate(noise_model(model), parameters);
  if (const auto steady = linear ? steady_state(system) : std::nullopt) {
    const Index n = system.states();
    const MatrixXd F = system.A - steady->K * system.C;
    const MatrixXd seen = MatrixXd::Identity(ny, ny) -
                          system.C * (MatrixXd::Identity(n, n) - F).partialPivLu().solve(steady->K);
    // In units of each output's innovations, so that the units chosen do not decide.
    const VectorXd unit = steady->Sigma.diagonal().cwiseSqrt();
    const MatrixXd whitened = unit.cwiseInverse().asDiagonal() * seen * unit.asDiagonal();
    if (Eigen::JacobiSVD<MatrixXd>(whitened).singularValues()[ny - 1] > kSeen) {
      offset = seen.fullPivLu().solve(mean);
      // Larger than anything measured: arithmetic of a model that all but integrates.
      offset = (offset.array().abs() <= largest.array()).select(offset, kNone);
    }
    hidden = (whitened.colwise().norm().transpose().array() <= kSeen);
  }
  for (Index i = 0; i < ny; ++i) {
    const double share = mean[i] * mean[i] / power[i];
    if (!(share * count[i] > kOffset * kOffset)) continue;
    if (outputs[static_cast<std::size_t>(i)].is_pseudo) continue;
    const Channel& source = outputs[i];
    const double scale = unit_scale(source.unit);
    const std::string unit = source.unit.empty() ? "" : " " + source.unit;
    const bool known = std::isfinite(offset[i]);
    out.push_back(
        {FindingCode::offset,
         share > kSerious ? Severity::serious : Severity::warning,
         {source.name},
         fmt::format("the innovations of '{}' have the mean {:.4g}{}, {:.2g} % of their power; the "
                     "model takes it for noise{}",
                     source.name, mean[i] / scale, unit, 100.0 * share,
                     known ? fmt::format(". An offset of {:.4g}{} in '{}' would explain it",
                                         offset[i] / scale, unit, source.name)
                     : hidden[i]
                         ? ". It is no offset of a sensor: the states take one in, and it does not "
                           "show here"
                         : ""),
         known ? "subtract the offset, or add it to the model as a constant state"
               : "add a drift or a constant input to the model"});
  }
  return out;
}

// Outputs of which more samples lie off than outliers are.
Findings check_share(const std::vector<Dataset>& recordings, const std::vector<Outlier>& outliers) {
  Findings out;
  for (std::size_t c = 0; c < recordings[0].outputs.size(); ++c) {
    const auto channel = static_cast<Index>(c);
    const auto off = std::count_if(outliers.begin(), outliers.end(),
                                   [channel](const Outlier& o) { return o.channel == channel; });
    Index present = 0, still = 0;
    for (const Dataset& data : recordings) {
      present += (data.y.row(channel).array() == data.y.row(channel).array()).count();
      still += still_samples(data).row(channel).count();
    }
    if (!(static_cast<double>(off) > kMostLeftOut * static_cast<double>(present))) continue;
    const std::string& name = recordings[0].outputs[c].name;
    const double share = static_cast<double>(still) / static_cast<double>(present);
    out.push_back(make_finding(
        FindingCode::too_many_outliers, {name},
        fmt::format("{} of {} samples of '{}' ({:.2g} %) lie off: no outliers but a noise of "
                    "another kind{}; none was left out",
                    off, present, name,
                    100.0 * static_cast<double>(off) / static_cast<double>(present),
                    share > 0.3 ? fmt::format(", and for {:.2g} % of the recording the sensor "
                                              "stands still",
                                              100.0 * share)
                                : ""),
        share > 0.3 ? "use the rows where it moves: use_when in the model file, or --range"
                    : "a part of the recording with one noise: --range; or a noise that changes: "
                      "track --adaptive"));
  }
  return out;
}

}  // namespace

std::vector<Outlier> find_outliers(const Model& model, const ParameterSet& parameters,
                                   const std::vector<Dataset>& recordings) {
  return outliers_of(model, parameters, recordings, filtered(model, parameters, recordings));
}

std::vector<Dataset> without(std::vector<Dataset> recordings,
                             const std::vector<Outlier>& outliers) {
  for (const Outlier& o : outliers) recordings[o.recording].y(o.channel, o.sample) = kNone;
  return recordings;
}

namespace {

bool is_angle(const Channel& channel) {
  return channel.unit.empty() || channel.unit == "rad" || channel.unit == "deg";
}

// Rows of an output in which it jumps by a turn, of one recording or the next.
struct Jumps {
  long count = 0, taken_for_motion = 0;  // the latter: what is expected does not jump along
  std::string first;
};

// @param e  innovations of the output
void add_jumps(const Dataset& data, Index row, const Eigen::RowVectorXd& e, Jumps& out) {
  constexpr double kTurn = 2.0 * std::numbers::pi, kNear = 0.2;  // [rad]
  constexpr double kNoise = 0.5;  // beyond a turn that measured angles scatter
  const auto within = [&](double low) {
    const auto y = data.y.row(row).array();
    return (y.isNaN() || (y > low - kNoise && y < low + kTurn + kNoise)).all();
  };
  if (!within(-0.5 * kTurn) && !within(0.0)) return;
  double before = kNone;
  for (Index t = 0; t < data.size(); ++t) {
    const double now = data.y(row, t);
    if (std::isnan(now)) continue;
    if (std::abs(std::abs(now - before) - kTurn) < kNear) {
      if (out.count++ == 0) out.first = data.name + " at " + row_time(data, t);
      out.taken_for_motion += std::abs(e[t]) > 0.5 * kTurn ? 1 : 0;
    }
    before = now;
  }
}

// An angle that jumps by a turn, which the filter takes for a large innovation. Where what is
// expected jumps along, a little sooner or later with other parameters, the likelihood has cliffs.
Findings check_turns(const Model& model, const std::vector<Dataset>& recordings,
                     const std::vector<FilterResult>& filters) {
  Findings out;
  for (std::size_t c = 0; c < recordings[0].outputs.size(); ++c) {
    const bool wraps = c < model.outputs.size() && model.outputs[c].wraps;
    if (wraps || recordings[0].outputs[c].is_pseudo || !is_angle(recordings[0].outputs[c]))
      continue;
    const auto row = static_cast<Index>(c);
    Jumps jumps;
    for (std::size_t r = 0; r < recordings.size(); ++r)
      add_jumps(recordings[r], row, filters[r].e.row(row), jumps);
    if (jumps.count == 0) continue;
    const std::string& name = recordings[0].outputs[c].name;
    const bool motion = jumps.taken_for_motion > 0;
    out.push_back(make_finding(
        FindingCode::turn, {name},
        fmt::format("'{}' jumps by a turn, {} time{}, first in {}: {}", name, jumps.count,
                    jumps.count > 1 ? "s" : "", jumps.first,
                    motion ? "the filter takes it for a motion"
                           : "what the model expects jumps along, with other parameters in another "
                             "row, so that the likelihood has cliffs"),
        "write 'wrap: true' beside its column"));
    if (!motion) out.back().severity = Severity::warning;
  }
  return out;
}

}  // namespace

Findings check_outliers_and_offset(const Model& model, const ParameterSet& parameters,
                                   const std::vector<Dataset>& recordings,
                                   const std::vector<FilterResult>& filters,
                                   const OutlierEffectOf& effect) {
  Findings out = check_outliers(model, parameters, recordings, filters, effect);
  append(out, check_offset(model, parameters, recordings, filters));
  append(out, check_turns(model, recordings, filters));
  return out;
}

NoiseEstimate tune_robust(
    const Model& model, const std::vector<Dataset>& recordings,
    const std::function<NoiseEstimate(const std::vector<Dataset>& recordings)>& estimator) {
  constexpr int kMostPasses = 10;
  std::vector<Outlier> left_out;
  const NoiseEstimate of_all = estimator(recordings);
  NoiseEstimate out = of_all;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    // Judged again on all samples: those that the first, too wide estimate wrongly took for
    // outliers come back.
    Eigen::VectorXd entries = free_entries(model.parameters);
    Index i = 0;
    for (const EstimatedParameter& p : out.parameters) {
      if (!p.fixed) entries[i++] = unit_or_dimensionless(p.unit).to_si(p.value);
    }
    const std::vector<Outlier> found =
        find_outliers(model, with_entries(model.parameters, entries), recordings);
    const bool same = std::equal(found.begin(), found.end(), left_out.begin(), left_out.end(),
                                 [](const Outlier& a, const Outlier& b) {
                                   return a.recording == b.recording && a.sample == b.sample &&
                                          a.channel == b.channel;
                                 });
    if (same) break;
    if (const Findings many = check_share(recordings, found); !many.empty()) {
      out = of_all;
      append(out.findings, many);
      conclude(out, "converged");
      return out;
    }
    left_out = found;
    out = estimator(without(recordings, left_out));
  }
  if (!left_out.empty()) {
    out.findings.push_back(make_finding(
        FindingCode::outliers_left_out, {},
        fmt::format("{} sample{} left out as outliers ({})", left_out.size(),
                    left_out.size() > 1 ? "s" : "", first_times(recordings, left_out))));
  }
  return out;
}

}  // namespace identikal
