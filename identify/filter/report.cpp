#include "identify/filter/report.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/estimate/covariance_factor.h"
#include "identify/estimate/test_result.h"
#include "identify/filter/channel_fit.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/nonlinear_recordings.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/reference_errors.h"
#include "identify/filter/simulated_fit.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/starting_state.h"
#include "lib/base/error.h"
#include "lib/data/row_time.h"
#include "lib/data/units.h"
#include "lib/filter/steady_state.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autoregression.h"
#include "lib/statistics/input_correlation.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd with_gaps(const std::vector<const MatrixXd*>& parts, Index gap) {
  Index total = gap * static_cast<Index>(parts.size() - 1), at = 0;
  for (const MatrixXd* part : parts) total += part->cols();
  MatrixXd out = MatrixXd::Constant(parts[0]->rows(), total, kNone);
  for (const MatrixXd* part : parts) {
    out.middleCols(at, part->cols()) = *part;
    at += part->cols() + gap;
  }
  return out;
}

Index shortest_of(const std::vector<Dataset>& recordings) {
  Index out = recordings[0].size();
  for (const Dataset& data : recordings) out = std::min(out, data.size());
  return out;
}

std::vector<Index> measured_rows(const std::vector<Channel>& outputs) {
  std::vector<Index> rows;
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    if (!outputs[i].is_pseudo) rows.push_back(static_cast<Index>(i));
  }
  return rows;
}

// All recordings side by side.
struct Joined {
  MatrixXd y, e, standardised;
  Eigen::VectorXd time;
  std::vector<int> recording;
};

Joined join(const std::vector<Dataset>& recordings, const std::vector<FilterResult>& filters) {
  const Index ny = recordings[0].y.rows();
  Index total = 0;
  for (const Dataset& data : recordings) total += data.size();
  Joined out;
  out.y.resize(ny, total);
  out.e.resize(ny, total);
  out.standardised.resize(ny, total);
  out.time.resize(total);
  Index at = 0;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const Index N = recordings[r].size();
    out.y.middleCols(at, N) = recordings[r].y;
    out.e.middleCols(at, N) = filters[r].e;
    out.standardised.middleCols(at, N) = filters[r].standardised;
    out.time.segment(at, N) = recordings[r].time;
    out.recording.insert(out.recording.end(), static_cast<std::size_t>(N), static_cast<int>(r) + 1);
    at += N;
  }
  return out;
}

// By an autoregression of a channel on its own samples before.
double explained_by_own_past(const VectorXd& e, int order) {
  const Index period = own_period(e);
  const Autocovariances rows =
      sample_autocovariances(e.transpose(), order * period + 1, Divisor::samples);
  Autocovariances Y;
  for (std::size_t k = 0; k < rows.size(); k += static_cast<std::size_t>(period)) {
    if (rows[k].allFinite()) Y.push_back(rows[k]);
  }
  const Index samples = (e.array() == e.array()).count();
  const VectorXd share = share_explained_by_past(yule_walker(Y), samples);
  return share.size() > 0 ? share[0] : kNone;
}

// Per channel, by an autoregression of all channels; where they have no rows in common, of itself.
VectorXd explained_by_past(const MatrixXd& e, int lags) {
  constexpr int kHighestOrder = 10;
  const int order = std::min(kHighestOrder, lags);
  const Autocovariances Y = sample_autocovariances(e, order + 1, Divisor::samples);
  const auto samples = static_cast<Index>((e.array() == e.array()).colwise().all().count());
  const bool together =
      std::all_of(Y.begin(), Y.end(), [](const MatrixXd& each) { return each.allFinite(); });
  if (together) return share_explained_by_past(yule_walker(Y), samples);
  VectorXd out(e.rows());
  for (Index i = 0; i < e.rows(); ++i) out[i] = explained_by_own_past(e.row(i).transpose(), order);
  return out;
}

// R^2 of the regression, adjusted for its degrees of freedom.
double explained_share(const FStatistic& f) {
  const double unexplained = f.dof_rest / (f.dof_rest + f.dof * f.value);
  return std::max(0.0, 1.0 - unexplained * (f.dof + f.dof_rest) / f.dof_rest);
}

// x(t) less what the coefficients make of the values before.
VectorXd whitened(const VectorXd& x, const std::vector<MatrixXd>& A) {
  VectorXd out = x;
  for (std::size_t k = 1; k <= A.size(); ++k) {
    const auto lag = static_cast<Index>(k);
    out.head(std::min(lag, x.size())).setConstant(kNone);
    if (x.size() > lag) out.tail(x.size() - lag) -= A[k - 1](0, 0) * x.head(x.size() - lag);
  }
  return out;
}

// input_tests() of errors that are not white: errors and inputs go through the filter that makes the
// errors so, an autoregression.
std::vector<FStatistic> whitened_input_tests(const std::vector<Dataset>& recordings,
                                             const std::vector<FilterResult>& filters) {
  constexpr int kLags = 10, kHighestOrder = 20;
  if (recordings[0].inputs.empty()) return {};
  const int gap = kLags + kHighestOrder;
  const MatrixXd e = side_by_side(filters, gap), u = inputs_side_by_side(recordings, gap);
  std::vector<FStatistic> out;
  for (Index i = 0; i < e.rows(); ++i) {
    const Index order = std::min<Index>(kHighestOrder, shortest_of(recordings) / 10);
    const Autoregressions models =
        yule_walker(sample_autocovariances(e.row(i), order + 1, Divisor::samples));
    if (models.S.empty()) {
      out.push_back({kNone, kNone, kNone});
      continue;
    }
    const Index samples = (e.row(i).array() == e.row(i).array()).count();
    const std::vector<MatrixXd>& A = models.A[static_cast<std::size_t>(
        autoregressive_order(models, std::max<Index>(3, samples), Penalty::aic).order)];
    MatrixXd earlier = MatrixXd::Constant(u.rows(), u.cols(), kNone);
    for (Index j = 0; j < u.rows(); ++j) {
      earlier.row(j).tail(u.cols() - 1) = whitened(u.row(j).transpose(), A).head(u.cols() - 1);
    }
    out.push_back(input_correlation(whitened(e.row(i).transpose(), A), earlier, kLags - 1));
  }
  return out;
}

void report_tests(FilterEstimate& estimate, const std::vector<Dataset>& recordings,
                  const std::vector<FilterResult>& of_all) {
  const std::vector<Channel> outputs = measured(recordings[0].outputs);
  const std::vector<FilterResult> filters = of_measured(of_all, recordings[0].outputs);
  const int lags = default_lags(shortest_of(recordings));
  const MatrixXd all = side_by_side(filters, rows_apart(filters, lags));
  const bool coloured = estimate.objective.method == kSimulationMethod;
  const std::vector<FStatistic> by_input =
      coloured ? whitened_input_tests(recordings, filters) : input_tests(recordings, filters);
  const VectorXd by_past = explained_by_past(all, lags);
  const double level = 0.05 / static_cast<double>(1 + outputs.size() + by_input.size());
  const ChiSquareStatistic nis = normalised_innovation_squared(all);
  if (nis.dof > 0.0) estimate.tests.push_back(nis_test(nis, level));
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const ChiSquareStatistic q = ljung_box(all.row(static_cast<Index>(i)).transpose(), lags);
    if (!std::isfinite(q.value)) {
      estimate.notes.push_back("ljung_box of '" + outputs[i].name +
                               "' is not computed: its innovations are constant or missing");
      continue;
    }
    TestResult test = ljung_box_test(outputs[i].name, q, level);
    if (by_past.size() > 0) test.share = by_past[static_cast<Index>(i)];
    estimate.tests.push_back(test);
  }
  for (std::size_t i = 0; i < by_input.size(); ++i) {
    const FStatistic& f = by_input[i];
    if (!std::isfinite(f.value)) continue;
    TestResult test = input_test(outputs[i].name, f, level);
    test.share = explained_share(f);
    estimate.tests.push_back(test);
  }
}

void report_fit(FilterEstimate& estimate, const std::vector<Channel>& of_model,
                const Joined& of_all) {
  const std::vector<Channel> outputs = measured(of_model);
  const std::vector<Index> rows = measured_rows(of_model);
  Joined all = of_all;
  for (MatrixXd* each : {&all.y, &all.e, &all.standardised})
    *each = (*each)(rows, Eigen::all).eval();
  Series& series = estimate.series;
  series.time = all.time;
  series.recording = all.recording;
  series.measured = all.y;
  series.predicted = all.y - all.e;
  series.standardised = all.standardised;
  for (std::size_t n = 0; n < outputs.size(); ++n) {
    const auto i = static_cast<Index>(n);
    const Unit unit = unit_or_dimensionless(outputs[n].unit);
    series.channels.push_back(outputs[n].name);
    series.units.push_back(outputs[n].unit);
    estimate.one_step.push_back(
        channel_fit(outputs[n], all.y.row(i).transpose(), all.e.row(i).transpose()));
    series.measured.row(i) = (series.measured.row(i).array() - unit.offset) / unit.scale;
    series.predicted.row(i) = (series.predicted.row(i).array() - unit.offset) / unit.scale;
  }
}

const char* initial_name(InitialState initial) {
  switch (initial) {
    case InitialState::given:
      return "given";
    case InitialState::stationary:
      return "stationary";
    case InitialState::diffuse:
    case InitialState::partly_diffuse:
      return "diffuse";
  }
  return "";
}

// What the columns of B and D belong to, but for the next sample's.
std::vector<SteadyFilter::Channel> input_channels(const Model& model, const std::string& when) {
  std::vector<SteadyFilter::Channel> out;
  for (const ChannelSource& input : model.inputs) out.push_back({input.name + when, input.unit});
  if (as_linear(model).offset) out.push_back({"1", ""});
  return out;
}

// A unit that the model file leaves out stands in the recording.
void take_units(std::vector<SteadyFilter::Channel>& to, const std::vector<Channel>& from,
                bool offset) {
  const std::size_t columns = from.size() + (offset ? 1 : 0);
  for (std::size_t i = 0; i < to.size(); ++i) {
    if (const std::size_t channel = i % columns; channel < from.size()) {
      to[i].unit = from[channel].unit;
    }
  }
}

// Where a filter at the model's values first ends as `status` says.
struct Failure {
  std::string recording;
  double time = kNone;
  Index row = 0;  // from 1; 0: it does not, or not at a sample of its own

  std::string where() const {
    return row == 0 ? "" : fmt::format(" at t = {:.6g} s (sample {})", time, row);
  }
};

Failure first_failure(const Model& model, const std::vector<Dataset>& recordings,
                      FilterStatus status) {
  const auto ends_so = [&](const Dataset& data) {
    return run_filter(model, model.parameters, data, Keep::innovations).status == status;
  };
  for (const Dataset& data : recordings) {
    if (!ends_so(data)) continue;
    if (status == FilterStatus::undetermined) return {data.name, kNone, 0};
    Index runs = 0, fails = data.size();  // samples with which it does not, and does
    while (fails - runs > 1) {
      const Index middle = runs + (fails - runs) / 2;
      (ends_so(first_samples(data, middle)) ? fails : runs) = middle;
    }
    return {data.name, data.time[fails - 1], fails};
  }
  return {recordings[0].name, kNone, 0};
}

// What an error of the log-likelihood at the model's values is compared with.
double size_of(RecordingsLikelihood& likelihood) {
  const Likelihood* there = likelihood.evaluate(likelihood.model().parameters, false);
  return there == nullptr ? 1.0 : std::max(1.0, std::abs(there->value));
}

// A step of the file's that changes what is estimated.
// @param controlled  it does not follow the motion, and others were taken
Findings check_own_step(const Model& given, const ParameterSet& parameters,
                        const std::vector<Dataset>& recordings, bool controlled) {
  Model model = given;
  model.parameters = parameters;
  if (controlled) {
    return {{FindingCode::integration,
             Severity::warning,
             {"integration_step"},
             fmt::format("steps of {:.3g} s do not follow the motion: steps that control their "
                         "error were taken instead",
                         as_formulas(model).longest_step),
             "leave out integration_step"}};
  }
  RecordingsLikelihood integrated(model, recordings);
  const double error = integrated.integration_error(parameters), size = size_of(integrated);
  if (!(std::abs(error) > as_formulas(model).integration_tolerance * size)) return {};
  return {{FindingCode::integration,
           Severity::serious,
           {"integration_step"},
           fmt::format("with steps of {:.3g} s the log-likelihood is not the model's: it is {:.4g} "
                       "{} where the integration controls its error",
                       as_formulas(model).longest_step, std::abs(error),
                       error > 0.0 ? "higher" : "lower"),
           "leave out integration_step, or shorten it"}};
}

// Steps that were chosen, and halved until that changes nothing, as far as may be.
Findings check_chosen_steps(Model model, const ParameterSet& parameters,
                            const std::vector<Dataset>& recordings) {
  constexpr int kRefinements = 4;
  if (as_formulas(model).linear) return {};
  model.parameters = parameters;
  RecordingsLikelihood integrated(model, recordings);
  for (int i = 0; i < kRefinements && integrated.refine(parameters); ++i) {
  }
  const double error = std::abs(integrated.integration_error(parameters));
  const double size = size_of(integrated);
  if (!(error > as_formulas(model).integration_tolerance * size)) return {};
  return {{FindingCode::integration,
           Severity::serious,
           {},
           fmt::format("the log-likelihood is known to {:.2g} only: a finer integration changes it",
                       error),
           "smooth formulas, as tanh(v/0.01) for sign(v); time: {integration_step: ...}"}};
}

// [s]; kNone in discrete time.
double shortest_step(const Model& model, const Dataset& data, const std::vector<int>& steps) {
  double out = kNone;
  if (!as_formulas(model).equations.continuous) return out;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const auto n = static_cast<Eigen::Index>(k);
    out = std::fmin(out, (data.time[n + 1] - data.time[n]) / steps[k]);
  }
  return out;
}

// Where the likelihood is not as smooth as the search takes it to be, or not the model's own.
/// @param shortest  step of equations of motion [s], written; kNone: they are controlled, or there are none
Findings check_integration(const Model& model, const ParameterSet& parameters,
                           const std::vector<Dataset>& recordings, double& shortest) {
  double largest = 0.0;
  bool controlled = false;
  std::string where;
  shortest = kNone;
  for (const Dataset& data : recordings) {
    const Integration chosen = integration_of(model, parameters, data);
    const IntegrationSteps& steps = chosen.steps;
    controlled = controlled || chosen.controlled;
    shortest = controlled ? kNone : std::fmin(shortest, shortest_step(model, data, steps.steps));
    if (chosen.controlled || steps.status != StepStatus::capped ||
        steps.largest_change <= largest) {
      continue;
    }
    largest = steps.largest_change;
    where = fmt::format("{}: from t = {} on", data.name, row_time(data, steps.sample));
  }
  if (where.empty()) {
    const bool own = as_formulas(model).longest_step > 0.0;
    return own ? check_own_step(model, parameters, recordings, controlled)
               : check_chosen_steps(model, parameters, recordings);
  }
  constexpr double kSmall = 1e-3;
  return {{FindingCode::integration,
           largest > kSmall ? Severity::warning : Severity::note,
           {},
           fmt::format(
               "{} the rates of change jump, or are faster than the integration follows: twice as "
               "many steps move a state by up to {:.2g} of its size",
               where, largest),
           "smooth formulas, as tanh(v/0.01) for sign(v); time: {integration_step: ...}"}};
}

}  // namespace

std::vector<Channel> measured(const std::vector<Channel>& outputs) {
  std::vector<Channel> out;
  std::copy_if(outputs.begin(), outputs.end(), std::back_inserter(out),
               [](const Channel& output) { return !output.is_pseudo; });
  return out;
}

std::vector<FilterResult> of_measured(const std::vector<FilterResult>& filters,
                                      const std::vector<Channel>& outputs) {
  const std::vector<Index> rows = measured_rows(outputs);
  if (rows.size() == outputs.size()) return filters;
  std::vector<FilterResult> out;
  for (const FilterResult& filter : filters) {
    FilterResult part;
    part.status = filter.status;
    part.first_proper = filter.first_proper;
    part.e = filter.e(rows, Eigen::all);
    part.e_sd = filter.e_sd(rows, Eigen::all);
    part.standardised = filter.standardised(rows, Eigen::all);
    out.push_back(std::move(part));
  }
  return out;
}

Index rows_apart(const std::vector<FilterResult>& filters, Index lags) {
  Index longest = 1;
  for (const FilterResult& filter : filters) {
    for (Index i = 0; i < filter.standardised.rows(); ++i) {
      longest = std::max(longest, own_period(filter.standardised.row(i).transpose()));
    }
  }
  return lags * longest;
}

MatrixXd side_by_side(const std::vector<FilterResult>& filters, Index gap) {
  std::vector<const MatrixXd*> parts;
  for (const FilterResult& filter : filters) parts.push_back(&filter.standardised);
  return with_gaps(parts, gap);
}

MatrixXd inputs_side_by_side(const std::vector<Dataset>& recordings, Index gap) {
  std::vector<const MatrixXd*> parts;
  for (const Dataset& data : recordings) parts.push_back(&data.u);
  return with_gaps(parts, gap);
}

std::vector<FStatistic> input_tests(const std::vector<Dataset>& recordings,
                                    const std::vector<FilterResult>& filters) {
  constexpr int kMost = 10;
  if (recordings[0].inputs.empty()) return {};
  const int before = std::min(kMost, default_lags(shortest_of(recordings)));
  const MatrixXd e = side_by_side(filters, before), u = inputs_side_by_side(recordings, before);
  MatrixXd earlier = MatrixXd::Constant(u.rows(), u.cols(), kNone);
  earlier.rightCols(u.cols() - 1) = u.leftCols(u.cols() - 1);
  std::vector<FStatistic> out;
  for (Index i = 0; i < e.rows(); ++i) {
    out.push_back(input_correlation(e.row(i).transpose(), earlier, before - 1));
  }
  return out;
}

namespace {

// Where the motion before a recording comes to no steady state.
void refuse_start(const Model& model, const std::vector<Dataset>& recordings) {
  if (!is_formula_model(model) || !as_formulas(model).rests_at) return;
  for (const Dataset& data : recordings) {
    if (starting_state(model, data).found) continue;
    throw InputError({data.name, 0, 0}, "before the recording the model comes to no steady state",
                     "dynamics that settle while inputs stay, at the values given",
                     "do they diverge or oscillate there? 'initial: {mean: ...}' gives a start");
  }
}

}  // namespace

void refuse_filter(const Model& model, const std::vector<Dataset>& recordings,
                   FilterStatus status) {
  if (status == FilterStatus::not_finite) refuse_start(model, recordings);
  const Location here{model.source, 0, 0};
  const bool nonlinear = is_formula_model(model) && !changes(model);
  if (status == FilterStatus::unstable) {
    throw InputError(
        here,
        fmt::format("the filter starts stationary, and A has an eigenvalue of size {:.6g}",
                    instantiate(noise_model(model), model.parameters)
                        .A.eigenvalues()
                        .cwiseAbs()
                        .maxCoeff()),
        "a stable A: every eigenvalue inside the unit circle",
        "say 'initial: diffuse' where nothing is known of the state");
  }
  const Failure failure = first_failure(model, recordings, status);
  const Location there{failure.recording, 0, 0};
  switch (status) {
    case FilterStatus::ok:
    case FilterStatus::unstable:
      break;
    case FilterStatus::indefinite:
      if (const auto fault = fault_at(noise_model(model), model.parameters)) {
        throw InputError(here, fault->text);
      }
      throw InputError(
          here,
          "an innovation covariance is not positive definite at these values" + failure.where(),
          nonlinear ? "noise in every output, and no output or combination of outputs "
                      "without any"
                    : "noise in every output: Q and R positive semidefinite, and no "
                      "output or combination of outputs without any");
    case FilterStatus::undetermined:
      throw InputError(there, "the recording does not determine the diffuse initial state",
                       "outputs that show every state, and more rows than states",
                       "say 'initial: stationary', or give x0 and P0");
    case FilterStatus::beyond_digest:  // no recording has it
    case FilterStatus::not_finite:
      check_inputs(recordings);
      if (nonlinear) {
        throw InputError(there,
                         "the filter has no numbers" + failure.where() +
                             ": a state overflows, or a formula or its derivative is undefined "
                             "there",
                         "formulas that are defined wherever the filter takes the states",
                         "bound what a function takes, as in sqrt(max(x, 1e-9)); start nearer to "
                         "the truth, or take a shorter time: {integration_step: ...}");
      }
      throw InputError(there, "the filter overflows" + failure.where(),
                       "numbers of a size whose square is finite");
  }
  throw InputError(here, "the filter cannot run");
}

namespace {

// A covariance without what rounding has left below zero; states are compared by their correlations,
// as their units may lie far apart.
MatrixXd without_negative_rounding(const MatrixXd& P) {
  const VectorXd sd = P.diagonal().cwiseMax(0.0).cwiseSqrt();
  const VectorXd per_sd = (sd.array() > 0.0).select(sd.cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> correlation(per_sd.asDiagonal() * P *
                                                            per_sd.asDiagonal());
  const bool definite =
      (P.diagonal().array() >= 0.0).all() && correlation.eigenvalues().minCoeff() >= 0.0;
  if (definite || !P.allFinite()) return P;
  const MatrixXd factor = sd.asDiagonal() * correlation.eigenvectors() *
                          correlation.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  return factor * factor.transpose();
}

}  // namespace

FilterMatrices filter_matrices(const Model& model, const ParameterSet& parameters) {
  FilterMatrices out;
  const LinearModel& noise = noise_model(model);
  const StateSpace written = written_matrices(noise, parameters);
  out.noise.Q = written.Q;
  out.noise.R = written.R;
  if (!written.S.isZero(0.0)) out.noise.S = written.S;
  const bool density = noise.noise == ProcessNoise::density;
  out.noise.Q_kind = density ? "density" : "per-sample";
  if (is_formula_model(model)) return out;
  SteadyFilter filter;
  filter.model = instantiate(noise, parameters);
  filter.inputs = input_channels(model, "");
  if (filter.model.inputs() > static_cast<Index>(filter.inputs.size())) {  // held linearly
    const auto next = input_channels(model, " of the next sample");
    filter.inputs.insert(filter.inputs.end(), next.begin(), next.end());
  }
  for (const ChannelSource& output : model.outputs) {
    filter.outputs.push_back({output.name, output.unit});
  }
  for (const StateName& state : model.states) filter.states.push_back({state.name, state.unit});
  if (const auto steady = steady_state(filter.model)) {
    out.noise.K_steady = steady->K;
    out.noise.P_steady = without_negative_rounding(steady->P);
    filter.K = steady->K;
    filter.P = out.noise.P_steady;
    filter.Sigma = steady->Sigma;
    filter.L = steady->Sigma.ldlt().solve(filter.model.C * steady->P.transpose()).transpose();
  }
  out.filter = std::move(filter);
  return out;
}

void report_innovations(FilterEstimate& estimate, const std::vector<Dataset>& recordings,
                        const std::vector<FilterResult>& filters) {
  report_fit(estimate, recordings[0].outputs, join(recordings, filters));
  report_tests(estimate, recordings, filters);
}

namespace {

// Errors five times as large as the filter says: no noise is that wrong.
constexpr double kAbsurdNees = 25.0;

Finding errors_out_of_band(const ReferenceFit& fit) {
  std::string remedy =
      "see first whether the reference's column, unit, axes and clock are right, "
      "then whether the model is";
  if (fit.nees < kAbsurdNees) {
    remedy = fmt::format(
        "multiply its variance by {:.3g} wherever it is used, or give the error "
        "that lasts a state of its own",
        fit.nees);
  }
  Finding out = make_finding(
      FindingCode::reference_band, {fit.name},
      fmt::format("the errors of {} are {:.2g} times what the filter says they are (NEES {:.3g}, "
                  "{:.0f} % in the 95 % band)",
                  fit.name, std::sqrt(fit.nees), fit.nees, 100.0 * fit.coverage),
      remedy);
  out.severity = Severity::serious;
  return out;
}

void report_references(FilterEstimate& estimate, const Model& model, const ParameterSet& parameters,
                       const std::vector<Dataset>& recordings) {
  estimate.references = reference_fits(model, parameters, recordings);
  for (const ReferenceFit& fit : estimate.references) {
    if (!is_out_of_band(fit)) continue;
    estimate.findings.push_back(errors_out_of_band(fit));
    if (fit.nees < kAbsurdNees) {
      estimate.derived.push_back({kCovarianceFactor + fit.name, "", fit.nees, kNone});
    }
  }
}

}  // namespace

std::vector<FilterResult> report_filter(FilterEstimate& estimate, const Model& model,
                                        const ParameterSet& parameters,
                                        const std::vector<Dataset>& recordings) {
  static_cast<FilterMatrices&>(estimate) = filter_matrices(model, parameters);
  if (estimate.filter) {
    take_units(estimate.filter->inputs, recordings[0].inputs, as_linear(model).offset);
    take_units(estimate.filter->outputs, recordings[0].outputs, false);
  }
  std::vector<FilterResult> filters;
  estimate.objective.log_likelihood = 0.0;
  estimate.objective.initial = initial_name(noise_model(model).initial);
  if (is_formula_model(model)) {
    estimate.objective.filter = filter_name(as_formulas(model));
  }
  for (const Dataset& data : recordings) {
    filters.push_back(run_filter(model, parameters, data, Keep::innovations));
    if (filters.back().status != FilterStatus::ok) {
      Model here = model;
      here.parameters = parameters;
      refuse_filter(here, recordings, filters.back().status);
    }
    estimate.objective.log_likelihood += filters.back().log_likelihood;
  }
  report_innovations(estimate, recordings, filters);
  report_references(estimate, model, parameters, recordings);
  if (is_formula_model(model)) {
    append(estimate.findings,
           check_integration(model, parameters, recordings, estimate.objective.integration_step));
    report_simulation(estimate, model, parameters, recordings);
  }
  return filters;
}

}  // namespace identikal
