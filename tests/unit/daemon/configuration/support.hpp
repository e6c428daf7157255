#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "daemon/configuration/configuration.hpp"

namespace vibrig::configuration {

/// What parse() complains of; empty if it does not.
inline std::string complaint(const std::string& text, bool daemon = false) {
    try {
        static_cast<void>(parse(text, "rig.toml", daemon));
    } catch (const ConfigurationError& error) {
        return error.what();
    }
    return "";
}

inline Configuration accepted(const std::string& text, bool daemon = false) {
    return parse(text, "rig.toml", daemon).configuration;
}

}  // namespace vibrig::configuration
