// How does a result of schema version 1, or of an earlier program, read now? Which keys and values
// were renamed; docs/file-formats.md has the same table for people.
#pragma once

#include <nlohmann/json.hpp>

namespace identikal {

/// A result of version 1 as one of version 2: keys and values under their new names, and the old
/// keys beside them. What is not as a result should be stays as it is.
void upgrade_result(nlohmann::ordered_json& result);

/// Gives a result the keys that its program did not write yet, with values that say nothing.
void add_new_keys(nlohmann::ordered_json& result);

/// The same as upgrade_result() for what the page of a result draws; no old keys are kept there.
void upgrade_page_data(nlohmann::ordered_json& data);

/// Puts the keys of version 1 beside those that replace them, with the same values: programs
/// written for version 1 find them as long as version 2 lasts.
void add_old_keys(nlohmann::ordered_json& result);

/// Names the same keys in the schema of results, as deprecated ones.
/// @throws std::logic_error when the schema has not the key that replaces one
void add_old_keys_to_schema(nlohmann::ordered_json& schema);

}  // namespace identikal
