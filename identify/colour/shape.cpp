#include "identify/colour/shape.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "identify/colour/internal/innovation_whiteness.h"
#include "identify/colour/internal/likelihood.h"
#include "identify/colour/internal/spectrum.h"
#include "identify/estimate/parameter_table.h"
#include "identify/filter/recordings_check.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/noise/ml.h"
#include "lib/base/error.h"
#include "lib/data/units.h"
#include "lib/filter/kalman.h"
#include "lib/filter/prediction.h"
#include "lib/model/equivalent_noise.h"
#include "lib/model/frequency_response.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;

// Tells the caller what is being done, and whether he wants it to go on.
class Stages {
 public:
  explicit Stages(const ShapeOptions& options) : options_(options) {}

  // @return false once the caller has stopped: this search, and all that would follow
  bool begin(const std::string& stage) {
    stage_ = stage;
    return go_on();
  }
  bool go_on() {
    stopped_ = stopped_ || (options_.progress && !options_.progress(stage_));
    return !stopped_;
  }
  bool stopped() const { return stopped_; }
  const std::string& current() const { return stage_; }

 private:
  const ShapeOptions& options_;
  std::string stage_;
  bool stopped_ = false;
};

const char* source_name(NoiseSource source) {
  return source == NoiseSource::process ? "process" : "measurement";
}

double bic_of(double log_likelihood, Index unknowns, Index samples) {
  return -2.0 * log_likelihood +
         static_cast<double>(unknowns) * std::log(static_cast<double>(samples));
}

// A structure with its maximum likelihood.
struct Candidate {
  ShapingStructure structure;
  Model model;  // its parameters are at the maximum
  double log_likelihood = kNone;
  double bic = kNone;
};

std::vector<ShapingStructure> structures(const Model& model, const ShapeOptions& options) {
  std::vector<ShapingStructure> out;
  const auto add = [&](NoiseSource where, Index channels) {
    if (options.source && *options.source != where) return;
    if (!shaping_fault(model, where).empty()) return;
    std::vector<std::vector<Index>> sets;
    for (Index c = 0; c < channels; ++c) sets.push_back({c});
    if (channels > 1) {
      sets.emplace_back();
      for (Index c = 0; c < channels; ++c) sets.back().push_back(c);
    }
    for (const std::vector<Index>& set : sets) out.push_back({where, set, 1});
  };
  add(NoiseSource::process, as_linear(model).G.constant.cols());
  add(NoiseSource::measurement, as_linear(model).C.constant.rows());
  return out;
}

// Root mean square errors over the samples of each recording from a share on, in SI; ny x horizons.
MatrixXd prediction_rms(const Model& model, const std::vector<Dataset>& recordings,
                        const std::vector<int>& horizons, double from) {
  const LinearModel& linear = as_linear(model);
  const StateSpace m = instantiate(linear, model.parameters);
  PredictionErrors all;
  for (const Dataset& data : recordings) {
    const auto begin = static_cast<Index>(from * static_cast<double>(data.size()));
    const PredictionErrors one =
        prediction_errors(m, linear.initial, data.y, data.u, horizons, begin);
    if (all.count.size() == 0) {
      all = one;
    } else {
      all.squares += one.squares;
      all.count += one.count;
    }
  }
  return all.rms();
}

double log_likelihood_of(const Model& model, const std::vector<Dataset>& recordings) {
  const LinearModel& linear = as_linear(model);
  const StateSpace m = instantiate(linear, model.parameters);
  double out = 0.0;
  for (const Dataset& data : recordings) {
    const Likelihood one = log_likelihood(m, linear.initial, data.y, data.u);
    if (one.status != FilterStatus::ok) return kNone;
    out += one.value;
  }
  return out;
}

// The log-likelihood behind the first samples. With a diffuse start a model with more states leaves
// out more samples, and what it leaves out has a unit: without the same beginning taken from both,
// likelihoods of two models could not be compared.
double comparable_log_likelihood(const Model& model, const std::vector<Dataset>& recordings,
                                 Index beginning) {
  if (beginning == 0) return log_likelihood_of(model, recordings);
  std::vector<Dataset> first;
  for (const Dataset& data : recordings) first.push_back(first_samples(data, beginning));
  return log_likelihood_of(model, recordings) - log_likelihood_of(model, first);
}

std::vector<Dataset> first_parts(const std::vector<Dataset>& recordings, double share) {
  std::vector<Dataset> out;
  for (const Dataset& data : recordings) {
    const auto keep = static_cast<Index>(share * static_cast<double>(data.size()));
    out.push_back(first_samples(data, std::max<Index>(1, keep)));
  }
  return out;
}

// Where the outputs' spectrum has the peak that belongs to the slowest of the filters' poles
// [rad/s]; kNone where there is none.
double output_peak(const Model& model, const std::vector<Shaping::Pole>& poles, double dt) {
  if (poles.empty()) return kNone;
  const StateSpace m = instantiate(as_linear(model), model.parameters);
  const Index n = m.states();
  const MatrixXcd C = m.C.cast<std::complex<double>>();
  const MatrixXcd noise = (m.G * m.Q * m.G.transpose()).cast<std::complex<double>>();
  const auto level = [&](double omega) {
    const MatrixXcd T = C * state_response(m.A, omega, MatrixXd::Identity(n, n));
    return (T * noise * T.adjoint()).trace().real();
  };
  const auto slowest = std::max_element(
      poles.begin(), poles.end(), [](const auto& a, const auto& b) { return a.radius < b.radius; });
  if (slowest->frequency <= 0.0) return kNone;
  // Uphill from the pole, in steps of a tenth of its width.
  const double step = std::max(0.1 * (1.0 - slowest->radius), 1e-5);
  double omega = slowest->frequency * dt, here = level(omega);
  for (const double sign : {1.0, -1.0}) {
    for (int k = 0; k < 20000; ++k) {
      const double next = omega + sign * step;
      if (!(next > 0.0 && next < std::numbers::pi)) return kNone;
      const double there = level(next);
      if (!(there > here)) break;
      omega = next;
      here = there;
    }
  }
  return omega / dt;
}

std::string channel_names(const Model& model, const ShapingStructure& structure) {
  std::string out;
  for (const Index c : structure.channels) {
    if (!out.empty()) out += ", ";
    out += structure.source == NoiseSource::process ? fmt::format("w{}", c + 1)
                                                    : model.outputs[c].name;
  }
  return out;
}

Index measured(const Dataset& data) { return samples_present({data}) / data.y.rows(); }

const Dataset& longest_of(const std::vector<Dataset>& recordings) {
  return *std::max_element(
      recordings.begin(), recordings.end(),
      [](const Dataset& a, const Dataset& b) { return measured(a) < measured(b); });
}

// The longest recording. Throws where no filter can be put into the model, or all are too short.
const Dataset& longest_recording(const Model& model, const std::vector<Dataset>& recordings,
                                 const ShapeOptions& options) {
  if (structures(model, options).empty()) {
    const NoiseSource source = options.source.value_or(NoiseSource::process);
    throw InputError(
        {model.source, 0, 0},
        "no shaping filter can be put into this model: " + shaping_fault(model, source),
        "a model whose dynamics are known, and a start that is not given as a whole");
  }
  constexpr Index kFewest = 64;  // samples that make a spectrum
  const Dataset& longest = longest_of(recordings);
  const Index fewest = kFewest + 2 * as_linear(model).A.constant.rows();
  if (measured(longest) < fewest) {
    throw InputError(
        {longest.name, 0, 0},
        fmt::format("{} measured rows are too few to distinguish coloured noise from white",
                    measured(longest)),
        fmt::format("at least {}", fewest), "use a longer recording");
  }
  return longest;
}

// Samples that determine any shaped model's start where some states start diffuse: twice the states of the
// largest.
Index undetermined_beginning(const LinearModel& model, int most_order) {
  if (model.initial == InitialState::stationary) return 0;
  const Index channels = std::max(model.G.constant.cols(), model.C.constant.rows());
  return 2 * (model.A.constant.rows() + most_order * channels);
}

// Every structure fitted to the spectrum, each order from what the lower one has found; the
// smallest BIC first.
std::vector<SpectralSolution> spectral_fits(const InnovationSpectrum& spectrum, const Model& model,
                                            const ShapeOptions& options, Stages& stages) {
  std::vector<SpectralSolution> out;
  for (ShapingStructure structure : structures(model, options)) {
    SpectralSolution lower;
    for (structure.order = 1; structure.order <= options.most_order; ++structure.order) {
      if (!stages.begin(fmt::format("spectrum: {} noise, order {}", source_name(structure.source),
                                    structure.order))) {
        return {};
      }
      SpectralSolution best;
      for (const bool zeros : {false, true}) {
        if (zeros && structure.order == 1) continue;
        structure.with_zeros = zeros;
        const SpectralSolution one =
            fit_spectrum(spectrum, structure, structure.order > 1 ? &lower : nullptr);
        if (!std::isfinite(one.log_likelihood)) continue;
        out.push_back(one);
        if (one.log_likelihood > best.log_likelihood) best = one;
      }
      if (best.channels.empty()) break;
      lower = best;
    }
  }
  std::sort(out.begin(), out.end(),
            [](const SpectralSolution& a, const SpectralSolution& b) { return a.bic < b.bic; });
  return out;
}

// The most promising of each noise source at their maximum likelihood; the smallest BIC first.
std::vector<Candidate> most_likely(const Model& start, const std::vector<Dataset>& recordings,
                                   const std::vector<SpectralSolution>& fits, Index beginning,
                                   Stages& stages) {
  constexpr std::size_t kEach = 3;
  constexpr double kHopeless = 15.0;  // BIC behind the best of its source
  const Index samples = samples_present(recordings);
  std::vector<Candidate> out;
  for (const NoiseSource source : {NoiseSource::process, NoiseSource::measurement}) {
    std::size_t taken = 0;
    double first = 0.0;
    for (const SpectralSolution& s : fits) {
      if (s.structure.source != source || taken == kEach) continue;
      if (taken == 0) first = s.bic;
      if (s.bic > first + kHopeless) continue;
      ++taken;
      if (!stages.begin(fmt::format("likelihood: order {}", s.structure.order))) return {};
      std::optional<Model> shaped =
          maximise_shaped(shaped_start(start, s), s.structure, recordings);
      if (!shaped) continue;
      const double L = comparable_log_likelihood(*shaped, recordings, beginning);
      if (!std::isfinite(L)) continue;
      const double bic = bic_of(L, coordinates(shaped->parameters).size(), samples);
      out.push_back({s.structure, std::move(*shaped), L, bic});
    }
  }
  std::sort(out.begin(), out.end(),
            [](const Candidate& a, const Candidate& b) { return a.bic < b.bic; });
  return out;
}

// Maximum likelihood without the finding that sends to this verb.
NoiseEstimate tuned(const Model& model, const std::vector<Dataset>& recordings, int starts,
                    std::uint64_t seed, Stages& stages) {
  NoiseMlOptions options;
  options.progress = [&](int, int, double) { return stages.go_on(); };
  options.starts = starts;
  options.profiles = false;
  options.seed = seed;
  NoiseEstimate out = tune_ml(model, recordings, options);
  std::erase_if(out.findings,
                [](const Finding& f) { return f.code == FindingCode::coloured_innovations; });
  return out;
}

// A candidate with its errors.
struct Winner {
  const Candidate* candidate;
  NoiseEstimate estimate;
  std::vector<ShapingFilter> filters;
};

// The best that beats white noise, that the data determine, and whose filters stay stable when
// nothing holds them.
std::optional<Winner> first_determined(const std::vector<Candidate>& candidates, double white_bic,
                                       const std::vector<Dataset>& recordings, Stages& stages) {
  for (const Candidate& c : candidates) {
    if (!(c.bic < white_bic) || !stages.go_on()) break;
    Winner out{&c, tuned(c.model, recordings, 1, 1, stages), {}};
    out.filters = filters_of(parameters_of(out.estimate, c.model.parameters), c.structure);
    const bool stable =
        std::all_of(out.filters.begin(), out.filters.end(),
                    [](const ShapingFilter& f) { return modes(f.a).front().radius < 1.0; });
    const Identifiability& id = out.estimate.identifiability;
    if (stable && id.rank == id.of && out.estimate.status != Status::not_converged) return out;
  }
  return std::nullopt;
}

// What filters the recordings ask for, the smallest BIC first.
std::vector<Candidate> candidates_for(const Model& white, const std::vector<Dataset>& recordings,
                                      const Dataset& longest, Index beginning,
                                      const ShapeOptions& options, Stages& stages) {
  InnovationSpectrum spectrum = innovation_spectrum(white, longest);
  const Model start = with_raised_variances(white, spectrum);
  const std::vector<SpectralSolution> fits = spectral_fits(spectrum, white, options, stages);
  return most_likely(start, recordings, fits, beginning, stages);
}

std::string in_words(const Model& model, const ShapingStructure& structure) {
  return fmt::format("{} noise of {}, order {}", source_name(structure.source),
                     channel_names(model, structure), structure.order);
}

// Of the first part of each recording alone: the filter is chosen and tuned there, and compared with
// the white model, tuned there too, on the last. What was chosen after a look at the last part would
// do well there because of that.
void compare_held_out(const Model& white, const std::vector<Dataset>& recordings, Index beginning,
                      const ShapeOptions& options, Stages& stages, Shaping& report) {
  const double share = 1.0 - options.hold_out;
  const std::vector<Dataset> first = first_parts(recordings, share);
  Model white_first = white;
  RecordingsLikelihood likelihood(white, first);
  const Solution refit = maximise(likelihood.problem(), coordinates(white.parameters));
  if (std::isfinite(refit.summary.objective)) {
    white_first.parameters = with_coordinates(white.parameters, refit.x);
  }
  const std::vector<Candidate> chosen =
      candidates_for(white_first, first, longest_of(first), beginning, options, stages);
  const double white_bic = bic_of(comparable_log_likelihood(white_first, first, beginning),
                                  coordinates(white.parameters).size(), samples_present(first));
  const bool any = !chosen.empty() && chosen.front().bic < white_bic;
  const Model& best_first = any ? chosen.front().model : white_first;
  report.held_out_choice = any ? in_words(white, chosen.front().structure) : "white";
  const std::vector<int> horizons{1, 2, 4, 8, 16};
  const MatrixXd without = prediction_rms(white_first, recordings, horizons, share);
  const MatrixXd with = prediction_rms(best_first, recordings, horizons, share);
  report.held_out_log_likelihood_without =
      log_likelihood_of(white_first, recordings) - log_likelihood_of(white_first, first);
  report.held_out_log_likelihood_with =
      log_likelihood_of(best_first, recordings) - log_likelihood_of(best_first, first);
  for (std::size_t i = 0; i < report.units.size(); ++i) {
    const double unit = unit_scale(report.units[i]);
    for (std::size_t h = 0; h < horizons.size(); ++h) {
      const auto row = static_cast<Index>(i), column = static_cast<Index>(h);
      report.predictions.push_back({report.channels[i], report.units[i], horizons[h],
                                    without(row, column) / unit, with(row, column) / unit});
    }
  }
}

// The model, with coloured process noise, as one with coloured measurement noise: A, C and G as
// numbers, the rest and its parameters as they are.
std::optional<Model> same_outputs(const Model& shaped, Index filter_states) {
  const auto m =
      colour_in_measurement(instantiate(as_linear(shaped), shaped.parameters), filter_states);
  if (!m) return std::nullopt;
  Model out = shaped;
  out.name += ", coloured measurement noise";
  LinearModel& linear = as_linear(out);
  linear.A = constant_matrix(m->A);
  linear.C = constant_matrix(m->C);
  linear.G = constant_matrix(m->G);
  // Parameters that stood in these alone are gone.
  out.parameters.clear();
  std::vector<int> place(shaped.parameters.size(), -1);
  const auto keep = [&](int& parameter) {
    int& to = place[parameter];
    if (to < 0) {
      to = static_cast<int>(out.parameters.size());
      out.parameters.push_back(shaped.parameters[parameter]);
    }
    parameter = to;
  };
  for (ParametrisedMatrix* matrix : {&linear.B, &linear.D, &linear.Q, &linear.R, &linear.S}) {
    for (ParametrisedMatrix::Entry& entry : matrix->entries) keep(entry.parameter);
    if (matrix->block >= 0) keep(matrix->block);
  }
  return out;
}

// Does the filter explain everything, hold on unseen data, leave the model's own noise?
Findings check_filter(const Shaping& report, const NoiseEstimate& estimate) {
  Findings out;
  const bool white_now =
      std::all_of(estimate.tests.begin(), estimate.tests.end(),
                  [](const TestResult& test) { return test.id != "ljung_box" || test.pass; });
  if (!white_now) {
    out.push_back(make_finding(FindingCode::still_coloured, {},
                               ", but not all: the innovations are still not white"));
  }
  if (report.held_out_log_likelihood_with < report.held_out_log_likelihood_without) {
    out.push_back(
        make_finding(FindingCode::worse_on_held_out, {},
                     ", but not on the part held out, where it does worse than white noise"));
  }
  for (const EstimatedParameter& p : estimate.parameters) {
    if (p.verdict != Verdict::at_bound || p.value != 0.0) continue;
    out.push_back(
        make_finding(FindingCode::noise_vanished, {p.name},
                     fmt::format("{} has become zero: the filter has taken its place", p.name),
                     "check the model's dynamics: a wrong A looks like coloured noise too"));
  }
  return out;
}

// Do the outputs say where the filter stands? They do not determine which source has the spectrum.
Findings check_source(const Candidate& best, const std::vector<Candidate>& candidates) {
  constexpr double kTells = 10.0;  // BIC apart: very strong evidence (Kass & Raftery 1995)
  const auto other = std::find_if(candidates.begin(), candidates.end(), [&](const Candidate& c) {
    return c.structure.source != best.structure.source;
  });
  if (other == candidates.end() || other->bic >= best.bic + kTells) return {};
  return {make_finding(
      FindingCode::noise_source, {},
      fmt::format("the outputs do not determine whether process or measurement noise is coloured "
                  "(BIC {:.1f} and {:.1f}); the state estimates differ",
                  best.bic, other->bic),
      "decide by what is known of the sensor, and use --noise process or measurement")};
}

// The model without filters, tuned.
struct WhiteModel {
  NoiseEstimate estimate;
  Model model;  // its parameters are at the maximum
  InnovationWhiteness whiteness;
  MatrixXd innovations;
  double bic = kNone;
};

Model linear_model_of(const Model& written) {
  Model model = written;
  LinearModel& linear = as_linear(model);
  linear = with_known_formulas_as_numbers(linear, model.parameters);
  if (linear.formulas.empty() && !linear.offset) return model;
  throw InputError({model.source, 0, 0},
                   linear.offset ? "the model has constants alongside states and inputs"
                                 : "the model is not linear in the parameters to be estimated",
                   "entries that are sums of multiples of parameters",
                   "'fit' or 'tune' first, then fix what is not noise");
}

void report_white_spectrum(const MatrixXd& innovations, Index first, double dt, Shaping& report) {
  const InnovationSpectra seen = innovation_spectra(innovations, first);
  report.frequency = seen.omega / dt;
  report.spectrum_white = seen.level;
  report.band = seen.band;
}

WhiteModel tune_white(const Model& model, const std::vector<Dataset>& recordings, Index beginning,
                      std::uint64_t seed, Stages& stages, Shaping& report) {
  const double dt = as_linear(model).dt;
  for (const Channel& channel : recordings[0].outputs) {
    report.channels.push_back(channel.name);
    report.units.push_back(channel.unit);
  }
  stages.begin("tuning the white model");
  WhiteModel out{tuned(model, recordings, 3, seed, stages), model, {}, {}};
  out.model.parameters = parameters_of(out.estimate, model.parameters);
  out.whiteness = innovation_whiteness(out.estimate);
  report.whiteness_p = out.whiteness.p;
  report.peak = out.whiteness.peak / dt;
  report.peak_p = out.whiteness.peak_p;
  out.innovations = out.estimate.series.standardised;
  report_white_spectrum(out.innovations, first_innovation(out.innovations), dt, report);
  const double L = comparable_log_likelihood(out.model, recordings, beginning);
  out.bic = bic_of(L, coordinates(model.parameters).size(), samples_present(recordings));
  report.candidates.push_back({"white", "", 0, 0, L, out.bic});
  return out;
}

// The first channel whose innovations are their mean but for rounding; empty: none.
std::string constant_innovations(const Series& series) {
  constexpr double kRounding = 1e-10;  // of the power
  for (std::size_t i = 0; i < series.channels.size(); ++i) {
    const auto e = series.standardised.row(static_cast<Index>(i)).array();
    const auto present = (e == e);
    const double n = static_cast<double>(present.count());
    const double mean = present.select(e, 0.0).sum() / n;
    const double power = present.select(e, 0.0).square().sum() / n;
    if (power - mean * mean <= kRounding * power) return series.channels[i];
  }
  return "";
}

// @param why  answers the verb, whatever the white model's own tuning came to
ShapeResult without_filter(WhiteModel white, Shaping report, Finding why) {
  ShapeResult out;
  static_cast<NoiseEstimate&>(out.estimate) = std::move(white.estimate);
  out.estimate.findings.push_back(std::move(why));
  conclude(out.estimate, "");
  out.estimate.shaping = std::move(report);
  return out;
}

void report_structure(const Winner& winner, double dt, Shaping& report) {
  const ShapingStructure& structure = winner.candidate->structure;
  report.noise_source = source_name(structure.source);
  report.order = static_cast<int>(structure.order);
  report.zeros = static_cast<int>(structure.zeros());
  for (const ShapingFilter& filter : winner.filters) {
    for (const Mode& mode : modes(filter.a)) {
      report.poles.push_back({mode.frequency / dt, mode.radius});
    }
  }
}

ShapeResult with_filter(Winner winner, const Model& model, const WhiteModel& white,
                        const std::vector<Candidate>& candidates, Shaping report) {
  const Candidate& best = *winner.candidate;
  const double dt = as_linear(model).dt;
  ShapeResult out;
  static_cast<NoiseEstimate&>(out.estimate) = std::move(winner.estimate);
  out.model = best.model;
  out.model->name = model.name + ", shaped";
  out.model->parameters = parameters_of(out.estimate, best.model.parameters);
  out.estimate.model_name = out.model->name;
  out.estimate.objective.method = "shape";
  // From the same sample on: with more states, a diffuse filter begins later.
  const MatrixXd& innovations = out.estimate.series.standardised;
  const Index first = std::max(first_innovation(innovations), first_innovation(white.innovations));
  report_white_spectrum(white.innovations, first, dt, report);
  report.spectrum_shaped = innovation_spectra(innovations, first).level;
  report.output_peak = output_peak(*out.model, report.poles, dt);
  if (best.structure.source == NoiseSource::process) {
    out.in_measurement = same_outputs(
        *out.model, static_cast<Index>(best.structure.channels.size()) * best.structure.order);
  }
  if (out.estimate.status == Status::ok) {
    append(out.estimate.findings, check_filter(report, out.estimate));
    append(out.estimate.findings, check_source(best, candidates));
    conclude(out.estimate,
             fmt::format("coloured {} noise (p {:.2g}): a filter of order {} explains it",
                         report.noise_source, report.whiteness_p, report.order));
  }
  out.estimate.shaping = std::move(report);
  return out;
}

}  // namespace

ShapeResult shape(const Model& written, const std::vector<Dataset>& recordings,
                  const ShapeOptions& options) {
  if (!(options.hold_out > 0.0 && options.hold_out < 1.0) || options.most_order < 1) {
    throw std::invalid_argument(
        fmt::format("hold_out is {} and most_order {}; expected a share between 0 and 1, and 1 or "
                    "more",
                    options.hold_out, options.most_order));
  }
  const Model model = sampled_model(checked(linear_model_of(written), recordings));
  Stages stages(options);
  const Dataset& longest = longest_recording(model, recordings, options);
  const Index beginning = undetermined_beginning(as_linear(model), options.most_order);
  Shaping report;
  WhiteModel white = tune_white(model, recordings, beginning, options.seed, stages, report);
  const auto end_here = [&](FindingCode code, std::string message) {
    return without_filter(std::move(white), std::move(report),
                          make_finding(code, {}, std::move(message)));
  };
  const auto as_stopped = [&] {
    return end_here(FindingCode::stopped, "stopped by the caller at: " + stages.current());
  };
  if (stages.stopped()) return as_stopped();
  if (const std::string channel = constant_innovations(white.estimate.series); !channel.empty()) {
    return end_here(FindingCode::colour_unexplained,
                    fmt::format("the innovations of '{}' are constant: that is a drift, which no "
                                "coloured noise explains; add a slope or a constant input to the "
                                "model",
                                channel));
  }
  constexpr double kLevel = 0.05;  // of all tests of whiteness together
  if (!(white.whiteness.p < kLevel)) {
    return end_here(
        FindingCode::no_coloured_noise,
        fmt::format("no coloured noise found: whiteness is not rejected (p {:.2g}), no shaping "
                    "filter is needed",
                    white.whiteness.p));
  }

  const std::vector<Candidate> candidates =
      candidates_for(white.model, recordings, longest, beginning, options, stages);
  if (stages.stopped()) return as_stopped();
  for (const Candidate& c : candidates) {
    report.candidates.push_back({source_name(c.structure.source), channel_names(model, c.structure),
                                 static_cast<int>(c.structure.order),
                                 static_cast<int>(c.structure.zeros()), c.log_likelihood, c.bic});
  }
  stages.begin("errors of the shaped model");
  std::optional<Winner> winner = first_determined(candidates, white.bic, recordings, stages);
  if (stages.stopped()) return as_stopped();
  if (!winner) {
    return end_here(
        FindingCode::colour_unexplained,
        fmt::format("the innovations are not white (p {:.2g}), and no shaping filter explains "
                    "them: the model itself is in doubt",
                    white.whiteness.p));
  }
  if (!stages.begin("held-out comparison")) return as_stopped();
  compare_held_out(white.model, recordings, beginning, options, stages, report);
  if (stages.stopped()) return as_stopped();
  report_structure(*winner, as_linear(model).dt, report);
  return with_filter(std::move(*winner), model, white, candidates, std::move(report));
}

}  // namespace identikal
