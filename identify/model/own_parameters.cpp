#include "identify/model/own_parameters.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "identify/model/matrix_reader.h"
#include "lib/base/error.h"
#include "lib/model/linear_model.h"

namespace identikal {
namespace {

using Eigen::Index;

std::string stem_of(const std::string& name) { return std::filesystem::path(name).stem().string(); }

// As formulas can have it.
std::string as_name(std::string label) {
  for (char& c : label) {
    if (!is_name(std::string("x") + c)) c = '_';
  }
  return label;
}

const RecordingTable::Row* row_of(const RecordingTable& table, const std::string& recording) {
  const auto found = std::find_if(table.rows.begin(), table.rows.end(), [&](const auto& row) {
    return row.recording == recording || row.recording == stem_of(recording);
  });
  return found == table.rows.end() ? nullptr : &*found;
}

// Gives recordings their own parameters, and adds those to the model.
class Placing {
 public:
  Placing(Model& model, bool may_add) : model_(model), may_add_(may_add) {}

  void place(std::vector<Dataset>& recordings) {
    name_recordings(recordings);
    std::set<int> named;
    for (const auto& own : model_.recordings.own) named.insert(own.parameter);
    for (const auto& row : model_.recordings.rows) {
      for (const auto& [parameter, value] : row.numbers) named.insert(parameter);
      for (const auto& [parameter, source] : row.sources) named.insert(parameter);
    }
    for (Dataset& recording : recordings) {
      recording.own.clear();
      for (const int parameter : named) {
        if (const int source = source_of(parameter, recording); source >= 0) {
          recording.own.push_back({parameter, source});
        }
      }
    }
    if (may_add_) retire_replaced(named, recordings);
  }

 private:
  // A name has to mean the same recording whichever others are there.
  void name_recordings(const std::vector<Dataset>& recordings) {
    std::map<std::string, std::string> taken;
    for (const Dataset& recording : recordings) {
      const std::string name = as_name(stem_of(recording.name));
      const std::string& first = taken.try_emplace(name, recording.name).first->second;
      if (first != recording.name) {
        throw InputError({recording.name, 0, 0},
                         fmt::format("parameters of this recording and of {} would have the same "
                                     "names, '..._{}'",
                                     first, name),
                         "files whose names differ in letters or digits");
      }
      names_[recording.name] = name;
    }
  }

  // The parameter that has this one's value here; -1: itself.
  int source_of(int parameter, const Dataset& recording) {
    const RecordingTable& table = model_.recordings;
    const RecordingTable::Row* row = row_of(table, recording.name);
    if (row != nullptr) {
      if (const auto number = row->numbers.find(parameter); number != row->numbers.end()) {
        return added(parameter, names_.at(recording.name), recording, number->second);
      }
      if (const auto source = row->sources.find(parameter); source != row->sources.end()) {
        return source->second;
      }
    }
    const auto own = std::find_if(table.own.begin(), table.own.end(),
                                  [&](const auto& each) { return each.parameter == parameter; });
    if (own == table.own.end()) return -1;
    return added(parameter, label_of(*own, row, recording), recording, std::nullopt);
  }

  std::string label_of(const RecordingTable::Own& own, const RecordingTable::Row* row,
                       const Dataset& recording) const {
    if (own.label.empty()) return names_.at(recording.name);
    if (row != nullptr && row->labels.contains(own.label)) {
      return as_name(row->labels.at(own.label));
    }
    throw InputError(
        row != nullptr ? row->at : Location{model_.source, 0, 0},
        fmt::format("recording '{}' has no {}, and '{}' has a value for each", recording.name,
                    own.label, model_.parameters[static_cast<std::size_t>(own.parameter)].name),
        fmt::format("recordings: {{{}: {{{}: NAME}}}}", stem_of(recording.name), own.label));
  }

  int added(int parameter, const std::string& label, const Dataset& recording,
            std::optional<double> known) {
    const Parameter& of = model_.parameters[static_cast<std::size_t>(parameter)];
    const std::string name = of.name + "_" + label;
    const int there = find_parameter(model_.parameters, name);
    if (there >= 0) {
      if (model_.parameters[static_cast<std::size_t>(there)].scope == Scope::recording)
        return there;
      throw InputError({model_.source, 0, 0},
                       fmt::format("'{}' is a parameter, and what '{}' would be called in '{}'",
                                   name, of.name, recording.name),
                       "another name of one of them");
    }
    Parameter own = of;
    own.name = name;
    own.scope = Scope::recording;
    if (known) {
      own.value.setConstant(*known);
      own.fixed = true;
      own.prior = {};
    } else if (!own.fixed) {
      start(own, of, recording);
    }
    model_.parameters.push_back(std::move(own));
    return static_cast<int>(model_.parameters.size()) - 1;
  }

  void start(Parameter& own, const Parameter& of, const Dataset& recording) const {
    const std::map<std::string, double>& found = model_.recordings.found;
    if (const auto value = found.find(own.name); value != found.end()) {
      own.value.setConstant(value->second);
      return;
    }
    if ((found.empty() && may_add_) || is_of_population(of)) return;  // it starts at the mean
    throw InputError({recording.name, 0, 0},
                     fmt::format("no value of '{}' is known for this recording", of.name),
                     fmt::format("a number under 'recordings' of {}", model_.source),
                     fmt::format("it would be called '{}'", own.name));
  }

  bool is_of_population(const Parameter& of) const {
    return is_drawn(model_, find_parameter(model_.parameters, of.name));
  }

  // What no recording takes any more stands for nothing.
  void retire_replaced(const std::set<int>& named, const std::vector<Dataset>& recordings) {
    std::set<int> used;
    for (const Dataset& recording : recordings) {
      std::set<int> own;
      for (const OwnParameter& each : recording.own) {
        own.insert(each.parameter);
        used.insert(each.source);
      }
      for (const int parameter : named) {
        if (!own.contains(parameter)) used.insert(parameter);
      }
    }
    for (const int parameter : named) {
      if (used.contains(parameter)) continue;
      Parameter& p = model_.parameters[static_cast<std::size_t>(parameter)];
      p.fixed = true;
      if (!is_of_population(p)) p.scope = Scope::replaced;  // else it is the mean
    }
  }

  Model& model_;
  const bool may_add_;
  std::map<std::string, std::string> names_;
};

}  // namespace

Model for_recordings(Model model, std::vector<Dataset>& recordings) {
  if (!model.recordings.empty()) Placing(model, true).place(recordings);
  return model;
}

void place_recordings(Model& model, std::vector<Dataset>& recordings) {
  if (!model.recordings.empty()) Placing(model, false).place(recordings);
}

int own_parameter_named(const Model& model, const std::string& name) {
  for (const auto& own : model.recordings.own) {
    const std::string begin = model.parameters[static_cast<std::size_t>(own.parameter)].name + "_";
    if (name.size() > begin.size() && name.starts_with(begin)) return own.parameter;
  }
  for (const auto& row : model.recordings.rows) {
    for (const auto& [parameter, value] : row.numbers) {
      const std::string& of = model.parameters[static_cast<std::size_t>(parameter)].name;
      if (name == of + "_" + as_name(stem_of(row.recording))) return parameter;
    }
  }
  return -1;
}

bool varies_by_logarithm(const Parameter& parameter) { return parameter.min >= 0.0; }

bool has_population(const Model& model) {
  const std::vector<RecordingTable::Own>& own = model.recordings.own;
  return std::any_of(own.begin(), own.end(), [](const auto& each) { return each.spread >= 0; });
}

bool is_drawn(const Model& model, int parameter) {
  const std::vector<RecordingTable::Own>& own = model.recordings.own;
  return std::any_of(own.begin(), own.end(), [&](const auto& each) {
    return each.spread >= 0 && each.parameter == parameter;
  });
}

bool has_own_values(const Model& model, int parameter) {
  const RecordingTable& table = model.recordings;
  const auto owns = [&](const auto& own) { return own.parameter == parameter; };
  const auto names = [&](const RecordingTable::Row& row) {
    return row.numbers.contains(parameter) || row.sources.contains(parameter);
  };
  return std::any_of(table.own.begin(), table.own.end(), owns) ||
         std::any_of(table.rows.begin(), table.rows.end(), names);
}

ParameterSet values_in(const ParameterSet& at, const Dataset& recording) {
  ParameterSet out = at;
  for (const OwnParameter& own : recording.own) {
    out[static_cast<std::size_t>(own.parameter)].value =
        at[static_cast<std::size_t>(own.source)].value;
  }
  return out;
}

std::vector<int> sources_in(const ParameterSet& joint, const Dataset& recording) {
  std::vector<int> out;
  for (const Parameter& p : joint) {
    if (p.scope == Scope::recording) break;  // those that were added are the last
    out.push_back(static_cast<int>(out.size()));
  }
  for (const OwnParameter& own : recording.own) {
    out[static_cast<std::size_t>(own.parameter)] = own.source;
  }
  return out;
}

namespace {

// Free is what a recording's model is differentiated by.
ParameterSet free_in(const ParameterSet& joint, const std::vector<int>& sources) {
  ParameterSet out(joint.begin(), joint.begin() + static_cast<std::ptrdiff_t>(sources.size()));
  for (std::size_t i = 0; i < out.size(); ++i) {
    const Parameter& source = joint[static_cast<std::size_t>(sources[i])];
    out[i].value = source.value;
    out[i].fixed = source.fixed;
  }
  return out;
}

}  // namespace

Model model_in(const Model& model, const Dataset& recording) {
  Model out = model;
  out.recordings = {};
  out.parameters = free_in(model.parameters, sources_in(model.parameters, recording));
  if (changes(out) && !changes(noise_model(out)) && !as_formulas(out).irregular) {
    LinearModel constant = noise_model(out);
    out.form = std::move(constant);
  }
  return out;
}

std::vector<Index> owners_of_entries(const Model& model, const std::vector<Dataset>& recordings,
                                     const std::vector<Index>& unit) {
  constexpr Index kNobody = -2;
  const ParameterSet& parameters = model.parameters;
  std::vector<Index> of_parameter(parameters.size(), -1);
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    if (parameters[i].scope == Scope::recording) of_parameter[i] = kNobody;
  }
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const Index own_unit = unit.empty() ? static_cast<Index>(r) : unit[r];
    for (const OwnParameter& own : recordings[r].own) {
      Index& of = of_parameter[static_cast<std::size_t>(own.source)];
      if (of == kNobody) of = own_unit;
      if (of != own_unit) of = -1;
    }
  }
  std::vector<Index> out;
  for (const EntryDerivative& entry : entry_derivatives(parameters)) {
    out.push_back(std::max<Index>(-1, of_parameter[static_cast<std::size_t>(entry.parameter)]));
  }
  return out;
}

std::vector<Index> joint_entries(const Model& model, const Dataset& recording) {
  const std::vector<int> sources = sources_in(model.parameters, recording);
  std::map<int, Index> first;  // entry of each free parameter
  const std::vector<EntryDerivative> joint = entry_derivatives(model.parameters);
  for (std::size_t i = 0; i < joint.size(); ++i) {
    first.try_emplace(joint[i].parameter, static_cast<Index>(i));
  }
  std::vector<Index> out;
  int before = -1;
  Index within = 0;
  for (const EntryDerivative& each : entry_derivatives(free_in(model.parameters, sources))) {
    within = each.parameter == before ? within + 1 : 0;
    before = each.parameter;
    out.push_back(first.at(sources[static_cast<std::size_t>(each.parameter)]) + within);
  }
  return out;
}

}  // namespace identikal
