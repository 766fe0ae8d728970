#include "fleet/task.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <stdexcept>

#include "fleet/internal/row_condition.h"
#include "fleet/simulated.h"
#include "jobs/verbs.h"
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "identify/model/included_files.h"
#include "identify/model/yaml_reader.h"
#include "identify/result/file.h"
#include "identify/result/file_digest.h"
#include "lib/base/error.h"
#include "lib/base/nearest_name.h"
#include "lib/data/join.h"
#include "lib/version.h"

namespace identikal {
namespace {

// Files that all recordings would write to, and what the fleet itself says.
const std::vector<std::string> kNotOfFleets = {"--output", "--report", "--json", "--quiet"};

const char* const kAbsent = "absent";

std::vector<std::string> names_of(const Option& option) {
  std::vector<std::string> out;
  for (std::size_t begin = 0; begin <= option.names.size();) {
    const std::size_t end = std::min(option.names.find(',', begin), option.names.size());
    out.push_back(option.names.substr(begin, end - begin));
    begin = end + 1;
  }
  return out;
}

const Option& option_called(const Verb& verb, const std::string& name) {
  std::vector<std::string> known;
  for (const Option& option : verb.options) {
    if (option.is_argument() || !option.now.empty()) continue;
    const std::vector<std::string> names = names_of(option);
    if (std::find(names.begin(), names.end(), name) == names.end()) {
      known.insert(known.end(), names.begin(), names.end());
      continue;
    }
    if (!is_option_of_fleet(option)) {
      throw InputError({}, fmt::format("{} for a recording of a fleet", name), "no such option",
                       "the store holds the results; 'identikal " + verb.name +
                           "' with this recording alone writes files");
    }
    return option;
  }
  throw InputError({}, fmt::format("unknown option '{}' of '{}'", name, verb.name), "",
                   did_you_mean(name, known));
}

// Argument and options of one job, set.
void take_job(const Verb& verb, const FleetTask& task, const FleetJob& job,
              const std::string& recording) {
  for (const Option& option : verb.options) {
    if (option.names == "MODEL" || option.names == "RESULT") take(option, task.model);
    if (option.names == "DATA") take(option, recording);
  }
  std::vector<std::string> words = task.options;
  const std::vector<std::string> own = option_words(job.options);
  words.insert(words.end(), own.begin(), own.end());
  take_words(verb, words);
}

FleetRow row_or_failure(const std::function<Outcome()>& work) {
  try {
    return row_of(work());
  } catch (const InputError& error) {
    return failed_row(2, error.what());
  } catch (const OutputError& error) {
    return failed_row(5, error.what());
  } catch (const std::invalid_argument& error) {
    return failed_row(2, error.what());
  } catch (const std::bad_alloc&) {
    return failed_row(5, "not enough memory");
  } catch (const std::exception& error) {
    return failed_row(5, fmt::format("internal error: {}; please report it", error.what()));
  }
}

std::string host_name() {
  char name[256] = "";
  return gethostname(name, sizeof name - 1) == 0 ? name : "";
}

// Of the files of a recording as they are now; empty where one cannot be read.
std::string sha256_of_files(const std::string& recording, Inputs& inputs) {
  if (is_simulation(recording)) return sha256_of_text(recording);
  std::string out;
  try {
    for (const std::string& file : joined_files(recording)) {
      out += (out.empty() ? "" : "+") + inputs.sha256(file);
    }
  } catch (const std::exception&) {
    return "";
  }
  return out;
}

bool is_result(const FleetTask& task) { return task.verb == "validate"; }

}  // namespace

const std::vector<std::string>& fleet_verb_names() {
  static const std::vector<std::string> kNames = {"tune", "fit", "check", "validate"};
  return kNames;
}

Verb make_fleet_verb(const std::string& name) {
  if (name == "tune") return tune_verb();
  if (name == "fit") return fit_verb();
  if (name == "check") return check_verb();
  if (name == "validate") return validate_verb();
  throw InputError({}, fmt::format("no verb '{}' for a fleet", name),
                   fmt::format("one of {}", fmt::join(fleet_verb_names(), ", ")));
}

bool is_option_of_fleet(const Option& option) {
  if (option.is_argument() || !option.now.empty()) return false;
  return std::find(kNotOfFleets.begin(), kNotOfFleets.end(), option.called()) == kNotOfFleets.end();
}

void take_words(const Verb& verb, const std::vector<std::string>& words,
                const std::string& argument) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (!word.starts_with('-') && !argument.empty()) {
      for (const Option& option : verb.options) {
        if (option.names == argument) take(option, word);
      }
      continue;
    }
    if (!word.starts_with('-')) {
      throw InputError({}, fmt::format("'{}' among options", word), "--name value");
    }
    const std::size_t equals = word.starts_with("--") ? word.find('=') : std::string::npos;
    const std::string name = word.substr(0, equals);
    const Option& option = option_called(verb, name);
    if (option.is_flag()) {
      if (equals != std::string::npos) throw InputError({}, name + " takes no value", name);
      take(option, "");
    } else if (equals != std::string::npos) {
      take(option, word.substr(equals + 1));
    } else if (i + 1 < words.size()) {
      take(option, words[++i]);
    } else {
      throw InputError({}, name + " has no value", "one");
    }
  }
}

std::string digest_of(const FleetTask& task) {
  std::string all = fmt::format("{}\n{}\n{}\n", IDENTIKAL_VERSION, task.verb, task.by);
  for (const std::string& option : task.options) all += option + "\n";
  if (is_result(task)) {
    all += sha256_of_text(read_stored_result(task.model).text);
  } else {
    const std::string text = read_yaml_text(task.model);
    all += sha256_of_text(text);
    for (const std::string& file : included_files(text, task.model)) all += sha256_of_file(file);
  }
  return sha256_of_text(all);
}

std::string stamp_of(const std::string& recording) {
  if (is_simulation(recording)) return "simulated";
  std::string out;
  for (const std::string& file : joined_files(recording)) {
    struct stat status {};
    if (stat(file.c_str(), &status) != 0) return kAbsent;
    out += fmt::format("{}{}:{}.{:09}", out.empty() ? "" : "+", status.st_size,
                       status.st_mtim.tv_sec, status.st_mtim.tv_nsec);
  }
  return out;
}

struct JobRunner::Shared {
  FleetTask task;
  std::string host = host_name();
  std::string model_text;  ///< of a model, or of a result
  std::string result_data;
  // The file that rows were last taken of.
  std::string file, stamp, text, sha256;
  Table table;

  void read(const std::string& recording, const std::string& its_stamp);
  Inputs inputs() const;
  FleetRow row(const FleetJob& job, const std::string& recording, Inputs& inputs) const;
  void parts(const FleetJob& job, std::size_t first_part,
             const std::function<void(FleetRow row)>& each);
};

void JobRunner::Shared::read(const std::string& recording, const std::string& its_stamp) {
  if (recording == file && its_stamp == stamp) return;
  file.clear();
  if (is_simulation(recording)) {
    throw InputError({recording}, "rows of a simulation", "whole recordings",
                     "--by and 'where' choose rows of a file");
  }
  if (joined_files(recording).size() > 1) {
    throw InputError({recording}, "rows of files that are joined", "one file",
                     "--by and 'where' choose rows of a single one");
  }
  text = read_csv_text(recording);
  sha256 = sha256_of_text(text);
  table = parse_csv(text, recording);
  file = recording;
  stamp = its_stamp;
}

Inputs JobRunner::Shared::inputs() const {
  Inputs out;
  if (is_result(task)) {
    out.keep_result(task.model, model_text, result_data);
  } else {
    out.keep_text(task.model, model_text);
  }
  return out;
}

FleetRow JobRunner::Shared::row(const FleetJob& job, const std::string& recording,
                                Inputs& inputs) const {
  return row_or_failure([&] {
    if (is_simulation(recording)) {
      if (is_result(task)) {
        throw InputError({recording}, "'validate' of a simulation", "recordings",
                         "'fleet check' tests a model on its own simulations");
      }
      inputs.keep_table(recording, simulated_table(recording, task.model, inputs));
    }
    const Verb verb = make_fleet_verb(task.verb);
    take_job(verb, task, job, recording);
    Call call;
    call.wants_text = false;
    call.inputs = std::move(inputs);
    Outcome out = verb.run(call);
    inputs = std::move(call.inputs);
    return out;
  });
}

void JobRunner::Shared::parts(const FleetJob& job, std::size_t first_part,
                              const std::function<void(FleetRow row)>& each) {
  const std::vector<std::size_t> rows = rows_where(job.where, text, table);
  std::vector<RowGroup> groups{{"", rows}};
  if (!task.by.empty()) groups = groups_by(task.by, text, table, rows);
  for (std::size_t i = first_part; i < groups.size(); ++i) {
    Inputs own = inputs();
    const std::string name =
        task.by.empty() ? job.recording
                        : fmt::format("{} ({} = {})", job.recording, task.by, groups[i].value);
    Table part = rows_at(table, groups[i].rows);
    part.path = name;
    own.keep_table(name, std::move(part));
    FleetRow out = row(job, name, own);
    out.part = groups[i].value;
    each(std::move(out));
  }
}

JobRunner::JobRunner(FleetTask task) : shared_(std::make_unique<Shared>()) {
  shared_->task = std::move(task);
  if (is_result(shared_->task)) {
    StoredResult result = read_stored_result(shared_->task.model, PageData::if_there);
    shared_->model_text = std::move(result.text);
    shared_->result_data = std::move(result.data);
  } else {
    shared_->model_text = read_yaml_text(shared_->task.model);
  }
}

JobRunner::~JobRunner() = default;

FleetResult JobRunner::run(const StoredJob& job, std::size_t first_part,
                           const std::function<void(FleetRow row)>& each) {
  const auto begin = std::chrono::steady_clock::now();
  FleetResult out;
  out.number = job.number;
  out.task = shared_->task.digest;
  out.host = shared_->host;
  const FleetJob& of = job.job;
  out.stamp = stamp_of(of.recording);
  Inputs inputs = shared_->inputs();
  const bool same_task = job.task == out.task && !job.again && !job.sha256.empty();
  if (same_task && sha256_of_files(of.recording, inputs) == job.sha256) {
    out.unchanged = true;
    return out;
  }
  const auto take = [&](FleetRow row) {
    if (row.exit_code == 5) out.again = true;
    each(std::move(row));
  };
  if (shared_->task.by.empty() && of.where.empty()) {
    if (first_part == 0) take(shared_->row(of, of.recording, inputs));
    out.sha256 = sha256_of_files(of.recording, inputs);
  } else {
    try {
      shared_->read(of.recording, out.stamp);
      shared_->parts(of, first_part, take);
      out.sha256 = shared_->sha256;
    } catch (const InputError& error) {
      take(failed_row(2, error.what()));
    } catch (const std::bad_alloc&) {
      take(failed_row(5, "not enough memory"));
    }
  }
  // What could not be read may be readable the next time; what is not there, when it is.
  if (out.sha256.empty() && out.stamp != kAbsent) out.again = true;
  out.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return out;
}

}  // namespace identikal
