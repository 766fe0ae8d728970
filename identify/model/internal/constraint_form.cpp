#include "identify/model/internal/constraint_form.h"

#include <algorithm>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "identify/model/model_values.h"
#include "lib/base/nearest_name.h"
#include "lib/data/units.h"
#include "lib/formula/dimension.h"

namespace identikal {
namespace {

constexpr std::size_t kMost = 100;
constexpr const char* kExpected = "such as \"Cf < Cr\" or \"a + b = 2.6 m\"";

// Where the sign is, and which.
struct Sign {
  std::size_t at = 0, length = 0;
  char kind = '=';  // '<', '>' or '='
};

std::optional<Sign> sign_of(const std::string& text) {
  const std::size_t at = text.find_first_of("<>=");
  if (at == std::string::npos) return std::nullopt;
  Sign out{at, 1, text[at]};
  if (at + 1 < text.size() && text[at + 1] == '=') out.length = 2;
  const bool another = text.find_first_of("<>=!", at + out.length) != std::string::npos;
  const bool unequal = at > 0 && text[at - 1] == '!';
  return another || unequal ? std::nullopt : std::optional(out);
}

// One side: a formula, and its dimension where units count.
struct Side {
  Expression formula;
  std::optional<Dimension> dimension;
};

class ConstraintReader {
 public:
  ConstraintReader(bool with_units, const Model& model) : with_units_(with_units), model_(model) {
    for (const Parameter& each : model.parameters) {
      names_.push_back(each.name);
      dimensions_.push_back(dimension_of(unit_or_dimensionless(each.unit)));
    }
  }

  void read(const YamlNode& node) {
    const std::string& text = text_of(node, "a constraint");
    const std::optional<Sign> sign = sign_of(text);
    if (!sign) {
      throw InputError(node.at, fmt::format("the constraint {}", describe(node)),
                       fmt::format("two sides with one of <, <=, >, >=, =, {}", kExpected));
    }
    const Side left = side(node, text, 0, sign->at);
    const Side right = side(node, text, sign->at + sign->length, text.size());
    check_units(node, *sign, left, right);
    const bool turned = sign->kind == '>';
    g.push_back(
        difference(turned ? right.formula : left.formula, turned ? left.formula : right.formula));
    check_parameters(node, g.back());
    equality.push_back(sign->kind == '=');
    texts.push_back(text);
  }

  std::vector<Expression> g;
  std::vector<bool> equality;
  std::vector<std::string> texts;

 private:
  Side side(const YamlNode& node, const std::string& text, std::size_t from, std::size_t to) const {
    const std::string_view part = std::string_view(text).substr(from, to - from);
    const std::optional<Quantity> quantity = split_quantity(trimmed(part));
    if (quantity && (quantity->unit.empty() || parse_unit(quantity->unit))) {
      return number(*quantity);
    }
    try {
      Side out{parse_expression(part, names_), std::nullopt};
      if (with_units_) out.dimension = dimension_of(out.formula, dimensions_);
      return out;
    } catch (const FormulaError& error) {
      const int before = static_cast<int>(from);
      throw error.in_file(place_in(node, error.column() > 0 ? error.column() + before : 0));
    }
  }

  static Side number(const Quantity& quantity) {
    const Unit unit = unit_or_dimensionless(quantity.unit);
    Side out;
    Expression::Node node;
    node.value = unit.to_si(quantity.number);
    out.formula.nodes.push_back(node);
    if (!quantity.unit.empty()) out.dimension = dimension_of(unit);
    return out;
  }

  static Expression difference(Expression left, const Expression& right) {
    const auto first = static_cast<int>(left.nodes.size());
    for (Expression::Node node : right.nodes) {
      for (int* operand : {&node.a, &node.b, &node.c}) {
        if (*operand >= 0) *operand += first;
      }
      left.nodes.push_back(node);
    }
    Expression::Node minus;
    minus.op = Op::subtract;
    minus.a = first - 1;
    minus.b = static_cast<int>(left.nodes.size()) - 1;
    left.nodes.push_back(minus);
    return left;
  }

  void check_units(const YamlNode& node, const Sign& sign, const Side& left,
                   const Side& right) const {
    if (!with_units_ || !left.dimension || !right.dimension) return;
    if (fits(*left.dimension, *right.dimension)) return;
    throw InputError(place_in(node, static_cast<int>(sign.at) + 1),
                     fmt::format("the left side is {}, the right side {}",
                                 in_words(*left.dimension), in_words(*right.dimension)),
                     "two sides of one dimension");
  }

  void check_parameters(const YamlNode& node, const Expression& formula) const {
    std::set<int> free;
    for (const Expression::Node& each : formula.nodes) {
      if (each.op != Op::symbol) continue;
      const Parameter& of = model_.parameters[static_cast<std::size_t>(each.symbol)];
      if (of.domain != Domain::scalar || of.value.size() != 1) {
        throw InputError(node.at, fmt::format("{} in a constraint is a matrix", in_quotes(of.name)),
                         "parameters that are numbers");
      }
      if (!of.fixed) free.insert(each.symbol);
    }
    if (free.size() == 1) {
      const Parameter& of = model_.parameters[static_cast<std::size_t>(*free.begin())];
      throw InputError(node.at,
                       fmt::format("the constraint {} holds one parameter alone that is estimated",
                                   in_quotes(node.text)),
                       fmt::format("'min' and 'max' of {}, or its value", in_quotes(of.name)));
    }
    if (free.empty()) {
      throw InputError(
          node.at,
          fmt::format("the constraint {} holds nothing that is estimated", in_quotes(node.text)),
          "two parameters or more that are estimated");
    }
  }

  bool with_units_;
  const Model& model_;
  std::vector<std::string> names_;
  std::vector<Dimension> dimensions_;
};

}  // namespace

void read_constraints(const YamlNode& root, bool with_units, Model& out) {
  const YamlNode* node = find(root, "constraints");
  if (node == nullptr) return;
  if (node->kind != YamlNode::Kind::list || node->items.empty()) {
    throw InputError(node->at, "constraints is " + describe(*node),
                     fmt::format("a list of conditions {}", kExpected));
  }
  if (node->items.size() > kMost) {
    throw InputError(node->at, fmt::format("{} constraints", node->items.size()),
                     fmt::format("at most {}", kMost));
  }
  ConstraintReader reader(with_units, out);
  for (const YamlNode& each : node->items) reader.read(each);
  for (const RecordingTable::Own& own : out.recordings.own) {
    for (std::size_t i = 0; i < reader.g.size(); ++i) {
      const bool holds = std::any_of(
          reader.g[i].nodes.begin(), reader.g[i].nodes.end(),
          [&](const auto& part) { return part.op == Op::symbol && part.symbol == own.parameter; });
      if (!holds) continue;
      throw InputError(node->items[i].at,
                       fmt::format("{} in a constraint has a value of its own in every recording",
                                   in_quotes(out.parameters[own.parameter].name)),
                       "parameters of all recordings");
    }
  }
  out.constraints = make_constraints(reader.g, std::move(reader.equality), std::move(reader.texts),
                                     static_cast<int>(out.parameters.size()));
}

}  // namespace identikal
