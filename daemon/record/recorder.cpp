#include "daemon/record/recorder.hpp"

#include <pthread.h>
#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <thread>
#include <utility>

#include "daemon/dwells/anew.hpp"
#include "daemon/record/campaign_file.hpp"
#include "daemon/record/disk.hpp"
#include "daemon/record/dwells_csv.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

// In the daemon's time: a simulated rig waits for this thread as for any other.
constexpr Time kPeriod = drivers::kSecond / 4;
constexpr Time kEstimatePeriod = drivers::kSecond;
constexpr Time kConditionPeriod = drivers::kSecond;
// Rows kept until the next flush; at 1 kHz 4 s.
constexpr std::size_t kMostRows = 4096;
// Who armed and started it belongs to the campaign, too.
constexpr std::size_t kEventsBefore = 32;
// While the disk refuses: at 8 kB for a dwell 32 MB.
constexpr std::size_t kMostKept = 4096;
// A disk that takes longer for one thing does not answer.
constexpr std::int64_t kPatience_ns = 400'000'000;
// A thread that wakes later than this does not get to run.
constexpr Time kLate = 2 * drivers::kSecond;

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

Recorder::Recorder(const configuration::RecordSettings& settings, std::string folder,
                   const drivers::Clock& clock, drivers::Waiter& self, EventSink on_event)
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
void Recorder::ordered(const rt::DwellOrder& order, Time now, const estimator::NoiseLevels& noise) {
    put(Order{now,
              order.from,
              order.to,
              order.dwell.run,
              order.dwell.position,
              order.dwell.table_g,
              order.cancel,
              order.zero_g,
              order.level_sigma_g,
              noise,
              order.dwell.begin_s,
              order.dwell.power_lost,
              order.dwell.frequency_hz,
              order.dwell.held_out,
              order.dwell.random,
              order.dwell.sweep,
              std::nullopt,
              {}});
}
void Recorder::dwell_done(Dwell dwell) { put(std::move(dwell)); }
void Recorder::swept(Swept swept) { put(std::move(swept)); }
void Recorder::played(Played played) { put(std::move(played)); }
void Recorder::event(const EventRecord& event) { put(event); }
void Recorder::campaign_ended(Ended ended) { put(std::move(ended)); }

RecorderStatus Recorder::status() const {
    const std::lock_guard lock(mutex_);
    RecorderStatus status = status_;
    if (const double stuck = stuck_s(); stuck > 0) {
        status.good = false;
        status.note = fmt::format("{}: no answer for {:.1f} s", folder_, stuck);
    }
    status.samples_dropped = samples_.counts().dropped;
    status.frames_dropped = received_.counts().dropped + sent_.counts().dropped;
    return status;
}

void Recorder::show() {
    shown_.good = !reported_bad_;
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

double Recorder::stuck_s() const noexcept {
    if (const auto since = alive_steady_ns_.load(); since != 0) {
        const auto age = drivers::steady_now() - since;
        return age > kPatience_ns ? static_cast<double>(age) * 1e-9 : 0;
    }
    const Time due = due_.load();
    const Time late = due == 0 ? 0 : clock_.now() - due;
    return late > kLate ? drivers::to_seconds(late) : 0;
}

void Recorder::alive() noexcept { alive_steady_ns_.store(drivers::steady_now()); }

void Recorder::loop() {
    while (!stop_.load()) {
        alive();
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
        look_around();
        keep_few();
        commit(std::exchange(commit_now_, false));
        show();
        const Time next = clock_.now() + kPeriod;
        due_.store(next);
        alive_steady_ns_.store(0);
        self_.wait_until(next);
    }
    due_.store(0);
    drain();
    std::deque<Entry> entries;
    {
        const std::lock_guard lock(mutex_);
        entries.swap(waiting_);
    }
    for (Entry& entry : entries) std::visit([this](auto& e) { take(e); }, entry);
    if (head_) take(Ended{"interrupted", "the daemon ended", "", "", head_->utc_ns});
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
        shown_.samples_lost += sample.dropped_before;
        write_gap({sample.time, sample.time, "samples", sample.dropped_before, "ring full"});
    }
    if (writer_) {
        writer_->put(sample);
        ++at_risk_;
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
        lost_.lost += at_risk_;
        shown_.samples_lost += at_risk_;
        at_risk_ = 0;
        if (lost_.from == 0) lost_.from = newest_sample_;
        lost_.to = newest_sample_;
        writer_.reset();
    }
    lost_.stream = "samples";
    if (lost_.reason.empty()) lost_.reason = why;
    shown_.note = why;
    retry_steady_ns_ = drivers::steady_now() + kRetryNs;
}

/// Both kinds of files are on one disk: what it refuses and that it takes again is reported once.
void Recorder::judge_disk() {
    const bool raw_good = !raw_ || raw_->good();
    if (writer_ && raw_good) {
        shown_.note.clear();
        if (reported_bad_.exchange(false))
            on_event_(Severity::info, fmt::format("writes again, to {}", shown_.file));
    } else {
        if (writer_) shown_.note = raw_->note();
        if (!reported_bad_.exchange(true)) on_event_(Severity::alarm, shown_.note);
    }
}

bool Recorder::open_file() {
    const std::string path = campaign_folder_ + "/" + part_name(part_ + 1);
    try {
        std::filesystem::create_directories(campaign_folder_);
        if (!room()) return false;
        Head head = *head_;
        head.part = part_ + 1;
        writer_ = std::make_unique<CampaignWriter>(path, head);
        write_kept();
    } catch (const std::exception& error) {
        writer_.reset();
        std::error_code ignored;
        std::filesystem::remove(path, ignored);
        refuse(error.what());
        return false;
    }
    close_previous();
    // Only the first file of this life goes on from another one's dwells.
    head_->restart = false;
    head_->dwells_before = 0;
    ++part_;
    shown_.file = path;
    note(path);
    return true;
}

/// A new one; or that of the campaign that goes on, with its next part.
void Recorder::find_folder() {
    part_ = 0;
    const std::string base = folder_ + "/" + head_->name + "-" + stamp(head_->utc_ns);
    campaign_folder_ = base;
    if (head_->restart) {
        if (const auto found = interrupted_campaign(folder_, *head_)) {
            campaign_folder_ = found->folder;
            part_ = found->head.part;
            head_->campaign = found->head.campaign;
            if (head_->clock == "rig") {
                // The rig's time went on, faster or slower than ours.
                const auto late = head_->utc_ns - head_->utc_offset_ns;
                head_->utc_offset_ns = found->head.utc_offset_ns;
                head_->utc_ns = late + head_->utc_offset_ns;
            }
            return;
        }
        on_event_(
            Severity::alarm,
            fmt::format("{}: found no recording of the {} dwells before the restart, expected "
                        "campaign {}: it will not replay as a whole",
                        folder_, head_->dwells_before, head_->name));
    }
    // A folder that cannot be looked at is met again, and reported, when the file is opened.
    std::error_code unknown;
    for (int i = 2; std::filesystem::exists(campaign_folder_, unknown); ++i)
        campaign_folder_ = fmt::format("{}-{}", base, i);
    head_->campaign = std::filesystem::path(campaign_folder_).filename().string();
}

/// An index that cannot be written costs nothing but a rebuild.
void Recorder::note(const std::string& path) {
    try {
        if (!index_)
            index_ = std::make_unique<Index>(
                folder_, [this](const std::string& words) { on_event_(Severity::warning, words); });
        index_->note_file(path);
        reported_index_ = false;
    } catch (const std::exception& error) {
        index_.reset();
        if (!std::exchange(reported_index_, true))
            on_event_(Severity::warning,
                      fmt::format("index: {}; vibrig recover makes it anew", error.what()));
    }
}

/// Of another life, or given up when the disk refused: others can read it once it is closed.
void Recorder::close_previous() {
    if (part_ == 0) return;
    const std::string previous = campaign_folder_ + "/" + part_name(part_);
    try {
        close_part(previous, part_name(part_ + 1));
        note(previous);
    } catch (const std::exception& error) {
        on_event_(Severity::warning, error.what());
    }
}

void Recorder::take(Head& head) {
    if (head_) take(Ended{"interrupted", "another campaign began", "", "", head.utc_ns});
    head_ = std::move(head);
    head_->journal_head = journal_head();
    find_folder();
    const std::size_t going_on = head_->dwells_before;
    lost_ = {};
    at_risk_ = 0;
    reported_bad_ = false;
    shown_ = {};
    shown_.folder = folder_;
    shown_.recording = true;
    estimate_samples_ = 0;
    looked_around_at_ = 0;
    // What stands there is to be read by others while it is written.
    if (open_file()) commit(true);
    if (settings_.raw && going_on > 0) append_dwells(restart_line(going_on));
    if (settings_.raw)
        raw_ = std::make_unique<RawLog>(
            campaign_folder_, head_->interface, settings_, head_->utc_offset_ns,
            [this](const Segment& segment) {
                ++shown_.segments;
                note(campaign_folder_ + "/" + segment.file);
            },
            [this] { alive(); });
    committed_steady_ns_ = drivers::steady_now();
}

/// What the disk refuses is tried again, in its order, with the next line and at each commit.
void Recorder::append_dwells(const std::string& line) {
    late_lines_.push_back(line);
    if (late_lines_.size() > kMostKept) late_lines_.pop_front();
    append_late_lines();
}

void Recorder::append_late_lines() {
    const std::string path = campaign_folder_ + "/dwells.csv";
    while (!late_lines_.empty()) {
        std::FILE* file = std::fopen(path.c_str(), "a");
        if (file == nullptr) return;
        const long before = std::ftell(file);
        std::string text = late_lines_.front();
        if (before == 0) text = std::string(kDwellsHeader) + '\n' + text;
        const bool taken = std::fputs(text.c_str(), file) >= 0;
        if (std::fclose(file) != 0 || !taken) {
            // A line that is half there would be believed, or refused, by who reads it.
            if (::truncate(path.c_str(), before) != 0) late_lines_.pop_front();
            return;
        }
        late_lines_.pop_front();
    }
}

void Recorder::take(const Order& order) {
    if (!head_) return;
    kept_.push_back(order);
    if (raw_) append_dwells(order_line(order, head_->utc_offset_ns));
}

void Recorder::take(const Dwell& dwell) {
    if (!head_) return;
    kept_.push_back(dwell);
    // The journal goes on from here after a crash: so must the recording.
    commit_now_ = true;
}

void Recorder::take(const Swept& swept) {
    if (!head_) return;
    kept_.push_back(swept);
    if (!raw_ || swept.empty()) return;
    append_dwells(swept_line(swept, head_->utc_offset_ns));
}

void Recorder::take(const Played& played) {
    if (!head_) return;
    kept_.push_back(played);
    if (raw_) append_dwells(played_line(played));
}

void Recorder::take(const EventRecord& event) { kept_.push_back(event); }

/// Without a campaign the newest; without a disk as many as memory has for them.
void Recorder::keep_few() {
    const std::size_t most = head_ ? kMostKept : kEventsBefore;
    while (kept_.size() > most) {
        kept_.pop_front();
        if (!head_) continue;
        const std::lock_guard lock(mutex_);
        ++status_.entries_dropped;
    }
}

/// Throws. What the file did not take is kept for the next one.
void Recorder::write_kept() {
    for (const auto& entry : kept_) std::visit([this](const auto& e) { writer_->put(e); }, entry);
    writer_->commit();
    kept_.clear();
}

void Recorder::write_gap(const Gap& gap) {
    ++shown_.gaps;
    kept_.push_back(gap);
}

void Recorder::look_at_estimate() {
    if (!head_ || !writer_ || !estimates_) return;
    const estimator::Estimate e = estimates_();
    if (e.samples == estimate_samples_ || newest_sample_ - estimate_at_ < kEstimatePeriod) return;
    estimate_samples_ = e.samples;
    estimate_at_ = newest_sample_;
    writer_->put(EstimateRow{newest_sample_, e.amplitude_g, e.frequency_hz, e.kappa, e.nis_per_dof,
                             e.innovation_arcsec, e.value, e.sigma});
}

void Recorder::look_around() {
    const Time now = clock_.now();
    if (!head_ || !writer_ || !conditions_ || now - looked_around_at_ < kConditionPeriod) return;
    looked_around_at_ = now;
    writer_->put(conditions_());
}

void Recorder::commit(bool all) {
    if (!head_) return;
    const std::int64_t now = drivers::steady_now();
    if (!all && now - committed_steady_ns_ < static_cast<std::int64_t>(settings_.flush_s * 1e9))
        return;
    committed_steady_ns_ = now;
    alive();
    if (raw_) raw_->flush();
    append_late_lines();
    alive();
    if (!writer_ && now >= retry_steady_ns_ && open_file()) {
        lost_.stream = "samples";
        if (lost_.lost > 0) write_gap(std::exchange(lost_, {}));
    }
    Gap gap;
    while (writer_ && raw_ && raw_->take_gap(gap)) write_gap(gap);
    write_rows();
    judge_disk();
}

void Recorder::write_rows() {
    if (!writer_ || !room()) return;
    try {
        write_kept();
        shown_.samples += std::exchange(at_risk_, 0);
    } catch (const hdf5::Error& error) {
        refuse(error.what());
    }
}

/// With the entry in it; where the journal's disk does not take that in time, as it is.
std::string Recorder::journal_head(std::uint64_t entry) {
    if (!journal_head_) return "";
    constexpr std::int64_t kDiskPatience_ns = 2'000'000'000;
    const std::int64_t until = drivers::steady_now() + kDiskPatience_ns;
    auto head = journal_head_(entry);
    for (; !head && drivers::steady_now() < until; head = journal_head_(entry)) {
        alive();
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return head ? *head : journal_head_(0).value_or("");
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
    const auto found = dwells::noise_found_in(ended.result_json);
    if (settings_.raw && found) append_dwells(anew_line(*found));
    if (writer_) {
        try {
            Ended signed_end = ended;
            signed_end.journal_head = journal_head(ended.journal_entry);
            writer_->end(signed_end);
            note(writer_->path());
        } catch (const hdf5::Error& error) {
            refuse(error.what());
        }
    }
    show();
    writer_.reset();
    raw_.reset();
    head_.reset();
    // What no file took of this campaign is not the next one's.
    const std::size_t dropped = std::erase_if(
        kept_, [](const auto& entry) { return !std::holds_alternative<EventRecord>(entry); });
    {
        const std::lock_guard lock(mutex_);
        status_.entries_dropped += dropped;
    }
    late_lines_.clear();
    shown_.recording = false;
    on_event_(lost_.lost > 0 ? Severity::warning : Severity::info,
              fmt::format("{}: {} samples, {} frames, {} lost",
                          shown_.file.empty() ? "no file" : shown_.file, shown_.samples,
                          shown_.frames, shown_.samples_lost + shown_.frames_lost));
}

}  // namespace vibrig::record
