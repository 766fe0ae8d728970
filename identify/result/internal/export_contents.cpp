#include "identify/result/internal/export_contents.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

#include "identify/estimate/covariance_factor.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_file.h"
#include "identify/result/estimated_model.h"
#include "identify/result/internal/export_comments.h"
#include "identify/result/internal/filter_code.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

std::vector<NamedMatrix> filter_matrices(const StoredEstimate& e) {
  const SteadyFilter& f = *e.filter;
  const bool density = e.noise.Q_kind == "density";
  std::vector<NamedMatrix> all{
      {"A", f.model.A, ""},
      {"B", f.model.B, ""},
      {"C", f.model.C, ""},
      {"D", f.model.D, ""},
      {"G", f.model.G, ""},
      {"Q", f.model.Q, "process noise, covariance of w per sample"},
      {"R", f.model.R, "measurement noise, covariance of v per sample"},
      {"S", f.model.S, "covariance of w and v per sample"},
      {"K_predictor", f.K, "steady gain of the predictor form, K = (A P C' + G S) Sigma^-1"},
      {"L_filter", f.L, "steady gain of the filter form, L = P C' Sigma^-1"},
      {"P", f.P, "steady covariance of x(t) - x_pred(t), before y(t) is known"},
      {"Sigma", f.Sigma, "steady covariance of e, C P C' + R"}};
  if (density) {
    all.insert(all.begin() + 6,
               {"Q_density", e.noise.Q,
                "process noise as the model file has it, power per time (density)"});
  }
  return all;
}

// The estimates in SI, one after the other.
std::vector<StructMember> members_of(const StoredEstimate& e, bool vehicle) {
  std::vector<StructMember> out;
  for (const EstimatedParameter& p : e.parameters) {
    if (is_straight(p)) continue;
    const Unit unit = unit_or_dimensionless(p.unit);
    // Only a number that stays the same keeps its last digit.
    const bool same = unit.scale == 1.0 && unit.offset == 0.0;
    std::string si = vehicle ? vehicle_unit(p.name) : same ? p.unit : si_unit(unit);
    if (si.empty()) si = "-";
    std::string remark = remark_of(p);
    if (!same) remark += fmt::format("; {:.6g} {}", p.value, p.unit);
    out.push_back({p.name, si, same ? p.value : unit.to_si(p.value), unit.scale * p.se, remark,
                   p.fixed ? "known" : to_string(p.verdict)});
  }
  return out;
}

std::vector<SteadyFilter::Channel> channels_of(const std::vector<ChannelSource>& from) {
  std::vector<SteadyFilter::Channel> out;
  for (const ChannelSource& c : from) out.push_back({c.name, c.unit});
  return out;
}

// What a filter of formulas needs beside these; of matrices that change from sample to sample, none.
std::vector<NamedMatrix> matrices_of(const Model& model, const StateSpace& written, bool density) {
  const LinearModel& linear = noise_model(model);
  std::vector<NamedMatrix> out;
  if (changes(model)) {
    const char* kind = linear.continuous ? "of dx/dt" : "";
    if (!moves(linear.A)) out.push_back({"A", written.A, kind});
    if (!moves(linear.B)) out.push_back({"B", written.B, kind});
    if (!moves(linear.C)) out.push_back({"C", written.C, ""});
    if (!moves(linear.D)) out.push_back({"D", written.D, ""});
  }
  if (!moves(linear.G) && !moves(linear.Q)) {
    out.push_back({"Q", written.G * written.Q * written.G.transpose(),
                   density ? "process noise of the states, power per time (density)"
                           : "process noise of the states, covariance per sample"});
  }
  if (!moves(linear.R)) out.push_back({"R", written.R, "measurement noise, covariance per sample"});
  if (linear.initial != InitialState::given) return out;
  out.push_back({"x0", written.x0, "state at the first sample: mean"});
  out.push_back({"P0", written.P0, "and its covariance"});
  return out;
}

void add_formulas(ExportContents& to, const StoredResult& result) {
  const StoredEstimate& e = result.estimate;
  const Model model = estimated_model(e, result.path);
  to.differs_by_recording = !model.recordings.empty();
  const StateSpace written = written_matrices(noise_model(model), model.parameters);
  const bool density = e.noise.Q_kind == "density";
  for (const StateName& state : model.states) to.states.push_back({state.name, state.unit});
  to.outputs = channels_of(model.outputs);
  to.inputs = channels_of(model.inputs);
  to.Q_kind = e.noise.Q_kind;
  to.matrices = matrices_of(model, written, density);
  to.lines.push_back(fmt::format("{} filter; numbers in SI; the formulas stand in the model file",
                                 e.objective.filter));
  if (changes(model) && holds_moving(noise_model(model))) {
    to.lines.emplace_back("matrices that change from sample to sample are not among them");
  }
  const std::string why_not = why_no_filter_code(model, e.objective.filter);
  if (why_not.empty()) {
    to.integration_step = e.objective.integration_step;
    to.program = model;
    to.lines.emplace_back(
        "functions (--to c, cpp, python): from x0 and P0 on, at every sample update, then predict");
  } else {
    to.lines.push_back("functions of the filter are not exported: " + why_not);
  }
  if (!to.states.empty()) to.lines.push_back("states x: " + channel_list(to.states, ""));
  to.lines.push_back("outputs y: " + channel_list(to.outputs));
  for (const ChannelSource& output : model.outputs) {
    if (output.transform == Transform::none) continue;
    const bool common = output.transform == Transform::common_logarithm;
    to.lines.push_back(fmt::format("y of {} is the {} of what was measured, in SI", output.name,
                                   common ? "common logarithm" : "logarithm"));
  }
  if (!to.inputs.empty()) to.lines.push_back("inputs u: " + channel_list(to.inputs));
}

// Of those that were found, the one that changes most.
std::optional<double> covariance_factor(const StoredEstimate& e) {
  std::optional<double> out;
  for (const DerivedValue& derived : e.derived) {
    if (!derived.name.starts_with(kCovarianceFactor) || !(derived.value > 0.0)) continue;
    const bool more = !out || std::abs(std::log(derived.value)) > std::abs(std::log(*out));
    if (more && std::isfinite(derived.value)) out = derived.value;
  }
  return out;
}

// A file may have been edited.
void check_filter(const StoredResult& result) {
  StateSpace model = result.estimate.filter->model;
  model.x0.setZero(model.states());
  model.P0.setZero(model.states(), model.states());
  try {
    check_shapes(model);
  } catch (const std::invalid_argument& error) {
    throw InputError({result.path, 0, 0}, fmt::format("not a filter ({})", error.what()),
                     "a result as -o writes it", "run the job again with -o");
  }
}

// "Iz", or the entry of a matrix with its place: "Q(1,1)", "R(level,slope)".
bool is_parameter_name(const std::string& text) {
  const std::size_t place = std::min(text.find('('), text.size());
  if (!is_name(text.substr(0, place))) return false;
  if (place == text.size()) return true;
  const auto of_place = [](unsigned char c) {
    return c == ',' || c == '_' || (c < 0x80 && std::isalnum(c) != 0);
  };
  return text.size() > place + 2 && text.back() == ')' &&
         std::all_of(text.begin() + static_cast<std::ptrdiff_t>(place) + 1, text.end() - 1,
                     of_place);
}

// They become words of programs: only what a model file can hold may stand here.
void check_words(const StoredResult& result) {
  const auto refuse = [&](const char* what) {
    throw InputError({result.path, 0, 0}, what, "a file as -o writes it",
                     "run the job again with -o");
  };
  for (const EstimatedParameter& p : result.estimate.parameters) {
    const bool named =
        is_parameter_name(p.name) && std::all_of(p.with.begin(), p.with.end(), is_parameter_name);
    if (!named) refuse("holds the name of a parameter that no model file can have");
    const bool in_one_line =
        std::none_of(p.unit.begin(), p.unit.end(), [](unsigned char c) { return c < 0x20; });
    if (!p.unit.empty() && !(in_one_line && parse_unit(p.unit))) {
      refuse("holds a unit that there is not");
    }
  }
}

// The first name, as the export has it, behind which a number is missing; empty: all are there.
std::string missing_number(const ExportContents& c) {
  for (const StructMember& m : c.members) {
    if (!std::isfinite(m.value)) return m.name;
  }
  if (c.dt && !std::isfinite(*c.dt)) return "dt";
  for (const char* needed : {"A", "C"}) {
    const bool there = std::any_of(c.matrices.begin(), c.matrices.end(),
                                   [&](const NamedMatrix& m) { return m.name == needed; });
    if (c.dt && !there) return needed;
  }
  for (const NamedMatrix& m : c.matrices) {
    if (!m.value.allFinite()) return m.name;
  }
  return "";
}

}  // namespace

ExportKind export_kind(const StoredEstimate& e) {
  if (e.verb == "bound") return ExportKind::nothing;
  if (!e.tyre_curve.empty())
    return e.parameters.empty() ? ExportKind::nothing : ExportKind::vehicle;
  if (e.filter) return ExportKind::filter;
  return e.objective.filter.empty() || !e.model_file ? ExportKind::nothing : ExportKind::formulas;
}

ExportContents export_contents(const StoredResult& result) {
  check_words(result);
  const StoredEstimate& e = result.estimate;
  ExportContents out;
  switch (export_kind(e)) {
    case ExportKind::nothing:
      throw InputError(
          {result.path, 0, 0},
          fmt::format("a result of '{}' that holds no filter, vehicle or model of formulas",
                      e.verb),
          "a result of tune, check or fit");
    case ExportKind::vehicle:
      out.suffix = out.group = "car";
      out.members = members_of(e, true);
      out.tyre_curve = e.tyre_curve;
      out.lines = vehicle_lines(e);
      break;
    case ExportKind::filter:
      out.suffix = "filter";
      out.dt = e.filter->model.dt;
      out.matrices = filter_matrices(e);
      out.states = e.filter->states;
      out.outputs = e.filter->outputs;
      out.inputs = e.filter->inputs;
      out.lines = parameter_lines(e, true);
      for (std::string& line : filter_lines(e)) out.lines.push_back(std::move(line));
      break;
    case ExportKind::formulas:
      out.suffix = "model";
      out.group = "p";
      out.members = members_of(e, false);
      add_formulas(out, result);
      break;
  }
  if (export_kind(e) != ExportKind::vehicle) out.covariance_factor = covariance_factor(e);
  std::erase_if(out.matrices, [](const NamedMatrix& m) { return m.value.size() == 0; });
  if (const std::string name = missing_number(out); !name.empty()) {
    throw InputError({result.path, 0, 0}, fmt::format("a number of '{}' is missing", name),
                     "a result as -o writes it", "run the job again with -o");
  }
  if (out.dt) check_filter(result);
  return out;
}

}  // namespace identikal
