// What does a job read? Files, or what a program has in memory under a name: each is read once, so that what is parsed is
// what is hashed and kept.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "identify/model/included_files.h"
#include "identify/model/model.h"
#include "identify/model/model_file.h"
#include "identify/result/file.h"
#include "lib/data/csv.h"

namespace identikal {

class Inputs {
 public:
  /// From here on the name stands for this text: a model.
  void keep_text(const std::string& name, std::string text);
  /// From here on the name stands for this recording.
  void keep_table(const std::string& name, Table table);
  /// What is known of this recording: a label of parameters' `per`, and its value there.
  void keep_labels(const std::string& name, std::map<std::string, std::string> labels);
  const std::map<std::string, std::string>& labels(const std::string& name) const;
  /// From here on the name stands for this result. @param page_data  kReportDataFile's text
  void keep_result(const std::string& name, std::string json, std::string page_data);

  bool is_in_memory(const std::string& name) const;
  /// A text in memory that is no result, or a file whose name ends like that of a model file.
  bool is_model(const std::string& name) const;
  /// A result in memory, or a path that may hold one: a folder, or a file whose name ends in .json.
  bool is_result(const std::string& name) const;
  /// A recording in memory, or a file that is neither model nor result.
  bool is_recording(const std::string& name) const;
  /// A model file's bytes. @throws InputError as read_yaml_text()
  const std::string& model_text(const std::string& name);
  /// That file's keys and values with those of the files that it includes.
  /// @throws InputError as parse_with_included()
  YamlNode model_tree(const std::string& name);
  /// Paths of the files that it includes, and of those that they include.
  std::vector<std::string> included(const std::string& name);
  /// The bytes of one of them.
  const std::string& included_text(const std::string& path) const { return included_.at(path); }
  /// That file, parsed. @throws InputError as parse_model_file()
  Model model(const std::string& name, FormulaReading reading = FormulaReading::linear);
  /// @throws InputError as read_csv()
  const Table& table(const std::string& name);
  /// @throws InputError as read_stored_result()
  StoredResult result(const std::string& name);
  /// SHA-256 of what was read, or of the samples that a program gave, in hexadecimal.
  std::string sha256(const std::string& name);

 private:
  struct Input {
    std::string text, page_data, sha256;
    std::shared_ptr<const Table> table;
    bool result = false;
  };

  std::map<std::string, Input> read_, kept_;
  std::map<std::string, std::shared_ptr<const StoredResult>> results_;
  FileTexts included_;
  std::map<std::string, std::map<std::string, std::string>> labels_;
};

}  // namespace identikal
