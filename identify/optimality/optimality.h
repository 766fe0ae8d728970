// Which tests does a filter's optimality have to stand, what do they say together, and what is
// wrong where?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "identify/optimality/score_statistic.h"
#include "lib/data/dataset.h"
#include "lib/filter/kalman.h"

namespace identikal {

/// Of all wrong calls about an optimal filter with Gaussian noise, at most so many.
inline constexpr double kFamilyError = 0.05;

struct Optimality {
  bool optimal = true;              ///< no test with a level rejects
  std::vector<TestResult> tests;    ///< those with a level make the verdict, the others explain it
  std::vector<std::string> faults;  ///< what is wrong where, a sentence each, most telling first
  std::vector<std::string> notes;
  Findings findings;
};

/// The default test. Each part may err with its share of 5 %, so that all together err with 5 % at
/// most (weighted Bonferroni, whatever their dependence); parts that cannot be computed leave their
/// share to the others.
///
///   score              6/10  against wrong Q and R (score_statistic)
///   portmanteau        2/10  all channels and their pairs at 5 lags (lib/statistics/whiteness.h)
///   nis                1/20  size of the innovations, two-sided
///   ljung_box          1/20  every channel, min(20, N/20) lags
///   mean               1/20  all channels, Hotelling
///   input_correlation  1/20  every channel against all inputs up to 10 samples back
///
/// Beside these, without a share: score_entry (one entry of Q or R each; fails where the score test
/// does and the entry alone stands out at 5 % over all entries), ar_order (Matisko's Test 3 with
/// BIC: the order, 0 = white), normality (Doornik & Hansen) and mcleod_li at 1 %, whose failure
/// means that the p-values are approximate. On recordings that Q and R were tuned on the score is
/// zero by construction; a fair verdict takes others.
///
/// Example:
///
///     const FilterResult filter = run_filter(model, model.parameters, recordings[0]);
///     const Optimality verdict = test_optimality(model, {recordings[0]}, {filter});
///     for (const std::string& fault : verdict.faults) std::puts(fault.c_str());
///
/// @param filters  of each recording, at the model's own values
Optimality test_optimality(const Model& model, const std::vector<Dataset>& recordings,
                           const std::vector<FilterResult>& filters);
/// Of recordings that are no longer there the score test alone, which gets the whole 5 %: whether
/// innovations are white by other means than through Q and R cannot be told.
Optimality test_optimality(const Model& model, const std::vector<RecordingDigest>& digests);

}  // namespace identikal
