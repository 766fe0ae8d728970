// Are a study's repetitions the same on any number of threads, and are its figures right? Its text
// is compared with what is kept in tests/golden/studies by tests/studies/published_figures.py.
#include "studies/study.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "identify/optimality/bound.h"
#include "lib/base/error.h"
#include "studies/runs.h"
#include "tests/support/scalar_case.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

// A study's CSV without its header.
MatrixXd numbers(const std::string& csv) {
  std::vector<std::vector<double>> rows;
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  MatrixXd out(rows.size(), rows.front().size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    out.row(static_cast<Index>(i)) =
        Eigen::Map<const Eigen::RowVectorXd>(rows[i].data(), out.cols());
  }
  return out;
}

TEST(Repeat, DrawsDependOnSeedStreamAndRunAlone) {
  const auto draws = [](std::uint64_t seed, std::uint64_t stream, int threads) {
    StudyOptions options;
    options.runs = 37;
    options.seed = seed;
    options.threads = threads;
    int last = 0;
    options.progress = [&](int done, int of) {
      EXPECT_EQ(of, 37);
      last = done;
    };
    std::vector<double> out(37);
    repeat(options, stream,
           [&](int run, Random& random) { out[static_cast<std::size_t>(run)] = random.uniform(); });
    EXPECT_EQ(last, 37);
    return out;
  };
  const std::vector<double> one = draws(1, 0, 1);
  for (const int threads : {2, 5, 100, 0}) EXPECT_EQ(draws(1, 0, threads), one);
  EXPECT_NE(draws(2, 0, 2), one);
  EXPECT_NE(draws(1, 1, 2), one);
  EXPECT_NE(one[0], one[1]);
}

TEST(Repeat, TheFirstFailureIsThrown) {
  StudyOptions options;
  options.runs = 40;
  for (const int threads : {1, 4}) {
    options.threads = threads;
    std::atomic<int> began{0};
    try {
      repeat(options, 0, [&](int run, Random&) {
        ++began;
        if (run % 10 == 7) throw std::runtime_error(std::to_string(run));
      });
      FAIL();
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "7");
    }
    EXPECT_LT(began, 40);
  }
}

TEST(Study, TableIsTheSameOnAnyNumberOfThreads) {
  StudyOptions options;
  options.runs = 2;
  options.threads = 1;
  const std::string one = study("matisko-table-7", options).text;
  options.threads = 2;
  EXPECT_EQ(study("matisko-table-7", options).text, one);
  EXPECT_NE(one.find("2 runs"), std::string::npos);
}

TEST(Study, RunsOfWhatIsNotRepeatedAreRefused) {
  StudyOptions options;
  options.runs = 5;
  EXPECT_THROW(study("matisko-figure-6", options), InputError);
  EXPECT_THROW(study("matisko-figure-7", options), InputError);
}

// One sample says nothing but how large Q / (1 - a^2) + R is.
TEST(StudyFigure, OneSampleHasARidge) {
  const StudyReport report = study("matisko-figure-4");
  const MatrixXd at = numbers(report.csv);
  ASSERT_EQ(at.rows(), 6400);
  ASSERT_TRUE(report.figure);
  const std::size_t from = report.text.find("y = ") + 4;
  const double y = std::stod(report.text.substr(from));
  double worst = 0.0;
  for (Index i = 0; i < at.rows(); ++i) {
    const double S = at(i, 0) / 0.75 + at(i, 1);
    const double density = std::exp(-0.5 * y * y / S) / std::sqrt(2.0 * M_PI * S);
    worst = std::max(worst, std::abs(at(i, 2) / density - 1.0));
  }
  std::printf("figure 4: %.1e of the normal density\n", worst);
  EXPECT_LT(worst, 1e-3);  // y is printed with four decimals, the density with six digits
}

TEST(StudyFigure, PosteriorIsADensityAsWideAsTheBound) {
  const StudyReport report = study("matisko-figure-5");
  const MatrixXd at = numbers(report.csv);
  ASSERT_EQ(at.rows(), 6400);
  const double cell = (6.0 - 0.075) / 79.0 * (14.0 - 6.1) / 79.0;
  EXPECT_NEAR(at.col(2).sum() * cell, 1.0, 1e-4);
  // The map holds nearly all of it: little is left at its border, but for that of Q, which is zero.
  double border = 0.0;
  for (Index i = 0; i < at.rows(); ++i) {
    const Index q = i / 80, r = i % 80;
    if (q == 79 || r == 0 || r == 79) border = std::max(border, at(i, 2));
  }
  EXPECT_LT(border, 0.001 * at.col(2).maxCoeff());
  // One recording scatters around the bound.
  BoundOptions options;
  options.samples = 2000;
  const CramerRaoBound bound = bound_of(scalar_model(0.5, 2.0, 10.0), options, nullptr);
  const Eigen::VectorXd weight = at.col(2) * cell;
  for (Index i = 0; i < 2; ++i) {
    const double mean = weight.dot(at.col(i));
    const double sd = std::sqrt(weight.dot((at.col(i).array() - mean).square().matrix()));
    const double ratio = sd / bound.parameters[static_cast<std::size_t>(i)].crb_se;
    std::printf("figure 5: posterior %s %.3f of the bound\n", i == 0 ? "Q" : "R", ratio);
    EXPECT_NEAR(ratio, 1.0, 0.15);
  }
}

// The scalar Riccati equation is quadratic: P^2 + ((1 - a^2) R - Q) P - Q R = 0.
TEST(StudyFigure, SensitivitiesAreDerivativesOfTheGain) {
  const MatrixXd at = numbers(study("matisko-figure-6").csv);
  ASSERT_EQ(at.rows(), 61 * 61);
  const double a = 0.95;
  const auto gain = [a](double q, double r) {
    const double b = (1.0 - a * a) * r - q, P = 0.5 * (-b + std::sqrt(b * b + 4.0 * q * r));
    return a * P / (P + r);
  };
  double worst = 0.0;
  for (Index i = 0; i < at.rows(); ++i) {
    const double q = at(i, 0), r = at(i, 1), h = 1e-5;
    const double by_q = (gain(q * (1 + h), r) - gain(q * (1 - h), r)) / (2 * h * q);
    const double by_r = (gain(q, r * (1 + h)) - gain(q, r * (1 - h))) / (2 * h * r);
    worst = std::max({worst, std::abs(at(i, 2) / gain(q, r) - 1.0), std::abs(at(i, 3) / by_q - 1.0),
                      std::abs(at(i, 4) / by_r - 1.0), std::abs(r * by_r / (q * by_q) + 1.0)});
  }
  std::printf("figure 6: %.1e of differences of the gain\n", worst);
  EXPECT_LT(worst, 2e-5);
}

TEST(StudyFigure, BoundsOfFigure15) {
  StudyOptions options;
  options.runs = 2;
  const MatrixXd at = numbers(study("matisko-figure-15", options).csv);
  ASSERT_EQ(at.rows(), 7);
  ASSERT_EQ(at.cols(), 3 + 2 * 5);
  EXPECT_TRUE(at.allFinite());
  EXPECT_TRUE((at.col(1).array() > at.col(2).array()).all());
  for (Index i = 0; i < 7; ++i) {
    EXPECT_NEAR(at(i, 2) * at(i, 0) / (2.0 * 2.0 * 2.0), 1.0, 1e-5);
    BoundOptions of;
    of.samples = static_cast<Index>(at(i, 0));
    const CramerRaoBound bound = bound_of(scalar_model(-0.5, 10.0, 2.0), of, nullptr);
    EXPECT_NEAR(at(i, 1) / std::pow(bound.parameters[1].crb_se, 2), 1.0, 1e-5);
  }
}

}  // namespace
}  // namespace identikal
