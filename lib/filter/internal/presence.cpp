#include "lib/filter/internal/presence.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

// Which channels a sample has, by channel.
using Channels = std::vector<std::uint64_t>;

std::uint64_t few_present(const double* y, Index channels) {
  std::uint64_t out = 0;
  for (Index i = 0; i < channels; ++i) out |= std::uint64_t{!std::isnan(y[i])} << i;
  return out;
}

Channels many_present(const double* y, Index channels) {
  Channels out;
  for (Index i = 0; i < channels; i += 64) {
    out.push_back(few_present(y + i, std::min<Index>(64, channels - i)));
  }
  return out;
}

// @param present  of a sample's outputs and their number, what can be compared
template <typename Present>
Presence presence_by(const MatrixXd& y, const Present& present) {
  Presence out;
  std::vector<decltype(present(y.data(), Index{}))> known;  // by pattern
  for (Index t = 0; t < y.cols(); ++t) {
    const auto here = present(y.col(t).data(), y.rows());
    if (t > 0 && here == known[out.parts.back().pattern]) {
      out.parts.back().end = t + 1;
      continue;
    }
    const auto at = std::find(known.begin(), known.end(), here);
    out.parts.push_back({t, t + 1, static_cast<std::size_t>(at - known.begin())});
    if (at != known.end()) continue;
    known.push_back(here);
    out.channels.emplace_back();
    for (Index i = 0; i < y.rows(); ++i) {
      if (!std::isnan(y(i, t))) out.channels.back().push_back(static_cast<int>(i));
    }
  }
  return out;
}

}  // namespace

Presence find_presence(const MatrixXd& y) {
  return y.rows() <= 64 ? presence_by(y, few_present) : presence_by(y, many_present);
}

}  // namespace identikal
