#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/commission/record.hpp"

namespace vibrig::commission {

/// How a part stands against a configuration.
struct Standing {
    Part part = Part::bus;
    bool proven = false;
    std::string why;          ///< not proven
    std::string moved;        ///< proven, but a zero has moved since
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
    /// The identity that the shaker's controller reports, which its parts stand on. Until it is
    /// known they are not held against it.
    void shaker_is(const std::string& device);
    /// What the file says that is not a record; empty: nothing.
    [[nodiscard]] const std::string& trouble() const noexcept { return trouble_; }
    /// What the daemon runs with, as it was when it started.
    [[nodiscard]] const Keys& keys(Part part) const { return keys_.at(part); }
    /// Evidence of a part as it was proven; empty: it was not.
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
