// Would a further part of the model predict the recordings better, and which?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/extension.h"
#include "identify/model/model.h"
#include "identify/noise/ml.h"
#include "lib/data/dataset.h"

namespace identikal {

struct ExtendOptions {
  double hold_out = 0.3;  ///< last share of each recording, on which extensions are compared
  int most = 3;           ///< extensions, one after the other
  NoiseMlOptions search;  ///< of the model that is chosen
  /// Told of each part as its trial begins, by one thread at a time. @return false to stop
  std::function<bool(const std::string& what)> progress;
};

/// What a further part of the model gained where nothing was fitted.
struct ExtensionTrial {
  std::string what;  ///< in_words() of it
  double gain =
      kNone;  ///< log-likelihood per held-out row; NaN: no filter, not determined, or nothing promised
  double gain_se = kNone;  ///< from its scatter between blocks of rows
  bool adopted = false;
  /// Pays, and is as likely of another sensor, "undecided". Of two outputs half of it in each is
  /// tried besides.
  bool ambiguous = false;
  /// Pays by what a filter's beginning gains in the first part: a constant beside errors that last.
  bool from_start = false;
  bool rival = false;  ///< what was adopted in its place predicts no better, beyond chance
};

struct ExtendResult {
  NoiseEstimate estimate;             ///< of the model chosen, on all rows
  std::string text;                   ///< its model file; empty: the model as it was
  std::vector<ExtensionTrial> tried;  ///< in the order of the trials
};

/// Step by step: every extension that there is (biases of one output and of all, errors that last,
/// those of sensors of one kind alike, scales and delays, the same of at most two inputs, process
/// noise of states without any, coloured process noise, noise of another size from a time on,
/// damping, friction and curves of the motion whose score promises something; of more than four
/// outputs all at once alone) is fitted to the first part of each recording by
/// maximum likelihood, and predicts the last part, its filter going on from the first. Those pay
/// whose gain is beyond 0.01 nats per row and 3 of its standard errors, or 2 where the first part
/// asks for them by 10 nats more than BIC's penalty; of those that no other beats by 3, the one is
/// adopted that the first part asks for by BIC. A bias, scale or delay that is as likely of another
/// sensor is not adopted; of two outputs a bias or scale that is half in the one and half, the
/// other way, in the other may be, which moves the states by neither. Beside an error that lasts, which
/// takes a constant in while the filter runs on, a constant pays if the first part from its very
/// beginning asks for it (likelihood ratio, 1e-4) and held-out rows do not speak against it. What is
/// chosen is tuned on all rows, and judged by judge_by_expected_errors(), judge_by_curves() and
/// judge_by_undecided(). Densities of rows are those of a normal distribution of which one sample in
/// a hundred is ten times as wide.
///
/// Example:
///
///     const YamlNode root = read_yaml("tracker.yaml");
///     const ExtendResult found = tune_extended(root, model, recordings);
///     std::puts(found.text.c_str());  // a model file
///
/// @param root  the model's file as a tree
/// @throws InputError as tune_ml(), and for a model that is not written as formulas
ExtendResult tune_extended(const YamlNode& root, const Model& model,
                           const std::vector<Dataset>& recordings,
                           const ExtendOptions& options = {});

}  // namespace identikal
