#include "tests/campaigns/noise_verdicts.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/filter/outliers.h"
#include "identify/noise/ml.h"

namespace identikal {
namespace {

// How far off, in units of what still counts as right.
double distance(const EstimatedParameter& p, double truth) {
  const double off = std::abs(p.value - truth);
  // A variance at zero has an upper limit instead.
  const double se = std::isfinite(p.se) ? p.se : p.ci95[1] / 1.96;
  const double in_errors = std::isfinite(se) ? off / (2.6 * se) : HUGE_VAL;
  return std::min(in_errors, off / (0.05 * truth));
}

bool is_wrong(const NoiseEstimate& estimate, const NoiseProblem& problem) {
  for (std::size_t i = 0; i < problem.truth.size(); ++i) {
    if (distance(estimate.parameters[i], problem.truth[i]) > 1.0) return true;
  }
  return false;
}

// What a program does that makes the changes of every finding; nothing where there are none.
void follow_findings(const NoiseEstimate& estimate, const NoiseProblem& problem,
                     NoiseVerdicts& verdicts) {
  bool reject_outliers = false;
  for (const Finding& finding : estimate.findings) {
    for (const Change& change : finding.changes) {
      if (change.option != "--reject-outliers") {
        throw std::logic_error("a change that the campaign does not know: " + change.option);
      }
      reject_outliers = true;
    }
  }
  if (!reject_outliers) return;
  const NoiseEstimate after = tune_robust(
      problem.model, {problem.recording},
      [&](const std::vector<Dataset>& recordings) { return tune_ml(problem.model, recordings); });
  if (after.status != Status::ok) return;
  ++(is_wrong(after, problem) ? verdicts.cured_wrong : verdicts.cured_right);
}

void count_intervals(const NoiseEstimate& estimate, const NoiseProblem& problem,
                     NoiseVerdicts& verdicts) {
  for (std::size_t i = 0; i < problem.truth.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[i];
    const std::array<double, 2>& interval = std::isnan(p.profile95[0]) ? p.ci95 : p.profile95;
    if (std::isnan(interval[0])) continue;
    ++verdicts.intervals;
    verdicts.covered += interval[0] <= problem.truth[i] && problem.truth[i] <= interval[1];
  }
}

}  // namespace

NoiseVerdicts judge_noise_problems(std::uint64_t seed, int count, int faults) {
  NoiseVerdicts out;
  for (int i = 0; i < count; ++i) {
    const NoiseProblem problem = draw_noise_problem(seed + static_cast<std::uint64_t>(i), faults);
    try {
      const NoiseEstimate estimate = tune_ml(problem.model, {problem.recording});
      const bool wrong = is_wrong(estimate, problem);
      const bool ok = estimate.status == Status::ok;
      ++(ok ? (wrong ? out.ok_wrong : out.ok_right)
            : (wrong ? out.refused_wrong : out.refused_right));
      if (ok) count_intervals(estimate, problem, out);
      if (!ok) follow_findings(estimate, problem, out);
    } catch (const std::invalid_argument&) {
      ++out.refused_wrong;  // a step that the time stamps contradict
    }
  }
  return out;
}

std::string in_words(const std::string& name, const NoiseVerdicts& v) {
  const auto percent = [](int part, int of) { return of > 0 ? 100.0 * part / of : 0.0; };
  return fmt::format(
      "{:<12} {:>5} recordings: ok and right {:>4}, ok and wrong {:>4}, refused rightly {:>4}, "
      "refused wrongly {:>4}; of the wrong {:.1f} % end ok, of the right {:.1f} %; intervals cover "
      "{:.1f} %; remedies make {} right and {} wrong ones ok",
      name, v.recordings(), v.ok_right, v.ok_wrong, v.refused_wrong, v.refused_right,
      percent(v.ok_wrong, v.ok_wrong + v.refused_wrong),
      percent(v.ok_right, v.ok_right + v.refused_right), percent(v.covered, v.intervals),
      v.cured_right, v.cured_wrong);
}

}  // namespace identikal
