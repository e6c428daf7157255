#include "daemon/journal/signing_key.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "proto/durable_file.hpp"

namespace vibrig::journal {

namespace {

constexpr std::size_t kKey = 32, kSignature = 64;

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;
using Context = std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)>;

const unsigned char* bytes_of(std::string_view text) {
    return reinterpret_cast<const unsigned char*>(text.data());
}
unsigned char* bytes_of(std::string& text) { return reinterpret_cast<unsigned char*>(text.data()); }

[[noreturn]] void fail(const std::string& path, const std::string& what) {
    throw std::runtime_error(path + ": " + what);
}

}  // namespace

void SigningKey::Free::operator()(evp_pkey_st* key) const noexcept { EVP_PKEY_free(key); }

SigningKey::SigningKey(const std::string& path) : path_(path) {
    // Where a pipe lies in its place, nobody is waited for.
    int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (fd >= 0) {
        const File file(::fdopen(fd, "r"), std::fclose);
        struct stat found {};
        if (::fstat(fd, &found) != 0) fail(path, std::strerror(errno));
        if (!S_ISREG(found.st_mode)) fail(path, "is no file, expected a signing key");
        if ((found.st_mode & (S_IRWXG | S_IRWXO)) != 0)
            fail(path,
                 fmt::format("found mode {:04o}, expected 0600: others than the daemon can read "
                             "its signing key",
                             found.st_mode & 07777U));
        if (found.st_uid != ::geteuid())
            fail(path,
                 fmt::format("found it owned by user {}, expected {}: another than the daemon "
                             "has its signing key",
                             found.st_uid, ::geteuid()));
        key_.reset(PEM_read_PrivateKey(file.get(), nullptr, nullptr, nullptr));
        if (!key_ || EVP_PKEY_get_id(key_.get()) != EVP_PKEY_ED25519)
            fail(path, "is no Ed25519 key in PEM");
    } else {
        if (errno != ENOENT) fail(path, std::strerror(errno));
        made_ = true;
        key_.reset(EVP_PKEY_Q_keygen(nullptr, nullptr, "ED25519"));
        if (!key_) fail(path, "no Ed25519 key could be made");
        const std::string unfinished = path + ".new";
        ::unlink(unfinished.c_str());
        fd = ::open(unfinished.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
        if (fd < 0) fail(unfinished, std::strerror(errno));
        File file(::fdopen(fd, "w"), std::fclose);
        const bool written = PEM_write_PrivateKey(file.get(), key_.get(), nullptr, nullptr, 0,
                                                  nullptr, nullptr) == 1 &&
                             std::fflush(file.get()) == 0 && ::fsync(fd) == 0;
        if (!written) fail(unfinished, std::strerror(errno));
    }
    std::string raw(kKey, '\0');
    std::size_t size = raw.size();
    if (EVP_PKEY_get_raw_public_key(key_.get(), bytes_of(raw), &size) != 1 || size != kKey)
        fail(path, "has no public key");
    public_ = to_hex(raw);
}

void SigningKey::keep() {
    const std::string unfinished = path_ + ".new";
    if (!made_) return;
    if (::rename(unfinished.c_str(), path_.c_str()) != 0) fail(unfinished, std::strerror(errno));
    // The journal names this key from now on: its name has to survive a power cut as well.
    proto::sync_folder_of(path_);
    made_ = false;
}

std::string SigningKey::sign(std::string_view message) const {
    const Context context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
    std::string signature(kSignature, '\0');
    std::size_t size = signature.size();
    if (EVP_DigestSignInit(context.get(), nullptr, nullptr, nullptr, key_.get()) != 1 ||
        EVP_DigestSign(context.get(), bytes_of(signature), &size, bytes_of(message),
                       message.size()) != 1) {
        throw std::runtime_error("nothing can be signed with the key");
    }
    return to_hex(signature);
}

bool signature_holds(std::string_view public_key, std::string_view message,
                     std::string_view signature) {
    const std::string key_bytes = from_hex(public_key), signed_bytes = from_hex(signature);
    if (key_bytes.size() != kKey || signed_bytes.size() != kSignature) return false;
    const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(
        EVP_PKEY_new_raw_public_key(EVP_PKEY_ED25519, nullptr,
                                    bytes_of(std::string_view(key_bytes)), kKey),
        EVP_PKEY_free);
    const Context context(EVP_MD_CTX_new(), EVP_MD_CTX_free);
    return key && EVP_DigestVerifyInit(context.get(), nullptr, nullptr, nullptr, key.get()) == 1 &&
           EVP_DigestVerify(context.get(), bytes_of(std::string_view(signed_bytes)), kSignature,
                            bytes_of(message), message.size()) == 1;
}

std::string sha256(std::string_view bytes) {
    std::string digest(32, '\0');
    unsigned size = 0;
    if (EVP_Digest(bytes.data(), bytes.size(), bytes_of(digest), &size, EVP_sha256(), nullptr) != 1)
        throw std::runtime_error("SHA-256 cannot be had");
    return digest;
}

std::string to_hex(std::string_view bytes) {
    const unsigned char* const begin = bytes_of(bytes);
    return fmt::format("{:02x}", fmt::join(begin, begin + bytes.size(), ""));
}

std::string from_hex(std::string_view text) {
    if (text.size() % 2 != 0) return {};
    std::string bytes;
    for (std::size_t i = 0; i < text.size(); i += 2) {
        unsigned byte = 0;
        const auto [end, error] = std::from_chars(text.data() + i, text.data() + i + 2, byte, 16);
        if (error != std::errc() || end != text.data() + i + 2) return {};
        bytes += static_cast<char>(byte);
    }
    return bytes;
}

}  // namespace vibrig::journal
