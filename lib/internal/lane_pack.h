// The lanes of one number: a value and its derivatives, or derivatives alone, to all of which the
// same is done in the same instructions. Included once per instruction set, behind <hwy/highway.h>.
// Internal to lib.
#if defined(IDENTIKAL_LANE_PACK) == defined(HWY_TARGET_TOGGLE)
#ifdef IDENTIKAL_LANE_PACK
#undef IDENTIKAL_LANE_PACK
#else
#define IDENTIKAL_LANE_PACK
#endif

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The lanes of one number in one block.
template <int W>
struct Pack {
  using Tag = hn::CappedTag<double, W>;
  static constexpr int kWidth = static_cast<int>(hn::MaxLanes(Tag()));
  static constexpr int kVectors = W / kWidth;
  hn::Vec<Tag> v[kVectors];

  static HWY_INLINE Pack Load(const double* p) {
    Pack out;
    for (int s = 0; s < kVectors; ++s) out.v[s] = hn::LoadU(Tag(), p + s * kWidth);
    return out;
  }
  static HWY_INLINE Pack Zero() {
    Pack out;
    for (int s = 0; s < kVectors; ++s) out.v[s] = hn::Zero(Tag());
    return out;
  }
  // `value` in the first lane, zero in the others.
  static HWY_INLINE Pack First(double value) {
    Pack out = Zero();
    out.v[0] = hn::IfThenElseZero(hn::FirstN(Tag(), 1), hn::Set(Tag(), value));
    return out;
  }
  HWY_INLINE void Store(double* p) const {
    for (int s = 0; s < kVectors; ++s) hn::StoreU(v[s], Tag(), p + s * kWidth);
  }
  HWY_INLINE void Add(double factor, const Pack& a) {
    const auto f = hn::Set(Tag(), factor);
    for (int s = 0; s < kVectors; ++s) v[s] = hn::MulAdd(f, a.v[s], v[s]);
  }
  HWY_INLINE void Subtract(double factor, const Pack& a) {
    const auto f = hn::Set(Tag(), factor);
    for (int s = 0; s < kVectors; ++s) v[s] = hn::NegMulAdd(f, a.v[s], v[s]);
  }
  HWY_INLINE void Add(const Pack& a) {
    for (int s = 0; s < kVectors; ++s) v[s] = hn::Add(v[s], a.v[s]);
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();
#endif
