// What do outliers do to an estimate of noise? It is made again without them.
#pragma once

#include <vector>

#include "identify/estimate/estimate.h"
#include "identify/filter/outliers.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Of maximum likelihood, from the estimate. It matters where a parameter moves by more than 2.6
/// standard errors and by more than 5 % of itself.
/// @param end      what was estimated with the outliers; `estimate` lists it in its units
/// @param cleaned  the recordings with the outliers missing
OutlierEffect outlier_effect(const Estimate& estimate, const Model& model, const ParameterSet& end,
                             const std::vector<Dataset>& cleaned);

}  // namespace identikal
