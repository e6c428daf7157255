#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/serve/metrics.hpp"
#include "daemon/serve/openapi.hpp"
#include "daemon/serve/readiness.hpp"
#include "daemon/serve/status_json.hpp"
#include "daemon/serve/status_server.hpp"
#include "daemon/serve/stream_feed.hpp"
#include "proto/vibrig.pb.h"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"

namespace vibrig::serve {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

bool holds(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

TEST(StreamClientTest, GetsTheStatusOnceAndThenWhatChanged) {
    FakeSource source;
    StreamFeed feed(source);
    StreamClient client(feed, "1234", Role::viewer, 20, 0);
    auto now = Clock::now();
    EXPECT_EQ(*client.next(now), R"({"type":"hello","instance":"1234","role":"viewer"})");
    EXPECT_EQ(*client.next(now),
              R"({"type":"status","status":)" + status_json(source.status()) + '}');
    EXPECT_EQ(client.next(now), nullptr) << "not due";
    EXPECT_GT(client.due(), now);
    // WHEN one number changes THEN the patch holds it and nothing else
    StatusData status = source.status();
    status.time += drivers::kSecond;
    source.set(status);
    now = client.due() + 20ms;  // older than what all share
    const auto patch = client.next(now);
    ASSERT_NE(patch, nullptr);
    EXPECT_TRUE(holds(*patch, R"({"type":"delta","patch":{"time_s":)")) << *patch;
    EXPECT_LT(patch->size(), 200u) << *patch;
    // WHEN a value is no longer there THEN the patch says null
    status.shaker.valid = false;
    source.set(status);
    EXPECT_TRUE(holds(*client.next(client.due() + 20ms), R"("measured_g":null)"));
}

/// Streams of one rate as the server's one thread serves them, one after the other.
class Streams {
  public:
    Streams(StreamFeed& feed, int count, double rate_hz)
        : clients_(static_cast<std::size_t>(count),
                   StreamClient(feed, "1", Role::viewer, rate_hz, 0)) {
        for (auto& client : clients_) (void)client.next(now);  // the greeting
    }
    /// All that is due; each takes `cost`. How many got a text.
    int serve(Clock::duration cost) {
        int texts = 0;
        for (auto& client : clients_) {
            if (client.next(now) != nullptr) ++texts;
            now += cost;
        }
        return texts;
    }
    [[nodiscard]] Clock::time_point due() const { return clients_.front().due(); }

    Clock::time_point now{std::chrono::hours(1)};

  private:
    std::vector<StreamClient> clients_;
};

TEST(StreamClientTest, OfOnePeriodShareAStatusHoweverLongServingThemTakes) {
    constexpr int kPeriods = 10;
    for (const int count : {1, 100, 1000}) {
        FakeSource source;
        StreamFeed feed(source);
        Streams streams(feed, count, 5);
        (void)streams.serve(0ms);  // the first of each
        StatusData status = source.status();
        // WHEN serving all of them takes most of a period of 200 ms
        for (int k = 0; k < kPeriods; ++k) {
            status.time += drivers::kSecond;
            source.set(status);
            const int before = source.asked;
            streams.now = streams.due();
            // THEN each has its text in each period, of one status made once
            EXPECT_EQ(streams.serve(150ms / count), count) << count << " in period " << k;
            EXPECT_EQ(source.asked - before, 1) << count << " in period " << k;
        }
    }
}

TEST(StreamClientTest, GetsNoStatusOlderThanItsPeriodNorThanAFifthOfASecond) {
    FakeSource source;
    StreamFeed feed(source);
    const auto text_of = [&](StreamClient& client, Clock::time_point now) {
        const auto text = client.next(now);
        return text ? *text : std::string();
    };
    // GIVEN a client of one rate, served at the begin of a period
    StreamClient first(feed, "1", Role::viewer, 0.1, 0), late = first, fast = first;
    fast.take(R"({"rate_hz": 20})");
    Clock::time_point now{std::chrono::hours(1)};
    for (auto* client : {&first, &late, &fast}) (void)client->next(now);
    for (auto* client : {&first, &late, &fast}) EXPECT_NE(text_of(*client, now), "");
    StatusData status = source.status();
    const auto changed = [&] {
        status.time += drivers::kSecond;
        source.set(status);
    };
    changed();
    now = first.due();
    EXPECT_NE(text_of(first, now), "");
    // WHEN one that is slow, of the same long period, takes up again much later
    changed();
    int before = source.asked;
    EXPECT_NE(text_of(late, now + 250ms), "");
    EXPECT_EQ(source.asked - before, 1) << "of data the latest";
    before = source.asked;
    // THEN a fast one gets what is new in each of its own periods
    now += 300ms;
    for (int k = 0; k < 4; ++k) {
        changed();
        EXPECT_NE(text_of(fast, now), "");
        now = fast.due();
    }
    EXPECT_EQ(source.asked - before, 4);
}

TEST(StreamClientTest, GetsEveryEventInOrderOrIsTooSlow) {
    FakeSource source;
    StreamFeed feed(source);
    const auto add = [&](int count) {
        for (int i = 0; i < count; ++i)
            source.log.append({0, 0, 0, Severity::info, "x", "happened"});
    };
    add(5000);
    StreamClient client(feed, "1", Role::viewer, 20, 0);
    (void)client.next(Clock::now());
    const std::string first = *client.next(Clock::now());
    EXPECT_TRUE(holds(first, R"("id":"5000")") && holds(first, R"("id":"4501")"))
        << "the newest 500";
    EXPECT_FALSE(holds(first, R"("id":"4500")"));
    (void)client.next(Clock::now());
    add(2);
    const std::string next = *client.next(client.due());
    EXPECT_TRUE(holds(next, R"("id":"5001")") && holds(next, R"("id":"5002")") &&
                !holds(next, "5000"));
    add(501);
    (void)client.next(client.due());  // the status that was due
    EXPECT_THROW((void)client.next(client.due()), std::runtime_error);
}

TEST(StreamClientTest, TakesARateAndNothingElse) {
    FakeSource source;
    StreamFeed feed(source);
    StreamClient client(feed, "1", Role::viewer, 1, 0);
    EXPECT_NO_THROW(client.take(R"({"rate_hz": 5})"));
    for (const char* bad : {"", "{", "5", R"({"rate_hz":"5"})", R"({"rate_hz":0})",
                            R"({"rate_hz":1e9})", R"({"rate_hz":null})", R"({"rate":1})", "[]"})
        EXPECT_THROW(client.take(bad), std::invalid_argument) << bad;
}

/// A WebSocket by hand: what the server sends is not masked.
class Socket {
  public:
    Socket(const std::string& path, const std::string& query) : raw_(path) {
        raw_.send(
            "GET /api/v1/stream" + query +
            " HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n");
        answer = raw_.answer();
    }
    /// The next message's text; "(closed CODE)".
    std::string next() {
        std::string text;
        while (true) {
            const std::string head = raw_.bytes(2);
            if (head.size() < 2) return "(gone)";
            const auto byte = [](char c) {
                return static_cast<std::size_t>(static_cast<unsigned char>(c));
            };
            std::size_t size = byte(head[1]) & 0x7F;
            if (size >= 126) {
                const std::string longer = raw_.bytes(size == 126 ? 2 : 8);
                size = 0;
                for (const char c : longer) size = size << 8 | byte(c);
            }
            const std::string payload = raw_.bytes(size);
            if ((byte(head[0]) & 0x0F) == 8)
                return "(closed " + std::to_string(byte(payload[0]) << 8 | byte(payload[1])) + ")";
            if ((byte(head[0]) & 0x0F) > 2) continue;  // a ping
            text += payload;
            if ((byte(head[0]) & 0x80) != 0) return text;
        }
    }
    std::string answer;

  private:
    RawConnection raw_;
};

TEST(Stream, OverASocketIsAWebSocketAtTheRateAskedFor) {
    FakeSource source;
    const TemporaryFolder folder;
    StatusServer server(source, folder.file("s"));
    Socket stream(folder.file("s"), "?rate_hz=20");
    EXPECT_EQ(status_of(stream.answer), 101);
    // The accept key of RFC 6455, section 1.3.
    EXPECT_TRUE(holds(stream.answer, "s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));
    EXPECT_TRUE(holds(stream.next(), R"("type":"hello")"));
    EXPECT_TRUE(holds(stream.next(), R"("type":"status")"));
    source.log.append({0, 0, 0, Severity::trip, "interlock", "emergency stop"});
    EXPECT_TRUE(holds(stream.next(), R"("type":"events")"));
    EXPECT_EQ(status_of(Socket(folder.file("s"), "?rate_hz=1000").answer), 400);
    EXPECT_EQ(status_of(get(folder.file("s"), "/api/v1/stream")), 426);
}

TEST(Stream, OfOneWhoNeverReadsHoldsNobodyUpAndEnds) {
    FakeSource source;
    const TemporaryFolder folder;
    StatusServer server(source, folder.file("s"));
    // GIVEN one who never reads, while events pour in
    const Socket deaf(folder.file("s"), "?rate_hz=20");
    Socket reads(folder.file("s"), "?rate_hz=20");
    bool ended = false;
    for (int i = 0; i < 20 && !ended; ++i) {  // 5 MB: more than the socket holds
        for (int k = 0; k < 400; ++k)
            source.log.append({0, 0, 0, Severity::info, "x", std::string(500, 'x')});
        // THEN who reads is served; all 400, or with the next ones more than 500 would wait for him
        const std::string last = R"("id":")" + std::to_string(400 * (i + 1)) + '"';
        for (std::string text; !holds(text, last);) {
            text = reads.next();
            ASSERT_NE(text.front(), '(') << text;
        }
        ended = holds(get(folder.file("s"), "/metrics"), "vibrig_server_streams_dropped_total 1");
    }
    EXPECT_TRUE(ended || holds(get(folder.file("s"), "/metrics"), "vibrig_server_streams 2"))
        << "its place is bounded either way";
}

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

TEST(Metrics, CarryWhatIsValidAndAddUp) {
    StatusData status = full_status();
    const std::string text = metrics_text(status, {});
    EXPECT_TRUE(holds(text, "# TYPE vibrig_interlock_reaction_seconds histogram"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_reaction_seconds_count 6\n")) << text;
    EXPECT_TRUE(holds(text, "vibrig_interlock_reaction_seconds_sum 0.0045\n"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_reaction_seconds_bucket{le=\"+Inf\"} 6\n"));
    EXPECT_TRUE(holds(text, "vibrig_campaign_state{state=\"recording\"} 1\n"));
    EXPECT_TRUE(holds(text, "vibrig_acquisition_latency_seconds_bucket{le=\"0.0002\"} 1\n"));
    EXPECT_TRUE(holds(text, "vibrig_mqtt_messages_total{outcome=\"left_out\"} 104\n"));
    EXPECT_TRUE(holds(text, "vibrig_thread_deadline_misses_total{thread=\"estimator\"} 116\n"));
    EXPECT_TRUE(holds(
        text, "vibrig_thread_page_faults_total{kind=\"major\",thread=\"acquisition\"} 111\n"));
    EXPECT_TRUE(holds(text, "vibrig_thread_fifo_priority{thread=\"acquisition\"} 60\n"));
    EXPECT_TRUE(holds(text, "vibrig_memory_locked 1\n"));
    EXPECT_TRUE(holds(text, "vibrig_door_made_anew_total{door=\"control\"} 131\n"));
    EXPECT_TRUE(
        holds(text, "vibrig_certificate_expiry_timestamp_seconds{whose=\"server\"} 1800000000\n"));
    EXPECT_TRUE(holds(text, "vibrig_log_lines_total{outcome=\"dropped\"} 123\n"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_value{name=\"amplitude_abort\",unit=\"dB\"} 2\n"));
    EXPECT_TRUE(holds(text, "vibrig_interlock_margin_ratio{name=\"amplitude_abort\"} 0.5\n"));
    EXPECT_FALSE(holds(text, "nan") || holds(text, "Nan")) << text;
    status.shaker.valid = false;
    EXPECT_FALSE(holds(metrics_text(status, {}), "vibrig_shaker_measured"));
}

TEST(OpenApi, IsOneJsonObject) {
    const auto tree = nlohmann::json::parse(openapi_json(), nullptr, false);
    ASSERT_TRUE(tree.is_object());
    EXPECT_TRUE(tree.contains("paths"));
}

/// What `schema` requires and `value` lacks, at whatever depth.
std::string lacking(const nlohmann::json& schemas, const nlohmann::json& schema,
                    const nlohmann::json& value) {
    if (schema.contains("$ref")) {
        const std::string name = schema["$ref"];
        return lacking(schemas, schemas.at(name.substr(name.rfind('/') + 1)), value);
    }
    std::string found;
    if (schema.value("type", nlohmann::json()) == "array") {
        for (const auto& item : value) found += lacking(schemas, schema["items"], item);
        return found;
    }
    if (!schema.contains("properties")) return {};
    for (const std::string name : schema["required"])
        if (!value.contains(name)) found += name + ' ';
    for (const auto& [name, part] : schema["properties"].items())
        if (value.contains(name)) found += lacking(schemas, part, value[name]);
    return found;
}

TEST(OpenApi, RequiresWhatIsAlwaysThere) {
    const auto schemas = nlohmann::json::parse(openapi_json())["components"]["schemas"];
    const auto judge = [&](const char* name, const std::string& text) {
        return lacking(schemas, schemas.at(name), nlohmann::json::parse(text));
    };
    // GIVEN answers with as little in them as can be, and full ones
    for (const StatusData& status : {StatusData{}, full_status()}) {
        EXPECT_EQ(judge("Status", status_json(status)), "");
        EXPECT_EQ(judge("Campaign", campaign_json(status)), "");
    }
    EXPECT_EQ(judge("Parameters", parameters_json(full_result())), "");
    EXPECT_EQ(judge("Events", events_json("", {EventRecord{}})), "");
    EXPECT_EQ(judge("Plan", plan_json({})), "");
    EXPECT_EQ(judge("Surface", surface_json({})), "");
    EXPECT_EQ(judge("CommandReply", reply_json({})), "");
    EXPECT_EQ(judge("Configuration", configuration_json("")), "");
    EXPECT_EQ(judge("Problem", problem_json(400, "", "")), "");
    EXPECT_EQ(judge("Command", R"({"kind":"arm","by":"Ada"})"), "");
    // THEN they pass, and what says nothing does not
    for (const char* name : {"Status", "Campaign", "Parameters", "Events", "Plan", "CommandReply",
                             "Configuration", "Problem", "Readiness", "Command"})
        EXPECT_NE(judge(name, "{}"), "") << name;
    EXPECT_NE(judge("Status", "{}").find("campaign "), std::string::npos);
    EXPECT_NE(judge("Campaign", "{}").find("state "), std::string::npos);
    EXPECT_EQ(judge("Command", "{}"), "kind by ");
}

}  // namespace
}  // namespace vibrig::serve
