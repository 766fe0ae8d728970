// A simulated quarterly series with a trend, a season and three samples missing, and an input. numpy
// RandomState(7), rounded; what statsmodels 0.13.5 (UnobservedComponents, use_exact_diffuse=True,
// parameters given) says of it stands in the tests. Its log-likelihood counts log 2 pi for the samples
// that determine a diffuse state too: ours is above by as many halves of it.
#pragma once

#include <limits>
#include <vector>

namespace identikal::structural_series {

inline constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

inline const std::vector<double> y{
    12.176,   9.623,    10.525,   7.941,  11.068, 8.35,   10.539, 7.771,  10.996, 7.986,
    10.421,   9.135,    11.218,   10.172, 12.237, 8.907,  13.21,  11.311, 12.761, 10.902,
    kMissing, kMissing, kMissing, 10.556, 15.024, 13.616, 15.288, 13.19,  16.513, 15.32,
    17.052,   15.012,   19.349,   16.92,  18.592, 15.779, 20.75,  18.482, 19.807, 18.234,
    21.707,   20.2,     22.092,   20.328, 23.679, 21.857, 23.622, 22.832, 25.661, 24.102,
    25.966,   23.639,   26.592,   26.247, 27.994, 25.339, 27.975, 26.783, 28.009, 26.724};

// Six more than y: those of a forecast.
inline const std::vector<double> u{
    -0.478, 0.385,  0.301,  1.219,  0.117, -1.854, -1.37,  0.731,  -0.258, 1.138,  0.273,
    -0.749, 1.082,  -0.807, -2.053, 2.064, -1.911, 0.636,  0.939,  0.147,  -1.683, 1.015,
    -1.442, -1.344, -0.362, 0.789,  0.3,   0.811,  -0.444, -0.172, -1.137, -0.317, 0.593,
    -0.3,   0.475,  -0.573, -0.592, 0.039, -0.195, 0.592,  0.178,  1.74,   -0.219, -0.227,
    -1.04,  0.023,  0.683,  -0.74,  -0.05, 0.719,  -0.127, -0.519, 0.973,  0.097,  0.397,
    1.171,  1.145,  -0.347, -0.525, 0.284, -0.133, -1.9,   1.275,  0.019,  0.736,  -1.173};

}  // namespace identikal::structural_series
