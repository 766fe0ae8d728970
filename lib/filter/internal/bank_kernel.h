// One step of many Kalman filters side by side, a vector of filters at a time. Raw pointers only:
// this file is compiled for several instruction sets, and nothing that another file might also
// instantiate may pass through it. Internal to the filter.
#pragma once

#include <cstddef>

namespace identikal::simd {

/// How many filters are taken at once; the number of lanes is a multiple of it.
std::size_t bank_width();

/// Element e of the filter in lane i stands at [e * lanes + i]. Matrices by columns, symmetric ones
/// by columns of their lower triangle.
struct BankStep {
  int states = 0;
  int outputs = 0;      ///< of the model
  int present = 0;      ///< of them, measured at this sample
  const int* channel;   ///< present: which output each one is
  const double* A;      ///< states x states, the same for all
  const double* C;      ///< present x states, the same for all
  const double* y;      ///< present: y - D u
  const double* drive;  ///< states: B u
  std::size_t lanes = 0;
  double *x, *P;               ///< prediction for this sample in, for the next one out
  const double *GQG, *GS, *R;  ///< G Q G', G S, R
  double* log_density;  ///< of y given what came before; -infinity where Sigma is not definite
  double* scratch;      ///< bank_scratch() doubles, aligned as x
};

std::size_t bank_scratch(int states, int outputs);

/// e = y - C x - D u, Sigma = C P C' + R, K = (A P C' + G S) Sigma^-1, x+ = A x + B u + K e,
/// P+ = F P F' + G Q G' - K (G S)' - (G S) K' + K R K' with F = A - K C (Joseph form).
void step_bank(const BankStep& step);

}  // namespace identikal::simd
