#include "daemon/serve/stream_feed.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "daemon/serve/status_json.hpp"
#include "daemon/serve/status_server.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"
#include "tests/unit/daemon/serve/raw_connection.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::serve {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

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

}  // namespace
}  // namespace vibrig::serve
