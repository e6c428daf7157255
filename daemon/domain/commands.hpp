#pragma once

#include <cstdint>
#include <string>

namespace vibrig {

struct CommandRequest {
    enum class Kind : std::uint8_t {
        arm,
        start,
        pause,
        resume,
        abort,
        acknowledge,
        selftest,
        commission,  ///< argument: what, as JSON
        certificate  ///< one was issued; argument: number, campaign and hashes, as JSON
    } kind = Kind::abort;
    std::string by;        ///< named person
    std::string argument;  ///< what is acknowledged
};
struct CommandReply {
    bool accepted = false;
    std::string message;
};

}  // namespace vibrig
