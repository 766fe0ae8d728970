#include "lib/formula/expression.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "lib/base/constants.h"
#include "lib/base/nearest_name.h"

namespace identikal {
namespace {

constexpr std::size_t kMaxFormula = 10'000;
constexpr int kMaxNesting = 100;

struct OpWord {
  std::string_view word;
  int operands;
};
// In the order of Op.
constexpr OpWord kOpWords[] = {
    {"number", 0}, {"symbol", 0}, {"+", 2},    {"-", 2},     {"*", 2},     {"/", 2},    {"-", 1},
    {"1/", 1},     {"^", 2},      {"<", 2},    {"<=", 2},    {">", 2},     {">=", 2},   {"==", 2},
    {"!=", 2},     {"and", 2},    {"or", 2},   {"not", 1},   {"if", 3},    {"sin", 1},  {"cos", 1},
    {"tan", 1},    {"asin", 1},   {"acos", 1}, {"atan", 1},  {"atan2", 2}, {"sinh", 1}, {"cosh", 1},
    {"tanh", 1},   {"exp", 1},    {"log", 1},  {"log10", 1}, {"sqrt", 1},  {"abs", 1},  {"sign", 1},
    {"floor", 1},  {"min", 2},    {"max", 2},  {"hypot", 2},
};
static_assert(std::size(kOpWords) == static_cast<std::size_t>(Op::hypot) + 1);

const OpWord& op_word(Op op) { return kOpWords[static_cast<std::size_t>(op)]; }

std::optional<Op> function_named(std::string_view name) {
  if (name == "pow") return Op::power;
  for (std::size_t i = static_cast<std::size_t>(Op::choose); i < std::size(kOpWords); ++i) {
    if (kOpWords[i].word == name) return static_cast<Op>(i);
  }
  return std::nullopt;
}

bool is_condition_op(Op op) { return op >= Op::less && op <= Op::logical_not; }

// Recursive descent; every way back into itself passes a Level, which limits the depth.
class FormulaParser {
 public:
  FormulaParser(std::string_view text, std::span<const std::string> names)
      : text_(text), names_(names) {}

  Expression parse(FormulaKind kind) {
    if (text_.size() > kMaxFormula) {
      throw FormulaError(0, "a formula of " + std::to_string(text_.size()) + " bytes",
                         "at most " + std::to_string(kMaxFormula),
                         "give parts of it names of their own");
    }
    next();
    const Part whole = disjunction();
    if (token_ != Token::end) unexpected("an operator such as '+', or the end");
    need(whole, kind == FormulaKind::condition);
    return std::move(out_);
  }

 private:
  enum class Token { end, number, name, sign };
  struct Part {
    int node;
    bool condition;
  };
  class Level {
   public:
    explicit Level(FormulaParser& parser) : parser_(parser) {
      if (++parser_.depth_ > kMaxNesting) {
        throw FormulaError(parser_.column_,
                           "nesting deeper than " + std::to_string(kMaxNesting) + " levels",
                           "a simpler formula", "give parts of it names of their own");
      }
    }
    ~Level() { --parser_.depth_; }
    Level(const Level&) = delete;
    Level& operator=(const Level&) = delete;

   private:
    FormulaParser& parser_;
  };

  static bool digit(char c) { return c >= '0' && c <= '9'; }
  static bool name_begins(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || (c & 0x80) != 0;
  }
  static bool blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }
  char at(std::size_t i) const { return i < text_.size() ? text_[i] : '\0'; }

  // Steps to the next token. Columns count characters, not the bytes of one character.
  void next() {
    const auto advance = [this] {
      if ((text_[pos_] & 0xC0) != 0x80) ++characters_;
      ++pos_;
    };
    while (pos_ < text_.size() && blank(text_[pos_])) advance();
    column_ = characters_ + 1;
    const std::size_t begin = pos_;
    if (pos_ == text_.size()) {
      token_ = Token::end;
    } else if (digit(text_[pos_]) || (text_[pos_] == '.' && digit(at(pos_ + 1)))) {
      token_ = Token::number;
      const char* end = text_.data() + text_.size();
      const auto [stop, error] = std::from_chars(text_.data() + pos_, end, number_);
      const auto size = static_cast<std::size_t>(stop - text_.data()) - pos_;
      if (error != std::errc{}) {
        throw FormulaError(column_, quoted(text_.substr(pos_, size)) + " is out of range",
                           "a number from 1e-307 to 1e308");
      }
      for (std::size_t i = 0; i < size; ++i) advance();
    } else if (const auto* typeset = typeset_sign(); typeset != nullptr) {
      throw FormulaError(column_, quoted(typeset->first) + " is not " + typeset->second,
                         "the sign of the keyboard");
    } else if (name_begins(text_[pos_])) {
      token_ = Token::name;
      while ((name_begins(at(pos_)) || digit(at(pos_))) && typeset_sign() == nullptr) advance();
    } else {
      token_ = Token::sign;
      static constexpr std::string_view kLong[] = {"<=", ">=", "==", "!=", "**", "&&", "||"};
      const bool two =
          std::find(std::begin(kLong), std::end(kLong), text_.substr(pos_, 2)) != std::end(kLong);
      advance();
      if (two) advance();
    }
    word_ = text_.substr(begin, pos_ - begin);
  }

  // Signs that text processors put in the place of those of the keyboard: no part of a name.
  const std::pair<std::string_view, const char*>* typeset_sign() const {
    static constexpr std::pair<std::string_view, const char*> kTypeset[] = {
        {"\u2212", "the minus sign '-'"},    {"\u2013", "the minus sign '-'"},
        {"\u2014", "the minus sign '-'"},    {"\u2010", "the minus sign '-'"},
        {"\u00B7", "the product sign '*'"},  {"\u22C5", "the product sign '*'"},
        {"\u00D7", "the product sign '*'"},  {"\u00F7", "the quotient sign '/'"},
        {"\u2215", "the quotient sign '/'"}, {"\u00B2", "the power '^2'"},
        {"\u00B3", "the power '^3'"},        {"\u00A0", "a blank ' '"},
    };
    for (const auto& each : kTypeset) {
      if (text_.substr(pos_).starts_with(each.first)) return &each;
    }
    return nullptr;
  }

  bool is_sign(std::string_view sign) const { return token_ == Token::sign && word_ == sign; }
  bool is_word(std::string_view word) const { return token_ == Token::name && word_ == word; }

  static std::string quoted(std::string_view text) {
    constexpr std::size_t kLongest = 40;
    if (text.size() <= kLongest) return "'" + std::string(text) + "'";
    std::size_t cut = kLongest;
    while (cut > 0 && (text[cut] & 0xC0) == 0x80) --cut;
    return "'" + std::string(text.substr(0, cut)) + "...'";
  }

  [[noreturn]] void unexpected(const std::string& expected) const {
    static constexpr std::pair<std::string_view, std::string_view> kHabits[] = {
        {"**", "a power is written ^"},
        {"=", "equality is written =="},
        {"&&", "write 'and'"},
        {"||", "write 'or'"},
        {"&", "write 'and'"},
        {"|", "write 'or'"},
        {"!", "write 'not'"},
        {"?", "a choice is written if(condition, then, else)"},
        {";", "arguments are separated by ','"},
    };
    std::string hint;
    for (const auto& [sign, text] : kHabits) {
      if (is_sign(sign)) hint = text;
    }
    if (after_value_ && (token_ == Token::name || token_ == Token::number || is_sign("("))) {
      hint = "a product needs '*'; numbers carry no units";
    }
    throw FormulaError(column_, token_ == Token::end ? "the formula ends" : quoted(word_), expected,
                       hint);
  }

  int push(Op op, int column, int a = -1, int b = -1, int c = -1) {
    out_.nodes.push_back({op, a, b, c, 0.0, -1, column, false});
    return static_cast<int>(out_.nodes.size()) - 1;
  }

  int column_of(const Part& part) const { return out_.nodes[part.node].column; }

  void need(const Part& part, bool condition) const {
    if (part.condition == condition) return;
    const std::string what(spelling(out_.nodes[part.node].op));
    if (condition) {
      throw FormulaError(column_of(part), "a number where a condition belongs",
                         "a comparison such as vx > 5");
    }
    throw FormulaError(column_of(part), "a condition ('" + what + "') where a number belongs",
                       "a number", "a choice between two numbers is if(condition, then, else)");
  }

  Part binary(Op op, int column, const Part& a, const Part& b, bool of_conditions = false) {
    need(a, of_conditions);
    need(b, of_conditions);
    return {push(op, column, a.node, b.node), is_condition_op(op)};
  }

  Part disjunction() {
    const Level level(*this);
    Part left = conjunction();
    while (is_word("or")) {
      const int column = column_;
      next();
      left = binary(Op::logical_or, column, left, conjunction(), true);
    }
    return left;
  }

  Part conjunction() {
    Part left = negated();
    while (is_word("and")) {
      const int column = column_;
      next();
      left = binary(Op::logical_and, column, left, negated(), true);
    }
    return left;
  }

  Part negated() {
    if (!is_word("not")) return compared();
    const Level level(*this);
    const int column = column_;
    next();
    const Part part = negated();
    need(part, true);
    return {push(Op::logical_not, column, part.node), true};
  }

  std::optional<Op> comparison() const {
    if (token_ != Token::sign) return std::nullopt;
    for (int i = static_cast<int>(Op::less); i <= static_cast<int>(Op::not_equal); ++i) {
      if (spelling(static_cast<Op>(i)) == word_) return static_cast<Op>(i);
    }
    return std::nullopt;
  }

  Part compared() {
    const Part left = sum();
    const std::optional<Op> op = comparison();
    if (!op) return left;
    const int column = column_;
    next();
    const Part out = binary(*op, column, left, sum());
    if (comparison()) {
      throw FormulaError(column_, "a second comparison", "one", "write a < b and b < c");
    }
    return out;
  }

  Part sum() {
    Part left = product();
    while (is_sign("+") || is_sign("-")) {
      const Op op = is_sign("+") ? Op::add : Op::subtract;
      const int column = column_;
      next();
      left = binary(op, column, left, product());
    }
    return left;
  }

  Part product() {
    Part left = with_sign();
    while (is_sign("*") || is_sign("/")) {
      const Op op = is_sign("*") ? Op::multiply : Op::divide;
      const int column = column_;
      next();
      left = binary(op, column, left, with_sign());
    }
    return left;
  }

  Part with_sign() {
    if (!is_sign("-") && !is_sign("+")) return power();
    const Level level(*this);
    const bool minus = is_sign("-");
    const int column = column_;
    next();
    const Part part = with_sign();
    need(part, false);
    return minus ? Part{push(Op::negate, column, part.node), false} : part;
  }

  Part power() {
    const Part base = atom();
    if (!is_sign("^")) return base;
    const Level level(*this);
    const int column = column_;
    next();
    return binary(Op::power, column, base, with_sign());
  }

  Part atom() {
    after_value_ = false;
    const int column = column_;
    if (token_ == Token::number) {
      const int node = push(Op::number, column);
      out_.nodes.back().value = number_;
      next();
      after_value_ = true;
      return {node, false};
    }
    if (is_sign("(")) {
      next();
      const Part inside = disjunction();
      close();
      return inside;
    }
    if (token_ == Token::name) return named(column);
    unexpected("a number, a name, a function or '('");
  }

  void close() {
    if (!is_sign(")")) unexpected("')' or an operator");
    next();
    after_value_ = true;
  }

  Part named(int column) {
    const std::string name(word_);
    if (name == "and" || name == "or" || name == "not") {
      unexpected("a number, a name, a function or '('");
    }
    next();
    if (const std::optional<Op> function = function_named(name)) {
      if (!is_sign("(")) {
        throw FormulaError(column, "'" + name + "' without arguments", "'" + name + "('");
      }
      return call(*function, name, column);
    }
    const auto hit = std::find(names_.begin(), names_.end(), name);
    if (is_sign("(")) {
      if (hit != names_.end()) {
        throw FormulaError(column, quoted(name) + " is not a function", "", "a product needs '*'");
      }
      throw FormulaError(column, "unknown function " + quoted(name),
                         "sin, cos, exp, log, sqrt, min, if, ...",
                         did_you_mean(name, known_names(true)));
    }
    after_value_ = true;
    if (hit != names_.end()) {
      const int node = push(Op::symbol, column);
      out_.nodes.back().symbol = static_cast<int>(hit - names_.begin());
      return {node, false};
    }
    if (name == "pi" || name == "g") {
      const int node = push(Op::number, column);
      out_.nodes.back().value = name == "pi" ? std::numbers::pi : kStandardGravity;
      out_.nodes.back().gravity = name == "g";
      return {node, false};
    }
    throw FormulaError(column, "unknown name " + quoted(name), "a name that the model declares",
                       did_you_mean(name, known_names(false)));
  }

  std::vector<std::string> known_names(bool functions) const {
    std::vector<std::string> out;
    if (!functions) {
      out.assign(names_.begin(), names_.end());
      out.insert(out.end(), {"pi", "g"});
      return out;
    }
    for (std::size_t i = static_cast<std::size_t>(Op::choose); i < std::size(kOpWords); ++i) {
      out.emplace_back(kOpWords[i].word);
    }
    out.emplace_back("pow");
    return out;
  }

  Part call(Op op, const std::string& name, int column) {
    std::vector<Part> arguments;
    do {
      next();
      arguments.push_back(disjunction());
    } while (is_sign(","));
    close();
    const bool any_number = op == Op::min || op == Op::max;
    const auto wanted = static_cast<std::size_t>(operands(op));
    if (any_number ? arguments.size() < wanted : arguments.size() != wanted) {
      throw FormulaError(column,
                         "'" + name + "' with " + std::to_string(arguments.size()) +
                             (arguments.size() == 1 ? " argument" : " arguments"),
                         (any_number ? "at least " : "") + std::to_string(wanted));
    }
    for (std::size_t i = 0; i < arguments.size(); ++i) {
      need(arguments[i], op == Op::choose && i == 0);
    }
    int node = push(op, column, arguments[0].node, wanted > 1 ? arguments[1].node : -1,
                    wanted > 2 ? arguments[2].node : -1);
    for (std::size_t i = 2; any_number && i < arguments.size(); ++i) {
      node = push(op, column, node, arguments[i].node);
    }
    return {node, false};
  }

  std::string_view text_;
  std::span<const std::string> names_;
  std::size_t pos_ = 0;
  int characters_ = 0;  // before pos_
  int depth_ = 0;
  Token token_ = Token::end;
  std::string_view word_;     // the token's text
  double number_ = 0.0;       // its value
  int column_ = 0;            // where it begins
  bool after_value_ = false;  // it follows something complete
  Expression out_;
};

std::string formula_message(int column, const std::string& found, const std::string& expected,
                            const std::string& hint) {
  const std::string place = column > 0 ? "column " + std::to_string(column) + ": " : "";
  return InputError({}, place + found, expected, hint).what();
}

}  // namespace

int operands(Op op) { return op_word(op).operands; }
std::string_view spelling(Op op) { return op_word(op).word; }

double apply(Op op, double a, double b, double c) {
  switch (op) {
    case Op::number:
    case Op::symbol:
      return kNaN;
    case Op::add:
      return a + b;
    case Op::subtract:
      return a - b;
    case Op::multiply:
      return a * b;
    case Op::divide:
      return a / b;
    case Op::negate:
      return -a;
    case Op::reciprocal:
      return 1.0 / a;
    case Op::power:
      return std::pow(a, b);
    case Op::less:
      return a < b ? 1.0 : 0.0;
    case Op::less_equal:
      return a <= b ? 1.0 : 0.0;
    case Op::greater:
      return a > b ? 1.0 : 0.0;
    case Op::greater_equal:
      return a >= b ? 1.0 : 0.0;
    case Op::equal:
      return a == b ? 1.0 : 0.0;
    case Op::not_equal:
      return a != b ? 1.0 : 0.0;
    case Op::logical_and:
      return a != 0.0 && b != 0.0 ? 1.0 : 0.0;
    case Op::logical_or:
      return a != 0.0 || b != 0.0 ? 1.0 : 0.0;
    case Op::logical_not:
      return a == 0.0 ? 1.0 : 0.0;
    case Op::choose:
      return a != 0.0 ? b : c;
    case Op::sin:
      return std::sin(a);
    case Op::cos:
      return std::cos(a);
    case Op::tan:
      return std::tan(a);
    case Op::asin:
      return std::asin(a);
    case Op::acos:
      return std::acos(a);
    case Op::atan:
      return std::atan(a);
    case Op::atan2:
      return std::atan2(a, b);
    case Op::sinh:
      return std::sinh(a);
    case Op::cosh:
      return std::cosh(a);
    case Op::tanh:
      return std::tanh(a);
    case Op::exp:
      return std::exp(a);
    case Op::log:
      return std::log(a);
    case Op::log10:
      return std::log10(a);
    case Op::sqrt:
      return std::sqrt(a);
    case Op::abs:
      return std::abs(a);
    case Op::sign:
      return a > 0.0 ? 1.0 : a < 0.0 ? -1.0 : a;
    case Op::floor:
      return std::floor(a);
    case Op::min:
      return a <= b ? a : b;
    case Op::max:
      return a >= b ? a : b;
    case Op::hypot:
      return std::hypot(a, b);
  }
  return kNaN;
}

FormulaError::FormulaError(int column, const std::string& found, const std::string& expected,
                           const std::string& hint)
    : std::runtime_error(formula_message(column, found, expected, hint)),
      column_(column),
      found_(found),
      expected_(expected),
      hint_(hint) {}

InputError FormulaError::in_file(const Location& at) const {
  return {at, found_, expected_, hint_};
}

Expression parse_expression(std::string_view text, std::span<const std::string> names,
                            FormulaKind kind) {
  return FormulaParser(text, names).parse(kind);
}

bool is_reserved_word(std::string_view name) {
  return name == "and" || name == "or" || name == "not" || function_named(name).has_value();
}

double evaluate(const Expression& expression, std::span<const double> symbols) {
  std::vector<double> value(expression.nodes.size());
  const auto operand = [&](int node) { return node < 0 ? 0.0 : value[node]; };
  for (std::size_t i = 0; i < value.size(); ++i) {
    const Expression::Node& node = expression.nodes[i];
    value[i] = node.op == Op::number ? node.value
               : node.op == Op::symbol
                   ? symbols[node.symbol]
                   : apply(node.op, operand(node.a), operand(node.b), operand(node.c));
  }
  return value.back();
}

}  // namespace identikal
