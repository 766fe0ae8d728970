#include "identify/filter/recordings_check.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "lib/base/error.h"
#include "lib/data/row_time.h"

namespace identikal {

using Eigen::Index;

Index samples_present(const std::vector<Dataset>& recordings) {
  Index samples = 0;
  for (const Dataset& data : recordings) {
    samples += static_cast<Index>((data.y.array() == data.y.array()).count());
  }
  return samples;
}

Index rows_present(const std::vector<Dataset>& recordings) {
  Index out = 0;
  for (const Dataset& data : recordings) {
    out += (data.y.array().isNaN() == false).colwise().any().count();
  }
  return out;
}

void check_recordings(const Model& model, const std::vector<Dataset>& recordings) {
  const Index unknowns = coordinates(model.parameters).size();
  if (unknowns == 0) {
    throw InputError({model.source, 0, 0}, "nothing is free to be estimated",
                     "at least one parameter with {value: ...} or a structured Q or R",
                     "use 'check' to test a filter whose noise is given");
  }
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  const Index samples = samples_present(recordings);
  if (samples <= unknowns) {
    throw InputError({recordings[0].name, 0, 0},
                     fmt::format("{} samples for {} unknowns", samples, unknowns),
                     "more samples than unknowns", "use a longer recording or fix parameters");
  }
  check_channels(recordings);
}

namespace {

// Covariances of covariances are fourth powers, and have to be numbers.
void refuse_size(const Dataset& data, Index i, double size, double span) {
  constexpr double kLargest = 1e75, kLeast = 1e-75;
  if (size <= kLargest && (span == 0.0 || span >= kLeast)) return;
  throw InputError({data.name, 0, 0},
                   fmt::format("output '{}' is of the size of {:.3g}", data.outputs[i].name,
                               size > kLargest ? size : span),
                   "1e-75 to 1e75, so that its fourth power is a number",
                   "give its column a unit or a scale");
}

}  // namespace

void check_channels(const std::vector<Dataset>& recordings) {
  check_inputs(recordings);
  for (const Dataset& data : recordings) {
    for (Index i = 0; i < data.y.rows(); ++i) {
      // What nobody measures, or counts in some rows alone, may be one number.
      if (data.outputs[i].is_pseudo) continue;
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (Index t = 0; t < data.y.cols(); ++t) {
        if (std::isnan(data.y(i, t))) continue;
        low = std::min(low, data.y(i, t));
        high = std::max(high, data.y(i, t));
      }
      if (low > high) continue;  // its condition holds nowhere here
      refuse_size(data, i, std::max(std::abs(low), std::abs(high)), high - low);
      if (low == high) {
        throw InputError(
            {data.name, 0, 0},
            fmt::format("output '{}' never changes (it is {:.6g} throughout)", data.outputs[i].name,
                        low),
            "a channel with noise",
            "remove it from the model's outputs; a number that is known is 'value' and "
            "'sd' in place of 'column'");
      }
    }
  }
}

void check_inputs(const std::vector<Dataset>& recordings) {
  if (recordings.empty()) throw std::invalid_argument("there is no recording");
  for (const Dataset& data : recordings) {
    for (Index i = 0; i < data.u.rows(); ++i) {
      for (Index t = 0; t < data.u.cols(); ++t) {
        if (std::isfinite(data.u(i, t))) continue;
        throw InputError(
            {data.name, 0, 0},
            fmt::format("input '{}' is missing at {}", data.inputs[i].name, row_time(data, t)),
            "a value in every row", "select rows with --range, or fill the gap");
      }
    }
  }
}

}  // namespace identikal
