#include "identify/survey/internal/column_names.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <map>
#include <optional>

#include "lib/data/units.h"

namespace identikal {
namespace {

// A name is of the class if it has any of the words, or any of the parts in its letters.
struct WordClass {
  const char* any[10] = {};
  const char* part[7] = {};

  bool empty() const { return any[0] == nullptr && part[0] == nullptr; }
  bool holds(const Words& w) const {
    const auto has = [&](const char* word) { return word != nullptr && w.any({word}); };
    const auto contains = [&](const char* letters) {
      return letters != nullptr && w.part({letters});
    };
    return std::any_of(std::begin(any), std::end(any), has) ||
           std::any_of(std::begin(part), std::end(part), contains);
  }
};

constexpr WordClass kCorner{{"fl", "fr", "rl", "rr", "lf", "rf", "lr", "front", "rear"}};
constexpr WordClass kAcceleration{{"a"}, {"acc"}};
constexpr WordClass kRate{{"rate", "vel", "velocity", "dot", "spd"}, {"yawvel", "yawrate"}};
constexpr WordClass kSpeed{{"speed", "velocity", "vel", "v", "u", "spd", "speedo"},
                           {"speed", "veloc"}};
constexpr WordClass kSideways{{"lat", "lateral", "y", "left", "right"}, {"latacc", "latvel"}};
constexpr WordClass kOnwards{{"lon", "long", "longitudinal", "x", "fwd", "forward"},
                             {"longacc", "longvel"}};
constexpr WordClass kAngular{{}, {"yaw", "ang", "roll", "pitch"}};
constexpr WordClass kOtherAngle{
    {"psi", "yaw", "roll", "pitch", "torque", "trq", "time", "error", "e"}};

// A name that is of all these classes, and of none of those, is of that kind.
struct NameRule {
  SignalKind kind = SignalKind::r;
  double score = 0.0;  // 0: no rule
  WordClass all[2] = {};
  WordClass none[2] = {};

  bool applies(const Words& w) const {
    return score > 0.0 &&
           std::all_of(std::begin(all), std::end(all),
                       [&](const WordClass& c) { return c.empty() || c.holds(w); }) &&
           std::none_of(std::begin(none), std::end(none),
                        [&](const WordClass& c) { return c.holds(w); });
  }
};

// Of each group the first rule that applies counts; of names of these classes, none.
struct NameRules {
  WordClass none[3] = {};
  NameRule rules[8] = {};
};

using enum SignalKind;
constexpr NameRules kNameRules[] = {
    {{kRate, {{"torque", "trq", "speed", "time"}}},
     {{steering, 10, {{{"swa", "hwa", "stw", "delh"}, {"steeringwheel", "steerwheel"}}}},
      {steering, 10, {{{"sw"}}, {{"pos", "angle", "ang"}}}},
      {steering, 9, {{{}, {"steer"}}}},
      {steering, 9, {{{"rwa"}, {"roadwheel"}}}},
      {steering, 6, {{{"delta"}}, kCorner}, {kOtherAngle}},
      {steering, 8, {{{"delta"}}}, {kOtherAngle}},
      {steering, 6, {{{}, {"delta"}}, kCorner}, {kOtherAngle}}}},
    {{kAcceleration},
     {{r, 10, {{{}, {"yawrate", "yawvel", "yawspeed"}}}},
      {r, 10, {{{"yaw"}}, kRate}},
      {r, 9, {{{"wz", "r"}, {"psidot", "psip", "dpsi", "gyroz", "gyrz", "omegaz"}}}},
      {r, 9, {{{}, {"gyro", "angrate", "angvel"}}, {{"z", "down", "up"}}}},
      {r, 8, {{{"rate"}}, {{"z"}}}, {{{"sample", "frame", "data", "heart"}}}},
      {r, 7, {{{"omega"}}}, {{{"x", "y"}}, kCorner}}}},
    {{kAngular},
     {{ay, 10, {{{"ay"}, {"accy", "aycg"}}}},
      {ay, 10, {kAcceleration, kSideways}},
      {ax, 10, {{{"ax"}, {"accx", "axcg"}}}},
      {ax, 10, {kAcceleration, kOnwards}}}},
    {{kAcceleration, kAngular, {{}, {"steer", "gyro", "cmd", "engine"}}},
     {{wheel_speed, 8, {kCorner, kSpeed}},
      {wheel_speed, 8, {kCorner, {{"wheel", "w"}}}},
      {wheel_speed, 9, {{{"wheel"}}, kSpeed}},
      {vy, 10, {{{"vy", "uy"}}}},
      {vy, 10, {kSpeed, kSideways}},
      {vx, 10, {{{"vx", "ux"}}}},
      {vx, 10, {kSpeed, kOnwards}},
      {vx, 8, {kSpeed}}}},
    {{},
     {{beta, 10, {{{"beta", "ssa"}, {"sideslip", "sidslp", "slipangle"}}}},
      {beta, 10, {{{"slip"}}, {{"angle", "ang"}}}}}}};

// What was requested, filtered or derived is second to what was measured.
double penalty_of(const Words& w) {
  constexpr WordClass requested{{"cmd", "command", "des", "desired", "ref", "target"},
                                {"cmd", "command"}};
  double out = 0.0;
  if (requested.holds(w)) out += 3.0;
  if (w.part({"filt"})) out += 1.0;
  if (w.any({"sd", "std", "var", "cov", "min", "max"})) out += 20.0;
  return out;
}

}  // namespace

std::vector<std::string> words_of(const std::string& name) {
  std::vector<std::string> out(1);
  char before = ' ';
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool letter = std::isalnum(byte) != 0;
    const bool camel =
        std::isupper(byte) != 0 && std::islower(static_cast<unsigned char>(before)) != 0;
    if ((!letter || camel) && !out.back().empty()) out.emplace_back();
    if (letter) out.back() += static_cast<char>(std::tolower(byte));
    before = c;
  }
  if (out.back().empty()) out.pop_back();
  return out;
}

Words::Words(const std::vector<std::string>& words) : set(words.begin(), words.end()) {
  for (const std::string& word : words) all += word;
}

bool Words::any(std::initializer_list<const char*> list) const {
  return std::any_of(list.begin(), list.end(), [&](const char* w) { return set.contains(w); });
}

bool Words::part(std::initializer_list<const char*> list) const {
  return std::any_of(list.begin(), list.end(),
                     [&](const char* w) { return all.find(w) != std::string::npos; });
}

bool is_curvature(const Words& w) {
  return w.part({"radius", "curvat", "kappa"}) || w.all == "1r" || w.all == "invr";
}

std::vector<NameGuess> kinds_of(const Words& w) {
  if (is_curvature(w)) return {};
  const double penalty = penalty_of(w);
  std::vector<NameGuess> out;
  for (const NameRules& group : kNameRules) {
    const bool excluded = std::any_of(std::begin(group.none), std::end(group.none),
                                      [&](const WordClass& c) { return c.holds(w); });
    if (excluded) continue;
    const auto rule = std::find_if(std::begin(group.rules), std::end(group.rules),
                                   [&](const NameRule& each) { return each.applies(w); });
    if (rule == std::end(group.rules) || rule->score <= penalty) continue;
    out.push_back({rule->kind, rule->score - penalty});
  }
  return out;
}

std::string unit_in_name(const std::vector<std::string>& words, SignalKind kind) {
  static const std::map<std::string, std::string> kUnits = {
      {"rad", "rad"},    {"deg", "deg"},     {"rps", "rad/s"},  {"radps", "rad/s"},
      {"rads", "rad/s"}, {"degps", "deg/s"}, {"dps", "deg/s"},  {"degs", "deg/s"},
      {"mps", "m/s"},    {"ms", "m/s"},      {"kmh", "km/h"},   {"kph", "km/h"},
      {"kmph", "km/h"},  {"mph", "mph"},     {"mps2", "m/s^2"}, {"ms2", "m/s^2"},
      {"mpss", "m/s^2"}, {"g", "g"}};
  for (auto word = words.rbegin(); word != words.rend(); ++word) {
    const auto hit = kUnits.find(*word);
    if (hit == kUnits.end()) continue;
    const std::optional<Unit> unit = parse_unit(hit->second), si = parse_unit(si_unit(kind));
    if (unit && same_dimension(*unit, *si)) return hit->second;
  }
  return "";
}

std::vector<std::string> usual_units(SignalKind kind) {
  switch (kind) {
    case SignalKind::steering:
    case SignalKind::beta:
      return {"rad", "deg"};
    case SignalKind::r:
      return {"rad/s", "deg/s"};
    case SignalKind::ay:
    case SignalKind::ax:
      return {"m/s^2", "g"};
    case SignalKind::vx:
    case SignalKind::vy:
    case SignalKind::wheel_speed:
      return {"m/s", "km/h", "mph"};
  }
  return {};
}

}  // namespace identikal
