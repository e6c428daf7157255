#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "daemon/journal/chain.hpp"

namespace vibrig::journal {

class Database;

/// How much of a journal is looked at, and when.
struct Pace {
    std::chrono::nanoseconds look = std::chrono::seconds(1);    ///< at the files' identity
    std::chrono::nanoseconds period = std::chrono::minutes(1);  ///< at the rows
    std::int64_t entries = 2000;                                ///< of a slice
    std::size_t bytes = 8 << 20;                                ///< of rows in a slice
};

/// Whether a journal stays what was written into it while its daemon runs, on a thread of its own,
/// which reads through connections of its own: what the writer has in memory proves nothing. Each
/// period what is new, and a slice of what is old; all of it until that has been done once, and
/// again when another program has written.
class Watch {
  public:
    Watch(std::string path, Pace pace) : path_(std::move(path)), pace_(pace) {}
    ~Watch();

    /// What has to be there. The journal's thread, before start() too.
    struct Expected {
        Link newest;
        std::string public_key;
        bool verified = false, intact = false;
    };
    /// A journal is opened or made: forgets what it found in another one.
    void begin(Expected expected);
    void start();
    void stop() noexcept;
    /// Is on disk. Before anybody is told so: what is cut off then is missed.
    void wrote(const Link& newest);
    /// The head of this entry lies beside it.
    void published(const Link& head);
    void changed_by_others();

    struct Report {
        std::vector<std::string> found;  ///< missing or changed; it looks no further then
        bool verified = false;           ///< all of it, since it was opened or another wrote to it
        double part = 0;                 ///< of the entries that were, until then
        std::string cannot;              ///< why it could not look; empty: it could
    };
    [[nodiscard]] Report report() const;
    /// Which of the files that were opened is gone or another one now; empty: none. Any thread.
    [[nodiscard]] std::string changed_files() const;

  private:
    struct Identity {
        dev_t device = 0;
        ino_t node = 0;
        off_t size = -1;  ///< -1: there is none
        mode_t mode = 0;
        uid_t owner = 0;
    };
    struct Files {
        Identity file, log, key;
    };
    [[nodiscard]] static Identity identity_of(const std::string& path);
    /// What is known of one opened journal; the watch's thread.
    struct Pass {
        std::uint64_t generation = 0;
        Files files;
        bool intact = false, verified = false;
        Verification all;  ///< goes round
        Link newest;       ///< until here it was looked at
    };

    void loop();
    void take_orders(Pass& pass);
    [[nodiscard]] bool look(Pass& pass, bool rows);
    /// Takes the sizes that it finds.
    [[nodiscard]] std::string changed_files(Files& files) const;
    void look_at_rows(Pass& pass, std::vector<std::string>& found);
    void look_at_new_rows(Pass& pass, Database& reader, std::vector<std::string>& found);

    const std::string path_;
    const Pace pace_;

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    Expected expected_;
    Files files_;  ///< as they were opened
    Link published_;
    std::uint64_t generation_ = 0;
    bool others_wrote_ = false;
    Report report_;
    std::atomic<bool> stop_{false};
    std::thread thread_;
};

}  // namespace vibrig::journal
