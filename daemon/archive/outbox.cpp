#include "daemon/archive/outbox.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <spdlog/fmt/fmt.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "daemon/archive/child.hpp"
#include "daemon/record/disk.hpp"

namespace vibrig::archive {

namespace fs = std::filesystem;

namespace {

constexpr double kFirstRetry_s = 0.5;
constexpr double kLook_s = 60;  // a campaign's end wakes it; what came otherwise is found by a look
constexpr int kFewFailures = 2;
constexpr double kPatience_s = 600;
constexpr double kSlowest_mb_per_s = 0.5;
constexpr double kMega = 1e6;
constexpr const char* kMarks = ".outbox";
constexpr const char* kRefused = ".refused";  // below the marks, by campaign: its state, then why

std::string program_beside() {
    std::error_code error;
    const auto self = fs::read_symlink("/proc/self/exe", error);
    return (self.parent_path() / "vibrig").string();
}

bool is_part(const std::string& name) {
    return name.starts_with("campaign") && name.ends_with(".h5");
}

std::string read_text(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

/// On the disk before anything that rests on it happens. False: the disk does not take it.
bool write_mark(const fs::path& path, const std::string& text) {
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    fs::path fresh = path;
    fresh += ".new";
    const int file = ::open(fresh.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
    if (file < 0) return false;  // delivered again, to find it there
    const auto size = static_cast<ssize_t>(text.size());
    const bool good = ::write(file, text.data(), text.size()) == size && ::fsync(file) == 0;
    ::close(file);
    if (good) fs::rename(fresh, path, error);
    return good && !error;
}

/// Why `vibrig archive add --json` refused it; empty: it did not.
std::string refusal_in(const std::string& line) {
    const auto root = nlohmann::json::parse(line, nullptr, false);
    const auto found = root.is_object() ? root.find("refused") : root.end();
    return found != root.end() && found->is_string() ? found->get<std::string>() : "";
}

/// Which of the earlier campaigns say nothing of quadratic coefficients; empty: none.
std::string left_out_in(const nlohmann::json& delivered) {
    const int count = delivered.value("of_other_vibration", 0);
    return count > 0 ? fmt::format("; quadratic ones without {} of another vibration", count) : "";
}

/// Its turn comes when nobody else wants processor or disk; its children inherit that.
void be_last() {
    const auto self = static_cast<id_t>(::syscall(SYS_gettid));
    constexpr int kNice = 19, kIoWhoThread = 1, kIdle = 3 << 13;
    ::setpriority(PRIO_PROCESS, self, kNice);
    ::syscall(SYS_ioprio_set, kIoWhoThread, 0, kIdle);
}

}  // namespace

Outbox::Outbox(configuration::ArchiveSettings settings, std::string recordings, Unit unit,
               EventSink event)
    : settings_(std::move(settings)),
      recordings_(std::move(recordings)),
      unit_(std::move(unit)),
      program_(program_beside()),
      event_(std::move(event)) {
    status_.folder = settings_.folder;
    status_.good = true;
}

Outbox::~Outbox() { stop(); }

void Outbox::start() {
    sigset_t all, before;
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_BLOCK, &all, &before);
    thread_ = std::thread([this] { loop(); });
    ::pthread_setname_np(thread_.native_handle(), "outbox");
    ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void Outbox::stop() noexcept {
    stop_.store(true);
    look();
    if (thread_.joinable()) thread_.join();
}

void Outbox::look() {
    const std::lock_guard lock(mutex_);
    look_ = true;
    changed_.notify_all();
}

ArchiveStatus Outbox::status() const {
    const std::lock_guard lock(mutex_);
    return status_;
}

std::string Outbox::history() const {
    const std::lock_guard lock(mutex_);
    return history_;
}

Outbox::TypeKnown Outbox::type_known() const {
    const std::lock_guard lock(mutex_);
    return type_known_;
}

void Outbox::show(const std::function<void(ArchiveStatus&)>& change) {
    const std::lock_guard lock(mutex_);
    change(status_);
}

void Outbox::show_waiting(const std::function<void(ArchiveStatus&)>& change) {
    const auto campaigns = scan();
    show([&](ArchiveStatus& s) {
        s.waiting = s.waiting_bytes = s.refused = 0;
        s.refused_note.clear();
        for (const Campaign& one : campaigns) {
            if (!one.refused.empty() && s.refused++ == 0)
                s.refused_note = one.key + ": " + one.refused;
            if (!one.waits()) continue;
            ++s.waiting;
            s.waiting_bytes += one.bytes;
        }
        change(s);
    });
}

void Outbox::wait(double seconds) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return look_; });
    look_ = stop_.load();
}

std::vector<std::string> Outbox::command(std::vector<std::string> words) const {
    words.insert(words.begin(), program_);
    for (const auto& [option, value] :
         {std::pair{"--archive", settings_.folder}, std::pair{"--index", settings_.index}}) {
        if (value.empty()) continue;
        words.emplace_back(option);
        words.push_back(value);
    }
    words.emplace_back("--json");
    return words;
}

void Outbox::loop() {
    be_last();
    ask_type();  // the first campaign may begin soon
    ask_history();
    double retry_s = kFirstRetry_s;
    while (!stop_.load()) {
        auto campaigns = scan();
        // What failed comes last: one that can never be read must not keep the others.
        std::ranges::stable_sort(campaigns, {}, [this](const Campaign& one) {
            const auto found = failed_.find(one.key);
            return found == failed_.end() ? 0 : found->second;
        });
        int failed = 0;
        bool done = false;
        for (const Campaign& campaign : campaigns) {
            if (!campaign.waits() || stop_.load()) continue;
            const Outcome outcome = deliver(campaign);
            done = done || outcome == Outcome::delivered;
            // The archive is gone, mostly: the others would fare no better now.
            if (outcome == Outcome::failed && ++failed >= kFewFailures && !done) break;
        }
        if (done && !stop_.load()) ask_history();
        if (done || type_known().json.empty()) ask_type();
        campaigns = scan();
        if (failed == 0) make_room(campaigns);
        show_waiting([](ArchiveStatus&) {});  // somebody may have put right what was refused
        const bool waiting = std::ranges::any_of(campaigns, &Campaign::waits);
        wait(failed > 0 ? retry_s : waiting ? kFirstRetry_s : kLook_s);
        retry_s =
            failed > 0 && !done ? std::min(2 * retry_s, settings_.retry_max_s) : kFirstRetry_s;
    }
}

/// What is over, by name, which is by time for campaigns of one name.
std::vector<Outbox::Campaign> Outbox::scan() const {
    std::vector<Campaign> found;
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(recordings_, error)) {
        if (!entry.is_directory(error)) continue;
        Campaign one;
        one.key = entry.path().filename().string();
        one.path = entry.path().string();
        bool over = false, being_written = false;
        std::map<std::string, std::uint64_t> files;
        std::map<std::string, fs::file_time_type::rep> changed;
        for (const auto& file : fs::directory_iterator(entry.path(), error)) {
            const std::string name = file.path().filename().string();
            const auto bytes = file.file_size(error);
            if (error) continue;
            if (is_part(name)) {
                over = true;
                being_written = being_written || record::WriterLock::held(file.path().string());
            }
            if (!is_part(name) && !name.starts_with("raw-") && name != "dwells.csv") continue;
            files[name] = bytes;
            changed[name] = file.last_write_time(error).time_since_epoch().count();
            one.bytes += bytes;
        }
        if (!over || being_written) continue;
        for (const auto& [name, bytes] : files) {
            one.print += fmt::format("{} {}\n", name, bytes);
            one.state += fmt::format("{} {} {}\n", name, bytes, changed[name]);
        }
        one.state += '\n';
        const fs::path marks = fs::path(recordings_) / kMarks;
        one.delivered = read_text(marks / one.key) == one.print;
        if (const std::string aside = read_text(marks / kRefused / one.key);
            aside.starts_with(one.state))
            one.refused = aside.substr(one.state.size());
        found.push_back(std::move(one));
    }
    std::ranges::sort(found, {}, &Campaign::key);
    return found;
}

bool Outbox::put_aside(const Campaign& campaign, const std::string& why) {
    std::string where;
    for (const auto& [option, value] :
         {std::pair{"--archive", settings_.folder}, std::pair{"--index", settings_.index}})
        if (!value.empty()) where += fmt::format("{} {} ", option, value);
    if (told_.insert(campaign.key + campaign.state + why).second)
        event_(Severity::alarm, fmt::format("{} is refused by the archive and put aside; once that "
                                            "is put right, vibrig archive add {}{}: {}",
                                            campaign.key, where, campaign.path, why));
    return write_mark(fs::path(recordings_) / kMarks / kRefused / campaign.key,
                      campaign.state + why);
}

Outbox::Outcome Outbox::deliver(const Campaign& campaign) {
    show_waiting([&](ArchiveStatus& s) { s.delivering = campaign.key; });
    auto words = command({"archive", "add", campaign.path});
    if (!settings_.rig.empty()) {
        words.emplace_back("--rig");
        words.push_back(settings_.rig);
    }
    const double limit_s =
        kPatience_s + static_cast<double>(campaign.bytes) / kMega / kSlowest_mb_per_s;
    const Run run = run_child(words, limit_s, stop_);
    const bool good = run.status == 0;
    if (stop_.load() && !good) return Outcome::failed;
    const std::string refused = good ? "" : refusal_in(run.out);
    bool noted = true;
    if (!refused.empty()) {
        noted = put_aside(campaign, refused);
        failed_.erase(campaign.key);
    } else if (good) {
        static_cast<void>(
            write_mark(fs::path(recordings_) / kMarks / campaign.key, campaign.print));
        failed_.erase(campaign.key);
        if (!std::exchange(reported_, "").empty())
            event_(Severity::info, "can be delivered to again");
        event_(Severity::info, campaign.key + ": delivered and verified");
        tell_moved(run.out);
    } else {
        ++failed_[campaign.key];
        if (std::exchange(reported_, run.error) != run.error)
            event_(Severity::warning, campaign.key +
                                          " cannot be delivered, it is kept and tried "
                                          "again: " +
                                          run.error);
    }
    show_waiting([&](ArchiveStatus& s) {
        s.delivering.clear();
        // Who refuses is there.
        s.good = good || !refused.empty();
        s.note = s.good ? "" : run.error;
        good ? ++s.delivered : ++s.failures;
    });
    // What cannot be noted comes again, not at once.
    return good                        ? Outcome::delivered
           : refused.empty() || !noted ? Outcome::failed
                                       : Outcome::refused;
}

void Outbox::tell_moved(const std::string& line) {
    const auto root = nlohmann::json::parse(line, nullptr, false);
    if (!root.is_object()) return;
    try {
        std::string words;
        for (const auto& one : root.at("moved"))
            words +=
                fmt::format("{}{} is {:.5g}, expected {:.5g} +- {:.2g} {} (p = {:.1g})",
                            words.empty() ? "" : "; ", one.at("coefficient").get<std::string>(),
                            one.at("value").get<double>(), one.at("expected").get<double>(),
                            one.at("sigma").get<double>(), one.at("unit").get<std::string>(),
                            one.at("p").get<double>());
        if (!words.empty())
            event_(Severity::alarm,
                   fmt::format("unit {} has moved by more than its {} earlier campaigns allow: {}",
                               root.at("unit").get<std::string>(), root.at("earlier").get<int>(),
                               words + left_out_in(root)));
    } catch (const nlohmann::json::exception&) {  // of another version of vibrig
    }
}

void Outbox::add_unit(std::vector<std::string>& words) const {
    if (unit_.simulated) words.emplace_back("--simulated");
    if (unit_.at_hz > 0) words.insert(words.end(), {"--at-hz", fmt::format("{}", unit_.at_hz)});
}

void Outbox::ask_history() {
    if (unit_.serial.empty()) return;
    std::vector<std::string> words{"trend", unit_.serial};
    add_unit(words);
    const Run run = run_child(command(std::move(words)), kPatience_s, stop_);
    if (run.status != 0) return;  // a new unit, or an archive that does not answer
    // Of a unit that was on no real rig these are of simulated ones: no history of a real one.
    const auto root = nlohmann::json::parse(run.out, nullptr, false);
    if (!unit_.simulated && (!root.is_object() || root.value("simulated", true))) return;
    const std::lock_guard lock(mutex_);
    history_ = run.out;
}

void Outbox::ask_type() {
    if (unit_.type.empty() || stop_.load()) return;
    std::vector<std::string> words{"archive", "type", unit_.type};
    if (!unit_.serial.empty()) words.insert(words.end(), {"--without", unit_.serial});
    add_unit(words);
    const Run run = run_child(command(std::move(words)), kPatience_s, stop_);
    const std::lock_guard lock(mutex_);
    // What is known stays known while the archive does not answer.
    if (run.status == 0) {
        type_known_ = {run.out, ""};
    } else if (type_known_.json.empty()) {
        type_known_.why_not = run.error;
    }
}

void Outbox::make_room(const std::vector<Campaign>& campaigns) {
    if (settings_.keep_mb <= 0) return;
    double mega = 0;
    for (const Campaign& one : campaigns) mega += static_cast<double>(one.bytes) / kMega;
    std::vector<std::pair<fs::file_time_type, const Campaign*>> by_age;
    std::error_code error;
    for (const Campaign& one : campaigns)
        by_age.emplace_back(fs::last_write_time(one.path, error), &one);
    std::ranges::sort(by_age);
    // The newest may be gone on with.
    if (!by_age.empty()) by_age.pop_back();
    for (const auto& [age, one] : by_age) {
        if (mega <= settings_.keep_mb || stop_.load()) return;
        // Verified anew: what the archive has lost since comes back.
        if (!one->delivered || !one->refused.empty() || deliver(*one) != Outcome::delivered)
            continue;
        fs::remove_all(one->path, error);
        if (error) continue;
        mega -= static_cast<double>(one->bytes) / kMega;
        show([](ArchiveStatus& s) { ++s.removed; });
        event_(Severity::info,
               one->key + ": removed here, beyond archive.keep_mb; the archive has it");
    }
}

std::string try_again(const std::string& campaign_folder) {
    const fs::path folder = fs::weakly_canonical(campaign_folder);
    const fs::path aside = folder.parent_path() / kMarks / kRefused / folder.filename();
    std::error_code error;
    fs::remove(aside, error);
    if (!error) return {};
    return aside.string() + ": cannot be removed: " + error.message() +
           ": vibrigd keeps it put aside";
}

}  // namespace vibrig::archive
