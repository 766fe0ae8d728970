// Which ways may the outputs go behind the last row?
#pragma once

#include <cstdint>
#include <iosfwd>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Simulated outputs behind a recording.
struct Scenarios {
  std::vector<std::string> names, units;  ///< of the outputs
  Eigen::VectorXd time;                   ///< rows [s]
  std::vector<Eigen::MatrixXd> y;         ///< of each of them, ny x rows, as the recording has them
};

/// Draws from p(y(N+1), ..., y(N+rows) | y(1), ..., y(N)), jointly over all rows: x(N+1) from what the
/// filter knows of it, N(x_pred, P_pred), then the model with its noise. Their mean and standard
/// deviation are those of forecast() (identify/filter/forecast.h) for a linear model; a nonlinear one
/// is followed by its equations, and not by their straight lines. Parameters count as known.
///
/// Example:
///
///     const Scenarios ahead = simulate_scenarios(model, recordings[0], 24, 1000, 1);
///     const double last = ahead.y[0](0, 23);  // of the first one, and the first output
///
/// @param rows, future  as forecast()
/// @param seed          the same seed draws the same ones
/// @throws InputError as forecast()
Scenarios simulate_scenarios(const Model& model, const Dataset& recording, Eigen::Index rows,
                             int count, std::uint64_t seed, const Dataset* future = nullptr);

/// Time [s], then every output of the first scenario, of the second, ...: NAME_1, NAME_2.
void write_scenarios_csv(std::ostream& out, const Scenarios& scenarios);

}  // namespace identikal
