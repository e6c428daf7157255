#include "daemon/record/dwells_csv.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/dwells/anew.hpp"
#include "daemon/record/campaign_checks.hpp"
#include "proto/open_end.hpp"
#include "proto/text.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

constexpr std::string_view kRestart = "# restart after dwells: ", kSwept = "# swept: ",
                           kPlayed = "# played: ", kAnew = "# result: ";

/// Columns that are not plain numbers.
enum Column : std::size_t {
    kRun,
    kPosition,
    kFrom = 3,
    kTo,
    kCancelled,
    kOffset,
    kBegin = 15,
    kPowerLost,
    kHeldOut = 18,
    kProfile,
    kColumns = 28
};

struct Number {
    std::size_t column;
    double* value;
    bool negative = true;  ///< it may be
};

std::array<Number, 18> numbers_of(Order& order) {
    auto& walk = order.noise.gyro_random_walk_deg_per_rt_h;
    auto& random = order.random;
    auto& sweep = order.sweep;
    return {{{2, &order.table_g},
             {7, &order.zero_g[0]},
             {8, &order.zero_g[1]},
             {9, &order.zero_g[2]},
             {10, &order.level_sigma_g},
             {11, &order.noise.angle_arcsec},
             {12, &walk[0]},
             {13, &walk[1]},
             {14, &walk[2]},
             {17, &order.frequency_hz, false},
             {20, &random.level_db},
             {21, &random.mean_square_g2},
             {22, &random.bandwidth_hz},
             {23, &random.gain_error},
             {24, &random.highest_hz},
             {25, &sweep.from_hz, false},
             {26, &sweep.to_hz, false},
             {27, &sweep.seconds, false}}};
}

/// JSON has no others: what a controller lies is in the HDF5 file.
std::vector<std::array<double, 2>> finite_only(const std::vector<std::array<double, 2>>& lines) {
    const bool finite = std::ranges::all_of(
        lines, [](const auto& line) { return std::isfinite(line[0]) && std::isfinite(line[1]); });
    return finite ? lines : std::vector<std::array<double, 2>>{};
}

std::string comment(std::string_view what, const std::string& text) {
    return fmt::format("{}{}\n", what, text);
}

[[noreturn]] void refuse(const std::string& place, const std::string& found,
                         const std::string& expected) {
    throw std::runtime_error(place + ": found '" + proto::printable(found.substr(0, 80)) +
                             "', expected " + expected);
}

std::vector<std::string> fields_of(const std::string& line) {
    std::vector<std::string> fields(1);
    for (const char c : line) {
        if (c == ',') {
            fields.emplace_back();
        } else if (c != '\r') {
            fields.back() += c;
        }
    }
    return fields;
}

Time microseconds(const std::string& text, const std::string& place) {
    const auto point = text.find('.');
    std::int64_t whole = 0, part = 0;
    std::string fraction = point == std::string::npos ? "" : text.substr(point + 1);
    fraction.resize(6, '0');
    if (!proto::read_number(std::string_view(text).substr(0, point), whole) ||
        !proto::read_number(std::string_view(fraction), part) || whole < 0 || part < 0 ||
        whole >= kMostUtc / drivers::kSecond)
        refuse(place, text, "seconds such as 1700000000.123456");
    return (whole * 1'000'000 + part) * drivers::kMicrosecond;
}

/// The first `count` dwells stay, with their ends: what came after was done again.
void keep_dwells(Campaign& campaign, std::size_t count) {
    std::size_t kept = 0, dwells = 0;
    while (kept < campaign.orders.size()) {
        if (!campaign.orders[kept].cancel && dwells++ == count) break;
        ++kept;
    }
    campaign.orders.resize(kept);
    campaign.restarted_at = count;
}

/// Into the newest order, which it stands behind.
void read_played(const std::string& text, const std::string& place, Campaign& to) {
    try {
        const auto json = nlohmann::json::parse(text);
        const auto of = std::ranges::find_if(to.orders.rbegin(), to.orders.rend(),
                                             [](const Order& order) { return !order.cancel; });
        if (of == to.orders.rend() || of->run != json.at(0).get<int>() ||
            of->position != json.at(1).get<int>())
            throw std::runtime_error(place + ": found what was played in run " + json.at(0).dump() +
                                     " position " + json.at(1).dump() +
                                     ", expected that of the dwell before it");
        const int word = json.at(2).get<int>();
        using Word = estimator::PlayedRandom::Word;
        of->played = estimator::PlayedRandom{
            word == 0 || word == 1 ? static_cast<Word>(word) : Word::refused,
            {json.at(3).get<double>(), json.at(4).get<double>(), json.at(5).get<double>(),
             json.at(6).get<double>(), of->random.profile, of->random.level_db},
            {json.at(7).get<double>(), json.at(8).get<double>()}};
        for (const auto& line : json.at(9))
            of->psd.push_back({line.at(0).get<double>(), line.at(1).get<double>()});
    } catch (const nlohmann::json::exception& error) {
        refuse(place, text, std::string("what was played as JSON: ") + error.what());
    }
}

/// Times are those of UTC yet.
void read_swept(const std::string& text, const std::string& place, Campaign& to) {
    try {
        const auto json = nlohmann::json::parse(text);
        for (const auto& one : json.at(2)) {
            const auto us = one.at(0).get<std::int64_t>(), ns = one.at(1).get<std::int64_t>();
            if (us < 0 || us >= kMostUtc / drivers::kMicrosecond || std::abs(ns) >= kMostTime)
                refuse(place, text, "times of a sweep");
            to.swept.push_back({us * drivers::kMicrosecond + ns, json.at(0).get<std::int32_t>(),
                                json.at(1).get<std::int32_t>(), one.at(2).get<double>()});
        }
    } catch (const nlohmann::json::exception& error) {
        refuse(place, text, std::string("the frequencies of a sweep as JSON: ") + error.what());
    }
}

/// A line of the file that is no order; false: it is one.
bool read_comment(const std::string& line, const std::string& place, Campaign& to) {
    const auto behind = [&line](std::string_view word) { return line.substr(word.size()); };
    if (line.starts_with(kRestart)) {
        std::size_t count = 0;
        if (!proto::read_number(behind(kRestart), count)) refuse(place, line, "a number of dwells");
        keep_dwells(to, count);
    } else if (line.starts_with(kSwept)) {
        read_swept(behind(kSwept), place, to);
    } else if (line.starts_with(kPlayed)) {
        read_played(behind(kPlayed), place, to);
    } else if (line.starts_with(kAnew)) {
        to.found = dwells::noise_found_in(behind(kAnew));
        if (!to.found) refuse(place, line, "the noise of the result as JSON");
    } else {
        return false;
    }
    return true;
}

/// False: it has not the fields that a header names.
bool read_order(const std::vector<std::string>& fields, Order& order, std::int64_t& offset_us) {
    static constexpr std::array<std::size_t, 6> kWidths{15, 16, 17, 19, 25, kColumns};
    const std::size_t width = fields.size();
    if (std::ranges::find(kWidths, width) == kWidths.end()) return false;
    for (const auto& [column, flag] :
         {std::pair{kPowerLost, &order.power_lost}, std::pair{kHeldOut, &order.held_out}}) {
        if (column >= width) continue;
        *flag = fields[column] == "1";
        if (!*flag && fields[column] != "0") return false;
    }
    for (const auto& [column, value, negative] : numbers_of(order)) {
        if (column >= width) continue;
        if (!proto::read_number(fields[column], *value) || !std::isfinite(*value)) return false;
        if (*value < 0 && !negative) return false;
    }
    if (width > kBegin && !fields[kBegin].empty() &&
        !(proto::read_number(fields[kBegin], order.begin_s) && std::isfinite(order.begin_s)))
        return false;
    return proto::read_number(fields[kRun], order.run) &&
           proto::read_number(fields[kPosition], order.position) &&
           proto::read_number(fields[kOffset], offset_us) &&
           (width <= kProfile || proto::read_number(fields[kProfile], order.random.profile));
}

}  // namespace

std::string order_line(Order order, std::int64_t utc_offset_ns) {
    const auto seconds = [utc_offset_ns](Time time) {
        const std::int64_t us = (time + utc_offset_ns) / drivers::kMicrosecond;
        return fmt::format("{}.{:06d}", us / 1'000'000, us % 1'000'000);
    };
    std::array<std::string, kColumns> fields;
    for (const Number& number : numbers_of(order))
        fields[number.column] = fmt::format("{}", *number.value);
    fields[kRun] = std::to_string(order.run);
    fields[kPosition] = std::to_string(order.position);
    if (order.cancel) {
        fields[kCancelled] = seconds(order.announced);
    } else {
        fields[kFrom] = seconds(order.from);
        fields[kTo] = seconds(order.to);
    }
    fields[kOffset] = std::to_string(utc_offset_ns / drivers::kMicrosecond);
    if (std::isfinite(order.begin_s)) fields[kBegin] = fmt::format("{}", order.begin_s);
    fields[kPowerLost] = order.power_lost ? "1" : "0";
    fields[kHeldOut] = order.held_out ? "1" : "0";
    fields[kProfile] = std::to_string(order.random.profile);
    return fmt::format("{}\n", fmt::join(fields, ","));
}

std::string restart_line(std::size_t dwells) { return comment(kRestart, std::to_string(dwells)); }

std::string swept_line(const Swept& swept, std::int64_t utc_offset_ns) {
    nlohmann::json readings = nlohmann::json::array();
    for (const SweptRow& row : swept)
        readings.push_back({(row.time + utc_offset_ns) / drivers::kMicrosecond,
                            row.time % drivers::kMicrosecond, row.frequency_hz});
    return comment(kSwept, nlohmann::json{swept[0].run, swept[0].position, readings}.dump());
}

std::string played_line(const Played& played) {
    const auto& [word, random, seen, place] = played.random;
    return comment(
        kPlayed, nlohmann::json{played.run, played.position, static_cast<int>(word),
                                random.mean_square_g2, random.bandwidth_hz, random.gain_error,
                                random.highest_hz, seen.share, seen.error, finite_only(played.psd)}
                     .dump());
}

std::string anew_line(const noise::Found& found) {
    return comment(kAnew, dwells::noise_in_json(found));
}

void read_dwells(const std::string& path, Campaign& to) {
    std::ifstream file(path);
    std::string line;
    const std::string header = kDwellsHeader;
    constexpr std::ptrdiff_t kOldest = 14;  // commas, of what recordings had at first
    if (!std::getline(file, line) || (line != header && !header.starts_with(line + ",")) ||
        std::ranges::count(line, ',') < kOldest)
        refuse(path + ":1", line, std::string("the header ") + kDwellsHeader);
    const std::size_t columns = fields_of(line).size();
    for (std::size_t number = 2; std::getline(file, line); ++number) {
        const std::string place = fmt::format("{}:{}", path, number);
        if (line.empty()) continue;
        const auto fields = fields_of(line);
        if (file.eof()) {
            // The recorder ends every line that it writes.
            const auto cut = proto::cut_fields(line.starts_with('#') ? columns : fields.size(),
                                               columns, fields.back(), true);
            if (!cut.empty()) throw std::runtime_error(place + ": " + cut);
            proto::tell_open_end(place, fields.back());
        }
        if (read_comment(line, place, to)) continue;
        Order order;
        std::int64_t offset_us = 0;
        if (!read_order(fields, order, offset_us) ||
            offset_us < -kMostTime / drivers::kMicrosecond ||
            offset_us > kMostUtc / drivers::kMicrosecond)
            refuse(place, line, "the fields that the header names");
        to.head.utc_offset_ns = offset_us * drivers::kMicrosecond;
        order.cancel = !fields[kCancelled].empty();
        if (order.cancel) {
            order.announced = microseconds(fields[kCancelled], place);
        } else {
            order.from = microseconds(fields[kFrom], place);
            order.to = microseconds(fields[kTo], place);
            if (order.to <= order.from)
                throw std::runtime_error(place + ": found an end before the beginning");
            if (order.to - order.from > kLongestDwell)
                refuse(place, line, "a dwell of two days at most");
        }
        to.orders.push_back(order);
    }
    if (to.orders.empty()) throw std::runtime_error(path + ": found no dwell, expected some");
    const auto to_clock = [&](Time& time) {
        time -= to.head.utc_offset_ns;
        if (time < -kMostTime || time > kMostUtc)
            refuse(path, fmt::to_string(time), "ns of the clock that its utc_offset_us is of");
    };
    for (SweptRow& row : to.swept) to_clock(row.time);
    for (Order& order : to.orders) {
        for (Time* time : {&order.announced, &order.from, &order.to})
            if (*time != 0) to_clock(*time);
    }
    place_played(to);
}

}  // namespace vibrig::record
