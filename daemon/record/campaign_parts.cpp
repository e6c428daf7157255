// A campaign's parts: which files they are, and how they join.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <set>

#include "daemon/dwells/anew.hpp"
#include "daemon/record/campaign_checks.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/hdf5.hpp"
#include "daemon/record/whole_campaign.hpp"
#include "proto/text.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;
using drivers::Time;

bool is_part_file(const std::string& path, int part) {
    return fs::path(path).filename() == part_name(part);
}

std::string part_name(int part) {
    return part == 1 ? "campaign.h5" : fmt::format("campaign-{}.h5", part);
}

std::string folder_of(const std::string& path) {
    const std::string folder = fs::path(path).parent_path().string();
    return folder.empty() ? "." : folder;
}

std::string base_name(const std::string& path) {
    const fs::path of = path;
    return (of.has_filename() ? of : of.parent_path()).filename().string();
}

std::map<int, std::string> part_files(const std::string& folder) {
    std::map<int, std::string> parts;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        if (!entry.is_regular_file(error)) continue;  // whoever opens a pipe waits
        const std::string name = entry.path().filename().string();
        int part = 0;
        if (name == part_name(1)) {
            part = 1;
        } else if (name.starts_with("campaign-") && name.ends_with(".h5") &&
                   proto::read_number(std::string_view(name).substr(9, name.size() - 12), part) &&
                   name != part_name(part)) {
            part = 0;
        }
        if (part > 0) parts[part] = entry.path().string();
    }
    return parts;
}

namespace {

/// Dwells that the filter heard of.
std::size_t fed(const std::vector<Dwell>& dwells) {
    return static_cast<std::size_t>(
        std::ranges::count_if(dwells, [](const Dwell& d) { return d.summary.samples > 0; }));
}

/// Forgets what came after the first `count` dwells: it was not done again from there.
void cut_back(Campaign& campaign, std::size_t count) {
    std::size_t kept = 0, left = count;
    while (kept < campaign.dwells.size() && left > 0) {
        if (campaign.dwells[kept++].summary.samples > 0) --left;
    }
    std::size_t orders = 0, done = 0;
    for (std::size_t i = 0; i < campaign.orders.size() && done < kept; ++i) {
        const Order& order = campaign.orders[i];
        const auto& summary = campaign.dwells[done].summary;
        if (order.cancel || summary.run != order.run || summary.position != order.position)
            continue;
        ++done;
        orders = i + 1;
        if (orders < campaign.orders.size() && campaign.orders[orders].cancel) ++orders;
    }
    campaign.dwells.resize(kept);
    campaign.orders.resize(orders);
}

void move_times(Campaign& part, Time by) {
    for (auto& sample : part.samples) sample.time += by;
    for (auto& order : part.orders) {
        order.announced += by;
        order.from += by;
        order.to += by;
    }
    for (auto& dwell : part.dwells) dwell.time += by;
    for (auto& row : part.swept) row.time += by;
    for (auto& one : part.played) one.from += by;
    for (auto& row : part.estimates) row.time += by;
    for (auto& row : part.conditions) row.time += by;
    for (auto& event : part.events) event.time += by;
    for (auto& gap : part.gaps) {
        gap.from += by;
        gap.to += by;
    }
}

template <typename T>
void append(std::vector<T>& to, std::vector<T>& from) {
    to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

void go_on_after_restart(Campaign& to, Campaign& part, Time last) {
    Time shift = part.head.utc_offset_ns - to.head.utc_offset_ns;
    // UTC may have been set back meanwhile; dwells only know differences.
    if (!part.samples.empty() && !to.samples.empty() && part.samples.front().time + shift <= last)
        shift = last + drivers::kSecond - part.samples.front().time;
    if (shift < -kMostTime || shift > kMostTime)
        throw std::runtime_error(fmt::format(
            "{}: attribute utc_offset_ns: found {}, expected it near {} of the first part",
            part.path, part.head.utc_offset_ns, to.head.utc_offset_ns));
    move_times(part, shift);
    to.moved = shift;
    const std::size_t before = fed(to.dwells);
    if (before < part.head.dwells_before)
        to.incomplete = fmt::format(
            "{}: found {} dwells before the restart, expected {}: the end of what the filter had "
            "was not recorded",
            to.parts.back().path, before, part.head.dwells_before);
    cut_back(to, part.head.dwells_before);
    to.restarted_at = to.dwells.size();
    to.gaps.push_back(
        {last, part.samples.empty() ? last : part.samples.front().time, "restart", 0,
         "the daemon did not run; the campaign was resumed by " + part.head.started_by});
}

/// Puts `part` behind what there is.
void join(Campaign& to, Campaign part) {
    const Time last = to.samples.empty() ? 0 : to.samples.back().time;
    if (part.head.restart) {
        go_on_after_restart(to, part, last);
    } else {
        // Of the same life of the daemon as the part before it, and so of the same clock.
        move_times(part, to.moved);
        // The disk refused meanwhile: of what was kept for this file some may be in the other, too.
        std::erase_if(part.samples, [&](const auto& sample) {
            return !to.samples.empty() && sample.time <= last;
        });
        std::erase_if(part.orders, [&](const Order& order) {
            return std::ranges::any_of(to.orders, [&](const Order& other) {
                return order.announced == other.announced && order.cancel == other.cancel;
            });
        });
        std::erase_if(part.swept, [&](const SweptRow& row) {
            return !to.swept.empty() && row.time <= to.swept.back().time;
        });
        std::erase_if(part.dwells, [&](const Dwell& dwell) {
            return !to.dwells.empty() && dwell.time <= to.dwells.back().time;
        });
    }
    append(to.parts, part.parts);
    append(to.samples, part.samples);
    append(to.orders, part.orders);
    append(to.dwells, part.dwells);
    append(to.swept, part.swept);
    append(to.played, part.played);
    place_played(to);
    append(to.estimates, part.estimates);
    append(to.conditions, part.conditions);
    append(to.events, part.events);
    append(to.gaps, part.gaps);
    to.head.simulated = to.head.simulated || part.head.simulated;
    to.state = part.state;
    to.reason = part.reason;
    to.mark = part.mark;
    to.ended_utc_ns = part.ended_utc_ns;
    to.result_json = part.result_json;
}

Campaign read_with_summary(const std::string& path) {
    Campaign part = read_part(path);
    part.parts.push_back({path, part.state, part.samples.size(), part.dwells.size()});
    return part;
}

}  // namespace

std::string campaign_path(const std::string& argument) {
    std::error_code error;
    if (fs::is_regular_file(argument, error)) {
        if (!is_hdf5(argument))
            throw std::runtime_error(
                with_raw_log(argument + ": found no HDF5 file, expected a campaign's", argument));
        return argument;
    }
    if (!fs::is_directory(argument, error))
        throw std::runtime_error(argument +
                                 ": found nothing, expected a campaign's HDF5 file or its folder");
    const fs::path folder(argument);
    if (const auto parts = part_files(argument); !parts.empty()) return parts.begin()->second;
    std::vector<std::string> found;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        const auto parts = part_files(entry.path().string());
        if (!parts.empty()) found.push_back(parts.begin()->second);
    }
    if (found.size() == 1) return found.front();
    std::ranges::sort(found);
    throw std::runtime_error(found.empty()
                                 ? argument + ": found no campaign.h5 in it, expected one"
                                 : fmt::format("{}: found several campaigns, expected one of {}",
                                               argument, fmt::join(found, " ")));
}

std::string with_raw_log(std::string what, const std::string& path) {
    const std::string folder = folder_of(path);
    if (!raw_files(folder).empty())
        what += "; its raw log is there: vibrig replay " + folder +
                "/raw-* --config FILE, with the campaign's configuration, gives its result";
    return what;
}

namespace {

Campaign read_parts(const std::string& path) {
    const Head first = read_part_head(path).head;
    const std::string folder = folder_of(path);
    const auto there = part_files(folder);
    const bool among = there.contains(first.part) && is_part_file(path, first.part);
    std::map<int, std::string> parts = among ? there : std::map{std::pair{first.part, path}};
    const WholeCampaign whole(folder, first.campaign, parts);
    Campaign campaign;
    for (const auto& [number, file] : parts) {
        Campaign part = read_with_summary(file);
        whole.check(number, part);
        if (number == 1) {
            campaign = std::move(part);
        } else {
            join(campaign, std::move(part));
        }
    }
    if (among) whole.check_end(campaign.state);
    campaign.found = dwells::noise_found_in(campaign.result_json);
    return campaign;
}

}  // namespace

Campaign read_campaign(const std::string& argument) {
    const std::string path = campaign_path(argument);
    try {
        return read_parts(path);
    } catch (const hdf5::Error& error) {
        throw std::runtime_error(with_raw_log(error.what(), path));
    }
}

std::optional<Campaign> interrupted_campaign(const std::string& folder, const Head& head) {
    std::vector<std::string> folders;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        if (entry.path().filename().string().starts_with(head.name + "-"))
            folders.push_back(entry.path().string());
    }
    // The stamp in the name makes the last one the newest.
    std::ranges::sort(folders, std::greater{});
    for (const auto& name : folders) {
        const auto parts = part_files(name);
        if (parts.empty()) continue;
        try {
            Campaign last = read_part_head(parts.rbegin()->second);
            if (last.head.name == head.name && last.state != "finished" &&
                last.head.configuration_hash == head.configuration_hash)
                return last;
        } catch (const std::exception&) {
            continue;  // not one that can be gone on with
        }
    }
    return {};
}

std::vector<RecordedDwell> recorded_dwells(const Campaign& campaign) {
    std::vector<RecordedDwell> dwells;
    const auto& samples = campaign.samples;
    const auto at = [&](drivers::Time time) {
        return static_cast<std::size_t>(
            std::ranges::lower_bound(samples, time, {}, &drivers::Sample::time) - samples.begin());
    };
    std::size_t done = 0;
    for (std::size_t i = 0; i < campaign.orders.size(); ++i) {
        const Order& order = campaign.orders[i];
        if (order.cancel) continue;
        RecordedDwell dwell{&order, at(order.from), 0, false};
        dwell.count = std::max(at(order.to), dwell.first) - dwell.first;
        const bool cancelled = i + 1 < campaign.orders.size() && campaign.orders[i + 1].cancel;
        // As many as the filter saw, wherever in time the end was ordered.
        if (done < campaign.dwells.size()) {
            const auto& summary = campaign.dwells[done].summary;
            if (summary.run == order.run && summary.position == order.position) {
                ++done;
                if (cancelled) {
                    dwell.cut_short =
                        summary.samples < dwell.count || (order.sweep.any() && summary.used == 0);
                    dwell.count = std::min<std::size_t>(dwell.count, summary.samples);
                }
            }
        }
        dwells.push_back(dwell);
    }
    return dwells;
}

int raw_number(const std::string& path) {
    const std::string name = fs::path(path).filename().string();
    std::string_view digits = name;
    int number = 0;
    if (digits.ends_with(".zst")) digits.remove_suffix(4);
    if (!digits.starts_with("raw-") || !digits.ends_with(".log")) return 0;
    digits = digits.substr(4, digits.size() - 8);
    return proto::read_number(digits, number) && number > 0 ? number : 0;
}

std::vector<std::string> in_order(std::vector<std::string> logs) {
    const bool of_one = std::ranges::all_of(logs, [&](const std::string& path) {
        return raw_number(path) > 0 && folder_of(path) == folder_of(logs.front());
    });
    if (of_one) std::ranges::stable_sort(logs, {}, raw_number);
    // Between the compressed one and the end of the other both are there for a moment.
    std::erase_if(logs, [&](const std::string& name) {
        return std::ranges::find(logs, name + ".zst") != logs.end();
    });
    std::set<fs::path> seen;
    for (const auto& path : logs) {
        std::error_code error;
        if (!seen.insert(fs::weakly_canonical(path, error)).second && !error)
            throw std::runtime_error(path + ": found it twice, expected each log once");
    }
    return logs;
}

std::vector<std::string> raw_files(const std::string& folder) {
    std::vector<std::string> files;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error)) {
        if (raw_number(entry.path().string()) > 0) files.push_back(entry.path().string());
    }
    return in_order(std::move(files));
}

std::vector<std::string> left_out(const std::string& folder, const std::vector<std::string>& logs) {
    std::vector<std::string> names;
    for (const auto& path : raw_files(folder)) {
        if (std::ranges::find(logs, raw_number(path), raw_number) == logs.end())
            names.push_back(fs::path(path).filename().string());
    }
    return names;
}

}  // namespace vibrig::record
