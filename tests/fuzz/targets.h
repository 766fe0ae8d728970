// What is given bytes of any kind? One function for each reader, each job and each interface: it returns, or the program
// ends by abort(), by a sanitizer, or by the clock of whoever calls it.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace identikal::fuzz {

void csv(std::string_view bytes);           ///< a recording
void yaml(std::string_view bytes);          ///< a tree of keys and values
void formula(std::string_view bytes);       ///< an expression
void model_file(std::string_view bytes);    ///< a model file
void result(std::string_view bytes);        ///< result.json
void digest(std::string_view bytes);        ///< a digest of recordings
void manifest(std::string_view bytes);      ///< which recordings a fleet has
void store(std::string_view bytes);         ///< what it has made of them, a database
void command_line(std::string_view bytes);  ///< words, one a line
void job(
    std::string_view bytes);  ///< words, a model file and a recording, a line '---' between them
void interface(std::string_view bytes);  ///< the same through the C interface, with options as JSON

struct Target {
  const char* name;
  void (*take)(std::string_view bytes);
  std::size_t longest;  ///< bytes worth trying
};
const std::vector<Target>& targets();
/// @return nullptr where none has this name
const Target* target_called(std::string_view name);

// What targets share.

/// A file of its own with these bytes, which goes with it.
class ScratchFile {
 public:
  ScratchFile(std::string_view bytes, const std::string& ending);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// Ends the program unless the message is one line of text.
void require_one_line(std::string_view message);
/// Pieces between lines that are '---'; `count` of them, missing ones empty.
std::vector<std::string> pieces(std::string_view bytes, std::size_t count);
/// Lines without their ends; the last one too where it is not empty.
std::vector<std::string> lines_of(std::string_view text);

}  // namespace identikal::fuzz
