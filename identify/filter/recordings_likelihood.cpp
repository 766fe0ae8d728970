#include "identify/filter/recordings_likelihood.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "identify/filter/leading_samples.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_check.h"
#include "identify/model/own_parameters.h"
#include "identify/model/parameter_prior.h"
#include "lib/base/constants.h"
#include "lib/model/partly_diffuse.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Is M positive semidefinite, to rounding?
bool semidefinite(const MatrixXd& M) {
  if (M.size() == 0) return true;
  if (!M.allFinite()) return false;
  if (Eigen::LLT<MatrixXd>(M).info() == Eigen::Success) return true;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(M, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().minCoeff() >= -1e-12 * eigen.eigenvalues().cwiseAbs().maxCoeff();
}

bool admissible(const StateSpace& model) {
  if (model.S.isZero(0.0)) return semidefinite(model.Q) && semidefinite(model.R);
  return semidefinite(joint_covariance(model));
}

const std::vector<Dataset> kNoRecordings;

}  // namespace

struct RecordingsLikelihood::Part {
  Model model;
  std::vector<Dataset> recording;
  std::vector<int> sources;           // of the model's parameters, in the joint model
  std::vector<Eigen::Index> entries;  // of the joint model, one for each free one of this
  RecordingsLikelihood likelihood;

  Part(const Model& joint, const Dataset& of, EvaluationMethod method)
      : model(model_in(joint, of)),
        recording{of},
        sources(sources_in(joint.parameters, of)),
        entries(joint_entries(joint, of)),
        likelihood(model, alone(recording), method) {}

  // Its own values stand in the model now.
  static const std::vector<Dataset>& alone(std::vector<Dataset>& recording) {
    recording.front().own.clear();
    return recording;
  }

  ParameterSet values(const ParameterSet& joint) const {
    ParameterSet out = model.parameters;
    for (std::size_t i = 0; i < out.size(); ++i) {
      out[i].value = joint[static_cast<std::size_t>(sources[i])].value;
    }
    return out;
  }
};

struct RecordingsLikelihood::Share {
  std::vector<Dataset> recordings;
  Eigen::Index entries;
  std::optional<RecordingsLikelihood> likelihood;  // none: there are more processes than recordings

  Share(const Model& model, const std::vector<Dataset>& all, EvaluationMethod method,
        const LikelihoodTeam& team)
      : entries(free_entries(model.parameters).size()) {
    for (const std::size_t i : share_of(team, all)) recordings.push_back(all[i]);
    if (!recordings.empty()) likelihood.emplace(model, recordings, method);
  }

  Likelihood at(const ParameterSet& values, bool with_gradient) {
    Likelihood out;
    const Eigen::Index k = with_gradient ? entries : 0;
    out.gradient.setZero(k);
    out.information.setZero(k, k);
    if (!likelihood) return out;
    const Likelihood* const own = likelihood->evaluate(values, with_gradient);
    if (own != nullptr) return {own->status, own->value, own->gradient, own->information};
    out.status = FilterStatus::indefinite;
    return out;
  }
};

RecordingsLikelihood::~RecordingsLikelihood() = default;

RecordingsLikelihood::RecordingsLikelihood(const Model& model,
                                           const std::vector<RecordingDigest>& digests)
    : RecordingsLikelihood(model, kNoRecordings) {
  digests_ = &digests;
  for (const RecordingDigest& digest : digests) engine_.add_digest(digest);
}

RecordingsLikelihood::RecordingsLikelihood(const Model& model,
                                           const std::vector<Dataset>& recordings,
                                           EvaluationMethod method)
    : model_(model), method_(method), recordings_(recordings) {
  for (const Parameter& p : model.parameters) {
    curved_ = curved_ || (!p.fixed && p.domain == Domain::positive_definite);
  }
  part_recordings();
  if (!parts_.empty()) return;
  for (const Dataset& data : recordings) log_jacobian_ += log_jacobian(data).sum();
  if (changes(model)) {
    changing_.emplace(model, recordings);
    return;
  }
  if (is_formula_model(model)) {
    nonlinear_.emplace(model, recordings);
    return;
  }
  const LinearModel& linear = as_linear(model);
  constant_derivatives_ = !linear.continuous && is_linear_in_parameters(linear, model.parameters);
  derivatives_ = model_derivatives(linear, model.parameters);
  for (const Dataset& data : recordings) inputs_.push_back(model_inputs(linear, data.u));
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    engine_.add_recording(recordings[i].y, inputs_[i]);
  }
}

void RecordingsLikelihood::part_recordings() {
  const bool differ = std::any_of(recordings_.begin(), recordings_.end(),
                                  [](const Dataset& data) { return !data.own.empty(); });
  if (!differ) return;
  for (const Dataset& data : recordings_) {
    parts_.push_back(std::make_unique<Part>(model_, data, method_));
  }
}

const Likelihood& RecordingsLikelihood::evaluate_parts(const ParameterSet& at, bool with_gradient) {
  const Eigen::Index k = with_gradient ? free_entries(at).size() : 0;
  of_parts_.status = FilterStatus::ok;
  of_parts_.value = 0.0;
  of_parts_.gradient.setZero(k);
  of_parts_.information.setZero(k, k);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = *parts_[i];
    const Likelihood* one = part.likelihood.evaluate(part.values(at), with_gradient);
    if (one == nullptr) {
      of_parts_.status = FilterStatus::indefinite;
      return of_parts_;
    }
    of_parts_.value += one->value;
    if (!with_gradient) continue;
    for (std::size_t a = 0; a < part.entries.size(); ++a) {
      const auto from = static_cast<Eigen::Index>(a);
      of_parts_.gradient[part.entries[a]] += one->gradient[from];
      for (std::size_t b = 0; b < part.entries.size(); ++b) {
        of_parts_.information(part.entries[a], part.entries[b]) +=
            one->information(from, static_cast<Eigen::Index>(b));
      }
    }
  }
  return of_parts_;
}

void RecordingsLikelihood::share_with(const LikelihoodTeam& team) {
  team_ = &team;
  share_ = std::make_unique<Share>(model_, recordings_, method_, team);
}

const Likelihood& RecordingsLikelihood::evaluate_by_team(const ParameterSet& at,
                                                         bool with_gradient) {
  team_->tell(bytes_of(request_at(TeamRequest::Kind::evaluate, at, with_gradient)));
  of_team_ = share_->at(at, with_gradient);
  for (const std::string& answer : team_->answers()) add_answer(answer, of_team_);
  return of_team_;
}

void work_for_team(const Model& model, const std::vector<Dataset>& recordings,
                   EvaluationMethod method, const LikelihoodTeam& team) {
  std::string failure;
  std::unique_ptr<RecordingsLikelihood::Share> share;
  while (const std::optional<std::string> bytes = team.hear()) {
    try {
      if (!share) {
        share = std::make_unique<RecordingsLikelihood::Share>(model, recordings, method, team);
      }
      const TeamRequest request = request_in(*bytes);
      const ParameterSet at = parameters_in(request, model.parameters);
      Likelihood out;
      if (request.kind == TeamRequest::Kind::evaluate) {
        out = share->at(at, request.with_gradient);
      } else if (share->likelihood && request.kind == TeamRequest::Kind::refine) {
        out.value = share->likelihood->refine(at) ? 1.0 : 0.0;
      } else if (share->likelihood) {
        share->likelihood->condition_on_beginning();
      }
      team.answer(bytes_of(out));
    } catch (const std::exception& error) {
      team.answer(bytes_of_failure(error.what()));
    }
  }
}

std::unique_ptr<RecordingsLikelihood> RecordingsLikelihood::another() const {
  if (digests_ != nullptr) {
    auto out = std::make_unique<RecordingsLikelihood>(model_, *digests_);
    out->prior_box_ = prior_box_;
    out->multipliers_ = multipliers_;
    out->roughness_weights_ = roughness_weights_;
    return out;
  }
  auto out = std::make_unique<RecordingsLikelihood>(model_, recordings_, method_);
  if (nonlinear_) out->nonlinear_.emplace(*nonlinear_);  // as fine as this one
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    if (const auto& fine = parts_[i]->likelihood.nonlinear_) {
      out->parts_[i]->likelihood.nonlinear_.emplace(*fine);
    }
    if (!parts_[i]->likelihood.first_outputs_.empty()) {
      out->parts_[i]->likelihood.condition_on_beginning();
    }
  }
  if (!first_outputs_.empty()) out->condition_on_beginning();
  out->prior_box_ = prior_box_;
  out->multipliers_ = multipliers_;
  out->roughness_weights_ = roughness_weights_;
  return out;
}

bool RecordingsLikelihood::set_system(const ParameterSet& at, bool with_derivatives) {
  if (changing_) return true;  // the filter judges them, sample by sample
  instantiate(noise_model(model_), at, system_);
  if (!admissible(system_)) return false;
  if (with_derivatives && !constant_derivatives_) {
    derivatives_ = model_derivatives(noise_model(model_), at);
  }
  return true;
}

void RecordingsLikelihood::condition_on_beginning() {
  last_ = nullptr;
  if (team_ != nullptr) {
    team_->tell(bytes_of(request_at(TeamRequest::Kind::condition_on_beginning, model_.parameters)));
    if (share_->likelihood) share_->likelihood->condition_on_beginning();
    for (const std::string& answer : team_->answers()) add_answer(answer, of_team_);
  }
  for (const auto& part : parts_) part->likelihood.condition_on_beginning();
  if (!parts_.empty() || !is_stationary() || !first_outputs_.empty()) return;
  const LinearModel& linear = as_linear(model_);
  if (diffuse_states_move_as_known(linear, model_.parameters)) return;
  const LeadingSamples leading = leading_samples(model_, model_.parameters, recordings_);
  if (leading.log_likelihood.size() == 0) return;
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    first_outputs_.push_back(recordings_[i].y.leftCols(leading.diffuse));
    first_inputs_.push_back(inputs_[i].leftCols(leading.diffuse));
  }
  for (std::size_t i = 0; i < recordings_.size(); ++i) {
    beginning_.add_recording(first_outputs_[i], first_inputs_[i]);
  }
}

double RecordingsLikelihood::log_likelihood_of_beginning(const ParameterSet& at) {
  last_ = nullptr;
  double of_parts = 0.0;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    of_parts += parts_[i]->likelihood.log_likelihood_of_beginning(parts_[i]->values(at));
  }
  if (!parts_.empty()) return of_parts;
  if (first_outputs_.empty()) return 0.0;
  if (!set_system(at, false)) return kNone;
  const Likelihood& first = beginning_.evaluate(system_, as_linear(model_).initial);
  return first.status == FilterStatus::ok ? first.value : kNone;
}

const Likelihood& RecordingsLikelihood::behind_beginning(const Likelihood& all,
                                                         bool with_gradient) {
  const Likelihood& first =
      beginning_.evaluate(system_, as_linear(model_).initial, with_gradient ? derivatives_ : none_);
  conditional_ = all;
  conditional_.status = all.status == FilterStatus::ok ? first.status : all.status;
  if (conditional_.status != FilterStatus::ok) return conditional_;
  conditional_.value -= first.value;
  if (!with_gradient) return conditional_;
  conditional_.gradient -= first.gradient;
  conditional_.information -= first.information;
  return conditional_;
}

void RecordingsLikelihood::weigh_by_priors() {
  if (!names_with_priors(model_.parameters).empty()) prior_box_ = prior_box(model_);
}

const Likelihood& RecordingsLikelihood::with_priors(const Likelihood& of_data,
                                                    const ParameterSet& at, bool with_gradient) {
  const PriorTerms prior = stated_priors_at(at);
  posterior_ = of_data;
  posterior_.value += prior.value;
  if (!std::isfinite(prior.value)) posterior_.status = FilterStatus::indefinite;
  if (posterior_.status != FilterStatus::ok || !with_gradient) return posterior_;
  posterior_.gradient += prior.gradient;
  posterior_.information.diagonal() += prior.information;
  return posterior_;
}

namespace {

VectorXd values_of(const ParameterSet& parameters) {
  VectorXd out(static_cast<Eigen::Index>(parameters.size()));
  for (Eigen::Index i = 0; i < out.size(); ++i) out[i] = parameters[i].value(0, 0);
  return out;
}

// By the free entries. @param by_parameters  a column each
MatrixXd by_entries(const MatrixXd& by_parameters, const ParameterSet& parameters) {
  const std::vector<EntryDerivative> entries = entry_derivatives(parameters);
  MatrixXd out = MatrixXd::Zero(by_parameters.rows(), static_cast<Eigen::Index>(entries.size()));
  for (std::size_t e = 0; e < entries.size(); ++e) {
    if (parameters[entries[e].parameter].domain != Domain::scalar) continue;
    out.col(static_cast<Eigen::Index>(e)) = by_parameters.col(entries[e].parameter);
  }
  return out;
}

}  // namespace

const Likelihood& RecordingsLikelihood::with_constraints(const Likelihood& of_data,
                                                         const ParameterSet& at,
                                                         bool with_gradient) {
  ConstraintValues values = constraint_values(model_.constraints, values_of(at));
  values.slopes = by_entries(values.slopes, at);
  const ConstraintResiduals rows = constraint_residuals(model_.constraints, multipliers_, values);
  constrained_ = of_data;
  constrained_.value += rows.constant - 0.5 * rows.r.squaredNorm();
  if (!std::isfinite(constrained_.value)) constrained_.status = FilterStatus::indefinite;
  if (!with_gradient) return constrained_;
  constrained_.gradient -= rows.slopes.transpose() * rows.r;
  constrained_.information += rows.slopes.transpose() * rows.slopes;
  return constrained_;
}

bool RecordingsLikelihood::tighten_constraints(const ParameterSet& at) {
  if (model_.constraints.empty()) return false;
  Multipliers held;
  std::swap(held, multipliers_);
  const Likelihood* of_data = evaluate(at, true);
  std::swap(held, multipliers_);
  if (of_data == nullptr) return false;
  const VectorXd p = values_of(at);
  const ConstraintValues values = constraint_values(model_.constraints, p);
  const MatrixXd slopes = by_entries(values.slopes, at);
  const VectorXd tolerances = constraint_tolerances(values, p, slopes, of_data->information);
  const bool first = multipliers_.w.size() == 0;
  const bool open =
      !first && update_multipliers(model_.constraints, values.g, tolerances, multipliers_);
  multipliers_.weigh(slopes, of_data->information);
  return first || open;
}

namespace {

VectorXd values_at_knots(const SplineCurve& curve, const ParameterSet& at) {
  return values_of(at)(curve.values);
}

double roughness_density(const std::vector<SplineCurve>& curves, const VectorXd& weights,
                         const ParameterSet& at) {
  double out = 0.0;
  for (Eigen::Index c = 0; c < weights.size(); ++c) {
    const SplineCurve& curve = curves[static_cast<std::size_t>(c)];
    const VectorXd f = values_at_knots(curve, at);
    if (weights[c] > 0.0) out -= 0.5 * weights[c] * f.dot(spline_roughness(curve.knots) * f);
  }
  return out;
}

}  // namespace

const Likelihood& RecordingsLikelihood::with_roughness(const Likelihood& of_data,
                                                       const ParameterSet& at, bool with_gradient) {
  smoothed_ = of_data;
  smoothed_.value += roughness_density(model_.curves, roughness_weights_, at);
  if (!with_gradient) return smoothed_;
  for (Eigen::Index c = 0; c < roughness_weights_.size(); ++c) {
    const SplineCurve& curve = model_.curves[static_cast<std::size_t>(c)];
    const auto knots = static_cast<Eigen::Index>(curve.knots.size());
    MatrixXd values = MatrixXd::Zero(knots, static_cast<Eigen::Index>(at.size()));
    for (Eigen::Index k = 0; k < knots; ++k)
      values(k, curve.values[static_cast<std::size_t>(k)]) = 1.0;
    const MatrixXd by = by_entries(values, at);
    const MatrixXd R = roughness_weights_[c] * spline_roughness(curve.knots);
    smoothed_.gradient -= by.transpose() * (R * values_at_knots(curve, at));
    smoothed_.information += by.transpose() * R * by;
  }
  return smoothed_;
}

double RecordingsLikelihood::log_density_beside_data(const ParameterSet& at) const {
  const double out =
      stated_priors_at(at).value + roughness_density(model_.curves, roughness_weights_, at);
  if (multipliers_.w.size() == 0) return out;
  const ConstraintResiduals rows = constraint_residuals(
      model_.constraints, multipliers_, constraint_values(model_.constraints, values_of(at)));
  return out + rows.constant - 0.5 * rows.r.squaredNorm();
}

// The density of what was recorded, not of its logarithms.
const Likelihood& RecordingsLikelihood::as_recorded(const Likelihood& of_values) {
  if (log_jacobian_ == 0.0) return of_values;
  recorded_ = of_values;
  recorded_.value += log_jacobian_;
  return recorded_;
}

const Likelihood* RecordingsLikelihood::complete(const Likelihood& of_values,
                                                 const ParameterSet& at, bool with_gradient) {
  if (of_values.status != FilterStatus::ok) return nullptr;
  // A team's shares are of what was recorded already.
  const Likelihood& of_data = team_ != nullptr ? of_values : as_recorded(of_values);
  const Likelihood& weighed = prior_box_ ? with_priors(of_data, at, with_gradient) : of_data;
  if (weighed.status != FilterStatus::ok) return nullptr;
  const Likelihood& smoothed =
      roughness_weights_.size() > 0 ? with_roughness(weighed, at, with_gradient) : weighed;
  if (multipliers_.w.size() == 0) return &smoothed;
  const Likelihood& held = with_constraints(smoothed, at, with_gradient);
  return held.status == FilterStatus::ok ? &held : nullptr;
}

const Likelihood* RecordingsLikelihood::evaluate(const ParameterSet& at, bool with_gradient) {
  if (team_ != nullptr) return complete(evaluate_by_team(at, with_gradient), at, with_gradient);
  if (!parts_.empty()) return complete(evaluate_parts(at, with_gradient), at, with_gradient);
  const Likelihood* const found = of_data(at, with_gradient);
  return found != nullptr ? complete(*found, at, with_gradient) : nullptr;
}

const Likelihood* RecordingsLikelihood::of_data(const ParameterSet& at, bool with_gradient) {
  if (is_last(at, with_gradient)) return last_;
  last_ = nullptr;
  if (!set_system(at, with_gradient && is_stationary())) return nullptr;
  const Likelihood& all = changing_ ? changing_->evaluate(at, with_gradient)
                          : nonlinear_
                              ? nonlinear_->evaluate(at, with_gradient)
                              : engine_.evaluate(system_, as_linear(model_).initial,
                                                 with_gradient ? derivatives_ : none_, method_);
  last_ = first_outputs_.empty() ? &all : &behind_beginning(all, with_gradient);
  last_has_gradient_ = with_gradient;
  last_values_.resize(at.size());
  for (std::size_t i = 0; i < at.size(); ++i) last_values_[i] = {at[i].value, at[i].fixed};
  return last_;
}

bool RecordingsLikelihood::is_last(const ParameterSet& at, bool with_gradient) const {
  if (last_ == nullptr || last_values_.size() != at.size()) return false;
  if (with_gradient && !last_has_gradient_) return false;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const MatrixXd &last = last_values_[i].value, &now = at[i].value;
    const bool alike = last.rows() == now.rows() && last.cols() == now.cols() &&
                       last_values_[i].fixed == at[i].fixed;
    if (!alike || !(last.array() == now.array()).all()) return false;
  }
  return true;
}

FilterStatus RecordingsLikelihood::watch(const ParameterSet& at, bool with_derivatives,
                                         std::size_t recording, const FilteredStateWatcher& see) {
  last_ = nullptr;
  if (model_.student) return watch_student(at, recording, see);
  if (!parts_.empty()) return watch_part(at, with_derivatives, recording, see);
  if (!set_system(at, with_derivatives && is_stationary())) return FilterStatus::indefinite;
  if (changing_) return changing_->watch(at, with_derivatives, recording, see);
  if (nonlinear_) return nonlinear_->watch(at, with_derivatives, recording, see);
  return watch_filtered_states(system_, as_linear(model_).initial, recordings_[recording].y,
                               inputs_[recording], with_derivatives ? derivatives_ : none_, see)
      .status;
}

namespace {

// By k entries of the joint model, of which these are the recording's.
FilteredState in_joint_entries(const FilteredState& seen, const std::vector<Eigen::Index>& entries,
                               Eigen::Index k) {
  FilteredState out{seen.t, seen.x, seen.P, {}, {}};
  if (k == 0) return out;
  out.dx.setZero(seen.dx.rows(), k);
  out.dP.setZero(seen.dP.rows(), k);
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const auto from = static_cast<Eigen::Index>(i);
    out.dx.col(entries[i]) += seen.dx.col(from);
    out.dP.col(entries[i]) += seen.dP.col(from);
  }
  return out;
}

}  // namespace

// Shown by the entries of the joint model; those that this recording does not hold move nothing.
FilterStatus RecordingsLikelihood::watch_part(const ParameterSet& at, bool with_derivatives,
                                              std::size_t recording,
                                              const FilteredStateWatcher& see) {
  Part& part = *parts_[recording];
  const Eigen::Index k = with_derivatives ? free_entries(at).size() : 0;
  return part.likelihood.watch(
      part.values(at), with_derivatives, 0,
      [&](const FilteredState& seen) { see(in_joint_entries(seen, part.entries, k)); });
}

FilterStatus RecordingsLikelihood::watch_student(const ParameterSet& at, std::size_t recording,
                                                 const FilteredStateWatcher& see) {
  const FilterResult filter = run_filter(model_, at, recordings_[recording]);
  if (filter.status != FilterStatus::ok) return filter.status;
  for (Eigen::Index t = filter.first_proper; t < filter.x_filt.cols(); ++t) {
    see({t, filter.x_filt.col(t), filter.P_filt[static_cast<std::size_t>(t)], {}, {}});
  }
  return filter.status;
}

LikelihoodProblem RecordingsLikelihood::problem() {
  LikelihoodProblem out;
  const Box box = prior_box_ ? *prior_box_ : coordinate_box(model_.parameters);
  out.lower = box.lower;
  out.upper = box.upper;
  out.evaluate = [this](const VectorXd& x, double& L, VectorXd* gradient, MatrixXd* information) {
    const Likelihood* result =
        evaluate(with_coordinates(model_.parameters, x), gradient != nullptr);
    if (result == nullptr) return false;
    L = result->value;
    if (gradient == nullptr) return true;
    *gradient = result->gradient;
    if (information != nullptr) *information = result->information;
    if (!curved_) return true;
    const MatrixXd J = entry_jacobian(model_.parameters, x);
    *gradient = J.transpose() * result->gradient;
    if (information != nullptr) {
      *information = J.transpose() * result->information * J +
                     coordinate_curvature(model_.parameters, result->gradient);
    }
    return true;
  };
  return out;
}

MatrixXd RecordingsLikelihood::products_of_parts(const ParameterSet& at) {
  const Eigen::Index k = free_entries(at).size();
  MatrixXd out = MatrixXd::Zero(k, k);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = *parts_[i];
    const MatrixXd one = part.likelihood.score_products(part.values(at));
    if (one.size() == 0 && !part.entries.empty()) return {};
    for (std::size_t a = 0; a < part.entries.size(); ++a) {
      for (std::size_t b = 0; b < part.entries.size(); ++b) {
        out(part.entries[a], part.entries[b]) +=
            one(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      }
    }
  }
  return out;
}

bool RecordingsLikelihood::refine(const ParameterSet& at) {
  last_ = nullptr;
  bool finer = false;
  if (team_ != nullptr) {
    team_->tell(bytes_of(request_at(TeamRequest::Kind::refine, at)));
    finer = share_->likelihood && share_->likelihood->refine(at);
    Likelihood of_others;
    for (const std::string& answer : team_->answers()) add_answer(answer, of_others);
    finer = finer || of_others.value > 0.0;
  }
  const bool all_finer = nonlinear_ && nonlinear_->refine(at);
  finer = finer || all_finer;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const bool here = parts_[i]->likelihood.refine(parts_[i]->values(at));
    finer = finer || here;
  }
  return finer;
}

double RecordingsLikelihood::integration_error(const ParameterSet& at) {
  last_ = nullptr;
  double out = nonlinear_ ? nonlinear_->integration_error(at) : 0.0;
  for (const auto& part : parts_) out += part->likelihood.integration_error(part->values(at));
  return out;
}

MatrixXd RecordingsLikelihood::score_products(const ParameterSet& at) {
  last_ = nullptr;
  if (!parts_.empty()) return products_of_parts(at);
  if (!set_system(at, is_stationary())) return {};
  if (is_stationary()) {
    const InitialState initial = as_linear(model_).initial;
    const MatrixXd all = engine_.score_products(system_, initial, derivatives_);
    if (first_outputs_.empty() || all.size() == 0) return all;
    const MatrixXd first = beginning_.score_products(system_, initial, derivatives_);
    return first.size() > 0 ? MatrixXd(all - first) : first;
  }
  MatrixXd out;
  const Likelihood& all =
      changing_ ? changing_->evaluate(at, true, &out) : nonlinear_->evaluate(at, true, &out);
  return all.status == FilterStatus::ok ? out : MatrixXd();
}

bool RecordingsLikelihood::is_cheap() const {
  if (team_ != nullptr) return true;  // its processes are what threads would be
  constexpr double kFew = 4000.0;     // products of the recursion's matrices by a vector
  if (evaluation_taken().method == EvaluationMethod::autocovariances) return true;
  if (!is_linear(model_)) return false;
  const auto size = static_cast<double>(noise_model(model_).A.constant.rows() + 1);
  return samples() * size * size < kFew;
}

double RecordingsLikelihood::samples() const {
  if (digests_ != nullptr) {
    double out = 0.0;
    for (const RecordingDigest& digest : *digests_) {
      out += static_cast<double>(digest.samples * digest.outputs);
    }
    return out;
  }
  return static_cast<double>(samples_present(recordings_));
}

FilterStatus RecordingsLikelihood::status_at_start() {
  for (const auto& part : parts_) {
    const FilterStatus here = part->likelihood.status_at_start();
    if (here != FilterStatus::ok) return here;
  }
  if (!parts_.empty()) return FilterStatus::ok;
  last_ = nullptr;
  if (!set_system(model_.parameters, false)) return FilterStatus::indefinite;
  if (changing_) return changing_->evaluate(model_.parameters, false).status;
  if (nonlinear_) return nonlinear_->evaluate(model_.parameters, false).status;
  return engine_.evaluate(system_, as_linear(model_).initial, none_, method_).status;
}

}  // namespace identikal
