// The program.
#include <algorithm>
#include <csignal>
#include <iterator>
#include <string_view>

#include "command/command_line.h"
#include "command/memory.h"

namespace {

// A fleet goes on with the next recording where one is too large.
bool works_through_recordings(int argc, char** argv) {
  if (argc < 3 || std::string_view(argv[1]) != "fleet") return false;
  constexpr std::string_view kVerbs[] = {"tune", "fit", "check", "validate", "resume"};
  return std::find(std::begin(kVerbs), std::end(kVerbs), argv[2]) != std::end(kVerbs);
}

}  // namespace

int main(int argc, char** argv) {
#ifdef SIGXFSZ
  // A file that becomes too large for the shell's limit is a write that fails, as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
#endif
  if (!works_through_recordings(argc, argv)) identikal::end_without_memory();
  return identikal::run_program(argc, argv);
}
