#include "daemon/configuration/configuration.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <string_view>

#include "daemon/configuration/cross_checks.hpp"
#include "daemon/configuration/derived.hpp"
#include "daemon/configuration/forms.hpp"
#include "daemon/configuration/schema.hpp"
#include "daemon/configuration/value.hpp"
#include "proto/edits.hpp"
#include "proto/text.hpp"

namespace vibrig::configuration {

namespace {

/// 10 000 positions are some 300 kB.
constexpr std::size_t kLargestFile = 4U << 20U;

std::string last_part(const std::string& key) { return key.substr(key.rfind('.') + 1); }

std::set<std::string> candidates(bool table) {
    std::set<std::string> names;
    for (const Key& key : schema()) {
        if (!table) {
            names.insert(key.name);
            continue;
        }
        for (std::size_t dot = key.name.find('.'); dot != std::string::npos;
             dot = key.name.find('.', dot + 1)) {
            names.insert(key.name.substr(0, dot));
        }
    }
    return names;
}

/// The known key (or table) that a person most likely meant; empty if none is near.
std::string nearest_key(const std::string& key, bool table) {
    constexpr std::size_t kLongest = 100;
    if (key.size() > kLongest) {
        return "";
    }
    std::string best;
    std::size_t best_edits = std::max<std::size_t>(2, last_part(key).size() / 3) + 1;
    for (const std::string& name : candidates(table)) {
        const std::size_t whole = proto::edits(key, name);
        // The right name in the wrong section is one mistake, whatever the sections are called.
        const std::size_t part = last_part(key) == last_part(name) ? 1 : whole;
        if (std::min(whole, part) < best_edits) {
            best_edits = std::min(whole, part);
            best = name;
        }
    }
    return best;
}

/// Takes every value of a file to its key.
class Reader {
  public:
    Reader(Configuration& configuration, Problems& problems)
        : configuration_(configuration), problems_(problems) {
        for (const Key& key : schema()) {
            keys_[key.name] = &key;
        }
    }

    void read(const toml::table& table, const std::string& prefix) {
        for (const auto& [name, node] : table) {
            const std::string key = prefix + std::string(name.str());
            const bool section = is_section(key);
            const auto known = keys_.find(key);
            if (section && node.is_table()) {
                read(*node.as_table(), key + ".");
            } else if (known != keys_.end()) {
                places_[key] = place_of(node.source());
                if (node.value<std::string_view>() == kBlank)
                    blank(*known->second, places_[key]);
                else
                    known->second->read({node, key, problems_}, configuration_);
            } else if (section) {
                problems_.add(place_of(node.source()), key, describe(node), "a table");
            } else {
                const std::string near = nearest_key(key, node.is_table());
                problems_.add(place_of(name.source()), key,
                              node.is_table() ? "an unknown table" : "an unknown key",
                              near.empty() ? "a known one" : "a known one, perhaps " + near);
            }
        }
    }

    [[nodiscard]] const std::map<std::string, Place>& places() const { return places_; }

  private:
    /// What `vibrigd --init` left for a person, who has not filled it in.
    void blank(const Key& key, Place place) {
        const std::string unit = key.unit.empty() ? "" : " " + key.unit;
        problems_.add(place, key.name, std::string("\"") + kBlank + "\"",
                      key.bounds + unit + ": " + key.doc);
    }
    [[nodiscard]] bool is_section(const std::string& key) const {
        const auto next = keys_.lower_bound(key + ".");
        return next != keys_.end() && next->first.compare(0, key.size() + 1, key + ".") == 0;
    }

    Configuration& configuration_;
    Problems& problems_;
    std::map<std::string, const Key*> keys_;
    std::map<std::string, Place> places_;
};

std::vector<EffectiveValue> effective_of(Configuration& configuration, const std::string& file,
                                         const std::map<std::string, Place>& places) {
    std::vector<EffectiveValue> effective;
    for (const Key& key : schema()) {
        const std::string value = key.write(configuration);
        if (value.empty()) {
            continue;
        }
        const auto place = places.find(key.name);
        effective.push_back(
            {key.name, value, key.unit,
             place == places.end() ? "default" : file + ":" + std::to_string(place->second.line),
             key.doc});
    }
    return effective;
}

std::string read_file(const std::string& path) {
    const auto refuse = [&path](const std::string& found) -> ConfigurationError {
        return ConfigurationError(path + ": found " + found + ", expected a configuration file");
    };
    std::error_code error;
    if (std::filesystem::is_directory(path, error)) {
        throw refuse("a folder");
    }
    errno = 0;
    std::ifstream file(path, std::ios::binary);
    if (!file) {
        throw refuse(errno != 0 ? std::strerror(errno) : "nothing that can be read");
    }
    std::string text(kLargestFile + 1, '\0');
    file.read(text.data(), static_cast<std::streamsize>(text.size()));
    if (file.bad()) {
        throw refuse("an error while reading");
    }
    text.resize(static_cast<std::size_t>(file.gcount()));
    if (text.size() > kLargestFile) {
        throw refuse("more than " + std::to_string(kLargestFile) + " bytes");
    }
    return text;
}

toml::table parse_toml(const std::string& text, const std::string& name) {
    try {
        return toml::parse(text, name);
    } catch (const toml::parse_error& error) {
        const Place place = place_of(error.source());
        throw ConfigurationError(name + ":" + std::to_string(place.line) + ":" +
                                 std::to_string(place.column) +
                                 ": not TOML: " + proto::printable(error.description(), 300));
    }
}

/// What a proof of the safe state stands on: "key=value\n" each, sorted.
std::string covered_by_proof(const std::vector<EffectiveValue>& effective) {
    static constexpr std::array<std::string_view, 8> kSections{
        "accelerometer", "can",      "clock",  "interlock",
        "platform",      "selftest", "shaker", "vibration"};
    std::vector<std::string> lines;
    for (const EffectiveValue& value : effective) {
        const auto section = std::string_view(value.key).substr(0, value.key.find_first_of(".["));
        // How long a proof is valid is no part of what it shows.
        if (value.key == "selftest.proof_valid_h" || value.key == "selftest.emergency_stop_days")
            continue;
        // Bolted to the table it is another rig.
        const bool hard = value.key == "spectrum.mount" && value.value == "\"hard\"";
        if (hard || std::ranges::find(kSections, section) != kSections.end())
            lines.push_back(value.key + "=" + value.value + "\n");
    }
    std::ranges::sort(lines);
    std::string text;
    for (const auto& line : lines) text += line;
    return text;
}

/// FNV-1a, 64 bits: tells whether a file is the one of that day, not whether somebody forged it.
std::string fingerprint_of_file(const std::string& path) {
    std::error_code error;
    std::ifstream file(path, std::ios::binary);
    if (!file || !std::filesystem::is_regular_file(path, error)) return "unknown";
    std::uint64_t hash = 0xcbf29ce484222325U;
    for (std::istreambuf_iterator<char> at(file), end; at != end; ++at)
        hash = (hash ^ static_cast<unsigned char>(*at)) * 0x100000001b3U;
    return std::to_string(hash);
}

}  // namespace

Loaded parse(const std::string& text, const std::string& name, bool daemon) {
    const toml::table table = parse_toml(text, name);
    const std::filesystem::path folder = std::filesystem::path(name).parent_path();
    Loaded loaded;
    Configuration& c = loaded.configuration;
    Problems problems;
    Reader reader(c, problems);
    reader.read(table, "");
    derive_defaults(c, folder, reader.places(), problems);
    // With what the profiles' files say: a recording is read without them.
    loaded.effective = effective_of(c, name, reader.places());
    c.campaign.proof.keys = covered_by_proof(loaded.effective);
    derive_campaign(c, folder, reader.places(), problems);
    CrossCheck check(c, reader.places(), problems);
    check.everywhere();
    if (daemon) {
        check.for_daemon();
    }
    if (!problems.empty()) {
        throw ConfigurationError(problems.text(name));
    }
    derive_opening(c);
    for (auto* const path :
         {&c.dbc, &c.results, &c.server.certificate, &c.server.key, &c.server.clients_ca,
          &c.server.revoked, &c.mqtt.ca, &c.mqtt.certificate, &c.mqtt.key, &c.mqtt.password_file,
          &c.commission.folder, &c.archive.folder, &c.journal, &c.log_file})
        resolve(*path, folder);
    if (!c.dbc.empty())
        c.campaign.proof.keys += "contents of can.dbc=" + fingerprint_of_file(c.dbc) + "\n";
    return loaded;
}

Loaded load(const std::string& path, bool daemon) {
    if (path.empty()) {
        return parse("", "built-in configuration", daemon);
    }
    Loaded loaded = parse(read_file(path), path, daemon);
    loaded.path = path;
    return loaded;
}

}  // namespace vibrig::configuration
