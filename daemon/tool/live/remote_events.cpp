#include <google/protobuf/util/json_util.h>

#include <chrono>
#include <iostream>
#include <thread>
#include <utility>

#include "daemon/serve/render.hpp"
#include "daemon/tool/colour.hpp"
#include "daemon/tool/live/remote.hpp"

namespace vibrig::tool {
namespace {

constexpr auto kPause = std::chrono::milliseconds(500);
constexpr int kAtOnce = 1000;
constexpr const char* kStream = "/api/v1/stream?status=false&rate_hz=10&after=";

void print(const v1::Event& event, bool json) {
    if (!json) {
        const std::string line = serve::render_event(event);
        const auto severity = event.severity();
        const bool bad = severity == v1::Event::alarm || severity == v1::Event::trip;
        std::cout << (bad                              ? colour::bad(line)
                      : severity == v1::Event::warning ? colour::warning(line)
                                                       : line)
                  << '\n';
        return;
    }
    google::protobuf::util::JsonPrintOptions options;
    options.always_print_primitive_fields = true;
    options.preserve_proto_field_names = true;
    std::string text;
    if (google::protobuf::util::MessageToJsonString(event, &text, options).ok()) {
        std::cout << text << '\n';
    }
}

/// Where the last answer ended.
struct Cursor {
    std::string instance;
    std::uint64_t after = 0;
};

/// Prints what is new; true where there is more than one answer holds. What is told meanwhile is
/// not waited for: a daemon that is never quiet would never be done with.
bool print_new(serve::Client& client, Cursor& cursor, bool json) {
    v1::Events answer;
    parse_answer(client.get("/api/v1/events?after=" + std::to_string(cursor.after) +
                            "&limit=" + std::to_string(kAtOnce)),
                 answer);
    if (!cursor.instance.empty() && answer.instance() != cursor.instance) {
        std::cerr << "vibrig: the daemon has started anew\n";
        cursor = {answer.instance(), 0};
        return true;
    }
    cursor.instance = answer.instance();
    for (const v1::Event& event : answer.events()) {
        print(event, json);
        cursor.after = event.id();
    }
    std::cout.flush();
    return answer.events_size() >= kAtOnce;
}

/// A message of the stream; false: it is another daemon's, whose events count anew, or nobody
/// reads.
bool print_message(const std::string& text, Cursor& cursor, bool json) {
    v1::Events message;  // "hello" has the instance, "events" the events
    parse_answer({200, text}, message);
    if (!message.instance().empty() && message.instance() != cursor.instance) return false;
    for (const v1::Event& event : message.events()) {
        print(event, json);
        cursor.after = event.id();
    }
    std::cout.flush();
    return std::cout.good();
}

}  // namespace

int show_events(const EventOptions& options) {
    serve::Client client(options.at);
    Cursor cursor;
    const auto catch_up = [&] {
        while (print_new(client, cursor, options.json)) {
        }
    };
    if (!options.follow) {
        catch_up();
        return 0;
    }
    print_new(client, cursor, options.json);  // who never answered is nobody to wait for
    bool gone = false;
    while (std::cout.good()) {
        try {
            catch_up();
            if (std::exchange(gone, false)) std::cerr << "vibrig: vibrigd answers again\n";
            client.follow(kStream + std::to_string(cursor.after), [&](const std::string& text) {
                return print_message(text, cursor, options.json);
            });
        } catch (const serve::ClientError& error) {
            if (!std::exchange(gone, true))
                std::cerr << "vibrig: " << error.what() << "; trying again\n";
            std::this_thread::sleep_for(kPause);
        }
    }
    return 0;
}

}  // namespace vibrig::tool
