#include "identify/model/curves.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "identify/model/internal/yaml_tree.h"
#include "identify/model/model_values.h"
#include "lib/base/error.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using Node = YamlNode;

// Formulas have at most 10 000 bytes.
constexpr std::size_t kMostKnots = 14, kMostOfTable = 60;

// One axis: the formula, and the knots in units of the mean distance between them.
struct Axis {
  std::string formula;  // over the unit of the knots
  std::vector<double> knots;
  double unit = 1.0;      // distance, in the unit that the knots are written in
  std::string unit_name;  // of what it runs over; empty: a pure number
};

Axis read_axis(const Node& formula, const Node& knots, const std::string& what, std::size_t least,
               std::size_t most) {
  Axis out;
  out.formula = text_of(formula, what);
  if (knots.kind != Node::Kind::list || knots.items.size() < least || knots.items.size() > most) {
    throw InputError(knots.at, fmt::format("the knots of {}", what),
                     fmt::format("a list of {} to {} rising numbers: [-1, 0, 1]", least, most));
  }
  for (const Node& each : knots.items) {
    const Quantity at = parse_quantity(text_of(each, what), each.at, "a knot of " + what);
    if (!out.knots.empty() && at.unit != out.unit_name) {
      throw InputError(each.at,
                       fmt::format("a knot in '{}' behind one in '{}'", at.unit, out.unit_name),
                       "all knots in one unit");
    }
    out.unit_name = at.unit;
    if (!out.knots.empty() && !(at.number > out.knots.back())) {
      throw InputError(each.at, fmt::format("knot {:g} behind {:g}", at.number, out.knots.back()),
                       "knots that rise");
    }
    out.knots.push_back(at.number);
  }
  out.unit = (out.knots.back() - out.knots.front()) / static_cast<double>(out.knots.size() - 1);
  const double first = out.knots.front();
  for (double& each : out.knots) each = (each - first) / out.unit;
  return out;
}

// Behind a knot: 0 before it, then a straight line.
std::string beyond(const std::string& z, double knot) {
  return fmt::format("max(0, {} - {:.17g})", z, knot);
}

// sum of weights times names; small ones are rounding.
std::string weighted(const VectorXd& weights, const std::vector<std::string>& names) {
  std::string out;
  const double largest = weights.cwiseAbs().maxCoeff();
  for (Index i = 0; i < weights.size(); ++i) {
    if (std::abs(weights[i]) <= 1e-13 * largest) continue;
    out += fmt::format("{}{:.15g}*{}", out.empty() || weights[i] < 0.0 ? "" : "+", weights[i],
                       names[static_cast<std::size_t>(i)]);
  }
  return out.empty() ? "0*" + names.front() : out;
}

std::string spline_formula(const Axis& axis, const std::string& z,
                           const std::vector<std::string>& values) {
  const std::vector<double>& knots = axis.knots;
  const auto n = static_cast<Index>(knots.size());
  const MatrixXd M = spline_coefficients(knots);
  const double last = knots.back();
  const std::string inside = fmt::format("min(max(0, {}), {:.15g})", z, last);
  std::string out = fmt::format("({})", weighted(M.row(0), values));
  for (Index k = 1; k < n; ++k) {
    const std::string coefficient = weighted(M.row(k), values);
    if (k < 4)
      out += fmt::format(" + ({})*{}^{}", coefficient, inside, k);
    else
      out += fmt::format(" + ({})*{}^3", coefficient,
                         beyond(inside, knots[static_cast<std::size_t>(k) - 2]));
  }
  // Outside of the knots straight on.
  const VectorXd begin = spline_weights(knots, 0.0, true), end = spline_weights(knots, last, true);
  out += fmt::format(" + ({})*min(0, {})", weighted(begin, values), z);
  return out + fmt::format(" + ({})*{}", weighted(end, values), beyond(z, last));
}

// 1 at knot i, 0 at all others, straight between them and outside.
std::string hat(const Axis& axis, const std::string& z, std::size_t i) {
  const std::vector<double>& at = axis.knots;
  const std::size_t last = at.size() - 1;
  // As a line and its kinks: slopes before and behind each knot.
  const auto slope = [&](std::size_t interval) {
    if (interval + 1 == i) return 1.0 / (at[i] - at[i - 1]);
    return interval == i ? -1.0 / (at[i + 1] - at[i]) : 0.0;
  };
  std::string out = i == 0 ? "1" : "0";
  if (slope(0) != 0.0) out += fmt::format(" + {:.17g}*({} - {:.17g})", slope(0), z, at[0]);
  for (std::size_t k = 1; k < last; ++k) {
    const double kink = slope(k) - slope(k - 1);
    if (kink != 0.0) out += fmt::format(" + {:.15g}*{}", kink, beyond(z, at[k]));
  }
  return "(" + out + ")";
}

bool carries_unit(const Node& value) {
  const auto quantity = split_quantity(value.text);
  return quantity && !quantity->unit.empty();
}

// Writes one curve: its formula, and its parameters where the file has none of that name.
class CurveWriter {
 public:
  CurveWriter(Node& parameters, const Node& name, const Node& node)
      : parameters_(parameters),
        name_(name.text),
        node_(node),
        what_("curve '" + name.text + "'") {}

  Node write() {
    check_keys(node_, what_, {"spline", "table", "knots", "values", "unit", "smooth"});
    const Node* spline = find(node_, "spline");
    const Node* table = find(node_, "table");
    if ((spline == nullptr) == (table == nullptr)) {
      throw InputError(node_.at, fmt::format("{} without 'spline' or 'table', or with both", what_),
                       "one of them: {spline: x, knots: [-1, 0, 1]}");
    }
    if (const Node* smooth = find(node_, "smooth"); smooth != nullptr && table != nullptr) {
      throw InputError(smooth->at, fmt::format("{}: 'smooth' of a table", what_),
                       "of a spline alone", "write 'spline' in place of 'table'");
    }
    const Node& knots = required(node_, "knots", what_, "knots: [-1, 0, 1]");
    if (spline != nullptr) return of_one(read_axis(*spline, knots, what_, 3, kMostKnots), true);
    if (table->kind == Node::Kind::list) return of_two(*table, knots);
    return of_one(read_axis(*table, knots, what_, 2, kMostKnots), false);
  }

 private:
  // What the axis runs over, in knot distances from the first knot. A fixed parameter carries the unit.
  std::string scaled(const Axis& axis, const Node& knots, const std::string& suffix) {
    const double first = split_quantity(knots.items.front().text)->number / axis.unit;
    const std::string name = name_ + "_distance" + suffix;
    Node value = yaml_mapping();
    append(value, "value",
           yaml_scalar(fmt::format("{:.17g}{}{}", axis.unit, axis.unit_name.empty() ? "" : " ",
                                   axis.unit_name),
                       node_));
    append(value, "fixed", yaml_scalar("true", node_));
    add(name, std::move(value));
    return fmt::format("(({})/{} - {:.17g})", axis.formula, name, first);
  }

  void add(const std::string& name, Node value) {
    if (find(parameters_, name) == nullptr) append(parameters_, name, std::move(value));
  }

  std::vector<std::string> add_values(const std::vector<std::string>& suffixes) {
    const Node* values = find(node_, "values");
    const Node* unit = find(node_, "unit");
    const bool fits = values == nullptr ||
                      (values->kind == Node::Kind::list && values->items.size() == suffixes.size());
    if (!fits) {
      throw InputError(values->at, fmt::format("the values of {}", what_),
                       fmt::format("a list of {}, one of each knot", suffixes.size()));
    }
    std::vector<std::string> names;
    for (std::size_t i = 0; i < suffixes.size(); ++i) {
      Node value = yaml_mapping();
      append(value, "value", values != nullptr ? values->items[i] : yaml_scalar("0", node_));
      const bool has_its_own = values != nullptr && carries_unit(values->items[i]);
      if (unit != nullptr && !has_its_own) append(value, "unit", *unit);
      names.push_back(name_ + suffixes[i]);
      add(names.back(), std::move(value));
    }
    return names;
  }

  Node of_one(const Axis& axis, bool smooth) {
    std::vector<std::string> suffixes;
    for (std::size_t i = 1; i <= axis.knots.size(); ++i) suffixes.push_back(fmt::format("_{}", i));
    const std::vector<std::string> values = add_values(suffixes);
    const std::string z = scaled(axis, *find(node_, "knots"), "");
    if (smooth) return yaml_scalar(spline_formula(axis, z, values), node_);
    std::string out;
    for (std::size_t i = 0; i < values.size(); ++i)
      out += (i == 0 ? "" : " + ") + values[i] + "*" + hat(axis, z, i);
    return yaml_scalar(out, node_);
  }

  Node of_two(const Node& table, const Node& knots) {
    if (table.items.size() != 2 || knots.kind != Node::Kind::list || knots.items.size() != 2) {
      throw InputError(
          table.at, fmt::format("{} over {} formulas", what_, table.items.size()),
          "two, with a list of knots for each: {table: [x, y], knots: [[0, 1], [0, 1]]}");
    }
    const Axis x = read_axis(table.items[0], knots.items[0], what_, 2, kMostKnots),
               y = read_axis(table.items[1], knots.items[1], what_, 2, kMostKnots);
    if (x.knots.size() * y.knots.size() > kMostOfTable) {
      throw InputError(knots.at,
                       fmt::format("{} with {} values", what_, x.knots.size() * y.knots.size()),
                       fmt::format("at most {}", kMostOfTable));
    }
    std::vector<std::string> suffixes;
    for (std::size_t i = 1; i <= x.knots.size(); ++i) {
      for (std::size_t j = 1; j <= y.knots.size(); ++j)
        suffixes.push_back(fmt::format("_{}_{}", i, j));
    }
    const std::vector<std::string> values = add_values(suffixes);
    const std::string zx = scaled(x, knots.items[0], "_1"), zy = scaled(y, knots.items[1], "_2");
    std::string out;
    for (std::size_t i = 0, k = 0; i < x.knots.size(); ++i) {
      std::string row;
      for (std::size_t j = 0; j < y.knots.size(); ++j)
        row += (j == 0 ? "" : " + ") + values[k++] + "*" + hat(y, zy, j);
      out += fmt::format("{}({})*{}", i == 0 ? "" : " + ", row, hat(x, zx, i));
    }
    return yaml_scalar(out, node_);
  }

  Node& parameters_;
  const std::string name_;
  const Node& node_;
  const std::string what_;
};

}  // namespace

YamlNode with_curves(YamlNode root) {
  if (root.kind != Node::Kind::mapping) return root;
  const Node* let = find(root, "let");
  if (let == nullptr || let->kind != Node::Kind::mapping) return root;
  const bool any = std::any_of(let->items.begin(), let->items.end(),
                               [](const Node& each) { return each.kind == Node::Kind::mapping; });
  if (!any) return root;
  Node definitions = *let;
  Node& parameters = value_at(root, "parameters");
  check_mapping(parameters, "parameters");
  for (std::size_t i = 0; i < definitions.keys.size(); ++i) {
    const Node given = definitions.items[i];
    if (given.kind == Node::Kind::mapping)
      definitions.items[i] = CurveWriter(parameters, definitions.keys[i], given).write();
  }
  value_at(root, "let") = std::move(definitions);
  return root;
}

std::vector<SplineCurve> spline_curves(const YamlNode& root, const ParameterSet& parameters) {
  std::vector<SplineCurve> out;
  const Node* let = root.kind == Node::Kind::mapping ? find(root, "let") : nullptr;
  if (let == nullptr || let->kind != Node::Kind::mapping) return out;
  for (std::size_t i = 0; i < let->keys.size(); ++i) {
    const Node& given = let->items[i];
    const Node* over = given.kind == Node::Kind::mapping ? find(given, "spline") : nullptr;
    if (over == nullptr) continue;
    const std::string what = "curve '" + let->keys[i].text + "'";
    const Axis axis = read_axis(*over, *find(given, "knots"), what, 3, kMostKnots);
    SplineCurve curve;
    curve.name = let->keys[i].text;
    curve.knots = axis.knots;
    curve.axis = axis.formula;
    curve.axis_unit = axis.unit_name;
    curve.distance = axis.unit;
    curve.origin = split_quantity(find(given, "knots")->items.front().text)->number;
    if (const Node* smooth = find(given, "smooth"))
      curve.smooth = word_of(*smooth, "'smooth' of " + what, {"true", "false"}) == "true";
    for (std::size_t k = 1; k <= axis.knots.size(); ++k)
      curve.values.push_back(find_parameter(parameters, fmt::format("{}_{}", curve.name, k)));
    const bool all =
        std::all_of(curve.values.begin(), curve.values.end(), [](int at) { return at >= 0; });
    if (all) out.push_back(std::move(curve));
  }
  return out;
}

}  // namespace identikal
