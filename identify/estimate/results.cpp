#include "identify/estimate/results.h"

namespace identikal {
namespace {

template <typename Section>
const Section* if_any(const std::optional<Section>& section) {
  return section ? &*section : nullptr;
}

void add_fit(const RecordingFit& fit, ResultSections& out) {
  out.fit = &fit;
  out.tests = &fit.tests;
}

void add_matrices(const FilterMatrices& from, ResultSections& out) {
  out.noise = &from.noise;
  out.filter = if_any(from.filter);
}

}  // namespace

ResultSections sections_of(const FilterEstimate& result) {
  ResultSections out{&result};
  add_fit(result, out);
  add_matrices(result, out);
  return out;
}

ResultSections sections_of(const StoredEstimate& result) {
  ResultSections out = sections_of(static_cast<const FilterEstimate&>(result));
  if (!result.tyre_curve.empty()) out.tyre_curve = &result.tyre_curve;
  out.model_file = if_any(result.model_file);
  out.excess_mean_square_error = if_any(result.excess_mean_square_error);
  out.bound = if_any(result.bound);
  out.posterior = if_any(result.posterior);
  out.time_history = if_any(result.time_history);
  out.forecast = if_any(result.forecast);
  out.black_box = if_any(result.black_box);
  out.shaping = if_any(result.shaping);
  out.minimum_rank = if_any(result.minimum_rank);
  out.survey = if_any(result.survey);
  out.handling = if_any(result.handling);
  return out;
}

ResultSections sections_of(const NoiseEstimate& result) {
  ResultSections out = sections_of(static_cast<const FilterEstimate&>(result));
  out.excess_mean_square_error = if_any(result.excess_mean_square_error);
  out.minimum_rank = if_any(result.minimum_rank);
  out.posterior = if_any(result.posterior);
  return out;
}

ResultSections sections_of(const ShapingEstimate& result) {
  ResultSections out = sections_of(static_cast<const NoiseEstimate&>(result));
  out.shaping = &result.shaping;
  return out;
}

ResultSections sections_of(const TrackedNoise& result) {
  ResultSections out = sections_of(static_cast<const FilterEstimate&>(result));
  out.time_history = &result.time_history;
  out.posterior = if_any(result.posterior);
  return out;
}

ResultSections sections_of(const TrackedCoefficients& result) {
  ResultSections out{&result};
  add_fit(result, out);
  out.time_history = &result.time_history;
  return out;
}

ResultSections sections_of(const VehicleEstimate& result) {
  ResultSections out{&result};
  add_fit(result, out);
  out.tyre_curve = &result.tyre_curve;
  return out;
}

ResultSections sections_of(const Validation& result) {
  ResultSections out = sections_of(static_cast<const FilterEstimate&>(result));
  if (!result.tyre_curve.empty()) out.tyre_curve = &result.tyre_curve;
  return out;
}

ResultSections sections_of(const Comparison& result) {
  ResultSections out{&result};
  out.tests = &result.tests;
  return out;
}

ResultSections sections_of(const CramerRaoBound& result) {
  ResultSections out{&result};
  out.noise = &result.noise;
  out.bound = &result.bound;
  out.excess_mean_square_error = if_any(result.excess_mean_square_error);
  return out;
}

ResultSections sections_of(const SurveyReport& result) {
  ResultSections out{&result};
  out.survey = &result.survey;
  return out;
}

ResultSections sections_of(const HandlingReport& result) {
  ResultSections out{&result};
  out.handling = &result.handling;
  return out;
}

ResultSections sections_of(const OutputForecast& result) {
  ResultSections out = sections_of(static_cast<const FilterEstimate&>(result));
  out.forecast = &result.forecast;
  return out;
}

ResultSections sections_of(const BlackBoxEstimate& result) {
  ResultSections out = sections_of(static_cast<const FilterEstimate&>(result));
  out.black_box = &result.black_box;
  return out;
}

}  // namespace identikal
