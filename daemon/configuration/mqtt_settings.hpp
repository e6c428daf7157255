#pragma once

#include <string>

namespace vibrig::configuration {

/// [mqtt]: the broker that watches a fleet of rigs.
struct MqttSettings {
    std::string host;  ///< empty: off
    int port = 8883;
    bool tls = true;
    std::string ca;                ///< authority of the broker's certificate; empty: the system's
    std::string certificate, key;  ///< this rig's own; empty: none
    std::string username, password_file;
    std::string group = "vibrig", node = "rig";  ///< of the topics: spBv1.0/GROUP/NDATA/NODE
    double period_s = 1;
    double backoff_max_s = 60;
};

}  // namespace vibrig::configuration
