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

template <int n, int r>
[[gnu::always_inline]] inline Eigen::Index run_body(
    const StateSpace& model, const Eigen::MatrixXd& W_, const Eigen::MatrixXd& Sw_,
    const Eigen::Ref<const Eigen::MatrixXd>& y, const Eigen::Ref<const Eigen::MatrixXd>& u,
    Eigen::Index t, Eigen::Index end, bool stop_when_settled, DirectRun& run) {
  using Square = Eigen::Matrix<double, n, n>;
  constexpr int kOrder = n == 1 && r != 1 ? Eigen::RowMajor : Eigen::ColMajor;
  using Columns = Eigen::Matrix<double, n, r, kOrder>;
  using Output = Eigen::Matrix<double, r, r>;
  using State = Eigen::Matrix<double, n, 1>;
  using Sample = Eigen::Matrix<double, r, 1>;
  const Square A = model.A, W = W_;
  const Columns Ct = model.C.transpose(), Sw = Sw_;
  const Output R = model.R;
  const bool crossed = !Sw.isZero(0.0), inputs = u.rows() > 0;
  Square P = run.P, F, AP, next;
  State x = run.x, moved;
  Columns PCt, K, KR;
  Output Sigma, L;
  Sample e, D;
  double squares = 0.0, determinant = 1.0, log_det = 0.0;
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

    // Sigma = L D L', and K = (A P C' + G S) Sigma^-1 by substitution.
    Sample inverse;
    for (int j = 0; j < r; ++j) {
      double pivot = Sigma(j, j);
      for (int k = 0; k < j; ++k) pivot -= L(j, k) * L(j, k) * D[k];
      if (!(pivot > 0.0)) {
        run.definite = false;
        return t;
      }
      D[j] = pivot;
      inverse[j] = 1.0 / pivot;
      for (int i = j + 1; i < r; ++i) {
        double entry = Sigma(i, j);
        for (int k = 0; k < j; ++k) entry -= L(i, k) * L(j, k) * D[k];
        L(i, j) = entry * inverse[j];
      }
    }
    for (int j = 1; j < r; ++j) {
      for (int k = 0; k < j; ++k) add_column(K, j, -L(j, k), k);
    }
    for (int j = r - 1; j >= 0; --j) {
      for (int i = 0; i < n; ++i) K(i, j) *= inverse[j];
      for (int k = j + 1; k < r; ++k) add_column(K, j, -L(k, j), k);
    }

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
    if (stop_when_settled) {
      settled = true;
      for (int j = 0; j < n && settled; ++j) {
        for (int i = 0; i <= j && settled; ++i) {
          const double scale = std::sqrt(next(i, i)) * std::sqrt(next(j, j));
          settled = std::abs(next(i, j) - P(i, j)) <= 1e-14 * scale;
        }
      }
    }
    copy(next, P);
  }
  run.x = x;
  run.P = P;
  run.value -= 0.5 * (log_det + std::log(determinant) + squares);
  return t;
}

// The same code with vectors of four and fused multiply-adds, where the machine has them.
#if defined(__x86_64__)
template <int n, int r>
[[gnu::target("avx2,fma")]] Eigen::Index run_wide(const StateSpace& model, const Eigen::MatrixXd& W,
                                                  const Eigen::MatrixXd& Sw,
                                                  const Eigen::Ref<const Eigen::MatrixXd>& y,
                                                  const Eigen::Ref<const Eigen::MatrixXd>& u,
                                                  Eigen::Index t, Eigen::Index end,
                                                  bool stop_when_settled, DirectRun& run) {
  return run_body<n, r>(model, W, Sw, y, u, t, end, stop_when_settled, run);
}
#endif

template <int n, int r>
Eigen::Index run_sized(const StateSpace& model, const Eigen::MatrixXd& W, const Eigen::MatrixXd& Sw,
                       const Eigen::Ref<const Eigen::MatrixXd>& y,
                       const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index t, Eigen::Index end,
                       bool stop_when_settled, DirectRun& run) {
#if defined(__x86_64__)
  static const bool wide = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (wide) return run_wide<n, r>(model, W, Sw, y, u, t, end, stop_when_settled, run);
#endif
  return run_body<n, r>(model, W, Sw, y, u, t, end, stop_when_settled, run);
}

template <int n>
Eigen::Index run_states(const StateSpace& model, const Eigen::MatrixXd& W,
                        const Eigen::MatrixXd& Sw, const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index t,
                        Eigen::Index end, bool stop_when_settled, DirectRun& run) {
  switch (y.rows()) {
    case 1:
      return run_sized<n, 1>(model, W, Sw, y, u, t, end, stop_when_settled, run);
    case 2:
      return run_sized<n, 2>(model, W, Sw, y, u, t, end, stop_when_settled, run);
    case 3:
      return run_sized<n, 3>(model, W, Sw, y, u, t, end, stop_when_settled, run);
    default:
      return t;
  }
}

}  // namespace

Eigen::Index run_direct(const StateSpace& model, const Eigen::MatrixXd& W,
                        const Eigen::MatrixXd& Sw, const Eigen::Ref<const Eigen::MatrixXd>& y,
                        const Eigen::Ref<const Eigen::MatrixXd>& u, Eigen::Index t,
                        Eigen::Index end, bool stop_when_settled, DirectRun& run) {
  constexpr decltype(&run_states<1>) kByStates[] = {run_states<1>, run_states<2>, run_states<3>,
                                                    run_states<4>, run_states<5>, run_states<6>};
  const auto n = static_cast<std::size_t>(model.states());
  if (n == 0 || n > std::size(kByStates)) return t;
  return kByStates[n - 1](model, W, Sw, y, u, t, end, stop_when_settled, run);
}

}  // namespace identikal
