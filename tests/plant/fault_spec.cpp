#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "proto/text.hpp"
#include "tests/plant/faults.hpp"

namespace vibrig::plant {
namespace {

enum class Value : std::uint8_t {
    none,
    rate,
    milliseconds,
    degrees,
    seconds,
    factor,
    factor_at,
    share_at,
    slowness,
    decibels,
    either_way,
    whole,
    word
};

struct Description {
    FaultKind kind;
    std::string_view name;
    Value value;
    bool channel;
    const char* help;
};

constexpr std::array<Description, 48> kDescriptions{{
    {FaultKind::lose, "lose", Value::rate, false, "lose=RATE             share of frames lost"},
    {FaultKind::stuck, "stuck", Value::none, true,
     "stuck[:CHANNEL]       the channel shows its last value for ever"},
    {FaultKind::late, "late", Value::milliseconds, false,
     "late=MS[,RATE]        frames come later (from the next tick on)"},
    {FaultKind::out_of_range, "out-of-range", Value::none, true,
     "out-of-range[:CHANNEL]  all bits of the value set (also: nan)"},
    {FaultKind::flag, "flag", Value::none, true, "flag[:CHANNEL]        valid bit 0"},
    {FaultKind::duplicate, "duplicate", Value::rate, false,
     "duplicate=RATE        share of frames sent twice"},
    {FaultKind::reorder, "reorder", Value::rate, false,
     "reorder=RATE          share of frames that swap with the next"},
    {FaultKind::shorten, "shorten", Value::rate, false,
     "shorten=RATE          share of frames cut to 3 bytes"},
    {FaultKind::bus_silent, "bus-silent", Value::seconds, false,
     "bus-silent[=S]        no frames, for S seconds"},
    {FaultKind::modbus_silent, "modbus-silent", Value::seconds, false,
     "modbus-silent[=S]     no answers over Modbus, for S seconds"},
    {FaultKind::modbus_wrong, "modbus-wrong", Value::word, false,
     "modbus-wrong[=exception|value]  server failure, or wrong register values"},
    {FaultKind::estop, "estop", Value::none, false,
     "estop                 emergency-stop chain open"},
    {FaultKind::loop_open, "loop-open", Value::none, false,
     "loop-open             stabilisation loop reported open"},
    {FaultKind::platform_fault, "platform-fault", Value::none, false,
     "platform-fault        fault bit of the platform"},
    {FaultKind::spike, "spike", Value::degrees, true,
     "spike[:CHANNEL]=DEG,RATE  angles jump for one sample"},
    {FaultKind::gyro_noise, "gyro-noise", Value::factor, false,
     "gyro-noise=FACTOR     the gyros' random walk is FACTOR times as large"},
    {FaultKind::sync_growth, "sync-growth", Value::factor_at, false,
     "sync-growth=FACTOR[,HZ]  rocking in step with the vibration is FACTOR times the truth's,\n"
     "                        where HZ is given at that frequency of the table alone"},
    {FaultKind::cross_growth, "cross-growth", Value::factor_at, false,
     "cross-growth=FACTOR[,HZ]  the same of the vibration across the vertical"},
    {FaultKind::distorted, "distorted", Value::share_at, false,
     "distorted=SHARE[,HZ]  the table's second harmonic, from its next change of frequency on"},
    {FaultKind::ack_without_stop, "ack-without-stop", Value::none, false,
     "ack-without-stop      run = 0 is acknowledged and read back, the table shakes on and the\n"
     "                        measured amplitude says so; the watchdog still works"},
    {FaultKind::timeout_ignored, "timeout-ignored", Value::none, false,
     "timeout-ignored       the watchdog never fires"},
    {FaultKind::timeout_scaled, "timeout-scaled", Value::factor, false,
     "timeout-scaled=FACTOR  the watchdog fires after FACTOR times its timeout"},
    {FaultKind::timeout_if_linked, "timeout-if-linked", Value::none, false,
     "timeout-if-linked     the watchdog's time passes only while somebody is connected"},
    {FaultKind::timeout_if_unlinked, "timeout-if-unlinked", Value::none, false,
     "timeout-if-unlinked   the watchdog's time passes only while nobody is connected"},
    {FaultKind::estop_contact_only, "estop-contact-only", Value::none, false,
     "estop-contact-only    the open emergency-stop chain is shown, and cuts nothing"},
    {FaultKind::estop_unseen, "estop-unseen", Value::none, false,
     "estop-unseen          the open chain cuts the power, its register shows it closed"},
    {FaultKind::estop_restarts, "estop-restarts", Value::none, false,
     "estop-restarts        once the chain is closed again the controller runs as before"},
    {FaultKind::other_device, "other-device", Value::none, false,
     "other-device          asked who it is (function 17) it names another controller"},
    {FaultKind::amplitude_scaled, "amplitude-scaled", Value::factor, false,
     "amplitude-scaled=FACTOR  the table does FACTOR times the set-point, read back as ordered"},
    {FaultKind::readback_echo, "readback-echo", Value::none, false,
     "readback-echo         the measured amplitude is the set-point (0 with run = 0), whatever "
     "the\n"
     "                        table does"},
    {FaultKind::stuck_contactor, "stuck-contactor", Value::none, false,
     "stuck-contactor       after a stop state idle, amplitude 0; the table shakes on as before"},
    {FaultKind::slow_ramp, "slow-ramp", Value::slowness, false,
     "slow-ramp=FACTOR      ramps take FACTOR times as long, stops and watchdog included"},
    {FaultKind::unit_rms, "unit-rms", Value::none, false,
     "unit-rms              amplitudes are taken and read back as rms"},
    {FaultKind::unit_mps2, "unit-mps2", Value::none, false,
     "unit-mps2             amplitudes are taken and read back as m/s^2 peak"},
    {FaultKind::dead_table, "dead-table", Value::none, false,
     "dead-table            the table does not move, measured amplitude 0 (but readback-echo)"},
    {FaultKind::frequency_ignored, "frequency-ignored", Value::none, false,
     "frequency-ignored     another frequency is taken and read back, the table keeps the old one"},
    {FaultKind::wrong_profile, "wrong-profile", Value::whole, false,
     "wrong-profile=NUMBER  random: this profile is loaded, whatever number is written and read "
     "back"},
    {FaultKind::profile_level_wrong, "profile-level-wrong", Value::decibels, false,
     "profile-level-wrong=DB  random: the table does so much more than is commanded and read back"},
    {FaultKind::no_abort_bands, "no-abort-bands", Value::none, false,
     "no-abort-bands        random: the controller has none, and its control_state says so"},
    {FaultKind::profile_tilted, "profile-tilted", Value::decibels, false,
     "profile-tilted=DB     random: the table plays so much more with each octave, at the same "
     "rms"},
    {FaultKind::psd_stale, "psd-stale", Value::none, false,
     "psd-stale             random: the measured PSD stays what it was"},
    {FaultKind::psd_nan, "psd-nan", Value::none, false,
     "psd-nan               random: a line of the measured PSD is no number"},
    {FaultKind::psd_scaled, "psd-scaled", Value::factor, false,
     "psd-scaled=FACTOR     random: the measured PSD is so many times what it was"},
    {FaultKind::psd_refused, "psd-refused", Value::none, false,
     "psd-refused           random: the measured PSD cannot be read (exception 4)"},
    {FaultKind::sweep_rate_scaled, "sweep-rate-scaled", Value::either_way, false,
     "sweep-rate-scaled=FACTOR  sweeps go so many times as fast as is commanded; 0: not at all, "
     "below "
     "0:\n"
     "                        the other way"},
    {FaultKind::actual_as_told, "actual-as-told", Value::none, false,
     "actual-as-told        the register of the actual frequency shows the sweep that is "
     "commanded"},
    {FaultKind::timeout_register, "timeout-register", Value::whole, false,
     "timeout-register=MS   another master keeps this in the watchdog's timeout register; 0: off"},
    {FaultKind::latched_fault, "latched-fault", Value::none, false,
     "latched-fault         the controller trips by itself, latched until run = 0 at rest"},
}};

constexpr std::array<std::string_view, kChannels> kChannelNames{"outer", "inner", "azimuth",
                                                                "x",     "y",     "z"};

[[noreturn]] void fail(std::string_view spec, const std::string& what) {
    throw PlantError("fault \"" + proto::printable(spec) + "\": " + what);
}

double number(std::string_view spec, std::string_view text, const char* what, double low,
              double high) {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value) ||
        value < low || value > high) {
        fail(spec, "found \"" + proto::printable(text) + "\", expected " + what);
    }
    return value;
}

const Description& describe(std::string_view spec, std::string_view name) {
    if (name == "nan") name = "out-of-range";
    std::string hyphens(name);
    std::replace(hyphens.begin(), hyphens.end(), '_', '-');
    std::string names;
    for (const Description& d : kDescriptions) {
        if (d.name == hyphens) return d;
        names += (names.empty() ? "" : ", ") + std::string(d.name);
    }
    fail(spec, "unknown fault \"" + proto::printable(name) + "\", expected one of " + names);
}

// Cuts off and returns what follows the first `mark`, if there is one.
std::optional<std::string_view> cut(std::string_view& text, std::string_view mark) {
    const auto at = text.find(mark);
    if (at == std::string_view::npos) return std::nullopt;
    const std::string_view rest = text.substr(at + mark.size());
    text = text.substr(0, at);
    return rest;
}

void read_value(std::string_view spec, const Description& d, std::string_view text, Fault& fault) {
    std::string_view first = text;
    const auto second = cut(first, ",");
    if (second && (d.value == Value::milliseconds || d.value == Value::degrees)) {
        fault.rate = number(spec, *second, "a rate from 0 to 1", 0, 1);
    } else if (second && (d.value == Value::factor_at || d.value == Value::share_at)) {
        fault.hz = number(spec, *second, "a frequency from 0.1 to 2000 Hz", 0.1, 2000);
    } else if (second) {
        fail(spec, "found \"," + proto::printable(*second) + "\", expected one value");
    }
    switch (d.value) {
        case Value::none:
            fail(spec, std::string(d.name) + " takes no value");
        case Value::rate:
            fault.value = number(spec, first, "a rate from 0 to 1", 0, 1);
            break;
        case Value::milliseconds:
            fault.value = number(spec, first, "milliseconds from 0 to 1e6", 0, 1e6);
            break;
        case Value::degrees:
            fault.value = number(spec, first, "degrees from -360 to 360", -360, 360);
            break;
        case Value::seconds:
            if (std::isfinite(fault.to_s))
                fail(spec, "found two ends, expected one end: =S or ..TO");
            fault.to_s = fault.from_s + number(spec, first, "seconds from 0 to 1e9", 0, 1e9);
            break;
        case Value::share_at:
            fault.value = number(spec, first, "a share from 0 to 0.5", 0, 0.5);
            break;
        case Value::factor_at:
        case Value::factor:
            fault.value = number(spec, first, "a factor from 0 to 1000", 0, 1000);
            break;
        case Value::slowness:
            fault.value = number(spec, first, "a factor from 1 to 1000", 1, 1000);
            break;
        case Value::either_way:
            fault.value = number(spec, first, "a factor from -20 to 20", -20, 20);
            break;
        case Value::decibels:
            fault.value = number(spec, first, "decibels from -60 to 20", -60, 20);
            break;
        case Value::whole:
            fault.value = number(spec, first, "a whole number from 0 to 65535", 0, 65535);
            if (fault.value != std::floor(fault.value))
                fail(spec, "found \"" + std::string(first) +
                               "\", expected a whole number from 0 to 65535");
            break;
        case Value::word:
            if (first != "exception" && first != "value") {
                fail(spec,
                     "found \"" + proto::printable(first) + "\", expected exception or value");
            }
            fault.value = first == "value" ? 1 : 0;
            break;
    }
}

}  // namespace

std::string_view name_of(FaultKind kind) noexcept {
    for (const Description& d : kDescriptions) {
        if (d.kind == kind) return d.name;
    }
    return "?";
}

std::string fault_help() {
    std::string text =
        "Faults: NAME[:CHANNEL][=VALUE][@FROM[..TO]], times in simulated seconds;\n"
        "channels outer, inner, azimuth, x, y, z; without one: all that apply. Names may have _ "
        "for "
        "-.\n";
    for (const Description& d : kDescriptions) text += std::string("  ") + d.help + "\n";
    return text;
}

Fault parse_fault(std::string_view spec, double now_s) {
    std::string_view rest = spec;
    Fault fault;
    fault.from_s = now_s;
    if (auto times = cut(rest, "@")) {
        const auto to = cut(*times, "..");
        fault.from_s = number(spec, *times, "a time in seconds, as in @100..200", 0, 1e9);
        if (to)
            fault.to_s = number(spec, *to, "a time in seconds after the first",
                                std::nextafter(fault.from_s, 1e9), 1e9);
    }
    // "lose:0.01" is understood like "lose=0.01": only what is no channel can be a value.
    auto value = cut(rest, "=");
    auto channel = cut(rest, ":");
    const Description& d = describe(spec, rest);
    fault.kind = d.kind;
    if (channel && !d.channel && !value) std::swap(channel, value);
    if (channel) {
        for (std::size_t i = 0; i < kChannels; ++i) {
            if (kChannelNames[i] == *channel) fault.channel = i;
        }
        if (!d.channel || !fault.channel || (d.kind == FaultKind::spike && *fault.channel > 2)) {
            fail(spec, "found channel \"" + proto::printable(*channel) + "\", expected " +
                           (!d.channel                   ? "none"
                            : d.kind == FaultKind::spike ? "outer, inner or azimuth"
                                                         : "outer, inner, azimuth, x, y or z"));
        }
    }
    if (value) {
        read_value(spec, d, *value, fault);
    } else if (d.value != Value::none && d.value != Value::seconds && d.value != Value::word) {
        fail(spec, "no value, expected " + std::string(d.help));
    }
    return fault;
}

void Faults::clear(std::string_view name) {
    if (name.empty()) {
        faults_.clear();
        return;
    }
    const FaultKind kind = describe(name, name).kind;
    std::erase_if(faults_, [kind](const Fault& fault) { return fault.kind == kind; });
}

}  // namespace vibrig::plant
