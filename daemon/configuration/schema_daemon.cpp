#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

}  // namespace

void add_daemon_keys(std::vector<Key>& keys) {
    keys.push_back(choice<C::ClockKind>(
        "clock.source", {{"real", C::ClockKind::real}, {"rig", C::ClockKind::rig}},
        "rig: the simulated rig owns the time", [](C & c) -> auto& { return c.clock; }));
    keys.push_back(text(
        "server.socket", "absolute or \"@name\"", "Unix socket of the status server", socket_rule,
        [](C & c) -> auto& { return c.socket; }));
    // The words are spdlog's own.
    const std::vector<std::string> levels{"trace", "debug",    "info", "warning",
                                          "error", "critical", "off"};
    keys.push_back(choice(
        "log.level", levels, "what is logged",
        [levels](C& c) -> std::size_t {
            std::size_t i = 0;
            while (i + 1 < levels.size() && levels[i] != c.log_level) {
                ++i;
            }
            return i;
        },
        [levels](C& c, std::size_t i) { c.log_level = levels[i]; }));
    keys.push_back(text(
        "log.file", "a path", "empty: standard error", path_rule,
        [](C & c) -> auto& { return c.log_file; }));
    keys.push_back(text(
        "journal.file", "a path",
        "SQLite: campaigns, results, events, commands; empty: journal.sqlite3 in campaign.results",
        path_rule, [](C & c) -> auto& { return c.journal; }));
    keys.push_back(integer("threads.acquisition_priority", "", 0, 99,
                           "SCHED_FIFO; 0: ordinary scheduling",
                           [](C& c) -> int& { return c.acquisition_priority; }));
    keys.push_back(integer("threads.estimator_priority", "", 0, 99,
                           "SCHED_FIFO; 0: ordinary scheduling",
                           [](C& c) -> int& { return c.estimator_priority; }));
}

}  // namespace vibrig::configuration
