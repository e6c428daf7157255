#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "daemon/domain/commands.hpp"
#include "daemon/domain/events.hpp"
#include "daemon/domain/latch.hpp"
#include "daemon/domain/positions.hpp"
#include "daemon/domain/services.hpp"
#include "daemon/journal/chained_file.hpp"
#include "daemon/journal/checkpoint.hpp"
#include "daemon/journal/latches.hpp"
#include "daemon/journal/watch.hpp"
#include "daemon/rt/fed.hpp"
#include "daemon/rt/ring.hpp"

namespace vibrig::journal {

/// A campaign that was not ended in order, as far as its positions are done.
struct Unfinished {
    std::int64_t id = 0;
    std::string name, started_by;
    std::vector<DwellCheckpoint> dwells;  ///< contiguous from run 1, position 1
};

/// One step of commissioning. `what`: begin, permission, move, reading, hypothesis, question,
/// answer, verdict, accept, void or refused arm.
struct Commissioned {
    std::string part, step, by, identity, what, data_json;
    std::int64_t utc_ns = 0;
};

/// What opening the journal found.
struct Recovery {
    std::optional<Unfinished> campaign;
    /// Why what was there is not used: a cold start, in words. Empty: nothing was refused.
    std::vector<std::string> refused;
    std::string begins;               ///< how its chain begins, where rows were taken over
    std::string assumed;              ///< of what an older version did not keep; empty: nothing
    std::string out_of_band;          ///< what the newest loop check found so; empty: nothing
    std::vector<std::string> proofs;  ///< of the safe state, as they were kept, oldest first
    /// Parts of the commissioning record, and who has signed each since it was recorded last.
    std::vector<std::pair<std::string, std::string>> signed_parts;
    std::string torqued_by;  ///< whose commissioning may have left a torque; empty: nobody's
    std::vector<std::string> certificates;  ///< numbers of those that were issued
    /// Not acknowledged; kDiedArmed among them if an arming had no end.
    std::vector<Latch> latches;
};

/// What happened, on disk: campaigns, positions done with what the filter was fed, results, events
/// and who commanded what. SQLite on a thread of its own; whoever writes never waits for the disk.
class Journal {
  public:
    /// Opens or makes the file and reads what an earlier life left. What is not what was written
    /// into it is put aside, and latches kJournalLatch. `anchors`: its signed heads that are kept
    /// elsewhere. Throws DatabaseError when there can be no journal at all.
    Journal(const std::string& path, std::uint64_t configuration_hash,
            std::function<void(double free_mb)> on_space = {}, std::vector<Anchor> anchors = {},
            Pace pace = {});
    ~Journal();

    [[nodiscard]] Recovery& recovery() noexcept { return recovery_; }
    /// The estimator's thread pushes what it feeds to the filter.
    [[nodiscard]] rt::Ring<rt::Fed>& fed() noexcept { return fed_; }

    /// Before start(): called in the journal's thread when entries are on disk.
    void on_written(std::function<void()> wake) { on_written_ = std::move(wake); }
    void start();
    /// Writes what waits and ends the thread.
    void stop() noexcept;

    /// Whether the entry of this number, and all before it, are on disk. Any thread.
    [[nodiscard]] bool on_disk(std::uint64_t entry) const;
    /// The signed head, once it has this entry in it. Any thread.
    [[nodiscard]] std::optional<std::string> head_with(std::uint64_t entry) const;

    // Control thread. They queue; `kMostWaiting` at most, the rest is dropped and counted. Armings
    // and latches are never dropped; what returns a number says on_disk() with it.
    std::uint64_t armed(const std::string& by, const std::string& what);
    std::uint64_t disarmed(const std::string& by, const std::string& why);
    std::uint64_t latched(const Latch& latch);
    /// `last`: with this person it is over; else it waits for a second one.
    std::uint64_t acknowledged(const std::string& name, const std::string& by, bool last);
    void campaign_begun(const std::string& name, const std::string& by);
    void campaign_resumed(std::int64_t id, const std::string& by);
    void dwell_done(const estimator::DwellInfo& info, const estimator::DwellSummary& summary,
                    const StopDone& stop);
    std::uint64_t campaign_ended(const std::string& state, const std::string& reason,
                                 const std::string& result_json);
    /// A loop check was completed; `out_of_band` is empty if all was in its band.
    void loop_checked(const std::string& by, const std::string& out_of_band);
    /// A proof of the safe state is over; `record` is kept as it is.
    void proved(const std::string& by, const std::string& record);
    void event(const EventRecord& event);
    void commissioned(const Commissioned& row);
    std::uint64_t command(const CommandRequest& request, const CommandReply& reply,
                          std::int64_t utc_ns);

    [[nodiscard]] JournalStatus status() const;
    /// What was found missing or changed since this was last asked, in words; the file was put
    /// aside and kJournalLatch is in the new one. Control thread.
    [[nodiscard]] std::vector<std::string> take_found();

    static constexpr std::size_t kMostWaiting = 10'000;

  private:
    struct Begun {
        std::string name, by;
        std::int64_t resumed_id = 0;  ///< 0: a new one
        std::int64_t utc_ns = 0;
    };
    struct Done {
        estimator::DwellInfo info;
        estimator::DwellSummary summary;
        StopDone stop;
    };
    struct Ended {
        std::string state, reason, result;
        std::int64_t utc_ns = 0;
    };
    struct Commanded {
        CommandRequest request;
        CommandReply reply;
        std::int64_t utc_ns = 0;
    };
    struct LoopChecked {
        std::string by, out_of_band;
        std::int64_t utc_ns = 0;
    };
    struct Proved {
        std::string by, record;
        std::int64_t utc_ns = 0;
    };
    /// A row of the table `safety`: the arming, and what has to be acknowledged.
    struct Safety {
        const char* what = "";
        std::string name, person, text;
        bool two_persons = false;
        std::int64_t utc_ns = 0;
    };
    using Entry = std::variant<Proved, Begun, Done, Ended, EventRecord, Commanded, LoopChecked,
                               Safety, Commissioned>;

    void open();
    void recover();
    void recover_loop_check();
    void recover_proofs();
    void recover_certificates();
    void recover_signed_parts();
    void recover_torque();
    void recover_safety();
    void read_safety(Database& from);
    void follow(const Safety& safety);
    void note_proof(std::int64_t row);
    /// Where it cannot be read there is none.
    void note_newest_proof() noexcept;
    void look();
    [[nodiscard]] std::string cause_of(const DatabaseError& error) const;
    void begin_anew(const std::vector<std::string>& found);
    void carry_over(const std::string& why);
    void carry_campaign(const std::vector<Row>& campaign);
    void show();
    [[nodiscard]] Database& database() { return file_.database(); }
    void chained(std::string_view table) { file_.chained(table, database().last_id()); }
    void recover_dwells(Unfinished& campaign);
    /// The number of the entry; 0: dropped.
    std::uint64_t put(Entry entry);
    void loop();
    void take_fed();
    void publish();
    [[nodiscard]] bool write(const std::deque<Entry>& entries);
    void write_one(const Begun& begun);
    void write_one(const Done& done);
    void write_one(const Ended& ended);
    void write_one(const EventRecord& event);
    void write_one(const Commanded& commanded);
    void write_one(const LoopChecked& checked);
    void write_one(const Proved& proved);
    void write_one(const Commissioned& row);
    void write_one(const Safety& safety);

    const std::string path_;
    const std::uint64_t configuration_hash_;
    std::function<void(double)> on_space_;
    std::function<void()> on_written_;
    ChainedFile file_;
    Watch watch_;
    Recovery recovery_;
    rt::Ring<rt::Fed> fed_{16384};

    // The journal's thread.
    std::int64_t campaign_ = 0;              ///< the one in progress; 0: none
    Latches latches_;                        ///< as the file has them
    Safety arming_;                          ///< as the file has it; its `what` is empty: none
    std::vector<std::string> to_replace_;    ///< why the file is to be put aside; empty: it is not
    std::string proof_head_;                 ///< signed, of the newest proof's entry
    bool started_ = false;                   ///< the thread runs
    std::deque<DwellCheckpoint> collected_;  ///< dwells being fed or not yet written

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::deque<Entry> waiting_;
    std::size_t at_work_ = 0;  ///< entries that its thread has and the disk has not
    std::vector<std::string> found_;
    JournalStatus status_;
    bool stop_ = false;
    std::thread thread_;
};

}  // namespace vibrig::journal
