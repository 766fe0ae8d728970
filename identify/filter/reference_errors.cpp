#include "identify/filter/reference_errors.h"

#include <algorithm>
#include <cmath>

#include "identify/estimate/distribution.h"
#include "identify/estimate/parameter_table.h"
#include "lib/base/constants.h"
#include "lib/base/median.h"
#include "lib/base/nearest_turn.h"
#include "lib/model/nonlinear_model.h"
#include "lib/statistics/autoregression.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Evaluates the references' quantities and their derivatives at states of the filter.
class Quantities {
 public:
  Quantities(const Model& model, const ParameterSet& at, bool with_derivatives)
      : references_(model.references),
        memory_(make_memory(references_.quantities)),
        values_(references_.quantities.outputs),
        with_derivatives_(with_derivatives) {
    const NonlinearModel& quantities = references_.quantities;
    VectorXd p(quantities.parameters);
    for (Index i = 0; i < p.size(); ++i) p[i] = at[static_cast<std::size_t>(i)].scalar();
    set_parameters(quantities, memory_, p);
    if (!with_derivatives) return;
    const std::vector<EntryDerivative> entries = entry_derivatives(at);
    for (std::size_t i = 0; i < entries.size(); ++i) {
      const Index parameter = entries[i].parameter;
      if (parameter >= quantities.parameters) continue;
      const Index column = quantities.column[static_cast<std::size_t>(parameter)];
      if (column >= 0) moved_.push_back({static_cast<Index>(i), column});
    }
  }

  void look(const FilteredState& state, const Dataset& recording) {
    observe(references_.quantities, memory_, state.x, recording.u.col(state.t),
            recording.time[state.t], values_, slopes_,
            with_derivatives_ ? Derivatives::second : Derivatives::first);
  }

  const ReferenceError& compare(std::size_t recording, Index i, const FilteredState& state,
                                double measured) {
    ReferenceError& out = error_;
    out.recording = recording;
    out.row = state.t;
    H_ = slopes_.wrt_x.row(i).transpose();
    PH_.noalias() = state.P * H_;
    out.reference = i;
    out.e = values_[i] - measured;
    if (references_.channels[static_cast<std::size_t>(i)].wraps) out.e = nearest_turn(out.e);
    const double sd = references_.sd[static_cast<std::size_t>(i)];
    out.v = H_.dot(PH_) + sd * sd;
    if (with_derivatives_) differentiate(state);
    return out;
  }

 private:
  struct Moved {
    Index entry, column;
  };

  // de = H dx + dh/dp,  dv = H dP H' + 2 dH P H'.
  void differentiate(const FilteredState& state) {
    ReferenceError& out = error_;
    const Index n = state.x.size(), outputs = slopes_.wrt_x.rows();
    HH_.noalias() = H_ * H_.transpose();
    out.de.noalias() = state.dx.transpose() * H_;
    out.dv.noalias() = state.dP.transpose() * HH_.reshaped();
    bend_.setZero(slopes_.wrt_x_jacobian.cols());  // of H P H', P held, by x and the parameters
    for (Index l = 0; l < n; ++l) {
      bend_ += 2.0 * PH_[l] * slopes_.wrt_x_jacobian.row(out.reference + outputs * l).transpose();
    }
    out.dv.noalias() += state.dx.transpose() * bend_.head(n);
    for (const Moved& each : moved_) {
      out.de[each.entry] += slopes_.wrt_p(out.reference, each.column);
      out.dv[each.entry] += bend_[n + each.column];
    }
  }

  const StateReferences& references_;
  ModelMemory memory_;
  VectorXd values_;
  Jacobian slopes_;
  std::vector<Moved> moved_;
  bool with_derivatives_;
  // Of the reference compared last; their memory serves again.
  VectorXd H_, PH_, bend_;
  MatrixXd HH_;
  ReferenceError error_;
};

// A program's samples are in SI and have no names of their own.
Channel channel_of(const Model& model, const Dataset& recording, std::size_t i) {
  if (i < recording.references.size()) return recording.references[i];
  return {model.references.channels[i].name, model.references.channels[i].si_unit};
}

// Of each recording at least one.
double independent_errors(const std::vector<std::vector<double>>& normalised) {
  double sum = 0.0;
  for (const std::vector<double>& each : normalised) {
    if (each.empty()) continue;
    const Eigen::Map<const VectorXd> e(each.data(), static_cast<Index>(each.size()));
    sum += std::max(1.0, independent_samples(e));
  }
  return sum;
}

}  // namespace

FilterStatus for_each_reference(const Model& model, const ParameterSet& at,
                                const std::vector<Dataset>& recordings,
                                RecordingsLikelihood& filters, bool with_derivatives,
                                const std::function<void(const ReferenceError&)>& see) {
  if (model.references.channels.empty()) return FilterStatus::ok;
  Quantities quantities(model, at, with_derivatives);
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const Dataset& recording = recordings[r];
    const auto look = [&](const FilteredState& state) {
      const auto measured = recording.reference.col(state.t);
      if (measured.array().isNaN().all()) return;
      quantities.look(state, recording);
      for (Index i = 0; i < measured.size(); ++i) {
        if (std::isnan(measured[i])) continue;
        see(quantities.compare(r, i, state, measured[i]));
      }
    };
    if (recording.reference.rows() == 0) continue;
    const FilterStatus status = filters.watch(at, with_derivatives, r, look);
    if (status != FilterStatus::ok) return status;
  }
  return FilterStatus::ok;
}

SettledRows first_settled_rows(const Model& model, const ParameterSet& at,
                               const std::vector<Dataset>& recordings,
                               RecordingsLikelihood& filters) {
  constexpr double kSettled = 4.0;  // times the median variance
  struct Row {
    Index row;
    double v;
  };
  const std::size_t count = model.references.channels.size();
  std::vector<std::vector<std::vector<Row>>> rows(recordings.size(),
                                                  std::vector<std::vector<Row>>(count));
  const auto add = [&](const ReferenceError& error) {
    if (!(error.v > 0.0)) return;  // a start that is known
    rows[error.recording][static_cast<std::size_t>(error.reference)].push_back(
        {error.row, error.v});
  };
  if (for_each_reference(model, at, recordings, filters, false, add) != FilterStatus::ok) return {};
  SettledRows out(recordings.size(), std::vector<Index>(count, 0));
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    for (std::size_t i = 0; i < count; ++i) {
      std::vector<double> all;
      for (const Row& each : rows[r][i]) all.push_back(each.v);
      if (all.empty()) continue;
      const double most = kSettled * median(std::move(all));
      for (const Row& each : rows[r][i]) {
        out[r][i] = each.row;
        if (each.v <= most) break;
      }
    }
  }
  return out;
}

std::vector<ReferenceFit> reference_fits(const Model& model, const ParameterSet& at,
                                         const std::vector<Dataset>& recordings,
                                         SettledRows settled) {
  if (model.references.channels.empty() || recordings.empty()) return {};
  struct Sums {
    long rows = 0, covered = 0;
    double e = 0.0, squares = 0.0, v = 0.0, nees = 0.0, log = 0.0;
    std::vector<std::vector<double>> normalised;  // e/v^1/2, per recording
  };
  std::vector<Sums> sums(model.references.channels.size());
  RecordingsLikelihood filters(model, recordings);
  if (settled.empty()) settled = first_settled_rows(model, at, recordings, filters);
  if (settled.empty()) return {};
  for (Sums& s : sums) s.normalised.resize(recordings.size());
  const auto add = [&](const ReferenceError& at_row) {
    if (!(at_row.v > 0.0) || !std::isfinite(at_row.e)) return;
    if (at_row.row < settled[at_row.recording][static_cast<std::size_t>(at_row.reference)]) return;
    Sums& s = sums[static_cast<std::size_t>(at_row.reference)];
    const double ratio = at_row.e * at_row.e / at_row.v;
    constexpr double kQuantile = 1.959963984540054;  // of a normal distribution, 97.5 %
    ++s.rows;
    s.covered += ratio < kQuantile * kQuantile ? 1 : 0;
    s.e += at_row.e;
    s.squares += at_row.e * at_row.e;
    s.v += at_row.v;
    s.nees += ratio;
    s.log -= 0.5 * (ratio + std::log(at_row.v) + kLogTwoPi);
    s.normalised[at_row.recording].push_back(at_row.e / std::sqrt(at_row.v));
  };
  if (for_each_reference(model, at, recordings, filters, false, add) != FilterStatus::ok) return {};
  std::vector<ReferenceFit> out;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Sums& s = sums[i];
    if (s.rows == 0) continue;
    const auto count = static_cast<double>(s.rows);
    const Channel channel = channel_of(model, recordings.front(), i);
    const double scale = unit_scale(channel.unit);
    out.push_back({channel.name, channel.unit, s.rows, independent_errors(s.normalised),
                   std::sqrt(s.squares / count) / scale, s.e / count / scale,
                   std::sqrt(s.v / count) / scale, s.nees / count,
                   static_cast<double>(s.covered) / count, s.log / count + std::log(scale)});
  }
  return out;
}

bool is_out_of_band(const ReferenceFit& fit) {
  constexpr double kLeast = 0.5, kMost = 2.0, kLevel = 0.01;
  if (fit.nees > kLeast && fit.nees < kMost) return false;
  const double above = chi_square_upper_tail(fit.nees * fit.independent, fit.independent);
  return std::min(above, 1.0 - above) < kLevel;
}

}  // namespace identikal
