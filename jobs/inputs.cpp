#include "jobs/inputs.h"

#include <filesystem>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "identify/model/model_file.h"
#include "identify/model/yaml_reader.h"
#include "identify/result/file_digest.h"

namespace identikal {
namespace {

// Of names and samples, which is all that a recording in memory has.
std::string sha256_of_samples(const Table& table) {
  std::string bytes;
  for (const Column& column : table.columns) {
    bytes += column.name + "\n" + column.unit + "\n";
    bytes.append(reinterpret_cast<const char*>(column.values.data()),
                 column.values.size() * sizeof(double));
  }
  return sha256_of_text(bytes);
}

struct ParsedModel {
  std::string text, name;
  Model model;
};

// What programs give job after job: parsing it takes longer than many a job. One for all threads: for the destructor of a thread's
// own the C library takes memory, and ends the program where there is none. A text that includes files is no part of it, for
// they may change.
class ParsedModels {
 public:
  std::shared_ptr<const ParsedModel> find(const std::string& text, const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& each : all_) {
      if (each->text == text && each->name == name) return each;
    }
    return nullptr;
  }
  void keep(std::shared_ptr<const ParsedModel> parsed) {
    constexpr std::size_t kMost = 8;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (all_.size() == kMost) all_.erase(all_.begin());
    all_.push_back(std::move(parsed));
  }

 private:
  std::mutex mutex_;
  std::vector<std::shared_ptr<const ParsedModel>> all_;  // the oldest first
};

Model parsed_once(const std::string& text, const std::string& name) {
  static ParsedModels known;
  if (const std::shared_ptr<const ParsedModel> found = known.find(text, name)) return found->model;
  Model model = parse_model_file(text, name);
  known.keep(std::make_shared<const ParsedModel>(ParsedModel{text, name, model}));
  return model;
}

}  // namespace

void Inputs::keep_text(const std::string& name, std::string text) {
  kept_[name].text = std::move(text);
}

void Inputs::keep_table(const std::string& name, Table table) {
  kept_[name].table = std::make_shared<const Table>(std::move(table));
}

void Inputs::keep_labels(const std::string& name, std::map<std::string, std::string> labels) {
  labels_[name] = std::move(labels);
}

const std::map<std::string, std::string>& Inputs::labels(const std::string& name) const {
  static const std::map<std::string, std::string> kNone;
  const auto found = labels_.find(name);
  return found == labels_.end() ? kNone : found->second;
}

void Inputs::keep_result(const std::string& name, std::string json, std::string page_data) {
  kept_[name] = {std::move(json), std::move(page_data), "", nullptr, true};
}

bool Inputs::is_in_memory(const std::string& name) const { return kept_.contains(name); }

bool Inputs::is_model(const std::string& name) const {
  if (const auto kept = kept_.find(name); kept != kept_.end()) {
    return !kept->second.table && !kept->second.result;
  }
  const std::string ending = std::filesystem::path(name).extension().string();
  return ending == ".yaml" || ending == ".yml";
}

bool Inputs::is_result(const std::string& name) const {
  if (const auto kept = kept_.find(name); kept != kept_.end()) return kept->second.result;
  std::error_code neither;
  return name.ends_with(".json") || std::filesystem::is_directory(name, neither);
}

bool Inputs::is_recording(const std::string& name) const {
  std::error_code none;
  const bool there = is_in_memory(name) || std::filesystem::exists(name, none);
  return there && !is_model(name) && !is_result(name);
}

const std::string& Inputs::model_text(const std::string& name) {
  if (is_in_memory(name)) return kept_.at(name).text;
  Input& input = read_[name];
  if (input.sha256.empty()) {
    input.text = read_yaml_text(name);
    input.sha256 = sha256_of_text(input.text);
  }
  return input.text;
}

YamlNode Inputs::model_tree(const std::string& name) {
  return parse_with_included(model_text(name), name, included_);
}

std::vector<std::string> Inputs::included(const std::string& name) {
  return included_files(model_text(name), name, included_);
}

Model Inputs::model(const std::string& name, FormulaReading reading) {
  const std::string& text = model_text(name);
  const bool may_include = text.find("include") != std::string::npos;
  if (may_include || reading != FormulaReading::linear) {
    return model_of(model_tree(name), name, reading);
  }
  return parsed_once(text, name);
}

const Table& Inputs::table(const std::string& name) {
  if (const auto kept = kept_.find(name); kept != kept_.end() && kept->second.table) {
    return *kept->second.table;
  }
  Input& input = read_[name];
  if (!input.table) {
    std::string text = read_csv_text(name);
    input.sha256 = sha256_of_text(text);
    input.table = std::make_shared<const Table>(parse_csv(std::move(text), name));
  }
  return *input.table;
}

StoredResult Inputs::result(const std::string& name) {
  if (!is_in_memory(name)) {
    std::shared_ptr<const StoredResult>& known = results_[name];
    if (!known) known = std::make_shared<const StoredResult>(read_stored_result(name));
    return *known;
  }
  StoredResult result;
  result.path = name;
  result.text = kept_.at(name).text;
  result.data = kept_.at(name).page_data;
  return parse_stored_result(std::move(result));
}

std::string Inputs::sha256(const std::string& name) {
  if (is_in_memory(name)) {
    const Input& kept = kept_.at(name);
    return kept.table ? sha256_of_samples(*kept.table) : sha256_of_text(kept.text);
  }
  if (const auto text = included_.find(name); text != included_.end()) {
    return sha256_of_text(text->second);
  }
  const auto read = read_.find(name);
  return read != read_.end() ? read->second.sha256 : sha256_of_file(name);
}

}  // namespace identikal
