// How do values that suit references differ from the likeliest ones, where the model is right and
// where it is not? Tuned on one recording, judged on the next.
#pragma once

#include <cmath>
#include <cstdio>
#include <string>

#include "identify/filter/reference_errors.h"
#include "identify/noise/ml.h"
#include "identify/noise/reference_tuning.h"
#include "tests/support/reference_case.h"

namespace identikal {

inline double value_of(const Estimate& estimate, const std::string& name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name == name) return p.value;
  }
  return std::nan("");
}

inline double se_of(const Estimate& estimate, const std::string& name) {
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.name == name) return p.se;
  }
  return std::nan("");
}

// Root of the product of the references' rmse.
inline double error_at(const ReferenceCase& at, double q, double r) {
  ParameterSet parameters = at.model.parameters;
  parameters[0].value(0, 0) = q;
  parameters[1].value(0, 0) = r;
  const auto fits = reference_fits(at.model, parameters, at.recordings);
  return std::sqrt(fits[0].rmse * fits[1].rmse);
}

inline ReferenceTuningOptions starts(int count) {
  ReferenceTuningOptions options;
  options.starts = count;
  return options;
}

inline NoiseMlOptions one_search() {
  NoiseMlOptions options;
  options.starts = 1;
  options.profiles = false;
  return options;
}

struct Rates {
  int runs = 0, named = 0, within = 0, better = 0;
  double gain = 0.0;
};

inline Rates campaign(int runs, double lasting) {
  Rates out;
  for (int k = 0; k < runs; ++k) {
    const auto seed = static_cast<std::uint64_t>(1000 + 2 * k);
    const ReferenceCase train = simulated_tracker(1500, seed, lasting);
    const ReferenceCase next = simulated_tracker(1500, seed + 1, lasting);
    const NoiseEstimate likeliest = tune_ml(train.model, train.recordings, one_search());
    const NoiseEstimate closest = tune_to_references(train.model, train.recordings, starts(1));
    ++out.runs;
    for (const Finding& finding : likeliest.findings) {
      out.named += finding.code == FindingCode::reference_disagrees ? 1 : 0;
    }
    bool within = true;
    for (const char* name : {"q", "r"}) {
      const double moved = std::log(value_of(closest, name) / value_of(likeliest, name));
      within = within && std::abs(moved) < 3.5 * se_of(closest, name) / value_of(closest, name);
    }
    out.within += within ? 1 : 0;
    const double before = error_at(next, value_of(likeliest, "q"), value_of(likeliest, "r"));
    const double after = error_at(next, value_of(closest, "q"), value_of(closest, "r"));
    out.better += after < before ? 1 : 0;
    out.gain += (1.0 - after / before) / runs;
  }
  std::printf(
      "lasting %g m^2: named %d of %d, values alike %d, better on the next %d, gain %.1f %%\n",
      lasting, out.named, out.runs, out.within, out.better, 100.0 * out.gain);
  return out;
}

}  // namespace identikal
