#include "jobs/output_files.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "jobs/unfinished_files.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

struct Scratch {
  fs::path path = fs::temp_directory_path() / ("output_files_" + std::to_string(getpid()));
  Scratch() { fs::create_directories(path); }
  ~Scratch() { fs::remove_all(path); }
  std::string operator/(const std::string& name) const { return (path / name).string(); }
  auto count() const {
    return std::distance(fs::directory_iterator(path), fs::directory_iterator());
  }
};

std::string content_of(const std::string& path) {
  std::ostringstream out;
  out << std::ifstream(path).rdbuf();
  return out.str();
}

std::string failure(const std::vector<OutputFile>& files) {
  try {
    write_files(files);
  } catch (const OutputError& error) {
    return error.what();
  }
  return "";
}

TEST(OutputFiles, AllOrNone) {
  const Scratch folder;
  write_files({{folder / "a/b/one", "1"}, {folder / "two", "2"}});
  EXPECT_EQ(content_of(folder / "a/b/one"), "1");
  EXPECT_EQ(content_of(folder / "two"), "2");
  const auto before = folder.count();
  const std::string said =
      failure({{folder / "two", "new", "--report"}, {"/proc/nowhere/result.json", "{}"}});
  EXPECT_THAT(said, HasSubstr("/proc/nowhere/result.json: cannot make the folder /proc/nowhere"));
  EXPECT_THAT(said, HasSubstr("; give another place with -o"));
  EXPECT_EQ(content_of(folder / "two"), "2");
  EXPECT_THAT(failure({{folder / "three", ""}, {folder / "a", "", "--report"}}),
              HasSubstr("a: cannot write: it is a folder; give another place with --report"));
  EXPECT_EQ(folder.count(), before);
}

TEST(OutputFiles, FoldersThatWereMadeGoAgain) {
  const Scratch folder;
  write_files({{folder / "kept/one", "1"}});
  const std::string said = failure({{folder / "kept/new/below/two", "2"},
                                    {folder / "other/three", "3"},
                                    {folder / "kept", "", "--report"}});
  EXPECT_THAT(said, HasSubstr("it is a folder"));
  EXPECT_FALSE(fs::exists(folder / "kept/new"));
  EXPECT_EQ(folder.count(), 1);
  EXPECT_EQ(content_of(folder / "kept/one"), "1");
}

TEST(OutputFiles, TwoFilesAreNotOne) {
  const Scratch folder;
  fs::create_directory(folder / "there");
  fs::create_symlink("there", folder / "link");
  for (const char* other :
       {"there/result.json", "there/../there/result.json", "link/result.json"}) {
    try {
      write_files({{folder / other, "page", "--report"}, {folder / "there/result.json", "{}"}});
      ADD_FAILURE() << other;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("--report and -o would both be written to it"));
    }
    EXPECT_TRUE(fs::is_empty(folder / "there"));
  }
}

TEST(OutputFiles, TheLongestNameGoes) {
  const Scratch folder;
  const std::string name(255, 'n');
  write_files({{folder / name, "long"}});
  EXPECT_EQ(content_of(folder / name), "long");
  EXPECT_THAT(failure({{folder / (name + "n"), "longer"}}), HasSubstr("File name too long"));
  EXPECT_EQ(folder.count(), 1);
}

TEST(OutputFiles, LinksAndPipesStayWhatTheyAre) {
  const Scratch folder;
  for (const char* target : {"there", "not there yet"}) {
    const std::string link = folder / ("link to " + std::string(target));
    if (std::string(target) == "there") write_files({{folder / target, "old"}});
    fs::create_symlink(target, link);
    write_files({{link, "new"}});
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_EQ(content_of(folder / target), "new");
  }
  fs::create_symlink("self", folder / "self");
  EXPECT_THAT(failure({{folder / "self", ""}}), HasSubstr("links in a circle"));

  const std::string pipe = folder / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::string read;
  std::thread reader([&] { read = content_of(pipe); });
  write_files({{pipe, "through"}});
  reader.join();
  EXPECT_EQ(read, "through");
  EXPECT_TRUE(fs::is_fifo(pipe));

  // A device that is full: its like is made here, so that the machine's own stays out of it.
  const std::string full = folder / "full";
  if (mknod(full.c_str(), S_IFCHR | 0600, static_cast<dev_t>((1U << 8U) | 7U)) == 0 &&
      std::ofstream(full).is_open()) {
    EXPECT_THAT(failure({{folder / "beside", "b"}, {full, "content"}}),
                HasSubstr("full: cannot write: No space left on device"));
    EXPECT_TRUE(fs::is_character_file(full));
    EXPECT_FALSE(fs::exists(folder / "beside"));
  }
}

TEST(OutputFiles, NoInputIsWrittenOver) {
  const Scratch folder;
  write_files({{folder / "data.csv", "t,y"}});
  fs::create_symlink("data.csv", folder / "link");
  for (const char* name : {"data.csv", "./data.csv", "link"}) {
    try {
      write_files({{folder / "other", "x"}, {folder / name, "x", "--report"}},
                  {folder / "gone", folder / "data.csv"});
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("another place with --report"));
    }
    EXPECT_FALSE(fs::exists(folder / "other"));
    EXPECT_EQ(content_of(folder / "data.csv"), "t,y");
  }
}

TEST(OutputFiles, WhatIsUnfinishedIsTakenAway) {
  const Scratch folder;
  std::ofstream(folder / "kept") << "1";
  fs::create_directory(folder / "made");
  std::ofstream(folder / "made/part") << "2";
  note_unfinished(folder / "made");
  note_unfinished(folder / "made/part");
  note_unfinished(folder / "never made");
  remove_unfinished();
  EXPECT_EQ(folder.count(), 1);
  forget_unfinished();
  write_files({{folder / "two", "2"}});
  remove_unfinished();
  EXPECT_EQ(content_of(folder / "two"), "2");
}

TEST(OutputFiles, AResultOfOneFileLeavesNothingOfAnEarlierOne) {
  const Scratch folder;
  write_files({{folder / "out/result.json", "1"}, {folder / "out/residuals.csv", "1"}});
  std::ofstream(folder / "out/notes.txt") << "mine";
  write_files({{folder / "out/result.json", "2"}});
  EXPECT_EQ(content_of(folder / "out/result.json"), "2");
  EXPECT_FALSE(fs::exists(folder / "out/residuals.csv"));
  EXPECT_EQ(content_of(folder / "out/notes.txt"), "mine");
}

}  // namespace
}  // namespace identikal
