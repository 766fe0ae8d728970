#include "identify/filter/observation_weights.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/internal/csv_lines.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/report.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

constexpr Index kMostSamples = 5000;  // a quarter of a minute of a small model

void check(const Model& model, const Dataset& recording) {
  if (!is_linear(model) && !changes(model)) {
    throw InputError({model.source, 0, 0}, "weights of samples for the states of a nonlinear model",
                     "a model that is linear in its states");
  }
  if (model.student) {
    throw InputError({model.source, 0, 0}, "weights of samples beside noise of Student's t",
                     "normal noise", "its weights depend on what was measured");
  }
  for (const ChannelSource& output : model.outputs) {
    if (!output.wraps) continue;
    throw InputError({model.source, 0, 0},
                     fmt::format("weights of samples beside '{}', which wraps", output.name),
                     "outputs without 'wrap'");
  }
  if (recording.y.size() > kMostSamples) {
    throw InputError({recording.name, 0, 0},
                     fmt::format("weights of {} samples", recording.y.size()),
                     fmt::format("{} at most", kMostSamples), "--range FROM:TO takes a part");
  }
}

VectorXd state_at(const Model& model, const Dataset& recording, Index row,
                  std::optional<Index> lag) {
  const SmootherResult run = run_smoother(model, model.parameters, recording, lag);
  if (run.status != FilterStatus::ok) refuse_filter(model, {recording}, run.status);
  return run.x.col(row);
}

}  // namespace

ObservationWeights observation_weights(const Model& model, const Dataset& recording, Index row,
                                       std::optional<Index> lag) {
  check(model, recording);
  const Index ny = recording.y.rows(), N = recording.y.cols();
  Dataset silent = recording;
  silent.y = (0.0 * recording.y.array()).matrix();  // missing samples stay so
  const VectorXd at_rest = state_at(model, silent, row, lag);
  if (!at_rest.allFinite()) {
    throw InputError({recording.name, 0, 0},
                     fmt::format("the rows up to row {} do not determine the states", row + 1),
                     "a later time, or --smooth");
  }
  ObservationWeights out{row, Eigen::MatrixXd::Zero(at_rest.size(), ny * N)};
  const Index last = lag ? std::min(row + *lag, N - 1) : N - 1;
  for (Index i = 0; i < ny; ++i) {
    // An impulse as large as what was measured keeps most digits.
    double size = 0.0;
    for (Index k = 0; k < N; ++k) {
      if (std::isfinite(recording.y(i, k))) size = std::max(size, std::abs(recording.y(i, k)));
    }
    if (size == 0.0) size = 1.0;
    for (Index k = 0; k <= last; ++k) {
      if (std::isnan(silent.y(i, k))) continue;
      silent.y(i, k) = size;
      out.weights.col(k * ny + i) = (state_at(model, silent, row, lag) - at_rest) / size;
      silent.y(i, k) = 0.0;
    }
  }
  return out;
}

void write_weights_csv(std::ostream& out, const Model& model, const Dataset& recording,
                       const ObservationWeights& weights) {
  const std::vector<NamedState> states = named_states(model);
  const auto& outputs = recording.outputs;
  CsvLines lines(out, false);
  for (const NamedState& state : states) {
    for (const Channel& output : outputs) {
      lines.head(fmt::format("{} by {}", state.name, output.name), "");
    }
  }
  const VectorXd& stamps = stamps_of(recording);
  const auto ny = static_cast<Index>(outputs.size());
  for (Index k = 0; k < stamps.size(); ++k) {
    lines.begin_line(0, stamps[k]);
    for (std::size_t s = 0; s < states.size(); ++s) {
      for (Index i = 0; i < ny; ++i) {
        const double per_unit = unit_scale(outputs[static_cast<std::size_t>(i)].unit);
        lines.cell(weights.weights(static_cast<Index>(s), k * ny + i) * per_unit /
                   states[s].si.scale);
      }
    }
  }
  lines.end();
}

}  // namespace identikal
