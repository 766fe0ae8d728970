#include "identify/noise/internal/possible_extensions.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "identify/estimate/estimate.h"
#include "identify/filter/model_filter.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Of more outputs than that, all are extended at once, or none by a state each.
constexpr std::size_t kMostAlone = 4, kMostStates = 6, kMostAlike = 12, kMostInputs = 2;

// Of each output: half of the innovations' size; zero where there is none.
std::vector<double> begin_sizes(const FilterResult& filter) {
  std::vector<double> out;
  for (Index i = 0; i < filter.e.rows(); ++i) {
    const auto e = filter.e.row(i).array();
    const double rows = static_cast<double>((e == e).count());
    out.push_back(0.5 * std::sqrt((e == e).select(e.square(), 0.0).sum() / std::max(1.0, rows)));
  }
  return out;
}

bool has_parameter(const Model& model, const std::string& name) {
  return find_parameter(model.parameters, name) >= 0;
}

bool has_state(const Model& model, const std::string& name) {
  return std::any_of(model.states.begin(), model.states.end(),
                     [&](const auto& state) { return state.name == name; });
}

// Biases or lasting errors of all outputs that have none.
ModelExtension of_all_outputs(ExtensionKind kind, const Model& model,
                              const std::vector<double>& sizes) {
  ModelExtension out{kind, {}, {}, false};
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const std::string& name = model.outputs[i].name;
    const bool there = kind == ExtensionKind::bias ? has_parameter(model, "bias_" + name)
                                                   : has_state(model, "error_" + name);
    if (there || !(sizes[i] > 0.0)) continue;
    out.names.push_back(name);
    out.size.push_back(sizes[i]);
  }
  return out;
}

// Those of `all` that are sensors of one kind.
std::vector<ModelExtension> alike(const YamlNode& root, const ModelExtension& all) {
  std::vector<ModelExtension> out;
  for (const std::vector<std::string>& kind : outputs_alike(root)) {
    ModelExtension group{all.kind, {}, {}, true};
    for (std::size_t i = 0; i < all.names.size(); ++i) {
      if (std::find(kind.begin(), kind.end(), all.names[i]) == kind.end()) continue;
      group.names.push_back(all.names[i]);
      group.size.push_back(all.size[i]);
    }
    const std::size_t count = group.names.size();
    if (count > 1 && count <= kMostAlike) out.push_back(std::move(group));
  }
  return out;
}

// What the inputs' sensors may do to them: a share of what they vary by is where a search begins.
std::vector<ModelExtension> of_inputs(const Model& model, const Dataset& recording) {
  constexpr double kShare = 0.1, kLittle = 0.05;  // of the standard deviation; of a scale
  std::vector<ModelExtension> out;
  if (model.inputs.size() > kMostInputs) return out;
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    const std::string& name = model.inputs[i].name;
    const auto u = recording.u.row(static_cast<Index>(i)).array();
    const double size = kShare * std::sqrt((u - u.mean()).square().mean());
    if (!(size > 0.0)) continue;  // nor where samples are missing
    if (!has_parameter(model, "bias_" + name)) {
      out.push_back({ExtensionKind::bias, {name}, {size}, false});
    }
    if (!has_parameter(model, "scale_" + name)) {
      out.push_back({ExtensionKind::scale, {name}, {kLittle}, false});
    }
    if (!has_state(model, "error_" + name)) {
      out.push_back({ExtensionKind::lasting_error, {name}, {size}, false});
    }
  }
  return out;
}

// A state that an extension has brought.
bool is_part_of_noise(const std::string& state) {
  return state.starts_with("error_") || state.starts_with("disturbance_");
}

// Of states, as the model's file has it: per second, or per sample.
MatrixXd written_process_noise(const Model& model) {
  const StateSpace written = written_matrices(noise_model(model), model.parameters);
  return written.G * written.Q * written.G.transpose();
}

// Of the outputs that are measured, and are no angles: two turns are no scale of one.
std::vector<ModelExtension> scales_and_delays(const YamlNode& root, const Model& model,
                                              double step) {
  constexpr double kLittle = 0.05, kShort = 0.5;  // of a scale; of a sample
  std::vector<ModelExtension> out;
  if (model.outputs.size() > kMostAlone) return out;
  const std::vector<bool> wraps = is_linear(model) ? std::vector<bool>() : as_formulas(model).wraps;
  for (const ExtensionKind kind : {ExtensionKind::scale, ExtensionKind::delay}) {
    const bool scale = kind == ExtensionKind::scale;
    for (std::size_t i = 0; i < model.outputs.size(); ++i) {
      const std::string& name = model.outputs[i].name;
      if (model.outputs[i].value || (scale && i < wraps.size() && wraps[i]) ||
          (!scale && !can_be_late(root, name)) ||
          has_parameter(model, (scale ? "scale_" : "delay_") + name)) {
        continue;
      }
      out.push_back({kind, {name}, {scale ? kLittle : kShort * step}, false});
    }
  }
  return out;
}

// In place of noise that is white: as large a variance of a sum over many samples.
std::vector<ModelExtension> coloured_process_noises(const YamlNode& root, const Model& model,
                                                    double step) {
  constexpr double kSteps = 60.0;  // twice the time constant where its search begins, in samples
  const MatrixXd Q = written_process_noise(model);
  const double interval = has_continuous_time(root) ? step : 1.0;
  std::vector<ModelExtension> out;
  for (const std::vector<std::string>& kind : states_alike(root)) {
    ModelExtension group{ExtensionKind::coloured_process_noise, {}, {}, kind.size() > 1};
    for (const std::string& name : kind) {
      const auto state = std::find_if(model.states.begin(), model.states.end(),
                                      [&](const StateName& each) { return each.name == name; });
      const Index at = state - model.states.begin();
      if (state == model.states.end() || !(Q(at, at) > 0.0) || is_part_of_noise(name) ||
          has_state(model, "disturbance_" + name)) {
        continue;
      }
      group.names.push_back(name);
      group.size.push_back(std::sqrt(Q(at, at) / (kSteps * interval)));
    }
    if (!group.names.empty() && group.names.size() <= kMostStates) out.push_back(std::move(group));
  }
  return out;
}

std::vector<ModelExtension> process_noises(const Model& model) {
  std::vector<ModelExtension> out;
  const MatrixXd Q = written_process_noise(model);
  const double of_others = std::sqrt(Q.diagonal().maxCoeff());
  for (std::size_t i = 0; i < model.states.size() && of_others > 0.0; ++i) {
    const auto at = static_cast<Index>(i);
    const std::string& name = model.states[i].name;
    if (Q(at, at) != 0.0 || is_part_of_noise(name) || has_parameter(model, "q_" + name)) {
      continue;
    }
    out.push_back({ExtensionKind::process_noise, {name}, {0.1 * of_others}, false});
  }
  return out;
}

// Do squares of e grow or shrink at some row? sqrt(N/2) max |C_k/C_N - k/N| (Inclan and Tiao 1994),
// whose critical value is that of 1 %; the row is the likeliest of normal e.
struct SizeChange {
  Index row;     // the first behind it
  double ratio;  // of the mean square behind it to that before
};
std::optional<SizeChange> size_change(const VectorXd& e) {
  constexpr double kCritical = 1.628;
  constexpr Index kLeast = 30;  // samples on either side
  std::vector<Index> rows;
  std::vector<double> sums{0.0};
  for (Index t = 0; t < e.size(); ++t) {
    if (std::isnan(e[t])) continue;
    rows.push_back(t);
    sums.push_back(sums.back() + e[t] * e[t]);
  }
  const auto N = static_cast<double>(rows.size());
  double statistic = 0.0, likeliest = -kInfinity;
  std::optional<SizeChange> out;
  for (Index k = kLeast; k <= static_cast<Index>(rows.size()) - kLeast; ++k) {
    const double sum = sums[static_cast<std::size_t>(k)], share = sum / sums.back(),
                 n = static_cast<double>(k);
    const double before = sum / n, behind = (sums.back() - sum) / (N - n);
    if (!(before > 0.0 && behind > 0.0)) continue;
    statistic = std::max(statistic, std::sqrt(0.5 * N) * std::abs(share - n / N));
    const double L = -0.5 * (n * std::log(before) + (N - n) * std::log(behind));
    if (!(L > likeliest)) continue;
    likeliest = L;
    out = SizeChange{rows[static_cast<std::size_t>(k)], behind / before};
  }
  return statistic > kCritical ? out : std::nullopt;
}

// Of outputs whose noise is written alike: by as much as the innovations of one are larger.
std::vector<ModelExtension> noises_of_their_own(const YamlNode& root, const Model& model,
                                                const std::vector<double>& sizes) {
  std::vector<ModelExtension> out;
  for (const std::vector<std::string>& kind : outputs_alike(root)) {
    if (kind.size() < 2 || kind.size() > kMostAlone) continue;
    // Of two, the one by itself is the other by itself.
    for (std::size_t i = kind.size() == 2 ? 1 : 0; i < kind.size(); ++i) {
      const auto size_of = [&](const std::string& name) {
        const auto at = std::find_if(model.outputs.begin(), model.outputs.end(),
                                     [&](const auto& output) { return output.name == name; });
        return at == model.outputs.end()
                   ? 0.0
                   : sizes[static_cast<std::size_t>(at - model.outputs.begin())];
      };
      const double own = size_of(kind[i]), other = size_of(kind[i == 0 ? 1 : 0]);
      if (!(own > 0.0 && other > 0.0) || has_parameter(model, "ratio_" + kind[i])) continue;
      out.push_back({ExtensionKind::measurement_noise_change,
                     {kind[i]},
                     {own * own / (other * other)},
                     false,
                     -kInfinity});
    }
  }
  return out;
}

// Of one recording: where several go into the fit, none of them has a time for all.
std::vector<ModelExtension> noise_changes(const Model& model, const Dataset& recording,
                                          const FilterResult& filter) {
  std::vector<ModelExtension> out;
  std::optional<SizeChange> largest;
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const std::string& name = model.outputs[i].name;
    if (has_parameter(model, "ratio_" + name) || has_parameter(model, "ratio_process")) continue;
    const auto change = size_change(filter.standardised.row(static_cast<Index>(i)).transpose());
    if (!change) continue;
    if (model.outputs.size() <= kMostAlone) {
      out.push_back({ExtensionKind::measurement_noise_change,
                     {name},
                     {change->ratio},
                     false,
                     recording.time[change->row]});
    }
    const auto size = [](const SizeChange& of) { return std::abs(std::log(of.ratio)); };
    if (!largest || size(*change) > size(*largest)) largest = change;
  }
  if (largest) {
    out.push_back({ExtensionKind::process_noise_change,
                   {"process"},
                   {largest->ratio},
                   false,
                   recording.time[largest->row]});
  }
  return out;
}

}  // namespace

std::vector<ModelExtension> possible_extensions(const YamlNode& root, const Model& model,
                                                const std::vector<Dataset>& recordings) {
  std::vector<ModelExtension> out;
  const FilterResult filter = run_filter(model, model.parameters, recordings[0], Keep::innovations);
  if (filter.status != FilterStatus::ok) return out;
  const std::vector<double> sizes = begin_sizes(filter);
  for (const ExtensionKind kind : {ExtensionKind::bias, ExtensionKind::lasting_error}) {
    const ModelExtension all = of_all_outputs(kind, model, sizes);
    const std::size_t count = all.names.size();
    for (std::size_t i = 0; count <= kMostAlone && i < count; ++i) {
      out.push_back({kind, {all.names[i]}, {all.size[i]}, false});
    }
    if (count > 1 && (kind == ExtensionKind::bias || count <= kMostStates)) out.push_back(all);
    if (kind == ExtensionKind::bias) continue;
    const std::vector<ModelExtension> groups = alike(root, all);
    out.insert(out.end(), groups.begin(), groups.end());
  }
  const double step = recordings[0].dt;
  for (const std::vector<ModelExtension>& more :
       {scales_and_delays(root, model, step), of_inputs(model, recordings[0]),
        process_noises(model), coloured_process_noises(root, model, step),
        noises_of_their_own(root, model, sizes), curved_motions(root, model, recordings)}) {
    out.insert(out.end(), more.begin(), more.end());
  }
  if (recordings.size() == 1) {
    const std::vector<ModelExtension> changes = noise_changes(model, recordings[0], filter);
    out.insert(out.end(), changes.begin(), changes.end());
  }
  return out;
}

std::vector<ModelExtension> curved_motions(const YamlNode& root, const Model& model,
                                           const std::vector<Dataset>& recordings) {
  std::vector<ModelExtension> out;
  const YamlNode* initial = find(root, "initial");
  if (initial == nullptr || find(*initial, "mean") == nullptr) return out;
  const FilterResult filter = run_filter(model, model.parameters, recordings[0]);
  if (filter.status != FilterStatus::ok) return out;
  const auto add = [&](ExtensionKind kind, std::vector<std::string> names, double size,
                       const std::string& parameter) {
    if (!has_parameter(model, parameter) && size > 0.0) {
      out.push_back({kind, std::move(names), {size}});
    }
  };
  const MatrixXd Q = written_process_noise(model);
  const VectorXd size = filter.x_filt.rowwise().norm() /
                        std::sqrt(static_cast<double>(std::max<Index>(1, filter.x_filt.cols())));
  for (std::size_t i = 0; i < model.states.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const std::string& name = model.states[i].name;
    if (!(Q(at, at) > 0.0) || is_part_of_noise(name)) continue;
    add(ExtensionKind::quadratic_damping, {name}, size[at], "drag_" + name);
    add(ExtensionKind::dry_friction, {name}, size[at], "friction_" + name);
    for (std::size_t k = 0; k < model.states.size(); ++k) {
      const std::string& other = model.states[k].name;
      if (k == i || is_part_of_noise(other) || !moves_by(root, name, other)) continue;
      add(ExtensionKind::cubic_stiffness, {name, other}, size[static_cast<Index>(k)],
          "cubic_" + name + "_" + other);
    }
  }
  if (model.inputs.size() > kMostInputs) return out;
  for (std::size_t i = 0; i < model.inputs.size(); ++i) {
    const auto u = recordings[0].u.row(static_cast<Index>(i));
    add(ExtensionKind::curved_input, {model.inputs[i].name}, u.norm(),
        "curve_" + model.inputs[i].name);
  }
  return out;
}

}  // namespace identikal
