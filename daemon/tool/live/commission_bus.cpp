// What is on a bus of which nobody has a DBC. Listens only, needs no daemon.
#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>

#include "daemon/commission/bus_list.hpp"
#include "daemon/tool/commands.hpp"
#include "drivers/can/can_port.hpp"
#include "proto/candump.hpp"

namespace vibrig::tool {

namespace {

struct BusOptions {
    std::string interface, seqpacket, candump;
    double seconds = 10;
    bool turn = false, json = false;
};

/// Listens for so long. Throws CanError.
void listen_for(drivers::CanPort& port, boost::asio::io_context& io, double seconds) {
    io.restart();
    io.run_for(std::chrono::duration_cast<std::chrono::nanoseconds>(
        std::chrono::duration<double>(seconds)));
    if (port.state() != drivers::PortState::running)
        throw std::runtime_error(std::string("the bus is ") + drivers::name_of(port.state()) +
                                 ", expected it running");
}

void listen_live(const BusOptions& options, commission::BusList& bus) {
    boost::asio::io_context io;
    drivers::CanPortSettings settings;
    if (options.interface.empty()) {
        settings.kind = drivers::CanPortSettings::Kind::seqpacket;
        settings.path = options.seqpacket;
    } else {
        settings.interface = options.interface;
    }
    const auto port = drivers::make_can_port(io, settings);
    port->start(
        [&bus](std::span<const drivers::ReceivedFrame> frames) {
            for (const auto& one : frames) {
                const bool extended = (one.frame.can_id & CAN_EFF_FLAG) != 0;
                if ((one.frame.can_id & CAN_RTR_FLAG) != 0) continue;
                bus.add(one.frame.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK), extended,
                        {one.frame.data, one.frame.len}, one.time);
            }
        },
        [](drivers::PortState, const char* text) { std::cerr << text << '\n'; },
        [](const drivers::ReceivedFrame&) {});
    std::cerr << "Nobody touches the gimbals: listening for " << options.seconds << " s\n";
    listen_for(*port, io, options.seconds);
    if (options.turn) {
        std::cerr << "Now turn ONE gimbal by hand, about 20 deg, and back: " << options.seconds
                  << " s\n";
        bus.turned();
        listen_for(*port, io, options.seconds);
    }
    port->stop();
}

void read_log(const std::string& path, commission::BusList& bus) {
    proto::CandumpReader reader(path);
    while (const auto frame = reader.next()) {
        if (frame->error || frame->remote) continue;
        bus.add(frame->id, frame->extended, {frame->data.data(), frame->size}, frame->time_ns);
    }
}

int list_bus(const BusOptions& options) {
    const int sources = (options.interface.empty() ? 0 : 1) + (options.seqpacket.empty() ? 0 : 1) +
                        (options.candump.empty() ? 0 : 1);
    if (sources != 1)
        throw std::runtime_error("found " + std::to_string(sources) +
                                 " of --interface, --seqpacket and --candump, expected one");
    if (options.turn && !options.candump.empty())
        throw std::runtime_error("--turn: found a log, expected a bus to listen to");
    commission::BusList bus;
    if (options.candump.empty())
        listen_live(options, bus);
    else
        read_log(options.candump, bus);
    if (options.json)
        std::cout << commission::json_of(bus).dump(1) << '\n';
    else
        std::cout << commission::table_of(bus);
    if (bus.frames() > 0) return 0;
    std::cerr << "vibrig commission bus: no frame was heard\n";
    return kNo;
}

}  // namespace

void add_commission_bus(CLI::App& commissioning, int& exit_code) {
    CLI::App& command = *commissioning.add_subcommand(
        "bus",
        "List what is on a bus of which there is no DBC: identifiers, periods, bytes that "
        "change. Listens only, needs no daemon");
    auto options = std::make_shared<BusOptions>();
    command.add_option("--interface", options->interface, "CAN interface, such as can0");
    command.add_option("--seqpacket", options->seqpacket, "Unix socket of a simulated rig's bus");
    command.add_option("--candump", options->candump, "A log of candump -l instead of a bus");
    command.add_option("--for", options->seconds, "How long to listen, s")
        ->capture_default_str()
        ->check(CLI::Range(0.5, 3600.0));
    command.add_flag("--turn", options->turn,
                     "Listen as long once more while somebody turns one gimbal: which bytes change "
                     "only then");
    command.add_flag("--json", options->json, "As JSON");
    command.footer(
        "Example: vibrig commission bus --interface can0 --turn\n"
        "Exit code 0: frames were heard; 1: none.");
    command.callback([&exit_code, options] {
        exit_code = guarded([&] { return list_bus(*options); }, "vibrig commission bus: ");
    });
}

}  // namespace vibrig::tool
