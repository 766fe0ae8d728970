// init: a commented model file to begin with.
#include <memory>

#include "jobs/run.h"
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "command/verbs.h"
#include "identify/model/components.h"
#include "identify/model/templates.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

Outcome init(const std::string& name) {
  Outcome out;
  if (name.empty()) {
    for (const ModelTemplate& each : model_templates()) {
      out.text += fmt::format("{}\n    {}\n", each.name, purpose_of(each));
    }
    out.text += fmt::format("components of a model, by name (examples/MODEL_FILE.md):\n    {}\n",
                            fmt::join(component_kinds(), ", "));
    return out;
  }
  std::vector<std::string> names;
  for (const ModelTemplate& each : model_templates()) {
    if (each.name == name) {
      out.text = each.text;
      return out;
    }
    names.push_back(each.name);
  }
  throw InputError({}, fmt::format("unknown template '{}'", name),
                   fmt::format("one of {}", fmt::join(names, ", ")), did_you_mean(name, names));
}

}  // namespace

Verb init_verb() {
  const auto name = std::make_shared<std::string>();
  Verb verb{"init", "Print a commented model file to begin with; without a name, list them."};
  add_optional_argument(verb, "TEMPLATE", *name, "Name of the model file.");
  verb.run = [name](Call&) { return init(*name); };
  return verb;
}

}  // namespace identikal
