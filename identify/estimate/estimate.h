// What does every job answer with? Its status, the parameters with their errors, and why.
#pragma once

#include <array>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/estimate/conclusion.h"
#include "identify/estimate/finding.h"
#include "identify/estimate/none.h"
#include "identify/estimate/status.h"

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
  untrusted,          ///< determined, by a model that the data contradict
};

struct EstimatedParameter {
  std::string name;
  std::string unit;  ///< unit of every number here
  double value = kNone;
  double se = kNone;
  std::array<double, 2> ci95{kNone, kNone};
  std::array<double, 2> profile95{kNone, kNone};  ///< interval of the profile likelihood
  double se_sandwich = kNone;                     ///< allows for noise that is not Gaussian
  double se_structure = kNone;  ///< the part of `se` that comes by what the model leaves out
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
  std::string prior;  ///< that counted beside the data, in words; empty: none (fit and tune, ml)
};

/// A quantity computed from the parameters, with its error carried over (delta method).
struct DerivedValue {
  std::string name;
  std::string unit;
  double value = kNone;
  double se = kNone;
};

/// A function that parameters stand for, with its error carried over.
struct EstimatedCurve {
  std::string name, unit;
  std::string axis, axis_unit;    ///< what it runs over
  Eigen::VectorXd at, value, se;  ///< of equal length
  double freedom = kNone;         ///< by how many free numbers it follows the data; of smooth ones
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

struct Objective {
  std::string method;
  std::string initial;  ///< of a linear model's state: "given", "stationary" or "diffuse"
  std::string filter;   ///< of a nonlinear model: "extended", "iterated" or "unscented"
  double log_likelihood = kNone;
  double log_likelihood_start = kNone;
  /// Leading samples of every recording that determine a diffuse start; aic and bic are those of
  /// what comes behind them, so that the units of the states do not matter.
  long diffuse_samples = 0;
  /// Log-likelihood of the first 1, 2, ... samples of every recording together; NaN for fewer than
  /// diffuse_samples (identify/filter/leading_samples.h).
  Eigen::VectorXd leading;
  double aic = kNone;
  /// Of a filter k log(rows) - 2 L, as Stata and statsmodels count; bic_values k log(values) - 2 L.
  double bic = kNone, bic_values = kNone;
  long samples = 0;         ///< measured values that the likelihood is of; 0: no BIC
  long rows = 0;            ///< with anything measured, of a filter
  double held_out = kNone;  ///< log-likelihood per held-out row, of a filter
  int iterations = 0;
  int evaluations = 0;
  int starts = 0;             ///< optimisations run
  int starts_at_optimum = 0;  ///< of them, how many ended at the best value
  /// Of the likelihood (lib/filter/likelihood.h): "time_varying_filter", "steady_state_filter" or
  /// "sample_autocovariances"; and why not a faster one.
  std::string evaluation_method, evaluation_reason;
  double integration_step = kNone;  ///< the shortest that was taken of equations of motion [s]
};

/// Objective::method of a fit to the errors of a simulation, which need not be white.
inline constexpr const char* kSimulationMethod = "simulation";

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

/// What every job answers. The type of a job's result adds what only that job has to say
/// (identify/estimate/results.h).
///
/// Example:
///
///     for (const EstimatedParameter& p : estimate.parameters) {
///       std::printf("%s = %g +- %g\n", p.name.c_str(), p.value, p.se);
///     }
///     if (exit_code(estimate, false) != 0) std::puts(estimate.message.c_str());
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
  Objective objective;
  Identifiability identifiability;
  std::vector<DerivedValue> derived;
  std::vector<EstimatedCurve> curves;
  Findings findings;               ///< printed() of them are the warnings of a result
  std::vector<std::string> notes;  ///< tables and remarks for people, line by line
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

/// Standard error over value, both in SI: the same in degC and in K. 0 where the value is zero.
double relative_error(const EstimatedParameter& p);

/// Fills correlation, identifiability, se, ci95 and verdicts. The k parameters judged are those
/// that are neither fixed nor already found at a bound, in their order.
/// @param information  k x k, in the units of `estimate.parameters`; its null directions are those
///   that the data do not identify
/// @param covariance   k x k; what `se` is taken from (it need not be the inverse of `information`)
/// @param quantile     half-width of the 95 % interval in standard errors
/// @param flat         share of the largest below which an eigenvalue carries no information
///
/// A parameter in such a direction gets neither standard error nor interval.
/// @throws std::invalid_argument when a matrix is not k x k
void judge_parameters(Estimate& estimate, const Eigen::MatrixXd& information,
                      const Eigen::MatrixXd& covariance, double quantile = 1.959963984540054,
                      double flat = kFlat);

}  // namespace identikal
