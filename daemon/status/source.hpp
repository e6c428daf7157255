#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "daemon/domain/commands.hpp"
#include "daemon/domain/events.hpp"
#include "daemon/status/status.hpp"

namespace vibrig {

/// What the campaign does and will know at its end.
struct PlanData {
    struct Stop {
        int run = 1, position = 1;
        std::array<double, 3> position_deg{};
        double table_g = 0;
    };
    std::string name;
    bool adaptive = false;
    double dwell_s = 0, frequency_hz = 0;
    std::vector<Stop> stops;
    /// Order of parameter_names(); not finite: not determined. Targets 0: none.
    std::array<double, estimator::kParameters> sigma{}, target{};
};

/// What the status server asks the daemon for. Any thread; never touches the real-time threads.
class StatusSource {
  public:
    virtual ~StatusSource() = default;
    [[nodiscard]] virtual StatusData status() const = 0;
    [[nodiscard]] virtual std::vector<EventRecord> events(std::uint64_t after_id,
                                                          std::size_t at_most) const = 0;
    /// Final or present result; empty while there is nothing.
    [[nodiscard]] virtual estimator::Result result() const = 0;
    [[nodiscard]] virtual std::string effective_configuration() const = 0;
    /// Takes its time, as the control thread does; but for an abort, which is answered at once.
    virtual CommandReply command(const CommandRequest& request) = 0;
    [[nodiscard]] virtual PlanData plan() const { return {}; }
    /// The unit's earlier campaigns, JSON as of `vibrig trend`; empty: none are known.
    [[nodiscard]] virtual std::string unit_history() const { return {}; }
    /// The server's thread goes on, and this is how its doors are; called twice a second. The
    /// status at that moment is for its history.
    virtual StatusData serving(const ServerStatus& /*server*/) { return {}; }
    /// Something that somebody has to know of the server.
    virtual void log_event(Severity /*severity*/, const std::string& /*text*/) {}
    /// A command that was not let through: who wanted what, and why not.
    virtual void refused(const std::string& /*who*/, const std::string& /*what*/,
                         const std::string& /*why*/) {}
};

}  // namespace vibrig
