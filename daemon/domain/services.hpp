#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace vibrig {

struct JournalStatus {
    std::string path;                                   ///< empty: no journal is kept
    bool running = false;                               ///< false: the disk refuses; entries wait
    std::string note;                                   ///< what the disk says
    std::uint64_t taken = 0, written = 0, dropped = 0;  ///< entries; taken = written + waiting
    std::string public_key;                             ///< its head is signed with, Ed25519, hex
    std::string head;        ///< the newest entry of its chain, signed: journal::SignedHead::line
    std::string proof_head;  ///< likewise the newest safe-state proof's entry; empty: none
    std::uint64_t entries = 0;  ///< of the chain
    bool verified = false;      ///< it is what was written into it, as looked at since the start
    double verified_part = 0;   ///< so much of it
    std::string not_watched;    ///< why it cannot be looked at just now; empty: it can
    std::uint64_t waiting = 0;  ///< entries that the disk does not have
};

/// Recording of the present campaign, or of the last one.
struct RecorderStatus {
    std::string folder;      ///< empty: nothing is recorded
    std::string file;        ///< the campaign's HDF5 file
    bool recording = false;  ///< a campaign is being recorded
    bool good = false;       ///< false: the disk refuses; what comes is lost and counted
    std::string note;        ///< what the disk says
    std::uint64_t samples = 0, samples_lost = 0;  ///< written; not written
    std::uint64_t frames = 0, frames_lost = 0;    ///< of the raw log
    std::uint64_t raw_bytes = 0, segments = 0, gaps = 0;
    std::uint64_t samples_dropped = 0, frames_dropped = 0;  ///< by full rings, since the start
    std::uint64_t entries_dropped = 0;
};

/// The process that watches the daemon from outside.
struct GuardStatus {
    std::string socket;  ///< empty: none is configured
    bool heard = false;  ///< a word came within its deadline
    std::string note;    ///< why not; while it is heard: that it is of another version
    // Of what follows nothing is known while it is not heard.
    std::string cause;  ///< what it found, "none" without
    std::string text;   ///< in words
    bool disobeyed = false, sees = false, rest = false, reaches_shaker = false,
         horn_confirms = false;
    double table_g = 0;  ///< peak at the table, by its own measurement
    std::string version;
};

/// The broker that watches a fleet of rigs.
struct MqttStatus {
    std::string broker;  ///< "broker.lab:8883"; empty: off
    bool connected = false;
    std::string note;  ///< why it is not
    std::uint64_t connections = 0, births = 0, messages = 0;
    std::uint64_t left_out = 0;  ///< times the broker was too slow to take an update
};

/// Campaigns on their way to the archive; nothing is lost of what waits.
struct ArchiveStatus {
    std::string folder;                            ///< empty: nothing is archived
    bool good = false;                             ///< the newest attempt was one
    std::string note;                              ///< why not
    std::string delivering;                        ///< the campaign that is on its way; empty: none
    std::uint64_t waiting = 0, waiting_bytes = 0;  ///< over and not delivered
    std::uint64_t delivered = 0, failures = 0;     ///< attempts since the start
    std::uint64_t removed = 0;                     ///< here, delivered and beyond archive.keep_mb
    std::uint64_t refused = 0;                     ///< by the archive: put aside, not waiting
    std::string refused_note;                      ///< the first of them, and why
};

/// Lines of the log on their way to stderr or the file; taken = written + dropped + waiting.
struct LogStatus {
    std::uint64_t taken = 0, written = 0, dropped = 0, waiting = 0;
    bool blocked = false;  ///< whoever reads it does not
};

/// A certificate whose end somebody has to see coming.
struct CertificateStatus {
    std::string whose;         ///< "server", "authority", or who is connected with it
    std::int64_t expires = 0;  ///< s, UTC
    bool own = false;          ///< the rig's: without it nobody gets in from outside
};

/// The ways in, and what ends with a date.
struct ServerStatus {
    struct Door {
        std::string name;     ///< control, status, page, remote
        std::string address;  ///< a path, or "https://0.0.0.0:8443/"
        bool open = true;
        std::string note;             ///< why it is not
        std::uint64_t made_anew = 0;  ///< times its socket was gone
    };
    std::vector<Door> doors;
    std::vector<CertificateStatus> certificates;
};

/// What the threads that a sample passes have of real time.
struct RealTimeStatus {
    struct Thread {
        std::string name;
        int fifo_priority = 0;                             ///< SCHED_FIFO; 0: ordinary scheduling
        std::string cpus;                                  ///< it may run on
        std::uint64_t major_faults = 0, minor_faults = 0;  ///< since it was set up
        std::uint64_t deadline_misses = 0;
        double longest_ms = 0;  ///< of what the deadline is for
    };
    std::vector<Thread> threads;
    bool memory_locked = false;
    double deadline_ms = 0;            ///< a sample period; 0: the rig owns the time, no deadline
    std::vector<std::string> missing;  ///< what could not be had, each with its cause
};

struct RingCounters {
    std::uint64_t pushed = 0, popped = 0, dropped = 0;
};

}  // namespace vibrig
