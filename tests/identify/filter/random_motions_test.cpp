#include "tests/identify/filter/random_motions.h"

namespace identikal {
namespace {

using random_motions::expect_exact;
using random_motions::MotionKind;

TEST(RandomMotions, StiffOnesAreTheEquations) { expect_exact(MotionKind::stiff, "stiff", 100); }
TEST(RandomMotions, OscillatorsAreTheEquations) {
  expect_exact(MotionKind::oscillating, "oscillating", 20);
}
TEST(RandomMotions, DrivenByJumpsAreTheEquations) {
  expect_exact(MotionKind::driven, "driven by jumps", 100);
}

}  // namespace
}  // namespace identikal
