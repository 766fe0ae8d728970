// Do a program and the library agree on how Eigen aligns its matrices?
#pragma once

#include <Eigen/Core>

// The library and Debian's Ceres are built for the baseline of the machine. With -march=native, or
// anything else that brings AVX, Eigen would allocate in one way here and free in another there,
// unless it is told to align as it does without.
static_assert(EIGEN_DEFAULT_ALIGN_BYTES <= 16 && EIGEN_MAX_STATIC_ALIGN_BYTES <= 16,
              "Identikal is built for the baseline instruction set: with -march, -mavx and the like "
              "compile files that include its headers with -DEIGEN_MAX_ALIGN_BYTES=16, as its CMake "
              "targets and pkg-config do");
