#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>

#include "proto/durable_file.hpp"
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

/// As the reader takes a field: in quotes where it would end early.
std::string field_of(const std::string& name) {
    const bool plain = name.find_first_of(",;\t") == std::string::npos && !name.starts_with(' ') &&
                       !name.ends_with(' ');
    return plain ? name : '"' + name + '"';
}

/// What a recording has beside time, dwell, angles and forces.
class Extras {
  public:
    Extras(std::span<const RecordingRow> rows, bool simulated,
           std::span<const std::string> profiles)
        : frequency_(!rows.empty() && rows.front().frequency_hz >= 0),
          role_(std::ranges::any_of(rows, &RecordingRow::held_out)),
          simulated_(simulated) {
        for (const std::string& name : profiles) profiles_.push_back(field_of(name));
    }
    [[nodiscard]] std::string header() const {
        std::string text;
        if (frequency_) text += ",frequency_hz";
        if (!profiles_.empty()) text += ",profile,level_db";
        if (role_) text += ",role";
        if (simulated_) text += ",simulated";
        return text;
    }
    /// Behind the forces, which leave a comma.
    void append_to(std::string& text, const RecordingRow& row) const {
        if (frequency_) append(text, row.frequency_hz, ',');
        if (!profiles_.empty()) {
            text += row.profile > 0 ? profiles_.at(row.profile - 1U) : "0";
            text += ',';
            append(text, row.level_db, ',');
        }
        if (role_) text += row.held_out ? "verify," : "identify,";
        if (simulated_) text += "1,";
        text.back() = '\n';
    }

  private:
    bool frequency_, role_, simulated_;
    std::vector<std::string> profiles_;
};

}  // namespace

void write_recording(const std::string& path, std::span<const RecordingRow> rows, bool simulated,
                     std::span<const std::string> profiles) {
    const auto fail = [&](const char* what) {
        throw RecordingError(path, 0, "", std::string(what) + std::strerror(errno));
    };
    std::optional<OutputFile> whole;
    try {
        whole.emplace(path);
    } catch (const std::runtime_error& error) {  // "PATH: ..."
        throw RecordingError(path, 0, "", std::string(error.what()).substr(path.size() + 2));
    }
    OutputFile& out = *whole;
    std::unique_ptr<std::FILE, Close> file(std::fopen(out.place().c_str(), "wb"));
    if (!file) fail("cannot be opened for writing: ");
    const Extras extras(rows, simulated, profiles);
    std::string text =
        "time_s,run,position,alpha_deg,beta_deg,gamma_deg,ax_g,ay_g,az_g" + extras.header() + "\n";
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
        for (const double force : row.force_g) append(text, force, ',');
        extras.append_to(text, row);
        if (text.size() > kChunk) flush();
    }
    flush();
    // A full disk shows itself only when the buffer is written out.
    if (std::fclose(file.release()) != 0) fail("cannot be written: ");
    out.finish();
}

}  // namespace vibrig::proto
