#include "daemon/log/log_sink.hpp"

#include <fcntl.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string_view>
#include <system_error>

namespace vibrig::log {
namespace {

class Sink final : public spdlog::sinks::base_sink<std::mutex> {
  public:
    Sink(LogQueue& queue, bool colours) : queue_(queue), colours_(colours) {}

  protected:
    void sink_it_(const spdlog::details::log_msg& message) override {
        spdlog::memory_buf_t text;
        formatter_->format(message, text);
        std::string line(text.data(), text.size());
        if (colours_ && message.color_range_end > message.color_range_start) {
            line.insert(message.color_range_end, "\033[0m");
            line.insert(message.color_range_start, colour_of(message.level));
        }
        queue_.put(std::move(line));
    }
    void flush_() override {}

  private:
    static const char* colour_of(spdlog::level::level_enum level) {
        return level >= spdlog::level::err    ? "\033[31m"
               : level == spdlog::level::warn ? "\033[33m"
                                              : "\033[32m";
    }
    LogQueue& queue_;
    const bool colours_;
};

}  // namespace

void log_through(LogQueue& queue, const std::string& level, bool colours) {
    spdlog::set_default_logger(
        std::make_shared<spdlog::logger>("vibrigd", std::make_shared<Sink>(queue, colours)));
    spdlog::set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %^%l%$ %v", spdlog::pattern_time_type::utc);
    spdlog::set_level(spdlog::level::from_str(level));
}

int open_log_file(const std::string& path) {
    constexpr int kMode = 0644;
    const int descriptor = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, kMode);
    if (descriptor < 0)
        throw std::system_error(
            errno, std::generic_category(),
            "log.file: found \"" + path + "\", expected a file that can be written");
    return descriptor;
}

bool shows_colours(int descriptor) {
    const char* const unwanted = std::getenv("NO_COLOR");
    return ::isatty(descriptor) == 1 && (unwanted == nullptr || *unwanted == '\0');
}

}  // namespace vibrig::log
