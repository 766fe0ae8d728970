// What does a person want to see behind the numbers? Filled where a report is requested, read by
// the report (identify/report/page_data.h) alone.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace identikal {

/// How likely the data are when one parameter is held at a value and all others are re-estimated.
struct LikelihoodProfile {
  std::string name;
  std::vector<double> value;  ///< in the parameter's unit, rising
  std::vector<double> drop;   ///< 2 (L_max - L): 3.84 at the ends of the 95 % interval
};

/// The side force of an axle: what the recording says without a model of the tyre, and the model's.
struct AxlePicture {
  std::string name;
  Eigen::VectorXd slip, force;              ///< [rad], [N]: from balances of force and moment
  Eigen::VectorXd curve_slip, curve_force;  ///< the fitted axle
};

/// Where a car drove: position in axes that begin at its first row.
struct TrackPicture {
  std::string name;
  Eigen::VectorXd X, Y;  ///< [m]
};

/// Matrices are channels x N and go with RecordingFit::series, in its units; empty where there is none.
struct Pictures {
  /// Log-likelihood from the start on, after every iteration; one search each.
  std::vector<std::vector<double>> searches;
  std::vector<LikelihoodProfile> profiles;
  Eigen::MatrixXd standardised_before;  ///< residuals / standard deviation, at the start's values
  Eigen::MatrixXd one_step;             ///< predicted from everything before
  Eigen::MatrixXd simulation;           ///< predicted without any later correction
  Eigen::MatrixXd simulation_sd;        ///< its standard deviation
  Eigen::VectorXd held_time;            ///< [s]: of M rows that the fit did not see
  std::vector<int> held_recording;      ///< 1, 2, ... of each of them; empty = there is one
  Eigen::MatrixXd held_measured, held_out_simulation;  ///< channels x M
  Eigen::MatrixXd held_standardised;  ///< channels x M, what Series::standardised is of the others
  std::vector<AxlePicture> axles;
  /// The axles' balances are high-pass filtered: only ay was measured.
  bool high_pass_filtered = false;
  std::vector<TrackPicture> tracks;
};

}  // namespace identikal
