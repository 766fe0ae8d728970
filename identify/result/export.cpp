#include "identify/result/export.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <functional>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "identify/model/model_file.h"
#include "identify/result/estimated_model.h"
#include "identify/result/schema.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

struct FormatNames {
  ExportFormat format;
  const char *name, *title, *comment;
};
constexpr FormatNames kFormats[] = {
    {ExportFormat::cpp, "cpp", "C++ (header)", "//"},
    {ExportFormat::c, "c", "C (header)", "//"},
    {ExportFormat::matlab, "matlab", "MATLAB, Octave", "%"},
    {ExportFormat::python, "python", "Python", "#"},
    {ExportFormat::yaml, "yaml", "Model file (YAML)", "#"},
    {ExportFormat::json, "json", "JSON", ""},
};

const FormatNames& names_of(ExportFormat format) {
  return *std::find_if(std::begin(kFormats), std::end(kFormats),
                       [&](const FormatNames& f) { return f.format == format; });
}

// The shortest text that reads as this very number, never as an integer.
std::string exact(double value) {
  std::string out = fmt::format("{}", value);
  if (out.find_first_of(".e") == std::string::npos) out += ".0";
  return out;
}

// A word that every language takes as a name once a suffix is added.
std::string identifier(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const bool plain =
        std::isalnum(static_cast<unsigned char>(c)) != 0 && static_cast<unsigned char>(c) < 0x80;
    if (plain) {
      out += static_cast<char>(std::tolower(c));
    } else if (!out.empty() && out.back() != '_') {
      out += '_';
    }
  }
  while (!out.empty() && out.back() == '_') out.pop_back();
  if (out.empty()) return "model";
  return std::isdigit(static_cast<unsigned char>(out[0])) != 0 ? "model_" + out : out;
}

// One comment a line; nothing that a user wrote ends it or carries it on into the next.
std::string commented(const std::vector<std::string>& lines, const std::string& mark) {
  std::string out;
  for (const std::string& line : lines) {
    std::string text = line;
    for (char& c : text) {
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
    }
    while (!text.empty() && text.back() == ' ') text.pop_back();
    if (text.ends_with('\\') || text.ends_with("?"
                                               "?/"))
      text += " .";
    out += text.empty() ? mark + "\n" : mark + " " + text + "\n";
  }
  return out;
}

enum class Kind { nothing, filter, vehicle, formulas };

Kind kind_of(const Estimate& e) {
  if (e.verb == "bound") return Kind::nothing;
  if (!e.tyre_curve.empty()) return e.parameters.empty() ? Kind::nothing : Kind::vehicle;
  if (e.filter) return Kind::filter;
  return e.objective.filter.empty() || !e.model_file ? Kind::nothing : Kind::formulas;
}

// The largest force of an axle that stays straight as far as it was driven: it has no number.
bool is_straight(const EstimatedParameter& p) { return std::isinf(p.value); }

std::string unit_text(const std::string& unit) { return unit.empty() ? "" : " " + unit; }

std::string remark_of(const EstimatedParameter& p) {
  if (p.fixed) return "known";
  std::string out = std::isfinite(p.se) ? fmt::format("se {:.3g}{}", p.se, unit_text(p.unit))
                                        : std::string("no standard error");
  std::string with;
  for (const std::string& name : p.with) with += " " + name;
  switch (p.verdict) {
    case Verdict::at_bound:
      return is_straight(p) ? "beyond what the recording showed: this axle stays straight"
                            : "AT ITS BOUND, no standard error";
    case Verdict::flat:
    case Verdict::unexcited:
      return "NOT DETERMINED by the data" + (with.empty() ? "" : ", only with" + with);
    case Verdict::unfitted:
      return "NOT FITTED: where the search would have started";
    case Verdict::ok:
    case Verdict::weak:
    case Verdict::correlated:
      break;
  }
  return out + ", " + in_words(to_string(p.verdict)) + (with.empty() ? "" : " with" + with);
}

std::string status_line(const Estimate& e) {
  switch (e.status) {
    case Status::untrusted:
      return "NOT TO BE TRUSTED: " + e.message;
    case Status::not_converged:
      return "NOT CONVERGED, the best so far: " + e.message;
    case Status::answer_no:
      return "REJECTED: " + e.message;
    case Status::ok:
      break;
  }
  return "status ok: " + e.message;
}

// What everybody who finds the numbers later wants to know.
std::vector<std::string> head(const StoredResult& result, const std::string& date) {
  const Estimate& e = result.estimate;
  std::vector<std::string> out;
  const std::string& method = e.objective.method;
  out.push_back(fmt::format("{}: identikal {}{}, version {}{}", e.model_name, e.verb,
                            method.empty() || method == e.verb ? "" : " (" + method + ")",
                            result.version, date.empty() ? "" : ", result written " + date));
  out.push_back(status_line(e));
  for (const Warning& w : e.warnings) {
    if (w.code == "data_treated") out.push_back("recorded: " + w.text);
    if (w.severity == "note") continue;
    out.push_back((w.severity == "serious" ? "SERIOUS: " : "warning: ") + w.text);
  }
  if (e.model_file) {
    out.push_back(fmt::format("model {}, sha256 {}", e.model_file->path, e.model_file->sha256));
  }
  for (const InputRecord& input : e.inputs) {
    out.push_back(fmt::format("data {}, {} of {} rows used, sha256 {}", input.path, input.used,
                              input.rows, input.sha256));
  }
  if (!result.command.empty()) out.push_back("command: " + result.command);
  return out;
}

std::vector<std::string> parameter_lines(const Estimate& e, bool with_known) {
  std::vector<std::string> out;
  for (const EstimatedParameter& p : e.parameters) {
    if (p.fixed && !with_known) continue;
    out.push_back(
        fmt::format("{} = {:.6g}{}, {}", p.name, p.value, unit_text(p.unit), remark_of(p)));
  }
  if (!e.covariance_kind.empty()) out.push_back("se from " + e.covariance_kind);
  return out;
}

std::vector<std::string> curve_lines(const Estimate& e) {
  std::vector<std::string> out{
      "single-track model, ISO 8855: x forward, y and angles positive to the left; C of an axle is "
      "Cf or Cr",
      "m (vy' + vx r) = Ff + Fr - m g sin(bank), Iz r' = a Ff - b Fr",
      "delta(t) = steering_gain (angle(t - steering_delay) + steering_offset) / steering_ratio",
      "slip alpha_f = (vy + a r)/vx - delta, alpha_r = (vy - b r)/vx; linear force L = -C alpha"};
  if (e.tyre_curve == "linear") out.emplace_back("tyre curve linear: F = L");
  if (e.tyre_curve == "tanh") {
    out.emplace_back("tyre curve tanh: F = D tanh(L/D), D = Ff_max or Fr_max");
  }
  if (e.tyre_curve == "fiala") {
    out.emplace_back(
        "tyre curve fiala: x = |L|/D, F = L (1 - x/3 + x^2/27) up to x = 3, then D sign(L); D = "
        "Ff_max or Fr_max");
  }
  if (e.tyre_curve == "magic-formula") {
    out.emplace_back(
        "tyre curve magic-formula: F = D sin(c atan(y - e (y - atan(y)))), y = L/(c D), D = Ff_max "
        "or Fr_max, c = curve_shape, e = curve_curvature");
  }
  for (const EstimatedParameter& p : e.parameters) {
    if (!is_straight(p)) continue;
    out.push_back(
        fmt::format("F = L for the {} axle, so there is no {}: it stays straight as far "
                    "as the recording goes",
                    p.name == "Ff_max" ? "front" : "rear", p.name));
  }
  return out;
}

std::string channel_list(const std::vector<SteadyFilter::Channel>& channels,
                         const char* unit_is = "recorded in ") {
  std::string out;
  for (const SteadyFilter::Channel& c : channels) {
    out += fmt::format("{}{}{}", out.empty() ? "" : ", ", c.name,
                       c.unit.empty() ? "" : fmt::format(" ({}{})", unit_is, c.unit));
  }
  return out;
}

std::vector<std::string> filter_lines(const Estimate& e) {
  const SteadyFilter& f = *e.filter;
  std::vector<std::string> out;
  out.emplace_back(
      "x(t+1) = A x + B u + G w, y = C x + D u + v, cov[w; v] = [Q S; S' R], discrete time, SI");
  if (!f.states.empty()) out.push_back("states x: " + channel_list(f.states, ""));
  out.push_back("outputs y: " + channel_list(f.outputs));
  if (!f.inputs.empty()) out.push_back("inputs u: " + channel_list(f.inputs));
  out.emplace_back("innovation e = y - C x_pred - D u");
  if (f.K.size() == 0) {
    out.emplace_back("this model has no steady filter, and so no K and L");
    return out;
  }
  out.emplace_back(
      "predictor form, one gain: x_pred(t+1) = A x_pred(t) + B u(t) + K_predictor e(t)");
  const bool crossed = !f.model.S.isZero(0.0);
  out.push_back(
      std::string("filter form, two steps: x_filt(t) = x_pred(t) + L_filter e(t), x_pred(t+1) = A "
                  "x_filt(t) + B u(t)") +
      (crossed ? " + G S Sigma^-1 e(t)" : ""));
  out.emplace_back("both gains hold once the filter has settled, where no sample is missing");
  return out;
}

struct NamedMatrix {
  std::string name;
  MatrixXd value;
  std::string remark;
};

struct StructMember {
  std::string name, unit;
  double value, se;
  std::string remark, verdict;
};

// What there is to write, whatever the language.
struct Contents {
  std::string suffix;  // of the name that all stands under
  std::string group;   // of the members, where a language has none of its own
  std::vector<StructMember> members;
  std::optional<double> dt;
  std::vector<NamedMatrix> matrices;
  std::string tyre_curve;
  std::string Q_kind;  // where no remark of a matrix tells a program
  std::vector<SteadyFilter::Channel> states, outputs, inputs;
  std::vector<std::string> lines;  // what a reader has to know
};

std::vector<NamedMatrix> filter_matrices(const Estimate& e) {
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

// A name that is no word of a language's own.
std::string member_name(const std::string& name) {
  static const std::set<std::string, std::less<>> reserved{
      "alignas",   "alignof",  "and",      "asm",       "auto",      "bitand",     "bitor",
      "bool",      "break",    "case",     "catch",     "char",      "class",      "classdef",
      "compl",     "concept",  "const",    "consteval", "constexpr", "constinit",  "continue",
      "decltype",  "default",  "delete",   "do",        "double",    "else",       "elseif",
      "end",       "enum",     "explicit", "export",    "extern",    "false",      "float",
      "for",       "friend",   "function", "global",    "goto",      "if",         "inline",
      "int",       "long",     "mutable",  "namespace", "new",       "noexcept",   "not",
      "nullptr",   "operator", "or",       "otherwise", "parfor",    "persistent", "private",
      "protected", "public",   "register", "requires",  "restrict",  "return",     "short",
      "signed",    "sizeof",   "spmd",     "static",    "struct",    "switch",     "template",
      "this",      "throw",    "true",     "try",       "typedef",   "typeid",     "typename",
      "union",     "unsigned", "using",    "virtual",   "void",      "volatile",   "while",
      "xor"};
  return reserved.contains(name) ? name + "_" : name;
}

// The estimates in SI, one after the other.
std::vector<StructMember> members_of(const Estimate& e, bool vehicle) {
  std::vector<StructMember> out;
  for (const EstimatedParameter& p : e.parameters) {
    if (is_straight(p)) continue;
    const Unit unit = parse_unit(p.unit).value_or(Unit{});
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

void add_formulas(Contents& to, const StoredResult& result) {
  const Estimate& e = result.estimate;
  const ModelFile model = estimated_model(e, result.path);
  const StateSpace written = written_matrices(model.linear, model.parameters);
  const bool density = e.noise.Q_kind == "density";
  for (const StateName& state : model.states) to.states.push_back({state.name, state.unit});
  to.outputs = channels_of(model.outputs);
  to.inputs = channels_of(model.inputs);
  to.Q_kind = e.noise.Q_kind;
  to.matrices = {{"Q", written.G * written.Q * written.G.transpose(),
                  density ? "process noise of the states, power per time (density)"
                          : "process noise of the states, covariance per sample"},
                 {"R", written.R, "measurement noise, covariance per sample"},
                 {"x0", written.x0, "state at the first sample: mean"},
                 {"P0", written.P0, "and its covariance"}};
  to.lines.push_back(fmt::format("{} filter; numbers in SI; the formulas stand in the model file",
                                 e.objective.filter));
  to.lines.push_back("states x: " + channel_list(to.states, ""));
  to.lines.push_back("outputs y: " + channel_list(to.outputs));
  if (!to.inputs.empty()) to.lines.push_back("inputs u: " + channel_list(to.inputs));
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

Contents contents_of(const StoredResult& result) {
  const Estimate& e = result.estimate;
  Contents out;
  switch (kind_of(e)) {
    case Kind::nothing:
      throw InputError(
          {result.path, 0, 0},
          fmt::format("a result of '{}' that holds no filter, vehicle or model of formulas",
                      e.verb),
          "a result of tune, check or fit");
    case Kind::vehicle:
      out.suffix = out.group = "car";
      out.members = members_of(e, true);
      out.tyre_curve = e.tyre_curve;
      out.lines = curve_lines(e);
      break;
    case Kind::filter:
      out.suffix = "filter";
      out.dt = e.filter->model.dt;
      out.matrices = filter_matrices(e);
      out.states = e.filter->states;
      out.outputs = e.filter->outputs;
      out.inputs = e.filter->inputs;
      out.lines = parameter_lines(e, true);
      for (std::string& line : filter_lines(e)) out.lines.push_back(std::move(line));
      break;
    case Kind::formulas:
      out.suffix = "model";
      out.group = "p";
      out.members = members_of(e, false);
      add_formulas(out, result);
      break;
  }
  std::erase_if(out.matrices, [](const NamedMatrix& m) { return m.value.size() == 0; });
  return out;
}

std::string row_text(const MatrixXd& M, Index i) {
  std::string out;
  for (Index j = 0; j < M.cols(); ++j) out += (j > 0 ? ", " : "") + exact(M(i, j));
  return out;
}

std::string rows_text(const MatrixXd& M, const char* open, const char* between, const char* close) {
  std::string out;
  for (Index i = 0; i < M.rows(); ++i) {
    out += (i > 0 ? between : "") + (open + row_text(M, i)) + close;
  }
  return out;
}

std::string ending(const std::string& remark, const FormatNames& format) {
  return remark.empty() ? "\n" : fmt::format("  {} {}\n", format.comment, remark);
}

std::string c_header(const Contents& c, const std::string& model, const FormatNames& format,
                     const std::string& comments) {
  const bool cpp = format.format == ExportFormat::cpp;
  const std::string name = identifier(model) + "_" + c.suffix;
  std::string guard = name + (cpp ? "_hpp" : "_h");
  for (char& letter : guard) letter = static_cast<char>(std::toupper(letter));
  const auto constant = [&](const char* type, const std::string& of) {
    return cpp ? fmt::format("inline constexpr {} {}", type, of)
               : fmt::format("static const {} {}_{}", type, name, of);
  };
  std::string out = comments + fmt::format("#ifndef {0}\n#define {0}\n\n", guard);
  if (!c.matrices.empty()) out += "// matrices by rows\n";
  if (cpp) out += fmt::format("namespace {} {{\n\n", name);
  if (!c.members.empty()) {
    out += cpp ? "struct Parameters {\n" : "typedef struct {\n";
    for (const StructMember& m : c.members)
      out += fmt::format("  double {};  // {}\n", member_name(m.name), m.unit);
    out += cpp ? "};\n\ninline constexpr Parameters estimate = {\n"
               : fmt::format(
                     "}} {0}_parameters;\n\nstatic const {0}_parameters {0}_estimate = {{\n", name);
    for (const StructMember& m : c.members) {
      out += fmt::format("    {},  // {} [{}], {}\n", exact(m.value), m.name, m.unit, m.remark);
    }
    out += "};\n";
  }
  if (c.dt) {
    out +=
        fmt::format("{} = {};  // sampling period [s]\n", constant("double", "dt"), exact(*c.dt));
  }
  for (const NamedMatrix& m : c.matrices) {
    out += fmt::format("{}[{}][{}] = {{{}}};", constant("double", m.name), m.value.rows(),
                       m.value.cols(), rows_text(m.value, "{", ", ", "}")) +
           ending(m.remark, format);
  }
  if (!c.tyre_curve.empty()) {
    out += fmt::format("{} = \"{}\";\n", constant("char", "tyre_curve[]"), c.tyre_curve);
  }
  if (cpp) out += fmt::format("\n}}  // namespace {}\n", name);
  return out + "\n#endif\n";
}

std::string matlab_script(const Contents& c, const FormatNames& format) {
  std::string out;
  for (const StructMember& m : c.members) {
    out += fmt::format("{}.{} = {};  % {}, {}\n", c.group, member_name(m.name), exact(m.value),
                       m.unit, m.remark);
  }
  if (c.dt) out += fmt::format("dt = {};  % sampling period [s]\n", exact(*c.dt));
  for (const NamedMatrix& m : c.matrices) {
    out += fmt::format("{} = [{}];", m.name, rows_text(m.value, "", "; ", "")) +
           ending(m.remark, format);
  }
  if (!c.tyre_curve.empty()) out += fmt::format("{}.tyre_curve = '{}';\n", c.group, c.tyre_curve);
  return out;
}

std::string python_script(const Contents& c, const FormatNames& format) {
  std::string out;
  if (!c.matrices.empty()) out += "import numpy as np\n\n";
  if (!c.members.empty()) {
    out += c.group + " = {\n";
    for (const StructMember& m : c.members) {
      out += fmt::format("    \"{}\": {},  # {}, {}\n", m.name, exact(m.value), m.unit, m.remark);
    }
    out += "}\n";
  }
  if (c.dt) out += fmt::format("dt = {}  # sampling period [s]\n", exact(*c.dt));
  for (const NamedMatrix& m : c.matrices) {
    out += fmt::format("{} = np.array([{}])", m.name, rows_text(m.value, "[", ", ", "]")) +
           ending(m.remark, format);
  }
  if (!c.tyre_curve.empty()) out += fmt::format("tyre_curve = \"{}\"\n", c.tyre_curve);
  return out;
}

using ExportJson = nlohmann::ordered_json;

// What head() says, for programs.
ExportJson identity(const StoredResult& result, const std::string& date) {
  const Estimate& e = result.estimate;
  ExportJson warnings = ExportJson::array(), data = ExportJson::array();
  for (const Warning& w : e.warnings) {
    warnings.push_back({{"code", w.code}, {"severity", w.severity}, {"text", w.text}});
  }
  for (const InputRecord& input : e.inputs) {
    data.push_back({{"path", input.path},
                    {"sha256", input.sha256},
                    {"rows", input.rows},
                    {"used", input.used}});
  }
  const auto known = [](const std::string& text) {
    return text.empty() ? ExportJson(nullptr) : ExportJson(text);
  };
  return {{"model", e.model_name},
          {"verb", e.verb},
          {"method", e.objective.method},
          {"version", result.version},
          {"written", known(date)},
          {"command", known(result.command)},
          {"status", {{"code", to_string(e.status)}, {"message", e.message}}},
          {"warnings", warnings},
          {"model_file", !e.model_file ? ExportJson(nullptr)
                                       : ExportJson{{"path", e.model_file->path},
                                                    {"sha256", e.model_file->sha256}}},
          {"data", data}};
}

std::string numbers(const StoredResult& result, const Contents& c, const std::string& date) {
  const Estimate& e = result.estimate;
  const auto number = [](double x) {
    return std::isfinite(x) ? ExportJson(x) : ExportJson(nullptr);
  };
  const auto parameter = [&](double value, const std::string& unit, double se,
                             const std::string& verdict) {
    return ExportJson{
        {"value", number(value)}, {"unit", unit}, {"se", number(se)}, {"verdict", verdict}};
  };
  ExportJson out = identity(result, date), parameters = ExportJson::object();
  const auto name_channels = [&](const char* key, const std::vector<SteadyFilter::Channel>& list,
                                 const char* unit) {
    out[key] = ExportJson::array();
    for (const SteadyFilter::Channel& channel : list) {
      out[key].push_back({{"name", channel.name}, {unit, channel.unit}});
    }
  };
  if (!c.states.empty()) name_channels("states", c.states, "unit");
  if (c.tyre_curve.empty()) {
    name_channels("outputs", c.outputs, "recorded_in");
    name_channels("inputs", c.inputs, "recorded_in");
  } else {
    out["tyre_curve"] = c.tyre_curve;
    out["straight_axles"] = ExportJson::array();
    for (const EstimatedParameter& p : e.parameters) {
      if (is_straight(p)) out["straight_axles"].push_back(p.name == "Ff_max" ? "front" : "rear");
    }
  }
  if (c.dt) out["dt"] = *c.dt;
  if (!c.Q_kind.empty()) out["Q_kind"] = c.Q_kind;
  for (const NamedMatrix& m : c.matrices) {
    ExportJson rows = ExportJson::array();
    for (Index i = 0; i < m.value.rows(); ++i) {
      ExportJson row = ExportJson::array();
      for (Index j = 0; j < m.value.cols(); ++j) row.push_back(number(m.value(i, j)));
      rows.push_back(std::move(row));
    }
    out[m.name] = std::move(rows);
  }
  for (const StructMember& m : c.members)
    parameters[m.name] = parameter(m.value, m.unit, m.se, m.verdict);
  if (c.members.empty()) {
    for (const EstimatedParameter& p : e.parameters) {
      parameters[p.name] =
          parameter(p.value, p.unit, p.se, p.fixed ? "known" : to_string(p.verdict));
    }
  }
  out["parameters"] = std::move(parameters);
  return out.dump(-1, ' ', false, ExportJson::error_handler_t::replace) + "\n";
}

// The first name, as the export has it, behind which a number is missing; empty: all are there.
std::string missing_number(const Contents& c) {
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

const std::vector<std::string>& export_formats() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const FormatNames& each : kFormats) out.emplace_back(each.name);
    return out;
  }();
  return names;
}

std::string export_format_list() {
  const std::vector<std::string>& names = export_formats();
  return fmt::format("{} or {}", fmt::join(names.begin(), names.end() - 1, ", "), names.back());
}

std::optional<ExportFormat> export_format(std::string_view name) {
  for (const FormatNames& each : kFormats) {
    if (name == each.name) return each.format;
  }
  return std::nullopt;
}

std::string_view describe(ExportFormat format) { return names_of(format).title; }

std::string export_text(const StoredResult& result, ExportFormat format, const std::string& date) {
  const Estimate& e = result.estimate;
  const Contents contents = contents_of(result);
  if (const std::string name = missing_number(contents); !name.empty()) {
    throw InputError({result.path, 0, 0}, fmt::format("a number of '{}' is missing", name),
                     "a result as -o writes it", "run the job again with -o");
  }
  if (kind_of(e) == Kind::filter) check_filter(result);
  const FormatNames& names = names_of(format);
  std::vector<std::string> lines = head(result, date);
  const std::vector<std::string> more = format != ExportFormat::yaml
                                            ? contents.lines
                                            : parameter_lines(e, kind_of(e) == Kind::filter);
  lines.insert(lines.end(), more.begin(), more.end());
  const std::string comments = commented(lines, names.comment);
  switch (format) {
    case ExportFormat::cpp:
    case ExportFormat::c:
      return c_header(contents, e.model_name, names, comments);
    case ExportFormat::matlab:
      return comments + matlab_script(contents, names);
    case ExportFormat::python:
      return comments + python_script(contents, names);
    case ExportFormat::json:
      return numbers(result, contents, date);
    case ExportFormat::yaml:
      break;
  }
  const std::optional<std::string> model = estimated_model_text(e, result.path);
  if (!model) {
    throw InputError(
        {e.model_file->path, 0, 0}, "the estimates cannot be put in the place of its values",
        "every value on one line of the model file itself, none in an included one", "--to json");
  }
  return comments + *model;
}

}  // namespace identikal
