#include "tests/unit/support/host_names.hpp"

#include <dlfcn.h>
#include <netdb.h>

#include <condition_variable>
#include <map>
#include <mutex>
#include <optional>
#include <utility>

namespace vibrig {
namespace {

struct Entry {
    std::vector<std::string> addresses;
    bool answers = true;
    bool asked = false;
};

struct Table {
    std::mutex mutex;
    std::condition_variable changed;
    std::map<std::string, Entry> names;
};

Table& table() {
    static Table one;
    return one;
}

/// Waits while the name's server is silent. Nothing: no test's name; empty: it is none any more.
std::optional<std::vector<std::string>> addresses_of(const std::string& name) {
    Table& all = table();
    std::unique_lock lock(all.mutex);
    auto found = all.names.find(name);
    if (found == all.names.end()) return std::nullopt;
    found->second.asked = true;
    all.changed.wait(lock, [&] {
        found = all.names.find(name);
        return found == all.names.end() || found->second.answers;
    });
    return found == all.names.end() ? std::vector<std::string>{} : found->second.addresses;
}

}  // namespace

HostName::HostName(std::string name, std::vector<std::string> addresses, Server server)
    : name_(std::move(name)) {
    const std::lock_guard lock(table().mutex);
    table().names[name_] = {std::move(addresses), server == Server::answers, false};
}

HostName::~HostName() {
    {
        const std::lock_guard lock(table().mutex);
        table().names.erase(name_);
    }
    table().changed.notify_all();
}

void HostName::answer() {
    {
        const std::lock_guard lock(table().mutex);
        table().names[name_].answers = true;
    }
    table().changed.notify_all();
}

bool HostName::asked() const {
    const std::lock_guard lock(table().mutex);
    return table().names[name_].asked;
}

}  // namespace vibrig

/// Stands before the C library's, for what is linked with it.
extern "C" int getaddrinfo(const char* name, const char* service, const addrinfo* hints,
                           addrinfo** found) {
    using Function = int (*)(const char*, const char*, const addrinfo*, addrinfo**);
    static const auto next = reinterpret_cast<Function>(::dlsym(RTLD_NEXT, "getaddrinfo"));
    const auto addresses = vibrig::addresses_of(name == nullptr ? "" : name);
    if (!addresses) return next(name, service, hints, found);
    if (addresses->empty()) return EAI_AGAIN;
    // The lists of the addresses one behind the other, as the C library frees them.
    for (const std::string& address : *addresses) {
        if (const int error = next(address.c_str(), service, hints, found); error != 0)
            return error;
        while (*found != nullptr) found = &(*found)->ai_next;
    }
    return 0;
}
