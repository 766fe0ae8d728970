// What reaches the terminal: text on standard output, remarks and a line of progress on standard error.
#pragma once

#include <string>

namespace identikal {

/// On standard output. @throws OutputError when it takes no more, as on a full disk
void print(const std::string& text);

/// A line on standard error.
void remark(const std::string& text);

/// One line that rewrites itself, on a terminal only.
class ProgressLine {
 public:
  explicit ProgressLine(bool quiet);
  ~ProgressLine() { clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  void show(const std::string& text);
  void clear();

 private:
  bool shown_;
  bool dirty_ = false;
};

}  // namespace identikal
