#include "command/command_line.h"

#include <algorithm>
#include <iostream>
#include <iterator>
#include <memory>
#include <new>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "fleet/verbs.h"
#include "jobs/run.h"
#include "jobs/verbs.h"
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command/interruption.h"
#include "command/manual.h"
#include "command/memory.h"
#include "command/option_parser.h"
#include "command/terminal.h"
#include "command/time_limit.h"
#include "command/verbs.h"
#include "identify/model/templates.h"
#include "identify/result/export.h"
#include "identify/simulation/manoeuvres.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/version.h"
#include "studies/study.h"

namespace identikal {
namespace {

const char* const kExitStatus =
    "Exit status:\n"
    "  0  done and usable\n"
    "  1  rejected: not optimal, not identifiable, not to be trusted\n"
    "  2  mistake on the command line, in the model or in the data\n"
    "  3  not converged; the best so far is printed\n"
    "  4  --strict and there are warnings\n"
    "  5  internal error, a limit of memory or time, or a result could not be written\n"
    "  130, 143  stopped by Ctrl-C or SIGTERM; the best so far is printed and written";
constexpr int kBySignal = 128;  // as shells count

// As it can be typed again.
std::string as_typed(int argc, char** argv) {
  std::string out = "identikal";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool plain = !word.empty() && word.find_first_not_of(
                                            "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVW"
                                            "XYZ0123456789-_./:=+,%@^") == std::string::npos;
    std::string quoted;
    for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
    out += plain ? " " + word : " '" + quoted + "'";
  }
  return out;
}

struct NamedVerb {
  const char* name;
  Verb (*make)();
};

constexpr NamedVerb kVerbs[] = {
    {"info", info_verb},
    {"init", init_verb},
    {"tune", tune_verb},
    {"fit", fit_verb},
    {"check", check_verb},
    {"track", track_verb},
    {"filter", filter_verb},
    {"compare", compare_verb},
    {"shape", shape_verb},
    {"bound", bound_verb},
    {"report", report_verb},
    {"export", export_verb},
    {"validate", validate_verb},
    {"study", study_verb},
    {"simulate", simulate_verb},
    {"handling", handling_verb},
    {"forecast", forecast_verb},
    {"digest", digest_verb},
    {"model", model_verb},
    // Verbs of a verb: "fleet tune" is two words of a command line.
    {"fleet tune", fleet_tune_verb},
    {"fleet joint", fleet_joint_verb},
    {"fleet fit", fleet_fit_verb},
    {"fleet check", fleet_check_verb},
    {"fleet validate", fleet_validate_verb},
    {"fleet resume", fleet_resume_verb},
    {"fleet status", fleet_status_verb},
    {"fleet export", fleet_export_verb},
    {"fleet population", fleet_population_verb},
    {"fleet coverage", fleet_coverage_verb},
    {"fleet report", fleet_report_verb},
    {"fleet merge", fleet_merge_verb},
};

// Those that ask while they work whether to stop. A signal ends the others as it ends any program.
constexpr std::string_view kSearches[] = {
    "tune",      "fit",         "shape",       "track",          "fleet tune",
    "fleet fit", "fleet joint", "fleet check", "fleet validate", "fleet resume"};

std::string first_word(const std::string& name) { return name.substr(0, name.find(' ')); }

// The verb that is typed: one word, or two.
std::string typed_name(int argc, char** argv) {
  const std::string first = argc > 1 ? argv[1] : "";
  const bool of_two = std::any_of(std::begin(kVerbs), std::end(kVerbs), [&](const NamedVerb& verb) {
    return std::string(verb.name).starts_with(first + " ");
  });
  return of_two && argc > 2 ? first + " " + argv[2] : first;
}

// A command line that begins with a verb needs the options of no other one: to define them all takes
// longer than to fit a short recording.
std::vector<Verb> verbs_of(int argc, char** argv) {
  const std::string typed = typed_name(argc, argv);
  std::vector<Verb> out;
  if (argc == 2 && typed == "--version") return out;
  for (const NamedVerb& verb : kVerbs) {
    if (typed == verb.name) return {verb.make()};
  }
  for (const NamedVerb& verb : kVerbs) out.push_back(verb.make());
  return out;
}

// Of `typed`, the verbs that could stand in its place: first words, or second ones.
std::vector<std::string> names_beside(const std::string& typed) {
  const std::size_t space = typed.find(' ');
  std::vector<std::string> names;
  for (const NamedVerb& verb : kVerbs) {
    const std::string name = verb.name;
    std::string word = first_word(name);
    if (space != std::string::npos) {
      if (!name.starts_with(typed.substr(0, space + 1))) continue;
      word = name.substr(space + 1);
    }
    if (names.empty() || names.back() != word) names.push_back(word);
  }
  return names;
}

void refuse_unknown_verb(int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  const std::string typed = typed_name(argc, argv);
  const std::size_t space = typed.find(' ');
  const std::string word = space == std::string::npos ? typed : typed.substr(space + 1);
  if (word.starts_with('-')) return;
  const std::vector<std::string> names = names_beside(typed);
  if (std::find(names.begin(), names.end(), word) != names.end()) return;
  throw InputError({}, fmt::format("unknown verb '{}'", typed),
                   fmt::format("one of {}", fmt::join(names, ", ")), did_you_mean(word, names));
}

// "fleet tune"
std::string name_of(const CLI::App& verb) {
  const CLI::App* parent = verb.get_parent();
  const bool nested = parent != nullptr && parent->get_parent() != nullptr;
  return nested ? parent->get_name() + " " + verb.get_name() : verb.get_name();
}

// The verb that the parser has found; nullptr when there is none.
const CLI::App* verb_in(const CLI::App& app) {
  const CLI::App* out = &app;
  while (!out->get_subcommands().empty()) out = out->get_subcommands().front();
  return out == &app ? nullptr : out;
}

// Those that help shows.
std::vector<std::string> option_names(const CLI::App& verb) {
  std::vector<std::string> out;
  for (const CLI::Option* option : verb.get_options()) {
    if (option->get_group().empty()) continue;
    for (const std::string& name : option->get_lnames()) out.push_back("--" + name);
    for (const std::string& name : option->get_snames()) out.push_back("-" + name);
  }
  return out;
}

bool shows_option(const Verb& verb, const std::string& name) {
  const auto has_name = [&](const Option& option) {
    // "-o,--output"
    return option.now.empty() &&
           ("," + option.names + ",").find("," + name + ",") != std::string::npos;
  };
  return std::any_of(verb.options.begin(), verb.options.end(), has_name);
}

// Which verbs take this option, as a hint; those of fleets take what the verb takes.
std::string verbs_with(const std::string& option) {
  std::vector<std::string> out;
  for (const NamedVerb& verb : kVerbs) {
    const bool of_fleets = std::string_view(verb.name).find(' ') != std::string_view::npos;
    if (of_fleets && !out.empty()) continue;
    if (shows_option(verb.make(), option)) out.push_back(fmt::format("'{}'", verb.name));
  }
  if (out.empty()) return "";
  return fmt::format("{} {} it", fmt::join(out, ", "), out.size() == 1 ? "has" : "have");
}

std::string hint_for(const CLI::App& verb, const std::string& option) {
  const std::string others = verbs_with(option);
  if (!others.empty()) return others;
  const std::string nearest =
      option.starts_with("--") ? did_you_mean(option, option_names(verb)) : std::string();
  if (!nearest.empty()) return nearest;
  return fmt::format("'identikal {} --help' shows them", name_of(verb));
}

// "-o", or the long name of an option that has no short one, or that of an argument.
std::string short_name(const CLI::Option& option) {
  if (!option.get_snames().empty()) return "-" + option.get_snames().front();
  if (!option.get_lnames().empty()) return "--" + option.get_lnames().front();
  return option.get_name(true);
}

// "MODEL DATA..."
std::string arguments_of(const CLI::App& verb) {
  std::string out;
  for (const CLI::Option* option : verb.get_options()) {
    if (!option->get_positional()) continue;
    const std::string name = option->get_name(true) + (option->get_expected_max() > 1 ? "..." : "");
    out += option->get_required() ? " " + name : " [" + name + "]";
  }
  return out;
}

// What a verb does not know, in one line; its other mistakes may only follow from this one.
void refuse_unknown_options(const CLI::App& app) {
  const CLI::App* const verb = verb_in(app);
  if (verb == nullptr) return;
  for (const std::string& word : verb->remaining()) {
    if (word.size() < 2 || word[0] != '-' || word == "--") continue;
    const std::string option = word.substr(0, word.find('='));
    throw InputError({}, fmt::format("unknown option '{}' of '{}'", option, name_of(*verb)), "",
                     hint_for(*verb, option));
  }
}

void refuse_unknown_words(const CLI::App& app, const CLI::ParseError& error) {
  refuse_unknown_options(app);
  if (const CLI::App* const verb = verb_in(app)) {
    const std::vector<std::string> unknown = verb->remaining();
    const bool extras = error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError);
    if (!extras) return;
    if (unknown.empty() && !app.remaining().empty()) {
      throw InputError({}, fmt::format("unknown option '{}'", app.remaining().front()), "",
                       "options stand behind the verb");
    }
    if (unknown.empty()) return;
    const std::string name = name_of(*verb);
    throw InputError({}, fmt::format("unexpected argument '{}' of '{}'", unknown.front(), name),
                     fmt::format("'identikal {}{}'", name, arguments_of(*verb)),
                     fmt::format("'identikal {} --help' shows them", name));
  }
  const std::vector<std::string> unknown = app.remaining();
  throw InputError({},
                   unknown.empty() ? std::string("a verb is missing")
                                   : fmt::format("unknown option '{}'", unknown.front()),
                   "", "'identikal --help' shows verbs and options");
}

// What the parser has refused, in the words of this program.
// It begins its messages with the option's name, that of a flag without its dashes.
[[noreturn]] void refuse(const CLI::App& verb, const CLI::ParseError& error) {
  const std::string hint = fmt::format("'identikal {} --help' shows them", name_of(verb));
  const std::string said = error.what();
  for (const CLI::Option* option : verb.get_options()) {
    const std::string name = short_name(*option), whole_name = option->get_name();
    if (option->get_items_expected_max() == 0) {
      // Words that belong to no option are one without a name.
      const std::size_t begin = whole_name.find_first_not_of('-');
      if (begin != std::string::npos && said.starts_with(whole_name.substr(begin) + " ")) {
        throw InputError({}, name + " takes no value", name + " alone");
      }
      continue;
    }
    if (option->get_expected_max() == 1 && option->count() > 1) {
      throw InputError({}, name + " is given twice", "once");
    }
    const bool named = said.starts_with(whole_name + ":") || said.starts_with(whole_name + " ");
    if (!named || option->count() > 0) continue;
    if (!option->get_required()) throw InputError({}, name + " has no value", "one", hint);
    const std::string usage = option->get_positional() ? arguments_of(verb) : " " + name + " VALUE";
    throw InputError({}, name + " is missing",
                     fmt::format("'identikal {}{}'", name_of(verb), usage), hint);
  }
  throw InputError({}, said, "", hint);
}

// Names of earlier versions are a group of their own, for which the parser leaves a blank line.
class Help : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override {
    std::string text = CLI::Formatter::make_help(app, std::move(name), mode);
    for (std::size_t at = 0; (at = text.find("\n\n\n", at)) != std::string::npos;) {
      text.erase(at, 1);
    }
    while (text.ends_with("\n\n")) text.pop_back();
    return text;
  }
};

// For the build, which makes the manual page and the completions of shells from the definitions.
std::string generated(const CLI::App& app, const std::string& kind) {
  std::vector<std::string> drives, templates;
  for (const Manoeuvre& m : manoeuvres()) drives.push_back(m.name);
  for (const ModelTemplate& t : model_templates()) templates.push_back(t.name);
  return command_reference(app, kind, IDENTIKAL_VERSION,
                           {{"init", "TEMPLATE", templates},
                            {"study", "NAME", study_names()},
                            {"simulate", "--manoeuvre", drives},
                            {"export", "--to", export_formats()}});
}

bool has_option(const Verb& verb, std::string_view name) {
  return std::any_of(verb.options.begin(), verb.options.end(),
                     [&](const Option& option) { return option.names == name; });
}

bool is_quiet(const Verb& verb) {
  const auto quiet = std::find_if(verb.options.begin(), verb.options.end(),
                                  [](const Option& option) { return option.names == "--quiet"; });
  return quiet != verb.options.end() && *std::get<bool*>(quiet->value);
}

bool is_search(const Verb& verb) {
  return std::find(std::begin(kSearches), std::end(kSearches), verb.name) != std::end(kSearches);
}

int run_verb(const Verb& verb, std::int64_t time_limit, const std::string& command) {
  ProgressLine line(is_quiet(verb));
  Call call;
  call.command = command;
  call.progress = [&](const std::string& what, double, double) {
    line.show(what);
    return signal_received() == 0;
  };
  std::vector<std::string> remarks;
  call.print = [&](const std::string& text) {
    line.clear();
    print(text);
  };
  call.notice = [&](const std::string& text) { remarks.push_back(text); };
  call.unattended = [](std::int64_t seconds) {
    end_at_signals();
    if (seconds > 0) end_after(seconds);
  };
  if (is_search(verb)) {
    stop_at_signals();
    limit_time(call, time_limit);
  } else if (time_limit > 0) {
    end_after(time_limit);
  }
  const Outcome outcome = verb.run(call);
  line.clear();
  print(outcome.text);
  for (const std::string& text : remarks) remark(text);
  const int signal = signal_received();
  return signal != 0 ? kBySignal + signal : outcome.exit_code;
}

}  // namespace

std::optional<CommandLine> read_command_line(int argc, char** argv) {
  CLI::App app{"Identikal: system identification and Kalman filter tuning from recorded data",
               "identikal"};
  app.formatter(std::make_shared<Help>());
  app.require_subcommand(1);
  app.set_version_flag("--version", "identikal " IDENTIKAL_VERSION "\n" IDENTIKAL_BUILT_WITH);
  refuse_unknown_verb(argc, argv);
  std::vector<Verb> verbs = verbs_of(argc, argv);
  std::string memory_limit;
  std::int64_t time_limit = 0;
  for (Verb& verb : verbs) {
    add_text(verb, "--memory-limit", memory_limit,
             "Use no more memory than this, e.g. 2 GB; what needs more ends with exit code 5.",
             "none");
    if (!has_option(verb, "--time-limit")) {
      add_number(verb, "--time-limit", time_limit, 1, 1000000,
                 is_search(verb) ? "Stop with what is done after this many seconds."
                                 : "End with exit code 5 and without a result after this many "
                                   "seconds.",
                 "none");
    }
    add_verb(app, verb);
  }
  // Verbs that are added later would have it too.
  app.footer(kExitStatus);
  if (argc == 3 && std::string(argv[1]) == "--generate") {
    print(generated(app, argv[2]));
    return std::nullopt;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      std::ostringstream text;
      app.exit(error, text, text);
      print(text.str());
      return std::nullopt;
    }
    refuse_unknown_words(app, error);
    refuse(*verb_in(app), error);
  } catch (const InputError&) {  // of the value of an option
    refuse_unknown_options(app);
    throw;
  }
  const std::string name = name_of(*verb_in(app));
  const auto typed =
      std::find_if(verbs.begin(), verbs.end(), [&](const Verb& verb) { return verb.name == name; });
  return CommandLine{*typed, memory_limit, time_limit};
}

int run_command_line(int argc, char** argv) {
  const std::optional<CommandLine> typed = read_command_line(argc, argv);
  if (!typed) return 0;
  if (!typed->memory_limit.empty()) limit_memory(typed->memory_limit);
  return run_verb(typed->verb, typed->time_limit, as_typed(argc, argv));
}

int run_program(int argc, char** argv) noexcept {
  try {
    return run_command_line(argc, argv);
  } catch (const InputError& error) {
    std::cerr << "identikal: " << error.what() << "\n";
    return 2;
  } catch (const OutputError& error) {
    std::cerr << "identikal: " << error.what() << "\n";
    return 5;
  } catch (const std::invalid_argument& error) {  // a model and recordings that do not go together
    std::cerr << "identikal: " << error.what() << "\n";
    return 2;
  } catch (const std::bad_alloc&) {
    std::cerr << "identikal: " << kNotEnoughMemory << "\n";
    return 5;
  } catch (const std::system_error& error) {  // what the system has not given
    const bool memory = error.code() == std::errc::not_enough_memory;
    std::cerr << "identikal: " << (memory ? kNotEnoughMemory : error.what()) << "\n";
    return 5;
  } catch (const std::exception& error) {
    std::cerr << "identikal: internal error: " << error.what() << "; please report it\n";
    return 5;
  }
}

}  // namespace identikal
