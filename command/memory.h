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

/// The first memory that the program asks for comes in pages of 2 MB where the system has them: a
/// recording of 20,000 rows otherwise spends a fifth of its time on pages of 4 kB. Nothing
/// where memory is limited. To be called before much else asks for memory.
void take_large_pages();

/// From here on a request for memory that fails ends the program at once: kNotEnoughMemory, exit
/// code 5, unfinished files taken away. An exception would not do: a matrix whose memory could not
/// be had is freed twice on its way out, and destructors of other libraries ask for memory.
void end_without_memory();

/// A request for memory has failed: what std::get_new_handler() does then, where there is one.
void memory_has_failed() noexcept;

}  // namespace identikal
