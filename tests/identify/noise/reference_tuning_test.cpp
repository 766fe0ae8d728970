// Noise that brings estimates closest to a reference: no other values are better, a right model has
// the likeliest ones, and a wrong one is named and beaten on the next recording.
#include "identify/noise/reference_tuning.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lib/base/error.h"
#include "tests/identify/noise/reference_campaign.h"

namespace identikal {
namespace {

TEST(ReferenceTuning, FindsWhatNoGridImproves) {
  const ReferenceCase tracker = simulated_tracker(600, 1, 1.0);
  const NoiseEstimate estimate = tune_to_references(tracker.model, tracker.recordings, starts(3));
  EXPECT_EQ(estimate.objective.starts_at_optimum, 3);
  const double q = value_of(estimate, "q"), r = value_of(estimate, "r");
  const double best = error_at(tracker, q, r);
  double least = best;
  for (double ratio = 0.01; ratio < 100.0; ratio *= 1.1) {
    least = std::min(least, error_at(tracker, q * ratio, r));
  }
  // The weighted references have no single scale; the second term costs next to nothing.
  EXPECT_LT(best, 1.002 * least);
  for (const ReferenceFit& fit : estimate.references) {
    EXPECT_GT(fit.nees, 0.5);
    EXPECT_LT(fit.nees, 2.0);
  }
}

TEST(ReferenceTuning, DoesNotDependOnTheStartOrTheUnit) {
  const ReferenceCase tracker = simulated_tracker(400, 2, 0.5);
  const NoiseEstimate estimate = tune_to_references(tracker.model, tracker.recordings, starts(1));
  ReferenceCase moved = tracker;
  moved.model.parameters[0].value(0, 0) *= 300.0;
  moved.model.parameters[1].value(0, 0) *= 0.01;
  const NoiseEstimate again = tune_to_references(moved.model, moved.recordings, starts(1));
  for (const char* name : {"q", "r"}) {
    EXPECT_NEAR(value_of(again, name), value_of(estimate, name), 1e-3 * se_of(estimate, name));
  }
  // In millimetres: the variances are 10^6 times as large.
  ReferenceCase small = tracker;
  for (Dataset& data : small.recordings) {
    data.y *= 1e3;
    data.reference *= 1e3;
  }
  for (double& sd : small.model.references.sd) sd *= 1e3;
  for (Parameter& p : small.model.parameters) p.value *= 1e6;
  const NoiseEstimate scaled = tune_to_references(small.model, small.recordings, starts(1));
  for (const char* name : {"q", "r"}) {
    EXPECT_NEAR(value_of(scaled, name), 1e6 * value_of(estimate, name),
                1e3 * se_of(estimate, name));
  }
}

TEST(ReferenceTuning, RefusesWhatHasNone) {
  ReferenceCase tracker = simulated_tracker(100, 3, 0.0);
  tracker.recordings[0].reference.setConstant(std::nan(""));
  EXPECT_THROW(tune_to_references(tracker.model, tracker.recordings), InputError);
  tracker.model.references = {};
  tracker.recordings[0].reference.resize(0, 0);
  EXPECT_THROW(tune_to_references(tracker.model, tracker.recordings), InputError);
  EXPECT_TRUE(check_against_references(tracker.model, tracker.model.parameters, tracker.recordings)
                  .empty());
}

}  // namespace
}  // namespace identikal
