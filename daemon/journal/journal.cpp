#include "daemon/journal/journal.hpp"

#include <pthread.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "daemon/journal/database.hpp"

namespace vibrig::journal {

namespace {

// Measurements in the ring are taken out this often; also how soon a sick disk is tried again.
constexpr auto kPeriod = std::chrono::milliseconds(200);
constexpr auto kRetry = std::chrono::seconds(1);

constexpr const char* kSchema = R"(
CREATE TABLE campaign (id INTEGER PRIMARY KEY, name TEXT NOT NULL, started_by TEXT NOT NULL,
    started_utc_ns INTEGER NOT NULL, configuration_hash INTEGER NOT NULL,
    state TEXT NOT NULL, reason TEXT NOT NULL DEFAULT '', ended_utc_ns INTEGER,
    result_json TEXT);
CREATE TABLE dwell (campaign INTEGER NOT NULL REFERENCES campaign(id), run INTEGER NOT NULL,
    position INTEGER NOT NULL, samples INTEGER NOT NULL, used INTEGER NOT NULL,
    rejected INTEGER NOT NULL, flagged INTEGER NOT NULL, reason TEXT NOT NULL,
    checkpoint BLOB NOT NULL, PRIMARY KEY (campaign, run, position));
CREATE TABLE event (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL, time_ns INTEGER NOT NULL,
    severity TEXT NOT NULL, source TEXT NOT NULL, text TEXT NOT NULL);
CREATE TABLE command (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL, kind TEXT NOT NULL,
    person TEXT NOT NULL, argument TEXT NOT NULL, accepted INTEGER NOT NULL,
    answer TEXT NOT NULL);
)";

// Later than version 1, whose readers leave it alone; made with the first check.
constexpr const char* kLoopCheckTable = R"(
CREATE TABLE IF NOT EXISTS loop_check (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    person TEXT NOT NULL, out_of_band TEXT NOT NULL);
)";

constexpr const char* kProofTable = R"(
CREATE TABLE IF NOT EXISTS proof (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    person TEXT NOT NULL, record TEXT NOT NULL);
)";
constexpr std::size_t kProofsKept = 200;  // read back at the start
constexpr const char* kSafetyTable = R"(
CREATE TABLE IF NOT EXISTS safety (id INTEGER PRIMARY KEY, utc_ns INTEGER NOT NULL,
    what TEXT NOT NULL, name TEXT NOT NULL, person TEXT NOT NULL, text TEXT NOT NULL,
    two_persons INTEGER NOT NULL);
)";
// What stands in it.
constexpr const char* kArmed = "armed";
constexpr const char* kDisarmed = "disarmed";
constexpr const char* kLatched = "latched";
constexpr const char* kFirst = "acknowledged by the first";
constexpr const char* kOver = "acknowledged";

std::int64_t utc_now() {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(
               std::chrono::system_clock::now().time_since_epoch())
        .count();
}

const char* word_of(CommandRequest::Kind kind) {
    using Kind = CommandRequest::Kind;
    switch (kind) {
        case Kind::arm:
            return "arm";
        case Kind::start:
            return "start";
        case Kind::pause:
            return "pause";
        case Kind::resume:
            return "resume";
        case Kind::abort:
            return "abort";
        case Kind::acknowledge:
            return "acknowledge";
        case Kind::selftest:
            return "selftest";
    }
    return "unknown";
}

/// The file and what SQLite keeps beside it.
void put_aside(const std::string& path, const std::string& suffix) {
    std::error_code error;
    for (const char* part : {"", "-wal", "-shm"})
        std::filesystem::rename(path + part, path + suffix + part, error);
}

}  // namespace

Journal::Journal(const std::string& path, std::uint64_t configuration_hash,
                 std::function<void(double)> on_space)
    : path_(path), configuration_hash_(configuration_hash), on_space_(std::move(on_space)) {
    const std::string aside = fmt::format(".{}", utc_now() / 1'000'000'000);
    try {
        open();
        recover();
    } catch (const DatabaseError& error) {
        if (!error.damaged()) throw;
        database_.reset();
        recovery_ = {};
        put_aside(path_, ".damaged" + aside);
        recovery_.refused.push_back(
            fmt::format("{}; put aside as {}.damaged{}: cold start", error.what(), path_, aside));
        open();
    }
    status_.path = path_;
    status_.running = true;
}

Journal::~Journal() { stop(); }

void Journal::open() {
    database_ = std::make_unique<Database>(path_);
    auto version = database_->ask("PRAGMA user_version").at(0).numbers.at(0);
    if (version > kSchemaVersion) {
        database_.reset();
        const std::string suffix = fmt::format(".version-{}", version);
        put_aside(path_, suffix);
        recovery_.refused.push_back(
            fmt::format("{}: found version {}, newer than {}; put aside as {}{}: cold start", path_,
                        version, kSchemaVersion, path_, suffix));
        database_ = std::make_unique<Database>(path_);
        version = 0;
    }
    if (const auto check = database_->ask("PRAGMA quick_check(1)");
        check.empty() || check.front().texts.at(0) != "ok") {
        throw DatabaseError(path_ + ": damaged", 11);  // SQLITE_CORRUPT
    }
    if (version == 0) {
        database_->execute("BEGIN IMMEDIATE");
        database_->execute(kSchema);
        database_->execute(fmt::format("PRAGMA user_version = {}", kSchemaVersion).c_str());
        database_->execute("COMMIT");
    }
}

void Journal::recover() {
    recover_loop_check();
    recover_proofs();
    recover_safety();
    const auto found = database_->ask(
        "SELECT id, name, started_by, configuration_hash, state FROM campaign "
        "ORDER BY id DESC LIMIT 1");
    if (found.empty() || found.front().texts.at(4) != "running") return;
    const Row& row = found.front();
    Unfinished campaign{row.numbers.at(0), row.texts.at(1), row.texts.at(2), {}};
    if (static_cast<std::uint64_t>(row.numbers.at(3)) != configuration_hash_) {
        recovery_.refused.push_back(
            fmt::format("campaign {} ({}) was of another configuration: cold start", campaign.id,
                        campaign.name));
        return;
    }
    recover_dwells(campaign);
    if (!campaign.dwells.empty()) recovery_.campaign = std::move(campaign);
}

void Journal::recover_loop_check() {
    if (database_->ask("SELECT name FROM sqlite_master WHERE name = 'loop_check'").empty()) return;
    const auto newest =
        database_->ask("SELECT out_of_band FROM loop_check ORDER BY id DESC LIMIT 1");
    if (!newest.empty()) recovery_.out_of_band = newest.front().texts.at(0);
}

void Journal::recover_proofs() {
    if (database_->ask("SELECT name FROM sqlite_master WHERE name = 'proof'").empty()) return;
    const auto rows = database_->ask(
        fmt::format("SELECT record FROM proof ORDER BY id DESC LIMIT {}", kProofsKept).c_str());
    for (auto row = rows.rbegin(); row != rows.rend(); ++row)
        recovery_.proofs.push_back(row->texts.at(0));
}

void Journal::recover_safety() {
    database_->execute(kSafetyTable);
    Latches latches;
    Safety arming;
    for (const Row& row : database_->ask(
             "SELECT utc_ns, what, name, person, text, two_persons FROM safety ORDER BY id")) {
        const std::string &what = row.texts[1], &name = row.texts[2], &person = row.texts[3];
        if (what == kArmed) {
            arming = {kArmed, name, person, row.texts[4], false, row.numbers[0]};
        } else if (what == kDisarmed) {
            arming = {};
        } else if (what == kLatched) {
            latches.add({name, row.texts[4], person, {}, row.numbers[5] != 0, row.numbers[0]});
        } else if (what == kFirst || what == kOver) {
            static_cast<void>(latches.acknowledge(name, person));
        }
    }
    recovery_.latches = latches.open();
    if (*arming.what == '\0') return;
    // Before anything else is written, and as one: killed again, the next start finds the same.
    const Latch died{
        kDiedArmed,
        fmt::format("the daemon ended while armed by {}: {}", arming.person, arming.text),
        arming.person,
        {},
        false,
        utc_now()};
    recovery_.latches.push_back(died);
    latched(died);
    disarmed(arming.person, "died");
}

void Journal::recover_dwells(Unfinished& campaign) {
    const auto rows = database_->ask(
        "SELECT run, position, checkpoint FROM dwell WHERE campaign = ? ORDER BY rowid",
        {campaign.id});
    int without_noise = 0;
    for (const Row& row : rows) {
        DwellCheckpoint dwell;
        std::string why = decode(row.texts.at(2), configuration_hash_, dwell);
        if (why.empty() &&
            (dwell.info.run != row.numbers.at(0) || dwell.info.position != row.numbers.at(1)))
            why = "of another position";
        if (!why.empty()) {
            recovery_.refused.push_back(
                fmt::format("campaign {} ({}), checkpoint of run {} position {}: {}: cold start",
                            campaign.id, campaign.name, row.numbers.at(0), row.numbers.at(1), why));
            campaign.dwells.clear();
            return;
        }
        without_noise += dwell.noise_known ? 0 : 1;
        campaign.dwells.push_back(std::move(dwell));
    }
    if (without_noise > 0) {
        recovery_.assumed = fmt::format(
            "campaign {} ({}): {} checkpoints of version 1 do not say with which noise levels they "
            "were filtered: assumed those that the noise monitor comes to again",
            campaign.id, campaign.name, without_noise);
    }
}

void Journal::start() {
    thread_ = std::thread([this] { loop(); });
    ::pthread_setname_np(thread_.native_handle(), "journal");
}

void Journal::stop() noexcept {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
}

std::uint64_t Journal::put(Entry entry) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kMostWaiting && !std::holds_alternative<Safety>(entry)) {
        ++status_.dropped;
        return 0;
    }
    waiting_.push_back(std::move(entry));
    changed_.notify_all();
    return ++status_.taken;
}

bool Journal::on_disk(std::uint64_t entry) const {
    const std::lock_guard lock(mutex_);
    return status_.written >= entry;
}

std::uint64_t Journal::armed(const std::string& by, const std::string& what) {
    return put(Safety{kArmed, {}, by, what, false, utc_now()});
}
std::uint64_t Journal::disarmed(const std::string& by, const std::string& why) {
    return put(Safety{kDisarmed, {}, by, why, false, utc_now()});
}
std::uint64_t Journal::latched(const Latch& latch) {
    return put(
        Safety{kLatched, latch.name, latch.armed_by, latch.cause, latch.two_persons, latch.utc_ns});
}
std::uint64_t Journal::acknowledged(const std::string& name, const std::string& by, bool last) {
    return put(Safety{last ? kOver : kFirst, name, by, {}, false, utc_now()});
}

void Journal::campaign_begun(const std::string& name, const std::string& by) {
    put(Begun{name, by, 0, utc_now()});
}
void Journal::campaign_resumed(std::int64_t id, const std::string& by) {
    put(Begun{{}, by, id, utc_now()});
}
void Journal::dwell_done(const estimator::DwellInfo& info, const estimator::DwellSummary& summary,
                         const StopDone& stop) {
    put(Done{info, summary, stop});
}
void Journal::campaign_ended(const std::string& state, const std::string& reason,
                             const std::string& result_json) {
    put(Ended{state, reason, result_json, utc_now()});
}
void Journal::loop_checked(const std::string& by, const std::string& out_of_band) {
    put(LoopChecked{by, out_of_band, utc_now()});
}
void Journal::proved(const std::string& by, const std::string& record) {
    put(Proved{by, record, utc_now()});
}
void Journal::event(const EventRecord& event) { put(event); }
void Journal::command(const CommandRequest& request, const CommandReply& reply,
                      std::int64_t utc_ns) {
    put(Commanded{request, reply, utc_ns});
}

JournalStatus Journal::status() const {
    const std::lock_guard lock(mutex_);
    return status_;
}

void Journal::loop() {
    std::deque<Entry> at_work;
    for (;;) {
        std::deque<Entry> taken;
        bool last = false;
        {
            std::unique_lock lock(mutex_);
            changed_.wait_for(
                lock, at_work.empty() ? kPeriod : std::chrono::milliseconds(kRetry),
                [this, &at_work] { return stop_ || (at_work.empty() && !waiting_.empty()); });
            taken.swap(waiting_);
            last = stop_;
        }
        std::ranges::move(taken, std::back_inserter(at_work));
        take_fed();
        if (on_space_) {
            std::error_code error;
            const auto folder = std::filesystem::absolute(path_).parent_path();
            const auto space = std::filesystem::space(folder, error);
            if (!error) on_space_(static_cast<double>(space.available) / 1e6);
        }
        if (!at_work.empty() && write(at_work)) at_work.clear();
        if (last) return;
    }
}

void Journal::take_fed() {
    constexpr std::size_t kMostCollected = 8;
    while (fed_.consume([this](const rt::Fed& fed) {
        if (fed.first || collected_.empty()) {
            if (collected_.size() == kMostCollected) collected_.pop_front();
            collected_.emplace_back().info = {fed.run, fed.position, 0};
        }
        collected_.back().measurements.push_back(fed.measurement);
    }) > 0) {
    }
}

bool Journal::write(const std::deque<Entry>& entries) {
    const std::int64_t campaign = campaign_;
    std::string why;
    try {
        database_->execute("BEGIN IMMEDIATE");
        for (const Entry& entry : entries) {
            std::visit([this](const auto& one) { write_one(one); }, entry);
        }
        database_->execute("COMMIT");
    } catch (const DatabaseError& error) {
        why = error.what();
        campaign_ = campaign;
        try {
            database_->execute("ROLLBACK");
        } catch (const DatabaseError&) {  // SQLite has rolled back by itself
        }
    }
    {
        const std::lock_guard lock(mutex_);
        status_.running = why.empty();
        status_.note = why;
        if (why.empty()) status_.written += entries.size();
    }
    if (on_written_) on_written_();
    return why.empty();
}

void Journal::write_one(const Begun& begun) {
    if (begun.resumed_id != 0) {
        campaign_ = begun.resumed_id;
        return;
    }
    database_->run("UPDATE campaign SET state = 'given up' WHERE state = 'running'", {});
    database_->run(
        "INSERT INTO campaign (name, started_by, started_utc_ns, configuration_hash, state) "
        "VALUES (?, ?, ?, ?, 'running')",
        {std::string_view(begun.name), std::string_view(begun.by), begun.utc_ns,
         static_cast<std::int64_t>(configuration_hash_)});
    campaign_ = database_->last_id();
}

void Journal::write_one(const Done& done) {
    if (campaign_ == 0) return;
    DwellCheckpoint empty;
    const auto same = [&done](const DwellCheckpoint& dwell) {
        return dwell.info.run == done.info.run && dwell.info.position == done.info.position;
    };
    const auto found = std::find_if(collected_.rbegin(), collected_.rend(), same);
    DwellCheckpoint& dwell = found == collected_.rend() ? empty : *found;
    dwell.info = done.info;
    dwell.summary = done.summary;
    dwell.stop = done.stop;
    // Measurements that were lost on the way would give another filter.
    const bool whole = dwell.measurements.size() == done.summary.samples;
    const std::string bytes = whole ? encode(dwell, configuration_hash_) : std::string{};
    database_->run("INSERT OR REPLACE INTO dwell VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                   {campaign_, std::int64_t{done.info.run}, std::int64_t{done.info.position},
                    std::int64_t{done.summary.samples}, std::int64_t{done.summary.used},
                    std::int64_t{done.summary.rejected}, std::int64_t{done.summary.flagged},
                    std::string_view(done.summary.reason), Blob{bytes}});
}

void Journal::write_one(const Ended& ended) {
    if (campaign_ == 0) return;
    database_->run(
        "UPDATE campaign SET state = ?, reason = ?, ended_utc_ns = ?, result_json = ? "
        "WHERE id = ?",
        {std::string_view(ended.state), std::string_view(ended.reason), ended.utc_ns,
         std::string_view(ended.result), campaign_});
    campaign_ = 0;
    collected_.clear();
}

void Journal::write_one(const EventRecord& event) {
    database_->run(
        "INSERT INTO event (utc_ns, time_ns, severity, source, text) VALUES (?, ?, ?, ?, ?)",
        {event.utc_ns, event.time, std::string_view(name_of(event.severity)),
         std::string_view(event.source), std::string_view(event.text)});
}

void Journal::write_one(const Commanded& commanded) {
    database_->run(
        "INSERT INTO command (utc_ns, kind, person, argument, accepted, answer) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        {commanded.utc_ns, std::string_view(word_of(commanded.request.kind)),
         std::string_view(commanded.request.by), std::string_view(commanded.request.argument),
         std::int64_t{commanded.reply.accepted}, std::string_view(commanded.reply.message)});
}

void Journal::write_one(const LoopChecked& checked) {
    database_->execute(kLoopCheckTable);
    database_->run(
        "INSERT INTO loop_check (utc_ns, person, out_of_band) VALUES (?, ?, ?)",
        {checked.utc_ns, std::string_view(checked.by), std::string_view(checked.out_of_band)});
}

void Journal::write_one(const Proved& proved) {
    database_->execute(kProofTable);
    database_->run("INSERT INTO proof (utc_ns, person, record) VALUES (?, ?, ?)",
                   {proved.utc_ns, std::string_view(proved.by), std::string_view(proved.record)});
}

void Journal::write_one(const Safety& safety) {
    database_->run(
        "INSERT INTO safety (utc_ns, what, name, person, text, two_persons) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        {safety.utc_ns, std::string_view(safety.what), std::string_view(safety.name),
         std::string_view(safety.person), std::string_view(safety.text),
         std::int64_t{safety.two_persons}});
}

}  // namespace vibrig::journal
