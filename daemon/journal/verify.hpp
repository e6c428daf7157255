#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "daemon/journal/signed_head.hpp"

namespace vibrig::journal {

struct Verdict {
    std::int64_t entries = 0;
    std::string chain;               ///< which journal: hash of its entry 1
    std::string head;                ///< its newest entry, signed
    std::string public_key;          ///< that it is signed with
    std::string begins;              ///< with what the chain does
    std::int64_t unpublished = 0;    ///< entries newer than the head beside it: it ended by SIGKILL
    std::vector<std::string> found;  ///< missing or changed; empty: it is what was written
};

struct Expectation {
    std::vector<Anchor> anchors;  ///< heads it has to go through
    std::string public_key;       ///< that has to have signed it: hex, or fingerprint(); empty: any
    std::function<void(double part)> progress;
};

/// Reads the whole of a journal, also one that a daemon is writing, and changes nothing. Throws
/// std::runtime_error for what is no journal or cannot be read.
[[nodiscard]] Verdict verify_file(const std::string& path, const Expectation& expected = {});

}  // namespace vibrig::journal
