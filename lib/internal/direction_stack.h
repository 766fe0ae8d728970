// How do the derivatives of small matrices by many directions follow from each other? All of them
// at once, so that every operation runs along the directions. Internal to lib.
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "lib/internal/add_scaled.h"

namespace identikal {

/// The derivatives of a matrix by k directions: row i + rows j holds those of entry (i, j).
using Stack = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// out.row(i) += weight from.row(j).
template <class From>
inline void add_row(Stack& out, Eigen::Index i, double weight, const From& from, Eigen::Index j) {
  const Eigen::Index k = out.cols();
  add_scaled(out.data() + k * i, weight, from.data() + k * j, k);
}
inline void clear_row(Stack& out, Eigen::Index i) {
  std::fill_n(out.data() + out.cols() * i, out.cols(), 0.0);
}
inline void copy_row(Stack& out, Eigen::Index i, Eigen::Index from) {
  std::copy_n(out.data() + out.cols() * from, out.cols(), out.data() + out.cols() * i);
}

/// out = A B, a product that is known to be symmetric.
template <class A, class B>
void set_symmetric_product(Eigen::MatrixXd& out, const A& a, const B& b) {
  const Eigen::Index n = a.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) {
      double sum = 0.0;
      for (Eigen::Index l = 0; l < a.cols(); ++l) sum += a.coeff(i, l) * b.coeff(l, j);
      out(i, j) = out(j, i) = sum;
    }
  }
}

/// The lower triangular L with L L' = S; false unless S is positive definite.
inline bool set_factor(const Eigen::MatrixXd& S, Eigen::MatrixXd& L) {
  const Eigen::Index n = S.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    double pivot = S(j, j);
    for (Eigen::Index l = 0; l < j; ++l) pivot -= L(j, l) * L(j, l);
    if (!(pivot > 0.0)) return false;
    L(j, j) = std::sqrt(pivot);
    for (Eigen::Index i = j + 1; i < n; ++i) {
      double sum = S(i, j);
      for (Eigen::Index l = 0; l < j; ++l) sum -= L(i, l) * L(j, l);
      L(i, j) = sum / L(j, j);
    }
  }
  return true;
}

/// V = L^-1 V, n x cols.
inline void solve_rows(const Eigen::MatrixXd& L, Stack& V, Eigen::Index cols) {
  const Eigen::Index n = L.rows();
  for (Eigen::Index j = 0; j < cols; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index l = 0; l < i; ++l) add_row(V, i + n * j, -L(i, l), V, l + n * j);
      V.row(i + n * j) *= 1.0 / L(i, i);
    }
  }
}
/// V = V (L^-1)', n x n.
inline void solve_columns(const Eigen::MatrixXd& L, Stack& V) {
  const Eigen::Index n = L.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index l = 0; l < j; ++l) add_row(V, i + n * j, -L(j, l), V, i + n * l);
      V.row(i + n * j) *= 1.0 / L(j, j);
    }
  }
}

/// out = A dP A', n x n; `half` is memory of the same size.
inline void set_congruence(const Eigen::MatrixXd& A, const Stack& dP, Stack& half, Stack& out) {
  const Eigen::Index n = A.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      clear_row(half, i + n * j);
      for (Eigen::Index l = 0; l < n; ++l) add_row(half, i + n * j, A(i, l), dP, l + n * j);
    }
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) {
      clear_row(out, i + n * j);
      for (Eigen::Index l = 0; l < n; ++l) add_row(out, i + n * j, A(j, l), half, i + n * l);
      if (i != j) copy_row(out, j + n * i, i + n * j);
    }
  }
}

inline bool is_zero_row(const Stack& M, Eigen::Index i) {
  const double* const row = M.data() + M.cols() * i;
  return std::all_of(row, row + M.cols(), [](double value) { return value == 0.0; });
}

/// out += D X + (D X)', n x n; `half` is memory of the same size.
inline void add_turned(const Stack& D, const Eigen::MatrixXd& X, Stack& half, Stack& out) {
  const Eigen::Index n = X.cols();
  half.setZero();
  for (Eigen::Index l = 0; l < X.rows(); ++l) {
    for (Eigen::Index i = 0; i < n; ++i) {
      if (is_zero_row(D, i + n * l)) continue;
      for (Eigen::Index j = 0; j < n; ++j) add_row(half, i + n * j, X(l, j), D, i + n * l);
    }
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i < n; ++i) {
      add_row(out, i + n * j, 1.0, half, i + n * j);
      add_row(out, i + n * j, 1.0, half, j + n * i);
    }
  }
}

/// out += K N K', N symmetric.
inline void add_gain_noise(const Eigen::MatrixXd& K, const Eigen::MatrixXd& N,
                           Eigen::MatrixXd& out) {
  for (Eigen::Index j = 0; j < K.rows(); ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) {
      double sum = 0.0;
      for (Eigen::Index b = 0; b < K.cols(); ++b) {
        for (Eigen::Index a = 0; a < K.cols(); ++a) sum += K(i, a) * N(a, b) * K(j, b);
      }
      out(i, j) += sum;
      if (i != j) out(j, i) = out(i, j);
    }
  }
}
/// out += K dN K'.
inline void add_gain_noise(const Eigen::MatrixXd& K, const Stack& dN, Stack& out) {
  const Eigen::Index n = K.rows(), m = K.cols();
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index i = 0; i <= j; ++i) {
      for (Eigen::Index b = 0; b < m; ++b) {
        for (Eigen::Index a = 0; a < m; ++a) {
          add_row(out, i + n * j, K(i, a) * K(j, b), dN, a + m * b);
        }
      }
      if (i != j) copy_row(out, j + n * i, i + n * j);
    }
  }
}

/// The upper triangle of to += weight v v'.
template <class Row>
void add_outer(Eigen::MatrixXd& to, const Row& v, double weight) {
  for (Eigen::Index j = 0; j < to.cols(); ++j) {
    const double factor = weight * v[j];
    for (Eigen::Index i = 0; i <= j; ++i) to(i, j) += factor * v[i];
  }
}

}  // namespace identikal
