#include "identify/noise/extend.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <Eigen/Cholesky>
#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/filter/model_filter.h"
#include "identify/model/check.h"
#include "identify/model/model_file.h"
#include "identify/noise/curved_motion.h"
#include "identify/noise/expected_errors.h"
#include "identify/noise/internal/extension_fit.h"
#include "identify/noise/internal/gain_by_row.h"
#include "identify/noise/internal/possible_extensions.h"
#include "lib/base/constants.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kStandardErrors = 3.0, kLeastGain = 0.01;  // nats per row
// Where the first part, too, asks for a further part, by as many nats more than BIC's penalty.
constexpr double kWithFirstPart = 2.0, kAskedFor = 10.0;

struct ExtendedModel : FittedModel {
  std::vector<VectorXd> densities;  // of held-out rows, per recording; empty: it does not run
  double log_density = 0.0;         // of the first part, but for a filter's beginning
  double criterion = 0.0;           // that less BIC's penalty
  double beginning = 0.0;           // log-density of what both leave out, and where it begins
  std::vector<Index> begins;
};

std::vector<Dataset> first_parts(const std::vector<Dataset>& recordings, double hold_out) {
  std::vector<Dataset> out;
  for (const Dataset& data : recordings) {
    const auto keep = static_cast<Index>(std::ceil((1.0 - hold_out) * data.size()));
    out.push_back(first_samples(data, std::max<Index>(keep, 2)));
  }
  return out;
}

// A filter that is right but for a few samples gains on all others what these cost: one in a hundred
// may be ten times as far off, so that a row costs nats and not hundreds of them. Source: Tukey (1960),
// "A survey of sampling from contaminated distributions".
// @param squares  e' Sigma^-1 e of m outputs
double log_of_contaminated(double squares, double m) {
  constexpr double kShare = 0.01, kFarther = 10.0;
  const double near = std::log1p(-kShare) - 0.5 * squares;
  const double far =
      std::log(kShare) - m * std::log(kFarther) - 0.5 * squares / (kFarther * kFarther);
  const double larger = std::max(near, far);
  return larger + std::log1p(std::exp(std::min(near, far) - larger));
}

struct RowDensities {
  VectorXd log_density;  // of each row; zero before `first`
  Index first;           // that is not taken by a diffuse start
};

// log p(y(t) | y(1), ..., y(t-1)).
std::optional<RowDensities> densities(const Model& model, const Dataset& data) {
  const FilterResult filter = run_filter(model, model.parameters, data);
  if (filter.status != FilterStatus::ok) return std::nullopt;
  VectorXd out = VectorXd::Zero(data.size());
  for (Index t = filter.first_proper; t < data.size(); ++t) {
    std::vector<Index> present;
    for (Index i = 0; i < data.y.rows(); ++i) {
      if (!std::isnan(data.y(i, t))) present.push_back(i);
    }
    if (present.empty()) continue;
    const MatrixXd Sigma = filter.Sigma[static_cast<std::size_t>(t)](present, present);
    const Eigen::LLT<MatrixXd> factor(Sigma);
    if (factor.info() != Eigen::Success) return std::nullopt;
    const MatrixXd L = factor.matrixL();
    const VectorXd z = L.triangularView<Eigen::Lower>().solve(VectorXd(filter.e(present, t)));
    const auto m = static_cast<double>(present.size());
    out[t] = log_of_contaminated(z.squaredNorm(), m) - L.diagonal().array().log().sum() -
             0.5 * kLogTwoPi * m;
  }
  return RowDensities{std::move(out), filter.first_proper};
}

bool predict(ExtendedModel& candidate, const std::vector<Dataset>& recordings,
             const std::vector<Dataset>& first) {
  constexpr Index kSettles = 5;  // a share of the first part: diffuse starts do not compare
  candidate.densities.clear();
  candidate.begins.clear();
  candidate.log_density = candidate.beginning = 0.0;
  double rows = 0.0;
  for (std::size_t r = 0; r < recordings.size(); ++r) {
    const Index held = first[r].size(), begin = held / kSettles;
    const auto all = densities(candidate.model, recordings[r]);
    if (!all || all->first > begin) return false;
    const VectorXd& each = all->log_density;
    candidate.log_density += each.segment(begin, held - begin).sum();
    candidate.beginning += each.head(begin).sum();
    candidate.begins.push_back(all->first);
    rows += static_cast<double>(held - begin);
    candidate.densities.push_back(each.tail(each.size() - held));
  }
  const auto unknowns = static_cast<double>(free_entries(candidate.model.parameters).size());
  candidate.criterion = candidate.log_density - 0.5 * unknowns * std::log(rows);
  return true;
}

bool pays(const GainByRow& gain) {
  return gain.mean > kStandardErrors * gain.se && gain.mean > kLeastGain;
}

// Where the fitted part asks for it clearly, the held-out part has to confirm it, not to show it alone.
bool pays(const GainByRow& gain, const ExtendedModel& more, const ExtendedModel& less) {
  return pays(gain) || (more.criterion > less.criterion + kAskedFor &&
                        gain.mean > kWithFirstPart * gain.se && gain.mean > kLeastGain);
}

// An error that lasts takes a constant in while the filter runs on, and held-out rows show nothing of
// it; the next recording begins without. The first part asks for it where the filter's beginning counts:
// by the likelihood ratio, since how many constants there are is no matter of choice.
bool pays_from_the_start(const GainByRow& gain, const ExtendedModel& more,
                         const ExtendedModel& less) {
  constexpr double kChance = 1e-4;
  const double likelier = more.log_density + more.beginning - less.log_density - less.beginning;
  const auto constants = static_cast<double>(free_entries(more.model.parameters).size() -
                                             free_entries(less.model.parameters).size());
  return more.begins == less.begins && gain.mean > -gain.se && likelier > 0.0 &&
         chi_square_upper_tail(2.0 * likelier, constants) < kChance;
}

GainByRow gain_of(const ExtendedModel& more, const ExtendedModel& less) {
  std::vector<VectorXd> gains;
  for (std::size_t r = 0; r < more.densities.size(); ++r) {
    gains.push_back(more.densities[r] - less.densities[r]);
  }
  return gain_by_row(gains);
}

std::optional<ExtendedModel> with_predictions(std::optional<FittedModel> fitted,
                                              const std::vector<Dataset>& recordings,
                                              const std::vector<Dataset>& first) {
  if (!fitted) return std::nullopt;
  ExtendedModel out{std::move(*fitted), {}, 0.0, 0.0, 0.0, {}};
  if (!predict(out, recordings, first)) return std::nullopt;
  return out;
}

// An extension that was tried.
struct Fitted {
  ExtendedModel candidate;
  GainByRow gain;
  double asked_for;  // by the first part [nats]
  bool pays;
  std::size_t trial;
  ModelExtension extension;
  int sensors;  // of one kind, that it is of one of; -1: none
};

// Two sensors that differ: which of them is off is told by a third one, or by inputs; of an error that
// lasts where they are not of one kind, too.
// Innovations that are coloured count for more samples than they are: nats alone would tell. Of a
// constant rows held out may; of an error that lasts they hold few that are independent.
bool cannot_be_told_from(const Fitted& one, const Fitted& other) {
  constexpr double kNats = 3.0, kShare = 0.1;  // of what the likelier one gains
  const ExtensionKind kind = one.extension.kind;
  if (other.extension.kind != kind || one.extension.names.size() != 1 ||
      other.extension.names.size() != 1 || one.extension.names == other.extension.names ||
      !(std::abs(one.asked_for - other.asked_for) <
        std::max(kNats, kShare * std::max(one.asked_for, other.asked_for)))) {
    return false;
  }
  if (kind == ExtensionKind::lasting_error) {
    return one.sensors >= 0 && one.sensors == other.sensors;
  }
  return is_constant(kind) && !pays(gain_of(one.candidate, other.candidate)) &&
         !pays(gain_of(other.candidate, one.candidate));
}

// Errors that last of sensors of one kind, of each its own size: where they predict no better than
// those that are alike, whose error it is is not told either.
bool is_no_better_than_alike(const Fitted& one, const Fitted& other) {
  return one.extension.kind == ExtensionKind::lasting_error &&
         other.extension.kind == ExtensionKind::lasting_error && other.extension.alike &&
         !one.extension.alike && one.extension.names == other.extension.names && other.pays &&
         !pays(gain_of(one.candidate, other.candidate));
}

bool cannot_be_told(const Fitted& one, const std::vector<Fitted>& fitted) {
  return std::any_of(fitted.begin(), fitted.end(), [&](const Fitted& other) {
    return cannot_be_told_from(one, other) || is_no_better_than_alike(one, other);
  });
}

// Of two outputs of which one is off, nothing says which: half of it in each.
std::vector<ModelExtension> opposite_pairs(const std::vector<Fitted>& fitted, const Model& model) {
  const auto is_output = [&model](const std::string& name) {
    return std::any_of(model.outputs.begin(), model.outputs.end(),
                       [&](const auto& output) { return output.name == name; });
  };
  std::vector<ModelExtension> out;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    for (std::size_t j = i + 1; j < fitted.size(); ++j) {
      const ModelExtension &one = fitted[i].extension, &other = fitted[j].extension;
      if (!fitted[i].pays || !fitted[j].pays || !cannot_be_told_from(fitted[i], fitted[j]) ||
          !(one.kind == ExtensionKind::bias || one.kind == ExtensionKind::scale) ||
          !is_output(one.names[0]) || !is_output(other.names[0])) {
        continue;
      }
      out.push_back({one.kind, {one.names[0], other.names[0]}, {one.size[0], other.size[0]}, true});
    }
  }
  return out;
}

// Of those that pay and that none predicts better than, the one that the first part asks for, by BIC.
std::optional<std::size_t> chosen_of(const std::vector<Fitted>& fitted) {
  const auto beaten = [&](const Fitted& each) {
    return std::any_of(fitted.begin(), fitted.end(), [&](const Fitted& other) {
      return other.pays && !cannot_be_told(other, fitted) &&
             pays(gain_of(other.candidate, each.candidate));
    });
  };
  std::optional<std::size_t> out;
  for (std::size_t i = 0; i < fitted.size(); ++i) {
    if (!fitted[i].pays || beaten(fitted[i]) || cannot_be_told(fitted[i], fitted)) continue;
    if (!out || fitted[i].candidate.criterion > fitted[*out].candidate.criterion) out = i;
  }
  return out;
}

int kind_of(const std::string& output, const std::vector<std::vector<std::string>>& kinds) {
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    if (std::find(kinds[k].begin(), kinds[k].end(), output) != kinds[k].end()) {
      return static_cast<int>(k);
    }
  }
  return -1;
}

// Parts that are tried side by side, each alone beside what was adopted before.
struct Round {
  const ExtendedModel& best;
  const std::vector<Dataset>&recordings, &first;
  const ExtendOptions& options;
  std::vector<ExtensionTrial>& tried;
  bool& runs;    // until the listener wants no more
  bool lasting;  // has an error that lasts been adopted?
  std::vector<Fitted> fitted;

  void try_parts(const std::vector<ModelExtension>& parts) {
    const std::vector<std::vector<std::string>> kinds = outputs_alike(best.root);
    auto found = fit_extensions(best, parts, first, options.search.threads,
                                [this](const ModelExtension& extension) {
                                  runs = !options.progress || options.progress(in_words(extension));
                                  return runs;
                                });
    for (std::size_t i = 0; i < parts.size(); ++i) {
      auto candidate = with_predictions(std::move(found[i]), recordings, first);
      if (!candidate && !runs) continue;  // perhaps it was not begun
      ExtensionTrial trial;
      trial.what = in_words(parts[i]);
      if (candidate) {
        const GainByRow gain = gain_of(*candidate, best);
        trial.gain = gain.mean;
        trial.gain_se = gain.se;
        trial.from_start =
            lasting && is_constant(parts[i].kind) && pays_from_the_start(gain, *candidate, best);
        const bool worth_it = trial.from_start || pays(gain, *candidate, best);
        const double asked_for = candidate->criterion - best.criterion;
        fitted.push_back({std::move(*candidate), gain, asked_for, worth_it, tried.size(), parts[i],
                          kind_of(parts[i].names[0], kinds)});
      }
      tried.push_back(std::move(trial));
    }
  }
};

// Of a bias or scale that is half in each of two outputs: the same of one of them alone.
void add_singles(const ModelExtension& two, const std::vector<Fitted>& fitted,
                 std::vector<UndecidedPart>& out) {
  for (const Fitted& each : fitted) {
    const bool of_one =
        each.extension.names.size() == 1 &&
        std::find(two.names.begin(), two.names.end(), each.extension.names[0]) != two.names.end();
    if (!of_one || each.extension.kind != two.kind) continue;
    out.push_back({in_words(each.extension), each.candidate.model});
  }
}

std::vector<std::string> table_of(const std::vector<ExtensionTrial>& tried) {
  std::vector<std::string> out{"further parts tried, by the log-likelihood per row held out:"};
  std::size_t width = 36;
  for (const ExtensionTrial& trial : tried) width = std::max(width, trial.what.size());
  for (const ExtensionTrial& trial : tried) {
    out.push_back(fmt::format(
        "  {:<{}} {}{}", trial.what, width,
        std::isnan(trial.gain) ? "no filter, no estimate, or nothing promised"
                               : fmt::format("{:+.3f} +- {:.3f}", trial.gain, trial.gain_se),
        trial.adopted && trial.from_start
            ? "  adopted: an error that lasts takes it in only as a recording goes on"
        : trial.adopted   ? "  adopted"
        : trial.ambiguous ? "  undecided"
        : trial.rival     ? "  as good"
                          : ""));
  }
  return out;
}

}  // namespace

ExtendResult tune_extended(const YamlNode& root, const Model& given,
                           const std::vector<Dataset>& recordings, const ExtendOptions& options) {
  if (given.states.empty()) {
    throw InputError({given.source, 0, 0}, "a model by matrices cannot be extended",
                     "a model of formulas: states, dynamics and outputs by their names",
                     "'identikal shape' finds coloured noise of a model by matrices");
  }
  ExtendResult out;
  ExtendedModel best;
  best.root = root;
  best.model = checked(given, recordings);
  const std::vector<Dataset> first = first_parts(recordings, options.hold_out);
  fit_values(best.model, first);  // where it does not determine all, it predicts with what it has
  bool runs = predict(best, recordings, first);
  std::vector<UndecidedPart> undecided;
  bool lasting = false;
  for (int step = 0; runs && step < options.most; ++step) {
    Round round{best, recordings, first, options, out.tried, runs, lasting, {}};
    round.try_parts(possible_extensions(best.root, best.model, first));
    if (runs) round.try_parts(opposite_pairs(round.fitted, best.model));
    std::vector<Fitted>& fitted = round.fitted;
    for (const Fitted& each : fitted) {
      out.tried[each.trial].ambiguous = each.pays && cannot_be_told(each, fitted);
    }
    const auto chosen = chosen_of(fitted);
    if (!chosen) break;
    Fitted& better = fitted[*chosen];
    for (const Fitted& each : fitted) {
      ExtensionTrial& trial = out.tried[each.trial];
      trial.adopted = each.trial == better.trial;
      const bool better_beats = pays(gain_of(better.candidate, each.candidate));
      trial.rival = !trial.adopted && trial.gain > kLeastGain && !better_beats;
    }
    if (better.extension.alike && is_constant(better.extension.kind)) {
      add_singles(better.extension, fitted, undecided);
    }
    lasting = lasting || better.extension.kind == ExtensionKind::lasting_error;
    best = std::move(better.candidate);
    out.text = model_file_text(best.root);
  }
  Model chosen = out.text.empty() ? given : best.model;
  out.estimate = tune_ml(chosen, recordings, options.search);
  ExpectedErrorsOptions further;
  further.threads = options.search.threads;
  judge_by_expected_errors(best.root, chosen, recordings, out.estimate, further);
  judge_by_curves(best.root, chosen, recordings, out.estimate, {});
  judge_by_undecided(undecided, chosen, recordings, out.estimate);
  const std::vector<std::string> lines = table_of(out.tried);
  out.estimate.notes.insert(out.estimate.notes.end(), lines.begin(), lines.end());
  return out;
}

}  // namespace identikal
