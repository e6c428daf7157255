#include "daemon/record/replay.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>
#include <utility>

#include "daemon/configuration/configuration.hpp"
#include "daemon/dwells/player.hpp"
#include "daemon/record/raw_frames.hpp"
#include "drivers/sample/assembler.hpp"
#include "proto/candump.hpp"
#include "proto/text.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

/// Those in force again would move a last bit: the filter keeps their squares.
void set_noise(estimator::Identification& identification, const estimator::NoiseLevels& levels) {
    const auto& now = identification.noise();
    if (levels.angle_arcsec > 0 &&
        (levels.angle_arcsec != now.angle_arcsec ||
         levels.gyro_random_walk_deg_per_rt_h != now.gyro_random_walk_deg_per_rt_h))
        identification.set_noise(levels);
}

void take_estimate(const estimator::Identification& identification, Dwell& to) {
    estimator::Estimate estimate;
    identification.solved(estimate);
    to.value = estimate.value;
    to.sigma = estimate.sigma;
    to.observable = estimate.observable;
    to.covariance = identification.covariance();
}

/// One dwell, with the noise levels in force.
void feed_as_it_is(estimator::Identification& identification, const Campaign& campaign,
                   const RecordedDwell& dwell, const OnStep& on_step) {
    const Order& order = *dwell.order;
    identification.begin_dwell(order.dwell());
    for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i) {
        const auto step =
            identification.add(rt::measurement_of(campaign.samples[i], order.from, order.zero_g));
        if (on_step) on_step(i, step);
    }
    static_cast<void>(identification.end_dwell(dwell.cut_short));
    if (order.played) static_cast<void>(identification.played(*order.played));
}

/// One finished dwell as a recording has it, if there is one; `order`: the newest.
bool take_done(dwells::Player& player, Dwell& dwell, bool decide, const Order* order) {
    rt::DwellDone done;
    if (!player.take_done(done, decide)) return false;
    dwell.time = player.now();
    if (order != nullptr && order->played) {
        const auto known = player.identification().played(*order->played);
        if (known.samples > 0) done.summary = known;
    }
    dwell.summary = done.summary;
    dwell.reason = done.summary.reason;
    take_estimate(player.identification(), dwell);
    return true;
}

bool same(double a, double b) {
    // To the last bit; and what is not a number is so on both sides.
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

std::string difference(const Dwell& was, const Dwell& is) {
    const std::string where =
        fmt::format("run {} position {}", was.summary.run, was.summary.position);
    if (was.summary.run != is.summary.run || was.summary.position != is.summary.position)
        return where + ": another dwell";
    if (was.summary.samples != is.summary.samples)
        return fmt::format("{}: {} samples, recorded {}", where, is.summary.samples,
                           was.summary.samples);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (!same(was.value[i], is.value[i]) || !same(was.sigma[i], is.sigma[i]))
            return fmt::format("{}: {} = {:.17g} +- {:.17g}, recorded {:.17g} +- {:.17g}", where,
                               estimator::parameter_names()[i], is.value[i], is.sigma[i],
                               was.value[i], was.sigma[i]);
    }
    if (was.covariance.size() != is.covariance.size() ||
        !std::ranges::equal(was.covariance, is.covariance, same))
        return where + ": covariance";
    return {};
}

/// What the campaign adds to the filter's result: zeros in the amplitudes' uncertainty, its mark.
void qualify(const Campaign& campaign, ReplayResult& out) {
    std::vector<std::pair<int, double>> variances;
    const auto dwells = recorded_dwells(campaign);
    for (std::size_t i = campaign.restarted_at; i < dwells.size() && i < out.dwells.size(); ++i) {
        const double sigma = dwells[i].order->level_sigma_g;
        if (sigma > 0) variances.emplace_back(dwells[i].order->run, sigma * sigma);
    }
    estimator::widen_amplitudes(out.result, variances);
    if (!campaign.mark.empty()) out.result.warnings.push_back("campaign marked: " + campaign.mark);
}

drivers::AssemblerSettings assembler_settings(const std::string& configuration) {
    std::istringstream lines(configuration);
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with("can.") && !line.starts_with("can.dbc")) kept += line + "\n";
    }
    return configuration::parse(kept, "configuration of the recording", false)
        .configuration.assembler;
}

/// Frames as the acquisition thread takes them.
class FrameReader {
  public:
    FrameReader(const std::string& dbc, const std::string& configuration,
                std::int64_t utc_offset_ns, std::vector<drivers::Sample>& to)
        : dbc_(proto::parse_dbc(dbc.empty() ? proto::rig_dbc_text() : dbc, "DBC of the recording")),
          settings_(assembler_settings(configuration)),
          to_(to),
          utc_offset_ns_(utc_offset_ns) {
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
        !proto::read_number(std::string_view(fraction), part) || whole < 0)
        throw std::runtime_error(place + ": found '" + proto::printable(text) +
                                 "', expected seconds such as 1700000000.123456");
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
        throw std::runtime_error(place + ": found '" + proto::printable(text.substr(0, 80)) +
                                 "', expected what was played as JSON: " + error.what());
    }
}

/// Times are those of UTC yet.
void read_swept(const std::string& text, const std::string& place, Campaign& to) {
    try {
        const auto json = nlohmann::json::parse(text);
        for (const auto& one : json.at(2))
            to.swept.push_back({one.at(0).get<std::int64_t>() * drivers::kMicrosecond +
                                    one.at(1).get<std::int64_t>(),
                                json.at(0).get<std::int32_t>(), json.at(1).get<std::int32_t>(),
                                one.at(2).get<double>()});
    } catch (const nlohmann::json::exception& error) {
        throw std::runtime_error(place + ": found '" + proto::printable(text.substr(0, 80)) +
                                 "', expected the frequencies of a sweep as JSON: " + error.what());
    }
}

void read_dwells(const std::string& path, Campaign& to) {
    std::ifstream file(path);
    std::string line;
    const std::string header = kDwellsHeader;
    constexpr std::ptrdiff_t kOldest = 14;  // commas, of what recordings had at first
    if (!std::getline(file, line) || (line != header && !header.starts_with(line + ",")) ||
        std::ranges::count(line, ',') < kOldest)
        throw std::runtime_error(path + ":1: found '" + proto::printable(line.substr(0, 80)) +
                                 "', expected the header " + kDwellsHeader);
    for (std::size_t number = 2; std::getline(file, line); ++number) {
        if (line.empty()) continue;
        const std::string place = fmt::format("{}:{}", path, number);
        if (std::size_t count = 0; line.starts_with(kRestartLine)) {
            if (!proto::read_number(std::string_view(line).substr(std::strlen(kRestartLine)),
                                    count))
                throw std::runtime_error(place + ": found '" + proto::printable(line) +
                                         "', expected a number of dwells");
            keep_dwells(to, count);
            continue;
        }
        if (line.starts_with(kSweptLine)) {
            read_swept(line.substr(std::strlen(kSweptLine)), place, to);
            continue;
        }
        if (line.starts_with(kPlayedLine)) {
            read_played(line.substr(std::strlen(kPlayedLine)), place, to);
            continue;
        }
        if (line.starts_with(kAnewLine)) {
            to.found = dwells::noise_found_in(line.substr(std::strlen(kAnewLine)));
            if (!to.found)
                throw std::runtime_error(place + ": found '" +
                                         proto::printable(line.substr(0, 80)) +
                                         "', expected the noise of the result as JSON");
            continue;
        }
        const auto fields = fields_of(line);
        Order order;
        std::int64_t offset_us = 0;
        auto& walk = order.noise.gyro_random_walk_deg_per_rt_h;
        const std::array<std::pair<std::size_t, double*>, 9> numbers{
            {{2, &order.table_g},
             {7, &order.zero_g[0]},
             {8, &order.zero_g[1]},
             {9, &order.zero_g[2]},
             {10, &order.level_sigma_g},
             {11, &order.noise.angle_arcsec},
             {12, &walk[0]},
             {13, &walk[1]},
             {14, &walk[2]}}};
        const bool dated = fields.size() >= 16 && !fields[15].empty();
        order.power_lost = fields.size() >= 17 && fields[16] == "1";
        order.held_out = fields.size() >= 19 && fields[18] == "1";
        auto& random = order.random;
        const std::array<std::pair<std::size_t, double*>, 5> of_random{
            {{20, &random.level_db},
             {21, &random.mean_square_g2},
             {22, &random.bandwidth_hz},
             {23, &random.gain_error},
             {24, &random.highest_hz}}};
        const auto yes_or_no = [&fields](std::size_t at) {
            return fields.size() <= at || fields[at] == "1" || fields[at] == "0";
        };
        auto& sweep = order.sweep;
        const std::array<std::pair<std::size_t, double*>, 3> of_sweep{
            {{25, &sweep.from_hz}, {26, &sweep.to_hz}, {27, &sweep.seconds}}};
        bool good = fields.size() >= 15 &&
                    (fields.size() <= 19 || fields.size() == 25 || fields.size() == 28) &&
                    fields.size() != 18 && yes_or_no(16) && yes_or_no(18) &&
                    (fields.size() < 19 ||
                     (proto::read_number(fields[17], order.frequency_hz) &&
                      std::isfinite(order.frequency_hz) && order.frequency_hz >= 0)) &&
                    (!dated || (proto::read_number(fields[15], order.begin_s) &&
                                std::isfinite(order.begin_s))) &&
                    proto::read_number(fields[0], order.run) &&
                    proto::read_number(fields[1], order.position) &&
                    proto::read_number(fields[6], offset_us);
        if (fields.size() == 28) {
            for (const auto& [field, value] : of_sweep)
                good = good && proto::read_number(fields[field], *value) && std::isfinite(*value) &&
                       *value >= 0;
        }
        if (fields.size() >= 25) {
            good = good && proto::read_number(fields[19], random.profile);
            for (const auto& [field, value] : of_random)
                good = good && proto::read_number(fields[field], *value) && std::isfinite(*value);
        }
        for (const auto& [field, value] : numbers)
            good = good && proto::read_number(fields[field], *value) && std::isfinite(*value);
        if (!good)
            throw std::runtime_error(place + ": found '" + proto::printable(line.substr(0, 80)) +
                                     "', expected the fields that the header names");
        to.head.utc_offset_ns = offset_us * drivers::kMicrosecond;
        if (!fields[5].empty()) {
            order.cancel = true;
            order.announced = microseconds(fields[5], place);
        } else {
            order.from = microseconds(fields[3], place);
            order.to = microseconds(fields[4], place);
            if (order.to <= order.from)
                throw std::runtime_error(place + ": found an end before the beginning");
        }
        to.orders.push_back(order);
    }
    if (to.orders.empty()) throw std::runtime_error(path + ": found no dwell, expected some");
    for (SweptRow& row : to.swept) row.time -= to.head.utc_offset_ns;
    for (Order& order : to.orders) {
        for (Time* time : {&order.announced, &order.from, &order.to})
            if (*time != 0) *time -= to.head.utc_offset_ns;
    }
}

}  // namespace

estimator::spectrum::ReadSweep sweep_of(const Campaign& campaign,
                                        const estimator::Settings& settings,
                                        const RecordedDwell& dwell) {
    // Since its level was reached, before the dwell began, to the reading after its end.
    constexpr Time kAround = 60 * drivers::kSecond;
    const Order& order = *dwell.order;
    estimator::spectrum::ReadSweep sweep(settings, order.run, order.position);
    for (const SweptRow& row : campaign.swept) {
        if (row.run == order.run && row.position == order.position &&
            row.time > order.from - kAround && row.time < order.to + kAround)
            sweep.frequency(drivers::to_seconds(row.time - order.from), row.frequency_hz);
    }
    for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i)
        sweep.add(rt::measurement_of(campaign.samples[i], order.from, order.zero_g));
    return sweep;
}

void number_psds(Campaign& campaign) {
    std::uint32_t place = 0;
    for (Order& order : campaign.orders)
        if (order.played && order.played->word == estimator::PlayedRandom::Word::good)
            order.played->place = ++place;
}

bool noise_known(const Campaign& campaign) {
    return std::ranges::all_of(campaign.orders, [](const Order& order) {
        return order.cancel || order.noise.angle_arcsec > 0;
    });
}

void forget_noise(Campaign& campaign) {
    for (Order& order : campaign.orders) order.noise = {};
    campaign.found.reset();
}

void feed(estimator::Identification& identification, const Campaign& campaign,
          const RecordedDwell& dwell, const OnStep& on_step) {
    set_noise(identification, campaign.found ? campaign.found->levels : dwell.order->noise);
    feed_as_it_is(identification, campaign, dwell, on_step);
}

dwells::Anew anew(const Campaign& campaign, const estimator::Settings& settings,
                  const noise::Found& found, const OnStep& on_step) {
    const auto dwells = recorded_dwells(campaign);
    dwells::Anew out(settings, found, dwells.size());
    for (const RecordedDwell& dwell : dwells)
        feed_as_it_is(out.identification(), campaign, dwell, on_step);
    return out;
}

estimator::Result live_result(const Campaign& campaign, const estimator::Settings& settings) {
    const auto dwells = recorded_dwells(campaign);
    estimator::Identification identification(settings, dwells.size());
    for (const RecordedDwell& dwell : dwells) {
        set_noise(identification, dwell.order->noise);
        feed_as_it_is(identification, campaign, dwell, {});
    }
    return identification.result();
}

ReplayResult replay(const Campaign& campaign, const estimator::Settings& settings,
                    const ReplayOptions& options) {
    if (!campaign.incomplete.empty()) throw std::runtime_error(campaign.incomplete);
    const auto begin = std::chrono::steady_clock::now();
    ReplayResult out;
    const auto& samples = campaign.samples;
    out.samples = samples.size();
    if (!samples.empty())
        out.recorded_s = drivers::to_seconds(samples.back().time - samples.front().time);
    dwells::Player player(settings);
    std::size_t at = 0;
    const auto play_until = [&](std::size_t end) {
        while (at < end) {
            std::size_t n = std::min(end - at, dwells::Player::kMost);
            if (options.speed > 0) {
                // A tenth of a second of wall time at once.
                const Time step = drivers::from_seconds(0.1 * options.speed);
                while (n > 1 && samples[at + n - 1].time - samples[at].time > step) n = (n + 1) / 2;
                const double due =
                    drivers::to_seconds(samples[at].time - samples.front().time) / options.speed;
                std::this_thread::sleep_until(
                    begin + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                std::chrono::duration<double>(due)));
            }
            player.push(std::span(samples).subspan(at, n));
            at += n;
            if (options.progress) options.progress(at, samples.size());
        }
    };
    const bool decide = !noise_known(campaign);
    const Order* newest = nullptr;
    const auto take = [&] {
        for (Dwell dwell; take_done(player, dwell, decide, newest);) {
            if (out.dwells.size() < campaign.dwells.size()) {
                ++out.compared;
                const Dwell& was = campaign.dwells[out.dwells.size()];
                if (!decide) {
                    dwell.summary.flagged = was.summary.flagged;
                    dwell.reason = was.reason;
                }
                const std::string what = difference(was, dwell);
                if (!what.empty()) ++out.different;
                if (out.first_difference.empty()) out.first_difference = what;
            }
            if (options.on_dwell) options.on_dwell(dwell);
            out.dwells.push_back(std::move(dwell));
        }
    };
    for (const RecordedDwell& dwell : recorded_dwells(campaign)) {
        play_until(std::max(at, dwell.first));
        newest = dwell.order;
        set_noise(player.identification(), dwell.order->noise);
        rt::DwellOrder order;
        order.from = dwell.order->from;
        order.to = dwell.order->to;
        order.zero_g = dwell.order->zero_g;
        order.dwell = dwell.order->dwell();
        player.order(order);
        const std::size_t end = dwell.first + dwell.count;
        play_until(end);
        if (!dwell.cut_short && end < samples.size() && dwell.count > 0) {
            play_until(end + 1);  // the first sample behind it ends the dwell
        } else {
            rt::DwellOrder cancel;
            cancel.cancel = true;
            player.order(cancel);
        }
        take();
    }
    play_until(samples.size());
    take();
    out.result = player.identification().result();
    qualify(campaign, out);
    out.found = decide ? player.noise_found() : campaign.found;
    if (out.found) {
        const dwells::Anew again = anew(campaign, settings, *out.found);
        out.live = std::exchange(out.result, again.result());
        take_estimate(again.identification(), out.anew.emplace());
        qualify(campaign, out);
    }
    out.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return out;
}

std::vector<drivers::Sample> samples_from_raw(const Campaign& campaign, Time& until) {
    std::vector<drivers::Sample> samples;
    FrameReader reader(campaign.head.dbc, campaign.head.configuration, campaign.head.utc_offset_ns,
                       samples);
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
    FrameReader reader(dbc, configuration, campaign.head.utc_offset_ns, campaign.samples);
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
