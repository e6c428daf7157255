#include "daemon/serve/render.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "daemon/serve/page.hpp"
#include "daemon/serve/status_message.hpp"
#include "daemon/status/values.hpp"
#include "proto/vibrig.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {
namespace {

std::string joined(const Lines& lines) {
    std::string text;
    for (const std::string& line : lines) text += line + '\n';
    return text;
}

int columns_of(const std::string& line) {
    return static_cast<int>(
        std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

bool has(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

TEST(Render, SaysWhatIsNotThereAndNothingOfNoBroker) {
    StatusData status = full_status();
    status.mqtt.connected = false;
    EXPECT_TRUE(has(joined(render_summary(message_of(status), {}, 120)),
                    "broker.lab:8883: DOWN, no route to host"));
    status.mqtt = {};
    status.latency = {};
    status.real_time.memory_locked = false;
    status.real_time.deadline_ms = 0;
    const std::string text = joined(render_summary(message_of(status), {}, 120));
    EXPECT_TRUE(has(text, "ordinary, memory not locked, no deadlines, ")) << text;
    EXPECT_FALSE(has(text, "broker") || has(text, "frame to ring")) << text;
}

TEST(Render, SaysWhatTheArchiveRefuses) {
    StatusData status = full_status();
    EXPECT_TRUE(
        has(joined(render_summary(message_of(status), {}, 120)), "1 REFUSED: unit-1: was changed"));
    status.archive.refused = 0;
    EXPECT_FALSE(has(joined(render_summary(message_of(status), {}, 120)), "REFUSED"));
}

TEST(Render, ShowsWhatCountsOnAWideTerminal) {
    const Rates rates{true, 40.0, 240.0, 37.0};
    const std::string text = joined(render_table(message_of(full_status()), rates, 120));
    for (const char* part : {"RECORDING",
                             "run 1/2, position 3/14",
                             "(180, 5, 45 deg)",
                             "37.5 %",
                             "12 min 30 s left",
                             "why: why not",
                             "rehearsal, armed by Ada",
                             "9.0000 g commanded",
                             "8.9987 g measured",
                             "EMERGENCY STOP OPEN",
                             "fault bits 0x0004",
                             "link degraded",
                             "newest dwell 5.9900 g",
                             "31.25 degC",
                             "40.0 samples/s, 240.0 frames/s, rig time x 37.0",
                             "kernel 26",
                             "ring 43",
                             "gaps 39",
                             "frame to ring 0.150 ms, worst 0.15 ms",
                             "FIFO 60 and ordinary, memory locked, 229 deadlines missed, page "
                             "faults 225 major 227 minor",
                             "broker.lab:8883: 103 messages, 104 left out",
                             "all good",
                             "NIS 1.020",
                             "vibrigd 0.1.0",
                             "D_Fx",
                             "D_OSz",
                             "deg/h/g^2"}) {
        EXPECT_TRUE(has(text, part)) << "missing: " << part << '\n' << text;
    }
}

TEST(Render, SaysEachSingleValueThatTheTableHasALineFor) {
    // GIVEN a status with a number, a text or a flag for everything
    const v1::Status status = message_of(full_status());
    const Lines lines = render_summary(status, {}, 2000);
    std::size_t rows = 0;
    for (const StatusValue& row : status_values()) {
        if (row.line == nullptr) continue;
        ++rows;
        // THEN the words of a row stand in its line, whatever the code of that line says
        const std::string label = row.line;
        const auto line = std::ranges::find_if(lines, [&](const std::string& one) {
            return one.starts_with(label) && one.at(label.size()) == ' ';
        });
        ASSERT_NE(line, lines.end()) << row.field;
        const std::string words = row.words;
        const auto place = words.find("{}");
        const auto is_said = [&](std::string part) {
            return part.empty() || line->find(part) != std::string::npos;
        };
        if (place == words.npos) {
            EXPECT_TRUE(is_said(words) || (row.otherwise != nullptr && is_said(row.otherwise)))
                << row.field << " in " << *line;
        } else {
            EXPECT_TRUE(is_said(words.substr(0, place)) && is_said(words.substr(place + 2)))
                << row.field << " in " << *line;
        }
    }
    EXPECT_GT(rows, 40u);
    // AND the page gets those that it shows
    const std::string script(page_values().text);
    for (const StatusValue& row : status_values()) {
        if (*row.field == '\0') continue;
        EXPECT_EQ(has(script, '"' + std::string(row.field) + '"'),
                  row.line != nullptr && row.on_page)
            << row.field;
    }
}

/// Random vibration and sweeps have no one frequency, whatever the filter makes of the last dwell.
TEST(Render, SaysNoFrequencyOfWhatHasNone) {
    StatusData data = full_status();
    data.estimate.frequency_hz = 15.117;
    const auto line_of = [&data] {
        const Lines lines = render_summary(message_of(data), {}, 2000);
        return *std::ranges::find_if(
            lines, [](const std::string& one) { return one.starts_with("vibration "); });
    };
    EXPECT_FALSE(has(line_of(), "15.117")) << line_of();
    EXPECT_TRUE(has(line_of(), "random, profile broad at -1.5 dB")) << line_of();
    data.vibration.words = "sweep 20 to 120 Hz, now 45.12 Hz";
    EXPECT_FALSE(has(line_of(), "15.117")) << line_of();
    EXPECT_TRUE(has(line_of(), "sweep 20 to 120 Hz, now 45.12 Hz")) << line_of();
    data.vibration = {};
    EXPECT_TRUE(has(line_of(), "15.117 Hz")) << line_of();
    // The page hides it by the same rule.
    EXPECT_TRUE(has(std::string(page_values().text), R"("unless": "vibration.words")"));
}

TEST(Render, KeepsTheCoefficientsOfOneKindInARow) {
    StatusData data = full_status();
    data.simulated = false;
    const Lines lines = render_coefficients(message_of(data), 80);
    ASSERT_EQ(lines.size(), 10u);
    EXPECT_TRUE(has(lines[0], "D_Fx") && has(lines[0], "D_Fy") && has(lines[0], "D_Fz"));
    EXPECT_TRUE(has(lines[9], "D_OSx") && has(lines[9], "D_OSy") && has(lines[9], "D_OSz"));
    EXPECT_TRUE(has(lines[0], "D_Fx    -0.5000 +-0.0100")) << lines[0];
}

TEST(Render, IsNeverWiderThanTheTerminalAndShowsAllCoefficients) {
    StatusData data = full_status();
    data.campaign_name = std::string(300, 'n') + "\xC3\xA9\xC3\xA9";
    data.reason = std::string(300, 'r');
    data.estimate.value[3] = 1.234567e17;
    data.estimate.value[4] = -1e-300;
    data.estimate.sigma[5] = 1e9;
    data.estimate.sigma[6] = 0;
    data.progress = 7;  // a status that is out of its bounds
    const v1::Status status = message_of(data);
    for (const int width : {-5, 0, 1, 20, 26, 40, 51, 52, 60, 77, 78, 80, 100, 132, 400}) {
        const Lines lines = render_table(status, {true, 1e9, 1e9, 1e9}, width);
        for (const std::string& line : lines) {
            EXPECT_LE(columns_of(line), std::max(width, 20)) << line;
        }
        if (width < 26) continue;
        const std::string text = joined(lines);
        for (const v1::Parameter& parameter : status.estimate().parameters()) {
            EXPECT_TRUE(has(text, parameter.name() + ' ')) << parameter.name() << " at " << width;
        }
    }
}

TEST(Render, OfASimulatedRigEveryLineSaysSo) {
    StatusData data = full_status();
    data.simulated = true;
    data.reason = std::string(300, 'r');
    const v1::Status status = message_of(data);
    for (const int width : {1, 40, 80, 132}) {
        for (const std::string& line : render_table(status, {}, width)) {
            if (line.empty()) continue;  // between summary and coefficients
            EXPECT_TRUE(line.ends_with("  SIMULATED")) << line;
            EXPECT_LE(columns_of(line), std::max(width, 20)) << line;
        }
    }
    EXPECT_TRUE(render_line(status).ends_with("  SIMULATED")) << render_line(status);
    data.simulated = false;
    EXPECT_FALSE(has(joined(render_table(message_of(data), {}, 80)), "SIMULATED"));
    EXPECT_FALSE(has(render_line(message_of(data)), "SIMULATED"));
}

TEST(Render, NamesEveryCampaignState) {
    StatusData data = full_status();
    for (int i = 0; i <= static_cast<int>(CampaignState::tripped); ++i) {
        data.state = static_cast<CampaignState>(i);
        const std::string name = name_of(data.state);
        std::string loud = name;
        std::transform(loud.begin(), loud.end(), loud.begin(),
                       [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
        for (const int width : {30, 100}) {
            EXPECT_EQ(render_summary(message_of(data), {}, width).at(0).rfind(loud, 0), 0u) << name;
        }
        EXPECT_TRUE(has(render_line(message_of(data)), name)) << name;
    }
}

TEST(Render, ShowsADashWhereThereIsNoNumber) {
    // GIVEN a daemon that has just started: no shaker, no platform, nothing observable
    const std::string text = joined(render_table(message_of(StatusData{}), {}, 100));
    EXPECT_TRUE(has(text, "- g measured")) << text;
    EXPECT_TRUE(has(text, "no reading, link absent")) << text;
    EXPECT_TRUE(has(text, "no status yet")) << text;
    EXPECT_TRUE(has(text, "not armed")) << text;
    EXPECT_FALSE(has(text, "nan")) << text;
    EXPECT_TRUE(has(text, "D_Fx          -")) << text;
    // AND a status with nothing in it at all
    EXPECT_FALSE(render_table(v1::Status{}, {}, 80).empty());
    EXPECT_FALSE(render_line(v1::Status{}).empty());
}

TEST(Render, NamesTheChannelsThatAreNotGood) {
    StatusData data = full_status();
    data.sample.quality[1] = drivers::Quality::stale;
    data.sample.quality[5] = drivers::Quality::out_of_range;
    data.sample.quality[6] = drivers::Quality::unbound;
    const std::string text = joined(render_summary(message_of(data), {}, 120));
    EXPECT_TRUE(has(text, "inner SILENT 0.2 s, accel_z OUT_OF_RANGE 0.6 s")) << text;
    EXPECT_FALSE(has(text, "table_accel")) << text;
}

TEST(Render, LetsNoTextSteerTheTerminal) {
    StatusData data = full_status();
    data.reason = "\x1b[2J\r\nfaked";
    data.armed_by = "\x07";
    for (const std::string& line : render_table(message_of(data), {}, 100)) {
        EXPECT_TRUE(std::none_of(line.begin(), line.end(), [](unsigned char c) {
            return c < 0x20;
        })) << line;
    }
    EXPECT_FALSE(has(render_line(message_of(data)), "\x1b"));
}

TEST(Render, RatesComeFromTwoStatusesOfOneDaemon) {
    StatusData data;
    data.time = 100 * drivers::kSecond;
    const v1::Status before = message_of(data);
    data.time = 110 * drivers::kSecond;
    data.uptime = drivers::kSecond;
    data.assembler.samples = 400;
    data.can_counters.received = 2400;
    const v1::Status after = message_of(data);
    const Rates rates = rates_between(before, after, 0.5);
    EXPECT_TRUE(rates.known);
    EXPECT_DOUBLE_EQ(rates.samples_per_s, 40);
    EXPECT_DOUBLE_EQ(rates.frames_per_s, 240);
    EXPECT_DOUBLE_EQ(rates.speed, 20);
    EXPECT_FALSE(rates_between(after, before, 0.5).known) << "started anew";
    EXPECT_FALSE(rates_between(after, after, 0.5).known) << "the clock stands still";
    EXPECT_FALSE(rates_between(before, after, 0).known);
}

TEST(Render, TellsAChangeOfPlaceFromProgress) {
    StatusData data = full_status();
    const v1::Status here = message_of(data);
    data.progress = 0.4;
    data.time += drivers::kSecond;
    EXPECT_TRUE(same_place(here, message_of(data)));
    data.position = 4;
    EXPECT_FALSE(same_place(here, message_of(data)));
    data = full_status();
    data.can = drivers::PortState::absent;
    EXPECT_FALSE(same_place(here, message_of(data)));
}

TEST(Render, WritesDurationsAsPeopleSayThem) {
    EXPECT_EQ(render_duration(0), "0 s");
    EXPECT_EQ(render_duration(59.4), "59 s");
    EXPECT_EQ(render_duration(59.6), "1 min 00 s");
    EXPECT_EQ(render_duration(750), "12 min 30 s");
    EXPECT_EQ(render_duration(3720), "1 h 02 min");
    EXPECT_EQ(render_duration(-1), "?");
    EXPECT_EQ(render_duration(std::numeric_limits<double>::quiet_NaN()), "?");
    EXPECT_EQ(render_duration(std::numeric_limits<double>::infinity()), "?");
}

TEST(Render, WritesAnEventInOneLine) {
    v1::Event event;
    fill(event, {7, 1'700'000'000'250'000'000, 0, Severity::alarm, "can", "vcan0: down\nwaiting"});
    EXPECT_EQ(render_event(event),
              "2023-11-14 22:13:20.250Z  alarm    can         vcan0: down?waiting");
}

}  // namespace
}  // namespace vibrig::serve
