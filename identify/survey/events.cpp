#include "identify/survey/events.h"

#include <cmath>

#include <fmt/format.h>

#include "lib/base/constants.h"

namespace identikal {

Findings check_spins(const std::vector<Spin>& spins, const Eigen::VectorXd& time, bool left_out) {
  if (spins.empty()) return {};
  std::string text = "the car spins";
  std::string_view joint = " at";
  for (const Spin& spin : spins) {
    text += fmt::format(
        "{} {:.4g} s (until {:.4g} s{})", joint, time[spin.first], time[spin.first + spin.rows - 1],
        std::isnan(spin.sideslip)
            ? ", steered against the turn"
            : fmt::format(", sideslip up to {:.0f} deg", kDegreesPerRadian * spin.sideslip));
    joint = ", at";
  }
  if (left_out) text += "; these rows are left out";
  return {make_finding(FindingCode::spin, {}, text,
                       "no single track spins; drive below the limit, or fit the part before it")};
}

}  // namespace identikal
