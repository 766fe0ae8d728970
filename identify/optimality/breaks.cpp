#include "identify/optimality/breaks.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/filter/model_filter.h"
#include "lib/base/median.h"
#include "lib/data/units.h"
#include "lib/filter/disturbance_smoother.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Rows of t-values in units of their typical size, where that is above 1; NaN becomes 0.
MatrixXd scaled_sizes(const MatrixXd& t) {
  MatrixXd out = t.array().isNaN().select(0.0, t.cwiseAbs());
  for (Index i = 0; i < out.rows(); ++i) {
    std::vector<double> sizes;
    for (const double value : t.row(i)) {
      if (!std::isnan(value)) sizes.push_back(std::abs(value));
    }
    if (sizes.empty()) continue;
    out.row(i) /= std::max(1.0, kDeviationPerMedian * median(std::move(sizes)));
  }
  return out;
}

std::optional<Break> largest_of(const DisturbanceResult& noise, std::size_t recording) {
  constexpr double kChance = 0.01;
  const MatrixXd states = scaled_sizes(noise.state_t), outputs = scaled_sizes(noise.output_t);
  const VectorXd furthest = outputs.colwise().maxCoeff().transpose();
  Break out;
  double largest = 0.0;
  for (Index t = 0; t + 1 < states.cols(); ++t) {
    Index state = 0;
    const double size = states.col(t).maxCoeff(&state);
    if (size <= std::max({largest, furthest[t], furthest[t + 1]})) continue;
    largest = size;
    out = {recording, state, t, noise.state_jump(state, t), noise.state_t(state, t), 1.0};
  }
  const auto count = static_cast<double>(states.size());
  out.p = std::min(1.0, count * normal_two_sided(largest));
  return out.p < kChance ? std::optional(out) : std::nullopt;
}

}  // namespace

std::vector<Break> find_breaks(const Model& model, const std::vector<Dataset>& recordings) {
  constexpr double kMostNumbers = 1e6;
  std::vector<Break> out;
  if (!has_disturbance_smoother(model)) return out;
  const auto n = static_cast<double>(noise_model(model).A.constant.rows());
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    if (static_cast<double>(recordings[i].size()) * n * n > kMostNumbers) continue;
    const DisturbanceResult noise =
        run_disturbance_smoother(model, model.parameters, recordings[i]);
    if (noise.status != FilterStatus::ok || noise.state_t.size() == 0) continue;
    if (const std::optional<Break> found = largest_of(noise, i)) out.push_back(*found);
  }
  return out;
}

std::string sentence(const Break& found, const Model& model,
                     const std::vector<Dataset>& recordings) {
  std::string state = fmt::format("x{}", found.state + 1), unit;
  double jump = found.jump;
  if (!model.states.empty()) {
    const StateName& named = model.states[static_cast<std::size_t>(found.state)];
    state = named.name;
    jump /= unit_or_dimensionless(named.unit).scale;
    unit = named.unit.empty() || named.unit == "1" ? "" : " " + named.unit;
  }
  const Dataset& data = recordings[found.recording];
  return fmt::format(
      "state '{}' of {} jumps by {:.4g}{} between {:.9g} and {:.9g} s: t = {:.3g}, p = {:.2g} "
      "among all states and samples. An input that steps there takes it up",
      state, data.name, jump, unit, data.time[found.sample], data.time[found.sample + 1], found.t,
      found.p);
}

}  // namespace identikal
