#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>

#include "proto/recording_csv.hpp"

namespace vibrig::proto {

namespace {

struct Close {
    void operator()(std::FILE* file) const noexcept { (void)std::fclose(file); }
};

template <typename Number>
void append(std::string& text, Number value, char after) {
    std::array<char, 32> digits{};
    const auto [end, error] = std::to_chars(digits.data(), digits.data() + digits.size(), value);
    if (error == std::errc()) text.append(digits.data(), end);
    text += after;
}

}  // namespace

void write_recording(const std::string& path, std::span<const RecordingRow> rows, bool simulated) {
    const auto fail = [&](const char* what) {
        throw RecordingError(path, 0, "", std::string(what) + std::strerror(errno));
    };
    std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "wb"));
    if (!file) fail("cannot be opened for writing: ");
    std::string text = "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g";
    const bool frequency = !rows.empty() && rows.front().frequency_hz >= 0;
    text += std::string(frequency ? ",frequency_hz" : "") + (simulated ? ",simulated\n" : "\n");
    const auto flush = [&] {
        if (std::fwrite(text.data(), 1, text.size(), file.get()) != text.size()) {
            fail("cannot be written: ");
        }
        text.clear();
    };
    constexpr std::size_t kChunk = std::size_t{1} << 16;
    for (const RecordingRow& row : rows) {
        append(text, row.time_s, ',');
        append(text, row.run, ',');
        append(text, row.position, ',');
        for (const double angle : row.angle_deg) append(text, angle, ',');
        append(text, row.force_g[0], ',');
        append(text, row.force_g[1], ',');
        append(text, row.force_g[2], simulated || frequency ? ',' : '\n');
        if (frequency) append(text, row.frequency_hz, simulated ? ',' : '\n');
        if (simulated) text += "1\n";
        if (text.size() > kChunk) flush();
    }
    flush();
    // A full disk shows itself only when the buffer is written out.
    if (std::fclose(file.release()) != 0) fail("cannot be written: ");
}

}  // namespace vibrig::proto
