#include "command/option_parser.h"

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "command/terminal.h"

namespace identikal {
namespace {

// Checks throw an InputError of their own, as the parser's messages say neither what was expected
// nor what to do.
CLI::Validator validator(const Option& option) {
  return {[check = option.check](std::string& text) {
            if (check) check(text);
            return std::string();
          },
          option.limits};
}

// A name of earlier versions: help does not show it, and its use is remarked on.
void add_old(CLI::App& verb, const Option& option) {
  const auto say_renamed = [](const std::string& old_name, const std::string& name) {
    remark(fmt::format("{} is called {} now; the next version will not know the old name", old_name,
                       name));
  };
  CLI::Option* added = nullptr;
  if (option.is_flag()) {
    added = verb.add_flag_callback(option.names, [option, say_renamed] {
      take(option, "");
      say_renamed(option.names, option.now);
    });
  } else {
    const auto taken = [option, say_renamed](const std::string& given) {
      take(option, given);
      std::string now = given;
      option.check(now);
      // Of a choice the value has another name too.
      const bool renamed = now != given;
      say_renamed(renamed ? option.names + " " + given : option.names,
                  renamed ? option.now + " " + now : option.now);
    };
    added = verb.add_option_function<std::string>(option.names, taken);
  }
  added->group("");
}

void add_today(CLI::App& verb, const Option& option) {
  CLI::Option* added = nullptr;
  if (option.is_flag()) {
    verb.add_flag(option.names, *std::get<bool*>(option.value), option.help)
        ->disable_flag_override();
    return;
  }
  std::visit(
      [&](auto* value) {
        if constexpr (!std::is_same_v<decltype(value), bool*>) {
          added = verb.add_option(option.names, *value, option.help);
        }
      },
      option.value);
  added->transform(validator(option))->default_str(option.shown)->required(option.required);
  if (option.is_list() && !option.is_argument()) added->allow_extra_args(false);
}

// Of "fleet tune" a subcommand of the subcommand "fleet".
CLI::App* add_named(CLI::App& app, const Verb& verb) {
  const std::size_t space = verb.name.find(' ');
  if (space == std::string::npos) return app.add_subcommand(verb.name, verb.help);
  const std::string first = verb.name.substr(0, space);
  const std::vector<CLI::App*> there =
      app.get_subcommands([&](const CLI::App* each) { return each->get_name() == first; });
  CLI::App* parent = there.empty() ? nullptr : there.front();
  if (parent == nullptr) {
    parent = app.add_subcommand(first,
                                "Do one verb on many recordings, on all processors or a cluster.");
    parent->require_subcommand(1);
  }
  return parent->add_subcommand(verb.name.substr(space + 1), verb.help);
}

}  // namespace

CLI::App& add_verb(CLI::App& app, const Verb& verb) {
  CLI::App* added = add_named(app, verb);
  added->footer(verb.footer);
  for (const Option& option : verb.options) {
    if (option.now.empty()) {
      add_today(*added, option);
    } else {
      add_old(*added, option);
    }
  }
  return *added;
}

}  // namespace identikal
