// Which model and which recordings does a command line name?
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "command/arguments.h"
#include "identify/estimate/estimate.h"
#include "identify/filter/simulated_fit.h"
#include "identify/model/model_file.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

namespace identikal {

/// @throws InputError naming the verb
void require_linear(const Arguments& args, const ModelFile& model);
/// A model whose filter is to run: matrices or formulas. @throws InputError
void require_filter(const Arguments& args, const ModelFile& model);

/// The model file with --from, --set and --filter applied. @throws InputError
ModelFile load_model(const Arguments& args);
/// Does this argument look like a model file rather than a recording?
bool is_model(const std::string& path);

/// The files that one DATA argument names, read. @throws InputError
std::vector<Table> read_files(const std::string& argument);
/// One recording, or several where the model file says that time restarts or rows are left out.
/// @throws InputError
std::vector<Dataset> load_runs(const Arguments& args, const std::vector<Table>& files,
                               const ModelFile& model, bool with_outputs = true);
/// The same where there has to be one.
Dataset load_data(const Arguments& args, const std::vector<Table>& files, const ModelFile& model,
                  bool with_outputs = true);

struct Recordings {
  std::vector<Dataset> data;
  std::vector<Dataset> held_out;                                ///< what the estimator does not see
  std::vector<InputRecord> records;                             ///< one per file
  std::vector<std::pair<std::size_t, std::size_t>> of_records;  ///< recordings [from, to) of a file

  std::vector<Warning> warnings;  ///< of how they go with the model

  /// What was loaded from the files of one argument.
  void add(std::vector<Dataset> runs, const std::vector<Table>& files, const TimeRange& range);
};
/// Those of all DATA arguments. @throws InputError
Recordings load_recordings(const Arguments& args, const ModelFile& model);
/// A linear model has one sampling period. @throws InputError when that of `other` is another
void check_period(const Arguments& args, const ModelFile& model, const Dataset& first,
                  const Dataset& other);

/// --hold-out: the last share of every recording, which is taken from it, or another recording.
/// The record of a file that is one recording says which range is left.
/// @throws InputError
std::vector<HeldOut> hold_out(const Arguments& args, const ModelFile& model,
                              Recordings& recordings);

}  // namespace identikal
