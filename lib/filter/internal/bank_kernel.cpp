#include "lib/filter/internal/bank_kernel.h"

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
  for (std::size_t u = 0; u < kVectors; ++u) out.v[u] = hn::Load(d, p + u * hn::Lanes(d));
  return out;
}
HWY_INLINE void Store(const Lot& a, double* p) {
  const Tag d;
  for (std::size_t u = 0; u < kVectors; ++u) hn::Store(a.v[u], d, p + u * hn::Lanes(d));
}
HWY_INLINE Lot Same(double value) {
  Lot out;
  for (std::size_t u = 0; u < kVectors; ++u) out.v[u] = hn::Set(Tag(), value);
  return out;
}
HWY_INLINE void Add(Lot& sum, const Lot& a, const Lot& b) {
  for (std::size_t u = 0; u < kVectors; ++u) sum.v[u] = hn::MulAdd(a.v[u], b.v[u], sum.v[u]);
}
HWY_INLINE void Subtract(Lot& sum, const Lot& a, const Lot& b) {
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

void StepBank(const BankStep& s) {
  const Tag d;
  const std::size_t width = BankWidth();
  const int n = s.states, r = s.present;
  const auto at = [](int rows, int i, int j) { return static_cast<std::size_t>(j * rows + i); };
  // Scratch of one lot: elements `width` apart.
  double* next = s.scratch;
  const auto matrix = [&next, width](int elements) {
    double* out = next;
    next += static_cast<std::size_t>(elements) * width;
    return out;
  };
  double *const x_next = matrix(n), *const F = matrix(n * n), *const FP = matrix(n * n),
                *const P_next = matrix(n * (n + 1) / 2), *const PC = matrix(n * r),
                *const W = matrix(n * r), *const K = matrix(n * r), *const T = matrix(n * r),
                *const z = matrix(r), *const L = matrix(r * r);
  const double kLog2Pi = 1.8378770664093454836;
  for (std::size_t lane = 0; lane < s.lanes; lane += width) {
    // Elements of the filters of this lot, and of the scratch.
    const auto in = [&](const double* m, std::size_t e)
                        HWY_ATTR { return Load(m + e * s.lanes + lane); };
    const auto get = [&](const double* m, std::size_t e) HWY_ATTR { return Load(m + e * width); };
    const auto put = [&](const Lot& a, double* m, std::size_t e)
                         HWY_ATTR { Store(a, m + e * width); };
    // P C', and z = e until Sigma is known.
    for (int j = 0; j < r; ++j) {
      Lot e = Same(s.y[j]);
      for (int k = 0; k < n; ++k) {
        Subtract(e, Same(s.C[at(r, j, k)]), in(s.x, static_cast<std::size_t>(k)));
      }
      put(e, z, static_cast<std::size_t>(j));
      for (int i = 0; i < n; ++i) {
        Lot sum = Same(0.0);
        for (int k = 0; k < n; ++k) Add(sum, in(s.P, Lower(n, i, k)), Same(s.C[at(r, j, k)]));
        put(sum, PC, at(n, i, j));
      }
    }
    // Sigma = L L'; the diagonal of L holds its inverse. z = L^-1 e.
    Lot density = Same(-0.5 * kLog2Pi * r);
    Lot least = Same(1.0);  // smallest pivot so far, or a NaN
    for (int j = 0; j < r; ++j) {
      for (int i = j; i < r; ++i) {
        Lot sigma = in(s.R, Lower(s.outputs, s.channel[i], s.channel[j]));
        for (int k = 0; k < n; ++k) Add(sigma, Same(s.C[at(r, i, k)]), get(PC, at(n, k, j)));
        for (int k = 0; k < j; ++k) Subtract(sigma, get(L, at(r, i, k)), get(L, at(r, j, k)));
        if (i > j) {
          const Lot inverse = get(L, at(r, j, j));
          for (std::size_t u = 0; u < kVectors; ++u) {
            sigma.v[u] = hn::Mul(sigma.v[u], inverse.v[u]);
          }
          put(sigma, L, at(r, i, j));
          continue;
        }
        Lot inverse;
        for (std::size_t u = 0; u < kVectors; ++u) {
          const Vector one = hn::Set(d, 1.0);
          const auto positive = hn::Gt(sigma.v[u], hn::Zero(d));
          least.v[u] = hn::IfThenElse(positive, least.v[u], hn::Zero(d));
          const Vector pivot = hn::IfThenElse(positive, sigma.v[u], one);
          inverse.v[u] = hn::Div(one, hn::Sqrt(pivot));
          density.v[u] = hn::NegMulAdd(hn::Set(d, 0.5), hn::Log(d, pivot), density.v[u]);
        }
        put(inverse, L, at(r, j, j));
        Lot e = get(z, static_cast<std::size_t>(j));
        for (int k = 0; k < j; ++k) {
          Subtract(e, get(L, at(r, j, k)), get(z, static_cast<std::size_t>(k)));
        }
        for (std::size_t u = 0; u < kVectors; ++u) {
          e.v[u] = hn::Mul(e.v[u], inverse.v[u]);
          density.v[u] = hn::NegMulAdd(hn::Mul(hn::Set(d, 0.5), e.v[u]), e.v[u], density.v[u]);
        }
        put(e, z, static_cast<std::size_t>(j));
      }
    }
    for (std::size_t u = 0; u < kVectors; ++u) {
      const auto usable = hn::And(hn::Gt(least.v[u], hn::Zero(d)), hn::IsFinite(density.v[u]));
      hn::Store(hn::IfThenElse(usable, density.v[u], hn::Neg(hn::Inf(d))), d,
                s.log_density + lane + u * hn::Lanes(d));
    }
    // W = (A P C' + G S) L'^-1 and K = W L^-1, row by row.
    for (int i = 0; i < n; ++i) {
      Lot state = Same(s.drive[i]);
      for (int k = 0; k < n; ++k) {
        Add(state, Same(s.A[at(n, i, k)]), in(s.x, static_cast<std::size_t>(k)));
      }
      for (int j = 0; j < r; ++j) {
        Lot w = in(s.GS, at(n, i, s.channel[j]));
        for (int k = 0; k < n; ++k) Add(w, Same(s.A[at(n, i, k)]), get(PC, at(n, k, j)));
        for (int k = 0; k < j; ++k) Subtract(w, get(W, at(n, i, k)), get(L, at(r, j, k)));
        const Lot inverse = get(L, at(r, j, j));
        for (std::size_t u = 0; u < kVectors; ++u) w.v[u] = hn::Mul(w.v[u], inverse.v[u]);
        put(w, W, at(n, i, j));
        Add(state, w, get(z, static_cast<std::size_t>(j)));
      }
      put(state, x_next, static_cast<std::size_t>(i));
      for (int j = r - 1; j >= 0; --j) {
        Lot gain = get(W, at(n, i, j));
        for (int k = j + 1; k < r; ++k) {
          Subtract(gain, get(K, at(n, i, k)), get(L, at(r, k, j)));
        }
        const Lot inverse = get(L, at(r, j, j));
        for (std::size_t u = 0; u < kVectors; ++u) {
          gain.v[u] = hn::Mul(gain.v[u], inverse.v[u]);
        }
        put(gain, K, at(n, i, j));
      }
      for (int k = 0; k < n; ++k) {
        Lot f = Same(s.A[at(n, i, k)]);
        for (int j = 0; j < r; ++j) Subtract(f, get(K, at(n, i, j)), Same(s.C[at(r, j, k)]));
        put(f, F, at(n, i, k));
      }
      for (int j = 0; j < r; ++j) {
        Lot t = Same(0.0);
        for (int k = 0; k < r; ++k) {
          Add(t, get(K, at(n, i, k)), in(s.R, Lower(s.outputs, s.channel[k], s.channel[j])));
        }
        const Lot gs = in(s.GS, at(n, i, s.channel[j]));
        for (std::size_t u = 0; u < kVectors; ++u) t.v[u] = hn::Sub(t.v[u], gs.v[u]);
        put(t, T, at(n, i, j));
      }
      for (int k = 0; k < n; ++k) {
        Lot sum = Same(0.0);
        for (int l = 0; l < n; ++l) Add(sum, get(F, at(n, i, l)), in(s.P, Lower(n, l, k)));
        put(sum, FP, at(n, i, k));
      }
    }
    for (int j = 0; j < n; ++j) {
      for (int i = j; i < n; ++i) {
        Lot sum = in(s.GQG, Lower(n, i, j));
        for (int k = 0; k < n; ++k) Add(sum, get(FP, at(n, i, k)), get(F, at(n, j, k)));
        for (int k = 0; k < r; ++k) {
          Add(sum, get(T, at(n, i, k)), get(K, at(n, j, k)));
          Subtract(sum, get(K, at(n, i, k)), in(s.GS, at(n, j, s.channel[k])));
        }
        put(sum, P_next, Lower(n, i, j));
      }
    }
    for (int i = 0; i < n; ++i) {
      Store(get(x_next, static_cast<std::size_t>(i)),
            s.x + static_cast<std::size_t>(i) * s.lanes + lane);
    }
    for (std::size_t e = 0; e < static_cast<std::size_t>(n * (n + 1) / 2); ++e) {
      Store(get(P_next, e), s.P + e * s.lanes + lane);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace identikal::simd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace identikal::simd {

HWY_EXPORT(BankWidth);
HWY_EXPORT(BankScratch);
HWY_EXPORT(StepBank);

std::size_t bank_width() { return HWY_DYNAMIC_DISPATCH(BankWidth)(); }

std::size_t bank_scratch(int states, int outputs) {
  return HWY_DYNAMIC_DISPATCH(BankScratch)(states, outputs);
}

void step_bank(const BankStep& step) { HWY_DYNAMIC_DISPATCH(StepBank)(step); }

}  // namespace identikal::simd
#endif
