#include "identify/linear_form.h"

#include <algorithm>
#include <cctype>
#include <functional>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "identify/model_values.h"
#include "lib/nearest_name.h"

namespace identikal {
namespace {

/// The parameters of a model while it is read: those that matrices may refer to by name, and after
/// them the ones that are whole matrices.
struct Names {
  ParameterSet set;
  const YamlNode* declared = nullptr;             // the mapping that the named ones come from
  std::map<std::string, int, std::less<>> index;  // of the named ones
  std::vector<bool> used;
};

bool is_name(std::string_view text) {
  const auto is_letter = [](char c) {
    return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_' || (c & 0x80) != 0;
  };
  return !text.empty() && is_letter(text.front()) &&
         std::all_of(text.begin(), text.end(), [&](char c) {
           return is_letter(c) || std::isdigit(static_cast<unsigned char>(c)) != 0;
         });
}

Names read_names(const YamlNode& root) {
  Names out;
  out.declared = find(root, "parameters");
  if (out.declared == nullptr) return out;
  check_mapping(*out.declared, "parameters");
  for (std::size_t i = 0; i < out.declared->keys.size(); ++i) {
    const YamlNode& key = out.declared->keys[i];
    if (!is_name(key.text)) {
      throw InputError(key.at, "parameter name " + describe(key),
                       "letters, digits and '_', beginning with a letter");
    }
    out.set.push_back(read_parameter(key.text, out.declared->items[i], nullptr));
    out.index.emplace(key.text, static_cast<int>(i));
  }
  out.used.assign(out.set.size(), false);
  return out;
}

/// A linear form in the parameters: position in the set to factor, and the constant under -1.
using Terms = std::map<int, double>;

// "2*q1 - 0.5*q2 + 1e-3" at the signs between terms: not at those of an exponent.
std::vector<std::string_view> split_terms(std::string_view text) {
  std::vector<std::string_view> out;
  std::size_t begin = 0;
  bool number = true, empty = true;  // of the factor that is being read
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    const bool exponent = number && !empty && (text[i - 1] == 'e' || text[i - 1] == 'E');
    if ((c == '+' || c == '-') && !empty && !exponent) {
      out.push_back(trimmed(text.substr(begin, i - begin)));
      begin = i;
      empty = true;
    } else if (c == '*') {
      empty = true;
    } else if (c != ' ' && c != '+' && c != '-') {
      if (empty) number = c == '.' || std::isdigit(static_cast<unsigned char>(c)) != 0;
      empty = false;
    }
  }
  out.push_back(trimmed(text.substr(begin)));
  return out;
}

void add_term(std::string_view term, const YamlNode& node, const std::string& matrix, Names& names,
              Terms& out) {
  const double sign = term.starts_with('-') ? -1.0 : 1.0;
  if (term.starts_with('-') || term.starts_with('+')) term = trimmed(term.substr(1));
  if (const auto number = plain_number(term)) {
    out[-1] += sign * *number;
    return;
  }
  const std::size_t star = term.find('*');
  std::string_view name = trimmed(term.substr(0, star));
  std::string_view other = star == std::string_view::npos ? "1" : trimmed(term.substr(star + 1));
  if (plain_number(name)) std::swap(name, other);
  const std::optional<double> factor = plain_number(other);
  if (!factor || !is_name(name)) {
    throw InputError(node.at, fmt::format("an entry of {} is {}", matrix, describe(node)),
                     "a number, a parameter name, or a sum of such with factors: 2*q1 + q2",
                     "other expressions are not available yet");
  }
  const auto hit = names.index.find(name);
  if (hit == names.index.end()) {
    std::vector<std::string> known;
    for (const Parameter& parameter : names.set) known.push_back(parameter.name);
    throw InputError(node.at, fmt::format("unknown parameter {} in {}", in_quotes(name), matrix),
                     "a number or a name from 'parameters'", did_you_mean(name, known));
  }
  names.used[static_cast<std::size_t>(hit->second)] = true;
  out[hit->second] += sign * *factor;
}

Terms read_terms(const YamlNode& node, const std::string& matrix, Names& names) {
  Terms out;
  for (const std::string_view term : split_terms(text_of(node, "an entry of " + matrix))) {
    add_term(term, node, matrix, names, out);
  }
  return out;
}

/// The nodes of a matrix's entries, row by row; rectangular and not empty.
using Grid = std::vector<std::vector<const YamlNode*>>;

Grid read_grid(const YamlNode& node, const std::string& name) {
  if (node.kind == YamlNode::Kind::scalar) return {{&node}};
  Grid out;
  for (const YamlNode& row : node.items) {
    if (node.kind != YamlNode::Kind::list || row.kind != YamlNode::Kind::list) break;
    out.emplace_back();
    for (const YamlNode& entry : row.items) out.back().push_back(&entry);
    if (out.back().size() != out.front().size()) {
      throw InputError(
          row.at, fmt::format("row {} of {} has length {}", out.size(), name, out.back().size()),
          fmt::format("{}, as in row 1", out.front().size()));
    }
  }
  if (out.empty() || out.size() != node.items.size() || out.front().empty()) {
    throw InputError(node.at, fmt::format("{} is not a matrix", name),
                     "a list of rows such as [[1, 0], [0, 1]]");
  }
  if (static_cast<Eigen::Index>(std::max(out.size(), out.front().size())) > kMaxSize) {
    throw InputError(node.at, fmt::format("{} is {} x {}", name, out.size(), out.front().size()),
                     fmt::format("at most {0} x {0}", kMaxSize));
  }
  return out;
}

ParametrisedMatrix read_entries(const Grid& grid, const std::string& name, Names& names) {
  ParametrisedMatrix out;
  out.constant.setZero(static_cast<Eigen::Index>(grid.size()),
                       static_cast<Eigen::Index>(grid.front().size()));
  for (int i = 0; i < out.constant.rows(); ++i) {
    for (int j = 0; j < out.constant.cols(); ++j) {
      for (const auto& [parameter, factor] : read_terms(
               *grid[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)], name, names)) {
        if (parameter < 0) {
          out.constant(i, j) = factor;
        } else {
          out.entries.push_back({i, j, parameter, factor});
        }
      }
    }
  }
  return out;
}

constexpr Eigen::Index kAny = -1;
/// What a matrix's size must be, and what its sides mean.
struct Shape {
  Eigen::Index rows, cols;
  const char* sides;
};

void check_shape(const Grid& grid, const YamlNode& node, const std::string& name,
                 const Shape& want) {
  const auto rows = static_cast<Eigen::Index>(grid.size());
  const auto cols = static_cast<Eigen::Index>(grid.front().size());
  if ((want.rows == kAny || rows == want.rows) && (want.cols == kAny || cols == want.cols)) return;
  const auto side = [](Eigen::Index size) { return size == kAny ? "any" : std::to_string(size); };
  throw InputError(node.at, fmt::format("{} is {} x {}", name, rows, cols),
                   fmt::format("{} x {} ({})", side(want.rows), side(want.cols), want.sides));
}

ParametrisedMatrix read_matrix(const YamlNode& node, const std::string& name, const Shape& want,
                               Names& names) {
  const Grid grid = read_grid(node, name);
  check_shape(grid, node, name, want);
  return read_entries(grid, name, names);
}

ParametrisedMatrix constant_matrix(Eigen::MatrixXd value) {
  ParametrisedMatrix out;
  out.constant = std::move(value);
  return out;
}

// A parameter that is a variance stays at or above zero.
void bound_variance(Parameter& parameter, const YamlNode& declared, const std::string& matrix) {
  const std::string what =
      fmt::format("parameter '{}' is a variance in {}", parameter.name, matrix);
  if (parameter.scalar() < 0.0) {
    throw InputError(part_or_whole(declared, "value").at, what + " and its value is negative");
  }
  if (find(declared, "min") != nullptr && parameter.min < 0.0) {
    throw InputError(part_or_whole(declared, "min").at, what + " and its min is negative",
                     "min: 0 or above");
  }
  parameter.min = std::max(parameter.min, 0.0);
  if (parameter.min >= parameter.max) {
    throw InputError(part_or_whole(declared, "max").at, what, "a max above 0");
  }
}

// A covariance by entries: symmetric whatever the parameters are, no negative variance.
ParametrisedMatrix read_covariance(const YamlNode& node, const std::string& name, const Shape& want,
                                   Names& names) {
  const Grid grid = read_grid(node, name);
  check_shape(grid, node, name, want);
  ParametrisedMatrix out = read_entries(grid, name, names);
  std::map<std::pair<int, int>, Terms> terms;
  for (const ParametrisedMatrix::Entry& e : out.entries) {
    terms[{e.row, e.col}].emplace(e.parameter, e.factor);
  }
  for (int i = 0; i < out.constant.rows(); ++i) {
    const auto& row = grid[static_cast<std::size_t>(i)];
    for (int j = 0; j < i; ++j) {
      if (out.constant(i, j) != out.constant(j, i) || terms[{i, j}] != terms[{j, i}]) {
        throw InputError(
            row[static_cast<std::size_t>(j)]->at,
            fmt::format("{} is not symmetric in row {}, column {}", name, i + 1, j + 1));
      }
    }
    // A variance that is one parameter's alone bounds it; a sum may stay positive in other ways.
    const Terms& variance = terms[{i, i}];
    const YamlNode& entry = *row[static_cast<std::size_t>(i)];
    const double fixed = out.constant(i, i);
    if (fixed < 0.0 ? variance.empty()
                    : fixed == 0.0 && variance.size() == 1 && variance.begin()->second < 0.0) {
      throw InputError(entry.at,
                       fmt::format("variance {} in {} is negative", describe(entry), name));
    }
    if (variance.size() == 1 && fixed == 0.0) {
      Parameter& parameter = names.set[static_cast<std::size_t>(variance.begin()->first)];
      bound_variance(parameter, *find(*names.declared, parameter.name), name);
    }
  }
  return out;
}

double smallest_eigenvalue(const Eigen::MatrixXd& M) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(M, Eigen::EigenvaluesOnly)
      .eigenvalues()
      .minCoeff();
}

// Up to rounding in numbers that a person wrote.
bool is_semidefinite(const Eigen::MatrixXd& M) {
  return smallest_eigenvalue(M) >= -1e-12 * M.cwiseAbs().maxCoeff();
}

// A start as a number (times I), a list of the diagonal's entries, or a matrix.
Eigen::MatrixXd read_start(const YamlNode* node, const std::string& name, Eigen::Index size,
                           const char* sides) {
  if (node == nullptr) return Eigen::MatrixXd::Identity(size, size);
  const std::string what = "start of " + name;
  if (node->kind == YamlNode::Kind::scalar) {
    return read_plain_number(*node, what) * Eigen::MatrixXd::Identity(size, size);
  }
  const bool is_diagonal = node->kind == YamlNode::Kind::list && !node->items.empty() &&
                           node->items.front().kind != YamlNode::Kind::list;
  if (!is_diagonal) {
    const Grid grid = read_grid(*node, what);
    check_shape(grid, *node, what, {size, size, sides});
    Eigen::MatrixXd out(size, size);
    for (Eigen::Index i = 0; i < size; ++i) {
      for (Eigen::Index j = 0; j < size; ++j) {
        out(i, j) = read_plain_number(
            *grid[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)], what);
      }
    }
    return out;
  }
  if (static_cast<Eigen::Index>(node->items.size()) != size) {
    throw InputError(node->at, fmt::format("{} has length {}", what, node->items.size()),
                     fmt::format("{}, the diagonal", size));
  }
  Eigen::VectorXd diagonal(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    diagonal[i] = read_plain_number(node->items[static_cast<std::size_t>(i)], what);
  }
  return diagonal.asDiagonal();
}

struct Structure {
  const char* name;
  Domain domain;
};
constexpr Structure kStructures[] = {{"full", Domain::positive_definite},
                                     {"diagonal", Domain::diagonal},
                                     {"scaled-identity", Domain::scaled_identity}};

// Q or R: by entries, or {structure, start, fixed}, which makes the whole matrix one parameter.
ParametrisedMatrix read_noise_covariance(const YamlNode& node, const std::string& name,
                                         const Shape& want, Names& names) {
  if (node.kind != YamlNode::Kind::mapping) return read_covariance(node, name, want, names);
  check_keys(node, name, {"structure", "start", "fixed", "prior"});
  const std::string& structure =
      word_of(required(node, "structure", name, "structure: full, diagonal or scaled-identity"),
              "structure", names_of(kStructures));
  Parameter parameter;
  parameter.name = name;
  parameter.domain =
      std::find_if(std::begin(kStructures), std::end(kStructures), [&](const Structure& s) {
        return s.name == structure;
      })->domain;
  if (const YamlNode* fixed = find(node, "fixed")) {
    parameter.fixed = word_of(*fixed, "fixed", {"true", "false"}) == "true";
  }
  if (const YamlNode* prior = find(node, "prior")) {
    parameter.prior = read_prior(*prior, "", "the variances of " + name);
  }
  parameter.value = read_start(find(node, "start"), name, want.rows, want.sides);
  const YamlNode& start = part_or_whole(node, "start");
  if (const std::string fault = domain_fault(parameter); !fault.empty()) {
    throw InputError(start.at, fmt::format("start of {} {}", name, fault));
  }
  if (names.index.contains(name)) {
    throw InputError(find(*names.declared, name)->at,
                     fmt::format("parameter '{0}' has the name of the matrix {0}", name), "",
                     "rename it");
  }
  ParametrisedMatrix out;
  out.block = static_cast<int>(names.set.size());
  names.set.push_back(std::move(parameter));
  return out;
}

void read_initial(const YamlNode& root, Eigen::Index n, Names& names, LinearModel& model) {
  const YamlNode* node = find(root, "initial");
  if (node == nullptr) return;
  if (node->kind == YamlNode::Kind::list) {
    throw InputError(node->at, "initial is a list",
                     "stationary, diffuse, or {mean: [...], sd: [...]}");
  }
  if (node->kind != YamlNode::Kind::mapping) {
    model.initial = word_of(*node, "initial", {"stationary", "diffuse"}) == "diffuse"
                        ? InitialState::diffuse
                        : InitialState::stationary;
    return;
  }
  check_keys(*node, "initial", {"mean", "sd", "covariance"});
  const YamlNode* sd = find(*node, "sd");
  const YamlNode* covariance = find(*node, "covariance");
  if ((sd == nullptr) == (covariance == nullptr)) {
    throw InputError(node->at, "initial needs one of 'sd' and 'covariance'",
                     "initial: {mean: [...], sd: [...]}");
  }
  const auto check_length = [n](const YamlNode& list, const char* what) {
    if (list.kind == YamlNode::Kind::list && static_cast<Eigen::Index>(list.items.size()) == n) {
      return;
    }
    throw InputError(list.at,
                     list.kind == YamlNode::Kind::list
                         ? fmt::format("{} has length {}", what, list.items.size())
                         : fmt::format("{} is {}", what, describe(list)),
                     fmt::format("a list of {}, one per state", n));
  };
  const YamlNode& mean = required(*node, "mean", "initial", "mean: [...], one entry per state");
  check_length(mean, "mean");
  Grid column;
  for (const YamlNode& entry : mean.items) column.push_back({&entry});
  model.x0 = read_entries(column, "mean", names);
  if (covariance != nullptr) {
    model.P0 = read_covariance(*covariance, "covariance", {n, n, "states x states"}, names);
  } else {
    check_length(*sd, "sd");
    Eigen::VectorXd variance(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const YamlNode& entry = sd->items[static_cast<std::size_t>(i)];
      const double value = read_plain_number(entry, "sd");
      if (value < 0.0) {
        throw InputError(entry.at, fmt::format("sd {} is negative", describe(entry)));
      }
      variance[i] = value * value;
    }
    model.P0 = constant_matrix(variance.asDiagonal());
  }
  model.initial = InitialState::given;
}

}  // namespace

std::string domain_fault(const Parameter& parameter) {
  const Eigen::MatrixXd& value = parameter.value;
  if (value != value.transpose()) return "is not symmetric";
  const Eigen::MatrixXd diagonal = value.diagonal().asDiagonal();
  if (parameter.domain != Domain::positive_definite && value != diagonal) return "is not diagonal";
  if (parameter.domain == Domain::scaled_identity &&
      (value.diagonal().array() != value(0, 0)).any()) {
    return "is not a multiple of the identity";
  }
  if (!is_semidefinite(value)) return "is not positive semidefinite";
  // Its coordinates are a factor L of L L'; where L is singular, the gradient vanishes.
  if (parameter.domain == Domain::positive_definite && !parameter.fixed &&
      !(smallest_eigenvalue(value) > 0.0)) {
    return "is singular, and a free full matrix cannot start there";
  }
  return "";
}

std::optional<ModelFault> fault_at(const LinearModel& model, const ParameterSet& parameters) {
  const StateSpace at = instantiate(model, parameters);
  for (const auto& [key, value] :
       {std::pair{"A", &at.A}, std::pair{"B", &at.B}, std::pair{"C", &at.C}, std::pair{"D", &at.D},
        std::pair{"G", &at.G}, std::pair{"S", &at.S}}) {
    if (!value->allFinite()) return ModelFault{key, fmt::format("{} is too large", key)};
  }
  if (!at.x0.allFinite()) return ModelFault{"initial", "the initial mean is too large"};
  const auto check = [](const char* key, const std::string& what, const Eigen::MatrixXd& value) {
    std::optional<ModelFault> out;
    if (!value.allFinite()) {
      out = {key, what + " is too large"};
    } else if (!is_semidefinite(value)) {
      out = {key, what + " is not positive semidefinite"};
    }
    return out;
  };
  std::optional<ModelFault> fault = check("Q", "Q", at.Q);
  if (!fault) fault = check("R", "R", at.R);
  if (!fault) fault = check("initial", "the initial covariance", at.P0);
  if (!fault && !at.S.isZero(0.0)) {
    fault = check("S", "the joint covariance of Q, R and S", joint_covariance(at));
  }
  return fault;
}

void read_linear(const YamlNode& root, ModelFile& out) {
  Names names = read_names(root);
  const std::string top = "the model file";
  out.outputs = read_channels(required(root, "outputs", top, "outputs: [{name: y, column: y}]"),
                              "outputs", {});
  if (const YamlNode* inputs = find(root, "inputs")) {
    out.inputs = read_channels(*inputs, "inputs", {});
  }
  const auto ny = static_cast<Eigen::Index>(out.outputs.size());
  const auto nu = static_cast<Eigen::Index>(out.inputs.size());

  LinearModel& model = out.linear;
  const YamlNode& A = required(root, "A", top, "A: a list of rows, states x states");
  model.A = read_matrix(A, "A", {kAny, kAny, "states x states"}, names);
  const Eigen::Index n = model.A.constant.rows();
  if (model.A.constant.cols() != n) {
    throw InputError(A.at, fmt::format("A is {} x {}", n, model.A.constant.cols()),
                     "a square matrix (states x states)");
  }
  model.C = read_matrix(required(root, "C", top, "C: a list of rows, outputs x states"), "C",
                        {ny, n, "outputs x states"}, names);
  const auto optional = [&](const char* key, const Shape& want, Eigen::MatrixXd otherwise) {
    const YamlNode* node = find(root, key);
    if (node != nullptr && otherwise.cols() == 0) {
      throw InputError(node->at, fmt::format("{} is given but the model has no inputs", key),
                       "inputs: [{name: u, column: u}]");
    }
    return node == nullptr ? constant_matrix(std::move(otherwise))
                           : read_matrix(*node, key, want, names);
  };
  if (nu > 0) required(root, "B", top, "B: a list of rows, states x inputs");
  model.B = optional("B", {n, nu, "states x inputs"}, Eigen::MatrixXd::Zero(n, nu));
  model.D = optional("D", {ny, nu, "outputs x inputs"}, Eigen::MatrixXd::Zero(ny, nu));
  model.G = optional("G", {n, kAny, "states x process noises"}, Eigen::MatrixXd::Identity(n, n));
  const Eigen::Index nw = model.G.constant.cols();
  model.Q = read_noise_covariance(required(root, "Q", top, "Q: covariance of the process noise"),
                                  "Q", {nw, nw, "process noises x process noises"}, names);
  model.R =
      read_noise_covariance(required(root, "R", top, "R: covariance of the measurement noise"), "R",
                            {ny, ny, "outputs x outputs"}, names);
  model.S = optional("S", {nw, ny, "process noises x outputs"}, Eigen::MatrixXd::Zero(nw, ny));
  read_initial(root, n, names, model);
  if (out.time.step > 0.0) model.dt = out.time.step;
  const YamlNode& time = required(root, "time", top, "");
  if (const YamlNode* kind = find(time, "kind")) {
    model.continuous = text_of(*kind, "kind") == "continuous";
  }
  if (const YamlNode* hold = find(time, "inputs")) {
    const bool linear = word_of(*hold, "inputs", {"zoh", "foh"}) == "foh";
    if (!model.continuous) {
      throw InputError(hold->at, "a discrete-time model knows nothing between samples",
                       "no 'inputs' here, or kind: continuous");
    }
    model.hold = linear ? InputHold::linear : InputHold::constant;
  }

  if (const YamlNode* noise = find(root, "noise")) {
    check_keys(*noise, "noise", {"process"});
    const YamlNode& process = required(*noise, "process", "noise", "process: per-sample");
    if (word_of(process, "process", {"per-sample", "density"}) == "density") {
      if (!model.continuous) {
        throw InputError(process.at, "process noise is a density in a discrete-time model",
                         "process: per-sample, or time: {kind: continuous, ...}");
      }
      model.noise = ProcessNoise::density;
      if (const YamlNode* S = find(root, "S")) {
        throw InputError(S->at, "S has no meaning with a noise density", "process: per-sample");
      }
    }
  } else if (model.continuous) {
    throw InputError(root.at, "a continuous-time model does not say what its Q is",
                     "noise: {process: density} or noise: {process: per-sample}");
  }
  for (std::size_t i = 0; i < names.used.size(); ++i) {
    if (!names.used[i]) {
      throw InputError(names.declared->keys[i].at,
                       fmt::format("parameter '{}' is not used anywhere", names.set[i].name));
    }
  }
  if (const std::optional<ModelFault> fault = fault_at(model, names.set)) {
    throw InputError(find(root, fault->key)->at, fault->text);
  }
  out.parameters = std::move(names.set);
}

}  // namespace identikal
