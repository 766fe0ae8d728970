// Which instruction set's version of a function runs on this machine? Highway compiles a file once
// per instruction set; its own dispatch lives in a shared library that measures the processor's
// clock for 10 ms whenever a program starts, which is more than many a fit takes.
//
// To be included once, before <hwy/highway.h> is used: in the block of HWY_ONCE.
#pragma once

namespace identikal::simd {

enum class InstructionSet { baseline, ssse3, sse4, avx2, avx3 };

/// The best that this machine and its operating system have, by Highway's names.
inline InstructionSet instruction_set() {
#if HWY_ARCH_X86
  static const InstructionSet best = [] {
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("ssse3")) return InstructionSet::baseline;
    // Highway takes these for granted beside SSE 4 and AVX 2; lzcnt and f16c come with bmi2.
    const bool sse4 = __builtin_cpu_supports("sse4.1") && __builtin_cpu_supports("sse4.2") &&
                      __builtin_cpu_supports("aes") && __builtin_cpu_supports("pclmul");
    if (!sse4) return InstructionSet::ssse3;
    const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                      __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    if (!avx2) return InstructionSet::sse4;
    const bool avx3 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw");
    return avx3 ? InstructionSet::avx3 : InstructionSet::avx2;
  }();
  return best;
#else
  return InstructionSet::baseline;
#endif
}

/// The function for the best instruction set that it was compiled for; null = it was not.
template <typename Function>
Function* best_version(Function* baseline, Function* ssse3, Function* sse4, Function* avx2,
                       Function* avx3) {
  const InstructionSet best = instruction_set();
  if (avx3 != nullptr && best >= InstructionSet::avx3) return avx3;
  if (avx2 != nullptr && best >= InstructionSet::avx2) return avx2;
  if (sse4 != nullptr && best >= InstructionSet::sse4) return sse4;
  if (ssse3 != nullptr && best >= InstructionSet::ssse3) return ssse3;
  return baseline;
}

}  // namespace identikal::simd

// A function of the namespaces HWY_NAMESPACE for this machine, in place of HWY_DYNAMIC_DISPATCH.
#if (HWY_TARGETS & (HWY_TARGETS - 1)) == 0
#define IDENTIKAL_DISPATCH(function) (HWY_STATIC_DISPATCH(function))
#else
#define IDENTIKAL_DISPATCH(function)                                                        \
  (*::identikal::simd::best_version<decltype(HWY_STATIC_DISPATCH(function))>(               \
      HWY_CHOOSE_FALLBACK(function), HWY_CHOOSE_SSSE3(function), HWY_CHOOSE_SSE4(function), \
      HWY_CHOOSE_AVX2(function), HWY_CHOOSE_AVX3(function)))
#endif
