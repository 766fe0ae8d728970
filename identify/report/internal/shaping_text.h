// Is the noise coloured, which shaping filter explains it best, and what is it worth?
#pragma once

#include <string>

#include "identify/estimate/details.h"

namespace identikal {

std::string shaping_text(const Shaping& shaping);

}  // namespace identikal
