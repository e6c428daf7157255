#pragma once

#include <cstdint>
#include <string>

namespace vibrig {

/// What a person does about the journal's latch, behind its cause.
inline constexpr const char* kJournalToDo =
    ": look at it (vibrig journal verify), then vibrig ack journal --by NAME";

/// Latched until named persons acknowledge it; kept over restarts.
struct Latch {
    std::string name;          ///< under which it is acknowledged
    std::string cause;         ///< in words
    std::string armed_by;      ///< by whom the shaker was armed then; empty: it was not
    std::string first;         ///< who acknowledged first, where two persons are needed
    bool two_persons = false;  ///< another person than these acknowledges it too
    std::int64_t utc_ns = 0;   ///< when it latched
};

}  // namespace vibrig
