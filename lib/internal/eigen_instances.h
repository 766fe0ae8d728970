// Eigen's functions of MatrixXd that are compiled once, in eigen_kernels.cpp, eigen_factors.cpp and
// eigen_spectra.cpp beside this, instead of in every source that uses them: that took half of the compiler's
// time. Part of the precompiled header alone: a source that is compiled without it instantiates them for itself,
// to the same code. The names are those of Eigen 3.4, which keeps them for itself: any other Eigen goes without.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

#if EIGEN_VERSION_AT_LEAST(3, 4, 0) && !EIGEN_VERSION_AT_LEAST(3, 4, 90)
// A function said to be special is not instantiated from its template.
#define FUNCTION(...) \
  template <>         \
  __VA_ARGS__;
#define MEMBER(...) \
  template <>       \
  __VA_ARGS__;
#define MEMBER_TEMPLATE(...) \
  template <>                \
  template <>                \
  __VA_ARGS__;
namespace Eigen {
#ifndef IDENTIKAL_COMPILES_EIGEN_KERNELS
#include "lib/internal/eigen_kernels.inc"
#ifndef IDENTIKAL_COMPILES_EIGEN_FACTORS
#include "lib/internal/eigen_factors.inc"
#ifndef IDENTIKAL_COMPILES_EIGEN_SPECTRA
#include "lib/internal/eigen_spectra.inc"
#endif
#endif
#endif
}  // namespace Eigen
#undef FUNCTION
#undef MEMBER
#undef MEMBER_TEMPLATE
#endif
