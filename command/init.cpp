// init: a commented model file to begin with.
#include <memory>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command/run.h"
#include "command/verbs.h"
#include "identify/model/templates.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

int init(const std::string& name) {
  if (name.empty()) {
    for (const ModelTemplate& each : model_templates()) {
      print(fmt::format("{}\n    {}\n", each.name, purpose_of(each)));
    }
    return 0;
  }
  std::vector<std::string> names;
  for (const ModelTemplate& each : model_templates()) {
    if (each.name == name) {
      print(each.text);
      return 0;
    }
    names.push_back(each.name);
  }
  throw InputError({}, fmt::format("unknown template '{}'", name),
                   fmt::format("one of {}", fmt::join(names, ", ")), did_you_mean(name, names));
}

}  // namespace

Verb init_verb(CLI::App& app) {
  const auto name = std::make_shared<std::string>();
  CLI::App& verb = add_verb(
      app, "init", "Print a commented model file to begin with; without a name, list them.");
  add_optional_argument(verb, "TEMPLATE", *name, "Name of the model file.");
  return {"init", [name](const std::string&) { return init(*name); }};
}

}  // namespace identikal
