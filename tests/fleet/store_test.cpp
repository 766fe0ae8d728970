#include "fleet/store.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "fleet/internal/message.h"
#include "fleet/table.h"
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;
using Open = FleetStore::Open;

FleetResult done(std::int64_t number, const std::string& task, const std::string& message) {
  FleetResult out;
  out.number = number;
  out.task = task;
  out.stamp = "1:2";
  out.sha256 = "ab";
  FleetRow row;
  row.exit_code = 0;
  row.status = "ok";
  row.message = message;
  row.parameters = R"({"q": {"value": 0.1, "se": 0.25, "low": -1, "high": 1e300}})";
  out.rows.push_back(row);
  return out;
}

class Store : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name = "fleet.store") { return folder_ / name; }
  static std::string table(FleetStore& store) {
    std::string out;
    write_table(store, [&](const std::string& text) { out += text; });
    return out;
  }
  void plan(FleetStore& store, int jobs) {
    std::vector<FleetJob> list;
    for (int i = 0; i < jobs; ++i) list.push_back({std::to_string(i) + ".csv", "", "", "", ""});
    store.plan(task_, list, std::vector<double>(list.size(), 1.0));
  }
  const FleetTask task_{"tune", "m.yaml", {"--starts", "1"}, "", "/here", "d1"};
  const fs::path folder_ = fs::path(testing::TempDir()) / ("store_" + std::to_string(getpid()));
};

TEST_F(Store, KeepsTaskJobsAndResults) {
  {
    FleetStore store(path(), Open::create);
    plan(store, 3);
    store.begin();
    store.put(done(1, "d1", "con,verged"));
    store.commit();
  }
  FleetStore store(path(), Open::read);
  EXPECT_EQ(store.task(), task_);
  EXPECT_EQ(store.counts().jobs, 3);
  EXPECT_EQ(store.counts().done, 1);
  EXPECT_EQ(store.jobs_after(0, 9).size(), 2U);
  EXPECT_EQ(store.jobs_after(0, 9)[0].stamp, "1:2");
  EXPECT_EQ(
      table(store),
      "recording,unit,group,status,exit_code,rows,log_likelihood,q,q_se,q_low,q_high,findings,"
      "message\n1.csv,,,ok,0,0,,0.1,0.25,-1,1e+300,,\"con,verged\"\n");
}

TEST_F(Store, AnotherManifestKeepsWhatIsInBoth) {
  FleetStore store(path(), Open::create);
  plan(store, 3);
  store.begin();
  for (int i = 0; i < 3; ++i) store.put(done(i, "d1", std::to_string(i)));
  store.commit();
  FleetJob second{"2.csv", "unit", "", "", ""};
  second.covariates.emplace_back("mileage", "12");
  second.covariates.emplace_back("day", "Mon");
  store.plan(task_, {{"new.csv", "", "", "", ""}, second, {"0.csv", "", "", "", ""}}, {1, 1, 1});
  EXPECT_EQ(store.counts().jobs, 3);
  EXPECT_EQ(store.counts().done, 2);
  std::vector<std::string> messages;
  store.for_each_row([&](const StoredRow& row) { messages.push_back(row.row.message); });
  EXPECT_EQ(messages, (std::vector<std::string>{"2", "0"}));
  EXPECT_EQ(store.jobs_after(0, 1)[0].job.unit, "unit");
  EXPECT_EQ(store.jobs_after(0, 1)[0].job.covariates.size(), 2U);
  EXPECT_NE(table(store).find(",mileage,day,"), std::string::npos);
}

TEST_F(Store, WhatIsNotCommittedIsNotThere) {
  {
    FleetStore store(path(), Open::create);
    plan(store, 3);
    store.begin();
    store.put(done(0, "d1", ""));
    store.commit();
    store.begin();
    store.put(done(1, "d1", ""));
  }
  EXPECT_EQ(FleetStore(path(), Open::read).counts().done, 1);
}

TEST_F(Store, OneProcessWrites) {
  FleetStore store(path(), Open::create);
  plan(store, 1);
  const pid_t child = fork();
  if (child == 0) {
    int code = 1;
    try {
      FleetStore second(path(), Open::write);
    } catch (const InputError&) {
      code = FleetStore(path(), Open::read).counts().jobs == 1 ? 0 : 2;
    }
    _exit(code);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

TEST_F(Store, SharesCoverEachJobOnce) {
  FleetStore store(path(), Open::create);
  std::vector<FleetJob> jobs;
  std::vector<double> costs;
  std::mt19937 random(5);
  double total = 0.0;
  for (int i = 0; i < 200; ++i) {
    jobs.push_back({std::to_string(i), "", "", "", ""});
    costs.push_back(1.0 + static_cast<double>(random() % 50));
    total += costs.back();
  }
  store.plan(task_, jobs, costs);
  for (const int n : {1, 3, 7, 199, 1000}) {
    std::vector<int> times(200, 0);
    for (int k = 1; k <= n; ++k) {
      const auto share = store.share(k, n);
      if (!share) continue;
      double cost = 0.0;
      for (auto i = share->first; i <= share->second; ++i) {
        ++times[static_cast<std::size_t>(i)];
        cost += costs[static_cast<std::size_t>(i)];
      }
      EXPECT_LE(cost, total / n + 51.0);
    }
    EXPECT_EQ(times, std::vector<int>(200, 1)) << n;
  }
}

TEST_F(Store, SharesAreMergedOnce) {
  FleetStore store(path(), Open::create);
  plan(store, 6);
  for (int k = 1; k <= 2; ++k) {
    const auto share = *store.share(k, 2);
    FleetStore own(path("share" + std::to_string(k)), Open::create);
    own.copy_share(path(), share.first, share.second);
    EXPECT_EQ(own.counts().jobs, 3);
    own.begin();
    for (auto i = share.first; i <= share.second; ++i) own.put(done(i, "d1", std::to_string(i)));
    own.commit();
  }
  EXPECT_EQ(store.take_from(path("share2")), 3);
  EXPECT_EQ(store.take_from(path("share1")), 3);
  EXPECT_EQ(store.take_from(path("share1")), 0);
  FleetStore whole(path("whole"), Open::create);
  plan(whole, 6);
  whole.begin();
  for (int i = 5; i >= 0; --i) whole.put(done(i, "d1", std::to_string(i)));
  whole.commit();
  EXPECT_EQ(table(store), table(whole));
  FleetTask other = task_;
  other.digest = "d2";
  whole.set_task(other);
  EXPECT_THROW(store.take_from(path("whole")), InputError);
}

TEST_F(Store, AFileOfSomethingElseIsRefused) {
  std::ofstream(path()) << "recording,unit\n" << std::string(2000, 'x');
  EXPECT_THROW(FleetStore(path(), Open::read), InputError);
  EXPECT_THROW(FleetStore(path(), Open::create), InputError);
  EXPECT_THROW(FleetStore(path("absent"), Open::read), InputError);
  EXPECT_THROW(FleetStore(path("absent"), Open::write), InputError);
  EXPECT_FALSE(fs::exists(path("absent")));
  EXPECT_FALSE(fs::exists(path("absent.lock")));
}

// A store that somebody has damaged: rows or an InputError or an OutputError, never anything else.
TEST_F(Store, DamageIsToldOrHarmless) {
  {
    FleetStore store(path(), Open::create);
    plan(store, 20);
    store.begin();
    for (int i = 0; i < 20; ++i) store.put(done(i, "d1", "message"));
    store.commit();
  }
  std::ifstream in(path(), std::ios::binary);
  const std::string whole((std::istreambuf_iterator<char>(in)), {});
  std::mt19937 random(11);
  for (int trial = 0; trial < 300; ++trial) {
    std::string bytes = whole;
    for (int i = 0; i < 8; ++i) bytes[random() % bytes.size()] = static_cast<char>(random());
    if (trial % 5 == 0) bytes.resize(random() % bytes.size());
    std::ofstream(path("damaged"), std::ios::binary) << bytes;
    try {
      FleetStore store(path("damaged"), Open::read);
      store.counts();
      table(store);
    } catch (const InputError&) {
    } catch (const OutputError&) {
    }
  }
}

TEST(Message, ComesBackAsItWas) {
  Assignment job;
  job.job.number = 7;
  job.job.job = {"a.csv", "u", "g", "o", std::string("w\0x", 3)};
  job.first_part = 3;
  RowMessage row{7, done(7, "t", "m").rows[0]};
  row.row.log_likelihood = -0.1;
  const std::string bytes =
      frame_of(job) + frame_of(row) + frame_of(DoneMessage{done(7, "t", "m")});
  FrameReader reader;
  std::vector<std::string> frames;
  for (const char c : bytes) {  // in the smallest of pieces
    reader.add({&c, 1});
    while (auto frame = reader.next()) frames.push_back(*frame);
  }
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(assignment_of(frames[0]).job.job, job.job.job);
  EXPECT_EQ(assignment_of(frames[0]).first_part, 3);
  EXPECT_EQ(std::get<RowMessage>(answer_of(frames[1])).row.log_likelihood, -0.1);
  EXPECT_EQ(std::get<RowMessage>(answer_of(frames[1])).row.parameters, row.row.parameters);
  EXPECT_EQ(std::get<DoneMessage>(answer_of(frames[2])).result.stamp, "1:2");
}

TEST(Message, OtherBytesAreRefused) {
  std::mt19937 random(3);
  const std::string good = frame_of(RowMessage{7, done(7, "t", "m").rows[0]}).substr(4);
  for (int trial = 0; trial < 20000; ++trial) {
    std::string bytes = good;
    bytes[random() % bytes.size()] = static_cast<char>(random());
    if (trial % 3 == 0) bytes.resize(random() % bytes.size());
    try {
      answer_of(bytes);
    } catch (const std::runtime_error&) {
    }
  }
  FrameReader reader;
  reader.add("\xff\xff\xff\xff");
  EXPECT_THROW(reader.next(), std::runtime_error);
}

}  // namespace
}  // namespace identikal
