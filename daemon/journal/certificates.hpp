#pragma once

#include <cstdint>
#include <string>

namespace vibrig::journal {

/// A certificate that was issued, as the laboratory's register keeps it: a file of its own, because
/// the journal is signed and the daemon alone writes it.
struct IssuedCertificate {
    std::int64_t utc_ns = 0;
    std::string number, campaign, person;
    std::string pdf_sha256, json_sha256;  ///< of the files that were given away
};

/// Whether a certificate of this number stands in the register at `path`, which is made if
/// it is not there. Throws DatabaseError.
[[nodiscard]] bool certificate_issued(const std::string& path, const std::string& number);
/// Adds one; a number is given once. Throws DatabaseError.
void note_certificate(const std::string& path, const IssuedCertificate& certificate);

}  // namespace vibrig::journal
