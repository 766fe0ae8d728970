// Which measurement noise of a model file follows the state, the inputs or the time?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "identify/model/yaml_reader.h"
#include "lib/formula/expression.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

/// The spread of one output, as the file has it.
struct NoiseSpread {
  std::size_t output = 0;
  Expression formula;
  bool variance = false;  ///< else a standard deviation
  bool of_state = false;  ///< it follows a state, or a definition
  bool of_inputs = false;
  std::string key;  ///< the output's name
  /// What stands in R for it: parameters that are factors of the whole, and no part of `formula` any
  /// more, or 1.
  std::string factor = "1";
};

/// Reads one formula; marks its parameters as used.
using ReadSpread =
    std::function<Expression(const YamlNode& node, std::size_t output, bool variance)>;

/// The spreads under noise: {measurement: {sd or variance: ...}} that hold more than parameters.
/// @param symbols  sizes of the model's formulas, in the order of lib/model/nonlinear_model.h
/// @param scalers  of each symbol, the name of a parameter that may be a factor in R; else empty
std::vector<NoiseSpread> moving_spreads(const YamlNode& root,
                                        const std::vector<std::string>& outputs,
                                        const ModelFormulas& symbols,
                                        const std::vector<std::string>& scalers,
                                        const ReadSpread& read);

/// The file with their factors in place of these spreads.
YamlNode with_factors_alone(YamlNode root, const std::vector<NoiseSpread>& spreads);

/// A model whose outputs are the standard deviations, 1 where none of these is given.
NonlinearModel scales_of(const std::vector<NoiseSpread>& spreads, std::size_t outputs,
                         ModelFormulas symbols, const std::vector<bool>& known);

}  // namespace identikal
