#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "daemon/configuration/archive_settings.hpp"
#include "daemon/domain/events.hpp"
#include "daemon/domain/services.hpp"

namespace vibrig::archive {

/// Brings campaigns that are over to the archive, on a thread of its own and in wall time, by
/// `vibrig archive add` as a process of its own: whatever archive, index or network do, it is that
/// process that waits. The outbox is the folder of recordings itself, with a mark for each campaign
/// that was delivered and verified; so nothing that is recorded can be missed, and nothing is
/// removed before. What the archive refuses is put aside with its reason, and tried again when its
/// files have changed or a person has delivered it. Any thread may call.
class Outbox {
  public:
    /// The unit on the rig.
    struct Unit {
        std::string serial;  ///< empty: not known
        std::string type;    ///< empty: nothing is asked of its type
        bool simulated = false;
        double at_hz = 0;  ///< of which its campaign's quadratic coefficients will be; 0: not known
    };
    /// `recordings`: the folder of campaigns' folders. `event` is called in its thread.
    Outbox(configuration::ArchiveSettings settings, std::string recordings, Unit unit,
           EventSink event);
    ~Outbox();
    Outbox(const Outbox&) = delete;
    Outbox& operator=(const Outbox&) = delete;

    void start();
    void stop() noexcept;
    /// A campaign is over: it looks at once.
    void look();
    [[nodiscard]] ArchiveStatus status() const;
    /// The unit's earlier campaigns, as `vibrig trend SERIAL --json` prints them; empty: not known.
    [[nodiscard]] std::string history() const;
    /// What the archive knows of the unit's type, as `vibrig archive type --json` prints it.
    struct TypeKnown {
        std::string json;     ///< empty: nothing
        std::string why_not;  ///< empty as well: not asked yet
    };
    [[nodiscard]] TypeKnown type_known() const;

  private:
    /// A campaign's folder, over.
    struct Campaign {
        std::string key, path, print;
        std::string state;  ///< the print with the times at which files were changed
        std::uint64_t bytes = 0;
        bool delivered = false;
        std::string refused;  ///< why the archive does not take it as it is; empty: it may
        [[nodiscard]] bool waits() const { return !delivered && refused.empty(); }
    };
    enum class Outcome { delivered, refused, failed };
    void loop();
    [[nodiscard]] std::vector<Campaign> scan() const;
    Outcome deliver(const Campaign& campaign);
    /// False: it is not noted, and comes again.
    bool put_aside(const Campaign& campaign, const std::string& why);
    void tell_moved(const std::string& line);
    void ask_history();
    /// To the words of a command: on which rig the unit is, and of which vibration.
    void add_unit(std::vector<std::string>& words) const;
    void ask_type();
    void make_room(const std::vector<Campaign>& campaigns);
    void wait(double seconds);
    [[nodiscard]] std::vector<std::string> command(std::vector<std::string> words) const;
    void show(const std::function<void(ArchiveStatus&)>& change);
    /// With what waits and what was refused, by a look at the folders.
    void show_waiting(const std::function<void(ArchiveStatus&)>& change);

    const configuration::ArchiveSettings settings_;
    const std::string recordings_;
    const Unit unit_;
    const std::string program_;
    const EventSink event_;
    std::map<std::string, int> failed_;  ///< campaigns that could not be delivered, and how often
    std::string reported_;               ///< why the newest could not
    std::set<std::string> told_;         ///< refusals, though none could be noted
    std::atomic<bool> stop_{false};
    mutable std::mutex mutex_;
    std::condition_variable changed_;
    bool look_ = false;
    ArchiveStatus status_;
    std::string history_;
    TypeKnown type_known_;
    std::thread thread_;
};

/// A person has delivered the campaign in this folder: what put it aside there is forgotten. Why it
/// cannot be, if it cannot.
[[nodiscard]] std::string try_again(const std::string& campaign_folder);

}  // namespace vibrig::archive
