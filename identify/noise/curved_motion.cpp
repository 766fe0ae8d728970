#include "identify/noise/curved_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/finding.h"
#include "identify/estimate/parameter_table.h"
#include "identify/model/check.h"
#include "identify/model/noise_entries.h"
#include "identify/noise/estimate.h"
#include "identify/noise/internal/extension_fit.h"
#include "identify/noise/internal/moved_estimates.h"
#include "identify/noise/internal/possible_extensions.h"

namespace identikal {
namespace {

constexpr double kSignificant = 1e-3;  // of all curves together

// What a maximum gains by one unknown more with that probability where nothing is missing.
double significant_gain(std::size_t curves) {
  const double p = kSignificant / static_cast<double>(curves);
  return 0.5 * chi_square_quantile(1.0 - p, 1.0);
}

Finding in_words(const ModelExtension& curve, double gain, const std::vector<MovedEstimate>& moved,
                 const NoiseEstimate& estimate) {
  std::string text = fmt::format("the recordings ask for {}: the log-likelihood is {:.3g} higher",
                                 in_words(curve), gain);
  if (moved.empty()) {
    text += ", and no estimate but of noise moves by it";
  } else {
    text += ", and " + in_words(moved.front(), estimate);
  }
  Finding out = make_finding(
      FindingCode::nonlinear, curve.names, text,
      "'identikal tune --extend' tries it on rows held out; or write it into the dynamics");
  if (!moved.empty()) out.severity = Severity::serious;
  return out;
}

}  // namespace

bool may_lack_a_curve(const Model& model, const NoiseEstimate& estimate) {
  if (estimate.status != Status::ok || model.states.empty() || moves_without_noise(model)) {
    return false;
  }
  const std::vector<bool> noise = entries_of_noise(model);
  return !std::all_of(noise.begin(), noise.end(), [](bool of_noise) { return of_noise; });
}

void judge_by_curves(const YamlNode& root, const Model& given,
                     const std::vector<Dataset>& recordings, NoiseEstimate& estimate,
                     const std::function<bool(const ModelExtension& extension)>& progress) {
  if (!may_lack_a_curve(given, estimate) || find(root, "dynamics") == nullptr) return;
  Model model = checked(given, recordings);
  model.parameters = parameters_of(estimate, model.parameters);
  const std::vector<Dataset> rows = rows_to_fit(recordings);
  const std::vector<ModelExtension> curves = curved_motions(root, model, rows);
  if (curves.empty()) return;
  FittedModel base{root, std::move(model), 0.0};
  const auto L = fit_values(base.model, rows);
  if (!L) return;
  base.log_likelihood = *L;
  const double least = significant_gain(curves.size());
  const auto found = likeliest_curve(base, curves, rows, least, progress);
  if (!found) return;
  estimate.findings.push_back(
      in_words(curves[found->which], found->fitted.log_likelihood - base.log_likelihood,
               moved_estimates(base.model, found->fitted.model, estimate), estimate));
  conclude(estimate, "converged");
}

}  // namespace identikal
