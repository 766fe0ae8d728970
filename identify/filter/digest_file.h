// How are digests of recordings kept: with the channels that they are of, and where they are from?
#pragma once

#include <string>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/recording_digest.h"

namespace identikal {

/// A recording's digest, and the SHA-256 of the files that it is of.
struct NamedDigest {
  std::string sha256;
  RecordingDigest digest;
};

/// Digests with the same channels, of one sampling period.
struct DigestFile {
  std::vector<std::string> outputs, inputs;  ///< "name [SI unit]" of a model's channels
  double step = 0.0;                         ///< [s]
  std::vector<NamedDigest> digests;
};

/// A name that ends in ".digest".
bool is_digest_name(const std::string& path);

/// Channels and period of a model, without digests.
DigestFile digest_file_of(const Model& model, double step);

/// Of each recording, with the model's own values. @param lags  at least so many
/// @throws InputError for a model that has none, a sample that is missing, and a recording that is too
///   short
///
/// Example:
///
///     DigestFile file = digest_file_of(model, recordings[0].dt);
///     file.digests.push_back({recordings[0].name, digest_of(model, recordings[0], 64)});
///     std::printf("%zu bytes\n", digest_text(file).size());
RecordingDigest digest_of(const Model& model, const Dataset& recording, Eigen::Index lags);

/// The file's bytes: a line that says what it is, channels, period, digests, and a SHA-256 of it all.
std::string digest_text(const DigestFile& file);
/// @param path  for messages
/// @throws InputError for a file that cannot be read, is none, or was changed
DigestFile read_digest_text(const std::string& text, const std::string& path);

/// @throws InputError where these are not the model's. @param source  of the model
void check_same_channels(const DigestFile& file, const DigestFile& of_model,
                         const std::string& source);

/// What a digest is good for: constant matrices, normal noise, and a start of which no samples are
/// asked.
/// @throws InputError for another model; std::invalid_argument without a digest
void check_takes_digests(const Model& model, std::size_t digests);

/// The digests of all files, in their order.
/// @param paths  of each, for messages
/// @throws InputError for other channels or another period than those of the first, and a recording
///   that is in two of them
DigestFile merged(std::vector<DigestFile> files, const std::vector<std::string>& paths);

}  // namespace identikal
