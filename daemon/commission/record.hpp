#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/configuration/configuration.hpp"

namespace vibrig::journal {
class SigningKey;
}

namespace vibrig::commission {

using Json = nlohmann::ordered_json;

/// What is proven apart, and voided apart. From registers on it is the shaker's, which proofs of
/// the safe state show (daemon/campaign/safety_proof.hpp).
enum class Part : std::uint8_t {
    bus,
    gimbals,
    accelerometers,
    earth,
    gyros,
    registers,
    watchdog,
    stop,
    units,
    excitation
};
inline constexpr std::array<Part, 10> kParts{
    Part::bus,       Part::gimbals,  Part::accelerometers, Part::earth, Part::gyros,
    Part::registers, Part::watchdog, Part::stop,           Part::units, Part::excitation};
inline constexpr std::array<Part, 5> kShakerParts{Part::registers, Part::watchdog, Part::stop,
                                                  Part::units, Part::excitation};
[[nodiscard]] constexpr bool of_the_shaker(Part part) noexcept { return part >= Part::registers; }
[[nodiscard]] const char* name_of(Part part) noexcept;
/// Nothing if there is no such part.
[[nodiscard]] std::optional<Part> part_named(std::string_view name);

/// Key and value as --check prints it.
using Keys = std::map<std::string, std::string>;

/// That a part stands on, those of the parts below it included; a DBC by the hash of its file.
[[nodiscard]] Keys keys_of(Part part, const configuration::Loaded& loaded);

/// One part as it was proven.
struct PartRecord {
    Keys keys;
    int meaning = 0;  ///< of the keys; a release that changes it voids the part
    Json evidence = Json::object();
    std::vector<std::string> by;
    std::int64_t utc_ns = 0;
    std::string version;  ///< of Vibrig
};

/// A person's own signature under parts of a record, made with the person's certificate.
struct PersonSignature {
    std::string by;  ///< as the certificate names the person
    std::vector<Part> parts;
    std::string cms;  ///< detached, over statement_of() these parts; hexadecimal
};

/// What is proven of a rig, one file for all parts.
struct Record {
    std::string rig;
    bool simulated = false;
    std::map<Part, PartRecord> parts;
    std::vector<PersonSignature> persons{};
    std::string signed_with;  ///< public key, hexadecimal; empty: it carries no signature
};

/// "2026-11-23" and "2026-11-23T14:05:00Z".
[[nodiscard]] std::string date_of(std::int64_t utc_ns);
[[nodiscard]] std::string instant_of(std::int64_t utc_ns);

/// Signed with `key`; nullptr: by nobody.
[[nodiscard]] std::string to_json(const Record& record, const journal::SigningKey* key = nullptr);
/// Throws std::invalid_argument: no such text, or one that is not as it was written.
[[nodiscard]] Record record_from_json(const std::string& text);

/// SHA-256 of all that a record says of a part.
[[nodiscard]] std::string digest_of(const PartRecord& part);
/// What a person signs: rig, and each part with its digest_of().
[[nodiscard]] std::string statement_of(const std::string& rig,
                                       const std::map<Part, std::string>& digests);

}  // namespace vibrig::commission
