// vibrig archive serve: the archive for a browser.
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "daemon/configuration/configuration.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/archive_pages.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "estimator/identification/result.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

/// An archive moves nothing and is asked nothing but its pages.
class NoRig final : public StatusSource {
  public:
    [[nodiscard]] StatusData status() const override { return {}; }
    [[nodiscard]] std::vector<EventRecord> events(std::uint64_t /*after*/,
                                                  std::size_t /*most*/) const override {
        return {};
    }
    [[nodiscard]] estimator::Result result() const override { return {}; }
    [[nodiscard]] std::string effective_configuration() const override { return {}; }
    CommandReply command(const CommandRequest& /*request*/) override {
        return {false, "an archive takes no commands"};
    }
    void log_event(Severity /*severity*/, const std::string& text) override {
        std::cerr << text << '\n';
    }
    void refused(const std::string& who, const std::string& what, const std::string& why) override {
        std::cerr << who << ": " << what << " refused: " << why << '\n';
    }
};

struct ServeOptions {
    serve::ServerSettings server = {};
    ArchiveOptions where = {};
    bool json = false;
};

/// One line: whoever started it reads it and goes on.
void print_addresses(const std::string& page, const std::string& remote, bool json) {
    if (json) {
        nlohmann::ordered_json where{{"page", nullptr}, {"remote", nullptr}};
        if (!page.empty()) where["page"] = page;
        if (!remote.empty()) where["remote"] = remote;
        std::cout << proto::json_text(where) << std::endl;
        return;
    }
    if (!page.empty()) std::cout << "archive: " << page << '\n';
    if (!remote.empty()) std::cout << "archive, with certificates: " << remote << '\n';
    std::cout << std::flush;
}

/// As vibrigd's server.page and server.remote, whose server takes the port as it comes.
void check_port(const char* option, const std::string& address) {
    if (address.empty()) return;
    const std::size_t colon = address.rfind(':');
    std::uint16_t port = 0;
    if (colon == std::string::npos || colon == 0 ||
        !proto::read_number(std::string_view(address).substr(colon + 1), port))
        throw std::runtime_error(std::string(option) + ": found '" + proto::printable(address) +
                                 "', expected ADDRESS:PORT with a port from 0 to 65535");
}

int serve_archive(const ServeOptions& options) {
    serve::ServerSettings settings = options.server;
    check_port("--page", settings.page);
    check_port("--remote", settings.remote);
    const Whereabouts at = whereabouts_of(options.where);
    if (at.place.folder.empty() || !std::filesystem::is_directory(at.place.folder))
        throw std::runtime_error("--archive: found '" + at.place.folder +
                                 "', expected the archive's folder");
    // It would be seen with the first page only.
    archive::Index(at.place.index, archive::Database::Mode::read);
    if (const auto& config = options.where.config; !config.empty()) {
        const auto server = configuration::load(config, false).configuration.server;
        for (auto [to, from] : {std::pair{&settings.certificate, &server.certificate},
                                {&settings.key, &server.key},
                                {&settings.clients_ca, &server.clients_ca},
                                {&settings.revoked, &server.revoked}})
            if (to->empty()) *to = *from;
    }
    if (!settings.remote.empty())
        for (const auto& [option, value] : {std::pair{"--certificate", &settings.certificate},
                                            {"--key", &settings.key},
                                            {"--clients-ca", &settings.clients_ca}})
            if (value->empty())
                throw std::runtime_error(std::string(option) +
                                         ": found nothing, expected a PEM file with --remote, or "
                                         "--config that names it");
    if (settings.page.empty() && settings.remote.empty()) settings.page = "127.0.0.1:8091";
    sigset_t signals;
    ::sigemptyset(&signals);
    for (const int signal : {SIGINT, SIGTERM}) ::sigaddset(&signals, signal);
    ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    const ArchivePages pages(at.place);
    NoRig source;
    // A recording takes its time on a slow line.
    settings.limits.idle_timeout = std::chrono::minutes(10);
    settings.documents = [&pages](std::string_view path, std::string_view query) {
        return pages.answer(path, query);
    };
    serve::StatusServer server(source, settings);
    server.answer();
    print_addresses(server.page_address(), server.remote_address(), options.json);
    int signal = 0;
    ::sigwait(&signals, &signal);
    return 0;
}

}  // namespace

void add_archive_serve(CLI::App& group, int& exit_code) {
    const auto [command, options] = add_command<ServeOptions>(
        group, exit_code, "serve", "Shows an archive in a browser; nothing can be changed there",
        serve_archive);
    command.add_option("--page", options.server.page,
                       "plain HTTP on this machine, \"127.0.0.1:PORT\" (default: port 8091, "
                       "without --remote)");
    command.add_option("--remote", options.server.remote,
                       "\"ADDRESS:PORT\": TLS with certificates on both sides, as server.remote");
    command.add_option("--certificate", options.server.certificate,
                       "of --remote, PEM (default: of --config)");
    command.add_option("--key", options.server.key,
                       "of the certificate, PEM (default: of --config)");
    command.add_option("--clients-ca", options.server.clients_ca,
                       "authority of the clients' certificates, PEM (default: of --config)");
    command.add_option("--revoked", options.server.revoked,
                       "certificates that no longer count, PEM (default: of --config)");
    add_archive_options(command, options.where);
    command.add_flag("--json", options.json, "print the addresses as one line of JSON");
    command.footer(
        "Example: vibrig archive serve --archive /lab/archive\n"
        "Ends with SIGINT or SIGTERM.\n"
        "Exit codes: 0 ended by a signal, 2 bad usage or input.");
}

}  // namespace vibrig::tool
