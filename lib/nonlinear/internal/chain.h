// How does what follows from a state and parameters move with the directions of a filter? Internal to
// lib: lib/nonlinear/filter.h is what others use.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "lib/internal/direction_stack.h"
#include "lib/model/nonlinear_model.h"
#include "lib/nonlinear/filter.h"

namespace identikal {

/// Derivatives by the directions of what has derivatives `by` [x; p], when x has dx.
class Chain {
 public:
  Chain(const NonlinearModel& model, const std::vector<FilterDirection>& directions)
      : nx_(model.states) {
    for (std::size_t i = 0; i < directions.size(); ++i) {
      if (directions[i].parameter < 0) continue;
      const Eigen::Index column = model.column[directions[i].parameter];
      if (column >= 0) moved_.push_back({static_cast<Eigen::Index>(i), column});
    }
  }
  /// out += ...
  template <class ByX, class ByP>
  void add(const ByX& wrt_x, const ByP& wrt_p, const Stack& dx, Stack& out, Eigen::Index first = 0,
           double sign = 1.0) const {
    for (Eigen::Index r = 0; r < wrt_x.rows(); ++r) {
      for (Eigen::Index l = 0; l < nx_; ++l) add_row(out, first + r, sign * wrt_x(r, l), dx, l);
      for (const Moved& each : moved_) {
        out(first + r, each.direction) += sign * wrt_p(r, each.column);
      }
    }
  }
  void set(const Eigen::MatrixXd& by, const Stack& dx, Stack& out) const {
    out.setZero();
    add(by.leftCols(nx_), by.rightCols(by.cols() - nx_), dx, out);
  }

 private:
  struct Moved {
    Eigen::Index direction, column;
  };
  Eigen::Index nx_;
  std::vector<Moved> moved_;
};

}  // namespace identikal
