// The registers that a configuration states, tried on the controller: the only command that writes
// to a shaker beside the daemon, and never while one has the rig.
#include <algorithm>
#include <chrono>
#include <csignal>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <utility>

#include "daemon/commission/register_trial.hpp"
#include "daemon/commission/trial_log.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/journal/signed_head.hpp"
#include "daemon/lock/rig_lock.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/live/commission_client.hpp"
#include "daemon/tool/live/commission_registers.hpp"
#include "drivers/shaker/modbus_link.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

constexpr auto kBetweenTrials = std::chrono::milliseconds(50);

volatile std::sig_atomic_t end_ordered = 0;  // NOLINT: a signal handler's

/// Throws once: what is to be taken back then still has its way.
void look_for_end() {
    static bool seen = false;
    if (end_ordered == 0 || std::exchange(seen, true)) return;
    throw std::runtime_error("ended by a signal");
}

/// An end from outside is an answer like any other: what was written is taken back first.
void end_in_order() {
    struct sigaction action {};
    action.sa_handler = [](int) { end_ordered = 1; };  // without SA_RESTART: reading a line ends
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &action, nullptr);
}

class LinkPort : public commission::TrialPort {
  public:
    explicit LinkPort(const drivers::ShakerSettings& settings) : link_(patient(settings)) {
        open();
    }

    Answer read(proto::RegisterTable table, std::uint16_t address,
                std::span<std::uint16_t> words) override {
        return ask([&] { return link_.read(table, address, words); });
    }
    Answer write(std::uint16_t address, std::span<const std::uint16_t> words) override {
        return ask([&] { return link_.write(address, words); });
    }
    void wait(double seconds) override {
        std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
        look_for_end();
    }
    [[nodiscard]] double now_s() const override {
        const auto now = std::chrono::steady_clock::now().time_since_epoch();
        return std::chrono::duration<double>(now).count();
    }
    std::string device() {
        std::string text;
        if (!link_.identify(text).ok()) {
            link_.close();  // a late reply would be taken for the next one
            open();
        }
        return text;
    }
    [[nodiscard]] const std::string& name() const { return link_.name(); }

  private:
    /// The configured timeout is for a daemon's stops; a person's trial bears a late reply.
    static drivers::ShakerSettings patient(drivers::ShakerSettings settings) {
        settings.response_timeout = std::max(settings.response_timeout, 2 * drivers::kSecond);
        return settings;
    }
    void open() {
        std::string why;
        if (link_.connect(why) != drivers::ModbusLink::Connection::open)
            throw std::runtime_error(link_.name() + ": " + why);
    }
    template <typename Request>
    Answer ask(Request&& request) {
        look_for_end();
        std::this_thread::sleep_for(kBetweenTrials);
        if (!link_.connected()) open();
        const drivers::Reply reply = request();
        if (reply.ok()) return Answer::done;
        if (reply.kind == drivers::ReplyKind::exception) return Answer::refused;
        link_.close();
        look_for_end();
        throw std::runtime_error(link_.name() + ": " + reply.text());
    }

    drivers::ModbusLink link_;
};

class Typist : public commission::TrialPerson {
  public:
    explicit Typist(std::ostream& out) : out_(out) {}
    std::string answer(const std::string& question) override {
        print_wrapped(out_, "? " + question);
        try {
            return typed_line(out_);
        } catch (const std::runtime_error&) {
            look_for_end();
            throw;
        }
    }
    void show(const std::string& line) override { print_wrapped(out_, line); }

  private:
    std::ostream& out_;
};

/// Peak g at the table at which each of the shaker's limits is reached.
std::vector<std::pair<std::string, double>> limits_of(const configuration::Configuration& c) {
    const double omega = 2 * std::numbers::pi * c.estimator.frequency_hz;
    const double g = c.estimator.gravity_mps2;
    return {{"acceleration_g", c.campaign.max_acceleration_g},
            {"velocity_mps", c.campaign.max_velocity_mps * omega / g},
            {"displacement_mm", 1e-3 * c.campaign.max_displacement_mm * omega * omega / g}};
}

void power_is_off(Typist& person) {
    for (;;) {
        const auto text = person.answer("Is the shaker's power stage off? [yes or no]");
        if (text == "yes" || text == "y") return;
        if (text == "no" || text == "n")
            throw commission::TrialEnded("registers are tried with the power stage off");
        person.show("  found \"" + text + "\", expected yes or no");
    }
}

}  // namespace

int try_registers(const RegisterOptions& options) {
    std::ostream& out = options.json ? std::cerr : std::cout;
    const auto loaded = configuration::load(options.configuration, true);
    const auto& rig = loaded.configuration;
    const RigLock lock(rig, options.configuration);
    LinkPort port(rig.shaker);
    Typist person(out);
    std::string device = port.device();
    if (device.empty()) device = options.plate;
    print_wrapped(
        out, "Device: " + (device.empty() ? "does not say who it is; --plate names it" : device));
    print_wrapped(out, port.name() + ", registers as " + options.configuration +
                           " states them. Nothing is written unless the emergency-stop chain is "
                           "open and the controller at rest.");
    end_in_order();
    std::string why;
    commission::TrialLog log(rig.commission.folder, options.by);
    log.add("begin", {{"device", device}, {"controller", port.name()}});
    commission::LoggedPort logged(port, log, rig.shaker.registers);
    commission::RegisterTrial trial(rig.shaker.registers, logged, person);
    try {
        power_is_off(person);
        trial.stop_chain(rig.campaign.proof.buttons, rig.campaign.proof.seen_s);
        trial.write_each();
        trial.beyond_limits(limits_of(rig));
    } catch (const commission::TrialEnded& ended) {
        why = ended.what();
    }
    const char* outcome = !why.empty() ? "refused" : trial.passed() ? "decided" : "undecided";
    CommissionJson rows = CommissionJson::array();
    for (const auto& row : trial.rows())
        rows.push_back({{"name", row.name}, {"passed", row.passed}, {"found", row.found}});
    log.add("verdict", {{"outcome", outcome}, {"why", why}, {"rows", rows}});
    if (why.empty() && trial.passed())
        commission::TriedRegisters(rig.commission.folder)
            .keep(commission::TriedRegisters::keys_of(loaded), options.by, device,
                  journal::utc_now());
    if (options.json) {
        std::cout << proto::json_text(CommissionJson{{"outcome", outcome},
                                                     {"why", why},
                                                     {"simulated", rig.simulated()},
                                                     {"by", options.by},
                                                     {"device", device},
                                                     {"rows", rows}},
                                      1)
                  << '\n';
    }
    if (!why.empty()) {
        print_wrapped(out, "REFUSED: " + why);
    } else {
        print_wrapped(out, trial.passed()
                               ? "DECIDED: the controller does what its registers are stated to "
                                 "do. What was written is in " +
                                     log.path() +
                                     ", and in the journal once vibrigd has started; the record is "
                                     "for vibrig commission watchdog stop units excitation."
                               : "UNDECIDED: what was left out is not known to be written rightly");
    }
    return why.empty() && trial.passed() ? 0 : kNo;
}

}  // namespace vibrig::tool
