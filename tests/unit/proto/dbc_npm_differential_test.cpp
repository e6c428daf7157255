// Random messages, decoded by Vibrig and by candied, a DBC decoder of other authors in another
// language. Environment: VIBRIG_NPM_DIR, a folder where `npm ci` ran; VIBRIG_SEED, to repeat a run.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "proto/dbc.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::proto {
namespace {

namespace fs = std::filesystem;

struct Frame {
    std::uint32_t id = 0;
    std::vector<std::uint8_t> payload;
};

std::string from_environment(const char* name, const std::string& otherwise) {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0' ? value : otherwise;
}

/// The DBC's number of a bit counted from the left of the payload: bit 0 is the right one of byte
/// 0.
unsigned sawtooth(unsigned from_left) { return from_left / 8 * 8 + 7 - from_left % 8; }

/// Writes one random database twice: as the format says, and with the start bits of big-endian
/// signals where candied looks for them.
class RandomDatabase {
  public:
    explicit RandomDatabase(std::uint64_t seed) : random_(seed) {
        both("VERSION \"\"\n\nBS_:\n\nBU_: Node\n\n");
        for (int i = 0; i < 300; ++i) message(i);
        both(tail_.str());
    }
    [[nodiscard]] std::string text() const { return ours_.str(); }
    [[nodiscard]] std::string text_for_candied() const { return theirs_.str(); }
    [[nodiscard]] const std::vector<Frame>& frames() const { return frames_; }

  private:
    unsigned pick(unsigned low, unsigned high) {
        return std::uniform_int_distribution<unsigned>(low, high)(random_);
    }

    void both(const std::string& text) {
        ours_ << text;
        theirs_ << text;
    }

    std::string decimal(double limit) {
        std::ostringstream text;
        text << std::fixed;
        text.precision(pick(0, 9));
        text << std::uniform_real_distribution<double>(-limit, limit)(random_);
        return std::stod(text.str()) == 0 ? "1" : text.str();
    }

    void message(int number) {
        static constexpr std::array<unsigned, 12> kSizes = {1, 2, 3, 5, 8, 8, 8, 8, 8, 12, 24, 64};
        const unsigned size = kSizes.at(pick(0, kSizes.size() - 1));
        const bool extended = pick(0, 2) == 0;
        const auto plain = static_cast<std::uint32_t>(extended ? 0x10000 + number * 77 : number);
        const std::uint32_t id = extended ? plain | 0x80000000U : plain;
        both("BO_ " + std::to_string(id) + " Message" + std::to_string(number) + ": " +
             std::to_string(size) + " Node\n");
        taken_.assign(std::size_t{size} * 8, false);
        const bool multiplexed = size > 1 && pick(0, 3) == 0;
        if (multiplexed) {
            both(" SG_ Multiplexor M : 0|8@1+ (1,0) [0|0] \"\" Node\n");
            std::fill_n(taken_.begin(), 8, true);
        }
        // Plain signals come first; then those of each multiplex value share what is left.
        const unsigned count = pick(1, size < 8 ? 6 : 16);
        for (unsigned k = 0; k < count; ++k) signal(id, size, "P" + std::to_string(k), "");
        const std::vector<bool> plain_bits = taken_;
        for (unsigned value = 0; multiplexed && value < 4; ++value) {
            taken_ = plain_bits;
            for (unsigned k = 0; k < 5; ++k) {
                signal(id, size, "M" + std::to_string(value) + "_" + std::to_string(k),
                       " m" + std::to_string(value));
            }
        }
        both("\n");
        for (int k = 0; k < 8; ++k) {
            Frame frame{id, std::vector<std::uint8_t>(size)};
            for (auto& byte : frame.payload) byte = static_cast<std::uint8_t>(pick(0, 255));
            if (k == 0) std::fill(frame.payload.begin(), frame.payload.end(), 0xff);
            if (multiplexed && k > 1) frame.payload[0] = static_cast<std::uint8_t>(pick(0, 4));
            frames_.push_back(frame);
        }
    }

    void signal(std::uint32_t id, unsigned size, const std::string& name,
                const std::string& multiplex) {
        const bool little = pick(0, 1) == 0;
        const unsigned kind = pick(0, 7);  // 1: 32-bit float, 2: 64-bit float
        const bool real = (kind == 1 && size >= 4) || (kind == 2 && size >= 8);
        const unsigned length = real ? kind * 32 : pick(1, std::min(64U, pick(1, size * 8)));
        unsigned first = pick(0, size * 8 - length);  // in the numbering of the byte order
        if (real) first = first / 8 * 8;
        std::vector<std::size_t> bits;
        for (unsigned i = 0; i < length; ++i)
            bits.push_back(little ? first + i : sawtooth(first + i));
        for (const std::size_t bit : bits) {
            if (taken_[bit]) return;
        }
        for (const std::size_t bit : bits) taken_[bit] = true;
        const unsigned start = little ? first : sawtooth(first);
        const unsigned lsb = little ? first : sawtooth(first + length - 1);
        const std::string rest = "|" + std::to_string(length) + (little ? "@1" : "@0") +
                                 (pick(0, 1) == 0 ? "+" : "-") + " (" + decimal(10) + "," +
                                 decimal(1000) + ") [0|0] \"u\" Node\n";
        ours_ << " SG_ " << name << multiplex << " : " << start << rest;
        theirs_ << " SG_ " << name << multiplex << " : " << lsb << rest;
        if (real) tail_ << "SIG_VALTYPE_ " << id << ' ' << name << " : " << kind << ";\n";
    }

    std::mt19937_64 random_;
    std::ostringstream ours_;
    std::ostringstream theirs_;
    std::ostringstream tail_;
    std::vector<bool> taken_;
    std::vector<Frame> frames_;
};

class NpmDifferential : public testing::Test {
  protected:
    void SetUp() override {
        ASSERT_EQ(std::system("node --version >/dev/null 2>&1"), 0)
            << "node is not installed: this test compares with a decoder that runs on it";
        ASSERT_TRUE(fs::exists(fs::path(npm_) / "node_modules" / "candied"))
            << "candied is not in " << npm_ << "/node_modules: copy package.json and "
            << "package-lock.json of tests/unit/proto/decode_with_npm there and run 'npm ci "
            << "--ignore-scripts', or name another folder in VIBRIG_NPM_DIR";
    }

    /// candied's answer to the frames, line by line.
    [[nodiscard]] std::vector<std::string> candied(const std::string& dbc,
                                                   const std::vector<Frame>& frames) const {
        std::ofstream(folder_ / "file.dbc") << dbc;
        std::ofstream input(folder_ / "frames");
        for (const Frame& frame : frames) {
            input << frame.id << ' ';
            for (const auto byte : frame.payload) {
                input << "0123456789abcdef"[byte >> 4] << "0123456789abcdef"[byte & 15];
            }
            input << '\n';
        }
        input.close();
        const std::string command = "cd '" + folder_.string() + "' && node '" +
                                    VIBRIG_DECODE_SCRIPT + "' '" + npm_ +
                                    "' file.dbc <frames >decoded";
        EXPECT_EQ(std::system(command.c_str()), 0) << command;
        std::vector<std::string> lines;
        std::ifstream output(folder_ / "decoded");
        for (std::string line; std::getline(output, line);) lines.push_back(line);
        return lines;
    }

    static void compare(const Dbc& dbc, const std::vector<Frame>& frames,
                        const std::vector<std::string>& answers) {
        std::size_t compared = 0;
        std::vector<std::size_t> found(frames.size());
        for (const std::string& answer : answers) {
            SCOPED_TRACE(answer);
            std::istringstream fields(answer);
            std::size_t index = 0;
            std::string name;
            bool is_present = false;
            std::string number;
            ASSERT_TRUE(fields >> index >> name >> is_present >> number);
            ASSERT_LT(index, frames.size());
            const Frame& frame = frames[index];
            const Message* message = dbc.find(frame.id & 0x7fffffffU, (frame.id >> 31) != 0);
            ASSERT_NE(message, nullptr);
            const Signal* signal = message->find(name);
            ASSERT_NE(signal, nullptr);
            EXPECT_EQ(present(*message, *signal, frame.payload), is_present);
            const auto value = decode(*signal, frame.payload);
            ASSERT_TRUE(value.has_value());
            const double expected = std::strtod(number.c_str(), nullptr);
            if (!std::isfinite(expected)) {
                EXPECT_EQ(std::isnan(*value), std::isnan(expected));
                EXPECT_TRUE(std::isnan(expected) || *value == expected);
            } else {
                // Beyond 2^53 both round; where offset and raw value cancel, that stays.
                const double size = std::max(std::abs(expected), std::abs(signal->offset));
                EXPECT_NEAR(*value, expected, 1e-9 * size);
            }
            ++compared;
            ++found[index];
            if (HasFailure()) return;
        }
        std::size_t expected_count = 0;
        for (const Frame& frame : frames) {
            expected_count +=
                dbc.find(frame.id & 0x7fffffffU, (frame.id >> 31) != 0)->signals.size();
        }
        EXPECT_EQ(compared, expected_count) << "both know the same signals";
        std::printf("%zu values of %zu frames compared\n", compared, frames.size());
    }

  private:
    std::string npm_ = from_environment("VIBRIG_NPM_DIR", VIBRIG_NPM_DEFAULT);
    TemporaryFolder folder_;
};

TEST_F(NpmDifferential, AgreesOnRandomMessages) {
    // GIVEN random messages of both byte orders, signed, floating and multiplexed, and payloads
    const std::uint64_t seed = std::stoull(from_environment("VIBRIG_SEED", "20091"));
    SCOPED_TRACE(testing::Message() << "VIBRIG_SEED=" << seed);
    const RandomDatabase database(seed);
    const Dbc dbc = parse_dbc(database.text(), "random.dbc");
    // WHEN both decode them THEN all physical values agree
    compare(dbc, database.frames(), candied(database.text_for_candied(), database.frames()));
}

TEST_F(NpmDifferential, AgreesOnTheRigsOwnMessages) {
    const std::uint64_t seed = std::stoull(from_environment("VIBRIG_SEED", "20091"));
    SCOPED_TRACE(testing::Message() << "VIBRIG_SEED=" << seed);
    std::mt19937_64 random(seed);
    const Dbc dbc = parse_dbc(rig_dbc_text(), "rig.dbc");
    std::vector<Frame> frames;
    for (const Message& message : dbc.messages) {
        for (int i = 0; i < 50; ++i) {
            Frame frame{message.id, std::vector<std::uint8_t>(message.size)};
            for (auto& byte : frame.payload) byte = static_cast<std::uint8_t>(random());
            if (i % 2 == 0) frame.payload[0] = static_cast<std::uint8_t>(i % 5);
            frames.push_back(frame);
        }
    }
    compare(dbc, frames, candied(std::string(rig_dbc_text()), frames));
}

}  // namespace
}  // namespace vibrig::proto
