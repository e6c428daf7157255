#pragma once

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "daemon/app/control_loop.hpp"
#include "daemon/app/outside.hpp"
#include "daemon/app/parts.hpp"
#include "daemon/app/status_assembler.hpp"
#include "daemon/app/supervisor.hpp"
#include "daemon/fleet/publisher.hpp"
#include "daemon/journal/latches.hpp"

namespace vibrig {

/// Joins the rooms and owns the threads:
///   acquisition (io_context) -> ring -> estimator -> snapshot -> server;  control -> gimbal,
///   shaker
class Daemon final : public StatusSource {
  public:
    /// Throws ConfigurationError, BindingError, CanError, ShakerError, std::system_error.
    /// `log_queue`: where its words go, to be watched; null: nobody asks.
    explicit Daemon(configuration::Loaded loaded, const log::LogQueue* log_queue = nullptr);
    ~Daemon() override;

    /// Starts the threads; throws CanError.
    void start();
    /// Asks for a clean end: shaker ramped down, dwell closed. Any thread.
    void shut_down() noexcept { control_.shut_down(); }
    /// After shut_down(): true once everything is at rest, false when `wall_seconds` have passed.
    [[nodiscard]] bool wait_for_end(double wall_seconds) {
        return control_.wait_for_end(wall_seconds);
    }
    /// After shut_down(): what is not at rest, or what nobody can tell of.
    [[nodiscard]] std::string what_moves() const {
        return parts_.campaign.what_moves(parts_.clock.now());
    }
    /// Longest orderly end: ramp, stop, watchdog.
    [[nodiscard]] double longest_end_s() const;
    /// Ends the threads, orderly or not.
    void join();
    /// The stages that measure or act and have ceased to; empty: all go on. Any one thread.
    [[nodiscard]] std::string stuck_stage() { return supervisor_.stuck_stage(); }

    [[nodiscard]] StatusData status() const override;
    [[nodiscard]] std::vector<EventRecord> events(std::uint64_t after_id,
                                                  std::size_t at_most) const override {
        return parts_.events.after(after_id, at_most);
    }
    [[nodiscard]] estimator::Result result() const override { return parts_.dwells.result(); }
    [[nodiscard]] std::string effective_configuration() const override {
        return configuration::format_effective(parts_.loaded);
    }
    CommandReply command(const CommandRequest& request) override {
        return control_.command(request);
    }
    [[nodiscard]] PlanData plan() const override { return plan_; }
    [[nodiscard]] std::string unit_history() const override {
        return parts_.outbox ? parts_.outbox->history() : std::string();
    }
    void refused(const std::string& who, const std::string& what, const std::string& why) override;
    StatusData serving(const ServerStatus& server) override;
    void log_event(Severity severity, const std::string& text) override;

  private:
    // The parts of start(), in its order.
    void make_results_folder() const;
    void open_journal();
    void open_outbox();
    void start_recording();
    void watch_shaker();
    void start_acquisition();
    void start_shaker();
    void start_threads();

    Parts parts_;
    journal::Latches latches_;  ///< control thread
    Supervisor supervisor_;
    Outside outside_;
    ControlLoop control_;
    StatusAssembler status_;
    const PlanData plan_;
    const std::unique_ptr<fleet::Publisher> publisher_;  ///< null: no broker

    std::thread acquisition_thread_, estimator_thread_, control_thread_;
};

}  // namespace vibrig
