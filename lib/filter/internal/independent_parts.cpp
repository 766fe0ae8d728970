#include "lib/filter/internal/independent_parts.h"

#include <algorithm>
#include <numeric>

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

void IndependentParts::begin(const StateSpace& model) {
  states_ = static_cast<int>(model.states());
  outputs_ = static_cast<int>(model.outputs());
  parent_.resize(static_cast<std::size_t>(model.states() + model.outputs() + model.G.cols()));
  std::iota(parent_.begin(), parent_.end(), 0);
  joined_ = true;
}

int IndependentParts::root(int node) {
  const auto at = [this](int i) -> int& { return parent_[static_cast<std::size_t>(i)]; };
  while (at(node) != node) node = at(node) = at(at(node));
  return node;
}

void IndependentParts::join(int node, int other) {
  const int a = root(node), b = root(other);
  if (a == b) return;
  parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  joined_ = true;
}

void IndependentParts::join_by(const MatrixXd& entries, int first_row, int first_column) {
  for (Index j = 0; j < entries.cols(); ++j) {
    for (Index i = 0; i < entries.rows(); ++i) {
      if (entries(i, j) != 0.0) {
        join(first_row + static_cast<int>(i), first_column + static_cast<int>(j));
      }
    }
  }
}

bool IndependentParts::link(const StateSpace& model, InitialState initial,
                            const std::vector<StateSpace>& derivatives) {
  if (is_whole()) return false;
  joined_ = false;
  if (parent_.empty()) begin(model);
  const int noises = states_ + outputs_;
  const auto join_all = [&](const StateSpace& of) {
    join_by(of.A, 0, 0);
    join_by(of.C, states_, 0);
    join_by(of.G, 0, noises);
    join_by(of.Q, noises, noises);
    join_by(of.R, states_, states_);
    join_by(of.S, noises, states_);
    if (initial == InitialState::given) join_by(of.P0, 0, 0);
  };
  join_all(model);
  for (const StateSpace& d : derivatives) join_all(d);
  if (joined_) collect();
  return joined_;
}

// A filter has states and outputs: where a part lacks either, all stays together.
void IndependentParts::collect() {
  parts_.clear();
  std::vector<int> part_of(parent_.size(), -1);
  const int noises = states_ + outputs_;
  for (int node = 0; node < static_cast<int>(parent_.size()); ++node) {
    int& at = part_of[static_cast<std::size_t>(root(node))];
    if (at < 0) {
      if (node >= noises) continue;  // a noise that drives nothing
      at = static_cast<int>(parts_.size());
      parts_.emplace_back();
    }
    IndependentPart& part = parts_[static_cast<std::size_t>(at)];
    if (node < states_) {
      part.states.push_back(node);
    } else if (node < noises) {
      part.outputs.push_back(node - states_);
    } else {
      part.noises.push_back(node - noises);
    }
  }
  const auto lacks = [](const IndependentPart& p) { return p.states.empty() || p.outputs.empty(); };
  if (std::any_of(parts_.begin(), parts_.end(), lacks)) parts_.assign(1, {});
}

namespace {

void take(const MatrixXd& from, const std::vector<int>& rows, const std::vector<int>& columns,
          MatrixXd& out) {
  out.resize(static_cast<Index>(rows.size()), static_cast<Index>(columns.size()));
  for (std::size_t j = 0; j < columns.size(); ++j) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      out(static_cast<Index>(i), static_cast<Index>(j)) = from(rows[i], columns[j]);
    }
  }
}

void take_rows(const MatrixXd& from, const std::vector<int>& rows, MatrixXd& out) {
  out.resize(static_cast<Index>(rows.size()), from.cols());
  for (Index j = 0; j < out.cols(); ++j) {
    for (Index i = 0; i < out.rows(); ++i) {
      out(i, j) = from(rows[static_cast<std::size_t>(i)], j);
    }
  }
}

bool is_zero(const MatrixXd& M, const std::vector<int>& rows, const std::vector<int>& columns) {
  for (const int j : columns) {
    for (const int i : rows) {
      if (M(i, j) != 0.0) return false;
    }
  }
  return true;
}

bool rows_are_zero(const MatrixXd& M, const std::vector<int>& rows) {
  return std::all_of(rows.begin(), rows.end(), [&](int i) { return M.row(i).isZero(0.0); });
}

}  // namespace

void take_part(const IndependentPart& part, const StateSpace& of, StateSpace& out) {
  take(of.A, part.states, part.states, out.A);
  take(of.C, part.outputs, part.states, out.C);
  take_rows(of.B, part.states, out.B);
  take_rows(of.D, part.outputs, out.D);
  take(of.R, part.outputs, part.outputs, out.R);
  if (part.noises.empty()) {
    out.G.setZero(out.A.rows(), 1);
    out.Q.setZero(1, 1);
    out.S.setZero(1, out.R.rows());
  } else {
    take(of.G, part.states, part.noises, out.G);
    take(of.Q, part.noises, part.noises, out.Q);
    take(of.S, part.noises, part.outputs, out.S);
  }
  out.dt = of.dt;
  if (of.P0.size() == 0) return;
  take(of.P0, part.states, part.states, out.P0);
  out.x0.resize(out.A.rows());
  for (Index i = 0; i < out.x0.size(); ++i) {
    out.x0[i] = of.x0[part.states[static_cast<std::size_t>(i)]];
  }
}

bool is_zero_in(const IndependentPart& part, const StateSpace& d) {
  const auto starts = [&d](int i) { return d.x0[i] == 0.0; };
  return is_zero(d.A, part.states, part.states) && is_zero(d.C, part.outputs, part.states) &&
         is_zero(d.G, part.states, part.noises) && is_zero(d.Q, part.noises, part.noises) &&
         is_zero(d.R, part.outputs, part.outputs) && is_zero(d.S, part.noises, part.outputs) &&
         rows_are_zero(d.B, part.states) && rows_are_zero(d.D, part.outputs) &&
         (d.P0.size() == 0 || is_zero(d.P0, part.states, part.states)) &&
         (d.x0.size() == 0 || std::all_of(part.states.begin(), part.states.end(), starts));
}

}  // namespace identikal
