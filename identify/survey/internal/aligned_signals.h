// How do all signals of a vehicle's recording look on one sampling grid? What the parts of the
// survey (identify/survey/survey.h) share.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "identify/survey/signals.h"
#include "lib/statistics/paired_correlation.h"

namespace identikal::surveying {

/// [m/s]: use_when proposed; the single-track model needs it
inline constexpr double kSlowestUse = 3.0;
inline constexpr double kSlowestTest =
    1.5;  ///< [m/s]: below, v r and v delta carry little information
inline constexpr double kSmoothing = 0.3;  ///< [s]: kinematics are compared on means over so long

/// The samples that are there.
std::vector<double> present(const Eigen::VectorXd& x);

/// quantile() of the samples that are there; NaN of none.
double quantile_of(const Eigen::VectorXd& x, double p);

/// The least step between two values; NaN where there is none.
double quantum_of(const Eigen::VectorXd& x);

/// paired_correlation(); empty of fewer than 8 samples.
PairedCorrelation compare_pair(const Eigen::VectorXd& x, const Eigen::VectorXd& y);

std::string shown(double value);
std::string percent(double share);

/// SI value of 1 of the signal's unit.
double unit_scale(const VehicleSignal& signal);

/// The recording on one sampling grid, and what was found so far.
struct Scene {
  VehicleSurvey out;
  std::map<SignalKind, const VehicleSignal*> first;  ///< of each kind
  Eigen::VectorXd time;                              ///< [s], of the sampling grid
  double step = kNone;                               ///< [s]
  std::map<SignalKind, Eigen::VectorXd> on;          ///< on the sampling grid
  std::map<SignalKind, Eigen::VectorXd> smooth;      ///< the same, averaged
  Eigen::VectorXd speed;                             ///< what stands for vx
  std::string speed_name;
  double length = kNone;  ///< wheelbase times steering ratio where they are known [m]

  bool has(SignalKind kind) const { return on.contains(kind); }
  const VehicleSignal& signal(SignalKind kind) const { return *first.at(kind); }
  std::string name(SignalKind kind) const { return "'" + signal(kind).column + "'"; }
  void add_finding(FindingCode code, Severity severity, std::vector<std::string> about,
                   std::string text, std::string todo) {
    out.findings.push_back({code, severity, std::move(about), std::move(text), std::move(todo)});
  }
  bool found(FindingCode code) const;
  /// Of the signal in the mapping, or null.
  VehicleSurvey::Proposal* proposal(SignalKind kind);
};

/// Takes the first signal of each kind onto the sampling grid of one of them.
/// @return false when there is no sampling grid
bool make_sampling_grid(const VehicleSignals& signals, Scene& scene);

/// x where the car drives faster than `speed`, else missing.
Eigen::VectorXd while_driving(const Scene& scene, const Eigen::VectorXd& x, double speed);

}  // namespace identikal::surveying
