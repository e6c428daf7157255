#include "daemon/journal/journal.hpp"

#include <pthread.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <utility>

#include "daemon/journal/database.hpp"
#include "daemon/journal/schema.hpp"

namespace vibrig::journal {

namespace {

// Measurements in the ring are taken out this often; also how soon a sick disk is tried again.
constexpr auto kPeriod = std::chrono::milliseconds(200);
constexpr auto kRetry = std::chrono::seconds(1);

}  // namespace

Journal::Journal(const std::string& path, std::uint64_t configuration_hash,
                 std::function<void(double)> on_space, std::vector<Anchor> anchors, Pace pace)
    : path_(path),
      configuration_hash_(configuration_hash),
      on_space_(std::move(on_space)),
      file_(path, std::move(anchors)),
      watch_(path, pace) {
    status_.path = path_;
    status_.running = true;
    open();
    recover();
    show();
}

Journal::~Journal() { stop(); }

void Journal::open() {
    const auto found = file_.open();
    if (!found.empty()) {
        begin_anew(found);
        recovery_.refused.push_back(take_found().front() + ": cold start");
    } else if (file_.begins().find("taken over") != std::string::npos) {
        recovery_.begins = fmt::format("{}: its chain begins {}", path_, file_.begins());
    }
    watch_.begin({file_.newest(), file_.public_key(), file_.verified(), file_.intact()});
}

std::vector<std::string> Journal::take_found() {
    const std::lock_guard lock(mutex_);
    return std::exchange(found_, {});
}

void Journal::start() {
    started_ = true;
    thread_ = std::thread([this] { loop(); });
    ::pthread_setname_np(thread_.native_handle(), "journal");
    watch_.start();
}

void Journal::stop() noexcept {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
    watch_.stop();
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

std::optional<std::string> Journal::head_with(std::uint64_t entry) const {
    const std::lock_guard lock(mutex_);
    if (status_.written < entry) return {};
    return status_.head;
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
std::uint64_t Journal::campaign_ended(const std::string& state, const std::string& reason,
                                      const std::string& result_json) {
    return put(Ended{state, reason, result_json, utc_now()});
}
void Journal::loop_checked(const std::string& by, const std::string& out_of_band) {
    put(LoopChecked{by, out_of_band, utc_now()});
}
void Journal::proved(const std::string& by, const std::string& record) {
    put(Proved{by, record, utc_now()});
}
void Journal::event(const EventRecord& event) { put(event); }
void Journal::commissioned(const Commissioned& row) { put(row); }
std::uint64_t Journal::command(const CommandRequest& request, const CommandReply& reply,
                               std::int64_t utc_ns) {
    return put(Commanded{request, reply, utc_ns});
}

JournalStatus Journal::status() const {
    const std::lock_guard lock(mutex_);
    JournalStatus status = status_;
    status.waiting = waiting_.size() + at_work_;
    return status;
}

void Journal::loop() {
    std::deque<Entry> at_work;
    for (;;) {
        look();
        std::deque<Entry> taken;
        bool last = false;
        {
            std::unique_lock lock(mutex_);
            changed_.wait_for(
                lock, at_work.empty() ? kPeriod : std::chrono::milliseconds(kRetry),
                [this, &at_work] { return stop_ || (at_work.empty() && !waiting_.empty()); });
            at_work_ += waiting_.size();
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

/// What is no longer what was written is put aside at once; what waits goes into the new file.
void Journal::look() {
    const auto report = watch_.report();
    if (to_replace_.empty()) to_replace_ = report.found;
    try {
        if (to_replace_.empty() && file_.changed_by_others()) watch_.changed_by_others();
        if (!to_replace_.empty()) {
            begin_anew(to_replace_);
            to_replace_.clear();
            watch_.begin({file_.newest(), file_.public_key(), file_.verified(), file_.intact()});
            if (on_written_) on_written_();
        }
    } catch (const DatabaseError& error) {
        file_.roll_back();
        if (error.damaged() && to_replace_.empty()) to_replace_ = {cause_of(error)};
        const std::lock_guard lock(mutex_);
        status_.running = false;
        status_.note = error.what();
        return;
    }
    show();
}

/// A file that was taken away reads as a damaged one.
std::string Journal::cause_of(const DatabaseError& error) const {
    auto why = watch_.changed_files();
    return why.empty() ? error.what() : why;
}

/// For the status.
void Journal::show() {
    const auto report = watch_.report();
    const std::lock_guard lock(mutex_);
    status_.verified = report.verified;
    status_.verified_part = report.verified ? 1 : report.part;
    status_.not_watched = report.cannot;
    status_.public_key = file_.public_key();
    status_.head = file_.head().line();
    status_.proof_head = proof_head_;
    status_.entries = static_cast<std::uint64_t>(file_.newest().entry);
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
        file_.begin();
        for (const Entry& entry : entries) {
            std::visit([this](const auto& one) { write_one(one); }, entry);
        }
        file_.commit();
        watch_.wrote(file_.newest());
        // It is on disk: nothing after this may take it back.
        for (const Entry& entry : entries) {
            if (const auto* safety = std::get_if<Safety>(&entry)) follow(*safety);
            if (std::holds_alternative<Proved>(entry)) note_newest_proof();
        }
    } catch (const DatabaseError& error) {
        why = error.what();
        campaign_ = campaign;
        file_.roll_back();
        if (error.damaged()) to_replace_ = {cause_of(error)};
    }
    {
        const std::lock_guard lock(mutex_);
        status_.running = why.empty();
        status_.note = why;
        if (why.empty()) {
            // With the head that goes with it: who closes a recording asks for both.
            status_.written += entries.size();
            at_work_ -= entries.size();
            status_.head = file_.head().line();
            status_.proof_head = proof_head_;
            status_.entries = static_cast<std::uint64_t>(file_.newest().entry);
        }
    }
    if (on_written_) on_written_();
    if (why.empty()) publish();
    return why.empty();
}

/// After it was reported that the entries are on disk: nobody waits for the head, which may lag
/// behind.
void Journal::publish() {
    const auto why = file_.publish();
    // Where it cannot be written the one before still lies there.
    if (why.empty()) return watch_.published(file_.newest());
    const std::lock_guard lock(mutex_);
    status_.note = "its signed head: " + why;
}

void Journal::write_one(const Begun& begun) {
    if (begun.resumed_id != 0) {
        campaign_ = begun.resumed_id;
        return;
    }
    for (const Row& row : database().ask("SELECT id FROM campaign WHERE state = 'running'")) {
        database().run("UPDATE campaign SET state = 'given up' WHERE id = ?", {row.numbers[0]});
        file_.chained("campaign", row.numbers[0]);
    }
    database().run(
        "INSERT INTO campaign (name, started_by, started_utc_ns, configuration_hash, state) "
        "VALUES (?, ?, ?, ?, 'running')",
        {begun.name, begun.by, begun.utc_ns, static_cast<std::int64_t>(configuration_hash_)});
    campaign_ = database().last_id();
    chained("campaign");
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
    const auto row = database().ask(
        "INSERT INTO dwell VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?) "
        "ON CONFLICT (campaign, run, position) DO UPDATE SET samples = excluded.samples, "
        "used = excluded.used, rejected = excluded.rejected, flagged = excluded.flagged, "
        "reason = excluded.reason, checkpoint = excluded.checkpoint RETURNING rowid",
        {campaign_, done.info.run, done.info.position, done.summary.samples, done.summary.used,
         done.summary.rejected, done.summary.flagged, done.summary.reason, Blob{bytes}});
    file_.chained("dwell", row.front().numbers[0]);
}

void Journal::write_one(const Ended& ended) {
    if (campaign_ == 0) return;
    database().run(
        "UPDATE campaign SET state = ?, reason = ?, ended_utc_ns = ?, result_json = ? "
        "WHERE id = ?",
        {ended.state, ended.reason, ended.utc_ns, ended.result, campaign_});
    file_.chained("campaign", campaign_);
    campaign_ = 0;
    collected_.clear();
}

void Journal::write_one(const EventRecord& event) {
    database().run(
        "INSERT INTO event (utc_ns, time_ns, severity, source, text) VALUES (?, ?, ?, ?, ?)",
        {event.utc_ns, event.time, name_of(event.severity), event.source, event.text});
    chained("event");
}

void Journal::write_one(const Commanded& commanded) {
    database().run(
        "INSERT INTO command (utc_ns, kind, person, argument, accepted, answer) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        {commanded.utc_ns, word_of(commanded.request.kind), commanded.request.by,
         commanded.request.argument, commanded.reply.accepted, commanded.reply.message});
    chained("command");
}

void Journal::write_one(const LoopChecked& checked) {
    database().run("INSERT INTO loop_check (utc_ns, person, out_of_band) VALUES (?, ?, ?)",
                   {checked.utc_ns, checked.by, checked.out_of_band});
    chained("loop_check");
}

void Journal::write_one(const Proved& proved) {
    database().run("INSERT INTO proof (utc_ns, person, record) VALUES (?, ?, ?)",
                   {proved.utc_ns, proved.by, proved.record});
    chained("proof");
}

void Journal::write_one(const Commissioned& row) {
    database().run(
        "INSERT INTO commissioning (utc_ns, part, step, by, identity, what, data_json) "
        "VALUES (?, ?, ?, ?, ?, ?, ?)",
        {row.utc_ns, row.part, row.step, row.by, row.identity, row.what, row.data_json});
    chained(kCommissioning);
}

void Journal::write_one(const Safety& safety) {
    database().run(
        "INSERT INTO safety (utc_ns, what, name, person, text, two_persons) "
        "VALUES (?, ?, ?, ?, ?, ?)",
        {safety.utc_ns, safety.what, safety.name, safety.person, safety.text, safety.two_persons});
    chained("safety");
}

}  // namespace vibrig::journal
