#include "identify/model/output_conditions.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "lib/base/constants.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd with_last_values(MatrixXd values) {
  for (Index t = 1; t < values.cols(); ++t) {
    for (Index i = 0; i < values.rows(); ++i) {
      if (std::isnan(values(i, t))) values(i, t) = values(i, t - 1);
    }
  }
  return values;
}

bool holds(const Expression& condition, const VectorXd& symbols) {
  for (const Expression::Node& node : condition.nodes) {
    if (node.op == Op::symbol && !std::isfinite(symbols[node.symbol])) return false;
  }
  return evaluate(condition, std::span(symbols.data(), static_cast<std::size_t>(symbols.size()))) !=
         0.0;
}

std::string in_unit(const ChannelSource& source) {
  const double value = unit_or_dimensionless(source.unit).from_si(*source.value);
  return fmt::format("{:.6g}{}{}", value, source.unit.empty() ? "" : " ", source.unit);
}

}  // namespace

std::vector<std::string> condition_symbols(const Model& model) {
  std::vector<std::string> out;
  for (const auto* channels : {&model.inputs, &model.outputs, &model.flags}) {
    for (const ChannelSource& channel : *channels) out.push_back(channel.name);
  }
  out.emplace_back("t");
  return out;
}

void apply_conditions(const Model& model, const Eigen::Ref<const MatrixXd>& flags,
                      Dataset& recording) {
  if (model.conditions.empty()) return;
  const auto asked = static_cast<Index>(model.flags.size());
  const Index N = recording.size(), nu = recording.u.rows(), ny = recording.y.rows();
  if (flags.rows() != asked || (asked > 0 && flags.cols() != N)) {
    throw std::invalid_argument(fmt::format("flags are {} x {}; expected {} x {} (flags x samples)",
                                            flags.rows(), flags.cols(), asked, N));
  }
  const MatrixXd known = with_last_values(flags), y = recording.y;
  VectorXd symbols(nu + ny + asked + 1);
  std::vector<Index> counted(model.conditions.size(), 0);
  for (Index t = 0; t < N; ++t) {
    if (nu > 0) symbols.head(nu) = recording.u.col(t);
    for (Index i = 0; i < ny; ++i) {
      const Transform transform = model.outputs[static_cast<std::size_t>(i)].transform;
      symbols[nu + i] = before_transform(transform, y(i, t));
    }
    if (asked > 0) symbols.segment(nu + ny, asked) = known.col(t);
    symbols[symbols.size() - 1] = recording.time[t];
    for (std::size_t i = 0; i < model.conditions.size(); ++i) {
      const OutputCondition& condition = model.conditions[i];
      if (!holds(condition.holds, symbols)) {
        recording.y(condition.output, t) = kNaN;
      } else if (!std::isnan(y(condition.output, t))) {
        ++counted[i];
      }
    }
  }
  for (std::size_t i = 0; i < model.conditions.size(); ++i) {
    const OutputCondition& condition = model.conditions[i];
    recording.notes.push_back(
        fmt::format("{} counts in {} of {} rows of {}, where {}",
                    model.outputs[static_cast<std::size_t>(condition.output)].name, counted[i], N,
                    recording.name, condition.text));
  }
}

std::vector<std::string> describe_conditions(const Model& model) {
  std::vector<std::string> out;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const ChannelSource& source = model.outputs[i];
    const auto condition = std::find_if(
        model.conditions.begin(), model.conditions.end(),
        [i](const OutputCondition& each) { return each.output == static_cast<Index>(i); });
    const bool conditional = condition != model.conditions.end();
    if (!source.value && !conditional) continue;
    out.push_back(
        fmt::format("output {}{} counts {}", source.name,
                    source.value ? ", the pseudo-measurement " + in_unit(source) + "," : "",
                    conditional ? "where " + condition->text : "in every row"));
  }
  return out;
}

}  // namespace identikal
