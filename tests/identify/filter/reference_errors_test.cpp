// Errors against a reference are those of the filtered states, in the reference's unit, and a
// recording without a reference is none the worse.
#include "identify/filter/reference_errors.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "identify/filter/model_filter.h"
#include "identify/filter/run.h"
#include "identify/model/model_file.h"
#include "identify/simulation/simulate.h"
#include "lib/base/error.h"
#include "lib/data/csv.h"
#include "tests/support/reference_case.h"

namespace identikal {
namespace {

using Eigen::Index;

TEST(ReferenceErrors, AreThoseOfTheFilteredStates) {
  const ReferenceCase tracker = simulated_tracker(400, 3, 0.0);
  const FilterResult filter =
      run_filter(tracker.model, tracker.model.parameters, tracker.recordings[0]);
  const std::vector<ReferenceFit> fits =
      reference_fits(tracker.model, tracker.model.parameters, tracker.recordings);
  ASSERT_EQ(fits.size(), 2u);
  for (Index i = 0; i < 2; ++i) {
    double squares = 0.0, ratios = 0.0, sum = 0.0;
    long rows = 0, covered = 0;
    const auto variance = [&](Index t) {
      return filter.P_filt[static_cast<std::size_t>(t)](2 * i, 2 * i) + (i == 0 ? 0.0004 : 0.0);
    };
    std::vector<double> all;
    const auto is_known = [&](Index t) {
      return t >= filter.first_proper && !std::isnan(tracker.recordings[0].reference(i, t));
    };
    for (Index t = 0; t < 400; ++t) {
      if (is_known(t)) all.push_back(variance(t));
    }
    std::nth_element(all.begin(), all.begin() + static_cast<long>(all.size() / 2), all.end());
    bool settled = false;
    for (Index t = filter.first_proper; t < 400; ++t) {
      settled = settled || (is_known(t) && variance(t) <= 4.0 * all[all.size() / 2]);
      if (!settled) continue;
      const double z = tracker.recordings[0].reference(i, t);
      if (std::isnan(z)) continue;
      const double e = filter.x_filt(2 * i, t) - z;
      const double v =
          filter.P_filt[static_cast<std::size_t>(t)](2 * i, 2 * i) + (i == 0 ? 0.0004 : 0.0);
      squares += e * e;
      ratios += e * e / v;
      sum += e;
      covered += std::abs(e) < 1.959963984540054 * std::sqrt(v) ? 1 : 0;
      ++rows;
    }
    const ReferenceFit& fit = fits[static_cast<std::size_t>(i)];
    const auto n = static_cast<double>(rows);
    EXPECT_EQ(fit.rows, rows);
    EXPECT_NEAR(fit.rmse, std::sqrt(squares / n), 1e-12);
    EXPECT_NEAR(fit.bias, sum / n, 1e-12);
    EXPECT_NEAR(fit.nees, ratios / n, 1e-9);
    EXPECT_NEAR(fit.coverage, static_cast<double>(covered) / n, 1e-12);
  }
}

// Errors last some 5 s: 20,000 rows have the information of 400, of which 95 +- 4 % are covered but
// in one of 2000 cases.
TEST(ReferenceErrors, OfARightModelAreAsLargeAsItSays) {
  const ReferenceCase tracker = simulated_tracker(20000, 4, 0.0);
  for (const ReferenceFit& fit :
       reference_fits(tracker.model, tracker.model.parameters, tracker.recordings)) {
    EXPECT_GT(fit.nees, 0.8) << fit.name;
    EXPECT_LT(fit.nees, 1.25) << fit.name;
    EXPECT_NEAR(fit.coverage, 0.95, 0.04) << fit.name;
  }
}

const char* const kPendulumWithReferences = R"(
identikal: 1
name: pendulum
time: {kind: continuous, column: t, unit: s}
parameters: {q: {value: 0.01, min: 0}, r: {value: 1e-4, min: 0}}
states: {phi: rad, w: rad/s}
dynamics: {phi: w, w: -9.81*sin(phi) 1/s^2}
outputs: {angle: {column: a, unit: rad, equals: phi}}
noise: {process: {kind: density, variance: {w: q}}, measurement: {variance: {angle: r}}}
initial: {mean: {phi: 0.5, w: 0}, sd: {phi: 0.1, w: 0.1}}
reference:
  phi: {column: true_phi, unit: deg, sd: 0.1 deg}
  height: {column: true_height, equals: 1 - cos(phi)}
)";

TEST(ReferenceErrors, MayBeOfFormulasInAnyUnit) {
  std::string text = kPendulumWithReferences;
  text.replace(text.find("-9.81*sin(phi) 1/s^2"), 20, "-c*sin(phi)");
  text.replace(text.find("parameters: {"), 13, "parameters: {c: 9.81 1/s^2, ");
  const Model model = parse_model_file(text, "pendulum.yaml");
  const double degree = std::acos(-1.0) / 180.0;
  EXPECT_NEAR(model.references.sd[0], 0.1 * degree, 1e-15);
  std::string rows = "t,a,true_phi [deg],true_height\n";
  for (int k = 0; k < 200; ++k) {
    const double phi = 0.5 * std::cos(3.1 * 0.01 * k);
    rows += std::to_string(0.01 * k) + "," + std::to_string(phi) + "," +
            std::to_string(phi / degree) + "," + std::to_string(1.0 - std::cos(phi)) + "\n";
  }
  const Table table = parse_csv(rows, "pendulum.csv");
  const std::vector<Dataset> recordings{
      make_dataset(table, model.time, model.inputs, model.outputs, {}, model.references.channels)};
  const std::vector<ReferenceFit> fits = reference_fits(model, model.parameters, recordings);
  ASSERT_EQ(fits.size(), 2u);
  EXPECT_EQ(fits[0].unit, "deg");
  const FilterResult filter = run_filter(model, model.parameters, recordings[0]);
  RecordingsLikelihood filters(model, recordings);
  const SettledRows settled = first_settled_rows(model, model.parameters, recordings, filters);
  EXPECT_LT(settled[0][0], 20);
  double phi = 0.0, height = 0.0;
  for (Index t = 0; t < 200; ++t) {
    if (t >= settled[0][0])
      phi += std::pow(filter.x_filt(0, t) / degree - recordings[0].reference(0, t) / degree, 2);
    if (t >= settled[0][1])
      height += std::pow(1.0 - std::cos(filter.x_filt(0, t)) - recordings[0].reference(1, t), 2);
  }
  EXPECT_NEAR(fits[0].rmse, std::sqrt(phi / fits[0].rows), 1e-9);
  EXPECT_NEAR(fits[1].rmse, std::sqrt(height / fits[1].rows), 1e-9);
}

TEST(ReferenceErrors, NeedNoReference) {
  ReferenceCase tracker = simulated_tracker(100, 5, 0.0);
  tracker.recordings[0].reference.resize(0, 0);
  EXPECT_TRUE(reference_fits(tracker.model, tracker.model.parameters, tracker.recordings).empty());
  const Model pendulum = parse_model_file(tracker_text(), "tracker.yaml");
  const Dataset data =
      make_dataset(parse_csv("t,zx,zy\n0,0,0\n0.1,1,0\n0.2,2,1\n0.3,2,1\n", "drive.csv"),
                   pendulum.time, {}, pendulum.outputs, {}, pendulum.references.channels);
  ASSERT_EQ(data.notes.size(), 2u);
  EXPECT_EQ(data.notes[0], "nothing to compare px with: column 'true_px' is not in drive.csv");
}

TEST(ReferenceErrors, OfWhatIsNoStateAreRefused) {
  const auto message_of = [](const std::string& from, const std::string& to) {
    std::string text = tracker_text();
    text.replace(text.find(from), from.size(), to);
    try {
      parse_model_file(text, "tracker.yaml");
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(message_of("px: {column: true_px", "pz: {column: true_px")
                .find("reference 'pz' is no "
                      "state"),
            std::string::npos);
  EXPECT_NE(message_of("sd: 0.02", "sd: -0.02").find("a standard deviation, 0 or above"),
            std::string::npos);
  EXPECT_NE(message_of("unit: m, sd", "unit: deg, sd").find("reference 'px'"), std::string::npos);
}

}  // namespace
}  // namespace identikal
