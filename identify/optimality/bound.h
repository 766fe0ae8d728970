// How well could any method know the parameters? The Cramer-Rao bound of a model, before any data.
#pragma once

#include <cstdint>
#include <vector>

#include "identify/estimate/results.h"
#include "identify/model/model.h"
#include "lib/data/dataset.h"
#include "lib/filter/recording_digest.h"

namespace identikal {

struct BoundOptions {
  Eigen::Index samples = 0;  ///< of the recording that is planned
  double accuracy = kNone;   ///< standard deviation / value that is wanted
  int runs = 50;             ///< nonlinear models: recordings to simulate
  std::uint64_t seed = 1;    ///< of their noise
};

/// Takes the model's values as the truth: the smallest standard deviation that an unbiased estimate
/// of each free parameter can have from `samples` samples of the outputs alone
/// (lib/filter/information.h), that with the states observed (the bound of Matisko 2013, chapter
/// 6), how many samples give the wanted accuracy, which parameters or combinations no recording can
/// determine, what the uncertainty means for the steady gain (4.33), and the bound of gain and
/// innovation covariance where these are the unknowns, beside the source's (6.45).
///
/// Of a nonlinear model there is no expectation in closed form: the information of
/// nonlinear_likelihood() (lib/nonlinear/filter.h), averaged over recordings simulated from the
/// model, whose likelihood is taken to be the filter's. What rests on a steady filter is left out.
///
/// Example:
///
///     const auto bound = bound_of(model, {.samples = 1000, .accuracy = 0.1}, nullptr);
///
/// @param inputs  recording whose times and inputs excite the model, of `samples` samples; null =
///   none, which a linear model without inputs needs not and one with inputs counts as silence
/// @throws InputError when nothing is free or the model's values give no filter, or cannot be
///   simulated; std::invalid_argument for a nonlinear model without `inputs` or with runs < 2, and as
///   checked_with_inputs() (identify/model/check.h)
CramerRaoBound bound_of(const Model& model, const BoundOptions& options, const Dataset* inputs);

/// The same of recordings like those of some digests: as many samples, the same inputs, and the
/// likelihood's information on them at the model's values.
/// @param options  of which `accuracy` counts
/// @throws InputError as bound_of() and check_takes_digests()
CramerRaoBound bound_of_digests(const Model& model, BoundOptions options,
                                const std::vector<RecordingDigest>& digests);

}  // namespace identikal
