// What does the search for a model work on, and which candidates does it try?
#pragma once

#include <vector>

#include <Eigen/Core>

#include "identify/black_box/black_box.h"
#include "identify/black_box/internal/candidates.h"
#include "identify/black_box/internal/scaled_recordings.h"
#include "lib/data/dataset.h"

namespace identikal {

/// Fits closer than this are the same: the smaller order is taken.
inline constexpr double kSameFit = 0.005;

/// What the search for a model works on: all rows, and their first ones, which candidates are fitted to.
struct ModelSearch {
  ScaledRecordings all;
  SplitRecordings parts;
  SubspaceStart of_first, of_all;
  BlackBoxPurpose purpose = BlackBoxPurpose::automatic;
  ModelStructure structure = ModelStructure::states;
  std::vector<Eigen::Index> delays = {};  ///< of the inputs, for polynomials
  bool has_inputs = false;
  Eigen::Index horizon = 0;  ///< rows ahead that count, where control is the purpose
  bool stopped = false;      ///< by the caller, before all orders were tried
  bool simulates() const {
    return has_inputs && purpose != BlackBoxPurpose::prediction &&
           purpose != BlackBoxPurpose::control;
  }
  bool is_stable(Refinement how) const { return simulates() && how != Refinement::any_poles; }
};

/// Of these recordings: about the means of their first rows, or about zero where that is what they move around.
/// @throws InputError for recordings too short for any model, for a structure of inputs alone without inputs
ModelSearch begun_search(const std::vector<Dataset>& recordings, const BlackBoxOptions& options);

/// Fills the model of all rows, and its BIC.
void fit_to_all_rows(const ModelSearch& search, BlackBoxCandidate& candidate);

/// Fits of held-out rows by the first ones; where BIC is wanted the model of all rows too.
BlackBoxCandidate candidate(const ModelSearch& search, int order, Refinement how, bool with_bic);

/// All orders that were asked for, until progress() says no; of states as the regression on them
/// has it, and with B and D by simulation where simulations count.
/// @throws InputError where the least order is beyond what the recordings tell
std::vector<BlackBoxCandidate> candidates_of_all_orders(ModelSearch& search,
                                                        const BlackBoxOptions& options);

}  // namespace identikal
