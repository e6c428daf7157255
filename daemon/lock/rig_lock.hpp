#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/configuration/configuration.hpp"

namespace vibrig {

/// Somebody else commands the rig; says who, with what configuration, since when.
class RigTaken : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// One rig, one daemon: holds the CAN bus and the Modbus peer of the shaker. Abstract sockets,
/// since their names belong to the network namespace as CAN interfaces do, are the same for all
/// users and end with their process, however it ends. A peer that one daemon calls by name and
/// another by address is two peers here; the bus is still one.
class RigLock {
  public:
    /// `path`: the configuration's, for whoever asks. Throws RigTaken, std::system_error.
    RigLock(const configuration::Configuration& configuration, const std::string& path);
    ~RigLock();
    RigLock(const RigLock&) = delete;
    RigLock& operator=(const RigLock&) = delete;

    /// Tells those that have asked meanwhile who holds the rig. Never waits; about once a second.
    void answer() noexcept;

    /// "can:can0", "modbus:127.0.0.1:502"
    [[nodiscard]] static std::vector<std::string> resources(
        const configuration::Configuration& configuration);

  private:
    void take(const std::string& resource);

    std::string words_;
    std::vector<int> sockets_;
};

}  // namespace vibrig
