// The target that FUZZ_TARGET names, for libFuzzer.
#include <cstdint>
#include <cstdio>
#include <cstdlib>

#include "tests/fuzz/targets.h"

namespace {

const identikal::fuzz::Target* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  const char* name = std::getenv("FUZZ_TARGET");
  chosen = identikal::fuzz::target_called(name != nullptr ? name : "");
  if (chosen != nullptr) return 0;
  std::fprintf(stderr, "FUZZ_TARGET is none of");
  for (const auto& target : identikal::fuzz::targets()) std::fprintf(stderr, " %s", target.name);
  std::fprintf(stderr, "\n");
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  chosen->take({reinterpret_cast<const char*>(data), size});
  return 0;
}
