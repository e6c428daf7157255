#include <algorithm>
#include <cmath>
#include <string_view>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "drivers/sample/channels.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;
using drivers::SignalBindings;

std::vector<Key> port_keys() {
    using P = drivers::CanPortSettings;
    using A = drivers::AssemblerSettings;
    using Kind = P::Kind;
    const auto can = part(&C::can);
    const auto assembler = part(&C::assembler);
    return {
        choice<Kind>("can.port", can(&P::kind),
                     {{"socketcan", Kind::socketcan}, {"seqpacket", Kind::seqpacket}},
                     "the kernel's CAN, or a Unix socket that carries CAN frames"),
        text("can.interface", can(&P::interface), "1 to 15 characters",
             "socketcan: network interface", interface_rule),
        text("can.path", can(&P::path), "absolute or \"@name\"",
             "seqpacket: Unix socket; @: abstract name", socket_or_empty_rule),
        text("can.dbc", at(&C::dbc), "a path", "DBC file of the bus; empty: the built-in rig.dbc",
             path_rule),
        boolean("can.fd", can(&P::fd), "accept CAN FD frames"),
        integer("can.receive_buffer", can(&P::receive_buffer), "byte", 4096, 1 << 30,
                "receive buffer of the socket"),
        converted(
            "can.sample_rate_hz", assembler(&A::sample_period), "Hz", {1, 10'000},
            "samples, that is sync counts, per second",
            // The period is kept in whole ns; a rate such as 30 Hz shows as it was written.
            [](drivers::Time period) {
                return std::round(1e9 / static_cast<double>(period) * 1e4) / 1e4;
            },
            [](double rate) { return static_cast<drivers::Time>(std::llround(1e9 / rate)); }),
        integer("can.samples_per_frame", assembler(&A::samples_per_frame), "", 1, 16,
                "samples in each frame that carries a channel, as CAN FD has room for: signal S is "
                "of the first, S_1, S_2, ... of the next; the frame's count is the first one's"),
        milliseconds("can.join_deadline_ms", assembler(&A::join_deadline), {1, 10'000},
                     "a sample is given out this long after its first frame"),
        milliseconds("can.stale_deadline_ms", assembler(&A::stale_deadline), {1, 60'000},
                     "a channel without a value for longer is stale; on a real rig 1000 at most"),
    };
}

std::vector<Key> signal_keys() {
    using S = SignalBindings;
    const auto bindings = part(&C::assembler, &drivers::AssemblerSettings::bindings);
    std::vector<Key> keys;
    const auto add = [&](const std::string& name, std::string S::*member, const char* doc) {
        keys.push_back(text("can.signals." + name, bindings(member), "\"Message.Signal\" or empty",
                            doc, binding_rule));
    };
    add("sync_count", &S::sync_count, "full counter, one count per sample");
    // What is of one kind stands together: first the values, then whether they are valid.
    const auto kind_ends = [](auto row) {
        return std::find_if(row, drivers::kChannelTable.end(), [row](const drivers::ChannelRow& r) {
            return std::string_view(r.valid_help) != row->valid_help;
        });
    };
    for (auto row = drivers::kChannelTable.begin(); row != drivers::kChannelTable.end();) {
        const auto end = kind_ends(row);
        for (auto r = row; r != end; ++r) add(r->name, r->signal, r->help);
        for (; row != end; ++row)
            if (row->valid != nullptr)
                add(row->name + std::string("_valid"), row->valid, row->valid_help);
    }
    for (const drivers::StatusRow& row : drivers::kStatusTable) add(row.name, row.signal, row.help);
    keys.push_back(text("can.signals.message_sync_signal", bindings(&S::message_sync_signal),
                        "a signal name or empty",
                        "in any message with a channel: low bits of its sync count",
                        identifier_or_empty_rule));
    return keys;
}

std::vector<Key> gimbal_keys() {
    using G = drivers::GimbalSettings;
    const auto gimbal = part(&C::gimbal);
    return {
        text("gimbal.message", gimbal(&G::message), "a message name",
             "command with signals Outer, Inner, Azimuth, Mode, Counter", identifier_rule),
        milliseconds("gimbal.status_deadline_ms", gimbal(&G::status_deadline), {10, 60'000},
                     "an older status is not believed; on a real rig 1000 at most"),
        seconds("gimbal.slew_timeout_s", gimbal(&G::slew_timeout), {1, 3600},
                "from command to in position"),
        milliseconds("gimbal.repeat_ms", gimbal(&G::repeat), {10, 60'000},
                     "a command is sent again until its counter is echoed"),
        travels("gimbal.travel_deg", gimbal(&G::travel_deg),
                "what cables allow, as the encoders count; a whole turn or more: no limit"),
    };
}

}  // namespace

std::vector<Key> bus_keys() { return joined({port_keys(), signal_keys(), gimbal_keys()}); }

}  // namespace vibrig::configuration
