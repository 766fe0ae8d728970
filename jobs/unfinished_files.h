// What has to go where the program ends in the middle of writing?
#pragma once

#include <string>

namespace identikal {

/// A file or folder that is about to be made, or emptied, and is none of the user's.
void note_unfinished(std::string path);

/// All that was noted is finished, or gone.
void forget_unfinished();

/// Takes away what was noted, last first: files, and folders that are empty. Asks for no memory.
void remove_unfinished() noexcept;

}  // namespace identikal
