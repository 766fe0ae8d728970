#include "identify/report/internal/text_layout.h"

#include <gtest/gtest.h>

namespace identikal {
namespace {

TEST(TextLayout, BreaksAtBlanksAndIndentsWhatFollows) {
  const std::string word(30, 'a');
  EXPECT_EQ(wrapped("note " + word + " " + word + " " + word, 5),
            "note " + word + " " + word + "\n     " + word + "\n");
  EXPECT_EQ(wrapped("  Q = [1,  2]", 4), "  Q = [1, 2]\n");
  const std::string longer(90, 'b');
  EXPECT_EQ(wrapped("see " + longer, 2), "see\n  " + longer + "\n");
}

TEST(TextLayout, BeginsAColumnWhereTheHeadEndsInABlank) {
  EXPECT_EQ(in_lines("time    ", "7 s", 8), "time    7 s\n");
  EXPECT_EQ(in_lines("", "7 s", 8), "7 s\n");
}

TEST(TextLayout, TablesAreAsWideAsWhatTheyHold) {
  EXPECT_EQ(text_table({{"name", true}, {"value"}, {"verdict", true}},
                       {{"q", "1.25", "ok"}, {"r_long", "3", "poorly determined"}}),
            "name    value  verdict\n"
            "q        1.25  ok\n"
            "r_long      3  poorly determined\n");
}

TEST(TextLayout, ALargeMatrixThatIsMostlyZeroIsSaidByItsEntries) {
  Eigen::MatrixXd Q = Eigen::MatrixXd::Zero(7, 7);
  EXPECT_EQ(matrix_text("Q", Q), "Q = 7 x 7, zero\n");
  Q(0, 0) = 0.5;
  Q(6, 2) = -2.0;
  EXPECT_EQ(matrix_text("Q", Q), "Q = 7 x 7, zero but for (1,1) 0.5, (7,3) -2\n");
  EXPECT_EQ(matrix_text("R", Eigen::MatrixXd::Zero(1, 2)), "R = [0, 0]\n");
  EXPECT_EQ(matrix_text("K", Eigen::RowVector2d(1.0, -3e-32)), "K = [1, 0]\n");
}

TEST(TextLayout, PutsTheLastColumnBelowWhereItDoesNotFit) {
  const std::string interval(66, '1');
  EXPECT_EQ(text_table({{"name", true}, {"interval"}, {"verdict", true}},
                       {{"q", interval, "ok"}, {"r", interval, "poorly determined"}}),
            "name" + std::string(59, ' ') + "interval  verdict\n" + "q    " + interval + "  ok\n" +
                "r    " + interval + "\n     poorly determined\n");
}

}  // namespace
}  // namespace identikal
