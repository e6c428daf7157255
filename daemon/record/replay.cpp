#include "daemon/record/replay.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fstream>
#include <limits>
#include <sstream>
#include <thread>

#include "daemon/configuration/configuration.hpp"
#include "daemon/noise/noise_monitor.hpp"
#include "daemon/record/raw_log.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/rig_clock.hpp"
#include "drivers/assembler.hpp"
#include "proto/candump.hpp"
#include "proto/text.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

/// The control thread's: it is this one, and it never sleeps there.
class Awake final : public drivers::Waiter {
  public:
    void notify() noexcept override {}
    bool wait_until(Time) noexcept override { return true; }
};

/// The estimator's thread with what feeds it.
class Player {
  public:
    Player(const estimator::Settings& settings)
        : identification_(settings),
          waiter_(clock_.make_waiter()),
          stage_(ring_, *waiter_, awake_, identification_),
          noise_(settings, [](Severity, const std::string&) {}),
          thread_([this] { stage_.run(); }) {
        rest();
    }
    ~Player() {
        stage_.stop();
        thread_.join();
    }
    Player(const Player&) = delete;
    Player& operator=(const Player&) = delete;

    void order(const rt::DwellOrder& order) {
        if (!stage_.order(order)) throw std::runtime_error("the estimator takes no order");
        rest();
    }
    void push(std::span<const drivers::Sample> samples) {
        if (samples.empty()) return;
        clock_.set(samples.back().time);
        if (ring_.push_n(samples) != samples.size())
            throw std::runtime_error("the estimator's ring is full");
        waiter_->notify();
        rest();
    }
    /// As the daemon does between two dwells.
    bool take_done(Dwell& dwell) {
        rt::DwellDone done;
        if (!stage_.take_done(done)) return false;
        rt::BlockRecord block;
        while (stage_.take_block(block)) noise_.add(block);
        estimator::Estimate estimate;
        identification_.estimate(estimate);
        if (noise_.end_dwell(done.summary, estimate.value)) {
            done.summary.flagged = true;
            done.summary.reason = "noise is not that of the earlier dwells";
        }
        if (const auto levels = noise_.take_new_levels()) identification_.set_noise(*levels);
        dwell.time = clock_.now();
        dwell.summary = done.summary;
        dwell.reason = done.summary.reason;
        identification_.estimate(estimate);
        dwell.value = estimate.value;
        dwell.sigma = estimate.sigma;
        dwell.observable = estimate.observable;
        dwell.covariance = identification_.covariance();
        return true;
    }
    [[nodiscard]] estimator::Result result() const { return identification_.result(); }

    static constexpr std::size_t kMost = 2048;  ///< samples at a time

  private:
    void rest() {
        while (!clock_.at_rest()) {
            clock_.rest().wait(-1);
            clock_.rest().clear();
        }
    }

    rt::RigClock clock_;
    Awake awake_;
    rt::Ring<drivers::Sample> ring_{4096};
    estimator::Identification identification_;
    std::unique_ptr<drivers::Waiter> waiter_;
    rt::EstimatorStage stage_;
    noise::NoiseMonitor noise_;
    std::thread thread_;
};

bool same(double a, double b) {
    // To the last bit; and what is not a number is so on both sides.
    return std::memcmp(&a, &b, sizeof a) == 0;
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
          assembler_(dbc_, assembler_settings(configuration),
                     [&to](const drivers::Sample& sample) { to.push_back(sample); }),
          utc_offset_ns_(utc_offset_ns) {
        if (const auto* message = dbc_.find("RigTime")) {
            rig_time_ = message;
            tick_end_ = message->find("TickEnd");
        }
    }

    void read(const std::string& path) {
        std::string rest;
        std::size_t number = 0;
        read_raw(path, [&](std::string_view piece) {
            rest += piece;
            std::size_t begin = 0;
            for (std::size_t end = rest.find('\n'); end != std::string::npos;
                 begin = end + 1, end = rest.find('\n', begin)) {
                ++number;
                line(std::string_view(rest).substr(begin, end - begin), path, number);
            }
            rest.erase(0, begin);
            if (rest.size() > 4096)
                throw std::runtime_error(
                    fmt::format("{}:{}: found no end of the line, expected one", path, number + 1));
            return true;
        });
        // A line without an end was cut off with its writer.
    }
    void finish() { assembler_.advance(std::numeric_limits<Time>::max() / 2); }
    [[nodiscard]] Time until() const { return until_; }
    [[nodiscard]] std::uint64_t frames() const { return frames_; }

  private:
    void line(std::string_view text, const std::string& path, std::size_t number) {
        if (text.empty() || text.front() == '#') return;
        proto::LoggedFrame logged;
        try {
            logged = proto::parse_candump_line(text);
        } catch (const proto::CandumpError& error) {
            throw std::runtime_error(fmt::format("{}:{}: {}", path, number, error.what()));
        }
        if (text.ends_with(" T")) return;  // what the daemon sent it does not receive
        drivers::ReceivedFrame frame;
        frame.time = logged.time_ns - utc_offset_ns_;
        frame.frame.can_id = logged.id | (logged.extended ? CAN_EFF_FLAG : 0U) |
                             (logged.remote ? CAN_RTR_FLAG : 0U) |
                             (logged.error ? CAN_ERR_FLAG : 0U);
        frame.frame.len = logged.size;
        frame.fd = logged.fd;
        std::copy_n(logged.data.begin(), logged.size, frame.frame.data);
        if (logged.error) return;
        until_ = std::max(until_, frame.time);
        ++frames_;
        if (rig_time_ != nullptr && frame.frame.can_id == rig_time_->id) {
            rig_ = true;
            const auto end = proto::decode_raw(*tick_end_, {frame.frame.data, frame.frame.len});
            if (end && *end != 0) assembler_.advance(frame.time);
            return;
        }
        if (!rig_ && assembler_.next_deadline() <= frame.time) assembler_.advance(frame.time);
        assembler_.feed(frame);
    }

    proto::Dbc dbc_;
    drivers::SampleAssembler assembler_;
    std::int64_t utc_offset_ns_;
    const proto::Message* rig_time_ = nullptr;
    const proto::Signal* tick_end_ = nullptr;
    bool rig_ = false;
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

void read_dwells(const std::string& path, Campaign& to) {
    std::ifstream file(path);
    std::string line;
    const std::string head = "run,position,table_g,from_s,to_s,cancelled_s,utc_offset_us";
    if (!std::getline(file, line) || line != head)
        throw std::runtime_error(path + ":1: found '" + proto::printable(line.substr(0, 80)) +
                                 "', expected the header " + head);
    for (std::size_t number = 2; std::getline(file, line); ++number) {
        if (line.empty()) continue;
        const std::string place = fmt::format("{}:{}", path, number);
        const auto fields = fields_of(line);
        Order order;
        std::int64_t offset_us = 0;
        if (fields.size() != 7 || !proto::read_number(fields[0], order.run) ||
            !proto::read_number(fields[1], order.position) ||
            !proto::read_number(fields[2], order.table_g) ||
            !proto::read_number(fields[6], offset_us))
            throw std::runtime_error(place + ": found '" + proto::printable(line.substr(0, 80)) +
                                     "', expected run, position, table_g, times, offset");
        to.head.utc_offset_ns = offset_us * drivers::kMicrosecond;
        if (!fields[5].empty()) {
            order.cancel = true;
            order.announced = microseconds(fields[5], place) - to.head.utc_offset_ns;
        } else {
            order.from = microseconds(fields[3], place) - to.head.utc_offset_ns;
            order.to = microseconds(fields[4], place) - to.head.utc_offset_ns;
            if (order.to <= order.from)
                throw std::runtime_error(place + ": found an end before the beginning");
        }
        to.orders.push_back(order);
    }
    if (to.orders.empty()) throw std::runtime_error(path + ": found no dwell, expected some");
}

}  // namespace

ReplayResult replay(const Campaign& campaign, const estimator::Settings& settings,
                    const ReplayOptions& options) {
    if (campaign.head.dwells_before > 0)
        throw std::runtime_error(
            fmt::format("{}: the campaign went on after a restart, {} dwells are in the file "
                        "before it: found one part, expected a whole campaign",
                        campaign.path, campaign.head.dwells_before));
    const auto begin = std::chrono::steady_clock::now();
    ReplayResult out;
    const auto& samples = campaign.samples;
    out.samples = samples.size();
    if (!samples.empty())
        out.recorded_s = drivers::to_seconds(samples.back().time - samples.front().time);
    Player player(settings);
    std::size_t at = 0;
    const auto play_until = [&](std::size_t end) {
        while (at < end) {
            std::size_t n = std::min(end - at, Player::kMost);
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
    const auto take = [&] {
        for (Dwell dwell; player.take_done(dwell);) {
            if (out.dwells.size() < campaign.dwells.size()) {
                ++out.compared;
                const std::string what = difference(campaign.dwells[out.dwells.size()], dwell);
                if (!what.empty()) ++out.different;
                if (out.first_difference.empty()) out.first_difference = what;
            }
            if (options.on_dwell) options.on_dwell(dwell);
            out.dwells.push_back(std::move(dwell));
        }
    };
    for (const RecordedDwell& dwell : recorded_dwells(campaign)) {
        play_until(std::max(at, dwell.first));
        rt::DwellOrder order;
        order.from = dwell.order->from;
        order.to = dwell.order->to;
        order.dwell = {dwell.order->run, dwell.order->position, dwell.order->table_g};
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
    out.result = player.result();
    out.took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return out;
}

std::vector<drivers::Sample> samples_from_raw(const Campaign& campaign, Time& until) {
    std::vector<drivers::Sample> samples;
    FrameReader reader(campaign.head.dbc, campaign.head.configuration, campaign.head.utc_offset_ns,
                       samples);
    for (const auto& path : raw_files(campaign.folder)) reader.read(path);
    reader.finish();
    until = reader.until();
    return samples;
}

Campaign campaign_from_candump(const std::vector<std::string>& logs, const std::string& dwells,
                               const std::string& configuration, const std::string& dbc) {
    Campaign campaign;
    campaign.path = logs.front();
    campaign.head.configuration = configuration;
    read_dwells(dwells, campaign);
    FrameReader reader(dbc, configuration, campaign.head.utc_offset_ns, campaign.samples);
    for (const auto& path : logs) reader.read(path);
    reader.finish();
    if (campaign.samples.empty())
        throw std::runtime_error(
            fmt::format("{}: found {} frames and no sample in them, expected "
                        "the signals of the configuration",
                        logs.front(), reader.frames()));
    return campaign;
}

}  // namespace vibrig::record
