#include "identify/model/internal/arma_polynomials.h"

#include <cmath>

#include <fmt/format.h>

namespace identikal {
namespace {

// A coefficient as terms with a sign each, so that no formula begins with --.
struct Terms {
  std::string text;
  void add(bool negative, const std::string& product) {
    const char* join = text.empty() ? (negative ? "-" : "") : (negative ? " - " : " + ");
    text += join + product;
  }
};

// Signed products by lag, of the factors so far.
struct Product {
  bool negative;
  std::string text;
};
using Products = std::multimap<int, Product>;

LagPolynomial collected(const Products& products, bool turned) {
  std::map<int, Terms> sums;
  for (const auto& [lag, product] : products) {
    if (lag > 0) sums[lag].add(product.negative != turned, product.text);
  }
  LagPolynomial out;
  for (auto& [lag, sum] : sums) out[lag] = sum.text;
  return out;
}

Products products_of(const std::vector<LagFactor>& factors) {
  Products out{{0, {false, ""}}};
  for (const LagFactor& factor : factors) {
    Products next = out;
    for (const auto& [lag, product] : out) {
      for (std::size_t k = 0; k < factor.coefficients.size(); ++k) {
        const std::string one = "(" + factor.coefficients[k] + ")";
        next.insert({lag + factor.lag * static_cast<int>(k + 1),
                     {product.negative != factor.negative,
                      product.text.empty() ? one : product.text + "*" + one}});
      }
    }
    out = std::move(next);
  }
  return out;
}

}  // namespace

LagPolynomial multiplied_out(const std::vector<LagFactor>& factors) {
  return collected(products_of(factors), false);
}

LagPolynomial right_side(const std::vector<LagFactor>& factors) {
  return collected(products_of(factors), true);
}

LagPolynomial differences(int difference, int period, int seasonal) {
  std::map<int, double> p{{0, 1.0}};
  const auto multiply = [&p](int lag) {
    std::map<int, double> next = p;
    for (const auto& [at, c] : p) next[at + lag] -= c;
    p = std::move(next);
  };
  for (int i = 0; i < difference; ++i) multiply(1);
  for (int i = 0; i < seasonal; ++i) multiply(period);
  LagPolynomial out;
  for (const auto& [lag, c] : p) {
    if (lag > 0 && c != 0.0) out[lag] = fmt::format("{}", -c);
  }
  return out;
}

int order_of(const LagPolynomial& p) { return p.empty() ? 0 : p.rbegin()->first; }

std::string weighted_sum(const LagPolynomial& p, const std::vector<std::string>& states,
                         int first) {
  std::string out;
  for (const auto& [lag, c] : p) {
    out += fmt::format("{}({})*{}", out.empty() ? "" : " + ", c,
                       states[static_cast<std::size_t>(lag - first)]);
  }
  return out;
}

}  // namespace identikal
