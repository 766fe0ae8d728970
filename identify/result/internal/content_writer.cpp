#include "identify/result/internal/content_writer.h"

#include <cmath>

#include <fmt/format.h>

namespace identikal {

void ContentWriter::add(double value) {
  if (std::isnan(value)) {
    out_ += "nan;";
  } else {
    out_ += fmt::format("{};", value == 0.0 ? 0.0 : value);  // the shortest that tells it apart
  }
}

}  // namespace identikal
