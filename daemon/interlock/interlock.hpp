#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "daemon/interlock/amplitude_witness.hpp"
#include "daemon/interlock/interlock_motion.hpp"
#include "daemon/interlock/interlock_table.hpp"
#include "daemon/interlock/mean_motion.hpp"
#include "daemon/interlock/random_witness.hpp"
#include "drivers/base/snapshot.hpp"
#include "drivers/sample/assembler.hpp"
#include "drivers/sample/sample.hpp"
#include "drivers/shaker/shaker.hpp"

namespace vibrig::rt {

[[nodiscard]] const char* text_of(Trip trip) noexcept;

/// A latched trip: cause, row of the table and value belong together, in one atomic value.
struct alignas(8) Tripped {
    Trip cause = Trip::none;
    std::uint8_t row = 0;
    std::uint8_t channel =
        drivers::kChannels;   ///< drivers::Channel that showed it; kChannels: none
    std::uint8_t number = 0;  ///< of this trip, so that the same one again is another
    float value = 0;          ///< as judged to be wrong
    [[nodiscard]] explicit operator bool() const noexcept { return cause != Trip::none; }
    bool operator==(const Tripped& other) const noexcept {
        return cause == other.cause && row == other.row && number == other.number;
    }
};
static_assert(sizeof(Tripped) == 8 && std::atomic<Tripped>::is_always_lock_free);
static_assert(kMostRules <= 256, "a row's number fits into a byte");

/// Software's share of a reaction: frames in to stop confirmed by the controller, wall time.
class ReactionHistogram {
  public:
    /// Upper bounds, ms; one more class is open.
    static constexpr std::array<double, 11> kBounds_ms{0.1, 0.2, 0.5, 1,   2,  5,
                                                       10,  20,  50,  100, 200};
    void add(drivers::Time taken) noexcept;
    struct Counts {
        std::array<std::uint64_t, kBounds_ms.size() + 1> count{};
        double largest_ms = 0, sum_ms = 0;
    };
    [[nodiscard]] Counts counts() const noexcept;

  private:
    std::array<std::atomic<std::uint64_t>, kBounds_ms.size() + 1> count_{};
    std::atomic<drivers::Time> largest_{0}, sum_{0};
};

/// Stops the shaker before anything else sees the sample: what comes with samples or by silence is
/// judged in the acquisition thread, what comes with a read-back in the shaker's thread right after
/// it. Aborts latch until acknowledged. Judging neither allocates, locks nor logs.
class Interlock {
  public:
    struct Limits {
        double table_g = 12.0;                                     ///< largest table acceleration
        drivers::Time platform_age = 500 * drivers::kMillisecond;  ///< of the platform's status
        std::vector<Rule> rules = default_interlock();             ///< kMostRules at most
        AmplitudeWitness::Settings witness = {};
        double transmission = 1;  ///< platform over table, until it is measured
        /// Settings of each random vibration that there may be: Ramp::random is a place in it,
        /// from 1.
        std::vector<RandomWitness::Settings> random = {};
        bool thermometer = false;  ///< there is one, whether it has spoken or not
    };
    /// One row as it stands now.
    struct RowState {
        const Rule* rule = nullptr;
        bool raised = false;
        double value = 0;    ///< as last judged to be wrong
        double present = 0;  ///< as judged now; NaN: not watched now
    };

    Interlock(drivers::Shaker& shaker, drivers::Waiter& control, Limits limits);

    void guard(Guard level) noexcept { guard_.store(level); }  ///< control thread
    /// Control thread: what the table is to do (0: nothing yet, or ramping) and where the gimbals
    /// are to be, deg as the encoders count.
    void command(double table_g, const std::array<double, 3>& position_deg) noexcept;
    /// Control thread: what is commanded, at the moment it is.
    void ramp(Ramp ramp) noexcept {
        ramp.number = ++ramps_;
        ramp_.publish(ramp);
    }
    /// Control thread: a stop is proved by making it happen. The amplitude may fall as it likes
    /// then, and the controller may report a fault once nobody feeds its watchdog; nothing may
    /// rise. `unlinked`: nobody reads it meanwhile.
    void proving(bool stop, bool unlinked = false) noexcept {
        proving_.store(stop);
        unlinked_.store(unlinked);
    }
    /// Control thread: platform over table, as the loop check has measured it.
    void transmission(double measured) noexcept { transmission_.store(measured); }
    /// Platform and table as the accelerometers show them, g peak at the table; negative: unknown.
    [[nodiscard]] std::array<double, 2> seen_g() const noexcept {
        return {seen_g_[0].load(), seen_g_[1].load()};
    }
    /// Acquisition thread: platform, table: whatever the newest judgement found wrong of it, and
    /// the newest one before what is latched, though nothing is excited any more.
    [[nodiscard]] std::array<bool, 2> contradicts() const noexcept {
        const bool judged = sampled_under_ == Guard::excitation;
        return {at_trip_[0] || (judged && verdict_.contradicts[0]),
                at_trip_[1] || (judged && verdict_.contradicts[1])};
    }
    /// The newest second of force and angles.
    [[nodiscard]] MeanMotion second() const noexcept { return second_.read(); }
    /// Control thread, slowly: innovations of the filter (0: none yet), free space.
    void filter(double nis_per_dof) noexcept { nis_.store(nis_per_dof); }
    void disk_free(double megabytes) noexcept { disk_free_mb_.store(megabytes); }
    /// Control thread: whether those that only look on keep up.
    void onlookers(bool recording_degraded, bool server_stuck) noexcept {
        recording_degraded_.store(recording_degraded);
        server_stuck_.store(server_stuck);
    }
    /// Control thread: what those outside say, and whether they can be heard.
    void outside(bool guard_lost, bool guard_stopped, bool horn_silent) noexcept {
        guard_lost_.store(guard_lost);
        guard_stopped_.store(guard_stopped);
        horn_silent_.store(horn_silent);
    }

    /// Acquisition thread: a batch of frames came in at this moment (CLOCK_MONOTONIC).
    void arrived(drivers::Time wall) noexcept { arrived_ = wall; }
    /// Acquisition thread, before the sample goes anywhere.
    void check(const drivers::Sample& sample, const drivers::PlatformStatus& platform) noexcept;
    /// Acquisition thread, on its timer: silence trips too.
    void check_ages(const drivers::SampleAssembler& assembler, drivers::Time now) noexcept;
    /// Shaker thread, after each read-back.
    void check(const drivers::ShakerReading& reading) noexcept;
    /// Acquisition thread: the CAN port is no longer running.
    void lost_bus() noexcept;
    /// Control thread, which alone judges this one: its row is raised whatever tripped before.
    void stop_disobeyed(bool disobeyed) noexcept {
        judge(By::read_back, Trip::stop_disobeyed, disobeyed, drivers::steady_now());
    }
    /// Control thread: the accelerometers see motion where nothing was asked for.
    void uncommanded() noexcept;
    /// Control thread, which alone judges this one: they see another vibration than was asked for.
    void wrong_vibration(bool wrong) noexcept {
        judge(By::read_back, Trip::wrong_vibration, wrong, drivers::steady_now());
    }
    /// Control thread, which alone judges these two: over what the loop check found, allowances
    /// in; both judged not wrong: none is looked for any more.
    void growth(double motion_in_step, double across) noexcept {
        judge(By::read_back, Trip::motion_in_step, motion_in_step, drivers::steady_now());
        judge(By::read_back, Trip::cross_growth, across, drivers::steady_now());
    }
    void no_growth() noexcept;
    /// Any thread. The first cause stays.
    void trip(Trip cause) noexcept { trip(cause, 0, 0, drivers::kChannels); }
    /// Shaker thread: a stop was written and confirmed.
    void stop_written() noexcept;

    [[nodiscard]] Tripped latched() const noexcept { return tripped_.load(); }
    [[nodiscard]] Trip tripped() const noexcept { return latched().cause; }
    /// Control thread: cause in words, with the value and its limit.
    [[nodiscard]] std::string text_of(const Tripped& tripped) const;
    /// Name of the row that tripped; empty: none.
    [[nodiscard]] std::string name_of(const Tripped& tripped) const;
    /// Clears the trip if it is `handled`; one that came meanwhile stays.
    void acknowledge(const Tripped& handled) noexcept;
    /// Clears a latched alarm by name; false if no row of that name is raised.
    bool acknowledge_alarm(const std::string& name) noexcept;

    [[nodiscard]] std::size_t rows() const noexcept { return rules_.size(); }
    [[nodiscard]] RowState row(std::size_t i) const noexcept;
    /// The least limit in the rows of a condition; infinite without one.
    [[nodiscard]] double least_limit(Trip condition) const noexcept;
    [[nodiscard]] ReactionHistogram::Counts reactions() const noexcept {
        return reactions_.counts();
    }

  private:
    /// Who judges: each keeps its own time since when a condition has not been met.
    enum class By : std::uint8_t { sample, read_back };
    struct State {
        std::array<std::atomic<drivers::Time>, 2> since{};  ///< by By; 0: met
        [[nodiscard]] bool met() const noexcept {
            return since[0].load() == 0 && since[1].load() == 0;
        }
        std::atomic<bool> raised{false};
        std::atomic<double> value{0};
        std::atomic<double> present{std::numeric_limits<double>::quiet_NaN()};
    };

    [[nodiscard]] bool at_least(Guard level) const noexcept { return guard_.load() >= level; }
    void judge(By by, Trip trip, bool wrong, drivers::Time now) noexcept;
    void judge(By by, Trip trip, double value, drivers::Time now) noexcept;
    void judge(Trip trip, const AmplitudeWitness::Verdict::Finding& finding,
               drivers::Time now) noexcept;
    void judge_row(By by, std::size_t row, bool wrong, double value, drivers::Time now,
                   std::uint8_t channel = drivers::kChannels) noexcept;
    void forget(By by, Guard above) noexcept;
    void trip(Trip cause, std::size_t row, double value, std::uint8_t channel) noexcept;
    void follow_ramp(const drivers::Sample& sample) noexcept;
    void check_witnesses(const drivers::Sample& sample) noexcept;
    void check_random(const drivers::Sample& sample) noexcept;
    [[nodiscard]] bool table_beyond_limit(const drivers::Sample& sample) noexcept;
    /// What is commanded is random vibration, and not rest.
    [[nodiscard]] bool at_random() const noexcept {
        return commanded_.random > 0 && std::max(commanded_.start_g, commanded_.target_g) > 0;
    }
    /// What is commanded is a sweep, and not rest.
    [[nodiscard]] bool sweeping() const noexcept {
        return commanded_.sweep.any() && std::max(commanded_.start_g, commanded_.target_g) > 0;
    }
    [[nodiscard]] bool stands_in_samples(drivers::Time at) const noexcept;
    /// Platform over table, of what is commanded.
    [[nodiscard]] double commanded_transmission() const noexcept {
        if (commanded_.sweep.any() && commanded_.sweep.transmission[0] > 0)
            return commanded_.sweep.transmission_at(std::max(now_, sample_time_));
        return commanded_.transmission > 0 ? commanded_.transmission : transmission_.load();
    }
    Guard follow_guard() noexcept;
    void keep_contradiction() noexcept;
    void check_motion(const drivers::Sample& sample) noexcept;

    drivers::Shaker& shaker_;
    drivers::Waiter& control_;
    double table_g_;
    bool table_bound_ = false;  ///< there is an accelerometer on the table; acquisition thread
    drivers::Time platform_age_;
    bool thermometer_;
    std::vector<Rule> rules_;
    std::array<State, kMostRules> states_;
    std::atomic<Guard> guard_{Guard::idle};
    std::atomic<Tripped> tripped_{Tripped{}};
    std::atomic<std::uint8_t> trips_{0};
    std::atomic<double> commanded_g_{0}, nis_{0}, disk_free_mb_{-1};
    std::atomic<bool> proving_{false}, unlinked_{false};
    std::atomic<bool> recording_degraded_{false}, server_stuck_{false};
    std::atomic<bool> guard_lost_{false}, guard_stopped_{false}, horn_silent_{false};
    std::array<std::atomic<double>, 3> position_rad_{};
    std::atomic<bool> position_known_{false};
    std::atomic<drivers::Time> stop_asked_{0};  ///< arrival of the frames that tripped; 0: none
    ReactionHistogram reactions_;

    Snapshot<Ramp> ramp_;
    Snapshot<MeanMotion> second_;
    std::uint64_t ramps_ = 0;  ///< control thread
    std::atomic<double> transmission_;
    std::array<std::atomic<double>, 2> seen_g_{-1, -1};

    // Acquisition thread.
    drivers::Time arrived_ = 0;
    drivers::Time now_ = 0;      ///< when silence was last looked for
    const double frequency_hz_;  ///< the configuration's
    const double rate_hz_;       ///< of the samples
    MeanMotionMeter seconds_;
    AmplitudeWitness witness_;
    AmplitudeWitness::Verdict verdict_;  ///< the newest
    Tripped kept_for_;                   ///< trip that this thread has seen last
    std::array<bool, 2> at_trip_{};      ///< what verdict_ contradicted when it came
    std::vector<RandomWitness> random_;
    bool bands_needed_ = false;  ///< of the controller itself
    Ramp commanded_;
    drivers::Time controller_began_ = 0;
    drivers::Time sample_time_ = 0;  ///< of the newest sample
    /// When the table's reading was out of its range last, and when it was so once more; 0: never.
    drivers::Time out_of_range_at_ = 0, out_of_range_again_ = 0;
    bool motion_stood_ = false;  ///< no motion was to be had of the sample before
    Guard sampled_under_ = Guard::idle;
    MotionMonitor motion_;
    LossMonitor loss_;
    // Shaker thread.
    Guard read_under_ = Guard::idle;
    std::uint64_t mismatches_ = 0;
};

}  // namespace vibrig::rt
