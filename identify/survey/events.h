// What happens on a drive that no model of a car's grip describes?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/finding.h"
#include "lib/vehicle/spin.h"

namespace identikal {

/// Names the spins of a drive, with their times; none: nothing to find.
/// @param left_out  these rows are: else they are the reader's to leave out
///
/// Example:
///
///     const Dataset& d = recordings[0];
///     const SpinSignals drive{d.time, d.u.row(0), d.u.row(1), d.y.row(0), d.y.row(1)};
///     const Findings findings = check_spins(find_spins(drive), d.time, true);
Findings check_spins(const std::vector<Spin>& spins, const Eigen::VectorXd& time, bool left_out);

/// The same of slides that a driver holds by countersteering.
Findings check_countersteering(const std::vector<Spin>& slides, const Eigen::VectorXd& time,
                               bool left_out);

/// Names rows that are left out for a cause, "esc is set", with their number and times.
/// @param left_out  N, of each row
Findings check_rows_left_out(const std::string& cause, const std::vector<bool>& left_out,
                             const Eigen::VectorXd& time);

}  // namespace identikal
