#include "daemon/record/pre_trip.hpp"

#include <fcntl.h>
#include <pthread.h>
#include <spdlog/fmt/chrono.h>
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

#include "estimator/filter/angles.hpp"
#include "proto/json_text.hpp"

namespace vibrig::record {

using drivers::Time;

namespace {

// The simulated rig may run hundreds of times as fast as time: 8192 samples are 1 s of it.
constexpr auto kPreTripPeriod = std::chrono::milliseconds(100);

std::string moment(std::int64_t utc_ns) {
    const auto ms = utc_ns / 1'000'000;
    return fmt::format("{:%Y%m%dT%H%M%S}.{:03d}Z", fmt::gmtime(static_cast<std::time_t>(ms / 1000)),
                       ms % 1000);
}

nlohmann::ordered_json line_of(const drivers::Sample& sample) {
    std::array<double, 3> angle_deg = sample.angle;
    for (double& angle : angle_deg) angle *= estimator::kDegPerRad;
    nlohmann::ordered_json quality = nlohmann::ordered_json::object();
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        const auto channel = static_cast<drivers::Channel>(c);
        quality[drivers::name_of(channel)] = drivers::name_of(sample.of(channel));
    }
    return {{"time_s", drivers::to_seconds(sample.time)},
            {"sequence", sample.sequence},
            {"lost_before", sample.dropped_before},
            {"angle_deg", angle_deg},
            {"force_g", sample.force},
            {"table_g", sample.table_accel},
            {"quality", std::move(quality)}};
}

/// On disk before it gets its name: a name is a whole file.
void rename_durably(const std::filesystem::path& from, const std::filesystem::path& to) {
    const int file = ::open(from.c_str(), O_RDONLY | O_CLOEXEC);
    const bool synced = file >= 0 && ::fsync(file) == 0;
    const int error = errno;
    if (file >= 0) ::close(file);
    if (!synced) throw std::runtime_error(std::strerror(error));
    std::filesystem::rename(from, to);
}

}  // namespace

PreTrip::PreTrip(std::string folder, Time sample_period, Events events, EventSink tell)
    : folder_(std::move(folder)),
      events_(std::move(events)),
      tell_(std::move(tell)),
      kept_(static_cast<std::size_t>(kSpan / drivers::checked_period("pre-trip", sample_period)) +
            1) {}

PreTrip::~PreTrip() { stop(); }

void PreTrip::start() {
    thread_ = std::thread([this] { loop(); });
    ::pthread_setname_np(thread_.native_handle(), "pre-trip");
}

void PreTrip::stop() noexcept {
    {
        const std::lock_guard lock(mutex_);
        stop_ = true;
        changed_.notify_all();
    }
    if (thread_.joinable()) thread_.join();
}

void PreTrip::tripped(Cause cause) {
    const std::lock_guard lock(mutex_);
    asked_ = std::move(cause);
    changed_.notify_all();
}

void PreTrip::loop() {
    for (bool last = false; !last;) {
        std::optional<Cause> cause;
        {
            std::unique_lock lock(mutex_);
            changed_.wait_for(lock, kPreTripPeriod, [this] { return stop_ || asked_; });
            cause = std::exchange(asked_, std::nullopt);
            last = stop_;
        }
        take();
        if (!cause) continue;
        take_until(cause->time);
        save(*cause);
    }
}

void PreTrip::take() {
    while (ring_.consume([this](const drivers::Sample& sample) {
        kept_[next_] = sample;
        next_ = (next_ + 1) % kept_.size();
        if (filled_ < kept_.size()) ++filled_;
    }) > 0) {
    }
}

/// The sample that tripped may still be on its way; a silent bus brings none.
void PreTrip::take_until(Time time) {
    const auto newest = [this] { return kept_[(next_ + kept_.size() - 1) % kept_.size()].time; };
    for (int tries = 0; tries < 10 && newest() < time; ++tries) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        take();
    }
}

void PreTrip::save(const Cause& cause) {
    const auto path = std::filesystem::path(folder_) /
                      fmt::format("trip-{}-{}.jsonl", moment(cause.utc_ns), cause.condition);
    auto unfinished = path;
    unfinished += ".new";
    try {
        std::filesystem::create_directories(folder_);
        const std::size_t samples = write(cause, unfinished);
        rename_durably(unfinished, path);
        tell_(Severity::info,
              fmt::format("{} samples before the trip in {}", samples, path.string()));
    } catch (const std::exception& error) {
        std::error_code ignored;
        std::filesystem::remove(unfinished, ignored);
        tell_(Severity::alarm, fmt::format("cannot save what was before the trip in {}: {}",
                                           path.string(), error.what()));
    }
}

std::size_t PreTrip::write(const Cause& cause, const std::string& path) const {
    std::ofstream file(path, std::ios::trunc);
    const auto put = [&file](const nlohmann::ordered_json& line) {
        // A text from a file or a person may hold anything.
        file << proto::json_text(line) << '\n';
    };
    const auto recent = [&cause](Time time) { return time >= cause.time - kSpan; };
    put({{"trip", cause.name},
         {"condition", cause.condition},
         {"text", cause.text},
         {"time_s", drivers::to_seconds(cause.time)},
         {"utc", moment(cause.utc_ns)},
         {"samples_lost", ring_.counts().dropped}});
    for (const EventRecord& event : events_()) {
        if (!recent(event.time)) continue;
        put({{"time_s", drivers::to_seconds(event.time)},
             {"severity", name_of(event.severity)},
             {"source", event.source},
             {"event", event.text}});
    }
    std::size_t samples = 0;
    for (std::size_t i = 0; i < filled_; ++i) {
        const auto& sample = kept_[(next_ + kept_.size() - filled_ + i) % kept_.size()];
        if (!recent(sample.time)) continue;
        put(line_of(sample));
        ++samples;
    }
    file.close();
    if (!file) throw std::runtime_error(std::strerror(errno));
    return samples;
}

}  // namespace vibrig::record
