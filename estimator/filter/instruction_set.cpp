#include "estimator/filter/instruction_set.hpp"

#include <array>
#include <string>

#include "estimator/filter/settings.hpp"

namespace vibrig::estimator {
namespace {

struct Entry {
    std::string_view name;
    const UdKernel* kernel;
    bool (*runs)() noexcept;
};

// Slowest first.
const std::array kEntries{
#ifdef VIBRIG_X86_KERNELS
    Entry{"sse2", &kUdKernelBaseline, []() noexcept { return true; }},
    Entry{"avx2", &kUdKernelAvx2,
          []() noexcept {
              return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
          }},
    Entry{"avx512", &kUdKernelAvx512,
          []() noexcept {
              return __builtin_cpu_supports("avx512f") != 0 &&
                     __builtin_cpu_supports("avx512dq") != 0 &&
                     __builtin_cpu_supports("avx512vl") != 0 && __builtin_cpu_supports("fma") != 0;
          }},
#else
    Entry{"baseline", &kUdKernelBaseline, []() noexcept { return true; }},
#endif
};

const Entry* best() noexcept {
    const Entry* found = nullptr;
    for (const Entry& entry : kEntries) {
        if (entry.runs()) found = &entry;
    }
    return found;
}

const Entry*& chosen() noexcept {
    static const Entry* entry = best();
    return entry;
}

}  // namespace

std::string_view instruction_set() noexcept { return chosen()->name; }

std::string_view compiler() noexcept {
#ifdef __clang__
    constexpr std::string_view kName = "clang++ " __clang_version__;  // which may end with a blank
    return kName.substr(0, kName.find_last_not_of(' ') + 1);
#else
    return "g++ " __VERSION__;
#endif
}

std::vector<std::string_view> instruction_sets() {
    std::vector<std::string_view> names;
    for (const Entry& entry : kEntries) {
        if (entry.runs()) names.push_back(entry.name);
    }
    return names;
}

bool force_instruction_set(std::string_view name) noexcept {
    if (name == "auto") {
        chosen() = best();
        return true;
    }
    for (const Entry& entry : kEntries) {
        if (entry.name == name && entry.runs()) {
            chosen() = &entry;
            return true;
        }
    }
    return false;
}

void use_instruction_set(std::string_view name) {
    if (force_instruction_set(name)) return;
    std::string known = "auto";
    for (const std::string_view other : instruction_sets()) known += ", " + std::string(other);
    throw SettingsError("instruction set: found \"" + std::string(name) + "\", expected " + known +
                        " on this processor");
}

const UdKernel& ud_kernel() noexcept {
#ifdef VIBRIG_X86_KERNELS
    static const bool wide = __builtin_cpu_supports("avx2") != 0;
    if (wide && chosen()->kernel == &kUdKernelBaseline) return kUdKernelBaselineWide;
#endif
    return *chosen()->kernel;
}

}  // namespace vibrig::estimator
