#include "fleet/mirrored_options.h"

#include "fleet/task.h"

namespace identikal {

void MirroredOptions::add(Verb& to, const Verb& from) {
  for (const Option& option : from.options) {
    if (!is_option_of_fleet(option)) continue;
    values_.push_back(std::make_unique<Value>());
    Value& value = *values_.back();
    value.name = option.called();
    Option mirrored = option;
    if (option.is_flag()) {
      mirrored.value = &value.flag;
    } else if (option.is_list()) {
      mirrored.value = &value.list;
    } else {
      mirrored.value = &value.text;
    }
    to.options.push_back(std::move(mirrored));
  }
}

std::vector<std::string> MirroredOptions::words() const {
  std::vector<std::string> out;
  for (const std::unique_ptr<Value>& value : values_) {
    if (value->flag) out.push_back(value->name);
    if (!value->text.empty()) out.insert(out.end(), {value->name, value->text});
    for (const std::string& text : value->list) out.insert(out.end(), {value->name, text});
  }
  return out;
}

}  // namespace identikal
