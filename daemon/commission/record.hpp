#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
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

/// How a part stands against a configuration.
struct Standing {
    Part part = Part::bus;
    bool proven = false;
    std::string why;          ///< not proven
    std::string told;         ///< proven, but a zero has moved since
    std::string signed_by{};  ///< a person's certificate
    std::optional<PartRecord> record;
};

/// The record of one rig, on disk. Control thread only.
class Book {
  public:
    /// Reads what there is. `loaded` must outlive this.
    explicit Book(const configuration::Loaded& loaded);

    [[nodiscard]] std::vector<Standing> standing(std::int64_t utc_ns) const;
    /// Why nothing is armed; empty: all parts are proven, or none is demanded. Those after `last`
    /// are not asked for: no gyros to move gimbals, none of the shaker's to prove them.
    [[nodiscard]] std::string refusal(std::int64_t utc_ns, Part last = Part::excitation) const;
    /// A part below the shaker's that does not stand: without it nothing of the shaker is
    /// witnessed. Empty: all of them stand.
    [[nodiscard]] std::string not_proven_below_shaker(std::int64_t utc_ns) const;
    /// Who the shaker's controller says it is, which its parts stand on. Until it is known they are
    /// not held against it.
    void shaker_is(const std::string& device);
    /// What the file says that is not a record; empty: nothing.
    [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
    /// What the daemon runs with, as it was when it started.
    [[nodiscard]] const Keys& keys(Part part) const { return keys_.at(part); }
    /// Of a part as it was proven; empty: it was not.
    [[nodiscard]] Json evidence(Part part) const;
    /// Takes a part in and writes the file. Throws std::runtime_error that names the file.
    void prove(const std::vector<Part>& parts, const PartRecord& what,
               const configuration::Loaded& as);
    /// Takes a person's signature in, and writes the file. The authority that the certificate has
    /// to come from is server.clients_ca. Throws std::invalid_argument that says what does not
    /// hold, and as prove().
    void sign(const std::vector<Part>& parts, const std::string& by, const std::string& cms);
    /// Who has signed which part, by a journal that nobody edits unseen: without these signatures
    /// the part is not proven, whoever has taken them out of the file.
    void expect_signed(const std::vector<std::pair<std::string, std::string>>& by_part);
    /// Takes a part out, if it is in, and writes the file. Throws as prove().
    void withdraw(Part part);
    [[nodiscard]] Json status(std::int64_t utc_ns) const;
    /// Public key of its signature; empty: there is none.
    [[nodiscard]] std::string signed_with() const { return record_ ? record_->signed_with : ""; }
    /// SHA-256 of the file; empty: there is none.
    [[nodiscard]] std::string sha256() const;

  private:
    [[nodiscard]] std::string path() const;
    [[nodiscard]] std::string key_path() const;
    [[nodiscard]] std::string doubt() const;
    [[nodiscard]] std::string signature_gone(Part part) const;
    [[nodiscard]] std::string doubt_of(const PersonSignature& one) const;
    void write(Record fresh);

    const configuration::Loaded& loaded_;
    std::map<Part, Keys> keys_;  ///< now
    std::string device_;         ///< of the shaker; empty: not known
    std::optional<Record> record_;
    std::map<Part, std::vector<std::string>> signed_by_;  ///< as the journal has it
    std::string text_;                                    ///< of the file
    std::string trouble_;
};

}  // namespace vibrig::commission
