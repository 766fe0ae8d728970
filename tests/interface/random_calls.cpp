// Calls ik_run() and the filters with whatever comes: random verbs, models, sizes, NaN, NULL.
// random_calls [COUNT] [SEED] [SECONDS]: with SECONDS the COUNT calls are repeated for so long, and
// memory has to stay what it was, to 1 %.
// Prints how often each code came; a crash, a leak or a hang is for whoever watches it (valgrind, a sanitizer).
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>
#include <string_view>
#include <vector>

#include "interface/identikal.h"
#include <malloc.h>
#include <unistd.h>

namespace {

struct NamedVerb {
  const char* name;
  std::vector<const char*> options;
};
const NamedVerb kVerbs[] = {
    {"tune",
     {nullptr, R"({"starts": 1})", R"({"method": "als"})", R"({"hold-out": "30%"})",
      R"({"starts": 1, "reject-outliers": true})"}},
    {"fit", {nullptr, R"({"starts": 1, "set": ["q=2"]})"}},
    {"check", {nullptr, R"({"set": "q=nan"})", R"({"strict": true})"}},
    {"shape", {R"({"order": 1})"}},
    {"track", {R"({"particles": 10})", R"({"particles": 10, "adaptive": true})"}},
    {"filter", {nullptr, R"({"smooth": true})", R"({"lag": 2})", R"({"range": "1:2"})"}},
    {"bound", {R"({"rows": 5})", R"({"rows": 50, "accuracy": "10%"})", nullptr}},
    {"simulate", {R"({"rows": 5})", R"#({"rows": 9, "seed": 3, "input": ["u=sin(t)"]})#", nullptr}},
    {"validate", {nullptr, R"({"fit": "50%"})"}},
    {"compare", {nullptr}},
    {"handling", {nullptr, R"({"speed": "80 km/h"})"}},
    {"info", {nullptr}},
    {"", {nullptr}},
    {"t\xff", {nullptr}}};
const char* const kOddOptions[] = {
    "", "{", "[[[[", R"({"starts": -1})", R"({"no": 1})", R"({"set": [[]]})"};

struct KnownModel {
  const char* text;
  std::size_t outputs, inputs;
};
const KnownModel kModels[] = {
    {"identikal: 1\ntime: {kind: discrete, step: 1 s}\noutputs: {y: {}}\nparameters: {q: {value: "
     "1, min: 0, max: 1e6}, "
     "r: {value: 1, min: 0, max: 1e6}}\nA: [[1]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\ninitial: diffuse\n",
     1, 0},
    {"identikal: 1\ntime: {kind: discrete, column: t, unit: s}\ninputs: {u: {}}\noutputs: {y1: {}, "
     "y2: {}}\nparameters: "
     "{q: {value: 1, min: 0, max: 1e6}, d: {value: 0.9, min: 0, max: 0.99}}\nA: [[1, 0.1], [0, "
     "d]]\nB: [[0], [1]]\n"
     "C: [[1, 0], [0, 1]]\nQ: [[q, 0], [0, q]]\nR: [[1, 0], [0, 1]]\ninitial: diffuse\n",
     2, 1},
    {"identikal: 1\ntime: {kind: continuous, column: t}\nstates: [x]\ndynamics: {x: -k*x + "
     "u}\ninputs: {u: "
     "{}}\noutputs: {y: "
     "{equals: x^2}}\n"
     "parameters: {k: {value: 1, min: 0, max: 5}}\nQ: [[0.1]]\nR: [[1]]\ninitial: {x: {value: 1, "
     "sd: 1}}\n",
     1, 1},
    {"identikal: 1\nmodel: single-track\ntime: {column: t}\n", 1, 2},
    {"identikal: 1\n", 1, 0},
    {"", 0, 0},
    {"{[", 0, 0},
    {"a: &a [*a]\n", 1, 0},
    {nullptr, 0, 0}};
const double kOdd[] = {0.0,
                       1.0,
                       -1e300,
                       1e-310,
                       std::numeric_limits<double>::quiet_NaN(),
                       std::numeric_limits<double>::infinity()};

struct Dice {
  std::mt19937 engine;
  std::size_t below(std::size_t n) { return engine() % n; }
  template <typename Items>
  auto one_of(const Items& items) {
    return items[below(std::size(items))];
  }
};

std::vector<double> samples(Dice& dice, std::size_t n) {
  std::vector<double> out(n);
  const bool odd = dice.below(4) == 0;
  for (double& value : out) {
    value = static_cast<double>(dice.below(2000)) / 100.0 - 10.0;
    if (odd && dice.below(5) == 0) value = dice.one_of(kOdd);
  }
  return out;
}

// A filter of a result, of a model, of both or of neither, and some samples. False: a code that is none.
bool step_a_filter(Dice& dice, const ik_result* result, const char* model) {
  ik_filter* filter = nullptr;
  const int opened =
      ik_filter_open(dice.below(2) == 0 ? result : nullptr, dice.below(2) == 0 ? model : nullptr,
                     dice.below(20) != 0 ? &filter : nullptr);
  const std::size_t n = ik_filter_states(filter), ny = ik_filter_outputs(filter);
  const std::size_t nu = ik_filter_inputs(filter),
                    k = ik_filter_parameters(filter, nullptr, nullptr);
  std::vector<double> state(n + 1), sd(n + 1), innovation(ny + 1), value(k + 1), value_sd(k + 1);
  bool known = opened == 0 || opened == 2;
  for (std::size_t t = dice.below(20); t > 0; --t) {
    const std::vector<double> y = samples(dice, ny + 1), u = samples(dice, nu + 1);
    const bool nothing = dice.below(10) == 0;
    const int stepped =
        ik_filter_step(filter, dice.below(15) != 0 ? y.data() : nullptr,
                       dice.below(15) != 0 ? u.data() : nullptr, nothing ? nullptr : state.data(),
                       nothing ? nullptr : sd.data(), nothing ? nullptr : innovation.data());
    known = known && stepped >= 0 && stepped <= 2;
    ik_filter_parameters(filter, value.data(), nothing ? nullptr : value_sd.data());
  }
  known = known && ik_filter_parameter_name(filter, dice.below(4)) != nullptr &&
          ik_filter_message(filter) != nullptr;
  ik_filter_free(filter);
  return known;
}

struct Seen {
  std::array<long, 6> codes{};
  long calls = 0;
  ik_result* kept = nullptr;  // a result of before, for those that start from one
};

// False: a code that is none.
bool call_once(Dice& dice, Seen& seen) {
  const bool wild = dice.below(4) == 0;  // else most things fit together
  const NamedVerb& verb = kVerbs[dice.below(wild ? std::size(kVerbs) : 10)];
  const auto is = [&](std::string_view name) { return verb.name == name; };
  const KnownModel& model = kModels[dice.below(wild ? std::size(kModels) : 3)];
  const std::size_t rows = wild ? dice.below(30) : 5 + dice.below(60);
  const std::size_t ny = wild ? dice.below(3) : model.outputs;
  const std::size_t nu = wild ? dice.below(2) : model.inputs;
  const bool inputs_alone = !wild && (is("bound") || is("simulate"));
  const std::vector<double> y = samples(dice, rows * ny + 1), u = samples(dice, rows * nu + 1);
  std::vector<double> time = samples(dice, rows + 1);
  if (!wild) {
    for (std::size_t k = 0; k < time.size(); ++k) time[k] = static_cast<double>(k);
  }
  ik_recording recording{};
  if (!wild || dice.below(5) != 0) recording.y = y.data();
  if (!wild || dice.below(5) != 0) recording.u = u.data();
  if (!wild || dice.below(3) == 0) recording.time = time.data();
  recording.rows = rows;
  recording.ny = inputs_alone ? 0 : ny;
  recording.nu = nu;
  if (wild && dice.below(2) == 0) recording.step = dice.one_of(kOdd);
  const char* const names[] = {"y", dice.below(2) == 0 ? "t" : nullptr, "u", ""};
  const char* const units[] = {dice.below(2) == 0 ? "m" : "nonsense", nullptr, "s", ""};
  if (wild && dice.below(3) == 0) recording.names = names;
  if (dice.below(8) == 0) recording.units = units;
  const ik_result* const previous[] = {seen.kept, wild && dice.below(2) == 0 ? nullptr : seen.kept};
  const bool of_results = is("validate") || is("compare");
  const std::size_t previous_count = wild             ? dice.below(3)
                                     : is("validate") ? 1
                                     : is("compare")  ? 2
                                                      : 0;
  const char* const options =
      wild && dice.below(2) == 0 ? dice.one_of(kOddOptions) : dice.one_of(verb.options);
  ik_result* result = nullptr;
  const std::size_t recordings =
      wild                                                                 ? dice.below(2)
      : (inputs_alone && (nu == 0 || options != nullptr)) || is("compare") ? 0
                                                                           : 1;
  const int code = ik_run(verb.name, of_results && !wild ? nullptr : model.text,
                          wild && dice.below(5) == 0 ? nullptr : &recording, recordings,
                          wild && dice.below(5) == 0 ? nullptr : previous, previous_count, options,
                          nullptr, dice.below(10) != 0 ? &result : nullptr);
  if (code < 0 || code > 5) return std::printf("code %d\n", code), false;
  ++seen.codes[static_cast<std::size_t>(code)];
  if (code == 5) std::printf("call %ld: %s\n", seen.calls, ik_result_message(result));
  std::size_t series_rows = 0, cols = 0;
  ik_result_series(result, "innovations", &series_rows, &cols);
  if (dice.below(200) == 0) ik_result_report_html(result);
  const ik_result* const of = dice.below(2) == 0 ? result : seen.kept;
  if (!step_a_filter(dice, of, model.text)) return std::puts("a filter's code"), false;
  if (result != nullptr && code == 0 && dice.below(3) == 0) std::swap(seen.kept, result);
  ik_result_free(result);
  ++seen.calls;
  return true;
}

// Resident memory without what the allocator keeps for later [MB].
double resident() {
  malloc_trim(0);
  long pages = 0, resident_pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%ld %ld", &pages, &resident_pages) != 2) resident_pages = 0;
    std::fclose(file);
  }
  return static_cast<double>(resident_pages * sysconf(_SC_PAGESIZE)) / 1e6;
}

int print(const Seen& seen) {
  std::printf("%ld calls: codes", seen.calls);
  for (std::size_t code = 0; code < seen.codes.size(); ++code)
    std::printf(" %zu: %ld", code, seen.codes[code]);
  std::printf("\n");
  return seen.codes[5] == 0 ? 0 : 1;
}

// The same calls round after round: memory that grows is memory that is lost.
int soak(long count, unsigned seed, double seconds) {
  const auto begin = std::chrono::steady_clock::now();
  const auto spent = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  };
  Seen seen;
  double first = 0.0, now = 0.0;
  for (long round = 1; spent() < seconds; ++round) {
    Dice dice{std::mt19937(seed)};
    for (long i = 0; i < count; ++i) {
      if (!call_once(dice, seen)) return 1;
    }
    ik_result_free(seen.kept);
    seen.kept = nullptr;
    now = resident();
    if (round == 3) first = now;  // everything that is made once has been made
    if ((round & (round - 1)) == 0) {
      std::printf("round %ld, %.0f s: %.2f MB\n", round, spent(), now);
      std::fflush(stdout);
    }
  }
  std::printf("%.0f s: %.2f MB, %.2f MB after the third round\n", spent(), now, first);
  return print(seen) != 0 || !(first > 0.0) || now > 1.01 * first ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  const long count = argc > 1 ? std::atol(argv[1]) : 2000;
  const unsigned seed = argc > 2 ? static_cast<unsigned>(std::atol(argv[2])) : 1;
  if (argc > 3) return soak(count, seed, std::atof(argv[3]));
  Dice dice{std::mt19937(seed)};
  Seen seen;
  for (long i = 0; i < count; ++i) {
    if (!call_once(dice, seen)) return 1;
  }
  ik_result_free(seen.kept);
  return print(seen);
}
