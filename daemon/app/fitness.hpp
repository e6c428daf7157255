#pragma once

#include <string>

#include "daemon/configuration/configuration.hpp"
#include "daemon/rt/acquisition.hpp"
#include "drivers/base/clock.hpp"
#include "drivers/can/can_port.hpp"

namespace vibrig {

/// Whether what comes from the rig is fit to measure with. Each says why not; empty: it is. Any
/// thread.
class Fitness {
  public:
    Fitness(const configuration::Configuration& configuration, const drivers::Clock& clock,
            const drivers::CanPort& port, const rt::Acquisition& acquisition)
        : configuration_(configuration), clock_(clock), port_(port), acquisition_(acquisition) {}

    /// Why rig and daemon have no time in common.
    [[nodiscard]] std::string clock_misfit() const;
    /// Why the samples do not come at the configured rate.
    [[nodiscard]] std::string rate_misfit() const;
    /// The first of both.
    [[nodiscard]] std::string misfit() const;
    /// Why an interrupted campaign cannot go on as it was.
    [[nodiscard]] std::string resume_gate() const;

  private:
    const configuration::Configuration& configuration_;
    const drivers::Clock& clock_;
    const drivers::CanPort& port_;
    const rt::Acquisition& acquisition_;
};

}  // namespace vibrig
