// Frames of the rig's bus, and strangers, at any time: counters balance and a good value is a
// number.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "drivers/sample/assembler.hpp"

namespace {

constexpr std::size_t kBytes = 12;  // of the input for a frame: which, length, how much later, data

void check(bool good) {
    if (!good) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig;
    static const proto::Dbc dbc = proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc");
    std::uint64_t samples = 0;
    drivers::AssemblerSettings settings;
    settings.sample_period = 25 * drivers::kMillisecond;
    drivers::SampleAssembler assembler(dbc, settings, [&samples](const drivers::Sample& sample) {
        ++samples;
        for (std::size_t i = 0; i < 3; ++i) {
            check(!sample.angles_good() || std::isfinite(sample.angle[i]));
            check(!sample.force_good() || std::isfinite(sample.force[i]));
        }
    });
    drivers::ReceivedFrame received;
    received.time = drivers::kSecond;
    for (; size >= kBytes; data += kBytes, size -= kBytes) {
        received.frame = {};
        received.frame.can_id = data[0] < 0xC0 ? dbc.messages[data[0] % dbc.messages.size()].id
                                               : static_cast<canid_t>(data[0]) << (data[1] % 24);
        received.frame.len = data[0] & 1 ? 8 : data[1] % 9;
        received.time += static_cast<std::int8_t>(data[2]) * 500 * drivers::kMicrosecond;
        received.time = std::max<drivers::Time>(received.time, 0);
        std::memcpy(received.frame.data, data + 4, 8);
        assembler.feed(received);
        assembler.advance(received.time + data[3] * drivers::kMillisecond);
    }
    const auto& c = assembler.counters();
    check(c.received == c.used + c.unknown + c.duplicate + c.late + c.wrong_length);
    check(c.samples == samples);
    return 0;
}
