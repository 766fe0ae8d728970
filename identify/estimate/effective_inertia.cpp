#include "identify/estimate/effective_inertia.h"

namespace identikal {

bool is_effective_inertia(const EstimatedParameter& p) {
  // Where the structure is allowed for all of the error is its part.
  return p.name == "Iz" && !p.fixed && p.se_structure < p.se &&
         2.0 * p.se_structure * p.se_structure > p.se * p.se;
}

}  // namespace identikal
