// What is a recording of C to the verbs? A table with the columns that the model asks for.
#pragma once

#include <string>

#include "interface/identikal.h"

#include "identify/model/model.h"
#include "lib/data/csv.h"

namespace identikal {

/// @param name          for messages
/// @param with_outputs  the model's outputs are among its columns: not where it holds inputs alone
/// @throws InputError for pointers that are missing, numbers of channels other than the model's, and
///   times that contradict the model's step
Table recording_table(const ik_recording& recording, const Model& model, const std::string& name,
                      bool with_outputs);

/// The same as a file: a header, with units in brackets, and numbers with all their digits.
/// @throws InputError for a column whose name is a number: a file's header cannot have one
std::string csv_text(const Table& table);

}  // namespace identikal
