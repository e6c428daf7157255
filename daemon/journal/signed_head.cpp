#include "daemon/journal/signed_head.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>

#include "daemon/journal/signing_key.hpp"

namespace vibrig::journal {

namespace {

constexpr std::size_t kLargestHead = 1024;  // a line has some 440 characters
constexpr std::size_t kHashDigits = 64, kSignatureDigits = 128;

/// " name=word" at the beginning of `rest`, which goes on behind it.
bool take(std::string_view& rest, std::string_view name, std::string_view& word) {
    if (!rest.starts_with(' ') || !rest.substr(1).starts_with(name)) return false;
    rest.remove_prefix(1 + name.size());
    if (!rest.starts_with('=')) return false;
    rest.remove_prefix(1);
    word = rest.substr(0, rest.find_first_not_of("0123456789abcdef"));
    rest.remove_prefix(word.size());
    return true;
}

bool take(std::string_view& rest, std::string_view name, std::int64_t& number) {
    std::string_view word;
    if (!take(rest, name, word)) return false;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    return error == std::errc() && end == word.data() + word.size();
}

}  // namespace

std::int64_t utc_now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
}

std::string SignedHead::signed_text() const {
    return fmt::format("{}1 chain={} entry={} hash={} utc_ns={} key={}", kHeadWord, chain,
                       link.entry, to_hex(link.hash), utc_ns, public_key);
}

std::string SignedHead::line() const { return signed_text() + " signature=" + signature; }

bool SignedHead::holds() const { return signature_holds(public_key, signed_text(), signature); }

SignedHead sign_head(std::string chain, const Link& link, std::int64_t utc_ns,
                     const SigningKey& key) {
    SignedHead head{std::move(chain), link, utc_ns, key.public_key(), {}};
    head.signature = key.sign(head.signed_text());
    return head;
}

std::optional<SignedHead> parse_head(std::string_view line) {
    if (!line.starts_with(kHeadWord)) return {};
    line.remove_prefix(kHeadWord.size());
    if (!line.starts_with('1')) return {};
    line.remove_prefix(1);
    SignedHead head;
    std::string_view chain, hash, key, signature;
    if (!take(line, "chain", chain) || !take(line, "entry", head.link.entry) ||
        !take(line, "hash", hash) || !take(line, "utc_ns", head.utc_ns) ||
        !take(line, "key", key) || !take(line, "signature", signature))
        return {};
    if ((!chain.empty() && chain.size() != kHashDigits) || hash.size() != kHashDigits ||
        key.size() != kHashDigits || signature.size() != kSignatureDigits)
        return {};
    head.chain = chain;
    head.link.hash = from_hex(hash);
    head.public_key = key;
    head.signature = signature;
    return head;
}

std::vector<SignedHead> heads_in(std::string_view text) {
    std::vector<SignedHead> heads;
    for (std::size_t at = text.find(kHeadWord); at != std::string_view::npos;
         at = text.find(kHeadWord, at + 1)) {
        if (auto head = parse_head(text.substr(at, kLargestHead)))
            heads.push_back(std::move(*head));
    }
    return heads;
}

std::string write_head(const std::string& path, const SignedHead& head) {
    const std::string text = head.line() + "\n";
    const std::string unfinished = path + ".new";
    ::unlink(unfinished.c_str());  // of a life that was killed, or something that is no file
    const int fd = ::open(unfinished.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    if (fd < 0) return unfinished + ": " + std::strerror(errno);
    const bool written =
        ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
        ::fsync(fd) == 0;
    const int why = errno;
    ::close(fd);
    if (written && ::rename(unfinished.c_str(), path.c_str()) == 0) return {};
    return unfinished + ": " + std::strerror(written ? errno : why);
}

FoundHead read_head(const std::string& path) {
    // Where a pipe lies in its place, nobody is waited for.
    const int fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) return {};
    std::string line(kLargestHead, '\0');
    const ssize_t size = ::read(fd, line.data(), line.size());
    ::close(fd);
    line.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    auto head = parse_head(line);
    if (!head || line != head->line() + "\n") return {{}, path + ": is no journal's head"};
    if (!head->holds()) return {{}, path + ": its signature does not hold"};
    return {std::move(head), {}};
}

std::string fingerprint(const std::string& public_key) {
    const std::string bytes = from_hex(public_key);
    return bytes.empty() ? "" : "SHA256:" + to_hex(sha256(bytes)).substr(0, 16);
}

}  // namespace vibrig::journal
