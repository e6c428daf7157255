#pragma once

#include <chrono>
#include <stdexcept>
#include <string>
#include <vector>

namespace vibrig::serve {

class PkiError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// What stands in a certificate. Times are relative to now.
struct CertificateSettings {
    enum class Use { authority, server, client } use = Use::client;
    std::string common_name;
    std::string role;                ///< organisational unit; of clients
    std::vector<std::string> hosts;  ///< of servers: names and addresses
    std::chrono::seconds valid_from{-3600};
    std::chrono::seconds valid_for{std::chrono::hours(24 * 825)};
};

/// A key (elliptic, P-256) with its certificate, both PEM.
struct Identity {
    std::string certificate, key;
};

/// A name as in the DNS (letters, digits, '-', '_', '.', a '*' for a part) or a numeric address.
[[nodiscard]] bool is_host(const std::string& text);
/// Why a server's certificate does not do for these hosts: it names not all of them, has ended, or
/// comes from another authority. Empty: it does. Throws PkiError where it cannot be read.
[[nodiscard]] std::string unfit_for(const std::vector<std::string>& hosts,
                                    const std::string& certificate, const std::string& authority);
/// Signed by the issuer; by itself without one. Throws PkiError.
[[nodiscard]] Identity make_identity(const CertificateSettings& settings,
                                     const Identity* issuer = nullptr);
/// The authority's list of certificates that no longer count (CRL, PEM), valid as long as the
/// authority: `before` (empty: none yet) and one certificate more; of an empty one nobody's. Throws
/// PkiError, also when the certificate is another authority's.
[[nodiscard]] std::string revoke(const std::string& certificate, const Identity& authority,
                                 const std::string& before);
/// Key, certificate and authority in one file that browsers import. Throws PkiError.
[[nodiscard]] std::string pkcs12_of(const Identity& identity, const std::string& authority,
                                    const std::string& name, const std::string& password);

}  // namespace vibrig::serve
