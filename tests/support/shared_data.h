// Where are the reference recordings, and what happens to a test that needs them when they are not
// there? They lie in the folder "shared" beside the repository and are not part of it.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

namespace identikal {

/// Path of a reference file, e.g. shared_file("likelihood/nile.csv").
inline std::string shared_file(const std::string& relative) {
  return std::string(IDENTIKAL_SOURCE_DIR) + "/../shared/" + relative;
}

/// True where a missing reference file must fail the test: the environment says CI=true.
inline bool shared_files_are_required() {
  const char* ci = std::getenv("CI");
  return ci != nullptr && std::string_view(ci) == "true";
}

}  // namespace identikal

/// First line of a test that reads shared_file(relative): skips it when the file is absent, but
/// fails it under CI. A macro because both must return from the test itself.
#define IDENTIKAL_NEEDS_SHARED_FILE(relative)                                                    \
  if (!std::filesystem::exists(identikal::shared_file(relative))) {                              \
    if (identikal::shared_files_are_required()) FAIL() << "missing reference file " << relative; \
    GTEST_SKIP() << "no reference file " << relative << " beside the repository";                \
  }                                                                                              \
  static_assert(true, "a semicolon follows")
