#include "daemon/serve/pki.hpp"

#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "daemon/tool/commands.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {
namespace {

namespace fs = std::filesystem;
using serve::CertificateSettings;
using serve::Identity;
using serve::PkiError;
using Json = nlohmann::ordered_json;

struct PkiOptions {
    std::string folder = "vibrig-pki";
    std::vector<std::string> hosts;
    std::vector<std::string> viewers, operators, admins;
    int days = 825;
    std::string password;
    std::vector<std::string> revoked;
    bool json = false;
};

constexpr const char* kAuthority = "authority";
constexpr const char* kServer = "server";
constexpr const char* kRevoked = "revoked.crl";

/// Keys are for their owner only, from the moment they exist.
void write(const fs::path& path, const std::string& text, bool secret) {
    struct Mask {
        explicit Mask(mode_t mask) : before(::umask(mask)) {}
        ~Mask() { ::umask(before); }
        Mask(const Mask&) = delete;
        Mask& operator=(const Mask&) = delete;
        mode_t before;
    } const mask(secret ? 0077 : 0022);
    proto::write_durably(path.string(), text, secret ? 0600 : 0644);
}

std::string read(const fs::path& path) {
    constexpr std::size_t kLongestFile = std::size_t{16} << 20;  // of a list of revoked ones
    std::string text;
    try {
        text = proto::read_whole_file(path.string(), kLongestFile);
    } catch (const std::runtime_error& error) {
        throw PkiError(path.string() + ": " + error.what());
    }
    if (text.empty())
        throw PkiError(path.string() +
                       ": found an empty file, expected a certificate or a key in PEM; bring it "
                       "back from a copy, or take it away with the authority that goes with it");
    return text;
}

void save(const fs::path& folder, const std::string& name, const Identity& identity) {
    write(folder / (name + ".crt"), identity.certificate, false);
    write(folder / (name + ".key"), identity.key, true);
}

Identity authority_in(const fs::path& folder) {
    return {read(folder / (std::string(kAuthority) + ".crt")),
            read(folder / (std::string(kAuthority) + ".key"))};
}

/// What of a name is no name of a certificate and of files; empty: all is well.
std::string wrong_with(const std::string& name) {
    // X.520's upper bound of a common name, in characters; of a file's name 255 bytes with ".key".
    constexpr std::ptrdiff_t kCharacters = 64;
    constexpr std::size_t kBytes = 250;
    if (name.empty() || proto::printable(name, name.size()) != name)
        return "a name, one line of UTF-8 without control characters";
    if (name.find_first_of("/\\") != std::string::npos || name.front() == '.')
        return "a name without '/' and '\\' that does not begin with '.': files are called so";
    const auto characters = std::ranges::count_if(
        name, [](char c) { return (static_cast<unsigned char>(c) & 0xC0U) != 0x80; });
    if (characters > kCharacters || name.size() > kBytes) return "a name of 64 characters at most";
    if (name == kAuthority || name == kServer)
        return "another name: the files of the " + name + " are called so";
    return {};
}

void check_people(const PkiOptions& options) {
    std::set<std::string> seen;
    for (const auto& [option, names] : {std::pair{"--viewer: ", &options.viewers},
                                        {"--operator: ", &options.operators},
                                        {"--admin: ", &options.admins}}) {
        for (const std::string& name : *names) {
            const std::string found = option + ("found \"" + proto::printable(name)) + '"';
            if (const auto expected = wrong_with(name); !expected.empty())
                throw PkiError(found + ", expected " + expected);
            if (!seen.insert(name).second)
                throw PkiError(found + " a second time, expected each person once");
            const fs::path key = fs::path(options.folder) / (name + ".key");
            if (fs::exists(key))
                throw PkiError(key.string() + " is there already; nothing was changed");
        }
    }
}

/// Whether the server has its certificate already. One that does not do, whose key the rig may be
/// using, is never replaced.
bool check_server(const PkiOptions& options) {
    for (const std::string& host : options.hosts) {
        if (!serve::is_host(host))
            throw PkiError("--host: found \"" + proto::printable(host) +
                           "\", expected a name such as rig.lab, or an address");
    }
    const fs::path folder = options.folder;
    const fs::path certificate = folder / (std::string(kServer) + ".crt");
    const fs::path key = folder / (std::string(kServer) + ".key");
    if (options.hosts.empty() || (!fs::exists(certificate) && !fs::exists(key))) return false;
    std::string why;
    if (!fs::exists(key))
        why = "has no " + key.string() + " beside it";
    else if (!fs::exists(folder / (std::string(kAuthority) + ".key")))
        why = "comes from an authority whose key is not there";
    else
        why = serve::unfit_for(options.hosts, read(certificate), authority_in(folder).certificate);
    if (why.empty()) return true;
    throw PkiError("--host: " + certificate.string() + " is there already and " + why +
                   "; nothing was changed. For a new one, which names what is asked for then, "
                   "move server.crt and server.key away first");
}

/// For people, as it happens.
void say(const PkiOptions& options, const std::string& line) {
    if (!options.json) std::cout << line << std::endl;
}

/// For machines, at the end.
int say_all(const PkiOptions& options, const Json& all) {
    if (options.json) std::cout << proto::json_text(all) << std::endl;
    return 0;
}

/// Made, unless it is `there`; what is said of it to machines.
Json make_server(const PkiOptions& options, const Identity& authority, bool there) {
    const fs::path folder = options.folder;
    const std::string file = (folder / kServer).string();
    if (!there) {
        // A common name is short; who connects looks at the hosts.
        constexpr std::size_t kCommonName = 64;
        const auto& first = options.hosts.front();
        save(folder, kServer,
             serve::make_identity(
                 {CertificateSettings::Use::server, first.size() <= kCommonName ? first : kServer,
                  "", options.hosts, std::chrono::hours(-1), std::chrono::hours(24 * options.days)},
                 &authority));
    }
    say(options, "server: " + file + ".crt, .key" + (there ? "; those that were there" : ""));
    return {{"hosts", options.hosts},
            {"certificate", file + ".crt"},
            {"key", file + ".key"},
            {"is_new", !there}};
}

int init(const PkiOptions& options) {
    // All of it before anything is written.
    check_people(options);
    const bool server_is_there = check_server(options);
    const fs::path folder = options.folder;
    std::error_code error;
    fs::create_directories(folder, error);
    if (error)
        throw PkiError("--folder: found \"" + proto::printable(options.folder) +
                       "\", expected a folder, or where one can be made: " + error.message());
    const auto valid_for = std::chrono::hours(24 * options.days);
    Identity authority;
    Json all{{"folder", folder.string()}, {"authority", (folder / kAuthority).string() + ".crt"}};
    // A second call adds people to the same authority.
    if (fs::exists(folder / (std::string(kAuthority) + ".key"))) {
        authority = authority_in(folder);
        say(options, "authority: the one in " + folder.string());
        all["authority_is_new"] = false;
    } else {
        authority = serve::make_identity({CertificateSettings::Use::authority,
                                          "Vibrig authority",
                                          "",
                                          {},
                                          std::chrono::hours(-1),
                                          4 * valid_for});
        save(folder, kAuthority, authority);
        say(options,
            "authority: " + (folder / kAuthority).string() + ".crt; keep its key off the rig");
        all["authority_is_new"] = true;
    }
    // Named in the configuration from the first day, it is there when somebody has to be shut out.
    if (!fs::exists(folder / kRevoked))
        write(folder / kRevoked, serve::revoke("", authority, ""), false);
    all["list"] = (folder / kRevoked).string();
    all["server"] = nullptr;
    all["people"] = Json::array();
    const auto client = [&](const std::string& name, const std::string& role) {
        const Identity made = serve::make_identity(
            {CertificateSettings::Use::client, name, role, {}, std::chrono::hours(-1), valid_for},
            &authority);
        write(folder / (name + ".p12"),
              serve::pkcs12_of(made, authority.certificate, name, options.password), true);
        // The key last: where it is, the others are, and a second call begins anew without it.
        save(folder, name, made);
        const std::string file = (folder / name).string();
        say(options, role + ": " + file + ".crt, .key; .p12 for a browser");
        all["people"].push_back({{"name", name},
                                 {"role", role},
                                 {"certificate", file + ".crt"},
                                 {"key", file + ".key"},
                                 {"browser", file + ".p12"}});
    };
    if (!options.hosts.empty()) all["server"] = make_server(options, authority, server_is_there);
    for (const std::string& name : options.viewers) client(name, "viewer");
    for (const std::string& name : options.operators) client(name, "operator");
    for (const std::string& name : options.admins) client(name, "admin");
    return say_all(options, all);
}

int revoke(const PkiOptions& options) {
    const fs::path folder = options.folder;
    const fs::path list = folder / kRevoked;
    const Identity authority = authority_in(folder);
    Json all{{"folder", folder.string()}, {"list", list.string()}, {"revoked", options.revoked}};
    for (const std::string& name : options.revoked) {
        const fs::path certificate = folder / (name + ".crt");
        if (name == kAuthority) throw PkiError("the authority cannot revoke itself");
        if (proto::printable(name, name.size()) != name)
            throw PkiError("name: found \"" + proto::printable(name) +
                           "\", expected somebody's, one line of UTF-8");
        const std::string before = fs::exists(list) ? read(list) : std::string{};
        std::string text;
        try {
            text = serve::revoke(read(certificate), authority, before);
        } catch (const PkiError& error) {
            throw PkiError("found '" + name + "', expected somebody with a valid certificate in " +
                           folder.string() + ": " + error.what());
        }
        // Never half a list: the daemon looks at it at any time.
        const fs::path fresh = folder / (std::string(kRevoked) + ".new");
        write(fresh, text, false);
        fs::rename(fresh, list);
        // Out of the way of a new certificate for the same name.
        const fs::path aside = folder / "revoked";
        fs::create_directories(aside);
        for (const char* const kind : {".crt", ".key", ".p12"}) {
            std::error_code none;
            fs::rename(folder / (name + kind), aside / (name + kind), none);
        }
        say(options, name + ": revoked; its files are in " + aside.string());
    }
    say(options, "the list for the rig: " + list.string());
    return say_all(options, all);
}

}  // namespace

void add_pki(CLI::App& app, int& exit_code) {
    CLI::App& pki = *app.add_subcommand("pki", "Certificates for a daemon that is asked remotely");
    pki.require_subcommand(1);
    pki.footer(
        "Example: vibrig pki init --host rig.lab --operator ada --viewer wall\n"
        "More: vibrig pki init --help, vibrig pki revoke --help");
    const auto [making, options] = add_command<PkiOptions>(
        pki, exit_code, "init", "Make an authority, a server's certificate and people's", init,
        "vibrig: ");
    making.add_option("--folder", options.folder, "Where they go")->capture_default_str();
    making.add_option("--host", options.hosts,
                      "Name or address of the rig's machine, as people will type it");
    making.add_option("--viewer", options.viewers, "Who may look");
    making.add_option("--operator", options.operators, "Who may command");
    making.add_option("--admin", options.admins, "Who may administer");
    making.add_option("--days", options.days, "Validity; the authority's is four times as long")
        ->check(CLI::Range(1, 3650))
        ->capture_default_str();
    making.add_option("--p12-password", options.password, "Of the files for browsers");
    making.add_flag("--json", options.json, "Print what was made as JSON");
    making.footer(
        "Example: vibrig pki init --host rig.lab --host 10.0.0.5 --operator ada --viewer wall\n"
        "Again, with other people, it adds them; the server's certificate stays as it is, and one\n"
        "that does not name each --host is refused: move server.crt and server.key away first.\n"
        "On the rig:\n"
        "  [server]\n"
        "  remote = \"0.0.0.0:8443\"\n"
        "  certificate = \"server.crt\"\n"
        "  key = \"server.key\"\n"
        "  clients_ca = \"authority.crt\"");
    const auto [revoking, of] = add_command<PkiOptions>(
        pki, exit_code, "revoke", "Make people's certificates worthless before their time", revoke,
        "vibrig: ");
    revoking.add_option("--folder", of.folder, "Where they are")->capture_default_str();
    revoking.add_option("name", of.revoked, "Whose")->required();
    revoking.add_flag("--json", of.json, "Print what was done as JSON");
    revoking.footer(
        "Example: vibrig pki revoke ada\n"
        "On the rig, which takes a changed list over by itself and ends connections:\n"
        "  [server]\n"
        "  revoked = \"revoked.crl\"");
}

}  // namespace vibrig::tool
