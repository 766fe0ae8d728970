#include "tests/campaigns/vehicle_verdicts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include <fmt/format.h>

#include "identify/vehicle/fit.h"
#include "lib/base/error.h"
#include "tests/campaigns/vehicle_drive_bound.h"

namespace identikal {
namespace {

constexpr const char* kJudged[] = {"Cf", "Cr", "Iz"};

const EstimatedParameter& parameter(const VehicleEstimate& fit, const std::string& name) {
  return *std::find_if(fit.parameters.begin(), fit.parameters.end(),
                       [&](const EstimatedParameter& p) { return p.name == name; });
}

bool is_wrong(const EstimatedParameter& p, double truth) {
  const double off = std::abs(p.value - truth);
  return off > 0.05 * truth && !(off < 2.6 * p.se);
}

bool is_wrong(const VehicleEstimate& fit, const VehicleDrive& drive) {
  bool wrong = false;
  for (std::size_t p = 0; p < 3; ++p) {
    wrong = wrong || is_wrong(parameter(fit, kJudged[p]), drive.truth[p]);
  }
  return wrong;
}

constexpr double kKnown = 0.25;  // the largest error of a value that counts as known

bool is_off_but_wide(const VehicleEstimate& fit, const VehicleDrive& drive) {
  for (std::size_t i = 0; i < 3; ++i) {
    const EstimatedParameter& p = parameter(fit, kJudged[i]);
    const bool off = std::abs(p.value - drive.truth[i]) > 0.05 * drive.truth[i];
    if (off && !(p.se < kKnown * p.value)) return true;
  }
  return false;
}

bool is_unknowable(const VehicleDrive& drive) {
  const std::array<double, 3> least = least_errors(drive, Insight::the_drawing);
  return !std::all_of(least.begin(), least.end(), [](double se) { return se < kKnown; });
}

// Whether nobody could tell what is wrong, at three standard deviations.
bool is_hidden(const VehicleDrive& drive) {
  return !drive.faults.kinds.empty() && least_misfit(drive) < 9.0;
}

// What a program does that makes the changes of every finding; nothing where there are none.
void follow_findings(const VehicleEstimate& fit, const VehicleDrive& drive,
                     VehicleVerdicts& verdicts) {
  VehicleFitOptions options;
  Dataset recording = drive.recording;
  Model model = drive.model;
  bool any = false;
  for (const Finding& finding : fit.findings) {
    for (const Change& change : finding.changes) {
      any = true;
      if (change.option == "--structure auto") {
        options.structure = VehicleFitOptions::Structure::automatic;
      } else if (change.model ==
                 fmt::format("outputs: {{{}: {{scale: -1}}}}", finding.about.front())) {
        for (std::size_t j = 0; j < recording.outputs.size(); ++j) {
          if (recording.outputs[j].name != finding.about.front()) continue;
          recording.y.row(static_cast<Eigen::Index>(j)) *= -1.0;
        }
      } else if (const std::size_t at = change.model.find("{steps: "); at != std::string::npos) {
        as_vehicle(model).steering_steps = std::stod(change.model.substr(at + 8));
      } else if (const std::size_t of = change.model.find("{noise: "); of != std::string::npos) {
        as_vehicle(model).steering_noise = std::stod(change.model.substr(of + 8));
      } else {
        throw std::logic_error("a change that the campaign does not know: " + change.model);
      }
    }
  }
  if (!any) return;
  const VehicleEstimate after = fit_vehicle(model, recording, options);
  if (after.status != Status::ok) return;
  ++(is_wrong(after, drive) ? verdicts.cured_wrong : verdicts.cured_right);
}

void print(const VehicleDrive& drive, const VehicleEstimate& fit, bool hidden) {
  std::string line;
  for (std::size_t i = 0; i < 3; ++i) {
    const EstimatedParameter& p = parameter(fit, kJudged[i]);
    line +=
        fmt::format(" {} {:+.1f} % ({:.1f})", kJudged[i], 100.0 * (p.value / drive.truth[i] - 1.0),
                    (p.value - drive.truth[i]) / p.se);
  }
  std::printf("%-70s %s | %s%s\n", drive.words.c_str(), line.c_str(), fit.message.c_str(),
              hidden ? " (nobody could tell)" : "");
}

}  // namespace

VehicleVerdicts judge_vehicle_drives(std::uint64_t seed, int count, int faults,
                                     VehicleFitOptions::Structure structure, bool each) {
  VehicleVerdicts out;
  VehicleFitOptions options;
  options.structure = structure;
  for (int i = 0; i < count; ++i) {
    const VehicleDrive drive = draw_vehicle_drive(seed + static_cast<std::uint64_t>(i), faults);
    try {
      const VehicleEstimate fit = fit_vehicle(drive.model, drive.recording, options);
      const bool wrong = is_wrong(fit, drive);
      const bool ok = fit.status == Status::ok;
      ++(ok ? (wrong ? out.ok_wrong : out.ok_right)
            : (wrong ? out.refused_wrong : out.refused_right));
      const bool hidden = wrong && is_hidden(drive);
      if (hidden) ++(ok ? out.ok_wrong_unknowable : out.refused_wrong_unknowable);
      for (const DriveFault fault : drive.faults.kinds) {
        out.wrong_by_fault[fault] += ok && wrong;
        out.unknowable_by_fault[fault] += ok && hidden;
      }
      for (std::size_t p = 0; ok && p < 3; ++p) {
        const EstimatedParameter& of = parameter(fit, kJudged[p]);
        ++out.intervals;
        out.covered += of.ci95[0] <= drive.truth[p] && drive.truth[p] <= of.ci95[1];
      }
      out.refused_wide += !ok && !wrong && is_off_but_wide(fit, drive);
      out.unknowable += !ok && is_unknowable(drive);
      if (!ok) follow_findings(fit, drive, out);
      if (each) print(drive, fit, hidden);
    } catch (const InputError&) {
      ++out.refused_wrong;
    }
  }
  return out;
}

std::string in_words(const std::string& name, const VehicleVerdicts& v) {
  const auto percent = [](int part, int of) { return of > 0 ? 100.0 * part / of : 0.0; };
  std::string out = fmt::format(
      "{:<12} {:>5} drives: ok and right {:>4}, ok and wrong {:>4}, refused rightly {:>4}, refused "
      "wrongly {:>4} ({} of them off by more than 5 % with an error above a quarter; of all "
      "refused "
      "{} that nobody could know); of the wrong {:.1f} % end ok, of the right {:.1f} %; intervals "
      "cover {:.1f} "
      "%; remedies make {} right and {} wrong ones ok",
      name, v.drives(), v.ok_right, v.ok_wrong, v.refused_wrong, v.refused_right, v.refused_wide,
      v.unknowable, percent(v.ok_wrong, v.ok_wrong + v.refused_wrong),
      percent(v.ok_right, v.ok_right + v.refused_right), percent(v.covered, v.intervals),
      v.cured_right, v.cured_wrong);
  for (const auto& [fault, count] : v.wrong_by_fault) {
    if (count > 0) out += fmt::format("; {} {}", to_string(fault), count);
  }
  const int knowable = v.ok_wrong - v.ok_wrong_unknowable;
  out += fmt::format(
      "; of the ok and wrong {} that nobody could tell, of the other wrong {:.1f} % end ok",
      v.ok_wrong_unknowable,
      percent(knowable, knowable + v.refused_wrong - v.refused_wrong_unknowable));
  for (const auto& [fault, count] : v.unknowable_by_fault) {
    if (count > 0) {
      out += fmt::format("; {} {}: {}", to_string(fault), count, revealed_by(fault));
    }
  }
  return out;
}

}  // namespace identikal
