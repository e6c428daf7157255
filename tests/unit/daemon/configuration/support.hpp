#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "daemon/configuration/configuration.hpp"

namespace vibrig::configuration {

/// A daemon's configuration is that of a simulated rig: a real one has no defaults for registers.
inline std::string as_simulated(const std::string& text, bool daemon) {
    return daemon ? text + "\n[commission]\nsimulated = true\n" : text;
}

/// What parse() complains of; empty if it does not.
inline std::string complaint(const std::string& text, bool daemon = false) {
    try {
        static_cast<void>(parse(as_simulated(text, daemon), "rig.toml", daemon));
    } catch (const ConfigurationError& error) {
        return error.what();
    }
    return "";
}

inline Configuration accepted(const std::string& text, bool daemon = false) {
    return parse(as_simulated(text, daemon), "rig.toml", daemon).configuration;
}

}  // namespace vibrig::configuration
