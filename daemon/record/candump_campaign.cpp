#include "daemon/record/candump_campaign.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/campaign_checks.hpp"
#include "daemon/record/dwells_csv.hpp"
#include "daemon/record/raw_frames.hpp"
#include "drivers/sample/assembler.hpp"
#include "drivers/sample/channels.hpp"
#include "proto/candump.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

/// An effective configuration lists every signal that its build knew: what it lacks was not bound.
void unbind_newer(const std::set<std::string>& listed, drivers::SignalBindings& bindings) {
    const auto check = [&](const std::string& name, std::string drivers::SignalBindings::*signal) {
        if (signal != nullptr && !listed.contains("can.signals." + name))
            (bindings.*signal).clear();
    };
    if (!listed.contains("can.signals.sync_count")) return;
    for (const auto& row : drivers::kChannelTable) {
        check(row.name, row.signal);
        check(std::string(row.name) + "_valid", row.valid);
    }
    for (const auto& row : drivers::kStatusTable) check(row.name, row.signal);
}

drivers::AssemblerSettings assembler_settings(const std::string& configuration,
                                              const std::string& folder) {
    std::istringstream lines(configuration);
    std::string kept;
    std::set<std::string> keys;
    for (std::string line; std::getline(lines, line);) {
        if (!line.starts_with("can.") || line.starts_with("can.dbc")) continue;
        kept += line + "\n";
        keys.insert(line.substr(0, line.find_first_of(" =")));
    }
    auto settings = configuration::parse(kept, "configuration of the recording in " + folder, false)
                        .configuration.assembler;
    unbind_newer(keys, settings.bindings);
    return settings;
}

/// Frames as the acquisition thread takes them.
class FrameReader {
  public:
    /// `folder`: of the recording, for what is wrong with DBC or configuration.
    FrameReader(const std::string& folder, const std::string& dbc, const std::string& configuration,
                std::int64_t utc_offset_ns, std::vector<drivers::Sample>& to)
        : dbc_(proto::parse_dbc(dbc.empty() ? proto::rig_dbc_text() : dbc,
                                "DBC of the recording in " + folder)),
          settings_(assembler_settings(configuration, folder)),
          to_(to),
          utc_offset_ns_(utc_offset_ns) {
        settings_.units_checked = false;
        begin();
        if (const auto* message = dbc_.find("RigTime")) {
            rig_time_ = message;
            tick_end_ = message->find("TickEnd");
        }
    }

    void read(const std::vector<std::string>& logs) {
        RawFrames frames(logs, utc_offset_ns_);
        std::optional<std::size_t> log;
        while (const RawFrame* one = frames.next()) {
            if (one->start) {
                begin();
                last_ = 0;  // UTC may have been set back meanwhile
                continue;
            }
            const Time time = one->frame.time;
            if (time < -kMostTime || time > kMostUtc)
                throw std::runtime_error(fmt::format(
                    "{}:{}: found a time {:.0f} years from the campaign's, expected a nearer one",
                    frames.path_of(*one), one->line,
                    std::abs(drivers::to_seconds(time)) / (365.25 * 86400)));
            // Behind one another; a second for time stamps that are not quite in order.
            if (log != one->log && last_ > 0 && time + drivers::kSecond < last_)
                throw std::runtime_error(fmt::format(
                    "{}:{}: found a time {:.6f} s before the end of the log before it, "
                    "expected logs in their order",
                    frames.path_of(*one), one->line, drivers::to_seconds(last_ - time)));
            log = one->log;
            last_ = std::max(last_, time);
            take(one->frame);
        }
    }
    void finish() { assembler_->advance(std::numeric_limits<Time>::max() / 2); }
    [[nodiscard]] Time until() const { return until_; }
    [[nodiscard]] std::uint64_t frames() const { return frames_; }

  private:
    void begin() {
        if (assembler_) finish();
        assembler_.emplace(dbc_, settings_,
                           [this](const drivers::Sample& sample) { to_.push_back(sample); });
    }
    void take(const drivers::ReceivedFrame& frame) {
        until_ = std::max(until_, frame.time);
        ++frames_;
        if (rig_time_ != nullptr && frame.frame.can_id == rig_time_->id) {
            rig_ = true;
            const auto end = proto::decode_raw(*tick_end_, {frame.frame.data, frame.frame.len});
            if (end && *end != 0) assembler_->advance(frame.time);
            return;
        }
        if (!rig_ && assembler_->next_deadline() <= frame.time) assembler_->advance(frame.time);
        assembler_->feed(frame);
    }

    proto::Dbc dbc_;
    drivers::AssemblerSettings settings_;
    std::vector<drivers::Sample>& to_;
    std::optional<drivers::SampleAssembler> assembler_;
    std::int64_t utc_offset_ns_;
    const proto::Message* rig_time_ = nullptr;
    const proto::Signal* tick_end_ = nullptr;
    bool rig_ = false;
    Time last_ = 0;  ///< since the daemon was started
    Time until_ = 0;
    std::uint64_t frames_ = 0;
};

}  // namespace

std::vector<drivers::Sample> samples_from_raw(const Campaign& campaign, Time& until) {
    std::vector<drivers::Sample> samples;
    FrameReader reader(campaign.folder, campaign.head.dbc, campaign.head.configuration,
                       campaign.head.utc_offset_ns, samples);
    reader.read(raw_files(campaign.folder));
    reader.finish();
    until = reader.until();
    return samples;
}

Campaign campaign_from_candump(const std::vector<std::string>& logs, const std::string& dwells,
                               const std::string& configuration, const std::string& dbc) {
    Campaign campaign;
    campaign.path = logs.front();
    campaign.head.configuration = configuration;
    campaign.head.simulated = of_simulated_rig(configuration);
    read_dwells(dwells, campaign);
    FrameReader reader(folder_of(logs.front()), dbc, configuration, campaign.head.utc_offset_ns,
                       campaign.samples);
    reader.read(in_order(logs));
    reader.finish();
    if (campaign.samples.empty())
        throw std::runtime_error(
            fmt::format("{}: found {} frames and no sample in them, expected "
                        "the signals of the configuration",
                        logs.front(), reader.frames()));
    return campaign;
}

}  // namespace vibrig::record
