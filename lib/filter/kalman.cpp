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

// Innovations alone, or the products of scores: what needs no states goes without allocation.
Likelihood run_tangents(const StateSpace& model, InitialState initial, const MatrixXd& y,
                        const MatrixXd& u, const std::vector<StateSpace>& derivatives,
                        FilterResult* store, MatrixXd* score_products) {
  const Presence presence = find_presence(y);
  const auto k = static_cast<Index>(derivatives.size());
  Likelihood out;
  out.gradient.setZero(k);
  out.information.setZero(k, k);
  TangentFilter filter;
  filter.prepare(model, derivatives);
  out.status = filter.run({y, u, presence, {}, nullptr, store, score_products}, initial, out);
  return finite(std::move(out));
}

}  // namespace

FilterResult kalman_filter(const StateSpace& model, InitialState initial,
                           const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                           Keep keep) {
  const std::vector<StateSpace> none;
  Recursion recursion(model, initial, y, u, none);  // checks the shapes
  if (keep == Keep::everything) return run(recursion, model.states(), y, keep);
  FilterResult out = empty_filter_result(model.states(), y.rows(), y.cols(), keep);
  const Likelihood likelihood = run_tangents(model, initial, y, u, none, &out, nullptr);
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

namespace {

Likelihood run_changing(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        bool with_derivatives, RecursionOptions& options) {
  StateSpace now;
  std::vector<StateSpace> derivatives;
  std::vector<StateSpace>* const wanted = with_derivatives ? &derivatives : nullptr;
  model(0, now, wanted);
  Recursion recursion(now, initial, y, u, derivatives);
  recursion.set_model_change([&](Index t) { model(t, now, wanted); }, derivatives);
  return recursion.run(options);
}

}  // namespace

Likelihood log_likelihood(const ModelAt& model, InitialState initial,
                          const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                          bool with_derivatives, bool motion_changes) {
  const MatrixXd outputs = y, inputs = u;
  const Presence presence = find_presence(outputs);
  Likelihood out;
  StateSpace first;
  std::vector<StateSpace> derivatives;
  model(0, first, with_derivatives ? &derivatives : nullptr);
  check_shapes(first, initial, derivatives);
  check_sizes(first, y, u);
  out.gradient.setZero(static_cast<Index>(derivatives.size()));
  out.information.setZero(out.gradient.size(), out.gradient.size());
  TangentFilter filter;
  out.status = filter.run_changing({model, with_derivatives, motion_changes},
                                   {outputs, inputs, presence, {}}, initial, out);
  return finite(std::move(out));
}

Likelihood watch_filtered_states(const ModelAt& model, InitialState initial,
                                 const Eigen::Ref<const MatrixXd>& y,
                                 const Eigen::Ref<const MatrixXd>& u, bool with_derivatives,
                                 const FilteredStateWatcher& see) {
  RecursionOptions options;
  options.watcher = &see;
  return run_changing(model, initial, y, u, with_derivatives, options);
}

MatrixXd score_products(const ModelAt& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u) {
  MatrixXd out;
  RecursionOptions options;
  options.score_products = &out;
  const Likelihood l = run_changing(model, initial, y, u, true, options);
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
  RecursionOptions options;
  options.watcher = &see;
  return Recursion(model, initial, y, u, derivatives).run(options);
}

MatrixXd score_products(const StateSpace& model, InitialState initial,
                        const Eigen::Ref<const MatrixXd>& y, const Eigen::Ref<const MatrixXd>& u,
                        const std::vector<StateSpace>& derivatives) {
  check_shapes(model, initial, derivatives);
  const auto k = static_cast<Index>(derivatives.size());
  MatrixXd out = MatrixXd::Zero(k, k);
  const Likelihood l = run_tangents(model, initial, y, u, derivatives, nullptr, &out);
  return l.status == FilterStatus::ok && out.allFinite() ? out : MatrixXd();
}

}  // namespace identikal
