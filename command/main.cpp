// The program.
#include <csignal>

#include "command/command_line.h"
#include "command/memory.h"

int main(int argc, char** argv) {
#ifdef SIGXFSZ
  // A file that becomes too large for the shell's limit is a write that fails, as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
#endif
  identikal::end_without_memory();
  identikal::take_large_pages();
  return identikal::run_program(argc, argv);
}
