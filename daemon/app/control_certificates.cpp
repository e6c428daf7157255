// Certificates that were issued, as `vibrig certificate` says: number and hashes go into the signed
// journal, each number once.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "daemon/app/control_loop.hpp"
#include "proto/json_text.hpp"

namespace vibrig {

namespace {

constexpr drivers::Time kJournalPatience =
    2 * drivers::kSecond;  // the server waits 5 s for an answer
constexpr std::size_t kLongestNumber = 100, kHashDigits = 64;

struct Issued {
    std::string number, wrong;  ///< empty: it is fine
};

Issued issued_of(const std::string& argument) {
    const auto what = nlohmann::json::parse(argument, nullptr, false);
    if (!what.is_object()) return {{}, "certificate: found no JSON object"};
    const auto text = [&what](const char* key) { return proto::text_at(what, key); };
    Issued issued{text("number"), {}};
    if (issued.number.empty() || issued.number.size() > kLongestNumber)
        issued.wrong = fmt::format("certificate: number: expected 1 to {} bytes", kLongestNumber);
    if (text("campaign").empty())
        issued.wrong = "certificate: campaign: found nothing, expected the recording's";
    for (const char* key : {"pdf_sha256", "json_sha256"}) {
        const std::string hash = text(key);
        if (hash.size() != kHashDigits ||
            hash.find_first_not_of("0123456789abcdef") != std::string::npos)
            issued.wrong = fmt::format("certificate: {}: found \"{}\", expected {} digits 0 to f",
                                       key, hash, kHashDigits);
    }
    return issued;
}

}  // namespace

void ControlLoop::begin_certificate(WaitingCommand waiting) {
    const auto issued = issued_of(waiting.request.argument);
    if (!issued.wrong.empty()) return answer(waiting, {false, issued.wrong});
    if (!journal_)
        return answer(waiting, {false, "no journal is kept: the certificate is entered nowhere"});
    auto& numbers = journal_->recovery().certificates;
    if (std::ranges::find(numbers, issued.number) != numbers.end())
        return answer(waiting, {false, fmt::format("certificate {} was issued already, expected a "
                                                   "new number",
                                                   issued.number)});
    const CommandReply reply{
        true, fmt::format("certificate {}: entered in {}", issued.number, journal_->status().path)};
    const auto entry = journal_->command(waiting.request, reply, utc_now());
    if (entry == 0) {
        reply_later(waiting, {false, "the journal takes no more just now: the disk is slow"});
        return;
    }
    numbers.push_back(issued.number);
    log(Severity::info, "certificate",
        fmt::format("{} issued by {}", issued.number, waiting.request.by));
    certifying_.push_back({std::move(waiting), reply, entry, drivers::steady_now()});
}

/// The PDF is given away once its hash is on disk.
void ControlLoop::finish_certificates(bool at_once) {
    std::erase_if(certifying_, [&](Acknowledging& one) {
        if (!journal_->on_disk(one.entry)) {
            if (!at_once && drivers::steady_now() - one.since_steady < kJournalPatience)
                return false;
            one.reply = {false, "the journal has not written it yet: the number is used up"};
        }
        reply_later(one.waiting, std::move(one.reply));
        return true;
    });
}

}  // namespace vibrig
