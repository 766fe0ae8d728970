// Instructions of a tape beyond the operations of formulas.
#pragma once

#include <cstdint>

#include "lib/formula/expression.h"

namespace identikal {

enum TapeOp : std::uint16_t {
  kMultiplyAdd = static_cast<int>(Op::hypot) + 1,  // a b + c
  kMultiplySubtract,                               // a b - c
  kSubtractProduct,                                // c - a b
  kTwoProducts,                                    // a b + c d
  kThreeProducts,                                  // the same of six factors in `places`
  kSumOfProducts,                                  // sum of positive a b - sum of negative a b
};

}  // namespace identikal
