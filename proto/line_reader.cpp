#include "proto/line_reader.hpp"

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace vibrig::proto {

LineReader::LineReader(const std::string& path) : file_(std::fopen(path.c_str(), "rb")) {
    if (!file_) throw std::runtime_error(std::string("cannot be opened: ") + std::strerror(errno));
    buffer_.resize(2 * kMaximumLine);
}

bool LineReader::fill() {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    const std::size_t got =
        std::fread(buffer_.data() + end_, 1, buffer_.size() - end_, file_.get());
    if (got == 0 && std::ferror(file_.get()) != 0) {
        throw std::runtime_error(std::string("cannot be read: ") + std::strerror(errno));
    }
    end_ += got;
    bytes_ += got;
    return got > 0;
}

std::string_view LineReader::take(std::size_t length) {
    const std::string_view whole(buffer_.data() + begin_, length);
    if (whole.starts_with("\x1f\x8b"))
        throw std::runtime_error("found a file packed by gzip, expected text in UTF-8");
    const std::size_t carriage = whole.find('\r');
    if (carriage != std::string_view::npos && carriage + 1 < length)
        throw std::runtime_error(
            "found lines that end in a carriage return only, expected LF or CR LF");
    if (length > kMaximumLine) {
        throw std::runtime_error("found a line of more than " + std::to_string(kMaximumLine) +
                                 " bytes, expected a shorter one");
    }
    std::string_view text = whole;
    if (text.find('\0') != std::string_view::npos) {
        throw std::runtime_error("found a NUL byte, expected text in UTF-8");
    }
    if (text.ends_with('\r')) text.remove_suffix(1);
    return text;
}

std::optional<std::string_view> LineReader::next() {
    ++line_;
    std::size_t searched = 0;
    for (;;) {
        const std::string_view ahead(buffer_.data() + begin_, end_ - begin_);
        const std::size_t length = ahead.find('\n', searched);
        if (length != std::string_view::npos) {
            const std::string_view text = take(length);
            begin_ += length + 1;
            return text;
        }
        searched = ahead.size();
        if (searched > kMaximumLine) return take(searched);
        if (fill()) continue;
        if (searched == 0) return std::nullopt;
        const std::string_view text = take(searched);
        begin_ = end_;
        ended_ = false;
        return text;
    }
}

}  // namespace vibrig::proto
