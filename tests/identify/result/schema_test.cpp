// The schema that is committed is the one that the description of the fields gives.
#include "identify/result/schema.h"

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(ResultSchema, IsTheCommittedOne) {
  const std::string path = IDENTIKAL_SOURCE_DIR "/identify/result/result.schema.json";
  if (std::getenv("RENEW") != nullptr) std::ofstream(path) << result_schema();
  std::ostringstream committed;
  committed << std::ifstream(path).rdbuf();
  EXPECT_TRUE(committed.str() == result_schema())
      << "fields were changed (identify/result/internal/fields.h). To renew " << path << ":\n"
      << "RENEW=1 build/tests/identify_tests --gtest_filter=ResultSchema.*";
}

}  // namespace
}  // namespace identikal
