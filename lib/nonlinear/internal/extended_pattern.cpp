#include "lib/nonlinear/internal/extended_pattern.h"

#include <algorithm>

#include "lib/internal/lane_count.h"

namespace identikal {

using Eigen::Index;
using Pattern = Eigen::Array<bool, Eigen::Dynamic, Eigen::Dynamic>;

LanePlaces::LanePlaces(const NonlinearModel& model, const std::vector<FilterDirection>& directions)
    : of_column(static_cast<std::size_t>(model.columns)) {
  const auto k = static_cast<int>(directions.size());
  lanes = static_cast<std::size_t>(simd::lane_count(k));
  blocks = (1 + directions.size() + lanes - 1) / lanes;
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (directions[i].parameter < 0) continue;
    const Index column = model.column[static_cast<std::size_t>(directions[i].parameter)];
    if (column >= 0) of_column[static_cast<std::size_t>(column)].push_back(1 + i);
  }
}

FormulaLanes::FormulaLanes(const FormulaSlopes& slopes, Index rows, Index states, Derivatives order,
                           const LanePlaces& places)
    : rows_(static_cast<std::size_t>(rows)), lanes_(places.lanes) {
  const auto lanes_of = [&](Index by, std::size_t numbers, std::size_t i) {
    std::vector<std::size_t> out;
    for (const std::size_t at : places.of_column[static_cast<std::size_t>(by - states)]) {
      out.push_back(places(numbers, i, at));
    }
    return out;
  };
  for (std::size_t e = 0; e < slopes.wrt_z.size(); ++e) {
    const auto& [i, j] = slopes.wrt_z[e];
    while (static_cast<Index>(row_.size()) <= i) row_.push_back(static_cast<int>(column_.size()));
    if (j < states) {
      slope_from_.push_back(e);
      column_.push_back(static_cast<int>(j));
    } else if (std::vector<std::size_t> to = lanes_of(j, rows_, static_cast<std::size_t>(i));
               !to.empty()) {
      values_by_p_.push_back({e, std::move(to)});
    }
  }
  row_.resize(rows_ + 1, static_cast<int>(column_.size()));
  curved_of_.assign(column_.size(), -1);
  second_row_ = {0};
  if (order == Derivatives::second) {
    const std::size_t curved = slopes.curved.size();
    std::size_t s = 0;
    for (std::size_t c = 0; c < curved; ++c) {
      const auto& [i, j] = slopes.curved[c];
      int e = row_[static_cast<std::size_t>(i)];
      while (column_[static_cast<std::size_t>(e)] != static_cast<int>(j)) ++e;
      entry_.push_back(e);
      curved_of_[static_cast<std::size_t>(e)] = static_cast<int>(c);
      for (; s < slopes.second.size() && slopes.second[s].row == i && slopes.second[s].column == j;
           ++s) {
        const Index by = slopes.second[s].by;
        if (by < states) {
          second_from_.push_back(s);
          second_by_.push_back(static_cast<int>(by));
        } else if (std::vector<std::size_t> to = lanes_of(by, curved, c); !to.empty()) {
          slopes_by_p_.push_back({s, std::move(to)});
        }
      }
      second_row_.push_back(static_cast<int>(second_by_.size()));
    }
  }
  slope_.assign(column_.size(), 0.0);
  second_.assign(second_by_.size(), 0.0);
  value_.assign(places.blocks * rows_ * places.lanes, 0.0);
  by_p_.assign(places.blocks * entry_.size() * places.lanes, 0.0);
  theta_ = by_p_;
}

simd::LaneSlopes FormulaLanes::slopes() const {
  return {static_cast<int>(rows_),
          static_cast<int>(column_.size()),
          static_cast<int>(entry_.size()),
          row_.data(),
          column_.data(),
          entry_.data(),
          curved_of_.data(),
          second_row_.data(),
          second_by_.data()};
}

simd::LanePoint FormulaLanes::point() {
  return {slope_.data(), second_.data(), value_.data(), by_p_.data(), theta_.data()};
}

void FormulaLanes::take(const SlopesAt& at) {
  for (std::size_t i = 0; i < rows_; ++i) value_[i * lanes_] = at.values[i];
  for (std::size_t e = 0; e < slope_.size(); ++e) slope_[e] = at.wrt_z[slope_from_[e]];
  for (const ByParameter& each : values_by_p_) {
    for (const std::size_t to : each.to) value_[to] = at.wrt_z[each.from];
  }
  if (at.second.empty()) return;
  for (std::size_t s = 0; s < second_.size(); ++s) second_[s] = at.second[second_from_[s]];
  for (const ByParameter& each : slopes_by_p_) {
    for (const std::size_t to : each.to) by_p_[to] = at.second[each.from];
  }
}

namespace {

// What rates that are `by` times a matrix make of one: entries, and who of them moves.
Pattern product_of(const Pattern& by, const Pattern& of) {
  Pattern out = Pattern::Constant(by.rows(), of.cols(), false);
  for (Index l = 0; l < by.cols(); ++l) {
    for (Index j = 0; j < of.cols(); ++j) {
      if (of(l, j)) out.col(j) = out.col(j) || by.col(l);
    }
  }
  return out;
}

template <class Grow>
void grow_until_all_are_there(Pattern& pattern, const Grow& grow) {
  for (Index before = -1; before != pattern.count();) {
    before = pattern.count();
    pattern = pattern || grow();
  }
}

// Phi and W where they may differ from zero, and the entries of Phi that move.
struct MotionEntries {
  Pattern Phi, W, moves;
};

MotionEntries entries_of(const Pattern& F, const Pattern& curved, const Pattern& noisy,
                         TransitionSource source, bool density) {
  MotionEntries out{F, noisy, curved};
  if (source == TransitionSource::map) return out;
  if (source == TransitionSource::any) {
    out.Phi.setConstant(true);
    out.moves.setConstant(true);
    if (density) out.W.setConstant(true);
    return out;
  }
  out.Phi.setConstant(false);
  out.Phi.matrix().diagonal().setConstant(true);
  grow_until_all_are_there(out.Phi, [&] { return product_of(F, out.Phi); });
  out.moves = product_of(curved, out.Phi);
  grow_until_all_are_there(out.moves, [&] { return product_of(F, out.moves); });
  if (!density) return out;
  grow_until_all_are_there(out.W, [&]() -> Pattern {
    const Pattern half = product_of(F, out.W);
    return half || half.transpose();
  });
  return out;
}

}  // namespace

void TermList::add(int factor_at, int in_at) {
  factor.push_back(factor_at);
  in.push_back(in_at);
}

MotionPattern motion_pattern(const FormulaSlopes& slopes, Derivatives order, Index n,
                             TransitionSource source,
                             const Eigen::Ref<const Eigen::MatrixXd>& noisy, bool density) {
  const bool derived = order == Derivatives::second;
  Eigen::ArrayXXi at_F = Eigen::ArrayXXi::Constant(n, n, -1), at_curved = at_F, at_Phi = at_F,
                  at_W = at_F;
  int count = 0;
  for (const auto& [i, j] : slopes.wrt_x) at_F(i, j) = count++;
  count = 0;
  for (const auto& [i, j] : slopes.curved) at_curved(i, j) = derived ? count++ : -1;
  const auto [Phi, W, moves] =
      entries_of(at_F >= 0, at_curved >= 0, noisy.array() != 0.0, source, density);
  MotionPattern out;
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      if (!Phi(i, j)) continue;
      at_Phi(i, j) = static_cast<int>(out.Phi_column.size());
      out.Phi_column.push_back(static_cast<int>(j));
      out.Phi_moves.push_back(derived && moves(i, j) ? 1 : 0);
    }
    out.Phi_row.push_back(static_cast<int>(out.Phi_column.size()));
    for (Index j = 0; j <= i; ++j) {
      if (W(i, j)) at_W(i, j) = at_W(j, i) = out.W_entries++;
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) out.W_index.push_back(at_W(i, j));
  }
  const bool follows = source == TransitionSource::equations;
  const auto add_products = [&](const Eigen::ArrayXXi& by, Index i, const Eigen::ArrayXXi& of,
                                Index j, TermList& to) {
    for (Index l = 0; l < n; ++l) {
      if (by(i, l) >= 0 && of(l, j) >= 0) to.add(by(i, l), of(l, j));
    }
  };
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      if (!Phi(i, j)) continue;
      if (follows) add_products(at_F, i, at_Phi, j, out.Phi_terms);
      if (follows) add_products(at_curved, i, at_Phi, j, out.Phi_moved);
      out.Phi_terms.end_entry();
      out.Phi_moved.end_entry();
    }
  }
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j <= i; ++j) {
      if (!W(i, j)) continue;
      if (follows && density) {
        for (const auto& [to, from] : {std::pair{i, j}, std::pair{j, i}}) {
          add_products(at_F, to, at_W, from, out.W_terms);
          add_products(at_curved, to, at_W, from, out.W_moved);
        }
      }
      out.W_terms.end_entry();
      out.W_moved.end_entry();
    }
  }
  return out;
}

}  // namespace identikal
