// What does every estimator answer with? One value that the console table, the JSON result and the
// tests read.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/pictures.h"
#include "lib/model/state_space.h"

namespace identikal {

inline constexpr double kNone =
    std::numeric_limits<double>::quiet_NaN();  ///< "absent"; null in JSON

/// Eigenvalues of the unit-diagonal information below this share of the largest carry no
/// information: exact sensitivities leave about 1e-13 there.
inline constexpr double kFlat = 1e-9;

/// What a person may do with the result; the codes of the JSON result.
enum class Status { ok, answer_no, not_converged, untrusted };

/// What the data say about one parameter.
enum class Verdict {
  ok,
  weak,        ///< standard error above a quarter of the value
  correlated,  ///< cannot be told from the parameters named in `with`
  at_bound,    ///< the estimate lies on a bound; no interval
  unexcited,   ///< the recording never moved it
  flat,        ///< lies in a direction along which the fit does not change
  unfitted,    ///< nothing was fitted: the value is the start
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

struct Warning {
  std::string code;      ///< stable, e.g. "tyre_saturation"
  std::string severity;  ///< "note", "warning" or "serious"; serious makes the result untrusted
  std::vector<std::string> about;
  std::string text;    ///< what was seen, with figures
  std::string remedy;  ///< what to do about it
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
  StateSpace
      model;  ///< as instantiate() gives it (lib/model/linear_model.h); x0 and P0 are not kept
  Eigen::MatrixXd K;  ///< of the predictor: x_pred(t+1) = A x_pred + B u + K e, K = (A P C' + G S)
                      ///< Sigma^-1
  Eigen::MatrixXd L;  ///< of the filter: x_filt(t) = x_pred(t) + L e, L = P C' Sigma^-1
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

/// How the fit of Q depends on how many independent sources of process noise it has.
struct RankSelection {
  struct Step {
    double penalty = kNone, objective = kNone, trace = kNone;  ///< of tr Q; of the fit; tr Q
    Eigen::Index rank = 0;                   ///< of Q: independent sources of noise
    double excess = kNone, allowed = kNone;  ///< chi-square of the re-fit with Q of that rank
  };
  std::vector<Step> curve;        ///< from the largest penalty to none
  Eigen::Index rank = 0, of = 0;  ///< of Q: the one selected, and the largest possible
};

/// What a recording could tell at best, before there is one. Vectors go with Estimate::parameters
/// and hold kNone for those that are fixed.
struct Bound {
  Eigen::Index samples = 0;
  double accuracy = kNone;                   ///< wanted standard deviation / value
  std::vector<double> complete_se;           ///< if the states were observed too
  std::vector<double> samples_needed;        ///< for the accuracy
  std::vector<Eigen::MatrixXd> gain_change;  ///< of the steady gain, for 1 % more of the parameter
  Eigen::MatrixXd gain_se;                   ///< that the bound leaves to the steady gain
  /// Nonlinear models: recordings that the information is the mean of, 0 where it is exact.
  int simulated = 0;
  std::uint64_t seed = 0;        ///< of their noise
  double simulation_se = kNone;  ///< of the bound's standard deviations, relative, at most
  /// Where K and Sigma are the unknowns themselves; all empty without a steady filter.
  struct InnovationForm {
    Eigen::MatrixXd Sigma;  ///< steady innovation covariance
    Eigen::MatrixXd K_se;   ///< NaN where the outputs do not show all states
    Eigen::MatrixXd Sigma_se;
    double published_K_se = kNone;  ///< Matisko (2013), (6.45): one state and one output only
    double published_Sigma_se = kNone;
    std::vector<double> published_se;  ///< (6.45) carried over to the parameters, where one to one
  } innovation_form;
};

/// What stands behind a Bayesian estimate; there `value` is the posterior mean, `se` its standard
/// deviation and `ci95` the central credible interval. Vectors go with Estimate::parameters and
/// hold kNone, or nothing, for those that are fixed.
struct Posterior {
  std::string method;        ///< "grid" or "sequential Monte Carlo"
  Eigen::Index points = 0;   ///< grid points or draws
  double effective = kNone;  ///< of them, as many count: (sum w)^2 / sum w^2, or distinct draws
  double log_evidence = kNone;
  std::vector<double> map;         ///< the most probable point, in the coordinates of the prior
  std::vector<std::string> prior;  ///< in words
};

/// How noise or coefficients were estimated from sample to sample, in the parameters' units.
struct TimeHistory {
  std::vector<std::string> names, units;  ///< of the free parameters
  Eigen::MatrixXd mean, sd;               ///< names x N; sd is kNone while nothing is learnt
  Eigen::VectorXd log_alarm;              ///< N: of the test for a change; kNone without test
  double log_threshold = kNone;
  struct Change {
    double since = kNone;  ///< [s]: when it happened, as estimated
    double found = kNone;  ///< [s]: when the test rejected
    Eigen::VectorXd before,
        after;  ///< names: estimates just before, and at the end of what follows
  };
  std::vector<Change> changes;
};

/// Coloured noise: what was tried, what won, what it is worth (identify/colour/shape.h).
struct Shaping {
  double whiteness_p = kNone;  ///< that white noise looks like this, all tests together
  double peak = kNone;         ///< [rad/s]: of the white model's innovations' spectrum
  double peak_p = kNone;       ///< that white noise has one as high
  std::string noise_source;    ///< "process" or "measurement"; empty: no filter
  int order = 0;               ///< of each filter
  int zeros = 0;               ///< of each filter
  struct Pole {
    double frequency = kNone;  ///< [rad/s]
    double radius = kNone;     ///< in the plane of z
  };
  std::vector<Pole> poles;     ///< of the filters, one of each pair
  double output_peak = kNone;  ///< [rad/s]: of the outputs' spectrum, at the slowest of them
  struct Candidate {
    std::string noise_source, channels;  ///< "white", "process" or "measurement"
    int order = 0, zeros = 0;
    double log_likelihood = kNone, bic = kNone;
  };
  std::vector<Candidate> candidates;  ///< the white model first, then the best first
  std::vector<std::string> channels, units;
  std::vector<int> horizons;  ///< samples
  /// Spectra of the standardised innovations, 1 where they are white: frequencies [rad/s], channels
  /// x frequencies; 95 % of a white sequence's values lie in the band.
  Eigen::VectorXd frequency;
  Eigen::MatrixXd spectrum_white, spectrum_shaped;  ///< shaped: empty without filter
  std::array<double, 2> band{kNone, kNone};
  Eigen::MatrixXd without, with;  ///< channels x horizons: rms prediction errors on held-out data
  double held_out_without = kNone, held_out_with = kNone;  ///< log-likelihoods there
};

/// What a vehicle's recording holds and what it can tell, before any fit
/// (identify/survey/survey.h).
struct VehicleSurvey {
  struct Signal {
    std::string quantity;  ///< "steering", "vx", "wheel_speed", "r", "vy", "ay", "beta", "ax"
    std::string column, unit;
    std::string source;               ///< the file, hence the clock, that it comes from
    double rate = kNone;              ///< [Hz]
    double min = kNone, max = kNone;  ///< in `unit`
    double held = kNone;      ///< share of samples that repeat the one before while it moves
    double quantum = kNone;   ///< least difference of two values, in `unit`
    double straight = kNone;  ///< median while driving straight on, in `unit`
  };
  std::vector<Signal> signals;
  /// Two things that kinematics ties together; lags as in lib/statistics/clock_offset.h.
  struct Relation {
    std::string expected, seen;          ///< e.g. "vx r" and "ay"
    double correlation = kNone;          ///< at the best lag
    double slope = kNone;                ///< size of what is seen over what is expected
    double lag = kNone, lag_se = kNone;  ///< [s]: positive, `seen` comes late
    double other_lag = kNone, other_correlation = kNone;
    bool clock = false;  ///< the lag is one of clocks: certain and larger than any car's
  };
  std::vector<Relation> relations;
  double duration = kNone;    ///< [s], of the times in which speed and yaw rate are known
  double standstill = kNone;  ///< share of it
  double reversing = kNone;
  double moving = kNone;  ///< above the speed that `mapping` proposes [s]
  std::array<double, 5> speed{kNone, kNone, kNone, kNone,
                              kNone};  ///< [m/s]: least, 5 %, median, 95 %, largest while turning
  std::array<double, 7> lateral{};     ///< share of |ay| [m/s^2] up to 1, 2, 3, 4, 6, 8 and above
  double above_half_hertz = kNone;     ///< share of the steering's power above 0.5 Hz
  double above_1_5_hertz = kNone;
  double left = kNone;    ///< share of turning to the left
  double steady = kNone;  ///< share of turning at a constant steering angle
  struct Verdict {
    std::string of;      ///< "Cf, Cr", "Iz", "steering_ratio", "a, b", "offsets"
    std::string answer;  ///< "yes", "weak", "combination" or "no"
    std::string why;
  };
  std::vector<Verdict> verdicts;
  /// A line of `inputs` or `outputs` of a model file.
  struct Proposal {
    bool input = false;
    std::string name, column, unit;
    double scale = 1.0;
    double offset = 0.0;  ///< in `unit`: only what the model file says already
    double delay = 0.0;   ///< [s]
  };
  std::vector<Proposal> mapping;
  std::string time_column, time_unit;  ///< empty: none
  double least_speed = 3.0;            ///< [m/s] of use_when
  std::vector<Warning> findings;
};

/// What the result was computed from, one per data file.
struct InputRecord {
  std::string path;
  std::string sha256;
  long rows = 0;
  long used = 0;
  /// Of time that was asked for [s], from the first row; of the rows in it, `used` were.
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
  Status status = Status::not_converged;
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
  std::optional<ExcessMeanSquareError>
      excess_mean_square_error;               ///< where noise is estimated, and verb bound
  std::optional<RankSelection> minimum_rank;  ///< tune --min-rank only
  std::optional<VehicleSurvey> survey;        ///< info --vehicle only
  std::vector<DerivedValue> derived;
  std::vector<Warning> warnings;
  std::vector<std::string> notes;  ///< tables and remarks for people, line by line
  Series series;
  Pictures pictures;  ///< filled where a report is asked for
};

/// As results print it: "not_converged", "weak".
std::string to_string(Status status);
std::string to_string(Verdict verdict);

/// Exit code of the contract: ok 0, answer_no and untrusted 1, not_converged 3; `strict` turns
/// warnings into 4.
int exit_code(const Estimate& estimate, bool strict);

/// Fills correlation, identifiability, se, ci95 and verdicts. The k parameters judged are those
/// that are neither fixed nor already found at a bound, in their order.
/// @param information  k x k, in the units of `estimate.parameters`; its null directions are the
/// flat ones
/// @param covariance   k x k; what `se` is taken from (it need not be the inverse of `information`)
/// @param quantile     half-width of the 95 % interval in standard errors
/// A parameter in a flat direction gets neither standard error nor interval.
/// @throws std::invalid_argument when a matrix is not k x k
void judge_parameters(Estimate& estimate, const Eigen::MatrixXd& information,
                      const Eigen::MatrixXd& covariance, double quantile = 1.959963984540054);

}  // namespace identikal
