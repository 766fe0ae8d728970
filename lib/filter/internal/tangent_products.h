// Products with F = A - K C in the lanes of tangent_kernel.cpp where there are many states: along what of A
// is not zero, and along K. They run along the numbers as they lie in memory, with up to four weights
// in registers. Included there once per instruction set, behind Pack.
#if defined(IDENTIKAL_TANGENT_PRODUCTS) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_TANGENT_PRODUCTS
#undef IDENTIKAL_TANGENT_PRODUCTS
#else
#define IDENTIKAL_TANGENT_PRODUCTS
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// The entries of row i of F, A's and then -K's, from `at` on: rows or columns of what they are
// multiplied with lie at `own`, `step` numbers apart, and for -K at `seen`, as far apart.
template <int W>
HWY_INLINE Entries EntriesOf(const TangentModel& f, int m, const double* F, int i, int at,
                             const double* own, const double* seen, int step) {
  const int begin = f.A_row[i], of_A = f.A_row[i + 1] - begin;
  Entries out;
  out.count = std::min(kMostEntries, of_A + m - at);
  out.weight = F + begin + i * m + at;
  for (int q = 0; q < out.count; ++q) {
    const int e = at + q;
    out.from[q] = e < of_A ? own + f.A_column[begin + e] * step * W : seen + (e - of_A) * step * W;
  }
  return out;
}

// Row a of C P.
template <int W>
void SeeRow(const TangentModel& f, const double* P, int a, double* to) {
  const int begin = f.C_row[a], end = f.C_row[a + 1];
  if (begin == end) std::fill(to, to + f.n * W, 0.0);
  Entries of;
  for (int at = begin; at < end; at += kMostEntries) {
    of.count = std::min(kMostEntries, end - at);
    of.weight = f.C + at;
    for (int q = 0; q < of.count; ++q) of.from[q] = P + f.C_column[at + q] * f.n * W;
    at == begin ? WeighRows<W, false>(of, f.n, to) : WeighRows<W, true>(of, f.n, to);
  }
}

// Row i of F P = A P - K C P.
template <int W>
void MultiplyRow(const TangentModel& f, int m, const double* F, const double* P, const double* CP,
                 int i, double* to) {
  const int all = f.A_row[i + 1] - f.A_row[i] + m;
  for (int at = 0; at < all; at += kMostEntries) {
    const Entries of = EntriesOf<W>(f, m, F, i, at, P, CP, f.n);
    at == 0 ? WeighRows<W, false>(of, f.n, to) : WeighRows<W, true>(of, f.n, to);
  }
}

// Column j of W + T A' - (T C' - K R + S) K', T = F P, from the diagonal down; with `mirror` the row too.
template <int W>
void MultiplyColumn(const TangentModel& f, int m, const double* F, const double* T,
                    const double* noise, int j, bool mirror, double* to) {
  const int all = f.A_row[j + 1] - f.A_row[j] + m, stride = f.n + m;
  for (int at = 0; at < all; at += kMostEntries) {
    const Entries of = EntriesOf<W>(f, m, F, j, at, T, T + f.n * W, 1);
    const double* from = at == 0 ? noise : to;
    if (mirror && at + of.count == all) {
      WeighColumns<W, true>(of, stride, f.n, j, from, to);
    } else {
      WeighColumns<W, false>(of, stride, f.n, j, from, to);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
