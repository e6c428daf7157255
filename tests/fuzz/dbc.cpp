// A DBC file: either it is taken, and its signals decode and encode any data, or one clear error.
#include <array>
#include <cstdint>
#include <string_view>

#include "proto/dbc.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig::proto;
    const std::string_view text(reinterpret_cast<const char*>(data), size);
    try {
        const Dbc dbc = parse_dbc(text, "fuzz.dbc");
        std::array<std::uint8_t, 64> frame{};
        for (std::size_t i = 0; i < frame.size() && i < size; ++i) frame[i] = data[size - 1 - i];
        for (const Message& message : dbc.messages) {
            for (const Signal& signal : message.signals) {
                static_cast<void>(present(message, signal, frame));
                if (const auto value = decode(signal, frame))
                    static_cast<void>(encode(signal, *value, frame));
            }
        }
    } catch (const DbcError&) {
    }
    return 0;
}
