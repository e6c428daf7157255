#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/app/commissioning.hpp"
#include "daemon/app/outside.hpp"
#include "daemon/app/parts.hpp"
#include "daemon/app/supervisor.hpp"
#include "daemon/commission/book.hpp"
#include "daemon/commission/shaker_parts.hpp"
#include "daemon/journal/latches.hpp"

namespace vibrig {

/// The control thread: trips, commands, the campaign and commissioning, one round after the other.
/// What of a command outlives the daemon goes into the journal first.
class ControlLoop {
  public:
    ControlLoop(Parts& parts, journal::Latches& latches, Supervisor& supervisor, Outside& outside)
        : parts_(parts), latches_(latches), supervisor_(supervisor), outside_(outside) {}

    // Before the thread runs.

    /// What the journal says of an earlier life.
    void take_over();
    /// What is latched of it, to people outside.
    void announce_latches();

    /// Before the shaker's thread begins: where a rig must be proven and nobody has tried whether
    /// the controller's registers are what the configuration calls them, nothing but a stop is
    /// written.
    void hold_untried_registers();
    /// The thread's body: until everything is at rest after shut_down(), or give_up().
    void run();

    // Any thread.

    void shut_down() noexcept;
    void give_up() noexcept;
    /// After shut_down(): true once everything is at rest, false when `wall_seconds` have passed.
    [[nodiscard]] bool wait_for_end(double wall_seconds);
    CommandReply command(const CommandRequest& request);
    /// The campaign's part of it, as of the last round.
    [[nodiscard]] StatusData status() const;
    /// Around the measurement, as it is now.
    [[nodiscard]] record::ConditionRow conditions() const;
    /// The shaker's thread: as the controller was before the stop at the start, which clears its
    /// faults.
    void first_reading(const drivers::ShakerReading& reading);

  private:
    struct WaitingCommand {
        CommandRequest request;
        std::promise<CommandReply> reply;
        /// Whoever asked no longer waits: it must not happen later.
        std::shared_ptr<std::atomic<bool>> abandoned;
    };

    void log(Severity severity, const std::string& source, const std::string& text) {
        events_.log(severity, source, text);
    }
    void show(drivers::Time now);
    void watch_outside();
    void record_begin(const std::string& by, std::size_t dwells_before);
    /// Instruments whose certificate has run out, for whoever arms.
    std::string tell_overdue();

    // Commands, trips and latches (control_commands.cpp).
    void take_commands(drivers::Time now);
    void answer(WaitingCommand& waiting, const CommandReply& reply);
    /// Once show() has shown what came of it: who is told "accepted" sees it in the status.
    void reply_later(WaitingCommand& waiting, CommandReply reply);
    void give_replies();
    /// An arming is accepted once the journal has it on disk; nobody waits for that but who asked.
    void begin_arming(WaitingCommand waiting, drivers::Time now);
    void begin_rest_check(WaitingCommand& waiting, drivers::Time now);
    void finish_arming(drivers::Time now);
    void give_up_arming(const std::string& why);
    /// Answers who acknowledged, once that is on disk; at the end of the daemon, all of them.
    void finish_acknowledging(bool at_once);
    /// Likewise with a certificate that was issued (control_certificates.cpp).
    void begin_certificate(WaitingCommand waiting);
    void finish_certificates(bool at_once);
    [[nodiscard]] bool first_shaking() const;
    void watch_arming();
    void end_arming(const std::string& why);
    [[nodiscard]] std::string not_fit_to_shake(const CommandRequest& request) const;
    [[nodiscard]] std::string journal_being_verified() const;
    [[nodiscard]] std::string not_fit_to_arm(const CommandRequest& request,
                                             drivers::Time now) const;
    void take_over_latches();
    void judge_first_reading(drivers::Time now);
    void watch_emergency_stop(drivers::Time now);
    void watch_disobeyed();
    [[nodiscard]] std::string armed_by_last() const;
    void on_trip(const rt::Tripped& tripped, drivers::Time now);
    void latch(Latch latch);
    CommandReply acknowledge(const CommandRequest& request, drivers::Time now);
    /// Accepted if it was for an alarm; a trip is the campaign's.
    CommandReply acknowledge_alarm(const CommandRequest& request);
    /// Why there is nothing of the name it gives; empty: there is, or it gives none.
    [[nodiscard]] std::string unknown_to_acknowledge(const CommandRequest& request) const;

    // control_attendance.cpp
    void take_attendance(CommandRequest& request);
    void watch_attendance(drivers::Time now);

    // control_device.cpp
    void watch_device(drivers::Time now);
    [[nodiscard]] std::string device_not_known() const;

    // What commissioning asks and tells (control_commission.cpp).
    void commission(WaitingCommand waiting, drivers::Time now);
    CommandReply commissioned(const CommandRequest& request, const std::string& word,
                              const commission::Json& what, drivers::Time now);
    /// Of record and procedure.
    [[nodiscard]] std::string read_commissioning(const commission::Json& what);

    // The record, which arming demands (control_record.cpp).
    [[nodiscard]] CommandReply enter_in_record(const CommandRequest& request,
                                               const commission::Json& what, drivers::Time now);
    [[nodiscard]] CommandReply accept_commissioning(const CommandRequest& request,
                                                    const std::string& second,
                                                    const commission::Json& confirmed_bits,
                                                    const configuration::Loaded& file);
    [[nodiscard]] CommandReply record_parts(const CommandRequest& request,
                                            const std::string& second,
                                            const std::vector<commission::Part>& parts,
                                            const commission::Json& evidence,
                                            const configuration::Loaded& as);
    [[nodiscard]] CommandReply sign_record(const CommandRequest& request,
                                           const commission::Json& what);
    void take_proof();
    [[nodiscard]] commission::ShakerParts shaker_parts(
        const commission::AmplitudeWitness& witness) const;
    [[nodiscard]] std::string enter_shaker_parts(const std::string& by,
                                                 const commission::AmplitudeWitness& witness);
    [[nodiscard]] CommandReply state_units(const CommandRequest& request,
                                           const commission::Json& what);
    [[nodiscard]] std::string registers_not_tried() const;
    void keep_trials();
    void keep_voided();
    void keep_end_of_torque(drivers::Time now);
    void follow_record(drivers::Time now);
    void void_gyros(const std::string& why);

    Parts& parts_;
    journal::Latches& latches_;
    Supervisor& supervisor_;
    Outside& outside_;
    const configuration::Loaded& loaded_ = parts_.loaded;
    const configuration::Configuration& configuration_ = parts_.configuration;
    Events& events_ = parts_.events;
    const std::unique_ptr<drivers::Shaker>& shaker_ = parts_.shaker;
    const std::unique_ptr<rt::StirredWaiter>& control_waiter_ = parts_.control_waiter;
    rt::Interlock& interlock_ = parts_.interlock;
    const std::unique_ptr<journal::Journal>& journal_ = parts_.journal;
    CampaignDwells& dwells_ = parts_.dwells;
    campaign::Campaign& campaign_ = parts_.campaign;

    commission::Book book_{loaded_};
    Commissioning commissioning_{parts_, outside_, book_};
    /// Who waits for a proof with a tool: the proof ends with the tool.
    struct Attendance {
        std::string by;
        drivers::Time steady = 0;  ///< when the tool was last there
    };
    std::optional<Attendance> attendance_;
    std::string device_;  ///< the identity that the shaker's controller reports; empty: not known
    bool torque_left_ = false;      ///< by an earlier life's commissioning, as the journal has it
    std::size_t proofs_taken_ = 0;  ///< into the record, of the campaign's
    /// An arming that the journal is writing.
    struct Arming {
        WaitingCommand waiting;
        std::uint64_t entry = 0;
        drivers::Time since_steady = 0;
    };
    std::optional<Arming> arming_;
    /// What was acknowledged and is not answered yet: "acknowledged" outlives a power cut.
    struct Acknowledging {
        WaitingCommand waiting;
        CommandReply reply;
        std::uint64_t entry = 0;
        drivers::Time since_steady = 0;
    };
    std::vector<std::pair<std::promise<CommandReply>, CommandReply>> replies_;
    std::vector<Acknowledging> acknowledging_;
    std::vector<Acknowledging> certifying_;       ///< certificates that are not answered yet
    std::uint64_t entry_of_acknowledgement_ = 0;  ///< the newest; 0: none
    std::string armed_by_;                        ///< as last looked at
    rt::Tripped handled_;                         ///< the interlock's, as it was reported
    drivers::ShakerReading first_reading_;
    std::atomic<bool> first_reading_known_{false};
    bool first_reading_judged_ = false;
    std::optional<bool> emergency_was_open_;  ///< as last judged

    std::atomic<bool> shut_down_{false}, give_up_{false};
    mutable std::mutex mutex_;  ///< guards what follows; never taken by acquisition or estimator
    std::deque<WaitingCommand> commands_;
    StatusData status_;  ///< what the campaign fills of it, latches and noise
    bool ended_ = false;
    std::condition_variable ended_changed_;
};

}  // namespace vibrig
