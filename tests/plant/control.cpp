#include "tests/plant/control.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <optional>

#include "proto/text.hpp"

namespace vibrig::plant {
namespace {

constexpr std::size_t kLongest = 4096;

std::string_view trimmed(std::string_view text) {
    const auto begin = text.find_first_not_of(" \t\r");
    if (begin == std::string_view::npos) return {};
    return text.substr(begin, text.find_last_not_of(" \t\r") - begin + 1);
}

// None: the table is the controller's own.
std::optional<double> table_g(std::string_view text) {
    if (text == "own") return std::nullopt;
    double g = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), g);
    if (error != std::errc{} || end != text.data() + text.size() || !(g >= 0 && g <= 100)) {
        throw PlantError("table: found \"" + std::string(text) +
                         "\", expected own or an amplitude from 0 to 100 g");
    }
    return g;
}

double hold_s(std::string_view text) {
    double s = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), s);
    if (error != std::errc{} || end != text.data() + text.size() || !(s >= 0 && s <= 1e9)) {
        throw PlantError("hold: found \"" + std::string(text) +
                         "\", expected a time of the rig from 0 to 1e9 s");
    }
    return s;
}

}  // namespace

double speed_of(std::string_view text, const char* place) {
    if (text == "max") return 0;
    double speed = 0;
    if (!proto::read_number(text, speed) || !(speed >= 1e-3 && speed <= 1e6)) {
        throw PlantError(std::string(place) + ": found \"" + proto::printable(text) +
                         "\", expected max or a factor from 0.001 to 1e6");
    }
    return speed;
}

std::string Control::execute(std::string_view line) {
    const std::string_view text = trimmed(line);
    const auto space = text.find(' ');
    const std::string_view word = text.substr(0, space);
    const std::string_view rest =
        space == std::string_view::npos ? "" : trimmed(text.substr(space));
    try {
        const std::scoped_lock lock(rig_.mutex);
        if (word == "fault") {
            rig_.faults.add(parse_fault(rest, rig_.now_s()));
            rig_.apply_faults();
            return "ok fault " + std::string(rest);
        }
        if (word == "clear") {
            rig_.faults.clear(rest);
            rig_.apply_faults();
            return "ok " + std::string(text);
        }
        if (word == "estop" && (rest == "open" || rest == "close")) {
            rig_.emergency_stop_by_hand = rest == "open";
            rig_.apply_faults();
            return "ok estop " + std::string(rest);
        }
        if (word == "table") {
            rig_.rig.shaker().drive_from_outside(table_g(rest));
            return "ok table " + std::string(rest);
        }
        if (word == "hold") {
            rig_.hold_at_s = hold_s(rest);
            return "ok hold " + std::string(rest);
        }
        if (word == "go") {
            rig_.hold_at_s.reset();
            return "ok go";
        }
        if (word == "speed") {  // of a rig that owns the time
            rig_.speed = speed_of(rest, "speed");
            return "ok speed " + std::string(rest);
        }
        if (word == "status") {
            std::array<char, 160> status{};
            std::snprintf(
                status.data(), status.size(),
                "ok time %.3f s, shaker state %d, table %.4f g, highest %.4f g, faults %d",
                rig_.now_s(), static_cast<int>(rig_.rig.shaker().state()),
                rig_.rig.shaker().amplitude_g(), rig_.rig.shaker().highest_g(),
                rig_.rig.shaker().faults());
            return status.data();
        }
        if (word == "help") return std::string("ok ") + kControlLines;
    } catch (const PlantError& error) {
        return std::string("error: ") + error.what();
    }
    return "error: found \"" + proto::printable(text) + "\", expected " + kControlLines;
}

bool Control::read(int descriptor) {
    std::array<char, 1024> buffer{};
    const ssize_t size = ::read(descriptor, buffer.data(), buffer.size());
    if (size < 0) return errno == EAGAIN || errno == EINTR;
    if (size == 0) return false;
    pending_.append(buffer.data(), static_cast<std::size_t>(size));
    for (auto end = pending_.find('\n'); end != std::string::npos; end = pending_.find('\n')) {
        if (!trimmed(std::string_view(pending_).substr(0, end)).empty()) {
            std::printf("%s\n", execute(std::string_view(pending_).substr(0, end)).c_str());
            std::fflush(stdout);
        }
        pending_.erase(0, end + 1);
    }
    if (pending_.size() > kLongest) {
        std::printf("error: found a line of more than %zu bytes, expected %s\n", kLongest,
                    kControlLines);
        std::fflush(stdout);
        pending_.clear();
    }
    return true;
}

}  // namespace vibrig::plant
