// A stationary start in the lanes of tangent_kernel.cpp: the covariance that the model has had for
// ever, and a recursion for what it changes by, which has as few columns as there are outputs:
//
//   P(t+1) - P(t) = Y M Y',  Y(1) = K(1), M(1) = -Sigma(1),  G = C Y, H = M G',
//   Sigma+ = Sigma + G H,  N+ = N + A Y H,  K+ = N+ Sigma+^-1,
//   Y+ = A Y - K+ G,  M+ = M + H Sigma^-1 H',  N(1) = A P(1) C' + S.
//
// Source: Morf, Sidhu and Kailath (1974), "Some new algorithms for recursive estimation in constant,
// linear, discrete-time systems", IEEE TAC 19; Herbst (2015), "Using the Chandrasekhar recursions for
// likelihood evaluation of DSGE models", Computational Economics 45. Included there once per
// instruction set, behind the products.
#if defined(IDENTIKAL_TANGENT_STATIONARY) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_TANGENT_STATIONARY
#undef IDENTIKAL_TANGENT_STATIONARY
#else
#define IDENTIKAL_TANGENT_STATIONARY
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// X = F X F' + X in place, in all lanes of a block, by the powers F, F^2, F^4, ...
template <int W>
void SumForward(const double* powers, int count, int n, double* X, double* T) {
  for (int q = 0; q < count; ++q, powers += n * n) {
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        Pack<W> sum = Pack<W>::Zero();
        for (int k = 0; k < n; ++k) {
          const double weight = powers[i * n + k];
          if (weight != 0.0) sum.Add(weight, Pack<W>::Load(X + (k * n + j) * W));
        }
        sum.Store(T + (i * n + j) * W);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j <= i; ++j) {
        Pack<W> sum = Pack<W>::Load(X + (i * n + j) * W);
        for (int k = 0; k < n; ++k) {
          const double weight = powers[j * n + k];
          if (weight != 0.0) sum.Add(weight, Pack<W>::Load(T + (i * n + k) * W));
        }
        sum.Store(X + (i * n + j) * W);
        if (j < i) sum.Store(X + (j * n + i) * W);
      }
    }
  }
}

// P of all lanes: the value is given, row by row, and what moves follows from
// dP = A dP A' + dA P A' + A P dA' + dW.
// @param PA  P A'
template <int W>
void StartStationary(const TangentModel& f, TangentRun& r, const double* powers, int count,
                     const double* P, const double* PA) {
  const int n = f.n;
  for (int b = 0; b < f.blocks; ++b) {
    double* X = r.P + b * n * n * W;
    std::copy(f.W + b * n * n * W, f.W + (b + 1) * n * n * W, X);
    for (int i = 0; i < n && f.A_theta != nullptr; ++i) {
      for (int at = f.A_theta_row[i]; at < f.A_theta_row[i + 1]; ++at) {
        const Pack<W> dA = MovedDynamics<W>(f, b, at);
        for (int j = 0; j < n; ++j) {
          const double by = PA[f.A_theta_column[at] * n + j];
          for (double* to : {X + (i * n + j) * W, X + (j * n + i) * W}) {
            Pack<W> sum = Pack<W>::Load(to);
            sum.Add(by, dA);
            sum.Store(to);
          }
        }
      }
    }
    SumForward<W>(powers, count, n, X, r.T);
  }
  for (int e = 0; e < n * n; ++e) r.P[e * W] = P[e];
}

// N = A P C' + S with all that moves in it; Sigma stands in its place.
template <int W, int M>
void BeginStationary(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  SeeCovariance<W, 0, M>(f, r);
  for (int b = f.blocks - 1; b >= 0; --b) {
    const double* PC = r.PC + b * n * m * W;
    double *seen = r.stationary.YH, *N = r.stationary.N + b * n * m * W;
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = Pack<W>::Load(PC + (i * m + a) * W);
        if (f.C_theta != nullptr) {
          for (int at = f.C_theta_row[a]; at < f.C_theta_row[a + 1]; ++at) {
            sum.Add(r.P[(i * n + f.C_theta_column[at]) * W], MovedOutput<W>(f, b, at));
          }
        }
        sum.Store(seen + (i * m + a) * W);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum =
            f.S != nullptr ? Pack<W>::Load(f.S + ((b * n + i) * m + a) * W) : Pack<W>::Zero();
        for (int at = f.A_row[i]; at < f.A_row[i + 1]; ++at) {
          sum.Add(f.A_entry[at], Pack<W>::Load(seen + (f.A_column[at] * m + a) * W));
        }
        if (f.A_theta != nullptr) {
          for (int at = f.A_theta_row[i]; at < f.A_theta_row[i + 1]; ++at) {
            sum.Add(r.PC[(f.A_theta_column[at] * m + a) * W], MovedDynamics<W>(f, b, at));
          }
        }
        sum.Store(N + (i * m + a) * W);
      }
    }
  }
}

// K = N Sigma^-1 and its derivatives, (dN - K dSigma) Sigma^-1.
template <int W, int M>
HWY_INLINE void GainOfStationary(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  for (int i = 0; i < n; ++i) {
    for (int a = 0; a < m; ++a) {
      double sum = 0.0;
      for (int c = 0; c < m; ++c) {
        sum += r.stationary.N[(i * m + c) * W] * r.Sigma_inverse[c * m + a];
      }
      r.K[i * m + a] = sum;
    }
  }
  double* row = r.work + m * m;
  for (int b = 0; b < f.blocks; ++b) {
    const double *N = r.stationary.N + b * n * m * W, *Sigma = r.Sigma + b * m * m * W;
    double* K_theta = r.K_theta + b * n * m * W;
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = Pack<W>::Load(N + (i * m + a) * W);
        for (int c = 0; c < m; ++c) {
          sum.Subtract(r.K[i * m + c], Pack<W>::Load(Sigma + (c * m + a) * W));
        }
        sum.Store(row + a * W);
      }
      WeighGainRow<W>(r, m, b == 0, row, K_theta + i * m * W);
    }
  }
}

// Y = K, M = -Sigma.
template <int W>
void BeginChange(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = f.m;
  for (int b = 0; b < f.blocks; ++b) {
    for (int e = 0; e < n * m; ++e) {
      Pack<W> sum = Pack<W>::Load(r.K_theta + (b * n * m + e) * W);
      if (b == 0) sum.Add(Pack<W>::First(r.K[e]));
      sum.Store(r.stationary.Y + (b * n * m + e) * W);
    }
    for (int e = 0; e < m * m; ++e) {
      Pack<W> sum = Pack<W>::Zero();
      sum.Subtract(1.0, Pack<W>::Load(r.Sigma + (b * m * m + e) * W));
      sum.Store(r.stationary.M + (b * m * m + e) * W);
    }
  }
}

// One row of A Y with all that moves in it.
template <int W>
HWY_INLINE Pack<W> AdvancedEntry(const TangentModel& f, const double* Y, int b, int m, int i,
                                 int a) {
  const double* own = Y + b * f.n * m * W;
  Pack<W> sum = Pack<W>::Zero();
  for (int at = f.A_row[i]; at < f.A_row[i + 1]; ++at) {
    sum.Add(f.A_entry[at], Pack<W>::Load(own + (f.A_column[at] * m + a) * W));
  }
  if (f.A_theta == nullptr) return sum;
  for (int at = f.A_theta_row[i]; at < f.A_theta_row[i + 1]; ++at) {
    sum.Add(Y[(f.A_theta_column[at] * m + a) * W], MovedDynamics<W>(f, b, at));
  }
  return sum;
}

// Y+ = A Y - K+ G.
template <int W, int M>
HWY_INLINE void AdvanceChange(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  TangentRun::Stationary& s = r.stationary;
  for (int b = 0; b < f.blocks; ++b) {
    const double *K_theta = r.K_theta + b * n * m * W, *G = s.G + b * m * m * W;
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = AdvancedEntry<W>(f, s.Y, b, m, i, a);
        for (int c = 0; c < m; ++c) {
          sum.Subtract(r.K[i * m + c], Pack<W>::Load(G + (c * m + a) * W));
          sum.Subtract(s.G[(c * m + a) * W], Pack<W>::Load(K_theta + (i * m + c) * W));
        }
        sum.Store(s.next_Y + ((b * n + i) * m + a) * W);
      }
    }
  }
  std::swap(s.Y, s.next_Y);
}

// What two products of lanes a b are: a0 b + a b0, the value itself once.
template <int W>
HWY_INLINE void AddProduct(bool first_block, double a0, const Pack<W>& a, double b0,
                           const Pack<W>& b, Pack<W>& sum) {
  sum.Add(a0, b);
  sum.Add(b0, a);
  if (first_block) sum.Add(Pack<W>::First(-a0 * b0));
}

// G = C Y, H = M G'.
template <int W, int M>
HWY_INLINE void SeeChange(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  TangentRun::Stationary& s = r.stationary;
  for (int b = 0; b < f.blocks; ++b) {
    const double* Y = s.Y + b * n * m * W;
    for (int c = 0; c < m; ++c) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = Pack<W>::Zero();
        for (int at = f.C_row[c]; at < f.C_row[c + 1]; ++at) {
          sum.Add(f.C[at], Pack<W>::Load(Y + (f.C_column[at] * m + a) * W));
        }
        if (f.C_theta != nullptr) {
          for (int at = f.C_theta_row[c]; at < f.C_theta_row[c + 1]; ++at) {
            sum.Add(s.Y[(f.C_theta_column[at] * m + a) * W], MovedOutput<W>(f, b, at));
          }
        }
        sum.Store(s.G + ((b * m + c) * m + a) * W);
      }
    }
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c < m; ++c) {
        Pack<W> sum = Pack<W>::Zero();
        for (int d = 0; d < m; ++d) {
          AddProduct<W>(b == 0, s.M[(a * m + d) * W],
                        Pack<W>::Load(s.M + ((b * m + a) * m + d) * W), s.G[(c * m + d) * W],
                        Pack<W>::Load(s.G + ((b * m + c) * m + d) * W), sum);
        }
        sum.Store(s.H + ((b * m + a) * m + c) * W);
      }
    }
  }
}

// M of the next sample, and Y H.
template <int W, int M>
HWY_INLINE void AdvanceWeight(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  TangentRun::Stationary& s = r.stationary;
  double* SiH = r.work;  // Sigma^-1 H' of the first lanes; L has been used
  for (int c = 0; c < m; ++c) {
    for (int a = 0; a < m; ++a) {
      double sum = 0.0;
      for (int d = 0; d < m; ++d) sum += r.Sigma_inverse[c * m + d] * s.H[(a * m + d) * W];
      SiH[c * m + a] = sum;
    }
  }
  for (int b = f.blocks - 1; b >= 0; --b) {
    const double* H = s.H + b * m * m * W;
    double *Sigma = r.Sigma + b * m * m * W, *change = s.M + b * m * m * W;
    // H Sigma^-1 H': dH (..) + its transpose - (..)' dSigma (..)
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c <= a; ++c) {
        Pack<W> sum = Pack<W>::Load(change + (a * m + c) * W);
        for (int d = 0; d < m; ++d) {
          sum.Add(SiH[d * m + c], Pack<W>::Load(H + (a * m + d) * W));
          sum.Add(SiH[d * m + a], Pack<W>::Load(H + (c * m + d) * W));
          for (int e = 0; e < m; ++e) {
            sum.Subtract(SiH[d * m + a] * SiH[e * m + c], Pack<W>::Load(Sigma + (d * m + e) * W));
          }
        }
        sum.Store(change + (a * m + c) * W);
        if (c < a) sum.Store(change + (c * m + a) * W);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = Pack<W>::Zero();
        for (int d = 0; d < m; ++d) {
          AddProduct<W>(b == 0, s.Y[(i * m + d) * W],
                        Pack<W>::Load(s.Y + ((b * n + i) * m + d) * W), s.H[(d * m + a) * W],
                        Pack<W>::Load(H + (d * m + a) * W), sum);
        }
        sum.Store(s.YH + ((b * n + i) * m + a) * W);
      }
    }
  }
}

// Sigma and N of the next sample.
template <int W, int M>
HWY_INLINE void AdvanceSigma(const TangentModel& f, TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  TangentRun::Stationary& s = r.stationary;
  for (int b = f.blocks - 1; b >= 0; --b) {
    double *Sigma = r.Sigma + b * m * m * W, *N = s.N + b * n * m * W;
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c <= a; ++c) {
        Pack<W> sum = Pack<W>::Load(Sigma + (a * m + c) * W);
        for (int d = 0; d < m; ++d) {
          AddProduct<W>(b == 0, s.G[(a * m + d) * W],
                        Pack<W>::Load(s.G + ((b * m + a) * m + d) * W), s.H[(d * m + c) * W],
                        Pack<W>::Load(s.H + ((b * m + d) * m + c) * W), sum);
        }
        sum.Store(Sigma + (a * m + c) * W);
        if (c < a) sum.Store(Sigma + (c * m + a) * W);
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int a = 0; a < m; ++a) {
        Pack<W> sum = Pack<W>::Load(N + (i * m + a) * W);
        sum.Add(AdvancedEntry<W>(f, s.YH, b, m, i, a));
        sum.Store(N + (i * m + a) * W);
      }
    }
  }
}

// Does P change no more, to 1e-18 of its first variances, and do its derivatives, to 1e-16 of the
// largest of theirs in units of those?
template <int W, int M>
bool StationarySettled(const TangentModel& f, const TangentRun& r) {
  const int n = f.n, m = M > 0 ? M : f.m;
  const TangentRun::Stationary& s = r.stationary;
  for (int b = 0; b < f.blocks; ++b) {
    for (int i = 0; i < n; ++i) {
      const double size = r.P[(i * n + i) * W];
      Pack<W> change = Pack<W>::Zero();
      for (int a = 0; a < m; ++a) {
        for (int c = 0; c < m; ++c) {
          const double Ya = s.Y[(i * m + a) * W], Yc = s.Y[(i * m + c) * W];
          change.Add(2.0 * s.M[(a * m + c) * W] * Ya,
                     Pack<W>::Load(s.Y + ((b * n + i) * m + c) * W));
          change.Add(Ya * Yc, Pack<W>::Load(s.M + ((b * m + a) * m + c) * W));
        }
      }
      double lanes[W];
      change.Store(lanes);
      for (int l = 0; l < W && b * W + l <= f.derivatives; ++l) {
        const double limit = b + l == 0 ? 1e-18 * size : 1e-16 * s.largest[b * W + l] * size;
        if (!(std::abs(lanes[l]) <= limit)) return false;
      }
    }
  }
  return true;
}

// The largest derivative of a first variance, by lane, in units of that.
template <int W>
void MeasureStart(const TangentModel& f, TangentRun& r) {
  const int n = f.n;
  for (int l = 0; l < f.blocks * W; ++l) {
    double largest = 0.0;
    for (int i = 0; i < n; ++i) {
      const double size = r.P[(i * n + i) * W];
      const double moved = r.P[((l / W * n + i) * n + i) * W + l % W];
      if (size > 0.0) largest = std::max(largest, std::abs(moved) / size);
    }
    r.stationary.largest[l] = largest;
  }
}

// Samples from the start on. `imprecise` where so little is left of the first Sigma that differences
// have lost its digits.
template <int W, int M>
TangentEnd RunStationary(const TangentModel& f, TangentRun& r, const double* y, int ny,
                         const double* u, long& t, long end) {
  constexpr double kDigitsLost = 1e-7;
  const int m = M > 0 ? M : f.m;
  BeginStationary<W, M>(f, r);
  MeasureStart<W>(f, r);
  double* first = r.stationary.first_Sigma;
  for (int a = 0; a < m; ++a) first[a] = r.Sigma[(a * m + a) * W];
  for (bool begun = false; t < end; begun = true) {
    const double* input = u + t * f.nu;
    Innovate<W, 0, M>(f, r, y + t * ny, input);
    for (int a = 0; a < m; ++a) {
      if (r.Sigma[(a * m + a) * W] < kDigitsLost * first[a]) return TangentEnd::imprecise;
    }
    if (!FactorSigma<W, M>(f, r)) return TangentEnd::imprecise;
    GainOfStationary<W, M>(f, r);
    if (begun) {
      AdvanceChange<W, M>(f, r);
    } else {
      BeginChange<W>(f, r);
    }
    Weigh<W, M>(f, r, t);
    if (f.derivatives > 0) {
      AddScore<W, M>(f, r, true);
      AddInformation<W>(f, r, m + m * (m + 1) / 2, 1.0);
    }
    AdvanceStates<W, 0, M>(f, r, input);
    ++t;
    if ((t & 3) == 0 && StationarySettled<W, M>(f, r)) return TangentEnd::settled;
    SeeChange<W, M>(f, r);
    AdvanceWeight<W, M>(f, r);
    AdvanceSigma<W, M>(f, r);
  }
  return TangentEnd::done;
}

template <int W>
TangentEnd RunStationaryOutputs(const TangentModel& f, TangentRun& r, const double* y, int ny,
                                const double* u, long& t, long end) {
  if (f.m == 1) return RunStationary<W, 1>(f, r, y, ny, u, t, end);
  return RunStationary<W, 0>(f, r, y, ny, u, t, end);
}

TangentEnd RunStationaryTangents(const TangentModel& f, TangentRun& r, const double* y, int ny,
                                 const double* u, long& t, long end) {
  if (f.lanes == 4) return RunStationaryOutputs<4>(f, r, y, ny, u, t, end);
  return RunStationaryOutputs<8>(f, r, y, ny, u, t, end);
}

void StartStationaryTangents(const TangentModel& f, TangentRun& r, const double* powers, int count,
                             const double* P, const double* PA) {
  if (f.lanes == 4) return StartStationary<4>(f, r, powers, count, P, PA);
  StartStationary<8>(f, r, powers, count, P, PA);
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
