#include "daemon/serve/pki.hpp"

#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/pkcs12.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <algorithm>
#include <array>
#include <memory>

namespace vibrig::serve {
namespace {

template <auto Free>
struct Freed {
    template <typename T>
    void operator()(T* pointer) const {
        Free(pointer);
    }
};
using Key = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;
using Certificate = std::unique_ptr<X509, Freed<X509_free>>;
using Time = std::unique_ptr<ASN1_TIME, Freed<ASN1_TIME_free>>;
using List = std::unique_ptr<X509_CRL, Freed<X509_CRL_free>>;
using Bio = std::unique_ptr<BIO, Freed<BIO_free_all>>;

[[noreturn]] void fail(const std::string& what) {
    std::array<char, 256> text{};
    ERR_error_string_n(ERR_get_error(), text.data(), text.size());
    throw PkiError(what + ": " + text.data());
}

void must(bool good, const char* what) {
    if (!good) fail(what);
}

Bio reader(const std::string& text) {
    return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}
std::string text_of(BIO* bio) {
    char* data = nullptr;
    const long size = BIO_ctrl(bio, BIO_CTRL_INFO, 0, &data);
    return {data, static_cast<std::size_t>(size)};
}
Certificate certificate_of(const std::string& pem) {
    Certificate found(PEM_read_bio_X509(reader(pem).get(), nullptr, nullptr, nullptr));
    must(found != nullptr, "reading a certificate");
    return found;
}
Key key_of(const std::string& pem) {
    Key found(PEM_read_bio_PrivateKey(reader(pem).get(), nullptr, nullptr, nullptr));
    must(found != nullptr, "reading a key");
    return found;
}

void add_name(X509_NAME* name, const char* field, const std::string& value) {
    if (value.empty()) return;
    must(X509_NAME_add_entry_by_txt(name, field, MBSTRING_UTF8,
                                    reinterpret_cast<const unsigned char*>(value.data()),
                                    static_cast<int>(value.size()), -1, 0) == 1,
         "the certificate's name");
}

void add_extension(X509* certificate, X509* issuer, int id, const std::string& value) {
    X509V3_CTX context;
    X509V3_set_ctx(&context, issuer, certificate, nullptr, nullptr, 0);
    X509_EXTENSION* const extension = X509V3_EXT_conf_nid(nullptr, &context, id, value.c_str());
    must(extension != nullptr, value.c_str());
    const bool added = X509_add_ext(certificate, extension, -1) == 1;
    X509_EXTENSION_free(extension);
    must(added, value.c_str());
}

bool is_address(const std::string& host) {
    std::array<unsigned char, 16> bytes{};
    return inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
           inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

std::string alternative_names(const std::vector<std::string>& hosts) {
    std::string names;
    for (const std::string& host : hosts) {
        if (!is_host(host))
            throw PkiError("host: found '" + host + "', expected a name or an address");
        names += (names.empty() ? "" : ",") + std::string(is_address(host) ? "IP:" : "DNS:") + host;
    }
    return names;
}

}  // namespace

bool is_host(const std::string& text) {
    constexpr std::size_t kHostName = 253;  // RFC 1035
    // What openssl reads as a list, or as anything but a name, is none.
    const auto fits = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               c == '-' || c == '_' || c == '.' || c == '*';
    };
    return is_address(text) ||
           (!text.empty() && text.size() <= kHostName && text.front() != '.' &&
            text.find("..") == std::string::npos && std::all_of(text.begin(), text.end(), fits));
}

std::string unfit_for(const std::vector<std::string>& hosts, const std::string& certificate,
                      const std::string& authority) {
    const Certificate server = certificate_of(certificate);
    const Certificate issuer = certificate_of(authority);
    if (X509_verify(server.get(), X509_get0_pubkey(issuer.get())) != 1)
        return "comes from another authority";
    if (X509_cmp_current_time(X509_get0_notAfter(server.get())) < 0) return "has ended";
    for (const std::string& host : hosts) {
        const bool named = is_address(host)
                               ? X509_check_ip_asc(server.get(), host.c_str(), 0) == 1
                               : X509_check_host(server.get(), host.c_str(), host.size(),
                                                 X509_CHECK_FLAG_NEVER_CHECK_SUBJECT, nullptr) == 1;
        if (!named) return "does not name \"" + host + '"';
    }
    return {};
}

Identity make_identity(const CertificateSettings& settings, const Identity* issuer) {
    using Use = CertificateSettings::Use;
    const Key key(EVP_EC_gen("P-256"));
    must(key != nullptr, "making a key");
    const Certificate certificate(X509_new());
    X509* const to = certificate.get();
    must(X509_set_version(to, X509_VERSION_3) == 1, "version");
    std::array<unsigned char, 16> serial{};
    must(RAND_bytes(serial.data(), serial.size()) == 1, "serial number");
    serial[0] &= 0x7F;  // positive
    BIGNUM* const number = BN_bin2bn(serial.data(), serial.size(), nullptr);
    BN_to_ASN1_INTEGER(number, X509_get_serialNumber(to));
    BN_free(number);
    X509_gmtime_adj(X509_getm_notBefore(to), static_cast<long>(settings.valid_from.count()));
    X509_gmtime_adj(X509_getm_notAfter(to),
                    static_cast<long>((settings.valid_from + settings.valid_for).count()));
    must(X509_set_pubkey(to, key.get()) == 1, "public key");
    add_name(X509_get_subject_name(to), "O", "Vibrig");
    add_name(X509_get_subject_name(to), "OU", settings.role);
    add_name(X509_get_subject_name(to), "CN", settings.common_name);

    const Certificate authority = issuer != nullptr ? certificate_of(issuer->certificate) : nullptr;
    const Key signer = issuer != nullptr ? key_of(issuer->key) : nullptr;
    X509* const from = authority ? authority.get() : to;
    must(X509_set_issuer_name(to, X509_get_subject_name(from)) == 1, "issuer");
    const bool is_authority = settings.use == Use::authority;
    add_extension(to, from, NID_basic_constraints,
                  is_authority ? "critical,CA:TRUE,pathlen:0" : "critical,CA:FALSE");
    add_extension(to, from, NID_key_usage,
                  is_authority ? "critical,keyCertSign,cRLSign" : "critical,digitalSignature");
    add_extension(to, from, NID_subject_key_identifier, "hash");
    add_extension(to, from, NID_authority_key_identifier, "keyid:always");
    if (settings.use == Use::server) add_extension(to, from, NID_ext_key_usage, "serverAuth");
    if (settings.use == Use::client) add_extension(to, from, NID_ext_key_usage, "clientAuth");
    if (!settings.hosts.empty())
        add_extension(to, from, NID_subject_alt_name, alternative_names(settings.hosts));
    must(X509_sign(to, signer ? signer.get() : key.get(), EVP_sha256()) > 0, "signing");

    const Bio pem(BIO_new(BIO_s_mem()));
    const Bio secret(BIO_new(BIO_s_mem()));
    must(PEM_write_bio_X509(pem.get(), to) == 1 &&
             PEM_write_bio_PrivateKey(secret.get(), key.get(), nullptr, nullptr, 0, nullptr,
                                      nullptr) == 1,
         "writing");
    return {text_of(pem.get()), text_of(secret.get())};
}

namespace {

void add_revoked(X509_CRL* list, const std::string& certificate, X509* issuer, ASN1_TIME* now) {
    const Certificate gone = certificate_of(certificate);
    if (X509_verify(gone.get(), X509_get0_pubkey(issuer)) != 1)
        throw PkiError("the certificate is not this authority's");
    X509_REVOKED* entry = nullptr;
    if (X509_CRL_get0_by_cert(list, &entry, gone.get()) == 1)
        throw PkiError("the certificate is revoked already");
    std::unique_ptr<X509_REVOKED, Freed<X509_REVOKED_free>> added(X509_REVOKED_new());
    must(added &&
             X509_REVOKED_set_serialNumber(added.get(), X509_get_serialNumber(gone.get())) == 1 &&
             X509_REVOKED_set_revocationDate(added.get(), now) == 1 &&
             X509_CRL_add0_revoked(list, added.get()) == 1,
         "the list of revoked certificates");
    static_cast<void>(added.release());
}

}  // namespace

std::string revoke(const std::string& certificate, const Identity& authority,
                   const std::string& before) {
    const Certificate issuer = certificate_of(authority.certificate);
    const Key key = key_of(authority.key);
    const List list(before.empty()
                        ? X509_CRL_new()
                        : PEM_read_bio_X509_CRL(reader(before).get(), nullptr, nullptr, nullptr));
    must(list != nullptr, "reading the list of revoked certificates");
    const Time now(X509_gmtime_adj(nullptr, 0));
    must(now && X509_CRL_set_version(list.get(), X509_CRL_VERSION_2) == 1 &&
             X509_CRL_set_issuer_name(list.get(), X509_get_subject_name(issuer.get())) == 1 &&
             X509_CRL_set1_lastUpdate(list.get(), now.get()) == 1 &&
             X509_CRL_set1_nextUpdate(list.get(), X509_get0_notAfter(issuer.get())) == 1,
         "the list of revoked certificates");
    if (!certificate.empty()) add_revoked(list.get(), certificate, issuer.get(), now.get());
    must(X509_CRL_sort(list.get()) == 1 && X509_CRL_sign(list.get(), key.get(), EVP_sha256()) > 0,
         "signing the list of revoked certificates");
    const Bio pem(BIO_new(BIO_s_mem()));
    must(PEM_write_bio_X509_CRL(pem.get(), list.get()) == 1, "writing");
    return text_of(pem.get());
}

std::string pkcs12_of(const Identity& identity, const std::string& authority,
                      const std::string& name, const std::string& password) {
    const Key key = key_of(identity.key);
    const Certificate certificate = certificate_of(identity.certificate);
    const std::unique_ptr<STACK_OF(X509), void (*)(STACK_OF(X509)*)> chain(
        sk_X509_new_null(), [](STACK_OF(X509) * stack) { sk_X509_pop_free(stack, X509_free); });
    sk_X509_push(chain.get(), certificate_of(authority).release());
    const std::unique_ptr<PKCS12, Freed<PKCS12_free>> made(PKCS12_create(
        password.c_str(), name.c_str(), key.get(), certificate.get(), chain.get(), 0, 0, 0, 0, 0));
    must(made != nullptr, "PKCS #12");
    const Bio out(BIO_new(BIO_s_mem()));
    must(i2d_PKCS12_bio(out.get(), made.get()) == 1, "PKCS #12");
    return text_of(out.get());
}

}  // namespace vibrig::serve
