#include "tests/fuzz/targets.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include <unistd.h>

namespace identikal::fuzz {

const std::vector<Target>& targets() {
  static const std::vector<Target> all = {{"csv", csv, 4000},
                                          {"yaml", yaml, 4000},
                                          {"formula", formula, 2000},
                                          {"model_file", model_file, 4000},
                                          {"result", result, 12000},
                                          {"digest", digest, 4000},
                                          {"manifest", manifest, 2000},
                                          {"store", store, 300},
                                          {"command_line", command_line, 400},
                                          {"job", job, 4000},
                                          {"interface", interface, 4000}};
  return all;
}

const Target* target_called(std::string_view name) {
  for (const Target& target : targets()) {
    if (target.name == name) return &target;
  }
  return nullptr;
}

void require_one_line(std::string_view message) {
  const bool one = !message.empty() && message.find('\n') == std::string_view::npos;
  if (one && !message.starts_with("internal error")) return;
  std::fprintf(stderr, "not one line for the user: %.*s\n", static_cast<int>(message.size()),
               message.data());
  std::abort();
}

ScratchFile::ScratchFile(std::string_view bytes, const std::string& ending)
    : path_((std::filesystem::temp_directory_path() / ("fuzz-" + std::to_string(getpid()) + ending))
                .string()) {
  std::ofstream(path_, std::ios::binary) << bytes;
}

ScratchFile::~ScratchFile() {
  for (const char* beside : {"", "-journal", ".lock"}) {
    std::error_code ignored;
    std::filesystem::remove(path_ + beside, ignored);
  }
}

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> out;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    out.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

std::vector<std::string> pieces(std::string_view bytes, std::size_t count) {
  constexpr std::string_view kBetween = "\n---\n";
  std::vector<std::string> out;
  while (out.size() + 1 < count) {
    const std::size_t end = bytes.find(kBetween);
    if (end == std::string_view::npos) break;
    out.emplace_back(bytes.substr(0, end + 1));
    bytes.remove_prefix(end + kBetween.size());
  }
  out.emplace_back(bytes);
  out.resize(count);
  return out;
}

}  // namespace identikal::fuzz
