#include "identify/survey/internal/aligned_signals.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/base/interpolation.h"
#include "lib/base/quantile.h"
#include "lib/data/units.h"

namespace identikal::surveying {

using Eigen::Index;
using Eigen::VectorXd;

std::vector<double> present(const VectorXd& x) {
  std::vector<double> out;
  for (const double v : x) {
    if (!std::isnan(v)) out.push_back(v);
  }
  return out;
}

double quantile_of(const VectorXd& x, double p) { return quantile(present(x), p); }

double quantum_of(const VectorXd& x) {
  std::vector<double> values = present(x);
  std::sort(values.begin(), values.end());
  if (values.empty()) return kNaN;
  // What rounding leaves of a decimal fraction is no step.
  const double rounding = 1e-9 * std::max(std::abs(values.front()), std::abs(values.back()));
  double least = kNaN;
  for (std::size_t i = 1; i < values.size(); ++i) {
    const double step = values[i] - values[i - 1];
    if (step > rounding && !(step >= least)) least = step;
  }
  return least;
}

PairedCorrelation compare_pair(const VectorXd& x, const VectorXd& y) {
  const PairedCorrelation out = paired_correlation(x, y);
  return out.count < 8 ? PairedCorrelation{} : out;
}

std::string shown(double value) { return fmt::format("{:.3g}", value); }

std::string percent(double share) { return fmt::format("{:.0f} %", 100.0 * share); }

double unit_scale(const VehicleSignal& signal) { return unit_or_dimensionless(signal.unit).scale; }

bool Scene::found(FindingCode code) const {
  return std::any_of(out.findings.begin(), out.findings.end(),
                     [code](const Finding& w) { return w.code == code; });
}

VehicleSurvey::Proposal* Scene::proposal(SignalKind kind) {
  for (VehicleSurvey::Proposal& p : out.mapping) {
    if (signal_kind(p.name) == kind) return &p;
  }
  return nullptr;
}

namespace {

// Mean over a window around every sample, of what is there; NaN where less than half is.
VectorXd smoothed(const VectorXd& x, Index half) {
  VectorXd out(x.size());
  double sum = 0.0;
  Index count = 0, begin = 0, end = 0;
  for (Index i = 0; i < x.size(); ++i) {
    for (; end <= std::min(i + half, x.size() - 1); ++end) {
      if (std::isnan(x[end])) continue;
      sum += x[end];
      ++count;
    }
    for (; begin < i - half; ++begin) {
      if (std::isnan(x[begin])) continue;
      sum -= x[begin];
      --count;
    }
    out[i] = 2 * count > half ? sum / static_cast<double>(count) : kNaN;
  }
  return out;
}

}  // namespace

bool make_sampling_grid(const VehicleSignals& signals, Scene& scene) {
  for (const VehicleSignal& s : signals.signals) scene.first.try_emplace(s.kind, &s);
  const SignalKind bases[] = {SignalKind::r, SignalKind::ay, SignalKind::vx,
                              SignalKind::wheel_speed, SignalKind::steering};
  const auto base = std::find_if(std::begin(bases), std::end(bases),
                                 [&](SignalKind kind) { return scene.first.contains(kind); });
  if (base == std::end(bases)) return false;
  const VehicleSignal& reference = scene.signal(*base);
  scene.time = reference.time;
  if (scene.time.size() < 2) return false;
  scene.step = own_period(scene.time, scene.time);
  const auto half = static_cast<Index>(std::lround(0.5 * kSmoothing / scene.step));
  for (const auto& [kind, signal] : scene.first) {
    const double period = own_period(signal->time, signal->value);
    scene.on[kind] =
        interpolate_linearly(signal->time, signal->value, scene.time, kBridgedPeriods * period);
    scene.smooth[kind] = smoothed(scene.on[kind], half);
  }
  for (const SignalKind kind : {SignalKind::vx, SignalKind::wheel_speed}) {
    if (!scene.has(kind) || scene.speed.size() > 0) continue;
    scene.speed = scene.on[kind];
    scene.speed_name = scene.name(kind);
  }
  return true;
}

VectorXd while_driving(const Scene& scene, const VectorXd& x, double speed) {
  VectorXd out = x;
  for (Index i = 0; i < out.size(); ++i) {
    if (!(scene.speed[i] > speed)) out[i] = kNaN;
  }
  return out;
}

}  // namespace identikal::surveying
