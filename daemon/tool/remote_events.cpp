#include <google/protobuf/util/json_util.h>

#include <chrono>
#include <iostream>
#include <thread>

#include "daemon/serve/render.hpp"
#include "daemon/tool/remote.hpp"

namespace vibrig::tool {
namespace {

constexpr auto kPause = std::chrono::milliseconds(500);

void print(const v1::Event& event, bool json) {
    if (!json) {
        std::cout << serve::render_event(event) << '\n';
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

/// Prints what is new; false when there was nothing.
bool print_new(serve::Client& client, Cursor& cursor, bool json) {
    v1::Events answer;
    parse_answer(client.get("/api/v1/events?after=" + std::to_string(cursor.after)), answer);
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
    return answer.events_size() > 0;
}

}  // namespace

int show_events(const EventOptions& options) {
    serve::Client client(options.at);
    Cursor cursor;
    while (print_new(client, cursor, options.json)) {
    }
    bool gone = false;
    while (options.follow && std::cout.good()) {
        std::this_thread::sleep_for(kPause);
        try {
            while (print_new(client, cursor, options.json)) {
            }
            if (gone) std::cerr << "vibrig: vibrigd answers again\n";
            gone = false;
        } catch (const serve::ClientError& error) {
            if (!gone) std::cerr << "vibrig: " << error.what() << "; trying again\n";
            gone = true;
        }
    }
    return 0;
}

}  // namespace vibrig::tool
