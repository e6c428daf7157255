#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "daemon/record/campaign_checks.hpp"
#include "daemon/record/campaign_columns.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/candump_campaign.hpp"
#include "daemon/record/disk.hpp"
#include "daemon/record/hdf5.hpp"

namespace vibrig::record {

namespace fs = std::filesystem;
using drivers::Time;
using hdf5::File;

namespace {

Time last_time(const Campaign& part) { return part.samples.empty() ? 0 : part.samples.back().time; }

/// What the raw log has of this part beyond its last sample comes from the frames themselves.
/// `gap`: from that sample to the end of the log.
std::vector<drivers::Sample> more_from_raw(const Campaign& part, Gap& gap, std::string& failure) {
    // The log may hold earlier lives, too.
    const Time begin = part.head.utc_ns - part.head.utc_offset_ns;
    const Time last = std::max(last_time(part), begin);
    std::vector<drivers::Sample> more;
    Time until = 0;
    try {
        more = samples_from_raw(part, until);
    } catch (const std::exception& error) {
        failure = std::string("raw log: ") + error.what();
    }
    std::erase_if(
        more, [last](const drivers::Sample& s) { return s.time <= last || s.time > kMostTime; });
    gap.from = last;
    gap.to = std::clamp(until, last, std::max(last, kMostTime));
    return more;
}

/// What was done and lost stands in the file's gaps: reported from there, now and every time after.
void mend_last(const std::string& path) {
    File::open(path, File::Mode::mend).close();
    const Campaign part = read_part(path);
    Gap gap{0, 0, "end", 0, "the recorder died; nothing is recorded after this"};
    std::string failure;
    const auto more = more_from_raw(part, gap, failure);
    const Time end = more.empty() ? last_time(part) : more.back().time;
    File file = File::open(path, File::Mode::write);
    {
        hdf5::Table samples(file, "/samples", specs_of(drivers::Sample{}));
        samples.keep(part.samples.size());
        for (const auto& sample : more) put_row(samples, sample);
        samples.commit();
        hdf5::Table gaps(file, "/gaps", specs_of(Gap{}));
        gaps.keep(part.gaps.size());
        if (!failure.empty()) put_row(gaps, Gap{end, end, "raw log", 0, failure});
        put_row(gaps, gap);
        gaps.commit();
    }
    write_end(file, {"recovered", "the recorder died before the campaign was over", "", "",
                     end + part.head.utc_offset_ns});
    file.close();
}

/// The last order, if its dwell was not done.
std::string cut_dwell(const Campaign& campaign) {
    const auto dwells = recorded_dwells(campaign);
    if (dwells.empty() || dwells.size() <= campaign.dwells.size()) return {};
    const RecordedDwell& dwell = dwells.back();
    const auto& samples = campaign.samples;
    if (dwell.count == 0)
        return fmt::format("run {} position {}: none of its samples is there", dwell.order->run,
                           dwell.order->position);
    return fmt::format("run {} position {}: {} samples, {:.3f} of {:.3f} s, are there",
                       dwell.order->run, dwell.order->position, dwell.count,
                       drivers::to_seconds(samples[dwell.first + dwell.count - 1].time -
                                           samples[dwell.first].time),
                       drivers::to_seconds(dwell.order->to - dwell.order->from));
}

std::uint64_t missing_instants(const Campaign& campaign) {
    std::uint64_t missing = 0;
    for (std::size_t i = 1; i < campaign.samples.size(); ++i) {
        const Time before = campaign.samples[i - 1].time;
        if (std::ranges::any_of(campaign.gaps, [before](const Gap& gap) {
                return gap.stream == "restart" && gap.from == before;
            }))
            continue;
        const std::uint32_t step = campaign.samples[i].sequence - campaign.samples[i - 1].sequence;
        // A counter that went back began anew.
        if (step > 1 && step < 1U << 31U) missing += step - 1;
    }
    return missing;
}

}  // namespace

void close_part(const std::string& path, const std::string& next) {
    if (read_part_head(path).state != "running") return;
    File::open(path, File::Mode::mend).close();
    const Campaign part = read_part(path);
    File file = File::open(path, File::Mode::write);
    hdf5::Table(file, "/samples", specs_of(drivers::Sample{})).keep(part.samples.size());
    write_end(file, {kContinued, "the campaign goes on in " + next, "", "",
                     last_time(part) + part.head.utc_offset_ns});
    file.close();
}

namespace {

Recovery recover_one(const std::string& path) {
    Recovery recovery;
    const Head head = read_part_head(path).head;
    auto parts = part_files(folder_of(path));
    if (!is_part_file(path, head.part)) parts = {{head.part, path}};
    const int last = parts.rbegin()->first;
    recovery.was_closed = true;
    for (const auto& [number, file] : parts) {
        if (read_part_head(file).state != "running") continue;
        recovery.was_closed = false;
        if (WriterLock::held(file))
            throw std::runtime_error(file +
                                     ": found it being written by a running vibrigd, expected one "
                                     "whose writer died");
        if (number == last) {
            mend_last(file);
        } else {
            close_part(file, part_name(number + 1));
        }
    }
    const Campaign campaign = read_campaign(path);
    recovery.parts = campaign.parts.size();
    recovery.recovered = campaign.state == "recovered";
    if (recovery.recovered && !campaign.gaps.empty()) {
        const Gap& end = campaign.gaps.back();
        recovery.raw_until_s = drivers::to_seconds(end.to - end.from);
        recovery.samples_from_raw = static_cast<std::size_t>(std::ranges::count_if(
            campaign.samples, [&end](const auto& sample) { return sample.time > end.from; }));
    }
    recovery.samples = campaign.samples.size() - recovery.samples_from_raw;
    recovery.dwells = campaign.dwells.size();
    recovery.missing = missing_instants(campaign);
    if (!campaign.samples.empty()) {
        const Time end = campaign.samples.back().time;
        recovery.recorded_s = drivers::to_seconds(end - campaign.samples.front().time);
        recovery.ends_utc_ns = end + campaign.head.utc_offset_ns;
    }
    recovery.cut_dwell = cut_dwell(campaign);
    for (const Gap& gap : campaign.gaps) {
        if (gap.stream == "end") continue;
        recovery.words.push_back(
            gap.lost > 0
                ? fmt::format("{} {} while recording: {}", gap.lost, gap.stream, gap.reason)
            : gap.to > gap.from
                ? fmt::format("{:.3f} s: {}", drivers::to_seconds(gap.to - gap.from), gap.reason)
                : gap.reason);
    }
    if (!campaign.incomplete.empty()) recovery.words.push_back(campaign.incomplete);
    return recovery;
}

Recovery recover_folder(const std::string& folder, const Index::Tell& tell) {
    if (part_files(folder).empty() && !raw_files(folder).empty())
        throw std::runtime_error(
            with_raw_log(folder + ": found no campaign.h5 in it, expected one", folder + "/raw"));
    const std::string path = campaign_path(folder);
    Recovery recovery;
    try {
        recovery = recover_one(path);
    } catch (const hdf5::Error& error) {
        throw std::runtime_error(with_raw_log(error.what(), path));
    }
    recovery.path = path;
    recovery.missing_raw = missing_raw(folder_of(path), tell);
    try {
        recovery.misplaced_raw = misplaced_raw(folder_of(path));
    } catch (const std::exception& error) {
        // One that is cut was named.
        if (recovery.missing_raw.empty()) recovery.misplaced_raw = error.what();
    }
    return recovery;
}

}  // namespace

std::vector<Recovery> recover(const std::string& argument, const Index::Tell& tell) {
    std::vector<std::string> folders;
    std::error_code error;
    const bool is_folder = fs::is_directory(argument, error);
    if (is_folder && part_files(argument).empty()) {
        for (const auto& entry : fs::directory_iterator(argument, error)) {
            const std::string path = entry.path().string();
            if (!part_files(path).empty() ||
                (entry.is_directory(error) && !raw_files(path).empty()))
                folders.push_back(path);
        }
        std::ranges::sort(folders);
    }
    const bool all = !folders.empty();
    if (!all) folders.push_back(argument);
    std::vector<Recovery> done;
    for (const auto& folder : folders) {
        try {
            done.push_back(recover_folder(folder, tell));
        } catch (const std::exception& why) {
            if (!all) throw;
            Recovery failed;
            const auto parts = part_files(folder);
            failed.path = parts.empty() ? folder : parts.begin()->second;
            failed.failed = why.what();
            done.push_back(std::move(failed));
        }
    }
    try {
        const std::string campaign = fs::weakly_canonical(folder_of(done.back().path)).string();
        const std::string beside = all ? argument : fs::path(campaign).parent_path().string();
        if (all || fs::exists(Index::path_in(beside), error)) {
            Index index(beside, tell);
            if (all) {
                tell(fmt::format("{}: made anew from the files of {} campaigns",
                                 Index::path_in(beside), index.rebuild()));
            } else if (part_files(campaign).contains(1)) {
                index.note(campaign);
            }
        }
    } catch (const std::exception& why) {
        tell(why.what());
    }
    return done;
}

}  // namespace vibrig::record
