// Which of the candidates is the model?
#pragma once

#include <cstddef>
#include <vector>

#include "identify/black_box/black_box.h"
#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/model_search.h"

namespace identikal {

/// Place of the one that serves the purpose, fitted to all rows; refined ones that are tried are added.
/// @param search  gets the horizon, where control is the purpose
/// @throws InputError where predictions of no order stay finite, or held-out rows are too few for the horizon
std::size_t chosen_candidate(ModelSearch& search, std::vector<BlackBoxCandidate>& all,
                             const BlackBoxOptions& options);

}  // namespace identikal
