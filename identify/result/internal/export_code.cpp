#include "identify/result/internal/export_code.h"

#include <algorithm>
#include <cctype>
#include <set>

#include <fmt/format.h>

#include "identify/result/internal/filter_code.h"
#include "lib/base/constants.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;

constexpr const char* kCovarianceRemark =
    "P times it is the size of the errors: references, held-out rows or a likelier model "
    "contradict P";

std::string exact(double value) { return number_code(value, CodeLanguage::c); }

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
  if (reserved.contains(name)) return name + "_";
  std::string out;  // of an entry of a matrix, "R(1,2)": R_1_2
  for (const char c : name) {
    if (c != ')') out += c == '(' || c == ',' ? '_' : c;
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

std::string ending(const std::string& remark, const char* mark) {
  return remark.empty() ? "\n" : fmt::format("  {} {}\n", mark, remark);
}

// What a program calls the equations' parameters: members that are there, numbers else.
FilterCodeNames names_in_filter(const ExportContents& c, const std::string& prefix,
                                const std::string& before, const std::string& behind,
                                CodeLanguage language) {
  FilterCodeNames out{prefix, {}};
  const ParameterSet& parameters = c.program->parameters;
  for (Index i = 0; i < as_formulas(*c.program).equations.parameters; ++i) {
    const Parameter& p = parameters[static_cast<std::size_t>(i)];
    const bool is_member = std::any_of(c.members.begin(), c.members.end(),
                                       [&](const StructMember& m) { return m.name == p.name; });
    const std::string word = language == CodeLanguage::c ? member_name(p.name) : p.name;
    out.parameters.push_back(is_member ? before + word + behind
                                       : number_code(p.scalar(), language));
  }
  return out;
}

// Where the equations are continuous and their steps are known.
bool has_integration_step(const ExportContents& c) {
  return c.program && as_formulas(*c.program).equations.continuous;
}

// Without the rounding of time stamps.
double integration_step(const ExportContents& c) {
  if (!(c.integration_step > 0.0)) return kInfinity;
  return std::stod(fmt::format("{:.9g}", c.integration_step));
}

}  // namespace

std::string c_header(const ExportContents& c, const std::string& model, const std::string& comments,
                     bool cpp) {
  const std::string name = identifier(model) + "_" + c.suffix;
  std::string guard = name + (cpp ? "_hpp" : "_h");
  for (char& letter : guard) letter = static_cast<char>(std::toupper(letter));
  const auto constant = [&](const char* type, const std::string& of) {
    return cpp ? fmt::format("inline constexpr {} {}", type, of)
               : fmt::format("static const {} {}_{}", type, name, of);
  };
  std::string out = comments + fmt::format("#ifndef {0}\n#define {0}\n\n", guard);
  if (c.program) out += "#include <math.h>\n\n";
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
  if (c.covariance_factor) {
    out += fmt::format("{} = {};  // {}\n", constant("double", "covariance_factor"),
                       exact(*c.covariance_factor), kCovarianceRemark);
  }
  for (const NamedMatrix& m : c.matrices) {
    out += fmt::format("{}[{}][{}] = {{{}}};", constant("double", m.name), m.value.rows(),
                       m.value.cols(), rows_text(m.value, "{", ", ", "}")) +
           ending(m.remark, "//");
  }
  if (!c.tyre_curve.empty()) {
    out += fmt::format("{} = \"{}\";\n", constant("char", "tyre_curve[]"), c.tyre_curve);
  }
  if (has_integration_step(c)) {
    out += fmt::format("{} = {};  // of the integration [s], at most\n",
                       constant("double", "longest_step"),
                       number_code(integration_step(c), CodeLanguage::c));
  }
  if (c.program) {
    const std::string prefix = cpp ? "" : name + "_";
    out += filter_in_c(*c.program,
                       names_in_filter(c, prefix, prefix + "estimate.", "", CodeLanguage::c), cpp);
  }
  if (cpp) out += fmt::format("\n}}  // namespace {}\n", name);
  return out + "\n#endif\n";
}

std::string matlab_script(const ExportContents& c) {
  std::string out;
  for (const StructMember& m : c.members) {
    out += fmt::format("{}.{} = {};  % {}, {}\n", c.group, member_name(m.name), exact(m.value),
                       m.unit, m.remark);
  }
  if (c.dt) out += fmt::format("dt = {};  % sampling period [s]\n", exact(*c.dt));
  if (c.covariance_factor) {
    out += fmt::format("covariance_factor = {};  % {}\n", exact(*c.covariance_factor),
                       kCovarianceRemark);
  }
  for (const NamedMatrix& m : c.matrices) {
    out +=
        fmt::format("{} = [{}];", m.name, rows_text(m.value, "", "; ", "")) + ending(m.remark, "%");
  }
  if (!c.tyre_curve.empty()) out += fmt::format("{}.tyre_curve = '{}';\n", c.group, c.tyre_curve);
  return out;
}

std::string python_script(const ExportContents& c) {
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
  if (c.covariance_factor) {
    out += fmt::format("covariance_factor = {}  # {}\n", exact(*c.covariance_factor),
                       kCovarianceRemark);
  }
  for (const NamedMatrix& m : c.matrices) {
    out += fmt::format("{} = np.array([{}])", m.name, rows_text(m.value, "[", ", ", "]")) +
           ending(m.remark, "#");
  }
  if (!c.tyre_curve.empty()) out += fmt::format("tyre_curve = \"{}\"\n", c.tyre_curve);
  if (has_integration_step(c)) {
    out += fmt::format("longest_step = {}  # of the integration [s], at most\n",
                       number_code(integration_step(c), CodeLanguage::python));
  }
  if (c.program) {
    out +=
        filter_in_python(*c.program, names_in_filter(c, "", "p[\"", "\"]", CodeLanguage::python));
  }
  return out;
}

}  // namespace identikal
