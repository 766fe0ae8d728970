// The program. Every exception ends here.
#include <csignal>
#include <iostream>
#include <new>
#include <stdexcept>

#include "command/command_line.h"
#include "lib/base/error.h"

int main(int argc, char** argv) {
#ifdef SIGXFSZ
  // A file that becomes too large for the shell's limit is a write that fails, as on a full disk.
  std::signal(SIGXFSZ, SIG_IGN);
#endif
  try {
    return identikal::run_command_line(argc, argv);
  } catch (const identikal::InputError& error) {
    std::cerr << "identikal: " << error.what() << "\n";
    return 2;
  } catch (const identikal::OutputError& error) {
    std::cerr << "identikal: " << error.what() << "\n";
    return 5;
  } catch (const std::invalid_argument& error) {  // a model and recordings that do not go together
    std::cerr << "identikal: " << error.what() << "\n";
    return 2;
  } catch (const std::bad_alloc&) {
    std::cerr << "identikal: not enough memory; expected less data, or more memory for this job\n";
    return 5;
  } catch (const std::exception& error) {
    std::cerr << "identikal: internal error: " << error.what() << "; please report it\n";
    return 5;
  }
}
