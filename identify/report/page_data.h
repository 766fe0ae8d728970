// What does the report page draw? Everything beyond the result itself, thinned so that the page
// stays small whatever the recording.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/results.h"
#include "lib/data/dataset.h"

namespace identikal {

/// A sequence on the columns of a page. Of a column with several samples the least and the largest
/// are kept, so that no peak is lost; NaN where a column has none. Empty: there is no such line.
struct Line {
  Eigen::VectorXd low, high;  ///< high is empty where a column is one sample
};

/// Is a channel's standardised innovation, or residual, white and normal?
struct InnovationPicture {
  Eigen::Index samples = 0;
  double mean = kNone, sd = kNone;
  Eigen::VectorXd autocorrelation;  ///< lags 1, 2, ..., of variance 1 / samples each
  Eigen::VectorXd normal, seen;     ///< quantiles of N(0, 1) and of the samples
  Eigen::VectorXd edges, count;     ///< histogram; what lies outside is in `outside`
  Eigen::Index outside = 0;
  Eigen::VectorXd level;                    ///< of the spectrum, 1 where white
  std::vector<Eigen::VectorXd> from_input;  ///< per input: correlation with it at the lags below
};

struct ReportChannel {
  std::string name, unit;
  Line measured, one_step, simulation, forecast_low, forecast_high;
  Line before, after;  ///< standardised
  InnovationPicture innovations_before, innovations_after;
};

/// One recording as it came; what is held out of it has a sheet of its own.
struct RecordingSheet {
  std::string name;
  bool held = false;  ///< the fit did not see it
  Eigen::Index rows = 0;
  double from = kNone, to = kNone, step = kNone;  ///< [s]
  double longest_step = kNone;                    ///< [s]
  struct Gap {
    double from, to;  ///< [s]
  };
  std::vector<Gap> gaps;  ///< steps above kGap of the usual one; the longest kMostGaps
  Eigen::Index gap_count = 0;
  struct ChannelSheet {
    std::string name, unit;
    bool input = false;
    Eigen::Index missing = 0;
    double low = kNone, mean = kNone, high = kNone;  ///< in the unit
  };
  std::vector<ChannelSheet> channels;
};

/// Where it all comes from.
struct Provenance {
  std::string command;
  std::string model_path, model_sha256;
};

struct ReportData {
  Provenance provenance;
  std::vector<RecordingSheet> recordings;
  Eigen::VectorXd time;                          ///< [s] of the columns; recordings end to end
  Eigen::Index rows = 0, columns = 0;            ///< rows > columns: thinned
  std::vector<double> joints;                    ///< [s]: where the next recording begins
  double held_from = kNone;                      ///< [s]: the fit did not see what follows
  std::vector<std::array<double, 2>> forecasts;  ///< [s]: simulated without any correction
  std::vector<std::array<double, 2>> used;       ///< [s]: runs of rows that went in
  std::vector<ReportChannel> channels;
  struct Input {
    std::string name, unit;
    Line line;
  };
  std::vector<Input> inputs;
  /// Normalised innovation squared over its degrees of freedom, means over blocks of rows.
  struct Nis {
    Eigen::Index block = 0;                  ///< rows
    Eigen::VectorXd time, value, low, high;  ///< low, high: 95 % of an optimal filter's lie inside
  } nis;
  int lags = 0;                                    ///< of the correlograms; inputs at -lags .. lags
  Eigen::VectorXd frequency;                       ///< [Hz] of the spectra
  std::array<double, 2> level_band{kNone, kNone};  ///< holds 95 % of a white sequence's
  Eigen::Index segment = 0, segments = 0;          ///< rows of each, that the spectra average
  struct HistoryLine {
    std::string name, unit;
    Line mean, low, high;  ///< low, high: two standard deviations off
  };
  std::vector<HistoryLine> time_history;  ///< verb track
  Line log_alarm;
  double log_threshold = kNone;
  std::vector<std::vector<double>> searches;
  std::vector<LikelihoodProfile> profiles;
  std::vector<AxlePicture> axles;  ///< clouds thinned to every n-th point
  bool high_pass_filtered = false;
  std::vector<TrackPicture> tracks;
};

/// Rows are dealt into at most so many columns that the page stays below a megabyte.
///
/// Example:
///
///     const ReportData data = report_data(sections_of(estimate), recordings, {}, {});
///     std::printf("%td rows on %td columns\n", data.rows, data.columns);
///
/// @param recordings  those that the estimate was made from, in the order of its series
/// @param held_out    those of Pictures::held_time
ReportData report_data(const ResultSections& result, const std::vector<Dataset>& recordings,
                       const std::vector<Dataset>& held_out, Provenance provenance);

}  // namespace identikal
