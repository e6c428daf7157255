#pragma once

#include <memory>
#include <string>
#include <string_view>

struct evp_pkey_st;

namespace vibrig::journal {

/// An Ed25519 key in a file that its owner alone can read. Keys and signatures in lower-case hex.
class SigningKey {
  public:
    /// Reads the file, or makes key and file (0600, synced), which is there once keep() is called.
    /// Throws std::runtime_error naming it.
    explicit SigningKey(const std::string& path);
    void keep();

    [[nodiscard]] bool made() const noexcept {
        return made_;
    }  ///< it was not there, and is not yet
    [[nodiscard]] const std::string& public_key() const noexcept { return public_; }
    [[nodiscard]] std::string sign(std::string_view message) const;

  private:
    struct Free {
        void operator()(evp_pkey_st* key) const noexcept;
    };
    std::unique_ptr<evp_pkey_st, Free> key_;
    std::string path_, public_;
    bool made_ = false;
};

/// False for what is no key or no signature, too.
[[nodiscard]] bool signature_holds(std::string_view public_key, std::string_view message,
                                   std::string_view signature);

/// SHA-256, 32 bytes.
[[nodiscard]] std::string sha256(std::string_view bytes);
[[nodiscard]] std::string to_hex(std::string_view bytes);
/// Empty: not hex.
[[nodiscard]] std::string from_hex(std::string_view text);

}  // namespace vibrig::journal
