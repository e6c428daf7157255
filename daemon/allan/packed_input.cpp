#include "daemon/allan/packed_input.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace vibrig::tool {

namespace {

constexpr std::size_t kPiece = 1 << 20;
constexpr unsigned char kMagic0 = 0x1f, kMagic1 = 0x8b;

}  // namespace

PackedInput::PackedInput(const std::string& path)
    : file_(path == "-" ? fdopen(dup(STDIN_FILENO), "rb") : std::fopen(path.c_str(), "rb")),
      buffer_(kPiece) {
    if (!file_) throw std::runtime_error(std::strerror(errno));
    fill();
    if (end_ < 2 || buffer_[0] != kMagic0 || buffer_[1] != kMagic1) return;
    auto stream = std::make_unique<z_stream>();
    if (inflateInit2(stream.get(), 16 + MAX_WBITS) != Z_OK)  // 16: gzip
        throw std::runtime_error("not enough memory");
    packed_.reset(stream.release());
}

bool PackedInput::fill() {
    begin_ = 0;
    end_ = std::fread(buffer_.data(), 1, buffer_.size(), file_.get());
    if (std::ferror(file_.get()) != 0) throw std::runtime_error(std::strerror(errno));
    taken_ += end_;
    return end_ > 0;
}

std::size_t PackedInput::read(char* out, std::size_t size) {
    if (packed_) return inflate_some(out, size);
    if (begin_ == end_ && !fill()) return 0;
    const std::size_t count = std::min(size, end_ - begin_);
    std::memcpy(out, buffer_.data() + begin_, count);
    begin_ += count;
    return count;
}

bool PackedInput::begin_member() {
    do {
        while (begin_ < end_ && buffer_[begin_] == 0) ++begin_;  // a tape's last block
    } while (begin_ == end_ && fill());
    if (begin_ == end_) return false;
    if (buffer_[begin_] != kMagic0)
        throw std::runtime_error("found at byte " + std::to_string(taken_ - end_ + begin_) +
                                 " what is no compressed data, expected more of them or the end");
    inflateReset(packed_.get());
    member_ended_ = false;
    return true;
}

std::size_t PackedInput::inflate_some(char* out, std::size_t size) {
    for (;;) {
        if (member_ended_ && !begin_member()) return 0;
        if (begin_ == end_ && !fill()) throw std::runtime_error("compressed data end too early");
        packed_->next_in = buffer_.data() + begin_;
        packed_->avail_in = static_cast<unsigned>(end_ - begin_);
        packed_->next_out = reinterpret_cast<unsigned char*>(out);
        packed_->avail_out = static_cast<unsigned>(size);
        const int code = inflate(packed_.get(), Z_NO_FLUSH);
        begin_ = end_ - packed_->avail_in;
        if (code != Z_OK && code != Z_STREAM_END && code != Z_BUF_ERROR)
            throw std::runtime_error(packed_->msg != nullptr ? packed_->msg : "compressed data");
        member_ended_ = code == Z_STREAM_END;
        if (const std::size_t made = size - packed_->avail_out; made > 0) return made;
    }
}

}  // namespace vibrig::tool
