#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "daemon/domain/services.hpp"
#include "proto/guard_words.hpp"

namespace vibrig::watch {

/// The daemon's end of the socket where vibrig-guard listens: tells it how the daemon goes on,
/// hears what it has found. On a thread of its own, in wall time. All calls from any thread.
class GuardLink {
  public:
    /// `word` is asked in the link's thread; its sequence is filled in there.
    using AskWord = std::function<proto::DaemonWord()>;
    GuardLink(std::string path, AskWord word);
    ~GuardLink();
    GuardLink(const GuardLink&) = delete;
    GuardLink& operator=(const GuardLink&) = delete;

    void start();
    void stop();
    /// The guard's word, if one came within its deadline.
    [[nodiscard]] bool heard() const;
    [[nodiscard]] proto::GuardWord word() const;
    /// A person has seen this finding; the guard gets it with every word from now on.
    void acknowledge(std::uint64_t finding);
    /// What the guard has found and nobody has acknowledged; none if it is not heard.
    [[nodiscard]] proto::GuardCause finding() const;
    [[nodiscard]] GuardStatus status() const;

  private:
    void run();
    void beat();
    [[nodiscard]] bool reach();
    void listen();
    void hang_up(const std::string& why);

    const std::string path_;
    const AskWord ask_;
    std::uint64_t sequence_ = 0;
    int socket_ = -1;
    int wake_ = -1;

    mutable std::mutex mutex_;  ///< guards what follows
    proto::GuardWord word_;
    std::int64_t heard_ns_ = 0;  ///< steady; 0: never
    std::uint64_t acknowledged_ = 0;
    std::string note_ = "never heard";

    std::thread thread_;
};

/// Whether the guard watches: it is heard, sees and reaches the shaker. What it lacks for no longer
/// than one reply that was lost is nothing. One thread.
class GuardEyes {
  public:
    /// Why it does not, as "is not heard"; empty: it does. `now_ns` is the wall's, steady.
    [[nodiscard]] std::string lacks(const GuardStatus& guard, std::int64_t now_ns);
    static constexpr double kPatience_s = 2;

  private:
    std::int64_t lacking_since_ns_ = -1;  ///< -1: it lacks nothing
};

}  // namespace vibrig::watch
