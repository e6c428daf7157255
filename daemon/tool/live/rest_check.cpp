// vibrig selftest --rest: the configuration held against free drift and gravity, nothing armed.
#include <chrono>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "daemon/results/exit_status.hpp"
#include "daemon/tool/colour.hpp"
#include "daemon/tool/live/commission_client.hpp"
#include "daemon/tool/live/remote.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

constexpr auto kLookAtRest = std::chrono::milliseconds(300);

/// What was found, for people.
void print_rest_check(std::ostream& out, const v1::RestCheck& check) {
    const bool right = check.verdict() == "right";
    const bool completed = check.verdict() != "not completed";
    const std::string head = right                       ? "the rig is what its configuration says"
                             : !completed                ? "NOT COMPLETED: " + check.message()
                             : check.verdict() == "told" ? "OFF: " + check.message()
                                                         : "REFUSED: " + check.message();
    print_wrapped(out, right ? colour::good(head) : colour::bad(head));
    if (right || !completed) return;
    for (const auto& suspect : check.suspects()) print_wrapped(out, "suspect: " + suspect);
    if (check.suspects().empty()) out << "no single key explains it\n";
}

}  // namespace

int check_at_rest(const serve::Address& at, const std::string& by, bool json) {
    if (!at.host.empty())
        throw std::runtime_error(
            "--rest: found --host, expected the local socket: who lets gimbals move stands beside "
            "them");
    serve::Client client(at);
    wait_for_rest(client);
    const auto command = command_of(v1::Command::selftest, by, "attended rest");
    if (const auto why = refusal_of(client, command); !why.empty()) {
        if (json)
            std::cout << proto::json_text(
                             nlohmann::ordered_json{{"outcome", "refused"}, {"message", why}}, 1)
                      << '\n';
        std::cerr << "vibrig: " << why << '\n';
        return kNo;
    }
    std::ostream& out = json ? std::cerr : std::cout;
    v1::Status status;
    std::string shown;
    do {
        std::this_thread::sleep_for(kLookAtRest);
        commission_command(client, by, {{"do", "attend"}});
        status = ask_status(client);
        const auto& doing = status.campaign().reason();
        if (status.campaign().state() == v1::Campaign::checking && doing != shown)
            out << (shown = doing) << std::endl;
    } while (status.rest_check().verdict() == "running");
    const auto& check = status.rest_check();
    if (status.simulated()) out << "SIMULATED: it says nothing of a real rig\n";
    print_rest_check(out, check);
    if (json) {
        nlohmann::ordered_json found{
            {"outcome", check.verdict()}, {"simulated", status.simulated()},
            {"by", check.by()},           {"utc_ns", check.utc_ns()},
            {"message", check.message()}, {"suspects", nlohmann::ordered_json::array()}};
        for (const auto& suspect : check.suspects()) found["suspects"].push_back(suspect);
        std::cout << proto::json_text(found, 1) << '\n';
    }
    return check.verdict() == "right" ? 0 : kNo;
}

}  // namespace vibrig::tool
