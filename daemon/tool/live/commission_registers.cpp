// Where a foreign controller keeps what its display shows. Reads only: what is below has no
// function that writes. What writes is commission_trial.cpp.
#include <algorithm>
#include <array>
#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/commission/places.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/live/commission_registers.hpp"
#include "daemon/tool/live/remote.hpp"
#include "drivers/shaker/modbus_link.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

using RegisterJson = nlohmann::ordered_json;

constexpr std::size_t kWordsAtOnce = 16;
constexpr auto kBetweenRequests = std::chrono::milliseconds(200);
constexpr auto kLate = std::chrono::seconds(1);
constexpr int kMostAsked = 3;
constexpr int kValues = 3;

drivers::ShakerSettings settings_of(const RegisterOptions& options) {
    if (options.tcp.empty() == options.device.empty())
        throw std::runtime_error("found " + std::string(options.tcp.empty() ? "neither" : "both") +
                                 " of --tcp and --device, expected one");
    drivers::ShakerSettings settings;
    settings.unit = options.unit;
    settings.baud = options.baud;
    settings.response_timeout = drivers::kSecond;
    if (options.tcp.empty()) {
        settings.transport = drivers::ShakerSettings::Transport::rtu;
        settings.device = options.device;
        return settings;
    }
    const auto colon = options.tcp.rfind(':');
    settings.host = options.tcp.substr(0, colon);
    if (colon == std::string::npos) return settings;
    try {
        std::size_t used = 0;
        settings.port = std::stoi(options.tcp.substr(colon + 1), &used);
        if (used + colon + 1 == options.tcp.size() && settings.port > 0 && settings.port < 65536)
            return settings;
    } catch (const std::exception&) {  // reported below
    }
    throw std::runtime_error("--tcp: found \"" + options.tcp + "\", expected HOST or HOST:PORT");
}

/// A link without a way to write.
class ReadingLink {
  public:
    explicit ReadingLink(const RegisterOptions& options) : link_(settings_of(options)) { open(); }

    /// By function 17; empty: it does not say.
    std::string device() {
        std::string text;
        std::this_thread::sleep_for(kBetweenRequests);
        const auto reply = link_.identify(text);
        if (reply.ok()) return text;
        if (reply.kind == drivers::ReplyKind::exception) return {};
        link_.close();  // a late reply would be taken for the next one
        open();
        return {};
    }

    /// Up to the first one that the device refuses. A reply that is late or lost is asked for
    /// again: a person's answers hang on it, and to read does nothing.
    commission::RegisterBlock read(proto::RegisterTable table, int count) {
        commission::RegisterBlock block{table, {}};
        while (block.words.size() < static_cast<std::size_t>(count)) {
            std::array<std::uint16_t, kWordsAtOnce> words{};
            const auto left = static_cast<std::size_t>(count) - block.words.size();
            const std::span some(words.data(), std::min(left, words.size()));
            drivers::Reply reply;
            for (int asked = 0; asked < kMostAsked; ++asked) {
                std::this_thread::sleep_for(kBetweenRequests);
                reply = link_.read(table, static_cast<std::uint16_t>(block.words.size()), some);
                if (reply.ok() || reply.kind == drivers::ReplyKind::exception) break;
                // A late reply would be taken for the next one: it is waited for, and forgotten.
                std::this_thread::sleep_for(kLate);
                link_.close();
                open();
            }
            if (reply.kind == drivers::ReplyKind::exception) break;
            if (!reply.ok())
                throw std::runtime_error(link_.name() + ": register " +
                                         std::to_string(block.words.size()) + ": " + reply.text());
            block.words.insert(block.words.end(), some.begin(), some.end());
        }
        return block;
    }

    [[nodiscard]] const std::string& name() const noexcept { return link_.name(); }

  private:
    void open() {
        std::string why;
        if (link_.connect(why) != drivers::ModbusLink::Connection::open)
            throw std::runtime_error(link_.name() + ": " + why);
    }

    drivers::ModbusLink link_;
};

/// Three values of one quantity, as a person sets them on the panel.
std::optional<std::vector<proto::Register>> places_by_values(ReadingLink& link,
                                                             const RegisterOptions& options,
                                                             std::ostream& out,
                                                             const std::string& quantity,
                                                             const std::string& examples) {
    std::vector<proto::Register> places;
    double before = 0;
    for (int n = 0; n < kValues;) {
        out << "? Set the " << quantity << " on the panel, " << (n == 0 ? "" : "to another value, ")
            << examples << ". What does its display show? [number, as shown"
            << (n == 0 ? "; Enter: leave it out" : "") << "]\n";
        const std::string text = typed_line(out);
        if (text.empty() && n == 0) return std::nullopt;
        const auto shown = commission::shown_value(text);
        if (!shown || shown->value == before) {
            out << "  found \"" << text << "\", expected a positive number such as 15.00"
                << (before > 0 ? ", another than before" : "") << '\n';
            continue;
        }
        const std::vector blocks{link.read(proto::RegisterTable::holding, options.holding),
                                 link.read(proto::RegisterTable::input, options.input)};
        places = n == 0 ? commission::places_of(*shown, blocks)
                        : commission::still_places(places, *shown, blocks);
        out << "  " << places.size() << (places.size() == 1 ? " place fits\n" : " places fit\n");
        before = shown->value;
        ++n;
    }
    return places;
}

int find_registers(const RegisterOptions& options) {
    if (options.write) return try_registers(options);
    std::ostream& out = options.json ? std::cerr : std::cout;
    ReadingLink link(options);
    std::string device = link.device();
    if (device.empty()) device = options.plate;
    out << "Device: "
        << (device.empty() ? "does not say who it is; --plate names it" : device.c_str()) << '\n';
    out << "Read-only: " << link.name() << ", " << options.holding << " holding and "
        << options.input << " input registers. The shaker's power stage is off.\n";
    RegisterJson all = RegisterJson::object();
    bool one_each = true, none = false;
    for (const auto& [quantity, examples] : {std::pair{"frequency", "e.g. 15.00, 17.50, 21.25 Hz"},
                                             std::pair{"amplitude", "e.g. 0.10, 0.25, 0.40"}}) {
        const auto places = places_by_values(link, options, out, quantity, examples);
        if (!places) continue;
        one_each = one_each && places->size() == 1;
        none = none || places->empty();
        all[quantity] = RegisterJson::array();
        for (const auto& place : *places) {
            all[quantity].push_back(commission::toml_line(quantity, place));
            out << "  " << commission::toml_line(quantity, place) << '\n';
        }
    }
    const char* outcome = all.empty() ? "unfinished" : one_each ? "decided" : "undecided";
    if (options.json)
        std::cout << proto::json_text(RegisterJson{{"outcome", outcome},
                                                   {"by", options.by},
                                                   {"device", device},
                                                   {"places", all}},
                                      1)
                  << '\n';
    if (!all.empty() && one_each) {
        out << "DECIDED. The other registers are the manual's; nothing is recorded: what they do\n"
               "proves vibrig selftest --by NAME.\n";
        return 0;
    }
    out << (all.empty() ? "UNFINISHED: nothing was set\n"
            : none      ? "UNDECIDED: no place shows what was typed: more registers (--holding, "
                          "--input), a display in another unit, or the manual\n"
                        : "UNDECIDED: what would tell: a value that needs more than 65535 counts, "
                          "or the manual\n");
    return kNo;
}

}  // namespace

std::string typed_line(std::ostream& out) {
    out << "> " << std::flush;
    std::string line;
    if (!std::getline(std::cin, line)) throw std::runtime_error("nobody answers");
    const auto first = line.find_first_not_of(" \t\r"), last = line.find_last_not_of(" \t\r");
    return first == std::string::npos ? "" : line.substr(first, last - first + 1);
}

void add_commission_registers(CLI::App& commissioning, int& exit_code) {
    const auto [command, options] = add_command<RegisterOptions>(
        commissioning, exit_code, "registers",
        "Find where a shaker's controller keeps frequency and amplitude, from what its display "
        "shows: reads only. With --write, try the registers that a configuration states, one by "
        "one, while nothing can move. Needs no daemon",
        find_registers, "vibrig commission registers: ");
    command.add_option("--by", options.by, "Who stands at the panel")
        ->required()
        ->check(one_line("a name"));
    command.add_option("--tcp", options.tcp, "Modbus TCP, HOST or HOST:PORT (502)")
        ->check(one_line("HOST or HOST:PORT"));
    command.add_option("--device", options.device, "Modbus RTU, serial device (8E1)");
    command.add_option("--plate", options.plate,
                       "Maker, type and firmware on its plate, of a device that does not say them "
                       "by function 17");
    command.add_option("--baud", options.baud, "Of the serial device")
        ->capture_default_str()
        ->check(CLI::Range(300, 4'000'000));  // as shaker.baud
    command.add_option("--unit", options.unit, "Modbus unit")
        ->capture_default_str()
        ->check(CLI::Range(0, 247));
    command.add_option("--holding", options.holding, "How many holding registers, from 0 on")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    command.add_option("--input", options.input, "How many input registers, from 0 on")
        ->capture_default_str()
        ->check(CLI::Range(0, 1024));
    auto* const write = command.add_flag(
        "--write", options.write,
        "Try the registers that --config states: the stop chain by hand, then with the chain open "
        "and the power stage off each one whose name is typed; the vibrigd of this rig is stopped");
    auto* const file = command.add_option("--config", options.configuration,
                                          "The daemon's configuration file, for --write");
    write->needs(file);
    file->needs(write);
    for (const char* reading : {"--tcp", "--device", "--baud", "--unit", "--holding", "--input"})
        write->excludes(command.get_option(reading));
    command.add_flag("--json", options.json, "As JSON; the dialogue goes to standard error");
    command.footer(
        "Example: vibrig commission registers --by 'Ada Lovelace' --tcp 192.0.2.7\n"
        "  vibrig commission registers --by 'Ada Lovelace' --write --config "
        "/etc/vibrig/vibrigd.toml\n"
        "Exit code 0: one place each, or all was tried and passed; 1: several, none, or not.");
}

}  // namespace vibrig::tool
