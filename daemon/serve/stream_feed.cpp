#include "daemon/serve/stream_feed.hpp"

#include <charconv>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "daemon/serve/event_log.hpp"
#include "daemon/serve/status_json.hpp"

namespace vibrig::serve {

using Json = nlohmann::json;

namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kYoung = std::chrono::milliseconds(20);    // the same status, whoever asks
constexpr auto kShared = std::chrono::milliseconds(200);  // among those due together
constexpr std::size_t kMadeKept = 64;
constexpr double kDefaultRate_hz = 1;

/// The merge patch that makes `after` of `before`; both objects.
Json difference(const Json& before, const Json& after) {
    Json patch = Json::object();
    for (const auto& [key, value] : before.items()) {
        if (!after.contains(key)) patch[key] = nullptr;
    }
    for (const auto& [key, value] : after.items()) {
        const auto old = before.find(key);
        if (old != before.end() && *old == value) continue;
        const bool inside = old != before.end() && old->is_object() && value.is_object();
        patch[key] = inside ? difference(*old, value) : value;
    }
    return patch;
}

std::shared_ptr<const std::string> shared(std::string text) {
    return std::make_shared<const std::string>(std::move(text));
}

}  // namespace

struct Frame {
    std::uint64_t number = 0;
    Clock::time_point made;
    std::string text;
    mutable Json parsed = nullptr;
    [[nodiscard]] const Json& tree() const {
        if (parsed.is_null()) parsed = Json::parse(text);
        return parsed;
    }
};

const std::string& StreamFeed::newest_text() {
    const auto now = Clock::now();
    return newest(now, now)->text;
}

std::shared_ptr<const Frame> StreamFeed::newest(Clock::time_point now, Clock::time_point since) {
    if (newest_) {
        const auto age = now - newest_->made;
        if (age < kYoung || (newest_->made >= since && age < kShared)) return newest_;
    }
    auto frame = std::make_shared<Frame>();
    frame->number = ++number_;
    frame->made = now;
    frame->text = status_json(source_.status());
    newest_ = std::move(frame);
    return newest_;
}

std::shared_ptr<const std::string> StreamFeed::change(const std::shared_ptr<const Frame>& before,
                                                      const std::shared_ptr<const Frame>& after) {
    const std::uint64_t from = before ? before->number : 0;
    for (const Made& made : made_) {
        if (made.from == from && made.to == after->number) return made.text;
    }
    std::shared_ptr<const std::string> text;
    if (!before) {
        text = shared(R"({"type":"status","status":)" + after->text + '}');
    } else if (Json patch = difference(before->tree(), after->tree()); !patch.empty()) {
        text = shared(R"({"type":"delta","patch":)" + patch.dump() + '}');
    }
    made_.push_back({from, after->number, text});
    if (made_.size() > kMadeKept) made_.pop_front();
    return text;
}

StreamClient::StreamClient(StreamFeed& feed, std::string instance, Role role, double rate_hz,
                           std::uint64_t after_event, bool with_status)
    : feed_(feed),
      instance_(std::move(instance)),
      role_(role),
      period_(
          std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / rate_hz))),
      event_(after_event),
      with_status_(with_status) {}

std::shared_ptr<const std::string> StreamClient::next(Clock::time_point now) {
    if (!std::exchange(greeted_, true)) {
        return shared(R"({"type":"hello","instance":")" + instance_ + R"(","role":")" +
                      name_of(role_) + "\"}");
    }
    if (!events_looked_at_) {
        // Once per look: a burst that never ends must not keep the status from coming.
        events_looked_at_ = true;
        auto events = feed_.source().events(event_, EventLog::kCapacity);
        if (!caught_up_) {
            caught_up_ = true;
            if (events.size() > kMostEventsBehind) {
                events.erase(events.begin(),
                             events.end() - static_cast<std::ptrdiff_t>(kMostEventsBehind));
            }
        } else if (events.size() > kMostEventsBehind) {
            throw std::runtime_error("more than " + std::to_string(kMostEventsBehind) +
                                     " events wait for this client");
        }
        if (!events.empty()) {
            event_ = events.back().id;
            std::string text = R"({"type":"events","events":[)";
            for (const EventRecord& event : events) {
                if (text.back() != '[') text += ',';
                text += event_json(event);
            }
            return shared(text + "]}");
        }
    }
    if (now < due_) {
        return {};
    }
    // On a grid: clients of one rate are due together and share what is made for them. No burst
    // afterwards to make up for what was slow.
    const Clock::time_point began(now.time_since_epoch() / period_ * period_);
    due_ = began + period_;
    events_looked_at_ = false;
    if (!with_status_) return {};
    const auto frame = feed_.newest(now, began);
    auto text = feed_.change(sent_, frame);
    sent_ = frame;
    return text;
}

void StreamClient::take(const std::string& text) {
    const Json asked = Json::parse(text, nullptr, false);
    if (!asked.is_object() || !asked.contains("rate_hz") || !asked["rate_hz"].is_number())
        throw std::invalid_argument(R"(expected {"rate_hz": NUMBER})");
    const double rate = parse_rate(asked["rate_hz"].dump());
    period_ = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1 / rate));
}

double parse_rate(std::string_view text) {
    if (text.empty()) return kDefaultRate_hz;
    double rate = 0;
    const char* const end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, rate);
    if (error != std::errc{} || stop != end || !(rate >= StreamClient::kSlowest_hz) ||
        !(rate <= StreamClient::kFastest_hz)) {
        throw std::invalid_argument("rate_hz: expected a number from 0.1 to 20");
    }
    return rate;
}

}  // namespace vibrig::serve
