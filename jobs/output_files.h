// How do results get onto the disk: all of them, or none?
#pragma once

#include <string>
#include <vector>

namespace identikal {

struct OutputFile {
  std::string path, content;
  std::string option = "-o";  ///< of the command line, that gave the path
};

/// Writes all files or none: each to a temporary name beside it, then renamed, so that nobody sees
/// half of one. A folder that takes several changes in one step (jobs/folder_exchange.h) where that
/// can be, and with a new result.json loses what else an earlier result has left there. Folders are made, and taken away again with the rest. A symbolic link stays and its target is written; a device or pipe
/// is written as it is.
/// @param inputs  paths that the job has read, none of which is written to
/// @throws OutputError naming the path, the reason, and the option to give another place with;
///   InputError for a path that is one of the inputs, or that two of the files have
void write_files(const std::vector<OutputFile>& files, const std::vector<std::string>& inputs = {});

/// A file of a result's folder.
struct ResultFile {
  std::string name, content;
};
std::vector<OutputFile> in_folder(const std::string& folder, const std::vector<ResultFile>& files);

}  // namespace identikal
