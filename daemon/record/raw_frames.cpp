#include "daemon/record/raw_frames.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "daemon/record/in_order.hpp"
#include "daemon/record/raw_log.hpp"
#include "proto/candump.hpp"

namespace vibrig::record {

namespace raw {

constexpr std::size_t kText = 1 << 18, kLongestLine = 4096;
constexpr unsigned kMostThreads = 8;

/// Whole lines of one log.
struct Text {
    std::size_t log = 0, lines_before = 0;
    std::string bytes;
};

struct Frames {
    std::vector<RawFrame> frames;
    std::string wrong;  ///< behind them; empty: nothing
};

/// Text of the logs, one after the other.
class Texts {
  public:
    explicit Texts(const std::vector<std::string>& logs) : logs_(logs) {}

    std::optional<Text> take() {
        for (; log_ < logs_.size(); ++log_) {
            if (!reader_) {
                reader_.emplace(logs_[log_]);
                lines_ = 0;
                rest_.clear();
            }
            while (rest_.size() < kText) {
                std::string_view piece;
                if (!reader_->next(piece)) {
                    reader_.reset();
                    break;
                }
                rest_ += piece;
            }
            if (auto text = whole_lines()) {
                if (!reader_) ++log_;
                return text;
            }
        }
        return std::nullopt;
    }

  private:
    std::optional<Text> whole_lines() {
        const std::size_t end = rest_.rfind('\n') + 1;  // npos + 1 is 0
        Text text{log_, lines_, rest_.substr(0, end)};
        lines_ += static_cast<std::size_t>(std::ranges::count(text.bytes, '\n'));
        rest_.erase(0, end);
        if (reader_ && rest_.size() > kLongestLine)
            throw std::runtime_error(fmt::format("{}:{}: found no end of the line, expected one",
                                                 logs_[log_], lines_ + 1));
        return end > 0 ? std::optional(std::move(text)) : std::nullopt;
    }

    const std::vector<std::string>& logs_;
    std::optional<RawReader> reader_;
    std::size_t log_ = 0, lines_ = 0;
    std::string rest_;
};

inline std::optional<drivers::ReceivedFrame> received(std::string_view text,
                                                      std::int64_t utc_offset_ns) {
    const proto::LoggedFrame logged = proto::parse_candump_line(text);
    if (text.ends_with(" T") || logged.error) return std::nullopt;
    drivers::ReceivedFrame frame;
    frame.time = logged.time_ns - utc_offset_ns;
    frame.frame.can_id =
        logged.id | (logged.extended ? CAN_EFF_FLAG : 0U) | (logged.remote ? CAN_RTR_FLAG : 0U);
    frame.frame.len = logged.size;
    frame.fd = logged.fd;
    std::copy_n(logged.data.begin(), logged.size, frame.frame.data);
    return frame;
}

inline Frames frames_of(const Text& text, std::int64_t utc_offset_ns) {
    Frames out;
    std::string_view rest = text.bytes;
    for (std::size_t line = text.lines_before + 1; !rest.empty(); ++line) {
        const std::size_t end = rest.find('\n');
        const std::string_view one = rest.substr(0, end);
        rest.remove_prefix(end + 1);
        if (one == kStartLine) out.frames.push_back({{}, true, text.log, line});
        if (one.empty() || one.front() == '#') continue;
        try {
            if (const auto frame = received(one, utc_offset_ns))
                out.frames.push_back({*frame, false, text.log, line});
        } catch (const proto::CandumpError& error) {
            out.wrong = fmt::format("{}: {}", line, error.what());
            return out;
        }
    }
    return out;
}

}  // namespace raw

struct RawFrames::Ahead {
    Ahead(const std::vector<std::string>& logs, std::int64_t utc_offset_ns)
        : texts(logs),
          frames([this] { return texts.take(); },
                 [utc_offset_ns](const raw::Text& text) {
                     return std::pair(text.log, raw::frames_of(text, utc_offset_ns));
                 },
                 // The reader of the frames has work of its own.
                 std::clamp(std::thread::hardware_concurrency(), 2U, raw::kMostThreads + 1) - 1) {}

    raw::Texts texts;
    std::pair<std::size_t, raw::Frames> now;
    std::size_t at = 0;
    InOrder<raw::Text, std::pair<std::size_t, raw::Frames>> frames;
};

RawFrames::RawFrames(std::vector<std::string> logs, std::int64_t utc_offset_ns)
    : logs_(std::move(logs)), ahead_(std::make_unique<Ahead>(logs_, utc_offset_ns)) {}
RawFrames::~RawFrames() = default;

const RawFrame* RawFrames::next() {
    Ahead& a = *ahead_;
    while (a.at == a.now.second.frames.size()) {
        if (!a.now.second.wrong.empty())
            throw std::runtime_error(logs_[a.now.first] + ":" + a.now.second.wrong);
        auto more = a.frames.next();
        if (!more) return nullptr;
        a.now = std::move(*more);
        a.at = 0;
    }
    return &a.now.second.frames[a.at++];
}

}  // namespace vibrig::record
