// What moves in the lanes of tangent_kernel.cpp where parameters move the dynamics or what outputs see:
// only the entries of A and C that any of them moves are gone over. Included there once per
// instruction set, behind Pack.
#if defined(IDENTIKAL_TANGENT_DYNAMICS) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_TANGENT_DYNAMICS
#undef IDENTIKAL_TANGENT_DYNAMICS
#else
#define IDENTIKAL_TANGENT_DYNAMICS
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// What the parameters of a block move: an entry of A, and of C.
template <int W>
HWY_INLINE Pack<W> MovedDynamics(const TangentModel& f, int b, int at) {
  return Pack<W>::Load(f.A_theta + (b * f.A_theta_row[f.n] + at) * W);
}
template <int W>
HWY_INLINE Pack<W> MovedOutput(const TangentModel& f, int b, int at) {
  return Pack<W>::Load(f.C_theta + (b * f.C_theta_row[f.m] + at) * W);
}

// dC P F' and dC P C' of a block; r.T holds F P in its first lanes.
template <int W, int N, int M>
HWY_INLINE void SeeMovedOutputs(const TangentModel& f, TangentRun& r, int b) {
  const int n = N > 0 ? N : f.n, m = M > 0 ? M : f.m;
  for (int c = 0; c < m; ++c) {
    for (int j = 0; j < n + m; ++j) {
      const double* by = j < n ? r.T + j * (N > 0 ? N : n + m) * W : r.PC + (j - n) * W;
      const int step = j < n ? W : m * W;
      Pack<W> sum = Pack<W>::Zero();
      for (int at = f.C_theta_row[c]; at < f.C_theta_row[c + 1]; ++at) {
        sum.Add(by[f.C_theta_column[at] * step], MovedOutput<W>(f, b, at));
      }
      sum.Store(j < n ? r.dC_PF + (c * n + j) * W : r.dC_PC + (c * m + j - n) * W);
    }
  }
}

// += dF P F' + its transpose, lower triangle; r.T holds F P in its first lanes, `stride`
// numbers a row.
template <int W>
HWY_INLINE void AddDynamics(const TangentModel& f, const TangentRun& r, int stride, int b, int i,
                            int j, Pack<W>& sum) {
  const int n = f.n, m = f.m;
  for (int at = f.A_theta_row[i]; at < f.A_theta_row[i + 1]; ++at) {
    sum.Add(r.T[(j * stride + f.A_theta_column[at]) * W], MovedDynamics<W>(f, b, at));
  }
  for (int at = f.A_theta_row[j]; at < f.A_theta_row[j + 1]; ++at) {
    sum.Add(r.T[(i * stride + f.A_theta_column[at]) * W], MovedDynamics<W>(f, b, at));
  }
  for (int c = 0; c < m; ++c) {
    sum.Subtract(r.K[i * m + c], Pack<W>::Load(r.dC_PF + (c * n + j) * W));
    sum.Subtract(r.K[j * m + c], Pack<W>::Load(r.dC_PF + (c * n + i) * W));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
