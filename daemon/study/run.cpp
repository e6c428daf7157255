#include "daemon/study/run.hpp"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <exception>
#include <filesystem>
#include <map>
#include <mutex>
#include <new>
#include <thread>

namespace vibrig::study {

namespace {

using Clock = std::chrono::steady_clock;  // a wall clock may jump
constexpr std::chrono::milliseconds kLook{100};
constexpr double kFresh_s = 60;

double seconds_since(Clock::time_point begin) {
    return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// What a thread could not go on for. That there is no memory is said without any.
struct Trouble {
    std::uint64_t index = 0;
    std::exception_ptr why = nullptr;  ///< none: all was done
};

/// With what was stored, and what is to be done.
std::string words_of(const Trouble& trouble, std::uint64_t stored) {
    const std::string end = "; " + std::to_string(stored) + " tasks were stored";
    try {
        std::rethrow_exception(trouble.why);
    } catch (const StudyError& error) {
        return error.what() + end;  // that does not pass
    } catch (const std::bad_alloc&) {
        return "not enough memory" + end + ", run it again and it goes on";
    } catch (const std::exception& error) {
        return error.what() + end + ", run it again and it goes on";
    }
}

/// Hands out the tasks that are not done in their order, and takes back what they gave.
class Queue {
  public:
    Queue(const std::vector<bool>& done, std::uint64_t first) : done_(done), first_(first) {}

    bool take(std::uint64_t& ticket, std::uint64_t& index) {
        const std::scoped_lock lock(mutex_);
        while (at_ < done_.size() && done_[at_]) ++at_;
        if (stopped_ || at_ == done_.size()) return false;
        ticket = next_ticket_++;
        index = first_ + at_++;
        return true;
    }
    void give(std::uint64_t ticket, TaskRecord record) {
        const std::scoped_lock lock(mutex_);
        given_.emplace(ticket, std::move(record));
        ++count_;
    }
    void left(const Trouble& trouble) {
        const std::scoped_lock lock(mutex_);
        ++left_;
        if (trouble.why) {
            stopped_ = true;
            if (!trouble_.why) trouble_ = trouble;
        }
        changed_.notify_all();
    }
    [[nodiscard]] Trouble trouble() {
        const std::scoped_lock lock(mutex_);
        return trouble_;
    }
    void stop() {
        const std::scoped_lock lock(mutex_);
        stopped_ = true;
    }
    /// True: all `threads` have left.
    bool wait(unsigned threads, double chunk_s) {
        std::unique_lock lock(mutex_);
        const auto look =
            std::min<std::chrono::duration<double>>(kLook, std::chrono::duration<double>(chunk_s));
        return changed_.wait_for(lock, look, [&] { return left_ == threads; });
    }
    /// What is there without a gap, since a part's indices grow; `all`: nothing comes any more.
    std::vector<TaskRecord> collect(bool all) {
        const std::scoped_lock lock(mutex_);
        std::vector<TaskRecord> records;
        while (!given_.empty() && (all || given_.begin()->first == collected_)) {
            records.push_back(std::move(given_.begin()->second));
            given_.erase(given_.begin());
            ++collected_;
        }
        return records;
    }
    [[nodiscard]] std::uint64_t count() {
        const std::scoped_lock lock(mutex_);
        return count_;
    }

  private:
    const std::vector<bool>& done_;
    std::uint64_t first_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::map<std::uint64_t, TaskRecord> given_;  ///< by ticket
    std::uint64_t at_ = 0, next_ticket_ = 0, collected_ = 0, count_ = 0;
    unsigned left_ = 0;
    Trouble trouble_;
    bool stopped_ = false;
};

/// Until nothing is left to take.
Trouble work(Queue& queue, const std::function<std::unique_ptr<Worker>()>& make) noexcept {
    std::uint64_t ticket = 0, index = 0;
    try {
        const std::unique_ptr<Worker> worker = make();
        while (queue.take(ticket, index)) queue.give(ticket, {index, worker->run(index)});
        return {};
    } catch (const std::exception&) {
        return {index, std::current_exception()};
    }
}

/// The threads; they are gone when it is. None begins before all are there: where the memory ends
/// with one that cannot be made, nobody else is in want of it.
class Crew {
  public:
    Crew(Queue& queue, const std::function<std::unique_ptr<Worker>()>& make, unsigned count)
        : queue_(queue) {
        try {
            threads_.reserve(count);
            while (threads_.size() < count)
                threads_.emplace_back([this, &queue, &make] {
                    starts_.wait(Starts::not_yet);
                    queue.left(starts_.load() == Starts::all ? work(queue, make) : Trouble{});
                });
            start(Starts::all);
        } catch (const std::exception& error) {
            const std::string made = std::to_string(threads_.size());
            start(Starts::none);
            end();
            throw StudyError("thread " + made + " of " + std::to_string(count) +
                             " cannot be made: " + error.what());
        }
    }
    ~Crew() { end(); }
    Crew(const Crew&) = delete;
    Crew& operator=(const Crew&) = delete;

  private:
    enum class Starts : std::uint8_t { not_yet, all, none };
    void start(Starts how) noexcept {
        starts_.store(how);
        starts_.notify_all();
    }
    void end() {
        queue_.stop();
        for (std::thread& thread : threads_) thread.join();
        threads_.clear();
    }

    Queue& queue_;
    std::atomic<Starts> starts_{Starts::not_yet};
    std::vector<std::thread> threads_;
};

void tell_others_at_work(const Folder& folder, const RunOptions& options) {
    for (const PartName& name : parts_in(folder.parts())) {
        if (name.closed || name.shard.number != options.shard.number ||
            name.shard.of != options.shard.of)
            continue;
        std::error_code error;
        const auto written =
            std::filesystem::last_write_time(folder.parts() + "/" + name.file, error);
        const double age_s =
            std::chrono::duration<double>(std::filesystem::file_time_type::clock::now() - written)
                .count();
        if (!error && age_s < kFresh_s && options.tell)
            options.tell(
                name.file +
                " was written a moment ago: another run of this shard may be "
                "at work. Both go on; what is done twice is the same, and nothing is lost");
    }
}

std::atomic<bool> signalled{false};

}  // namespace

const std::atomic<bool>& stop_on_signals() {
    struct sigaction action {};
    action.sa_handler = [](int) { signalled.store(true); };
    sigaction(SIGINT, &action, nullptr);
    sigaction(SIGTERM, &action, nullptr);
    std::signal(SIGXFSZ, SIG_IGN);
    return signalled;
}

RunReport run_study(const Folder& folder, const RunOptions& options) {
    const std::uint64_t first = options.shard.begin(folder.tasks());
    tell_others_at_work(folder, options);
    const Done done = done_in(folder.parts(), folder.id, folder.tasks(), options.shard);
    if (options.tell) {
        for (const std::string& damaged : done.damaged)
            options.tell(damaged + ": what it lacks is computed again");
    }
    RunReport report;
    report.all = done.tasks.size();
    report.before = done.count;
    report.failed = done.failed;
    PartWriter writer(folder.parts(), folder.id, options.shard);
    Queue queue(done.tasks, first);
    const auto begin = Clock::now();
    const auto store = [&](bool all) {
        const auto records = queue.collect(all);
        for (const TaskRecord& record : records) {
            if (record.bytes[0] != 'F') continue;
            if (report.failed++ == 0)
                report.first_failure =
                    "task " + std::to_string(record.index) + ": " + record.bytes.substr(1);
        }
        writer.append(records);
        report.now += records.size();
    };
    const auto make = options.worker ? options.worker : [&folder] { return worker_of(folder); };
    {
        Crew crew(queue, make, options.threads);
        auto stored_at = begin;
        for (bool over = false; !over;) {
            over = queue.wait(options.threads, std::max(1e-3, options.chunk_s));
            if (options.stop != nullptr && options.stop->load()) queue.stop();
            if (over || seconds_since(stored_at) >= options.chunk_s) {
                store(over);
                stored_at = Clock::now();
            }
            if (!options.progress) continue;
            const std::uint64_t now = queue.count();
            const double rate = static_cast<double>(now) / std::max(1e-3, seconds_since(begin));
            const auto left = static_cast<double>(report.all - report.before - now);
            options.progress({report.before + now, report.all, rate, now > 0 ? left / rate : -1});
        }
    }
    writer.close();
    if (const Trouble trouble = queue.trouble(); trouble.why)
        throw StudyError(folder.path + ": stopped at task " + std::to_string(trouble.index) + ": " +
                         words_of(trouble, report.now));
    return report;
}

}  // namespace vibrig::study
