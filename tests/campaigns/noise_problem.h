// Recordings whose noise covariances are known, with the faults that users' models and recordings
// have.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "identify/model/model.h"
#include "lib/data/dataset.h"

namespace identikal {

enum class NoiseFault {
  wrong_A,           ///< a pole elsewhere; an integrator that leaks
  missing_state,     ///< a lag or an oscillation in an output that the model does not have
  coloured_output,   ///< measurement noise that follows its own past
  coloured_process,  ///< process noise that follows its own past
  outliers,          ///< samples far off
  changing_R,        ///< measurement noise that changes its size: a jump, or a drift
  wrong_step,        ///< the sampling period is another one
};

std::string to_string(NoiseFault fault);

/// What a user has, and what he cannot know.
struct NoiseProblem {
  Model model;  ///< as he believes it to be; its free parameters are variances
  Dataset recording;
  std::vector<double> truth;  ///< of every free parameter, in the model's order
  std::vector<NoiseFault> faults;
  std::string words;  ///< kind of model, faults with their sizes
};

/// Drawn at random, faults and their sizes too: sizes from harmless to gross, evenly in their
/// logarithm. The same for the same seed.
/// @param faults  how many, 0 to 2, each of another kind
NoiseProblem draw_noise_problem(std::uint64_t seed, int faults);

}  // namespace identikal
