#pragma once

#include <memory>

#include "daemon/configuration/mqtt_settings.hpp"
#include "daemon/domain/events.hpp"
#include "daemon/status/source.hpp"

namespace vibrig::fleet {

/// Tells an MQTT broker the status, as an edge node of Sparkplug B, on a thread of its own: it asks
/// the StatusSource, and nothing waits for it. A broker that is gone is sought again, more and more
/// seldom up to the settings' backoff; what a slow one does not take is left out.
class Publisher {
  public:
    /// Throws std::runtime_error that names the key for a file that cannot be read. `log` is called
    /// from the publisher's thread.
    Publisher(const StatusSource& source, const configuration::MqttSettings& settings,
              EventSink log);
    ~Publisher();
    void start();
    void stop();  ///< tells the broker the node's death and ends the thread, within two seconds
    Publisher(const Publisher&) = delete;
    Publisher& operator=(const Publisher&) = delete;

    /// Any thread.
    [[nodiscard]] MqttStatus status() const;

  private:
    struct Impl;
    std::shared_ptr<Impl> impl_;
};

}  // namespace vibrig::fleet
