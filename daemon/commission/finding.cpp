#include "daemon/commission/finding.hpp"

#include <spdlog/fmt/fmt.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <map>

#include "estimator/commissioning/earth.hpp"

namespace vibrig::commission {

namespace room = estimator::commissioning;

namespace {

constexpr double kRatioTolerance = 0.02;

const room::AngleUnit& unit_of(const room::Description& d, std::size_t gimbal) {
    return room::angle_units()[static_cast<std::size_t>(d.unit[gimbal])];
}

std::string row_of(double x, double y, double z, int digits) {
    // -0.00000 is nobody's value
    const double dust = 0.5 * std::pow(10.0, -digits);
    const auto clean = [dust](double v) { return std::abs(v) < dust ? 0.0 : v; };
    return fmt::format("[{1:.{0}f}, {2:.{0}f}, {3:.{0}f}]", digits, clean(x), clean(y), clean(z));
}

void name_channels(Finding& f, const room::Description& d, const Names& names) {
    for (std::size_t g = 0; g < 3; ++g) {
        const auto channel = static_cast<std::size_t>(d.channel[g]);
        if (channel != g)
            f.keys.push_back({std::string("can.signals.") + kGimbalNames[g],
                              "\"" + names.angle[channel] + "\"", "moves, gravity"});
    }
}

void correct_dbc(Finding& f, const room::Description& d, const Names& names,
                 const Commanded& commanded) {
    for (std::size_t g = 0; g < 3; ++g) {
        const auto channel = static_cast<std::size_t>(d.channel[g]);
        const auto& unit = unit_of(d, g);
        if (unit.degrees != 1)
            f.corrections.push_back(
                fmt::format("{} counts in {}, expected deg: multiply its factor by {:.9g}",
                            names.angle[channel], unit.name, unit.degrees));
        if (!commanded.known) continue;
        if (const auto slot = commanded.slot[channel]; slot != g)
            f.corrections.push_back(fmt::format(
                "{}: its {} command moves the {} gimbal, expected "
                "the {} one: exchange the signals' names",
                names.command, kGimbalNames[slot], kGimbalNames[g], kGimbalNames[slot]));
        const double turn = commanded.ratio[channel] * unit.degrees;  // deg of the gimbal per deg
        if (std::abs(turn - 1) > kRatioTolerance)
            f.corrections.push_back(fmt::format(
                "{}, of the {} gimbal: 1 deg commanded moves its reading by {:.4g} deg, expected "
                "1: {}",
                names.command, kGimbalNames[g], turn,
                std::abs(turn + 1) <= kRatioTolerance ? "negate its factor" : "mend its factor"));
    }
}

}  // namespace

bool number_in(const std::string& text, double low, double high, double& value) {
    try {
        std::size_t used = 0;
        value = std::stod(text, &used);
        return used == text.size() && value >= low && value <= high;
    } catch (const std::exception&) {
        return false;
    }
}

const char* name_of(Finding::Outcome outcome) noexcept {
    constexpr std::array kNames{"unfinished", "decided", "undecided", "refused"};
    return kNames[static_cast<std::size_t>(outcome)];
}

Json hypotheses_of(const room::GravityFinding& gravity) {
    constexpr std::size_t kMost = 5;
    Json all = Json::array();
    for (const auto& h : gravity.hypotheses) {
        if (all.size() == kMost) break;
        Json assignment = Json::array(), units = Json::array();
        std::array<const char*, 3> of_channel{};
        for (std::size_t g = 0; g < 3; ++g) {
            of_channel[static_cast<std::size_t>(h.best.channel[g])] = kGimbalNames[g];
            units.push_back(unit_of(h.best, g).name);
        }
        for (const char* name : of_channel) assignment.push_back(name);
        all.push_back({{"assignment", assignment},
                       {"sign_product", h.sign_product()},
                       {"units", units},
                       {"rms_mg", 1e3 * h.rms_g},
                       {"ln_ratio", h.ln_ratio}});
    }
    return all;
}

void fill_keys(Finding& f, const room::Description& d, const room::EarthRate& rate,
               const Names& names, const room::Statements& said, const Commanded& commanded) {
    const std::string by_gravity = fmt::format(
        "ln LR {:.0f} over next, {} positions, rms {:.2f} mg", f.evidence.value("ln_ratio", 0.0),
        f.evidence.value("positions", 0), f.evidence.value("rms_mg", 0.0));
    name_channels(f, d, names);
    correct_dbc(f, d, names, commanded);
    f.keys.push_back({"platform.up", "\"+y\"", "convention, with the outer axis level"});
    f.keys.push_back({"platform.encoder_sign",
                      fmt::format("[{}, {}, {}]", d.sign[0], d.sign[1], d.sign[2]), by_gravity});
    f.keys.push_back({"platform.encoder_zero_deg",
                      row_of(d.zero_deg[0], d.zero_deg[1], d.zero_deg[2], 3),
                      "+- 0.03; the azimuth zero to 10' by the accelerometers"});
    const Eigen::Matrix3d m = d.accelerometers.inverse();
    const auto row = [&m](int i) { return row_of(m(i, 0), m(i, 1), m(i, 2), 4); };
    f.keys.push_back(
        {"accelerometer.matrix", "[" + row(0) + ", " + row(1) + ", " + row(2) + "]", by_gravity});
    f.keys.push_back(
        {"accelerometer.zero_g", row_of(d.zero_g[0], d.zero_g[1], d.zero_g[2], 5), by_gravity});
    f.keys.push_back({"site.elevation_deg", fmt::format("{:.3f}", d.elevation_deg), "+- 0.02"});
    f.keys.push_back(
        {"site.azimuth_deg", fmt::format("{:.2f}", rate.azimuth_deg()),
         fmt::format("Earth rate north {:.2f} east {:.2f} deg/h", rate.neu[0], rate.neu[1])});
    if (said.latitude_deg)
        f.keys.push_back({"site.latitude_deg", fmt::format("{:.6g}", *said.latitude_deg),
                          fmt::format("stated; measured {:.2f} +- {:.2f}, either hemisphere",
                                      rate.latitude_deg(), rate.latitude_sigma_deg())});
    if (commanded.known) {
        std::string travel;
        bool limited = false;
        for (std::size_t g = 0; g < 3; ++g) {
            const auto channel = static_cast<std::size_t>(d.channel[g]);
            const bool free = commanded.free[channel];
            // Readings in degrees: the file of a bus that counts otherwise is corrected.
            const double degrees = unit_of(d, g).degrees;
            const auto [from, to] = commanded.travel[channel];
            // Of the ranges that are whole turns apart the one about zero: a key takes a turn.
            const double turns = free ? 0 : std::round(degrees * (from + to) / 2 / 360);
            const double low = free ? -360 : degrees * from - 360 * turns;
            const double high = free ? 360 : degrees * to - 360 * turns;
            limited = limited || high - low < 360;
            travel += fmt::format("{}[{:.1f}, {:.1f}]", g == 0 ? "" : ", ", low, high);
        }
        if (limited)
            f.keys.push_back({"gimbal.travel_deg", "[" + travel + "]",
                              commanded.met_a_stop
                                  ? "as stated at the start, less where a gimbal met a stop"
                                  : "as stated at the start"});
    }
    f.sigma = {{"site.azimuth_deg", 57.3 * std::max(rate.sigma[0], rate.sigma[1]) /
                                        std::max(rate.neu.head<2>().norm(), 1e-3)},
               {"site.latitude_deg", rate.latitude_sigma_deg()},
               {"site.elevation_deg", 0.02},
               {"platform.encoder_zero_deg", {0.03, 0.03, 0.17}}};
}

void fill_bus_keys(Finding& f, const Names& names, double measured_hz) {
    const auto found = [&f](const std::string& key) {
        return std::ranges::find(f.keys, key, &FoundKey::key) != f.keys.end();
    };
    const auto add = [&](const std::string& key, const std::string& value, const char* evidence) {
        if (!value.empty() && !found(key)) f.keys.push_back({key, value, evidence});
    };
    if (names.dbc != "\"\"") add("can.dbc", names.dbc, "as it was measured with");
    constexpr std::array kAccelerometers{"x", "y", "z"};
    for (std::size_t i = 0; i < 3; ++i) {
        add(std::string("can.signals.") + kGimbalNames[i], "\"" + names.angle[i] + "\"",
            "moves, gravity");
        add(std::string("can.signals.accel_") + kAccelerometers[i], "\"" + names.force[i] + "\"",
            "gravity; accelerometer.matrix says along which axis");
    }
    if (measured_hz > 0)
        add("can.sample_rate_hz", names.sample_rate,
            fmt::format("{:.2f} samples/s by the kernel's stamps", measured_hz).c_str());
}

std::string to_toml(const Finding& f, bool simulated) {
    const std::string mark = simulated ? "SIMULATED: " : "";
    std::map<std::string, std::string> tables;
    for (const auto& key : f.keys) {
        const auto dot = key.key.rfind('.');
        tables[key.key.substr(0, dot)] += fmt::format("# {}{}\n{} = {}\n", mark, key.evidence,
                                                      key.key.substr(dot + 1), key.value);
    }
    std::string text = fmt::format("# {}as vibrig commission found it; not accepted yet\n", mark);
    for (const auto& [name, rows] : tables) text += fmt::format("\n[{}]\n{}", name, rows);
    return text;
}

Json to_json(const Finding& f) {
    Json found = Json::object(), evidence = Json::object();
    for (const auto& key : f.keys) {
        // TOML's and JSON's forms of these are the same
        found[key.key] = Json::parse(key.value, nullptr, false);
        evidence[key.key] = key.evidence;
    }
    return {{"outcome", name_of(f.outcome)},
            {"why", f.why},
            {"suspects", f.suspects},
            {"second_person", f.second_person},
            {"hypotheses", f.hypotheses},
            {"witnesses", f.witnesses},
            {"would_separate", f.would_separate},
            {"found", found},
            {"found_by", evidence},
            {"corrections", f.corrections},
            {"evidence", f.evidence},
            {"sigma", f.sigma}};
}

}  // namespace vibrig::commission
