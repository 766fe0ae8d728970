#include "identify/estimate/recording_fit.h"

#include <fmt/format.h>

namespace identikal {

std::string in_words(const DrivenRange& range) {
  if (range.unit == "Hz") {
    return fmt::format("{} up to {:.2g} {}", range.quantity, range.high, range.unit);
  }
  return fmt::format("{} {:.3g} to {:.3g} {}", range.quantity, range.low, range.high, range.unit);
}

}  // namespace identikal
