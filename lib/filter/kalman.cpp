#include "lib/filter/kalman.h"

#include <cmath>
#include <utility>

#include "lib/filter/internal/recursion.h"
#include "lib/filter/internal/tangent_filter.h"

namespace identikal {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

FilterResult run(Recursion& recursion, Index n, const Eigen::Ref<const MatrixXd>& y, Keep keep) {
  FilterResult out = empty_filter_result(n, y.rows(), y.cols(), keep);
  RecursionOptions options;
  const Likelihood likelihood = recursion.run(options, &out);
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
  return out;
}

Likelihood finite(Likelihood out) {
  if (out.status == FilterStatus::ok && !(std::isfinite(out.value) && out.gradient.allFinite())) {
    out.status = FilterStatus::not_finite;
  }
  return out;
}

// What is wanted of the samples beside the likelihood, where not null.
struct Wanted {
  FilterResult* store = nullptr;
  MatrixXd* score_products = nullptr;
  const FilteredStateWatcher* watcher = nullptr;
};

Likelihood no_likelihood(const std::vector<StateSpace>& derivatives) {
  const auto k = static_cast<Index>(derivatives.size());
  Likelihood out;
  out.gradient.setZero(k);
  out.information.setZero(k, k);
  return out;
}

Likelihood run_tangents(const StateSpace& model, InitialState initial, const MatrixXd& y,
                        const MatrixXd& u, const std::vector<StateSpace>& derivatives,
                        const Wanted& wanted) {
  check_shapes(model, initial, derivatives);
  check_sizes(model, y, u);
  const Presence presence = find_presence(y);
  Likelihood out = no_likelihood(derivatives);
  TangentFilter filter;
  filter.prepare(model, derivatives);
  out.status =
      filter.run({y, u, presence, {}, nullptr, wanted.store, wanted.score_products, wanted.watcher},
                 initial, out);
  return finite(std::move(out));
}

Likelihood run_tangents(const ModelAt& model, InitialState initial, const MatrixXd& y,
                        const MatrixXd& u, bool with_derivatives, bool motion_changes,
                        const Wanted& wanted) {
  StateSpace first;
  std::vector<StateSpace> derivatives;
  model(0, first, with_derivatives ? &derivatives : nullptr);
  check_shapes(first, initial, derivatives);
  check_sizes(first, y, u);
  const Presence presence = find_presence(y);
  Likelihood out = no_likelihood(derivatives);
  if (wanted.score_products != nullptr) *wanted.score_products = out.information;
  TangentFilter filter;
  out.status = filter.run_changing(
      {model, with_derivatives, motion_changes},
      {y, u, presence, {}, nullptr, wanted.store, wanted.score_products, wanted.watcher}, initial,
      out);
  return finite(std::move(out));
}

}  // namespace

FilterResult kalman_filter(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  const std::vector<StateSpace> none;
  if (keep == Keep::everything) {
    Recursion recursion(model, initial, y, u, none);
    return run(recursion, model.states(), y, keep);
  }
  FilterResult out = empty_filter_result(model.states(), y.rows(), y.cols(), keep);
  const Likelihood likelihood = run_tangents(model, initial, y, u, none, {.store = &out});
  out.status = likelihood.status;
  out.log_likelihood = likelihood.value;
  return out;
}

FilterResult kalman_filter(const ModelAt& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  StateSpace now;
  const std::vector<StateSpace> none;
  model(0, now, nullptr);
  Recursion recursion(now, initial, y, u, none);
  recursion.set_model_change([&](Index t) { model(t, now, nullptr); }, none);
  return run(recursion, now.states(), y, keep);
}

Likelihood log_likelihood(const ModelAt& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          bool with_derivatives, bool motion_changes) {
  return run_tangents(model, initial, y, u, with_derivatives, motion_changes, {});
}

Likelihood watch_filtered_states(const ModelAt& model, InitialState initial,
                                 const Eigen::Ref<const MatrixXd>& y,
                                 const Eigen::Ref<const MatrixXd>& u, bool with_derivatives,
                                 const FilteredStateWatcher& see) {
  return run_tangents(model, initial, y, u, with_derivatives, true, {.watcher = &see});
}

MatrixXd score_products(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u) {
  MatrixXd out;
  const Likelihood l = run_tangents(model, initial, y, u, true, true, {.score_products = &out});
  return l.status == FilterStatus::ok ? out : MatrixXd();
}

Likelihood log_likelihood(const StateSpace& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          const std::vector<StateSpace>& derivatives) {
  RecursionOptions options;
  return Recursion(model, initial, y, u, derivatives).run(options);
}

Likelihood watch_filtered_states(const StateSpace& model, InitialState initial,
                                 const Eigen::Ref<const MatrixXd>& y,
                                 const Eigen::Ref<const MatrixXd>& u,
                                 const std::vector<StateSpace>& derivatives,
                                 const FilteredStateWatcher& see) {
  return run_tangents(model, initial, y, u, derivatives, {.watcher = &see});
}

MatrixXd score_products(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        const std::vector<StateSpace>& derivatives) {
  const auto k = static_cast<Index>(derivatives.size());
  MatrixXd out = MatrixXd::Zero(k, k);
  const Likelihood l = run_tangents(model, initial, y, u, derivatives, {.score_products = &out});
  return l.status == FilterStatus::ok && out.allFinite() ? out : MatrixXd();
}

}  // namespace identikal
