// The shaker's parts of the commissioning record: a run at 0 g, there each button of the emergency
// stop pressed once, then a proof of the safe state, all made by the daemon.

#include <algorithm>
#include <iostream>

#include "daemon/tool/live/commission_client.hpp"
#include "daemon/tool/live/remote.hpp"
#include "proto/json_text.hpp"

namespace vibrig::tool {

namespace {

bool person_agrees(const CommissionOptions& options, std::ostream& out, const std::string& asked) {
    print_wrapped(out, "? " + asked + " [yes or no]");
    if (options.yes) return true;
    for (std::string line; out << "> " << std::flush, std::getline(std::cin, line);) {
        if (line == "yes" || line == "y") return true;
        if (line == "no" || line == "n") return false;
        print_wrapped(out, "  found \"" + line + "\", expected yes or no");
    }
    throw CommissionRefused("nobody answers: ended");
}

/// The trip of a button that was pressed on purpose.
void acknowledge_press(serve::Client& client, const CommissionOptions& options, std::ostream& out,
                       const std::string& button) {
    if (!person_agrees(
            options, out,
            "The trip of \"" + button + "\" is latched. Acknowledge it, " + options.by + "?"))
        throw CommissionRefused("not acknowledged: vibrig ack trip --by NAME, then go on");
    const auto command = command_of(v1::Command::acknowledge, options.by, "trip");
    if (const auto why = refusal_of(client, command); !why.empty())
        throw CommissionRefused(why + ": the buttons pressed so far are kept, go on after it");
}

bool asked_for(const CommissionOptions& options, const char* part) {
    return std::ranges::find(options.parts, part) != options.parts.end();
}

/// Each while the controller runs at 0 g. Empty: they have passed.
std::string press_buttons(serve::Client& client, const CommissionOptions& options,
                          const CommissionJson& left, std::ostream& out) {
    for (const std::string button : left) {
        if (!person_agrees(options, out,
                           "The controller will run at 0 g. Stand at the button \"" + button +
                               "\" and press it when asked. Ready?"))
            throw CommissionRefused("the button \"" + button + "\" was not pressed");
        if (auto why =
                prove_safe_state(client, options.by, "at_zero emergency_stop " + button, out);
            !why.empty())
            return why;
        acknowledge_press(client, options, out, button);
    }
    return {};
}

/// What stops it is tried at 0 g, then it shakes. Each is an arming of its own. Empty: it has
/// passed.
std::string prove_all(serve::Client& client, const CommissionOptions& options,
                      const CommissionJson& record, std::ostream& out) {
    if (record["ran_at_zero"] != true) {
        if (!person_agrees(options, out,
                           "The controller will run at 0 g, and its watchdog will stop it twice. "
                           "Nothing should move; the chain is closed, its power on. Ready?"))
            throw CommissionRefused("it does not run at 0 g without a person's word");
        if (auto why = prove_safe_state(client, options.by, "at_zero", out); !why.empty())
            return "at 0 g: " + why;
    }
    const auto& parts = record["parts"];
    // Before it shakes for the first time whoever asked for what: else the daemon refuses it.
    const bool understood =
        parts["units"]["proven"] == true && parts["registers"]["proven"] == true;
    if (asked_for(options, "stop") || !understood)
        if (auto why = press_buttons(client, options, record["buttons_left"], out); !why.empty())
            return why;
    const bool stop_alone = options.parts == std::vector<std::string>{"stop"};
    if (stop_alone && parts["units"]["proven"] == true && parts["excitation"]["proven"] == true)
        return {};
    if (!person_agrees(options, out, "Now the table will shake, 0.5 g at most. Ready?"))
        throw CommissionRefused("it does not shake without a person's word");
    return prove_safe_state(client, options.by, "", out);
}

}  // namespace

int commission_shaker(const CommissionOptions& options) {
    std::ostream& out = options.json ? std::cerr : std::cout;
    serve::Client client(options.at);
    auto state = commission_state(client, options.by, 0);
    if (options.yes && state["simulated"] != true)
        throw std::runtime_error("--yes: persons answer on a real rig");
    if (state["record"]["demanded"] != true)
        throw CommissionRefused("this rig is armed without a record: nothing is kept of it");
    for (const char* below : {"bus", "gimbals", "accelerometers", "earth", "gyros"})
        if (const auto& part = state["record"]["parts"][below]; part["proven"] != true)
            throw CommissionRefused(std::string("the platform's parts first: ") + below + ": " +
                                    part["why"].get<std::string>());
    std::string why;
    if (!options.display.empty())
        print_wrapped(out, commission_command(client, options.by,
                                              {{"do", "state"},
                                               {"part", "units"},
                                               {"display", options.display},
                                               {"reference_g", options.reference_g}}));
    else
        why = prove_all(client, options, state["record"], out);
    state = CommissionJson::parse(
        commission_command(client, options.by, {{"do", "read"}, {"shaker", true}}));
    const auto& parts = state["record"]["parts"];
    const auto& lacking = state["record"]["lacking"];
    bool all = why.empty();
    for (const auto& part : options.parts) {
        const bool proven = parts[part]["proven"];
        all = all && proven;
        print_wrapped(
            out, part + (proven ? ": proven"
                                : " NOT: " +
                                      lacking.value(part, parts[part]["why"].get<std::string>())));
    }
    if (!why.empty()) print_wrapped(out, "REFUSED: " + why);
    const char* outcome = !why.empty() ? "refused" : all ? "decided" : "undecided";
    if (options.json)
        std::cout << proto::json_text(CommissionJson{{"outcome", outcome},
                                                     {"why", why},
                                                     {"simulated", state["simulated"]},
                                                     {"parts", parts}},
                                      1)
                  << '\n';
    return all ? 0 : kNo;
}

}  // namespace vibrig::tool
