#pragma once

#include <array>
#include <cstddef>
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
/// In the order of CommandRequest::Kind, as people, the interface and the journal have them.
inline constexpr std::array<const char*, 9> kCommandWords{"arm",      "start",      "pause",
                                                          "resume",   "abort",      "acknowledge",
                                                          "selftest", "commission", "certificate"};
static_assert([] {
    using enum CommandRequest::Kind;
    constexpr std::array kInOrder{arm,         start,    pause,      resume,     abort,
                                  acknowledge, selftest, commission, certificate};
    for (std::size_t i = 0; i < kInOrder.size(); ++i)
        if (static_cast<std::size_t>(kInOrder[i]) != i) return false;
    return kInOrder.size() == kCommandWords.size();
}());
[[nodiscard]] constexpr const char* word_of(CommandRequest::Kind kind) {
    return kCommandWords[static_cast<std::size_t>(kind)];
}
struct CommandReply {
    bool accepted = false;
    std::string message;
};

}  // namespace vibrig
