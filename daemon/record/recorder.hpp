#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>

#include "daemon/configuration/record_settings.hpp"
#include "daemon/domain/events.hpp"
#include "daemon/domain/services.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/index.hpp"
#include "daemon/record/raw_log.hpp"
#include "daemon/record/records.hpp"
#include "daemon/rt/ring.hpp"
#include "drivers/base/clock.hpp"
#include "drivers/base/snapshot.hpp"
#include "drivers/can/can_port.hpp"

namespace vibrig::record {

/// Sends through another port and tells the recorder. Control thread only.
class SentTap final : public drivers::CanPort {
  public:
    SentTap(drivers::CanPort& port, const drivers::Clock& clock, rt::Ring<FrameRecord>& to)
        : port_(port), clock_(clock), to_(to) {}
    void start(FrameHandler, StateHandler, ErrorHandler) override {}
    void stop() noexcept override {}
    [[nodiscard]] bool send(const canfd_frame& frame, bool fd) noexcept override;
    [[nodiscard]] drivers::CanPortCounters counters() const noexcept override {
        return port_.counters();
    }
    [[nodiscard]] drivers::PortState state() const noexcept override { return port_.state(); }

  private:
    drivers::CanPort& port_;
    const drivers::Clock& clock_;
    rt::Ring<FrameRecord>& to_;
};

/// Writes campaigns to disk on a thread of its own: raw frames as candump logs, the rest as HDF5.
/// Whoever feeds it never waits for the disk; what the disk refuses is counted and, once it writes
/// again, noted in the recording.
class Recorder {
  public:
    using Estimates = std::function<estimator::Estimate()>;
    using Conditions = std::function<ConditionRow()>;

    /// `folder`: where campaigns' folders go. `on_event` is called in the recorder's thread.
    Recorder(const configuration::RecordSettings& settings, std::string folder,
             const drivers::Clock& clock, drivers::Waiter& self, EventSink on_event);
    ~Recorder();

    /// Acquisition pushes what it received, ...
    [[nodiscard]] rt::Ring<FrameRecord>& received() noexcept { return received_; }
    [[nodiscard]] rt::Ring<drivers::Sample>& samples() noexcept { return samples_; }
    /// ... control what it sent.
    [[nodiscard]] rt::Ring<FrameRecord>& sent() noexcept { return sent_; }
    /// Before start(): where the state of the filter, and what is around the measurement, are
    /// looked at, in the recorder's thread.
    void watch(Estimates estimates, Conditions conditions) {
        estimates_ = std::move(estimates);
        conditions_ = std::move(conditions);
    }
    /// Likewise the signed head of the journal, for what is recorded, once the entry of this number
    /// is in it.
    using JournalHead = std::function<std::optional<std::string>(std::uint64_t entry)>;
    void sign_with(JournalHead journal_head) { journal_head_ = std::move(journal_head); }

    void start();
    /// Writes what there is and ends the thread.
    void stop() noexcept;

    // Control thread; they queue.
    void campaign_begun(Head head);
    void ordered(const rt::DwellOrder& order, drivers::Time now,
                 const estimator::NoiseLevels& noise);
    void dwell_done(Dwell dwell);
    void swept(Swept swept);
    void played(Played played);
    void event(const EventRecord& event);
    void campaign_ended(Ended ended);

    [[nodiscard]] RecorderStatus status() const;
    /// For how long it has not gone on, s, because the disk does not answer or the thread does not
    /// run; 0: it does. Any thread.
    [[nodiscard]] double stuck_s() const noexcept;
    /// The disk refuses, or it does not go on. Any thread.
    [[nodiscard]] bool degraded() const noexcept { return reported_bad_.load() || stuck_s() > 0; }

    static constexpr std::size_t kMostWaiting = 10'000;

  private:
    using Entry = std::variant<Head, Order, Dwell, Swept, Played, EventRecord, Ended>;

    void put(Entry entry);
    void loop();
    void drain();
    void take(Head& head);
    void find_folder();
    void close_previous();
    void note(const std::string& path);
    [[nodiscard]] std::string journal_head(std::uint64_t entry = 0);
    void take(const Order& order);
    void take(const Dwell& dwell);
    void take(const Swept& swept);
    void take(const Played& played);
    void take(const EventRecord& event);
    void take(const Ended& ended);
    void take(const drivers::Sample& sample);
    void look_at_estimate();
    void look_around();
    void commit(bool all);
    void write_rows();
    [[nodiscard]] bool open_file();
    void refuse(const std::string& why);
    void write_gap(const Gap& gap);
    void append_dwells(const std::string& line);
    void append_late_lines();
    void write_kept();
    void keep_few();
    void show();
    void alive() noexcept;
    void judge_disk();
    [[nodiscard]] bool room();

    const configuration::RecordSettings settings_;
    const std::string folder_;
    const drivers::Clock& clock_;
    drivers::Waiter& self_;
    EventSink on_event_;
    Estimates estimates_;
    Conditions conditions_;
    JournalHead journal_head_;
    rt::Ring<FrameRecord> received_{65536};
    rt::Ring<FrameRecord> sent_{1024};
    rt::Ring<drivers::Sample> samples_{16384};

    // The recorder's thread.
    std::optional<Head> head_;  ///< of the campaign in progress
    std::string campaign_folder_;
    int part_ = 0;  ///< files of this campaign so far
    std::unique_ptr<CampaignWriter> writer_;
    std::unique_ptr<Index> index_;  ///< null until it could be opened
    bool reported_index_ = false;
    std::unique_ptr<RawLog> raw_;
    std::deque<FrameRecord> late_sent_;
    /// What goes into the file once it can be written: few and small, unlike the samples.
    std::deque<std::variant<Order, Dwell, Swept, Played, EventRecord, Gap>> kept_;
    std::deque<std::string> late_lines_;  ///< of dwells.csv, that the disk has not taken
    std::int64_t committed_steady_ns_ = 0, retry_steady_ns_ = 0;
    drivers::Time newest_sample_ = 0, estimate_at_ = 0, looked_around_at_ = 0;
    std::uint64_t estimate_samples_ = 0;
    Gap lost_;                   ///< samples that could not be written
    std::uint64_t at_risk_ = 0;  ///< samples given to the file since it last went to the disk
    bool commit_now_ = false;
    RecorderStatus shown_;

    std::atomic<bool> reported_bad_{false};  ///< set by its thread
    std::atomic<bool> stop_{false};
    /// When its thread last went on, in wall time; 0: it waits for something to do.
    std::atomic<std::int64_t> alive_steady_ns_{0};
    std::atomic<drivers::Time> due_{0};  ///< when it will look again, in the daemon's time
    mutable std::mutex mutex_;
    std::deque<Entry> waiting_;
    RecorderStatus status_;
    std::thread thread_;
};

}  // namespace vibrig::record
