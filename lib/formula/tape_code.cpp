#include "lib/formula/tape_code.h"

#include <array>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "lib/formula/internal/tape_codes.h"

namespace identikal {
namespace {

constexpr std::size_t kLongestInside = 60;  // characters of a number that stands where it is used

/// Slots that an instruction reads, as often as it does.
std::vector<std::uint32_t> operands_of(const Tape& tape, const Tape::Instruction& i) {
  switch (i.code) {
    case kMultiplyAdd:
    case kMultiplySubtract:
    case kSubtractProduct:
      return {i.a, i.b, i.c};
    case kTwoProducts:
      return {i.a, i.b, i.c, i.d};
    case kThreeProducts:
    case kSumOfProducts: {
      const auto begin = tape.places.begin() + static_cast<std::ptrdiff_t>(i.d);
      return {begin, begin + 2 * (i.positive + i.negative)};
    }
    default: {
      const std::array all{i.a, i.b, i.c};
      return {all.begin(), all.begin() + operands(static_cast<Op>(i.code))};
    }
  }
}

class TapeWriter {
 public:
  TapeWriter(const Tape& tape, CodeLanguage language, const std::vector<std::string>& symbols)
      : tape_(tape), language_(language), text_(tape.start.size()), uses_(tape.start.size(), 0) {
    for (std::size_t i = 0; i < tape.first_result; ++i) {
      text_[i] = {i < tape.symbols ? symbols[i] : number_code(tape.start[i], language), true};
      if (i >= tape.symbols && tape.start[i] < 0.0) text_[i].atom = false;
    }
  }

  TapeCode write(std::size_t columns) {
    std::vector<std::uint32_t> jacobian;
    for (std::size_t row = 0; row < tape_.values; ++row) {
      for (std::size_t k = 0; k < columns; ++k) {
        jacobian.push_back(tape_.jacobian_slot[row * tape_.columns + k]);
      }
    }
    for (const std::uint32_t slot : tape_.value_slot) ++uses_[slot];
    for (const std::uint32_t slot : jacobian) ++uses_[slot];
    count_uses();
    TapeCode out;
    for (std::size_t n = 0; n < tape_.code.size(); ++n) write_instruction(n, out);
    for (const std::uint32_t slot : tape_.value_slot) out.values.push_back(text_[slot].text);
    for (const std::uint32_t slot : jacobian) out.jacobian.push_back(text_[slot].text);
    return out;
  }

 private:
  struct Text {
    std::string text;
    bool atom = true;  // needs no parentheses as an operand
  };

  /// From the last instruction to the first: what nothing needs uses nothing.
  void count_uses() {
    for (std::size_t n = tape_.code.size(); n-- > 0;) {
      if (uses_[tape_.first_result + n] == 0) continue;
      for (const std::uint32_t slot : operands_of(tape_, tape_.code[n])) ++uses_[slot];
    }
  }

  void write_instruction(std::size_t n, TapeCode& out) {
    const std::size_t slot = tape_.first_result + n;
    if (uses_[slot] == 0) return;
    Text text = text_of(tape_.code[n]);
    if (uses_[slot] > 1 || text.text.size() > kLongestInside) {
      const std::string name = "t" + std::to_string(out.statements.size() + 1);
      out.statements.push_back(name + " = " + text.text);
      text = {name, true};
    }
    text_[slot] = std::move(text);
  }

  std::string at(std::uint32_t slot) const {
    const Text& text = text_[slot];
    return text.atom ? text.text : "(" + text.text + ")";
  }

  /// Those of a sum of products; a factor of one is left out.
  std::string product(std::uint32_t a, std::uint32_t b) const {
    const auto is_one = [&](std::uint32_t slot) {
      return slot >= tape_.symbols && slot < tape_.first_result && tape_.start[slot] == 1.0;
    };
    return is_one(b) ? at(a) : is_one(a) ? at(b) : at(a) + "*" + at(b);
  }

  std::string sum_of_products(const Tape::Instruction& i) const {
    std::string out;
    const std::uint32_t* place = tape_.places.data() + i.d;
    for (int k = 0; k < i.positive + i.negative; ++k, place += 2) {
      const bool negative = k >= i.positive;
      out += negative ? (out.empty() ? "-" : " - ") : (out.empty() ? "" : " + ");
      out += product(place[0], place[1]);
    }
    return out;
  }

  Text text_of(const Tape::Instruction& i) const {
    switch (i.code) {
      case kMultiplyAdd:
        return {product(i.a, i.b) + " + " + at(i.c), false};
      case kMultiplySubtract:
        return {product(i.a, i.b) + " - " + at(i.c), false};
      case kSubtractProduct:
        return {at(i.c) + " - " + product(i.a, i.b), false};
      case kTwoProducts:
        return {product(i.a, i.b) + " + " + product(i.c, i.d), false};
      case kThreeProducts:
      case kSumOfProducts:
        return {sum_of_products(i), false};
      default:
        return operation(static_cast<Op>(i.code), i);
    }
  }

  Text operation(Op op, const Tape::Instruction& i) const {
    const bool c = language_ == CodeLanguage::c;
    switch (op) {
      case Op::negate:
        return {"-" + at(i.a), false};
      case Op::reciprocal:
        return {"1.0/" + at(i.a), false};
      case Op::add:
      case Op::subtract:
      case Op::less:
      case Op::less_equal:
      case Op::greater:
      case Op::greater_equal:
      case Op::equal:
      case Op::not_equal:
        return {at(i.a) + " " + std::string(spelling(op)) + " " + at(i.b), false};
      case Op::multiply:
      case Op::divide:
        return {at(i.a) + std::string(spelling(op)) + at(i.b), false};
      case Op::logical_and:
        return {c ? at(i.a) + " && " + at(i.b) : both(i, "and"), !c};
      case Op::logical_or:
        return {c ? at(i.a) + " || " + at(i.b) : both(i, "or"), !c};
      case Op::logical_not:
        return {c ? "!" + at(i.a) : "float(not " + at(i.a) + ")", !c};
      case Op::choose:
        return {c ? at(i.a) + " ? " + at(i.b) + " : " + at(i.c)
                  : at(i.b) + " if " + at(i.a) + " else " + at(i.c),
                false};
      case Op::sign:
        return {c ? "(" + at(i.a) + " > 0.0) - (" + at(i.a) + " < 0.0)"
                  : "np.sign(" + text_[i.a].text + ")",
                !c};
      default:
        return {function_name(op) + "(" + text_[i.a].text +
                    (operands(op) == 2 ? ", " + text_[i.b].text : "") + ")",
                true};
    }
  }

  /// In Python, whose `and` and `or` return one of the numbers.
  std::string both(const Tape::Instruction& i, const char* word) const {
    return "float(bool(" + text_[i.a].text + ") " + word + " bool(" + text_[i.b].text + "))";
  }

  std::string function_name(Op op) const {
    const bool c = language_ == CodeLanguage::c;
    if (op == Op::power) return c ? "pow" : "np.power";
    if (op == Op::abs) return c ? "fabs" : "np.abs";
    if (op == Op::min) return c ? "fmin" : "np.fmin";
    if (op == Op::max) return c ? "fmax" : "np.fmax";
    const std::string name(spelling(op));
    if (c) return name;
    const bool inverse = name == "asin" || name == "acos" || name == "atan" || name == "atan2";
    return inverse ? "np.arc" + name.substr(1) : "np." + name;
  }

  const Tape& tape_;
  CodeLanguage language_;
  std::vector<Text> text_;  // of every slot
  std::vector<int> uses_;   // the same
};

}  // namespace

std::string number_code(double value, CodeLanguage language) {
  const bool c = language == CodeLanguage::c;
  if (std::isnan(value)) return c ? "NAN" : "np.nan";
  if (std::isinf(value)) return std::string(value < 0.0 ? "-" : "") + (c ? "INFINITY" : "np.inf");
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  std::string out(text.data(), end);
  if (out.find_first_of(".e") == std::string::npos) out += ".0";
  return out;
}

TapeCode code_of(const Tape& tape, CodeLanguage language, const std::vector<std::string>& symbols,
                 std::size_t columns) {
  if (symbols.size() < tape.symbols || columns > tape.columns) {
    throw std::invalid_argument("code_of: fewer symbols, or more columns, than the tape has");
  }
  return TapeWriter(tape, language, symbols).write(columns);
}

}  // namespace identikal
