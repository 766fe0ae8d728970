#include "lib/base/utf8.h"

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(Utf8, CharactersOfOneToFourBytes) {
  EXPECT_TRUE(is_utf8("a\xC2\xB0\xE2\x82\xAC\xF0\x9F\x9A\x97"));
  EXPECT_EQ(utf8_length("\xE2\x82\xAC", 0), 3u);
  EXPECT_EQ(utf8_length("\xE2\x82\xAC", 1), 0u);
  EXPECT_EQ(utf8_length("a", 1), 0u);
}

TEST(Utf8, WhatJsonCouldNotHoldIsNone) {
  for (const char* bytes :
       {"\xB0", "\xC2", "\xC0\x80", "\xE0\x80\x80", "\xED\xA0\x80", "\xF0\x80\x80\x80",
        "\xF4\x90\x80\x80", "\xF5\x80\x80\x80", "\xE2\x82"}) {
    EXPECT_FALSE(is_utf8(bytes));
  }
}

}  // namespace
}  // namespace identikal
