#include "daemon/journal/checkpoint.hpp"

#include <spdlog/fmt/fmt.h>
#include <zlib.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "daemon/dwells/dwell_book.hpp"

namespace vibrig::journal {

namespace {

static_assert(std::endian::native == std::endian::little, "the format is little endian");

constexpr std::string_view kMagic = "VIBRIGCK";
constexpr std::size_t kChecksum = 4;
constexpr std::size_t kMeasurement = 7 * sizeof(double) + 1;
constexpr std::uint64_t kMostMeasurements = 100'000'000;

std::uint32_t checksum(std::string_view bytes) {
    return static_cast<std::uint32_t>(::crc32_z(
        ::crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

template <typename T>
void put(std::string& to, const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    to.append(reinterpret_cast<const char*>(&value), sizeof value);
}

class Reader {
  public:
    explicit Reader(std::string_view bytes) : bytes_(bytes) {}
    template <typename T>
    void get(T& value) {
        if (bytes_.size() < sizeof value) {
            good_ = false;
            return;
        }
        std::memcpy(&value, bytes_.data(), sizeof value);
        bytes_.remove_prefix(sizeof value);
    }
    [[nodiscard]] std::size_t left() const { return bytes_.size(); }
    [[nodiscard]] bool good() const { return good_; }

  private:
    std::string_view bytes_;
    bool good_ = true;
};

/// One list of the summary's numbers, for both directions.
void each_number(auto& s, auto&& each) {
    each(s.run);
    each(s.position);
    each(s.samples);
    each(s.used);
    each(s.rejected);
    each(s.reinitialised);
    each(s.kappa);
    each(s.amplitude_g);
    each(s.frequency_hz);
    each(s.mean_force_g);
    each(s.nis_per_dof);
    each(s.innovation_correlation);
}

void each_level(auto& levels, auto&& each) {
    each(levels.angle_arcsec);
    for (auto& walk : levels.gyro_random_walk_deg_per_rt_h) each(walk);
}

void each_part(auto& stop, auto&& each) {
    for (auto& angle : stop.position_deg) each(angle);
    each(stop.table_g);
    each(stop.repeats);
    each(stop.used_s);
}

void each_of_sweep(auto& sweep, auto&& each) {
    each(sweep.from_hz);
    each(sweep.to_hz);
    each(sweep.seconds);
}

void each_of_random(auto& random, auto&& each) {
    each(random.mean_square_g2);
    each(random.bandwidth_hz);
    each(random.gain_error);
    each(random.highest_hz);
    each(random.profile);
    each(random.level_db);
}

std::string bytes_of(const estimator::NoiseLevels& levels) {
    std::string bytes;
    each_level(levels, [&bytes](double value) { put(bytes, value); });
    return bytes;
}

/// No filter ever took others; a walk of 0 can be configured.
bool possible(const estimator::NoiseLevels& levels) {
    bool good = levels.angle_arcsec > 0;
    each_level(levels,
               [&good](double value) { good = good && std::isfinite(value) && value >= 0; });
    return good;
}

std::string words(const estimator::NoiseLevels& levels) {
    const auto& walk = levels.gyro_random_walk_deg_per_rt_h;
    return fmt::format("{:g} arcsec, N {:g}, {:g}, {:g} deg/sqrt(h)", levels.angle_arcsec, walk[0],
                       walk[1], walk[2]);
}

// One byte in the file; what an earlier program wrote as kFlagged may have been left out as well.
enum Flag : char { kClean = 0, kFlagged = 1, kFollowed = 2, kLeftOut = 3 };

Flag flag_of(const estimator::DwellSummary& summary) {
    if (!summary.flagged) return kClean;
    if (summary.left_out) return kLeftOut;
    return summary.followed ? kFollowed : kFlagged;
}

std::string numbers_of(const estimator::DwellSummary& summary) {
    std::string bytes;
    each_number(summary, [&bytes](const auto& value) { put(bytes, value); });
    bytes.push_back(flag_of(summary));
    return bytes;
}

void each_of_played(auto& played, auto&& each) {
    each_of_random(played.random, each);
    each(played.seen.share);
    each(played.seen.error);
    each(played.place);
}

void put_played(std::string& bytes, const DwellCheckpoint& dwell) {
    const auto& played = dwell.info.played;
    bytes.push_back(static_cast<char>(played ? 1 + static_cast<int>(played->word) : 0));
    if (!played) return;
    each_of_played(*played, [&bytes](auto value) { put(bytes, value); });
    put(bytes, static_cast<std::uint32_t>(dwell.stop.psd.size()));
    for (const auto& line : dwell.stop.psd)
        for (const double value : line) put(bytes, value);
}

/// What a controller lies may be any number; what was taken may not.
std::string read_played(Reader& reader, DwellCheckpoint& dwell) {
    char known = 0;
    reader.get(known);
    if (known == 0 || !reader.good()) return {};
    if (known < 1 || known > 3) return "corrupt: what was played";
    auto& played = dwell.info.played.emplace();
    played.word = static_cast<estimator::PlayedRandom::Word>(known - 1);
    each_of_played(played, [&reader](auto& value) { reader.get(value); });
    bool good = played.seen.share > 0;
    each_of_played(
        played, [&good](auto value) { good = good && std::isfinite(static_cast<double>(value)); });
    std::uint32_t lines = 0;
    reader.get(lines);
    if (reader.good() && (!good || lines > reader.left() / (2 * sizeof(double))))
        return "corrupt: what was played";
    dwell.stop.psd.resize(reader.good() ? lines : 0);
    for (auto& line : dwell.stop.psd)
        for (double& value : line) reader.get(value);
    return {};
}

std::string no_sweep(DwellCheckpoint& dwell) {
    dwell.info.sweep = {};
    dwell.stop.swept_hz.clear();
    return {};
}

std::string read_sweep(Reader& reader, DwellCheckpoint& dwell) {
    each_of_sweep(dwell.info.sweep, [&reader](double& value) { reader.get(value); });
    bool good = true;
    each_of_sweep(dwell.info.sweep,
                  [&good](double value) { good = good && std::isfinite(value) && value >= 0; });
    std::uint32_t readings = 0;
    reader.get(readings);
    if (reader.good() && (!good || readings > reader.left() / (2 * sizeof(double))))
        return "corrupt: sweep";
    dwell.stop.swept_hz.resize(reader.good() ? readings : 0);
    for (auto& reading : dwell.stop.swept_hz) {
        for (double& value : reading) {
            reader.get(value);
            good = good && std::isfinite(value);
        }
        good = good && reading[1] > 0;
    }
    dwell.stop.sweep_from_hz = dwell.info.sweep.from_hz;
    dwell.stop.sweep_to_hz = dwell.info.sweep.to_hz;
    return good ? "" : "corrupt: sweep";
}

}  // namespace

// FNV-1a, 64 bits.
std::uint64_t configuration_hash(std::string_view text) noexcept {
    std::uint64_t hash = 0xcbf29ce484222325;
    for (const char c : text) {
        hash ^= static_cast<unsigned char>(c);
        hash *= 0x100000001b3;
    }
    return hash;
}

std::string encode(const DwellCheckpoint& dwell, std::uint64_t configuration_hash) {
    std::string bytes(kMagic);
    put(bytes, kCheckpointVersion);
    put(bytes, configuration_hash);
    put(bytes, dwell.info.run);
    put(bytes, dwell.info.position);
    put(bytes, dwell.info.table_g);
    bytes += numbers_of(dwell.summary);
    bytes += bytes_of(dwell.summary.noise);
    each_part(dwell.stop, [&bytes](auto value) { put(bytes, value); });
    put(bytes, dwell.stop.begin_s);
    put(bytes, dwell.stop.begun_utc_ns);
    bytes.push_back(dwell.info.power_lost ? 1 : 0);
    put(bytes, dwell.info.frequency_hz);
    bytes.push_back(dwell.info.held_out ? 1 : 0);
    each_of_random(dwell.info.random, [&bytes](auto value) { put(bytes, value); });
    each_of_sweep(dwell.info.sweep, [&bytes](auto value) { put(bytes, value); });
    put(bytes, static_cast<std::uint32_t>(dwell.stop.swept_hz.size()));
    for (const auto& reading : dwell.stop.swept_hz)
        for (const double value : reading) put(bytes, value);
    put_played(bytes, dwell);
    put(bytes, static_cast<std::uint64_t>(dwell.measurements.size()));
    bytes.reserve(bytes.size() + dwell.measurements.size() * kMeasurement + kChecksum);
    for (const auto& m : dwell.measurements) {
        put(bytes, m.time_s);
        for (const double angle : m.angle_rad) put(bytes, angle);
        for (const double force : m.force_g) put(bytes, force);
        bytes.push_back(static_cast<char>((m.angles_good ? 1 : 0) | (m.force_good ? 2 : 0)));
    }
    put(bytes, checksum(bytes));
    return bytes;
}

std::string decode(std::string_view bytes, std::uint64_t configuration_hash,
                   DwellCheckpoint& dwell) {
    if (bytes.size() < kMagic.size() + sizeof kCheckpointVersion + kChecksum)
        return fmt::format("truncated: {} bytes", bytes.size());
    if (bytes.substr(0, kMagic.size()) != kMagic) return "not a checkpoint of this program";
    Reader reader(bytes.substr(kMagic.size(), bytes.size() - kMagic.size() - kChecksum));
    std::uint32_t version = 0;
    reader.get(version);
    // Before the checksum, which another version may keep elsewhere.
    if (version > kCheckpointVersion)
        return fmt::format("version {}, newer than {}", version, kCheckpointVersion);
    std::uint32_t expected = 0;
    std::memcpy(&expected, bytes.data() + bytes.size() - kChecksum, kChecksum);
    if (checksum(bytes.substr(0, bytes.size() - kChecksum)) != expected)
        return "corrupt: the checksum does not match";
    std::uint64_t hash = 0;
    reader.get(hash);
    if (hash != configuration_hash) return "of another configuration";
    reader.get(dwell.info.run);
    reader.get(dwell.info.position);
    reader.get(dwell.info.table_g);
    dwell.summary = {};
    each_number(dwell.summary, [&reader](auto& value) { reader.get(value); });
    char flagged = 0;
    reader.get(flagged);
    dwell.summary.flagged = flagged != kClean;
    dwell.summary.followed = flagged == kFollowed;
    dwell.summary.left_out = flagged == kLeftOut;
    dwell.noise_known = version >= 2;
    if (dwell.noise_known) {
        each_level(dwell.summary.noise, [&reader](double& value) { reader.get(value); });
        if (reader.good() && !possible(dwell.summary.noise))
            return "corrupt: noise levels " + words(dwell.summary.noise);
    }
    dwell.stop_known = version >= 3;
    if (dwell.stop_known) {
        each_part(dwell.stop, [&reader](auto& value) { reader.get(value); });
        bool good = dwell.stop.repeats >= 0 && dwell.stop.used_s >= 0;
        each_part(dwell.stop, [&good](auto value) { good = good && std::isfinite(value); });
        if (reader.good() && !good) return "corrupt: position, repeats or time used";
    }
    dwell.time_known = version >= 4;
    if (dwell.time_known) {
        reader.get(dwell.stop.begin_s);
        reader.get(dwell.stop.begun_utc_ns);
        if (reader.good() && dwell.stop.begin_s < 0) return "corrupt: time of the beginning";
    }
    dwell.info.begin_s = dwell.stop.begin_s;
    char power_lost = 0;
    if (version >= 5) reader.get(power_lost);
    dwell.info.power_lost = power_lost != 0;
    dwell.info.frequency_hz = 0;
    char held_out = 0;
    if (version >= 6) {
        reader.get(dwell.info.frequency_hz);
        reader.get(held_out);
        if (reader.good() && !(dwell.info.frequency_hz >= 0)) return "corrupt: frequency";
    }
    dwell.info.held_out = held_out != 0;
    auto& random = dwell.info.random = {};
    if (version >= 7) {
        each_of_random(random, [&reader](auto& value) { reader.get(value); });
        bool good = random.mean_square_g2 >= 0 && random.bandwidth_hz >= 0;
        each_of_random(random, [&good](auto value) {
            good = good && std::isfinite(static_cast<double>(value));
        });
        if (reader.good() && !good) return "corrupt: random vibration";
    }
    dwell.stop.profile = random.profile;
    dwell.stop.frequency_hz = dwell.info.frequency_hz;
    dwell.stop.held_out = dwell.info.held_out;
    if (const std::string why = version >= 8 ? read_sweep(reader, dwell) : no_sweep(dwell);
        !why.empty())
        return why;
    dwell.info.played.reset();
    dwell.stop.psd.clear();
    if (const std::string why = version >= 9 ? read_played(reader, dwell) : ""; !why.empty())
        return why;
    std::uint64_t count = 0;
    reader.get(count);
    if (!reader.good() || count > kMostMeasurements || count * kMeasurement != reader.left())
        return fmt::format("corrupt: {} measurements in {} bytes", count, reader.left());
    dwell.measurements.resize(count);
    for (auto& m : dwell.measurements) {
        reader.get(m.time_s);
        for (double& angle : m.angle_rad) reader.get(angle);
        for (double& force : m.force_g) reader.get(force);
        char good = 0;
        reader.get(good);
        m.angles_good = (good & 1) != 0;
        m.force_good = (good & 2) != 0;
    }
    return {};
}

std::string replay(std::vector<DwellCheckpoint>& dwells, dwells::DwellBook& book,
                   drivers::Time dwell_length) {
    for (auto& dwell : dwells) {
        const auto& noise = book.identification().noise();
        const std::string where =
            fmt::format("run {} position {}", dwell.info.run, dwell.info.position);
        if (dwell.noise_known && bytes_of(noise) != bytes_of(dwell.summary.noise)) {
            return fmt::format("{} was filtered with {}, found {} again", where,
                               words(dwell.summary.noise), words(noise));
        }
        const auto summary =
            book.take_again({dwell.info, dwell_length, dwell.measurements, dwell.stop.swept_hz});
        // An earlier program kept left out as flagged; what is left out has no sample in use.
        if (dwell.summary.flagged) dwell.summary.left_out = summary.left_out;
        if (numbers_of(summary) != numbers_of(dwell.summary))
            return where + " does not come out as it did";
        dwell.summary = summary;
    }
    return {};
}

}  // namespace vibrig::journal
