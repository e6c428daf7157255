#include "daemon/record/raw_log.hpp"

#include <fcntl.h>
#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "daemon/record/disk.hpp"
#include "drivers/base/clock.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

constexpr std::size_t kBuffer = 65'536;
constexpr int kLevel = 3;  // of zstd: fast, and logs shrink to a fifth

using StdFile = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

}  // namespace

RawLog::RawLog(std::string folder, std::string interface,
               const configuration::RecordSettings& settings, std::int64_t utc_offset_ns,
               Closed on_closed, std::function<void()> on_progress)
    : folder_(std::move(folder)),
      settings_(settings),
      utc_offset_ns_(utc_offset_ns),
      on_closed_(std::move(on_closed)),
      on_progress_(std::move(on_progress)) {
    line_.interface = std::move(interface);
    // A campaign that goes on after a restart: its earlier segments stay.
    std::error_code unknown;
    for (const auto& entry : std::filesystem::directory_iterator(folder_, unknown)) {
        int number = 0;
        const std::string name = entry.path().filename().string();
        if (std::sscanf(name.c_str(), "raw-%d.log", &number) == 1)
            number_ = std::max(number_, number);
    }
    goes_on_ = number_ > 0;
    buffer_.reserve(kBuffer + 256);
}

RawLog::~RawLog() { close(); }

void RawLog::add(const FrameRecord& record) {
    if (record.dropped_before > 0) {
        buffer_ += fmt::format("# {} frames lost in the recorder's ring\n", record.dropped_before);
        lose(record.dropped_before, record.time, record.time);
        gap_.reason = "ring full";
    }
    line_.time_ns = record.time + utc_offset_ns_;
    line_.extended = (record.frame.can_id & CAN_EFF_FLAG) != 0;
    line_.remote = (record.frame.can_id & CAN_RTR_FLAG) != 0;
    line_.error = (record.frame.can_id & CAN_ERR_FLAG) != 0;
    line_.id = record.frame.can_id & (line_.extended || line_.error ? CAN_EFF_MASK : CAN_SFF_MASK);
    line_.fd = record.fd;
    line_.fd_flags =
        record.fd ? static_cast<std::uint8_t>(record.frame.flags & 3) : std::uint8_t{0};
    line_.size = std::min<std::uint8_t>(record.frame.len, 64);
    std::copy_n(record.frame.data, line_.size, line_.data.begin());
    std::string text;
    try {
        text = proto::candump_line(line_);
    } catch (const proto::CandumpError&) {
        return lose(1, record.time, record.time);
    }
    if (buffered_ == 0) buffer_from_ = record.time;
    buffer_ += text;
    buffer_ += record.sent ? " T\n" : " R\n";
    buffer_to_ = record.time;
    ++buffered_;
    if (buffer_.size() >= kBuffer) flush();
}

void RawLog::lose(std::uint64_t frames, Time from, Time to) {
    lost_ += frames;
    if (gap_.lost == 0) gap_.from = from;
    gap_.to = to;
    gap_.lost += frames;
}

bool RawLog::take_gap(Gap& gap) {
    if (gap_.lost == 0 || !good_) return false;
    gap = gap_;
    gap.stream = "frames";
    gap_ = {};
    return true;
}

void RawLog::refuse(const std::string& why) {
    good_ = false;
    note_ = why;
    retry_steady_ns_ = drivers::steady_now() + kRetryNs;
    forget();
}

void RawLog::forget() {
    gap_.reason = note_;
    lose(buffered_, buffer_from_, buffer_to_);
    buffer_.clear();
    buffered_ = 0;
}

void RawLog::open() {
    if (const std::string why = lack_of_room(folder_, settings_.keep_free_mb); !why.empty())
        return refuse(why);
    segment_ = {};
    segment_.file = fmt::format("raw-{:04d}.log", ++number_);
    segment_.from = buffer_from_;
    const std::string path = folder_ + "/" + segment_.file;
    fd_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_APPEND | O_CLOEXEC, 0644);
    if (fd_ < 0) {
        const int error = errno;
        if (error != EEXIST) --number_;  // a hole in the numbers is a segment that is missing
        return refuse(path + ": " + std::strerror(error));
    }
    if (std::exchange(goes_on_, false)) buffer_.insert(0, std::string(kStartLine) + "\n");
}

void RawLog::flush() {
    if (buffer_.empty()) return;
    if (fd_ < 0) {
        if (!good_ && drivers::steady_now() < retry_steady_ns_) return forget();
        open();
        if (fd_ < 0) return;
    }
    std::size_t done = 0;
    while (done < buffer_.size()) {
        const ssize_t n = ::write(fd_, buffer_.data() + done, buffer_.size() - done);
        if (n < 0 && errno == EINTR) continue;
        if (n <= 0) {
            const int error = errno;
            // No half line: the next segment begins where this one ends.
            const bool whole = ::ftruncate(fd_, static_cast<off_t>(segment_.bytes)) == 0;
            const std::string file = segment_.file;
            end_segment();
            return refuse(folder_ + "/" + file + ": " + std::strerror(error) +
                          (whole ? "" : "; its last line is cut off"));
        }
        done += static_cast<std::size_t>(n);
    }
    good_ = true;
    note_.clear();
    frames_ += buffered_;
    bytes_ += buffer_.size();
    segment_.frames += buffered_;
    segment_.bytes += buffer_.size();
    segment_.to = buffer_to_;
    buffer_.clear();
    buffered_ = 0;
    if (static_cast<double>(segment_.bytes) >= settings_.segment_mb * 1e6 ||
        drivers::to_seconds(segment_.to - segment_.from) >= settings_.segment_s)
        end_segment();
}

void RawLog::end_segment() {
    if (fd_ < 0) return;
    ::fdatasync(fd_);
    ::close(fd_);
    fd_ = -1;
    if (settings_.zstd) {
        const std::string why = compress(folder_ + "/" + segment_.file, on_progress_);
        if (why.empty()) {
            segment_.file += ".zst";
        } else {
            note_ = why;
        }
    }
    if (on_closed_) on_closed_(segment_);
}

void RawLog::close() {
    flush();
    end_segment();
}

std::string compress(const std::string& path, const std::function<void()>& on_progress) {
    const std::string to = path + ".zst";
    const std::string part = to + ".part";
    const StdFile in(std::fopen(path.c_str(), "rb"), std::fclose);
    StdFile out(std::fopen(part.c_str(), "wb"), std::fclose);
    if (!in || !out) return part + ": " + std::strerror(errno);
    const std::unique_ptr<ZSTD_CCtx, size_t (*)(ZSTD_CCtx*)> context(ZSTD_createCCtx(),
                                                                     ZSTD_freeCCtx);
    ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kLevel);
    ZSTD_CCtx_setParameter(context.get(), ZSTD_c_checksumFlag, 1);
    std::vector<char> from(ZSTD_CStreamInSize()), to_buffer(ZSTD_CStreamOutSize());
    const auto failed = [&](const std::string& why) {
        out.reset();
        ::unlink(part.c_str());
        return part + ": " + why;
    };
    for (bool last = false; !last;) {
        const std::size_t n = std::fread(from.data(), 1, from.size(), in.get());
        if (std::ferror(in.get()) != 0) return failed(std::strerror(errno));
        last = n < from.size();
        if (on_progress) on_progress();
        ZSTD_inBuffer input{from.data(), n, 0};
        for (bool done = false; !done;) {
            ZSTD_outBuffer output{to_buffer.data(), to_buffer.size(), 0};
            const std::size_t left = ZSTD_compressStream2(context.get(), &output, &input,
                                                          last ? ZSTD_e_end : ZSTD_e_continue);
            if (ZSTD_isError(left) != 0) return failed(ZSTD_getErrorName(left));
            if (std::fwrite(to_buffer.data(), 1, output.pos, out.get()) != output.pos)
                return failed(std::strerror(errno));
            done = last ? left == 0 : input.pos == input.size;
        }
    }
    if (std::fflush(out.get()) != 0 || ::fdatasync(::fileno(out.get())) != 0)
        return failed(std::strerror(errno));
    out.reset();
    if (std::rename(part.c_str(), to.c_str()) != 0) return failed(std::strerror(errno));
    ::unlink(path.c_str());
    return {};
}

bool is_cut(const std::string& path) {
    std::error_code error;
    const std::size_t size = std::filesystem::file_size(path, error);
    if (error || size == 0) return !error;
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    void* const bytes = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
    if (file >= 0) ::close(file);
    if (bytes == MAP_FAILED) return false;  // whoever reads it says why not
    std::size_t at = 0;
    while (at < size) {
        const std::size_t frame =
            ZSTD_findFrameCompressedSize(static_cast<const char*>(bytes) + at, size - at);
        if (ZSTD_isError(frame) != 0) break;
        at += frame;
    }
    ::munmap(bytes, size);
    return at != size;
}

struct RawReader::Input {
    StdFile file{nullptr, std::fclose};
    bool packed = false;
    std::unique_ptr<ZSTD_DCtx, size_t (*)(ZSTD_DCtx*)> context{ZSTD_createDCtx(), ZSTD_freeDCtx};
    std::vector<char> from = std::vector<char>(ZSTD_DStreamInSize());
    std::vector<char> to = std::vector<char>(ZSTD_DStreamOutSize());
    ZSTD_inBuffer there{nullptr, 0, 0};
};

RawReader::RawReader(std::string path) : path_(std::move(path)), input_(std::make_unique<Input>()) {
    input_->file.reset(std::fopen(path_.c_str(), "rb"));
    if (!input_->file) throw std::runtime_error(path_ + ": " + std::strerror(errno));
    input_->packed = path_.ends_with(".zst");
}
RawReader::~RawReader() = default;

bool RawReader::next(std::string_view& piece) {
    Input& in = *input_;
    for (;;) {
        while (in.packed && in.there.pos < in.there.size) {
            ZSTD_outBuffer output{in.to.data(), in.to.size(), 0};
            const std::size_t left = ZSTD_decompressStream(in.context.get(), &output, &in.there);
            if (ZSTD_isError(left) != 0)
                throw std::runtime_error(path_ + ": " + ZSTD_getErrorName(left));
            piece = {in.to.data(), output.pos};
            if (output.pos > 0) return true;
        }
        const std::size_t n = std::fread(in.from.data(), 1, in.from.size(), in.file.get());
        if (std::ferror(in.file.get()) != 0)
            throw std::runtime_error(path_ + ": " + std::strerror(errno));
        if (n == 0) return false;
        in.there = {in.from.data(), n, 0};
        piece = {in.from.data(), n};
        if (!in.packed) return true;
    }
}

void read_raw(const std::string& path, const std::function<bool(std::string_view)>& take) {
    RawReader reader(path);
    for (std::string_view piece; reader.next(piece);) {
        if (!take(piece)) return;
    }
}

}  // namespace vibrig::record
