#include "lib/filter/internal/direct_kernel.h"

#include <cmath>

#include "lib/internal/small_product.h"

namespace identikal {
namespace {

// Plain loops all through: code that stores by halves what it loads whole again is slow.
template <class Matrix>
[[gnu::always_inline]] inline void copy(const Matrix& from, Matrix& to) {
  for (Eigen::Index i = 0; i < Matrix::SizeAtCompileTime; ++i) to.coeffRef(i) = from.coeff(i);
}

// M.col(j) += factor M.col(k)
template <class Matrix>
[[gnu::always_inline]] inline void add_column(Matrix& M, int j, double factor, int k) {
  for (Eigen::Index i = 0; i < M.rows(); ++i) M.coeffRef(i, j) += factor * M.coeff(i, k);
}

// Sigma = L D L'; false unless it is positive definite. L has ones on its diagonal.
template <int r>
[[gnu::always_inline]] inline bool factor(const Eigen::Matrix<double, r, r>& Sigma,
                                          Eigen::Matrix<double, r, r>& L,
                                          Eigen::Matrix<double, r, 1>& D,
                                          Eigen::Matrix<double, r, 1>& inverse) {
  for (int j = 0; j < r; ++j) {
    double pivot = Sigma(j, j);
    for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k) * D[k];
    if (!(pivot > 0.0)) return false;
    D[j] = pivot;
    inverse[j] = 1.0 / pivot;
    for (int i = j + 1; i < r; ++i) {
      double entry = Sigma(i, j);
      for (int k = 0; k < j; ++k) entry -= L(i, k) * L(j, k) * D[k];
      L(i, j) = entry * inverse[j];
    }
  }
  return true;
}

// K = K Sigma^-1 by substitution.
template <int r, class Columns>
[[gnu::always_inline]] inline void divide(Columns& K, const Eigen::Matrix<double, r, r>& L,
                                          const Eigen::Matrix<double, r, 1>& inverse) {
  for (int j = 1; j < r; ++j) {
    for (int k = 0; k < j; ++k) add_column(K, j, -L(j, k), k);
  }
  for (int j = r - 1; j >= 0; --j) {
    for (int i = 0; i < K.rows(); ++i) K(i, j) *= inverse[j];
    for (int k = j + 1; k < r; ++k) add_column(K, j, -L(k, j), k);
  }
}

template <class Square>
[[gnu::always_inline]] inline bool has_settled(const Square& P, const Square& next) {
  for (int j = 0; j < P.rows(); ++j) {
    for (int i = 0; i <= j; ++i) {
      const double scale = std::sqrt(next(i, i)) * std::sqrt(next(j, j));
      if (!(std::abs(next(i, j) - P(i, j)) <= 1e-14 * scale)) return false;
    }
  }
  return true;
}

// sum log|Sigma| + e' Sigma^-1 e
struct Terms {
  double squares = 0.0, determinant = 1.0, log_det = 0.0;

  template <int r>
  [[gnu::always_inline]] void add(Eigen::Matrix<double, r, 1>& e,
                                  const Eigen::Matrix<double, r, r>& L,
                                  const Eigen::Matrix<double, r, 1>& D,
                                  const Eigen::Matrix<double, r, 1>& inverse) {
    const double before = determinant;
    for (int j = 0; j < r; ++j) {
      for (int k = 0; k < j; ++k) e[j] -= L(j, k) * e[k];
      squares += e[j] * e[j] * inverse[j];
      determinant *= D[j];
    }
    // The logarithm is dear: one for many samples, unless a single one leaves the range.
    if (!(determinant > 1e-100 && determinant < 1e100)) {
      log_det += std::log(before);
      for (int j = 0; j < r; ++j) log_det += std::log(D[j]);
      determinant = 1.0;
    }
  }
};

template <int n, int r>
[[gnu::always_inline]] inline Eigen::Index run_body(const DirectFilter& filter, Eigen::Index t,
                                                    DirectRun& run) {
  using Square = Eigen::Matrix<double, n, n>;
  constexpr int kOrder = n == 1 && r != 1 ? Eigen::RowMajor : Eigen::ColMajor;
  using Columns = Eigen::Matrix<double, n, r, kOrder>;
  using Output = Eigen::Matrix<double, r, r>;
  using State = Eigen::Matrix<double, n, 1>;
  using Sample = Eigen::Matrix<double, r, 1>;
  const StateSpace& model = filter.model;
  const Eigen::Ref<const Eigen::MatrixXd>&y = filter.y, &u = filter.u;
  const Eigen::Index end = filter.end;
  const bool stop_when_settled = filter.stop_when_settled;
  const Square A = model.A, W = filter.W;
  const Columns Ct = model.C.transpose(), Sw = filter.Sw;
  const Output R = model.R;
  const bool crossed = !Sw.isZero(0.0), inputs = u.rows() > 0;
  Square P = run.P, F, AP, next;
  State x = run.x, moved;
  Columns PCt, K, KR;
  Output Sigma, L;
  Sample e, D, inverse;
  Terms terms;
  for (bool settled = false; t < end && !settled; ++t) {
    // A P does not wait for Sigma.
    set_product(PCt, P, Ct);
    set_product(AP, A, P);
    copy(R, Sigma);
    add_product(Sigma, Ct.transpose(), PCt);
    copy(Sw, K);
    add_product(K, AP, Ct);
    for (int j = 0; j < r; ++j) e[j] = y(j, t);
    add_product(e, Ct.transpose(), x, -1.0);
    if (inputs) e.noalias() -= model.D * u.col(t);
    if (!factor(Sigma, L, D, inverse)) {
      run.definite = false;
      return t;
    }
    divide(K, L, inverse);

    copy(A, F);
    add_product(F, K, Ct.transpose(), -1.0);
    add_product(AP, K, PCt.transpose(), -1.0);  // F P
    set_product(KR, K, R);
    if (crossed) KR -= Sw;
    copy(W, next);
    add_product(next, AP, F.transpose());
    add_product(next, KR, K.transpose());
    if (crossed) add_product(next, K, Sw.transpose(), -1.0);
    // A filter that forgets lets asymmetry from rounding decay: now and then is enough. Each time
    // stalls on entries stored singly and loaded by fours.
    if (stop_when_settled || (t & 15) == 0) symmetrise(next);

    set_product(moved, A, x);
    add_product(moved, K, e);
    if (inputs) moved.noalias() += model.B * u.col(t);
    copy(moved, x);
    terms.add(e, L, D, inverse);
    settled = stop_when_settled && has_settled(P, next);
    copy(next, P);
  }
  run.x = x;
  run.P = P;
  run.value -= 0.5 * (terms.log_det + std::log(terms.determinant) + terms.squares);
  return t;
}

// The same code with vectors of four and fused multiply-adds, where the machine has them.
#if defined(__x86_64__)
template <int n, int r>
[[gnu::target("avx2,fma")]] Eigen::Index run_wide(const DirectFilter& filter, Eigen::Index t,
                                                  DirectRun& run) {
  return run_body<n, r>(filter, t, run);
}
#endif

template <int n, int r>
Eigen::Index run_sized(const DirectFilter& filter, Eigen::Index t, DirectRun& run) {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (wide) return run_wide<n, r>(filter, t, run);
#endif
  return run_body<n, r>(filter, t, run);
}

template <int n>
Eigen::Index run_states(const DirectFilter& filter, Eigen::Index t, DirectRun& run) {
  switch (filter.y.rows()) {
    case 1:
      return run_sized<n, 1>(filter, t, run);
    case 2:
      return run_sized<n, 2>(filter, t, run);
    case 3:
      return run_sized<n, 3>(filter, t, run);
    default:
      return t;
  }
}

}  // namespace

Eigen::Index run_direct(const DirectFilter& filter, Eigen::Index t, DirectRun& run) {
  constexpr decltype(&run_states<1>) kByStates[] = {run_states<1>, run_states<2>, run_states<3>,
                                                    run_states<4>, run_states<5>, run_states<6>};
  const auto n = static_cast<std::size_t>(filter.model.states());
  if (n == 0 || n > std::size(kByStates)) return t;
  return kByStates[n - 1](filter, t, run);
}

}  // namespace identikal
