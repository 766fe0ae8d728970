#include "identify/noise/auto.h"

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "identify/estimate/parameter_table.h"
#include "identify/model/check.h"
#include "identify/model/matrix_reader.h"
#include "identify/noise/als.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

// Why there is no second opinion, or the opinion.
struct Second {
  std::optional<NoiseEstimate> estimate;
  std::string reason;
};

Second second_opinion(const Model& model, const std::vector<Dataset>& recordings) {
  try {
    NoiseEstimate als = tune_als(model, recordings);
    if (als.status == Status::ok) return {als, ""};
    return {std::nullopt, als.message};
  } catch (const InputError& error) {
    return {std::nullopt, error.what()};
  }
}

// A start from which the search can rise: variances that als holds at zero begin small, not at
// zero, where the gradient of a factor vanishes.
ParameterSet start_from(const ParameterSet& parameters, const Estimate& als) {
  Eigen::VectorXd entries = free_entries(parameters);
  Eigen::Index i = 0;
  for (const EstimatedParameter& p : als.parameters) {
    if (p.fixed) continue;
    if (p.verdict != Verdict::at_bound) entries[i] = unit_or_dimensionless(p.unit).to_si(p.value);
    ++i;
  }
  return with_entries(parameters, entries);
}

}  // namespace

NoiseEstimate tune_auto(const Model& given, const std::vector<Dataset>& recordings,
                        const NoiseMlOptions& options) {
  const Model model = checked(given, recordings);
  constexpr double kApart = 4.0;
  const Second second = second_opinion(model, recordings);
  Model started = model;
  if (second.estimate) {
    const ParameterSet start = start_from(model.parameters, *second.estimate);
    if (!fault_at(noise_model(model), start)) started.parameters = start;
  }
  NoiseEstimate out = tune_ml(started, recordings, options);
  out.objective.method = "auto";
  if (!second.estimate) {
    out.notes.push_back("autocovariance least squares gave no second opinion: " + second.reason);
    return out;
  }
  std::string apart, near;
  std::vector<std::string> about;
  for (std::size_t i = 0; i < out.parameters.size(); ++i) {
    const EstimatedParameter& ml = out.parameters[i];
    const EstimatedParameter& als = second.estimate->parameters[i];
    if (ml.fixed) continue;
    near += fmt::format("{}{} {:.5g}", near.empty() ? "" : ", ", als.name, als.value);
    const double error = std::fmax(ml.se, als.se);
    if (!(std::abs(ml.value - als.value) > kApart * error)) continue;
    about.push_back(ml.name);
    apart += fmt::format("{}{} is {:.4g} by likelihood and {:.4g} by autocovariances",
                         apart.empty() ? "" : "; ", ml.name, ml.value, als.value);
  }
  out.notes.push_back("als-weighted: " + near);
  if (!about.empty()) {
    out.findings.push_back(make_finding(
        FindingCode::methods_disagree, about,
        apart + ": further apart than their errors allow, so the model does not describe the data",
        "look at the residuals: outliers, coloured noise and changes of the noise show there"));
  }
  return out;
}

}  // namespace identikal
