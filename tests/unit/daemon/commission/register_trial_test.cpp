// Registers of a controller that is not ours, tried while nothing can move: one that does what its
// map says, and those that do not.
#include "daemon/commission/register_trial.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <deque>
#include <functional>

namespace vibrig::commission {
namespace {

using proto::Register;
using proto::RegisterTable;
using proto::RegisterType;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Le;
using ::testing::Not;

constexpr std::uint16_t kIdle = 0, kRunning = 2, kFault = 4;

/// A map of its own: frequency as f32, amplitude as u32 with the low word first.
proto::ShakerRegisters foreign_map() {
    proto::ShakerRegisters map;
    const auto place = [](Register& reg, std::uint16_t address, RegisterType type, double scale) {
        reg.address = address;
        reg.type = type;
        reg.scale = scale;
    };
    place(map.frequency, 100, RegisterType::f32, 1);
    place(map.amplitude, 110, RegisterType::u32, 1e-3);
    map.amplitude.order = proto::WordOrder::little;
    place(map.ramp_time, 120, RegisterType::u16, 0.1);
    place(map.run, 130, RegisterType::u16, 1);
    place(*map.watchdog, 140, RegisterType::u16, 1);
    place(map.watchdog_timeout, 141, RegisterType::u16, 1e-3);
    place(map.state, 20, RegisterType::u16, 1);
    place(map.fault, 21, RegisterType::u16, 1);
    place(map.emergency_stop, 22, RegisterType::bits, 1);
    map.emergency_stop.mask = 4;
    place(map.measured_amplitude, 30, RegisterType::u32, 1e-3);
    return map;
}

/// The controller. Its registers end at 150; its own counter, at 143, never rests.
class Fake : public TrialPort {
  public:
    proto::ShakerRegisters map = foreign_map();
    std::array<std::uint16_t, 150> holding{}, input{};
    std::vector<std::uint16_t> written;  ///< addresses, in their order
    double time_s = 0;
    /// Lies: called after each write; before each look.
    std::function<void(std::uint16_t)> after_write = [](std::uint16_t) {};
    std::function<void()> before_read = [] {};
    std::function<bool(std::uint16_t, std::span<const std::uint16_t>)> refuses =
        [](std::uint16_t, std::span<const std::uint16_t>) { return false; };

    Fake() {
        set(map.frequency, 15);
        set(map.ramp_time, 2);
        set(map.watchdog_timeout, 1.5);
        holding[105] = 7;
    }
    void set(const Register& reg, double value) {
        auto& table = reg.table == RegisterTable::holding ? holding : input;
        ASSERT_TRUE(proto::encode(reg, value, std::span(table).subspan(reg.address, reg.words())));
    }
    [[nodiscard]] double value(const Register& reg) const {
        const auto& table = reg.table == RegisterTable::holding ? holding : input;
        return proto::decode(reg, std::span(table).subspan(reg.address, reg.words()));
    }
    void open_chain(bool open) {
        set(map.emergency_stop, open ? 1 : 0);
        if (open) set(map.state, kFault);
    }

    Answer read(RegisterTable table, std::uint16_t address,
                std::span<std::uint16_t> words) override {
        before_read();
        ++holding[143];
        const auto& from = table == RegisterTable::holding ? holding : input;
        EXPECT_THAT(words.size(), Le(16U));
        if (address + words.size() > from.size()) return Answer::refused;
        std::copy_n(from.begin() + address, words.size(), words.begin());
        time_s += 0.05;
        return Answer::done;
    }
    Answer write(std::uint16_t address, std::span<const std::uint16_t> words) override {
        time_s += 0.05;
        written.push_back(address);
        EXPECT_EQ(value(map.emergency_stop), 1) << "written with the chain closed: " << address;
        EXPECT_NE(value(map.state), kRunning) << "written while it runs: " << address;
        if (refuses(address, words)) return Answer::refused;
        std::ranges::copy(words, holding.begin() + address);
        after_write(address);
        return Answer::done;
    }
    void wait(double seconds) override { time_s += seconds; }
    [[nodiscard]] double now_s() const override { return time_s; }
};

/// Does as asked, unless set otherwise for a question that begins so.
class Person : public TrialPerson {
  public:
    Fake& controller;
    std::vector<std::string> lines;
    std::deque<std::pair<std::string, std::string>> instead;  ///< once each
    std::function<void(const std::string&)> acts = [](const std::string&) {};

    explicit Person(Fake& fake) : controller(fake) {}

    std::string answer(const std::string& question) override {
        acts(question);
        const auto begins = [&](const std::string& with) { return question.starts_with(with); };
        const auto other = std::ranges::find_if(instead, [&](const auto& one) {
            return question.find(one.first) != std::string::npos;
        });
        if (other != instead.end()) {
            auto text = other->second;
            instead.erase(other);
            if (text == "EOF") throw std::runtime_error("nobody answers");
            return text;
        }
        if (begins("Close") || begins("Release")) controller.open_chain(false);
        if (begins("Press") || begins("Open")) controller.open_chain(true);
        if (begins("May ")) return question.substr(4, question.find(' ', 4) - 4);
        const auto is = question.find(" is "), now = question.find(" now.");
        if (now != std::string::npos) {
            const double value = std::stod(question.substr(is + 4, now - is - 4));
            std::array<char, 32> text{};
            std::snprintf(text.data(), text.size(), "%.2f", value);
            return text.data();
        }
        return "";
    }
    void show(const std::string& line) override { lines.push_back(line); }
};

struct Bench {
    Fake controller;
    Person person{controller};
    RegisterTrial trial{controller.map, controller, person};

    /// Why it ended; empty: it went on to its end.
    std::string write_each() {
        try {
            trial.write_each();
        } catch (const std::exception& error) {
            return error.what();
        }
        return "";
    }
    std::string stop_chain() {
        try {
            trial.stop_chain({"rack", "door"}, 0.5);
        } catch (const std::exception& error) {
            return error.what();
        }
        return "";
    }
};

TEST(RegisterTrial, OfAControllerThatDoesWhatItsMapSaysEachRegisterPasses) {
    Bench b;
    EXPECT_EQ(b.stop_chain(), "");
    EXPECT_THAT(b.controller.written, IsEmpty()) << "the chain is looked at, nothing written";
    EXPECT_EQ(b.write_each(), "");
    b.trial.beyond_limits({{"acceleration", 12}});
    EXPECT_TRUE(b.trial.passed());
    std::vector<std::string> names;
    for (const auto& row : b.trial.rows()) names.push_back(row.name);
    EXPECT_THAT(names, ElementsAre("stop chain, rack", "closing after rack", "stop chain, door",
                                   "closing after door", "frequency", "amplitude", "ramp_time",
                                   "watchdog_timeout", "watchdog", "run", "limit, acceleration"));
    // THEN all is as it was, and nothing but the stated registers was written
    const Fake fresh;
    for (const auto* reg : {&fresh.map.frequency, &fresh.map.amplitude, &fresh.map.ramp_time,
                            &fresh.map.run, &fresh.map.watchdog_timeout})
        EXPECT_EQ(b.controller.value(*reg), fresh.value(*reg)) << reg->address;
    EXPECT_THAT(b.controller.written, Each(testing::AnyOf(100, 110, 120, 130, 140, 141)));
    EXPECT_EQ(b.trial.rows().back().found,
              "12.001 g is taken: the controller does not limit, Vibrig alone does");
}

TEST(RegisterTrial, LimitsOfTheControllerAreSeenEitherWay) {
    Bench refusing;
    refusing.controller.refuses = [&c = refusing.controller](std::uint16_t at, auto words) {
        return at == 110 && proto::decode(c.map.amplitude, words) > 12;
    };
    EXPECT_EQ(refusing.write_each(), "");
    refusing.trial.beyond_limits({{"acceleration", 12}, {"velocity", 11.5}});
    EXPECT_EQ(refusing.trial.rows()[6].found, "12.001 g is refused");
    EXPECT_THAT(refusing.trial.rows()[7].found, HasSubstr("11.501 g is taken"));
    EXPECT_EQ(refusing.controller.value(refusing.controller.map.amplitude), 0);

    Bench clamping;
    EXPECT_EQ(clamping.write_each(), "");
    clamping.controller.after_write = [&c = clamping.controller](std::uint16_t at) {
        if (at == 110 && c.value(c.map.amplitude) > 10) c.set(c.map.amplitude, 10);
    };
    clamping.trial.beyond_limits({{"acceleration", 12}});
    EXPECT_EQ(clamping.trial.rows().back().found, "12.001 g is held to 10");
}

TEST(RegisterTrial, NothingIsWrittenWhoseNameNobodyHasTyped) {
    Bench b;
    b.person.instead = {{"May frequency", "yes"},     {"May frequency", ""},
                        {"May amplitude", ""},        {"May ramp_time", ""},
                        {"May watchdog_timeout", ""}, {"May watchdog ", ""},
                        {"May run", "ramp_time"},     {"May run", ""}};
    EXPECT_EQ(b.write_each(), "");
    b.trial.beyond_limits({{"acceleration", 12}});
    EXPECT_THAT(b.controller.written, IsEmpty());
    EXPECT_FALSE(b.trial.passed());
    EXPECT_THAT(b.trial.rows(), Each(Field(&TrialRow::found, "left out")));
    EXPECT_THAT(b.person.lines,
                Contains(HasSubstr("found \"yes\", expected frequency or nothing")));
    EXPECT_THAT(b.person.lines,
                Contains(HasSubstr("found \"ramp_time\", expected run or nothing")));
}

TEST(RegisterTrial, NothingIsWrittenWhileTheTableMoves) {
    for (const auto& [what, moves] :
         std::vector<std::pair<std::string, std::function<void(Fake&)>>>{
             {"shaker.registers.run reads 1", [](Fake& c) { c.set(c.map.run, 1); }},
             {"shaker.registers.state reads 2", [](Fake& c) { c.set(c.map.state, kRunning); }},
             {"measured_amplitude reads 0.05 g",
              [](Fake& c) { c.set(c.map.measured_amplitude, 0.05); }}}) {
        Bench b;
        // It moves from the moment on in which the chain is said to be open.
        b.controller.before_read = [&, m = &moves] {
            if (b.controller.value(b.controller.map.emergency_stop) == 1) (*m)(b.controller);
        };
        EXPECT_THAT(b.write_each(), HasSubstr(what));
        EXPECT_THAT(b.controller.written, IsEmpty()) << what;
    }
}

TEST(RegisterTrial, NothingIsWrittenOnceTheChainIsClosed) {
    Bench b;
    b.person.acts = [&](const std::string& question) {
        if (question.starts_with("May ramp_time")) b.controller.open_chain(false);
    };
    EXPECT_THAT(b.write_each(), HasSubstr("the emergency-stop chain was closed"));
    EXPECT_THAT(b.controller.written, Not(Contains(120)));
}

TEST(RegisterTrial, AnotherMasterIsNamedByTheRegisterThatChanges) {
    // At the beginning, as a daemon feeds a watchdog
    Bench feeding;
    feeding.controller.before_read = [&c = feeding.controller] { ++c.holding[140]; };
    EXPECT_THAT(feeding.write_each(),
                AllOf(HasSubstr("shaker.registers.watchdog (holding 140)"),
                      HasSubstr("nobody here has written it: another master")));
    EXPECT_THAT(feeding.controller.written, IsEmpty());
    // AND in between
    Bench later;
    later.person.acts = [&](const std::string& question) {
        if (question.starts_with("May ramp_time"))
            later.controller.set(later.controller.map.frequency, 40);
    };
    EXPECT_THAT(later.write_each(),
                HasSubstr("shaker.registers.frequency (holding 100) was 15, is 40"));
    EXPECT_THAT(later.controller.written, Not(Contains(120)));
}

TEST(RegisterTrial, ARegisterThatIsAnothersIsRecognisedByItsNeighbours) {
    Bench b;
    b.controller.after_write = [&c = b.controller](std::uint16_t at) {
        if (at == 100 && c.value(c.map.frequency) != 15) c.holding[105] = 99;
    };
    EXPECT_THAT(b.write_each(),
                HasSubstr("writing shaker.registers.frequency (holding 100) changes holding 105 "
                          "from 7 to 99"));
    EXPECT_EQ(b.controller.value(b.controller.map.frequency), 15) << "and is taken back";
    // BUT a place that shows the set-point once more is noted only
    Bench twice;
    twice.controller.after_write = [&c = twice.controller](std::uint16_t at) {
        if (at == 120) c.holding[122] = c.holding[120];
    };
    twice.controller.holding[122] = twice.controller.holding[120];
    EXPECT_EQ(twice.write_each(), "");
    EXPECT_THAT(twice.person.lines, Contains("  holding 122 follows it"));
}

TEST(RegisterTrial, WhatIsNotKeptOrRefusedEndsIt) {
    Bench echo;
    echo.controller.after_write = [&c = echo.controller](std::uint16_t at) {
        if (at == 120) c.set(c.map.ramp_time, 2);
    };
    EXPECT_THAT(echo.write_each(), HasSubstr("shaker.registers.ramp_time (holding 120): 3 written "
                                             "(another value), 2 read back"));
    Bench refusing;
    refusing.controller.refuses = [](std::uint16_t at, auto) { return at == 141; };
    EXPECT_THAT(refusing.write_each(), HasSubstr("watchdog_timeout (holding 141): its own value, "
                                                 "1.5, is refused"));
}

TEST(RegisterTrial, ADisplayThatSaysOtherwiseEndsItAndBothAreShown) {
    Bench b;
    b.person.instead = {{"frequency is 16 now", "about 16"}, {"frequency is 16 now", "160.0"}};
    EXPECT_THAT(b.write_each(), HasSubstr("shaker.registers.frequency (holding 100): 16 written "
                                          "and read back, 160.0 on the display"));
    EXPECT_THAT(b.person.lines, Contains(HasSubstr("found \"about 16\", expected a number")));
    EXPECT_EQ(b.controller.value(b.controller.map.frequency), 15);
    // BUT what no display shows is no contradiction
    Bench silent;
    silent.person.instead = {{"frequency is 16 now", "-"}, {"ramp_time is 3 now", "-"}};
    EXPECT_EQ(silent.write_each(), "");
}

TEST(RegisterTrial, RunThatStartsWithTheChainOpenIsTakenBackAtOnce) {
    Bench b;
    b.controller.after_write = [&c = b.controller](std::uint16_t at) {
        if (at != 130) return;
        c.set(c.map.state, c.value(c.map.run) != 0 ? 1 : kIdle);
    };
    EXPECT_THAT(b.write_each(),
                HasSubstr("run = 1 starts although the emergency-stop chain is open"));
    EXPECT_EQ(b.controller.value(b.controller.map.run), 0);
    EXPECT_FALSE(b.trial.passed());
    // AND one that refuses it passes
    Bench refusing;
    refusing.controller.refuses = [](std::uint16_t at, auto words) {
        return at == 130 && words[0] == 1;
    };
    EXPECT_EQ(refusing.write_each(), "");
    EXPECT_EQ(refusing.trial.rows().back().found, "1 is refused while the chain is open");
}

TEST(RegisterTrial, WhereNobodyAnswersAnyMoreWhatWasWrittenIsTakenBack) {
    for (const char* question :
         {"frequency is 16 now", "ramp_time is 3 now", "amplitude is 0.001"}) {
        Bench b;
        b.person.instead = {{question, "EOF"}};
        EXPECT_EQ(b.write_each(), "nobody answers");
        const Fake fresh;
        EXPECT_EQ(b.controller.holding[101], fresh.holding[101]);
        EXPECT_EQ(b.controller.value(b.controller.map.frequency), 15);
        EXPECT_EQ(b.controller.value(b.controller.map.ramp_time), 2);
        EXPECT_EQ(b.controller.value(b.controller.map.amplitude), 0);
    }
}

TEST(RegisterTrial, AButtonThatIsNotSeenEndsIt) {
    Bench b;
    b.person.acts = [&](const std::string& question) {
        if (question.find("\"door\"") == std::string::npos) return;
        if (question.starts_with("Press")) b.person.instead = {{"Press", ""}};
    };
    EXPECT_THAT(b.stop_chain(), HasSubstr("\"door\" is pressed by your word, the chain closed by "
                                          "its register (input 22)"));
    EXPECT_FALSE(b.trial.passed());
    EXPECT_THAT(b.controller.written, IsEmpty());
}

TEST(RegisterTrial, AChainThatStartsSomethingWhenItClosesEndsIt) {
    Bench b;
    double closed_s = -1;
    b.person.acts = [&](const std::string& question) {
        if (question.starts_with("Release")) closed_s = b.controller.time_s;
    };
    b.controller.before_read = [&] {
        if (closed_s >= 0 && b.controller.time_s > closed_s + 8)
            b.controller.set(b.controller.map.state, 1);
    };
    EXPECT_THAT(b.stop_chain(), HasSubstr("closing the chain starts something: "
                                          "shaker.registers.state reads 1"));
}

TEST(RegisterTrial, APersonsWordAgainstTheChainsRegisterIsShownWithBoth) {
    Bench b;
    b.person.instead = {{"Open the", ""}, {"Open the", ""}, {"Open the", ""}};
    EXPECT_THAT(b.write_each(), HasSubstr("open by your word, closed by its register (input 22)"));
    EXPECT_THAT(b.person.lines,
                Contains(HasSubstr("emergency_stop (input 22) reads closed, expected open")));
    EXPECT_THAT(b.controller.written, IsEmpty());
}

}  // namespace
}  // namespace vibrig::commission
