#pragma once

#include <sys/types.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "daemon/guard/modbus_tcp.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig::guard {

/// What horn and lamp show, as docs/guard.md has it: the same tunes as the daemon's, so that people
/// learn them once.
///   stop       lamp on, horn 1 s in 2 s: the shaker is ordered to stop
///   disobeyed  lamp and horn on without a pause: press the emergency stop
enum class Tune : std::uint8_t { none, stop, disobeyed };
[[nodiscard]] bool sounds(Tune tune, drivers::Time since) noexcept;

struct AlarmSettings {
    std::string host;  ///< of the Modbus/TCP device with the coils; empty: there is none
    int port = 502;
    int unit = 1;
    int horn_coil = 0;
    int lamp_coil = -1;   ///< -1: none
    int wait_ms = 500;    ///< of one request
    std::string command;  ///< program that pages somebody; empty: none
    drivers::Time command_limit = 10 * drivers::kSecond;
};

/// Horn and lamp. Another master may sound the same horn: this one says off only once. One thread.
class Coils {
  public:
    explicit Coils(const AlarmSettings& settings);
    /// Writes what is due and reads it back. False: a coil that should be on does not read back as
    /// on, or the device is not reached; note() says which.
    [[nodiscard]] bool show(Tune tune, drivers::Time now);
    [[nodiscard]] const std::string& note() const noexcept { return note_; }

  private:
    struct Coil {
        const char* name;
        int address;
        bool on = false;  ///< as last commanded
    };
    [[nodiscard]] bool set(Coil& coil, bool on);
    [[nodiscard]] bool is_on(const Coil& coil, bool& on);
    [[nodiscard]] bool fail(const char* what, const Coil& coil);

    ModbusTcp line_;
    Coil horn_, lamp_;
    Tune tune_ = Tune::none;
    drivers::Time begun_ = 0, next_attempt_ = 0;
    std::string note_;
};

/// One run after another of the program that pages somebody: a text on its standard input, a
/// process group of its own, a limited time, its output nowhere. Nobody waits for it. One thread.
class Pager {
  public:
    Pager(std::string path, drivers::Time limit);
    ~Pager();  ///< kills what still runs
    Pager(const Pager&) = delete;
    Pager& operator=(const Pager&) = delete;

    [[nodiscard]] bool busy() const noexcept { return leader_ > 0; }
    /// Not while it is busy. What went wrong, in words; empty: started.
    [[nodiscard]] std::string start(const std::string& text, drivers::Time now);
    /// What went wrong with a run that is over, in words.
    [[nodiscard]] std::string attend(drivers::Time now);

  private:
    std::string path_;
    drivers::Time limit_;
    pid_t leader_ = -1;
    drivers::Time until_ = 0;
    bool late_ = false;  ///< its time was up
};

/// Both, on a thread each in wall time: the guard waits for neither, and no page waits for a horn
/// that is not reached, or not even found.
class Alarm {
  public:
    /// Throws SettingsError for what libmodbus refuses.
    explicit Alarm(const AlarmSettings& settings);
    ~Alarm();
    Alarm(const Alarm&) = delete;
    Alarm& operator=(const Alarm&) = delete;

    void show(Tune tune);
    /// The pager is run with this at once, unless it still runs for another of that kind. Of what
    /// waits, 16 are kept.
    void page(Tune kind, const std::string& text);
    /// Horn and lamp read back as commanded, or there are none.
    [[nodiscard]] bool confirms() const;

  private:
    void end() noexcept;
    void run_horn();
    void run_pager();
    void sound(drivers::Time now);
    void attend(Tune kind, drivers::Time now);
    [[nodiscard]] Pager* pager(Tune kind) noexcept;
    [[nodiscard]] bool paging() noexcept;

    std::unique_ptr<Coils> coils_;  ///< of the horn's thread, as what follows
    Tune shown_ = Tune::none;
    int bad_reads_ = 0;
    // Of the pagers' thread. One that hangs with a stop does not hold up that the stop is not
    // obeyed.
    std::unique_ptr<Pager> stop_pager_, disobeyed_pager_;

    mutable std::mutex mutex_;  ///< guards what follows; never held while the outside is busy
    std::condition_variable changed_;
    Tune tune_ = Tune::none;
    std::deque<std::pair<Tune, std::string>> waiting_;
    bool confirms_ = true;
    bool quit_ = false;

    std::thread horn_thread_, pager_thread_;
};

/// One line on standard error, and none where it would have to wait for it.
void say(const char* severity, const std::string& text);

}  // namespace vibrig::guard
