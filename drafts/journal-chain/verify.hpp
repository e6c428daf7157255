#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace vibrig::journal {

struct Verdict {
    std::int64_t entries = 0;
    std::string head;        ///< newest entry and its hash, "1234:9f.."
    std::string public_key;  ///< that the head beside the journal is signed with; empty: none
    std::string begins;      ///< with what the chain does
    std::vector<std::string> found;  ///< missing or changed; empty: it is as it was written
};

/// Reads the whole of a journal, also one that a daemon is writing, and changes nothing. `head`:
/// "ENTRY:HASH" that it has to go through; empty: none. Throws std::runtime_error for what is no
/// journal or cannot be read.
[[nodiscard]] Verdict verify_file(const std::string& path, const std::string& head = {});

}  // namespace vibrig::journal
