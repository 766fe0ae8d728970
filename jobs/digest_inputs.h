// Which digests does a command line name?
#pragma once

#include <string>
#include <vector>

#include "identify/filter/digest_file.h"

namespace identikal {

/// Whether all of these are digests: files *.digest. @throws InputError where some are and some are
/// not
bool are_digests(const std::vector<std::string>& files);

/// All digests of some files. @throws InputError as read_digest_text() and merged()
DigestFile read_digests(const std::vector<std::string>& files);

}  // namespace identikal
