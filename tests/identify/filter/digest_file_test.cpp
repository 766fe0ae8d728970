#include "identify/filter/digest_file.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>

#include <gtest/gtest.h>

#include "identify/noise/ml.h"
#include "lib/base/error.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

double seconds_of(const std::function<void()>& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

Dataset recording(const MatiskoSystem& system, Random& random) {
  return dataset_of(simulate_matisko(system, random));
}

// System 7 of Matisko (2013): size, an evaluation, a fit, and the same fit from the recording.
TEST(DigestFile, AFitFromADigestIsTheRecordings) {
  MatiskoSystem system = matisko_system(7);
  system.samples = 200000;
  Random random(9);
  const std::vector<Dataset> recordings{recording(system, random), recording(system, random)};
  std::vector<RecordingDigest> digests;
  for (const Dataset& each : recordings) digests.push_back(digest_of(system.model, each, 64));
  NoiseMlOptions options;
  const NoiseEstimate whole = tune_ml(system.model, recordings, options);
  const NoiseEstimate small = tune_ml_digests(system.model, digests, options);
  const double seconds = seconds_of([&] { tune_ml_digests(system.model, digests, options); });
  double worst = std::abs(small.objective.log_likelihood / whole.objective.log_likelihood - 1.0);
  ASSERT_EQ(small.parameters.size(), whole.parameters.size());
  for (std::size_t i = 0; i < whole.parameters.size(); ++i) {
    const EstimatedParameter &a = whole.parameters[i], &b = small.parameters[i];
    if (a.fixed) continue;
    // In standard errors: so exact is the maximum, where the likelihood is flat, found at all.
    worst =
        std::max({worst, std::abs(a.value - b.value) / a.se, std::abs(a.se / b.se - 1.0) * 1e-3});
    EXPECT_NEAR(b.profile95[0], a.profile95[0], 1e-6 * a.se);
  }
  std::printf("digest of 200,000 rows: %zu bytes; fit of two %.2f ms; greatest difference %.1e\n",
              bytes_of(digests[0]).size(), 1e3 * seconds, worst);
  EXPECT_EQ(small.status, Status::ok) << small.message;
  EXPECT_LT(bytes_of(digests[0]).size(), 100000U);
  EXPECT_LT(worst, 1e-8);
  EXPECT_TRUE(small.tests.empty());
}

TEST(DigestFile, ComesBackAndIsMergedOnce) {
  MatiskoSystem system = matisko_system(7);
  system.samples = 2000;
  Random random(10);
  DigestFile file = digest_file_of(system.model, 1.0);
  for (int i = 0; i < 3; ++i) {
    file.digests.push_back(
        {std::to_string(i), digest_of(system.model, recording(system, random), 64)});
  }
  const std::string text = digest_text(file);
  const DigestFile back = read_digest_text(text, "x.digest");
  EXPECT_EQ(back.outputs, file.outputs);
  EXPECT_EQ(back.digests.size(), 3U);
  EXPECT_EQ(digest_text(back), text);
  DigestFile other = digest_file_of(system.model, 1.0);
  other.digests.push_back({"7", file.digests[0].digest});
  EXPECT_EQ(merged({file, other}, {"a", "b"}).digests.size(), 4U);
  EXPECT_THROW(merged({file, back}, {"a", "b"}), InputError);
  other.step = 2.0;
  EXPECT_THROW(merged({file, other}, {"a", "b"}), InputError);
  other.outputs = {"z"};
  EXPECT_THROW(merged({file, other}, {"a", "b"}), InputError);
}

TEST(DigestFile, DamageIsTold) {
  MatiskoSystem system = matisko_system(7);
  system.samples = 500;
  Random random(11);
  DigestFile file = digest_file_of(system.model, 1.0);
  file.digests.push_back({"1", digest_of(system.model, recording(system, random), 64)});
  const std::string text = digest_text(file);
  for (std::size_t i = 0; i < text.size(); i += 7) {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    EXPECT_THROW(read_digest_text(changed, "x.digest"), InputError) << i;
  }
  EXPECT_THROW(read_digest_text(text.substr(0, 300), "x.digest"), InputError);
  EXPECT_THROW(read_digest_text("", "x.digest"), InputError);
}

// Reading and merging as many files of System 7 as a fleet may give; 100,000 are asked in 10 s.
TEST(DigestFile, ManyAreMergedQuickly) {
  MatiskoSystem system = matisko_system(7);
  system.samples = 2000;
  Random random(12);
  const RecordingDigest digest = digest_of(system.model, recording(system, random), 64);
  std::vector<std::string> texts, paths;
  for (int i = 0; i < 2000; ++i) {
    DigestFile file = digest_file_of(system.model, 1.0);
    file.digests.push_back({std::to_string(i), digest});
    texts.push_back(digest_text(file));
    paths.push_back(std::to_string(i));
  }
  std::size_t bytes = 0;
  const auto read_and_merge = [&] {
    std::vector<DigestFile> files;
    for (std::size_t i = 0; i < texts.size(); ++i) {
      files.push_back(read_digest_text(texts[i], paths[i]));
    }
    bytes = digest_text(merged(std::move(files), paths)).size();
  };
  double seconds = seconds_of(read_and_merge);  // the least of three: others use the machine too
  for (int i = 0; i < 2; ++i) seconds = std::min(seconds, seconds_of(read_and_merge));
  std::printf("2000 digests of %zu bytes read and merged in %.3f s: 100,000 in %.1f s\n",
              texts[0].size(), seconds, 50.0 * seconds);
  EXPECT_GT(bytes, 2000 * (texts[0].size() - 500));
  EXPECT_LT(seconds, 0.5);  // of 0.2 that are asked, with room for a busy machine
}

}  // namespace
}  // namespace identikal
