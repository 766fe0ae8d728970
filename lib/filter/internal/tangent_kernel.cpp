#include "lib/filter/internal/tangent_kernel.h"

#include <algorithm>
#include <cmath>

// Instruction sets that add nothing here only take the compiler longer.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/filter/internal/tangent_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// Pack before those that use it.
#include "lib/internal/lane_pack.h"
#include "lib/internal/lane_rows.h"
#include "lib/internal/lane_scores.h"
//
#include "lib/filter/internal/tangent_dynamics.h"
#include "lib/filter/internal/tangent_products.h"

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// F = A - K C as products with it want it.
template <int N>
HWY_INLINE void LayOutF(const TangentModel& f, const TangentRun& r, int m) {
  if constexpr (N > 0) {
    for (int at = 0; at < N * N; ++at) r.F[at] = f.A[at];
    for (int a = 0; a < m; ++a) {
      for (int c = f.C_row[a]; c < f.C_row[a + 1]; ++c) {
        for (int i = 0; i < N; ++i) r.F[i * N + f.C_column[c]] -= r.K[i * m + a] * f.C[c];
      }
    }
  } else {
    double* to = r.F;
    for (int i = 0; i < f.n; ++i) {
      for (int at = f.A_row[i]; at < f.A_row[i + 1]; ++at) *to++ = f.A_entry[at];
      for (int a = 0; a < m; ++a) *to++ = -r.K[i * m + a];
    }
  }
}

// K = (A P C' + S) Sigma^-1 by substitution, F = A - K C.
template <int W, int N, int M>
HWY_INLINE void FindGain(const TangentModel& f, TangentRun& r) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  const double* L = r.work;
  for (int i = 0; i < n; ++i) {
    double* k = r.K + i * m;
    for (int a = 0; a < m; ++a) k[a] = f.S != nullptr ? f.S[(i * m + a) * W] : 0.0;
    for (int at = f.A_row[i]; at < f.A_row[i + 1]; ++at) {
      const double* PC = r.PC + f.A_column[at] * m * W;
      for (int a = 0; a < m; ++a) k[a] += f.A_entry[at] * PC[a * W];
    }
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c < a; ++c) k[a] -= L[a * m + c] * k[c];
      k[a] *= r.L_inverse[a * m + a];
    }
    for (int a = m - 1; a >= 0; --a) {
      for (int c = a + 1; c < m; ++c) k[a] -= L[c * m + a] * k[c];
      k[a] *= r.L_inverse[a * m + a];
    }
  }
  LayOutF<N>(f, r, m);
}

// M of them, or as many as the model says; kUnseen: a sample without any.
constexpr int kUnseen = -1;
template <int M>
HWY_INLINE int Outputs(const TangentModel& f) {
  return M > 0 ? M : M == kUnseen ? 0 : f.m;
}

// E = y - D u - C x, column by column; the responses to a diffuse start know neither y nor u.
template <int W, int N, int M>
HWY_INLINE void Innovate(const TangentModel& f, TangentRun& r, const double* y, const double* u) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  for (int b = 0; b < f.blocks; ++b) {
    for (int c = 0; c < r.columns; ++c) {
      const double* x = r.x + (b * r.columns + c) * n * W;
      const double* first = r.x + c * n * W;
      double* E = r.E + (b * r.columns + c) * m * W;
      for (int a = 0; a < m; ++a) {
        Pack<W> e = b == 0 && c == 0 ? Pack<W>::First(y[f.channel[a]]) : Pack<W>::Zero();
        for (int at = f.C_row[a]; at < f.C_row[a + 1]; ++at) {
          e.Subtract(f.C[at], Pack<W>::Load(x + f.C_column[at] * W));
        }
        if (c == 0) {
          for (int j = 0; j < f.nu; ++j) {
            e.Subtract(u[j], Pack<W>::Load(f.D + ((b * m + a) * f.nu + j) * W));
          }
        }
        if (f.C_theta != nullptr) {
          for (int at = f.C_theta_row[a]; at < f.C_theta_row[a + 1]; ++at) {
            e.Subtract(first[f.C_theta_column[at] * W], MovedOutput<W>(f, b, at));
          }
        }
        e.Store(E + a * W);
      }
    }
  }
}

// Sigma^-1 e, and what e adds to the squares. Sample t is kept where that is asked for.
template <int W, int M>
HWY_INLINE void Weigh(const TangentModel& f, TangentRun& r, long t) {
  const int m = M > 0 ? M : f.m;
  for (int a = 0; a < m; ++a) r.Sie[a] = 0.0;
  for (int a = 0; a < m; ++a) {
    double z = 0.0;
    for (int c = 0; c <= a; ++c) z += r.L_inverse[a * m + c] * r.E[c * W];
    r.squares += z * z;
    if (r.kept_e != nullptr) {
      r.kept_e[t * m + a] = r.E[a * W];
      r.kept_white[t * m + a] = z;
      r.kept_sd[t * m + a] = std::sqrt(r.Sigma[(a * m + a) * W]);
    }
    for (int c = 0; c <= a; ++c) r.Sie[c] += r.L_inverse[a * m + c] * z;
  }
}

template <int W, int N, int M>
HWY_INLINE void AdvanceStates(const TangentModel& f, TangentRun& r, const double* u) {
  const int n = N > 0 ? N : f.n, m = Outputs<M>(f);
  for (int b = 0; b < f.blocks; ++b) {
    const double* K_theta = r.K_theta + b * n * m * W;
    for (int c = 0; c < r.columns; ++c) {
      const double *x = r.x + (b * r.columns + c) * n * W, *first = r.x + c * n * W;
      const double *E = r.E + (b * r.columns + c) * m * W, *first_E = r.E + c * m * W;
      double* next = r.next_x + (b * r.columns + c) * n * W;
      for (int i = 0; i < n; ++i) {
        Pack<W> sum = Pack<W>::Zero();
        for (int at = f.A_row[i]; at < f.A_row[i + 1]; ++at) {
          sum.Add(f.A_entry[at], Pack<W>::Load(x + f.A_column[at] * W));
        }
        for (int a = 0; a < m; ++a) {
          sum.Add(r.K[i * m + a], Pack<W>::Load(E + a * W));
          sum.Add(first_E[a * W], Pack<W>::Load(K_theta + (i * m + a) * W));
        }
        if (c == 0) {
          for (int j = 0; j < f.nu; ++j) {
            sum.Add(u[j], Pack<W>::Load(f.B + ((b * n + i) * f.nu + j) * W));
          }
        }
        if (f.A_theta != nullptr) {
          for (int at = f.A_theta_row[i]; at < f.A_theta_row[i + 1]; ++at) {
            sum.Add(first[f.A_theta_column[at] * W], MovedDynamics<W>(f, b, at));
          }
        }
        sum.Store(next + i * W);
      }
    }
  }
  std::swap(r.x, r.next_x);
}

// What the sample says about a diffuse start, and its derivatives.
template <int W>
void AddDelta(const TangentModel& f, TangentRun& r) {
  const int diffuse = r.columns - 1, m = f.m;
  // Sigma^-1 E of the first lanes; column 0 is r.Sie.
  double* SiE = r.white_lanes;
  for (int c = 0; c < diffuse; ++c) {
    for (int a = 0; a < m; ++a) {
      double sum = 0.0;
      for (int k = 0; k < m; ++k) sum += r.Sigma_inverse[a * m + k] * r.E[((1 + c) * m + k) * W];
      SiE[c * m + a] = sum;
    }
  }
  double* moved = r.work + m * m;  // m: dSigma Sigma^-1 E of one column
  for (int b = 0; b < f.blocks; ++b) {
    const double *E = r.E + b * r.columns * m * W, *Sigma = r.Sigma + b * m * m * W;
    for (int c = 0; c <= diffuse; ++c) {  // 0: the innovation
      const double* weight = c == 0 ? r.Sie : SiE + (c - 1) * m;
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = Pack<W>::Load(E + (c * m + a) * W);
        for (int k = 0; k < m; ++k) {
          sum.Subtract(weight[k], Pack<W>::Load(Sigma + (a * m + k) * W));
        }
        sum.Store(moved + a * W);  // dE - dSigma Sigma^-1 E
      }
      for (int d = 0; d < diffuse; ++d) {
        double* to = c == 0 ? r.delta_score + (b * diffuse + d) * W
                            : r.delta_information + ((b * diffuse + d) * diffuse + c - 1) * W;
        Pack<W> sum = Pack<W>::Load(to);
        for (int a = 0; a < m; ++a) {
          sum.Add(SiE[d * m + a], Pack<W>::Load(moved + a * W));
          sum.Add(weight[a], Pack<W>::Load(E + ((1 + d) * m + a) * W));
        }
        sum.Store(to);
      }
    }
  }
}

// P C' of a block.
template <int W, int N, int M>
HWY_INLINE void SeeStates(const TangentModel& f, TangentRun& r, int b) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  const double* P = r.P + b * n * n * W;
  double* PC = r.PC + b * n * m * W;
  if constexpr (N == 0 && M == 1) return SeeRow<W>(f, P, 0, PC);
  for (int i = 0; i < n; ++i) {
    for (int a = 0; a < m; ++a) {
      Pack<W> sum = Pack<W>::Zero();
      for (int at = f.C_row[a]; at < f.C_row[a + 1]; ++at) {
        sum.Add(f.C[at], Pack<W>::Load(P + (i * n + f.C_column[at]) * W));
      }
      sum.Store(PC + (i * m + a) * W);
    }
  }
}

// P C' and Sigma in all lanes.
template <int W, int N, int M>
HWY_INLINE void SeeCovariance(const TangentModel& f, TangentRun& r) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  for (int b = 0; b < f.blocks; ++b) {
    SeeStates<W, N, M>(f, r, b);
    double *PC = r.PC + b * n * m * W, *Sigma = r.Sigma + b * m * m * W;
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c <= a; ++c) {
        Pack<W> sum = Pack<W>::Load(f.R + ((b * m + a) * m + c) * W);
        for (int at = f.C_row[a]; at < f.C_row[a + 1]; ++at) {
          sum.Add(f.C[at], Pack<W>::Load(PC + (f.C_column[at] * m + c) * W));
        }
        if (f.C_theta != nullptr) {
          for (int at = f.C_theta_row[a]; at < f.C_theta_row[a + 1]; ++at) {
            sum.Add(r.PC[(f.C_theta_column[at] * m + c) * W], MovedOutput<W>(f, b, at));
          }
          for (int at = f.C_theta_row[c]; at < f.C_theta_row[c + 1]; ++at) {
            sum.Add(r.PC[(f.C_theta_column[at] * m + a) * W], MovedOutput<W>(f, b, at));
          }
        }
        sum.Store(Sigma + (a * m + c) * W);
        if (c < a) sum.Store(Sigma + (c * m + a) * W);
      }
    }
  }
}

// Numbers in a row of T.
template <int N, int M>
HWY_INLINE int Stride(const TangentModel& f) {
  return N > 0 ? N : f.n + Outputs<M>(f);
}

// T = F P of a block
template <int W, int N, int M>
HWY_INLINE void MultiplyByF(const TangentModel& f, const TangentRun& r, int b) {
  const int n = N > 0 ? N : f.n, m = Outputs<M>(f), stride = Stride<N, M>(f);
  const double* P = r.P + b * n * n * W;
  double* T = r.T + b * n * stride * W;
  if constexpr (N == 0) {
    const double *PC = r.PC + b * n * m * W, *CP = m > 1 ? r.CP : PC;
    for (int i = 0; m > 1 && i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W>::Load(PC + (i * m + a) * W).Store(r.CP + (a * n + i) * W);
      }
    }
    for (int i = 0; i < n; ++i) MultiplyRow<W>(f, m, r.F, P, CP, i, T + i * stride * W);
  } else {
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) {
        Pack<W> sum = Pack<W>::Zero();
        for (int k = 0; k < N; ++k) sum.Add(r.F[i * N + k], Pack<W>::Load(P + (k * N + j) * W));
        sum.Store(T + (i * N + j) * W);
      }
    }
  }
}

// F P C' - K R + S, T = F P.
template <int W, int N, int M>
HWY_INLINE Pack<W> SeenProduct(const TangentModel& f, const TangentRun& r, int b, int i, int a) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  const double* row = r.T + (b * n + i) * Stride<N, M>(f) * W;
  Pack<W> sum = f.S != nullptr ? Pack<W>::Load(f.S + ((b * n + i) * m + a) * W) : Pack<W>::Zero();
  for (int at = f.C_row[a]; at < f.C_row[a + 1]; ++at) {
    sum.Add(f.C[at], Pack<W>::Load(row + f.C_column[at] * W));
  }
  for (int c = f.diagonal_R ? a : 0; c < (f.diagonal_R ? a + 1 : m); ++c) {
    sum.Subtract(r.K[i * m + c], Pack<W>::Load(f.R + ((b * m + c) * m + a) * W));
  }
  return sum;
}

// That behind every row of T.
template <int W, int M>
HWY_INLINE void SeeProducts(const TangentModel& f, const TangentRun& r, int b) {
  const int n = f.n, m = M > 0 ? M : f.m;
  for (int i = 0; i < n; ++i) {
    double* behind = r.T + ((b * n + i) * (n + m) + n) * W;
    for (int a = 0; a < m; ++a) SeenProduct<W, 0, M>(f, r, b, i, a).Store(behind + a * W);
  }
}

// A row of dK: what stands in `row` times Sigma^-1.
template <int W>
HWY_INLINE void WeighGainRow(const TangentRun& r, int m, bool first_block, const double* row,
                             double* K_theta) {
  for (int a = 0; a < m; ++a) {
    Pack<W> sum = Pack<W>::Zero();
    for (int c = 0; c < m; ++c) {
      sum.Add(r.Sigma_inverse[c * m + a], Pack<W>::Load(row + c * W));
    }
    // What rounding leaves of K Sigma - A P C' - S is none of the gain's derivatives.
    if (first_block)
      sum.v[0] = hn::IfThenZeroElse(hn::FirstN(typename Pack<W>::Tag(), 1), sum.v[0]);
    sum.Store(K_theta + a * W);
  }
}

// dK in lanes; zero in the first.
template <int W, int N, int M>
HWY_INLINE void DifferentiateGain(const TangentModel& f, TangentRun& r, int b) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  double *K_theta = r.K_theta + b * n * m * W, *row = r.work + m * m;
  if (f.A_theta != nullptr) SeeMovedOutputs<W, N, M>(f, r, b);
  for (int i = 0; i < n; ++i) {
    for (int a = 0; a < m; ++a) {
      Pack<W> sum = N == 0 ? Pack<W>::Load(r.T + ((b * n + i) * (n + m) + n + a) * W)
                           : SeenProduct<W, N, M>(f, r, b, i, a);
      if (f.A_theta != nullptr) {
        // dF P C' + F P dC'
        for (int at = f.A_theta_row[i]; at < f.A_theta_row[i + 1]; ++at) {
          sum.Add(r.PC[(f.A_theta_column[at] * m + a) * W], MovedDynamics<W>(f, b, at));
        }
        for (int c = 0; c < m; ++c) {
          sum.Subtract(r.K[i * m + c], Pack<W>::Load(r.dC_PC + (c * m + a) * W));
        }
        sum.Add(Pack<W>::Load(r.dC_PF + (a * n + i) * W));
      }
      sum.Store(row + a * W);
    }
    WeighGainRow<W>(r, m, b == 0, row, K_theta + i * m * W);
  }
}

// P+ in all lanes where there are many states: products with F bring all but what S and moving
// dynamics add.
template <int W, int M>
HWY_INLINE void AdvanceLargeCovariance(const TangentModel& f, const TangentRun& r, int b) {
  const int n = f.n, m = Outputs<M>(f);
  const double *T = r.T + b * n * (n + m) * W, *noise = f.W + b * n * n * W;
  double* next = r.next_P + b * n * n * W;
  const bool plain = f.S == nullptr && f.A_theta == nullptr;
  for (int j = 0; j < n; ++j) {
    MultiplyColumn<W>(f, m, r.F, T, noise, j, plain, next);
    for (int i = j; !plain && i < n; ++i) {
      Pack<W> sum = Pack<W>::Load(next + (i * n + j) * W);
      for (int a = 0; f.S != nullptr && a < m; ++a) {
        sum.Subtract(r.K[i * m + a], Pack<W>::Load(f.S + ((b * n + j) * m + a) * W));
      }
      if (f.A_theta != nullptr) AddDynamics<W>(f, r, Stride<0, M>(f), b, i, j, sum);
      sum.Store(next + (i * n + j) * W);
      sum.Store(next + (j * n + i) * W);
    }
  }
}

// P+ in all lanes.
template <int W, int N, int M>
HWY_INLINE void AdvanceCovariance(const TangentModel& f, const TangentRun& r, int b) {
  if constexpr (N == 0) return AdvanceLargeCovariance<W, M>(f, r, b);
  const int m = Outputs<M>(f);
  const double* T = r.T + b * N * N * W;
  double *next = r.next_P + b * N * N * W, *KR = r.PC + b * N * m * W;  // P C' has been used
  for (int i = 0; i < N; ++i) {
    for (int a = 0; a < m; ++a) {
      Pack<W> sum = Pack<W>::Zero();
      for (int c = f.diagonal_R ? a : 0; c < (f.diagonal_R ? a + 1 : m); ++c) {
        sum.Add(r.K[i * m + c], Pack<W>::Load(f.R + ((b * m + c) * m + a) * W));
      }
      if (f.S != nullptr) sum.Subtract(1.0, Pack<W>::Load(f.S + ((b * N + i) * m + a) * W));
      sum.Store(KR + (i * m + a) * W);
    }
  }
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) {
      Pack<W> sum = Pack<W>::Load(f.W + ((b * N + i) * N + j) * W);
      for (int k = 0; k < N; ++k) sum.Add(r.F[j * N + k], Pack<W>::Load(T + (i * N + k) * W));
      for (int a = 0; a < m; ++a) {
        sum.Add(r.K[j * m + a], Pack<W>::Load(KR + (i * m + a) * W));
        if (f.S != nullptr) {
          sum.Subtract(r.K[i * m + a], Pack<W>::Load(f.S + ((b * N + j) * m + a) * W));
        }
      }
      if (f.A_theta != nullptr) AddDynamics<W>(f, r, N, b, i, j, sum);
      sum.Store(next + (i * N + j) * W);
      if (i != j) sum.Store(next + (j * N + i) * W);
    }
  }
}

// Has P stopped changing, to 1e-14 of the standard deviations?
template <int W>
bool CovarianceSettled(int n, const double* P, const double* next) {
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double size = next[(i * n + i) * W] * next[(j * n + j) * W];
      const double change = next[(i * n + j) * W] - P[(i * n + j) * W];
      if (!(change * change <= 1e-28 * size)) return false;
    }
  }
  return true;
}

// The same of lane l, to 1e-12 of its own entries or what P's deviations make of the largest.
template <int W>
bool DerivativeSettled(int n, const double* P, const double* before, const double* after) {
  const auto scale = [&](int i, int j) {
    return std::sqrt(P[(i * n + i) * W] * P[(j * n + j) * W]);
  };
  double largest = 0.0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double size = scale(i, j);
      if (size > 0.0) largest = std::max(largest, std::abs(after[(i * n + j) * W]) / size);
    }
  }
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      const double own =
          std::sqrt(std::abs(after[(i * n + i) * W]) * std::abs(after[(j * n + j) * W]));
      const double size =
          std::max({std::abs(after[(i * n + j) * W]), own, 1e-3 * largest * scale(i, j)});
      if (std::abs(after[(i * n + j) * W] - before[(i * n + j) * W]) > 1e-12 * size) return false;
    }
  }
  return true;
}

template <int W>
bool Settled(const TangentModel& f, const TangentRun& r) {
  const int n = f.n;
  if (!CovarianceSettled<W>(n, r.P, r.next_P)) return false;
  for (int i = 1; i <= f.derivatives; ++i) {
    const int at = (i / W) * n * n * W + i % W;
    if (!DerivativeSettled<W>(n, r.P, r.P + at, r.next_P + at)) return false;
  }
  return true;
}

template <int W, int N, int M>
TangentEnd Run(const TangentModel& f, TangentRun& r, const double* y, int ny, const double* u,
               long& t, long end, bool stop_when_settled) {
  const int m = M > 0 ? M : f.m;
  while (t < end) {
    const double* input = u + t * f.nu;
    Innovate<W, N, M>(f, r, y + t * ny, input);
    SeeCovariance<W, N, M>(f, r);
    if (!FactorSigma<W, M>(f, r)) return TangentEnd::indefinite;
    FindGain<W, N, M>(f, r);
    Weigh<W, M>(f, r, t);
    if (f.derivatives > 0) {
      AddScore<W, M>(f, r, true);
      if (r.informed) {
        AddInformation<W>(f, r, m + m * (m + 1) / 2, 1.0);
        AddTraces<W>(f, r, m, 1.0);
      }
    }
    if (r.columns > 1) AddDelta<W>(f, r);
    // Block 0 first: the others need F P of its first lanes.
    for (int b = 0; b < f.blocks; ++b) MultiplyByF<W, N, M>(f, r, b);
    for (int b = f.blocks - 1; b >= 0; --b) {
      if constexpr (N == 0) SeeProducts<W, M>(f, r, b);
      if (f.derivatives > 0) DifferentiateGain<W, N, M>(f, r, b);
      AdvanceCovariance<W, N, M>(f, r, b);
    }
    AdvanceStates<W, N, M>(f, r, input);
    ++t;
    const bool settled = stop_when_settled && (t & 3) == 0 && Settled<W>(f, r);
    std::swap(r.P, r.next_P);
    if (settled) return TangentEnd::settled;
  }
  return TangentEnd::done;
}

// Samples of which nothing was measured: F = A, and nothing is added to the sums.
template <int W, int N>
void RunUnseen(const TangentModel& f, TangentRun& r, const double* u, long& t, long end) {
  LayOutF<N>(f, r, 0);
  for (; t < end; ++t) {
    for (int b = 0; b < f.blocks; ++b) MultiplyByF<W, N, kUnseen>(f, r, b);
    for (int b = 0; b < f.blocks; ++b) AdvanceCovariance<W, N, kUnseen>(f, r, b);
    AdvanceStates<W, N, kUnseen>(f, r, u + t * f.nu);
    std::swap(r.P, r.next_P);
  }
}

template <int W, int N, int M>
void RunSettled(const TangentModel& f, TangentRun& r, const double* y, int ny, const double* u,
                long t, long end) {
  const int m = M > 0 ? M : f.m;
  const double samples = static_cast<double>(end - t);
  const double* L = r.work;
  for (int a = 0; a < m; ++a) r.log_det += samples * 2.0 * std::log(L[a * m + a]);
  for (; t < end; ++t) {
    const double* input = u + t * f.nu;
    Innovate<W, N, M>(f, r, y + t * ny, input);
    Weigh<W, M>(f, r, t);
    if (f.derivatives > 0) {
      AddScore<W, M>(f, r, false);
      AddInformation<W>(f, r, m, 1.0);
    }
    AdvanceStates<W, N, M>(f, r, input);
  }
  if (f.derivatives == 0 || samples == 0.0) return;
  // What Sigma adds to the information is the same at every sample.
  double* gradient = r.gradient;
  r.gradient = r.white_lanes;
  AddScore<W, M>(f, r, true);
  r.gradient = gradient;
  AddTraces<W>(f, r, m, samples);
  r.white += m * f.blocks * W;
  AddInformation<W>(f, r, m * (m + 1) / 2, samples);
  r.white -= m * f.blocks * W;
}

template <int W, int N>
TangentEnd RunOutputs(const TangentModel& f, TangentRun& r, const double* y, int ny,
                      const double* u, long& t, long end, bool stop_when_settled) {
  if (f.m == 0) {
    RunUnseen<W, N>(f, r, u, t, end);
    return TangentEnd::done;
  }
  if (f.m == 1) return Run<W, N, 1>(f, r, y, ny, u, t, end, stop_when_settled);
  if constexpr (N > 1) {
    if (f.m == 2) return Run<W, N, 2>(f, r, y, ny, u, t, end, stop_when_settled);
    if (f.m == N) return Run<W, N, N>(f, r, y, ny, u, t, end, stop_when_settled);
  }
  return Run<W, N, 0>(f, r, y, ny, u, t, end, stop_when_settled);
}

template <int W, int N>
void RunSettledOutputs(const TangentModel& f, TangentRun& r, const double* y, int ny,
                       const double* u, long t, long end) {
  if (f.m == 1) return RunSettled<W, N, 1>(f, r, y, ny, u, t, end);
  if constexpr (N > 1) {
    if (f.m == 2) return RunSettled<W, N, 2>(f, r, y, ny, u, t, end);
    if (f.m == N) return RunSettled<W, N, N>(f, r, y, ny, u, t, end);
  }
  RunSettled<W, N, 0>(f, r, y, ny, u, t, end);
}

template <int W>
TangentEnd RunStates(const TangentModel& f, TangentRun& r, const double* y, int ny, const double* u,
                     long& t, long end, bool stop_when_settled) {
  switch (f.n) {
    case 1:
      return RunOutputs<W, 1>(f, r, y, ny, u, t, end, stop_when_settled);
    case 2:
      return RunOutputs<W, 2>(f, r, y, ny, u, t, end, stop_when_settled);
    case 3:
      return RunOutputs<W, 3>(f, r, y, ny, u, t, end, stop_when_settled);
    case 4:
      return RunOutputs<W, 4>(f, r, y, ny, u, t, end, stop_when_settled);
    default:
      return RunOutputs<W, 0>(f, r, y, ny, u, t, end, stop_when_settled);
  }
}

template <int W>
void RunSettledStates(const TangentModel& f, TangentRun& r, const double* y, int ny,
                      const double* u, long t, long end) {
  switch (f.n) {
    case 1:
      return RunSettledOutputs<W, 1>(f, r, y, ny, u, t, end);
    case 2:
      return RunSettledOutputs<W, 2>(f, r, y, ny, u, t, end);
    case 3:
      return RunSettledOutputs<W, 3>(f, r, y, ny, u, t, end);
    case 4:
      return RunSettledOutputs<W, 4>(f, r, y, ny, u, t, end);
    default:
      return RunSettledOutputs<W, 0>(f, r, y, ny, u, t, end);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#include "lib/filter/internal/tangent_stationary.h"

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

TangentEnd RunTangents(const TangentModel& f, TangentRun& r, const double* y, int ny,
                       const double* u, long& t, long end, bool stop_when_settled) {
  if (f.lanes == 4) return RunStates<4>(f, r, y, ny, u, t, end, stop_when_settled);
  return RunStates<8>(f, r, y, ny, u, t, end, stop_when_settled);
}

void RunSettledTangents(const TangentModel& f, TangentRun& r, const double* y, int ny,
                        const double* u, long t, long end) {
  if (f.lanes == 4) return RunSettledStates<4>(f, r, y, ny, u, t, end);
  RunSettledStates<8>(f, r, y, ny, u, t, end);
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "lib/internal/instruction_set.h"

namespace identikal::simd {

TangentEnd run_tangents(const TangentModel& model, TangentRun& run, const double* y, int ny,
                        const double* u, long& t, long end, bool stop_when_settled) {
  return IDENTIKAL_DISPATCH(RunTangents)(model, run, y, ny, u, t, end, stop_when_settled);
}

void run_settled_tangents(const TangentModel& model, TangentRun& run, const double* y, int ny,
                          const double* u, long t, long end) {
  IDENTIKAL_DISPATCH(RunSettledTangents)(model, run, y, ny, u, t, end);
}

void start_stationary_tangents(const TangentModel& model, TangentRun& run, const double* powers,
                               int count, const double* P, const double* PA) {
  IDENTIKAL_DISPATCH(StartStationaryTangents)(model, run, powers, count, P, PA);
}

TangentEnd run_stationary_tangents(const TangentModel& model, TangentRun& run, const double* y,
                                   int ny, const double* u, long& t, long end) {
  return IDENTIKAL_DISPATCH(RunStationaryTangents)(model, run, y, ny, u, t, end);
}

}  // namespace identikal::simd
#endif
