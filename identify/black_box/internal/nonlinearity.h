// Is a linear model of these recordings enough, and if not, which channel asks for a curve?
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "identify/black_box/internal/scaled_recordings.h"
#include "identify/estimate/details.h"
#include "identify/estimate/finding.h"
#include "lib/subspace/innovation_form.h"

namespace identikal {

/// Score tests of static curves that the model lacks: w = H^-1 s is what the innovations would have
/// of it, s the outputs' response to the square, the cube or the absolute value
///
/// * of an input in that input's place (Hammerstein),
/// * of a predicted output where it is measured (Wiener),
/// * of a predicted output in an input's place (a spring, a drag), of at most nine pairs.
///
/// What the inputs and outputs of some rows before explain linearly is taken out of w and of the
/// innovations, and so are the responses to straight lines in place of curves: the model's matrices
/// were fitted. The significance is that of the scores' sum against the scatter of forty parts of
/// the recording and against their autocovariances (Kiefer and Vogelsang 2005): it allows for
/// colour and for unequal noise. Of the p-values of all curves the least counts, times their number
/// (Bonferroni).
/// Source of the idea: Billings and Voon (1986).
///
/// @param model  of scaled recordings
/// @param skip   rows at the beginning of each that still know its first state
/// @return those with p below 0.001, the one that explains most first; none of recordings too short
std::vector<BlackBox::Nonlinearity> nonlinearities(const InnovationForm& model,
                                                   const ScaledRecordings& recordings,
                                                   const std::vector<std::string>& inputs,
                                                   const std::vector<std::string>& outputs,
                                                   Eigen::Index skip);

/// A linear model is not enough where a curve explains more than a hundredth of the squares that it
/// leaves, of innovations or of the simulation's errors; serious above a tenth.
Findings check_linearity(const std::vector<BlackBox::Nonlinearity>& found);

}  // namespace identikal
