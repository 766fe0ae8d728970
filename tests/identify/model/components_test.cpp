// Models put together from components are the models that one would write by hand, and say what
// statsmodels says.
#include "identify/model/components.h"

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "identify/filter/forecast.h"
#include "identify/filter/model_filter.h"
#include "identify/filter/recordings_likelihood.h"
#include "identify/model/check.h"
#include "identify/model/model_file.h"
#include "identify/model/recording.h"
#include "lib/model/polynomial_factors.h"
#include "tests/support/structural_series.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr const char* kTrendAndSeason = R"(identikal: 1
time: {step: 1 s}
parameters: {ql: {value: 0.09, min: 0}, qs: {value: 0.0025, min: 0}, qw: {value: 0.02, min: 0}, r: {value: 0.15, min: 0}}
components:
  trend: {kind: trend, variance: {level: ql, slope: qs}}
  season: {kind: season, period: 4, variance: qw}
outputs: {y: {column: y}}
noise: {measurement: {variance: {y: r}}}
)";

constexpr const char* kByHand = R"(identikal: 1
time: {step: 1 s}
parameters: {ql: {value: 0.09, min: 0}, qs: {value: 0.0025, min: 0}, qw: {value: 0.02, min: 0}, r: {value: 0.15, min: 0}}
A: [[1, 1, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, -1, -1, -1], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0]]
C: [[1, 0, 1, 0, 0]]
G: [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]]
Q: [[ql, 0, 0], [0, qs, 0], [0, 0, qw]]
R: [[r]]
initial: diffuse
outputs: [{name: y, column: y}]
)";

Dataset series_of(const Model& model) {
  const auto& y = structural_series::y;
  const auto& u = structural_series::u;
  const std::vector<double> first(u.begin(), u.begin() + static_cast<std::ptrdiff_t>(y.size()));
  return model.inputs.empty() ? recording(model, y, 1.0) : recording(model, y, 1.0, first);
}

double log_likelihood(const Model& model) {
  const std::vector<Dataset> data{series_of(model)};
  RecordingsLikelihood likelihood(model, data);
  const Likelihood* found = likelihood.evaluate(model.parameters, false);
  return found == nullptr ? std::nan("") : found->value;
}

// What statsmodels counts for the diffuse states as well.
double of_diffuse(double states) { return 0.5 * states * std::log(2.0 * std::numbers::pi); }

Model read(const std::string& text) { return parse_model_file(text, "components.yaml"); }

void expect_near(const VectorXd& found, const std::vector<double>& expected, double accuracy) {
  ASSERT_EQ(found.size(), static_cast<Index>(expected.size()));
  for (Index i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i], expected[static_cast<std::size_t>(i)], accuracy) << i;
  }
}

void expect_forecast(const Model& model, const std::vector<double>& mean,
                     const std::vector<double>& sd) {
  Dataset future;
  future.u =
      Eigen::Map<const VectorXd>(structural_series::u.data() + structural_series::y.size(), 6)
          .transpose();
  const OutputForecast ahead =
      forecast(model, series_of(model), 6, model.inputs.empty() ? nullptr : &future);
  expect_near(ahead.forecast.mean.row(0).transpose(), mean, 1e-6);
  expect_near(ahead.forecast.sd.row(0).transpose(), sd, 1e-6);
  EXPECT_EQ(ahead.forecast.time[0], 60.0);
}

TEST(Components, TrendAndSeasonAreTheMatricesOneWouldWrite) {
  const Model model = read(kTrendAndSeason);
  ASSERT_TRUE(is_linear(model));
  const Model by_hand = read(kByHand);
  const double L = log_likelihood(model);
  EXPECT_NEAR(L / log_likelihood(by_hand), 1.0, 1e-12);
  const StateSpace one = instantiate(as_linear(model), model.parameters),
                   other = instantiate(as_linear(by_hand), by_hand.parameters);
  EXPECT_EQ(one.A, other.A);
  EXPECT_EQ(one.C, other.C);
  EXPECT_EQ(one.G * one.Q * one.G.transpose(), other.G * other.Q * other.G.transpose());
}

TEST(Components, TrendAndSeasonAgreeWithStatsmodels) {
  const Model model = read(kTrendAndSeason);
  EXPECT_NEAR(log_likelihood(model), -63.1301127798458 + of_diffuse(5), 1e-6);
  const SmootherResult path = run_smoother(model, model.parameters, series_of(model), std::nullopt);
  expect_near(path.x.col(0),
              {10.337158233710035, -0.0431589743170373, 1.6297123487361296, -1.672239841891283,
               0.8347103608195934},
              1e-6);
  expect_near(path.x.col(21),
              {12.617574357390106, 0.2951111061517926, -0.5833575741753378, 1.5241697730631172,
               -1.7613108839079301},
              1e-6);
  expect_near(path.sd.col(21),
              {0.37975987229828223, 0.08735402175573988, 0.22021409747322532, 0.21859133159791072,
               0.2006267380508799},
              1e-6);
  expect_forecast(model,
                  {29.387114411764923, 28.26963985979391, 29.720996351907452, 27.953935985076214,
                   30.764376987864676, 29.64690243589366},
                  {0.7415267809968771, 0.8324869614195873, 0.9447095241518617, 1.0357404097974117,
                   1.2724918783335863, 1.3977703470040603});
}

TEST(Components, ATrigonometricSeasonAgreesWithStatsmodels) {
  const Model model = read(R"(identikal: 1
time: {step: 1 s}
components:
  trend: {kind: smooth-trend, variance: 0.0025}
  season: {kind: trigonometric, period: 5, variance: 0.01}
outputs: {y: {column: y, equals: trend + season}}
noise: {measurement: {variance: {y: 0.15}}}
)");
  EXPECT_NEAR(log_likelihood(model), -286.12170572145027 + of_diffuse(6), 1e-6);
  expect_forecast(model,
                  {27.0191762539973, 28.045977910233464, 27.914682998621153, 28.665932272173894,
                   28.21021423148361, 27.81818213083298},
                  {0.7101170969649458, 0.7477267843800033, 0.7931404497465784, 0.8446458720359498,
                   0.9006400984773386, 1.1713156228191157});
}

TEST(Components, ALevelAndAnAutoregressionStartEachInItsWay) {
  const std::string text = R"(identikal: 1
time: {step: 1 s}
parameters: {a: 0.5, b: -0.2, q: {value: 0.3, min: 0}}
components:
  level: {kind: level, sd: 0.3}
  rest: {kind: ar, coefficients: [a, b], variance: q}
outputs: {y: {column: y}}
noise: {measurement: {variance: {y: 0.15}}}
)";
  const Model model = read(text);
  EXPECT_NEAR(log_likelihood(model), -230.03648691982133 + of_diffuse(1), 1e-6);
  const SmootherResult path = run_smoother(model, model.parameters, series_of(model), std::nullopt);
  EXPECT_NEAR(path.x(0, 0), 10.548555678694411, 1e-6);
  EXPECT_NEAR(path.x(1, 0), 1.0648314120620566, 1e-6);
  EXPECT_NEAR(path.sd(0, 21), 0.44085666749343333, 1e-6);
  expect_forecast(model,
                  {26.704659464176512, 26.762636305370766, 26.821911916746373, 26.839954354195328,
                   26.83712045064468, 26.832095011379568},
                  {0.8287519917301811, 0.9631410225969984, 1.0167563239370072, 1.0532268404585698,
                   1.0903824189301123, 1.1298861652039724});
  // The start moves with the coefficients.
  const std::vector<Dataset> data{series_of(model)};
  RecordingsLikelihood likelihood(model, data);
  const VectorXd z = free_entries(model.parameters);
  const VectorXd gradient = likelihood.evaluate(model.parameters, true)->gradient;
  for (Index i = 0; i < z.size(); ++i) {
    const auto at = [&](double by) {
      return likelihood
          .evaluate(with_entries(model.parameters, z + by * VectorXd::Unit(z.size(), i)), false)
          ->value;
    };
    EXPECT_NEAR(gradient[i], (at(1e-5) - at(-1e-5)) / 2e-5, 1e-5) << i;
  }
}

std::string arma_model(const std::string& keys, const std::string& parameters = "") {
  const std::string all = parameters.empty() ? "" : "parameters: {" + parameters + "}\n";
  return "identikal: 1\ntime: {step: 1 s}\n" + all +
         "components: {y: {kind: arma, variance: 0.7, " + keys + "}}\noutputs: {y: {column: y}}\n";
}

// SARIMAX(order, seasonal_order, use_exact_diffuse=True), statsmodels 0.13.5, at these parameters.
TEST(Components, SeasonalModelsWithDifferencesAgreeWithStatsmodels) {
  const Model mixed =
      read(arma_model("ar: 1, ma: [b], difference: 1, season: {period: 4, ar: [0.5], ma: 1}",
                      "y_ar1: 0.4, b: -0.3, y_season_ma1: 0.2"));
  EXPECT_NEAR(log_likelihood(mixed), -122.35743044621503 + of_diffuse(1), 1e-6);
  EXPECT_EQ(mixed.parameters.size(), 3U) << "what the file says of y_ar1 holds";
  const Model twice = read(
      arma_model("ar: [0.4, -0.3], difference: 1, season: {period: 4, ma: [-0.5], difference: 1}"));
  EXPECT_NEAR(log_likelihood(twice), -76.60590871972603 + of_diffuse(5), 1e-6);
  expect_forecast(twice,
                  {30.139522240148334, 28.966366252657156, 30.27310692895219, 28.452247208852405,
                   31.629203358072314, 30.521378850239707},
                  {0.8366605125397504, 1.4394446713871023, 1.7841862720005062, 2.0014642956558464,
                   2.3874219907646803, 2.8214058562294446});
  // statsmodels has the intercept of the regression, 5: here it is the mean.
  const Model mean =
      read(arma_model("ar: [0.7], ma: [-0.3, 0.2], mean: mu", "mu: 16.6666666666666667"));
  EXPECT_NEAR(log_likelihood(mean), -347.2981518548243, 1e-6);
}

// Also where the differences are in the state, the coefficients are searched inside the unit circle.
TEST(Components, CoefficientsOfAnArmaAreFactors) {
  for (const bool differences : {false, true}) {
    std::string text =
        arma_model(std::string("ar: 1, ma: 2, ") +
                       (differences ? "difference: 1, season: {period: 4, ma: 1, difference: 1}"
                                    : "season: {period: 4, ma: 1}"),
                   "q: {value: 1, min: 0}");
    text.replace(text.find("0.7"), 3, "q");
    const Model each = read(text);
    const auto found = polynomial_factors(noise_model(each), each.parameters);
    ASSERT_EQ(found.size(), 3U) << differences;
    EXPECT_FALSE(found[0].moving_average);
    EXPECT_EQ(found[1].parameters.size(), 2U);
    EXPECT_EQ(found[2].lag, 4);
    EXPECT_TRUE(found[2].moving_average);
  }
}

TEST(Components, ADampedCycleAgreesWithStatsmodels) {
  const Model model = read(R"(identikal: 1
time: {step: 1 s}
parameters: {p: {value: 9, min: 3}}
components:
  level: {kind: level, variance: 0.09}
  cycle: {kind: cycle, period: p, damping: 0.9, variance: 0.05}
outputs: {y: {column: y}}
noise: {measurement: {variance: {y: 0.15}}}
initial: diffuse
)");
  EXPECT_NEAR(log_likelihood(model), -298.2277574166047 + of_diffuse(3), 1e-6);
  expect_forecast(model,
                  {26.807177414591465, 26.76101965794096, 26.82760566503344, 26.95680756122116,
                   27.081026805783328, 27.147656701516784},
                  {0.6869929804976662, 0.8452752617028017, 0.94781491847485, 1.000916754926232,
                   1.0260216047193493, 1.0416596305435715});
}

TEST(Components, CoefficientsOfInputsAreDiffuseStates) {
  const Model model = read(R"(identikal: 1
time: {step: 1 s}
inputs: {u1: {column: u}}
components:
  level: {kind: level, variance: 0.09}
  effects: [u1]
outputs: {y: {column: y}}
noise: {measurement: {variance: {y: 0.15}}}
)");
  ASSERT_TRUE(changes(model));
  EXPECT_NEAR(log_likelihood(model), -309.86274529460786 + of_diffuse(2), 1e-6);
  const SmootherResult path = run_smoother(model, model.parameters, series_of(model), std::nullopt);
  EXPECT_NEAR(path.x(1, 0), -0.3803363659984885, 1e-6);
  EXPECT_NEAR(path.sd(1, 21), 0.07084129319190903, 1e-6);
  expect_forecast(model,
                  {27.171511482949693, 27.843565841669022, 26.635997879623822, 27.113700355317924,
                   26.840999180897008, 27.567061303588122},
                  {0.5655320277238419, 0.6551859005885317, 0.7118771459876878, 0.7678657887311116,
                   0.8256880423149818, 0.8817454797930179});
}

// In continuous time, against what the same process says by its covariance.
TEST(Components, AMaternProcessHasItsCovariance) {
  for (const double nu : {0.5, 1.5, 2.5}) {
    const Model model = read(R"(identikal: 1
time: {kind: continuous, step: 0.3 s}
components: {x: {kind: matern, smoothness: )" +
                             std::to_string(nu) + R"(, length: 0.8, sd: 1.7}}
outputs: {y: {column: y}}
noise: {measurement: {variance: {y: 0.2}}}
)");
    const StateSpace m = instantiate(as_linear(model), model.parameters);
    MatrixXd P = MatrixXd::Zero(m.states(), m.states());
    for (int i = 0; i < 500; ++i)
      P = (m.A * P * m.A.transpose() + m.G * m.Q * m.G.transpose()).eval();
    const double lambda = std::sqrt(2.0 * nu) / 0.8, d = lambda * 0.3;
    const double polynomial = nu == 0.5 ? 1.0 : nu == 1.5 ? 1.0 + d : 1.0 + d + d * d / 3.0;
    EXPECT_NEAR(P(0, 0), 1.7 * 1.7, 1e-9) << nu;
    EXPECT_NEAR((m.A * P)(0, 0), 1.7 * 1.7 * polynomial * std::exp(-d), 1e-9) << nu;
  }
}

// A clock's flicker is flicker between the ends of its range: S(f) = h / f.
TEST(Components, TheFlickerOfAClockFallsWithTheFrequency) {
  const Model model = read(R"(identikal: 1
time: {kind: continuous, step: 1 s}
components:
  clock:
    kind: clock
    unit: s
    variance: {white-fm: 1e-22, random-walk-fm: 1e-32, flicker-fm: 1e-24}
    flicker-range: [1 s, 1e6 s]
outputs: {phase: {column: x, unit: s}}
noise: {measurement: {sd: {phase: 1 ns}}}
)");
  const StateSpace m = written_matrices(noise_model(model), model.parameters);
  for (const double f : {1e-4, 1e-3}) {
    double density = 0.0;  // of the flicker states, one-sided
    for (Index i = 2; i < m.states(); ++i) {
      const double rate = -m.A(i, i);
      density += 2.0 * m.Q(i, i) / (rate * rate + std::pow(2.0 * std::numbers::pi * f, 2));
    }
    EXPECT_NEAR(density * f / 1e-24, 1.0, 0.02) << f;
  }
}

// A standard deviation is a quantity with its unit, or a number.
TEST(Components, StandardDeviationsMayHaveUnits) {
  const auto variance = [](const std::string& sd) {
    const Model model = read(R"(identikal: 1
time: {step: 1 s}
components: {level: {kind: level, unit: m, sd: )" +
                             sd + R"(}}
outputs: {y: {column: y, unit: m}}
noise: {measurement: {sd: {y: 1 cm}}}
)");
    return instantiate(as_linear(model), model.parameters).Q(0, 0);
  };
  EXPECT_NEAR(variance("30 cm"), 0.09, 1e-15);
  EXPECT_NEAR(variance("0.3"), 0.09, 1e-15);
}

TEST(Components, AreWrittenOutAsAModelFileThatSaysTheSame) {
  const std::string text = written_out(kTrendAndSeason, "components.yaml");
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("components")));
  EXPECT_EQ(log_likelihood(read(text)), log_likelihood(read(kTrendAndSeason)));
}

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Components, MistakesAreShownWhereTheyStand) {
  const std::string text = kTrendAndSeason;
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string out = text;
    const std::size_t at = out.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return out.replace(at, from.size(), to);
  };
  EXPECT_THAT(refusal(with("kind: season", "kind: seasons")),
              testing::HasSubstr("did you mean 'season'"));
  EXPECT_THAT(refusal(with("period: 4", "period: 4.5")),
              testing::HasSubstr("6:34: period is '4.5'"));
  EXPECT_THAT(refusal(with("variance: qw", "variance: qx")),
              testing::HasSubstr("6:47: unknown name 'qx'"));
  EXPECT_THAT(refusal(with("step: 1 s", "kind: continuous, step: 1 s")),
              testing::HasSubstr("'season' is a season, which belongs to discrete time"));
  EXPECT_THAT(refusal(with("slope: qs", "slop: qs")), testing::HasSubstr("slop"));
  EXPECT_THAT(refusal(arma_model("ar: -1")), testing::HasSubstr("a whole number, 0 to 60"));
  EXPECT_THAT(refusal(arma_model("ar: 1, season: {ar: 1}")), testing::HasSubstr("period"));
  EXPECT_THAT(refusal(arma_model("ar: [a]")), testing::HasSubstr("unknown name 'a'"));
}

// Over a second, with w = 0.3 rad/s: the velocity turns by 0.3 rad, the position by its integral.
TEST(Components, ATurnIsTheClosedForm) {
  for (const std::string& rate : {std::string("w"), std::string("0.3 rad/s"), std::string("w/1")}) {
    const Model model = read(R"(identikal: 1
time: {kind: continuous, step: 1 s}
parameters: {)" + std::string(rate[0] == 'w' ? "w: 0.3 rad/s, " : "") +
                             R"(q: {value: 0.5 m^2/s^3, min: 0}, r: {value: 1 m^2, min: 0}}
components: {car: {kind: coordinated-turn, unit: m, rate: )" +
                             rate + R"(, variance: q}}
outputs: {px: {unit: m, equals: car_x}, py: {unit: m, equals: car_y}}
noise: {measurement: {variance: {px: r, py: r}}}
)");
    ASSERT_TRUE(is_linear(model));
    const StateSpace m = instantiate(as_linear(model), model.parameters);
    const double s = std::sin(0.3), c = std::cos(0.3), w = 0.3;
    MatrixXd A(4, 4);
    A << 1, 0, s / w, -(1 - c) / w, 0, 1, (1 - c) / w, s / w, 0, 0, c, -s, 0, 0, s, c;
    EXPECT_LT((m.A - A).cwiseAbs().maxCoeff(), 1e-12) << rate;
    // White acceleration of density q in both directions: what turning cannot change.
    const MatrixXd Q = m.G * m.Q * m.G.transpose();
    EXPECT_NEAR(Q(2, 2), 0.5, 1e-12);
    EXPECT_NEAR(Q(3, 3), 0.5, 1e-12);
    EXPECT_NEAR(Q(2, 3), 0.0, 1e-12);
    EXPECT_NEAR(Q(0, 0), 0.5 * 2.0 * (w - s) / (w * w * w), 1e-12);
  }
}

}  // namespace
}  // namespace identikal
