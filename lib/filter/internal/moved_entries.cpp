#include "lib/filter/internal/moved_entries.h"

#include <algorithm>

namespace identikal {

MovedEntries moved_entries(const std::vector<StateSpace>& derivatives,
                           const Eigen::MatrixXd StateSpace::*matrix, const std::vector<int>& rows,
                           std::size_t lanes) {
  MovedEntries out;
  out.row.assign(1, 0);
  const Eigen::Index columns = derivatives.empty() ? 0 : (derivatives.front().*matrix).cols();
  for (const int i : rows) {
    for (Eigen::Index j = 0; j < columns; ++j) {
      const auto moves = [&](const StateSpace& d) { return (d.*matrix)(i, j) != 0.0; };
      if (std::any_of(derivatives.begin(), derivatives.end(), moves)) {
        out.column.push_back(static_cast<int>(j));
      }
    }
    out.row.push_back(static_cast<int>(out.column.size()));
  }
  const std::size_t entries = out.column.size(), blocks = derivatives.size() / lanes + 1;
  // One at least, so that there is an address where no entry moves.
  out.by.assign(std::max<std::size_t>(1, entries) * lanes * blocks, 0.0);
  for (std::size_t l = 1; l <= derivatives.size(); ++l) {
    for (std::size_t r = 0; r < rows.size(); ++r) {
      for (int e = out.row[r]; e < out.row[r + 1]; ++e) {
        const std::size_t at = l / lanes * entries + static_cast<std::size_t>(e);
        out.by[at * lanes + l % lanes] = (derivatives[l - 1].*matrix)(rows[r], out.column[e]);
      }
    }
  }
  return out;
}

}  // namespace identikal
