// What `vibrig commission` writes: the configuration, and the record by way of the daemon.
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <stdexcept>
#include <string_view>

#include "daemon/commission/acceptance.hpp"
#include "daemon/commission/person_signature.hpp"
#include "daemon/configuration/configuration.hpp"
#include "daemon/tool/live/commission_client.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

std::string text_of_file(const std::string& path) {
    // More than any configuration, or what was found for one, can be.
    constexpr std::size_t kLongestFile = std::size_t{16} << 20;
    try {
        return proto::read_whole_file(path, kLongestFile);
    } catch (const std::runtime_error& error) {
        throw std::runtime_error(path + ": " + error.what());
    }
}

/// What is said and asked: with --json standard output has the outcome alone.
std::ostream& aside(const CommissionOptions& options) {
    return options.json ? std::cerr : std::cout;
}

bool agreed(const CommissionOptions& options, const std::string& question) {
    if (options.yes) return true;
    aside(options) << "? " << question << " [yes or no]\n> " << std::flush;
    std::string line;
    return std::getline(std::cin, line) && (line == "yes" || line == "y");
}

/// What was there is kept beside the file itself, not beside a link to it. Returns where.
std::string save_file(std::ostream& out, const std::string& path, const std::string& before,
                      const std::string& text) {
    const std::string real = std::filesystem::canonical(path).string();
    std::string kept = real + ".1";
    for (int n = 2; std::filesystem::exists(kept); ++n) kept = real + "." + std::to_string(n);
    proto::write_durably(kept, before, 0600);
    std::filesystem::permissions(kept, std::filesystem::status(real).permissions());
    proto::write_durably(path, text);
    print_wrapped(out, path + " is written; as it was: " + kept);
    return kept;
}

/// Those of `values` that the configuration does not say yet; each is printed and, as JSON,
/// `listed`.
std::vector<TomlValue> changed_of(std::vector<TomlValue> values, const configuration::Loaded& now,
                                  std::ostream& out, CommissionJson& listed) {
    std::vector<TomlValue> changed;
    for (auto& value : values) {
        const auto at =
            std::ranges::find(now.effective, value.key, &configuration::EffectiveValue::key);
        const std::string was = at == now.effective.end() ? "nothing" : at->value;
        // 1 and 1.0 are one value.
        const auto meant = CommissionJson::parse(value.value, nullptr, false);
        if (was == value.value ||
            (!meant.is_discarded() && CommissionJson::parse(was, nullptr, false) == meant))
            continue;
        print_wrapped(out, "- " + value.key + " = " + was);
        print_wrapped(out, "+ " + value.key + " = " + value.value);
        listed.push_back({{"key", value.key}, {"was", was}, {"is", value.value}});
        changed.push_back(std::move(value));
    }
    return changed;
}

/// Last, once all is done.
int accepted_as(const CommissionOptions& options, CommissionJson outcome) {
    outcome["outcome"] = "accepted";
    if (options.json) std::cout << proto::json_text(outcome, 1) << '\n';
    return 0;
}

/// Before anything is written or asked.
void expect_two(const CommissionOptions& options) {
    if (options.second.empty())
        throw std::runtime_error("--second: found nothing, expected another person");
    if (const auto why = commission::not_two(options.by, options.second); !why.empty())
        throw CommissionRefused(why);
}

std::string signed_by(const CommissionOptions& options, const std::string& text) {
    return commission::sign_detached(text, options.identity + ".crt", options.identity + ".key");
}

/// Before anything is written or asked, too.
void expect_identity(const CommissionOptions& options) {
    if (!options.identity.empty()) static_cast<void>(signed_by(options, "may it be used?"));
}

/// What was recorded just now, with the certificate of who is at the tool, if there is one.
void sign_recorded(serve::Client& client, const CommissionOptions& options,
                   const std::vector<std::string>& parts) {
    if (options.identity.empty()) return;
    const auto record = commission_state(client, options.by, 0)["record"];
    std::map<commission::Part, std::string> digests;
    for (const auto& name : parts)
        digests[commission::part_named(name).value()] = record["parts"][name]["digest"];
    const auto cms =
        signed_by(options, commission::statement_of(record["rig"].get<std::string>(), digests));
    print_wrapped(
        aside(options),
        commission_command(client, options.by, {{"do", "sign"}, {"parts", parts}, {"cms", cms}}));
}

/// A line of a person, with blanks around it taken off.
std::string line_of_person(std::ostream& out) {
    std::string line;
    out << "> " << std::flush;
    if (!std::getline(std::cin, line)) throw CommissionRefused("nobody answers: not stated");
    const auto first = line.find_first_not_of(" \t"), last = line.find_last_not_of(" \t");
    return first == std::string::npos ? "" : line.substr(first, last - first + 1);
}

/// What was said before is out of sight; where a terminal knows no way to clear itself it is
/// scrolled away.
void clear_terminal(std::ostream& out) {
    if (isatty(&out == &std::cerr ? STDERR_FILENO : STDOUT_FILENO) == 0) return;
    const char* const kind = std::getenv("TERM");
    const bool dumb = kind == nullptr || *kind == '\0' || std::string_view(kind) == "dumb";
    constexpr std::size_t kRows = 100;
    out << (dumb ? std::string(kRows, '\n') : "\x1b[H\x1b[2J\x1b[3J") << std::flush;
}

/// Of one person alone.
CommissionJson sign_said_by(std::ostream& out, const std::string& person) {
    clear_terminal(out);
    print_wrapped(out, "drift_sign cannot be measured. " + person +
                           ", please, alone at the keyboard: a positive drift coefficient is");
    out << "  1  the gyro's output at zero input (IEEE Std 517)\n"
           "  2  the rate at which the platform turns\n"
           "  3  the torque that stops it\n";
    std::string says;
    while (says != "1" && says != "2" && says != "3") {
        out << "? Which? [1, 2 or 3]\n";
        says = line_of_person(out);
    }
    std::string source;
    while (source.empty()) {
        out << "? Where is that written? [name of the drawing or certificate]\n";
        source = line_of_person(out);
    }
    clear_terminal(out);
    return {{"by", person}, {"says", says[0] - '0'}, {"source", source}};
}

/// Bits that never changed, as far as both persons say that they are what they are called. Nobody
/// says so for them: without a question none is confirmed on a real rig.
CommissionJson confirmed_bits(serve::Client& client, const CommissionOptions& options,
                              const CommissionJson& state) {
    const auto with_bits = CommissionJson::parse(
        commission_command(client, options.by, {{"do", "read"}, {"bits", true}}));
    const auto left = with_bits["record"]["unproven_bits"];
    if (left.empty()) return left;
    const auto none = CommissionJson::array();
    std::string names;
    for (const auto& name : left) names += " " + name.get<std::string>();
    print_wrapped(aside(options), "never changed, unproven:" + names);
    if (options.yes && state["simulated"] != true) return none;
    return agreed(options, options.by + " and " + options.second +
                               ": by the maker's paper, is each what it is called?")
               ? left
               : none;
}

}  // namespace

std::vector<TomlValue> values_of(const CommissionJson& found, const CommissionJson& by,
                                 const std::string& mark) {
    std::vector<TomlValue> values;
    for (const auto& [key, value] : found.items()) {
        std::string text;
        // One blank behind a comma, as --check prints it.
        for (const char c : value.dump()) text += c == ',' ? std::string(", ") : std::string(1, c);
        values.push_back({key, text, mark + by.value(key, std::string())});
    }
    return values;
}

std::string mark_of(const CommissionJson& of) {
    return of.value("simulated", false) ? "SIMULATED: " : "";
}

int accept_bus(const CommissionOptions& options) {
    expect_two(options);
    if (options.configuration.empty())
        throw std::runtime_error("--bus: found no --config, expected the configuration to write");
    const std::string path = options.configuration;
    const std::string before = text_of_file(path);
    const auto now = configuration::parse(before, path, false);
    const auto found = std::filesystem::path(now.configuration.commission.folder) / "found.toml";
    auto values = values_in(text_of_file(found.string()), found.string());
    for (const auto& value : values)
        if (!value.key.starts_with("can."))
            throw std::runtime_error(found.string() + ": found " + value.key +
                                     ", expected what vibrig commission bus --find wrote");
    CommissionJson outcome{{"configuration", path}, {"changed", CommissionJson::array()}};
    const auto changed = changed_of(std::move(values), now, aside(options), outcome["changed"]);
    if (changed.empty()) throw CommissionRefused(path + " says so already: nothing is written");
    const std::string after = with_values(before, path, changed);
    // Before it takes the place of one that works.
    static_cast<void>(configuration::parse(after, path, false));
    if (!agreed(options, options.by + " and " + options.second + ": write " + path + "?"))
        throw CommissionRefused("not accepted: nothing is written");
    outcome["as_it_was"] = save_file(aside(options), path, before, after);
    return accepted_as(options, std::move(outcome));
}

int accept_commission(const CommissionOptions& options) {
    if (options.bus) return accept_bus(options);
    expect_two(options);
    expect_identity(options);
    serve::Client client(options.at);
    const auto state = commission_state(client, options.by, 0);
    const auto& procedure = state["procedure"];
    if (procedure.is_null() || procedure["active"] == true ||
        procedure["result"]["outcome"] != "decided")
        throw CommissionRefused("nothing is decided: vibrig commission --by NAME");
    const auto& result = procedure["result"];
    const std::string path = options.configuration.empty()
                                 ? state["configuration"].get<std::string>()
                                 : options.configuration;
    if (path.empty()) throw std::runtime_error("the daemon has no configuration file");
    if (!result["corrections"].empty())
        throw CommissionRefused("the DBC first, then commission anew: " +
                                result["corrections"][0].get<std::string>());
    const std::string before = text_of_file(path);
    CommissionJson outcome{{"configuration", path}, {"changed", CommissionJson::array()}};
    const auto changed =
        changed_of(values_of(result["found"], result["found_by"], mark_of(state)),
                   configuration::load(path, true), aside(options), outcome["changed"]);
    if (!changed.empty()) {
        const std::string after = with_values(before, path, changed);
        // Before it takes the place of one that works.
        static_cast<void>(configuration::parse(after, path, true));
        if (!agreed(options, options.by + " and " + options.second + ": write " + path + "?"))
            throw CommissionRefused("not accepted: nothing is written");
        outcome["as_it_was"] = save_file(aside(options), path, before, after);
    } else if (!agreed(options, options.by + " and " + options.second + ": record it?")) {
        throw CommissionRefused("not accepted");
    }
    const auto answer =
        commission_command(client, options.by,
                           {{"do", "accept"},
                            {"second", options.second},
                            {"confirmed_bits", confirmed_bits(client, options, state)}});
    print_wrapped(aside(options), answer);
    outcome["message"] = answer;
    outcome["simulated"] = state.value("simulated", false);
    sign_recorded(client, options, {"bus", "gimbals", "accelerometers", "earth"});
    return accepted_as(options, std::move(outcome));
}

int state_gyros(const CommissionOptions& options) {
    expect_two(options);
    expect_identity(options);
    serve::Client client(options.at);
    const auto state = commission_state(client, options.by, 0);
    if (options.yes && state["simulated"] != true)
        throw std::runtime_error("--yes: persons answer on a real rig");
    const auto now = configuration::load(state["configuration"].get<std::string>(), true);
    std::ostream& out = aside(options);
    auto said = CommissionJson::array();
    if (!options.yes) said = {sign_said_by(out, options.by), sign_said_by(out, options.second)};
    out << "From the drawing; nothing measures signs, output and spin axes or drift_sign:\n";
    for (const auto& value : now.effective)
        if (value.key.starts_with("platform.gyro_") || value.key == "platform.drift_sign" ||
            value.key.starts_with("levelling.torque_"))
            out << "  " << value.key << " = " << value.value << '\n';
    if (!agreed(options, options.by + " and " + options.second + ": is that so?"))
        throw CommissionRefused("not stated");
    const auto answer = commission_command(
        client, options.by,
        {{"do", "state"}, {"part", "gyros"}, {"second", options.second}, {"statements", said}});
    print_wrapped(out, answer);
    sign_recorded(client, options, {"gyros"});
    if (options.json)
        std::cout << proto::json_text(
                         CommissionJson{
                             {"outcome", "decided"},
                             {"message", answer},
                             {"simulated", state["simulated"]},
                             {"parts", commission_state(client, options.by, 0)["record"]["parts"]}},
                         1)
                  << '\n';
    return 0;
}

}  // namespace vibrig::tool
