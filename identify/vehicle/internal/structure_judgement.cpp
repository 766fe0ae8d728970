#include "identify/vehicle/internal/structure_judgement.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "lib/base/constants.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

constexpr double kOpen = 0.25;              // of a parameter: what makes it unknown
constexpr double kLargestShift = 0.2;       // of a parameter: what of it counts where it is taken
constexpr double kShareOfStructure = 0.25;  // of a variance: from there on it is the structure's
constexpr double kMistaken = 5.0;           // standard deviations of the prior
constexpr double kCertain = 0.8;            // the probability of a mistake that is taken as one
constexpr double kEvident = 4.0 * 49.0;     // its evidence: that probability at odds of 1 to 49
constexpr double kNoticed = 2.0;            // standard deviations from what the model takes
constexpr double kDetermined = 0.7;         // of the prior's standard deviation

// Standard deviations of the prior: what stands for something else.
constexpr double kUnheardOf = 3.5;

/// Told by the recording, not by the prior alone, and not what the model takes.
bool is_seen(const StructureCause& cause) {
  return cause.sd < kDetermined * cause.prior_sd &&
         std::abs(cause.value - cause.as_written) > kNoticed * cause.sd;
}

/// How a body rolls means something only where it is seen to roll.
bool is_of_roll(const StructureCause& cause) {
  const std::array kOfRoll = {kRollQuickness, kRollDecay, kRollArm, kHeightOfAy, kHeightOfVy};
  return std::any_of(kOfRoll.begin(), kOfRoll.end(),
                     [&](SecondaryEffect effect) { return cause.name == name_of(effect); });
}

bool rolls(const StructureStudy& study) {
  const auto at = std::find_if(study.causes.begin(), study.causes.end(), [](const auto& cause) {
    return cause.name == name_of(kRollGradient);
  });
  return at == study.causes.end() || is_seen(*at);  // else the model has it
}

double surprise(const StructureCause& cause) {
  if (cause.heavy_tails) return 0.0;
  return std::abs(cause.value - cause.prior_mean) / cause.prior_sd;
}

/// The cause that is least of what cars have; nothing without causes.
const StructureCause* most_surprising(const StructureStudy& study) {
  const auto at = std::max_element(
      study.causes.begin(), study.causes.end(),
      [](const StructureCause& a, const StructureCause& b) { return surprise(a) < surprise(b); });
  return at == study.causes.end() ? nullptr : &*at;
}

bool is_judged(VehicleParameter parameter) {
  return parameter == kCf || parameter == kCr || parameter == kYawInertia;
}

/// What would narrow the error of these parameters most.
std::string separating_measurement(const StructureStudy& study,
                                   const std::vector<Eigen::Index>& parameters) {
  std::vector<std::pair<double, std::string>> gain;
  for (std::size_t c = 0; c < study.causes.size(); ++c) {
    const std::string& name = study.causes[c].separated_by;
    auto at =
        std::find_if(gain.begin(), gain.end(), [&](const auto& g) { return g.second == name; });
    if (at == gain.end()) at = gain.insert(gain.end(), {0.0, name});
    for (const Eigen::Index i : parameters) {
      at->first += std::pow(study.with_causes(i, static_cast<Eigen::Index>(c)), 2);
    }
  }
  std::sort(gain.begin(), gain.end(),
            [](const auto& a, const auto& b) { return a.first > b.first; });
  if (gain.empty()) return "";
  return gain.size() < 2 || gain[1].first < 0.5 * gain[0].first
             ? gain[0].second
             : fmt::format("{}; {}", gain[0].second, gain[1].second);
}

/// To the first digit of the error, or two digits of the value, whichever is finer.
std::string with_error(double value, double sd) {
  const auto decimals = [](double x, int digits) {
    return x == 0.0 ? 0 : digits - 1 - static_cast<int>(std::floor(std::log10(std::abs(x))));
  };
  return fmt::format("{:.{}f} +- {:.1g}", value, std::max({0, decimals(sd, 1), decimals(value, 2)}),
                     sd);
}

std::string in_words(const std::string& name, double value, double sd, const std::string& unit) {
  return fmt::format("{} {}{}{}", name, with_error(value, sd), unit.empty() ? "" : " ", unit);
}

std::string in_words(const StructureCause& cause) {
  return in_words(cause.name, cause.value, cause.sd, cause.unit);
}

/// The finding that belongs to a cause which is beyond anything that cars and test equipment have;
/// other: a car may have any.
FindingCode mistake(const std::string& cause) {
  if (cause == name_of(kSteeringGain)) return FindingCode::steering_gain;
  if (cause == name_of(kSteeringDelay) || cause == name_of(kSteeringLag)) {
    return FindingCode::steering_delay;
  }
  const bool of_sensor = cause.starts_with("lag of") || cause == name_of(kArmOfVy);
  return of_sensor ? FindingCode::sensor_differs : FindingCode::other;
}

bool is_about(const Findings& findings, const std::string& name) {
  return std::any_of(findings.begin(), findings.end(),
                     [&](const Finding& finding) { return finding.about.front() == name; });
}

/// Mistakes that the recording is all but sure of. Where they are small the errors allow for them.
/// @param others  what was said already
Findings check_suspected(const StructureStudy& study, const Findings& others) {
  Findings out;
  for (const SuspectedMistake& mistake : study.mistakes) {
    if (!(mistake.probability > kCertain && mistake.evidence > kEvident)) continue;
    if (is_about(others, mistake.name)) continue;
    const std::string size = in_words(mistake.name, mistake.size, mistake.sd, mistake.unit);
    const std::string text =
        mistake.may_be_a_car ? size + " would explain the recording better; so may what the car has"
                             : "the recording contradicts the model file: " + size;
    Finding finding = make_finding(mistake.code, {mistake.name}, text,
                                   "known better by: " + mistake.separated_by);
    if (std::abs(mistake.size) < mistake.gross) finding.severity = Severity::warning;
    if (mistake.may_be_a_car) finding.severity = Severity::note;
    out.push_back(std::move(finding));
  }
  return out;
}

/// A cause that no car has stands for something that the study does not have.
Findings check_surprise(const StructureStudy& study, const Findings& others) {
  const StructureCause* cause = most_surprising(study);
  const bool said = std::any_of(others.begin(), others.end(), [](const Finding& finding) {
    return finding.severity != Severity::note;
  });
  if (cause == nullptr || !(surprise(*cause) > kUnheardOf) || said) return {};
  return {make_finding(
      FindingCode::structure_dependent, {cause->name},
      fmt::format("the recording asks for {}, where cars and test equipment have {:.2g} +- {:.1g}: "
                  "something else is behind it",
                  in_words(*cause), cause->prior_mean, cause->prior_sd),
      "check axle distances, mass, places and gains of the sensors and the speed; known better "
      "by: " +
          cause->separated_by)};
}

/// What is wrong in the model file or with the equipment is no structure that errors allow for.
Findings check_mistakes(const StructureStudy& study) {
  Findings out;
  for (const StructureCause& cause : study.causes) {
    const FindingCode code = mistake(cause.name);
    const bool usual = std::abs(cause.value - cause.as_written) < kMistaken * cause.prior_sd;
    if (usual || code == FindingCode::other) continue;
    out.push_back({code,
                   Severity::serious,
                   {cause.name},
                   fmt::format("the recording contradicts the model file: {}, not {}",
                               in_words(cause), cause.as_written),
                   "check that channel; known better by: " + cause.separated_by});
  }
  return out;
}

}  // namespace

double shift_share(bool adopted) { return adopted ? 2.0 / 3.0 : 1.0; }

void widen_by_structure(const StructureStudy& study, const Eigen::VectorXd& value,
                        const Eigen::VectorXd& simulated, VehicleCovariance& covariance) {
  const Eigen::VectorXd by_method = simulated - value;
  const Eigen::VectorXd shift = shift_share(false) * (study.value - value);
  const Eigen::MatrixXd more =
      study.covariance + shift * shift.transpose() + by_method * by_method.transpose();
  covariance.covariance += more(covariance.inner, covariance.inner);
}

void take_structure(const StructureStudy& study, const VehicleUnknowns& unknowns,
                    const Eigen::VectorXd& value, VehicleCovariance& covariance) {
  Eigen::VectorXd shift = shift_share(true) * (study.value - value);
  for (Eigen::Index i = 0; i < shift.size(); ++i) {
    if (!is_judged(unknowns.free[static_cast<std::size_t>(i)])) continue;
    const double limit = kLargestShift * std::abs(study.value[i]);
    shift[i] = std::clamp(shift[i], -limit, limit);
  }
  const Eigen::MatrixXd own = study.covariance + shift * shift.transpose();
  covariance.covariance = own(covariance.inner, covariance.inner);
}

void report_structure(const StructureStudy& study, bool adopted, const VehicleUnknowns& unknowns,
                      const VehicleCovariance& of_noise, const VehicleCovariance& of_all,
                      VehicleEstimate& estimate) {
  for (std::size_t k = 0; k < of_all.inner.size(); ++k) {
    const auto n = static_cast<Eigen::Index>(k);
    EstimatedParameter& p =
        estimate.parameters[unknowns.position[static_cast<std::size_t>(of_all.inner[k])]];
    const double noise = adopted ? 0.0 : of_noise.covariance(n, n) / of_all.covariance(n, n);
    p.se_structure = p.se * std::sqrt(std::max(0.0, 1.0 - noise));
  }
  std::vector<std::string> seen;
  for (const StructureCause& cause : study.causes) {
    if (is_seen(cause) && (!is_of_roll(cause) || rolls(study))) seen.push_back(in_words(cause));
    if (adopted) estimate.derived.push_back({cause.name, cause.unit, cause.value, cause.sd});
  }
  if (!seen.empty()) {
    estimate.notes.push_back(
        fmt::format("the recording shows what the model leaves out: {}", fmt::join(seen, ", ")));
  }
  if (study.wide_angle) {
    estimate.notes.push_back(
        fmt::format("the road wheels turn by up to {:.1f} deg, where a single track's small angles "
                    "are off; the errors allow for it",
                    *study.wide_angle * kDegreesPerRadian));
  }
  if (!study.converged) {
    estimate.notes.push_back("the search for what the model leaves out did not converge");
  }
}

Findings check_structure(const StructureStudy& study, const VehicleUnknowns& unknowns,
                         const VehicleEstimate& estimate) {
  std::vector<Eigen::Index> open;
  std::vector<std::string> names, texts;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    const EstimatedParameter& p = estimate.parameters[unknowns.position[i]];
    if (!is_judged(unknowns.free[i]) || !(p.se > kOpen * std::abs(p.value))) continue;
    if (p.ci95[0] <= 0.0) continue;  // nothing is known of it, and other findings say so
    if (std::pow(p.se_structure / p.se, 2) < kShareOfStructure) continue;
    const auto n = static_cast<Eigen::Index>(i);
    const double per_si = 1.0 / unit_scale(p.unit);
    open.push_back(n);
    names.push_back(p.name);
    texts.push_back(fmt::format("{} {:.4g} here, {:.4g} +- {:.2g} {} with them", p.name, p.value,
                                study.value[n] * per_si, std::sqrt(study.covariance(n, n)) * per_si,
                                p.unit));
  }
  Findings out = check_mistakes(study);
  append(out, check_suspected(study, out));
  append(out, check_surprise(study, out));
  if (open.empty()) return out;
  out.push_back(make_finding(
      FindingCode::structure_dependent, names,
      fmt::format("{} hang{} on what the model leaves out (lags, roll, bending tyres{}): {}",
                  fmt::join(names, ", "), names.size() == 1 ? "s" : "",
                  study.wide_angle ? ", large angles" : "", fmt::join(texts, "; ")),
      fmt::format("to tell the causes apart: {}", separating_measurement(study, open))));
  return out;
}

Findings check_structure_unknown(const VehicleUnknowns& unknowns, const VehicleEstimate& estimate) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < unknowns.free.size(); ++i) {
    if (is_judged(unknowns.free[i])) {
      names.push_back(estimate.parameters[unknowns.position[i]].name);
    }
  }
  return {make_finding(FindingCode::structure_dependent, names,
                       "what lags, roll and bending tyres may add is not known: the car with them "
                       "cannot be simulated from here",
                       "look at the fit first: its values are no car's, or the drive spins")};
}

}  // namespace identikal
