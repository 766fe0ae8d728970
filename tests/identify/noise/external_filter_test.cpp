#include "identify/noise/external_filter.h"

#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "identify/noise/ml.h"
#include "lib/base/random.h"
#include "lib/filter/simulation.h"

namespace identikal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPeriod = 0.1;

// A tracker as it stands in many code bases: members, a predict and an update, positions only.
class Tracker {
 public:
  Tracker(double acceleration_variance, double position_variance)
      : q_(acceleration_variance), r_(position_variance) {}
  void predict() {
    const double h = kPeriod;
    p_ += h * v_;
    const double pp = P_[0] + 2.0 * h * P_[1] + h * h * P_[2], pv = P_[1] + h * P_[2];
    P_[0] = pp + q_ * h * h * h * h / 4.0;
    P_[1] = pv + q_ * h * h * h / 2.0;
    P_[2] += q_ * h * h;
  }
  void update(double position) {
    innovation = position - p_;
    variance = P_[0] + r_;
    const double kp = P_[0] / variance, kv = P_[1] / variance;
    p_ += kp * innovation;
    v_ += kv * innovation;
    P_[2] -= kv * P_[1];
    P_[1] -= kv * P_[0];
    P_[0] -= kp * P_[0];
  }
  double innovation = 0.0, variance = 1.0;

 private:
  double q_, r_, p_ = 0.0, v_ = 0.0;
  double P_[3] = {4.0, 0.0, 1.0};
};

Model tracking_model(double q, double r) {
  Model model;
  model.name = "tracker";
  for (const auto& [name, value] : {std::pair{"q", q}, std::pair{"r", r}}) {
    Parameter p;
    p.name = name;
    p.value = MatrixXd::Constant(1, 1, value);
    p.min = 0.0;
    model.parameters.push_back(p);
  }
  LinearModel& m = as_linear(model);
  m.A.constant = (MatrixXd(2, 2) << 1, kPeriod, 0, 1).finished();
  m.B.constant.resize(2, 0);
  m.C.constant = Eigen::RowVector2d(1, 0);
  m.D.constant.resize(1, 0);
  m.G.constant = Eigen::Vector2d(kPeriod * kPeriod / 2.0, kPeriod);
  m.Q.constant = m.R.constant = m.S.constant = MatrixXd::Zero(1, 1);
  m.Q.entries = {{0, 0, 0, 1.0}};
  m.R.entries = {{0, 0, 1, 1.0}};
  m.x0.constant = VectorXd::Zero(2);
  m.P0.constant = Eigen::Vector2d(4, 1).asDiagonal();
  m.initial = InitialState::given;
  m.dt = kPeriod;
  return model;
}

Dataset tracked(double q, double r, Eigen::Index N) {
  const Model truth = tracking_model(q, r);
  Random random(5);
  Dataset data;
  data.name = "track";
  data.dt = kPeriod;
  data.time = VectorXd::LinSpaced(N, 0.0, kPeriod * static_cast<double>(N - 1));
  data.u.resize(0, N);
  data.y = simulate_outputs(instantiate(as_linear(truth), truth.parameters), InitialState::given,
                            MatrixXd(), N, random);
  data.outputs = {{"position", "m"}};
  return data;
}

TEST(ExternalFilter, AMistunedTrackerReachesTheBuiltInOptimum) {
  Dataset data = tracked(2.0, 0.09, 1500);
  for (Eigen::Index t = 400; t < 420; ++t) data.y(0, t) = kNone;
  const auto run = [&](const ParameterSet& at) -> std::optional<Innovations> {
    Tracker filter(at[0].scalar(), at[1].scalar());
    Innovations out;
    out.e.resize(1, data.size());
    for (Eigen::Index t = 0; t < data.size(); ++t) {
      if (t > 0) filter.predict();
      out.e(0, t) = kNone;
      if (!std::isnan(data.y(0, t))) {
        filter.update(data.y(0, t));
        out.e(0, t) = filter.innovation;
      }
      out.Sigma.push_back(MatrixXd::Constant(1, 1, filter.variance));
    }
    return out;
  };
  // A hundred times too calm, fifty times too sure of its sensor.
  const Model start = tracking_model(0.02, 0.0018);
  const NoiseEstimate own = fit_external_filter(start.parameters, run);
  NoiseMlOptions direct;  // whose information has the sample's own terms, as the differences have
  direct.evaluation = EvaluationMethod::time_varying;
  const NoiseEstimate built_in = tune_ml(start, {data}, direct);
  ASSERT_EQ(own.status, Status::ok);
  ASSERT_EQ(built_in.status, Status::ok);
  for (std::size_t i = 0; i < 2; ++i) {
    const double off = own.parameters[i].value / built_in.parameters[i].value - 1.0;
    std::printf("%s: own filter %.10g, built-in %.10g, %.1e apart; se %.3g, bound %.3g\n",
                own.parameters[i].name.c_str(), own.parameters[i].value,
                built_in.parameters[i].value, off, own.parameters[i].se,
                built_in.parameters[i].crb_se);
    EXPECT_LT(std::abs(off), 1e-6);
    EXPECT_NEAR(own.parameters[i].se, built_in.parameters[i].crb_se,
                1e-3 * built_in.parameters[i].crb_se);
    EXPECT_NEAR(own.parameters[i].se_sandwich, own.parameters[i].se, 0.2 * own.parameters[i].se);
  }
  EXPECT_NEAR(own.objective.log_likelihood, built_in.objective.log_likelihood,
              1e-9 * std::abs(built_in.objective.log_likelihood));
}

TEST(ExternalFilter, AFilterThatDoesNotRunIsRefused) {
  const Model start = tracking_model(1.0, 1.0);
  EXPECT_THROW(
      fit_external_filter(start.parameters, [](const ParameterSet&) { return std::nullopt; }),
      std::invalid_argument);
  ParameterSet fixed = start.parameters;
  for (Parameter& p : fixed) p.fixed = true;
  EXPECT_THROW(fit_external_filter(fixed, [](const ParameterSet&) { return std::nullopt; }),
               std::invalid_argument);
}

}  // namespace
}  // namespace identikal
