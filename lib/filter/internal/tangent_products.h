// Products with F = A - K C in the lanes of tangent_kernel.cpp, where F has few entries in a row: those
// of A and the columns that an output sees. They run along the numbers as they lie in memory, with up
// to four entries of F in registers. Included there once per instruction set, behind Pack.
#if defined(IDENTIKAL_TANGENT_PRODUCTS) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_TANGENT_PRODUCTS
#undef IDENTIKAL_TANGENT_PRODUCTS
#else
#define IDENTIKAL_TANGENT_PRODUCTS
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

// Row i of F P.
template <int W>
void MultiplyRow(const TangentModel& f, const double* F, const double* P, int i, double* to) {
  Entries of;
  for (int at = f.row[i]; at < f.row[i + 1]; at += of.count) {
    of.count = std::min(kMostEntries, f.row[i + 1] - at);
    of.weight = F + at;
    for (int q = 0; q < of.count; ++q) of.from[q] = P + f.column[at + q] * f.n * W;
    if (at == f.row[i]) {
      WeighRows<W, false>(of, f.n, to);
    } else {
      WeighRows<W, true>(of, f.n, to);
    }
  }
}

// Column j of W + T F', T = F P, from the diagonal down; with K KR where that is given, and then the
// row j too.
template <int W>
void MultiplyColumn(const TangentModel& f, const double* F, const double* T, const double* noise,
                    int j, double K, const double* KR, double* to) {
  Entries of;
  for (int at = f.row[j]; at < f.row[j + 1]; at += of.count) {
    of.count = std::min(kMostEntries, f.row[j + 1] - at);
    of.weight = F + at;
    for (int q = 0; q < of.count; ++q) of.from[q] = T + f.column[at + q] * W;
    const double* from = at == f.row[j] ? noise : to;
    if (KR != nullptr && at + of.count == f.row[j + 1]) {
      WeighColumns<W, true>(of, f.n, j, from, K, KR, to);
    } else {
      WeighColumns<W, false>(of, f.n, j, from, K, KR, to);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
