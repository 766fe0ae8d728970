// What fleets read: digests, manifests, stores.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "fleet/manifest.h"
#include "fleet/population.h"
#include "fleet/store.h"
#include "fleet/summary.h"
#include "fleet/table.h"

#include "identify/filter/digest_file.h"
#include "identify/result/file_digest.h"
#include "lib/base/error.h"
#include "tests/fuzz/targets.h"

namespace identikal::fuzz {
namespace {

template <typename Job>
void refused_in_a_line(const Job& job) {
  try {
    job();
  } catch (const InputError& error) {
    require_one_line(error.what());
  } catch (const OutputError& error) {
    require_one_line(error.what());
  }
}

void require_sizes(const RecordingDigest& digest) {
  const Eigen::Index channels = digest.head.rows();
  const bool holds =
      digest.tail.rows() == channels && digest.tail.cols() == digest.lags() &&
      static_cast<Eigen::Index>(digest.sums.size()) == digest.lags() * channels * channels;
  if (!holds) std::abort();
}

std::string whole_store() {
  const ScratchFile file("", ".whole");
  std::filesystem::remove(file.path());
  {
    FleetStore made(file.path(), FleetStore::Open::create);
    std::vector<FleetJob> jobs;
    for (int i = 0; i < 6; ++i) {
      jobs.push_back(
          {std::to_string(i) + ".csv", "u" + std::to_string(i), i % 2 ? "a" : "b", "", ""});
    }
    made.plan({"tune", "m.yaml", {"--starts", "1"}, "", "folder", "d"}, jobs,
              std::vector<double>(jobs.size(), 1.0));
    made.begin();
    for (std::size_t i = 0; i < jobs.size(); ++i) {
      FleetResult result;
      result.number = static_cast<std::int64_t>(i);
      result.task = "d";
      FleetRow row;
      row.exit_code = 0;
      row.status = "ok";
      row.parameters = R"({"q": {"value": )" + std::to_string(1.0 + 0.1 * static_cast<double>(i)) +
                       R"(, "se": 0.25, "low": 0.5, "high": 2}})";
      result.rows.push_back(row);
      made.put(std::move(result));
    }
    made.commit();
  }
  std::ifstream in(file.path(), std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

// As they are, and with the checksum that they would have to have.
void digest(std::string_view bytes) {
  constexpr std::size_t kSha = 64;
  const std::string as_given(bytes);
  const std::string body = as_given.substr(0, as_given.size() - std::min(kSha, as_given.size()));
  for (const std::string& text : {as_given, body + sha256_of_text(body)}) {
    refused_in_a_line([&] {
      const DigestFile read = read_digest_text(text, "x.digest");
      for (const NamedDigest& each : read.digests) require_sizes(each.digest);
    });
  }
}

void manifest(std::string_view bytes) {
  const ScratchFile file(bytes, ".csv");
  refused_in_a_line([&] {
    for (const FleetJob& job : read_manifests({file.path()})) option_words(job.options);
  });
}

// Three bytes each put another value somewhere into a whole store.
void store(std::string_view bytes) {
  static const std::string whole = whole_store();
  std::string damaged = whole;
  for (std::size_t i = 0; i + 2 < bytes.size(); i += 3) {
    const std::size_t at =
        static_cast<unsigned char>(bytes[i]) * 256U + static_cast<unsigned char>(bytes[i + 1]);
    damaged[at % damaged.size()] = bytes[i + 2];
  }
  const ScratchFile file(damaged, ".store");
  refused_in_a_line([&] {
    FleetStore read(file.path(), FleetStore::Open::read);
    status_text(read);
    write_table(read, [](const std::string&) {});
    population_text(population_of(read));
  });
}

}  // namespace identikal::fuzz
