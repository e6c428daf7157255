#include "tests/plant/recording.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <ostream>
#include <sstream>

#include "proto/register_map.hpp"
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

// Slews with the shaker at rest, then ramps it up and waits until the isolators have rung down.
void prepare(Rig& rig, const CampaignPlan& plan, const Vec3& position, double table_g) {
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
    set_shaker(rig.shaker(), map.frequency, plan.frequency_hz);
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
    std::ifstream in(name);
    if (!in)
        throw PlantError(name + ": cannot be read, expected \"table1\" or a CSV file of positions");
    const std::array<const char*, 3> names{"alpha_deg", "beta_deg", "gamma_deg"};
    std::array<std::optional<std::size_t>, 3> column;
    std::vector<Vec3> positions;
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
        const std::vector<std::string> fields = split(line);
        if (fields.empty() || (fields.size() == 1 && fields[0].empty())) continue;
        const std::string place = name + ":" + std::to_string(number) + ": ";
        if (!column[0]) {
            for (std::size_t i = 0; i < 3; ++i) {
                for (std::size_t c = 0; c < fields.size(); ++c) {
                    if (fields[c] == names[i]) column[i] = c;
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
    Rig rig(truth);
    std::uint64_t samples = 0;
    std::size_t dwell = 0;
    const auto ticks = static_cast<std::int64_t>(
        std::llround(plan.dwell_s * 1e6 / static_cast<double>(rig.tick_us())));
    for (std::size_t run = 0; run < plan.table_g.size(); ++run) {
        for (std::size_t position = 0; position < plan.positions_deg.size(); ++position) {
            prepare(rig, plan, plan.positions_deg[position], plan.table_g[run]);
            for (std::int64_t i = 0; i < ticks; ++i) {
                rig.advance();
                sink({run + 1, position + 1, 1e-6 * static_cast<double>(rig.time_us()),
                      rig.readings()});
                ++samples;
            }
            if (progress) progress(++dwell, plan.table_g.size() * plan.positions_deg.size());
        }
    }
    return samples;
}

std::uint64_t record(const Truth& truth, const CampaignPlan& plan, std::ostream& out,
                     const std::function<void(std::size_t, std::size_t)>& progress) {
    out << "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g\n";
    const auto write = [&out](const PlannedSample& s) {
        const Readings& r = s.readings;
        std::array<char, 200> row{};
        const int length =
            std::snprintf(row.data(), row.size(), "%.6f,%zu,%zu,%.7f,%.7f,%.7f,%.7f,%.7f,%.7f\n",
                          s.time_s, s.run, s.position, r.encoder_deg[0], r.encoder_deg[1],
                          r.encoder_deg[2], r.raw_g[0], r.raw_g[1], r.raw_g[2]);
        out.write(row.data(), length);
    };
    return simulate(truth, plan, write, progress);
}

}  // namespace vibrig::plant
