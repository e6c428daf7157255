#include <algorithm>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

void add_record_keys(std::vector<Key>& keys) {
    keys.push_back(boolean("record.enabled", "campaigns are recorded",
                           [](C& c) -> bool& { return c.record.enabled; }));
    keys.push_back(text(
        "record.folder", "a folder",
        "a folder for each campaign goes there; empty: campaign.results, and without it nothing is "
        "recorded",
        path_rule, [](C & c) -> auto& { return c.record.folder; }));
    keys.push_back(boolean("record.raw", "all frames too, as candump logs",
                           [](C& c) -> bool& { return c.record.raw; }));
    keys.push_back(number("record.segment_s", "s", {1, 86'400},
                          "a log is closed and another begun after so long",
                          [](C& c) -> double& { return c.record.segment_s; }));
    keys.push_back(integer("record.segment_mb", "MB", 1, 4096, "or when it is so long",
                           [](C& c) -> int& { return c.record.segment_mb; }));
    keys.push_back(boolean("record.zstd", "closed logs are compressed",
                           [](C& c) -> bool& { return c.record.zstd; }));
    keys.push_back(number("record.flush_s", "s", {0.1, 60}, "readers see what is older",
                          [](C& c) -> double& { return c.record.flush_s; }));
    keys.push_back(integer("record.keep_free_mb", "MB", 0, 1'000'000,
                           "with less on the disk nothing is recorded, until there is more",
                           [](C& c) -> int& { return c.record.keep_free_mb; }));
}

/// A password would be read by whoever may see the configuration.
std::string index_rule(const std::string& text) {
    if (text.empty()) return "";
    const std::size_t scheme = text.find("://");
    if (!text.starts_with("postgresql://") && !text.starts_with("postgres://"))
        return "\"postgresql://...\", or \"\" for SQLite in archive.folder";
    const std::size_t at = text.find('@', scheme + 3), colon = text.find(':', scheme + 3);
    if ((at != std::string::npos && colon < at) || text.find("password=") != std::string::npos)
        return "no password in it: ?passfile=PATH names a file that has it, as ~/.pgpass";
    return line_rule(text);
}

void add_archive_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "archive.folder", "a path",
        "of a mounted file system: a campaign's folder is copied there when it is over, verified "
        "and registered; empty: none is",
        path_rule, [](C & c) -> auto& { return c.archive.folder; }));
    keys.push_back(text(
        "archive.index", "\"postgresql://...\" without a password",
        "index that several rigs share; empty: recordings.sqlite3 in archive.folder", index_rule,
        [](C & c) -> auto& { return c.archive.index; }));
    keys.push_back(text(
        "archive.rig", "letters, digits, ' ', '.', '_', '-'",
        "this rig's name in the archive; empty: the machine's",
        [](const std::string& name) {
            return name.empty() ? std::string() : campaign_name_rule(name);
        },
        [](C & c) -> auto& { return c.archive.rig; }));
    keys.push_back(number("archive.retry_max_s", "s", {0.5, 86'400},
                          "longest wait before what could not be delivered is tried again",
                          [](C& c) -> double& { return c.archive.retry_max_s; }));
    keys.push_back(integer("archive.keep_mb", "MB", 0, 1'000'000'000,
                           "share of the rig's disk for recordings: beyond it the oldest that are "
                           "delivered and verified are removed here; 0: none is",
                           [](C& c) -> int& { return c.archive.keep_mb; }));
}

void add_mqtt_keys(std::vector<Key>& keys) {
    keys.push_back(text(
        "mqtt.host", "a host name or numeric address, or \"\"",
        "MQTT broker that is told the status (Sparkplug B); empty: none", host_or_empty_rule,
        [](C & c) -> auto& { return c.mqtt.host; }));
    keys.push_back(integer("mqtt.port", "", 1, 65'535, "the broker's; 8883 is usual with TLS",
                           [](C& c) -> int& { return c.mqtt.port; }));
    keys.push_back(boolean("mqtt.tls", "false: in clear, to a broker on this machine only",
                           [](C& c) -> bool& { return c.mqtt.tls; }));
    keys.push_back(text(
        "mqtt.ca", "a path", "authority of the broker's certificate, PEM; empty: the system's",
        path_rule, [](C & c) -> auto& { return c.mqtt.ca; }));
    keys.push_back(text(
        "mqtt.certificate", "a path", "this rig's, PEM; empty: none is shown", path_rule,
        [](C & c) -> auto& { return c.mqtt.certificate; }));
    keys.push_back(text(
        "mqtt.key", "a path", "of the certificate, PEM, without a password", path_rule,
        [](C & c) -> auto& { return c.mqtt.key; }));
    keys.push_back(text(
        "mqtt.username", "1 line", "as the broker knows this rig; empty: none", line_rule,
        [](C & c) -> auto& { return c.mqtt.username; }));
    keys.push_back(text(
        "mqtt.password_file", "a path", "its first line is the password", path_rule,
        [](C & c) -> auto& { return c.mqtt.password_file; }));
    keys.push_back(text(
        "mqtt.group", "letters, digits, ' ', '.', '_', '-'",
        "group id of the topics, spBv1.0/GROUP/NDATA/NODE", campaign_name_rule,
        [](C & c) -> auto& { return c.mqtt.group; }));
    keys.push_back(text(
        "mqtt.node", "letters, digits, ' ', '.', '_', '-'",
        "edge node id, another one for each rig", campaign_name_rule,
        [](C & c) -> auto& { return c.mqtt.node; }));
    keys.push_back(number("mqtt.period_s", "s", {0.1, 3600}, "what has changed is told so often",
                          [](C& c) -> double& { return c.mqtt.period_s; }));
    keys.push_back(number("mqtt.backoff_max_s", "s", {0.5, 3600},
                          "longest wait before a lost broker is sought again",
                          [](C& c) -> double& { return c.mqtt.backoff_max_s; }));
}

using Coefficients = std::vector<C::Commission::Coefficient>;
constexpr const char* kCertificate = "commission.certificate";
constexpr const char* kCoefficientTable = "a table { name = \"D_Fx\", value = 1.2 }";

/// One coefficient of a certificate, or a problem.
void read_coefficient(const toml::node& node, const std::string& place, Coefficients& to,
                      Problems& problems) {
    const toml::table* table = node.as_table();
    const toml::node* name = table == nullptr ? nullptr : table->get("name");
    const toml::node* value = table == nullptr ? nullptr : table->get("value");
    if (name == nullptr || value == nullptr || table->size() != 2)
        return problems.add(place_of(node.source()), place, describe(node), kCoefficientTable);
    const auto* text = name->as_string();
    const auto& names = estimator::parameter_names();
    const bool known = text != nullptr && std::ranges::find(names, text->get()) != names.end();
    if (!known || std::ranges::find(to, text->get(), &C::Commission::Coefficient::name) != to.end())
        return problems.add(place_of(name->source()), place + ".name", describe(*name),
                            "a coefficient, D_Fx to D_OSz, each once");
    if (const auto number = read_number(*value, place + ".value", {-1e3, 1e3}, "", problems))
        to.push_back({text->get(), *number});
}

Key certificate() {
    auto read = [](const toml::node& node, C& c, Problems& problems) {
        const toml::array* all = read_array(node, kCertificate, 0, estimator::kParameters,
                                            "tables { name = \"D_Fx\", value = 1.2 }", problems);
        c.commission.certificate.clear();
        for (std::size_t i = 0; all != nullptr && i < all->size(); ++i)
            read_coefficient(*all->get(i), kCertificate + ("[" + std::to_string(i) + "]"),
                             c.commission.certificate, problems);
    };
    auto write = [](C& c) {
        std::string text;
        for (const auto& one : c.commission.certificate)
            text += (text.empty() ? "" : ", ") + std::string("{ name = ") + write_text(one.name) +
                    ", value = " + write_number(one.value) + " }";
        return "[" + text + "]";
    };
    return {kCertificate,
            "tables",
            "",
            "up to 30 x { name, value }",
            "coefficients of the maker's certificate, with their signs; a campaign that finds the "
            "other sign is marked, and the part gyros is to be proven anew",
            read,
            write,
            schema_of_array(
                R"({"type":"object","required":["name","value"],"additionalProperties":false,)"
                R"("properties":{"name":{"type":"string"},"value":{"type":"number"}}})",
                0, estimator::kParameters)};
}

}  // namespace

void add_daemon_keys(std::vector<Key>& keys) {
    keys.push_back(choice<C::ClockKind>(
        "clock.source", {{"real", C::ClockKind::real}, {"rig", C::ClockKind::rig}},
        "rig: the simulated rig owns the time", [](C & c) -> auto& { return c.clock; }));
    keys.push_back(boolean("commission.simulated",
                           "the rig is simulated although the clock is real; Modbus on this "
                           "machine only",
                           [](C& c) -> bool& { return c.commission.simulated; }));
    keys.push_back(boolean("commission.enforce",
                           "a simulated rig, too, is armed only with what a real one needs",
                           [](C& c) -> bool& { return c.commission.enforce; }));
    keys.push_back(text(
        "commission.folder", "a path",
        "of the commissioning record; a simulated rig is held to one with enforce and a folder "
        "that is not the default",
        folder_rule, [](C & c) -> auto& { return c.commission.folder; }));
    keys.push_back(number("commission.valid_days", "d", {1, 3660},
                          "how long a part of the commissioning record counts",
                          [](C& c) -> double& { return c.commission.valid_days; }));
    keys.push_back(number("commission.linear_sigma", "deg/h/g", {0.01, 100},
                          "how large linear drift terms are believed to be while north is sought, "
                          "1 sigma",
                          [](C& c) -> double& { return c.commission.linear_sigma; }));
    keys.push_back(boolean("commission.opening_check",
                           "hold the configuration against free drift and gravity before the first "
                           "ramp, 4 min; of rigs that are armed by the record",
                           [](C& c) -> bool& { return c.commission.opening_check; }));
    keys.push_back(names(
        "commission.buttons", 16,
        "emergency-stop buttons of the rig; each is pressed once before the "
        "stop counts as proven",
        [](C & c) -> auto& { return c.campaign.proof.buttons; }));
    keys.push_back(certificate());
    keys.push_back(number("commission.stop_s", "s", {0.1, 2},
                          "from the table's fall until the register shows a pressed button",
                          [](C& c) -> double& { return c.campaign.proof.seen_s; }));
    keys.push_back(text(
        "server.socket", "absolute or \"@name\"", "Unix socket of the status server", socket_rule,
        [](C & c) -> auto& { return c.socket; }));
    keys.push_back(text(
        "server.operator_group", "a group's name",
        "who may command at the socket, besides root; empty: whoever may open it", group_rule,
        [](C & c) -> auto& { return c.server.operator_group; }));
    keys.push_back(text(
        "server.status_socket", "absolute or \"@name\"",
        "Unix socket for reading only; empty: none", socket_or_empty_rule,
        [](C & c) -> auto& { return c.server.status_socket; }));
    keys.push_back(text(
        "server.page", "\"127.0.0.1:PORT\" or \"[::1]:PORT\", port 0: any free one",
        "live page for a browser on this machine, read-only; empty: none", endpoint_rule,
        [](C & c) -> auto& { return c.server.page; }));
    keys.push_back(text(
        "server.remote", "\"ADDRESS:PORT\"",
        "the page and the API over TLS with certificates on both sides; empty: none", endpoint_rule,
        [](C & c) -> auto& { return c.server.remote; }));
    keys.push_back(text(
        "server.certificate", "a path", "of server.remote, PEM; `vibrig pki init` makes one",
        path_rule, [](C & c) -> auto& { return c.server.certificate; }));
    keys.push_back(text(
        "server.key", "a path", "of the certificate, PEM", path_rule,
        [](C & c) -> auto& { return c.server.key; }));
    keys.push_back(text(
        "server.clients_ca", "a path", "authority the clients' certificates come from, PEM",
        path_rule, [](C & c) -> auto& { return c.server.clients_ca; }));
    keys.push_back(text(
        "server.revoked", "a path",
        "clients' certificates that no longer count, PEM; `vibrig pki revoke` writes it; empty: "
        "none",
        path_rule, [](C & c) -> auto& { return c.server.revoked; }));
    add_mqtt_keys(keys);
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
    add_record_keys(keys);
    add_archive_keys(keys);
    constexpr int kLastCpu = 1023;
    keys.push_back(integer("threads.acquisition_priority", "", 0, 99,
                           "SCHED_FIFO; 0: ordinary scheduling",
                           [](C& c) -> int& { return c.acquisition_priority; }));
    keys.push_back(integer("threads.estimator_priority", "", 0, 99,
                           "SCHED_FIFO; 0: ordinary scheduling",
                           [](C& c) -> int& { return c.estimator_priority; }));
    keys.push_back(integer("threads.acquisition_cpu", "", -1, kLastCpu,
                           "the thread keeps to this CPU, counted from 0; -1: to none",
                           [](C& c) -> int& { return c.acquisition_cpu; }));
    keys.push_back(integer("threads.estimator_cpu", "", -1, kLastCpu,
                           "the thread keeps to this CPU, counted from 0; -1: to that of "
                           "acquisition, wherever that is",
                           [](C& c) -> int& { return c.estimator_cpu; }));
    keys.push_back(boolean("threads.lock_memory",
                           "the daemon's memory stays in memory; not where the rig owns the time",
                           [](C& c) -> bool& { return c.lock_memory; }));
}

}  // namespace vibrig::configuration
