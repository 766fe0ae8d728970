// What becomes of the program where memory is short?
#pragma once

#include <string>

namespace identikal {

constexpr const char* kNotEnoughMemory =
    "not enough memory; expected less data, or more memory for this job";

/// From here on the program has no more than this much memory: "2 GB", "500 MB". What needs more
/// ends with kNotEnoughMemory.
/// @throws InputError for a text that is no size, less than 50 MB, or where the system refuses it
void limit_memory(const std::string& size);

/// Destructors of other libraries ask for memory, and an exception that comes out of one ends a
/// program at once. From here on it ends with kNotEnoughMemory and exit code 5 instead of abort().
void end_in_words_without_memory();

}  // namespace identikal
