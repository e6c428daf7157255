// What an earlier life has left in a journal, and what of a journal goes into the one that takes
// its place.
#include <fmt/format.h>

#include "daemon/journal/database.hpp"
#include "daemon/journal/journal.hpp"
#include "daemon/journal/schema.hpp"

namespace vibrig::journal {

namespace {

constexpr std::size_t kProofsKept = 200;  // read back at the start

}  // namespace

void Journal::recover() {
    recover_loop_check();
    recover_proofs();
    recover_certificates();
    recover_signed_parts();
    recover_torque();
    recover_safety();
    const auto found = database().ask(
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
    const auto newest =
        database().ask("SELECT out_of_band FROM loop_check ORDER BY id DESC LIMIT 1");
    if (!newest.empty()) recovery_.out_of_band = newest.front().texts.at(0);
}

void Journal::recover_proofs() {
    const auto rows = database().ask(
        fmt::format("SELECT record FROM proof ORDER BY id DESC LIMIT {}", kProofsKept).c_str());
    for (auto row = rows.rbegin(); row != rows.rend(); ++row)
        recovery_.proofs.push_back(row->texts.at(0));
    note_proof(database().ask("SELECT max(id) FROM proof").at(0).numbers.at(0));
}

void Journal::recover_signed_parts() {
    for (const Row& row :
         database().ask("SELECT part, by FROM commissioning AS s WHERE what = 'sign' AND id > "
                        "coalesce((SELECT max(id) FROM commissioning WHERE what = 'accept' AND "
                        "part = s.part), "
                        "0) ORDER BY id"))
        recovery_.signed_parts.emplace_back(row.texts.at(0), row.texts.at(1));
}

/// Nothing is armed for commissioning's torques. From their permission on, which is on disk long
/// before the first of them is commanded, one may be left; until zero was, or it came to its end.
void Journal::recover_torque() {
    const auto newest = database().ask(
        "SELECT by, what = 'permission' OR EXISTS (SELECT 1 FROM json_each(data_json, "
        "'$.deg_per_h') WHERE value <> 0) FROM commissioning WHERE what IN ('torque', 'verdict') "
        "OR (what = 'permission' AND json_extract(data_json, '$.id') = 'permit.torque' AND "
        "json_extract(data_json, '$.value') = 'yes') ORDER BY id DESC LIMIT 1");
    if (!newest.empty() && newest.front().numbers.at(1) != 0)
        recovery_.torqued_by = newest.front().texts.at(0);
}

void Journal::recover_certificates() {
    for (const Row& row : database().ask("SELECT json_extract(argument, '$.number') FROM command "
                                         "WHERE kind = ? AND accepted = 1",
                                         {kCertificate}))
        recovery_.certificates.push_back(row.texts.at(0));
}

void Journal::note_proof(std::int64_t row) {
    const auto head = row == 0 ? std::optional<SignedHead>() : file_.head_of("proof", row);
    proof_head_ = head ? head->line() : "";
}

void Journal::note_newest_proof() noexcept {
    try {
        note_proof(database().ask("SELECT max(id) FROM proof").at(0).numbers.at(0));
    } catch (const std::exception&) {
        proof_head_.clear();
    }
}

void Journal::follow(const Safety& safety) {
    const std::string_view what = safety.what;
    if (what == kArmed) {
        arming_ = safety;
    } else if (what == kDisarmed) {
        arming_ = {};
    } else if (what == kLatched) {
        latches_.add(
            {safety.name, safety.text, safety.person, {}, safety.two_persons, safety.utc_ns});
    } else if (what == kFirst || what == kOver) {
        static_cast<void>(latches_.acknowledge(safety.name, safety.person));
    }
}

void Journal::read_safety(Database& from) {
    for (const Row& row :
         from.ask("SELECT utc_ns, what, name, person, text, two_persons FROM safety ORDER BY id")) {
        for (const char* what : {kArmed, kDisarmed, kLatched, kFirst, kOver}) {
            if (row.texts[1] == what)
                follow({what, row.texts[2], row.texts[3], row.texts[4], row.numbers[5] != 0,
                        row.numbers[0]});
        }
    }
}

void Journal::recover_safety() {
    latches_ = {};
    arming_ = {};
    read_safety(database());
    recovery_.latches = latches_.open();
    if (*arming_.what == '\0') return;
    // Before anything else is written, and as one: killed again, the next start finds the same.
    const Latch died{
        kDiedArmed,
        fmt::format("the daemon ended while armed by {}: {}", arming_.person, arming_.text),
        arming_.person,
        {},
        false,
        utc_now()};
    recovery_.latches.push_back(died);
    latched(died);
    disarmed(arming_.person, "died");
}

void Journal::recover_dwells(Unfinished& campaign) {
    const auto rows = database().ask(
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

void Journal::begin_anew(const std::vector<std::string>& found) {
    std::string why = fmt::format("{}", fmt::join(found, "; "));
    std::vector<Row> campaign;
    try {
        if (started_) {  // what is latched and armed is known
            campaign = database().ask(
                "SELECT id, name, started_by, started_utc_ns, configuration_hash FROM campaign "
                "WHERE id = ?",
                {campaign_});
        } else {
            read_safety(database());
        }
    } catch (const DatabaseError&) {  // without it
        if (!started_) why += "; what was latched or armed in it cannot be read";
    }
    file_.replace(found, [&] {
        if (!file_.aside().empty()) why += "; put aside as " + file_.aside();
        carry_over(why);
        carry_campaign(campaign);
    });
    campaign_ = campaign.empty() ? 0 : campaign_;
    proof_head_.clear();
    follow({kLatched, kJournalLatch, {}, why, false, utc_now()});
    const std::lock_guard lock(mutex_);
    found_.push_back(why);
}

/// What is latched and armed stands in the new file before anything else, and why there is one.
void Journal::carry_over(const std::string& why) {
    for (const Latch& latch : latches_.open()) {
        write_one(Safety{kLatched, latch.name, latch.armed_by, latch.cause, latch.two_persons,
                         latch.utc_ns});
        if (!latch.first.empty())
            write_one(Safety{kFirst, latch.name, latch.first, {}, false, utc_now()});
    }
    write_one(Safety{kLatched, kJournalLatch, {}, why, false, utc_now()});
    if (*arming_.what != '\0') write_one(arming_);
}

void Journal::carry_campaign(const std::vector<Row>& campaign) {
    if (campaign.empty()) return;
    const Row& row = campaign.front();
    database().run(
        "INSERT INTO campaign (id, name, started_by, started_utc_ns, configuration_hash, state) "
        "VALUES (?, ?, ?, ?, ?, 'running')",
        {row.numbers[0], row.texts[1], row.texts[2], row.numbers[3], row.numbers[4]});
    chained("campaign");
}

}  // namespace vibrig::journal
