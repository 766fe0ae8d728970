#include "identify/export_result.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "identify/estimated_model.h"
#include "identify/model_file.h"
#include "identify/report.h"
#include "lib/error.h"
#include "lib/units.h"

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

bool is_vehicle(const Estimate& e) { return !e.tyre_curve.empty(); }

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
  return out + ", " + to_string(p.verdict) + (with.empty() ? "" : " with" + with);
}

std::string status_line(const Estimate& e) {
  switch (e.status) {
    case Status::untrusted:
      return "NOT TO BE TRUSTED: " + e.message;
    case Status::not_converged:
      return "NOT CONVERGED, the best so far: " + e.message;
    case Status::answer_no:
      return "THE ANSWER WAS NO: " + e.message;
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

std::string channel_list(const std::vector<SteadyFilter::Channel>& channels) {
  std::string out;
  for (const SteadyFilter::Channel& c : channels) {
    out += fmt::format("{}{}{}", out.empty() ? "" : ", ", c.name,
                       c.unit.empty() ? "" : fmt::format(" (recorded in {})", c.unit));
  }
  return out;
}

std::vector<std::string> filter_lines(const Estimate& e) {
  const SteadyFilter& f = *e.filter;
  std::vector<std::string> out;
  out.emplace_back(
      "x(t+1) = A x + B u + G w, y = C x + D u + v, cov[w; v] = [Q S; S' R], discrete time, SI");
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
  const MatrixXd* value;
  std::string remark;
};

// Those that are there.
std::vector<NamedMatrix> matrices_of(const Estimate& e) {
  const SteadyFilter& f = *e.filter;
  const bool density = e.noise.Q_kind == "density";
  std::vector<NamedMatrix> all{
      {"A", &f.model.A, ""},
      {"B", &f.model.B, ""},
      {"C", &f.model.C, ""},
      {"D", &f.model.D, ""},
      {"G", &f.model.G, ""},
      {"Q", &f.model.Q, "process noise, covariance of w per sample"},
      {"R", &f.model.R, "measurement noise, covariance of v per sample"},
      {"S", &f.model.S, "covariance of w and v per sample"},
      {"K_predictor", &f.K, "steady gain of the predictor form, K = (A P C' + G S) Sigma^-1"},
      {"L_filter", &f.L, "steady gain of the filter form, L = P C' Sigma^-1"},
      {"P", &f.P, "steady covariance of x(t) - x_pred(t), before y(t) is known"},
      {"Sigma", &f.Sigma, "steady covariance of e, C P C' + R"}};
  if (density) {
    all.insert(all.begin() + 6,
               {"Q_density", &e.noise.Q,
                "process noise as the model file has it, power per time (density)"});
  }
  std::erase_if(all, [](const NamedMatrix& m) { return m.value->size() == 0; });
  return all;
}

struct StructMember {
  std::string name, unit;
  double value, se;  // SI
  std::string remark, verdict;
};

std::vector<StructMember> members_of(const Estimate& e) {
  std::vector<StructMember> out;
  for (const EstimatedParameter& p : e.parameters) {
    if (is_straight(p)) continue;
    const Unit unit = parse_unit(p.unit).value_or(Unit{});
    const std::string si = vehicle_unit(p.name);
    // Only a number that stays the same keeps its last digit.
    const bool same = unit.scale == 1.0 && unit.offset == 0.0;
    std::string remark = remark_of(p);
    if (!same) remark += fmt::format("; {:.6g} {}", p.value, p.unit);
    out.push_back({p.name, si.empty() ? "-" : si, same ? p.value : unit.to_si(p.value),
                   unit.scale * p.se, remark, p.fixed ? "known" : to_string(p.verdict)});
  }
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

std::string c_header(const Estimate& e, const FormatNames& format, const std::string& comments) {
  const bool cpp = format.format == ExportFormat::cpp, vehicle = is_vehicle(e);
  const std::string name = identifier(e.model_name) + (vehicle ? "_car" : "_filter");
  std::string guard = name + (cpp ? "_hpp" : "_h");
  for (char& c : guard) c = static_cast<char>(std::toupper(c));
  std::string out = comments + fmt::format("#ifndef {0}\n#define {0}\n\n", guard);
  const auto array = [&](const std::string& of, const MatrixXd& M) {
    return fmt::format("{}{}[{}][{}] = {{{}}};",
                       cpp ? "inline constexpr double " : "static const double " + name + "_", of,
                       M.rows(), M.cols(), rows_text(M, "{", ", ", "}"));
  };
  if (vehicle) {
    if (cpp) out += fmt::format("namespace {} {{\n\n", name);
    out += cpp ? "struct Parameters {\n" : "typedef struct {\n";
    for (const StructMember& m : members_of(e)) {
      out += fmt::format("  double {};  // {}\n", m.name, m.unit);
    }
    out += cpp ? "};\n\ninline constexpr Parameters estimate = {\n"
               : fmt::format(
                     "}} {0}_parameters;\n\nstatic const {0}_parameters {0}_estimate = {{\n", name);
    for (const StructMember& m : members_of(e)) {
      out += fmt::format("    {},  // {} [{}], {}\n", exact(m.value), m.name, m.unit, m.remark);
    }
    out += "};\n";
    out += fmt::format("{}tyre_curve[] = \"{}\";\n",
                       cpp ? "inline constexpr char " : "static const char " + name + "_",
                       e.tyre_curve);
  } else {
    out += "// matrices by rows\n";
    if (cpp) out += fmt::format("namespace {} {{\n\n", name);
    out += fmt::format("{}dt = {};  // sampling period [s]\n",
                       cpp ? "inline constexpr double " : "static const double " + name + "_",
                       exact(e.filter->model.dt));
    for (const NamedMatrix& m : matrices_of(e)) {
      out += array(m.name, *m.value) + ending(m.remark, format);
    }
  }
  if (cpp) out += fmt::format("\n}}  // namespace {}\n", name);
  return out + "\n#endif\n";
}

std::string matlab_script(const Estimate& e, const FormatNames& format) {
  std::string out;
  if (is_vehicle(e)) {
    for (const StructMember& m : members_of(e)) {
      out += fmt::format("car.{} = {};  % {}, {}\n", m.name, exact(m.value), m.unit, m.remark);
    }
    return out + fmt::format("car.tyre_curve = '{}';\n", e.tyre_curve);
  }
  out += fmt::format("dt = {};  % sampling period [s]\n", exact(e.filter->model.dt));
  for (const NamedMatrix& m : matrices_of(e)) {
    out += fmt::format("{} = [{}];", m.name, rows_text(*m.value, "", "; ", "")) +
           ending(m.remark, format);
  }
  return out;
}

std::string python_script(const Estimate& e, const FormatNames& format) {
  std::string out;
  if (is_vehicle(e)) {
    out += "car = {\n";
    for (const StructMember& m : members_of(e)) {
      out += fmt::format("    \"{}\": {},  # {}, {}\n", m.name, exact(m.value), m.unit, m.remark);
    }
    return out + fmt::format("}}\ntyre_curve = \"{}\"\n", e.tyre_curve);
  }
  out += "import numpy as np\n\n";
  out += fmt::format("dt = {}  # sampling period [s]\n", exact(e.filter->model.dt));
  for (const NamedMatrix& m : matrices_of(e)) {
    out += fmt::format("{} = np.array([{}])", m.name, rows_text(*m.value, "[", ", ", "]")) +
           ending(m.remark, format);
  }
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

std::string numbers(const StoredResult& result, const std::string& date) {
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
  if (!is_vehicle(e)) {
    const auto channels = [](const std::vector<SteadyFilter::Channel>& list) {
      ExportJson names = ExportJson::array();
      for (const SteadyFilter::Channel& c : list) {
        names.push_back({{"name", c.name}, {"recorded_in", c.unit}});
      }
      return names;
    };
    out["outputs"] = channels(e.filter->outputs);
    out["inputs"] = channels(e.filter->inputs);
    out["dt"] = e.filter->model.dt;
    for (const NamedMatrix& m : matrices_of(e)) {
      ExportJson rows = ExportJson::array();
      for (Index i = 0; i < m.value->rows(); ++i) {
        ExportJson row = ExportJson::array();
        for (Index j = 0; j < m.value->cols(); ++j) row.push_back(number((*m.value)(i, j)));
        rows.push_back(std::move(row));
      }
      out[m.name] = std::move(rows);
    }
    for (const EstimatedParameter& p : e.parameters) {
      parameters[p.name] =
          parameter(p.value, p.unit, p.se, p.fixed ? "known" : to_string(p.verdict));
    }
  } else {
    out["tyre_curve"] = e.tyre_curve;
    out["straight_axles"] = ExportJson::array();
    for (const EstimatedParameter& p : e.parameters) {
      if (is_straight(p)) out["straight_axles"].push_back(p.name == "Ff_max" ? "front" : "rear");
    }
    for (const StructMember& m : members_of(e)) {
      parameters[m.name] = parameter(m.value, m.unit, m.se, m.verdict);
    }
  }
  out["parameters"] = std::move(parameters);
  return out.dump(-1, ' ', false, ExportJson::error_handler_t::replace) + "\n";
}

bool holds_numbers(const Estimate& e) {
  return e.verb != "bound" && (e.filter.has_value() || (is_vehicle(e) && !e.parameters.empty()));
}

// The first name, as the export has it, behind which a number is missing; empty: all are there.
std::string missing_number(const Estimate& e) {
  if (is_vehicle(e)) {
    for (const StructMember& m : members_of(e)) {
      if (!std::isfinite(m.value)) return m.name;
    }
    return "";
  }
  const StateSpace& model = e.filter->model;
  if (!std::isfinite(model.dt)) return "dt";
  if (model.A.size() == 0) return "A";
  if (model.C.size() == 0) return "C";
  for (const NamedMatrix& m : matrices_of(e)) {
    if (!m.value->allFinite()) return m.name;
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

bool is_exportable(const Estimate& e) { return holds_numbers(e) && missing_number(e).empty(); }

std::string export_text(const StoredResult& result, ExportFormat format, const std::string& date) {
  const Estimate& e = result.estimate;
  if (!holds_numbers(e)) {
    throw InputError(
        {result.path, 0, 0},
        fmt::format("a result of '{}' that holds neither a filter nor a vehicle", e.verb),
        "a result of tune, check or fit");
  }
  if (const std::string name = missing_number(e); !name.empty()) {
    throw InputError({result.path, 0, 0}, fmt::format("a number of '{}' is missing", name),
                     "a result as -o writes it", "run the job again with -o");
  }
  const FormatNames& names = names_of(format);
  std::vector<std::string> lines = head(result, date);
  if (!is_vehicle(e) || format == ExportFormat::yaml) {
    const std::vector<std::string> more = parameter_lines(e, !is_vehicle(e));
    lines.insert(lines.end(), more.begin(), more.end());
  }
  if (format != ExportFormat::yaml) {
    const std::vector<std::string> more = is_vehicle(e) ? curve_lines(e) : filter_lines(e);
    lines.insert(lines.end(), more.begin(), more.end());
  }
  const std::string comments = commented(lines, names.comment);
  switch (format) {
    case ExportFormat::cpp:
    case ExportFormat::c:
      return c_header(e, names, comments);
    case ExportFormat::matlab:
      return comments + matlab_script(e, names);
    case ExportFormat::python:
      return comments + python_script(e, names);
    case ExportFormat::json:
      return numbers(result, date);
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
