// What does a program answer that was built without the studies?
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/base/error.h"
#include "studies/study.h"

namespace identikal {
namespace {

TEST(WithoutStudies, SaysSoInOneLine) {
  EXPECT_TRUE(study_names().empty());
  EXPECT_THAT(study_ranges(), testing::HasSubstr("built without the studies"));
  try {
    study("matisko-table-1");
    FAIL() << "there is no study to run";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(),
                 "this program was built without the studies; configure with "
                 "-DIDENTIKAL_BUILD_STUDIES=ON and build it again");
  }
}

}  // namespace
}  // namespace identikal
