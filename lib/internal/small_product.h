// Products of matrices of a few rows. Eigen's own, for sizes known at run time only, go through
// kernels made for large matrices; these are plain loops that the compiler unrolls.
// Internal to lib.
#pragma once

#include <Eigen/Core>

namespace identikal {

/// out += factor a b; out must not be part of a or b.
template <class Out, class A, class B>
[[gnu::always_inline]] inline void add_product(Out&& out, const A& a, const B& b,
                                               double factor = 1.0) {
  const Eigen::Index rows = a.rows(), inner = a.cols(), cols = b.cols();
  for (Eigen::Index j = 0; j < cols; ++j) {
    for (Eigen::Index k = 0; k < inner; ++k) {
      const double weight = factor * b.coeff(k, j);
      for (Eigen::Index i = 0; i < rows; ++i) out.coeffRef(i, j) += a.coeff(i, k) * weight;
    }
  }
}

/// out = factor a b; out must not be part of a or b.
template <class Out, class A, class B>
[[gnu::always_inline]] inline void set_product(Out&& out, const A& a, const B& b,
                                               double factor = 1.0) {
  out.resize(a.rows(), b.cols());
  for (Eigen::Index j = 0; j < out.cols(); ++j) {
    for (Eigen::Index i = 0; i < out.rows(); ++i) out.coeffRef(i, j) = 0.0;
  }
  add_product(out, a, b, factor);
}

/// sum_ij a_ij b_ij
template <class A, class B>
inline double inner_product(const A& a, const B& b) {
  double sum = 0.0;
  for (Eigen::Index j = 0; j < a.cols(); ++j) {
    for (Eigen::Index i = 0; i < a.rows(); ++i) sum += a.coeff(i, j) * b.coeff(i, j);
  }
  return sum;
}

/// M = (M + M') / 2
template <class Square>
[[gnu::always_inline]] inline void symmetrise(Square& M) {
  for (Eigen::Index j = 0; j < M.cols(); ++j) {
    for (Eigen::Index i = 0; i < j; ++i) {
      M.coeffRef(i, j) = M.coeffRef(j, i) = 0.5 * (M.coeff(i, j) + M.coeff(j, i));
    }
  }
}

/// out += half + half'
template <class Square>
inline void add_with_transpose(Square& out, const Square& half, double factor = 1.0) {
  for (Eigen::Index j = 0; j < half.cols(); ++j) {
    for (Eigen::Index i = 0; i < half.rows(); ++i) {
      out.coeffRef(i, j) += factor * (half.coeff(i, j) + half.coeff(j, i));
    }
  }
}

}  // namespace identikal
