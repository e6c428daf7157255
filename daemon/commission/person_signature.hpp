#pragma once

#include <cstdint>
#include <string>

namespace vibrig::commission {

/// A detached CMS signature (DER, lower-case hex) over a text, with the signer's certificate in it.
/// `certificate` and `key` are PEM files. Throws std::runtime_error that names the file.
[[nodiscard]] std::string sign_detached(const std::string& text, const std::string& certificate,
                                        const std::string& key);

/// Who has signed the text: the certificate's common name. The certificate has to come from an
/// authority of the PEM file, and to have been valid at `utc_ns`. Throws std::invalid_argument that
/// says what does not hold.
[[nodiscard]] std::string signer_of_detached(const std::string& text, const std::string& signature,
                                             const std::string& authority, std::int64_t utc_ns);

}  // namespace vibrig::commission
