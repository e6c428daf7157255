#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "drivers/base/snapshot.hpp"
#include "drivers/shaker/modbus_link.hpp"
#include "drivers/shaker/shaker.hpp"
#include "drivers/shaker/shaker_image.hpp"
#include "drivers/shaker/shaker_orders.hpp"

namespace vibrig::drivers {

/// The shaker's thread: one request at a time, the most urgent first; in between it sleeps on the
/// clock.
class ModbusShaker final : public Shaker {
  public:
    ModbusShaker(Clock& clock, const ShakerSettings& settings);
    ~ModbusShaker() override;

    void start(std::function<bool()> may_feed, StateHandler on_state) override;
    [[nodiscard]] bool request(const ShakerSetPoint& set_point,
                               std::uint64_t stops) noexcept override;
    void stop_now() noexcept override;
    void hang_up_until(Time time) noexcept override;
    void read_only(bool on) noexcept override { read_only_ = on; }
    [[nodiscard]] std::uint64_t stops() const noexcept override { return orders_.ticket().stops(); }
    [[nodiscard]] bool stop_pending() const noexcept override { return orders_.stop_pending(); }
    [[nodiscard]] bool busy() const noexcept override { return orders_.busy(); }
    [[nodiscard]] ShakerReading reading() const noexcept override;
    [[nodiscard]] ShakerCounters counters() const noexcept override;
    [[nodiscard]] LinkState state() const noexcept override { return state_.load(); }
    void on_reading(std::function<void()> wake) override { on_reading_ = std::move(wake); }
    void on_judging(std::function<void(const ShakerReading&)> judge) override {
        on_judging_ = std::move(judge);
    }
    void on_stop_written(std::function<void()> confirmed) override {
        on_stop_written_ = std::move(confirmed);
    }
    [[nodiscard]] std::uint64_t beats() const noexcept override { return beats_; }
    [[nodiscard]] ShakerIdentity identity() const override;
    std::uint64_t read_psd() noexcept override;
    [[nodiscard]] ShakerPsd psd() const override;
    void shut_down() noexcept override;

  private:
    struct Count {
        std::atomic<std::uint64_t> value{0};
        void operator++() noexcept { value.fetch_add(1, std::memory_order_relaxed); }
        operator std::uint64_t() const noexcept { return value.load(std::memory_order_relaxed); }
    };
    struct Counts {
        Count requests, replies, timeouts, exceptions, reconnects, set_points_discarded, feeds,
            stops_written, read_back_mismatches, wrong_replies, lost, set_points_written;
    };
    using Words = std::array<std::uint16_t, 2>;

    void wake() noexcept;
    void run() noexcept;
    void work(Time now);
    void sleep_until(Time deadline) noexcept { waiter_->wait_until(deadline); }

    void try_connect(Time now);
    void lose_link(const std::string& why);
    void close_link();
    [[nodiscard]] bool outranked() const noexcept;
    [[nodiscard]] Reply transact(const std::function<Reply()>& request);
    [[nodiscard]] Reply write(const proto::Register& reg, std::span<const std::uint16_t> words);
    [[nodiscard]] Reply read(const proto::Register& reg, std::span<std::uint16_t> words);

    [[nodiscard]] Words present(const proto::Register& reg) noexcept;
    enum class Written : std::uint8_t { as_written, otherwise, not_written };
    /// Writes a register and reads it back; `otherwise` and exceptions leave the state degraded.
    [[nodiscard]] Written write_and_verify(const char* role, const proto::Register& reg,
                                           double value);
    [[nodiscard]] Written verify(const char* role, const proto::Register& reg,
                                 std::span<const std::uint16_t> words);

    void write_stop(Time now);
    [[nodiscard]] Time stop_repeat() const noexcept;
    [[nodiscard]] Reply order_stop(std::span<const std::uint16_t> run);
    [[nodiscard]] Reply try_ramp(std::span<const std::uint16_t> ramp);
    void write_set_point();
    struct Step {
        const char* role;
        const proto::Register& reg;
        double value;
    };
    [[nodiscard]] bool write_steps(const ShakerSetPoint& set_point);
    [[nodiscard]] bool write_each(std::span<const Step> steps);
    /// What chooses the kind of vibration, at rest; of random vibration the checksum is looked at.
    [[nodiscard]] bool choose(const ShakerSetPoint& set_point);
    [[nodiscard]] bool choose_random(const RandomSetPoint& random);
    [[nodiscard]] bool same_kind(const ShakerSetPoint& set_point,
                                 const ShakerReading& now) const noexcept;
    [[nodiscard]] std::string differs(const char* role, const proto::Register& reg,
                                      double commanded);
    void drop_void_set_point() noexcept;
    [[nodiscard]] bool watchdog_due(Time now) const noexcept;
    void serve_watchdog(Time now);
    void write_timeout();
    void check_timeout(Time now);
    /// After so long without a feed the device stops.
    [[nodiscard]] Time watchdog_timeout() const noexcept { return 3 * settings_.watchdog_period; }
    void poll(Time now);
    // shaker_identity.cpp
    void link_is_new();
    [[nodiscard]] bool identity_due() const noexcept;
    void ask_identity();
    // shaker_psd.cpp
    [[nodiscard]] bool psd_due() noexcept;
    void read_psd_part();
    void answer_psd(std::string why_not);
    /// Registers that no longer hold what was commanded; empty: all do.
    [[nodiscard]] std::string changed_by_others(const ShakerReading& reading);

    void settle(const std::string& why);
    void set_state(LinkState state, const std::string& text);

    Clock& clock_;
    ShakerSettings settings_;
    ModbusLink link_;
    ShakerImage image_;
    ShakerOrders orders_;
    Counts counts_;
    Count beats_;
    rt::Snapshot<ShakerReading> latest_;
    std::atomic<LinkState> state_{LinkState::absent};

    std::function<bool()> may_feed_;
    StateHandler on_state_;
    std::function<void()> on_reading_, on_stop_written_;
    std::function<void(const ShakerReading&)> on_judging_;
    std::unique_ptr<Waiter> waiter_;
    // Whoever wakes the thread counts itself in, so that the waiter is not destroyed under it.
    std::atomic<Waiter*> wakeable_{nullptr};
    std::atomic<int> wakers_{0};
    std::atomic<bool> quit_{false};
    std::atomic<bool> in_flight_{false};
    std::atomic<Time> hung_up_until_{0};
    std::atomic<bool> read_only_{false};
    std::thread thread_;
    mutable std::mutex identity_mutex_;
    ShakerIdentity identity_;
    std::atomic<std::uint64_t> psd_asked_{0};  ///< requests so far
    mutable std::mutex psd_mutex_;
    ShakerPsd psd_;

    // The rest belongs to the shaker's thread.
    bool was_connected_ = false;
    bool polled_ = false;  ///< every register has been read since the link was made
    bool looked_ = false;  ///< read once, or tried to, in this process
    bool poll_refused_ = false, feed_refused_ = false;
    bool write_failed_ = false;  ///< until a stop is read back as done
    bool stop_tried_ = false, connect_tried_for_stop_ = false;
    std::uint64_t stops_seen_ = 0;  ///< orders of a stop that this thread has taken up
    bool ramp_tried_ = false;       ///< of the stop at hand
    bool joint_refused_ = false;    ///< the device takes one register at a time
    bool joint_in_vain_ = false;    ///< of the stop at hand: ordered so, and not read back as done
    bool timeout_due_ = false;      ///< the watchdog's timeout is to be written
    WatchdogTimeout timeout_seen_ = WatchdogTimeout::unread;
    double timeout_read_s_ = 0;
    int asks_left_ = 0;                        ///< who it is
    bool closed_by_us_ = false;                ///< the link, or by asking: the device is the same
    std::uint64_t psd_request_ = 0;            ///< that is being read, or was
    int psd_attempts_left_ = 0;                ///< of it; 0: it is answered
    std::vector<std::uint16_t> psd_words_;     ///< of it so far
    std::optional<ShakerSetPoint> commanded_;  ///< in force by our command; none: at rest
    std::uint16_t feed_ = 0;
    Time backoff_ = 0;
    Time next_attempt_ = 0, next_stop_ = 0, next_poll_ = 0, next_feed_ = 0, next_check_ = 0;
    Time last_feed_ = 0, stop_alone_until_ = 0;
};

}  // namespace vibrig::drivers
