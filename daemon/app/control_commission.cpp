// What the tool for commissioning asks: of the procedure, and of the record.
#include "daemon/app/control_loop.hpp"
#include "daemon/commission/bus_bits.hpp"
#include "proto/json_text.hpp"
#include "proto/person_name.hpp"

namespace vibrig {

using commission::Json;
using drivers::Time;

void ControlLoop::commission(WaitingCommand waiting, Time now) {
    const CommandRequest& request = waiting.request;
    const Json what = Json::parse(request.argument, nullptr, false);
    if (!what.is_object() || !what.contains("do") || !what["do"].is_string())
        return answer(waiting, {false, "commission: found no JSON object with \"do\""});
    const std::string word = what["do"];
    if (word == "attend") {
        if (attendance_ && proto::same_person(request.by, attendance_->by))
            attendance_->steady = drivers::steady_now();
        return reply_later(waiting, {true, "there"});
    }
    CommandReply reply;
    try {
        reply = commissioned(request, word, what, now);
    } catch (const std::exception& error) {  // of files that others write, or take away
        reply = {false, std::string("commission: ") + error.what()};
    }
    if (word == "read" && reply.accepted)  // several times a second: no row of the audit
        reply_later(waiting, std::move(reply));
    else
        answer(waiting, reply);
}

/// Throws std::exception: a file cannot be read.
CommandReply ControlLoop::commissioned(const CommandRequest& request, const std::string& word,
                                       const Json& what, Time now) {
    if (word == "read") {
        commissioning_.attend(request.by);
        return {true, read_commissioning(what)};
    }
    if (word == "accept" || word == "state") return enter_in_record(request, what, now);
    if (word == "sign") return sign_record(request, what);
    return commissioning_.command(request, word, what, now);
}

std::string ControlLoop::read_commissioning(const Json& what) {
    const auto after = what.contains("after") && what["after"].is_number_unsigned()
                           ? what["after"].get<std::size_t>()
                           : 0;
    Json record = book_.status(utc_now());
    record["buttons_left"] = campaign_.proof().buttons_left();
    record["ran_at_zero"] = campaign_.proof().ran_at_zero();
    record["unproven_bits"] = what.contains("bits")
                                  ? Json(commission::unproven_bits(loaded_, parts_.dbc))
                                  : Json::array();
    record["lacking"] = Json::object();
    if (what.contains("shaker"))  // why parts are not given: no business of a poll
        for (const auto& [part, why] : shaker_parts({}).lacking)
            record["lacking"][name_of(part)] = why;
    const Json reply{{"record", record},
                     {"simulated", configuration_.simulated()},
                     {"configuration", loaded_.path},
                     {"progress", commissioning_.progress()},
                     {"procedure", commissioning_.state(after)}};
    return proto::json_text(reply);
}

}  // namespace vibrig
