// What does a model file compare the states with?
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"
#include "lib/formula/expression.h"
#include "lib/model/nonlinear_model.h"

namespace identikal {

/// The formula at this place, of the quantity that this reference measures.
using ReadReferenceFormula = std::function<Expression(const YamlNode&, const ChannelSource&)>;

/// Reads
///
///   reference: {px: {column: true_px, unit: m, sd: 0.02}, heading: {equals: "atan2(vy, vx)"}}
///
/// where a reference without 'equals' is the state of its name.
/// @param symbols  the model's symbols and definitions; its dynamics and outputs are not looked at
/// @param known    per parameter (lib/model/nonlinear_model.h)
/// @return no channels where the file has no such key
StateReferences read_references(const YamlNode& root, const ModelFormulas& symbols,
                                const std::vector<std::string>& states,
                                const std::vector<bool>& known, const ReadReferenceFormula& read);

}  // namespace identikal
