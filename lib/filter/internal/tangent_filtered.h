// What does a sample leave the filter with: the state behind its measurement, and how that moves with
// every parameter? Internal to the filter.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/filter/filter_result.h"
#include "lib/filter/internal/tangent_kernel.h"

namespace identikal {

/// Kf = P C' Sigma^-1,  x_filt = x + Kf e,  P_filt = (I - Kf C) P (I - Kf C)' + Kf R Kf',
///   dx_filt = dx + Kf de + (dP C' + P dC' - Kf dSigma) Sigma^-1 e,
///   dP_filt = (I - Kf C) dP (I - Kf C)' + Kf dR Kf' - half - half',  half = Kf dC P (I - Kf C)':
/// the gain minimises P_filt, so its own derivative drops out.
class FilteredTangents {
 public:
  /// Before anything else of a sample, and again wherever P, the model or its channels have changed.
  /// @param r  as the sample has left it
  /// @param P  n x n in lanes, before the sample
  void take_covariance(const simd::TangentModel& f, const simd::TangentRun& r, const double* P);
  /// @param x  n in lanes, before the sample
  void take_state(const simd::TangentModel& f, const simd::TangentRun& r, const double* x);
  /// The sample is the caller's to name.
  FilteredState& state() { return state_; }

 private:
  void find_gain(const simd::TangentModel& f, const simd::TangentRun& r, const double* P);
  void find_rest_of_covariance(const simd::TangentModel& f, const double* P);
  template <int W>
  void find_blocks(const simd::TangentModel& f, const simd::TangentRun& r, const double* P);
  template <int W>
  void find_block(const simd::TangentModel& f, const simd::TangentRun& r, const double* P, int b);
  template <int W>
  void add_moved_outputs(const simd::TangentModel& f, const double* P, int b);
  template <int W>
  void set_covariances(const simd::TangentModel& f, int b);
  template <int W>
  void find_state(const simd::TangentModel& f, const simd::TangentRun& r, const double* x);

  std::vector<double> Kf_, rest_;     // n x m; I - Kf C, n x n
  std::vector<double> P_rest_;        // P (I - Kf C)', n x n
  std::vector<double> moved_gain_;    // dP C' + P dC' - Kf dSigma: n x m in lanes
  std::vector<double> T_, KR_, out_;  // of a block: (I - Kf C) P, Kf R, the filtered covariance
  FilteredState state_;
};

}  // namespace identikal
