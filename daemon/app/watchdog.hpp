#pragma once

#include <string>

namespace vibrig {

/// Reports to the service manager; nothing happens without one (sd_notify(3)).
class ServiceManager {
  public:
    ServiceManager();
    void ready(const std::string& status) const;
    void status(const std::string& status) const;
    void reloading() const;
    /// It waits as long at least before it kills, s.
    void stopping(double longest_s) const;
    /// Feeds its watchdog.
    void alive() const;
    /// How often alive() is to be called, s; half of what the manager waits. 0: it does not wait.
    [[nodiscard]] double period_s() const { return period_s_; }

  private:
    double period_s_ = 0;
};

}  // namespace vibrig
