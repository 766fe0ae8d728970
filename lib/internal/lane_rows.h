// Sums of weighed rows and columns of n x n matrices in lanes, along the numbers as they lie in memory,
// with up to four weights in registers. Included once per instruction set, behind lane_pack.h.
// Internal to lib.
#if defined(IDENTIKAL_LANE_ROWS) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_LANE_ROWS
#undef IDENTIKAL_LANE_ROWS
#else
#define IDENTIKAL_LANE_ROWS
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

constexpr int kMostEntries = 4;

// What entries of a row weigh, up to four at a time.
struct Entries {
  int count = 0;
  const double* weight = nullptr;
  const double* from[kMostEntries] = {};
};

// The same in registers.
template <int W, int kCount>
struct Weights {
  using Tag = typename Pack<W>::Tag;
  using V = hn::Vec<Tag>;
  V first, second, third, fourth;
  const double *at_first, *at_second, *at_third, *at_fourth;

  explicit HWY_INLINE Weights(const Entries& of)
      : first(Set(of, 0)),
        second(Set(of, 1)),
        third(Set(of, 2)),
        fourth(Set(of, 3)),
        at_first(of.from[0]),
        at_second(of.from[1]),
        at_third(of.from[2]),
        at_fourth(of.from[3]) {}

  static HWY_INLINE V Set(const Entries& of, int q) {
    return hn::Set(Tag(), of.weight[q < kCount ? q : 0]);
  }
  HWY_INLINE V First(int at) const { return hn::Mul(first, hn::LoadU(Tag(), at_first + at)); }
  HWY_INLINE V AddFirst(int at, V sum) const {
    return hn::MulAdd(first, hn::LoadU(Tag(), at_first + at), sum);
  }
  HWY_INLINE V AddOthers(int at, V sum) const {
    if constexpr (kCount > 1) sum = hn::MulAdd(second, hn::LoadU(Tag(), at_second + at), sum);
    if constexpr (kCount > 2) sum = hn::MulAdd(third, hn::LoadU(Tag(), at_third + at), sum);
    if constexpr (kCount > 3) sum = hn::MulAdd(fourth, hn::LoadU(Tag(), at_fourth + at), sum);
    return sum;
  }
};

// to = sum of the weighed rows, or += where the sum goes on.
template <int W, int kCount, bool kGoOn>
HWY_INLINE void WeighRow(const Entries& of, int n, double* to) {
  const typename Pack<W>::Tag tag;
  const Weights<W, kCount> weights(of);
  for (int j = 0; j < n * W; j += Pack<W>::kWidth) {
    auto sum = kGoOn ? weights.AddFirst(j, hn::LoadU(tag, to + j)) : weights.First(j);
    sum = weights.AddOthers(j, sum);
    hn::StoreU(sum, tag, to + j);
  }
}

template <int W, bool kGoOn>
void WeighRows(const Entries& of, int n, double* to) {
  switch (of.count) {
    case 1:
      return WeighRow<W, 1, kGoOn>(of, n, to);
    case 2:
      return WeighRow<W, 2, kGoOn>(of, n, to);
    case 3:
      return WeighRow<W, 3, kGoOn>(of, n, to);
    default:
      return WeighRow<W, 4, kGoOn>(of, n, to);
  }
}

// Column j of a symmetric n x n sum from the diagonal down, and with kMirror the row too; its beginning
// is `from`. The weighed columns are those of a matrix with rows of `stride` numbers.
template <int W, int kCount, bool kMirror>
HWY_INLINE void WeighColumn(const Entries& of, int stride, int n, int j, const double* from,
                            double* to) {
  const typename Pack<W>::Tag tag;
  const Weights<W, kCount> weights(of);
  for (int s = 0; s < W; s += Pack<W>::kWidth) {
    double* mirror = to + j * n * W + s;
    int column = j * (n + 1) * W + s;
    for (int i = j, row = j * stride * W + s; i < n; ++i, row += stride * W, column += n * W) {
      auto sum = weights.AddFirst(row, hn::LoadU(tag, from + column));
      sum = weights.AddOthers(row, sum);
      if constexpr (kMirror) hn::StoreU(sum, tag, mirror + i * W);
      hn::StoreU(sum, tag, to + column);
    }
  }
}

template <int W, bool kMirror>
void WeighColumns(const Entries& of, int stride, int n, int j, const double* from, double* to) {
  switch (of.count) {
    case 1:
      return WeighColumn<W, 1, kMirror>(of, stride, n, j, from, to);
    case 2:
      return WeighColumn<W, 2, kMirror>(of, stride, n, j, from, to);
    case 3:
      return WeighColumn<W, 3, kMirror>(of, stride, n, j, from, to);
    default:
      return WeighColumn<W, 4, kMirror>(of, stride, n, j, from, to);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
