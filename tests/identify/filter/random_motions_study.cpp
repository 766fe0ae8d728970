#include "tests/identify/filter/random_motions.h"

namespace identikal {
namespace {

using random_motions::expect_exact;
using random_motions::MotionKind;

TEST(RandomMotionsStudy, AThousandAreTheEquations) {
  expect_exact(MotionKind::stiff, "stiff", 334);
  expect_exact(MotionKind::oscillating, "oscillating", 333);
  expect_exact(MotionKind::driven, "driven by jumps", 333);
}

}  // namespace
}  // namespace identikal
