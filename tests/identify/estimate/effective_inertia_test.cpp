#include "identify/estimate/effective_inertia.h"

#include <gtest/gtest.h>

#include "identify/report/internal/verdict_text.h"

namespace identikal {
namespace {

// More than half of the variance comes by what the model leaves out.
TEST(EffectiveInertia, IsOneThatTheStructureDecides) {
  EstimatedParameter Iz;
  Iz.name = "Iz";
  Iz.se = 100.0;
  EXPECT_FALSE(is_effective_inertia(Iz));  // nothing is said of the structure
  Iz.se_structure = 70.0;
  EXPECT_FALSE(is_effective_inertia(Iz));
  Iz.se_structure = 71.0;
  EXPECT_TRUE(is_effective_inertia(Iz));
  EXPECT_EQ(verdict_text(Iz), "ok, effective");
  Iz.se_structure = 100.0;  // allowed for
  EXPECT_FALSE(is_effective_inertia(Iz));
  EXPECT_EQ(verdict_text(Iz), "ok");
  EstimatedParameter Cf = Iz;
  Cf.name = "Cf";
  Cf.se_structure = 99.0;
  EXPECT_FALSE(is_effective_inertia(Cf));
}

}  // namespace
}  // namespace identikal
