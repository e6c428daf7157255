#include "daemon/journal/reread.hpp"

#include <fmt/format.h>

#include <chrono>
#include <thread>

#include "daemon/journal/database.hpp"

namespace vibrig::journal {

namespace {

using Wall = std::chrono::steady_clock;
constexpr auto kLongestWait = std::chrono::seconds(10);  // for a disk
constexpr auto kLook = std::chrono::milliseconds(20);

/// The campaign in progress once the dwell is in it; 0: it does not come.
std::int64_t campaign_with(Database& database, const estimator::DwellSummary& dwell) {
    for (const auto until = Wall::now() + kLongestWait; Wall::now() < until;) {
        const auto rows = database.ask(
            "SELECT campaign.id FROM campaign JOIN dwell ON dwell.campaign = campaign.id "
            "WHERE campaign.state = 'running' AND dwell.run = ? AND dwell.position = ? "
            "ORDER BY campaign.id DESC LIMIT 1",
            {std::int64_t{dwell.run}, std::int64_t{dwell.position}});
        if (!rows.empty()) return rows.front().numbers.at(0);
        std::this_thread::sleep_for(kLook);
    }
    return 0;
}

}  // namespace

std::string reread(const std::string& path, std::uint64_t configuration_hash,
                   const estimator::DwellSummary& last,
                   const std::function<void(const DwellCheckpoint&)>& take) {
    try {
        Database database(path, Database::Mode::read);
        const std::int64_t campaign = campaign_with(database, last);
        if (campaign == 0)
            return fmt::format("{}: run {} position {} is not in it", path, last.run,
                               last.position);
        const auto rows = database.ask(
            "SELECT rowid, run, position FROM dwell WHERE campaign = ? ORDER BY rowid", {campaign});
        for (const Row& row : rows) {
            const auto found =
                database.ask("SELECT checkpoint FROM dwell WHERE rowid = ?", {row.numbers.at(0)});
            DwellCheckpoint dwell;
            const std::string why =
                found.empty() ? "gone" : decode(found[0].texts.at(0), configuration_hash, dwell);
            if (!why.empty())
                return fmt::format("{}: checkpoint of run {} position {}: {}", path,
                                   row.numbers.at(1), row.numbers.at(2), why);
            take(dwell);
        }
        return {};
    } catch (const DatabaseError& error) {
        return error.what();
    }
}

}  // namespace vibrig::journal
