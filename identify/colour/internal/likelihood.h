// Which coefficients of shaping filters make recordings most likely?
#pragma once

#include <optional>
#include <vector>

#include "identify/colour/internal/spectrum.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

/// The model with the filters and variances of a fit of the spectrum: where the search begins.
/// @param base  what with_raised_variances() gave
Model shaped_start(const Model& base, const SpectralSolution& spectral);

/// The model at its maximum likelihood over all recordings, by all free parameters, the filters in
/// zeta (lib/model/shaping_filter.h): stable, with stable inverses, wherever the search goes.
/// @param shaped  of with_shaping_filters(), with filters of this structure
/// @return nothing where the likelihood is undefined at the start, or a filter on the unit circle
std::optional<Model> maximise_shaped(const Model& shaped, const ShapingStructure& structure,
                                     const std::vector<Dataset>& recordings);

/// The filters of a shaped model, at these values of its parameters.
std::vector<ShapingFilter> filters_of(const ParameterSet& parameters,
                                      const ShapingStructure& structure);

}  // namespace identikal
