// Which model and which recordings does a command line name?
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "jobs/inputs.h"
#include "jobs/options.h"

#include "identify/estimate/results.h"
#include "identify/filter/simulated_fit.h"
#include "identify/model/model_file.h"
#include "identify/result/file.h"
#include "lib/data/csv.h"
#include "lib/data/dataset.h"

namespace identikal {

/// @param job  that the model is for, "tune --method als"; named in the message
/// @throws InputError
void require_linear(const Model& model, const std::string& job);
/// A model whose filter is to run: matrices or formulas. @throws InputError
void require_filter(const Model& model, const std::string& job);

/// The model file with --from, --set and --filter applied; never a regression. @throws InputError
Model load_model(const ModelOptions& options, const std::string& verb, Inputs& inputs,
                 FormulaReading reading = FormulaReading::linear);
/// The same, for the verb that takes regressions too.
Model load_any_model(const ModelOptions& options, Inputs& inputs);

/// The files that one DATA argument names, read. @throws InputError
std::vector<Table> read_files(const std::string& argument, Inputs& inputs);
/// One recording, or several where the model file says that time restarts or rows are left out.
/// @throws InputError
std::vector<Dataset> load_runs(const std::vector<Table>& files, const Model& model,
                               const TimeRange& range, bool with_outputs = true);
/// The same where there has to be one.
Dataset load_data(const std::vector<Table>& files, const Model& model, const TimeRange& range,
                  bool with_outputs = true);

struct Recordings {
  std::vector<Dataset> data;
  std::vector<Dataset> held_out;                                ///< what the estimator does not see
  std::vector<InputRecord> records;                             ///< one per file
  std::vector<std::pair<std::size_t, std::size_t>> of_records;  ///< recordings [from, to) of a file
  std::vector<std::string> held_out_files;                      ///< read for --hold-out

  /// By the name of the recording: what the caller knows of it (Inputs::labels()).
  std::map<std::string, std::map<std::string, std::string>> labels;

  Findings findings;  ///< of how they go with the model

  /// What was loaded from the files of one argument.
  void add(std::vector<Dataset> runs, const std::vector<Table>& files, const TimeRange& range,
           Inputs& inputs);
};
/// Those of all DATA arguments. @throws InputError
Recordings load_recordings(const RecordingOptions& options, const Model& model,
                           const std::string& verb, Inputs& inputs);
/// The model of these recordings together (identify/model/own_parameters.h). @throws InputError
/// also where two files have one name
Model joint_model(Model model, Recordings& recordings);

/// The model of one recording alone, with the values that its parameters have there.
/// @throws InputError as for_recordings()
Model model_of_recording(Model model, Dataset& recording);
/// A model file that names no sampling period has the recording's.
void take_period(Model& model, const Dataset& data);
/// The model, in the state that its filter comes to through the rows before --range, where that is
/// a range of one recording; the findings say so. Else the model itself, which starts anew.
Model going_on_from_rows_before(Model model, const RecordingOptions& options,
                                Recordings& recordings, Inputs& inputs);
/// The files that a result rests on, and its own: nothing is to be written over them.
/// @param named  the result as the command line names it
std::vector<std::string> files_of(const StoredResult& result, const std::string& named);
/// Those of --from; none without it.
std::vector<std::string> files_of_origin(const ModelOptions& options, Inputs& inputs);
/// Warnings where the result of --from is doubtful, or one of another model file.
Findings findings_of_origin(const ModelOptions& options, Inputs& inputs);
/// A linear model has one sampling period. @throws InputError when that of `other` is another
void check_period(const Model& model, const Dataset& first, const Dataset& other);

/// --hold-out: the last share of every recording, which is taken from it, or another recording.
/// The record of a file that is one recording says which range is left.
/// @throws InputError
std::vector<HeldOut> hold_out(const std::string& hold_out, const Model& model,
                              const TimeRange& range, Recordings& recordings, Inputs& inputs);

}  // namespace identikal
