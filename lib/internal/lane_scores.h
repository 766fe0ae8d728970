// What a sample adds to the gradient and to the information, in lanes. Included once per instruction
// set, behind lane_pack.h. Internal to lib.
//
// `f` has m outputs, `blocks` and a number of `derivatives`; `r` what the innovations are: E and
// Sigma in lanes, and room for their factors and sums (lib/filter/internal/tangent_kernel.h).
#if defined(IDENTIKAL_LANE_SCORES) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_LANE_SCORES
#undef IDENTIKAL_LANE_SCORES
#else
#define IDENTIKAL_LANE_SCORES
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// Sigma = L L' of the first lanes; L^-1, Sigma^-1. false unless positive definite.
template <int W, int M, class Model, class Run>
HWY_INLINE bool FactorSigma(const Model& f, Run& r) {
  const int m = M > 0 ? M : f.m;
  double *L = r.work, *Li = r.L_inverse, *Si = r.Sigma_inverse;
  for (int j = 0; j < m; ++j) {
    double pivot = r.Sigma[(j * m + j) * W];
    for (int k = 0; k < j; ++k) pivot -= L[j * m + k] * L[j * m + k];
    if (!(pivot > 0.0) || !(pivot < 1e300)) return false;
    const double before = r.determinant;
    r.determinant *= pivot;
    // The logarithm is dear: one for many samples, unless a single one leaves the range.
    if (!(r.determinant > 1e-100 && r.determinant < 1e100)) {
      r.log_det += std::log(before) + std::log(pivot);
      r.determinant = 1.0;
    }
    const double root = std::sqrt(pivot), inverse = 1.0 / root;
    L[j * m + j] = root;
    Li[j * m + j] = inverse;
    for (int i = j + 1; i < m; ++i) {
      double entry = r.Sigma[(i * m + j) * W];
      for (int k = 0; k < j; ++k) entry -= L[i * m + k] * L[j * m + k];
      L[i * m + j] = entry * inverse;
    }
    for (int k = 0; k < j; ++k) {
      double entry = 0.0;
      for (int l = k; l < j; ++l) entry -= L[j * m + l] * Li[l * m + k];
      Li[j * m + k] = entry * inverse;
      Li[k * m + j] = 0.0;
    }
  }
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (int k = i; k < m; ++k) sum += Li[k * m + i] * Li[k * m + j];
      Si[i * m + j] = Si[j * m + i] = sum;
    }
  }
  return true;
}

// The derivatives of the sample's log-density, and what they owe to Sigma and e in units of the
// innovations' standard deviations.
template <int W, int M, class Model, class Run>
HWY_INLINE void AddScore(const Model& f, Run& r, bool with_Sigma) {
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

template <int W, class Model, class Run>
HWY_INLINE void AddInformation(const Model& f, Run& r, int rows, double factor) {
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
template <int W, class Model, class Run>
HWY_INLINE void AddTraces(const Model& f, Run& r, int m, double factor) {
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
