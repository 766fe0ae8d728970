// Which digests does a command line name?
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "jobs/load.h"

#include "identify/filter/digest_file.h"

namespace identikal {

/// Whether all of these are digests: files *.digest. @throws InputError where some are and some are
/// not
bool are_digests(const std::vector<std::string>& files);

/// All digests of some files. @throws InputError as read_digest_text() and merged()
DigestFile read_digests(const std::vector<std::string>& files);

/// Those of some files, for a model, which takes their sampling period where it has none.
struct LoadedDigests {
  std::vector<RecordingDigest> digests;
  Recordings recordings;  ///< which files they are of, without data
};
/// @throws InputError as read_digests(), and for other channels than the model's
LoadedDigests load_digests(const std::vector<std::string>& files, Model& model, Inputs& inputs);

/// Options that ask for rows. @param given  with the name of each
/// @throws InputError for one that was given
void refuse_beside_digests(const std::vector<std::pair<bool, std::string>>& given);

}  // namespace identikal
