#include "daemon/journal/chained_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "daemon/journal/schema.hpp"

namespace vibrig::journal {

namespace {

namespace fs = std::filesystem;

// So long the start waits for it, and no file larger than this is checked as a whole before it goes
// on; the rest is done behind it.
constexpr auto kAtStart = std::chrono::seconds(1);
constexpr std::uintmax_t kWholeAtStart = 16 << 20;
constexpr std::int64_t kStepEntries = 500;
constexpr std::size_t kStepBytes = 4 << 20;
constexpr std::size_t kMostPrevious = 50;

/// 0: there is none, or it is empty.
std::uintmax_t size_of(const std::string& path) {
    std::error_code none;
    const auto size = fs::file_size(path, none);
    return none ? 0 : size;
}

bool exists(const std::string& path) {
    std::error_code none;
    return fs::exists(fs::symlink_status(path, none));
}

std::int64_t version_of(Database& database) {
    return database.ask("PRAGMA user_version").at(0).numbers.at(0);
}

}  // namespace

Database& ChainedFile::database() {
    if (!database_) throw DatabaseError(path_ + ": is not open", 0);
    return *database_;
}

std::vector<std::string> ChainedFile::open() {
    // With a head or a key beside it, it was ours: what lies there now is put aside.
    if (!exists(path_ + kHeadSuffix) && !exists(path_ + kKeySuffix))
        refuse_foreign(path_, {"event", "chain"});
    std::vector<std::string> found;
    const FoundHead beside = read_head(path_ + kHeadSuffix);
    if (!beside.wrong.empty()) found.push_back(beside.wrong);
    if (beside.head && !beside.head->chain.empty()) previous_.push_back(beside.head->chain);
    const bool key_was_there = exists(path_ + kKeySuffix);
    take_key(found);
    if (size_of(path_) == 0) {
        const char* const what = exists(path_) ? "has length zero" : "is gone";
        if (beside.head && beside.head->link.entry > 0) {
            found.push_back(
                fmt::format("{}: {}, with {} entries", path_, what, beside.head->link.entry));
        } else if (key_was_there && !exists(path_ + kHeadSuffix)) {
            found.push_back(
                fmt::format("{}: {}, and so is its signed head; its key is there", path_, what));
        }
    }
    if (!found.empty() && size_of(path_) == 0) return found;
    try {
        open_database(beside, found);
    } catch (const DatabaseError& error) {
        if (!error.damaged()) throw;
        found.emplace_back(error.what());
    }
    return found;
}

void ChainedFile::open_database(const FoundHead& beside, std::vector<std::string>& found) {
    database_ = std::make_unique<Database>(path_);
    const auto version = version_of(*database_);
    const std::string says = fmt::format("{}: found version {}", path_, version);
    const bool first = !exists(path_ + kHeadSuffix) && key_ && key_->made();
    const bool begun = beside.head && beside.head->link.entry == 0;  // and killed
    if (version > kSchemaVersion) {
        found.push_back(fmt::format("{}, newer than {}", says, kSchemaVersion));
    } else if (version < kSchemaVersion && !first && !begun) {
        found.push_back(fmt::format("{}, expected {} as its signed head and its key say", says,
                                    kSchemaVersion));
    } else if (size_of(path_) <= kWholeAtStart) {
        for (const std::string& what : database_->damage(1)) found.push_back(path_ + ": " + what);
        intact_ = true;
    }
    if (!found.empty()) return;
    if (version == kSchemaVersion) return check_start(beside, found);
    check_anchors(found);
    if (!found.empty()) return;
    make({}, {});
}

void ChainedFile::take_key(std::vector<std::string>& found) {
    try {
        key_.emplace(path_ + kKeySuffix);
    } catch (const std::runtime_error& error) {
        found.emplace_back(error.what());
    }
}

void ChainedFile::check_start(const FoundHead& beside, std::vector<std::string>& found) {
    for (const char* table : kChained) {
        if (has_table(*database_, "chain") ? lacks_table(*database_, table)
                                           : !has_table(*database_, table))
            found.push_back(fmt::format("{}: table {} is missing", path_, table));
    }
    if (!found.empty()) return;
    make_commissioning(*database_);
    chain_ = Chain(Chain::newest(*database_));
    name_ = Chain::name_of(*database_);
    check_head(beside, found);
    check_anchors(found);
    check_rows(found);
    if (!found.empty()) return;
    const auto line = database_->ask("SELECT line FROM head").at(0).texts.at(0);
    head_ = parse_head(line).value();  // check_head has read it
    static_cast<void>(publish());      // it lags behind after SIGKILL
    static_cast<void>(changed_by_others());
}

void ChainedFile::check_head(const FoundHead& beside, std::vector<std::string>& found) {
    const std::string place = path_ + kHeadSuffix;
    if (key_->made()) {
        found.push_back(path_ + kKeySuffix + ": the journal's key is gone");
        return;
    }
    if (!beside.head) {
        found.push_back(place + ": the journal's signed head is gone");
    } else if (beside.head->public_key != key_->public_key()) {
        found.push_back(fmt::format("{}: is signed with {}, the journal's key is {}", place,
                                    fingerprint(beside.head->public_key),
                                    fingerprint(key_->public_key())));
    } else if (beside.head->chain == name_) {
        if (auto why = differs_from(*database_, beside.head->link, "its signed head"); !why.empty())
            found.push_back(path_ + ": " + why);
    } else if (!beside.head->chain.empty() && !came_before(beside.head->chain)) {
        found.push_back(place + ": is of another journal");
    }
    if (auto why = unsigned_end(*database_, key_->public_key()); !why.empty())
        found.push_back(path_ + ": " + why);
}

/// What came before this one is what its signed beginning says, not what lies beside it.
bool ChainedFile::came_before(const std::string& chain) const {
    if (!database_ || !has_table(*database_, "origin")) return false;
    return !database_->ask("SELECT 1 FROM origin WHERE instr(previous, ?) > 0", {chain}).empty();
}

void ChainedFile::check_anchors(std::vector<std::string>& found) {
    for (const Anchor& anchor : anchors_) {
        const SignedHead& head = anchor.head;
        if (head.chain.empty() || !head.holds() || came_before(head.chain)) continue;
        if (name_ != head.chain) {
            found.push_back(fmt::format(
                "{}: {} names entry {} of another journal ({:.16}), signed with {}", path_,
                anchor.place, head.link.entry, head.chain, fingerprint(head.public_key)));
        } else if (auto why = differs_from(*database_, head.link, anchor.place); !why.empty()) {
            found.push_back(path_ + ": " + why);
        }
    }
}

void ChainedFile::check_rows(std::vector<std::string>& found) {
    const auto until = std::chrono::steady_clock::now() + kAtStart;
    Verification rows;
    while (!rows.done() && std::chrono::steady_clock::now() < until)
        rows.step(*database_, kStepEntries, kStepBytes);
    verified_ = rows.done();
    for (const std::string& what : rows.found()) found.push_back(path_ + ": " + what);
}

bool ChainedFile::key_is_there() const {
    if (!key_ || key_->made() || !exists(path_ + kKeySuffix)) return false;
    try {
        return SigningKey(path_ + kKeySuffix).public_key() == key_->public_key();
    } catch (const std::runtime_error&) {
        return false;
    }
}

void ChainedFile::remember_previous() {
    try {
        if (database_ && has_table(*database_, "chain")) {
            for (const Row& row : database_->ask("SELECT previous FROM origin")) {
                std::istringstream names(row.texts.at(0));
                for (std::string name; names >> name;) previous_.push_back(name);
            }
            name_ = Chain::name_of(*database_);
        }
    } catch (const DatabaseError&) {  // the head beside it has named it
    }
    if (!name_.empty()) previous_.push_back(name_);
    std::vector<std::string> once;
    for (auto name = previous_.rbegin(); name != previous_.rend(); ++name) {
        if (once.size() < kMostPrevious && std::ranges::find(once, *name) == once.end())
            once.push_back(*name);
    }
    previous_.assign(once.rbegin(), once.rend());
}

/// The head stays until there is another one: whoever is killed meanwhile leaves a journal that is
/// gone, not one that never was.
void ChainedFile::put_aside() {
    const std::string aside = fmt::format("{}.aside.{}", path_, utc_now() / 1'000'000);
    std::error_code none;
    if (exists(path_)) aside_ = aside;
    for (const char* part : {"", "-wal", "-shm"}) fs::rename(path_ + part, aside + part, none);
    fs::copy_file(path_ + kHeadSuffix, aside + kHeadSuffix, none);
    if (key_is_there()) return;
    fs::rename(path_ + kKeySuffix, aside + kKeySuffix, none);
    key_.reset();
}

void ChainedFile::replace(const std::vector<std::string>& found, const FirstRows& first_rows) {
    if (!moved_) {
        aside_.clear();
        for (const Anchor& anchor : anchors_) previous_.push_back(anchor.head.chain);
        remember_previous();
        database_.reset();
        put_aside();
        moved_ = true;
    }
    // What goes wrong now is the disk's fault, and tried again.
    database_.reset();
    try {
        if (!key_) key_.emplace(path_ + kKeySuffix);
    } catch (const std::runtime_error& error) {
        throw DatabaseError(error.what(), 0);
    }
    database_ = std::make_unique<Database>(path_);
    make((aside_.empty() ? "anew: " : "anew, after " + aside_ + " was put aside: ") + found.front(),
         first_rows);
    moved_ = false;
}

/// Head and key first: where there are entries, both have been.
void ChainedFile::make(const std::string& begins, const FirstRows& first_rows) {
    const FoundHead beside = read_head(path_ + kHeadSuffix);
    if (!beside.head || beside.head->link.entry == 0) {
        if (auto why = write_head(path_ + kHeadSuffix, sign_head({}, {}, utc_now(), *key_));
            !why.empty())
            throw DatabaseError(why, 0);
    }
    key_->keep();
    const auto version = version_of(*database_);
    chain_ = Chain(Link{});
    begin();
    try {
        make_tables(*database_);
        std::int64_t rows = 0;
        for (const std::string table : kChained)
            rows += database_->ask(("SELECT count(*) FROM " + table).c_str()).at(0).numbers.at(0);
        begins_ = !begins.empty() ? begins
                  : version == 0  ? "with the file"
                                  : fmt::format(
                                        "with {} rows that version {} had kept without a "
                                         "chain: taken over as they were found",
                                        rows, version);
        const std::string previous = fmt::format("{}", fmt::join(previous_, " "));
        database_->run(
            "INSERT INTO origin (utc_ns, text, public_key, previous) VALUES (?, ?, ?, ?)",
            {utc_now(), begins_, key_->public_key(), previous});
        chained("origin", database_->last_id());
        name_ = to_hex(chain_.last().hash);
        chain_.take_over(*database_);
        if (first_rows) first_rows();
        database_->execute(fmt::format("PRAGMA user_version = {}", kSchemaVersion).c_str());
        commit();
    } catch (const DatabaseError&) {
        database_.reset();  // which rolls back
        throw;
    }
    if (auto why = publish(); !why.empty()) throw DatabaseError(why, 0);
    verified_ = intact_ = true;
    static_cast<void>(changed_by_others());
}

void ChainedFile::begin() {
    database().execute("BEGIN IMMEDIATE");
    before_ = chain_.last();
}

void ChainedFile::commit() {
    const auto head = sign_head(name_, chain_.last(), utc_now(), *key_);
    database().run("INSERT OR REPLACE INTO head VALUES (1, ?)", {head.line()});
    database().execute("COMMIT");
    head_ = head;
}

void ChainedFile::roll_back() noexcept {
    chain_.rewind(before_);
    try {
        if (database_) database_->execute("ROLLBACK");
    } catch (const DatabaseError&) {  // SQLite has rolled back by itself
    }
}

std::string ChainedFile::publish() { return write_head(path_ + kHeadSuffix, head_); }

bool ChainedFile::changed_by_others() {
    const auto version = database().ask("PRAGMA data_version").at(0).numbers.at(0);
    return std::exchange(data_version_, version) != version;
}

std::optional<SignedHead> ChainedFile::head_of(std::string_view table, std::int64_t row) {
    const auto found = database().ask(
        "SELECT entry, hash FROM chain WHERE tbl = ? AND row = ? ORDER BY entry DESC LIMIT 1",
        {table, row});
    if (found.empty()) return {};
    return sign_head(name_, {found.front().numbers.at(0), found.front().texts.at(1)}, utc_now(),
                     *key_);
}

}  // namespace vibrig::journal
