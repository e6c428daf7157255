#include "daemon/app/events.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "proto/text.hpp"

namespace vibrig {

void Events::log(Severity severity, const std::string& source, const std::string& text) {
    enter(severity, source, text);
    // No page about a pager that fails; a fit can wait until somebody reads the log.
    if (severity == Severity::alarm && source != "annunciator" && source != "fit")
        announce(drivers::HornPattern::alarm, text);
}

void Events::announce(drivers::HornPattern pattern, const std::string& text) {
    if (drivers::Annunciator* const annunciator = annunciator_.load(); annunciator != nullptr)
        annunciator->announce(pattern, text);
}

void Events::enter(Severity severity, const std::string& source, const std::string& text) {
    EventRecord record;
    record.utc_ns = utc_now();
    record.time = clock_.now();
    record.severity = severity;
    record.source = source;
    // Every event comes through here, and much of what they say comes from outside.
    record.text = proto::printable(text, proto::kLongestLine);
    list_.append(record);
    if (journal_ != nullptr) journal_->event(record);
    if (recorder_ != nullptr) recorder_->event(record);
    const auto level = severity == Severity::info      ? spdlog::level::info
                       : severity == Severity::warning ? spdlog::level::warn
                                                       : spdlog::level::err;
    spdlog::log(level, "{}: {}", source, record.text);
}

EventSink Events::sink(std::string source) {
    return [this, source = std::move(source)](Severity severity, const std::string& text) {
        log(severity, source, text);
    };
}

}  // namespace vibrig
