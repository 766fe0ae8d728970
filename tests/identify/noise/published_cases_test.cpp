// Do the likelihood and its maximum agree with what other programs printed, digit for digit?
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string>
#include <vector>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "identify/filter/recordings_likelihood.h"
#include "identify/noise/ml.h"
#include "lib/data/csv.h"
#include "lib/filter/likelihood.h"
#include "tests/support/matisko_systems.h"
#include "tests/support/scalar_case.h"
#include "tests/support/shared_data.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Json = nlohmann::json;

constexpr const char* kCases = "likelihood/cases.json";
const double kLog2Pi = std::log(2.0 * std::numbers::pi);

const Json& published(const std::string& id) {
  static const Json cases = Json::parse(std::ifstream(shared_file(kCases)));
  for (const Json& c : cases) {
    if (c["id"] == id) return c;
  }
  throw std::invalid_argument("no case " + id);
}

MatrixXd row(const Json& numbers) {
  const auto values = numbers.get<std::vector<double>>();
  return Eigen::Map<const MatrixXd>(values.data(), 1, static_cast<Index>(values.size()));
}

// Half a unit of the last digit printed. The JSON reader keeps the shortest digits that give the
// same double, so only trailing zeros are lost.
double half_unit(const Json& number) {
  const std::string text = number.dump();
  const std::size_t e = text.find('e'), point = text.find('.');
  int power = e == std::string::npos ? 0 : std::stoi(text.substr(e + 1));
  if (point != std::string::npos) power -= static_cast<int>(std::min(e, text.size()) - point) - 1;
  return 0.5 * std::pow(10.0, power);
}

void print(const std::string& what, double reached, const Json& number) {
  std::printf("%-44s %.12g, published %s\n", what.c_str(), reached, number.dump().c_str());
}

// To every digit printed, as far as a double has them after a thousand sums. `of_inputs` is what
// the rounding of the printed parameters may change.
void expect_printed(const std::string& what, double reached, const Json& number,
                    double of_inputs = 0.0) {
  print(what, reached, number);
  const double value = number.get<double>();
  EXPECT_NEAR(reached, value, std::max(half_unit(number) + of_inputs, 1e-12 * std::abs(value)))
      << what;
}

// The same where the digits beyond the last were cut off rather than rounded.
void expect_cut_off(const std::string& what, double reached, const Json& number) {
  print(what, reached, number);
  const double beyond = std::abs(reached) - std::abs(number.get<double>());
  EXPECT_GE(beyond, 0.0) << what;
  EXPECT_LT(beyond, 2.0 * half_unit(number)) << what;
}

// Nobody's printed estimate may be better than our maximum, nor worse by more than the relative
// change of the likelihood at which that program stops its search.
constexpr double kStata = 1e-7, kR = 1e-8;
void expect_not_beaten(const std::string& what, double maximum, double at_printed,
                       double stopped_at) {
  std::printf("%-44s %.12g, above the published estimate by %.1e\n", what.c_str(), maximum,
              maximum - at_printed);
  EXPECT_GE(maximum, at_printed - 1e-11 * std::abs(at_printed)) << what;
  EXPECT_LE(maximum - at_printed, stopped_at * std::abs(at_printed)) << what;
}

// One output, nothing in it yet; the state starts at zero, exactly known unless told otherwise.
Model empty_model(const std::string& name, Index n, Index nw, Index nu = 0) {
  Model model;
  model.name = name;
  LinearModel& m = as_linear(model);
  m.A.constant = m.P0.constant = MatrixXd::Zero(n, n);
  m.B.constant = MatrixXd::Zero(n, nu);
  m.C.constant = MatrixXd::Zero(1, n);
  m.D.constant = MatrixXd::Zero(1, nu);
  m.G.constant = MatrixXd::Zero(n, nw);
  m.Q.constant = MatrixXd::Zero(nw, nw);
  m.R.constant = MatrixXd::Zero(1, 1);
  m.S.constant = MatrixXd::Zero(nw, 1);
  m.x0.constant = MatrixXd::Zero(n, 1);
  return model;
}

int add_parameter(Model& model, const std::string& name, double value, bool variance = false) {
  Parameter p;
  p.name = name;
  p.value = MatrixXd::Constant(1, 1, value);
  if (variance) p.min = 0.0;
  model.parameters.push_back(p);
  return static_cast<int>(model.parameters.size()) - 1;
}

// AR(p) in companion form with a regression on the inputs:
// y = beta' u + z,  z = phi_1 z(t-1) + ... + w.  Parameters: phi, beta, sigma2.
Model autoregression(Index p, Index regressors) {
  Model model = empty_model("AR", p, 1, regressors);
  LinearModel& m = as_linear(model);
  for (int i = 0; i < p; ++i) {
    m.A.entries.push_back({0, i, add_parameter(model, "phi" + std::to_string(i + 1), 0.1), 1.0});
    if (i > 0) m.A.constant(i, i - 1) = 1.0;
  }
  for (int i = 0; i < regressors; ++i) {
    m.D.entries.push_back({0, i, add_parameter(model, "beta" + std::to_string(i), 1.0), 1.0});
  }
  m.C.constant(0, 0) = m.G.constant(0, 0) = 1.0;
  m.Q.entries = {{0, 0, add_parameter(model, "sigma2", 1.0, true), 1.0}};
  return model;
}

// ARMA(1,1) about a mean, Hamilton's form: z = phi z(t-1) + w,  y = mean + z + theta z(t-1).
// Parameters: phi, theta, mean, sigma2.
Model arma_hamilton() {
  Model model = empty_model("ARMA", 2, 1, 1);
  LinearModel& m = as_linear(model);
  m.A.entries = {{0, 0, add_parameter(model, "phi", 0.5), 1.0}};
  m.C.entries = {{0, 1, add_parameter(model, "theta", 0.1), 1.0}};
  m.D.entries = {{0, 0, add_parameter(model, "mean", 1.0), 1.0}};
  m.A.constant(1, 0) = m.C.constant(0, 0) = m.G.constant(0, 0) = 1.0;
  m.Q.entries = {{0, 0, add_parameter(model, "sigma2", 1.0, true), 1.0}};
  return model;
}

// The same process with one state and one noise for state and output: Q = R = S.
Model arma_innovations() {
  Model model = empty_model("ARMA", 1, 1, 1);
  LinearModel& m = as_linear(model);
  m.A.entries = {{0, 0, add_parameter(model, "phi", 0.5), 1.0}};
  m.G.entries = {{0, 0, 0, 1.0}, {0, 0, add_parameter(model, "theta", 0.1), 1.0}};
  m.D.entries = {{0, 0, add_parameter(model, "mean", 1.0), 1.0}};
  m.C.constant(0, 0) = 1.0;
  m.Q.entries = {{0, 0, add_parameter(model, "sigma2", 1.0, true), 1.0}};
  m.R.entries = m.S.entries = m.Q.entries;
  return model;
}

// Random walk plus noise. Parameters: r, q.
Model local_level() {
  Model model = empty_model("local level", 1, 1);
  LinearModel& m = as_linear(model);
  m.A.constant(0, 0) = m.C.constant(0, 0) = m.G.constant(0, 0) = 1.0;
  m.R.entries = {{0, 0, add_parameter(model, "r", 10000.0, true), 1.0}};
  m.Q.entries = {{0, 0, add_parameter(model, "q", 1000.0, true), 1.0}};
  m.initial = InitialState::diffuse;
  return model;
}

Dataset recording(const MatrixXd& y, const MatrixXd& u) {
  Dataset data = dataset_of(y);
  data.u = u;
  for (Index i = 0; i < u.rows(); ++i) data.inputs.push_back({"u" + std::to_string(i + 1), ""});
  return data;
}
Dataset recording(const MatrixXd& y) { return recording(y, MatrixXd(0, y.cols())); }
Dataset recording_about_mean(const MatrixXd& y) {
  return recording(y, MatrixXd::Ones(1, y.cols()));
}

MatrixXd differences(const MatrixXd& y, Index lag) {
  return y.rightCols(y.cols() - lag) - y.leftCols(y.cols() - lag);
}

double value_at(const Model& model, const Dataset& data, const std::vector<double>& at) {
  const VectorXd x = Eigen::Map<const VectorXd>(at.data(), static_cast<Index>(at.size()));
  LikelihoodEngine engine;
  engine.add_recording(data.y, data.u);
  const Likelihood& l =
      engine.evaluate(instantiate(as_linear(model), with_coordinates(model.parameters, x)),
                      as_linear(model).initial);
  EXPECT_EQ(l.status, FilterStatus::ok) << describe(l.status);
  return l.value;
}

NoiseEstimate maximum_of(const Model& model, const Dataset& data, int starts = 5,
                         Status expected = Status::ok) {
  NoiseMlOptions options;
  options.starts = starts;
  const NoiseEstimate e = tune_ml(model, {data}, options);
  EXPECT_EQ(e.status, expected) << e.message;
  return e;
}

// The log-likelihood of the samples from `first` on, given those before: a difference of two.
class LaterLikelihood {
 public:
  LaterLikelihood(const Model& model, const Dataset& data, Index first)
      : all_{data},
        before_{data},
        of_all_(model, all_, EvaluationMethod::time_varying),
        of_before_(model, cut(before_, first), EvaluationMethod::time_varying) {}

  LikelihoodProblem problem() {
    LikelihoodProblem out = of_all_.problem();
    const auto all = out.evaluate, before = of_before_.problem().evaluate;
    out.evaluate = [all, before](const VectorXd& x, double& L, VectorXd* g, MatrixXd* J) {
      double L0 = 0.0;
      VectorXd g0;
      MatrixXd J0;
      if (!all(x, L, g, J) || !before(x, L0, g ? &g0 : nullptr, J ? &J0 : nullptr)) return false;
      L -= L0;
      if (g) *g -= g0;
      if (J) *J -= J0;
      return true;
    };
    return out;
  }

  double value_at(const VectorXd& x) {
    double L = 0.0;
    EXPECT_TRUE(problem().evaluate(x, L, nullptr, nullptr));
    return L;
  }

  Solution maximum_from(const VectorXd& start) {
    SolverOptions options;
    options.decrement_tolerance = 1e-15;
    const Solution out = maximise(problem(), start, options);
    EXPECT_TRUE(out.summary.usable()) << out.summary.message;
    return out;
  }

 private:
  static const std::vector<Dataset>& cut(std::vector<Dataset>& data, Index first) {
    data[0].y = data[0].y.leftCols(first).eval();
    data[0].u = data[0].u.leftCols(first).eval();
    data[0].time = data[0].time.head(first).eval();
    return data;
  }
  std::vector<Dataset> all_, before_;
  RecordingsLikelihood of_all_, of_before_;
};

// log|X'X| / 2, X the output's response to a unit of each initial state: what KFAS's marginal
// likelihood adds to the diffuse one.
double marginal_minus_diffuse(const StateSpace& m, Index N) {
  MatrixXd X(N, m.states()), C = m.C;
  for (Index t = 0; t < N; ++t) {
    X.row(t) = C;
    C = (C * m.A).eval();
  }
  return Eigen::LLT<MatrixXd>(X.transpose() * X).matrixLLT().diagonal().array().log().sum();
}

// Estimates to a thousandth of their standard errors: half a millionth of log-likelihood.
void expect_estimates(const Estimate& e, const std::vector<double>& at) {
  ASSERT_EQ(e.parameters.size(), at.size());
  for (std::size_t i = 0; i < at.size(); ++i) {
    const EstimatedParameter& p = e.parameters[i];
    std::printf("  %-8s %.10g, published %.10g\n", p.name.c_str(), p.value, at[i]);
    EXPECT_LT(std::abs(p.value - at[i]), 1e-3 * p.se) << p.name;
  }
}

TEST(PublishedCases, NileLocalLevel) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("nile_local_level_diffuse");
  const Json& L = c["loglik_conventions"];
  const Dataset data = recording(row(c["y"]));
  const Model model = local_level();
  const std::vector<double> mle = {c["mle"]["sigma2_eps"], c["mle"]["sigma2_eta"]};

  // Ours is Durbin & Koopman's, without log 2 pi of the one diffuse observation.
  const double value = value_at(model, data, mle);
  expect_printed("Nile, KFAS diffuse", value, L["diffuse_without_log2pi_of_diffuse_obs_KFAS"]);
  expect_printed("Nile, + log 2 pi of the diffuse observation", value - 0.5 * kLog2Pi,
                 L["full_n_log2pi_statsmodels_exact_diffuse"]);
  const StateSpace system = instantiate(as_linear(model), model.parameters);
  expect_printed("Nile, KFAS marginal", value + marginal_minus_diffuse(system, data.size()),
                 L["KFAS_marginal"]);

  const NoiseEstimate e = maximum_of(model, data);
  expect_printed("Nile, maximum", e.objective.log_likelihood,
                 L["diffuse_without_log2pi_of_diffuse_obs_KFAS"]);
  expect_estimates(e, mle);
  const Json& se = c["se_observed_information"];
  expect_printed("  se of eps", e.parameters[0].se, se["sigma2_eps"]);
  expect_printed("  se of eta", e.parameters[1].se, se["sigma2_eta"]);
}

TEST(PublishedCases, NileLocalLevelWithOtherStarts) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("nile_local_level_diffuse");
  const Json& L = c["loglik_conventions"];
  const Dataset data = recording(row(c["y"]));
  const auto N = static_cast<double>(data.size());

  // R's StructTS: x(0) = y(1) with 1e4 times the variance of y, one step before the first sample.
  Model model = local_level();
  as_linear(model).initial = InitialState::given;
  as_linear(model).P0.entries = as_linear(model).Q.entries;
  as_linear(model).x0.constant(0, 0) = data.y(0, 0);
  as_linear(model).P0.constant(0, 0) =
      1e4 * (data.y.array() - data.y.mean()).square().sum() / (N - 1.0);
  NoiseEstimate e = maximum_of(model, data);
  expect_printed("Nile, R StructTS", e.objective.log_likelihood, L["StructTS_R"]);

  // dlm: x(0) ~ N(0, 1e7), the negative without log 2 pi.
  as_linear(model).x0.constant(0, 0) = 0.0;
  as_linear(model).P0.constant(0, 0) = 1e7;
  e = maximum_of(model, data);
  expect_printed("Nile, dlm", -e.objective.log_likelihood - 0.5 * N * kLog2Pi,
                 L["dlm_C0_1e7_negll_no_2pi"]);

  // MARSS: x(1) itself unknown and not random. Its two searches stop at different values, so
  // neither is the maximum.
  as_linear(model).P0.entries.clear();
  as_linear(model).P0.constant(0, 0) = 0.0;
  as_linear(model).x0.entries = {{0, 0, add_parameter(model, "x1", 1000.0), 1.0}};
  e = maximum_of(model, data);
  for (const char* search : {"MARSS_x0_estimated_EM", "MARSS_x0_estimated_BFGS"}) {
    print("Nile, " + std::string(search), e.objective.log_likelihood, L[search]);
    EXPECT_GT(e.objective.log_likelihood, L[search].get<double>());
  }

  // x(1) ~ N(0, 1e6), the first sample not counted.
  model = local_level();
  as_linear(model).initial = InitialState::given;
  as_linear(model).P0.constant(0, 0) = 1e6;
  LaterLikelihood later(model, data, 1);
  // statsmodels' default search stops early, at 15078 and 1479.
  expect_printed("Nile, statsmodels approximately diffuse",
                 later.value_at(Eigen::Vector2d(15078.0, 1479.0)),
                 L["approx_diffuse_P1_1e6_burn1_statsmodels"]);
  const Solution s = later.maximum_from(coordinates(model.parameters));
  expect_cut_off("Nile, StateSpaceModels.jl", s.summary.objective,
                 L["approx_diffuse_StateSpaceModels_jl"]);
}

TEST(PublishedCases, NileConcentrated) {
  // Durbin & Koopman (2012), table 2.1: q = sigma2_eta / sigma2_eps given, the scale concentrated
  // out and all constants dropped.
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("nile_local_level_diffuse");
  const Dataset data = recording(row(c["y"]));
  const auto proper = static_cast<double>(data.size() - 1);
  const Model model = local_level();
  for (const auto& [key, line] :
       c["recomputed_here"]["table2_1_concentrated_no_constants"].items()) {
    const double q = std::stod(key);
    const StateSpace unit =
        instantiate(as_linear(model), with_coordinates(model.parameters, Eigen::Vector2d(1.0, q)));
    const FilterResult f = kalman_filter(unit, InitialState::diffuse, data.y, data.u);
    const double scale =
        f.standardised.rightCols(data.size() - f.first_proper).squaredNorm() / proper;
    expect_printed("Nile, scale at q = " + key, scale, line[1]);
    expect_printed("Nile, concentrated at q = " + key,
                   value_at(model, data, {scale, q * scale}) + 0.5 * proper * (kLog2Pi + 1.0),
                   line[0]);
    if (key != "0.0973") continue;
    // The book's estimates are this rounded q times its scale, not the maximum's 1469.18.
    expect_printed("  the book's sigma2_eps", scale, c["mle_published"]["sigma2_eps"]);
    expect_printed("  the book's sigma2_eta", q * scale, c["mle_published"]["sigma2_eta"]);
  }
}

TEST(PublishedCases, NileWithGaps) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("nile_missing");
  Dataset data = recording(row(published("nile_local_level_diffuse")["y"]));
  data.y.middleCols(20, 20).setConstant(std::nan(""));
  data.y.middleCols(60, 20).setConstant(std::nan(""));
  Model model = local_level();
  const std::vector<double> mle = {c["mle"]["sigma2_eps"], c["mle"]["sigma2_eta"]};
  expect_printed("Nile with gaps, KFAS", value_at(model, data, mle), c["loglik_diffuse_KFAS"]);
  const NoiseEstimate e = maximum_of(model, data);
  expect_printed("Nile with gaps, maximum", e.objective.log_likelihood, c["loglik_diffuse_KFAS"]);
  expect_estimates(e, mle);
  // x(1) ~ N(0, 1e6), the first sample not counted.
  as_linear(model).initial = InitialState::given;
  as_linear(model).P0.constant(0, 0) = 1e6;
  const Solution s = LaterLikelihood(model, data, 1).maximum_from(coordinates(model.parameters));
  expect_cut_off("Nile with gaps, StateSpaceModels.jl", s.summary.objective,
                 c["loglik_approx_diffuse_StateSpaceModels_jl"]);
}

TEST(PublishedCases, Clark1987) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("kim_nelson_clark1987");
  const Json& p = c["parameters"];
  const MatrixXd y = row(c["y"]).array().log();
  const Index first = c["start_obs_for_loglik"].get<Index>() - 1;
  Model model = empty_model("Clark", 4, 4);
  LinearModel& m = as_linear(model);
  m.initial = InitialState::given;
  m.A.constant << 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1;
  m.C.constant << 1, 1, 0, 0;
  m.G.constant.setIdentity();
  m.P0.constant = 100.0 * MatrixXd::Identity(4, 4);
  const char* sd[] = {"sigma_v", "sigma_e", "", "sigma_w"};
  for (const int i : {0, 1, 3}) {
    const double s = p[sd[i]];
    m.Q.entries.push_back({i, i, add_parameter(model, sd[i], s * s, true), 1.0});
  }
  m.A.entries.push_back({1, 1, add_parameter(model, "phi1", p["phi1"]), 1.0});
  m.A.entries.push_back({1, 2, add_parameter(model, "phi2", p["phi2"]), 1.0});

  // At the printed parameters, with T P0 T' as the initial covariance.
  StateSpace system = instantiate(m, model.parameters);
  system.P0 = (system.A * system.P0 * system.A.transpose()).eval();
  LikelihoodEngine all, before;
  const MatrixXd none(0, y.cols()), y_before = y.leftCols(first), none_before(0, first);
  all.add_recording(y, none);
  before.add_recording(y_before, none_before);
  const double value = all.evaluate(system, InitialState::given).value -
                       before.evaluate(system, InitialState::given).value;

  // Their filter starts with a prediction: a missing sample before the first. It adds Q to T P0 T',
  // which is 3e-7 of it, and is linear in the parameters.
  MatrixXd late(1, y.cols() + 1);
  late << std::nan(""), y;
  LaterLikelihood later(model, recording(late), first + 1);
  const VectorXd at = coordinates(model.parameters);
  VectorXd gradient;
  MatrixXd information;
  double L = 0.0;
  ASSERT_TRUE(later.problem().evaluate(at, L, &gradient, &information));
  EXPECT_NEAR(L, value, 1e-8);
  // The last of sigma_w's three digits alone is worth 8e-6.
  double of_inputs = 0.0;
  for (Index i = 0; i < at.size(); ++i) {
    const std::string& name = model.parameters[i].name;
    const double slope = i < 3 ? 2.0 * std::sqrt(at[i]) : 1.0;  // d variance / d sigma
    of_inputs += std::abs(gradient[i]) * slope * half_unit(p[name]);
  }
  expect_printed("Clark, at the printed parameters", value, c["loglik"], of_inputs);
  const Solution s = later.maximum_from(at);
  expect_printed("Clark, maximum", s.summary.objective, c["loglik"]);
  for (Index i = 0; i < 3; ++i) {
    const std::string& name = model.parameters[i].name;
    expect_printed("  " + name, std::sqrt(s.x[i]), p[name]);
  }
}

TEST(PublishedCases, WholesalePricesAr3) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("stata_wpi1_ar3");
  const Json& x = c["expected"];
  const Dataset data = recording(differences(row(c["y"]), 1));
  const Model model = autoregression(3, 0);
  std::vector<double> at = x["params_ar"];
  at.push_back(x["params_variance"][0]);
  const double value = value_at(model, data, at);
  expect_printed("wpi1 AR(3), Stata", value, x["loglike"]);
  const NoiseEstimate e = maximum_of(model, data);
  expect_not_beaten("wpi1 AR(3), maximum", e.objective.log_likelihood, value, kStata);
  expect_estimates(e, at);
  for (std::size_t i = 0; i < 4; ++i) {
    expect_printed("  se of " + e.parameters[i].name, e.parameters[i].se,
                   i < 3 ? x["se_ar"][i] : x["se_variance"][0]);
  }
}

TEST(PublishedCases, WholesalePricesArma) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("stata_wpi1_stationary");
  const Json& x = c["expected"];
  const Dataset data = recording_about_mean(differences(row(c["y"]), 1));
  const std::vector<double> at = {x["params_ar"][0], x["params_ma"][0], x["params_mean"][0],
                                  x["params_variance"][0]};
  for (const bool hamilton : {true, false}) {
    const Model model = hamilton ? arma_hamilton() : arma_innovations();
    const std::string name = hamilton ? "wpi1 ARMA(1,1)" : "wpi1 ARMA(1,1), Q = R = S";
    const double value = value_at(model, data, at);
    expect_printed(name + ", Stata", value, x["loglike"]);
    const NoiseEstimate e = maximum_of(model, data);
    expect_not_beaten(name + ", maximum", e.objective.log_likelihood, value, kStata);
    expect_estimates(e, at);
  }
}

TEST(PublishedCases, WholesalePricesArmaDiffuse) {
  // x(1) ~ N(0, 1e9 I) in Hamilton's form. Its second state is seen through theta only, so the
  // likelihood rises without meaning towards theta = 0 and Stata's is a local maximum: start there.
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("stata_wpi1_diffuse");
  const Json& x = c["expected"];
  const std::vector<Dataset> data = {recording_about_mean(differences(row(c["y"]), 1))};
  const Eigen::Vector4d at(x["params_ar"][0], x["params_ma"][0], x["params_mean"][0],
                           x["params_variance"][0]);
  Model model = arma_hamilton();
  as_linear(model).initial = InitialState::given;
  as_linear(model).P0.constant = x["initial_variance"].get<double>() * MatrixXd::Identity(2, 2);
  const double value = value_at(model, data[0], {at.begin(), at.end()});
  expect_printed("wpi1 ARMA(1,1) diffuse, Stata", value, x["loglike"]);
  RecordingsLikelihood likelihood(model, data);
  SolverOptions options;
  options.decrement_tolerance = 1e-15;
  const Solution s = maximise(likelihood.problem(), at, options);
  EXPECT_TRUE(s.summary.usable()) << s.summary.message;
  expect_not_beaten("wpi1 ARMA(1,1) diffuse, maximum", s.summary.objective, value, kStata);
  for (Index i = 0; i < 4; ++i) {
    std::printf("  %-8s %.10g, published %.10g\n", model.parameters[i].name.c_str(), s.x[i], at[i]);
  }
}

TEST(PublishedCases, AirlineModel) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("stata_air2_stationary");
  const Json& x = c["expected"];
  // (1 + theta B)(1 + Theta B^12) as a cascade, m = e + theta e(t-1), y = m + Theta m(t-12), is
  // linear in the two numbers where their product is not.
  Model model = empty_model("airline", 14, 1);
  LinearModel& m = as_linear(model);
  m.A.entries = {{1, 0, add_parameter(model, "theta", -0.1), 1.0}};
  m.C.entries = {{0, 13, add_parameter(model, "Theta", -0.1), 1.0}};
  m.Q.entries = {{0, 0, add_parameter(model, "sigma2", 0.01, true), 1.0}};
  m.G.constant(0, 0) = m.G.constant(1, 0) = m.C.constant(0, 1) = 1.0;
  for (Index i = 2; i < 14; ++i) m.A.constant(i, i - 1) = 1.0;
  const std::vector<double> at = {x["params_ma"][0], x["params_seasonal_ma"][0],
                                  x["params_variance"][0]};
  // Stata keeps what it computes, ln(air), as 4-byte numbers; with 8 bytes the fifth decimal
  // differs.
  const MatrixXd log_air = row(c["y"]).array().log();
  const MatrixXd stored = log_air.cast<float>().cast<double>();
  const Dataset data = recording(differences(differences(stored, 1), 12));
  const double value = value_at(model, data, at);
  expect_printed("air2, Stata", value, x["loglike"]);
  const NoiseEstimate e = maximum_of(model, data, 1);
  expect_not_beaten("air2, maximum", e.objective.log_likelihood, value, kStata);
  expect_estimates(e, at);
}

void expect_arima(const std::string& name, Model model, const Dataset& data,
                  const std::vector<double>& at, const Json& loglik) {
  const double value = value_at(model, data, at);
  expect_printed(name + ", R", value, loglik);
  const NoiseEstimate e = maximum_of(model, data);
  expect_not_beaten(name + ", maximum", e.objective.log_likelihood, value, kR);
  expect_estimates(e, at);
}

TEST(PublishedCases, RArima) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Dataset lh = recording_about_mean(row(published("r_lh_ar1")["y"]));
  const Json& one = published("r_lh_ar1")["expected"];
  expect_arima("lh AR(1)", autoregression(1, 1), lh, {one["ar1"], one["intercept"], one["sigma2"]},
               one["loglik"]);
  const Json& three = published("r_lh_ar3")["expected"];
  const Json& ar = three["ar"];
  expect_arima("lh AR(3)", autoregression(3, 1), lh,
               {ar[0], ar[1], ar[2], three["intercept"], three["sigma2"]}, three["loglik"]);

  const Json& c = published("r_lakehuron");
  const Json& x = c["expected"];
  const MatrixXd y = row(c["y"]);
  MatrixXd u = MatrixXd::Ones(2, y.cols());
  u.row(1) = Eigen::RowVectorXd::LinSpaced(y.cols(), 1875.0 - 1920.0,
                                           1875.0 - 1921.0 + static_cast<double>(y.cols()));
  Model model = autoregression(2, 2);
  model.parameters[2].value(0, 0) = 570.0;  // feet, not 1
  expect_arima("LakeHuron AR(2)", model, recording(y, u),
               {x["ar"][0], x["ar"][1], x["intercept"], x["slope"], x["sigma2"]}, x["loglik"]);
}

TEST(PublishedCases, AirPassengersBasicStructuralModel) {
  IDENTIKAL_NEEDS_SHARED_FILE(kCases);
  const Json& c = published("kfas_log_airpassengers_bsm");
  const Json& x = c["expected"];
  // The same passengers as Stata's air2.
  const Dataset data = recording(row(published("stata_air2_stationary")["y"]).array().log());
  // Level, slope, and 11 seasonal effects that sum to noise.
  Model model = empty_model("basic structural", 13, 3);
  LinearModel& m = as_linear(model);
  m.initial = InitialState::diffuse;
  m.A.constant(0, 0) = m.A.constant(0, 1) = m.A.constant(1, 1) = 1.0;
  m.A.constant.block(2, 2, 1, 11).setConstant(-1.0);
  for (Index i = 3; i < 13; ++i) m.A.constant(i, i - 1) = 1.0;
  for (Index i = 0; i < 3; ++i) m.G.constant(i, i) = 1.0;
  m.C.constant(0, 0) = m.C.constant(0, 2) = 1.0;
  m.R.entries = {{0, 0, add_parameter(model, "eps", 1e-3, true), 1.0}};
  for (int i = 0; i < 3; ++i) {
    const char* name[] = {"level", "slope", "seas"};
    m.Q.entries.push_back({i, i, add_parameter(model, name[i], 1e-3, true), 1.0});
  }
  const Eigen::Vector4d at(x["eps"], x["level"], x["slope"], x["seas"]);
  const StateSpace system = instantiate(m, with_coordinates(model.parameters, at));
  const Likelihood l =
      log_likelihood(system, m.initial, data.y, data.u, model_derivatives(m, model.parameters));
  double of_inputs = 0.0;  // the slope has two digits
  for (Index i = 0; i < 4; ++i) {
    const std::string& name = model.parameters[i].name;
    of_inputs += std::abs(l.gradient[i]) * half_unit(x[name]);
  }
  const double value = value_at(model, data, {at.begin(), at.end()});
  expect_printed("BSM, KFAS diffuse", value, x["loglik_diffuse_KFAS"], of_inputs);
  expect_printed("BSM, KFAS marginal", value + marginal_minus_diffuse(system, data.size()),
                 x["marginal"], of_inputs);
  // The maximum is at slope = 0, which KFAS, searching over logarithms, only comes near.
  const NoiseEstimate e = maximum_of(model, data, 1, Status::untrusted);
  EXPECT_EQ(e.parameters[2].value, 0.0);
  expect_not_beaten("BSM, maximum", e.objective.log_likelihood,
                    value_at(model, data, {at[0], at[1], 0.0, at[3]}), 1e-10);
  for (const int i : {0, 1, 3}) {
    const EstimatedParameter& p = e.parameters[i];
    std::printf("  %-8s %.10g, published %.10g\n", p.name.c_str(), p.value, at[i]);
    EXPECT_LT(std::abs(p.value - at[i]), 1e-3 * p.se) << p.name;
  }

  // StateSpaceModels.jl: x(1) ~ N(0, 1e6 I), the 13 samples that determine it not counted.
  m.initial = InitialState::given;
  m.P0.constant = 1e6 * MatrixXd::Identity(13, 13);
  const Solution s = LaterLikelihood(model, data, 13).maximum_from(at);
  const std::string other = c["reference_other"];
  const std::string number = other.substr(other.find(": ") + 2, 9);
  expect_cut_off("BSM, StateSpaceModels.jl", s.summary.objective, Json::parse(number));
}

TEST(PublishedCases, SimulatedSystems) {
  for (const int number : {1, 6, 7}) {
    const std::string name = "sys" + std::to_string(number), file = "likelihood/" + name + ".csv";
    IDENTIKAL_NEEDS_SHARED_FILE(kCases);
    IDENTIKAL_NEEDS_SHARED_FILE(file);
    const Json& c = published("sim_" + name);
    const MatiskoSystem system = matisko_system(number);
    TimeSource time;
    time.step = 1.0;
    std::vector<ChannelSource> outputs = {{"y1", "1", "", "", {}}, {"y2", "2", "", "", {}}};
    if (number == 1) outputs.pop_back();
    const Dataset data = make_dataset(read_csv(shared_file(file)), time, {}, outputs);
    LikelihoodEngine engine;
    engine.add_recording(data.y, data.u);
    const Likelihood& l =
        engine.evaluate(true_system(system), InitialState::stationary,
                        model_derivatives(as_linear(system.model), system.model.parameters));
    expect_printed(name + ", at the truth", l.value, c["loglik_at_truth"]);
    // By the logarithms; the complex step's digits end at about the eighth.
    const Json& score = c["score_log_params_at_truth_TMB_AD"];
    for (std::size_t i = 0; i < score.size(); ++i) {
      const auto at = static_cast<Index>(i);
      expect_printed("  score", system.truth[at] * l.gradient[at], score[i]);
    }
    const NoiseEstimate e = maximum_of(system.model, data);
    expect_printed(name + ", maximum", e.objective.log_likelihood, c["max_loglik"]);
    expect_estimates(e, c["mle_KFAS_tight"]);
  }
}

}  // namespace
}  // namespace identikal
