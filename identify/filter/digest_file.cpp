#include "identify/filter/digest_file.h"

#include <charconv>
#include <cmath>
#include <stdexcept>
#include <unordered_set>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/result/file_digest.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

constexpr std::string_view kBegin = "identikal digest 1\n";
constexpr std::size_t kShaLength = 64;

std::string channel_text(const ChannelSource& channel) {
  return channel.si_unit.empty() ? channel.name
                                 : fmt::format("{} [{}]", channel.name, channel.si_unit);
}

[[noreturn]] void refuse(const std::string& path, const std::string& found) {
  throw InputError({path}, found, "a file that 'identikal digest' has written");
}

// The line at the begin of `rest`, which has to start with this word.
std::string_view line_after(std::string_view word, std::string_view& rest,
                            const std::string& path) {
  const std::size_t end = rest.find('\n');
  if (end == std::string_view::npos || !rest.starts_with(word))
    refuse(path, "no digest, or a damaged one");
  std::string_view line = rest.substr(word.size(), end - word.size());
  rest.remove_prefix(end + 1);
  return line;
}

std::vector<std::string> names_in(std::string_view line) {
  std::vector<std::string> out;
  while (!line.empty()) {
    const std::size_t end = std::min(line.find('\t'), line.size());
    out.emplace_back(line.substr(0, end));
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  return out;
}

template <typename Number>
Number number_in(std::string_view line, const std::string& path) {
  Number out{};
  const auto [stop, error] = std::from_chars(line.data(), line.data() + line.size(), out);
  if (error != std::errc{} || stop != line.data() + line.size()) refuse(path, "a damaged digest");
  return out;
}

void check_same(const DigestFile& all, const DigestFile& more, const std::string& path) {
  if (more.outputs != all.outputs || more.inputs != all.inputs) {
    throw InputError({path},
                     fmt::format("outputs {} and inputs {}", fmt::join(more.outputs, ", "),
                                 fmt::join(more.inputs, ", ")),
                     fmt::format("outputs {} and inputs {}", fmt::join(all.outputs, ", "),
                                 fmt::join(all.inputs, ", ")));
  }
  if (std::abs(more.step - all.step) > 1e-6 * all.step) {
    throw InputError({path}, fmt::format("a sampling period of {:g} s", more.step),
                     fmt::format("{:g} s", all.step));
  }
}

}  // namespace

bool is_digest_name(const std::string& path) { return path.ends_with(".digest"); }

DigestFile digest_file_of(const Model& model, double step) {
  DigestFile out;
  for (const ChannelSource& channel : model.outputs) out.outputs.push_back(channel_text(channel));
  for (const ChannelSource& channel : model.inputs) out.inputs.push_back(channel_text(channel));
  out.step = step;
  return out;
}

RecordingDigest digest_of(const Model& model, const Dataset& recording, Eigen::Index lags) {
  if (!is_linear(model) || changes(model) || model.student) {
    throw InputError({model.source}, "'digest' of a model that is not linear with normal noise",
                     "a model with A, C, Q, R that are constant");
  }
  const LinearModel& linear = as_linear(model);
  if (linear.initial == InitialState::partly_diffuse) {
    throw InputError({model.source}, "'digest' with a start that is diffuse in part",
                     "initial: stationary, diffuse, or given");
  }
  try {
    return identikal::digest_of(recording.y, model_inputs(linear, recording.u),
                                instantiate(linear, model.parameters), lags);
  } catch (const std::invalid_argument& error) {
    throw InputError({recording.name}, error.what(), "a long recording without gaps",
                     "recordings with gaps are tuned as they are");
  }
}

std::string digest_text(const DigestFile& file) {
  std::string out(kBegin);
  out += fmt::format("outputs {}\ninputs {}\nstep {}\ncount {}\n", fmt::join(file.outputs, "\t"),
                     fmt::join(file.inputs, "\t"), file.step, file.digests.size());
  for (const NamedDigest& each : file.digests) {
    out += each.sha256 + "\n";
    add_bytes(each.digest, out);
  }
  out += sha256_of_text(out);
  return out;
}

DigestFile read_digest_text(const std::string& text, const std::string& path) {
  std::string_view rest = text;
  if (!rest.starts_with(kBegin) || rest.size() < kBegin.size() + kShaLength) {
    refuse(path, "no digest");
  }
  const std::string_view whole = rest.substr(0, rest.size() - kShaLength);
  if (sha256_of_text(whole) != rest.substr(whole.size())) refuse(path, "a damaged digest");
  rest = whole.substr(kBegin.size());
  DigestFile out;
  out.outputs = names_in(line_after("outputs ", rest, path));
  out.inputs = names_in(line_after("inputs ", rest, path));
  out.step = number_in<double>(line_after("step ", rest, path), path);
  const auto count = number_in<std::size_t>(line_after("count ", rest, path), path);
  try {
    for (std::size_t i = 0; i < count; ++i) {
      std::string sha256(line_after("", rest, path));
      out.digests.push_back({std::move(sha256), digest_in(rest)});
    }
  } catch (const std::invalid_argument& error) {
    refuse(path, error.what());
  }
  if (!rest.empty()) refuse(path, "a damaged digest");
  return out;
}

void check_same_channels(const DigestFile& file, const DigestFile& of_model,
                         const std::string& source) {
  check_same(file, of_model, source);
}

DigestFile merged(std::vector<DigestFile> files, const std::vector<std::string>& paths) {
  DigestFile out{files.front().outputs, files.front().inputs, files.front().step, {}};
  std::unordered_set<std::string> known;
  for (std::size_t i = 0; i < files.size(); ++i) {
    check_same(out, files[i], paths[i]);
    for (NamedDigest& each : files[i].digests) {
      if (!known.insert(each.sha256).second) {
        throw InputError({paths[i]}, "a recording that is in another digest too", "each once",
                         "it would count twice");
      }
      out.digests.push_back(std::move(each));
    }
  }
  return out;
}

void check_takes_digests(const Model& model, std::size_t digests) {
  if (digests == 0) throw std::invalid_argument("there is no digest");
  const auto refuse = [&](const std::string& what, const std::string& expected) {
    throw InputError({model.source, 0, 0}, what + " with a digest", expected,
                     "the recording itself serves any model");
  };
  if (!is_linear(model) || changes(model) || model.student) {
    refuse("a model that is not linear with normal noise", "a model with A, C, Q, R");
  }
  const LinearModel& linear = as_linear(model);
  const bool known = is_known(linear.A, model.parameters) && is_known(linear.C, model.parameters);
  if (linear.initial == InitialState::diffuse && !known) {
    refuse("a diffuse start and free A or C", "initial: stationary, or A and C that are known");
  }
}

}  // namespace identikal
