#pragma once

#include <cstdint>
#include <string>

namespace vibrig::serve {

/// What somebody may do; each includes the ones before it. An administrator may do what an operator
/// may; the certificates of both are distinguished in the audit.
enum class Role : std::uint8_t { none, viewer, operate, administer };
[[nodiscard]] const char* name_of(Role role) noexcept;
/// "viewer", "operator", "admin"; none for anything else.
[[nodiscard]] Role role_named(const std::string& name) noexcept;

/// Who is at the other end of a connection, as the kernel or a certificate says.
struct Caller {
    Role role = Role::none;
    std::string identity;  ///< "uid 1000", "certificate ada, operator, from 10.0.0.7"
    bool browser = false;  ///< over TCP: Host, Origin and Content-Type are checked, pages served
    bool encrypted = false;
    bool expired = false;  ///< the certificate: known, and good for an abort alone
    std::string host;      ///< plain HTTP: "127.0.0.1:8090"; what Host may say, besides localhost
};

}  // namespace vibrig::serve
