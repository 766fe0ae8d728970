// Does a model fall apart into smaller ones that have nothing to do with each other, as the axes of a
// gyroscope or a track's x and y do? The likelihood is the product of theirs, and filtering them one by
// one costs a fraction of filtering them together. Internal to the filter.
#pragma once

#include <vector>

#include "lib/model/linear_model.h"
#include "lib/model/state_space.h"

namespace identikal {

/// States, outputs and noises of a larger model that nothing links to its others. Parts share
/// parameters, which are known of a model, and inputs, which are measured.
struct IndependentPart {
  std::vector<int> states, outputs, noises;
};

class IndependentParts {
 public:
  /// Links what an entry of A, C, Q, R, S, G, or of P0 where the start is given, couples in the model
  /// or in a derivative. What has been linked once remains so, lest parts come and go with a search.
  /// @return have parts grown together?
  bool link(const StateSpace& model, InitialState initial,
            const std::vector<StateSpace>& derivatives);

  /// Is there nothing left to link?
  bool is_whole() const { return parts_.size() == 1; }
  const std::vector<IndependentPart>& parts() const { return parts_; }

 private:
  void begin(const StateSpace& model);
  int root(int node);
  void join(int node, int other);
  void join_by(const Eigen::MatrixXd& entries, int first_row, int first_column);
  void collect();

  int states_ = 0, outputs_ = 0;
  std::vector<int> parent_;  // of states, then outputs, then noises
  bool joined_ = false;
  std::vector<IndependentPart> parts_;
};

/// The matrices of a part; a derivative likewise. A part without noise gets one that is zero.
void take_part(const IndependentPart& part, const StateSpace& of, StateSpace& out);

/// Is everything zero that take_part() takes?
bool is_zero_in(const IndependentPart& part, const StateSpace& derivative);

}  // namespace identikal
