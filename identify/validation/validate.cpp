#include "identify/validation/validate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "identify/estimate/test_result.h"
#include "identify/filter/outliers.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/filter/report.h"
#include "identify/filter/student_weights.h"
#include "identify/model/check.h"
#include "identify/result/file_digest.h"
#include "identify/validation/internal/vehicle_refit.h"
#include "identify/vehicle/checks.h"
#include "identify/vehicle/driven_range.h"
#include "identify/vehicle/series.h"
#include "lib/base/error.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;

// The result's figures belong to its sampling period, unless the noise is one of continuous time.
void check_period(const SteadyFilter* filter, const Model& model,
                  const std::vector<Dataset>& recordings) {
  if (filter == nullptr) return;
  const LinearModel& noise = noise_model(model);
  if (noise.continuous && noise.noise == ProcessNoise::density) return;
  const double dt = filter->model.dt;
  for (const Dataset& data : recordings) {
    if (std::abs(data.dt - dt) <= 1e-6 * dt || model.time.step > 0.0) continue;
    throw InputError({data.name, 0, 0},
                     fmt::format("sampled every {:.6g} s, the result every {:.6g} s", data.dt, dt),
                     "the same sampling period", "noise per sample belongs to one sampling period");
  }
}

double measured_rows(const std::vector<Dataset>& recordings) {
  double rows = 0.0;
  for (const Dataset& data : recordings) {
    rows += static_cast<double>(data.size()) - static_cast<double>(data.absent.size());
  }
  return rows;
}

double own_rows(const Estimate& result) {
  double rows = 0.0;
  for (const InputRecord& input : result.inputs) rows += static_cast<double>(input.used);
  return rows;
}

constexpr double kKnown = 1e12;  // degrees of freedom of a variance that is known

// Whether unseen innovations are white and as large as the filter says. The estimates' own errors
// show in them, the more the fewer rows they came from: with rho new rows per old one,
//   score        s' J^-1 s / (1 + rho) ~ chi2(k), for cov s = J + J V J with V = (rho J^-1)
//   nis          mean of the new ~ F(new samples, old samples): on the old it was fitted to 1
//   ljung_box    sum of lags - k unit chi-squares and k of size 1 + rho (the fit takes k directions
//                from the correlations of the old rows, Box & Pierce 1970), by its mean and
//                variance
//   input_correlation  likewise
// where k values were estimated; without any, as on any data.
struct UnseenTests {
  std::vector<Index> estimated;  // of the free entries
  Index entries = 0;             // all that are free
  double rho = 0.0;
  double level = kNone;  // of each test

  double k() const { return static_cast<double>(estimated.size()); }

  // Parameters and outputs of the recordings ask for as many tests.
  UnseenTests(const Estimate& result, const std::vector<Dataset>& recordings,
              std::size_t tests_of_outputs) {
    for (const EstimatedParameter& p : result.parameters) {
      if (p.fixed) continue;
      if (p.verdict != Verdict::at_bound) estimated.push_back(entries);
      ++entries;
    }
    const double own = own_rows(result);
    if (!estimated.empty() && own > 0.0) rho = measured_rows(recordings) / own;
    level = 0.05 / static_cast<double>(tests_of_outputs + (estimated.empty() ? 1 : 2));
  }

  TestResult test(const char* id, const std::string& channel, double value,
                  std::array<double, 2> interval, double p) const {
    TestResult out = test_result(id, channel, value, interval, p, level);
    out.level = level;
    return out;
  }

  // Of other values of the parameters, by the score; none where the data determine no value.
  std::optional<TestResult> score(const Model& model,
                                  const std::vector<Dataset>& recordings) const {
    if (estimated.empty()) return std::nullopt;
    RecordingsLikelihood likelihood(model, recordings);
    const Likelihood* at = likelihood.evaluate(model.parameters, true);
    if (at == nullptr || at->gradient.size() != entries) return std::nullopt;
    const Eigen::VectorXd s = at->gradient(estimated);
    const Eigen::MatrixXd J = at->information(estimated, estimated);
    const Eigen::VectorXd scale = J.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * J *
                                                               scale.asDiagonal());
    const Eigen::VectorXd along = eigen.eigenvectors().transpose() * scale.cwiseProduct(s);
    const Eigen::VectorXd& size = eigen.eigenvalues();
    double value = 0.0, dof = 0.0;
    for (Index i = 0; i < size.size(); ++i) {
      if (!(size[i] > kFlat * size[size.size() - 1])) continue;
      value += along[i] * along[i] / size[i] / (1.0 + rho);
      dof += 1.0;
    }
    if (!(dof > 0.0)) return std::nullopt;
    return test("score", "", value, {0.0, chi_square_quantile(1.0 - level, dof)},
                chi_square_upper_tail(value, dof));
  }

  double old_samples(double samples) const { return rho > 0.0 ? samples / rho : kKnown; }

  TestResult nis(const ChiSquareStatistic& nis) const {
    const double mean = nis.value / nis.dof, old = old_samples(nis.dof);
    const double upper = f_upper_tail(mean, nis.dof, old);
    return test(
        "nis", "", mean,
        {f_quantile(0.5 * level, nis.dof, old), f_quantile(1.0 - 0.5 * level, nis.dof, old)},
        std::min(1.0, 2.0 * std::min(upper, 1.0 - upper)));
  }

  // How much larger innovations are found in four of five cases.
  double detectable_size(double samples) const {
    const double old = old_samples(samples);
    return std::sqrt(f_quantile(1.0 - 0.5 * level, samples, old) / f_quantile(0.2, samples, old));
  }

  // A mean of `dof` squares of unit normals, k of which the estimates' errors make larger, over one
  // of `rest` that they do not. @param reported  its size as reported
  TestResult mean_square(const char* id, const std::string& channel, const FStatistic& f,
                         double reported) const {
    const double taken = std::min(k(), f.dof);
    const double mean = 1.0 + rho * taken / f.dof;
    const double half_variance = (f.dof - taken + (1.0 + rho) * (1.0 + rho) * taken) / f.dof;
    const double effective = f.dof * mean * mean / half_variance;
    return test(id, channel, reported * f.value,
                {0.0, reported * mean * f_quantile(1.0 - level, effective, f.dof_rest)},
                f_upper_tail(f.value / mean, effective, f.dof_rest));
  }
};

Findings check_tests(const std::vector<TestResult>& tests) {
  std::string failed;
  for (const TestResult& test : tests) {
    if (test.pass) continue;
    failed += (failed.empty() ? "" : ", ") + test.id +
              (test.channel.empty() ? "" : " of " + test.channel);
  }
  if (failed.empty()) return {};
  return {make_finding(FindingCode::test_rejects, {},
                       "it does not hold on these data: rejected by " + failed)};
}

Findings check_power(double detectable) {
  constexpr double kLeast = 1.5;
  if (!(detectable > kLeast)) return {};
  return {make_finding(FindingCode::insufficient_power, {},
                       fmt::format("insufficient power: these data would not show innovations "
                                   "{:.2g} times as large as the filter predicts",
                                   detectable),
                       "validate on a longer recording")};
}

void test_unseen(const Estimate& result, const Model& model, const std::vector<Dataset>& recordings,
                 const std::vector<FilterResult>& of_all, Validation& estimate) {
  Index shortest = recordings[0].size();
  for (const Dataset& data : recordings) shortest = std::min(shortest, data.size());
  const std::vector<Channel> outputs = measured(recordings[0].outputs);
  const std::vector<FilterResult> filters = of_measured(of_all, recordings[0].outputs);
  const std::vector<FStatistic> by_input = input_tests(recordings, filters);
  const UnseenTests unseen(result, recordings, outputs.size() + by_input.size());
  const int lags = default_lags(shortest);
  const Eigen::MatrixXd all = side_by_side(filters, rows_apart(filters, lags));
  estimate.tests.clear();
  const bool own_values = std::any_of(recordings.begin(), recordings.end(),
                                      [](const Dataset& data) { return !data.own.empty(); });
  if (own_values) {
    estimate.notes.emplace_back(
        "no score test of the estimates, as parameters have values of their own in recordings");
  } else if (!model.student) {
    if (auto score = unseen.score(model, recordings)) estimate.tests.push_back(std::move(*score));
  }
  if (const ChiSquareStatistic nis = normalised_innovation_squared(all); nis.dof > 0.0) {
    estimate.tests.push_back(unseen.nis(nis));
    append(estimate.findings, check_power(unseen.detectable_size(nis.dof)));
  }
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const ChiSquareStatistic q = ljung_box(all.row(static_cast<Index>(i)).transpose(), lags);
    if (!std::isfinite(q.value) || !(q.dof > 0.0)) continue;
    estimate.tests.push_back(
        unseen.mean_square("ljung_box", outputs[i].name, {q.value / q.dof, q.dof, kKnown}, q.dof));
  }
  for (std::size_t i = 0; i < by_input.size(); ++i) {
    if (!std::isfinite(by_input[i].value)) continue;
    estimate.tests.push_back(
        unseen.mean_square("input_correlation", outputs[i].name, by_input[i], 1.0));
  }
}

Validation validate_filter(const ResultSections& validated, const Model& written,
                           const std::vector<Dataset>& recordings) {
  const Estimate& result = *validated.core;
  check_period(validated.filter, written, recordings);
  const Model model = checked(written, recordings);
  check_channels(recordings);
  Validation out;
  out.model_name = model.name;
  list_parameters(out, model.parameters, model.parameters);
  for (EstimatedParameter& p : out.parameters) p.fixed = true;
  out.objective.method = result.objective.method;  // decides whether the simulation counts
  const std::vector<FilterResult> filters = report_filter(out, model, model.parameters, recordings);
  if (result.objective.method == kSimulationMethod) {
    const bool starts_known = written_matrices(noise_model(model), model.parameters).P0.isZero(0.0);
    if (starts_known) return out;
    out.notes.emplace_back(
        "the start of each recording is what its own outputs make likeliest; nothing else is "
        "refitted");
    return out;
  }
  test_unseen(result, model, recordings, filters, out);
  if (model.student) {
    out.notes.push_back(student_note(model));
  } else {
    append(out.findings, check_outliers_and_offset(model, model.parameters, recordings, filters));
  }
  const auto per_row = [](double L, double rows) { return rows > 0.0 ? L / rows : kNone; };
  out.derived.push_back({"log-likelihood per row", "",
                         per_row(out.objective.log_likelihood, measured_rows(recordings)), kNone});
  out.derived.push_back(
      {"  on its own data", "", per_row(result.objective.log_likelihood, own_rows(result)), kNone});
  return out;
}

Validation validate_car(const ResultSections& validated, const Model& model,
                        const std::vector<Dataset>& recordings, bool robust) {
  Validation out;
  out.model_name = model.name;
  if (validated.tyre_curve != nullptr) out.tyre_curve = *validated.tyre_curve;
  const VehicleUnknowns unknowns = vehicle_unknowns(model);
  for (const EstimatedParameter& p : validated.core->parameters) {
    EstimatedParameter known;
    known.name = p.name;
    known.unit = p.unit;
    known.value = known.start = p.value;
    known.fixed = true;
    const auto parameter = vehicle_parameter(p.name);
    known.neutral = parameter && unknowns.value[*parameter] == neutral_vehicle()[*parameter];
    out.parameters.push_back(std::move(known));
  }
  KnownCar along = validate_vehicle(model, recordings, unknowns, unknowns.value, robust);
  out.series = std::move(along.series);
  out.driven = std::move(along.driven);
  out.simulation = channel_fits(out.series, robust);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    out.inputs.push_back({recordings[i].name, "", static_cast<long>(recordings[i].size()), 0});
  }
  for (Index t = 0; t < out.series.time.size(); ++t) {
    const auto run = out.series.recording.empty()
                         ? std::size_t{0}
                         : static_cast<std::size_t>(out.series.recording[t] - 1);
    if (!out.series.predicted.col(t).array().isNaN().all()) ++out.inputs[run].used;
  }
  append(out.findings, check_hold_out_by_survey(model, recordings, out.findings));
  return out;
}

constexpr double kRefitLevel = 0.05;
constexpr double kRefitMatters = 0.05;  // of an output's size

// Whether there are values to compare, with an error to compare them by.
bool compares(const VehicleRefit& refit) { return !refit.changes.empty() && refit.dof > 0.0; }

TestResult refit_test(const VehicleRefit& refit) {
  TestResult test = test_result("refit", "", refit.statistic,
                                {0.0, f_quantile(1.0 - kRefitLevel, refit.dof, refit.freedom)},
                                refit.p, kRefitLevel);
  test.level = kRefitLevel;
  return test;
}

// The output that a refit moves most, by how much of its size.
struct Moved {
  std::string channel;
  double most = 0.0;
};

Moved most_moved(const VehicleRefit& refit, const Validation& estimate) {
  Moved out;
  for (std::size_t j = 0; j < refit.moves.size(); ++j) {
    if (refit.moves[j] > out.most) out = {estimate.simulation[j].channel, refit.moves[j]};
  }
  return out;
}

std::string change_of(const VehicleRefit::Change& c) {
  return fmt::format("{} by {:+.0f} %", c.name, 100.0 * (c.refitted / c.known - 1.0));
}

// What a refit makes of the car.
void report_refit(const VehicleRefit& refit, Validation& estimate) {
  if (!compares(refit)) {
    estimate.notes.emplace_back(
        !refit.tried      ? "refit: no value of the result has an error to compare by"
        : refit.converged ? "refit: these data determine none of the values that were estimated"
                          : "refit: the search did not converge, so values are not compared");
    return;
  }
  estimate.tests.push_back(refit_test(refit));
  estimate.notes.emplace_back("refit on these data   result      refit    change  detectable");
  for (const VehicleRefit::Change& c : refit.changes) {
    estimate.notes.push_back(fmt::format(
        "  {:<16} {:>9.6g}  {:>9.6g}  {:>+6.1f} %  {:>10}", c.name, c.known, c.refitted,
        100.0 * (c.refitted / c.known - 1.0),
        std::isnan(c.detectable) ? "never" : fmt::format("{:.1f} %", 100.0 * c.detectable)));
  }
  const Moved moved = most_moved(refit, estimate);
  estimate.derived.push_back({"refit moves " + moved.channel, "%", 100.0 * moved.most, kNone});
  estimate.notes.push_back(
      fmt::format("refit: the values differ significantly where an F test rejects at {:.0f} % "
                  "({:.0f} and {:.0f} degrees of freedom, errors of both fits) and where they move "
                  "a simulated output by more than {:.0f} % of its size. detectable: the change of "
                  "this value alone that is found with a power of 80 %",
                  100.0 * kRefitLevel, refit.dof, refit.freedom, 100.0 * kRefitMatters));
}

// Errors of the values that these data would not show.
Findings check_refit_power(const VehicleRefit& refit) {
  constexpr double kDetectable = 0.2;  // of a parameter: larger changes must not go unnoticed
  if (!compares(refit)) return {};
  std::vector<std::string> about;
  for (const VehicleRefit::Change& c : refit.changes) {
    if (!(c.detectable <= kDetectable)) about.push_back(c.name);
  }
  if (about.empty()) return {};
  return {make_finding(
      FindingCode::insufficient_power, about,
      fmt::format("insufficient power: these data would not show an error of 20 % in {}",
                  fmt::join(about, ", ")),
      "validate on a recording that determines it: 'identikal info --vehicle' says which do")};
}

// A refit rejects the values where they differ significantly and the outputs move.
Findings check_values(const VehicleRefit& refit, const Validation& estimate) {
  constexpr double kClear = 2.0;  // standard errors
  if (!compares(refit) || refit_test(refit).pass) return {};
  const Moved moved = most_moved(refit, estimate);
  if (moved.most <= kRefitMatters) return {};
  std::vector<std::string> clear, all;
  for (const VehicleRefit::Change& c : refit.changes) {
    all.push_back(change_of(c));
    if (std::abs(c.refitted - c.known) > kClear * c.se) clear.push_back(all.back());
  }
  return {make_finding(
      FindingCode::values_differ, {},
      fmt::format("the values differ significantly: a refit changes {} (p {:.2g}), and {} by "
                  "{:.0f} % of its size",
                  fmt::join(clear.empty() ? all : clear, ", "), refit.p, moved.channel,
                  100.0 * moved.most))};
}

// The output that has to follow the steering.
std::size_t leading_output(const std::vector<ChannelFit>& fits) {
  const auto named = std::find_if(fits.begin(), fits.end(),
                                  [](const ChannelFit& fit) { return fit.channel == "r"; });
  const auto best = std::max_element(
      fits.begin(), fits.end(),
      [](const ChannelFit& a, const ChannelFit& b) { return a.fit_percent < b.fit_percent; });
  return static_cast<std::size_t>((named != fits.end() ? named : best) - fits.begin());
}

// A channel without a fit never changed and is below any limit.
Findings check_fits(const std::vector<ChannelFit>& fits, const std::vector<double>& limits) {
  std::string below;
  for (std::size_t i = 0; i < fits.size(); ++i) {
    if (fits[i].fit_percent >= limits[i]) continue;
    below += fmt::format("{}{} {:.1f} %, {:.4g} % wanted", below.empty() ? "" : "; ",
                         fits[i].channel, fits[i].fit_percent, limits[i]);
  }
  if (below.empty()) return {};
  return {make_finding(FindingCode::does_not_predict, {}, "fit too low: " + below)};
}

// Data that the result was made from.
Findings check_own_data(const Estimate& result, const std::vector<InputRecord>& inputs) {
  Findings out;
  for (const InputRecord& input : inputs) {
    const bool own =
        std::any_of(result.inputs.begin(), result.inputs.end(), [&](const InputRecord& each) {
          const bool apart = each.range[1] <= input.range[0] || input.range[1] <= each.range[0];
          return each.sha256 == input.sha256 && !apart;
        });
    if (!own) continue;
    out.push_back(
        make_finding(FindingCode::own_data, {input.path},
                     input.path + " is what the result was made from: this proves nothing",
                     "validate on a recording that was held out"));
  }
  if (out.empty()) return out;
  out.push_back(
      make_finding(FindingCode::proves_nothing, {}, ", but the result was made from these data"));
  return out;
}

// What became of the result, and of its model file, since.
Findings check_origin(const Estimate& result, const ModelSource* model_file) {
  Findings out;
  if (result.status != Status::ok) {
    out.push_back(make_finding(
        FindingCode::doubtful_result, {},
        fmt::format("the result itself is {}: {}", to_string(result.status), result.message)));
  }
  if (model_file == nullptr) return out;
  const ModelSource& model = *model_file;
  std::error_code none;
  if (std::filesystem::is_regular_file(model.path, none) &&
      sha256_of_file(model.path) != model.sha256) {
    out.push_back(make_finding(
        FindingCode::model_changed, {model.path},
        model.path +
            " has changed since; what is validated is the model as it was, which the result holds",
        "run the job again if the change matters"));
  }
  return out;
}

// Another car, or the same one where the fit knows nothing of it?
Findings check_range(const RecordingFit& own, const Findings& rejections, Validation& estimate) {
  const std::string where = beyond(own.driven, estimate.driven);
  if (where.empty()) return rejections;
  if (rejections.empty()) {
    estimate.notes.push_back("beyond what the result was fitted to, and it holds there: " + where);
    return {};
  }
  std::vector<std::string> seen;
  for (const Finding& each : rejections) seen.push_back(each.text);
  return {make_finding(FindingCode::outside_fitted_range, {},
                       fmt::format("the drive goes beyond what the result was fitted to: {}; "
                                   "whether it is another car cannot be told: {}",
                                   where, fmt::join(seen, "; ")),
                       "validate on a drive within that range, or fit both together")};
}

// Of a car: its fits, and whether a refit gives other values.
void conclude_car(const VehicleRefit& refit, const RecordingFit& own, const Findings& circumstances,
                  Validation& estimate) {
  const std::vector<ChannelFit>& fits = estimate.simulation;
  std::vector<double> limits(fits.size(), 0.0);
  if (!limits.empty()) limits[leading_output(fits)] = kPoorFit;
  Findings rejections = check_fits(fits, limits);
  append(rejections, check_values(refit, estimate));
  append(estimate.findings, check_range(own, rejections, estimate));
  append(estimate.findings, circumstances);
  conclude(estimate,
           refit.dof > 0.0 ? "it holds on these data: every fit is high enough, and the values of "
                             "a refit do not differ significantly"
                           : "every fit is high enough; the values themselves are not tested",
           Basis::tests);
}

}  // namespace

Validation validate(const ResultSections& result, const Model& model,
                    const std::vector<Dataset>& recordings, const std::vector<InputRecord>& inputs,
                    const ValidateOptions& options) {
  const bool vehicle = is_vehicle(model);
  Validation out = vehicle ? validate_car(result, model, recordings, options.robust)
                           : validate_filter(result, model, recordings);
  const bool simulated = vehicle || result.core->objective.method == kSimulationMethod;
  const std::vector<ChannelFit>& fits = simulated ? out.simulation : out.one_step;
  const RecordingFit own = result.fit != nullptr ? *result.fit : RecordingFit{};
  for (const ChannelFit& fit : simulated ? own.simulation : own.one_step) {
    out.derived.push_back({"own fit of " + fit.channel, "%", fit.fit_percent, kNone});
  }
  VehicleRefit refit;
  if (vehicle) {
    refit = refit_vehicle(*result.core, model, recordings, options.robust);
    report_refit(refit, out);
    append(out.findings, check_refit_power(refit));
  }
  Findings circumstances = check_own_data(*result.core, inputs);
  append(circumstances, check_origin(*result.core, result.model_file));
  if (options.least_fit) {
    append(out.findings, check_fits(fits, std::vector<double>(fits.size(), *options.least_fit)));
    append(out.findings, circumstances);
    conclude(out, "it holds on these data: every fit is high enough", Basis::tests);
  } else if (vehicle) {
    conclude_car(refit, own, circumstances, out);
  } else if (simulated) {
    append(out.findings, check_fits(fits, std::vector<double>(fits.size(), kPoorFit)));
    append(out.findings, circumstances);
    conclude(out, "it holds on these data: the simulation explains half of every output",
             Basis::tests);
  } else {
    append(out.findings, check_tests(out.tests));
    append(out.findings, circumstances);
    conclude(out, "it holds on these data: no test rejects it", Basis::tests);
  }
  out.verb = out.objective.method = "validate";
  return out;
}

}  // namespace identikal
