#include "daemon/journal/watch.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <utility>

#include "daemon/journal/chained_file.hpp"
#include "daemon/journal/database.hpp"

namespace vibrig::journal {

namespace {
constexpr int kNice = 10;  // whoever measures comes first
}

Watch::~Watch() { stop(); }

Watch::Identity Watch::identity_of(const std::string& path) {
    struct stat found {};
    if (::stat(path.c_str(), &found) != 0) return {};
    return {found.st_dev, found.st_ino, found.st_size, found.st_mode, found.st_uid};
}

void Watch::begin(Expected expected) {
    const Files files{identity_of(path_), identity_of(path_ + "-wal"),
                      identity_of(path_ + kKeySuffix)};
    const std::lock_guard lock(mutex_);
    ++generation_;
    files_ = files;
    expected_ = std::move(expected);
    published_ = {};
    others_wrote_ = false;
    report_ = {};
    report_.verified = expected_.verified;
    changed_.notify_all();
}

void Watch::start() {
    thread_ = std::thread([this] { loop(); });
    ::pthread_setname_np(thread_.native_handle(), "journal-watch");
}

void Watch::stop() noexcept {
    {
        const std::lock_guard lock(mutex_);
        stop_.store(true);
        changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
}

void Watch::wrote(const Link& newest) {
    const std::lock_guard lock(mutex_);
    expected_.newest = newest;
}

void Watch::published(const Link& head) {
    const std::lock_guard lock(mutex_);
    published_ = head;
}

void Watch::changed_by_others() {
    const std::lock_guard lock(mutex_);
    others_wrote_ = true;
    report_.verified = false;
    changed_.notify_all();
}

Watch::Report Watch::report() const {
    const std::lock_guard lock(mutex_);
    return report_;
}

void Watch::loop() {
    ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNice);
    Pass pass;
    auto rows_due = std::chrono::steady_clock::now();
    while (!stop_.load()) {
        take_orders(pass);
        const auto now = std::chrono::steady_clock::now();
        const bool rows = !pass.verified || now >= rows_due;
        const bool could = look(pass, rows);
        if (rows && could && pass.verified) rows_due = now + pace_.period;
        std::unique_lock lock(mutex_);
        if (!pass.verified && could && report_.found.empty()) continue;
        changed_.wait_for(lock, pace_.look, [&] {
            return stop_.load() || generation_ != pass.generation || others_wrote_;
        });
    }
}

void Watch::take_orders(Pass& pass) {
    const std::lock_guard lock(mutex_);
    if (generation_ != pass.generation) {
        pass = Pass();
        pass.generation = generation_;
        pass.intact = expected_.intact;
        pass.verified = expected_.verified;
        if (pass.verified) pass.newest = expected_.newest;
        pass.files = files_;
    } else if (others_wrote_) {
        pass.verified = false;
        pass.all = Verification();
    }
    others_wrote_ = false;
}

/// False: it could not; it is tried again.
bool Watch::look(Pass& pass, bool rows) {
    std::vector<std::string> found;
    std::string cannot;
    {
        const std::lock_guard lock(mutex_);
        if (!report_.found.empty()) return true;  // until it is replaced
    }
    try {
        if (auto why = changed_files(pass.files); !why.empty()) {
            found.push_back(std::move(why));
        } else if (rows) {
            look_at_rows(pass, found);
        }
    } catch (const DatabaseError& error) {
        if (error.damaged()) {
            found.emplace_back(error.what());
        } else {
            cannot = error.what();
        }
    }
    // A file that went after the first look is the cause of what was read since.
    if (!found.empty() || !cannot.empty()) {
        if (auto why = changed_files(pass.files); !why.empty() && found != std::vector{why})
            found.insert(found.begin(), std::move(why));
    }
    const std::lock_guard lock(mutex_);
    // Of another journal meanwhile, or to be looked at anew.
    if (generation_ != pass.generation) return true;
    report_.cannot = cannot;
    report_.verified = pass.verified && !others_wrote_;
    const auto all = expected_.newest.entry;
    report_.part =
        all == 0 ? 1 : static_cast<double>(pass.all.at().entry) / static_cast<double>(all);
    report_.found = std::move(found);
    return cannot.empty();
}

std::string Watch::changed_files() const {
    Files files;
    {
        const std::lock_guard lock(mutex_);
        files = files_;
    }
    return changed_files(files);
}

std::string Watch::changed_files(Files& files) const {
    const auto compare = [](const std::string& path, const Identity& was, const Identity& now) {
        if (was.size < 0) return std::string();
        if (now.size < 0) return path + ": was deleted while the daemon ran";
        if (now.node != was.node || now.device != was.device)
            return path + ": was replaced by another file while the daemon ran";
        return std::string();
    };
    const Identity file = identity_of(path_), log = identity_of(path_ + "-wal");
    const Identity key = identity_of(path_ + kKeySuffix);
    if (auto why = compare(path_, files.file, file); !why.empty()) return why;
    if (file.size < files.file.size) {
        return fmt::format("{}: was cut from {} to {} bytes while the daemon ran", path_,
                           files.file.size, file.size);
    }
    // A reader of the watch's own that opens after a deletion makes another log.
    if (!compare(path_, files.log, log).empty())
        return path_ + "-wal: was deleted or replaced while the daemon ran";
    if (auto why = compare(path_ + kKeySuffix, files.key, key); !why.empty()) return why;
    const Identity& was = files.key;
    if (key.mode != was.mode || key.owner != was.owner || key.size != was.size)
        return path_ + kKeySuffix + ": the journal's key was changed, or opened to others";
    files.file = file;
    files.log = log;
    return {};
}

void Watch::look_at_rows(Pass& pass, std::vector<std::string>& found) {
    Expected expected;
    Link published;
    {
        const std::lock_guard lock(mutex_);
        expected = expected_;
        published = published_;
    }
    const auto beside = read_head(path_ + kHeadSuffix);
    if (!beside.wrong.empty()) {
        found.push_back(beside.wrong);
    } else if (!beside.head) {
        found.push_back(path_ + kHeadSuffix + ": was deleted while the daemon ran");
    } else if (beside.head->link.entry < published.entry) {
        found.push_back(fmt::format("{}: found the head of entry {}, written was that of {}",
                                    path_ + kHeadSuffix, beside.head->link.entry, published.entry));
    }
    const std::size_t of_files = found.size();
    Database reader(path_, Database::Mode::read);
    reader.end_when(stop_);
    if (!std::exchange(pass.intact, true)) {
        for (std::string& what : reader.damage(1)) found.push_back(std::move(what));
    }
    {
        const Snapshot snapshot(reader);
        if (auto why = differs_from(reader, expected.newest, "the daemon"); !why.empty())
            found.push_back(std::move(why));
        if (auto why = unsigned_end(reader, expected.public_key); !why.empty())
            found.push_back(std::move(why));
        pass.all.step(reader, pace_.entries, pace_.bytes);
    }
    if (pass.verified) look_at_new_rows(pass, reader, found);
    found.insert(found.end(), pass.all.found().begin(), pass.all.found().end());
    for (std::size_t i = of_files; i < found.size(); ++i) found[i] = path_ + ": " + found[i];
    if (!pass.all.done()) return;
    if (!pass.verified) pass.newest = pass.all.at();
    pass.verified = true;
    pass.all = Verification();
}

/// A round over a journal of years takes hours: what was written since the last look is looked at
/// now. Rows that are in no entry are looked for at the end of a round.
void Watch::look_at_new_rows(Pass& pass, Database& reader, std::vector<std::string>& found) {
    constexpr bool kNoStrangers = false;
    Verification fresh(pass.newest, kNoStrangers);
    while (!fresh.done()) {
        const Snapshot snapshot(reader);
        fresh.step(reader, pace_.entries, pace_.bytes);
    }
    found.insert(found.end(), fresh.found().begin(), fresh.found().end());
    pass.newest = fresh.at();
}

}  // namespace vibrig::journal
