#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "drivers/annunciator/horn.hpp"
#include "drivers/annunciator/page_command.hpp"

namespace vibrig::drivers {

struct AnnunciatorSettings {
    HornSettings horn;
    std::string command;  ///< program that pages somebody; empty: none
    Time command_limit = 10 * kSecond;
    std::string source = "vibrigd";  ///< who speaks, in the command's input
};

struct AnnunciatorStatus {
    bool horn = false;                                     ///< there is one
    bool confirms = true;                                  ///< it reads back as commanded
    std::string horn_note;                                 ///< why not
    HornPattern pattern = HornPattern::none;               ///< that this is said of
    bool command = false;                                  ///< there is one
    std::uint64_t started = 0, failed = 0, timed_out = 0;  ///< runs of it
    std::uint64_t left_out = 0;                            ///< not run: too many waited
    std::string command_note;  ///< what went wrong with the newest, or why it cannot be run
};

/// Horn with lamp, and pager, on a thread each and in wall time: no page waits for the horn, whose
/// name may have to be looked up, which takes as long as the resolver wants. show() and announce()
/// may be called in any thread that is not real-time; they wait for nothing outside.
class Annunciator {
  public:
    /// Throws ShakerError for settings that cannot work. `said`, from both threads, perhaps at
    /// once: one line when horn or command stop to work, and when they work again.
    using Say = std::function<void(bool good, const std::string& text)>;
    Annunciator(const AnnunciatorSettings& settings, Say said);
    ~Annunciator();
    Annunciator(const Annunciator&) = delete;
    Annunciator& operator=(const Annunciator&) = delete;

    /// What horn and lamp show from now on.
    void show(HornPattern pattern);
    /// The command is run with this as soon as there is room. Of what waits, 16 are kept.
    void announce(HornPattern kind, const std::string& text);
    [[nodiscard]] AnnunciatorStatus status() const;

  private:
    void end() noexcept;
    void run_horn();
    void run_pager();
    void sound(Time now);
    void page(Time now);
    void check_command(Time now);
    [[nodiscard]] std::string to_json(HornPattern kind, const std::string& text) const;

    const AnnunciatorSettings settings_;
    const Say said_;
    std::unique_ptr<Horn> horn_;  ///< of its thread, as what follows
    HornPattern shown_ = HornPattern::none;
    int bad_reads_ = 0;
    std::unique_ptr<PageCommand> command_;  ///< of the pager's thread, as what follows
    std::string trouble_;                   ///< of the command, as last looked at
    Time check_due_ = 0;

    mutable std::mutex mutex_;  ///< guards what follows; never held while horn or command are busy
    std::condition_variable changed_;
    HornPattern pattern_ = HornPattern::none;
    std::deque<std::string> waiting_;
    AnnunciatorStatus status_;
    bool quit_ = false;

    std::thread horn_thread_, pager_thread_;
};

}  // namespace vibrig::drivers
