#include "identify/survey/survey.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "identify/model/model_file.h"
#include "identify/report/survey_text.h"
#include "identify/simulation/simulate.h"
#include "identify/survey/columns.h"
#include "lib/base/constants.h"
#include "lib/base/random.h"
#include "tests/support/shared_data.h"
#include "tests/support/vehicle_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
using ::testing::HasSubstr;
using Codes = std::set<std::string>;

const Finding* finding_of(const VehicleSurvey& survey, const std::string& code) {
  for (const Finding& w : survey.findings) {
    if (name_of(w) == code) return &w;
  }
  return nullptr;
}

// Codes of the findings that claim a mistake; notes do not.
Codes alarms(const VehicleSurvey& survey) {
  Codes out;
  for (const Finding& w : survey.findings) {
    if (w.severity != Severity::note) out.insert(name_of(w));
  }
  return out;
}

std::string answer(const VehicleSurvey& survey, const std::string& of) {
  for (const VehicleSurvey::Verdict& v : survey.identifiable) {
    if (v.of == of) return v.answer;
  }
  return "";
}

VehicleSurvey::Proposal proposal(const VehicleSurvey& survey, const std::string& name) {
  for (const VehicleSurvey::Proposal& p : survey.mapping) {
    if (p.name == name) return p;
  }
  return {};
}

const VehicleSurvey::Relation* relation(const VehicleSurvey& survey, const std::string& expected) {
  for (const VehicleSurvey::Relation& r : survey.relations) {
    if (r.expected == expected) return &r;
  }
  return nullptr;
}

// --- Simulated: the thesis' car, all that a fit may be given, spoilt one way at a time ---

const std::vector<std::string> kAll = {"r", "vy", "ay", "beta"};
enum Output { kRowR, kVy, kAy, kBeta };

// Steering in three tones, speed between 10 and 25 m/s.
Dataset drive_around(std::uint64_t seed = 1, const std::vector<std::string>& outputs = kAll) {
  const auto wheel = [](double t) {
    return 0.5 * std::sin(1.1 * t) + 0.35 * std::sin(2.7 * t + 1.0) + 0.2 * std::sin(7.3 * t);
  };
  const auto speed = [](double t) { return 17.0 + 7.0 * std::sin(0.21 * t); };
  Dataset data = testing::record({}, testing::uniform_time(40.0, 100.0), outputs, wheel, speed);
  std::vector<double> sd;
  for (const std::string& name : outputs) {
    sd.push_back(name == "r" ? 0.005 : name == "vy" ? 0.03 : name == "ay" ? 0.1 : 0.002);
  }
  return testing::with_noise(std::move(data), sd, seed);
}

VehicleSurvey surveyed(const Dataset& data, const std::vector<std::string>& outputs = kAll) {
  return survey(vehicle_signals(testing::sladka2010_model(outputs), data));
}

VehicleSurvey surveyed_when(const std::function<void(Dataset&)>& spoil) {
  Dataset data = drive_around();
  spoil(data);
  return surveyed(data);
}

TEST(VehicleSurvey, ACleanDriveRaisesNothing) {
  const VehicleSurvey s = surveyed(drive_around());
  EXPECT_EQ(alarms(s), Codes{});
  EXPECT_EQ(answer(s, "Cf, Cr"), "yes");
  EXPECT_EQ(answer(s, "Iz"), "yes");
  EXPECT_EQ(answer(s, "steering_ratio"), "yes");
  EXPECT_GT(relation(s, "vx r")->correlation, 0.99);
  EXPECT_NEAR(relation(s, "vx r")->lag, 0.0, 0.02);
  EXPECT_GT(relation(s, "ay - vx r")->correlation, 0.5);
  EXPECT_NEAR(s.left, 0.5, 0.1);
  EXPECT_EQ(s.standstill, 0.0);
}

TEST(VehicleSurvey, WrongSigns) {
  const VehicleSurvey ay = surveyed_when([](Dataset& d) { d.y.row(kAy) *= -1.0; });
  EXPECT_EQ(alarms(ay), Codes{"sign_ay"});
  EXPECT_EQ(proposal(ay, "ay").scale, -1.0);
  const VehicleSurvey r = surveyed_when([](Dataset& d) { d.y.row(kRowR) *= -1.0; });
  EXPECT_EQ(alarms(r), Codes{"sign_r"});
  EXPECT_EQ(proposal(r, "r").scale, -1.0);
  const VehicleSurvey steering = surveyed_when([](Dataset& d) { d.u.row(0) *= -1.0; });
  EXPECT_EQ(alarms(steering), Codes{"sign_steering"});
  EXPECT_EQ(proposal(steering, "steering_wheel_angle").scale, -1.0);
  // Axes to the right and down: sideslip shows that it is r and ay that are mirrored.
  const VehicleSurvey down = surveyed_when([](Dataset& d) {
    d.y.row(kRowR) *= -1.0;
    d.y.row(kAy) *= -1.0;
  });
  EXPECT_EQ(alarms(down), Codes{"sign_steering"});
  EXPECT_EQ(proposal(down, "r").scale, -1.0);
  EXPECT_EQ(proposal(down, "ay").scale, -1.0);
  EXPECT_EQ(proposal(down, "steering_wheel_angle").scale, 1.0);
  const VehicleSurvey vy = surveyed_when([](Dataset& d) { d.y.row(kVy) *= -1.0; });
  EXPECT_EQ(alarms(vy), Codes{"sign_vy"});
}

TEST(VehicleSurvey, WrongUnits) {
  const VehicleSurvey g = surveyed_when([](Dataset& d) { d.y.row(kAy) /= 9.80665; });
  EXPECT_EQ(alarms(g), Codes{"units_ay"});
  EXPECT_THAT(finding_of(g, "units_ay")->remedy, HasSubstr("ay is in g, taken as m/s^2"));
  const VehicleSurvey deg = surveyed_when([](Dataset& d) { d.y.row(kRowR) *= 57.29578; });
  EXPECT_TRUE(alarms(deg).contains("units_ay"));
  EXPECT_THAT(finding_of(deg, "units_ay")->remedy, HasSubstr("r is in deg/s, taken as rad/s"));
  const VehicleSurvey kmh = surveyed_when([](Dataset& d) { d.u.row(1) *= 3.6; });
  EXPECT_THAT(finding_of(kmh, "units_ay")->remedy, HasSubstr("vx is in km/h, taken as m/s"));
  const VehicleSurvey steering = surveyed_when([](Dataset& d) { d.u.row(0) *= 57.29578; });
  EXPECT_EQ(alarms(steering), Codes{"units_steering"});
  EXPECT_THAT(finding_of(steering, "units_steering")->remedy,
              HasSubstr("a steering-wheel angle in deg, taken as rad"));
  const VehicleSurvey road = surveyed_when([](Dataset& d) { d.u.row(0) /= 21.0; });
  EXPECT_THAT(finding_of(road, "units_steering")->remedy, HasSubstr("an angle of the road wheels"));
}

TEST(VehicleSurvey, SwappedChannels) {
  const VehicleSurvey swapped = surveyed_when([](Dataset& d) {
    const Eigen::RowVectorXd r = d.y.row(kRowR);
    d.y.row(kRowR) = d.y.row(kAy);
    d.y.row(kAy) = r;
  });
  EXPECT_TRUE(alarms(swapped).contains("swapped_channels"));
  EXPECT_THAT(finding_of(swapped, "swapped_channels")->text, HasSubstr("'r' behaves like ay"));
  const VehicleSurvey sideways = surveyed_when([](Dataset& d) {
    const Eigen::RowVectorXd vx = d.u.row(1);
    d.u.row(1) = d.y.row(kVy).array() + 1.6;
    d.y.row(kVy) = vx;
  });
  EXPECT_TRUE(alarms(sideways).contains("swapped_channels"));
}

// The yaw rate stands in the column of vy, and vy in that of the yaw rate.
TEST(VehicleSurvey, YawRateAndLateralVelocityExchanged) {
  const VehicleSurvey swapped = surveyed_when([](Dataset& d) {
    const Eigen::RowVectorXd r = d.y.row(kRowR);
    d.y.row(kRowR) = d.y.row(kVy);
    d.y.row(kVy) = r;
  });
  const Finding* found = finding_of(swapped, "swapped_channels");
  ASSERT_NE(found, nullptr);
  EXPECT_EQ(found->about, (std::vector<std::string>{"r", "vy"}));
  EXPECT_THAT(found->text, HasSubstr("'vy' behaves like r"));
  EXPECT_FALSE(alarms(swapped).contains("units_ay"));
  EXPECT_FALSE(alarms(swapped).contains("sign_r"));
}

// Two rows of three have no yaw rate: nothing is held.
TEST(VehicleSurvey, EmptyCellsAreNoHeldSamples) {
  const VehicleSurvey s = surveyed_when([](Dataset& d) {
    for (Index i = 0; i < d.size(); ++i) {
      if (i % 3 != 0) d.y(kRowR, i) = kNaN;
    }
  });
  EXPECT_EQ(alarms(s), Codes{});
  for (const VehicleSurvey::Signal& x : s.signals) EXPECT_EQ(x.held, 0.0) << x.column;
  // Held at 10 Hz, and every second cell of that empty: four samples of five repeat the one before.
  const VehicleSurvey held = surveyed_when([](Dataset& d) {
    for (Index i = 0; i < d.size(); ++i) {
      d.y(kRowR, i) = i % 2 == 0 ? d.y(kRowR, i - i % 10) : kNaN;
    }
  });
  EXPECT_THAT(finding_of(held, "held_samples")->text, HasSubstr("80 %"));
}

// Whatever is missing, dead or too short, no text holds a number that is none.
TEST(VehicleSurvey, TextsHoldNumbers) {
  const auto check = [](const VehicleSurvey& s, const char* what) {
    const std::string text = survey_text(s);
    for (const char* none : {"nan", " inf", "-inf", "e+2"}) {
      EXPECT_EQ(text.find(none), std::string::npos) << what << "\n" << text;
    }
  };
  check(surveyed_when([](Dataset& d) { d.u.row(0).setZero(); }), "no steering");
  check(surveyed_when([](Dataset& d) { d.u.row(1).setZero(); }), "no speed");
  check(surveyed_when([](Dataset& d) { d.u.row(1).setConstant(-20.0); }), "backwards");
  for (const Index row : {kRowR, kVy, kAy, kBeta}) {
    check(surveyed_when([&](Dataset& d) { d.y.row(row).setZero(); }), "dead");
    check(surveyed_when([&](Dataset& d) { d.y.row(row).setConstant(kNaN); }), "empty");
    check(surveyed_when([&](Dataset& d) { d.y.row(row).tail(3990).setZero(); }), "dies");
  }
  check(surveyed_when([](Dataset& d) { d.u.row(0).tail(3990).setZero(); }), "steers at first");
  check(surveyed_when([](Dataset& d) { d.y.topRows(3).setZero(); }), "straight on");
  for (const Index rows : {1, 2, 41, 60, 300}) {
    check(surveyed(first_samples(drive_around(), rows)), "short");
  }
  // 10 s at 5 Hz: driven, but too few samples for a spectrum.
  const Dataset slow = testing::record(
      {}, testing::uniform_time(10.0, 5.0), kAll, [](double t) { return std::sin(t); },
      [](double) { return 20.0; });
  check(surveyed(slow), "10 s at 5 Hz");
  check(survey({}), "nothing");
}

// Shifts a row by whole samples: what is recorded at t was there at t - seconds.
void come_late(Dataset& d, Eigen::MatrixXd& values, Index row, double seconds) {
  const VectorXd x = values.row(row).transpose();
  const auto shift = static_cast<Index>(std::lround(seconds / d.dt));
  for (Index i = 0; i < x.size(); ++i) {
    const Index from = i - shift;
    values(row, i) = from >= 0 && from < x.size() ? x[from] : kNaN;
  }
}

TEST(VehicleSurvey, ClocksApart) {
  for (const double late : {-0.74, 0.4, 1.3}) {
    const VehicleSurvey s = surveyed_when([&](Dataset& d) { come_late(d, d.u, 0, late); });
    EXPECT_EQ(alarms(s), Codes{"clock_offset"}) << late;
    EXPECT_NEAR(proposal(s, "steering_wheel_angle").delay, late, 0.1);
  }
  for (const double late : {-0.5, 0.3}) {
    const VehicleSurvey s = surveyed_when([&](Dataset& d) { come_late(d, d.y, kAy, late); });
    EXPECT_EQ(alarms(s), Codes{"clock_offset"}) << late;
    EXPECT_NEAR(proposal(s, "ay").delay, late, 0.05);
  }
  // A delay of a tenth of a second is a car's, or an actuator's: nothing for a survey.
  EXPECT_EQ(alarms(surveyed_when([&](Dataset& d) { come_late(d, d.u, 0, 0.05); })), Codes{});
}

// What the model file does already stays, and what is found comes on top.
TEST(VehicleSurvey, TheMappingOfTheModelFileIsTheStart) {
  Dataset data = drive_around();
  come_late(data, data.u, 0, 0.4);
  data.y.row(kAy) *= -1.0;
  Model model = testing::sladka2010_model(kAll);
  model.inputs[0].delay = 0.3;
  model.outputs[kAy].scale = -2.0;
  model.outputs[kAy].offset = 0.5;
  const VehicleSurvey s = survey(vehicle_signals(model, data));
  EXPECT_NEAR(proposal(s, "steering_wheel_angle").delay, 0.7, 0.1);
  EXPECT_EQ(proposal(s, "ay").scale, 2.0);
  EXPECT_EQ(proposal(s, "ay").offset, -0.5);
}

TEST(VehicleSurvey, OnlyTheRangeCounts) {
  const VehicleSignals all = vehicle_signals(testing::sladka2010_model(kAll), drive_around());
  TimeRange range;
  range.from = 10.0;
  range.to = 30.0;
  EXPECT_NEAR(survey(within(all, range)).duration, 20.0, 0.05);
  range.from = 100.0;
  range.to = 110.0;
  EXPECT_TRUE(alarms(survey(within(all, range))).contains("too_short"));
}

TEST(VehicleSurvey, SensorsThatFail) {
  const VehicleSurvey dead = surveyed_when([](Dataset& d) { d.y.row(kAy).setConstant(0.3); });
  EXPECT_EQ(alarms(dead), Codes{"dead_channel"});
  const VehicleSurvey empty = surveyed_when([](Dataset& d) { d.y.row(kVy).setConstant(kNaN); });
  EXPECT_TRUE(alarms(empty).contains("dead_channel"));
  const VehicleSurvey stuck = surveyed_when([](Dataset& d) {
    for (Index i = 1500; i < 2100; ++i) d.y(kRowR, i) = d.y(kRowR, 1500);
  });
  EXPECT_EQ(alarms(stuck), Codes{"stuck_channel"});
  EXPECT_THAT(finding_of(stuck, "stuck_channel")->text, HasSubstr("from 15 s"));
  const VehicleSurvey held = surveyed_when([](Dataset& d) {
    for (Index i = 0; i < d.size(); ++i) d.y(kRowR, i) = d.y(kRowR, i - i % 10);
  });
  EXPECT_EQ(alarms(held), Codes{"held_samples"});
  EXPECT_THAT(finding_of(held, "held_samples")->text, HasSubstr("90 %"));
  const VehicleSurvey spikes = surveyed_when([](Dataset& d) {
    for (Index i = 500; i < 3000; i += 500) d.y(kRowR, i) += 3.0;
  });
  EXPECT_EQ(alarms(spikes), Codes{"outliers"});
  EXPECT_THAT(finding_of(spikes, "outliers")->text, HasSubstr("5 samples of 'r' leap"));
}

TEST(VehicleSurvey, DrivesThatTellLittle) {
  const VehicleSurvey straight = surveyed_when([](Dataset& d) { d.u.row(0).setConstant(0.01); });
  EXPECT_TRUE(alarms(straight).contains("no_steering"));
  EXPECT_EQ(answer(straight, "Cf, Cr"), "no");
  const VehicleSurvey back =
      surveyed_when([](Dataset& d) { d.u.block(1, 0, 1, 400).setConstant(-2); });
  EXPECT_TRUE(alarms(back).contains("reversing"));
  EXPECT_NEAR(back.reversing, 0.1, 0.01);
  const VehicleSurvey still = surveyed_when([](Dataset& d) { d.u.block(1, 0, 1, 2000).setZero(); });
  ASSERT_NE(finding_of(still, "standstill"), nullptr);
  EXPECT_NEAR(still.standstill, 0.5, 0.01);
  const VehicleSurvey parked = surveyed_when([](Dataset& d) { d.u.row(1).setZero(); });
  EXPECT_TRUE(alarms(parked).contains("too_short"));
  for (const Index rows : {1, 2, 5, 100}) {
    const VehicleSurvey s = surveyed(first_samples(drive_around(), rows));
    EXPECT_TRUE(alarms(s).contains("too_short")) << rows;
    EXPECT_EQ(answer(s, "Cf, Cr"), "no");
    EXPECT_FALSE(survey_text(s).empty());
  }
  const VehicleSurvey nothing = survey({});
  EXPECT_TRUE(alarms(nothing).contains("no_steering"));
  EXPECT_TRUE(alarms(nothing).contains("too_short"));
}

TEST(VehicleSurvey, YawRateAloneAtOneSpeed) {
  const auto at = [](double frequency) {
    Dataset data = testing::record(
        {}, testing::uniform_time(40.0, 100.0), {"r"},
        [=](double t) { return 0.6 * std::sin(frequency * t) + 0.1 * std::sin(0.7 * t); },
        [](double) { return 20.0; });
    return surveyed(testing::with_noise(std::move(data), {0.003}, 4), {"r"});
  };
  EXPECT_EQ(answer(at(2.0), "Iz"), "no");
  EXPECT_EQ(answer(at(2.0), "Cf, Cr"), "combination");
  EXPECT_EQ(answer(at(12.0), "Iz"), "poorly");
  EXPECT_EQ(answer(at(12.0), "steering_ratio"), "no");
}

TEST(VehicleSurvey, SteadyCirclesTellTwoProductsOnly) {
  Dataset data = testing::record(
      {}, testing::uniform_time(60.0, 50.0), {"r", "ay"},
      [](double t) { return t < 30.0 ? 1.5 : -1.5; },
      [](double t) { return 5.0 + 0.25 * std::fmod(t, 30.0); });
  const VehicleSurvey s =
      surveyed(testing::with_noise(std::move(data), {0.003, 0.05}, 4), {"r", "ay"});
  EXPECT_EQ(alarms(s), Codes{});
  EXPECT_EQ(answer(s, "Cf, Cr"), "combination");
  EXPECT_EQ(answer(s, "Iz"), "no");
}

// 200 drives, 200 severe lane changes at 10 to 200 Hz, 200 as `simulate` writes them: no alarm at
// all, so that the rate is below 1.5 % each (95 %).
TEST(VehicleSurvey, FalseAlarmsOnCleanData) {
  int drives = 0, lane_changes = 0, bare = 0;
  constexpr double rates[] = {10.0, 20.0, 50.0, 200.0};
  const Model model =
      read_model_file(std::string(IDENTIKAL_SOURCE_DIR) + "/examples/severe_lane_change.yaml");
  const std::string path =
      ::testing::TempDir() + "/identikal_survey_" + std::to_string(getpid()) + ".csv";
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    drives += alarms(surveyed(drive_around(seed))).empty() ? 0 : 1;
    const Dataset change = testing::with_noise(testing::lane_change({}, rates[seed % 4], kAll),
                                               {0.01, 0.03, 0.2, 0.005}, seed);
    lane_changes += alarms(surveyed(change)).empty() ? 0 : 1;
    std::FILE* file = std::fopen(path.c_str(), "w");
    ASSERT_NE(file, nullptr);
    std::fputs(simulate_vehicle(model, {}, nullptr, std::nullopt, seed).csv.c_str(), file);
    std::fclose(file);
    bare += alarms(survey(guess_vehicle({read_csv(path)}))).empty() ? 0 : 1;
  }
  std::remove(path.c_str());
  std::printf("false alarms of 200: drives %d, lane changes with all outputs %d, as simulated %d\n",
              drives, lane_changes, bare);
  EXPECT_EQ(drives, 0);
  EXPECT_EQ(lane_changes, 0);
  EXPECT_EQ(bare, 0);
}

// --- Columns ---

Table table_of(const std::vector<std::pair<std::string, VectorXd>>& columns) {
  Table out;
  out.path = "log.csv";
  for (const auto& [name, values] : columns) {
    Column c;
    c.name = c.header = name;
    c.values.assign(values.begin(), values.end());
    out.columns.push_back(c);
  }
  out.rows = out.columns[0].values.size();
  out.has_header = true;
  out.header_line = 1;
  out.line_runs = {{0, 2}};
  return out;
}

TEST(VehicleColumns, NamesThatSayNothingAreToldByKinematics) {
  const Dataset d = drive_around();
  const VehicleSignals s =
      guess_vehicle({table_of({{"t", d.time},
                               {"ch1", d.y.row(kAy).transpose() / 9.80665},
                               {"ch2", d.u.row(0).transpose() * 57.29578},
                               {"ch3", d.u.row(1).transpose() * 3.6},
                               {"ch4", d.y.row(kRowR).transpose() * 57.29578}})});
  std::map<std::string, std::string> found;
  for (const VehicleSignal& x : s.signals) found[x.column] = to_string(x.kind) + " " + x.unit;
  EXPECT_EQ(found["ch1"], "ay g");
  EXPECT_EQ(found["ch2"], "steering deg");
  EXPECT_EQ(found["ch3"], "vx km/h");
  EXPECT_EQ(found["ch4"], "r deg/s");
  EXPECT_EQ(alarms(survey(s)), Codes{});
}

TEST(VehicleColumns, FilesWithoutTimeOrRowsAreNamed) {
  const VehicleSignals s =
      guess_vehicle({table_of({{"r", VectorXd::Ones(3)}, {"vx", VectorXd::Ones(3)}})});
  EXPECT_TRUE(s.signals.empty());
  EXPECT_TRUE(alarms(survey(s)).contains("no_time"));
  const VehicleSurvey one = survey(
      guess_vehicle({table_of({{"t", VectorXd::Zero(1)}, {"yaw_rate", VectorXd::Ones(1)}})}));
  EXPECT_TRUE(alarms(one).contains("no_time"));
}

TEST(VehicleColumns, TimeIsKnownByItsNameAndUnit) {
  const Dataset d = drive_around();
  struct Case {
    const char *name, *unit;
    double per_second;
    const char* expected;
  };
  for (const Case& c : {Case{"t_s", "", 1.0, "s"}, Case{"t_ms", "", 1e3, "ms"},
                        Case{"Time", "GPS ns", 1e9, "ns"}, Case{"t", "min", 1.0 / 60.0, "min"},
                        Case{"INS_time_sec", "", 1.0, "sec"}, Case{"time", "UTC", 1.0, "s"}}) {
    Table table = table_of({{c.name, d.time * c.per_second},
                            {"swa_deg", d.u.row(0).transpose() * 57.29578},
                            {"vx", d.u.row(1).transpose()},
                            {"rate_hor_z_dps", d.y.row(kRowR).transpose() * 57.29578}});
    table.columns[0].unit = c.unit;
    const VehicleSignals s = guess_vehicle({table});
    EXPECT_EQ(s.time_column, c.name);
    EXPECT_EQ(s.time_unit, c.expected);
    const VehicleSurvey found = survey(s);
    EXPECT_EQ(alarms(found), Codes{}) << c.name;
    EXPECT_EQ(proposal(found, "r").column, "rate_hor_z_dps");
    EXPECT_EQ(proposal(found, "r").unit, "deg/s");
  }
  for (const char* name : {"T", "t_max", "torque", "t_front"}) {
    Column column;
    column.name = name;
    EXPECT_EQ(looks_like_time(column), std::string(name) == "T") << name;
  }
}

TEST(VehicleColumns, EqualTimeStampsAreNoRuns) {
  const Dataset d = drive_around();
  VectorXd time = d.time;
  for (const Index row : {500, 1200, 1201}) time[row] = time[row - 1];
  const VehicleSurvey found =
      survey(guess_vehicle({table_of({{"t", time},
                                      {"swa", d.u.row(0).transpose()},
                                      {"vx", d.u.row(1).transpose()},
                                      {"yaw_rate", d.y.row(kRowR).transpose()}})}));
  EXPECT_EQ(alarms(found), Codes{"repeated_stamps"});
  EXPECT_NE(finding_of(found, "repeated_stamps")->text.find("3 time stamps"), std::string::npos);
}

TEST(VehicleColumns, TheFirstColumnIsTimeWhereItIncreasesEvenly) {
  const Dataset d = drive_around();
  for (const auto& [per_second, unit] :
       {std::pair{1.0, "s"}, {1e3, "ms"}, {1e6, "us"}, {1e9, "ns"}}) {
    const VehicleSignals s =
        guess_vehicle({table_of({{"column_1", d.time * per_second},
                                 {"swa_deg", d.u.row(0).transpose() * 57.29578},
                                 {"vx", d.u.row(1).transpose()},
                                 {"yaw_rate", d.y.row(kRowR).transpose()}})});
    EXPECT_EQ(s.time_column, "column_1");
    EXPECT_EQ(s.time_unit, unit);
    EXPECT_THAT(s.findings.at(0).text, HasSubstr("is taken as time in"));
    EXPECT_EQ(alarms(survey(s)), Codes{});
  }
  // Not where it goes back, and not where it is a signal.
  const VehicleSignals none = guess_vehicle(
      {table_of({{"column_1", d.y.row(kRowR).transpose()}, {"vx", d.u.row(1).transpose()}})});
  EXPECT_EQ(none.time_column, "");
}

TEST(VehicleColumns, RunsOfOneFileRestartInTheModelProposed) {
  const Dataset d = drive_around();
  VectorXd time = d.time;
  time.tail(time.size() / 2).array() -= time[time.size() / 2];
  const VehicleSurvey s =
      survey(guess_vehicle({table_of({{"t", time},
                                      {"swa", d.u.row(0).transpose()},
                                      {"vx", d.u.row(1).transpose()},
                                      {"yaw_rate", d.y.row(kRowR).transpose()}})}));
  EXPECT_THAT(mapping_text(s), HasSubstr("time: {column: t, unit: s, runs: restart}"));
}

TEST(VehicleColumns, ACurvatureIsNoYawRate) {
  const Dataset d = drive_around();
  const VectorXd curvature = d.y.row(kRowR).transpose().cwiseQuotient(d.u.row(1).transpose());
  for (const auto& [name, unit] :
       {std::pair{"1/R", ""}, {"1/R", "1/m"}, {"Curvature", ""}, {"channel 7", "1/m"}}) {
    Table table = table_of({{"t", d.time},
                            {name, curvature},
                            {"swa", d.u.row(0).transpose()},
                            {"vx", d.u.row(1).transpose()},
                            {"ay", d.y.row(kAy).transpose()}});
    table.columns[1].unit = unit;
    for (const VehicleSignal& signal : guess_vehicle({table}).signals) {
      EXPECT_NE(signal.kind, SignalKind::r) << name << " " << unit;
    }
  }
}

TEST(VehicleSurvey, BetaAndVyOfOneDeviceAreOneMeasurement) {
  const VehicleSurvey two = surveyed(drive_around());
  EXPECT_EQ(finding_of(two, "one_measurement"), nullptr);
  EXPECT_EQ(proposal(two, "beta").column, "beta");
  const VehicleSurvey one = surveyed_when([](Dataset& d) {
    for (Index k = 0; k < d.size(); ++k) d.y(kBeta, k) = std::atan2(d.y(kVy, k), d.u(1, k));
  });
  ASSERT_NE(finding_of(one, "one_measurement"), nullptr);
  EXPECT_EQ(proposal(one, "beta").column, "");
  EXPECT_EQ(proposal(one, "vy").column, "vy");
}

TEST(VehicleSurvey, TheGainOfAyIsNamed) {
  // Slow turns, so that means over seconds are not near zero.
  const auto wheel = [](double t) { return 0.6 * std::sin(0.25 * t); };
  Dataset data =
      testing::with_noise(testing::record({}, testing::uniform_time(60.0, 100.0), kAll, wheel,
                                          [](double t) { return 17.0 + 5.0 * std::sin(0.11 * t); }),
                          {0.005, 0.03, 0.1, 0.002}, 1);
  EXPECT_EQ(finding_of(surveyed(data), "gain_ay"), nullptr);
  data.y.row(kAy) *= 1.1;
  const VehicleSurvey found = surveyed(data);
  ASSERT_NE(finding_of(found, "gain_ay"), nullptr);
  EXPECT_THAT(finding_of(found, "gain_ay")->text, HasSubstr("is 1.10 +- 0.0"));
  EXPECT_EQ(alarms(found), Codes{"gain_ay"});
}

TEST(VehicleSurvey, ALagBetweenTwoFilesIsProposedAsDelay) {
  const Dataset d = drive_around();
  const auto files = [&](const VectorXd& of_steering, const std::string& path) {
    Table steering = table_of({{"t", of_steering}, {"swa", d.u.row(0).transpose()}});
    Table rest = table_of({{"t", d.time},
                           {"vx", d.u.row(1).transpose()},
                           {"yaw_rate", d.y.row(kRowR).transpose()},
                           {"ay", d.y.row(kAy).transpose()}});
    steering.path = path;
    return survey(guess_vehicle({rest, steering}));
  };
  const VectorXd late = d.time.array() - 0.3;  // its clock is behind
  EXPECT_NEAR(proposal(files(late, "steering.csv"), "steering_wheel_angle").delay, -0.3, 0.1);
  EXPECT_EQ(proposal(files(d.time, "steering.csv"), "steering_wheel_angle").delay, 0.0);
}

// --- Real recordings: what must be found in each of the ten, and what must not ---

struct Real {
  const char* name;
  std::vector<std::string> files;
  Codes must;                   // codes found, of any severity
  Codes must_not;               // serious ones that would be wrong
  std::string steering, r, ay;  // columns; empty: not there
  std::string iz;  // answers that are right: what fit says, "poorly determined" of most
};

TEST(VehicleSurvey, TenRealRecordings) {
  const Codes none;
  const Real cases[] = {
      {"polaris lap",
       {"polaris_human_connor_track3_1.csv"},
       {"clock_offset", "one_clock", "sign_steering", "held_samples"},
       {"units_ay", "swapped_channels", "sign_ay", "sign_vy", "units_steering"},
       "swa_rad",
       "yaw_rate_rps",
       "ay_mps2",
       "poorly"},
      {"revsted",
       {"revsted_obd_sample.csv"},
       {"sign_ay", "held_samples"},
       {"clock_offset", "units_ay", "sign_steering", "sign_r", "sign_vy", "swapped_channels"},
       "SW_pos_obd",
       "yaw_rate",
       "LatAcc_obd",
       "poorly"},
      {"polaris circles",
       {"polaris_circle_timeseries.csv"},
       {"several_runs", "sign_steering"},
       {"clock_offset", "units_ay", "sign_ay", "swapped_channels"},
       "swa_cmd_rad",
       "yaw_rate_rps",
       "ay_mps2",
       "no"},
      {"rav4",
       {"comma2k19_rav4_imu.csv", "comma2k19_rav4_speed.csv", "comma2k19_rav4_steer.csv"},
       {"several_clocks", "sign_steering", "held_samples"},
       {"units_ay", "swapped_channels", "sign_ay", "clock_offset"},
       "steering_wheel_deg",
       "gyro_down",
       "acc_right",
       "no"},
      {"av-21",
       {"iac_av21_Putnam_park2023_run4_2.csv"},
       {"standstill"},
       {"clock_offset", "sign_steering", "sign_r", "units_steering", "swapped_channels"},
       "delta",
       "omega",
       "",
       "poorly"},
      {"ferrari",
       {"revs_250lm_first_half.csv"},
       none,
       {"clock_offset", "units_ay", "sign_ay", "sign_steering", "sign_vy", "swapped_channels",
        "units_steering"},
       "delta",
       "yawRate",
       "ayCG",
       "poorly"},
      {"stanford",
       {"stanford_me227_ab.csv"},
       {"standstill"},
       {"clock_offset", "units_ay", "sign_ay", "sign_steering", "sign_vy", "units_steering"},
       "deltaMeasured_rad",
       "r_radps",
       "ay_mps2",
       "poorly"},
      {"marc2",
       {"cobb_sim_marc2.txt"},
       none,
       {"clock_offset", "sign_steering", "units_steering"},
       "STEER",
       "YAWVEL",
       "",
       "poorly"},
      {"marc3",
       {"cobb_sim_marc3.txt"},
       {"several_runs"},
       {"clock_offset", "units_ay", "sign_ay", "sign_steering", "sign_vy", "units_steering"},
       "STEER",
       "YAWVEL",
       "LATACC",
       ""},
      {"polaris summary",
       {"polaris_steady_circle_summary.csv"},
       {"no_time"},
       {"clock_offset", "sign_steering"},
       "",
       "",
       "",
       ""},
  };
  for (const Real& c : cases) {
    SCOPED_TRACE(c.name);
    std::vector<Table> tables;
    for (const std::string& file : c.files) {
      IDENTIKAL_NEEDS_SHARED_FILE("recordings/" + file);
      tables.push_back(read_csv(shared_file("recordings/" + file)));
    }
    const VehicleSurvey s = survey(guess_vehicle(tables));
    Codes all;
    std::string line;
    for (const Finding& w : s.findings) {
      if (all.insert(name_of(w)).second) line += " " + name_of(w);
    }
    std::printf("%-16s%s\n", c.name, line.c_str());
    for (const std::string& code : c.must) EXPECT_TRUE(all.contains(code)) << code;
    for (const std::string& code : c.must_not) EXPECT_FALSE(all.contains(code)) << code;
    const std::string steering =
        proposal(s, "steering_wheel_angle").column + proposal(s, "road_wheel_angle").column;
    EXPECT_EQ(steering, c.steering);
    EXPECT_EQ(proposal(s, "r").column, c.r);
    EXPECT_EQ(proposal(s, "ay").column, c.ay);
    if (!c.iz.empty()) {
      EXPECT_EQ(answer(s, "Iz"), c.iz);
    }
  }
}

VehicleSurvey of_recording(const std::string& file) {
  return survey(guess_vehicle({read_csv(shared_file("recordings/" + file))}));
}

TEST(VehicleSurvey, ClockOfThePolarisLap) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/polaris_human_connor_track3_1.csv");
  const VehicleSurvey s = of_recording("polaris_human_connor_track3_1.csv");
  const double delay = proposal(s, "steering_wheel_angle").delay;
  std::printf("polaris lap: wheel speed late by %.3f s, steering by %.3f s, one clock %.3f s\n",
              relation(s, "vx")->lag, -relation(s, "steering")->lag, delay);
  EXPECT_GT(delay, 0.66);
  EXPECT_LT(delay, 0.84);
  EXPECT_GT(relation(s, "vx")->lag, 0.66);
  EXPECT_LT(relation(s, "vx")->lag, 0.84);
}

TEST(VehicleSurvey, SignsStepsAndUnitsOfRealRecordings) {
  IDENTIKAL_NEEDS_SHARED_FILE("recordings/revsted_obd_sample.csv");
  const VehicleSurvey revsted = of_recording("revsted_obd_sample.csv");
  EXPECT_EQ(proposal(revsted, "ay").scale, -1.0);
  EXPECT_EQ(proposal(revsted, "ay").unit, "m/s^2");
  EXPECT_EQ(proposal(revsted, "r").unit, "deg/s");
  EXPECT_EQ(proposal(revsted, "vx").unit, "km/h");
  EXPECT_EQ(proposal(revsted, "beta").unit, "deg");
  for (const VehicleSurvey::Signal& x : revsted.signals) {
    if (x.column != "yaw_rate") continue;
    EXPECT_NEAR(x.quantum, 1.28, 0.01);
    EXPECT_NEAR(x.held, 0.9, 0.02);
  }
  const VehicleSurvey ferrari = of_recording("revs_250lm_first_half.csv");
  EXPECT_EQ(proposal(ferrari, "road_wheel_angle").unit, "rad");
  EXPECT_EQ(proposal(ferrari, "r").unit, "rad/s");
  EXPECT_EQ(proposal(ferrari, "vy").column, "vy");
  for (const VehicleSurvey::Signal& x : ferrari.signals) {
    if (x.column == "yawRateFilt") {
      EXPECT_EQ(x.unit, "deg/s");
    }
  }
  const VehicleSurvey circles = of_recording("polaris_circle_timeseries.csv");
  EXPECT_EQ(answer(circles, "Cf, Cr"), "combination");
  EXPECT_NEAR(relation(circles, "vx r")->slope, 1.2, 0.05);
  const VehicleSurvey marc3 = of_recording("cobb_sim_marc3.txt");
  EXPECT_EQ(proposal(marc3, "steering_wheel_angle").unit, "deg");
  EXPECT_EQ(proposal(marc3, "ay").unit, "g");
}

// Every real recording, spoilt in every way: which mistakes are found?
TEST(VehicleSurvey, MistakesPutIntoRealRecordings) {
  const std::vector<std::vector<std::string>> recordings = {
      {"polaris_human_connor_track3_1.csv"},
      {"revsted_obd_sample.csv"},
      {"comma2k19_rav4_imu.csv", "comma2k19_rav4_speed.csv", "comma2k19_rav4_steer.csv"},
      {"iac_av21_Putnam_park2023_run4_2.csv"},
      {"revs_250lm_first_half.csv"},
      {"stanford_me227_ab.csv"},
      {"cobb_sim_marc2.txt"}};
  struct Mistake {
    const char* name;
    SignalKind in;
    std::function<void(VehicleSignal&)> make;
    std::function<bool(const VehicleSurvey& before, const VehicleSurvey& after)> found;
  };
  const auto signs = [](const VehicleSurvey& s, const char* one, const char* other) {
    const auto scale = [&](const std::string& name) {
      if (name != "steering") return proposal(s, name).scale;
      return proposal(s, "steering_wheel_angle").scale * proposal(s, "road_wheel_angle").scale;
    };
    return scale(one) * scale(other);
  };
  const auto has = [](const char* code) {
    return [code](const VehicleSurvey&, const VehicleSurvey& s) {
      return finding_of(s, code) != nullptr;
    };
  };
  const auto times = [](double factor) {
    return [factor](VehicleSignal& x) { x.value *= factor; };
  };
  const auto later = [](double seconds) {
    return [seconds](VehicleSignal& x) { x.time.array() += seconds; };
  };
  const auto late = [](const VehicleSurvey& s) { return -relation(s, "steering")->lag; };
  const Mistake mistakes[] = {
      {"-r", SignalKind::r, times(-1),
       [&](const VehicleSurvey& a, const VehicleSurvey& b) {
         return signs(a, "steering", "r") == -signs(b, "steering", "r");
       }},
      {"-ay", SignalKind::ay, times(-1),
       [&](const VehicleSurvey& a, const VehicleSurvey& b) {
         return signs(a, "r", "ay") == -signs(b, "r", "ay");
       }},
      {"-steering", SignalKind::steering, times(-1),
       [&](const VehicleSurvey& a, const VehicleSurvey& b) {
         return signs(a, "steering", "r") == -signs(b, "steering", "r");
       }},
      {"ay in g", SignalKind::ay, times(1 / 9.80665), has("units_ay")},
      {"r in deg/s", SignalKind::r, times(57.29578), has("units_ay")},
      {"steering in deg", SignalKind::steering, times(57.29578), has("units_steering")},
      {"steering late", SignalKind::steering, later(1.2),
       [&](const VehicleSurvey& a, const VehicleSurvey& b) {
         return finding_of(b, "clock_offset") && std::abs(late(b) - late(a) - 1.2) < 0.15;
       }},
      {"steering early", SignalKind::steering, later(-2.0),
       [&](const VehicleSurvey& a, const VehicleSurvey& b) {
         return finding_of(b, "clock_offset") && std::abs(late(b) - late(a) + 2.0) < 0.15;
       }},
      {"ay late", SignalKind::ay, later(0.6),
       [&](const VehicleSurvey&, const VehicleSurvey& b) {
         return finding_of(b, "clock_offset") && std::abs(proposal(b, "ay").delay - 0.6) < 0.2;
       }},
      {"r stuck", SignalKind::r,
       [](VehicleSignal& x) {
         // Three seconds from where it is farthest from its mean.
         Index at = 0;
         (x.value.array() - x.value.mean()).abs().maxCoeff(&at);
         for (Index i = at; i < x.value.size() && x.time[i] < x.time[at] + 3.0; ++i) {
           x.value[i] = x.value[at];
         }
       },
       has("stuck_channel")},
      {"steering dead", SignalKind::steering, times(0.0), has("no_steering")},
  };
  int found = 0, tried = 0;
  for (const Mistake& m : mistakes) {
    std::string line;
    for (const std::vector<std::string>& files : recordings) {
      std::vector<Table> tables;
      for (const std::string& file : files) {
        IDENTIKAL_NEEDS_SHARED_FILE("recordings/" + file);
        tables.push_back(read_csv(shared_file("recordings/" + file)));
      }
      VehicleSignals signals = guess_vehicle(tables);
      const auto hit = std::find_if(signals.signals.begin(), signals.signals.end(),
                                    [&](const VehicleSignal& x) { return x.kind == m.in; });
      const VehicleSurvey before = survey(signals);
      const bool no_ay = proposal(before, "ay").column.empty();
      const std::string code = m.name;
      if (hit == signals.signals.end() || (no_ay && code == "r in deg/s")) {
        line += "    -";
        continue;
      }
      m.make(*hit);
      const bool here = m.found(before, survey(signals));
      ++tried;
      found += here ? 1 : 0;
      line += here ? "  yes" : "   no";
    }
    std::printf("%-16s%s\n", m.name, line.c_str());
  }
  std::printf("%d of %d mistakes found\n", found, tried);
  EXPECT_GE(found, 66);
}

TEST(SurveyReport, TheMappingIsWhatAModelFileTakes) {
  VehicleSurvey s = surveyed_when([](Dataset& d) {
    d.y.row(kAy) *= -1.0;
    come_late(d, d.u, 0, 0.74);
  });
  s.time_column = "t [s]";
  s.time_unit = "s";
  const std::string text = mapping_text(s);
  EXPECT_THAT(text, HasSubstr("time: {column: \"t [s]\", unit: s}"));
  EXPECT_THAT(text, HasSubstr("  ay: {column: ay, unit: m/s^2, scale: -1}"));
  EXPECT_THAT(text, ::testing::ContainsRegex("steering_wheel_angle: .*, delay: 0\\.[678]"));
  EXPECT_THAT(text, HasSubstr("use_when: \"vx > 3\""));
  // Lines of a model file are as long as the names in them.
  const std::string whole = survey_text(s), report = whole.substr(0, whole.find("\nproposed"));
  for (std::size_t begin = 0, end; (end = report.find('\n', begin)) != std::string::npos;
       begin = end + 1) {
    EXPECT_LE(end - begin, 80u) << report.substr(begin, end - begin);
  }
}

}  // namespace
}  // namespace identikal
