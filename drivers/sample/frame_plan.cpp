#include "drivers/sample/frame_plan.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "drivers/sample/signal_binding.hpp"

namespace vibrig::drivers {

std::uint64_t MessagePlan::bits(std::span<const std::uint8_t> payload) const noexcept {
    if (multiplexor == nullptr) return bit;
    const auto raw = proto::decode_raw(*multiplexor, payload);
    if (!raw) return bit;
    std::uint64_t all = bit;
    for (const Group& group : groups)
        if (group.first <= *raw && *raw <= group.last) all |= group.bit;
    return all;
}

FramePlan::FramePlan(const proto::Dbc& dbc, const SignalBindings& names,
                     std::uint32_t samples_per_frame, bool units_checked)
    : dbc_(dbc) {
    // Another lab's DBC names most things otherwise: all that is missing is listed at once.
    std::vector<BindingError> missing;
    const auto bind = [this, units_checked, &missing](const char* key, const std::string& name,
                                                      const char* unit = "") -> BoundSignal {
        const std::string place = std::string("can.signals.") + key;
        try {
            const BoundSignal bound = bind_signal(dbc_, place, name);
            if (units_checked) expect_unit(bound, place, name, unit);
            return bound;
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
        const BoundSignal value = bind(c.name, names.*c.signal, c.unit);
        const BoundSignal valid =
            c.valid == nullptr ? BoundSignal{}
                               : bind((c.name + std::string("_valid")).c_str(), names.*c.valid);
        if (!value) continue;
        bound_[index] = true;
        has_validity_[index] = static_cast<bool>(valid);
        const auto add = [&](const std::string& key, const std::string& name, bool validity) {
            for (std::uint32_t part = 0; part < samples_per_frame; ++part) {
                const BoundSignal of_part =
                    bind(key.c_str(), part == 0 ? name : name + '_' + std::to_string(part),
                         validity ? "" : c.unit);
                if (of_part)
                    plan_for(*of_part.message)
                        .channels.push_back({index, of_part.signal, validity, part});
            }
        };
        add(c.name, names.*c.signal, false);
        if (valid) add(c.name + std::string("_valid"), names.*c.valid, true);
    }
    if (samples_per_frame > 1 && !has_count_ && missing.empty())
        throw BindingError("can.signals.sync_count", names.sync_count,
                           "a counter, where can.samples_per_frame is more than 1");
    if (missing.empty() && std::ranges::none_of(bound_, [](bool b) { return b; })) {
        throw BindingError("can.signals", "",
                           "at least one measured channel, such as outer = \"Resolvers.Outer\"");
    }

    const SignalBindings usual;
    // Few rigs have more than one temperature: what nobody asked for need not be there.
    const auto if_there = [&](const std::string& name, const std::string& as_usual) {
        const std::size_t dot = name.find('.');
        const proto::Message* message = dbc_.find(std::string_view(name).substr(0, dot));
        const bool there = message != nullptr && dot != std::string::npos &&
                           message->find(std::string_view(name).substr(dot + 1)) != nullptr;
        return name == as_usual && !there ? none : name;
    };
    for (const StatusRow& row : kStatusTable) {
        const std::string& name = names.*row.signal;
        if (const BoundSignal bound =
                bind(row.name, row.sensor ? if_there(name, usual.*row.signal) : name, row.unit))
            plan_for(*bound.message).status.push_back({&row, bound.signal});
    }

    if (!missing.empty()) throw BindingError(std::move(missing));

    number_messages(names);
}

/// Gives bits to what makes a sample complete, and puts the messages where find() looks.
void FramePlan::number_messages(const SignalBindings& names) {
    unsigned used = 0;
    const auto next_bit = [&] {
        if (used == 64)
            throw BindingError("can.signals", "more than 64 messages and multiplex values",
                               "at most 64 that carry channels");
        complete_ |= std::uint64_t{1} << used;
        return std::uint64_t{1} << used++;
    };
    for (std::size_t i = 0; i < plans_.size(); ++i) {
        MessagePlan& plan = plans_[i];
        bool always = plan.count != nullptr;
        for (const auto& channel : plan.channels) {
            const proto::Signal& signal = *channel.signal;
            if (!signal.multiplex_value) {
                always = true;
                continue;
            }
            const std::uint32_t first = *signal.multiplex_value;
            const std::uint32_t last = signal.multiplex_last.value_or(first);
            const bool known = std::ranges::any_of(plan.groups, [&](const auto& group) {
                return group.first == first && group.last == last;
            });
            if (!known) plan.groups.push_back({first, last, next_bit()});
        }
        if (always) plan.bit = next_bit();
        if (!plan.groups.empty()) plan.multiplexor = plan.message->multiplexor();
        if ((always || !plan.groups.empty()) && has_count_ && plan.count == nullptr)
            plan.low = plan.message->find(names.message_sync_signal);
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
