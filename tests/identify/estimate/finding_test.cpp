#include "identify/estimate/finding.h"

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/estimate/conclusion.h"
#include "identify/estimate/estimate.h"
#include "identify/result/file.h"
#include "identify/result/json.h"

namespace identikal {
namespace {

using ::testing::HasSubstr;

Finding serious(FindingCode code, std::vector<std::string> about = {}) {
  return {code, Severity::serious, std::move(about), "text of " + std::string(kind_of(code).name)};
}

std::vector<std::string> names(const Findings& findings) {
  std::vector<std::string> out;
  for (const Finding& f : findings) out.push_back(name_of(f));
  return out;
}

TEST(Finding, EveryCodeHasOneRowAndANameOfItsOwn) {
  std::set<std::string_view> seen;
  for (const FindingKind& kind : finding_kinds()) {
    EXPECT_EQ(kind_of(kind.code).name, kind.name);
    EXPECT_TRUE(seen.insert(kind.name).second) << kind.name;
    EXPECT_FALSE(kind.meaning.empty()) << kind.name;
    EXPECT_LE(kind.severity, kind.worst) << kind.name;
    // An effect that no finding can have would mislead readers of the table.
    EXPECT_TRUE(kind.effect == Status::ok || kind.worst == Severity::serious) << kind.name;
    EXPECT_TRUE(kind.effect == Status::ok || kind.in_message != InMessage::nothing) << kind.name;
  }
}

TEST(Finding, NamesOfResultsAreFoundAgain) {
  for (const FindingKind& kind : finding_kinds()) {
    if (concludes(kind.code) || kind.code == FindingCode::other) continue;
    Finding f;
    set_code(f, std::string(kind.name));
    EXPECT_EQ(f.code, kind.code);
    EXPECT_EQ(name_of(f), kind.name);
  }
  // Results print none of these: whatever has the name is of another version.
  Finding f;
  set_code(f, "stopped");
  EXPECT_EQ(f.code, FindingCode::other);
  EXPECT_EQ(name_of(f), "stopped");
  set_code(f, "at_bound");
  EXPECT_EQ(f.code, FindingCode::at_bound);
  EXPECT_EQ(name_of(f), "at_bound");
}

TEST(Finding, ResultsWithUnknownCodesAreReadAndWrittenUnchanged) {
  Estimate e;
  e.findings.push_back({FindingCode::other, Severity::warning, {"x"}, "text", "do", "of_tomorrow"});
  e.findings.push_back(make_finding(FindingCode::few_samples, {}, "few"));
  e.findings.push_back(make_finding(FindingCode::not_converged, {}, "not printed"));
  const std::string json = result_json({&e}, false, 0.5);
  EXPECT_THAT(json, HasSubstr("\"of_tomorrow\""));
  EXPECT_THAT(json, testing::Not(HasSubstr("not printed")));
  StoredResult file;
  file.path = "result.json";
  file.text = json;
  const StoredResult read = parse_stored_result(file);
  EXPECT_EQ(names(read.estimate.findings),
            (std::vector<std::string>{"of_tomorrow", "few_samples"}));
  EXPECT_EQ(read.estimate.findings[0].code, FindingCode::other);
  EXPECT_EQ(read.estimate.findings[1].code, FindingCode::few_samples);
}

TEST(Conclusion, IsOkWithoutEffects) {
  Findings findings;
  for (const FindingKind& kind : finding_kinds()) {
    if (concludes(kind.code)) continue;
    findings.push_back({kind.code, Severity::note, {}, "a note", ""});
    findings.push_back({kind.code, Severity::warning, {}, "a warning", ""});
    if (kind.effect == Status::ok) findings.push_back(serious(kind.code));
  }
  const Conclusion got = conclude(findings, "converged");
  EXPECT_EQ(got.status, Status::ok);
  EXPECT_EQ(got.message, "converged");
  EXPECT_EQ(names(got.findings), names(findings));
  EXPECT_EQ(conclude({}, "done").message, "done");
}

TEST(Conclusion, EveryEffectIsThatOfTheTable) {
  for (const FindingKind& kind : finding_kinds()) {
    const Conclusion got = conclude({serious(kind.code)}, "converged");
    EXPECT_EQ(got.status, kind.effect) << kind.name;
    const std::string text = "text of " + std::string(kind.name);
    switch (kind.in_message) {
      case InMessage::nothing:
        EXPECT_EQ(got.message, "converged");
        break;
      case InMessage::name:
        if (kind.code == FindingCode::other) break;
        EXPECT_EQ(got.message, "do not use these values: " + std::string(kind.name));
        break;
      case InMessage::misfit:
        EXPECT_EQ(got.message, "converged, but the data do not fit the model: see the warnings");
        break;
      case InMessage::text:
        EXPECT_EQ(got.message, text);
        break;
      case InMessage::addition:
        EXPECT_EQ(got.message, "converged" + text);
        break;
    }
    const Conclusion of_tests = conclude({serious(kind.code)}, "converged", Basis::tests);
    // References are no part of what tests ask, and contradict all the same.
    const bool decides = concludes(kind.code) || kind.code == FindingCode::reference_band;
    EXPECT_EQ(of_tests.status, decides ? kind.effect : Status::ok) << kind.name;
  }
}

TEST(Conclusion, TheFirstRankDecides) {
  // Each of them beats all behind it, in whatever order they were found.
  const FindingCode order[] = {FindingCode::stopped,       FindingCode::only_circles,
                               FindingCode::sign_ay,       FindingCode::not_identifiable,
                               FindingCode::not_converged, FindingCode::dead_output,
                               FindingCode::poor_fit};
  for (std::size_t first = 0; first + 1 < std::size(order); ++first) {
    Findings findings;
    for (std::size_t i = std::size(order); i-- > first;) findings.push_back(serious(order[i]));
    const Conclusion got = conclude(findings, "converged");
    EXPECT_EQ(got.status, kind_of(order[first]).effect) << kind_of(order[first]).name;
    if (concludes(order[first])) {
      EXPECT_EQ(got.message, findings.back().text);
    }
  }
}

TEST(Conclusion, TextsOfOneRankAreJoinedAndReasonsNamedOnce) {
  EXPECT_EQ(conclude({serious(FindingCode::does_not_predict), serious(FindingCode::values_differ)},
                     "holds", Basis::tests)
                .message,
            "text of does_not_predict; text of values_differ");
  EXPECT_EQ(conclude({serious(FindingCode::poor_fit), serious(FindingCode::dead_output),
                      serious(FindingCode::poor_fit)},
                     "fitted")
                .message,
            "do not use these values: poor_fit, dead_output");
  // Behind any message.
  const Finding own = make_finding(FindingCode::proves_nothing, {}, ", but it is its own");
  EXPECT_EQ(conclude({own}, "holds").message, "holds, but it is its own");
  EXPECT_EQ(conclude({own}, "holds").status, Status::ok);
  EXPECT_EQ(conclude({own, serious(FindingCode::test_rejects)}, "holds").message,
            "text of test_rejects, but it is its own");
}

TEST(Conclusion, CausesGoBeforeTheirConsequences) {
  const Findings findings = {
      serious(FindingCode::poor_fit, {"r"}), make_finding(FindingCode::implausible_Cf, {"Cf"}, ""),
      make_finding(FindingCode::few_samples, {}, ""),
      make_finding(FindingCode::implausible_Cr, {"Cr"}, ""), serious(FindingCode::sign_ay, {"ay"})};
  const Conclusion got = conclude(findings, "fitted");
  EXPECT_EQ(names(got.findings),
            (std::vector<std::string>{"sign_ay", "consequences", "few_samples"}));
  EXPECT_EQ(got.findings[1].text,
            "also found, as the above causes it: poor_fit (r), implausible (Cf, Cr)");
  EXPECT_EQ(got.findings[1].about, (std::vector<std::string>{"r", "Cf", "Cr"}));
  EXPECT_EQ(got.message, "do not use these values: sign_ay");
  // Where something else decides they are findings of their own.
  Findings circles = findings;
  circles.push_back(serious(FindingCode::only_circles));
  EXPECT_EQ(names(conclude(circles, "").findings), names(circles));
  // A sign that is no more than doubtful explains nothing.
  Findings doubtful = findings;
  doubtful.back().severity = Severity::warning;
  EXPECT_EQ(conclude(doubtful, "").message, "do not use these values: poor_fit");
}

TEST(Finding, TheDocumentHasTheTable) {
  const std::string path = IDENTIKAL_SOURCE_DIR "/docs/troubleshooting.md";
  std::ostringstream document;
  document << std::ifstream(path).rdbuf();
  const std::string text = document.str(), table = finding_table();
  // Its end.
  const std::string wanted = text.substr(0, text.find(table.substr(0, table.find('\n')))) + table;
  if (std::getenv("RENEW") != nullptr) std::ofstream(path) << wanted;
  EXPECT_TRUE(text == wanted || std::getenv("RENEW") != nullptr)
      << "the table of findings has changed (identify/estimate/finding.cpp). To renew " << path
      << ":\nRENEW=1 build/tests/identify_tests --gtest_filter=Finding.TheDocumentHasTheTable";
}

}  // namespace
}  // namespace identikal
