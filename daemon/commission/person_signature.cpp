#include "daemon/commission/person_signature.hpp"

#include <openssl/bio.h>
#include <openssl/cms.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <openssl/x509_vfy.h>

#include <array>
#include <ctime>
#include <memory>
#include <stdexcept>

#include "daemon/journal/signing_key.hpp"

namespace vibrig::commission {

namespace {

template <auto Function>
struct Freed {
    template <class T>
    void operator()(T* it) const noexcept {
        Function(it);
    }
};
using Bio = std::unique_ptr<BIO, Freed<BIO_free_all>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;
using Signed = std::unique_ptr<CMS_ContentInfo, Freed<CMS_ContentInfo_free>>;
using Store = std::unique_ptr<X509_STORE, Freed<X509_STORE_free>>;

/// What OpenSSL says last, and nothing is left to be said of another error.
std::string cause() {
    std::array<char, 200> text{};
    const auto code = ERR_peek_last_error();
    ERR_clear_error();
    if (code == 0) return "it cannot be read";
    ERR_error_string_n(code, text.data(), text.size());
    const std::string all = text.data();
    return all.substr(all.rfind(':') + 1);
}

Bio opened(const std::string& path) {
    ERR_clear_error();
    Bio file(BIO_new_file(path.c_str(), "r"));
    if (!file) throw std::runtime_error(path + ": " + cause());
    return file;
}

Bio memory_of(const std::string& text) {
    return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

std::string name_in(const X509* certificate) {
    std::array<char, 256> name{};
    const int size = X509_NAME_get_text_by_NID(X509_get_subject_name(certificate), NID_commonName,
                                               name.data(), static_cast<int>(name.size()));
    return size > 0 ? std::string(name.data(), static_cast<std::size_t>(size)) : "";
}

}  // namespace

std::string sign_detached(const std::string& text, const std::string& certificate,
                          const std::string& key) {
    const Certificate who(PEM_read_bio_X509(opened(certificate).get(), nullptr, nullptr, nullptr));
    if (!who) throw std::runtime_error(certificate + ": " + cause());
    const Key with(PEM_read_bio_PrivateKey(opened(key).get(), nullptr, nullptr, nullptr));
    if (!with) throw std::runtime_error(key + ": " + cause());
    const Bio content = memory_of(text);
    const Signed made(CMS_sign(who.get(), with.get(), nullptr, content.get(),
                               CMS_DETACHED | CMS_BINARY | CMS_NOSMIMECAP));
    const Bio out(BIO_new(BIO_s_mem()));
    if (!made || i2d_CMS_bio(out.get(), made.get()) != 1)
        throw std::runtime_error(certificate + ": " + cause());
    char* data = nullptr;
    const long size = BIO_get_mem_data(out.get(), &data);
    return journal::to_hex({data, static_cast<std::size_t>(size)});
}

std::string signer_of_detached(const std::string& text, const std::string& signature,
                               const std::string& authority, std::int64_t utc_ns) {
    ERR_clear_error();
    const std::string der = journal::from_hex(signature);
    const Signed given(d2i_CMS_bio(memory_of(der).get(), nullptr));
    if (!given) throw std::invalid_argument("no CMS signature");
    const Store store(X509_STORE_new());
    if (!store || X509_STORE_load_file(store.get(), authority.c_str()) != 1)
        throw std::invalid_argument(authority + ": " + cause());
    // It was given then; that its certificate has run out since takes nothing back. Certificates of
    // clients are for TLS, and it is the person that counts.
    X509_VERIFY_PARAM_set_time(X509_STORE_get0_param(store.get()),
                               static_cast<std::time_t>(utc_ns / 1'000'000'000));
    X509_STORE_set_purpose(store.get(), X509_PURPOSE_ANY);
    const Bio content = memory_of(text);
    if (CMS_verify(given.get(), nullptr, store.get(), content.get(), nullptr, CMS_BINARY) != 1)
        throw std::invalid_argument(cause());
    // One signer, or nobody knows whose word it is.
    const std::unique_ptr<STACK_OF(X509), Freed<[](STACK_OF(X509) * all) { sk_X509_free(all); }>>
        signers(CMS_get0_signers(given.get()));
    if (!signers || sk_X509_num(signers.get()) != 1)
        throw std::invalid_argument("expected one signer");
    const std::string name = name_in(sk_X509_value(signers.get(), 0));
    if (name.empty()) throw std::invalid_argument("its certificate names nobody");
    return name;
}

}  // namespace vibrig::commission
