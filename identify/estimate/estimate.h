// What does every estimator answer with? One value that the console table, the JSON result and the
// tests read.
#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/conclusion.h"
#include "identify/estimate/details.h"
#include "identify/estimate/finding.h"
#include "identify/estimate/none.h"
#include "identify/estimate/pictures.h"
#include "identify/estimate/status.h"
#include "lib/model/state_space.h"

namespace identikal {

/// Eigenvalues of the unit-diagonal information below this share of the largest carry no
/// information: exact sensitivities leave about 1e-13 there.
inline constexpr double kFlat = 1e-9;

/// How well the data determine one parameter.
enum class Verdict {
  ok,
  poorly_determined,  ///< standard error above a quarter of the value
  correlated,         ///< cannot be separated from the parameters named in `with`
  at_bound,           ///< the estimate lies on a bound; no interval
  unexcited,          ///< the recording never moved it
  not_identifiable,   ///< lies in a direction along which the fit does not change
  unfitted,           ///< nothing was fitted: the value is the start
};

struct EstimatedParameter {
  std::string name;
  std::string unit;  ///< unit of every number here
  double value = kNone;
  double se = kNone;
  std::array<double, 2> ci95{kNone, kNone};
  std::array<double, 2> profile95{kNone, kNone};  ///< interval of the profile likelihood
  double se_sandwich = kNone;                     ///< allows for noise that is not Gaussian
  /// Cramér-Rao standard deviation at the estimate for white noise of the distribution that was
  /// fitted: normal, or Student's with `fit --robust`
  double crb_se = kNone;
  double start = kNone;
  std::array<double, 2> bounds{-std::numeric_limits<double>::infinity(),
                               std::numeric_limits<double>::infinity()};
  bool fixed = false;
  bool neutral = false;  ///< fixed at a value that changes nothing: people need not read it
  Verdict verdict = Verdict::ok;
  std::vector<std::string> with;
};

/// A quantity computed from the parameters, with its error carried over (delta method).
struct DerivedValue {
  std::string name;
  std::string unit;
  double value = kNone;
  double se = kNone;
};

struct TestResult {
  std::string id;       ///< "nis", "ljung_box", ... (identify/optimality/optimality.h)
  std::string channel;  ///< empty: all together
  double value = kNone;
  std::array<double, 2> interval{kNone, kNone};
  double p = kNone;
  bool pass = true;
  double level = kNone;  ///< how often it may fail an optimal filter; kNone: no part of the verdict
};

struct ChannelFit {
  std::string channel;
  std::string unit;
  double fit_percent = kNone;  ///< 100 (1 - ||y - yhat|| / ||y - mean y||)
  double rmse = kNone;         ///< in `unit`
};

struct Identifiability {
  int rank = 0;
  int of = 0;
  double condition = kNone;  ///< of the information matrix scaled to unit diagonal
  struct Direction {
    std::vector<std::string> names;
    std::vector<double> weights;
  };
  std::vector<Direction> unidentifiable_directions;
};

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

/// The model file of a result, as it was then; of files that it includes no text is kept.
struct ModelSource {
  std::string path, sha256, text;
  struct Included {
    std::string path, sha256;
  };
  std::vector<Included> included;
};

struct Objective {
  std::string method;
  std::string initial;  ///< of a linear model's state: "given", "stationary" or "diffuse"
  std::string filter;   ///< of a nonlinear model: "extended", "iterated" or "unscented"
  double log_likelihood = kNone;
  double log_likelihood_start = kNone;
  double aic = kNone;
  double bic = kNone;
  long samples = 0;  ///< measured values that the likelihood is of, as BIC counts them; 0: no BIC
  double held_out = kNone;  ///< log-likelihood per held-out row, of a filter
  int iterations = 0;
  int evaluations = 0;
  int starts = 0;             ///< optimisations run
  int starts_at_optimum = 0;  ///< of them, how many ended at the best value
  /// Of the likelihood (lib/filter/likelihood.h): "time_varying_filter", "steady_state_filter" or
  /// "sample_autocovariances"; and why not a faster one.
  std::string evaluation_method, evaluation_reason;
};

/// What the errors of noise parameters cost the filter made with them.
struct ExcessMeanSquareError {
  double relative = kNone;  ///< expected tr P over the optimal, - 1 (lib/filter/information.h)
  std::vector<std::string> without;  ///< variances that ended at zero: their errors do not count
  std::string reason;                ///< why there is no number
};

/// What the result was computed from, one per data file.
struct InputRecord {
  std::string path;
  std::string sha256;
  long rows = 0;
  long used = 0;
  /// Of the time range that was requested [s], from the first row; of the rows in it, `used` were.
  std::array<double, 2> range{-std::numeric_limits<double>::infinity(),
                              std::numeric_limits<double>::infinity()};
};

/// Series behind the result, for residuals.csv; SI converted back to the channel's unit.
struct Series {
  Eigen::VectorXd time;
  std::vector<int> recording;  ///< 1, 2, ... of each sample; empty = there is one
  std::vector<std::string> channels, units;
  Eigen::MatrixXd measured, predicted;  ///< channels x N; NaN where there is none
  Eigen::MatrixXd standardised;         ///< residual / its standard deviation; may be empty
};

struct Estimate {
  std::string verb;
  std::string model_name;
  Status status = Status::not_converged;  ///< with the message set once, by conclude()
  std::string message = "the estimator did not run";
  std::vector<InputRecord> inputs;
  std::vector<EstimatedParameter> parameters;
  std::string covariance_kind;        ///< where `se` comes from, in words
  double covariance_freedom = kNone;  ///< of the Student's t behind `ci95`; kNone: normal
  std::vector<std::string> correlation_names;
  Eigen::MatrixXd correlation;
  Noise noise;
  std::optional<SteadyFilter> filter;     ///< linear models
  std::string tyre_curve;                 ///< vehicles: name_of(TyreCurve)
  std::optional<ModelSource> model_file;  ///< verbs with one model
  Objective objective;
  std::vector<ChannelFit> one_step, simulation;
  std::vector<ChannelFit> hold_out;           ///< simulation of data that the fit did not see
  std::vector<ChannelFit> hold_out_one_step;  ///< a filter's fit to them
  std::vector<TestResult> tests;
  Identifiability identifiability;
  std::optional<Bound> bound;               ///< verb bound only
  std::optional<Posterior> posterior;       ///< method bayes and verb track only
  std::optional<TimeHistory> time_history;  ///< verb track only
  std::optional<Shaping> shaping;           ///< verb shape only
  /// Where noise is estimated, and verb bound.
  std::optional<ExcessMeanSquareError> excess_mean_square_error;
  std::optional<RankSelection> minimum_rank;  ///< tune --min-rank only
  std::optional<VehicleSurvey> survey;        ///< info --vehicle only
  std::vector<DerivedValue> derived;
  Findings findings;               ///< printed() of them are the warnings of a result
  std::vector<std::string> notes;  ///< tables and remarks for people, line by line
  Series series;
  Pictures pictures;  ///< filled where a report is requested
};

/// Puts the findings in order and sets status and message by them: the last step of a job, as
/// conclude() of identify/estimate/conclusion.h says.
void conclude(Estimate& estimate, const std::string& message_when_ok, Basis basis = Basis::fit);

/// As results print it: "poorly_determined".
std::string to_string(Verdict verdict);

/// The parameters that the data do not determine, by verdict, in their order.
std::vector<std::string> not_determined(const Estimate& estimate);

/// Exit code of the contract: ok 0, rejected and untrusted 1, not_converged 3; `strict` turns
/// warnings into 4.
int exit_code(const Estimate& estimate, bool strict);

/// Fills correlation, identifiability, se, ci95 and verdicts. The k parameters judged are those
/// that are neither fixed nor already found at a bound, in their order.
/// @param information  k x k, in the units of `estimate.parameters`; its null directions are those
///   that the data do not identify
/// @param covariance   k x k; what `se` is taken from (it need not be the inverse of `information`)
/// @param quantile     half-width of the 95 % interval in standard errors
///
/// A parameter in such a direction gets neither standard error nor interval.
/// @throws std::invalid_argument when a matrix is not k x k
void judge_parameters(Estimate& estimate, const Eigen::MatrixXd& information,
                      const Eigen::MatrixXd& covariance, double quantile = 1.959963984540054);

}  // namespace identikal
