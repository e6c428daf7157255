#pragma once

#include <string>

#include "daemon/serve/api.hpp"
#include "daemon/status/status.hpp"

namespace vibrig::serve {

/// The status as Prometheus scrapes it (text format 0.0.4). What is not valid is absent.
[[nodiscard]] std::string metrics_text(const StatusData& status, const Api::Traffic& traffic);

}  // namespace vibrig::serve
