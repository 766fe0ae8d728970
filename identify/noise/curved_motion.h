// Do the equations of motion lack a curve that would change an estimate?
#pragma once

#include <functional>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/extension.h"
#include "identify/model/model.h"
#include "identify/model/yaml_reader.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Is there something that judge_by_curves() would ask: an estimate that is ok and not of noise
/// alone, of states that noise moves?
bool may_lack_a_curve(const Model& model, const NoiseEstimate& estimate);

/// Process noise takes over what a motion lacks, and innovations stay white while other estimates
/// are off. Where something else than noise is estimated: score tests of quadratic damping, dry
/// friction and cubic terms in every state that has process noise, and of curves of the inputs
/// (identify/noise/internal/possible_extensions.h), on at most 5000 rows, at p below 0.001 for all
/// of them together. The likeliest is fitted, and where an estimate would be another with it the
/// finding `nonlinear` is serious, else a warning; concludes again.
/// Source of the idea: Rao (1948), "Large sample tests of statistical hypotheses concerning several
/// parameters", Proc. Camb. Phil. Soc. 44.
///
/// Example:
///
///     const YamlNode root = read_yaml("motor.yaml");
///     NoiseEstimate tuned;  // = tune_ml(model, recordings)
///     judge_by_curves(root, model, recordings, tuned, {});
///
/// @param root      the model's file as a tree
/// @param model     as given, its values do not count: those of the estimate do
/// @param progress  as fit_extensions() takes it
void judge_by_curves(const YamlNode& root, const Model& model,
                     const std::vector<Dataset>& recordings, NoiseEstimate& estimate,
                     const std::function<bool(const ModelExtension& extension)>& progress);

}  // namespace identikal
