#include "command/manual.h"

#include <cctype>
#include <set>
#include <sstream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "lib/base/error.h"

namespace identikal {
namespace {

struct OptionText {
  std::vector<std::string> names;   // "-o", "--output"; empty for an argument
  std::string argument;             // of an argument: DATA
  std::string kind;                 // what the value is: TEXT, INT, ...; empty for a flag
  std::vector<std::string> values;  // when only these are allowed, or known
  std::string limits, default_value, help;
  bool required = false, repeats = false;
};

struct VerbText {
  std::string name, help, footer;
  std::vector<OptionText> options, arguments;
};

OptionText option_text(const CLI::Option& option, const std::string& verb,
                       const std::vector<KnownValues>& known) {
  OptionText out;
  for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
  if (option.get_positional()) out.argument = option.get_name(true);
  out.help = option.get_description();
  out.required = option.get_required();
  out.repeats = option.get_expected_max() > 1;
  out.default_value = option.get_default_str();
  if (option.get_items_expected_max() > 0) {
    // "TEXT:{ml,als}", "INT:INT in [1 - 1000]"
    const std::string type = option.get_type_name();
    const std::size_t colon = type.find(':');
    out.kind = type.substr(0, colon);
    if (colon != std::string::npos) out.limits = type.substr(colon + 1);
    if (out.limits.starts_with('{') && out.limits.ends_with('}')) {
      std::istringstream list(out.limits.substr(1, out.limits.size() - 2));
      for (std::string value; std::getline(list, value, ',');) out.values.push_back(value);
    }
  }
  const std::string name = out.argument.empty() ? out.names.back() : out.argument;
  for (const KnownValues& k : known) {
    if (k.verb == verb && k.name == name) out.values = k.values;
  }
  return out;
}

VerbText verb_text(const CLI::App& app, const std::vector<KnownValues>& known) {
  VerbText out{app.get_name(), app.get_description(), app.get_footer(), {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    OptionText text = option_text(*option, out.name, known);
    (text.argument.empty() ? out.options : out.arguments).push_back(std::move(text));
  }
  return out;
}

std::vector<const CLI::App*> shown_below(const CLI::App& app) {
  std::vector<const CLI::App*> out;
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!verb->get_group().empty()) out.push_back(verb);
  }
  return out;
}

// With "fleet tune" and its like as verbs of their own.
std::vector<VerbText> verbs_of(const CLI::App& app, const std::vector<KnownValues>& known) {
  std::vector<VerbText> out;
  for (const CLI::App* verb : shown_below(app)) {
    const std::vector<const CLI::App*> below = shown_below(*verb);
    if (below.empty()) out.push_back(verb_text(*verb, known));
    for (const CLI::App* second : below) {
      out.push_back(verb_text(*second, known));
      out.back().name = verb->get_name() + " " + second->get_name();
    }
  }
  return out;
}

// As a shell completes them: "fleet" takes the second word as its first argument, and the options
// of all that it may be.
std::vector<VerbText> first_words(const CLI::App& app, const std::vector<KnownValues>& known) {
  std::vector<VerbText> out;
  for (const CLI::App* verb : shown_below(app)) {
    out.push_back(verb_text(*verb, known));
    OptionText second;
    second.argument = "VERB";
    std::set<std::string> seen;
    for (const CLI::App* below : shown_below(*verb)) {
      second.values.push_back(below->get_name());
      for (OptionText& option : verb_text(*below, known).options) {
        if (seen.insert(option.names.back()).second) out.back().options.push_back(option);
      }
    }
    if (!second.values.empty()) out.back().arguments.push_back(second);
  }
  return out;
}

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  return fmt::format("{}", fmt::join(words, between));
}

std::string replaced(const std::string& text, const std::string& characters,
                     const std::string& before) {
  std::string out;
  for (const char c : text) {
    if (characters.find(c) != std::string::npos) out += before;
    out += c;
  }
  return out;
}

// A quote inside single quotes of a shell that knows no escapes there.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

// Text of troff: backslash, minus, and a dot or quote that would begin a request.
std::string troff(const std::string& text) {
  std::string out;
  bool line_begins = true;
  for (const char c : text) {
    if (line_begins && (c == '.' || c == '\'')) out += "\\&";
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else if (c == '\'') {
      out += "\\(aq";
    } else if (c == '^') {
      out += "\\(ha";
    } else if (c == '~') {
      out += "\\(ti";
    } else {
      out += c;
    }
    line_begins = c == '\n';
  }
  return out;
}

std::string argument_text(const OptionText& argument) {
  const std::string text = argument.argument + (argument.repeats ? "..." : "");
  return argument.required ? text : "[" + text + "]";
}

std::string troff_options(const std::vector<OptionText>& options) {
  std::string out;
  for (const OptionText& o : options) {
    std::vector<std::string> names;
    for (const std::string& name : o.argument.empty() ? o.names : std::vector{o.argument}) {
      names.push_back("\\fB" + troff(name) + "\\fR");
    }
    const bool takes_value = o.argument.empty() && !o.kind.empty();
    out += ".TP\n" + joined(names, ", ") + (takes_value ? " \\fI" + troff(o.kind) + "\\fR" : "");
    out += "\n" + troff(o.help) + "\n";
    if (o.limits.starts_with('{')) {
      out += ".br\nOne of: " + troff(joined(o.values, ", ")) + "\n";
    } else if (!o.limits.empty()) {
      out += ".br\nA value " + troff(o.limits.substr(o.limits.find(' ') + 1)) + "\n";
    }
    if (!o.default_value.empty()) out += ".br\nDefault: " + troff(o.default_value) + "\n";
  }
  return out;
}

std::string as_it_is(const std::string& text) { return ".nf\n" + troff(text) + "\n.fi\n"; }

std::string man_page(const CLI::App& app, const std::vector<VerbText>& verbs,
                     const std::string& version) {
  const VerbText all = verb_text(app, {});
  std::string out =
      fmt::format(".TH IDENTIKAL 1 \"\" \"identikal {}\" \"User Commands\"\n", version);
  const std::size_t colon = all.help.find(": ");  // after the program's name
  out += ".SH NAME\nidentikal \\- " +
         troff(colon == std::string::npos ? all.help : all.help.substr(colon + 2)) +
         "\n.SH SYNOPSIS\n";
  for (const VerbText& verb : verbs) {
    out += ".B identikal " + troff(verb.name) + "\n[\\fIoptions\\fR]";
    for (const OptionText& a : verb.arguments) out += " " + troff(argument_text(a));
    out += "\n.br\n";
  }
  out += ".SH OPTIONS\n" + troff_options(all.options) + ".SH VERBS\n";
  for (const VerbText& verb : verbs) {
    out += ".SS " + troff(verb.name) + "\n" + troff(verb.help) + "\n";
    out += troff_options(verb.arguments) + troff_options(verb.options);
    if (!verb.footer.empty()) out += ".PP\n" + as_it_is(verb.footer);
  }
  if (const std::size_t end = all.footer.find(":\n"); end != std::string::npos) {
    std::string title = all.footer.substr(0, end);
    for (char& c : title) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    out += ".SH " + title + "\n" + as_it_is(all.footer.substr(end + 2));
  }
  return out;
}

bool takes_files(const OptionText& o) {
  return o.values.empty() && (o.kind == "TEXT" || o.kind == "FILE");
}

std::string bash_completion(const VerbText& all, const std::vector<VerbText>& verbs) {
  std::vector<std::string> names, global;
  for (const VerbText& verb : verbs) names.push_back(verb.name);
  for (const OptionText& o : all.options)
    global.insert(global.end(), o.names.begin(), o.names.end());
  std::string out =
      "# Completion of identikal for bash, made from its command line.\n"
      "_identikal() {\n"
      "  local current=${COMP_WORDS[COMP_CWORD]} option=${COMP_WORDS[COMP_CWORD-1]} words= "
      "files=yes\n"
      "  if [ \"$current\" = = ]; then current=\n"
      "  elif [ \"$option\" = = ]; then option=${COMP_WORDS[COMP_CWORD-2]}; fi\n"
      "  if [ \"$COMP_CWORD\" -eq 1 ]; then\n";
  out += "    words='" + joined(names, " ") + " " + joined(global, " ") + "' files=\n  else\n";
  out += "    case \"${COMP_WORDS[1]} $option\" in\n";
  for (const VerbText& verb : verbs) {
    for (const OptionText& o : verb.options) {
      if (o.kind.empty()) continue;
      std::vector<std::string> patterns;
      for (const std::string& name : o.names) patterns.push_back(quoted(verb.name + " " + name));
      out += "      " + joined(patterns, "|") + ")";
      if (!takes_files(o)) out += " words=" + quoted(joined(o.values, " ")) + " files=";
      out += " ;;\n";
    }
  }
  out += "      *)\n        case \"${COMP_WORDS[1]} $current\" in\n";
  for (const VerbText& verb : verbs) {
    std::vector<std::string> options;
    for (const OptionText& o : verb.options)
      options.insert(options.end(), o.names.begin(), o.names.end());
    out += "          " + quoted(verb.name + " -") + "*) words=" + quoted(joined(options, " ")) +
           " files= ;;\n";
    for (const OptionText& a : verb.arguments) {
      if (a.values.empty()) continue;
      out += "          " + quoted(verb.name + " ") + "*) words=" + quoted(joined(a.values, " ")) +
             " files= ;;\n";
    }
  }
  out +=
      "        esac ;;\n"
      "    esac\n"
      "  fi\n"
      "  if [ -n \"$files\" ]; then\n"
      "    compopt -o filenames 2>/dev/null\n"
      "    mapfile -t COMPREPLY < <(compgen -f -- \"$current\")\n"
      "  else\n"
      "    mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$current\")\n"
      "  fi\n"
      "}\n"
      "complete -F _identikal identikal\n";
  return out;
}

std::string zsh_value(const OptionText& o) {
  if (!o.values.empty()) return "(" + joined(o.values, " ") + ")";
  return takes_files(o) ? "_files" : " ";
}

std::string zsh_completion(const VerbText& all, const std::vector<VerbText>& verbs) {
  const auto described = [](const std::string& text) { return replaced(text, "[]:\\", "\\"); };
  const auto specs = [&](const std::vector<OptionText>& options, const std::string& indent) {
    std::string out;
    for (const OptionText& o : options) {
      const std::string others = o.repeats ? "*" : "(" + joined(o.names, " ") + ")";
      for (const std::string& name : o.names) {
        const std::string value = o.kind.empty() ? "" : ":" + o.kind + ":" + zsh_value(o);
        out += " \\\n" + indent + quoted(others + name + "[" + described(o.help) + "]" + value);
      }
    }
    return out;
  };
  std::string out =
      "#compdef identikal\n"
      "# Completion of identikal for zsh, made from its command line.\n"
      "_identikal() {\n"
      "  local context state state_descr line\n"
      "  typeset -A opt_args\n"
      "  local -a verbs=(\n";
  for (const VerbText& verb : verbs) {
    out += "    " + quoted(verb.name + ":" + replaced(verb.help, ":\\", "\\")) + "\n";
  }
  out += "  )\n  _arguments -C" + specs(all.options, "    ") +
         " \\\n    '1:verb:->verb' '*::argument:->rest'\n"
         "  case $state in\n"
         "    verb) _describe verb verbs ;;\n"
         "    rest)\n"
         "      case $line[1] in\n";
  for (const VerbText& verb : verbs) {
    out += "        " + verb.name + ")\n          _arguments" + specs(verb.options, "            ");
    for (const OptionText& a : verb.arguments) {
      out += " \\\n            " +
             quoted((a.repeats ? "*:" : ":") + described(a.argument) + ":" + zsh_value(a));
    }
    out += " ;;\n";
  }
  return out + "      esac ;;\n  esac\n}\n_identikal \"$@\"\n";
}

std::string fish_completion(const VerbText& all, const std::vector<VerbText>& verbs) {
  const auto fish_quoted = [](const std::string& text) {
    return "'" + replaced(text, "'\\", "\\") + "'";
  };
  const auto line = [&](const std::string& when, const OptionText& o) {
    std::string out = "complete -c identikal -n " + fish_quoted(when);
    for (const std::string& name : o.names) {
      out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
    }
    if (!o.kind.empty()) out += takes_files(o) ? " -r -F" : " -x";
    if (!o.values.empty()) out += " -a " + fish_quoted(joined(o.values, " "));
    return out + " -d " + fish_quoted(o.help) + "\n";
  };
  std::string out = "# Completion of identikal for fish, made from its command line.\n";
  for (const OptionText& o : all.options) out += line("__fish_use_subcommand", o);
  for (const VerbText& verb : verbs) {
    out += "complete -c identikal -n __fish_use_subcommand -f -a " + verb.name + " -d " +
           fish_quoted(verb.help) + "\n";
  }
  for (const VerbText& verb : verbs) {
    const std::string when = "__fish_seen_subcommand_from " + verb.name;
    for (const OptionText& o : verb.options) out += line(when, o);
    for (const OptionText& a : verb.arguments) {
      if (a.values.empty()) continue;
      out += "complete -c identikal -n " + fish_quoted(when) + " -f -a " +
             fish_quoted(joined(a.values, " ")) + "\n";
    }
  }
  return out;
}

}  // namespace

std::string command_reference(const CLI::App& app, const std::string& kind,
                              const std::string& version, const std::vector<KnownValues>& known) {
  if (kind == "man") return man_page(app, verbs_of(app, known), version);
  const std::vector<VerbText> verbs = first_words(app, known);
  const VerbText all = verb_text(app, {});
  if (kind == "bash") return bash_completion(all, verbs);
  if (kind == "zsh") return zsh_completion(all, verbs);
  if (kind == "fish") return fish_completion(all, verbs);
  throw InputError({}, "--generate '" + kind + "' is not known", "man, bash, zsh or fish");
}

}  // namespace identikal
