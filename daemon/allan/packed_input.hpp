#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

namespace vibrig::tool {

/// The bytes of a file, or of standard input ("-"), as they stand or out of gzip, all members of
/// it. zlib's own reader takes whatever follows a member and is none for the end of the file: a
/// record of which a later part is damaged would only be shorter.
class PackedInput {
  public:
    /// Both throw std::runtime_error with the cause; the caller names the file.
    explicit PackedInput(const std::string& path);
    /// Some bytes, at most `size`; 0 at the end.
    [[nodiscard]] std::size_t read(char* out, std::size_t size);
    /// Of the file, taken so far.
    [[nodiscard]] std::size_t taken() const noexcept { return taken_; }

  private:
    struct Close {
        void operator()(std::FILE* file) const { (void)std::fclose(file); }
        void operator()(z_stream* stream) const {
            inflateEnd(stream);
            delete stream;
        }
    };

    bool fill();
    [[nodiscard]] std::size_t inflate_some(char* out, std::size_t size);
    /// What follows the end of a member: another one, or nothing but zeros.
    [[nodiscard]] bool begin_member();

    std::unique_ptr<std::FILE, Close> file_;
    std::unique_ptr<z_stream, Close> packed_;  ///< none: as they stand
    std::vector<unsigned char> buffer_;
    std::size_t begin_ = 0, end_ = 0, taken_ = 0;
    bool member_ended_ = false;
};

}  // namespace vibrig::tool
