// The extended filter and its derivatives by all directions at once: the value stands in the first
// lane of each number, the derivatives in the lanes behind it. Raw pointers only: this file is
// compiled for several instruction sets. Internal to lib: extended_filter.h drives it.
//
// Motion, with F = df/dx along it and dF its derivatives by the directions:
//
//   x' = f(x),  Phi' = F Phi,  W' = F W + W F' + Q,   P+ = Phi P Phi' + W
//
// A sample, linearised at xi with H = dh/dx:
//
//   e = y - h(xi) - H (x - xi),  M = P H',  Sigma = H M + R,  K = M Sigma^-1,  T = I - K H,
//   x+ = x + M Sigma^-1 e,   dx+ = dx + dM Sigma^-1 e + K (de - dSigma Sigma^-1 e),
//   P+ = T P T' + K R K',    dP+ = T dP T' + K dR K' - (K dH P T') - (K dH P T')'
//
// The gain minimises P+, so dK drops out of dP+.
#pragma once

namespace identikal::simd {

/// Sums of products: entry o is the sum of factor[at] times number in[at], row[o] <= at < row[o + 1].
struct LaneTerms {
  const int *row = nullptr, *factor = nullptr, *in = nullptr;
};

/// Which numbers of a formula's derivatives may differ from zero.
struct LaneSlopes {
  int rows = 0, entries = 0, curved = 0;
  const int *row = nullptr, *column = nullptr;  ///< rows + 1; entries, row by row
  const int* entry = nullptr;                   ///< curved: of the entries
  const int* curved_of = nullptr;               ///< entries: of the curved ones, or -1
  /// curved + 1; per second derivative by a state, which one.
  const int *second_row = nullptr, *second_by = nullptr;
};

/// The same at a point. Lanes: number i of block b at (b numbers + i) lanes.
struct LanePoint {
  double* slope = nullptr;   ///< entries
  double* second = nullptr;  ///< second_row[curved]
  double* value = nullptr;   ///< rows, lanes: the value, and its derivatives by p
  double* by_p = nullptr;    ///< curved, lanes: the entry's derivatives by p; 0 in the first
  double* theta = nullptr;   ///< curved, lanes, written: the entry's derivatives in all
};

struct ExtendedModel {
  int n = 0, ny = 0, blocks = 0, lanes = 0, derivatives = 0;
  LaneSlopes f, h;
  /// Phi's entries row by row, and which of them any direction moves.
  int Phi_entries = 0;
  const int *Phi_row = nullptr, *Phi_column = nullptr;
  const char* Phi_moves = nullptr;
  /// Of W, the entries of the lower triangle; n x n: which one, or -1.
  int W_entries = 0;
  const int* W_index = nullptr;
  // Rates of Phi and W: by the slopes of f, and by the curved ones times what is in the first lane.
  LaneTerms Phi_terms, Phi_moved, W_terms, W_moved;
  const double* Q = nullptr;  ///< W_entries, lanes
  const double* R = nullptr;  ///< ny x ny, lanes
  bool diagonal_R = true;
};

struct ExtendedRun {
  double *x = nullptr, *P = nullptr, *next_P = nullptr, *T = nullptr;  ///< lanes; n x n row by row
  double* xi = nullptr;  ///< n, lanes: where h is linearised; the state itself or another
  /// n + Phi_entries + W_entries numbers in lanes: x, Phi and W at a step's begin, at a stage and at
  /// the next one, and the sum over stages.
  double *begin = nullptr, *stage = nullptr, *next_stage = nullptr, *sum = nullptr;
  double* Phi_value = nullptr;  ///< Phi_entries
  LanePoint f, h;
  // Of a sample, with its m outputs.
  int m = 0;
  const int* channel = nullptr;  ///< m: of the ny
  double *M = nullptr, *E = nullptr, *Sigma = nullptr, *HX = nullptr,
         *KR = nullptr;      ///< lanes; the last two of a block
  double* next_x = nullptr;  ///< lanes
  double* K = nullptr;       ///< n x m
  /// I - K H: up to n x n entries, row by row; n + 1; and by state.
  double* gains = nullptr;
  int *gain_row = nullptr, *gain_column = nullptr, *gain_at = nullptr;
  bool* is_seen = nullptr;                                ///< n
  double *L_inverse = nullptr, *Sigma_inverse = nullptr;  ///< m x m
  double *Sie = nullptr, *white_e = nullptr;              ///< m: Sigma^-1 e, L^-1 e
  double *white = nullptr, *work = nullptr;  ///< as lib/internal/lane_scores.h has them
  // Sums.
  static constexpr int columns = 1;
  static constexpr bool informed = true;
  double* gradient = nullptr;     ///< blocks * lanes
  double* information = nullptr;  ///< (1 + derivatives) x blocks * lanes
  double squares = 0.0, log_det = 0.0, determinant = 1.0;
};

/// One stage of the Runge-Kutta method, r.f being f where the state at the stage is: adds `weight`
/// times the rates to the sum, which begins with the first stage, and moves from the step's begin by
/// `reach` times them to the next stage. Only the state does with `state_alone`.
void follow_stage(const ExtendedModel& model, ExtendedRun& run, double weight, double reach,
                  bool is_first, bool state_alone);

/// x = f(x), and Phi = F, in the place of a step's begin.
void map_state(const ExtendedModel& model, ExtendedRun& run);

/// P = Phi P Phi' + W, of the Phi and W at the step's begin.
void predict_covariance(const ExtendedModel& model, ExtendedRun& run);

enum class SampleEnd { done, indefinite, not_finite };

/// Innovations, gain and the state that they lead to, which stays in next_x; r.h is h at xi, with
/// h - y in the first lane of its values.
SampleEnd innovate(const ExtendedModel& model, ExtendedRun& run);
/// The covariance that the gain leads to.
void correct(const ExtendedModel& model, ExtendedRun& run);
/// What the sample adds to the value and, with derivatives, to gradient and information.
void add_sample(const ExtendedModel& model, ExtendedRun& run);

}  // namespace identikal::simd
