#include "tests/plant/recording.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>
#include <ostream>
#include <sstream>

#include "proto/open_end.hpp"
#include "proto/register_map.hpp"
#include "proto/text.hpp"
#include "tests/plant/input_file.hpp"
#include "tests/plant/rig.hpp"

namespace vibrig::plant {
namespace {

std::vector<std::string> split(const std::string& line) {
    std::vector<std::string> fields;
    std::istringstream in(line);
    std::string field;
    while (std::getline(in, field, ',')) {
        const auto begin = field.find_first_not_of(" \t\r");
        const auto end = field.find_last_not_of(" \t\r");
        fields.push_back(begin == std::string::npos ? "" : field.substr(begin, end - begin + 1));
    }
    return fields;
}

void set_shaker(ShakerController& shaker, const proto::Register& reg, double value) {
    const auto raw = static_cast<std::uint32_t>(std::llround(value / reg.scale));
    const std::array<std::uint16_t, 2> both{static_cast<std::uint16_t>(raw >> 16),
                                            static_cast<std::uint16_t>(raw)};
    const bool wide = reg.type == proto::RegisterType::u32;
    const std::span<const std::uint16_t> words =
        wide ? std::span(both) : std::span(both).subspan(1);
    if (shaker.write(reg.address, words) != ShakerController::Answer::accepted) {
        throw PlantError("shaker refuses " + std::to_string(value) + " in register " +
                         std::to_string(reg.address));
    }
}

proto::Register holding(std::size_t address, proto::RegisterType type, double scale) {
    proto::Register reg;
    reg.address = static_cast<std::uint16_t>(address);
    reg.type = type;
    reg.scale = scale;
    return reg;
}

/// Of a run under random vibration about its profile, as the controller's register has it, dB.
double level_db(const Truth& truth, const CampaignPlan& plan, std::size_t run) {
    const auto profile =
        std::ranges::find(truth.profiles, plan.profile_of(run), &ShakerProfile::number);
    if (profile == truth.profiles.end()) return 0;
    return std::round(200 * std::log10(plan.table_g[run - 1] / profile->rms_g())) / 10;
}

/// It takes what a dwell lasts after the shaker has waited, less two seconds at its end.
void choose_sweep(Rig& rig, const CampaignPlan& plan, const std::array<double, 2>& hz) {
    using proto::RegisterType;
    const double waits_s = ShakerController::kSweepRests_s - plan.settle_s;
    const double seconds = plan.dwell_s - std::max(0.0, waits_s) - 2;
    if (!(seconds > 0))
        throw PlantError("--dwell: found " + std::to_string(plan.dwell_s) +
                         " s, expected more for a sweep: it begins " + std::to_string(waits_s) +
                         " s after the beginning and ends 2 s before the end");
    const double rate = 60 * std::abs(std::log2(hz[1] / hz[0])) / seconds;
    const auto hertz = [](std::size_t at) { return holding(at, RegisterType::u32, 1e-3); };
    set_shaker(rig.shaker(), hertz(ShakerController::kSweepFrom), hz[0]);
    set_shaker(rig.shaker(), hertz(ShakerController::kSweepTo), hz[1]);
    set_shaker(rig.shaker(), holding(ShakerController::kSweepRate, RegisterType::u16, 0.01), rate);
    set_shaker(rig.shaker(), holding(ShakerController::kMode, RegisterType::u16, 1), 2);
}

/// At rest: the kind of vibration of a run, and for random vibration its rms.
void choose_vibration(Rig& rig, const CampaignPlan& plan, std::size_t run) {
    if (plan.profile.empty() && plan.sweep.empty()) return;
    using proto::RegisterType;
    const auto mode = holding(ShakerController::kMode, RegisterType::u16, 1);
    if (const auto hz = plan.sweep_of(run); hz[0] > 0) return choose_sweep(rig, plan, hz);
    const auto number = holding(ShakerController::kProfileNumber, RegisterType::u16, 1);
    const auto level = holding(ShakerController::kProfileLevel, RegisterType::i16, 0.1);
    const std::uint16_t chosen = plan.profile_of(run);
    set_shaker(rig.shaker(), mode, 0);
    if (chosen == 0) return;
    set_shaker(rig.shaker(), number, chosen);
    set_shaker(rig.shaker(), level, level_db(rig.truth(), plan, run));
    set_shaker(rig.shaker(), mode, 1);
}

// Slews with the shaker at rest, then ramps it up and waits until the isolators have rung down.
void prepare(Rig& rig, const CampaignPlan& plan, const Vec3& position, std::size_t run) {
    const double table_g = plan.table_g[run - 1];
    const proto::ShakerRegisters map;
    const auto wait_until = [&rig](auto done) {
        while (!done()) rig.advance();
    };
    const auto wait = [&rig](double seconds) {
        const std::int64_t end = rig.time_us() + std::llround(1e6 * seconds);
        while (rig.time_us() < end) rig.advance();
    };
    set_shaker(rig.shaker(), map.run, 0);
    wait_until([&] { return rig.shaker().at_rest(); });
    rig.slew_to(position);
    wait_until([&] { return rig.gimbals().in_position(); });
    rig.release();
    choose_vibration(rig, plan, run);
    set_shaker(rig.shaker(), map.frequency, plan.hz_of(run));
    set_shaker(rig.shaker(), map.ramp_time, plan.ramp_s);
    set_shaker(rig.shaker(), map.amplitude, table_g);
    if (table_g > 0) {
        set_shaker(rig.shaker(), map.run, 1);
        wait(plan.ramp_s);
        if (rig.shaker().state() == ShakerState::fault) {
            throw PlantError("shaker tripped on the way to " + std::to_string(table_g) +
                             " g (fault bits " + std::to_string(rig.shaker().faults()) + ")");
        }
    }
    wait(plan.settle_s);
}

}  // namespace

std::vector<Vec3> CampaignPlan::table1() {
    return {{0, 0, 0},   {0, 0, 45},   {0, 0, 90},  {0, 0, 180},  {180, 0, 45},
            {45, 0, 0},  {45, 0, 90},  {90, 0, 90}, {90, 0, 180}, {180, 0, 270},
            {270, 0, 0}, {270, 0, 90}, {-45, 0, 0}, {-45, 0, 90}};
}

std::vector<Vec3> read_positions(const std::string& name) {
    if (name == "table1") return CampaignPlan::table1();
    std::istringstream in(read_input(name, "\"table1\" or a CSV file of positions"));
    const std::array<const char*, 3> names{"alpha_deg", "beta_deg", "gamma_deg"};
    std::array<std::optional<std::size_t>, 3> column;
    std::vector<Vec3> positions;
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
        const std::vector<std::string> fields = split(line);
        if (fields.empty() || (fields.size() == 1 && fields[0].empty())) continue;
        const std::string place = name + ":" + std::to_string(number) + ": ";
        if (in.eof()) proto::tell_open_end(name + ":" + std::to_string(number), fields.back());
        if (!column[0]) {
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t c = 0; c < fields.size(); ++c) {
                    if (!proto::same_name(fields[c], names[i])) continue;
                    if (column[i])
                        throw PlantError(place + "found column " + names[i] +
                                         " twice, expected it once");
                    column[i] = c;
                }
                if (!column[i])
                    throw PlantError(place + "no column " + names[i] + " in the header");
            }
            continue;
        }
        Vec3 position{};
        for (std::size_t i = 0; i < 3; ++i) {
            const std::string text = *column[i] < fields.size() ? fields[*column[i]] : "";
            std::size_t used = 0;
            try {
                position[i] = std::stod(text, &used);
            } catch (const std::exception&) {
                used = 0;
            }
            if (used == 0 || used != text.size() || !(std::abs(position[i]) <= 360)) {
                throw PlantError(place + names[i] + ": found \"" + text +
                                 "\", expected an angle from -360 to 360");
            }
        }
        if (std::abs(std::remainder(position[1], 360.0)) > 80) {
            throw PlantError(place + "beta_deg: found " + std::to_string(position[1]) +
                             ", expected at most 80: beyond it the gimbals lock");
        }
        positions.push_back(position);
    }
    if (positions.empty())
        throw PlantError(name + ": no positions, expected a header and at least one row");
    return positions;
}

std::uint64_t simulate(const Truth& truth, const CampaignPlan& plan,
                       const std::function<void(const PlannedSample&)>& sink,
                       const std::function<void(std::size_t, std::size_t)>& progress) {
    if (plan.frequency_hz.size() != 1 && plan.frequency_hz.size() != plan.table_g.size())
        throw PlantError("--frequency: found " + std::to_string(plan.frequency_hz.size()) +
                         " frequencies, expected one, or one for each of " +
                         std::to_string(plan.table_g.size()) + " levels");
    if (!plan.profile.empty() && plan.profile.size() != plan.table_g.size())
        throw PlantError("--profile: found " + std::to_string(plan.profile.size()) +
                         " numbers, expected one for each of " +
                         std::to_string(plan.table_g.size()) + " levels");
    if (!plan.sweep.empty() && plan.sweep.size() != plan.table_g.size())
        throw PlantError("--sweep: found " + std::to_string(plan.sweep.size()) +
                         " sweeps, expected one for each of " +
                         std::to_string(plan.table_g.size()) + " levels");
    Rig rig(truth);
    std::uint64_t samples = 0;
    std::size_t dwell = 0;
    const auto ticks = static_cast<std::int64_t>(
        std::llround(plan.dwell_s * 1e6 / static_cast<double>(rig.tick_us())));
    auto order = plan.order;
    if (order.empty()) {
        for (std::size_t run = 1; run <= plan.table_g.size(); ++run) {
            for (std::size_t p = 1; p <= plan.positions_deg.size(); ++p) order.emplace_back(run, p);
        }
    }
    for (const auto& [run, position] : order) {
        if (run < 1 || run > plan.table_g.size() || position < 1 ||
            position > plan.positions_deg.size()) {
            throw PlantError("order: found position " + std::to_string(position) + " in run " +
                             std::to_string(run) + ", expected up to " +
                             std::to_string(plan.positions_deg.size()) + " and " +
                             std::to_string(plan.table_g.size()));
        }
        prepare(rig, plan, plan.positions_deg[position - 1], run);
        for (std::int64_t i = 0; i < ticks; ++i) {
            rig.advance();
            sink({run, position, 1e-6 * static_cast<double>(rig.time_us()), rig.readings(),
                  rig.shaker().sweeps() ? rig.shaker().table_hz() : 0, rig.drift().coefficients()});
            ++samples;
        }
        if (progress) progress(++dwell, order.size());
    }
    return samples;
}

std::vector<std::pair<std::size_t, std::size_t>> parse_order(const std::string& text) {
    std::vector<std::pair<std::size_t, std::size_t>> order;
    for (const std::string& field : split(text)) {
        unsigned position = 0;
        unsigned run = 0;
        int used = 0;
        if (std::sscanf(field.c_str(), "%4u.%4u%n", &position, &run, &used) != 2 ||
            static_cast<std::size_t>(used) != field.size()) {
            throw PlantError("order: found \"" + field +
                             "\", expected POSITION.RUN, as in 9.1,11.2,5.1");
        }
        order.emplace_back(run, position);
    }
    return order;
}

std::array<double, 2> parse_sweep(const std::string& text) {
    if (text == "-") return {};
    std::array<double, 2> hz{};
    int used = 0;
    const auto may_be = [](double f) { return f >= 1 && f <= 200; };
    if (std::sscanf(text.c_str(), "%lf:%lf%n", &hz[0], &hz[1], &used) != 2 ||
        static_cast<std::size_t>(used) != text.size() || !may_be(hz[0]) || !may_be(hz[1]) ||
        hz[0] == hz[1])
        throw PlantError("--sweep: found \"" + text +
                         "\", expected two frequencies from 1 to 200 Hz, as in 20:120, or -");
    return hz;
}

std::uint64_t record(const Truth& truth, const CampaignPlan& plan, std::ostream& out,
                     std::array<GyroCoefficients, 3>* mean,
                     const std::function<void(std::size_t, std::size_t)>& progress) {
    const bool random = !plan.profile.empty();
    const bool several = plan.frequency_hz.size() > 1 || random || !plan.sweep.empty();
    out << "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g"
        << (several ? ",frequency_hz" : "") << (random ? ",profile,level_db" : "")
        << ",simulated\n";
    std::array<GyroCoefficients, 3> sum{};
    const auto write = [&](const PlannedSample& s) {
        std::array<char, 400> row{};
        char* at = row.data();
        char* const end = row.data() + row.size();
        const auto fixed = [&](double value, int digits, char mark) {
            at = std::to_chars(at, end, value, std::chars_format::fixed, digits).ptr;
            *at++ = mark;
        };
        fixed(s.time_s, 6, ',');
        for (const std::size_t whole : {s.run, s.position}) {
            at = std::to_chars(at, end, whole).ptr;
            *at++ = ',';
        }
        for (const double angle : s.readings.encoder_deg) fixed(angle, 7, ',');
        for (const double force : s.readings.raw_g) fixed(force, 7, ',');
        const bool sine = plan.table_g[s.run - 1] > 0 && plan.profile_of(s.run) == 0;
        if (several) fixed(s.hz > 0 ? s.hz : (sine ? plan.hz_of(s.run) : 0), 4, ',');
        if (random) {
            at = std::to_chars(at, end, plan.profile_of(s.run)).ptr;
            *at++ = ',';
            fixed(level_db(truth, plan, s.run), 1, ',');
        }
        *at++ = '1';
        *at++ = '\n';
        out.write(row.data(), at - row.data());
        for (std::size_t g = 0; g < 3; ++g) {
            for (std::size_t t = 0; t < kTerms; ++t) sum[g][t] += s.coefficients[g][t];
        }
    };
    const std::uint64_t samples = simulate(truth, plan, write, progress);
    if (mean != nullptr) {
        for (std::size_t g = 0; g < 3; ++g) {
            for (std::size_t t = 0; t < kTerms; ++t)
                (*mean)[g][t] = sum[g][t] / static_cast<double>(samples);
        }
    }
    return samples;
}

}  // namespace vibrig::plant
