// Which formula is a function that nobody knows, given by its values at knots?
#pragma once

#include <vector>

#include "identify/model/yaml_reader.h"
#include "lib/model/parameter.h"
#include "lib/model/spline_curve.h"

namespace identikal {

/// A model file with the curves and tables of its `let` written out as formulas:
///
///   let: {force: {spline: x, knots: [-0.2 m, 0 m, 0.2 m], unit: N}}
///
/// is the cubic spline over x through the values of force_1, force_2, force_3 at the knots, which
/// are parameters of that unit: they start at 0, or at `values: [...]`, unless the file has them
/// itself. Every cubic is such a curve (at the second and the last but one knot the third
/// derivative does not jump); outside of the knots it goes on straight. `table` in place of
/// `spline` is straight between the knots; over two formulas, `table: [x, y]` with knots: [[...],
/// [...]], it is linear in each of them and the value at knots i of x and j of y is force_i_j.
///
/// The curve is linear in its values: as sharp as the knots are dense, and no sharper; with
/// `smooth: true` as smooth as recordings ask for (identify/noise/ml.h).
///
/// Example:
///
///     const YamlNode root = with_curves(parse_yaml("let: {f: {spline: x, knots: [-1, 0, 1]}}", "f.yaml"));
///     std::puts(find(*find(root, "let"), "f")->text.c_str());  // a formula of x, f_1, f_2, f_3
///
/// Source: de Boor (1978), "A practical guide to splines", chapter IV.
/// @throws InputError for unknown keys, knots that do not rise or are too few or too many, units
///   that differ
YamlNode with_curves(YamlNode root);

/// The splines of `let`, before they are written out. @param parameters  of the model that was made
/// of it
/// @throws InputError for `smooth` that is neither true nor false
std::vector<SplineCurve> spline_curves(const YamlNode& root, const ParameterSet& parameters);

}  // namespace identikal
