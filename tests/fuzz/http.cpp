// A request to the status server: any answer is a whole one, and only an operator's command gets
// through. Lines of the input: role, method, target, type, Host, Origin; the rest is the body.
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>

#include "daemon/serve/api.hpp"
#include "daemon/serve/stream_feed.hpp"
#include "tests/unit/daemon/serve/fake_source.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace vibrig::serve;
    std::string_view left(reinterpret_cast<const char*>(data), size);
    std::array<std::string_view, 6> lines;
    for (auto& line : lines) {
        line = left.substr(0, left.find('\n'));
        left.remove_prefix(std::min(left.size(), line.size() + 1));
    }
    Caller caller;
    caller.role = role_named(std::string(lines[0]));
    caller.identity = "fuzz";
    caller.browser = lines[0].ends_with('r');  // viewer, operator
    caller.host = "127.0.0.1:8090";
    const ApiRequest request{lines[1], lines[2], lines[3], lines[4], lines[5], std::string(left)};

    FakeSource source;
    // A command is carried out at once: what waits is the server's, not the parser's.
    Api api(source, "fuzz",
            [&source](const vibrig::CommandRequest& command,
                      const std::function<void(vibrig::CommandReply)>& done) {
                done(source.command(command));
                return true;
            });
    const ApiAnswer browser = api.check_browser(request, caller);
    ApiAnswer answer;
    answer.status = 0;
    api.answer(request, caller, [&answer](const ApiAnswer& given) { answer = given; });
    if (browser.status < 200 || answer.status < 200 || answer.status > 599) std::abort();
    if (answer.content_type.find("json") != std::string::npos &&
        !nlohmann::json::accept(answer.body))
        std::abort();
    if (caller.role < Role::operate && !source.requests().empty()) std::abort();

    StreamClient client(api.feed(), "fuzz", caller.role, 1, 0);
    try {
        client.take(request.body);
    } catch (const std::invalid_argument&) {
    }
    return 0;
}
