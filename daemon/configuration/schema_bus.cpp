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

void add_port_keys(std::vector<Key>& keys) {
    using Kind = drivers::CanPortSettings::Kind;
    keys.push_back(choice<Kind>(
        "can.port", {{"socketcan", Kind::socketcan}, {"seqpacket", Kind::seqpacket}},
        "the kernel's CAN, or a Unix socket that carries CAN frames",
        [](C & c) -> auto& { return c.can.kind; }));
    keys.push_back(text(
        "can.interface", "1 to 15 characters", "socketcan: network interface", interface_rule,
        [](C & c) -> auto& { return c.can.interface; }));
    keys.push_back(text(
        "can.path", "absolute or \"@name\"", "seqpacket: Unix socket; @: abstract name",
        socket_or_empty_rule, [](C & c) -> auto& { return c.can.path; }));
    keys.push_back(text(
        "can.dbc", "a path", "DBC file of the bus; empty: the built-in rig.dbc", path_rule,
        [](C & c) -> auto& { return c.dbc; }));
    keys.push_back(
        boolean("can.fd", "accept CAN FD frames", [](C& c) -> bool& { return c.can.fd; }));
    keys.push_back(integer("can.receive_buffer", "byte", 4096, 1 << 30,
                           "receive buffer of the socket",
                           [](C& c) -> int& { return c.can.receive_buffer; }));
    keys.push_back(converted(
        "can.sample_rate_hz", "Hz", {1, 10'000}, "samples, that is sync counts, per second",
        [](C& c) {
            // The period is kept in whole ns; a rate such as 30 Hz shows as it was written.
            return std::round(1e9 / static_cast<double>(c.assembler.sample_period) * 1e4) / 1e4;
        },
        [](C& c, double rate) {
            c.assembler.sample_period = static_cast<drivers::Time>(std::llround(1e9 / rate));
        }));
    keys.push_back(integer("can.samples_per_frame", "", 1, 16,
                           "samples in each frame that carries a channel, as CAN FD has room for: "
                           "signal S is of the first, S_1, S_2, ... of the next; the frame's count "
                           "is the first one's",
                           [](C& c) -> int& { return c.assembler.samples_per_frame; }));
    keys.push_back(milliseconds(
        "can.join_deadline_ms", {1, 10'000},
        "a sample is given out this long after its first frame",
        [](C & c) -> auto& { return c.assembler.join_deadline; }));
    keys.push_back(milliseconds(
        "can.stale_deadline_ms", {1, 60'000}, "a channel without a value for longer is stale",
        [](C & c) -> auto& { return c.assembler.stale_deadline; }));
}

void add_signal_keys(std::vector<Key>& keys) {
    struct Row {
        const char* name;
        std::string SignalBindings::*member;
        const char* doc;
    };
    using S = SignalBindings;
    static constexpr Row kRows[] = {
        {"loop_closed", &S::loop_closed, "1: stabilisation loop closed"},
        {"gyros_at_speed", &S::gyros_at_speed, "1: gyro wheels at speed"},
        {"ready", &S::ready, "1: platform ready"},
        {"fault", &S::fault, "1: platform fault"},
        {"temperature", &S::temperature, "platform temperature, degC"},
        {"in_position", &S::in_position, "1: gimbals in position"},
        {"slewing", &S::slewing, "1: gimbals slewing"},
        {"command_echo", &S::command_echo, "counter of the last gimbal command accepted"},
        {"temperature_case", &S::temperature_case, "degC; the default may be missing in the DBC"},
        {"temperature_gyro_x", &S::temperature_gyro_x, "degC; as temperature_case"},
        {"temperature_gyro_y", &S::temperature_gyro_y, "degC; as temperature_case"},
        {"temperature_gyro_z", &S::temperature_gyro_z, "degC; as temperature_case"},
    };
    const auto at = [](std::string S::*member) -> At<std::string> {
        return [member](C& c) -> std::string& { return c.assembler.bindings.*member; };
    };
    const auto add = [&](const std::string& name, std::string S::*member, const char* doc) {
        keys.push_back(text("can.signals." + name, "\"Message.Signal\" or empty", doc, binding_rule,
                            at(member)));
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
    for (const Row& row : kRows) add(row.name, row.member, row.doc);
    keys.push_back(text("can.signals.message_sync_signal", "a signal name or empty",
                        "in any message with a channel: low bits of its sync count",
                        identifier_or_empty_rule, at(&S::message_sync_signal)));
}

void add_gimbal_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "gimbal.message", "a message name",
        "command with signals Outer, Inner, Azimuth, Mode, Counter", identifier_rule,
        [](C & c) -> auto& { return c.gimbal.message; }));
    keys.push_back(milliseconds(
        "gimbal.status_deadline_ms", {10, 60'000}, "an older status is not believed",
        [](C & c) -> auto& { return c.gimbal.status_deadline; }));
    keys.push_back(seconds(
        "gimbal.slew_timeout_s", {1, 3600}, "from command to in position",
        [](C & c) -> auto& { return c.gimbal.slew_timeout; }));
    keys.push_back(milliseconds(
        "gimbal.repeat_ms", {10, 60'000}, "a command is sent again until its counter is echoed",
        [](C & c) -> auto& { return c.gimbal.repeat; }));
    keys.push_back(travels(
        "gimbal.travel_deg",
        "what cables allow, as the encoders count; a whole turn or more: no limit",
        [](C & c) -> auto& { return c.gimbal.travel_deg; }));
}

}  // namespace

void add_bus_keys(std::vector<Key>& keys) {
    add_port_keys(keys);
    add_signal_keys(keys);
    add_gimbal_keys(keys);
}

}  // namespace vibrig::configuration
