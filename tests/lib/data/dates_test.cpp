// Dates and times of day as logs write them, against what the calendar says of them.
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/base/error.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;

// A column 't' of these cells beside numbers.
Table of_times(const std::vector<std::string>& cells) {
  std::string text = "t;y\n";
  for (std::size_t k = 0; k < cells.size(); ++k) text += cells[k] + ";" + std::to_string(k) + "\n";
  return parse_csv(text, "log.csv");
}
Dataset measured(const Table& table, const std::string& of_time, const std::string& of_y) {
  TimeSource time;
  time.column = of_time;
  if (of_time.empty()) time.step = 1.0;
  ChannelSource y;
  y.name = "y";
  y.column = of_y;
  return make_dataset(table, time, {}, {y});
}
double seconds(const std::string& cell) {
  const Table table = of_times({cell});
  return table.columns[0].dates == Dates::none ? std::nan("") : table.columns[0].values[0];
}

// By `date -u -d ... +%s`.
TEST(Dates, AreReadAsTheyAreWritten) {
  constexpr double kNoon = 1706704205.0;  // 2024-01-31 12:30:05 UTC
  for (const char* cell :
       {"2024-01-31 12:30:05", "2024-01-31T12:30:05Z", "2024-01-31T12:30:05.000+00:00",
        "2024-01-31 14:30:05+02:00", "2024-01-31 07:00:05 -0530", "2024/01/31 12:30:05",
        "31.01.2024 12:30:05", "31-Jan-2024 12:30:05", "31/jan/2024 12:30:05", "1/31/2024 12:30:05",
        "31/1/2024 12:30:05", "1/31/2024 12:30:05 PM", "31.1.2024 12:30:05 UTC"}) {
    EXPECT_EQ(seconds(cell), kNoon) << cell;
  }
  EXPECT_EQ(seconds("2024-01-31"), 1706659200.0);
  EXPECT_EQ(seconds("2024-01-31 12:30"), 1706704200.0);
  EXPECT_EQ(seconds("2024-01-30 24:00"), 1706659200.0);
  EXPECT_EQ(seconds("2024-01-31 12:05:00 am"), 1706659500.0);
  EXPECT_EQ(seconds("1969-07-20 20:17:40"), -14182940.0);
  EXPECT_EQ(seconds("2000-02-29"), 951782400.0);
  EXPECT_EQ(seconds("1949-01"), -662688000.0);
  EXPECT_EQ(seconds("12:30:05,25"), 45005.25);
}

TEST(Dates, AreNoneWhereTheCalendarHasNone) {
  for (const char* cell :
       {"2023-02-29", "2024-13-01", "31.04.2024", "2024-01-31 25:00:00", "2024-01-31 24:00:01",
        "2024-01-31 12:60", "2024-01-31 12:30:61", "12:30", "2024-01-31x", "1.2.3", "31-Foo-2024",
        "2024-01-31 13:00 pm", "2024-01-31 12:30:05.", "2024-01-31 12:30:05+2", "+2024-01-31"}) {
    EXPECT_TRUE(std::isnan(seconds(cell))) << cell;
  }
}

// A tenth of a microsecond is beyond what a double has of seconds since 1970.
TEST(Dates, KeepEveryDigitOfTheirSteps) {
  const Table table = of_times({"2024-01-31 23:59:59.9999999", "2024-02-01 00:00:00.0000001",
                                "2024-02-01 00:00:00.0000003"});
  const std::vector<double> t = exact_stamps(table.columns[0]);
  EXPECT_NEAR(t[1], 2e-7, 1e-15);
  EXPECT_NEAR(t[2], 4e-7, 1e-15);
  EXPECT_EQ(date_text(table.columns[0], 0), "2024-01-31 23:59:59.9999999");
  EXPECT_EQ(date_text(table.columns[0], 2), "2024-02-01 00:00:00.0000003");
}

TEST(Dates, TheDaysBehindMidnightAreCounted) {
  const Table table = of_times({"23:59:58", "23:59:59", "00:00:00", "00:00:01"});
  EXPECT_EQ(table.columns[0].dates, Dates::times_of_day);
  EXPECT_EQ(exact_stamps(table.columns[0]), (std::vector<double>{0.0, 1.0, 2.0, 3.0}));
}

TEST(Dates, MonthsAreEquallyLong) {
  for (const auto& cells : {std::vector<std::string>{"1949-01", "1949-02", "1949-03", "1949-04"},
                            {"31.12.2023", "31.01.2024", "29.02.2024", "31.03.2024"}}) {
    const Table table = of_times(cells);
    EXPECT_EQ(table.columns[0].months, 1);
    EXPECT_EQ(exact_stamps(table.columns[0])[3], 3 * 2629746.0);
  }
  EXPECT_EQ(of_times({"2023-01-01", "2023-04-01", "2023-07-01"}).columns[0].months, 3);
  EXPECT_EQ(of_times({"2023-01-01", "2023-02-01", "2023-02-28"}).columns[0].months, 0);
}

// Which number is the day is told by another row, or does not matter for the steps, or is asked.
TEST(Dates, SayWhereTheDayMayBeTheMonth) {
  const Table told = of_times({"11/1/2024", "12/1/2024", "13/1/2024"});
  EXPECT_EQ(exact_stamps(told.columns[0])[2], 2 * 86400.0);
  const Table same = of_times({"3/4/2024 10:00:00", "3/4/2024 10:00:01"});
  EXPECT_EQ(exact_stamps(same.columns[0])[1], 1.0);
  const Table open = of_times({"3/4/2024", "4/4/2024", "5/4/2024"});
  EXPECT_EQ(open.columns[0].dates, Dates::ambiguous);
  EXPECT_EQ(open.columns[0].text_cells, 3u);
  try {
    measured(open, "t", "y");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("log.csv:2:1: '3/4/2024' in column 't'; expected a number"));
    EXPECT_THAT(error.what(), HasSubstr("write it as 2024-01-31"));
  }
}

TEST(Dates, ThatGoBackAreNamedAsTheyAreWritten) {
  const Table table = of_times({"2024-01-31 12:00:00", "2024-01-31 12:00:01", "2024-01-31 11:00"});
  try {
    measured(table, "t", "y");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("log.csv:4: time goes back from 2024-01-31 12:00:01 to "
                                        "2024-01-31 11:00:00"));
  }
}

TEST(Dates, OneCellOfAnotherKindMakesAColumnText) {
  for (const char* other : {"yesterday", "17", "12:00:00"}) {
    const Table table = of_times({"2024-01-31", "2024-02-01", other});
    EXPECT_EQ(table.columns[0].dates, Dates::none) << other;
    EXPECT_GE(table.columns[0].text_cells, 2u) << other;
  }
  const Table missing = of_times({"2024-01-31", "", "2024-02-01"});
  EXPECT_EQ(missing.columns[0].dates, Dates::instants);
  EXPECT_EQ(missing.columns[0].missing, 1u);
}

TEST(Dates, AreTimeStampsAndNoMeasurement) {
  const Table table = of_times({"2024-01-31 00:00", "2024-01-31 00:10", "2024-01-31 00:20"});
  const Dataset data = measured(table, "t", "y");
  EXPECT_EQ(data.dt, 600.0);
  EXPECT_EQ(data.time[0], 0.0);
  EXPECT_THAT(data.notes.front(), HasSubstr("time counts from the first stamp, 2024-01-31"));
  try {
    measured(table, "", "t");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("'2024-01-31 00:00' in column 't'; expected a number"));
    EXPECT_THAT(error.what(), HasSubstr("time: {column: t}"));
  }
}

}  // namespace
}  // namespace identikal
