// What stands in a result, under which key, and what does it mean? The one list of the fields that
// result.json, its reader, its schema and the comparison of results are made from.
//
// describe(fields, s) tells the visitor `fields` what the struct is and, in the order of the file,
// every field of s: its key, the member, its meaning with the unit. Members that are not listed are
// for tables and plots: they are not in the file.
#pragma once

#include "identify/result/internal/black_box_fields.h"
#include "identify/result/internal/forms.h"

namespace identikal {

template <class Fields>
void describe(Fields& fields, InputRecord& input) {
  fields.is("InputRecord", "One data file that the result was computed from.");
  fields("path", input.path, "path of the file, as it was given");
  fields("sha256", Sha256{input.sha256}, "SHA-256 of the file");
  fields("rows", input.rows, "rows in the requested range of time");
  fields("used", input.used, "rows of these that the result rests on");
  fields("range", Ends{input.range},
         "range of time [s] from the first row, as --range gave it; null: from the first, to the "
         "last");
}

template <class Fields>
void describe(Fields& fields, ModelSource::Included& file) {
  fields.is("ModelSource.Included", "A file that the model file includes.");
  fields("path", file.path, "path of the file, as it was found");
  fields("sha256", Sha256{file.sha256}, "SHA-256 of the file");
}

template <class Fields>
void describe(Fields& fields, ModelSource& model) {
  fields.is("ModelSource", "The model file as it was then, and which files it includes.");
  fields("path", model.path, "path of the file, as it was given");
  fields("sha256", Sha256{model.sha256}, "SHA-256 of the file");
  fields("text", model.text, "its text; that of the files it includes is not kept");
  fields("included", model.included,
         "files that it includes, in the order in which they were read");
}

template <class Fields>
void describe(Fields& fields, EstimatedParameter& p) {
  fields.is("EstimatedParameter", "One number of the model, estimated or known.");
  fields("name", p.name, "name as in the model file; an entry of a matrix with its place, Q(1,1)");
  fields("unit", p.unit, "unit of every number here; empty: none");
  fields("value", p.value,
         "the estimate; null for the largest force of an axle that stays straight as far as it was "
         "driven");
  fields("se", p.se, "standard error, from what covariance_kind says");
  fields("ci95", p.ci95, "95 % interval");
  fields("profile95", p.profile95, "95 % interval of the profile likelihood");
  fields("se_sandwich", p.se_sandwich, "standard error that allows for noise that is not Gaussian");
  fields("se_structure", p.se_structure,
         "part of the standard error that comes by what the model leaves out (vehicles)");
  fields("crb_se", p.crb_se,
         "Cramer-Rao standard deviation for white noise of the distribution that was fitted");
  fields("start", p.start, "value where the search began");
  fields("bounds", Ends{p.bounds}, "bounds that the search kept to; null: none on this side");
  fields("fixed", p.fixed, "whether it is known, not estimated");
  fields("verdict", p.verdict, "how well the data determine it");
  fields("with", p.with, "parameters that it cannot be separated from");
  fields("prior", p.prior,
         "prior that counted beside the data, in words; empty: none (tune and fit of a filter)");
}

template <class Fields>
void describe(Fields& fields, ExcessMeanSquareError& excess) {
  fields.is("ExcessMeanSquareError",
            "What the errors of noise parameters cost the filter made with them.");
  fields("relative", excess.relative,
         "tr P of the filter with this noise over the optimal, - 1, as expected from the "
         "parameters' errors (verb bound: from the bound)");
  fields("without", excess.without, "variances that ended at zero: their errors do not count");
  fields("reason", excess.reason, "why there is no number; empty where there is one");
}

// Without a definition of its own: what a filter loses by the noise stands among its fields too.
template <class Fields>
void describe(Fields& fields, Noise& noise) {
  fields.group("Q", "process noise", [&](auto& Q) {
    Q("matrix", noise.Q, "covariance in SI");
    Q("kind", noise.Q_kind,
      "per-sample, or density: power per time; empty where there is no noise");
  });
  fields.group("R", "measurement noise, per sample",
               [&](auto& R) { R("matrix", noise.R, "covariance in SI"); });
  fields("S", noise.S, "covariance of process and measurement noise");
  fields("K_steady", noise.K_steady, "steady gain of the predictor");
  fields("P_steady", noise.P_steady, "steady covariance of the predicted state");
}

template <class Fields>
void describe(Fields& fields, SteadyFilter::Channel& channel) {
  fields.is("SteadyFilter.Channel", "An input, output or state of the filter.");
  fields("name", channel.name, "name as in the model file");
  fields("unit", channel.unit, "unit of the column; the filter takes SI");
}

template <class Fields>
void describe(Fields& fields, SteadyFilter& filter) {
  fields.is("SteadyFilter",
            "The filter as a program runs it, discrete time, SI; x_pred(t+1) = A x_pred + B u + "
            "K e with e = y - C x_pred - D u, K = (A P C' + G S) Sigma^-1, x_filt = x_pred + L e, "
            "L = P C' Sigma^-1. K, L, P, Sigma are null without a steady state.");
  StateSpace& model = filter.model;
  fields("dt", Present<double>{model.dt}, "time from sample to sample [s]");
  fields("inputs", filter.inputs, "inputs, as the columns of B and D");
  fields("outputs", filter.outputs, "outputs, as the rows of C");
  fields("states", filter.states, "states, as formulas name them; empty without names");
  fields("A", model.A, "states x states");
  fields("B", model.B, "states x inputs");
  fields("C", model.C, "outputs x states");
  fields("D", model.D, "outputs x inputs");
  fields("G", model.G, "states x process noises");
  fields("Q", model.Q, "covariance of the process noises, per sample");
  fields("R", model.R, "covariance of the measurement noise");
  fields("S", model.S, "covariance of process noises and measurement noise");
  fields("K", filter.K, "gain of the predictor");
  fields("L", filter.L, "gain of the filter");
  fields("P", filter.P, "covariance of x_pred");
  fields("Sigma", filter.Sigma, "covariance of e");
}

template <class Fields>
void describe(Fields& fields, Objective& objective) {
  fields.is("Objective", "What was maximised or minimised, and how that went.");
  fields("method", objective.method, "method of the verb");
  fields("initial", one_of(objective.initial, {"", "given", "stationary", "diffuse"}),
         "initial state of a linear model");
  fields("filter", one_of(objective.filter, {"", "extended", "iterated", "unscented", "kalman"}),
         "filter of a nonlinear model; kalman: of a linear one that changes from sample to "
         "sample");
  fields("log_likelihood", objective.log_likelihood, "log-likelihood at the estimate");
  fields("log_likelihood_start", objective.log_likelihood_start,
         "log-likelihood where the search began");
  fields("diffuse_samples", objective.diffuse_samples,
         "leading samples of every recording that determine a diffuse start");
  fields("leading", objective.leading,
         "log-likelihood of the first 1, 2, ... samples of every recording together; null for "
         "fewer than diffuse_samples");
  fields("aic", objective.aic,
         "Akaike's information criterion, of the samples behind a diffuse start");
  fields("bic", objective.bic,
         "Bayesian information criterion, of the samples behind a diffuse start; of a filter rows "
         "are counted");
  fields("bic_values", objective.bic_values,
         "the same of a filter with measured values counted, of which a row may have several");
  fields("samples", objective.samples, "measured values; 0 where there is no BIC");
  fields("rows", objective.rows, "rows with anything measured, of a filter");
  fields("held_out", objective.held_out, "log-likelihood per held-out row, of a filter");
  fields("iterations", objective.iterations, "iterations of the best search");
  fields("evaluations", objective.evaluations, "evaluations of the objective");
  fields("starts", objective.starts, "searches run");
  fields("starts_at_optimum", objective.starts_at_optimum,
         "searches of these that ended at the best value");
  fields("evaluation_method",
         one_of(objective.evaluation_method,
                {"", "time_varying_filter", "steady_state_filter", "sample_autocovariances"}),
         "how the likelihood was evaluated");
  fields("evaluation_reason", objective.evaluation_reason,
         "why it was not evaluated in a faster way");
  fields("integration_step", objective.integration_step,
         "the shortest integration step that equations of motion needed [s]; null where none has a "
         "fixed one");
}

// The channel is the key that these stand under.
template <class Fields>
void describe(Fields& fields, ChannelFit& fit) {
  fields.is("ChannelFit", "How far one channel is explained.");
  fields("fit_percent", fit.fit_percent, "100 (1 - ||y - yhat|| / ||y - mean y||)");
  fields("rmse", fit.rmse, "root mean square error, in its unit");
  fields("unit", fit.unit, "unit of the channel");
}

template <class Fields>
void describe(Fields& fields, TestResult& test) {
  fields.is("TestResult", "One test of the residuals or innovations.");
  fields("id", test.id, "which test: nis, ljung_box, ...");
  fields("channel", test.channel, "channel that was tested; empty: all together");
  fields("value", test.value, "the statistic");
  fields("interval", test.interval, "interval of the statistic in which the test passes");
  fields("p", test.p, "p-value");
  fields("pass", test.pass, "whether the test does not reject");
  fields("level", test.level,
         "probability that it rejects an optimal filter; null: no part of the verdict");
  fields("share", test.share,
         "share of the channel's variance that its past, or earlier inputs, explain beyond chance; "
         "null: no such test");
}

template <class Fields>
void describe(Fields& fields, Identifiability::Direction& direction) {
  fields.is("Identifiability.Direction", "A direction along which the fit does not change.");
  fields("names", direction.names, "parameters that move together");
  fields("weights", direction.weights, "how far each moves, scaled to unit information");
}

template <class Fields>
void describe(Fields& fields, Identifiability& id) {
  fields.is("Identifiability", "Which parameters the data determine.");
  fields("rank", id.rank, "number of directions that the data determine");
  fields("of", id.of, "number of parameters that were judged");
  fields("condition", id.condition, "condition of the information matrix scaled to unit diagonal");
  fields("unidentifiable_directions", id.unidentifiable_directions,
         "directions that the data leave open");
}

template <class Fields>
void describe(Fields& fields, Bound::Parameter& p) {
  fields.is("Bound.Parameter", "The bound of one parameter; null where it is known.");
  fields("name", p.name, "name as among the result's parameters");
  fields("complete_se", p.complete_se, "standard deviation if the states were observed too");
  fields("samples_needed", p.samples_needed, "samples needed for the accuracy");
  fields("gain_change", p.gain_change, "change of the steady gain for 1 % more of the parameter");
  fields(
      "published_se", p.published_se,
      "standard deviation by (6.45) of Matisko (2013), where that carries over to the parameters");
}

template <class Fields>
void describe(Fields& fields, SimulatedInformation& simulation) {
  fields.is("SimulatedInformation",
            "Nonlinear models: recordings that the information is the mean of, and how far that "
            "leaves the bounds off.");
  fields("recordings", simulation.recordings, "number of simulated recordings");
  fields("seed", simulation.seed, "seed of their noise");
  fields("relative_se", simulation.relative_se,
         "relative standard error of the bounds' standard deviations, at most");
}

template <class Fields>
void describe(Fields& fields, Bound::InnovationForm& form) {
  fields.is("Bound.InnovationForm",
            "K and Sigma as the unknowns; published: (6.45) of Matisko (2013), a bound of Sigma "
            "only.");
  fields("Sigma", form.Sigma, "steady covariance of the innovations");
  fields("K_se", form.K_se,
         "standard deviations of K; null where the outputs do not show all states");
  fields("Sigma_se", form.Sigma_se, "standard deviations of Sigma");
  fields("published_K_se", form.published_K_se,
         "standard deviation of K by (6.45); one state and one output only");
  fields("published_Sigma_se", form.published_Sigma_se,
         "standard deviation of Sigma by (6.45); one state and one output only");
}

template <class Fields>
void describe(Fields& fields, Bound& bound) {
  fields.is("Bound", "What a recording of so many samples could tell at best.");
  fields("samples", bound.samples, "samples of the planned recording");
  fields("accuracy", bound.accuracy, "wanted standard deviation over value");
  fields("parameters", bound.parameters, "bounds of the result's parameters, in their order");
  fields("gain_se", bound.gain_se, "standard deviations that the bound leaves to the steady gain");
  fields("simulated", bound.simulated,
         "simulation that the information comes from; null where it is exact");
  fields("innovation_form", bound.innovation_form,
         "bounds of the innovation form; null without a steady filter");
}

template <class Fields>
void describe(Fields& fields, Posterior::Parameter& p) {
  fields.is("Posterior.Parameter", "One parameter; null and empty where it is known.");
  fields("name", p.name, "name as among the result's parameters");
  fields("map", p.map, "value at the most probable point");
  fields("prior", p.prior, "prior in words");
}

template <class Fields>
void describe(Fields& fields, Posterior& posterior) {
  fields.is("Posterior",
            "What stands behind a Bayesian estimate: value is the posterior mean, se its standard "
            "deviation, ci95 the central credible interval.");
  fields("method",
         one_of(posterior.method, {"grid", "sequential Monte Carlo", "recursive Monte Carlo"}),
         "how it was computed");
  fields("points", posterior.points, "points of the grid, or draws");
  fields("effective", posterior.effective,
         "how many points count: (sum w)^2 / sum w^2, or distinct draws");
  fields("log_evidence", posterior.log_evidence, "logarithm of the marginal likelihood");
  fields("parameters", posterior.parameters,
         "priors and modes of the result's parameters, in their order");
}

template <class Fields>
void describe(Fields& fields, TimeHistory::Change& change) {
  fields.is("TimeHistory.Change", "A change of what is tracked; values as the names.");
  fields("since", change.since, "time of the change, as estimated [s]");
  fields("found", change.found, "time at which the test rejected [s]");
  fields("before", change.before, "estimates just before");
  fields("after", change.after, "estimates at the end of what follows");
}

template <class Fields>
void describe(Fields& fields, TimeHistory& history) {
  fields.is("TimeHistory",
            "When the noise, or coefficients, changed; the history itself is course.csv.");
  fields("names", history.names, "names of the free parameters");
  fields("units", history.units, "units of the free parameters");
  fields("changes", history.changes, "changes that were found, in the order of time");
}

template <class Fields>
void describe(Fields& fields, Forecast& forecast) {
  fields.is("Forecast", "What the outputs are expected to be behind the last row.");
  fields("names", forecast.names, "names of the outputs");
  fields("units", forecast.units, "units of the outputs");
  fields("time", forecast.time, "of the rows, as recorded [s]");
  fields("mean", forecast.mean, "outputs x rows");
  fields("sd", forecast.sd, "standard deviations of measurements, outputs x rows");
  fields("low", forecast.low, "2.5 % of measurements lie below, outputs x rows");
  fields("high", forecast.high, "2.5 % of measurements lie above, outputs x rows");
}

template <class Fields>
void describe(Fields& fields, Shaping::Pole& pole) {
  fields.is("Shaping.Pole", "One of a pair of poles.");
  fields("frequency", pole.frequency, "frequency [rad/s]");
  fields("radius", pole.radius, "distance from the origin of the plane of z");
}

template <class Fields>
void describe(Fields& fields, Shaping::Candidate& candidate) {
  fields.is("Shaping.Candidate", "A shaping filter that was tried.");
  fields("noise_source", one_of(candidate.noise_source, {"white", "process", "measurement"}),
         "noise that it shapes");
  fields("channels", candidate.channels, "channels with coloured noise");
  fields("order", candidate.order, "order of each filter");
  fields("zeros", candidate.zeros, "zeros of each filter");
  fields("log_likelihood", candidate.log_likelihood, "log-likelihood at its best");
  fields("bic", candidate.bic, "Bayesian information criterion");
}

template <class Fields>
void describe(Fields& fields, Shaping::Prediction& prediction) {
  fields.is("Shaping.Prediction", "Errors of prediction on held-out data.");
  fields("channel", prediction.channel, "name of the output");
  fields("unit", prediction.unit, "unit of the errors");
  fields("steps", prediction.steps, "samples ahead");
  fields("rmse_without", prediction.rmse_without,
         "root mean square error of the model with white noise");
  fields("rmse_with", prediction.rmse_with, "root mean square error of the model with the filter");
}

template <class Fields>
void describe(Fields& fields, Shaping& shaping) {
  fields.is("Shaping",
            "Is the noise coloured, which filters were tried, what is the best worth on held-out "
            "data.");
  fields("whiteness_p", shaping.whiteness_p,
         "probability that white noise looks like this, all tests together");
  fields("peak", shaping.peak, "peak of the spectrum of the white model's innovations [rad/s]");
  fields("peak_p", shaping.peak_p, "probability that white noise has a peak as high");
  fields("noise_source", one_of(shaping.noise_source, {"", "process", "measurement"}),
         "noise that the best filter shapes; empty: no filter");
  fields("order", shaping.order, "order of each filter");
  fields("zeros", shaping.zeros, "zeros of each filter");
  fields("poles", shaping.poles, "poles of the filters, one of each pair");
  fields("output_peak", shaping.output_peak,
         "peak of the spectrum of the outputs, at the slowest of the poles [rad/s]");
  fields("candidates", shaping.candidates,
         "filters that were tried: the white model first, then the best first");
  fields("predictions", shaping.predictions, "errors on held-out data; empty without");
  fields("held_out_log_likelihood_without", shaping.held_out_log_likelihood_without,
         "log-likelihood of held-out data with white noise");
  fields("held_out_log_likelihood_with", shaping.held_out_log_likelihood_with,
         "log-likelihood of held-out data with the filter");
  fields("held_out_choice", shaping.held_out_choice,
         "the filter that the rest of the data alone asks for, or white: it is what is compared");
}

template <class Fields>
void describe(Fields& fields, RankSelection::Step& step) {
  fields.is("RankSelection.Step", "The fit for one penalty of tr Q.");
  fields("penalty", step.penalty, "penalty of tr Q");
  fields("objective", step.objective, "objective of the fit");
  fields("trace", step.trace, "tr Q");
  fields("rank", step.rank, "rank of Q: independent sources of noise");
  fields("excess", step.excess,
         "chi-square by which the fit without penalty is worse with that rank");
  fields("allowed", step.allowed, "99 % quantile of the excess");
}

template <class Fields>
void describe(Fields& fields, RankSelection& selection) {
  fields.is("RankSelection", "How the fit of Q depends on how many sources of noise it has.");
  fields("rank", selection.rank, "selected rank of Q, the number of independent sources of noise");
  fields("of", selection.of, "largest possible rank");
  fields("curve", selection.curve, "fits from the largest penalty to none");
}

template <class Fields>
void describe(Fields& fields, Change& change) {
  fields.is("Change", "One thing to change.");
  fields("option", change.option, "of the command line; empty: none");
  fields("model", change.model, "YAML to merge into the model file; empty: none");
}

template <class Fields>
void describe(Fields& fields, Finding& finding) {
  fields.is("Finding", "What was found in a recording, a model or an estimate.");
  fields("code", CodeOf{finding}, "stable name; docs/troubleshooting.md lists them");
  fields("severity", finding.severity, "a serious one decides the status");
  fields("about", finding.about, "parameters, channels or files that it is about");
  fields("text", finding.text, "what was seen, with figures");
  fields("remedy", finding.remedy, "what to do about it; may be empty");
  fields("changes", finding.changes,
         "the same as a program can do it, where the job has tried it and it cures");
}

template <class Fields>
void describe(Fields& fields, VehicleSurvey::Signal& signal) {
  fields.is("VehicleSurvey.Signal", "A column that was understood.");
  fields("quantity", signal.quantity, "steering, vx, wheel_speed, r, vy, ay, beta or ax");
  fields("column", signal.column, "heading of the column");
  fields("unit", signal.unit, "unit of the column");
  fields("source", signal.source, "file, hence clock, that it comes from");
  fields("rate", signal.rate, "sampling rate [Hz]");
  fields("min", signal.min, "least value, in its unit");
  fields("max", signal.max, "largest value, in its unit");
  fields("held", signal.held, "share of samples that repeat the one before while the car moves");
  fields("quantum", signal.quantum, "least difference of two values, in its unit");
  fields("straight", signal.straight, "median while driving straight on, in its unit");
}

template <class Fields>
void describe(Fields& fields, VehicleSurvey::Relation& relation) {
  fields.is("VehicleSurvey.Relation", "Two things that kinematics ties together.");
  fields("expected", relation.expected, "what is expected, e.g. vx r");
  fields("seen", relation.seen, "what is seen, e.g. ay");
  fields("correlation", relation.correlation, "correlation at the best lag");
  fields("slope", relation.slope, "size of what is seen over what is expected");
  fields("lag", relation.lag, "best lag [s]: positive, what is seen comes late");
  fields("lag_se", relation.lag_se, "standard error of the lag [s]");
  fields("other_lag", relation.other_lag, "next best lag [s]");
  fields("other_correlation", relation.other_correlation, "correlation at the next best lag");
  fields("clock", relation.clock,
         "whether the lag is one of clocks: certain and larger than any car's");
}

template <class Fields>
void describe(Fields& fields, VehicleSurvey::Verdict& verdict) {
  fields.is("VehicleSurvey.Verdict", "Whether a fit could determine parameters.");
  fields("of", verdict.of, "parameters of the vehicle");
  fields("answer", one_of(verdict.answer, {"yes", "poorly", "combination", "no"}),
         "whether they can be determined; combination: not each for itself");
  fields("why", verdict.why, "reason in words");
}

template <class Fields>
void describe(Fields& fields, VehicleSurvey::Proposal& line) {
  fields.is("VehicleSurvey.Proposal", "A line of a model file.");
  fields("list", one_of(line.list, {"inputs", "outputs"}),
         "list of the model file that the line belongs to");
  fields("name", line.name, "name of the channel");
  fields("column", line.column, "heading of the column");
  fields("unit", line.unit, "unit of the column");
  fields("scale", line.scale, "factor of the column");
  fields("offset", line.offset, "offset in its unit: only what the model file says already");
  fields("delay", line.delay, "delay [s]");
}

// What was driven.
template <class Fields>
void describe_motion(Fields& fields, VehicleSurvey& survey) {
  fields("duration", survey.duration,
         "length of the times in which speed and yaw rate are known [s]");
  fields("moving", survey.moving, "time above the speed that the mapping proposes [s]");
  fields("standstill", survey.standstill, "share of the duration at standstill");
  fields("reversing", survey.reversing, "share of the duration in reverse");
  fields("speed", survey.speed, "speed while turning: least, 5 %, median, 95 %, largest [m/s]");
  fields("lateral_acceleration", survey.lateral_acceleration,
         "shares of |ay| up to 1, 2, 3, 4, 6, 8 m/s^2 and above");
  fields("steering_above_0_5_hz", survey.steering_above_0_5_hz,
         "share of the steering's power above 0.5 Hz");
  fields("steering_above_1_5_hz", survey.steering_above_1_5_hz,
         "share of the steering's power above 1.5 Hz");
  fields("left", survey.left, "share of turning to the left");
  fields("steady", survey.steady, "share of turning at a constant steering angle");
  fields("yaw_change", survey.yaw_change,
         "change of the yaw rate within half a second, over its size");
}

template <class Fields>
void describe(Fields& fields, VehicleSurvey& survey) {
  fields.is("VehicleSurvey",
            "What a vehicle's recording holds and what it can tell before any fit.");
  fields("signals", survey.signals, "columns that were understood");
  fields("relations", survey.relations, "what ties them together");
  describe_motion(fields, survey);
  fields("identifiable", survey.identifiable, "what a fit could determine");
  fields("mapping", survey.mapping, "lines proposed for a model file");
  fields.group("time", "time of the recording", [&](auto& time) {
    time("column", survey.time_column, "heading of the column; empty: none");
    time("unit", survey.time_unit, "unit of the column");
    time("restarts", survey.restarts, "several runs in one file: each begins where time goes back");
  });
  fields("least_speed", survey.least_speed, "least speed of use_when [m/s]");
  fields("findings", survey.findings, "what is wrong with the recording");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet::Value& value) {
  fields.is("HandlingSheet.Value", "A number of the log or of the model.");
  fields("value", value.value, "null where it does not exist");
  fields("se", value.se, "standard error; null where there is none");
  fields("ci95", value.ci95, "95 % interval");
  fields("why", value.why, "why value or error is null, a sentence; empty: both are there");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet::Figure& figure) {
  fields.is("HandlingSheet.Figure", "A figure from the log and from the model.");
  fields("name", figure.name, "name in words");
  fields("unit", figure.unit, "unit of all numbers; empty: none");
  fields("log", figure.log, "from the recordings alone");
  fields("model", figure.model, "of the model");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet::Section& section) {
  fields.is("HandlingSheet.Section", "What one standard asks for.");
  fields("standard", section.standard, "number of the standard");
  fields("title", section.title, "manoeuvre of the standard");
  fields("figures", section.figures, "figures in the order of the sheet");
  fields("remarks", section.remarks, "sentences on what they rest on");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet::CurvePoint& point) {
  fields.is("HandlingSheet.CurvePoint",
            "A bin of the characteristic curve, 1 m/s^2 wide (ISO 4138).");
  fields("ay", point.ay, "vx times yaw rate, mean of the bin [m/s^2]");
  fields("seconds", point.seconds, "quasi-steady turning in it [s]");
  fields("speed", point.speed, "mean speed [m/s]");
  fields("angle_log", point.angle_log, "steering angle as measured [deg]");
  fields("angle_model", point.angle_model, "that of the model [deg]");
  fields("yaw_gain_log", point.yaw_gain_log, "yaw rate over steering angle [1/s]");
  fields("yaw_gain_model", point.yaw_gain_model, "that of the model [1/s]");
  fields("sideslip_log", point.sideslip_log, "sideslip angle of the centre of gravity [deg]");
  fields("sideslip_model", point.sideslip_model, "that of the model [deg]");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet::ResponsePoint& point) {
  fields.is("HandlingSheet.ResponsePoint", "A frequency of a response (ISO 7401).");
  fields("frequency", point.frequency, "frequency [Hz]");
  fields("coherence", point.coherence, "coherence of the log with its steering, 0 to 1");
  fields("gain_log", point.gain_log, "gain, in the response's unit");
  fields("gain_model", point.gain_model, "that of the model");
  fields("phase_log", point.phase_log, "phase [deg], negative where the output is late");
  fields("phase_model", point.phase_model, "that of the model [deg]");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet::Response& response) {
  fields.is("HandlingSheet.Response", "Response of an output to the measured steering angle.");
  fields("output", one_of(response.output, {"r", "ay", "beta"}), "the output");
  fields("unit", response.unit, "unit of the gain");
  fields("points", response.points, "frequencies, rising");
}

template <class Fields>
void describe(Fields& fields, HandlingSheet& sheet) {
  fields.is("HandlingSheet", "The handling of a vehicle, from a log and from a model.");
  fields("steering", one_of(sheet.steering, {"steering wheel", "road wheel"}),
         "whose angle the steering is");
  fields("speed", sheet.speed, "speed that the model's response is at [m/s]");
  fields("sections", sheet.sections, "figures standard by standard");
  fields("curve", sheet.curve, "characteristic curve, rising in ay; empty without a log of it");
  fields("responses", sheet.responses, "frequency responses");
  fields("remarks", sheet.remarks, "sentences on log and model as a whole");
}

template <class Fields>
void describe(Fields& fields, DrivenRange& range) {
  fields.is("DrivenRange", "What 99 % of the rows of a vehicle's drive lie between.");
  fields("quantity", range.quantity, "vx, ay, beta or steering frequency");
  fields("unit", range.unit, "m/s, m/s^2, deg or Hz");
  fields("low", range.low, "0.5 % lie below");
  fields("high", range.high, "0.5 % lie above; of the frequency: 95 % of the power lies below");
}

template <class Fields>
void describe(Fields& fields, ReferenceFit& fit) {
  fields.is("ReferenceFit", "How far a filter's estimates of a quantity are from a reference.");
  fields("name", fit.name, "of the reference in the model file");
  fields("unit", fit.unit, "of rmse, bias and sd");
  fields("rows", fit.rows, "rows where both are known and the filter has settled");
  fields("independent", fit.independent, "as many independent errors tell as much of the NEES");
  fields("rmse", fit.rmse, "root of the mean squared error");
  fields("bias", fit.bias, "mean error: estimate - reference");
  fields("sd", fit.sd, "root of the mean variance, of the filter and the reference together");
  fields("nees", fit.nees, "mean of squared error over variance; 1 where the variance is right");
  fields("coverage", fit.coverage, "share of errors within 1.96 standard deviations");
  fields("log_score", fit.log_score, "mean log-density of the errors [nats]");
}

template <class Fields>
void describe(Fields& fields, DerivedValue& derived) {
  fields.is("DerivedValue", "A quantity computed from the parameters.");
  fields("name", derived.name, "name in words");
  fields("unit", derived.unit, "unit of both numbers");
  fields("value", derived.value, "value at the estimate");
  fields("se", derived.se, "standard error, carried over from the parameters");
}

template <class Fields>
void describe(Fields& fields, EstimatedCurve& curve) {
  fields.is("EstimatedCurve", "A function that parameters stand for.");
  fields("name", curve.name, "its name in the model file");
  fields("unit", curve.unit, "of value and se");
  fields("axis", curve.axis, "what it runs over");
  fields("axis_unit", curve.axis_unit, "of at");
  fields("at", curve.at, "from the first knot to the last");
  fields("value", curve.value, "there");
  fields("se", curve.se, "standard errors, carried over from the parameters");
  fields("freedom", curve.freedom,
         "by how many free numbers it follows the data; null: its roughness does not count");
}

}  // namespace identikal
