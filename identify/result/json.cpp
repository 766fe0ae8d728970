#include "identify/result/json.h"

#include <cmath>

#include <nlohmann/json.hpp>

#include "identify/result/internal/version_1.h"
#include "identify/result/schema.h"
#include "lib/version.h"

namespace identikal {
namespace {

using Json = nlohmann::ordered_json;

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json matrix(const Eigen::MatrixXd& M) {
  if (M.size() == 0) return nullptr;
  Json rows = Json::array();
  for (Eigen::Index i = 0; i < M.rows(); ++i) {
    Json row = Json::array();
    for (Eigen::Index j = 0; j < M.cols(); ++j) row.push_back(number(M(i, j)));
    rows.push_back(std::move(row));
  }
  return rows;
}

Json parameters(const Estimate& estimate) {
  Json out = Json::array();
  for (const EstimatedParameter& p : estimate.parameters) {
    out.push_back({{"name", p.name},
                   {"unit", p.unit},
                   {"value", number(p.value)},
                   {"se", number(p.se)},
                   {"ci95", {number(p.ci95[0]), number(p.ci95[1])}},
                   {"profile95", {number(p.profile95[0]), number(p.profile95[1])}},
                   {"se_sandwich", number(p.se_sandwich)},
                   {"crb_se", number(p.crb_se)},
                   {"start", number(p.start)},
                   {"bounds", {number(p.bounds[0]), number(p.bounds[1])}},
                   {"fixed", p.fixed},
                   {"verdict", to_string(p.verdict)},
                   {"with", p.with}});
  }
  return out;
}

Json fits(const std::vector<ChannelFit>& channels) {
  Json out = Json::object();
  for (const ChannelFit& fit : channels) {
    out[fit.channel] = {
        {"fit_percent", number(fit.fit_percent)}, {"rmse", number(fit.rmse)}, {"unit", fit.unit}};
  }
  return out;
}

Json bound(const Bound* of) {
  if (of == nullptr) return nullptr;
  const Bound& b = *of;
  Json rows = Json::array();
  const Bound::InnovationForm& form = b.innovation_form;
  for (const Bound::Parameter& p : b.parameters) {
    rows.push_back({{"name", p.name},
                    {"complete_se", number(p.complete_se)},
                    {"samples_needed", number(p.samples_needed)},
                    {"gain_change", matrix(p.gain_change)},
                    {"published_se", number(p.published_se)}});
  }
  return {{"samples", b.samples},
          {"accuracy", number(b.accuracy)},
          {"parameters", rows},
          {"gain_se", matrix(b.gain_se)},
          {"simulated", !b.simulated ? Json(nullptr)
                                     : Json{{"recordings", b.simulated->recordings},
                                            {"seed", b.simulated->seed},
                                            {"relative_se", number(b.simulated->relative_se)}}},
          {"innovation_form",
           {{"Sigma", matrix(form.Sigma)},
            {"K_se", matrix(form.K_se)},
            {"Sigma_se", matrix(form.Sigma_se)},
            {"published_K_se", number(form.published_K_se)},
            {"published_Sigma_se", number(form.published_Sigma_se)}}}};
}

Json posterior(const Posterior* of) {
  if (of == nullptr) return nullptr;
  const Posterior& p = *of;
  Json rows = Json::array();
  for (const Posterior::Parameter& row : p.parameters) {
    rows.push_back({{"name", row.name}, {"map", number(row.map)}, {"prior", row.prior}});
  }
  return {{"method", p.method},
          {"points", p.points},
          {"effective", number(p.effective)},
          {"log_evidence", number(p.log_evidence)},
          {"parameters", rows}};
}

Json time_history(const TimeHistory* of) {
  if (of == nullptr) return nullptr;
  const TimeHistory& c = *of;
  const auto values = [](const Eigen::VectorXd& v) {
    Json out = Json::array();
    for (const double x : v) out.push_back(number(x));
    return out;
  };
  Json changes = Json::array();
  for (const TimeHistory::Change& change : c.changes) {
    changes.push_back({{"since", number(change.since)},
                       {"found", number(change.found)},
                       {"before", values(change.before)},
                       {"after", values(change.after)}});
  }
  return {{"names", c.names}, {"units", c.units}, {"changes", changes}};
}

Json findings_of(const Findings& findings) {
  Json out = Json::array();
  for (const Finding& w : printed(findings)) {
    out.push_back({{"code", name_of(w)},
                   {"severity", to_string(w.severity)},
                   {"about", w.about},
                   {"text", w.text},
                   {"remedy", w.remedy}});
  }
  return out;
}

Json signals_of(const VehicleSurvey& survey) {
  Json out = Json::array();
  for (const VehicleSurvey::Signal& x : survey.signals) {
    out.push_back({{"quantity", x.quantity},
                   {"column", x.column},
                   {"unit", x.unit},
                   {"source", x.source},
                   {"rate", number(x.rate)},
                   {"min", number(x.min)},
                   {"max", number(x.max)},
                   {"held", number(x.held)},
                   {"quantum", number(x.quantum)},
                   {"straight", number(x.straight)}});
  }
  return out;
}

Json relations_of(const VehicleSurvey& survey) {
  Json out = Json::array();
  for (const VehicleSurvey::Relation& x : survey.relations) {
    out.push_back({{"expected", x.expected},
                   {"seen", x.seen},
                   {"correlation", number(x.correlation)},
                   {"slope", number(x.slope)},
                   {"lag", number(x.lag)},
                   {"lag_se", number(x.lag_se)},
                   {"other_lag", number(x.other_lag)},
                   {"other_correlation", number(x.other_correlation)},
                   {"clock", x.clock}});
  }
  return out;
}

Json mapping_of(const VehicleSurvey& survey) {
  Json out = Json::array();
  for (const VehicleSurvey::Proposal& p : survey.mapping) {
    out.push_back({{"list", p.list},
                   {"name", p.name},
                   {"column", p.column},
                   {"unit", p.unit},
                   {"scale", number(p.scale)},
                   {"offset", number(p.offset)},
                   {"delay", number(p.delay)}});
  }
  return out;
}

Json survey(const VehicleSurvey* of) {
  if (of == nullptr) return nullptr;
  const VehicleSurvey& s = *of;
  Json verdicts = Json::array(), speed = Json::array(), lateral = Json::array();
  for (const VehicleSurvey::Verdict& v : s.identifiable) {
    verdicts.push_back({{"of", v.of}, {"answer", v.answer}, {"why", v.why}});
  }
  for (const double v : s.speed) speed.push_back(number(v));
  for (const double v : s.lateral_acceleration) lateral.push_back(number(v));
  return {{"signals", signals_of(s)},
          {"relations", relations_of(s)},
          {"duration", number(s.duration)},
          {"moving", number(s.moving)},
          {"standstill", number(s.standstill)},
          {"reversing", number(s.reversing)},
          {"speed", speed},
          {"lateral_acceleration", lateral},
          {"steering_above_0_5_hz", number(s.steering_above_0_5_hz)},
          {"steering_above_1_5_hz", number(s.steering_above_1_5_hz)},
          {"left", number(s.left)},
          {"steady", number(s.steady)},
          {"identifiable", verdicts},
          {"mapping", mapping_of(s)},
          {"time", {{"column", s.time_column}, {"unit", s.time_unit}}},
          {"least_speed", number(s.least_speed)},
          {"findings", findings_of(s.findings)}};
}

Json shaping(const Shaping* of) {
  if (of == nullptr) return nullptr;
  const Shaping& s = *of;
  Json candidates = Json::array(), poles = Json::array(), predictions = Json::array();
  for (const Shaping::Candidate& c : s.candidates) {
    candidates.push_back({{"noise_source", c.noise_source},
                          {"channels", c.channels},
                          {"order", c.order},
                          {"zeros", c.zeros},
                          {"log_likelihood", number(c.log_likelihood)},
                          {"bic", number(c.bic)}});
  }
  for (const Shaping::Pole& pole : s.poles) {
    poles.push_back({{"frequency", number(pole.frequency)}, {"radius", number(pole.radius)}});
  }
  for (const Shaping::Prediction& p : s.predictions) {
    predictions.push_back({{"channel", p.channel},
                           {"unit", p.unit},
                           {"steps", p.steps},
                           {"rmse_without", number(p.rmse_without)},
                           {"rmse_with", number(p.rmse_with)}});
  }
  return {{"whiteness_p", number(s.whiteness_p)},
          {"peak", number(s.peak)},
          {"peak_p", number(s.peak_p)},
          {"noise_source", s.noise_source},
          {"order", s.order},
          {"zeros", s.zeros},
          {"poles", poles},
          {"output_peak", number(s.output_peak)},
          {"candidates", candidates},
          {"predictions", predictions},
          {"held_out_log_likelihood_without", number(s.held_out_log_likelihood_without)},
          {"held_out_log_likelihood_with", number(s.held_out_log_likelihood_with)}};
}

Json excess(const ExcessMeanSquareError* of) {
  if (of == nullptr) return nullptr;
  const ExcessMeanSquareError& l = *of;
  return {{"relative", number(l.relative)}, {"without", l.without}, {"reason", l.reason}};
}

Json minimum_rank(const RankSelection* of) {
  if (of == nullptr) return nullptr;
  Json curve = Json::array();
  for (const RankSelection::Step& step : of->curve) {
    curve.push_back({{"penalty", number(step.penalty)},
                     {"objective", number(step.objective)},
                     {"trace", number(step.trace)},
                     {"rank", step.rank},
                     {"excess", number(step.excess)},
                     {"allowed", number(step.allowed)}});
  }
  return {{"rank", of->rank}, {"of", of->of}, {"curve", curve}};
}

Json filter(const SteadyFilter* of) {
  if (of == nullptr) return nullptr;
  const SteadyFilter& f = *of;
  const auto channels = [](const std::vector<SteadyFilter::Channel>& list) {
    Json out = Json::array();
    for (const SteadyFilter::Channel& c : list) {
      out.push_back({{"name", c.name}, {"unit", c.unit}});
    }
    return out;
  };
  const StateSpace& m = f.model;
  return {{"dt", number(m.dt)},
          {"inputs", channels(f.inputs)},
          {"outputs", channels(f.outputs)},
          {"states", channels(f.states)},
          {"A", matrix(m.A)},
          {"B", matrix(m.B)},
          {"C", matrix(m.C)},
          {"D", matrix(m.D)},
          {"G", matrix(m.G)},
          {"Q", matrix(m.Q)},
          {"R", matrix(m.R)},
          {"S", matrix(m.S)},
          {"K", matrix(f.K)},
          {"L", matrix(f.L)},
          {"P", matrix(f.P)},
          {"Sigma", matrix(f.Sigma)}};
}

Json model_file(const ModelSource* of) {
  if (of == nullptr) return nullptr;
  const ModelSource& m = *of;
  Json included = Json::array();
  for (const ModelSource::Included& file : m.included) {
    included.push_back({{"path", file.path}, {"sha256", file.sha256}});
  }
  return {{"path", m.path}, {"sha256", m.sha256}, {"text", m.text}, {"included", included}};
}

Json inputs(const Estimate& estimate) {
  Json out = Json::array();
  for (const InputRecord& input : estimate.inputs) {
    out.push_back({{"path", input.path},
                   {"sha256", input.sha256},
                   {"rows", input.rows},
                   {"used", input.used},
                   {"range", {number(input.range[0]), number(input.range[1])}}});
  }
  return out;
}

Json noise(const ResultSections& result) {
  const Noise n = result.noise != nullptr ? *result.noise : Noise{};
  return {{"Q", {{"matrix", matrix(n.Q)}, {"kind", n.Q_kind}}},
          {"R", {{"matrix", matrix(n.R)}}},
          {"S", matrix(n.S)},
          {"K_steady", matrix(n.K_steady)},
          {"P_steady", matrix(n.P_steady)},
          {"excess_mean_square_error", excess(result.excess_mean_square_error)}};
}

Json objective(const Estimate& estimate) {
  const Objective& o = estimate.objective;
  return {{"method", o.method},
          {"initial", o.initial},
          {"filter", o.filter},
          {"log_likelihood", number(o.log_likelihood)},
          {"log_likelihood_start", number(o.log_likelihood_start)},
          {"aic", number(o.aic)},
          {"bic", number(o.bic)},
          {"samples", o.samples},
          {"held_out", number(o.held_out)},
          {"iterations", o.iterations},
          {"evaluations", o.evaluations},
          {"starts", o.starts},
          {"starts_at_optimum", o.starts_at_optimum},
          {"evaluation_method", o.evaluation_method},
          {"evaluation_reason", o.evaluation_reason}};
}

Json tests(const std::vector<TestResult>* of) {
  Json out = Json::array();
  if (of == nullptr) return out;
  for (const TestResult& test : *of) {
    out.push_back({{"id", test.id},
                   {"channel", test.channel},
                   {"value", number(test.value)},
                   {"interval", {number(test.interval[0]), number(test.interval[1])}},
                   {"p", number(test.p)},
                   {"pass", test.pass},
                   {"level", number(test.level)}});
  }
  return out;
}

Json identifiability(const Estimate& estimate) {
  const Identifiability& id = estimate.identifiability;
  Json directions = Json::array();
  for (const Identifiability::Direction& d : id.unidentifiable_directions) {
    directions.push_back({{"names", d.names}, {"weights", d.weights}});
  }
  return {{"rank", id.rank},
          {"of", id.of},
          {"condition", number(id.condition)},
          {"unidentifiable_directions", directions}};
}

Json derived(const Estimate& estimate) {
  Json out = Json::array();
  for (const DerivedValue& d : estimate.derived) {
    out.push_back(
        {{"name", d.name}, {"unit", d.unit}, {"value", number(d.value)}, {"se", number(d.se)}});
  }
  return out;
}

}  // namespace

std::string result_json(const ResultSections& result, bool strict, double timing_s) {
  const Estimate& estimate = *result.core;
  const RecordingFit fit = result.fit != nullptr ? *result.fit : RecordingFit{};
  Json out;
  out["schema_version"] = kSchemaVersion;
  out["version"] = IDENTIKAL_VERSION;
  out["verb"] = estimate.verb;
  out["model"] = estimate.model_name;
  out["status"] = {{"code", to_string(estimate.status)},
                   {"exit", exit_code(estimate, strict)},
                   {"message", estimate.message}};
  out["inputs"] = inputs(estimate);
  out["model_file"] = model_file(result.model_file);
  out["parameters"] = parameters(estimate);
  out["covariance_kind"] = estimate.covariance_kind;
  out["covariance_freedom"] = number(estimate.covariance_freedom);
  out["correlation"] = {{"names", estimate.correlation_names},
                        {"matrix", matrix(estimate.correlation)}};
  out["noise"] = noise(result);
  out["filter"] = filter(result.filter);
  out["tyre_curve"] = result.tyre_curve == nullptr ? Json(nullptr) : Json(*result.tyre_curve);
  out["objective"] = objective(estimate);
  out["fit"] = {{"one_step", fits(fit.one_step)},
                {"simulation", fits(fit.simulation)},
                {"hold_out", fits(fit.hold_out)},
                {"hold_out_one_step", fits(fit.hold_out_one_step)}};
  out["tests"] = tests(result.tests);
  out["identifiability"] = identifiability(estimate);
  out["bound"] = bound(result.bound);
  out["posterior"] = posterior(result.posterior);
  out["time_history"] = time_history(result.time_history);
  out["shaping"] = shaping(result.shaping);
  out["minimum_rank"] = minimum_rank(result.minimum_rank);
  out["survey"] = survey(result.survey);
  out["derived"] = derived(estimate);
  out["warnings"] = findings_of(estimate.findings);
  out["notes"] = estimate.notes;
  add_old_keys(out);
  out["timing_s"] = number(timing_s);
  return out.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace identikal
