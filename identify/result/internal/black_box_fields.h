// Which keys has a model from data alone in JSON, and what do they mean?
#pragma once

#include <string>
#include <vector>

#include "identify/estimate/details.h"
#include "identify/result/internal/forms.h"

namespace identikal {

/// Ways to the matrices of a black box.
inline const std::vector<std::string> kRefinements{"states",       "simulation", "prediction_error",
                                                   "any_poles",    "arx",        "armax",
                                                   "output_error", "box_jenkins"};

template <class Fields>
void describe(Fields& fields, BlackBox::Candidate& candidate) {
  fields.is("BlackBoxCandidate", "A model that was tried.");
  fields("order", candidate.order, "number of states");
  fields("refinement", one_of(candidate.refinement, kRefinements), "how its matrices were found");
  fields("bic", candidate.bic, "of its one-step predictions");
  fields("simulation_fit", candidate.simulation_fit, "of held-out rows, mean over the outputs [%]");
  fields("prediction_fit", candidate.prediction_fit, "the same, one step ahead [%]");
  fields("control_fit", candidate.control_fit, "the same, all rows up to the horizon ahead [%]");
}

template <class Fields>
void describe(Fields& fields, BlackBox::Pole& pole) {
  fields.is("BlackBoxPole", "A pole; one of each conjugate pair.");
  fields("real", pole.real, "real part");
  fields("imaginary", pole.imaginary, "imaginary part");
  fields("real_se", pole.real_se, "its standard error");
  fields("imaginary_se", pole.imaginary_se, "its standard error");
  fields("frequency", pole.frequency, "of the pole in continuous time [rad/s]");
  fields("damping", pole.damping, "of the pole in continuous time");
  fields("time_constant", pole.time_constant, "of the pole in continuous time [s]");
  fields("frequency_se", pole.frequency_se, "its standard error");
  fields("damping_se", pole.damping_se, "its standard error; of a pair");
  fields("time_constant_se", pole.time_constant_se, "its standard error");
}

template <class Fields>
void describe(Fields& fields, BlackBox::Polynomial& polynomial) {
  fields.is("BlackBoxPolynomial", "One of A y = B/F u + C/D e.");
  fields("output", polynomial.output, "name of the output");
  fields("name", one_of(polynomial.name, {"A", "B", "C", "D", "F"}), "which of them");
  fields("input", polynomial.input, "name of the input; of B and F");
  fields("delay", polynomial.delay, "power of q^-1 at the first coefficient");
  fields("value", polynomial.value, "coefficients, with the leading one where it is 1, SI");
  fields("se", polynomial.se, "standard errors");
}

template <class Fields>
void describe(Fields& fields, BlackBox::OperatingPoint& point) {
  fields.is("OperatingPointOfChannel", "What the model's signals are deviations from.");
  fields("channel", point.channel, "name of the input or output");
  fields("unit", point.unit, "its unit");
  fields("value", point.value, "in that unit");
}

template <class Fields>
void describe(Fields& fields, BlackBox::Delay& delay) {
  fields.is("InputDelay", "When an input is first seen.");
  fields("input", delay.input, "name of the input");
  fields("rows", delay.rows, "rows after which some output shows it");
  fields("before", delay.before,
         "what it may have done before, by the largest response to it: two standard errors");
}

template <class Fields>
void describe(Fields& fields, BlackBox::Nonlinearity& curve) {
  fields.is("BlackBoxNonlinearity",
            "A curve that a linear model has not, and that the recordings ask for.");
  fields(
      "place", one_of(curve.place, {"input", "output", "feedback"}),
      "input: in place of an input; output: where an output is measured; feedback: of an output, "
      "in place of an input");
  fields("shape", one_of(curve.shape, {"square", "cube", "absolute value"}), "of the signal");
  fields("input", curve.input, "name of the input");
  fields("output", curve.output, "name of the output");
  fields("p", curve.p, "that a linear system shows as much, of this curve by itself");
  fields("of_innovations", curve.of_innovations, "share of their squares that it explains");
  fields("of_simulation", curve.of_simulation, "the same of the simulation's errors");
}

template <class Fields>
void describe(Fields& fields, BlackBox::ImpulseResponse& response) {
  fields.is("BlackBoxImpulseResponse",
            "What an output does behind a unit of an input, without a model.");
  fields("input", response.input, "name of the input");
  fields("output", response.output, "name of the output");
  fields("kernel", one_of(response.kernel, {"TC", "DC", "SS"}), "of largest evidence");
  fields("value", response.value, "from the same row on, SI");
  fields("se", response.se,
         "posterior standard deviations; where nothing is left of a response, the prior's");
}

template <class Fields>
void describe(Fields& fields, BlackBox::StepResponse& response) {
  fields.is("BlackBoxStepResponse",
            "What an output of the model does behind a unit step of an input.");
  fields("input", response.input, "name of the input");
  fields("output", response.output, "name of the output");
  fields("value", response.value, "from the same row on, SI");
  fields("se", response.se, "standard errors");
}

template <class Fields>
void describe(Fields& fields, BlackBox::TransferFunction& transfer) {
  fields.is("BlackBoxTransferFunction",
            "Of the model in continuous time, inputs held between the rows: coefficients of "
            "falling powers of s, SI.");
  fields("input", transfer.input, "name of the input");
  fields("output", transfer.output, "name of the output");
  fields("numerator", transfer.numerator, "as many as of the denominator");
  fields("numerator_se", transfer.numerator_se, "standard errors");
  fields("denominator", transfer.denominator, "the first is 1");
  fields("denominator_se", transfer.denominator_se, "standard errors");
}

template <class Fields>
void describe(Fields& fields, BlackBox::FrequencyResponse& response) {
  fields.is("BlackBoxFrequencyResponse",
            "Of an output to an input: the model's, and by spectral analysis.");
  fields("input", response.input, "name of the input");
  fields("output", response.output, "name of the output");
  fields("frequency", response.frequency, "[rad/s]");
  fields("gain", response.gain, "of the model, SI");
  fields("gain_se", response.gain_se, "its standard errors");
  fields("phase", response.phase, "of the model [deg]");
  fields("phase_se", response.phase_se, "its standard errors");
  fields("spectral_gain", response.spectral_gain, "without a model, SI");
  fields("spectral_gain_se", response.spectral_gain_se, "its standard errors");
  fields("spectral_phase", response.spectral_phase, "without a model [deg]");
  fields("spectral_phase_se", response.spectral_phase_se, "its standard errors");
  fields("coherence", response.coherence, "share of the output's power that all inputs explain");
}

template <class Fields>
void describe(Fields& fields, BlackBox& box) {
  fields.is("BlackBox", "A model from data alone: what was tried, what was chosen.");
  fields("purpose", one_of(box.purpose, {"automatic", "simulation", "prediction", "control"}),
         "what it is to be good at");
  fields("order", box.order, "number of states");
  fields("refinement", one_of(box.refinement, kRefinements), "how its matrices were found");
  fields("lags", box.lags, "rows that the predictor behind all candidates looks back");
  fields("held_out_share", box.held_out_share,
         "of every recording, that candidates were judged on");
  fields("singular_values", box.singular_values, "what each state says of the outputs to come");
  fields("candidates", box.candidates, "all that was tried");
  fields("poles", box.poles, "of the model");
  fields("polynomials", box.polynomials, "of ARX, ARMAX, output-error and Box-Jenkins models");
  fields("operating_point", box.operating_point, "what its signals are deviations from");
  fields("horizon", box.horizon, "rows ahead that count for control; 0: not the purpose");
  fields("delays", box.delays, "of the inputs");
  fields("nonlinearities", box.nonlinearities, "curves that recordings ask for, most first");
  fields("impulse_responses", box.impulse_responses, "by regularised least squares");
  fields("step_responses", box.step_responses, "of the model");
  fields("transfer_functions", box.transfer_functions,
         "of the model in continuous time; none where a pole is at or below zero");
  fields("frequency_responses", box.frequency_responses, "of the model and by spectral analysis");
  fields("input_names", box.inputs, "columns of gain");
  fields("output_names", box.outputs, "rows of gain");
  fields("gain", box.gain, "in the steady state, SI");
  fields("gain_se", box.gain_se, "standard errors");
}

}  // namespace identikal
