#include "identify/optimality/bound.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include <Eigen/LU>
#include <Eigen/QR>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/parameter_table.h"
#include "identify/filter/digest_file.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/noise/estimate.h"
#include "identify/simulation/simulate.h"
#include "lib/base/random.h"
#include "lib/data/units.h"
#include "lib/filter/information.h"
#include "lib/model/parameter.h"
#include "solvers/covariance.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// A pseudo-inverse leaves the determined parameters their variance when others are flat.
MatrixXd covariance_of(const MatrixXd& information) {
  const auto inverse = scaled_inverse(information, 1e-9);
  return inverse ? *inverse : information.completeOrthogonalDecomposition().pseudoInverse();
}

// Standard deviations of the steady gain's entries by the delta method.
MatrixXd gain_deviation(const GainSensitivity& gain, const MatrixXd& covariance) {
  MatrixXd slopes(gain.K.size(), covariance.rows());
  for (Index i = 0; i < covariance.rows(); ++i) {
    slopes.col(i) = gain.K_theta[i].reshaped();
  }
  const VectorXd variance = (slopes * covariance * slopes.transpose()).diagonal();
  return variance.cwiseMax(0.0).cwiseSqrt().reshaped(gain.K.rows(), gain.K.cols());
}

// With what (6.45) leaves to the free parameters, in SI.
struct InnovationForm : Bound::InnovationForm {
  std::vector<double> published_se;
};

// What recordings of `samples` samples leave to K and Sigma as unknowns of their own.
// @param of_the_noise  K and Sigma carry all that outputs say of the parameters
InnovationForm innovation_form(const StateSpace& system, const GainSensitivity& gain, Index samples,
                               bool of_the_noise) {
  InnovationForm out;
  out.published_se.assign(gain.K_theta.size(), kNone);
  const auto information = innovation_form_information(system.A, system.C, gain.K, gain.Sigma);
  if (!information) return out;
  const auto N = static_cast<double>(samples);
  const Index gains = gain.K.size(), ny = gain.Sigma.rows();
  out.Sigma = gain.Sigma;
  out.K_se = MatrixXd::Constant(gain.K.rows(), ny, kNone);
  if (const auto K = scaled_inverse(N * information->topLeftCorner(gains, gains))) {
    out.K_se = K->diagonal().cwiseSqrt().reshaped(gain.K.rows(), ny);
  }
  const VectorXd variance = gain.Sigma.diagonal();
  out.Sigma_se = ((gain.Sigma.cwiseAbs2() + variance * variance.transpose()) / N).cwiseSqrt();
  const auto k = static_cast<Index>(gain.K_theta.size());
  if (gains != 1 || ny != 1 || gain.K(0, 0) == 0.0) return out;

  const Eigen::Matrix2d published =
      N * published_innovation_information(gain.K(0, 0), gain.Sigma(0, 0));
  const Eigen::Matrix2d inverse = published.inverse();
  out.published_K_se = std::sqrt(inverse(0, 0));
  out.published_Sigma_se = std::sqrt(inverse(1, 1));
  if (k != 2 || !of_the_noise) return out;  // not one to one
  MatrixXd slopes(information->rows(), k);
  for (Index i = 0; i < k; ++i) {
    slopes.col(i) << gain.K_theta[i].reshaped(), lower_triangle(gain.Sigma_theta[i]);
  }
  const auto by_parameter = scaled_inverse(slopes.transpose() * published * slopes);
  if (!by_parameter) return out;
  for (Index i = 0; i < k; ++i) {
    out.published_se[i] = std::sqrt((*by_parameter)(i, i));
  }
  return out;
}

Findings check_determined(const CramerRaoBound& estimate) {
  const Identifiability& id = estimate.identifiability;
  if (id.rank == id.of) return {};
  const std::vector<std::string> open = not_determined(estimate);
  return {make_finding(FindingCode::not_identifiable, open,
                       fmt::format("outputs alone determine {} of {} unknowns; not determined: {}",
                                   id.rank, id.of, fmt::join(open, ", ")))};
}

// The information of recordings of any length: what `samples` have, and
// what each further one adds. A filter that has not settled from the first sample on adds something
// else at the beginning, which the total holds.
struct GrowingInformation {
  MatrixXd total, per_sample;
  double samples = 0.0;

  // How many samples give parameter i this standard error? Newton's method on 1 / variance, which
  // is nearly a straight line.
  double samples_for(Index i, double se) const {
    double N = covariance_of(per_sample)(i, i) / (se * se);
    for (int step = 0; step < 20; ++step) {
      const MatrixXd covariance = covariance_of(total + (N - samples) * per_sample);
      const double variance = covariance(i, i);
      const double slope = covariance.row(i) * per_sample * covariance.col(i);
      const double next = N + variance * (variance / (se * se) - 1.0) / slope;
      if (!std::isfinite(next) || !(next > 1.0)) break;
      const bool close = std::abs(next - N) < 1e-9 * N;
      N = next;
      if (close) break;
    }
    return std::isfinite(N) ? std::ceil(N - 1e-6) : kNone;
  }
};

// What recordings say of the free entries, SI.
struct RecordingInformation {
  MatrixXd total;
  std::optional<GrowingInformation> growing;  // where an accuracy is wanted
  // Per free entry: its variance times the samples, with the states observed; kNone where the
  // noise alone does not say it. Empty: none of them.
  VectorXd complete;
  std::optional<GainSensitivity> gain;
  InnovationForm innovation_form;
};

// With the states observed and the dynamics known. Noise of continuous time depends, as it is from
// sample to sample, on the dynamics too; but what that says of them is little beside what the
// states themselves say, so nothing is said of parameters that move both.
VectorXd complete_variance(const StateSpace& system, const std::vector<StateSpace>& derivatives) {
  std::vector<StateSpace> of_noise;
  std::vector<Index> place;
  for (std::size_t i = 0; i < derivatives.size(); ++i) {
    const StateSpace& d = derivatives[i];
    const bool in_noise = !(d.Q.isZero(0.0) && d.R.isZero(0.0) && d.S.isZero(0.0));
    if (!in_noise || !d.G.isZero(0.0) || changes_dynamics(d)) continue;
    of_noise.push_back(d);
    place.push_back(static_cast<Index>(i));
  }
  VectorXd out = VectorXd::Constant(static_cast<Index>(derivatives.size()), kNone);
  const auto information = complete_data_information(system, of_noise);
  const auto covariance = information ? scaled_inverse(*information, 1e-12) : std::nullopt;
  if (covariance) out(place) = covariance->diagonal();
  return out;
}

// Further samples add what a steady filter sees, so that a filter that has not settled by the last
// sample is followed until it has. With inputs they add as much, on average, as so far.
// @param found  of `samples` samples
GrowingInformation growing_information(ExpectedInformation found, const StateSpace& system,
                                       InitialState initial, Index samples,
                                       const std::vector<StateSpace>& derivatives,
                                       const MatrixXd& u) {
  constexpr Index kLongest = 5000;  // what settles later is hardly told from what never does
  while (u.size() == 0 && found.per_sample.size() == 0 && samples < kLongest) {
    ExpectedInformation longer =
        expected_information(system, initial, 4 * samples, derivatives, MatrixXd());
    if (longer.status != FilterStatus::ok) break;
    found = std::move(longer);
    samples *= 4;
  }
  const auto count = static_cast<double>(samples);
  const bool settles = u.size() == 0 && found.per_sample.size() > 0;
  return {found.total, settles ? found.per_sample : MatrixXd(found.total / count), count};
}

// What rests on a steady filter.
void add_steady(const StateSpace& system, const std::vector<StateSpace>& derivatives, Index samples,
                RecordingInformation& out) {
  out.complete = complete_variance(system, derivatives);
  out.gain = steady_gain_sensitivity(system, derivatives);
  if (!out.gain) return;
  const bool of_the_noise = std::none_of(derivatives.begin(), derivatives.end(), changes_dynamics);
  out.innovation_form = innovation_form(system, *out.gain, samples, of_the_noise);
}

RecordingInformation information_of_linear(const Model& model, const BoundOptions& options,
                                           const Dataset* inputs,
                                           const std::vector<StateSpace>& derivatives) {
  const LinearModel& linear = as_linear(model);
  const StateSpace system = instantiate(linear, model.parameters);
  const MatrixXd u = inputs != nullptr ? model_inputs(linear, inputs->u) : MatrixXd();
  const ExpectedInformation information =
      expected_information(system, linear.initial, options.samples, derivatives, u);
  if (information.status != FilterStatus::ok) {
    throw InputError(
        {model.source, 0, 0}, describe(information.status), "values of a filter that runs",
        linear.initial == InitialState::stationary ? "say 'initial: diffuse' where A is not stable"
                                                   : "");
  }
  RecordingInformation out;
  out.total = information.total;
  if (std::isfinite(options.accuracy)) {
    out.growing =
        growing_information(information, system, linear.initial, options.samples, derivatives, u);
  }
  add_steady(system, derivatives, options.samples, out);
  return out;
}

RecordingInformation information_of_nonlinear(const Model& model, const BoundOptions& options,
                                              const Dataset& inputs, Bound& bound) {
  Random random(options.seed);
  std::vector<MatrixXd> each;
  std::vector<Dataset> recording{inputs};
  RecordingInformation out;
  for (int run = 0; run < options.runs; ++run) {
    recording[0].y = simulated_outputs(model, inputs, random);
    RecordingsLikelihood likelihood(model, recording);
    const Likelihood* const at = likelihood.evaluate(model.parameters, true);
    if (at == nullptr) {
      throw InputError({model.source, 0, 0},
                       fmt::format("simulated recording {} of {}: {}", run + 1, options.runs,
                                   describe(likelihood.status_at_start())),
                       "values of a filter that runs");
    }
    each.push_back(at->information);
    out.total = run == 0 ? at->information : MatrixXd(out.total + at->information);
  }
  const double runs = options.runs;
  out.total /= runs;
  const auto samples = static_cast<double>(options.samples);
  out.growing = GrowingInformation{out.total, out.total / samples, samples};
  SimulatedInformation& simulation = bound.simulated.emplace();
  simulation.recordings = options.runs;
  simulation.seed = options.seed;
  // V = J^-1 moves by -V dJ V.
  const auto V = scaled_inverse(out.total, 1e-9);
  if (!V) return out;
  VectorXd squares = VectorXd::Zero(V->rows());
  for (const MatrixXd& J : each) {
    squares += (*V * (J - out.total) * *V).diagonal().cwiseAbs2();
  }
  const VectorXd se = (squares / (runs * (runs - 1.0))).cwiseSqrt();
  simulation.relative_se = 0.5 * se.cwiseQuotient(V->diagonal()).maxCoeff();
  return out;
}

// Of every parameter, kNone and empty for those that are fixed: the complete data's standard error,
// the samples that the accuracy takes, the change of the steady gain.
void bound_parameters(CramerRaoBound& estimate, const RecordingInformation& information,
                      const VectorXd& unit, const std::optional<GrowingInformation>& growing) {
  Bound& bound = estimate.bound;
  const double samples = static_cast<double>(bound.samples);
  Index i = 0;
  for (EstimatedParameter& p : estimate.parameters) {
    Bound::Parameter& out = bound.parameters.emplace_back();
    out.name = p.name;
    if (!p.fixed) {
      p.crb_se = p.se;
      p.se = kNone;
      p.ci95 = {kNone, kNone};
      if (information.complete.size() > 0)
        out.complete_se = std::sqrt(information.complete[i] / samples) / unit[i];
      if (growing && !std::isnan(p.crb_se)) {
        out.samples_needed = growing->samples_for(i, bound.accuracy * std::abs(p.value));
      }
      if (information.gain) {
        out.gain_change = 0.01 * p.value * unit[i] * information.gain->K_theta[i];
      }
      ++i;
    }
  }
}

// What the bound leaves to the steady gain, and the bound where K and Sigma are the unknowns.
void bound_gain(CramerRaoBound& estimate, const RecordingInformation& information,
                const VectorXd& unit, const MatrixXd& covariance) {
  Bound& bound = estimate.bound;
  estimate.noise.K_steady = information.gain->K;
  bound.gain_se =
      gain_deviation(*information.gain, unit.asDiagonal() * covariance * unit.asDiagonal());
  bound.innovation_form = information.innovation_form;
  const std::vector<double>& free = information.innovation_form.published_se;
  Index at = 0;
  for (std::size_t i = 0; i < estimate.parameters.size(); ++i) {
    if (estimate.parameters[i].fixed) continue;
    bound.parameters[i].published_se = free[at] / unit[at];
    ++at;
  }
}

// SI values of the units of the free entries.
VectorXd free_units(const CramerRaoBound& estimate) {
  std::vector<double> units;
  for (const EstimatedParameter& p : estimate.parameters) {
    if (!p.fixed) units.push_back(unit_scale(p.unit));
  }
  return Eigen::Map<const VectorXd>(units.data(), static_cast<Index>(units.size()));
}

// What the information says, parameter by parameter, and of the gain.
void report_bound(CramerRaoBound& estimate, const Model& model,
                  const RecordingInformation& information) {
  const VectorXd unit = free_units(estimate);
  const auto in_units = [&unit](const MatrixXd& J) {
    return MatrixXd(unit.asDiagonal() * J * unit.asDiagonal());
  };
  const MatrixXd total = in_units(information.total);
  const MatrixXd covariance = covariance_of(total);
  judge_parameters(estimate, total, covariance);
  estimate.excess_mean_square_error = excess_error(estimate, model, model.parameters);
  std::optional<GrowingInformation> growing;
  if (const auto& found = information.growing) {
    growing = {in_units(found->total), in_units(found->per_sample), found->samples};
  }
  bound_parameters(estimate, information, unit, growing);
  if (information.gain) bound_gain(estimate, information, unit, covariance);
  append(estimate.findings, check_determined(estimate));
}

void refuse_nothing_free(const Model& model) {
  if (free_entries(model.parameters).size() > 0) return;
  throw InputError({model.source, 0, 0}, "nothing is free, so there is nothing to bound",
                   "at least one parameter with {value: ...} or a structured Q or R");
}

CramerRaoBound begun_bound(const Model& model, const BoundOptions& options) {
  CramerRaoBound out;
  out.verb = "bound";
  out.model_name = model.name;
  out.objective.method = "bound";
  list_parameters(out, model.parameters, model.parameters);
  out.bound.samples = options.samples;
  out.bound.accuracy = options.accuracy;
  return out;
}

// Of what the likelihood of the digests adds up, inputs included.
RecordingInformation information_of_digests(const Model& model, const BoundOptions& options,
                                            const std::vector<RecordingDigest>& digests) {
  const StateSpace system = instantiate(as_linear(model), model.parameters);
  const std::vector<StateSpace> derivatives = model_derivatives(as_linear(model), model.parameters);
  RecordingInformation out;
  FilterStatus status = FilterStatus::ok;
  if (as_linear(model).B.constant.cols() > 0) {
    RecordingsLikelihood likelihood(model, digests);
    const Likelihood* const at = likelihood.evaluate(model.parameters, true);
    if (at == nullptr) status = likelihood.status_at_start();
    if (at != nullptr) out.total = at->information;
  } else {
    // Nothing but the number of samples counts.
    const auto k = static_cast<Index>(derivatives.size());
    out.total = MatrixXd::Zero(k, k);
    for (const RecordingDigest& digest : digests) {
      const ExpectedInformation one = expected_information(system, as_linear(model).initial,
                                                           digest.samples, derivatives, MatrixXd());
      if (one.status != FilterStatus::ok) status = one.status;
      if (status == FilterStatus::ok) out.total += one.total;
    }
  }
  if (status != FilterStatus::ok) {
    throw InputError({model.source, 0, 0}, describe(status), "values of a filter that runs");
  }
  const auto samples = static_cast<double>(options.samples);
  if (std::isfinite(options.accuracy)) {
    out.growing = GrowingInformation{out.total, out.total / samples, samples};
  }
  add_steady(system, derivatives, options.samples, out);
  return out;
}

}  // namespace

CramerRaoBound bound_of(const Model& given, const BoundOptions& options, const Dataset* inputs) {
  refuse_constraints(given, "bound");
  if (options.samples < 1) {
    throw std::invalid_argument(fmt::format("samples is {}; expected 1 or more", options.samples));
  }
  const Model model = checked_with_inputs(given, inputs);
  if (inputs != nullptr && inputs->size() != options.samples) {
    throw std::invalid_argument(fmt::format("samples is {}, and the recording has {} of inputs",
                                            options.samples, inputs->size()));
  }
  const bool nonlinear = is_formula_model(model);
  if (nonlinear && (inputs == nullptr || options.runs < 2)) {
    throw std::invalid_argument(
        fmt::format("bound_of: a nonlinear model needs a recording's times and inputs, and 2 or "
                    "more runs, not {}",
                    options.runs));
  }
  refuse_nothing_free(model);
  CramerRaoBound estimate = begun_bound(model, options);
  const RecordingInformation information =
      nonlinear ? information_of_nonlinear(model, options, *inputs, estimate.bound)
                : information_of_linear(model, options, inputs,
                                        model_derivatives(as_linear(model), model.parameters));
  report_bound(estimate, model, information);
  for (const OutputCondition& condition : model.conditions) {
    estimate.notes.push_back(fmt::format(
        "taken as counting in every row: {}, which counts where {}",
        model.outputs[static_cast<std::size_t>(condition.output)].name, condition.text));
  }
  conclude(estimate, "every free parameter can be determined");
  return estimate;
}

CramerRaoBound bound_of_digests(const Model& model, BoundOptions options,
                                const std::vector<RecordingDigest>& digests) {
  refuse_constraints(model, "bound");
  check_takes_digests(model, digests.size());
  refuse_nothing_free(model);
  options.samples = 0;
  for (const RecordingDigest& digest : digests) options.samples += digest.samples;
  CramerRaoBound estimate = begun_bound(model, options);
  report_bound(estimate, model, information_of_digests(model, options, digests));
  conclude(estimate, "every free parameter can be determined");
  return estimate;
}

}  // namespace identikal
