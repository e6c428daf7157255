#include "drivers/annunciator/annunciator.hpp"

#include <pthread.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <system_error>

#include "proto/json_text.hpp"

namespace vibrig::drivers {

namespace {

constexpr std::size_t kMostWaiting = 16;
// Two read-backs in a row: between write and read-back another master may have had its turn.
constexpr int kReadsToBelieve = 2;
constexpr auto kLookAtRuns = std::chrono::milliseconds(50);
constexpr auto kCommandPeriod = std::chrono::seconds(2);

[[nodiscard]] std::string utc_text() {
    const auto now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
    tm fields{};
    ::gmtime_r(&now, &fields);
    std::array<char, 32> text{};
    const auto size = std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &fields);
    return {text.data(), size};
}

}  // namespace

Annunciator::Annunciator(const AnnunciatorSettings& settings, Say said)
    : settings_(settings), said_(std::move(said)) {
    if (!settings_.horn.host.empty()) horn_ = std::make_unique<Horn>(settings_.horn);
    if (!settings_.command.empty())
        command_ = std::make_unique<PageCommand>(settings_.command, settings_.command_limit);
    status_.horn = horn_ != nullptr;
    status_.command = command_ != nullptr;
    if (horn_) {
        horn_thread_ = std::thread([this] { run_horn(); });
        ::pthread_setname_np(horn_thread_.native_handle(), "horn");
    }
    if (!command_) return;
    try {
        pager_thread_ = std::thread([this] { run_pager(); });
    } catch (const std::system_error&) {
        end();  // nobody else does: the horn's runs, and this is not made
        throw;
    }
    ::pthread_setname_np(pager_thread_.native_handle(), "pager");
}

Annunciator::~Annunciator() { end(); }

void Annunciator::end() noexcept {
    {
        const std::lock_guard lock(mutex_);
        quit_ = true;
    }
    changed_.notify_all();
    for (std::thread* const thread : {&pager_thread_, &horn_thread_})
        if (thread->joinable()) thread->join();
}

void Annunciator::show(HornPattern pattern) {
    {
        const std::lock_guard lock(mutex_);
        if (pattern_ == pattern) return;
        pattern_ = pattern;
        if (!horn_) status_.pattern = pattern;
    }
    changed_.notify_all();
}

void Annunciator::announce(HornPattern kind, const std::string& text) {
    if (!command_) return;
    auto json = to_json(kind, text);
    {
        const std::lock_guard lock(mutex_);
        if (waiting_.size() == kMostWaiting) {
            waiting_.pop_front();
            ++status_.left_out;
        }
        waiting_.push_back(std::move(json));
    }
    changed_.notify_all();
}

AnnunciatorStatus Annunciator::status() const {
    const std::lock_guard lock(mutex_);
    return status_;
}

std::string Annunciator::to_json(HornPattern kind, const std::string& text) const {
    // Escaped six times as long at most: the whole stays below PageCommand::kLongestText.
    constexpr std::size_t kLongest = 600;
    return proto::json_text(nlohmann::ordered_json{{"source", settings_.source},
                                                   {"kind", name_of(kind)},
                                                   {"time", utc_text()},
                                                   {"text", text.substr(0, kLongest)}}) +
           '\n';
}

void Annunciator::sound(Time now) {
    {
        const std::lock_guard lock(mutex_);
        shown_ = pattern_;
    }
    const bool good = horn_->show(shown_, now);
    bad_reads_ = good ? 0 : std::min(bad_reads_ + 1, kReadsToBelieve);
    const bool confirms = bad_reads_ < kReadsToBelieve;
    bool changed = false;
    {
        const std::lock_guard lock(mutex_);
        changed = status_.confirms != confirms;
        // Of a pattern that has not been read back yet nothing is said.
        if (good || !confirms) status_.pattern = shown_;
        status_.confirms = confirms;
        status_.horn_note = confirms ? std::string() : horn_->note();
    }
    if (changed && said_)
        said_(confirms, confirms ? "horn and lamp confirm again"
                                 : "horn or lamp do not confirm: " + horn_->note());
}

/// Whether it is there has to be known before it is needed.
void Annunciator::check_command(Time now) {
    if (now < check_due_) return;
    check_due_ = now + std::chrono::nanoseconds(kCommandPeriod).count();
    const std::string trouble = command_->trouble();
    if (trouble == trouble_) return;
    trouble_ = trouble;
    {
        const std::lock_guard lock(mutex_);
        status_.command_note = trouble;
    }
    if (said_) said_(trouble.empty(), trouble.empty() ? "the command can be run again" : trouble);
}

void Annunciator::page(Time now) {
    check_command(now);
    const std::uint64_t done = command_->counters().done;
    std::string wrong = command_->attend(now);
    while (command_->has_room()) {
        std::string text;
        {
            const std::lock_guard lock(mutex_);
            if (waiting_.empty()) break;
            text = std::move(waiting_.front());
            waiting_.pop_front();
        }
        if (const auto why = command_->start(text, now); !why.empty()) wrong = why;
    }
    {
        const std::lock_guard lock(mutex_);
        const auto& counters = command_->counters();
        status_.started = counters.started;
        status_.failed = counters.failed;
        status_.timed_out = counters.timed_out;
        if (!wrong.empty() || counters.done > done) status_.command_note = wrong;
    }
    if (!wrong.empty() && said_) said_(false, wrong);
}

void Annunciator::run_horn() {
    for (;;) {
        sound(steady_now());
        const Time left = horn_->next(steady_now()) - steady_now();
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, std::chrono::nanoseconds(std::max<Time>(left, kMillisecond)),
                          [&] { return quit_ || pattern_ != shown_; });
        if (quit_) break;
    }
    // Nobody would end it; only a table that obeys no stop is left sounding.
    if (shown_ != HornPattern::disobeyed) horn_->show(HornPattern::none, steady_now());
}

void Annunciator::run_pager() {
    for (;;) {
        page(steady_now());
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, command_->idle() ? kCommandPeriod : kLookAtRuns,
                          [&] { return quit_ || (!waiting_.empty() && command_->has_room()); });
        if (quit_) break;
    }
}

}  // namespace vibrig::drivers
