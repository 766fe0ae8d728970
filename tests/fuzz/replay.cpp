// Every input that was kept, then changes of them for a while, without an instrumented build:
// fuzz_replay TARGET SECONDS SEED FOLDER...
// An input that ends the program, or takes longer than ten seconds, is left in fuzz-TARGET.input.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include "tests/fuzz/targets.h"

extern "C" void __sanitizer_set_death_callback(void (*callback)()) __attribute__((weak));

namespace {

using identikal::fuzz::Target;

constexpr unsigned kHang = 10;  // [s]

std::string running, left_in;

// Nothing but open() and write() is safe here.
void keep_input() {
  const int file = open(left_in.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  if (file < 0) return;
  [[maybe_unused]] const auto written = write(file, running.data(), running.size());
  close(file);
}

void end_by(int signal) {
  keep_input();
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void run(const Target& target, std::string input) {
  running = std::move(input);
  alarm(kHang);
  target.take(running);
  alarm(0);
}

std::vector<std::string> inputs_of(const std::vector<std::string>& folders) {
  std::vector<std::filesystem::path> files;
  for (const std::string& folder : folders) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  std::vector<std::string> out;
  for (const auto& path : files) {
    std::ifstream file(path, std::ios::binary);
    out.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  return out;
}

class Changes {
 public:
  Changes(const std::vector<std::string>& inputs, std::uint64_t seed)
      : inputs_(inputs), engine_(seed) {}

  std::string next(std::size_t longest) {
    std::string out = one_of(inputs_);
    for (std::size_t n = 1 + below(4); n > 0; --n) change(out);
    if (out.size() > longest) out.resize(longest);
    return out;
  }

 private:
  std::size_t below(std::size_t n) { return n == 0 ? 0 : engine_() % n; }
  const std::string& one_of(const std::vector<std::string>& items) {
    return items[below(items.size())];
  }
  // A piece of one input: what stands between two of its blanks or signs, or any bytes.
  std::string piece() {
    const std::string& from = one_of(inputs_);
    const std::size_t begin = below(from.size());
    if (below(3) == 0) return from.substr(begin, 1 + below(20));
    constexpr std::string_view kEnds = " \n:,[]{}()";
    const std::size_t start = std::min(from.find_first_of(kEnds, begin), from.size());
    return from.substr(start, from.find_first_of(kEnds, start + 1) - start);
  }
  void change(std::string& text) {
    static const std::vector<std::string> kOdd = {
        "0",    "-1",         "1e308", "1e-320", "nan", "inf", "-0", "9007199254740993",
        "1e99", "2147483648", "\xff",  "\n",     "\0x", "''",  "{}", "[]",
        "...",  "&a *a",      "%",     "'"};
    const std::size_t at = below(text.size() + 1);
    switch (below(6)) {
      case 0:
        text.insert(at, piece());
        break;
      case 1:
        text.erase(at, 1 + below(30));
        break;
      case 2:
        if (at < text.size()) text[at] = static_cast<char>(below(256));
        break;
      case 3:
        text.insert(at, one_of(kOdd));
        break;
      case 4:
        text.replace(at, std::min<std::size_t>(below(12), text.size() - at), piece());
        break;
      default: {
        const std::string& other = one_of(inputs_);
        text = text.substr(0, at) + other.substr(below(other.size()));
      }
    }
  }

  const std::vector<std::string>& inputs_;
  std::mt19937_64 engine_;
};

}  // namespace

int main(int argc, char** argv) {
  const Target* target = argc > 1 ? identikal::fuzz::target_called(argv[1]) : nullptr;
  if (target == nullptr || argc < 5) {
    std::fprintf(stderr, "fuzz_replay TARGET SECONDS SEED FOLDER...\n");
    return 2;
  }
  left_in = std::string("fuzz-") + target->name + ".input";
  for (const int signal : {SIGABRT, SIGALRM, SIGFPE}) std::signal(signal, end_by);
  if (__sanitizer_set_death_callback != nullptr) {
    __sanitizer_set_death_callback(keep_input);
  } else {
    std::signal(SIGSEGV, end_by);
  }
  const std::vector<std::string> inputs = inputs_of({argv + 4, argv + argc});
  if (inputs.empty()) return std::fprintf(stderr, "no inputs\n"), 2;
  for (const std::string& input : inputs) run(*target, input);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(std::atol(argv[2]));
  Changes changes(inputs, static_cast<std::uint64_t>(std::atol(argv[3])));
  long count = 0;
  for (; std::chrono::steady_clock::now() < end; ++count)
    run(*target, changes.next(target->longest));
  std::printf("%s: %zu inputs, %ld changes of them\n", target->name, inputs.size(), count);
  return 0;
}
