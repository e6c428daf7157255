#pragma once

#include <array>
#include <string>
#include <vector>

#include "daemon/commission/bus_list.hpp"
#include "daemon/commission/bus_signals.hpp"
#include "daemon/commission/finding.hpp"

namespace vibrig::commission {

/// The keys can.* of a bus with a DBC, without a daemon: which angle follows each gimbal that a
/// person turns, the three accelerometers, the counter, and samples a second by the kernel's
/// stamps.
class BusFinder {
  public:
    /// `dbc`: its file as can.dbc names it; `configured_hz`: 0: nothing is configured.
    BusFinder(std::string dbc, double configured_hz);

    /// This gimbal was turned, nothing else. Why no signal is its angle; empty: one is.
    [[nodiscard]] std::string turned(std::size_t gimbal, const BusSignals& bus);
    /// How often the message with the counter comes, else that of the first angle.
    void listen(const proto::Dbc& dbc, const BusSignals& bus, const BusList& list);
    /// Decided, or why not.
    [[nodiscard]] Finding finding() const;

  private:
    std::string dbc_;
    double configured_hz_;
    std::array<std::string, 3> angle_, score_;
    std::vector<std::string> accelerometers_, counters_;
    std::string rate_of_;
    double measured_hz_ = 0;
};

}  // namespace vibrig::commission
