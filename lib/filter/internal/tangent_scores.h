// What a sample adds to the gradient and to the information, in the lanes of tangent_kernel.cpp.
// Included there once per instruction set, behind Pack.
#if defined(IDENTIKAL_TANGENT_SCORES) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_TANGENT_SCORES
#undef IDENTIKAL_TANGENT_SCORES
#else
#define IDENTIKAL_TANGENT_SCORES
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// The derivatives of the sample's log-density, and what they owe to Sigma and e in units of the
// innovations' standard deviations.
template <int W, int M>
HWY_INLINE void AddScore(const TangentModel& f, TangentRun& r, bool with_Sigma) {
  constexpr double kRootHalf = 0.70710678118654752440;
  const int m = M > 0 ? M : f.m, stride = f.blocks * W;
  for (int b = 0; b < f.blocks; ++b) {
    const double *Sigma = r.Sigma + b * m * m * W, *E = r.E + b * r.columns * m * W;
    Pack<W> score = Pack<W>::Load(r.gradient + b * W);
    for (int a = 0; a < m; ++a) {
      score.Subtract(r.Sie[a], Pack<W>::Load(E + a * W));
      for (int c = 0; c <= a; ++c) {
        const double weight = r.Sigma_inverse[a * m + c] - r.Sie[a] * r.Sie[c];
        score.Subtract(a == c ? 0.5 * weight : weight, Pack<W>::Load(Sigma + (a * m + c) * W));
      }
    }
    score.Store(r.gradient + b * W);
    if (!r.informed) continue;
    double* white = r.white + b * W;
    for (int a = 0; a < m; ++a, white += stride) {
      Pack<W> z = Pack<W>::Zero();
      for (int c = 0; c <= a; ++c) z.Add(r.L_inverse[a * m + c], Pack<W>::Load(E + c * W));
      z.Store(white);
    }
    if (!with_Sigma) continue;
    double* half = r.work + m * m;  // L^-1 dSigma
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c < m; ++c) {
        Pack<W> sum = Pack<W>::Zero();
        for (int k = 0; k <= a; ++k) {
          sum.Add(r.L_inverse[a * m + k], Pack<W>::Load(Sigma + (k * m + c) * W));
        }
        sum.Store(half + (a * m + c) * W);
      }
    }
    for (int a = 0; a < m; ++a) {
      for (int c = 0; c <= a; ++c, white += stride) {
        const double root = a == c ? kRootHalf : 1.0;
        Pack<W> sum = Pack<W>::Zero();
        for (int k = 0; k <= c; ++k) {
          sum.Add(root * r.L_inverse[c * m + k], Pack<W>::Load(half + (a * m + k) * W));
        }
        sum.Store(white);
      }
    }
  }
}

template <int W>
HWY_INLINE void AddInformation(const TangentModel& f, TangentRun& r, int rows, double factor) {
  const int stride = f.blocks * W;
  for (int b = 0; b < f.blocks; ++b) {
    const double* white = r.white + b * W;
    // Both triangles of the blocks on the diagonal, the lower one of the others.
    for (int i = std::max(1, b * W); i <= f.derivatives; ++i) {
      double* to = r.information + i * stride + b * W;
      Pack<W> sum = Pack<W>::Load(to);
      for (int q = 0; q < rows; ++q) {
        sum.Add(factor * r.white[q * stride + i], Pack<W>::Load(white + q * stride));
      }
      sum.Store(to);
    }
  }
}

// 1/2 tr(Sigma^-1 dSigma), of the rows that AddScore() has left.
template <int W>
HWY_INLINE void AddTraces(const TangentModel& f, TangentRun& r, int m, double factor) {
  constexpr double kRootHalf = 0.70710678118654752440;
  const int stride = f.blocks * W;
  for (int b = 0; b < f.blocks; ++b) {
    Pack<W> sum = Pack<W>::Load(r.half_traces + b * W);
    const double* white = r.white + m * stride + b * W;
    for (int a = 0; a < m; ++a, white += (a + 1) * stride) {
      sum.Add(factor * kRootHalf, Pack<W>::Load(white));
    }
    sum.Store(r.half_traces + b * W);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
