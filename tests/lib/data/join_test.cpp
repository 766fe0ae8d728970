#include "lib/data/join.h"

#include <cmath>
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

class Join : public testing::Test {
 protected:
  Join() : folder_(testing::TempDir() + "/identikal_join_" + std::to_string(getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~Join() override { std::filesystem::remove_all(folder_); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ + "/" + name) << text;
    return folder_ + "/" + name;
  }
  static Joined join(const std::vector<std::string>& paths, const std::string& time = "") {
    std::vector<Table> tables;
    for (const std::string& path : paths) tables.push_back(read_csv(path));
    return join_tables(tables, {time, "", 0.0, {}});
  }
  static std::string refused(const std::vector<std::string>& paths, const std::string& time = "") {
    try {
      join(paths, time);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  std::string folder_;
};

TEST_F(Join, PutsTheOthersOnTheTimeGridOfTheFirst) {
  const std::string imu = write("imu.csv", "t,r\n0,1\n0.1,2\n0.2,3\n0.3,4\n0.4,5\n");
  const std::string can = write("can.csv", "time [ms],v\n50,10\n250,30\n350,40\n");
  const Joined joined = join({imu, can}, "t");
  EXPECT_THAT(joined.table.column_names(), ElementsAre("t", "r", "v"));
  EXPECT_THAT(joined.file, ElementsAre(0, 0, 1));
  EXPECT_EQ(joined.table.rows, 5u);
  const std::vector<double>& v = joined.table.find("v")->values;
  EXPECT_TRUE(std::isnan(v[0])) << "before its first sample";
  EXPECT_NEAR(v[1], 15.0, 1e-9);
  EXPECT_NEAR(v[2], 25.0, 1e-9);
  EXPECT_NEAR(v[3], 35.0, 1e-9);
  EXPECT_TRUE(std::isnan(v[4])) << "after its last";
  EXPECT_EQ(joined.table.find("v")->missing, 2u);
  ASSERT_EQ(joined.notes.size(), 2u);
  EXPECT_THAT(joined.notes[0], HasSubstr("imu.csv (10 Hz)"));
  EXPECT_THAT(joined.notes[1], HasSubstr("v interpolated linearly from can.csv (5 Hz)"));
  EXPECT_THAT(joined.notes[1], HasSubstr("2 of 5 rows"));
}

TEST_F(Join, OneFileAloneIsUnchanged) {
  const std::string imu = write("imu.csv", "t,r\n0,1\n0.1,2\n");
  const Joined joined = join({imu});
  EXPECT_EQ(joined.table.path, imu);
  EXPECT_TRUE(joined.notes.empty());
}

TEST_F(Join, ColumnsOfTwoFilesGetTheFilesName) {
  const std::string a = write("imu.csv", "t,speed\n0,1\n0.1,2\n0.2,3\n");
  const std::string c = write("bus.csv", "t,speed,swa\n0,1,5\n0.1,2,5\n0.2,3,6\n");
  const Joined joined = join({a, c}, "t");
  EXPECT_THAT(joined.table.column_names(), ElementsAre("t", "imu.speed", "bus.speed", "swa"));
  EXPECT_THROW(
      {
        try {
          make_dataset(joined.table, {"t", "", 0.0, {}}, {},
                       {{"v", "speed", "m/s", "m/s", {"model.yaml", 3, 4}}});
        } catch (const InputError& error) {
          EXPECT_STREQ(error.what(),
                       "model.yaml:3:4: column 'speed' is in several files; expected "
                       "'imu.speed', 'bus.speed'; write which one is meant");
          throw;
        }
      },
      InputError);
  std::filesystem::create_directories(folder_ + "/other");
  const std::string twin = write("other/imu.csv", "t,speed\n0,1\n0.1,2\n");
  EXPECT_THAT(refused({a, twin}), HasSubstr("is in two files called 'imu'"));
}

TEST_F(Join, SaysWhatCannotBeJoined) {
  const std::string a = write("a.csv", "t,r\n0,1\n0.1,2\n0.2,3\n");
  EXPECT_THAT(refused({a, write("b.csv", "x,v\n0,1\n1,2\n")}, "t"),
              testing::AllOf(HasSubstr("b.csv:1: no time column"), HasSubstr("name it 't'")));
  EXPECT_THAT(refused({a, write("c.csv", "t,v\n100,1\n101,2\n")}, "t"),
              HasSubstr("c.csv: times from 100 s to 101 s, a.csv has 0 s to 0.2 s"));
  EXPECT_THAT(refused({a, write("d.csv", "t,v\n0,1\n0,2\n")}, "t"), HasSubstr("is a duplicate"));
  EXPECT_THAT(refused({a, write("e.csv", "t,v\n0,1\n")}, "t"), HasSubstr("a single row"));
}

TEST_F(Join, ReadsTheNamesOfTheFiles) {
  const std::string a = write("a.csv", "t\n0\n"), plus = write("a+b.csv", "t\n0\n");
  EXPECT_THAT(joined_files(a + "+missing.csv"), ElementsAre(a, "missing.csv"));
  EXPECT_THAT(joined_files(plus), ElementsAre(plus));
  EXPECT_THAT(joined_files(plus + "+" + a), ElementsAre(plus, a));
  EXPECT_THROW(joined_files(a + "+"), InputError);
}

TEST_F(Join, ThreeFilesOfARealDrive) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/comma2k19_rav4_imu.csv");
  const Joined joined = join({shared_file("recordings/comma2k19_rav4_imu.csv"),
                              shared_file("recordings/comma2k19_rav4_speed.csv"),
                              shared_file("recordings/comma2k19_rav4_steer.csv")},
                             "t");
  EXPECT_EQ(joined.table.rows, 6256u);
  EXPECT_EQ(joined.table.columns.size(), 7u + 5u + 1u);
  // The second sample of the steering stands at 0.006701 s, the third at 0.023668 s, all at -0.4.
  EXPECT_NEAR(joined.table.find("steering_wheel_deg")->values[2], -0.4, 1e-12);
  EXPECT_LT(joined.table.find("speed_mps")->missing, 10u);
}

}  // namespace
}  // namespace identikal
