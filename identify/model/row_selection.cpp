#include "identify/model/row_selection.h"

#include <utility>

#include <fmt/format.h>

#include "identify/model/late_inputs.h"

namespace identikal {

using Eigen::Index;

namespace {

// Adds those of a part.
Index add_segments(const Model& model, const Dataset& recording, std::vector<Dataset>& out) {
  const bool nonlinear = is_formula_model(model);
  const std::optional<Expression>& use_when = model.use_when;
  std::vector<double> symbols(model.states.size() + model.inputs.size());
  std::string gap = recording.begins;  // what stands before a segment
  const auto usable = [&](Index t) {
    for (Index i = 0; i < recording.u.rows(); ++i) {
      symbols[model.states.size() + static_cast<std::size_t>(i)] = recording.u(i, t);
    }
    if (nonlinear && !recording.u.col(t).allFinite()) {
      gap = "after a missing input";
      return false;
    }
    if (!use_when || evaluate(*use_when, symbols) != 0.0) return true;
    gap = "after rows that use_when leaves out";
    return false;
  };
  Index used = 0;
  for (Index from = 0; from < recording.size();) {
    Index to = from;
    const std::string before = gap;
    while (to < recording.size() && usable(to)) ++to;
    if (to - from > 1) {
      out.push_back(samples_from(first_samples(recording, to), from));
      out.back().begins = before;
      used += to - from;
    }
    from = to + 1;
  }
  return used;
}

}  // namespace

std::vector<Dataset> usable_segments(const Model& model, Dataset recording) {
  const bool nonlinear = is_formula_model(model);
  if (!nonlinear && !model.use_when) return {std::move(recording)};
  const bool late = nonlinear && !as_formulas(model).late.empty();
  std::vector<Dataset> out;
  Index used = 0;
  if (late) {
    for (Dataset& part : with_late_records(model, recording)) {
      if (part.begins.empty() && part.time[0] > recording.time[0]) {
        part.begins = "after rows where a late input is not known";
      }
      used += add_segments(model, part, out);
    }
  } else {
    used = add_segments(model, recording, out);
  }
  if (out.empty()) {
    throw InputError({recording.name, 0, 0}, "no two rows in succession can be used",
                     model.use_when ? "rows where use_when holds and every input is there"
                                    : "rows where every input is there");
  }
  if (used < recording.size()) {
    out.front().notes.push_back(fmt::format("{} of {} rows used, in {} segment{}", used,
                                            recording.size(), out.size(),
                                            out.size() > 1 ? "s" : ""));
  }
  return out;
}

}  // namespace identikal
