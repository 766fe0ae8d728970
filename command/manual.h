// How is the command line written for a manual page and for shells that complete it?
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace identikal {

/// Values of an option or argument that the definition of the command line does not list.
struct KnownValues {
  std::string verb, name;  ///< "simulate", "--manoeuvre"; "study", "NAME"
  std::vector<std::string> values;
};

/// The command line that `app` defines, every verb and option that its help shows, as `kind`:
/// "man" (troff, section 1), "bash", "zsh" or "fish" (completions). `version` stands in the
/// manual page.
/// @throws InputError for any other kind
std::string command_reference(const CLI::App& app, const std::string& kind,
                              const std::string& version,
                              const std::vector<KnownValues>& known = {});

}  // namespace identikal
