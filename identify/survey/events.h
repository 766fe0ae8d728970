// What happens on a drive that no model of a car's grip describes?
#pragma once

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

}  // namespace identikal
