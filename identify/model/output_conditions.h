// In which rows of a recording does an output count? A pseudo-measurement of zero velocity holds at
// standstill, a sensor is trusted where it is within its range.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// What conditions are formulas of, in this order: inputs, outputs, flags, and the time t of the
/// recording [s]. All are SI.
std::vector<std::string> condition_symbols(const Model& model);

/// Makes every output missing where its condition does not hold, and says in the notes in how many
/// rows it does. A condition holds in no row in which a value that it asks is missing; a flag keeps
/// its last value. Outputs are asked as they were recorded, whatever other conditions say.
///
/// Example:
///
///     const Table table = read_csv("drive.csv");
///     Dataset log = make_dataset(table, model.time, model.inputs, model.outputs);
///     const Dataset asked = make_dataset(table, model.time, model.flags, {});
///     apply_conditions(model, asked.u, log);
///
/// @param flags  of model.flags, x N, SI; NaN where a cell is empty
/// @throws std::invalid_argument when there are other numbers of flags or rows than the model's and
///   the recording's
void apply_conditions(const Model& model, const Eigen::Ref<const Eigen::MatrixXd>& flags,
                      Dataset& recording);

/// A sentence on every pseudo-measurement and condition of the model; none where it has neither.
std::vector<std::string> describe_conditions(const Model& model);

}  // namespace identikal
