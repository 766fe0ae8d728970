#include "lib/filter/revised_innovations.h"

#include "lib/filter/internal/recursion.h"
#include "lib/filter/internal/tangent_filter.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

struct RevisedInnovations::State {
  StateSpace model;
  InitialState initial;
  MatrixXd u;
  std::vector<StateSpace> none;
  TangentFilter filter;
  Checkpoints checkpoints;
  FilterResult result;
};

RevisedInnovations::RevisedInnovations(const StateSpace& model, InitialState initial,
                                       const MatrixXd& u)
    : state_(std::make_unique<State>()) {
  state_->model = model;
  state_->initial = initial;
  state_->u = u;
  check_shapes(state_->model, initial, state_->none);
}
RevisedInnovations::~RevisedInnovations() = default;
RevisedInnovations::RevisedInnovations(RevisedInnovations&&) noexcept = default;
RevisedInnovations& RevisedInnovations::operator=(RevisedInnovations&&) noexcept = default;

const FilterResult& RevisedInnovations::of(const MatrixXd& y, const std::vector<Index>& changed) {
  State& s = *state_;
  const Presence presence = find_presence(y);
  const std::vector<Segment> whole;
  const TangentRecording recording{y, s.u, presence, whole, nullptr, &s.result, nullptr};
  if (!changed.empty() && s.result.e.cols() == y.cols() && s.result.status == FilterStatus::ok) {
    s.result.status = s.filter.revise(recording, s.initial, changed, s.checkpoints);
    return s.result;
  }
  s.result = empty_filter_result(s.model.states(), y.rows(), y.cols(), Keep::innovations);
  s.filter.prepare(s.model, s.none);
  Likelihood likelihood;
  s.result.status = s.filter.run(recording, s.initial, likelihood, &s.checkpoints);
  s.result.log_likelihood = likelihood.value;
  return s.result;
}

}  // namespace identikal
