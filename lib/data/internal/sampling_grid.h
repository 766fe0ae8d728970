// On what grid do time stamps lie?
#pragma once

namespace identikal {

/// Of rows with different times; 0: there are none. @param first, last  rising stamps
double median_step(const double* first, const double* last);

/// Are the stamps whole numbers of steps apart, and not all the same multiple of one? Then rows are
/// absent from a grid of that step; all two steps apart, they are a grid of their own.
bool on_some_of_grid(const double* first, const double* last, double step);

/// The longest step, from the shortest distance down to a twentieth of it, of which some rows are
/// absent; 0: none.
double grid_of(const double* first, const double* last);

}  // namespace identikal
