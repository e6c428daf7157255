#include "daemon/record/recorder.hpp"

#include <pthread.h>
#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "daemon/record/disk.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

// In the daemon's time: a simulated rig waits for this thread as for any other.
constexpr Time kPeriod = drivers::kSecond / 4;
constexpr Time kEstimatePeriod = drivers::kSecond;
// Rows kept until the next flush; at 1 kHz 4 s.
constexpr std::size_t kMostRows = 4096;
// Who armed and started it belongs to the campaign, too.
constexpr std::size_t kEventsBefore = 32;

std::string stamp(std::int64_t utc_ns) {
    return fmt::format("{:%Y%m%dT%H%M%SZ}",
                       fmt::gmtime(static_cast<std::time_t>(utc_ns / drivers::kSecond)));
}

}  // namespace

bool SentTap::send(const canfd_frame& frame, bool fd) noexcept {
    const bool sent = port_.send(frame, fd);
    if (sent) {
        FrameRecord record;
        record.frame = frame;
        record.time = clock_.now();
        record.fd = fd;
        record.sent = true;
        to_.try_push(record);
    }
    return sent;
}

Recorder::Recorder(const Settings& settings, std::string folder, const drivers::Clock& clock,
                   drivers::Waiter& self, Event on_event)
    : settings_(settings),
      folder_(std::move(folder)),
      clock_(clock),
      self_(self),
      on_event_(std::move(on_event)) {
    shown_.folder = folder_;
    shown_.good = true;
    show();
}

Recorder::~Recorder() { stop(); }

void Recorder::start() {
    thread_ = std::thread([this] { loop(); });
    ::pthread_setname_np(thread_.native_handle(), "recorder");
}

void Recorder::stop() noexcept {
    stop_.store(true);
    self_.notify();
    if (thread_.joinable()) thread_.join();
}

void Recorder::put(Entry entry) {
    {
        const std::lock_guard lock(mutex_);
        if (waiting_.size() >= kMostWaiting) {
            ++status_.entries_dropped;
            return;
        }
        waiting_.push_back(std::move(entry));
    }
    self_.notify();
}

void Recorder::campaign_begun(Head head) { put(std::move(head)); }
void Recorder::ordered(const rt::DwellOrder& order, Time now) {
    put(Order{now, order.from, order.to, order.dwell.run, order.dwell.position, order.dwell.table_g,
              order.cancel});
}
void Recorder::dwell_done(Dwell dwell) { put(std::move(dwell)); }
void Recorder::event(const EventRecord& event) { put(event); }
void Recorder::campaign_ended(const std::string& state, const std::string& reason,
                              const std::string& result_json, std::int64_t utc_ns) {
    put(Ended{state, reason, result_json, utc_ns});
}

RecorderStatus Recorder::status() const {
    const std::lock_guard lock(mutex_);
    RecorderStatus status = status_;
    status.samples_dropped = samples_.counts().dropped;
    status.frames_dropped = received_.counts().dropped + sent_.counts().dropped;
    return status;
}

void Recorder::show() {
    shown_.good = !told_bad_;
    if (raw_) {
        shown_.frames = raw_->frames();
        shown_.frames_lost = raw_->lost();
        shown_.raw_bytes = raw_->bytes();
    }
    const std::lock_guard lock(mutex_);
    const auto dropped = status_.entries_dropped;
    status_ = shown_;
    status_.entries_dropped = dropped;
}

void Recorder::loop() {
    while (!stop_.load()) {
        std::deque<Entry> entries;
        {
            const std::lock_guard lock(mutex_);
            entries.swap(waiting_);
        }
        for (Entry& entry : entries) {
            // What came before belongs to what was before.
            if (std::holds_alternative<Head>(entry) || std::holds_alternative<Ended>(entry))
                drain();
            std::visit([this](auto& e) { take(e); }, entry);
        }
        drain();
        look_at_estimate();
        commit(false);
        show();
        self_.wait_until(clock_.now() + kPeriod);
    }
    drain();
    std::deque<Entry> entries;
    {
        const std::lock_guard lock(mutex_);
        entries.swap(waiting_);
    }
    for (Entry& entry : entries) std::visit([this](auto& e) { take(e); }, entry);
    if (head_) take(Ended{"interrupted", "the daemon ended", "", head_->utc_ns});
    show();
}

/// Both directions in the order of time, as far as they are there.
void Recorder::drain() {
    const bool logging = raw_ != nullptr;
    const auto keep = [&](const FrameRecord& record) { late_sent_.push_back(record); };
    while (sent_.consume(keep) > 0) {
    }
    const auto sent_until = [&](Time time) {
        while (!late_sent_.empty() && late_sent_.front().time <= time) {
            if (logging) raw_->add(late_sent_.front());
            late_sent_.pop_front();
        }
    };
    const auto log = [&](const FrameRecord& record) {
        sent_until(record.time - 1);
        if (logging) raw_->add(record);
    };
    while (received_.consume(log, 256) > 0) {
    }
    if (!logging) late_sent_.clear();
    sent_until(clock_.now() - kPeriod);
    while (samples_.consume([this](const drivers::Sample& sample) { take(sample); }, 256) > 0) {
    }
}

void Recorder::take(const drivers::Sample& sample) {
    if (!head_) return;
    newest_sample_ = sample.time;
    if (sample.dropped_before > 0) {
        Gap gap;
        gap.from = gap.to = sample.time;
        gap.stream = "samples";
        gap.lost = sample.dropped_before;
        gap.reason = "ring full";
        shown_.samples_lost += gap.lost;
        write_gap(gap);
    }
    if (writer_) {
        writer_->sample(sample);
        if (writer_->samples_waiting() >= kMostRows) commit(true);
        return;
    }
    if (lost_.lost++ == 0) lost_.from = sample.time;
    lost_.to = sample.time;
    ++shown_.samples_lost;
}

bool Recorder::room() {
    const std::string why = lack_of_room(campaign_folder_, settings_.keep_free_mb);
    if (!why.empty()) refuse(why);
    return why.empty();
}

/// What was not written yet is lost. The file so far stays; another goes on when the disk does.
void Recorder::refuse(const std::string& why) {
    if (writer_) {
        lost_.lost += writer_->samples_waiting();
        shown_.samples_lost += writer_->samples_waiting();
        if (lost_.from == 0) lost_.from = newest_sample_;
        lost_.to = newest_sample_;
        writer_.reset();
    }
    lost_.stream = "samples";
    lost_.reason = why;
    shown_.note = why;
    retry_wall_ns_ = wall_ns() + kRetryNs;
    if (!std::exchange(told_bad_, true)) on_event_(Severity::alarm, why);
}

bool Recorder::open_file() {
    const std::string name = part_ == 0 ? "campaign.h5" : fmt::format("campaign-{}.h5", part_ + 1);
    const std::string path = campaign_folder_ + "/" + name;
    try {
        std::filesystem::create_directories(campaign_folder_);
        if (!room()) return false;
        writer_ = std::make_unique<CampaignWriter>(path, *head_);
    } catch (const std::exception& error) {
        std::error_code ignored;
        if (!writer_) std::filesystem::remove(path, ignored);
        refuse(error.what());
        return false;
    }
    ++part_;
    shown_.file = path;
    return true;
}

void Recorder::take(Head& head) {
    if (head_) take(Ended{"interrupted", "another campaign began", "", head.utc_ns});
    head_ = std::move(head);
    std::string base = folder_ + "/" + head_->name + "-" + stamp(head_->utc_ns);
    campaign_folder_ = base;
    // A folder that cannot be looked at is met again, and told, when the file is opened.
    std::error_code unknown;
    for (int i = 2; std::filesystem::exists(campaign_folder_, unknown); ++i)
        campaign_folder_ = fmt::format("{}-{}", base, i);
    part_ = 0;
    lost_ = {};
    told_bad_ = false;
    shown_ = {};
    shown_.folder = folder_;
    shown_.recording = true;
    estimate_samples_ = 0;
    if (open_file()) {
        for (const EventRecord& event : before_) writer_->event(event);
    }
    before_.clear();
    if (settings_.raw)
        raw_ = std::make_unique<RawLog>(campaign_folder_, head_->interface, settings_,
                                        head_->utc_offset_ns,
                                        [this](const Segment&) { ++shown_.segments; });
    committed_wall_ns_ = wall_ns();
}

/// Beside the raw log, in its times: which frames belong to which dwell.
void Recorder::write_order_line(const Order& order) {
    const std::string path = campaign_folder_ + "/dwells.csv";
    std::FILE* file = std::fopen(path.c_str(), "a");
    if (file == nullptr) return;
    if (std::ftell(file) == 0)
        std::fputs("run,position,table_g,from_s,to_s,cancelled_s,utc_offset_us\n", file);
    const auto us = [&](Time time) {
        return (time + head_->utc_offset_ns) / drivers::kMicrosecond;
    };
    const auto seconds = [](std::int64_t t) {
        return fmt::format("{}.{:06d}", t / 1'000'000, t % 1'000'000);
    };
    const std::string line = fmt::format("{},{},{},{},{},{},{}\n", order.run, order.position,
                                         order.table_g, order.cancel ? "" : seconds(us(order.from)),
                                         order.cancel ? "" : seconds(us(order.to)),
                                         order.cancel ? seconds(us(order.announced)) : "",
                                         head_->utc_offset_ns / drivers::kMicrosecond);
    std::fputs(line.c_str(), file);
    std::fclose(file);
}

void Recorder::take(const Order& order) {
    if (writer_) writer_->order(order);
    if (head_ && raw_) write_order_line(order);
}
void Recorder::take(const Dwell& dwell) {
    if (writer_) writer_->dwell(dwell);
}
void Recorder::take(const EventRecord& event) {
    if (writer_) {
        writer_->event(event);
    } else if (!head_) {
        before_.push_back(event);
        if (before_.size() > kEventsBefore) before_.pop_front();
    }
}

void Recorder::write_gap(const Gap& gap) {
    ++shown_.gaps;
    if (writer_) writer_->gap(gap);
}

void Recorder::look_at_estimate() {
    if (!head_ || !writer_ || !estimates_) return;
    const estimator::Estimate e = estimates_();
    if (e.samples == estimate_samples_ || newest_sample_ - estimate_at_ < kEstimatePeriod) return;
    estimate_samples_ = e.samples;
    estimate_at_ = newest_sample_;
    writer_->estimate({newest_sample_, e.amplitude_g, e.frequency_hz, e.kappa, e.nis_per_dof,
                       e.innovation_arcsec, e.value, e.sigma});
}

void Recorder::commit(bool all) {
    if (!head_) return;
    const std::int64_t now = wall_ns();
    if (!all && now - committed_wall_ns_ < static_cast<std::int64_t>(settings_.flush_s * 1e9))
        return;
    committed_wall_ns_ = now;
    if (raw_) {
        const bool was_good = raw_->good();
        raw_->flush();
        Gap gap;
        while (raw_->take_gap(gap)) write_gap(gap);
        if (was_good != raw_->good())
            on_event_(raw_->good() ? Severity::info : Severity::alarm,
                      raw_->good() ? "the raw log is written again" : raw_->note());
        if (!raw_->good()) shown_.note = raw_->note();
    }
    if (!writer_ && now >= retry_wall_ns_ && open_file()) {
        lost_.stream = "samples";
        if (lost_.lost > 0) write_gap(std::exchange(lost_, {}));
        shown_.note.clear();
        if (std::exchange(told_bad_, false))
            on_event_(Severity::info, fmt::format("writes again, to {}", shown_.file));
    }
    if (!writer_ || !room()) return;
    try {
        const auto rows = writer_->samples_waiting();
        writer_->commit();
        shown_.samples += rows;
    } catch (const hdf5::Error& error) {
        refuse(error.what());
    }
}

void Recorder::take(const Ended& ended) {
    if (!head_) return;
    sent_.consume([this](const FrameRecord& record) { late_sent_.push_back(record); }, 1024);
    for (const FrameRecord& record : late_sent_) {
        if (raw_) raw_->add(record);
    }
    late_sent_.clear();
    commit(true);
    if (raw_) raw_->close();
    if (writer_) {
        try {
            writer_->end(ended.state, ended.reason, ended.result, ended.utc_ns);
        } catch (const hdf5::Error& error) {
            refuse(error.what());
        }
    }
    show();
    writer_.reset();
    raw_.reset();
    head_.reset();
    shown_.recording = false;
    on_event_(lost_.lost > 0 ? Severity::warning : Severity::info,
              fmt::format("{}: {} samples, {} frames, {} lost", shown_.file, shown_.samples,
                          shown_.frames, shown_.samples_lost + shown_.frames_lost));
}

}  // namespace vibrig::record
