#include "identify/survey/events.h"

#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "lib/base/constants.h"

namespace identikal {
namespace {

constexpr std::size_t kMostShown = 3;

/// " at 3 s (until 4 s, sideslip up to 20 deg), at ...".
std::string times_of(const std::vector<Spin>& spins, const Eigen::VectorXd& time,
                     std::string_view unmeasured) {
  std::string out;
  std::string_view joint = " at";
  for (std::size_t i = 0; i < spins.size() && i < kMostShown; ++i) {
    const Spin& spin = spins[i];
    const std::string slip =
        std::isnan(spin.sideslip)
            ? std::string(unmeasured)
            : fmt::format(", sideslip up to {:.0f} deg", kDegreesPerRadian * spin.sideslip);
    out += fmt::format("{} {:.4g} s (until {:.4g} s{})", joint, time[spin.first],
                       time[spin.first + spin.rows - 1], slip);
    joint = ", at";
  }
  if (spins.size() > kMostShown) out += fmt::format(", and {} more", spins.size() - kMostShown);
  return out;
}

}  // namespace

Findings check_spins(const std::vector<Spin>& spins, const Eigen::VectorXd& time, bool left_out) {
  if (spins.empty()) return {};
  std::string text = "the car spins" + times_of(spins, time, ", steered against the turn");
  if (left_out) text += "; these rows are left out";
  return {make_finding(FindingCode::spin, {}, text,
                       "no single track spins; drive below the limit, or fit the part before it")};
}

Findings check_countersteering(const std::vector<Spin>& slides, const Eigen::VectorXd& time,
                               bool left_out) {
  if (slides.empty()) return {};
  std::string text =
      "the driver holds a slide by steering against the turn" + times_of(slides, time, "");
  if (left_out) text += "; these rows are left out";
  return {make_finding(
      FindingCode::countersteer, {}, text,
      left_out ? "tyres of a straight line do not slide; 'tyre: {curve: tanh}' uses these rows"
               : "beyond their grip tyres are not those of a model: drive below the limit")};
}

Findings check_rows_left_out(const std::string& cause, const std::vector<bool>& left_out,
                             const Eigen::VectorXd& time) {
  std::string spans;
  std::size_t rows = 0, runs = 0;
  for (std::size_t k = 0; k < left_out.size(); ++k) {
    if (!left_out[k]) continue;
    const std::size_t first = k;
    while (k + 1 < left_out.size() && left_out[k + 1]) ++k;
    rows += k - first + 1;
    if (++runs > kMostShown) continue;
    spans +=
        fmt::format("{}{:.4g} to {:.4g} s", runs == 1 ? "" : ", ",
                    time[static_cast<Eigen::Index>(first)], time[static_cast<Eigen::Index>(k)]);
  }
  if (rows == 0) return {};
  if (runs > kMostShown) spans += fmt::format(", and {} more", runs - kMostShown);
  return {make_finding(
      FindingCode::rows_left_out, {},
      fmt::format("{} in {} row{} ({}); {} left out", cause, rows, rows == 1 ? "" : "s", spans,
                  rows == 1 ? "it is" : "these rows are"))};
}

}  // namespace identikal
