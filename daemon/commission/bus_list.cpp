#include "daemon/commission/bus_list.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

namespace vibrig::commission {

namespace {

/// "0-3 6".
std::string ranges_of(const std::vector<int>& bytes) {
    std::string text;
    for (std::size_t i = 0; i < bytes.size();) {
        std::size_t end = i;
        while (end + 1 < bytes.size() && bytes[end + 1] == bytes[end] + 1) ++end;
        text += text.empty() ? "" : " ";
        text += end == i ? fmt::format("{}", bytes[i]) : fmt::format("{}-{}", bytes[i], bytes[end]);
        i = end + 1;
    }
    return text.empty() ? "-" : text;
}

double share(std::uint64_t part, std::uint64_t whole) {
    return whole == 0 ? 0 : static_cast<double>(part) / static_cast<double>(whole);
}

/// ", turned 2 (4 %) 3 (98 %)", of bytes that rest otherwise.
std::string turned_bytes(const BusList::Message& m) {
    std::string text;
    for (const auto& flips : m.flips)
        if (flips.at_rest == 0)
            text += fmt::format("{} {} ({:.0f} %)", text.empty() ? ", turned" : "", flips.byte,
                                100 * flips.turned);
    return text;
}

std::string name_of(const BusList::Message& m) {
    return m.extended ? fmt::format("{:08x}", m.id) : fmt::format("{:03x}", m.id);
}

}  // namespace

void BusList::add(std::uint32_t id, bool extended, std::span<const std::uint8_t> data,
                  drivers::Time time) {
    ++frames_;
    Seen& seen = seen_[{extended, id}];
    Message& m = seen.message;
    const std::size_t size = std::min<std::size_t>(data.size(), seen.before.size());
    if (m.frames == 0) {
        m.id = id;
        m.extended = extended;
        m.shortest = m.longest = size;
        seen.first = time;
        seen.counts.fill(true);
    } else {
        const double step = drivers::to_seconds(time - seen.last);
        const auto n = static_cast<double>(m.frames);
        const double off = step - seen.mean_s;
        seen.mean_s += off / n;
        seen.squares += off * (step - seen.mean_s);
        ++(turned_ ? seen.turned : seen.rested);
        auto& changes = turned_ ? seen.turn : seen.rest;
        for (std::size_t i = 0; i < std::min(size, m.shortest); ++i) {
            if (data[i] != seen.before[i]) ++changes[i];
            if (!turned_)
                seen.counts[i] =
                    seen.counts[i] && data[i] == static_cast<std::uint8_t>(seen.before[i] + 1);
        }
        m.shortest = std::min(m.shortest, size);
        m.longest = std::max(m.longest, size);
    }
    std::copy_n(data.begin(), size, seen.before.begin());
    seen.last = time;
    ++m.frames;
}

std::vector<BusList::Message> BusList::messages() const {
    std::vector<Message> all;
    for (const auto& [key, seen] : seen_) {
        Message m = seen.message;
        const auto intervals = static_cast<double>(m.frames - 1);
        if (m.frames > 1)
            m.period_ms = 1e3 * drivers::to_seconds(seen.last - seen.first) / intervals;
        if (m.frames > 2) m.jitter_ms = 1e3 * std::sqrt(seen.squares / (intervals - 1));
        for (std::size_t i = 0; i < m.shortest; ++i) {
            const int byte = static_cast<int>(i);
            if (seen.rest[i] > 0) m.at_rest.push_back(byte);
            if (seen.turn[i] > 0 && seen.rest[i] == 0) m.turned_only.push_back(byte);
            if (seen.rest[i] > 0 || seen.turn[i] > 0)
                m.flips.push_back(
                    {byte, share(seen.rest[i], seen.rested), share(seen.turn[i], seen.turned)});
            // A few frames may count by chance.
            if (seen.rest[i] > 0 && seen.counts[i] && m.frames > 8) m.counters.push_back(byte);
        }
        all.push_back(std::move(m));
    }
    return all;
}

std::string table_of(const BusList& bus) {
    std::string text = fmt::format("{:<9}{:>7}{:>11}{:>11}{:>7}  {}\n", "id", "frames", "period ms",
                                   "jitter ms", "bytes", "bytes that change");
    for (const auto& m : bus.messages()) {
        std::string bytes = "at rest " + ranges_of(m.at_rest);
        if (!m.counters.empty()) bytes += ", counts " + ranges_of(m.counters);
        bytes += turned_bytes(m);
        const std::string size = m.shortest == m.longest
                                     ? fmt::format("{}", m.longest)
                                     : fmt::format("{}-{}", m.shortest, m.longest);
        text += fmt::format("{:<9}{:>7}{:>11.2f}{:>11.2f}{:>7}  {}\n", name_of(m), m.frames,
                            m.period_ms, m.jitter_ms, size, bytes);
    }
    return text;
}

nlohmann::ordered_json json_of(const BusList& bus) {
    nlohmann::ordered_json all = nlohmann::ordered_json::array();
    for (const auto& m : bus.messages()) {
        nlohmann::ordered_json flips = nlohmann::ordered_json::array();
        for (const auto& f : m.flips)
            flips.push_back({{"byte", f.byte}, {"at_rest", f.at_rest}, {"turned", f.turned}});
        all.push_back({{"id", m.id},
                       {"extended", m.extended},
                       {"frames", m.frames},
                       {"period_ms", m.period_ms},
                       {"jitter_ms", m.jitter_ms},
                       {"bytes", {m.shortest, m.longest}},
                       {"at_rest", m.at_rest},
                       {"turned", m.turned_only},
                       {"counters", m.counters},
                       {"flips", flips}});
    }
    return {{"frames", bus.frames()}, {"messages", all}};
}

}  // namespace vibrig::commission
