// What does a model file say of recordings one by one? `per` of parameters, and the table `recordings`.
#pragma once

#include "identify/model/matrix_reader.h"
#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"

namespace identikal {

/// Parameters that only recordings name count as used.
/// @throws InputError for a row that says something else than numbers and names of parameters and
///   labels, and for units that differ
RecordingTable read_recordings(const YamlNode& root, NamedParameters& parameters);

/// Adds the standard deviations that `spread` of parameters asks for, "sd_NAME", behind all others.
/// @throws InputError for one that is not positive, without `per`, or beside a prior
void add_spreads(const YamlNode& root, Model& model);

/// Per parameter: has it other values in some recordings?
std::vector<bool> differs(const RecordingTable& table, std::size_t parameters);

/// A source lies within the bounds of what it stands for, a variance's too; to be called when these are known.
/// @throws InputError for a value beyond them
void bound_sources(const YamlNode& root, const RecordingTable& table, NamedParameters& parameters);

}  // namespace identikal
