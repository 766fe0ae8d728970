#include "interface/run.h"

#include <algorithm>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <utility>
#include <variant>
#include <vector>

#include "interface/json_options.h"
#include "interface/recording_table.h"
#include "jobs/verbs.h"
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/model/model_file.h"
#include "identify/report/page.h"
#include "identify/result/estimated_model.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/version.h"

namespace identikal {

std::string model_name_in_memory(std::size_t index) {
  return index == 0 ? "<model>" : fmt::format("<model {}>", index + 1);
}

std::string recording_name_in_memory(std::size_t index) {
  return fmt::format("<recording {}>", index + 1);
}

std::string result_name_in_memory(std::size_t index) {
  return fmt::format("<result {}>", index + 1);
}

void guarded(ik_result& result, const std::function<void()>& work) noexcept {
  try {
    try {
      work();
    } catch (const InputError& error) {
      result.code = 2;
      result.message = error.what();
    } catch (const OutputError& error) {
      result.code = 5;
      result.message = error.what();
    } catch (const std::invalid_argument& error) {
      result.code = 2;
      result.message = error.what();
    } catch (const std::bad_alloc&) {
      result.code = 5;
      result.message = "out of memory";
    } catch (const std::exception& error) {
      result.code = 5;
      result.message = fmt::format("internal error: {}; please report it", error.what());
    }
  } catch (...) {  // no memory for the message
    result.code = 5;
  }
}

namespace {

using MakeVerb = Verb (*)();

struct NamedVerb {
  const char* name;
  MakeVerb make;
};

constexpr NamedVerb kVerbs[] = {
    {"tune", tune_verb},       {"fit", fit_verb},           {"check", check_verb},
    {"shape", shape_verb},     {"track", track_verb},       {"filter", filter_verb},
    {"bound", bound_verb},     {"simulate", simulate_verb}, {"validate", validate_verb},
    {"compare", compare_verb}, {"handling", handling_verb}, {"forecast", forecast_verb},
    {"model", model_verb}};

// It makes the model that others are given.
constexpr const char* kFromDataAlone = "model";

MakeVerb verb_called(const std::string& name) {
  std::vector<std::string> names;
  for (const NamedVerb& each : kVerbs) {
    if (name == each.name) return each.make;
    names.emplace_back(each.name);
  }
  throw InputError({}, fmt::format("unknown verb '{}'", name),
                   fmt::format("one of {}", fmt::join(names, ", ")), did_you_mean(name, names));
}

void check_arguments(const Arguments& given, const std::string& verb) {
  if (given.count > 0 && given.recordings == nullptr) {
    throw InputError({}, fmt::format("recordings is NULL and count is {}", given.count),
                     "an array of them");
  }
  for (std::size_t i = 0; i < given.previous_count; ++i) {
    const bool there = given.previous != nullptr && given.previous[i] != nullptr;
    if (there && given.previous[i]->outcome.json.exists()) continue;
    if (!there) {
      throw InputError({}, fmt::format("previous result {} is NULL", i + 1), "a result");
    }
    throw InputError({},
                     fmt::format("previous result {} is of '{}' and holds no estimate (code {})",
                                 i + 1, given.previous[i]->verb, given.previous[i]->code),
                     "one of tune, fit, check, shape or track with code 0, 1, 3 or 4");
  }
  const bool has_model = !given.models.empty();
  const bool of_models = verb == "compare" && given.models.size() > 1;
  const bool of_results = verb == "validate" || (verb == "compare" && !of_models) ||
                          (verb == "handling" && given.previous_count > 0);
  const bool of_data = verb == kFromDataAlone;
  if (of_data && has_model) {
    throw InputError({}, "'model' with a model", "recordings alone: it finds the model");
  }
  if (of_results && has_model) {
    throw InputError({}, fmt::format("'{}' with a model", verb),
                     "previous results, which hold their models");
  }
  if (verb == "compare" && !of_models && given.count + given.files.size() > 0) {
    throw InputError({},
                     fmt::format("'compare' with {} recordings", given.count + given.files.size()),
                     "previous results alone, which say what they were fitted to");
  }
  if (!of_results && !of_data && !has_model) {
    throw InputError({}, "model_yaml is NULL", "the text of a model file");
  }
  const bool of_one = verb == "validate" || verb == "filter" || verb == "forecast" ||
                      verb == "simulate" || verb == "handling";
  const bool of_several = verb == "compare" && !of_models;
  const std::size_t least = verb == "validate" ? 1 : of_several ? 2 : 0;
  const std::size_t most = of_several ? 1000 : of_one ? 1 : 0;
  if (given.previous_count < least || given.previous_count > most) {
    throw InputError(
        {}, fmt::format("{} previous results for '{}'", given.previous_count, verb),
        least == most ? fmt::format("{}", least) : fmt::format("from {} to {}", least, most));
  }
}

std::vector<std::string> model_names(const Arguments& given) {
  std::vector<std::string> out;
  for (const GivenModel& each : given.models) {
    out.push_back(each.file.empty() ? model_name_in_memory(out.size()) : each.file);
  }
  return out;
}

// Channels that no model names: y and u, with numbers where there are several.
Model channels_of(const ik_recording& given) {
  Model out;
  const auto name = [](const char* letter, std::size_t count) {
    std::vector<ChannelSource> all(count);
    for (std::size_t i = 0; i < count; ++i) {
      all[i].name = count == 1 ? letter : fmt::format("{}{}", letter, i + 1);
      all[i].column = all[i].name;
    }
    return all;
  };
  out.outputs = name("y", given.ny);
  out.inputs = name("u", given.nu);
  if (given.time != nullptr || given.step != 0.0) out.time.column = "time";
  return out;
}

// The names of columns from..from+count of a table as an option takes them.
std::string listed(const Table& table, std::size_t from, std::size_t count) {
  std::string out;
  for (std::size_t i = from; i < from + count; ++i) {
    const std::string& name = table.columns[i].name;
    if (name.find(',') != name.npos) {
      throw InputError({}, fmt::format("the name '{}' has a comma", name), "names without commas");
    }
    out += (i == from ? "" : ",") + name;
  }
  return out;
}

// The first model says which columns a recording has.
Model model_of_recordings(const Arguments& given, const std::string& verb, Inputs& inputs) {
  if (verb == kFromDataAlone) return channels_of(given.recordings[0]);
  if (verb == "validate" || (verb == "handling" && given.previous_count > 0)) {
    const StoredResult result = inputs.result(result_name_in_memory(0));
    return estimated_model(result.estimate, result.path);
  }
  return given.models.empty() ? Model() : inputs.model(model_names(given).front());
}

void keep_inputs(const Arguments& given, ik_result& result) {
  Inputs& inputs = result.inputs;
  const std::string& verb = result.verb;
  for (std::size_t i = 0; i < given.models.size(); ++i) {
    const GivenModel& each = given.models[i];
    if (each.file.empty()) inputs.keep_text(model_name_in_memory(i), each.text);
  }
  for (std::size_t i = 0; i < given.previous_count; ++i) {
    const Outcome& outcome = given.previous[i]->outcome;
    inputs.keep_result(result_name_in_memory(i), outcome.json.text(), outcome.page_data);
  }
  if (given.count == 0) return;
  const Model model = model_of_recordings(given, verb, inputs);
  const bool with_outputs = verb != "bound" && verb != "simulate";
  for (std::size_t i = 0; i < given.count; ++i) {
    const std::string name = recording_name_in_memory(i);
    const ik_recording& recording = given.recordings[i];
    Table table = recording_table(recording, model, name, with_outputs);
    if (verb == kFromDataAlone && i == 0) {
      const std::size_t first = table.columns.size() - recording.ny - recording.nu;
      result.output_columns = listed(table, first, recording.ny);
      result.input_columns = listed(table, first + recording.ny, recording.nu);
    }
    inputs.keep_table(name, std::move(table));
  }
}

// What the command line takes as arguments.
void take_arguments(const Verb& verb, const ik_result& result) {
  const Inputs& inputs = result.inputs;
  const auto names = [&](std::string (*name)(std::size_t)) {
    std::vector<std::string> out;
    while (inputs.is_in_memory(name(out.size()))) out.push_back(name(out.size()));
    return out;
  };
  std::vector<std::string> recordings = names(recording_name_in_memory);
  recordings.insert(recordings.end(), result.files.begin(), result.files.end());
  const std::vector<std::string> results = names(result_name_in_memory);
  for (const Option& option : verb.options) {
    std::vector<std::string> values;
    if (option.names == "MODEL") values = result.models;
    if (option.names == "RESULT" || option.names == "--from") values = results;
    if (option.names == "DATA") values = recordings;
    const bool is_channels = option.names == "--input" || option.names == "--output";
    if (verb.name == kFromDataAlone && is_channels) {
      const std::string& columns =
          option.names == "--input" ? result.input_columns : result.output_columns;
      if (!columns.empty()) values = {columns};
    }
    if (option.names == "FILES") {
      values = results;
      values.insert(values.end(), result.models.begin(), result.models.end());
      values.insert(values.end(), recordings.begin(), recordings.end());
    }
    if (option.is_argument() && option.required && values.empty()) {
      throw InputError({}, fmt::format("'{}' without a recording", verb.name), "one at least");
    }
    if (!option.is_list() && values.size() > 1) {
      throw InputError({}, fmt::format("'{}' with {} recordings", verb.name, values.size()), "one");
    }
    for (const std::string& value : values) take(option, value);
  }
}

void ask_for_json(const Verb& verb) {
  for (const Option& option : verb.options) {
    if (option.names == "--json") take(option, "");
  }
}

// A verb, and the values of its options before any is taken.
class ReadyVerb {
 public:
  explicit ReadyVerb(const std::string& name) : verb_(verb_called(name)()) {
    for (const Option& option : verb_.options) {
      defaults_.push_back(
          std::visit([](const auto* value) { return OptionValue(*value); }, option.value));
    }
  }
  const Verb& verb() const { return verb_; }
  void reset() {
    for (std::size_t i = 0; i < defaults_.size(); ++i) {
      std::visit(
          [&](auto* value) {
            *value = std::get<std::remove_pointer_t<decltype(value)>>(defaults_[i]);
          },
          verb_.options[i].value);
    }
  }

 private:
  using OptionValue = std::variant<bool, std::int64_t, std::string, std::vector<std::string>>;
  Verb verb_;
  std::vector<OptionValue> defaults_;
};

// The one that this thread used last: to say what all of its options are takes a tenth of a short
// fit. It is nobody's while it is used: a job may call another one as it reports progress.
std::optional<ReadyVerb>& last_verb() {
  thread_local std::optional<ReadyVerb> verb;
  return verb;
}

ReadyVerb take_verb(const std::string& name) {
  std::optional<ReadyVerb> known = std::exchange(last_verb(), std::nullopt);
  if (!known || known->verb().name != name) return ReadyVerb(name);
  known->reset();
  return *std::move(known);
}

Outcome run_verb(const ik_result& result, bool wants_page, const Progress& progress,
                 const GoesOn& goes_on) {
  ReadyVerb ready = take_verb(result.verb);
  const Verb& verb = ready.verb();
  take_arguments(verb, result);
  ask_for_json(verb);
  take_json_options(verb, result.options);
  Call call;
  call.inputs = result.inputs;
  call.wants_page = wants_page;
  call.wants_series = true;
  call.wants_text = false;
  call.progress = progress;
  call.goes_on = goes_on;
  Outcome out = verb.run(call);
  last_verb() = std::move(ready);
  return out;
}

Progress progress_of(const ik_callbacks* callbacks) {
  if (callbacks == nullptr || callbacks->size < sizeof(ik_callbacks) || !callbacks->progress)
    return {};
  return [callbacks](const std::string& what, double share, double value) {
    return callbacks->progress(callbacks->user, what.c_str(), share, value) != 0;
  };
}

}  // namespace

void run(ik_result& result, const Arguments& given, const Progress& progress,
         const GoesOn& goes_on) {
  verb_called(result.verb);  // throws unless there is one
  check_arguments(given, result.verb);
  result.models = model_names(given);
  result.files = given.files;
  keep_inputs(given, result);
  result.outcome = run_verb(result, false, progress, goes_on);
  result.code = result.outcome.exit_code;
  result.message = result.outcome.message;
}

void check_call(const std::string& verb,
                const std::vector<std::pair<std::string, std::string>>& models,
                const std::string& options) {
  const Verb made = verb_called(verb)();
  take_json_options(made, options);
  for (const auto& [text, file] : models) {
    file.empty() ? parse_model_file(text, model_name_in_memory()) : read_model_file(file);
  }
}

void draw_page(ik_result& result) {
  if (!result.outcome.json.exists() || !result.page.empty()) return;
  const Outcome drawn = run_verb(result, true, {}, {});
  if (!drawn.page_data.empty()) result.page = report_page(drawn.json.text(), drawn.page_data);
}

}  // namespace identikal

using identikal::guarded;
using identikal::InputError;

int ik_run(const char* verb, const char* model_yaml, const ik_recording* recordings, size_t count,
           const ik_result* const* previous, size_t previous_count, const char* options_json,
           const ik_callbacks* callbacks, ik_result** result) {
  std::unique_ptr<ik_result> out(new (std::nothrow) ik_result);
  if (!out) {
    if (result != nullptr) *result = nullptr;
    return 5;
  }
  guarded(*out, [&] {
    if (verb == nullptr) throw InputError({}, "verb is NULL", "tune, fit, ...");
    out->verb = verb;
    out->options = options_json != nullptr ? options_json : "{}";
    identikal::Arguments given{{}, recordings, count, previous, previous_count};
    if (model_yaml != nullptr) given.models.push_back({model_yaml, ""});
    identikal::run(*out, given, identikal::progress_of(callbacks));
  });
  const int code = out->code;
  if (result != nullptr) *result = out.release();
  return code;
}

const char* ik_result_json(const ik_result* result) {
  if (result == nullptr) return "";
  const identikal::Outcome& outcome = result->outcome;
  if (!outcome.json.exists()) return outcome.text.c_str();
  const char* text = "";
  ik_result problem;
  guarded(problem, [&] { text = outcome.json.text().c_str(); });
  return text;
}

const char* ik_result_message(const ik_result* result) {
  return result == nullptr ? "there is no result" : result->message.c_str();
}

const double* ik_result_series(const ik_result* result, const char* name, size_t* rows,
                               size_t* cols) {
  if (rows != nullptr) *rows = 0;
  if (cols != nullptr) *cols = 0;
  if (result == nullptr || name == nullptr) return nullptr;
  for (const identikal::NamedSeries& series : result->outcome.series) {
    if (series.name != name) continue;
    if (rows != nullptr) *rows = static_cast<size_t>(series.values.rows());
    if (cols != nullptr) *cols = static_cast<size_t>(series.values.cols());
    return series.values.data();
  }
  return nullptr;
}

const char* ik_result_report_html(ik_result* result) {
  if (result == nullptr) return "";
  ik_result problem;
  guarded(problem, [&] { identikal::draw_page(*result); });
  return result->page.c_str();
}

void ik_result_free(ik_result* result) { delete result; }

const char* ik_version(void) { return IDENTIKAL_VERSION; }
