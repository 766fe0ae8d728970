// Which numbers of an extended filter may differ from zero? Most slopes of most models are zero, and
// so is most of what the motion makes of them. Internal to lib: extended_filter.h goes through them.
#pragma once

#include <cstddef>
#include <vector>

#include "lib/model/nonlinear_model.h"
#include "lib/nonlinear/filter.h"
#include "lib/nonlinear/internal/extended_kernel.h"

namespace identikal {

/// Where the directions of a filter lie: direction i in lane 1 + i, counted over the blocks.
struct LanePlaces {
  std::size_t lanes = 4, blocks = 1;
  std::vector<std::vector<std::size_t>> of_column;  ///< per column of p: lanes of directions

  LanePlaces(const NonlinearModel& model, const std::vector<FilterDirection>& directions);
  /// Lane `at` of number i of as many in a block.
  std::size_t operator()(std::size_t numbers, std::size_t i, std::size_t at) const {
    return ((at / lanes) * numbers + i) * lanes + at % lanes;
  }
};

/// f or h at points: what SlopesAt gives, where the kernel wants it.
class FormulaLanes {
 public:
  FormulaLanes(const FormulaSlopes& slopes, Eigen::Index rows, Eigen::Index states,
               Derivatives order, const LanePlaces& places);
  simd::LaneSlopes slopes() const;
  simd::LanePoint point();
  void take(const SlopesAt& at);

 private:
  // A derivative by a parameter: which, of which number, and in which lanes.
  struct ByParameter {
    std::size_t from;
    std::vector<std::size_t> to;
  };
  std::size_t rows_, lanes_;
  std::vector<int> row_, column_, entry_, curved_of_, second_row_, second_by_;
  std::vector<std::size_t> slope_from_, second_from_;
  std::vector<ByParameter> values_by_p_, slopes_by_p_;
  std::vector<double> slope_, second_, value_, by_p_, theta_;
};

/// Sums of products that make up the rates of a matrix.
struct TermList {
  std::vector<int> row{0}, factor, in;
  void add(int factor_at, int in_at);
  void end_entry() { row.push_back(static_cast<int>(factor.size())); }
  simd::LaneTerms terms() const { return {row.data(), factor.data(), in.data()}; }
};

/// Where Phi and W come from.
enum class TransitionSource {
  equations,  ///< differential equations
  map,        ///< Phi is df/dx, W is Q
  any,        ///< nothing is known but that W is symmetric
};
/// Phi = dx(k+1)/dx(k) and W, the covariance that the noise adds between two samples.
struct MotionPattern {
  std::vector<int> Phi_row{0}, Phi_column,
      W_index;  ///< W_index: n x n, of the lower triangle, or -1
  std::vector<char> Phi_moves;
  int W_entries = 0;
  TermList Phi_terms, Phi_moved, W_terms, W_moved;
};
/// @param slopes   of f
/// @param noisy    n x n, symmetric: entries of Q, or of its derivatives, that are not zero
/// @param density  whether W follows from Q along the motion; it is Q otherwise
MotionPattern motion_pattern(const FormulaSlopes& slopes, Derivatives order, Eigen::Index states,
                             TransitionSource source,
                             const Eigen::Ref<const Eigen::MatrixXd>& noisy, bool density);

}  // namespace identikal
