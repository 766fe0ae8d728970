// What do the jobs answer beyond parameters? One struct for each job that has more to say.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/finding.h"
#include "identify/estimate/none.h"

namespace identikal {

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

/// Where the information of a nonlinear model comes from.
struct SimulatedInformation {
  int recordings = 0;          ///< that it is the mean of
  std::uint64_t seed = 0;      ///< of their noise
  double relative_se = kNone;  ///< of the bound's standard deviations, relative, at most
};

/// What a recording could determine at best, before there is one.
struct Bound {
  Eigen::Index samples = 0;
  double accuracy = kNone;  ///< wanted standard deviation / value
  /// Of one of Estimate::parameters; kNone and empty where it is fixed.
  struct Parameter {
    std::string name;
    double complete_se = kNone;     ///< if the states were observed too
    double samples_needed = kNone;  ///< for the accuracy
    Eigen::MatrixXd gain_change;    ///< of the steady gain, for 1 % more of the parameter
    double published_se = kNone;    ///< Matisko (2013), (6.45), carried over where one to one
  };
  std::vector<Parameter> parameters;              ///< in the order of Estimate::parameters
  Eigen::MatrixXd gain_se;                        ///< that the bound leaves to the steady gain
  std::optional<SimulatedInformation> simulated;  ///< without, the information is exact
  /// Where K and Sigma are the unknowns themselves; all empty without a steady filter.
  struct InnovationForm {
    Eigen::MatrixXd Sigma;  ///< steady innovation covariance
    Eigen::MatrixXd K_se;   ///< NaN where the outputs do not show all states
    Eigen::MatrixXd Sigma_se;
    double published_K_se = kNone;  ///< Matisko (2013), (6.45): one state and one output only
    double published_Sigma_se = kNone;
  } innovation_form;
};

/// What stands behind a Bayesian estimate; there `value` is the posterior mean, `se` its standard
/// deviation and `ci95` the central credible interval.
struct Posterior {
  std::string method;        ///< "grid" or "sequential Monte Carlo"
  Eigen::Index points = 0;   ///< grid points or draws
  double effective = kNone;  ///< of them, as many count: (sum w)^2 / sum w^2, or distinct draws
  double log_evidence = kNone;
  /// Of one of Estimate::parameters; kNone and empty where it is fixed.
  struct Parameter {
    std::string name;
    double map = kNone;  ///< the most probable point, in the coordinates of the prior
    std::string prior;   ///< in words
  };
  std::vector<Parameter> parameters;  ///< in the order of Estimate::parameters
};

/// What the outputs are expected to be behind the last row.
struct Forecast {
  std::vector<std::string> names, units;  ///< of the outputs
  Eigen::VectorXd time;                   ///< rows, as recorded [s]
  Eigen::MatrixXd mean, sd;               ///< outputs x rows; sd is that of a measurement
  Eigen::MatrixXd low, high;              ///< 95 % of the measurements lie between
};

/// A model from data alone: what was tried, what was chosen (identify/black_box/black_box.h).
struct BlackBox {
  std::string purpose;  ///< "automatic", "simulation", "prediction" or "control"
  int order = 0;        ///< states of the model that was chosen
  /// How it was found: "states", "simulation", "output_error", "prediction_error" or "any_poles" (the same, unstable
  /// poles too); of polynomials "arx", "armax", "output_error" or "box_jenkins".
  std::string refinement;
  long lags = 0;                ///< rows that the predictor behind all of them looks back
  double held_out_share = 0.0;  ///< of every recording, at its end, that candidates were judged on
  Eigen::VectorXd singular_values;  ///< what each state says of the outputs to come, falling
  struct Candidate {
    int order = 0;
    std::string refinement;
    double bic = kNone;  ///< of the one-step predictions, k log(rows) - 2 L
    /// Fit of the held-out rows in per cent, mean over the outputs.
    double simulation_fit = kNone, prediction_fit = kNone;
    double control_fit = kNone;  ///< of the predictions 1 to `horizon` rows ahead together
  };
  std::vector<Candidate> candidates;
  long horizon = 0;  ///< rows ahead that count for control; 0: control is not the purpose
  /// Of A; one of each conjugate pair.
  struct Pole {
    double real = kNone, imaginary = kNone, real_se = kNone, imaginary_se = kNone;
    double frequency = kNone;      ///< [rad/s]: of the pole in continuous time, |log(pole)|/dt
    double damping = kNone;        ///< of it, -Re/|.|
    double time_constant = kNone;  ///< [s]: 1/-Re of it
    double frequency_se = kNone, damping_se = kNone, time_constant_se = kNone;
  };
  std::vector<Pole> poles;
  /// A(q) y = B(q)/F(q) u + C(q)/D(q) e of one output: one of its polynomials, in SI.
  struct Polynomial {
    std::string output, name, input;  ///< name: "A" to "F"; an input of B and F
    long delay = 0;                   ///< power of q^-1 at the first coefficient
    Eigen::VectorXd value, se;        ///< se kNone where the recordings do not determine them
  };
  std::vector<Polynomial> polynomials;
  /// The model's signals are deviations from it.
  struct OperatingPoint {
    std::string channel, unit;
    double value = kNone;
  };
  std::vector<OperatingPoint> operating_point;
  /// Rows after which an input is first seen in any output.
  struct Delay {
    std::string input;
    long rows = 0;
    /// What it may have done before, by the largest response to it: two standard errors of the responses there.
    double before = kNone;
  };
  std::vector<Delay> delays;
  /// A curve that a linear model has not, and that the recordings ask for.
  struct Nonlinearity {
    /// "input": of an input, in its place; "output": of an output, where it is measured; "feedback": of an output, in
    /// the place of an input.
    std::string place;
    std::string shape;          ///< "square", "cube" or "absolute value"
    std::string input, output;  ///< empty where none takes part
    double p = kNone;           ///< that a linear system shows as much, of this curve by itself
    double of_innovations = kNone,
           of_simulation = kNone;  ///< share of their squares that it explains
  };
  std::vector<Nonlinearity> nonlinearities;  ///< the one that explains most first
  /// What an output does behind a unit of an input, without a model: by regularised least squares.
  struct ImpulseResponse {
    std::string input, output;
    std::string kernel;         ///< of largest evidence: "TC", "DC" or "SS"
    Eigen::VectorXd value, se;  ///< from the same row on, SI
  };
  std::vector<ImpulseResponse> impulse_responses;
  /// What an output of the model does behind a unit step of an input.
  struct StepResponse {
    std::string input, output;
    Eigen::VectorXd value, se;  ///< from the same row on, SI
  };
  std::vector<StepResponse> step_responses;
  /// In continuous time, inputs held between the rows: coefficients of falling powers of s, SI, as many in the
  /// numerator as in the denominator, whose first is 1.
  struct TransferFunction {
    std::string input, output;
    Eigen::VectorXd numerator, numerator_se, denominator, denominator_se;
  };
  std::vector<TransferFunction> transfer_functions;  ///< none where a pole is at or below zero
  /// Of an output to an input at frequencies [rad/s]: the model's, and by spectral analysis without a model. Gains are SI,
  /// phases [deg].
  struct FrequencyResponse {
    std::string input, output;
    Eigen::VectorXd frequency, gain, gain_se, phase, phase_se;
    Eigen::VectorXd spectral_gain, spectral_gain_se, spectral_phase, spectral_phase_se;
    Eigen::VectorXd coherence;  ///< share of the output's power that all inputs explain together
  };
  std::vector<FrequencyResponse> frequency_responses;
  std::vector<std::string> inputs, outputs;
  Eigen::MatrixXd gain,
      gain_se;  ///< outputs x inputs: in the steady state, SI; kNone where it has none
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
    /// names: estimates just before, and at the end of what follows.
    Eigen::VectorXd before, after;
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
  /// Spectra of the standardised innovations, 1 where they are white: frequencies [rad/s], channels
  /// x frequencies; 95 % of a white sequence's values lie in the band.
  Eigen::VectorXd frequency;
  Eigen::MatrixXd spectrum_white, spectrum_shaped;  ///< shaped: empty without filter
  std::array<double, 2> band{kNone, kNone};
  /// Of held-out data, without and with the filter.
  struct Prediction {
    std::string channel, unit;
    int steps = 0;  ///< samples ahead
    double rmse_without = kNone, rmse_with = kNone;
  };
  std::vector<Prediction> predictions;  ///< channel by channel, more and more steps ahead
  double held_out_log_likelihood_without = kNone, held_out_log_likelihood_with = kNone;
  std::string held_out_choice;  ///< what the rest alone asks for: "process noise of w1, order 2"
};

/// What a vehicle's recording holds and what it can determine, before any fit
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
  /// Least, 5 %, median, 95 %, largest while turning [m/s].
  std::array<double, 5> speed{kNone, kNone, kNone, kNone, kNone};
  /// Share of |ay| [m/s^2] up to 1, 2, 3, 4, 6, 8 and above.
  std::array<double, 7> lateral_acceleration{};
  double steering_above_0_5_hz = kNone;  ///< share of the steering's power above 0.5 Hz
  double steering_above_1_5_hz = kNone;
  double left = kNone;        ///< share of turning to the left
  double steady = kNone;      ///< share of turning at a constant steering angle
  double yaw_change = kNone;  ///< of the yaw rate within half a second, over its size
  struct Verdict {
    std::string of;      ///< "Cf, Cr", "Iz", "steering_ratio", "a, b", "offsets"
    std::string answer;  ///< "yes", "poorly", "combination" or "no"
    std::string why;
  };
  std::vector<Verdict> identifiable;
  /// A line of `inputs` or `outputs` of a model file.
  struct Proposal {
    std::string list;  ///< "inputs" or "outputs"
    std::string name, column, unit;
    double scale = 1.0;
    double offset = 0.0;  ///< in `unit`: only what the model file says already
    double delay = 0.0;   ///< [s]
  };
  std::vector<Proposal> mapping;
  std::string time_column, time_unit;  ///< empty: none
  bool restarts = false;     ///< several runs in one file: each begins where time goes back
  double least_speed = 3.0;  ///< [m/s] of use_when
  Findings findings;
};

}  // namespace identikal
