// How do all files of a folder change at once?
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>

namespace identikal {

/// A folder that takes the place of another in one step, so that whoever looks sees all of the old
/// files or all of the new ones, whenever the program is killed. What else lies in the old one is
/// carried over. Made, filled, and put in place; taken away again where that does not happen.
class FolderExchange {
 public:
  /// Nothing where it cannot be: the folder holds folders or links, is where this program works, or
  /// belongs to somebody else.
  /// @param names  of the new files
  /// @param stale  of files that are not carried over
  static std::optional<FolderExchange> beside(const std::filesystem::path& folder,
                                              std::set<std::string> names,
                                              std::set<std::string> stale);
  ~FolderExchange();
  FolderExchange(FolderExchange&& other) noexcept;
  FolderExchange& operator=(FolderExchange&& other) noexcept;

  /// The folder that changes, without links in its path.
  const std::filesystem::path& folder() const { return folder_; }
  /// Where the new files are to be written.
  const std::filesystem::path& fresh() const { return fresh_; }

  /// false: the system cannot, and nothing has changed.
  bool put_in_place();

 private:
  FolderExchange(std::filesystem::path folder, std::filesystem::path fresh,
                 std::set<std::string> names, std::set<std::string> stale);
  bool carry_over();
  void clear_old();

  std::filesystem::path folder_, fresh_;
  std::set<std::string> names_, stale_;
};

/// A name for a file or folder beside others that nobody can lay there before.
std::string unforeseeable_name();

}  // namespace identikal
