// Which states does a model have that is put together from components by name: a trend, a season, a
// cycle, the clock of a receiver?
#pragma once

#include <string>
#include <vector>

#include "identify/model/yaml_reader.h"

namespace identikal {

/// A model file with its `components` written out: as states, dynamics, outputs, noise and start of
/// the formulas that say the same, so that everything that formulas have is there. A file without
/// them is returned as it is. The keys of each kind stand in examples/MODEL_FILE.md.
///
/// Example:
///
///     const std::string text =
///         "identikal: 1\nparameters: {q: {value: 4, min: 0}}\ntime: {kind: discrete, step: 1 s}\n"
///         "components: {level: {kind: level, variance: q}}\noutputs: {sales: {column: sales}}\n";
///     std::puts(written_out(text, "sales.yaml").c_str());
///
/// Sources: Harvey (1989), "Forecasting, Structural Time Series Models and the Kalman Filter",
/// chapter 2 (trend, season, cycle); Hartikainen & Sarkka (2010), "Kalman filtering and smoothing
/// solutions to temporal Gaussian process regression models" (Matern); Zucca & Tavella (2005), "The
/// clock model and its relationship with the Allan and related variances" (clock).
/// @throws InputError for an unknown kind or key, a kind that belongs to the other kind of time, a
///   name that is taken
YamlNode with_components(YamlNode root);

/// The same as the text of a model file, included files and all.
std::string written_out(const std::string& text, const std::string& path);

/// Names of the kinds of components.
const std::vector<std::string>& component_kinds();

}  // namespace identikal
