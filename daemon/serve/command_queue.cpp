#include "daemon/serve/command_queue.hpp"

#include <pthread.h>

#include <csignal>
#include <exception>
#include <utility>

namespace vibrig::serve {

CommandQueue::CommandQueue(StatusSource& source) : source_(source) {
    // Signals are for the main thread.
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_BLOCK, &all, &before);
    thread_ = std::thread([this] { carry_out(); });
    pthread_setname_np(thread_.native_handle(), "commands");
    pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

CommandQueue::~CommandQueue() {
    {
        const std::lock_guard lock(mutex_);
        ending_ = true;
        changed_.notify_all();
    }
    thread_.join();
}

bool CommandQueue::put(CommandRequest request, Done done) {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() >= kMostWaiting) return false;
    waiting_.push_back({std::move(request), std::move(done)});
    changed_.notify_all();
    return true;
}

void CommandQueue::refuse_waiting(const std::string& why) {
    std::deque<Waiting> overtaken;
    {
        const std::lock_guard lock(mutex_);
        overtaken.swap(waiting_);
    }
    for (Waiting& one : overtaken) one.done({false, why});
}

void CommandQueue::carry_out() {
    for (;;) {
        Waiting next;
        {
            std::unique_lock lock(mutex_);
            changed_.wait(lock, [this] { return ending_ || !waiting_.empty(); });
            if (ending_) return;
            next = std::move(waiting_.front());
            waiting_.pop_front();
        }
        CommandReply reply;
        try {
            reply = source_.command(next.request);
        } catch (const std::exception& error) {
            reply = {false, error.what()};
        }
        next.done(std::move(reply));
    }
}

}  // namespace vibrig::serve
