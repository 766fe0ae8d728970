// Results go to JSON and come back as they were, whatever stands in them.
#include "identify/result/json.h"

#include <cmath>
#include <filesystem>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/result/file.h"
#include "identify/result/internal/whole_file.h"
#include "identify/result/same.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;

// Fills every field that is described, with what is rare in results too.
class RandomFields {
 public:
  explicit RandomFields(unsigned seed) : random_(seed) {}

  void is(const char* /*name*/, const char* /*meaning*/) {}
  template <class T>
  void operator()(const char* /*key*/, T&& member, const char* /*meaning*/) {
    fill(member);
  }
  template <class Part>
  void group(const char* /*key*/, const char* /*meaning*/, const Part& part) {
    part(*this);
  }

 private:
  std::size_t below(std::size_t n) { return random_() % n; }
  double finite() {
    const auto scale = static_cast<double>(below(40)) - 20.0;
    return std::normal_distribution<>()(random_) * std::pow(10.0, scale);
  }
  void fill(double& x) {
    const double rare[] = {kNone, kInfinity, -kInfinity, 0.0, -0.0, 1e300};
    x = below(3) == 0 ? rare[below(std::size(rare))] : finite();
  }
  void fill(bool& x) { x = below(2) == 0; }
  void fill(std::string& x) {
    const char* some[] = {"", "a", "\"b\", {c}", "two\nlines", "Größe [µm]", "\\u0000 </script>"};
    x = some[below(std::size(some))];
  }
  template <class T>
  requires std::is_integral_v<T>
  void fill(T& x) { x = static_cast<T>(sizeof(T) == 8 ? random_() : random_() % 1000); }
  template <class T>
  requires std::is_enum_v<T>
  void fill(T& x) { x = values_of(x)[below(values_of(x).size())]; }
  template <class T>
  void fill(std::vector<T>& x) {
    x.resize(below(3));
    for (T& item : x) fill(item);
  }
  template <std::size_t n>
  void fill(std::array<double, n>& x) {
    for (double& item : x) fill(item);
  }
  void fill(Eigen::VectorXd& x) {
    x.resize(static_cast<Eigen::Index>(below(4)));
    for (double& item : x) fill(item);
  }
  void fill(Eigen::MatrixXd& x) {
    x.resize(0, 0);
    if (below(4) == 0) return;
    x.resize(1 + static_cast<Eigen::Index>(below(3)), 1 + static_cast<Eigen::Index>(below(3)));
    for (double& item : x.reshaped()) fill(item);
  }
  template <class T>
  void fill(std::optional<T>& x) {
    x.reset();
    if (below(4) != 0) fill(x.emplace());
  }
  template <class Struct>
  void fill(Struct& s) {
    describe(*this, s);
  }

  template <class T>
  void fill(Section<T>& x) {
    fill(*x.read);
  }
  template <class T>
  void fill(Choice<T>& x) {
    x.value = x.known[below(x.known.size())];
  }
  void fill(Present<std::string>& x) { x.value = "said"; }
  void fill(Present<double>& x) { x.value = finite(); }
  void fill(ChoiceOrNull& x) { x.text = below(2) == 0 ? "" : x.known[below(x.known.size())]; }
  void fill(Sha256& x) { x.text = std::string(64, "0123456789abcdef"[below(16)]); }
  void fill(Ends& x) {
    x.ends = {below(2) == 0 ? -kInfinity : finite(), below(2) == 0 ? kInfinity : finite()};
  }
  void fill(CodeOf& x) {
    const auto kinds = finding_kinds();
    set_code(x.finding, std::string(kinds[below(kinds.size())].name));
  }
  void fill(Printed& x) { fill(x.findings); }
  void fill(ByChannel& x) {
    fill(x.fits);
    for (std::size_t i = 0; i < x.fits.size(); ++i) x.fits[i].channel = std::to_string(9 - i);
  }

  std::mt19937_64 random_;
};

StoredEstimate random_result(unsigned seed) {
  StoredEstimate out;
  WholeFile file = file_to_read(out);
  RandomFields fields(seed);
  describe(fields, file);
  out.correlation_names.resize(static_cast<std::size_t>(out.correlation.rows()));
  return out;
}

std::string json(const StoredEstimate& e) { return result_json(sections_of(e), false, 0.25); }

bool same(const StoredEstimate& a, const StoredEstimate& b) {
  return same(sections_of(a), sections_of(b));
}

StoredResult stored_result(const std::string& text) {
  StoredResult file;
  file.path = "result.json";
  file.text = text;
  return parse_stored_result(file);
}

std::string refusal_of_result(const std::string& text) {
  try {
    stored_result(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(ResultJson, ComesBackAsItWasWritten) {
  for (unsigned seed = 1; seed <= 300; ++seed) {
    const std::string text = json(random_result(seed));
    const StoredResult once = stored_result(text);
    EXPECT_EQ(json(once.estimate), text) << "seed " << seed;
    EXPECT_TRUE(same(stored_result(json(once.estimate)).estimate, once.estimate));
  }
}

TEST(ResultJson, OfVersion1ComesBackToo) {
  int found = 0;
  for (const auto& folder :
       std::filesystem::directory_iterator(IDENTIKAL_SOURCE_DIR "/tests/golden/result_v1")) {
    const StoredResult once = read_stored_result(folder.path().string());
    const StoredResult again = stored_result(json(once.estimate));
    EXPECT_TRUE(same(once.estimate, again.estimate)) << folder.path();
    ++found;
  }
  EXPECT_EQ(found, 3);
}

TEST(ResultJson, WhatIsWrongIsSaidWithItsPlace) {
  StoredEstimate e;
  e.parameters.resize(2);
  e.noise.Q = Eigen::MatrixXd::Ones(2, 2);
  const std::string text = json(e);
  ASSERT_EQ(refusal_of_result(text), "");
  const auto with = [&](const std::string& before, const std::string& now) {
    std::string out = text;
    const std::size_t at = out.rfind(before);
    EXPECT_NE(at, out.npos) << before;
    return out.replace(at, before.size(), now);
  };
  EXPECT_EQ(refusal_of_result(with("\"se_sandwich\"", "\"other\"")),
            "result.json: 'parameters[1].se_sandwich' is missing; expected a result.json as -o "
            "writes it; run the job again with -o");
  EXPECT_THAT(refusal_of_result(with("\"fixed\": false", "\"fixed\": 0")),
              HasSubstr("'parameters[1].fixed' is neither true nor false"));
  EXPECT_THAT(refusal_of_result(with("\"verdict\": \"ok\"", "\"verdict\": \"fine\"")),
              HasSubstr("'parameters[1].verdict' is \"fine\""));
  EXPECT_THAT(refusal_of_result(with("\"evaluations\": 0", "\"evaluations\": 0.5")),
              HasSubstr("'objective.evaluations' is no whole number"));
  EXPECT_THAT(refusal_of_result(with("\"evaluations\": 0", "\"evaluations\": 5000000000")),
              HasSubstr("'objective.evaluations' is too large a number"));
  EXPECT_THAT(refusal_of_result(with("\"notes\": []", "\"notes\": [\"a\", 1]")),
              HasSubstr("'notes[1]' is no text"));
  EXPECT_THAT(refusal_of_result(with("\"ci95\": [\n        null,", "\"ci95\": [")),
              HasSubstr("'parameters[1].ci95' is no interval"));
  EXPECT_THAT(refusal_of_result(with("1.0,\n          1.0\n        ]\n      ]", "1.0]]")),
              HasSubstr("'noise.Q.matrix' has rows of different lengths"));
  EXPECT_THAT(refusal_of_result(with("\"correlation\": {\n    \"names\": []",
                                     "\"correlation\": {\"names\": [\"a\"]")),
              HasSubstr("'correlation' has other names than rows"));
}

TEST(Same, IsWhatTheFileHolds) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    EXPECT_TRUE(same(random_result(seed), random_result(seed)));
    EXPECT_FALSE(same(random_result(seed), random_result(seed + 1)));
  }
  StoredEstimate a, b;
  a.parameters.resize(1);
  b.parameters.resize(1);
  EXPECT_TRUE(same(a, b));  // all of their numbers are NaN
  b.parameters[0].value = 0.0;
  EXPECT_FALSE(same(a, b));
  a.parameters[0].value = -0.0;
  EXPECT_TRUE(same(a, b));
  a.parameters[0].se = std::nextafter(1.0, 2.0);
  b.parameters[0].se = 1.0;
  EXPECT_FALSE(same(a, b));
  b = a;
  a.noise.Q = Eigen::MatrixXd::Zero(2, 3);
  b.noise.Q = Eigen::MatrixXd::Zero(3, 2);
  EXPECT_FALSE(same(a, b));
  b = a;
  a.notes = {"ab", "c"};
  b.notes = {"a", "bc"};
  EXPECT_FALSE(same(a, b));
  b = a;
  b.series.time = Eigen::VectorXd::Ones(3);
  EXPECT_TRUE(same(a, b));  // not in the file
  a.bound.emplace();
  EXPECT_FALSE(same(a, b));
}

}  // namespace
}  // namespace identikal
