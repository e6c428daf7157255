#pragma once

#include <atomic>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "daemon/serve/event_log.hpp"
#include "daemon/status/source.hpp"
#include "estimator/identification/result.hpp"

namespace vibrig::v1 {
class Status;
}

namespace vibrig::serve {

/// A status in which no field has its default value, so that a forgotten one shows.
[[nodiscard]] StatusData full_status();
[[nodiscard]] estimator::Result full_result();
[[nodiscard]] v1::Status message_of(const StatusData& data);

[[nodiscard]] inline bool holds(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

/// A daemon without devices.
class FakeSource : public StatusSource {
  public:
    mutable std::atomic<int> asked{0};  ///< times the status was asked for

    FakeSource() : status_(full_status()) {}

    [[nodiscard]] StatusData status() const override {
        std::unique_lock lock(mutex_);
        StatusData status = status_;
        lock.unlock();
        ++asked;  // behind it: what is set then is not what was given here
        if (broken) throw std::runtime_error("no status today");
        return status;
    }
    [[nodiscard]] std::vector<EventRecord> events(std::uint64_t after_id,
                                                  std::size_t at_most) const override {
        return log.after(after_id, at_most);
    }
    [[nodiscard]] estimator::Result result() const override { return full_result(); }
    [[nodiscard]] std::string effective_configuration() const override {
        return "can.interface = vcan0\n";
    }
    CommandReply command(const CommandRequest& request) override {
        if (request.kind == slow_kind) ++asked_to_arm;
        if (request.kind == slow_kind)
            while (slow) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        const std::lock_guard lock(mutex_);
        requests_.push_back(request);
        return reply_;
    }

    void log_event(Severity severity, const std::string& text) override {
        const std::lock_guard lock(mutex_);
        logged_ += std::string(name_of(severity)) + ": " + text + '\n';
    }
    [[nodiscard]] std::string logged() const {
        const std::lock_guard lock(mutex_);
        return logged_;
    }
    StatusData serving(const ServerStatus& server) override {
        const std::lock_guard lock(mutex_);
        server_ = server;
        return status_;
    }
    [[nodiscard]] ServerStatus server() const {
        const std::lock_guard lock(mutex_);
        return server_;
    }
    void refused(const std::string& who, const std::string& what, const std::string& why) override {
        const std::lock_guard lock(mutex_);
        refusals_.push_back(what + " | " + who + " | " + why);
    }
    [[nodiscard]] std::vector<std::string> refusals() const {
        const std::lock_guard lock(mutex_);
        return refusals_;
    }

    void set(const StatusData& status) {
        const std::lock_guard lock(mutex_);
        status_ = status;
    }
    void answer_commands_with(const CommandReply& reply) {
        const std::lock_guard lock(mutex_);
        reply_ = reply;
    }
    [[nodiscard]] std::vector<CommandRequest> requests() const {
        const std::lock_guard lock(mutex_);
        return requests_;
    }

    EventLog log;
    std::atomic<bool> broken = false;
    /// An arming is answered when `slow` is over.
    std::atomic<bool> slow = false;
    static constexpr auto slow_kind = CommandRequest::Kind::arm;
    std::atomic<int> asked_to_arm = 0;

  private:
    mutable std::mutex mutex_;
    StatusData status_;
    CommandReply reply_{true, "done"};
    std::vector<CommandRequest> requests_;
    std::vector<std::string> refusals_;
    std::string logged_;
    ServerStatus server_;
};

}  // namespace vibrig::serve
