// Do a program and the library agree on how Eigen aligns its matrices?
#pragma once

#include <Eigen/Core>

// The library and Debian's Ceres are built for the baseline of the machine. With -march=native, or
// anything else that brings AVX, Eigen would allocate in one way here and free in another there.
static_assert(EIGEN_DEFAULT_ALIGN_BYTES <= 16 && EIGEN_MAX_STATIC_ALIGN_BYTES <= 16,
              "Identikal is built for the baseline instruction set: compile files that include its "
              "headers without -march, -mavx and the like");
