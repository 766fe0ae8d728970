#include "lib/data/dataset.h"

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "lib/base/constants.h"
#include "lib/data/csv.h"
#include "lib/data/row_time.h"
#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using testing::ElementsAreArray;
using testing::HasSubstr;

Column column(const std::string& name, const std::string& unit, const std::vector<double>& values) {
  Column out;
  out.name = out.header = name;
  out.unit = unit;
  out.values = values;
  for (const double value : values) out.missing += std::isnan(value) ? 1 : 0;
  return out;
}

// A file whose header stands on line 2 and whose rows begin on line 3.
Table table(const std::vector<Column>& columns) {
  Table out;
  out.path = "runs/lane_change.csv";
  out.columns = columns;
  out.rows = columns[0].values.size();
  out.has_header = true;
  out.header_line = 2;
  out.line_runs = {{0, 3}};
  return out;
}

ChannelSource channel(const std::string& name, const std::string& in_column,
                      const std::string& unit = "", const std::string& si_unit = "") {
  return {name, in_column, unit, si_unit, {"model.yaml", 9, 5}};
}

TimeSource time_column(const std::string& name, const std::string& unit = "", double step = 0.0) {
  return {name, unit, step, {"model.yaml", 4, 7}};
}

TimeSource fixed_step(double step) { return time_column("", "", step); }

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

std::string message_of(const Table& t, const TimeSource& time,
                       const std::vector<ChannelSource>& outputs, const TimeRange& range = {}) {
  return message_of([&] { make_dataset(t, time, {}, outputs, range); });
}

std::vector<double> to_vector(const Eigen::VectorXd& v) { return {v.begin(), v.end()}; }

TEST(Dataset, PicksColumnsAndConvertsThemToSi) {
  const Table t = table({column("t", "s", {0.0, 0.1, 0.2}), column("swa", "deg", {0, 90, 180}),
                         column("speed", "", {36, 72, kNaN}), column("yaw", "", {1, 2, 3})});
  const Dataset data =
      make_dataset(t, time_column("t"),
                   {channel("steer", "swa", "", "rad"), channel("vx", "speed", "km/h", "m/s")},
                   {channel("r", "4", "", "rad/s")});
  EXPECT_EQ(data.name, "lane_change.csv");
  EXPECT_DOUBLE_EQ(data.dt, 0.1);
  EXPECT_EQ(data.size(), 3);
  ASSERT_EQ(data.u.rows(), 2);
  ASSERT_EQ(data.y.rows(), 1);
  EXPECT_DOUBLE_EQ(data.u(0, 1), 90 * kDegree);
  EXPECT_DOUBLE_EQ(data.u(1, 1), 20.0);
  EXPECT_TRUE(std::isnan(data.u(1, 2)));
  EXPECT_EQ(data.y(0, 2), 3.0);
  EXPECT_EQ(data.inputs[0].name, "steer");
  EXPECT_EQ(data.inputs[0].unit, "deg");
  EXPECT_EQ(data.inputs[1].unit, "km/h");
  EXPECT_EQ(data.outputs[0].unit, "rad/s");
}

TEST(Dataset, WorksWithoutInputsAndWithoutATimeColumn) {
  const Table t = table({column("y", "", {5, 6, 7})});
  const Dataset data = make_dataset(t, fixed_step(0.25), {}, {channel("y", "y")});
  EXPECT_EQ(data.dt, 0.25);
  EXPECT_THAT(to_vector(data.time), ElementsAreArray({0.0, 0.25, 0.5}));
  EXPECT_EQ(data.u.rows(), 0);
  EXPECT_EQ(data.u.cols(), 3);
  EXPECT_EQ(data.outputs[0].unit, "");
}

TEST(Dataset, TimeMayBeInAnyUnitOfTime) {
  struct Case {
    const char* file_unit;
    const char* model_unit;
    double seconds;
  };
  for (const Case& c : {Case{"", "", 1.0}, Case{"sec", "", 1.0}, Case{"ms", "", 1e-3},
                        Case{"", "us", 1e-6}, Case{"", "min", 60.0}, Case{"h", "h", 3600.0}}) {
    SCOPED_TRACE(c.file_unit + std::string("|") + c.model_unit);
    const Table t = table({column("t", c.file_unit, {10, 12, 14}), column("y", "", {1, 2, 3})});
    const Dataset data = make_dataset(t, time_column("t", c.model_unit), {}, {channel("y", "y")});
    EXPECT_DOUBLE_EQ(data.dt, 2 * c.seconds);
    EXPECT_DOUBLE_EQ(data.time[0], 10 * c.seconds);
  }
}

TEST(Dataset, TheMedianStepIgnoresGapsAndKeepsTheDigitsOfAnEpoch) {
  const double epoch = 1692117187.25;
  const Table t =
      table({column("t", "s", {epoch, epoch + 0.25, epoch + 0.5, epoch + 60, epoch + 60.25}),
             column("y", "", {1, 2, 3, 4, 5})});
  const Dataset data = make_dataset(t, time_column("t"), {}, {channel("y", "y")});
  EXPECT_EQ(data.dt, 0.25);
  EXPECT_EQ(data.time[0], epoch);
  EXPECT_EQ(data.time[4], epoch + 60.25);
  // Four steps: the mean of the middle two.
  const Table even = table({column("t", "s", {0, 1, 3, 7}), column("y", "", {1, 2, 3, 4})});
  EXPECT_EQ(make_dataset(even, time_column("t"), {}, {channel("y", "y")}).dt, 2.0);
  const Table odd = table({column("t", "s", {0, 1, 3}), column("y", "", {1, 2, 3})});
  EXPECT_EQ(make_dataset(odd, time_column("t"), {}, {channel("y", "y")}).dt, 1.5);
}

TEST(Dataset, AStepGivenBesideAColumnMustAgreeWithinOnePercent) {
  const Table t = table({column("t", "s", {0, 0.1005, 0.201}), column("y", "", {1, 2, 3})});
  EXPECT_EQ(make_dataset(t, time_column("t", "", 0.1), {}, {channel("y", "y")}).dt, 0.1);
  EXPECT_EQ(message_of(t, time_column("t", "", 0.102), {channel("y", "y")}),
            "model.yaml:4:7: the rows of lane_change.csv are 0.1005 s apart (median); expected "
            "0.102 s, the step "
            "of the model");
}

TEST(Dataset, ARangeCountsFromTheFirstRow) {
  const Table t = table(
      {column("t", "s", {100.0, 100.1, 100.2, 100.3, 100.4}), column("y", "", {1, 2, 3, 4, 5})});
  TimeRange range;
  range.from = 0.1;
  range.to = 0.3;
  const Dataset data = make_dataset(t, time_column("t"), {}, {channel("y", "y")}, range);
  EXPECT_THAT(to_vector(data.time), ElementsAreArray({100.1, 100.2, 100.3}));
  EXPECT_THAT(to_vector(data.y.row(0)), ElementsAreArray({2, 3, 4}));
  TimeRange open;
  open.from = 0.35;
  EXPECT_EQ(message_of(t, time_column("t"), {channel("y", "y")}, open),
            "runs/lane_change.csv:7: a single time stamp; expected at least two, to tell the step");
  open.from = 1.0;
  open.to = 2.0;
  EXPECT_EQ(message_of(t, time_column("t"), {channel("y", "y")}, open),
            "runs/lane_change.csv: no row from 1 s to 2 s; expected a range within 0 s to 0.4 s");
  const Dataset fixed = make_dataset(t, fixed_step(0.1), {}, {channel("y", "y")}, range);
  EXPECT_THAT(to_vector(fixed.y.row(0)), ElementsAreArray({2, 3, 4}));
}

TEST(Dataset, UnitsOfFileAndModelMayAgreeInOtherWords) {
  const Table t = table({column("v", "kmph", {36}), column("delta", "nonsense", {1})});
  EXPECT_DOUBLE_EQ(make_dataset(t, fixed_step(1), {}, {channel("v", "v", "km/h", "m/s")}).y(0, 0),
                   10.0);
  // The model's unit also settles what the file leaves unreadable.
  EXPECT_DOUBLE_EQ(
      make_dataset(t, fixed_step(1), {}, {channel("d", "delta", "deg", "rad")}).y(0, 0), kDegree);
}

TEST(Dataset, ConvertsTemperatures) {
  const Table t = table({column("T", "degC", {20})});
  EXPECT_DOUBLE_EQ(make_dataset(t, fixed_step(1), {}, {channel("T", "T", "", "K")}).y(0, 0),
                   293.15);
}

TEST(Dataset, SaysWhatIsWrongWithAColumn) {
  Table t = table({column("t", "s", {0, 1, 2}), column("yaw_rate", "deg/s", {1, 2, 3}),
                   column("speed", "kmhh", {1, 2, 3}), column("empty", "", {kNaN, kNaN, kNaN}),
                   column("late", "", {kNaN, kNaN, 3}), column("run", "", {kNaN, 1, 2})});
  t.columns[5].text_cells = 1;
  t.columns[5].first_text = {3, 17, "abc"};
  struct Case {
    ChannelSource source;
    std::string message;
  };
  const std::vector<Case> cases = {
      {channel("r", "yaw_rat"),
       "model.yaml:9:5: no column 'yaw_rat' in lane_change.csv; expected one of 't', 'yaw_rate', "
       "'speed', "
       "'empty', 'late', 'run'; did you mean 'yaw_rate'?"},
      {channel("r", "gyro_z_filtered"),
       "model.yaml:9:5: no column 'gyro_z_filtered' in lane_change.csv; expected one of 't', "
       "'yaw_rate', "
       "'speed', 'empty', 'late', 'run'"},
      {channel("r", "7"),
       "model.yaml:9:5: no column '7' in lane_change.csv; expected a name or 1 to 6"},
      {channel("r", "run"), "runs/lane_change.csv:3:17: 'abc' in column 'run'; expected a number"},
      {channel("r", "empty"),
       "runs/lane_change.csv:3: no number in column 'empty' from this row to line 5; expected at "
       "least one"},
      {channel("r", "yaw_rate", "degs"),
       "model.yaml:9:5: unknown unit 'degs' of column 'yaw_rate'; did you mean 'deg/s'?"},
      {channel("v", "speed"),
       "runs/lane_change.csv:2: unknown unit 'kmhh' of column 'speed'; did you mean 'km/h'? give "
       "its 'unit:' in "
       "the model file"},
      {channel("r", "yaw_rate", "rad/s"),
       "model.yaml:9:5: column 'yaw_rate' is in 'deg/s' according to lane_change.csv, in 'rad/s' "
       "according to "
       "the model; expected one unit; remove the 'unit:' here, or the unit in the file's header"},
      {channel("r", "yaw_rate", "m/s"),
       "model.yaml:9:5: column 'yaw_rate' is in 'deg/s' according to lane_change.csv, in 'm/s' "
       "according to "
       "the model; expected one unit; remove the 'unit:' here, or the unit in the file's header"},
      {channel("v", "yaw_rate", "", "m/s"),
       "model.yaml:9:5: column 'yaw_rate' is in 'deg/s', which measures something else; expected a "
       "unit of the "
       "same kind as 'm/s'"},
      {channel("v", "late", "deg", "m/s"),
       "model.yaml:9:5: column 'late' is in 'deg', which measures something else; expected a unit "
       "of the same "
       "kind as 'm/s'"},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.source.column);
    EXPECT_EQ(message_of(t, time_column("t"), {c.source}), c.message);
  }
  // A column that has numbers, but none in the range.
  TimeRange range;
  range.to = 1.0;
  EXPECT_EQ(message_of(t, time_column("t"), {channel("r", "late")}, range),
            "runs/lane_change.csv:3: no number in column 'late' from this row to line 4; expected "
            "at least one");
  // A program without a model file still learns which recording it was.
  ChannelSource bare{"r", "nothing", "", "", {}};
  EXPECT_THAT(
      message_of(t, time_column("t"), {bare}),
      testing::StartsWith("runs/lane_change.csv: no column 'nothing' in lane_change.csv; "));
  // The unit row, when there is one, is where the unit stands.
  t.unit_line = 8;
  EXPECT_THAT(message_of(t, time_column("t"), {channel("v", "speed")}),
              testing::StartsWith("runs/lane_change.csv:8: unknown unit"));
  EXPECT_THROW(make_dataset(t, time_column("t"), {}, {channel("r", "yaw_rate", "", "no unit")}),
               std::invalid_argument);
}

TEST(Dataset, ListsOnlySomeOfManyColumns) {
  std::vector<Column> columns;
  for (int j = 0; j < 500; ++j) columns.push_back(column("signal_" + std::to_string(j), "", {1.0}));
  const std::string message =
      message_of(table(columns), fixed_step(1), {channel("r", "nothing_like_it")});
  EXPECT_THAT(message, testing::EndsWith(", ... (500 columns)"));
  EXPECT_LT(message.size(), 200u);
}

TEST(Dataset, SaysWhatIsWrongWithTime) {
  const auto message = [](const std::vector<double>& t, const std::string& unit) {
    return message_of(
        table({column("t", unit, t), column("y", "", std::vector<double>(t.size(), 1.0))}),
        time_column("t"), {channel("y", "y")});
  };
  EXPECT_EQ(message({12.29, 12.3, 12.3, 12.4}, "s"),
            "runs/lane_change.csv:5: time 12.3 s is a duplicate; expected increasing time stamps; "
            "remove one of the two rows");
  EXPECT_EQ(
      message({1692117187.04, 1692117187.04}, "ms"),
      "runs/lane_change.csv:4: time 1692117187.04 ms is a duplicate; expected increasing time "
      "stamps; remove one of the two rows");
  EXPECT_EQ(message({12.2, 12.3, 0.3}, ""),
            "runs/lane_change.csv:5: time goes back from 12.3 s to 0.3 s; expected increasing time "
            "stamps; recordings joined end to end: 'runs: restart' under 'time' in the model file "
            "makes each a separate run");
  EXPECT_EQ(message({0, kNaN, 2}, "s"),
            "runs/lane_change.csv:4: no time stamp in column 't'; expected a number");
  EXPECT_EQ(message({0, 1, 2}, "m"),
            "model.yaml:4:7: column 't' is in 'm', which measures something else; expected a unit "
            "of the same kind "
            "as 's'");
  EXPECT_EQ(message({0}, "s"),
            "runs/lane_change.csv:3: a single time stamp; expected at least two, to tell the step");
  const Table t = table({column("y", "", {1, 2})});
  EXPECT_EQ(message_of(t, time_column("tme"), {channel("y", "y")}),
            "model.yaml:4:7: no column 'tme' in lane_change.csv; expected one of 'y'");
  for (const double step : {0.0, -1.0, kNaN}) {
    EXPECT_EQ(message_of(t, fixed_step(step), {channel("y", "y")}),
              "model.yaml:4:7: neither a time column nor a time step; expected one of them");
  }
  Table no_rows = table({column("y", "", {})});
  EXPECT_EQ(message_of(no_rows, fixed_step(1), {channel("y", "y")}),
            "runs/lane_change.csv: no rows; expected at least one row of numbers");
}

Dataset recording(const std::vector<double>& time) {
  Dataset data;
  data.name = "run.csv";
  data.time =
      Eigen::Map<const Eigen::VectorXd>(time.data(), static_cast<Eigen::Index>(time.size()));
  data.dt = 0.5;
  data.u = Eigen::RowVectorXd::LinSpaced(data.size(), 1.0, static_cast<double>(data.size()));
  data.y = 10.0 * data.u;
  data.inputs = {{"u", "m"}};
  data.outputs = {{"y", "m"}};
  return data;
}

TEST(Runs, BeginWhereTimeDoesNotIncrease) {
  TimeSource time;
  time.column = "t";
  time.restarts = true;
  const auto runs = [&](const std::vector<double>& stamps) {
    return split_runs(
        table({column("t", "s", stamps), column("y", "", std::vector<double>(stamps.size(), 1.0))}),
        time);
  };
  const std::vector<Table> two = runs({0, 1, 2, 0, 1});
  ASSERT_EQ(two.size(), 2u);
  EXPECT_EQ(two[0].rows, 3u);
  EXPECT_EQ(two[1].columns[0].values, (std::vector<double>{0, 1}));
  // A stamp written twice, or a row out of place, is no run.
  EXPECT_THAT(message_of([&] {
                runs({0, 1, 1, 2, 2});
              }),
              HasSubstr("a run of this row alone: the time stamp is not above the one before"));
  EXPECT_THAT(message_of([&] {
                runs({5, 0, 1});
              }),
              HasSubstr("a run of this row alone: the next time stamp is not above it"));
  EXPECT_EQ(runs({3}).size(), 1u);
}

TEST(UniformTimeGrid, AbsentRowsBecomeMissingSamples) {
  const Dataset out = on_uniform_grid(recording({7.0, 7.1, 7.4, 7.5}), 0.1);
  ASSERT_EQ(out.size(), 6);
  EXPECT_EQ(out.dt, 0.1);
  EXPECT_EQ(out.name, "run.csv");
  EXPECT_EQ(out.inputs[0].name, "u");
  EXPECT_EQ(out.outputs[0].name, "y");
  EXPECT_DOUBLE_EQ(out.time[5], 7.5);
  EXPECT_EQ(out.u(0, 1), 2.0);
  EXPECT_TRUE(std::isnan(out.u(0, 2)));
  EXPECT_TRUE(std::isnan(out.y(0, 3)));
  EXPECT_EQ(out.y(0, 4), 30.0);
  EXPECT_EQ(out.y(0, 5), 40.0);
  EXPECT_EQ(out.absent, (std::vector<Eigen::Index>{2, 3}));
  EXPECT_EQ(first_samples(out, 3).absent, std::vector<Eigen::Index>{2});
  EXPECT_EQ(samples_from(out, 3).absent, std::vector<Eigen::Index>{0});
  EXPECT_TRUE(samples_from(out, 4).absent.empty());
}

TEST(UniformTimeGrid, AWholeRecordingIsLeftAsItIs) {
  const Dataset data = recording({0.0, 0.1, 0.2, 0.3});
  const Dataset out = on_uniform_grid(data, 0.1);
  EXPECT_EQ(out.u, data.u);
  EXPECT_EQ(out.y, data.y);
  EXPECT_EQ(on_uniform_grid(recording({3.0}), 0.1).size(), 1);
}

TEST(UniformTimeGrid, AClockThatRunsSlowStaysOnTheTimeGrid) {
  std::vector<double> time;
  for (int i = 0; i < 1000; ++i) time.push_back(1692117187.0 + 0.0401 * i);
  const Dataset out = on_uniform_grid(recording(time), 0.04);
  EXPECT_EQ(out.size(), 1000);
  EXPECT_DOUBLE_EQ(out.time[999], 1692117187.0 + 0.04 * 999);
}

TEST(UniformTimeGrid, RefusesOtherTimeStamps) {
  EXPECT_EQ(message_of([] {
              on_uniform_grid(recording({0.0, 0.1, 0.25}), 0.1);
            }),
            "run.csv: time 0.25 s is 1.5 steps after the row before; expected a whole number of "
            "steps of 0.1 s; the stamps are on a grid of 0.05 s with rows absent: 'step: 0.05 s' "
            "under 'time' in the model file takes them so");
  EXPECT_THAT(message_of([] {
                on_uniform_grid(recording({0.0, 0.001}), 0.1);
              }),
              testing::HasSubstr("time 0.001 s is 0.01 steps after the row before"));
  EXPECT_EQ(on_uniform_grid(recording({0.0, 0.1, 0.26}), 0.1, 0.45).size(), 4);
  EXPECT_EQ(message_of([] {
              on_uniform_grid(recording({0.0, 1.0, 20.0}), 0.5);
            }),
            "run.csv: rows with a step of 0.5 s up to time 20 s would be more than ten times the 3 "
            "recorded; "
            "expected a recording without such gaps; choose a range without the gap");
  EXPECT_THAT(message_of([] {
                on_uniform_grid(recording({0.0, 1.0, 1e300}), 1.0);
              }),
              testing::HasSubstr("more than ten times the 3 recorded"));
  for (const double step : {0.0, -0.1, kNaN, std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(on_uniform_grid(recording({0.0, 0.1}), step), std::invalid_argument);
  }
}

// --- Recordings as others write them ---

TEST(Dataset, ReadsARecordingWithUnitsInItsHeader) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/cobb_sim_marc2.txt");
  const Table t = read_csv(shared_file("recordings/cobb_sim_marc2.txt"));
  const Dataset data =
      make_dataset(t, time_column("TIME"),
                   {channel("steer", "STEER", "", "rad"), channel("vx", "SPEED", "", "m/s")},
                   {channel("r", "YAWVEL", "", "rad/s")});
  EXPECT_EQ(data.size(), 4097);
  EXPECT_NEAR(data.dt, 0.01, 1e-12);
  EXPECT_DOUBLE_EQ(data.u(1, 0), 100.0 / 3.6);
  EXPECT_EQ(on_uniform_grid(data, 0.01).size(), 4097);
}

TEST(Dataset, ReadsARecordingInEpochTime) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/iac_av21_Putnam_park2023_run4_2.csv");
  const Table t = read_csv(shared_file("recordings/iac_av21_Putnam_park2023_run4_2.csv"));
  const Dataset data =
      make_dataset(t, time_column("time", "", 0.04), {channel("delta", "delta", "", "rad")},
                   {channel("r", "omega", "", "rad/s"), channel("v", "wheel_rl", "km/h", "m/s")});
  EXPECT_EQ(data.size(), 11900);
  EXPECT_EQ(data.dt, 0.04);
  EXPECT_EQ(data.time[0], 1692117187.46380758);
  EXPECT_DOUBLE_EQ(data.y(1, 11899), 79.05504085 / 3.6);
  EXPECT_EQ(on_uniform_grid(data, 0.04).size(), 11900);
}

// Doubles are 256 ns apart there.
TEST(Dataset, CountsNanosecondsOfAnEpochFromTheFirst) {
  for (const long step : {10'000'000L, 1'000'000L, 100'000L, 10'000L, 100L}) {
    std::string text = "t,y\n";
    for (long k = 0; k < 200; ++k) {
      text += std::to_string(1'790'000'000'000'000'123L + k * step) + "," + std::to_string(k % 7) +
              "\n";
    }
    const Dataset data =
        make_dataset(parse_csv(text, "epoch.csv"), time_column("t", "ns"), {}, {channel("y", "y")});
    EXPECT_DOUBLE_EQ(data.dt, 1e-9 * static_cast<double>(step));
    EXPECT_EQ(data.time[0], 0.0);
    EXPECT_DOUBLE_EQ(data.time[199], 199e-9 * static_cast<double>(step));
    EXPECT_EQ(on_uniform_grid(data, data.dt).size(), 200);
    ASSERT_EQ(data.notes.size(), 1);
    EXPECT_THAT(data.notes[0], HasSubstr("the first stamp, 1790000000000000123"));
  }
}

TEST(Dataset, RefusesRunsJoinedInOneFile) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/polaris_circle_timeseries.csv");
  const Table t = read_csv(shared_file("recordings/polaris_circle_timeseries.csv"));
  EXPECT_THAT(message_of(t, time_column("t"), {channel("r", "yaw_rate_rps", "rad/s")}),
              testing::AllOf(testing::HasSubstr("polaris_circle_timeseries.csv:"),
                             testing::HasSubstr(": time goes back from ")));
  EXPECT_THAT(
      message_of(t, fixed_step(0.02), {channel("run", "run")}),
      testing::HasSubstr("polaris_circle_timeseries.csv:2:1: 'lateral180deg_25ms' in column 'run'; "
                         "expected a number"));
}

TEST(Dataset, RowsOfOneTimeAreReplicates) {
  const Table log =
      table({column("t", "s", {0, 1, 1, 1, 2, 4, 4}), column("y", "", {1, 2, 3, 4, 5, 6, 7})});
  TimeSource time = time_column("t");
  EXPECT_THROW(make_dataset(log, time, {}, {channel("y", "y")}), InputError);
  time.replicates = true;
  const Dataset data = make_dataset(log, time, {}, {channel("y", "y")});
  EXPECT_EQ(data.dt, 1.0);
  EXPECT_THAT(data.stamps, ElementsAreArray({0.0, 1.0, 1.0, 1.0, 2.0, 4.0, 4.0}));
  for (Eigen::Index k = 1; k < data.size(); ++k) EXPECT_GT(data.time[k], data.time[k - 1]);
  EXPECT_LT((data.time - data.stamps).cwiseAbs().maxCoeff(), 1e-8);
  EXPECT_THAT(data.y.reshaped(), ElementsAreArray({1, 2, 3, 4, 5, 6, 7}));
  ASSERT_EQ(data.notes.size(), 1u);
  EXPECT_THAT(data.notes[0], HasSubstr("3 rows have the time of the row before"));
  const Table at_once = table({column("t", "s", {2, 2, 2}), column("y", "", {1, 2, 3})});
  EXPECT_THROW(make_dataset(at_once, time, {}, {channel("y", "y")}), InputError);
  ChannelSource late = channel("y", "y");
  late.delay = 0.5;
  EXPECT_THROW(make_dataset(log, time, {}, {late}), InputError);
}

// As seconds they would be years apart.
TEST(Dataset, RefusesTimeThatIsNotInSecondsWithoutItsUnit) {
  const auto read = [](const char* name, double first, double step, const char* unit) {
    const Table log = table(
        {column(name, "", {first, first + step, first + 2 * step}), column("y", "", {1, 2, 3})});
    return make_dataset(log, time_column(name, unit), {}, {channel("y", "y")}).dt;
  };
  EXPECT_EQ(read("t", 1.7e9, 0.5, ""), 0.5);
  EXPECT_EQ(read("t_s", 0.0, 0.5, ""), 0.5);
  for (const auto& [name, first, unit] : {std::tuple{"timestamp", 1.7e12, "ms"},
                                          {"t", 1.7e15, "us"},
                                          {"time", 1.7e18, "ns"},
                                          {"t_ms", 0.0, "ms"}}) {
    EXPECT_GT(read(name, first, 1024.0, "s"), 1000.0);
    EXPECT_LT(read(name, first, 1024.0, unit), 1.1);
    try {
      read(name, first, 1024.0, "");
      ADD_FAILURE() << name;
    } catch (const InputError& e) {
      EXPECT_THAT(e.what(), HasSubstr(std::string("'unit: ") + unit + "'"));
    }
  }
}

// Of an epoch the next number is far away.
TEST(Dataset, ReplicatesOfAnEpochRise) {
  const Table log = table(
      {column("t", "s", {1.7e9, 1.7e9 + 1, 1.7e9 + 1, 1.7e9 + 2}), column("y", "", {1, 2, 3, 4})});
  TimeSource time = time_column("t");
  time.replicates = true;
  const Dataset data = make_dataset(log, time, {}, {channel("y", "y")});
  for (Eigen::Index k = 1; k < data.size(); ++k) EXPECT_GT(data.time[k], data.time[k - 1]);
}

TEST(Dataset, ScaleOffsetAndDelayOfAChannel) {
  const Table t = table(
      {column("t", "s", {0, 0.1, 0.2, 0.3, 0.4}), column("ay", "g", {0, 0.1, 0.2, kNaN, 0.4})});
  ChannelSource source = channel("ay", "ay", "g", "m/s^2");
  const Dataset plain = make_dataset(t, time_column("t"), {}, {source});
  EXPECT_TRUE(plain.notes.empty());
  source.scale = -1.0;
  source.offset = 0.5;
  const Dataset turned = make_dataset(t, time_column("t"), {}, {source});
  EXPECT_DOUBLE_EQ(turned.y(0, 1), 9.80665 * 0.4);
  EXPECT_TRUE(std::isnan(turned.y(0, 3)));
  EXPECT_THAT(turned.notes, testing::ElementsAre("ay is column 'ay' times -1 plus 0.5 g"));
  source = channel("ay", "ay", "g", "m/s^2");
  source.delay = 0.15;
  const Dataset early = make_dataset(t, time_column("t"), {}, {source});
  EXPECT_NEAR(early.y(0, 0), 9.80665 * 0.15, 1e-12);
  EXPECT_NEAR(early.y(0, 1), 9.80665 * 0.25, 1e-12) << "across the missing sample";
  EXPECT_NEAR(early.y(0, 2), 9.80665 * 0.35, 1e-12);
  EXPECT_TRUE(std::isnan(early.y(0, 3))) << "nothing was recorded 0.15 s later";
  EXPECT_THAT(early.notes,
              testing::ElementsAre("ay is column 'ay' 0.15 s earlier, interpolated linearly"));
  EXPECT_EQ(on_uniform_grid(early, 0.1).notes, early.notes);
  // Rows outside the range are known all the same.
  TimeRange range;
  range.to = 0.1;
  EXPECT_NEAR(make_dataset(t, time_column("t"), {}, {source}, range).y(0, 1), 9.80665 * 0.25,
              1e-12);
  source.delay = -0.1;
  const Dataset late = make_dataset(t, time_column("t"), {}, {source});
  EXPECT_TRUE(std::isnan(late.y(0, 0)));
  EXPECT_NEAR(late.y(0, 2), 9.80665 * 0.1, 1e-12);
  source.delay = 10.0;
  EXPECT_EQ(message_of(t, time_column("t"), {source}),
            "model.yaml:9:5: no number of column 'ay' is left after a delay of 10 s; expected a "
            "delay shorter than the recording");
}

// Stamps of 0.2 s and 0.3 s are a grid of 0.1 s with rows absent, for who allows it; 0.2 s
// throughout are a grid of their own, and a step that fits neither is refused.
TEST(AbsentRows, OfAGridFinerThanTheMedian) {
  const auto dataset = [](const std::string& times, bool rows_absent) {
    TimeSource time;
    time.column = "t";
    time.step = 0.1;
    time.rows_absent = rows_absent;
    std::string text = "t,y\n";
    std::istringstream in(times);
    for (std::string t; in >> t;) text += t + "," + t + "\n";
    ChannelSource y;
    y.name = y.column = "y";
    return make_dataset(parse_csv(text, "grid.csv"), time, {}, {y});
  };
  const Dataset data = dataset("0 0.2 0.5 0.7 1.0", true);
  EXPECT_DOUBLE_EQ(data.dt, 0.1);
  const Dataset grid = on_uniform_grid(data, data.dt);
  EXPECT_EQ(grid.size(), 11);
  EXPECT_EQ(grid.absent.size(), 6u);
  EXPECT_DOUBLE_EQ(grid.y(0, 5), 0.5);
  EXPECT_TRUE(std::isnan(grid.y(0, 6)));
  EXPECT_THROW(dataset("0 0.2 0.5 0.7 1.0", false), InputError);
  EXPECT_THROW(dataset("0 0.2 0.4 0.6 0.8", true), InputError);
  EXPECT_THROW(dataset("0 0.2 0.5 0.74 1.0", true), InputError);
  // Without a step the message names the grid.
  Dataset no_step = data;
  try {
    on_uniform_grid(no_step, 0.25);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("'step: 0.1 s'"), std::string::npos) << error.what();
  }
}

TEST(Dataset, TheTimeOfARowIsToldFromThatOfTheNext) {
  Dataset data;
  data.dt = 0.02;
  data.time.setLinSpaced(3, 262929.0, 262929.04);
  EXPECT_EQ(row_time(data, 1), "262929.02 s");
  data.time = data.time.array() - 262929.0;
  EXPECT_EQ(row_time(data, 2), "0.04 s");
}

}  // namespace
}  // namespace identikal
