#pragma once

#include <atomic>
#include <string>
#include <vector>

namespace vibrig::archive {

/// What became of a program that was run to its end.
struct Run {
    int status = -1;    ///< exit status; -1: it did not end by itself
    std::string out;    ///< its standard output
    std::string error;  ///< the last line of its standard error, or why there is none
};

/// Runs a program at the lowest priority and waits for it, `limit_s` of wall time at most, or until
/// `stop`; then its process group is killed. A child that the kernel does not let die is left
/// alone.
[[nodiscard]] Run run_child(const std::vector<std::string>& arguments, double limit_s,
                            const std::atomic<bool>& stop);

}  // namespace vibrig::archive
