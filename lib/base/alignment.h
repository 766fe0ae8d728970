// Do a program and the library agree on how Eigen aligns its matrices?
#pragma once

#include <Eigen/Core>

// The library and Debian's Ceres are built for the baseline of the machine. With -march=native, or
// anything else that brings AVX, Eigen would allocate in one way here and free in another there.
static_assert(EIGEN_DEFAULT_ALIGN_BYTES <= 16 && EIGEN_MAX_STATIC_ALIGN_BYTES <= 16,
              "Identikal is built for the baseline instruction set: put -mno-avx behind -march, "
              "-mavx and the like where files include its headers, as its CMake targets and "
              "pkg-config do; identikal.h, the C interface, takes any flags");
