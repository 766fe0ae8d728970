#include "fleet/manifest.h"

#include <filesystem>
#include <fstream>

#include "fleet/internal/row_condition.h"
#include <gtest/gtest.h>
#include <unistd.h>

#include "lib/base/error.h"
#include "lib/data/csv.h"
#include "lib/data/text_table.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;

class Manifest : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "b");
    for (const char* name : {"b/2.csv", "1.csv", "10.csv", "notes.txt"}) write(name, "y\n1\n2\n");
  }
  void TearDown() override { fs::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
  }
  std::vector<std::string> recordings(const std::string& manifest) {
    std::vector<std::string> out;
    for (const FleetJob& job : read_manifests({manifest})) {
      out.push_back(fs::relative(job.recording, folder_).string());
    }
    return out;
  }
  std::string refusal(const std::string& text) {
    write("fleet.csv", text);
    try {
      read_manifests({folder_ / "fleet.csv"});
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  const fs::path folder_ = fs::path(testing::TempDir()) / ("manifest_" + std::to_string(getpid()));
};

TEST_F(Manifest, AFolderAPatternAndARecording) {
  using Names = std::vector<std::string>;
  EXPECT_EQ(recordings(folder_), (Names{"1.csv", "10.csv", "b/2.csv"}));
  EXPECT_EQ(recordings(folder_ / "*.csv"), (Names{"1.csv", "10.csv"}));
  EXPECT_EQ(recordings(folder_ / "10.csv"), (Names{"10.csv"}));
  EXPECT_EQ(recordings(folder_ / "absent.csv"), (Names{"absent.csv"}));  // a row that says so
  EXPECT_THROW(recordings(folder_ / "x*.csv"), InputError);
}

TEST_F(Manifest, ATableSaysMoreOfEach) {
  write("fleet.csv",
        "# of May\nrecording;unit;group;options;where\n1.csv;car 1;A;--starts 1;speed > 5\n"
        "\"b/2.csv\";\"car; 2\"\n");
  const std::vector<FleetJob> jobs = read_manifests({folder_ / "fleet.csv"});
  ASSERT_EQ(jobs.size(), 2U);
  EXPECT_EQ(jobs[0], (FleetJob{folder_ / "1.csv", "car 1", "A", "--starts 1", "speed > 5"}));
  EXPECT_EQ(jobs[1], (FleetJob{folder_ / "b/2.csv", "car; 2", "", "", ""}));
}

TEST_F(Manifest, JoinedFilesLieInItsFolder) {
  write("fleet.csv", "recording\n1.csv+10.csv\n");
  EXPECT_EQ(read_manifests({folder_ / "fleet.csv"})[0].recording,
            (folder_ / "1.csv").string() + "+" + (folder_ / "10.csv").string());
}

TEST_F(Manifest, MistakesAreToldWithTheirLine) {
  EXPECT_NE(refusal("recording,units\n1.csv,a\n").find("did you mean 'unit'"), std::string::npos);
  EXPECT_NE(refusal("recording,unit\n,a\n").find("fleet.csv:2"), std::string::npos);
  EXPECT_NE(refusal("recording,unit\n1.csv,a,b\n").find("3 cells"), std::string::npos);
  EXPECT_NE(refusal("recording\n1.csv\n1.csv\n").find("stand twice"), std::string::npos);
  EXPECT_NE(refusal("recording\n").find("without rows"), std::string::npos);
  EXPECT_NE(refusal("recording,recording\na,b\n").find("two columns"), std::string::npos);
  EXPECT_NE(refusal("recording\n\"1.csv\n").find("fleet.csv:2:1"), std::string::npos);
}

TEST(OptionWords, AreAShells) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(option_words("--starts 1  --set 'q=3 m' \"\""),
            (Words{"--starts", "1", "--set", "q=3 m", ""}));
  EXPECT_EQ(option_words(""), Words{});
  EXPECT_THROW(option_words("--set 'q"), InputError);
}

class Rows : public testing::Test {
 protected:
  const std::string text_ =
      "vehicle,speed,y\ncar 1,1,10\n\"car, 2\",5,20\ncar 1,,30\n\n# note\ncar 1,9,40\n";
  const Table table_ = parse_csv(text_, "t.csv");
  std::vector<std::size_t> where(const std::string& condition) {
    return rows_where(condition, text_, table_);
  }
};

TEST_F(Rows, NumbersAndTextsAreCompared) {
  using R = std::vector<std::size_t>;
  EXPECT_EQ(where(""), (R{0, 1, 2, 3}));
  EXPECT_EQ(where("speed > 1"), (R{1, 3}));
  EXPECT_EQ(where("speed >= 1 and y != 20"), (R{0, 3}));
  EXPECT_EQ(where("vehicle = car 1 and y <= 30"), (R{0, 2}));
  EXPECT_EQ(where("vehicle = 'car, 2'"), (R{1}));
  EXPECT_EQ(where("vehicle != car 1"), (R{1}));
}

TEST_F(Rows, MistakesAreTold) {
  for (const char* wrong : {"speed", "speed > ", "> 3", "speed ! 3", "vehicle < car", "spee = 1",
                            "speed = 77", "speed > 1 and "}) {
    EXPECT_THROW(where(wrong), InputError) << wrong;
  }
}

TEST_F(Rows, PartsComeInTheirOrder) {
  const std::vector<RowGroup> parts = groups_by("vehicle", text_, table_, where(""));
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].value, "car 1");
  EXPECT_EQ(parts[0].rows, (std::vector<std::size_t>{0, 2, 3}));
  EXPECT_EQ(parts[1].value, "car, 2");
  const Table part = rows_at(table_, parts[0].rows);
  EXPECT_EQ(part.rows, 3U);
  EXPECT_EQ(part.find("y")->values, (std::vector<double>{10, 30, 40}));
  EXPECT_EQ(part.find("speed")->missing, 1U);
  EXPECT_EQ(part.line_of_row(1), 4);
  EXPECT_EQ(part.line_of_row(2), 7);
}

TEST_F(Rows, ARowWithoutAPartIsTold) {
  const std::string text = "unit,y\na,1\n,2\n";
  const Table table = parse_csv(text, "t.csv");
  try {
    groups_by("unit", text, table, {0, 1});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "t.csv:3: nothing in column 'unit'; expected whose row it is");
  }
}

}  // namespace
}  // namespace identikal
