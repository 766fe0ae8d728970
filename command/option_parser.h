// How does the parser of the command line get to know the options of a verb?
#pragma once

#include "jobs/verb.h"

namespace CLI {
class App;
}

namespace identikal {

/// The verb as a subcommand: what is parsed goes where its options say.
/// @throws InputError from the parser, for a text that is no value of an option
CLI::App& add_verb(CLI::App& app, const Verb& verb);

}  // namespace identikal
