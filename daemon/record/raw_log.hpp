#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/configuration/record_settings.hpp"
#include "daemon/record/records.hpp"
#include "proto/candump.hpp"

namespace vibrig::record {

/// One closed file of a raw log.
struct Segment {
    std::string file;  ///< name in the folder
    drivers::Time from = 0, to = 0;
    std::uint64_t frames = 0, bytes = 0;
};

/// In a log: the daemon was started again here.
inline constexpr std::string_view kStartLine = "# the daemon was started again";

/// Frames as candump logs them, in segments; both directions (R, T). One thread. A disk that
/// refuses costs the frames that were to go there, and they are counted; nothing throws.
class RawLog {
  public:
    using Closed = std::function<void(const Segment&)>;
    /// `on_progress` is called while a segment is compressed.
    RawLog(std::string folder, std::string interface, const configuration::RecordSettings& settings,
           std::int64_t utc_offset_ns, Closed on_closed, std::function<void()> on_progress = {});
    ~RawLog();

    void add(const FrameRecord& record);
    /// Hands what is buffered to the kernel.
    void flush();
    void close();

    [[nodiscard]] bool good() const noexcept { return good_; }
    [[nodiscard]] const std::string& note() const noexcept { return note_; }
    [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }
    [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }
    [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
    /// What was lost since the last call; false: nothing.
    [[nodiscard]] bool take_gap(Gap& gap);

  private:
    void open();
    void end_segment();
    void refuse(const std::string& why);
    void forget();  ///< what is buffered
    void lose(std::uint64_t frames, drivers::Time from, drivers::Time to);

    std::string folder_;
    configuration::RecordSettings settings_;
    std::int64_t utc_offset_ns_;
    Closed on_closed_;
    std::function<void()> on_progress_;
    proto::LoggedFrame line_;  ///< keeps the interface's name
    int fd_ = -1;
    int number_ = 0;
    bool goes_on_ = false;  ///< from segments of an earlier start
    Segment segment_;
    std::string buffer_;
    std::uint64_t buffered_ = 0;  ///< frames
    drivers::Time buffer_from_ = 0, buffer_to_ = 0;
    std::int64_t retry_steady_ns_ = 0;
    bool good_ = true;
    std::string note_;
    std::uint64_t frames_ = 0, lost_ = 0, bytes_ = 0;
    Gap gap_;
};

/// Compresses a closed file and takes it away; the compressed one appears whole or not at all.
/// Empty: done; else why not, and the file is still there.
/// `on_progress` is called now and then.
[[nodiscard]] std::string compress(const std::string& path,
                                   const std::function<void()>& on_progress = {});

/// True: a compressed file is empty or ends within a frame of zstd. Only the sizes in it are read.
[[nodiscard]] bool is_cut(const std::string& path);

/// A file of a raw log piece by piece, decompressed if it ends in .zst. One that is_cut() is read
/// up to there; who reads it has to say so. Throws std::runtime_error.
class RawReader {
  public:
    explicit RawReader(std::string path);
    ~RawReader();
    RawReader(const RawReader&) = delete;
    RawReader& operator=(const RawReader&) = delete;

    /// Valid until the next call; false at the end.
    [[nodiscard]] bool next(std::string_view& piece);

  private:
    struct Input;
    std::string path_;
    std::unique_ptr<Input> input_;
};
/// Calls `take` with the pieces of a file; false of it ends it. Throws std::runtime_error.
void read_raw(const std::string& path, const std::function<bool(std::string_view)>& take);

}  // namespace vibrig::record
