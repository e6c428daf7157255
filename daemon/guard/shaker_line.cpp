#include "daemon/guard/shaker_line.hpp"

#include <modbus/modbus.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <stdexcept>
#include <utility>

namespace vibrig::guard {

namespace {

constexpr drivers::Time kPoll = drivers::kSecond / 2;
constexpr drivers::Time kPollWhileStopping = drivers::kSecond / 5;
constexpr int kWaitForRampMs = 100;
constexpr drivers::Time kRetry = drivers::kSecond;
// What was read earlier is not known any more.
constexpr drivers::Time kFresh = 2 * drivers::kSecond;

}  // namespace

ShakerLine::ShakerLine(const ShakerLineSettings& settings)
    : settings_(settings), line_(settings.host, settings.port, settings.unit) {
    if (!line_.resolve())
        throw std::runtime_error((settings.host_place.empty() ? "" : settings.host_place + ": ") +
                                 key_error("shaker.host",
                                           '"' + settings.host + "\" (" + line_.note() + ")",
                                           "a host that can be resolved"));
}

bool ShakerLine::read(const proto::Register& reg, double& value) {
    std::array<std::uint16_t, 2> words{};
    const auto count = static_cast<int>(reg.words());
    const int got =
        reg.table == proto::RegisterTable::holding
            ? modbus_read_registers(line_.get(), reg.address, count, words.data())
            : modbus_read_input_registers(line_.get(), reg.address, count, words.data());
    if (got != count) return line_.lose(std::string("cannot read: ") + modbus_strerror(errno));
    value = proto::decode(reg, {words.data(), reg.words()});
    return true;
}

bool ShakerLine::write_stop() {
    std::array<std::uint16_t, 2> words{};
    const auto count = static_cast<int>(settings_.run.words());
    // Other bits of the same register stay as they are.
    if (settings_.run.type == proto::RegisterType::bits &&
        modbus_read_registers(line_.get(), settings_.run.address, 1, words.data()) != 1)
        return line_.lose(std::string("cannot read: ") + modbus_strerror(errno));
    if (!proto::encode(settings_.run, 0, {words.data(), settings_.run.words()})) return false;
    if (!stop_in_one(words.data())) {
        if (!line_.connected()) return false;
        if (!ramp_at_once()) return false;
        if (write(settings_.run.address, words.data(), settings_.run.words()) != count)
            return line_.lose(std::string("cannot write: ") + modbus_strerror(errno));
    }
    ++stops_;
    return true;
}

int ShakerLine::write(int address, const std::uint16_t* words, std::size_t count) {
    return count == 1
               ? modbus_write_register(line_.get(), address, words[0])
               : modbus_write_registers(line_.get(), address, static_cast<int>(count), words);
}

/// Ramp 0 and run 0 in one request, where their registers are neighbours and the device takes it.
bool ShakerLine::stop_in_one(const std::uint16_t* run) {
    const proto::Register &first = settings_.ramp_time, &second = settings_.run;
    const bool ramp_first = first.address + first.words() == second.address;
    const bool run_first = second.address + second.words() == first.address;
    if (joint_refused_ || joint_in_vain_ || !(ramp_first || run_first)) return false;
    std::array<std::uint16_t, 4> words{};  // a ramp of 0 is 0 in every type
    std::copy_n(run, second.words(),
                words.begin() + static_cast<std::ptrdiff_t>(ramp_first ? first.words() : 0));
    const std::size_t count = first.words() + second.words();
    if (write(ramp_first ? first.address : second.address, words.data(), count) ==
        static_cast<int>(count)) {
        joint_in_vain_ = true;  // until run is read as 0
        return true;
    }
    if (errno >= EMBXILFUN && errno <= EMBXGTAR) {
        joint_refused_ = true;
    } else {
        joint_in_vain_ = true;
        line_.lose(std::string("cannot write: ") + modbus_strerror(errno));
    }
    return false;
}

/// One short try a stop: run 0 goes out whatever comes back. False: there is no connection after
/// it; else it may be another, where no late answer is taken for the next one's.
bool ShakerLine::ramp_at_once() {
    if (std::exchange(ramp_tried_, true)) return true;
    const std::array<std::uint16_t, 2> zero{};
    line_.wait_for_ms(kWaitForRampMs);
    const int written =
        write(settings_.ramp_time.address, zero.data(), settings_.ramp_time.words());
    const int error = errno;
    line_.wait_as_ever();
    if (written >= 0 || (error >= EMBXILFUN && error <= EMBXGTAR)) return true;
    line_.lose(std::string("cannot write: ") + modbus_strerror(error));
    return line_.connect();
}

void ShakerLine::step(drivers::Time now, bool stop) {
    // A stop that is new waits for no turn.
    if (stop && !stopping_) {
        due_ = 0;
        ramp_tried_ = joint_refused_ = joint_in_vain_ = false;
    }
    stopping_ = stop;
    if (now < due_) return;
    due_ = now + (stop ? kPollWhileStopping : kRetry);
    if (!line_.connected() && !line_.connect()) return;
    const bool alone = joint_in_vain_;
    const bool seen = (!stop || write_stop()) && look(now);
    if (seen) due_ = now + (stop ? kPollWhileStopping : kPoll);
    if (alone || !joint_in_vain_) return;
    // A request for both went out just now. If it did not stop, run 0 alone waits for no turn.
    if (seen && !word_.runs)
        joint_in_vain_ = false;
    else
        due_ = now;
}

bool ShakerLine::look(drivers::Time now) {
    double run = 0, measured = 0;
    if (!read(settings_.run, run) || !read(settings_.measured_amplitude, measured)) return false;
    word_ = {true, run != 0, measured};
    read_ = now;
    line_.is_well();
    return true;
}

ShakerWord ShakerLine::word(drivers::Time now) const {
    return read_ != 0 && now - read_ <= kFresh ? word_ : ShakerWord{};
}

}  // namespace vibrig::guard
