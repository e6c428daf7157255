#include <algorithm>
#include <optional>
#include <set>

#include "daemon/configuration/key.hpp"
#include "daemon/configuration/rules.hpp"
#include "daemon/configuration/value.hpp"
#include "estimator/filter/parameters.hpp"

namespace vibrig::configuration {

namespace {

using C = Configuration;

std::vector<Key> record_keys() {
    using R = RecordSettings;
    const auto record = part(&C::record);
    return {
        boolean("record.enabled", record(&R::enabled), "campaigns are recorded"),
        text("record.folder", record(&R::folder), "a folder",
             "a folder for each campaign goes there; empty: campaign.results, and without it "
             "nothing is recorded",
             path_rule),
        boolean("record.raw", record(&R::raw), "all frames too, as candump logs"),
        number("record.segment_s", record(&R::segment_s), "s", {1, 86'400},
               "a log is closed and another begun after so long"),
        integer("record.segment_mb", record(&R::segment_mb), "MB", 1, 4096,
                "or when it is so long"),
        boolean("record.zstd", record(&R::zstd), "closed logs are compressed"),
        number("record.flush_s", record(&R::flush_s), "s", {0.1, 60}, "readers see what is older"),
        integer("record.keep_free_mb", record(&R::keep_free_mb), "MB", 0, 1'000'000,
                "with less on the disk nothing is recorded, until there is more"),
    };
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

std::vector<Key> archive_keys() {
    using A = ArchiveSettings;
    const auto archive = part(&C::archive);
    return {
        text("archive.folder", archive(&A::folder), "a path",
             "of a mounted file system: a campaign's folder is copied there when it is over, "
             "verified and registered; empty: none is",
             path_rule),
        text("archive.index", archive(&A::index), "\"postgresql://...\" without a password",
             "index that several rigs share; empty: recordings.sqlite3 in archive.folder",
             index_rule),
        text("archive.rig", archive(&A::rig), "letters, digits, ' ', '.', '_', '-'",
             "this rig's name in the archive; empty: the machine's",
             [](const std::string& name) {
                 return name.empty() ? std::string() : campaign_name_rule(name);
             }),
        number("archive.retry_max_s", archive(&A::retry_max_s), "s", {0.5, 86'400},
               "longest wait before what could not be delivered is tried again"),
        integer("archive.keep_mb", archive(&A::keep_mb), "MB", 0, 1'000'000'000,
                "share of the rig's disk for recordings: beyond it the oldest that are delivered "
                "and verified are removed here; 0: none is"),
    };
}

std::vector<Key> mqtt_keys() {
    using M = MqttSettings;
    const auto mqtt = part(&C::mqtt);
    return {
        text("mqtt.host", mqtt(&M::host), "a host name or numeric address, or \"\"",
             "MQTT broker that the status is published to (Sparkplug B); empty: none",
             host_or_empty_rule),
        integer("mqtt.port", mqtt(&M::port), "", 1, 65'535, "the broker's; 8883 is usual with TLS"),
        boolean("mqtt.tls", mqtt(&M::tls), "false: in clear, to a broker on this machine only"),
        text("mqtt.ca", mqtt(&M::ca), "a path",
             "authority of the broker's certificate, PEM; empty: the system's", path_rule),
        text("mqtt.certificate", mqtt(&M::certificate), "a path",
             "this rig's, PEM; empty: none is shown", path_rule),
        text("mqtt.key", mqtt(&M::key), "a path", "of the certificate, PEM, without a password",
             path_rule),
        text("mqtt.username", mqtt(&M::username), "1 line",
             "as the broker knows this rig; empty: none", line_rule),
        text("mqtt.password_file", mqtt(&M::password_file), "a path",
             "its first line is the password", path_rule),
        text("mqtt.group", mqtt(&M::group), "letters, digits, ' ', '.', '_', '-'",
             "group id of the topics, spBv1.0/GROUP/NDATA/NODE", campaign_name_rule),
        text("mqtt.node", mqtt(&M::node), "letters, digits, ' ', '.', '_', '-'",
             "edge node id, another one for each rig", campaign_name_rule),
        number("mqtt.period_s", mqtt(&M::period_s), "s", {0.1, 3600},
               "what has changed is published so often"),
        number("mqtt.backoff_max_s", mqtt(&M::backoff_max_s), "s", {0.5, 3600},
               "longest wait before a lost broker is sought again"),
    };
}

using Coefficient = C::Commission::Coefficient;

/// One coefficient of a certificate, none of those that there are.
std::optional<Coefficient> read_coefficient(const Entry& entry, std::set<std::string>& there) {
    const toml::table* table = entry.node.as_table();
    const toml::node* name = table == nullptr ? nullptr : table->get("name");
    const toml::node* value = table == nullptr ? nullptr : table->get("value");
    if (name == nullptr || value == nullptr || table->size() != 2) {
        entry.refuse("a table { name = \"D_Fx\", value = 1.2 }");
        return std::nullopt;
    }
    const auto* text = name->as_string();
    const auto& names = estimator::parameter_names();
    const bool known = text != nullptr && std::ranges::find(names, text->get()) != names.end();
    if (!known || there.contains(text->get())) {
        entry.part(*name, "name").refuse("a coefficient, D_Fx to D_OSz, each once");
        return std::nullopt;
    }
    const auto number = entry.part(*value, "value").number({-1e3, 1e3}, "");
    if (!number) return std::nullopt;
    there.insert(text->get());
    return Coefficient{text->get(), *number};
}

Key certificate() {
    auto read = [](const Entry& entry, C& c) {
        std::set<std::string> there;
        const auto all =
            entry.elements(0, estimator::kParameters, "tables { name = \"D_Fx\", value = 1.2 }",
                           [&](const Entry& one) { return read_coefficient(one, there); });
        if (all) c.commission.certificate = *all;
    };
    auto write = [](C& c) {
        return write_list(c.commission.certificate, [](const auto& one) {
            return "{ name = " + write_text(one.name) + ", value = " + write_number(one.value) +
                   " }";
        });
    };
    return {"commission.certificate",
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

std::vector<Key> commission_keys() {
    using M = C::Commission;
    using P = campaign::ProofSettings;
    const auto commission = part(&C::commission);
    const auto proof = part(&C::campaign, &campaign::Settings::proof);
    return {
        choice<C::ClockKind>("clock.source", at(&C::clock),
                             {{"real", C::ClockKind::real}, {"rig", C::ClockKind::rig}},
                             "rig: the simulated rig owns the time"),
        boolean("commission.simulated", commission(&M::simulated),
                "the rig is simulated although the clock is real; Modbus on this machine only"),
        boolean("commission.enforce", commission(&M::enforce),
                "a simulated rig, too, is armed only with what a real one needs"),
        text("commission.folder", commission(&M::folder), "a path",
             "of the commissioning record; a simulated rig is held to one with enforce and a "
             "folder that is not the default",
             folder_rule),
        number("commission.valid_days", commission(&M::valid_days), "d", {1, 3660},
               "how long a part of the commissioning record counts"),
        number("commission.linear_sigma", commission(&M::linear_sigma), "deg/h/g", {0.01, 100},
               "how large linear drift terms are believed to be while north is sought, 1 sigma"),
        boolean("commission.opening_check", commission(&M::opening_check),
                "hold the configuration against free drift and gravity before the first ramp, 4 "
                "min; of rigs that are armed by the record"),
        names("commission.buttons", proof(&P::buttons), 16,
              "emergency-stop buttons of the rig; each is pressed once before the stop counts as "
              "proven"),
        certificate(),
        number("commission.stop_s", proof(&P::seen_s), "s", {0.1, 2},
               "from the table's fall until the register shows a pressed button"),
    };
}

std::vector<Key> server_keys() {
    using S = C::Server;
    const auto server = part(&C::server);
    return {
        text("server.socket", at(&C::socket), "an absolute path",
             "Unix socket of the status server: a file, whose mode says who may open it",
             socket_file_rule),
        text("server.operator_group", server(&S::operator_group), "a group's name",
             "who may command at the socket, besides root; empty: whoever may open it", group_rule),
        text("server.status_socket", server(&S::status_socket), "an absolute path",
             "Unix socket for reading only, a file as server.socket; empty: none",
             socket_file_or_empty_rule),
        text("server.page", server(&S::page),
             "\"127.0.0.1:PORT\" or \"[::1]:PORT\", port 0: any free one",
             "live page for a browser on this machine, read-only; empty: none", endpoint_rule),
        text("server.remote", server(&S::remote), "\"ADDRESS:PORT\"",
             "the page and the API over TLS with certificates on both sides; empty: none",
             endpoint_rule),
        text("server.certificate", server(&S::certificate), "a path",
             "of server.remote, PEM; `vibrig pki init` makes one", path_rule),
        text("server.key", server(&S::key), "a path", "of the certificate, PEM", path_rule),
        text("server.clients_ca", server(&S::clients_ca), "a path",
             "authority the clients' certificates come from, PEM", path_rule),
        text("server.revoked", server(&S::revoked), "a path",
             "clients' certificates that no longer count, PEM; `vibrig pki revoke` writes it; "
             "empty: none",
             path_rule),
    };
}

std::vector<Key> log_keys() {
    // The words are spdlog's own.
    std::vector<std::pair<std::string, std::string>> levels;
    for (const char* word : {"trace", "debug", "info", "warning", "error", "critical", "off"})
        levels.emplace_back(word, word);
    return {
        choice<std::string>("log.level", at(&C::log_level), levels, "what is logged"),
        text("log.file", at(&C::log_file), "a path", "empty: standard error", path_rule),
        text("journal.file", at(&C::journal), "a path",
             "SQLite: campaigns, results, events, commands; empty: journal.sqlite3 in "
             "campaign.results",
             path_rule),
    };
}

std::vector<Key> thread_keys() {
    constexpr int kLastCpu = 1023;
    return {
        integer("threads.acquisition_priority", at(&C::acquisition_priority), "", 0, 99,
                "SCHED_FIFO; 0: ordinary scheduling"),
        integer("threads.estimator_priority", at(&C::estimator_priority), "", 0, 99,
                "SCHED_FIFO; 0: ordinary scheduling"),
        integer("threads.acquisition_cpu", at(&C::acquisition_cpu), "", -1, kLastCpu,
                "the thread keeps to this CPU, counted from 0; -1: to none"),
        integer("threads.estimator_cpu", at(&C::estimator_cpu), "", -1, kLastCpu,
                "the thread keeps to this CPU, counted from 0; -1: to that of acquisition, "
                "wherever that is"),
        boolean("threads.lock_memory", at(&C::lock_memory),
                "the daemon's memory stays in memory; not where the rig owns the time"),
    };
}

}  // namespace

std::vector<Key> daemon_keys() {
    return joined({commission_keys(), server_keys(), mqtt_keys(), log_keys(), record_keys(),
                   archive_keys(), thread_keys()});
}

}  // namespace vibrig::configuration
