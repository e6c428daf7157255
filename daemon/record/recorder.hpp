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

#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/raw_log.hpp"
#include "daemon/record/records.hpp"
#include "daemon/record/settings.hpp"
#include "daemon/rt/ring.hpp"
#include "daemon/rt/snapshot.hpp"
#include "daemon/status.hpp"
#include "drivers/can_port.hpp"
#include "drivers/clock.hpp"

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
/// again, told in the recording.
class Recorder {
  public:
    using Event = std::function<void(Severity, const std::string&)>;
    using Estimates = std::function<estimator::Estimate()>;

    /// `folder`: where campaigns' folders go. `on_event` is called in the recorder's thread.
    Recorder(const Settings& settings, std::string folder, const drivers::Clock& clock,
             drivers::Waiter& self, Event on_event);
    ~Recorder();

    /// Acquisition pushes what it received, ...
    [[nodiscard]] rt::Ring<FrameRecord>& received() noexcept { return received_; }
    [[nodiscard]] rt::Ring<drivers::Sample>& samples() noexcept { return samples_; }
    /// ... control what it sent.
    [[nodiscard]] rt::Ring<FrameRecord>& sent() noexcept { return sent_; }
    /// Before start(): where the state of the filter is looked at.
    void watch(Estimates estimates) { estimates_ = std::move(estimates); }

    void start();
    /// Writes what there is and ends the thread.
    void stop() noexcept;

    // Control thread; they queue.
    void campaign_begun(Head head);
    void ordered(const rt::DwellOrder& order, drivers::Time now);
    void dwell_done(Dwell dwell);
    void event(const EventRecord& event);
    void campaign_ended(const std::string& state, const std::string& reason,
                        const std::string& result_json, std::int64_t utc_ns);

    [[nodiscard]] RecorderStatus status() const;

    static constexpr std::size_t kMostWaiting = 10'000;

  private:
    struct Ended {
        std::string state, reason, result;
        std::int64_t utc_ns = 0;
    };
    using Entry = std::variant<Head, Order, Dwell, EventRecord, Ended>;

    void put(Entry entry);
    void loop();
    void drain();
    void take(Head& head);
    void take(const Order& order);
    void take(const Dwell& dwell);
    void take(const EventRecord& event);
    void take(const Ended& ended);
    void take(const drivers::Sample& sample);
    void look_at_estimate();
    void commit(bool all);
    [[nodiscard]] bool open_file();
    void refuse(const std::string& why);
    void write_gap(const Gap& gap);
    void write_order_line(const Order& order);
    void show();
    [[nodiscard]] bool room();

    const Settings settings_;
    const std::string folder_;
    const drivers::Clock& clock_;
    drivers::Waiter& self_;
    Event on_event_;
    Estimates estimates_;
    rt::Ring<FrameRecord> received_{65536};
    rt::Ring<FrameRecord> sent_{1024};
    rt::Ring<drivers::Sample> samples_{16384};

    // The recorder's thread.
    std::optional<Head> head_;  ///< of the campaign in progress
    std::string campaign_folder_;
    int part_ = 0;  ///< files of this campaign so far
    std::unique_ptr<CampaignWriter> writer_;
    std::unique_ptr<RawLog> raw_;
    std::deque<FrameRecord> late_sent_;
    std::deque<EventRecord> before_;  ///< the newest events while nothing is recorded
    std::int64_t committed_wall_ns_ = 0, retry_wall_ns_ = 0;
    drivers::Time newest_sample_ = 0, estimate_at_ = 0;
    std::uint64_t estimate_samples_ = 0;
    Gap lost_;  ///< samples that could not be written
    bool told_bad_ = false;
    RecorderStatus shown_;

    std::atomic<bool> stop_{false};
    mutable std::mutex mutex_;
    std::deque<Entry> waiting_;
    RecorderStatus status_;
    std::thread thread_;
};

}  // namespace vibrig::record
