#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "daemon/domain/commands.hpp"
#include "daemon/status/source.hpp"

namespace vibrig::serve {

/// Commands on their way to the daemon, one after the other on a thread of their own: an answer may
/// take as long as a slow disk or a stuck control thread, and the server hears a stop meanwhile.
class CommandQueue {
  public:
    using Done = std::function<void(CommandReply)>;
    static constexpr std::size_t kMostWaiting = 100;

    explicit CommandQueue(StatusSource& source);
    /// Waits for the one that is being carried out; drops the others.
    ~CommandQueue();
    CommandQueue(const CommandQueue&) = delete;
    CommandQueue& operator=(const CommandQueue&) = delete;

    /// `done` is called on the queue's thread, or never when the queue ends before. False: too many
    /// wait, and `done` is not kept.
    [[nodiscard]] bool put(CommandRequest request, Done done);
    /// Answers what has not begun with a refusal: a stop overtakes it, and it must not follow.
    void refuse_waiting(const std::string& why);

  private:
    struct Waiting {
        CommandRequest request;
        Done done;
    };
    void carry_out();

    StatusSource& source_;
    std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Waiting> waiting_;
    bool ending_ = false;
    std::thread thread_;
};

}  // namespace vibrig::serve
