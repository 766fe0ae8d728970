// Which filter do noise covariances stand for, and what do their errors cost it?
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/none.h"
#include "lib/model/state_space.h"

namespace identikal {

struct Noise {
  Eigen::MatrixXd Q, R, S, K_steady, P_steady;  ///< empty = absent
  std::string Q_kind;                           ///< "per-sample" or "density"
};

/// The filter that the noise stands for, as a program runs it: discrete time, all in SI. Without a
/// steady state K, L, P and Sigma are empty.
struct SteadyFilter {
  /// As instantiate() gives it (lib/model/linear_model.h); x0 and P0 are not kept.
  StateSpace model;
  /// Of the predictor: x_pred(t+1) = A x_pred + B u + K e, K = (A P C' + G S) Sigma^-1.
  Eigen::MatrixXd K;
  Eigen::MatrixXd L;         ///< of the filter: x_filt(t) = x_pred(t) + L e, L = P C' Sigma^-1
  Eigen::MatrixXd P, Sigma;  ///< covariances of x_pred and of e = y - C x_pred - D u
  struct Channel {
    std::string name, unit;  ///< unit of the column; the filter takes SI
  };
  /// Inputs as the columns of B and D: those of the model file, "1" for an input that is always 1
  /// where the model has an offset, and where they are held linearly all of them again, at t+1.
  std::vector<Channel> inputs, outputs;
  std::vector<Channel> states;  ///< as formulas name them, their unit the user's; empty: no names
};

/// Of a model at the values of the result.
struct FilterMatrices {
  Noise noise;
  std::optional<SteadyFilter> filter;  ///< linear models
};

/// What the errors of noise parameters cost the filter made with them.
struct ExcessMeanSquareError {
  double relative = kNone;  ///< expected tr P over the optimal, - 1 (lib/filter/information.h)
  std::vector<std::string> without;  ///< variances that ended at zero: their errors do not count
  std::string reason;                ///< why there is no number
};

}  // namespace identikal
