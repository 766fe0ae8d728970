#include "identify/model/internal/component_kinds.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include <fmt/format.h>

#include "identify/model/components.h"
#include "identify/model/internal/arma_polynomials.h"
#include "identify/model/internal/yaml_tree.h"
#include "identify/model/matrix_reader.h"
#include "identify/model/model_values.h"
#include "lib/data/units.h"

namespace identikal {
namespace {

using Node = YamlNode;
using State = Component::State;

constexpr int kMostCoefficients = 60, kMostDifferences = 4;

// One entry of `components`.
struct Given {
  const std::string& name;
  const Node& node;
  bool continuous = false;

  const Node* key(const char* key) const { return find(node, key); }
  const Node& needed(const char* key, const std::string& example) const {
    return required(node, key, fmt::format("component '{}'", name), example);
  }
  std::string formula(const char* key, const std::string& example) const {
    return "(" + text_of(needed(key, example), key) + ")";
  }
  // Of the component, divided by s^power.
  std::string unit(int power = 0) const {
    const Node* unit = key("unit");
    const std::string own = unit == nullptr ? "" : text_of(*unit, "unit");
    if (power == 0 || !continuous) return own;
    const std::string time = power == 1 ? "s" : fmt::format("s^{}", power);
    return own.empty() || own == "1" ? "1/" + time : own + "/" + time;
  }
  void belongs_to(bool to_continuous) const {
    if (continuous == to_continuous) return;
    throw InputError(
        node.at,
        fmt::format("component '{}' is a {}, which belongs to {} time", name,
                    text_of(*key("kind"), "kind"), to_continuous ? "continuous" : "discrete"),
        fmt::format("time: {{kind: {}}}", to_continuous ? "continuous" : "discrete"));
  }
};

// Of a quantity, "0.5 m", or a formula.
std::string squared(const std::string& text) {
  const std::optional<Quantity> quantity = split_quantity(text);
  const std::optional<Unit> unit = quantity ? parse_unit(quantity->unit) : std::nullopt;
  if (!unit) return "(" + text + ")^2";
  Unit square{1.0, 0.0, unit->dimension};
  for (double& power : square.dimension) power *= 2.0;
  const double value = unit->scale * quantity->number;
  return fmt::format("{:.17g} {}", value * value, si_unit(square));
}

// The variance of one part of a component, which is its name and that of its key in a mapping; the
// main part's may stand alone. Nothing: zero.
void add_noise(const Given& of, const std::string& part, bool is_main,
               const std::vector<std::string>& states, Component& out,
               const std::function<std::string(const std::string&)>& scaled = {}) {
  for (const bool as_sd : {false, true}) {
    const Node* given = of.key(as_sd ? "sd" : "variance");
    if (given == nullptr) continue;
    const bool by_part = given->kind == Node::Kind::mapping;
    const Node* value = by_part ? find(*given, part) : is_main ? given : nullptr;
    if (value == nullptr) continue;
    const std::string& text = text_of(*value, "the variance of " + of.name);
    Node variance = *value;
    if (as_sd) variance = yaml_scalar(squared(text), *value);
    if (scaled) variance = yaml_scalar(scaled("(" + variance.text + ")"), *value);
    for (const std::string& state : states) out.noise.push_back({state, variance});
  }
}

void all_stationary(Component& out) {
  for (const State& state : out.states) out.stationary_states.push_back(state.name);
}

// The parts that a mapping of variances may name.
void check_parts(const Given& of, const std::vector<std::string>& parts) {
  for (const char* key : {"variance", "sd"}) {
    const Node* given = of.key(key);
    if (given != nullptr && given->kind == Node::Kind::mapping) {
      check_keys(*given, fmt::format("{} of component '{}'", key, of.name), parts);
    }
  }
  if (of.key("variance") != nullptr && of.key("sd") != nullptr) {
    throw InputError(of.node.at, fmt::format("component '{}' has 'variance' and 'sd'", of.name),
                     "one of them");
  }
}

// What a state becomes: itself and a rate, or a rate alone.
std::string moved(const Given& of, const std::string& state, const std::string& rate) {
  if (of.continuous) return rate.empty() ? "0" : rate;
  return rate.empty() ? state : state + " + " + rate;
}

Component level(const Given& of) {
  check_parts(of, {"level"});
  Component out;
  out.states = {{of.name, of.unit(), moved(of, of.name, "")}};
  out.visible = of.name;
  add_noise(of, "level", true, {of.name}, out);
  return out;
}

// @param main  the part whose variance may stand alone; the other has none then
Component trend_with(const Given& of, const std::string& rate, const std::string& main) {
  check_parts(of, main == "level" ? std::vector<std::string>{"level", rate}
                                  : std::vector<std::string>{rate});
  const std::string slope = of.name + "_" + rate;
  Component out;
  out.states = {{of.name, of.unit(), moved(of, of.name, slope)},
                {slope, of.unit(1), moved(of, slope, "")}};
  out.visible = of.name;
  if (main == "level") add_noise(of, "level", true, {of.name}, out);
  add_noise(of, rate, main != "level", {slope}, out);
  return out;
}

Component trend(const Given& of) { return trend_with(of, "slope", "level"); }
Component smooth_trend(const Given& of) { return trend_with(of, "slope", "slope"); }
Component drift(const Given& of) { return trend_with(of, "rate", "rate"); }

Component constant_velocity(const Given& of) {
  of.belongs_to(true);
  return trend_with(of, "v", "v");
}

Component constant_acceleration(const Given& of) {
  of.belongs_to(true);
  check_parts(of, {"a"});
  const std::string v = of.name + "_v", a = of.name + "_a";
  Component out;
  out.states = {{of.name, of.unit(), v}, {v, of.unit(1), a}, {a, of.unit(2), "0"}};
  out.visible = of.name;
  add_noise(of, "a", true, {a}, out);
  return out;
}

// In a plane, a velocity that turns at a rate: to the left where it is positive.
Component coordinated_turn(const Given& of) {
  of.belongs_to(true);
  check_parts(of, {"v"});
  const std::string x = of.name + "_x", y = of.name + "_y", vx = of.name + "_vx",
                    vy = of.name + "_vy";
  std::string rate = of.formula("rate", "rate: 0.1 rad/s");
  Component out;
  const Node& given = *of.key("rate");
  const std::optional<Quantity> quantity = split_quantity(given.text);
  if (quantity && !quantity->unit.empty()) {
    rate = of.name + "_rate";
    out.known.push_back({rate, given});
  }
  out.states = {{x, of.unit(), vx},
                {y, of.unit(), vy},
                {vx, of.unit(1), fmt::format("-{}*{}", rate, vy)},
                {vy, of.unit(1), fmt::format("{}*{}", rate, vx)}};
  out.visible = x;
  add_noise(of, "v", true, {vx, vy}, out);
  return out;
}

int whole_number(const Node& node, const std::string& about, int least, int most) {
  const double number = read_plain_number(node, about);
  if (!(number >= least && number <= most && number == std::floor(number))) {
    throw InputError(node.at, fmt::format("{} is {}", about, describe(node)),
                     fmt::format("a whole number, {} to {}", least, most));
  }
  return static_cast<int>(number);
}

// A whole number of samples, at least 2.
int samples_in(const Given& of, const char* key) {
  return whole_number(of.needed(key, fmt::format("{}: 12", key)), key, 2,
                      static_cast<int>(kMaxSize));
}

// The effects of all samples of a period sum to zero but for noise.
Component season(const Given& of) {
  of.belongs_to(false);
  check_parts(of, {"season"});
  const int period = samples_in(of, "period");
  Component out;
  std::string all;
  for (int i = 0; i + 1 < period; ++i) {
    const std::string before = i == 0 ? "" : out.states.back().name;
    const std::string name = i == 0 ? of.name : fmt::format("{}_{}", of.name, i);
    all += "-" + name;
    out.states.push_back({name, of.unit(), before});
  }
  out.states.front().dynamics = all;
  out.visible = of.name;
  add_noise(of, "season", true, {of.name}, out);
  return out;
}

// Two states that turn by an angle per sample, or at a rate.
void add_rotation(const Given& of, const std::string& name, const std::string& angle,
                  const std::string& damping, Component& out) {
  const std::string star = name + "_star";
  if (of.continuous) {
    const std::string fade = damping.empty() ? "" : fmt::format("-{}*", damping);
    out.states.push_back(
        {name, of.unit(),
         (fade.empty() ? "" : fade + name + " + ") + fmt::format("{}*{}", angle, star)});
    out.states.push_back(
        {star, of.unit(),
         (fade.empty() ? "" : fade + star + " ") + fmt::format("-{}*{}", angle, name)});
    return;
  }
  const std::string factor = damping.empty() ? "" : damping + "*";
  out.states.push_back(
      {name, of.unit(),
       fmt::format("{}(cos({})*{} + sin({})*{})", factor, angle, name, angle, star)});
  out.states.push_back(
      {star, of.unit(),
       fmt::format("{}(cos({})*{} - sin({})*{})", factor, angle, star, angle, name)});
}

// How many harmonics of a period, which is a number or none.
int harmonics_of(const Given& of, const std::optional<double>& period) {
  const bool whole = !of.continuous && period && *period == std::floor(*period);
  const int most = whole ? static_cast<int>(*period) / 2 : 0;
  const Node* node = of.key("harmonics");
  if (node == nullptr) {
    if (most > 0) return most;
    throw InputError(of.node.at,
                     fmt::format("component '{}' does not say how many harmonics", of.name),
                     "harmonics: 3");
  }
  const double given = read_plain_number(*node, "harmonics");
  const double limit = most > 0 ? most : 0.5 * static_cast<double>(kMaxSize);
  if (!(given >= 1.0 && given <= limit && given == std::floor(given))) {
    throw InputError(node->at, "harmonics is " + describe(*node),
                     fmt::format("a whole number, 1 to {}", limit));
  }
  return static_cast<int>(given);
}

Component trigonometric(const Given& of) {
  check_parts(of, {"season"});
  const std::string period = of.formula("period", "period: 12");
  const std::optional<double> number = plain_number(text_of(*of.key("period"), "period"));
  const int harmonics = harmonics_of(of, number);
  Component out;
  std::vector<std::string> disturbed;
  for (int h = 1; h <= harmonics; ++h) {
    const std::string name = fmt::format("{}_{}", of.name, h);
    out.visible += (h > 1 ? " + " : "") + name;
    // Twice per period of two samples: the other state would never be seen.
    if (number && 2.0 * h == *number && !of.continuous) {
      out.states.push_back({name, of.unit(), "-" + name});
    } else {
      add_rotation(of, name, fmt::format("(2*pi*{}/{})", h, period), "", out);
    }
  }
  for (const State& state : out.states) disturbed.push_back(state.name);
  add_noise(of, "season", true, disturbed, out);
  return out;
}

Component cycle(const Given& of) {
  check_parts(of, {"cycle"});
  const std::string period = of.formula("period", "period: p");
  const Node* damping = of.key("damping");
  const std::string factor = damping == nullptr ? "" : of.formula("damping", "");
  Component out;
  add_rotation(of, of.name, "(2*pi/" + period + ")", factor, out);
  out.visible = of.name;
  if (damping != nullptr) all_stationary(out);
  add_noise(of, "cycle", true, {out.states[0].name, out.states[1].name}, out);
  return out;
}

Component autoregression(const Given& of) {
  of.belongs_to(false);
  check_parts(of, {"ar"});
  const Node& given = of.needed("coefficients", "coefficients: [a1, a2]");
  std::vector<const Node*> coefficients;
  if (given.kind == Node::Kind::list) {
    for (const Node& each : given.items) coefficients.push_back(&each);
  } else {
    coefficients.push_back(&given);
  }
  Component out;
  std::string sum;
  for (std::size_t i = 0; i < coefficients.size(); ++i) {
    const std::string name = i == 0 ? of.name : fmt::format("{}_{}", of.name, i);
    const std::string before = i == 0 ? "" : out.states.back().name;
    sum += fmt::format("{}({})*{}", i == 0 ? "" : " + ", text_of(*coefficients[i], "a coefficient"),
                       name);
    out.states.push_back({name, of.unit(), before});
  }
  if (out.states.empty()) throw InputError(given.at, "no coefficient", "coefficients: [a1, a2]");
  out.states.front().dynamics = sum;
  out.visible = of.name;
  all_stationary(out);
  add_noise(of, "ar", true, {of.name}, out);
  return out;
}

// Coefficients of a factor: their formulas, or how many there are, each a parameter of its own then.
std::vector<std::string> coefficients_of(const Given& of, const Node* given,
                                         const std::string& prefix, Component& out) {
  std::vector<std::string> all;
  if (given == nullptr) return all;
  if (given->kind == Node::Kind::list) {
    for (const Node& each : given->items) all.push_back(text_of(each, "a coefficient"));
    return all;
  }
  const int count = whole_number(*given, prefix, 0, kMostCoefficients);
  for (int k = 1; k <= count; ++k) {
    all.push_back(fmt::format("{}_{}{}", of.name, prefix, k));
    Node start = yaml_mapping();
    append(start, "value", yaml_scalar("0"));
    out.known.push_back({all.back(), std::move(start)});
  }
  return all;
}

// What `arma` says of its polynomials.
struct ArmaKeys {
  LagPolynomial ar, ma;  // on the right side each
  LagPolynomial before;  // of differences
};

ArmaKeys read_arma(const Given& of, Component& out) {
  const Node* season = of.key("season");
  int period = 1, seasonal = 0;
  std::vector<LagFactor> ar, ma;
  ar.push_back({coefficients_of(of, of.key("ar"), "ar", out), 1, true});
  ma.push_back({coefficients_of(of, of.key("ma"), "ma", out), 1, false});
  if (season != nullptr) {
    const std::string about = fmt::format("the season of '{}'", of.name);
    check_keys(*season, about, {"period", "ar", "ma", "difference"});
    period = whole_number(required(*season, "period", about, "period: 12"), "period", 2,
                          static_cast<int>(kMaxSize));
    const Node* times = find(*season, "difference");
    if (times != nullptr) seasonal = whole_number(*times, "difference", 0, kMostDifferences);
    ar.push_back({coefficients_of(of, find(*season, "ar"), "season_ar", out), period, true});
    ma.push_back({coefficients_of(of, find(*season, "ma"), "season_ma", out), period, false});
  }
  const Node* times = of.key("difference");
  const int difference =
      times == nullptr ? 0 : whole_number(*times, "difference", 0, kMostDifferences);
  return {right_side(ar), multiplied_out(ma), differences(difference, period, seasonal)};
}

// Names of a register: the first one's, and those of the samples before.
std::vector<std::string> register_of(const std::string& name, int length) {
  std::vector<std::string> out;
  for (int i = 0; i < length; ++i) out.push_back(i == 0 ? name : fmt::format("{}_{}", name, i));
  return out;
}

// w with ar(z) w = ma(z) e, as ma(z) x of an autoregression ar(z) x = e; and y with differences(z) y =
// w + mean, from the samples of y before, of which nothing is known at first.
Component arma(const Given& of) {
  of.belongs_to(false);
  check_parts(of, {"arma"});
  Component out;
  const ArmaKeys keys = read_arma(of, out);
  const bool is_plain = keys.ma.empty() && keys.before.empty() && of.key("mean") == nullptr;
  const std::string first = is_plain ? of.name : of.name + "_x";
  const int length = std::max({1, order_of(keys.ar), 1 + order_of(keys.ma)});
  const std::vector<std::string> x = register_of(first, length);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const std::string sum = i > 0 ? x[i - 1] : weighted_sum(keys.ar, x, 1);
    out.states.push_back({x[i], of.unit(), sum.empty() ? "0*" + x[i] : sum});
  }
  all_stationary(out);
  add_noise(of, "arma", true, {first}, out);
  out.visible = first;
  if (!keys.ma.empty()) out.visible += " + " + weighted_sum(keys.ma, x, 0);
  if (of.key("mean") != nullptr) out.visible += " + " + of.formula("mean", "");
  const std::vector<std::string> y = register_of(of.name + "_before", order_of(keys.before));
  if (!y.empty()) out.visible += " + " + weighted_sum(keys.before, y, 1);
  for (std::size_t i = 0; i < y.size(); ++i) {
    out.states.push_back({y[i], of.unit(), i == 0 ? out.visible : y[i - 1]});
  }
  return out;
}

// x = s.d.e. of the order that has the covariance s^2 M(|lag| / length).
Component matern(const Given& of) {
  of.belongs_to(true);
  check_parts(of, {"matern"});
  const Node& node = of.needed("smoothness", "smoothness: 1.5");
  const double nu = read_plain_number(node, "smoothness");
  if (nu != 0.5 && nu != 1.5 && nu != 2.5) {
    throw InputError(node.at, "smoothness is " + describe(node), "0.5, 1.5 or 2.5");
  }
  const std::string length = of.formula("length", "length: l");
  const std::string lambda = fmt::format("(sqrt({})/{})", 2.0 * nu, length);
  const std::string x = of.name, v = x + "_rate", a = x + "_curvature";
  Component out;
  out.visible = x;
  std::string density;  // of the last state, by the variance
  if (nu == 0.5) {
    out.states = {{x, of.unit(), fmt::format("-{}/{}", x, length)}};
    density = fmt::format("2/{}", length);
  } else if (nu == 1.5) {
    out.states = {{x, of.unit(), v},
                  {v, of.unit(1), fmt::format("-{0}^2*{1} - 2*{0}*{2}", lambda, x, v)}};
    density = fmt::format("4*{}^3", lambda);
  } else {
    out.states = {
        {x, of.unit(), v},
        {v, of.unit(1), a},
        {a, of.unit(2), fmt::format("-{0}^3*{1} - 3*{0}^2*{2} - 3*{0}*{3}", lambda, x, v, a)}};
    density = fmt::format("16/3*{}^5", lambda);
  }
  all_stationary(out);
  add_noise(of, "matern", true, {out.states.back().name}, out,
            [&](const std::string& variance) { return density + "*" + variance; });
  return out;
}

// States that fade, one per factor kFactor of time: s^2 each gives S(f) = s^2 / (f ln kFactor)
// (one-sided).
void add_flicker(const Given& of, Component& out) {
  constexpr double kFactor = 4.0;
  const Node& range = of.needed("flicker-range", "flicker-range: [10 s, 1 d]");
  if (range.kind != Node::Kind::list || range.items.size() != 2) {
    throw InputError(range.at, "flicker-range is " + describe(range), "[10 s, 1 d]");
  }
  const double from = read_si(range.items[0], "s", "flicker-range"),
               to = read_si(range.items[1], "s", "flicker-range");
  if (!(from > 0.0 && to > from)) {
    throw InputError(range.at, "flicker-range does not rise", "[10 s, 1 d]");
  }
  // A quantity, as the rates of these states have a unit.
  const std::string shortest = of.name + "_flicker_shortest";
  out.known.push_back({shortest, yaml_scalar(fmt::format("{:.17g} s", from), range)});
  const int count = 1 + static_cast<int>(std::ceil(std::log(to / from) / std::log(kFactor)));
  for (int i = 0; i < count; ++i) {
    const std::string name = fmt::format("{}_flicker_{}", of.name, i + 1);
    const std::string tau = fmt::format("({}*{})", shortest, std::pow(kFactor, i));
    out.states.push_back({name, of.unit(1), fmt::format("-{}/{}", name, tau)});
    out.stationary_states.push_back(name);
    add_noise(of, "flicker-fm", false, {name}, out, [&](const std::string& h) {
      return fmt::format("{:.17g}/{}*{}", 2.0 * std::log(kFactor), tau, h);
    });
  }
}

// A phase (a time), and a frequency that is a number: white frequency noise drives the phase, its
// random walk the frequency.
Component clock(const Given& of) {
  of.belongs_to(true);
  check_parts(of, {"white-fm", "random-walk-fm", "flicker-fm"});
  const std::string y = of.name + "_frequency";
  Component out;
  out.visible = of.name;
  out.states = {{of.name, of.unit(), y}, {y, of.unit(1), "0"}};
  const Node* variances = of.key(of.key("sd") != nullptr ? "sd" : "variance");
  const bool by_part = variances != nullptr && variances->kind == Node::Kind::mapping;
  if (by_part && find(*variances, "flicker-fm") != nullptr) add_flicker(of, out);
  for (std::size_t i = 2; i < out.states.size(); ++i) {
    out.states.front().dynamics += " + " + out.states[i].name;
  }
  add_noise(of, "white-fm", false, {of.name}, out);
  add_noise(of, "random-walk-fm", false, {y}, out);
  return out;
}

// Coefficients of inputs that nothing is known of, and that stay what they are but for noise.
Component regression(const Given& of) {
  const bool is_list = of.node.kind == Node::Kind::list;
  const Node& inputs = is_list ? of.node : of.needed("inputs", "inputs: [u1, u2]");
  Component out;
  if (inputs.kind != Node::Kind::list || inputs.items.empty()) {
    throw InputError(inputs.at, fmt::format("component '{}' names no inputs", of.name),
                     "inputs: [u1, u2]");
  }
  for (const Node& input : inputs.items) {
    const std::string& name = text_of(input, "an input");
    const std::string state = of.name + "_" + name;
    out.states.push_back({state, is_list ? "" : of.unit(), moved(of, state, "")});
    out.visible += (out.visible.empty() ? "" : " + ") + state + "*" + name;
    if (!is_list) add_noise(of, name, true, {state}, out);
  }
  return out;
}

struct ComponentKind {
  const char* name;
  Component (*make)(const Given&);
  std::vector<std::string> keys;  // beside kind, unit, output, variance, sd
};
const std::vector<ComponentKind>& kinds() {
  static const std::vector<ComponentKind> all{
      {"level", level, {}},
      {"trend", trend, {}},
      {"smooth-trend", smooth_trend, {}},
      {"season", season, {"period"}},
      {"trigonometric", trigonometric, {"period", "harmonics"}},
      {"cycle", cycle, {"period", "damping"}},
      {"ar", autoregression, {"coefficients"}},
      {"arma", arma, {"ar", "ma", "difference", "mean", "season"}},
      {"matern", matern, {"smoothness", "length"}},
      {"clock", clock, {"flicker-range"}},
      {"bias", level, {}},
      {"drift", drift, {}},
      {"constant-velocity", constant_velocity, {}},
      {"constant-acceleration", constant_acceleration, {}},
      {"coordinated-turn", coordinated_turn, {"rate"}},
      {"regression", regression, {"inputs"}},
  };
  return all;
}

}  // namespace

Component component_of(const std::string& name, const YamlNode& node, bool continuous) {
  const Given of{name, node, continuous};
  if (of.node.kind == Node::Kind::list) return regression(of);
  check_mapping(of.node, fmt::format("component '{}'", of.name));
  const std::string& kind = word_of(of.needed("kind", "kind: level"), "kind", component_kinds());
  const ComponentKind& found = *std::find_if(
      kinds().begin(), kinds().end(), [&](const ComponentKind& each) { return each.name == kind; });
  std::vector<std::string> keys{"kind", "unit", "output", "variance", "sd"};
  keys.insert(keys.end(), found.keys.begin(), found.keys.end());
  check_keys(of.node, fmt::format("component '{}'", of.name), keys);
  return found.make(of);
}

const std::vector<std::string>& component_kinds() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out;
    for (const ComponentKind& kind : kinds()) out.emplace_back(kind.name);
    return out;
  }();
  return names;
}

}  // namespace identikal
