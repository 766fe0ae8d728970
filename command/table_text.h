// What is in this file? Columns, units, rate, gaps, before any model is fitted.
#pragma once

#include <string>

#include "identify/model/model_file.h"
#include "lib/data/csv.h"

namespace identikal {

/// A table of the columns (unit, rows present, range, mean, standard deviation, remarks such as
/// constant, text or held samples), the column that looks like time with its rate, jitter and gaps.
/// Text within 80 columns where names allow.
std::string table_text(const Table& table);

/// What the model takes from the recording: channels in SI with range and excitation.
/// @throws InputError as make_dataset()
std::string channels_text(const Model& model, const Dataset& data);

}  // namespace identikal
