// What is on a bus of which nobody has a DBC. Listens only, needs no daemon.
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/commission/bus_bits.hpp"
#include "daemon/commission/bus_find.hpp"
#include "daemon/commission/bus_list.hpp"
#include "daemon/commission/bus_signals.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/journal/signed_head.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/live/commission_client.hpp"
#include "daemon/tool/live/commission_registers.hpp"
#include "daemon/tool/live/remote.hpp"
#include "drivers/can/can_port.hpp"
#include "proto/candump.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

struct BusOptions {
    std::string interface, seqpacket, candump, dbc;
    double seconds = 10, turn_at = 0;
    bool turn = false, json = false, bits = false, find = false;
    std::string by, folder, configuration;
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

/// Bytes, and where there is a DBC its signals.
struct Heard {
    commission::BusList bytes;
    std::optional<commission::BusSignals> signals;

    void add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data,
             drivers::Time time) {
        bytes.add(id, extended, data, time);
        if (signals) signals->add(id, extended, data);
    }
    void turned() {
        bytes.turned();
        if (signals) signals->turned();
    }
};

std::unique_ptr<drivers::CanPort> make_port(const BusOptions& options,
                                            boost::asio::io_context& io) {
    drivers::CanPortSettings settings;
    if (options.interface.empty()) {
        settings.kind = drivers::CanPortSettings::Kind::seqpacket;
        settings.path = options.seqpacket;
    } else {
        settings.interface = options.interface;
    }
    return drivers::make_can_port(io, settings);
}

/// Frames to whoever has `add`, until the port stops.
template <typename Ear>
void start(drivers::CanPort& port, Ear& bus) {
    port.start(
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
}

void listen_live(const BusOptions& options, Heard& bus, const std::string& gimbal = "ONE") {
    boost::asio::io_context io;
    const auto port = make_port(options, io);
    start(*port, bus);
    std::cerr << "Nobody touches the gimbals: listening for " << options.seconds << " s\n";
    listen_for(*port, io, options.seconds);
    if (options.turn) {
        std::cerr << "Now turn " << gimbal
                  << " gimbal by hand, about 20 deg, and back: " << options.seconds << " s\n";
        bus.turned();
        listen_for(*port, io, options.seconds);
    }
    port->stop();
}

/// Frames to the watch of one bit.
struct OneBit {
    commission::BitWatch watch;
    void add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data,
             drivers::Time /*time*/) {
        watch.add(id, extended, data);
    }
};

/// By hand: listens until it has changed and come back. Nothing: it has not.
bool changed_by_hand(const BusOptions& options, OneBit& bit) {
    constexpr double kLook_s = 0.2;
    boost::asio::io_context io;
    const auto port = make_port(options, io);
    start(*port, bit);
    for (double s = 0; s < options.seconds && !bit.watch.came_back(); s += kLook_s)
        listen_for(*port, io, kLook_s);
    port->stop();
    return bit.watch.came_back();
}

/// Each bit that has never changed: changed once and back by hand, or confirmed by two persons.
/// How many are left.
std::size_t prove_bits(const BusOptions& options, const proto::Dbc& dbc,
                       const commission::BusSignals& heard) {
    std::vector<commission::BitProof> proven;
    std::size_t left = 0;
    for (const auto& signal : heard.signals()) {
        if (signal.kind != commission::BusSignals::Kind::bit || signal.changed) continue;
        for (bool over = false; !over;) {
            print_wrapped(std::cerr,
                          "? " + signal.name + " reads " + (signal.low != 0 ? "1" : "0") +
                              ". Change it once (power of a gimbal off, loop opened) and back, "
                              "within " +
                              std::to_string(std::lround(options.seconds)) +
                              " s. [Enter: now; two names, A. Person, B. Person: they confirm it; "
                              "-: leave it out]");
            const std::string text = typed_line(std::cerr);
            OneBit bit{commission::BitWatch(dbc, signal.name)};
            const int rests_at = signal.low != 0 ? 1 : 0;
            over = true;
            if (text == "-") {
                ++left;
            } else if (text.empty() && changed_by_hand(options, bit)) {
                proven.push_back({signal.name, true, {options.by}, rests_at});
                std::cerr << "  " << signal.name << ": changed once and back\n";
            } else if (const auto names = commission::two_names(text); !names.empty()) {
                proven.push_back({signal.name, false, names, rests_at});
                std::cerr << "  " << signal.name << ": confirmed by " << names[0] << " and "
                          << names[1] << '\n';
            } else {
                over = false;
                print_wrapped(std::cerr, text.empty() ? "  it did not change and come back"
                                                      : "  found \"" + text +
                                                            "\", expected nothing, two names or -");
            }
        }
    }
    commission::BitBook(options.folder, record::sha256_of_file(options.dbc))
        .keep(proven, journal::utc_now());
    std::cerr << proven.size() << " bits proven, " << left << " left out; kept in "
              << options.folder << '\n';
    return left;
}

void read_log(const BusOptions& options, Heard& bus) {
    proto::CandumpReader reader(options.candump);
    std::optional<drivers::Time> turn;
    while (const auto frame = reader.next()) {
        if (frame->error || frame->remote) continue;
        if (!turn) turn = frame->time_ns + drivers::from_seconds(options.turn_at);
        if (options.turn_at > 0 && frame->time_ns >= *turn) bus.turned();
        bus.add(frame->id, frame->extended, {frame->data.data(), frame->size}, frame->time_ns);
    }
}

/// Each gimbal in turn; what was found goes into found.toml of the folder.
int find_signals(BusOptions options) {
    double configured_hz = 0;
    bool simulated = !options.seqpacket.empty();
    if (!options.configuration.empty()) {
        const auto rig = configuration::load(options.configuration, false).configuration;
        configured_hz = 1 / drivers::to_seconds(rig.assembler.sample_period);
        simulated = simulated || rig.simulated();
    }
    options.turn = true;
    const auto dbc = proto::read_dbc(options.dbc);
    commission::BusFinder finder(std::filesystem::absolute(options.dbc).lexically_normal().string(),
                                 configured_hz);
    for (std::size_t g = 0; g < 3; ++g) {
        for (bool over = false; !over;) {
            const std::string name = commission::kLoudNames[g];
            print_wrapped(std::cerr,
                          "? Next the " + name + " gimbal. [Enter: listen now; -: leave it out]");
            if (typed_line(std::cerr) == "-") break;
            Heard bus{{}, commission::BusSignals(dbc)};
            listen_live(options, bus, "the " + name);
            const auto why = finder.turned(g, *bus.signals);
            over = why.empty();
            if (over)
                finder.listen(dbc, *bus.signals, bus.bytes);
            else
                print_wrapped(std::cerr, "  " + why);
        }
    }
    const auto found = finder.finding();
    if (options.json) {
        auto all = commission::to_json(found);
        all["simulated"] = simulated;
        all["by"] = options.by;
        std::cout << proto::json_text(all, 1) << '\n';
    }
    std::ostream& out = options.json ? std::cerr : std::cout;
    if (found.outcome != commission::Finding::Outcome::decided) {
        print_wrapped(
            out,
            (found.outcome == commission::Finding::Outcome::refused ? "REFUSED: " : "UNDECIDED: ") +
                found.why);
        return kNo;
    }
    const auto toml = commission::to_toml(found, simulated);
    std::filesystem::create_directories(options.folder);
    const auto path = (std::filesystem::path(options.folder) / "found.toml").string();
    proto::write_durably(path, toml, 0644);
    out << toml;
    print_wrapped(out, "DECIDED, kept in " + path +
                           ". Into the configuration: vibrig commission "
                           "accept --bus --config FILE --by '" +
                           options.by + "' --second NAME");
    return 0;
}

int list_bus(const BusOptions& options) {
    const int sources = (options.interface.empty() ? 0 : 1) + (options.seqpacket.empty() ? 0 : 1) +
                        (options.candump.empty() ? 0 : 1);
    if (sources != 1)
        throw std::runtime_error("found " + std::to_string(sources) +
                                 " of --interface, --seqpacket and --candump, expected one");
    if (options.turn && !options.candump.empty())
        throw std::runtime_error("--turn: found a log, expected a bus to listen to, or --turn-at");
    if (options.turn_at > 0 && options.candump.empty())
        throw std::runtime_error("--turn-at: found a bus, expected a log (--candump)");
    if (options.bits && (!options.candump.empty() || options.dbc.empty() || options.by.empty() ||
                         options.folder.empty()))
        throw std::runtime_error("--bits: expected a bus, --dbc, --by and --folder");
    if (options.find) {
        if (!options.candump.empty() || options.dbc.empty() || options.by.empty() ||
            options.folder.empty())
            throw std::runtime_error("--find: expected a bus, --dbc, --by and --folder");
        return find_signals(options);
    }
    Heard bus;
    if (!options.dbc.empty()) bus.signals.emplace(proto::read_dbc(options.dbc));
    const bool turned = options.turn || options.turn_at > 0;
    if (options.candump.empty())
        listen_live(options, bus);
    else
        read_log(options, bus);
    if (options.json) {
        auto all = commission::json_of(bus.bytes);
        if (bus.signals) all.update(commission::json_of(*bus.signals, turned));
        std::cout << proto::json_text(all, 1) << '\n';
    } else {
        std::cout << commission::table_of(bus.bytes);
        if (bus.signals) std::cout << commission::table_of(*bus.signals, turned);
    }
    if (bus.bytes.frames() == 0) {
        std::cerr << "vibrig commission bus: no frame was heard\n";
        return kNo;
    }
    if (options.bits && prove_bits(options, proto::read_dbc(options.dbc), *bus.signals) > 0)
        return kNo;
    return turned && bus.signals && !bus.signals->winner() ? kNo : 0;
}

}  // namespace

void add_commission_bus(CLI::App& commissioning, int& exit_code) {
    const auto [command, options] = add_command<BusOptions>(
        commissioning, exit_code, "bus",
        "List what is on a bus of which there is no DBC: identifiers, periods, bytes that "
        "change. Listens only, needs no daemon",
        list_bus, "vibrig commission bus: ");
    command.add_option("--interface", options.interface, "CAN interface, such as can0");
    command.add_option("--seqpacket", options.seqpacket, "Unix socket of a simulated rig's bus");
    command.add_option("--candump", options.candump, "A log of candump -l instead of a bus");
    add_number(command, "--for", options.seconds, "How long to listen, s", 0.5, 3600)
        ->capture_default_str();
    command.add_flag("--turn", options.turn,
                     "Listen as long once more while somebody turns one gimbal: which bytes change "
                     "only then");
    add_number(command, "--turn-at", options.turn_at,
               "Of a log: s from its beginning on which one gimbal is turned", 0.5, 1e5);
    command.add_option(
        "--dbc", options.dbc,
        "Its signals, too: range and noise, and which one follows the gimbal that is "
        "turned");
    command.add_flag("--bits", options.bits,
                     "Then have each bit that never changed (valid bits, loop closed, ready, "
                     "fault) changed once by hand, or confirmed by two persons");
    command.add_flag(
        "--find", options.find,
        "Instead: each gimbal is turned by hand in turn, which names its angle; "
        "can.dbc, can.signals.* and can.sample_rate_hz go into found.toml of --folder");
    command
        .add_option("--config", options.configuration,
                    "--find: a configuration whose can.sample_rate_hz has to be the rate measured")
        ->check(CLI::ExistingFile);
    command.add_option("--by", options.by, "Who changes bits, or turns gimbals")
        ->check(one_line("a name"));
    command.add_option("--folder", options.folder,
                       "commission.folder, where what is proven or found is kept");
    command.add_flag("--json", options.json, "As JSON");
    command.footer(
        "Example: vibrig commission bus --interface can0 --turn --dbc rig.dbc\n"
        "Exit code 0: frames were heard, and if asked one signal follows, or all was found; 1: not "
        "so.");
}

}  // namespace vibrig::tool
