#pragma once

namespace vibrig::bench {

/// A status server alone on a port of 127.0.0.1, which it prints, with room for more than the
/// daemon takes (224 through each door). Until standard input ends. Throws serve::ServeError.
void serve_status();

}  // namespace vibrig::bench
