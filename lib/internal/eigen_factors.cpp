// Without the precompiled header, which says that these functions are compiled elsewhere.
#define IDENTIKAL_COMPILES_EIGEN_FACTORS
#include "lib/internal/eigen_instances.h"

#if EIGEN_VERSION_AT_LEAST(3, 4, 0) && !EIGEN_VERSION_AT_LEAST(3, 4, 90)
#define FUNCTION(...) template __VA_ARGS__;
#define MEMBER(...) template __VA_ARGS__;
#define MEMBER_TEMPLATE(...) template __VA_ARGS__;
namespace Eigen {
#include "lib/internal/eigen_factors.inc"
}  // namespace Eigen
#endif
