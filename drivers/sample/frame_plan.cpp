#include "drivers/sample/frame_plan.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sample/channels.hpp"
#include "drivers/sample/signal_binding.hpp"

namespace vibrig::drivers {

FramePlan::FramePlan(const proto::Dbc& dbc, const SignalBindings& names) : dbc_(dbc) {
    // Another lab's DBC names most things otherwise: all that is missing is told at once.
    std::vector<BindingError> missing;
    const auto bind = [this, &missing](const char* key, const std::string& name) -> BoundSignal {
        try {
            return bind_signal(dbc_, std::string("can.signals.") + key, name);
        } catch (const BindingError& error) {
            missing.push_back(error);
            return {};
        }
    };

    if (const BoundSignal sync = bind("sync_count", names.sync_count)) {
        plan_for(*sync.message).count = sync.signal;
        has_count_ = true;
    }

    const std::string none;
    for (const ChannelRow& c : kChannelTable) {
        const auto index = static_cast<std::size_t>(c.channel);
        const BoundSignal value = bind(c.name, names.*c.signal);
        const BoundSignal valid =
            c.valid == nullptr ? BoundSignal{}
                               : bind((c.name + std::string("_valid")).c_str(), names.*c.valid);
        if (!value) continue;
        bound_[index] = true;
        plan_for(*value.message).channels.push_back({index, value.signal, false});
        if (valid) {
            has_validity_[index] = true;
            plan_for(*valid.message).channels.push_back({index, valid.signal, true});
        }
    }
    if (missing.empty() && std::ranges::none_of(bound_, [](bool b) { return b; })) {
        throw BindingError("can.signals", "",
                           "at least one measured channel, such as outer = \"Resolvers.Outer\"");
    }

    using Field = MessagePlan::StatusField;
    struct StatusName {
        Field field;
        const char* key;
        const std::string& name;
    };
    const SignalBindings usual;
    // Few rigs have more than one temperature: what nobody asked for need not be there.
    const auto if_there = [&](const std::string& name, const std::string& as_usual) {
        const std::size_t dot = name.find('.');
        const proto::Message* message = dbc_.find(std::string_view(name).substr(0, dot));
        const bool there = message != nullptr && dot != std::string::npos &&
                           message->find(std::string_view(name).substr(dot + 1)) != nullptr;
        return name == as_usual && !there ? none : name;
    };
    const std::array<std::string, 4> sensors{
        if_there(names.temperature_case, usual.temperature_case),
        if_there(names.temperature_gyro_x, usual.temperature_gyro_x),
        if_there(names.temperature_gyro_y, usual.temperature_gyro_y),
        if_there(names.temperature_gyro_z, usual.temperature_gyro_z)};
    const std::array<StatusName, 12> status{{
        {Field::loop_closed, "loop_closed", names.loop_closed},
        {Field::gyros_at_speed, "gyros_at_speed", names.gyros_at_speed},
        {Field::ready, "ready", names.ready},
        {Field::fault, "fault", names.fault},
        {Field::temperature, "temperature", names.temperature},
        {Field::in_position, "in_position", names.in_position},
        {Field::slewing, "slewing", names.slewing},
        {Field::command_echo, "command_echo", names.command_echo},
        {Field::temperature_case, "temperature_case", sensors[0]},
        {Field::temperature_gyro_x, "temperature_gyro_x", sensors[1]},
        {Field::temperature_gyro_y, "temperature_gyro_y", sensors[2]},
        {Field::temperature_gyro_z, "temperature_gyro_z", sensors[3]},
    }};
    for (const StatusName& s : status) {
        if (const BoundSignal bound = bind(s.key, s.name)) {
            plan_for(*bound.message).status.push_back({s.field, bound.signal});
        }
    }

    if (!missing.empty()) throw BindingError(std::move(missing));

    for (std::size_t i = 0; i < plans_.size(); ++i) {
        MessagePlan& plan = plans_[i];
        if (plan.count != nullptr || !plan.channels.empty()) {
            plan.bit = std::uint64_t{1} << i;  // at most 26 names can be bound
            complete_ |= plan.bit;
            if (has_count_ && plan.count == nullptr)
                plan.low = plan.message->find(names.message_sync_signal);
        }
        const auto entry = static_cast<std::uint16_t>(i + 1);
        if (plan.message->extended) {
            extended_.emplace_back(plan.message->id, entry);
        } else if (plan.message->id < standard_.size()) {
            standard_[plan.message->id] = entry;
        }
    }
    std::ranges::sort(extended_);
}

MessagePlan& FramePlan::plan_for(const proto::Message& message) {
    const auto known = std::ranges::find(plans_, &message, &MessagePlan::message);
    if (known != plans_.end()) return *known;
    plans_.push_back({});
    plans_.back().message = &message;
    return plans_.back();
}

const MessagePlan* FramePlan::find(std::uint32_t id, bool extended) const noexcept {
    std::size_t entry = 0;
    if (!extended) {
        entry = id < standard_.size() ? standard_[id] : 0;
    } else {
        const auto at = std::ranges::lower_bound(extended_, id, {},
                                                 &std::pair<std::uint32_t, std::uint16_t>::first);
        if (at != extended_.end() && at->first == id) entry = at->second;
    }
    return entry == 0 ? nullptr : &plans_[entry - 1];
}

}  // namespace vibrig::drivers
