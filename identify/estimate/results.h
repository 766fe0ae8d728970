// What does each job answer with? A type for each job, on the core that all have in common.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "identify/estimate/details.h"
#include "identify/estimate/estimate.h"
#include "identify/estimate/filter_matrices.h"
#include "identify/estimate/handling.h"
#include "identify/estimate/recording_fit.h"

namespace identikal {

/// What every result about a Kalman filter has.
struct FilterEstimate : Estimate, RecordingFit, FilterMatrices {};

/// The model file of a result, as it was then; of files that it includes no text is kept.
struct ModelSource {
  std::string path, sha256, text;
  struct Included {
    std::string path, sha256;
    std::string text = {};  ///< as the job has read it; of a stored result it is not kept
  };
  std::vector<Included> included;
};

/// A result that was written before, of whatever job: all that its file holds, hence neither series
/// nor pictures.
struct StoredEstimate : FilterEstimate {
  std::string tyre_curve;  ///< vehicles: name_of(TyreCurve)
  std::optional<ModelSource> model_file;
  std::optional<ExcessMeanSquareError> excess_mean_square_error;
  std::optional<Bound> bound;
  std::optional<Posterior> posterior;
  std::optional<TimeHistory> time_history;
  std::optional<Shaping> shaping;
  std::optional<RankSelection> minimum_rank;
  std::optional<VehicleSurvey> survey;
  std::optional<HandlingSheet> handling;
  std::optional<Forecast> forecast;
  std::optional<BlackBox> black_box;
};

/// Of tune, and of fit where the model is a filter.
struct NoiseEstimate : FilterEstimate {
  std::optional<ExcessMeanSquareError> excess_mean_square_error;
  std::optional<RankSelection> minimum_rank;  ///< where the rank of Q is minimised
  std::optional<Posterior> posterior;         ///< Bayes
};

/// Of shape: the model chosen, tuned, and what else was tried.
struct ShapingEstimate : NoiseEstimate {
  Shaping shaping;
};

/// Of check: the filter as it is, and the tests of its innovations.
struct OptimalityReport : FilterEstimate {};

/// Of track where noise is followed.
struct TrackedNoise : FilterEstimate {
  TimeHistory time_history;
  std::optional<Posterior> posterior;  ///< where noise was learnt
};

/// Of track where the coefficients of a regression, or a vehicle's, are followed.
struct TrackedCoefficients : Estimate, RecordingFit {
  TimeHistory time_history;
};

/// Of fit where the model is a vehicle.
struct VehicleEstimate : Estimate, RecordingFit {
  std::string tyre_curve;  ///< name_of(TyreCurve)
};

/// Of validate: a result, unchanged, on other recordings.
struct Validation : FilterEstimate {
  std::string tyre_curve;  ///< vehicles: name_of(TyreCurve)
};

/// Of compare: figures of every result or model, by its name.
struct Comparison : Estimate {
  std::vector<TestResult> tests;
};

/// Of bound: what a recording could determine at best.
struct CramerRaoBound : Estimate {
  Noise noise;  ///< its steady gain alone
  Bound bound;
  std::optional<ExcessMeanSquareError> excess_mean_square_error;
};

/// Of info --vehicle: what recordings hold, before any fit.
struct SurveyReport : Estimate {
  VehicleSurvey survey;
};

/// Of handling: the engineer's sheet of a vehicle.
struct HandlingReport : Estimate {
  HandlingSheet handling;
};

/// Of forecast: the filter that was run, and what it expects.
struct OutputForecast : FilterEstimate {
  Forecast forecast;
};

/// Of model: a model from data alone, and the filter that it is.
struct BlackBoxEstimate : FilterEstimate {
  BlackBox black_box;
};

/// A result section by section, as files, pages and the console show it. Sections that a job does
/// not have are null. It refers to the result.
///
/// Example:
///
///     const ResultSections sections = sections_of(estimate);
///     if (sections.fit) std::printf("%zu tests\n", sections.fit->tests.size());
struct ResultSections {
  const Estimate* core = nullptr;  ///< never null
  const RecordingFit* fit = nullptr;
  const std::vector<TestResult>* tests = nullptr;
  const Noise* noise = nullptr;
  const SteadyFilter* filter = nullptr;
  const std::string* tyre_curve = nullptr;
  const Bound* bound = nullptr;
  const Posterior* posterior = nullptr;
  const TimeHistory* time_history = nullptr;
  const Shaping* shaping = nullptr;
  const ExcessMeanSquareError* excess_mean_square_error = nullptr;
  const RankSelection* minimum_rank = nullptr;
  const VehicleSurvey* survey = nullptr;
  const HandlingSheet* handling = nullptr;
  const Forecast* forecast = nullptr;
  const BlackBox* black_box = nullptr;
  const ModelSource* model_file = nullptr;  ///< of a result that is written: jobs with one model
};

ResultSections sections_of(const FilterEstimate& result);
ResultSections sections_of(const StoredEstimate& result);
ResultSections sections_of(const NoiseEstimate& result);
ResultSections sections_of(const ShapingEstimate& result);
ResultSections sections_of(const TrackedNoise& result);
ResultSections sections_of(const TrackedCoefficients& result);
ResultSections sections_of(const VehicleEstimate& result);
ResultSections sections_of(const Validation& result);
ResultSections sections_of(const Comparison& result);
ResultSections sections_of(const CramerRaoBound& result);
ResultSections sections_of(const SurveyReport& result);
ResultSections sections_of(const HandlingReport& result);
ResultSections sections_of(const OutputForecast& result);
ResultSections sections_of(const BlackBoxEstimate& result);

}  // namespace identikal
