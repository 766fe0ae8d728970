#include "identify/estimate/estimate.h"

#include <cmath>

#include <Eigen/LU>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/report/console.h"
#include "identify/result/json.h"
#include "lib/base/error.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using ::testing::HasSubstr;

Estimate with_parameters(std::initializer_list<double> values) {
  Estimate estimate;
  estimate.verb = "fit";
  for (const double value : values) {
    EstimatedParameter p;
    p.name = "p" + std::to_string(estimate.parameters.size() + 1);
    p.value = value;
    estimate.parameters.push_back(p);
  }
  return estimate;
}

TEST(JudgeParameters, NamesTheFlatDirectionAndPrintsNoInterval) {
  Estimate e = with_parameters({2.0, 3.0, 10.0});
  // Only p1 + p2 (scaled) and p3 are seen.
  MatrixXd information(3, 3);
  information << 4, 8, 0, 8, 16, 0, 0, 0, 1;
  judge_parameters(e, information, MatrixXd::Identity(3, 3));
  EXPECT_EQ(e.identifiability.rank, 2);
  EXPECT_EQ(e.identifiability.of, 3);
  ASSERT_EQ(e.identifiability.unidentifiable_directions.size(), 1u);
  EXPECT_EQ(e.parameters[0].verdict, Verdict::not_identifiable);
  EXPECT_EQ(e.parameters[0].with, std::vector<std::string>{"p2"});
  EXPECT_TRUE(std::isnan(e.parameters[1].se));
  EXPECT_EQ(e.parameters[2].verdict, Verdict::ok);
  EXPECT_EQ(e.parameters[2].se, 1.0);
}

TEST(JudgeParameters, UnexcitedWeakCorrelatedFixedAndBounded) {
  Estimate e = with_parameters({1.0, 1.0, 1.0, 1.0, 5.0, 0.0});
  e.parameters[4].fixed = true;
  e.parameters[5].verdict = Verdict::at_bound;
  MatrixXd covariance = MatrixXd::Identity(4, 4);
  covariance.diagonal() << 1.0, 0.04, 4.0, 4.0;
  covariance(2, 3) = covariance(3, 2) = 4.0 * 0.95;
  MatrixXd information = covariance.inverse();
  information.row(0).setZero();
  information.col(0).setZero();
  judge_parameters(e, information, covariance);
  EXPECT_EQ(e.parameters[0].verdict, Verdict::unexcited);
  EXPECT_TRUE(std::isnan(e.parameters[0].se));
  EXPECT_EQ(e.parameters[1].verdict, Verdict::ok);
  EXPECT_EQ(e.parameters[2].verdict, Verdict::correlated);
  EXPECT_EQ(e.parameters[2].with, std::vector<std::string>{"p4"});
  EXPECT_TRUE(std::isnan(e.parameters[4].se));
  EXPECT_EQ(e.parameters[5].verdict, Verdict::at_bound);
  EXPECT_THROW(judge_parameters(e, information, MatrixXd::Identity(2, 2)), std::invalid_argument);
}

TEST(ExitCode, FollowsTheContract) {
  Estimate e;
  EXPECT_EQ(exit_code(e, false), 3);
  e.status = Status::ok;
  EXPECT_EQ(exit_code(e, true), 0);
  e.findings.push_back({FindingCode::evaluation_method, Severity::note, {}, "", ""});
  EXPECT_EQ(exit_code(e, true), 0);
  e.findings.push_back({FindingCode::few_samples, Severity::warning, {}, "", ""});
  EXPECT_EQ(exit_code(e, true), 4);
  EXPECT_EQ(exit_code(e, false), 0);
  e.status = Status::untrusted;
  EXPECT_EQ(exit_code(e, true), 1);
}

// What is determined beside a parameter that is not is ok, unless the data do not fit the model.
TEST(Conclude, DoubtsWhatIsDeterminedOnlyWhereTheModelIsWrong) {
  const auto verdict_with = [](FindingCode other) {
    Estimate e = with_parameters({1.0, 2.0});
    for (EstimatedParameter& p : e.parameters) p.verdict = Verdict::ok;
    e.parameters[1].verdict = Verdict::not_identifiable;
    e.findings.push_back({FindingCode::not_identifiable, Severity::serious, {}, "one", ""});
    e.findings.push_back({other, Severity::serious, {}, "another", ""});
    conclude(e, "converged");
    EXPECT_EQ(e.status, Status::rejected);
    return e.parameters[0].verdict;
  };
  EXPECT_EQ(verdict_with(FindingCode::not_identifiable), Verdict::ok);
  EXPECT_EQ(verdict_with(FindingCode::coloured_innovations), Verdict::untrusted);
}

TEST(Report, LinesStayOnThePage) {
  Estimate e = with_parameters({1234567.0, -0.00012345});
  e.findings.push_back(
      {FindingCode::poor_fit,
       Severity::serious,
       {"p1"},
       std::string(300, 'x') + " y " + std::string(70, 'z'),
       "do this and that until all of it is mended and then look at the result once more"});
  e.notes.push_back(
      "a note of many words that goes on and on until it has to be broken into more than a line of "
      "text");
  const std::string text = console_report({&e});
  EXPECT_THAT(text, HasSubstr("SERIOUS"));
  std::size_t begin = 0;
  for (std::size_t end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1) {
    const std::string line = text.substr(begin, end - begin);
    const bool unbreakable = line.find("xxx") != std::string::npos;
    EXPECT_TRUE(unbreakable || line.size() <= 80u) << line;
  }
}

TEST(Report, JsonHasNullForWhatDoesNotExist) {
  Estimate e = with_parameters({1.0});
  const std::string json = result_json({&e}, false, 0.5);
  EXPECT_THAT(json, HasSubstr("\"se\": null"));
  EXPECT_THAT(json, testing::Not(HasSubstr("nan")));
}

}  // namespace
}  // namespace identikal
