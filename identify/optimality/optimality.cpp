#include "identify/optimality/optimality.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "identify/estimate/distribution.h"
#include "identify/estimate/test_result.h"
#include "identify/filter/report.h"
#include "lib/statistics/autocorrelation.h"
#include "lib/statistics/autoregression.h"
#include "lib/statistics/input_correlation.h"
#include "lib/statistics/normality.h"
#include "lib/statistics/sequential_probability_ratio.h"
#include "lib/statistics/whiteness.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kPairLags = 5, kInputLags = 10, kHighestOrder = 10;
constexpr double kConditionLevel = 0.01;

// A test of the family, its share of the error, and what it is judged by.
struct Member {
  TestResult result;
  double share = 0.0;
  enum class Law { chi_square, nis, f } law = Law::chi_square;
  FStatistic statistic;
};

void judge(Member& member, double level) {
  TestResult& t = member.result;
  const FStatistic& f = member.statistic;
  switch (member.law) {
    case Member::Law::chi_square:
      t = chi_square_test(t.id, t.channel, {f.value, f.dof}, level);
      break;
    case Member::Law::nis:
      t = nis_test({f.value, f.dof}, level);
      break;
    case Member::Law::f:
      t = f_test(t.id, t.channel, f, level);
      break;
  }
  t.level = level;
}

Member member(const char* id, const std::string& channel, const FStatistic& statistic, double share,
              Member::Law law = Member::Law::f) {
  return {reported_figure(id, channel, statistic.value, true), share, law, statistic};
}

Member member(const char* id, const std::string& channel, const ChiSquareStatistic& statistic,
              double share, Member::Law law = Member::Law::chi_square) {
  return member(id, channel, FStatistic{statistic.value, statistic.dof, 0.0}, share, law);
}

// "1 (0.21), 3 (-0.12)": lags whose autocorrelation leaves its own 1 % band, or the largest.
std::string telling_lags(const VectorXd& e, int lags) {
  VectorXd pairs;
  const VectorXd r = autocorrelation(e, lags, &pairs);
  std::vector<int> order(static_cast<std::size_t>(lags));
  std::iota(order.begin(), order.end(), 0);
  const auto size = [&](int k) {  // nothing where there is no pair
    return std::isfinite(r[k]) ? std::abs(r[k]) * std::sqrt(pairs[k]) : 0.0;
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return size(a) > size(b); });
  std::string out;
  for (std::size_t i = 0; i < order.size() && i < 3; ++i) {
    if (i > 0 && size(order[i]) < normal_quantile(1.0 - 0.5 * kConditionLevel)) break;
    out += fmt::format("{}{} ({:.2f})", i == 0 ? "" : ", ", order[i] + 1, r[order[i]]);
  }
  return out;
}

// The strongest correlation of one channel with the past of one.
std::string telling_pair(const MatrixXd& e, int lags, const std::vector<Channel>& outputs) {
  const Autocovariances gamma =
      autocorrelations(sample_autocovariances(e, lags + 1, Divisor::equal_variance));
  Index row = 0, col = 0;
  std::size_t at = 1;
  double largest = -1.0;
  for (std::size_t k = 1; k < gamma.size(); ++k) {
    Index i = 0, j = 0;
    const double value =
        gamma[k].array().isFinite().select(gamma[k].cwiseAbs(), 0.0).maxCoeff(&i, &j);
    if (value > largest) {
      largest = value;
      row = i;
      col = j;
      at = k;
    }
  }
  const std::string& now = outputs[row].name;
  const std::string& past = outputs[col].name;
  return fmt::format("innovations of '{}' correlate with {} {} sample{} before ({:.2f})", now,
                     row == col ? "their own" : "those of '" + past + "'", at, at == 1 ? "" : "s",
                     gamma[at](row, col));
}

// Entries of Q and R: one test each, and in words which to move where.
void report_entries(const ScoreStatistic& score, bool rejected, Optimality& out) {
  const auto k = static_cast<Index>(score.names.size());
  const double limit = normal_quantile(1.0 - 0.5 * kFamilyError / static_cast<double>(k));
  std::vector<Index> order(static_cast<std::size_t>(k));
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index a, Index b) {
    return std::abs(score.direction[a]) > std::abs(score.direction[b]);
  });
  for (Index i = 0; i < k; ++i) {
    const double z = score.direction[i];
    TestResult entry =
        reported_figure("score_entry", score.names[i], z, !rejected || std::abs(z) <= limit);
    entry.interval = {-limit, limit};
    entry.p = normal_two_sided(z);
    out.tests.push_back(entry);
  }
  if (!rejected) return;
  std::string said;
  for (std::size_t i = 0; i < order.size() && i < 3; ++i) {
    const double z = score.direction[order[i]];
    if (i > 0 && std::abs(z) <= limit) break;
    said += fmt::format("{}{} should be {} (z = {:.1f})", i == 0 ? "" : ", ", score.names[order[i]],
                        z > 0.0 ? "larger" : "smaller", z);
  }
  out.faults.push_back("the noise covariances are wrong: taken one at a time, " + said);
}

void explain(const Member& failed, const MatrixXd& e, int lags, const std::vector<Channel>& outputs,
             Optimality& out) {
  const TestResult& t = failed.result;
  const auto channel = [&] {
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      if (outputs[i].name == t.channel) return static_cast<Index>(i);
    }
    return Index{0};
  };
  if (t.id == "nis") {
    out.faults.push_back(fmt::format(
        "innovations are {:.3g} times as large (in variance) as the filter predicts: Q or R is too "
        "{}",
        t.value, t.value > 1.0 ? "small" : "large"));
  } else if (t.id == "portmanteau") {
    out.faults.push_back(telling_pair(e, kPairLags, outputs));
  } else if (t.id == "ljung_box") {
    out.faults.push_back(fmt::format("innovations of '{}' are correlated (p = {:.2g}), at lag {}",
                                     t.channel, t.p,
                                     telling_lags(e.row(channel()).transpose(), lags)));
  } else if (t.id == "mean") {
    Index worst = 0;
    double largest = -1.0, mean = 0.0;
    for (Index i = 0; i < e.rows(); ++i) {
      const Moments m = moments(e.row(i).transpose());
      const double size = m.mean * m.mean * m.samples / m.variance;
      if (size > largest) {
        largest = size;
        worst = i;
        mean = m.mean;
      }
    }
    out.faults.push_back(
        fmt::format("innovations of '{}' have a mean of {:.2g} standard deviations",
                    outputs[worst].name, mean));
  } else if (t.id == "input_correlation") {
    out.faults.push_back(fmt::format(
        "innovations of '{}' follow the inputs (p = {:.2g}): how inputs act, or the delay of one",
        t.channel, t.p));
  }
}

// What the p-values rest on.
void report_conditions(const MatrixXd& e, int lags, const std::vector<Channel>& outputs,
                       Optimality& out) {
  for (std::size_t n = 0; n < outputs.size(); ++n) {
    const VectorXd channel = e.row(static_cast<Index>(n)).transpose();
    const std::pair<const char*, ChiSquareStatistic> conditions[] = {
        {"normality", doornik_hansen(moments(channel))}, {"mcleod_li", mcleod_li(channel, lags)}};
    for (const auto& [id, statistic] : conditions) {
      if (!std::isfinite(statistic.value)) continue;
      Member condition = member(id, outputs[n].name, statistic, 0.0);
      judge(condition, kConditionLevel);
      condition.result.level = kNone;
      out.tests.push_back(condition.result);
      if (condition.result.pass) continue;
      const bool normality = std::string(id) == "normality";
      out.findings.push_back(make_finding(
          normality ? FindingCode::innovations_not_gaussian : FindingCode::innovations_change_size,
          {outputs[n].name},
          fmt::format(
              "innovations of '{}' {} (p = {:.2g}): p-values are approximate", outputs[n].name,
              normality ? "are not Gaussian" : "change their size with time", condition.result.p)));
    }
  }
}

void report_order(const MatrixXd& e, Optimality& out) {
  const auto samples = static_cast<Index>((e.array() == e.array()).colwise().all().count());
  const auto highest = std::min<Index>(kHighestOrder, samples / (5 * e.rows()));
  if (highest < 1 || samples < 3) return;
  const Autoregressions models =
      yule_walker(sample_autocovariances(e, highest + 1, Divisor::samples));
  if (models.S.empty()) return;
  const auto found = static_cast<double>(autoregressive_order(models, samples, Penalty::bic).order);
  TestResult order = reported_figure("ar_order", "", found, found == 0.0);
  order.interval = {0.0, 0.0};
  out.tests.push_back(order);
}

void report_sequential(const MatrixXd& e, Optimality& out) {
  const SequentialProbabilityRatioOptions options;
  SequentialProbabilityRatio test = start_sequential_probability_ratio(e.rows(), options);
  for (Index t = 0; t < e.cols() && test.decision == SequentialDecision::undecided; ++t) {
    update(test, e.col(t));
  }
  const char* verdict = test.decision == SequentialDecision::undecided  ? "undecided"
                        : test.decision == SequentialDecision::coloured ? "coloured"
                                                                        : "white";
  out.notes.push_back(
      fmt::format("sequential test (false alarms {:.3g} %, misses {:.3g} %): {} after {} samples",
                  100.0 * options.false_alarm, 100.0 * options.miss, verdict, test.samples));
}

}  // namespace

Optimality test_optimality(const Model& model, const std::vector<Dataset>& recordings,
                           const std::vector<FilterResult>& of_all) {
  Optimality out;
  const std::vector<Channel> outputs = measured(recordings[0].outputs);
  const std::vector<FilterResult> filters = of_measured(of_all, recordings[0].outputs);
  Index shortest = recordings[0].size();
  for (const Dataset& data : recordings) shortest = std::min(shortest, data.size());
  const int most = default_lags(shortest);
  const Index gap = rows_apart(filters, std::max({most, kPairLags, kInputLags}));
  // With more, Ljung and Box' statistic of a short record scatters more than its distribution says.
  const int lags = std::clamp(static_cast<int>(shortest) / 20, 1, most);
  const MatrixXd e = side_by_side(filters, gap);
  const auto ny = static_cast<double>(e.rows());
  std::vector<Member> family;

  ScoreStatistic score;
  score.status = FilterStatus::undetermined;  // of Student's t there is none
  if (!model.student) score = score_statistic(with_free_noise(model), recordings);
  if (score.status == FilterStatus::ok && score.statistic.dof > 0.0) {
    family.push_back(member("score", "", score.statistic, 0.6));
  }
  family.push_back(member("portmanteau", "", portmanteau(e, std::min(kPairLags, most)), 0.2));
  family.push_back(member("nis", "", normalised_innovation_squared(e), 0.05, Member::Law::nis));
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const VectorXd channel = e.row(static_cast<Index>(i)).transpose();
    family.push_back(member("ljung_box", outputs[i].name, ljung_box(channel, lags), 0.05 / ny));
    if (!std::isfinite(family.back().result.value)) {
      out.notes.push_back("ljung_box of '" + outputs[i].name +
                          "' is not computed: its innovations are constant or missing");
    }
  }
  family.push_back(member("mean", "", mean_test(e), 0.05));
  if (!recordings[0].inputs.empty()) {
    const MatrixXd u = inputs_side_by_side(recordings, gap);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      const VectorXd channel = e.row(static_cast<Index>(i)).transpose();
      family.push_back(member("input_correlation", outputs[i].name,
                              input_correlation(channel, u, std::min(kInputLags, most)),
                              0.05 / ny));
    }
  }

  std::erase_if(family, [](const Member& m) {
    return !std::isfinite(m.result.value) || !(m.statistic.dof > 0.0);
  });
  double shares = 0.0;
  for (const Member& m : family) shares += m.share;
  for (Member& m : family) {
    judge(m, kFamilyError * m.share / shares);
    out.tests.push_back(m.result);
    out.optimal = out.optimal && m.result.pass;
  }
  for (const Member& m : family) {
    if (m.result.id == "score") {
      report_entries(score, !m.result.pass, out);
    } else if (!m.result.pass) {
      explain(m, e, lags, outputs, out);
    }
  }
  report_order(e, out);
  report_conditions(e, lags, outputs, out);
  report_sequential(e, out);
  return out;
}

Optimality test_optimality(const Model& model, const std::vector<RecordingDigest>& digests) {
  Optimality out;
  const ScoreStatistic score = score_statistic(with_free_noise(model), digests);
  if (score.status != FilterStatus::ok || !(score.statistic.dof > 0.0)) return out;
  Member only = member("score", "", score.statistic, 1.0);
  judge(only, kFamilyError);
  out.tests.push_back(only.result);
  out.optimal = only.result.pass;
  report_entries(score, !out.optimal, out);
  return out;
}

}  // namespace identikal
