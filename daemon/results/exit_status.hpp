#pragma once

#include <exception>
#include <iostream>

namespace vibrig::tool {

constexpr int kNo = 1;        ///< exit status: the result says no
constexpr int kBadInput = 2;  ///< exit status: bad usage or input, or no daemon

/// Exit status of a command whose body is `run`. What it throws becomes one line on standard error,
/// after `who`, and kBadInput; so does an output that nobody could be given.
template <typename Run>
[[nodiscard]] int guarded(Run&& run, const char* who = "") {
    try {
        const int code = run();
        std::cout.flush();
        if (std::cout) return code;
        std::cerr << who << "standard output: cannot be written\n";
    } catch (const std::exception& error) {
        std::cerr << who << error.what() << '\n';
    }
    return kBadInput;
}

}  // namespace vibrig::tool
