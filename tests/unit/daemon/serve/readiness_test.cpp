#include "daemon/serve/readiness.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "daemon/serve/metrics.hpp"
#include "daemon/serve/render.hpp"
#include "proto/vibrig.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"

namespace vibrig::serve {
namespace {

TEST(Readiness, NamesWhatIsNotWell) {
    StatusData well;
    well.can = drivers::PortState::running;
    well.shaker_link = drivers::LinkState::running;
    well.shaker.valid = true;
    well.shaker.watchdog = drivers::WatchdogTimeout::kept;
    well.rest.state = "at rest";
    well.sample.quality.fill(drivers::Quality::good);
    well.time = well.sample.time = well.platform.time = drivers::kSecond;
    well.platform.ready = true;
    well.loop_check.verdict = "in band";
    well.utc_ns = 1'700'000'000 * drivers::kSecond;
    well.server = {{{"control", "/s", true, "", 0}}, {{"server", 1'700'000'001, true}}};
    EXPECT_TRUE(readiness(well).ready()) << readiness(well).failures();
    struct Row {
        const char* words;
        void (*spoil)(StatusData&);
    };
    for (
        const Row& row : {
            Row{"can: link fault", [](StatusData& s) { s.can = drivers::PortState::fault; }},
            Row{"shaker: link connecting",
                [](StatusData& s) { s.shaker_link = drivers::LinkState::connecting; }},
            Row{"emergency stop: open", [](StatusData& s) { s.shaker.emergency_stop_open = true; }},
            Row{"rest: stopping: table 0.300 g rms",
                [](StatusData& s) {
                    s.stop_pending = true;
                    s.rest = {"stopping", {}, false, "table 0.300 g rms"};
                }},
            Row{"rest: stop not obeyed, press the emergency stop",
                [](StatusData& s) {
                    s.rest = {"stop not obeyed", {}, true, ""};
                }},
            Row{"rest: unknown", [](StatusData& s) { s.rest = {}; }},
            Row{"annunciator: pager: /p: Permission denied",
                [](StatusData& s) {
                    s.annunciator.command = true;
                    s.annunciator.command_note = "/p: Permission denied";
                }},
            Row{"watchdog: timeout reads 60.0 s, not what was written",
                [](StatusData& s) {
                    s.shaker.watchdog = drivers::WatchdogTimeout::changed;
                    s.shaker.watchdog_timeout_s = 60;
                }},
            Row{"channels: inner silent, last good 5.0 s ago",
                [](StatusData& s) {
                    s.channel_age_s[1] = 5;
                    s.sample.quality[1] = drivers::Quality::stale;
                }},
            Row{"channels: outer never, inner never",
                [](StatusData& s) {
                    s.sample = {};
                    s.channel_age_s.fill(-1);
                }},
            Row{"platform: silent for 2.0 s",
                [](StatusData& s) { s.platform.time -= 2 * drivers::kSecond; }},
            Row{"clock: no time in common",
                [](StatusData& s) { s.clock_misfit = "no time in common"; }},
            Row{"sample rate: 80 is not 40", [](StatusData& s) { s.rate_misfit = "80 is not 40"; }},
            Row{"platform: not ready", [](StatusData& s) { s.platform.ready = false; }},
            Row{"loop check: none yet", [](StatusData& s) { s.loop_check = {}; }},
            Row{"doors: control: another vibrigd answers",
                [](StatusData& s) {
                    s.server.doors[0].open = false;
                    s.server.doors[0].note = "another vibrigd answers";
                }},
            Row{"certificates: server EXPIRED 2023-11-14",
                [](StatusData& s) { s.server.certificates[0].expires = 1'700'000'000; }},
            Row{"interlock: tripped: hot", [](StatusData& s) { s.interlock.tripped = "hot"; }},
            Row{"journal: disk full",
                [](StatusData& s) {
                    s.journal = {};
                    s.journal.path = "j";
                    s.journal.note = "disk full";
                }},
            Row{"journal: being verified, 34 % done",
                [](StatusData& s) {
                    s.journal = {};
                    s.journal.path = "j";
                    s.journal.running = true;
                    s.journal.verified_part = 0.34;
                }},
            Row{"journal: event 2 was changed: look at it (vibrig journal verify), then vibrig ack "
                "journal --by NAME",
                [](StatusData& s) {
                    s.journal = {};
                    s.journal.path = "j";
                    s.journal.running = true;
                    s.journal.verified = true;
                    s.interlock.latches = {{"journal", "event 2 was changed", "", "", false, 0}};
                }},
        }) {
        StatusData spoilt = well;
        row.spoil(spoilt);
        EXPECT_TRUE(holds(readiness(spoilt).failures(), row.words)) << readiness(spoilt).failures();
    }
}

TEST(Silence, IsTheSameInStatusMetricsAndSelftest) {
    // GIVEN a rig that was good and has said nothing for ten seconds
    StatusData status = full_status();
    status.sample.quality.fill(drivers::Quality::good);
    EXPECT_EQ(status.channel(0), ChannelState::good);
    status.time += 10 * drivers::kSecond;
    // THEN none of its channels is good
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        EXPECT_EQ(status.channel(c), ChannelState::silent);
        EXPECT_EQ(message_of(status).sample().channels(static_cast<int>(c)).quality(),
                  v1::Channel::silent);
        EXPECT_FALSE(message_of(status).sample().channels(static_cast<int>(c)).has_value());
    }
    EXPECT_EQ(status.platform_state(), ChannelState::silent);
    EXPECT_FALSE(message_of(status).platform().has_ready());
    EXPECT_FALSE(message_of(status).platform().has_in_position());
    EXPECT_FALSE(message_of(status).platform().has_slewing());
    const Lines lines = render_summary(message_of(status), {}, 200);
    EXPECT_TRUE(std::ranges::any_of(lines, [](const std::string& line) {
        return line == "platform   SILENT  SIMULATED";
    })) << "what it said before it fell silent is not said of now";
    const auto metrics = metrics_text(status, {});
    EXPECT_TRUE(holds(metrics, "vibrig_channel_quality{channel=\"outer\",quality=\"silent\"} 1\n"));
    EXPECT_TRUE(holds(metrics, "vibrig_channel_quality{channel=\"outer\",quality=\"good\"} 0\n"));
    EXPECT_TRUE(holds(metrics, "vibrig_platform_silent 1\n"));
    EXPECT_FALSE(holds(metrics, "vibrig_platform_ready"));
    EXPECT_TRUE(holds(readiness(status).failures(), "channels: outer silent"));
    // AND of one that has said nothing since the start it is said
    status.sample = {};
    status.channel_age_s.fill(-1);
    EXPECT_EQ(message_of(status).sample().channels(0).quality(), v1::Channel::never);
    EXPECT_TRUE(holds(readiness(status).failures(), "channels: outer never"));
    EXPECT_TRUE(holds(metrics_text(status, {}),
                      "vibrig_channel_quality{channel=\"outer\",quality=\"never\"} 1\n"));
}

}  // namespace
}  // namespace vibrig::serve
