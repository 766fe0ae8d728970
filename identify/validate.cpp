#include "identify/validate.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "identify/check.h"
#include "identify/report.h"
#include "identify/vehicle_checks.h"
#include "identify/vehicle_series.h"
#include "lib/error.h"

namespace identikal {
namespace {

using Eigen::Index;

// The result's figures belong to its sampling period, unless the noise is one of continuous time.
void check_period(const Estimate& result, const ModelFile& model,
                  const std::vector<Dataset>& recordings) {
  const bool any_period = model.linear.continuous && model.linear.noise == ProcessNoise::density;
  if (any_period || !result.filter) return;
  const double dt = result.filter->model.dt;
  for (const Dataset& data : recordings) {
    if (std::abs(data.dt - dt) <= 1e-6 * dt || model.time.step > 0.0) continue;
    throw InputError({data.name, 0, 0},
                     fmt::format("sampled every {:.6g} s, the result every {:.6g} s", data.dt, dt),
                     "the same sampling period", "noise per sample belongs to one sampling period");
  }
}

Estimate validate_filter(const Estimate& result, const ModelFile& model,
                         const std::vector<Dataset>& recordings) {
  check_period(result, model, recordings);
  ModelFile sampled = model;
  if (model.time.step == 0.0) sampled.linear.dt = recordings.front().dt;
  Estimate out = check_filter(sampled, recordings);
  const auto per_row = [](double L, double rows) { return rows > 0.0 ? L / rows : kNone; };
  double rows = 0.0, own_rows = 0.0;
  for (const Dataset& data : recordings) rows += static_cast<double>(data.size());
  for (const InputRecord& input : result.inputs) own_rows += static_cast<double>(input.used);
  out.derived.push_back(
      {"log-likelihood per row", "", per_row(out.objective.log_likelihood, rows), kNone});
  out.derived.push_back(
      {"  on its own data", "", per_row(result.objective.log_likelihood, own_rows), kNone});
  return out;
}

Estimate validate_car(const Estimate& result, const ModelFile& model,
                      const std::vector<Dataset>& recordings, bool robust) {
  Estimate out;
  out.model_name = model.name;
  out.status = Status::ok;
  out.tyre_curve = result.tyre_curve;
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  for (const EstimatedParameter& p : result.parameters) {
    EstimatedParameter known;
    known.name = p.name;
    known.unit = p.unit;
    known.value = known.start = p.value;
    known.fixed = true;
    const auto parameter = vehicle_parameter(p.name);
    known.neutral = parameter && unknowns.value[*parameter] == neutral_vehicle()[*parameter];
    out.parameters.push_back(std::move(known));
  }
  out.series = validate_vehicle(model, recordings, unknowns, unknowns.value, robust);
  out.simulation = channel_fits(out.series, robust);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    out.inputs.push_back({recordings[i].name, "", static_cast<long>(recordings[i].size()), 0});
  }
  for (Index t = 0; t < out.series.time.size(); ++t) {
    const auto run =
        out.series.recording.empty()
            ? std::size_t{0}
            : static_cast<std::size_t>(out.series.recording[static_cast<std::size_t>(t)] - 1);
    if (!out.series.predicted.col(t).array().isNaN().all()) ++out.inputs[run].used;
  }
  check_hold_out_recordings(model, recordings, out);
  return out;
}

// The output that has to follow the steering.
std::size_t leading_output(const std::vector<ChannelFit>& fits) {
  const auto named = std::find_if(fits.begin(), fits.end(),
                                  [](const ChannelFit& fit) { return fit.channel == "r"; });
  const auto best = std::max_element(
      fits.begin(), fits.end(),
      [](const ChannelFit& a, const ChannelFit& b) { return a.fit_percent < b.fit_percent; });
  return static_cast<std::size_t>((named != fits.end() ? named : best) - fits.begin());
}

// Answers by limits of the fit. A channel without a fit never changed and reaches none.
void judge_fits(const std::vector<ChannelFit>& fits, const std::vector<double>& limits,
                Estimate& estimate) {
  std::string below;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (fits[i].fit_percent >= limits[i]) continue;
    below += fmt::format("{}{} {:.1f} %, {:.4g} % wanted", below.empty() ? "" : "; ",
                         fits[i].channel, fits[i].fit_percent, limits[i]);
  }
  estimate.status = below.empty() ? Status::ok : Status::answer_no;
  estimate.message =
      below.empty() ? "it holds on these data: every fit is high enough" : "fit too low: " + below;
}

void warn_of_circumstances(const Estimate& result, const std::vector<InputRecord>& inputs,
                           Estimate& estimate) {
  for (const InputRecord& input : inputs) {
    const bool own =
        std::any_of(result.inputs.begin(), result.inputs.end(),
                    [&](const InputRecord& each) { return each.sha256 == input.sha256; });
    if (!own) continue;
    estimate.warnings.push_back({"own_data",
                                 "warning",
                                 {input.path},
                                 input.path + " is what the result was made from: this proves "
                                              "nothing",
                                 "validate on a recording that it has not seen"});
  }
  if (result.status != Status::ok) {
    estimate.warnings.push_back(
        {"doubtful_result",
         "warning",
         {},
         fmt::format("the result itself is {}: {}", to_string(result.status), result.message),
         ""});
  }
  const ModelSource& model = *result.model_file;
  std::error_code none;
  if (std::filesystem::is_regular_file(model.path, none) &&
      sha256_of_file(model.path) != model.sha256) {
    estimate.warnings.push_back({"model_changed",
                                 "warning",
                                 {model.path},
                                 model.path + " has changed since; what is validated is the model "
                                              "as it was, which the result holds",
                                 "run the job again if the change matters"});
  }
}

}  // namespace

Estimate validate(const Estimate& result, const ModelFile& model,
                  const std::vector<Dataset>& recordings, const std::vector<InputRecord>& inputs,
                  const ValidateOptions& options) {
  const bool vehicle = model.form == ModelFile::Form::single_track;
  Estimate out = vehicle ? validate_car(result, model, recordings, options.robust)
                         : validate_filter(result, model, recordings);
  const std::vector<ChannelFit>& fits = vehicle ? out.simulation : out.one_step;
  const std::vector<ChannelFit>& own = vehicle ? result.simulation : result.one_step;
  for (const ChannelFit& fit : own) {
    out.derived.push_back({"own fit of " + fit.channel, "%", fit.fit_percent, kNone});
  }
  if (options.least_fit) {
    judge_fits(fits, std::vector<double>(fits.size(), *options.least_fit), out);
  } else if (vehicle) {
    std::vector<double> limits(fits.size(), 0.0);
    if (!limits.empty()) limits[leading_output(fits)] = kPoorFit;
    judge_fits(fits, limits, out);
  }
  warn_of_circumstances(result, inputs, out);
  out.verb = out.objective.method = "validate";
  out.model_file = result.model_file;
  return out;
}

}  // namespace identikal
