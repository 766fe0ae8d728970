#include "identify/model/recording.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/model/check.h"
#include "identify/model/late_inputs.h"
#include "identify/model/output_conditions.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"
#include "lib/base/median.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// Names of channels in SI, as results print them.
std::vector<Channel> channels_of(const std::vector<ChannelSource>& sources, Index rows,
                                 const char* what) {
  if (static_cast<Index>(sources.size()) != rows) {
    throw std::invalid_argument(
        fmt::format("the recording has {} {}, the model {}", rows, what, sources.size()));
  }
  std::vector<Channel> out;
  for (const ChannelSource& source : sources) {
    out.push_back({source.name, source.si_unit, source.value.has_value(), source.transform});
  }
  return out;
}

Eigen::MatrixXd rows_named(const std::vector<ChannelSource>& sources,
                           const std::vector<std::pair<std::string, Samples>>& channels) {
  Eigen::MatrixXd out;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const auto found = std::find_if(channels.begin(), channels.end(), [&](const auto& channel) {
      return channel.first == sources[i].name;
    });
    if (found == channels.end()) {
      throw std::invalid_argument(
          fmt::format("the recording has no channel '{}', which the model has", sources[i].name));
    }
    const auto again = std::find_if(found + 1, channels.end(), [&](const auto& channel) {
      return channel.first == sources[i].name;
    });
    if (again != channels.end()) {
      throw std::invalid_argument(
          fmt::format("the recording has channel '{}' twice", sources[i].name));
    }
    const Eigen::MatrixXd& values = found->second.values;
    if (i == 0) out.resize(static_cast<Index>(sources.size()), values.cols());
    if (values.rows() != 1 || values.cols() != out.cols()) {
      throw std::invalid_argument(fmt::format("channel '{}' is {} x {}; expected 1 x {}",
                                              sources[i].name, values.rows(), values.cols(),
                                              out.cols()));
    }
    out.row(static_cast<Index>(i)) = values;
  }
  return out;
}

// As the model compares them.
void transform_outputs(Dataset& data) {
  for (std::size_t i = 0; i < data.outputs.size(); ++i) {
    const Transform transform = data.outputs[i].transform;
    if (transform == Transform::none) continue;
    auto row = data.y.row(static_cast<Index>(i));
    if ((row.array() <= 0.0).any()) {
      throw std::invalid_argument(
          fmt::format("output '{}' is not above 0 throughout, and its logarithm is to be taken",
                      data.outputs[i].name));
    }
    for (double& y : row) y = transformed(transform, y);
  }
}

// Times of the last rows that are infinite: a usual step each behind the others, which stamps do
// not say.
void take_rest(const Model& model, Dataset& data) {
  Index finite = data.time.size();
  while (finite > 0 && data.time[finite - 1] == kInfinity) --finite;
  if (!model.time.infinite || finite == data.time.size() || finite < 2) return;
  data.stamps = data.time;
  const Index steps = finite - 1;
  const Eigen::VectorXd step = data.time.segment(1, steps) - data.time.head(steps);
  const double usual = median({step.begin(), step.end()});
  for (Index k = finite; k < data.time.size(); ++k) data.time[k] = data.time[k - 1] + usual;
}

// Pseudo-measurements have their numbers, doses are zero where none is said, and outputs count where
// their conditions hold.
void as_model_file_says(const Model& model, const MatrixXd& flags, Dataset& data) {
  transform_outputs(data);
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const std::optional<double>& value = model.outputs[i].value;
    if (value) data.y.row(static_cast<Index>(i)).setConstant(*value);
  }
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    if (!model.inputs[i].empty_is_zero) continue;
    auto row = data.u.row(static_cast<Index>(i));
    row = row.array().isNaN().select(0.0, row).eval();
  }
  apply_conditions(model, flags, data);
}

// Where the model has one step, rows that are absent between the times become missing samples.
Dataset on_grid_of(const Model& model, Dataset data) {
  const bool irregular = is_formula_model(model) && as_formulas(model).irregular;
  const bool rises = (data.time.tail(std::max<Index>(data.time.size() - 1, 0)).array() >
                      data.time.head(std::max<Index>(data.time.size() - 1, 0)).array())
                         .all();
  const bool whole = data.time.size() == data.y.cols() && data.time.allFinite() && rises;
  if (has_filter(model) && !irregular && whole && data.dt > 0.0) {
    const double step = model.time.step;
    // Times that are several steps of the model apart are on its grid, with rows absent.
    const bool as_model =
        step > 0.0 && (std::abs(data.dt - step) <= 0.01 * step || has_rows_absent(data.time, step));
    try {
      data = on_uniform_grid(data, as_model ? step : data.dt);
    } catch (const InputError& error) {
      throw std::invalid_argument(error.what());
    }
  }
  check_recording(model, data);
  return data;
}

}  // namespace

Samples::Samples(std::span<const double> channel)
    : values(Eigen::Map<const Eigen::RowVectorXd>(channel.data(),
                                                  static_cast<Index>(channel.size()))) {}

namespace {

// The rows in which late inputs are known whatever their delays are.
Dataset where_inputs_are_known(const Model& model, Dataset recording) {
  if (!is_formula_model(model) || as_formulas(model).late.empty()) return recording;
  std::vector<Dataset> parts = with_late_records(model, std::move(recording));
  if (parts.size() == 1) return std::move(parts.front());
  throw std::invalid_argument(
      "a late input is missing within the recording; expected samples "
      "without gaps, or a recording for every part");
}

Dataset recording_with_flags(const Model& model, const Samples& y, const SampleTimes& time,
                             const Samples& u, const MatrixXd& flags) {
  Dataset out;
  out.name = "recording";
  out.y = y.values;
  out.u = u.values;
  const Index size = out.y.cols();
  if (out.u.size() == 0) out.u.resize(out.u.rows(), size);
  out.outputs = channels_of(model.outputs, out.y.rows(), "outputs");
  out.inputs = channels_of(model.inputs, out.u.rows(), "inputs");
  out.dt = time.step;
  out.time = time.times;
  take_rest(model, out);
  if (out.time.size() == 0 && out.dt == 0.0) {
    throw std::invalid_argument(
        fmt::format("the sampling period is 0 s, and there are 0 times for {} samples", size));
  }
  if (out.time.size() == 0) {
    out.time = Eigen::VectorXd::LinSpaced(size, 0.0, static_cast<double>(size - 1)) * time.step;
  } else if (out.dt == 0.0 && out.time.size() > 1) {
    const Index steps = out.time.size() - 1;
    const Eigen::VectorXd step = out.time.tail(steps) - out.time.head(steps);
    out.dt = median({step.begin(), step.end()});
  }
  if (out.time.size() == out.y.cols()) as_model_file_says(model, flags, out);
  if (time.times.size() > 0)
    return where_inputs_are_known(model, on_grid_of(model, std::move(out)));
  check_recording(model, out);
  return where_inputs_are_known(model, std::move(out));
}

}  // namespace

Dataset recording(const Model& model, const Samples& y, const SampleTimes& time, const Samples& u) {
  if (!model.flags.empty()) {
    throw std::invalid_argument(
        fmt::format("conditions ask the flag '{}'; expected channels by their names",
                    model.flags.front().name));
  }
  return recording_with_flags(model, y, time, u, MatrixXd(0, y.values.cols()));
}

Dataset recording(const Model& model, const std::vector<std::pair<std::string, Samples>>& channels,
                  const SampleTimes& time) {
  Samples y, u;
  std::vector<std::pair<std::string, Samples>> given = channels;
  for (const ChannelSource& output : model.outputs) {
    if (!output.value || channels.empty()) continue;
    const Index size = channels.front().second.values.cols();
    std::erase_if(given, [&](const auto& channel) { return channel.first == output.name; });
    given.emplace_back(output.name, Samples(MatrixXd::Constant(1, size, *output.value)));
  }
  y.values = rows_named(model.outputs, given);
  u.values = rows_named(model.inputs, given);
  return recording_with_flags(model, y, time, u, rows_named(model.flags, given));
}

}  // namespace identikal
