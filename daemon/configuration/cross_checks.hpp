#pragma once

#include <initializer_list>
#include <limits>
#include <map>
#include <string>

#include "daemon/configuration/configuration.hpp"
#include "daemon/configuration/problems.hpp"

namespace vibrig::configuration {

/// A network interface that belongs to a device: nothing virtual. `folder`: the kernel's list.
[[nodiscard]] bool is_hardware(const std::string& interface,
                               const std::string& folder = "/sys/class/net");

/// What single bounds cannot tell. A rule whose keys have a problem of their own already is left
/// out, so that one mistake is reported once.
class CrossCheck {
  public:
    CrossCheck(const Configuration& configuration, const std::map<std::string, Place>& places,
               Problems& problems)
        : c_(configuration), places_(places), problems_(problems) {}

    void everywhere();  ///< contradictions, also for `vibrig identify`
    void for_daemon();  ///< what only the daemon needs

  private:
    [[nodiscard]] bool sound(std::initializer_list<const char*> keys) const;
    /// Blames the first of the keys that stands in the file; else the first.
    void refuse(std::initializer_list<std::string> keys, const std::string& found,
                const std::string& expected);
    void bus();
    void broker();
    void onlookers();
    void archiving();
    void temperature();
    void doors();
    void status_signals();
    void rest();
    void stops_in_time();
    void seconds_of_samples();
    void seen_in_time();
    void adaptive();
    void rig_clock();
    void simulated_rig();
    void real_rig();
    void registers_stated();
    void registers();
    void random_registers();
    void psd_block(const proto::PsdBlock& block);
    void sweep_registers();
    void sweeps_of_plan();
    void writable_registers_apart();
    void set_points_fit();
    void watchdog_timeout_fits();
    void set_points_of_plan_fit();
    /// What is written to a register, and how near to it the register's step has to come.
    struct SetPoint {
        double value;
        const char* unit;
        double near = std::numeric_limits<double>::infinity();
    };
    /// `from`: the key that asks for it; `where` stands before what was found.
    void held(const proto::Register& reg, const std::string& role, const SetPoint& value,
              const char* from, const std::string& where = {});
    void limits();
    void frequency();
    void inputs();
    void mount();
    void response();
    void mode();
    void profiles();
    void frequencies_of_plan();
    void travel();

    const Configuration& c_;
    const std::map<std::string, Place>& places_;
    Problems& problems_;
};

/// Natural frequency of the isolators from one transmission, damping neglected (Tang et al. 2009,
/// eq. 3 with k1 = k2 = 0, above resonance): transmission = 1 / ((f / f_n)^2 - 1). Zero if the
/// transmission is 1 or more: then f is not that far above.
[[nodiscard]] double isolator_resonance_hz(double frequency_hz, double transmission);

}  // namespace vibrig::configuration
