// One sample of a Kalman predictor and of its derivatives by every parameter at once: the value
// stands in the first lane of each number, the derivatives in the lanes behind it, so that what is
// done to one is done to all in the same instructions. Raw pointers only: this file is compiled for
// several instruction sets. Internal to the filter: tangent_filter.h drives it.
//
//   e = y - C x - D u,  Sigma = C P C' + R = L L',  K = (A P C' + S) Sigma^-1,  F = A - K C,
//   x+ = A x + B u + K e,  P+ = F P F' + W + (K R - S) K' - K S',
//   de = -C dx - dC x - dD u,  dK = (F dP C' + dS - K dR + dF P C' + F P dC') Sigma^-1,
//   dx+ = A dx + dA x + dB u + K de + dK e,
//   dP+ = F dP F' + dW + (K dR - dS) K' - K dS' + dF P F' + F P dF',  dF = dA - K dC;
//
// dSigma has dC P C' + C P dC' beside C dP C' + dR. W is G Q G' and S is G S of
// lib/model/state_space.h. The gain minimises P+, so dK drops out of dP+.
#pragma once

#include <cstddef>

namespace identikal::simd {

/// Up to so many states products with F are written out; with more they run along what of A is not
/// zero, and along K.
constexpr int kUnrolledStates = 4;

/// A model with the channels that a sample has, m of them. Numbers in lanes: matrix [i][j] of
/// rows x cols, block b, lane l at ((b rows + i) cols + j) lanes + l.
struct TangentModel {
  int n = 0, m = 0, nu = 0, blocks = 0, lanes = 0, derivatives = 0;
  const double* A = nullptr;  ///< n x n; null where n > kUnrolledStates
  /// Entries of A that may differ from zero, row by row; where n > kUnrolledStates one of each row at least.
  const int *A_row = nullptr, *A_column = nullptr;  ///< n + 1; A_row[n]
  const double* A_entry = nullptr;                  ///< A_row[n]
  /// C, row by row.
  const int *C_row = nullptr, *C_column = nullptr;  ///< m + 1; C_row[m]
  const double* C = nullptr;
  const int* channel = nullptr;  ///< m: rows of y
  // In lanes; those that may be null are zero then.
  const double *W = nullptr, *R = nullptr;  ///< n x n; m x m
  const double* S = nullptr;                ///< n x m, or null
  const double *B = nullptr, *D = nullptr;  ///< n x nu, m x nu; null without inputs
  // Entries of A and of C, row by row, that any parameter moves, and what they are in lanes: entry e
  // of block b at (b entries + e) lanes, the entries being the last of each row's ends.
  const int *A_theta_row = nullptr, *A_theta_column = nullptr;  ///< n + 1; A_theta_row[n]
  const int *C_theta_row = nullptr, *C_theta_column = nullptr;  ///< m + 1; C_theta_row[m]
  const double *A_theta = nullptr, *C_theta = nullptr;          ///< null: noise alone
  bool diagonal_R = true;                                       ///< in every lane
};

/// State before a sample, workspace and sums. x has one column, or 1 + n with the responses to a
/// diffuse start behind the first.
struct TangentRun {
  int columns = 1;
  bool informed = true;                    ///< whether samples add to the information
  double *P = nullptr, *next_P = nullptr;  ///< n x n in lanes
  /// F P in lanes; where n > kUnrolledStates with m columns behind it, F P C' - K R + S.
  double* T = nullptr;
  double *x = nullptr, *next_x = nullptr;                      ///< columns x n in lanes
  double *PC = nullptr, *Sigma = nullptr, *K_theta = nullptr;  ///< n x m, m x m, n x m in lanes
  double* E = nullptr;                                         ///< columns x m in lanes
  double *white = nullptr,
         *white_lanes = nullptr;      ///< m (m + 1)/2 + m rows of blocks * lanes; a row
  double* CP = nullptr;               ///< m x n in lanes, of a block
  double *F = nullptr, *K = nullptr;  ///< n x n, or by rows what A has and then -K; n x m
  double *L_inverse = nullptr, *Sigma_inverse = nullptr;  ///< m x m
  double* Sie = nullptr;                                  ///< m: Sigma^-1 e
  double *dC_PF = nullptr, *dC_PC = nullptr;  ///< dC P F', dC P C': m x n, m x m lanes of a block
  double* work = nullptr;                     ///< m m lanes + m m
  // Of tangent_stationary.h: n x m and m x m in lanes; all lanes; m.
  struct Stationary {
    double *Y = nullptr, *next_Y = nullptr, *N = nullptr, *YH = nullptr;
    double *M = nullptr, *G = nullptr, *H = nullptr;
    double *largest = nullptr, *first_Sigma = nullptr;
  } stationary;
  // Sums.
  double* gradient = nullptr;     ///< blocks * lanes
  double* information = nullptr;  ///< (1 + derivatives) x blocks * lanes
  double* half_traces = nullptr;  ///< blocks * lanes: 1/2 tr(Sigma^-1 dSigma) of informed samples
  double *delta_information = nullptr,
         *delta_score = nullptr;  ///< of the columns behind the first, in lanes
  double squares = 0.0, log_det = 0.0, determinant = 1.0;
  // Where samples that have all of the ny outputs leave e, L^-1 e and the deviations of e: sample t at
  // t ny; or null.
  double *kept_e = nullptr, *kept_white = nullptr, *kept_sd = nullptr;
};

/// How a part of samples ended.
enum class TangentEnd { done, settled, indefinite, imprecise };

/// Samples t .. end - 1, all with the channels of the model. Advances t. `settled` ends it behind a
/// sample at which P and its derivatives have stopped changing, to 1e-14 and 1e-12 of themselves.
/// @param y, u  sample s at y + s ny, u + s nu
TangentEnd run_tangents(const TangentModel& model, TangentRun& run, const double* y, int ny,
                        const double* u, long& t, long end, bool stop_when_settled);

/// The same with K, dK, Sigma and dSigma as the last sample left them; x has one column.
void run_settled_tangents(const TangentModel& model, TangentRun& run, const double* y, int ny,
                          const double* u, long t, long end);

/// P of a stationary start and its derivatives.
/// @param powers  A, A^2, A^4, ..., `count` of them, until they have vanished
/// @param P, PA   of the value, P and P A'; all matrices row by row
void start_stationary_tangents(const TangentModel& model, TangentRun& run, const double* powers,
                               int count, const double* P, const double* PA);

/// All samples behind a stationary start, with all outputs. `imprecise` where what has been added to
/// the sums is worth nothing: run_tangents() keeps more digits. P is left as it was.
TangentEnd run_stationary_tangents(const TangentModel& model, TangentRun& run, const double* y,
                                   int ny, const double* u, long& t, long end);

}  // namespace identikal::simd
