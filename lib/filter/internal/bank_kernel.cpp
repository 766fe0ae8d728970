#include "lib/filter/internal/bank_kernel.h"

#include "lib/base/constants.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "lib/filter/internal/bank_kernel.cpp"
// In this order:
// clang-format off
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
#include <hwy/contrib/math/math-inl.h>
// clang-format on

HWY_BEFORE_NAMESPACE();
namespace identikal::simd {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Tag = hn::ScalableTag<double>;
using Vector = hn::Vec<Tag>;

// Independent sums that hide the latency of one another.
constexpr std::size_t kVectors = 4;

std::size_t BankWidth() { return kVectors * hn::Lanes(Tag()); }

// The same element of the filters taken at once.
struct Lot {
  Vector v[kVectors];
};

HWY_INLINE Lot Load(const double* p) {
  const Tag d;
  Lot out;
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) out.v[u] = hn::Load(d, p + u * hn::Lanes(d));
  return out;
}
HWY_INLINE void Store(const Lot& a, double* p) {
  const Tag d;
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) hn::Store(a.v[u], d, p + u * hn::Lanes(d));
}
HWY_INLINE Lot Same(double value) {
  Lot out;
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) out.v[u] = hn::Set(Tag(), value);
  return out;
}
HWY_INLINE void Add(Lot& sum, const Lot& a, const Lot& b) {
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) sum.v[u] = hn::MulAdd(a.v[u], b.v[u], sum.v[u]);
}
HWY_INLINE void Subtract(Lot& sum, const Lot& a, const Lot& b) {
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) sum.v[u] = hn::NegMulAdd(a.v[u], b.v[u], sum.v[u]);
}

// Position in the lower triangle by columns.
HWY_INLINE std::size_t Lower(int n, int i, int j) {
  if (i < j) return Lower(n, j, i);
  return static_cast<std::size_t>(j * n - j * (j - 1) / 2 + i - j);
}

std::size_t BankScratch(int n, int r) {
  return BankWidth() *
         static_cast<std::size_t>(n + 2 * n * n + n * (n + 1) / 2 + 4 * n * r + r + r * r);
}

HWY_INLINE void Scale(Lot& a, const Lot& by) {
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) a.v[u] = hn::Mul(a.v[u], by.v[u]);
}

HWY_INLINE std::size_t At(int rows, int i, int j) { return static_cast<std::size_t>(j * rows + i); }

// The filters taken at once, with room for their matrices: elements of the bank stand `lanes`
// apart, those of the scratch `width`.
struct LotStep {
  const BankStep& s;
  std::size_t width, lane;
  double *x_next, *F, *FP, *P_next, *PC, *W, *K, *T, *z, *L;

  HWY_INLINE Lot In(const double* m, std::size_t e) const { return Load(m + e * s.lanes + lane); }
  HWY_INLINE Lot Get(const double* m, std::size_t e) const { return Load(m + e * width); }
  HWY_INLINE void Put(const Lot& a, double* m, std::size_t e) const { Store(a, m + e * width); }
};

HWY_INLINE LotStep MakeLotStep(const BankStep& s) {
  const int n = s.states, r = s.present;
  LotStep out{s, BankWidth(), 0, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}};
  double* next = s.scratch;
  const auto take = [&](double*& matrix, int elements) {
    matrix = next;
    next += static_cast<std::size_t>(elements) * out.width;
  };
  take(out.x_next, n), take(out.F, n * n), take(out.FP, n * n);
  take(out.P_next, n * (n + 1) / 2), take(out.PC, n * r), take(out.W, n * r);
  take(out.K, n * r), take(out.T, n * r), take(out.z, r), take(out.L, r * r);
  return out;
}

// P C', and z = e until Sigma is known.
HWY_INLINE void Innovate(const LotStep& q) {
  const BankStep& s = q.s;
  const int n = s.states, r = s.present;
  for (int j = 0; j < r; ++j) {
    Lot e = Same(s.y[j]);
    for (int k = 0; k < n; ++k) Subtract(e, Same(s.C[At(r, j, k)]), q.In(s.x, k));
    q.Put(e, q.z, j);
    for (int i = 0; i < n; ++i) {
      Lot sum = Same(0.0);
      for (int k = 0; k < n; ++k) Add(sum, q.In(s.P, Lower(n, i, k)), Same(s.C[At(r, j, k)]));
      q.Put(sum, q.PC, At(n, i, j));
    }
  }
}

// The inverse of the root of a pivot, for the diagonal of L. Where it is not positive, `least` says
// so.
HWY_INLINE Lot InverseRoot(const Lot& sigma, Lot& least, Lot& density) {
  const Tag d;
  const Vector one = hn::Set(d, 1.0);
  Lot inverse;
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) {
    const auto positive = hn::Gt(sigma.v[u], hn::Zero(d));
    least.v[u] = hn::IfThenElse(positive, least.v[u], hn::Zero(d));
    const Vector pivot = hn::IfThenElse(positive, sigma.v[u], one);
    inverse.v[u] = hn::Div(one, hn::Sqrt(pivot));
    density.v[u] = hn::NegMulAdd(hn::Set(d, 0.5), hn::Log(d, pivot), density.v[u]);
  }
  return inverse;
}

// Element j of z = L^-1 e.
HWY_INLINE void Whiten(const LotStep& q, int j, const Lot& inverse, Lot& density) {
  const Tag d;
  Lot e = q.Get(q.z, j);
  for (int k = 0; k < j; ++k) Subtract(e, q.Get(q.L, At(q.s.present, j, k)), q.Get(q.z, k));
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) {
    e.v[u] = hn::Mul(e.v[u], inverse.v[u]);
    density.v[u] = hn::NegMulAdd(hn::Mul(hn::Set(d, 0.5), e.v[u]), e.v[u], density.v[u]);
  }
  q.Put(e, q.z, j);
}

// Sigma = L L'; the diagonal of L holds its inverse. z = L^-1 e, and the log-density.
HWY_INLINE void Factor(const LotStep& q) {
  const Tag d;
  const BankStep& s = q.s;
  const int n = s.states, r = s.present;
  Lot density = Same(-0.5 * kLogTwoPi * r);
  Lot least = Same(1.0);  // smallest pivot so far, or a NaN
  for (int j = 0; j < r; ++j) {
    for (int i = j; i < r; ++i) {
      Lot sigma = q.In(s.R, Lower(s.outputs, s.channel[i], s.channel[j]));
      for (int k = 0; k < n; ++k) Add(sigma, Same(s.C[At(r, i, k)]), q.Get(q.PC, At(n, k, j)));
      for (int k = 0; k < j; ++k) Subtract(sigma, q.Get(q.L, At(r, i, k)), q.Get(q.L, At(r, j, k)));
      if (i > j) {
        Scale(sigma, q.Get(q.L, At(r, j, j)));
        q.Put(sigma, q.L, At(r, i, j));
        continue;
      }
      const Lot inverse = InverseRoot(sigma, least, density);
      q.Put(inverse, q.L, At(r, j, j));
      Whiten(q, j, inverse, density);
    }
  }
  HWY_UNROLL(4)
  for (std::size_t u = 0; u < kVectors; ++u) {
    const auto usable = hn::And(hn::Gt(least.v[u], hn::Zero(d)), hn::IsFinite(density.v[u]));
    hn::Store(hn::IfThenElse(usable, density.v[u], hn::Neg(hn::Inf(d))), d,
              s.log_density + q.lane + u * hn::Lanes(d));
  }
}

// Row i of W = (A P C' + G S) L'^-1 and of K = W L^-1, and state i of the next sample.
HWY_INLINE void GainRow(const LotStep& q, int i) {
  const BankStep& s = q.s;
  const int n = s.states, r = s.present;
  Lot state = Same(s.drive[i]);
  for (int k = 0; k < n; ++k) Add(state, Same(s.A[At(n, i, k)]), q.In(s.x, k));
  for (int j = 0; j < r; ++j) {
    Lot w = q.In(s.GS, At(n, i, s.channel[j]));
    for (int k = 0; k < n; ++k) Add(w, Same(s.A[At(n, i, k)]), q.Get(q.PC, At(n, k, j)));
    for (int k = 0; k < j; ++k) Subtract(w, q.Get(q.W, At(n, i, k)), q.Get(q.L, At(r, j, k)));
    Scale(w, q.Get(q.L, At(r, j, j)));
    q.Put(w, q.W, At(n, i, j));
    Add(state, w, q.Get(q.z, j));
  }
  q.Put(state, q.x_next, i);
  for (int j = r - 1; j >= 0; --j) {
    Lot gain = q.Get(q.W, At(n, i, j));
    for (int k = j + 1; k < r; ++k) {
      Subtract(gain, q.Get(q.K, At(n, i, k)), q.Get(q.L, At(r, k, j)));
    }
    Scale(gain, q.Get(q.L, At(r, j, j)));
    q.Put(gain, q.K, At(n, i, j));
  }
}

// Row i of F = A - K C, of T = K R - G S and of F P.
HWY_INLINE void ClosedLoopRow(const LotStep& q, int i) {
  const BankStep& s = q.s;
  const int n = s.states, r = s.present;
  for (int k = 0; k < n; ++k) {
    Lot f = Same(s.A[At(n, i, k)]);
    for (int j = 0; j < r; ++j) Subtract(f, q.Get(q.K, At(n, i, j)), Same(s.C[At(r, j, k)]));
    q.Put(f, q.F, At(n, i, k));
  }
  for (int j = 0; j < r; ++j) {
    Lot t = Same(0.0);
    for (int k = 0; k < r; ++k) {
      Add(t, q.Get(q.K, At(n, i, k)), q.In(s.R, Lower(s.outputs, s.channel[k], s.channel[j])));
    }
    const Lot gs = q.In(s.GS, At(n, i, s.channel[j]));
    HWY_UNROLL(4)
    for (std::size_t u = 0; u < kVectors; ++u) t.v[u] = hn::Sub(t.v[u], gs.v[u]);
    q.Put(t, q.T, At(n, i, j));
  }
  for (int k = 0; k < n; ++k) {
    Lot sum = Same(0.0);
    for (int l = 0; l < n; ++l) Add(sum, q.Get(q.F, At(n, i, l)), q.In(s.P, Lower(n, l, k)));
    q.Put(sum, q.FP, At(n, i, k));
  }
}

// P+ = F P F' + G Q G' + T K' - K (G S)'
HWY_INLINE void NextCovariance(const LotStep& q) {
  const BankStep& s = q.s;
  const int n = s.states, r = s.present;
  for (int j = 0; j < n; ++j) {
    for (int i = j; i < n; ++i) {
      Lot sum = q.In(s.GQG, Lower(n, i, j));
      for (int k = 0; k < n; ++k) Add(sum, q.Get(q.FP, At(n, i, k)), q.Get(q.F, At(n, j, k)));
      for (int k = 0; k < r; ++k) {
        Add(sum, q.Get(q.T, At(n, i, k)), q.Get(q.K, At(n, j, k)));
        Subtract(sum, q.Get(q.K, At(n, i, k)), q.In(s.GS, At(n, j, s.channel[k])));
      }
      q.Put(sum, q.P_next, Lower(n, i, j));
    }
  }
}

void StepBank(const BankStep& s) {
  const LotStep first = MakeLotStep(s);
  const int n = s.states;
  for (std::size_t lane = 0; lane < s.lanes; lane += first.width) {
    LotStep q = first;
    q.lane = lane;
    Innovate(q);
    Factor(q);
    for (int i = 0; i < n; ++i) {
      GainRow(q, i);
      ClosedLoopRow(q, i);
    }
    NextCovariance(q);
    for (int i = 0; i < n; ++i) Store(q.Get(q.x_next, i), s.x + i * s.lanes + q.lane);
    for (int e = 0; e < n * (n + 1) / 2; ++e) {
      Store(q.Get(q.P_next, e), s.P + e * s.lanes + q.lane);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include "lib/internal/instruction_set.h"

namespace identikal::simd {

std::size_t bank_width() { return IDENTIKAL_DISPATCH(BankWidth)(); }

std::size_t bank_scratch(int states, int outputs) {
  return IDENTIKAL_DISPATCH(BankScratch)(states, outputs);
}

void step_bank(const BankStep& step) { IDENTIKAL_DISPATCH(StepBank)(step); }

}  // namespace identikal::simd
#endif
