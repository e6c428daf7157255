#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "proto/register_map.hpp"

namespace vibrig::commission {

/// A shaker's controller, as a trial of its registers uses it: one request at a time.
class TrialPort {
  public:
    enum class Answer : std::uint8_t { done, refused };  ///< refused: by an exception
    virtual ~TrialPort() = default;
    /// Throws std::runtime_error where nobody answers, or wrongly.
    virtual Answer read(proto::RegisterTable table, std::uint16_t address,
                        std::span<std::uint16_t> words) = 0;
    virtual Answer write(std::uint16_t address, std::span<const std::uint16_t> words) = 0;
    virtual void wait(double seconds) = 0;
    [[nodiscard]] virtual double now_s() const = 0;
};

/// Who stands at the controller.
class TrialPerson {
  public:
    virtual ~TrialPerson() = default;
    /// What is typed, without blanks around it. Throws std::runtime_error where nobody answers.
    virtual std::string answer(const std::string& question) = 0;
    virtual void show(const std::string& line) = 0;
};

/// One thing that was tried, and what came of it.
struct TrialRow {
    std::string name, found;
    bool passed = false;
};

/// It cannot go on: what contradicts what. What was written has been taken back as far as the
/// controller lets it.
class TrialEnded : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// Whether a controller does what [shaker.registers] says of it, before anything may move: with the
/// power stage off, its stop chain by hand, then each register written with the chain open. Nothing
/// is written unless the controller reports that it rests with the chain open, nor to a register
/// whose name nobody has typed, nor where another master writes.
class RegisterTrial {
  public:
    RegisterTrial(const proto::ShakerRegisters& map, TrialPort& port, TrialPerson& person);

    /// Each button opens the chain's register within `seen_s` of the person's word, and nothing
    /// starts for 10 s after it was closed again. Reads only.
    void stop_chain(const std::vector<std::string>& buttons, double seen_s);
    /// Each register that is written: its own value, then a harmless other one, read back, its
    /// neighbours as they were; run = 1 does not lead to running. Those left out are rows that have
    /// not passed.
    void write_each();
    /// The amplitude's set-point, one count above each of these (name, g): refused, or noted. Only
    /// where somebody has named the amplitude.
    void beyond_limits(const std::vector<std::pair<std::string, double>>& limits_g);

    [[nodiscard]] const std::vector<TrialRow>& rows() const { return rows_; }
    [[nodiscard]] bool passed() const;

  private:
    using Words = std::vector<std::uint16_t>;
    struct Role {
        const char* name;
        const proto::Register* reg;
    };
    struct Range {
        proto::RegisterTable table;
        std::uint16_t first = 0, count = 0;
        bool watched = false;  ///< it tells whether something moves
    };
    using Place = std::pair<proto::RegisterTable, std::uint16_t>;
    using Image = std::map<Place, std::uint16_t>;

    static constexpr double kPoll_s = 0.1;
    static constexpr double kStill_g = 0.01;  ///< of the table, by the controller's own word
    static constexpr double kRamping = 1, kRunning = 2, kStopping = 3;  ///< states
    static constexpr int kAsked = 3;  ///< how often before it ends

    [[nodiscard]] static std::string place_of(const proto::Register& reg);
    // register_trial.cpp: reading, and the chain
    void lay_out();
    [[nodiscard]] Image read(bool all);
    [[nodiscard]] Image read_all() { return read(true); }
    [[nodiscard]] Image read_watched() { return read(false); }
    [[nodiscard]] static Words words_of(const Image& image, const proto::Register& reg);
    [[nodiscard]] static double value_of(const Image& image, const proto::Register& reg);
    [[nodiscard]] std::string what_moves(const Image& image) const;
    [[nodiscard]] std::string role_at(std::uint16_t address) const;

    void chain_is(bool open, const std::string& asked);
    void nothing_starts(const std::string& button);
    void row(std::string name, bool passed, std::string found);

    // register_writes.cpp: writing
    void begin_writing();
    void look_for_others(const Image& now);
    /// The chain is open, the controller at rest, and nobody else has written: else it ends.
    void may_write();
    [[nodiscard]] TrialPort::Answer write(const Role& role, const Words& words, const char* what);
    void hold_against(const Role& role, const Words& words, const char* what);
    void display_agrees(const Role& role, double value);
    void take_back() noexcept;

    void write_one(const Role& role);
    void try_value(const Role& role, double value);
    void try_run(const Role& role);
    [[nodiscard]] bool named(const Role& role);

    proto::ShakerRegisters map_;
    TrialPort& port_;
    TrialPerson& person_;
    std::vector<Role> written_, seen_;
    std::vector<Range> ranges_;
    std::vector<TrialRow> rows_;
    Image last_;             ///< as it has to be now
    std::set<Place> alive_;  ///< what changes by itself: the controller's own affair
    bool writing_ = false;   ///< last_ and alive_ are known
    std::vector<std::pair<Role, Words>> to_take_back_;
    bool amplitude_named_ = false;
};

}  // namespace vibrig::commission
