#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

struct _modbus;
struct _modbus_mapping_t;

namespace vibrig::drivers::test {

/// One request as the server understood it.
struct Request {
    int function = 0;
    int address = 0;
    int count = 0;
    std::vector<std::uint16_t> values;  ///< of a write
    int connection = 0;                 ///< counted from 1
    [[nodiscard]] bool is_write() const { return function == 6 || function == 16; }
    /// The run register is written, alone or together with the ramp time before it.
    [[nodiscard]] bool writes_run() const {
        return is_write() && address <= kRunRegister && address + count > kRunRegister;
    }
    [[nodiscard]] bool writes(int register_address) const {
        return register_address == kRunRegister
                   ? writes_run()
                   : is_write() && address == register_address && !writes_run();
    }
    [[nodiscard]] bool writes(int register_address, std::uint16_t value) const {
        return writes(register_address) && values.back() == value;
    }
    static constexpr int kRunRegister = 5;
};

/// What the server does with a request.
struct Answer {
    enum class Kind : std::uint8_t {
        normal,
        hang,          ///< carried out, never answered
        exception,     ///< `code`; not carried out
        ignore_write,  ///< acknowledged, not carried out
        swallow,       ///< neither carried out nor answered
        trip,          ///< carried out, and the run register drops to 0
        late,          ///< answered after `delay`
        twice,         ///< answered, and then again
        wrong_transaction,
        wrong_unit,
        wrong_function,
        wrong_length,
        damaged,          ///< last byte inverted (the checksum of a serial line)
        half_then_close,  ///< half of the reply, then the end of the connection
        close,
        bytewise,  ///< one byte at a time, `delay` apart
    } kind = Kind::normal;
    int code = 0;
    std::chrono::milliseconds delay{0};
};

/// A shaker controller on libmodbus' server side, with the default register map: TCP on a free port
/// of the loopback, or a serial line on a pty. It can be made to misbehave.
class TestServer {
  public:
    using Script = std::function<Answer(const Request&)>;
    enum class Line : std::uint8_t { tcp, rtu };

    explicit TestServer(Line line = Line::tcp, int port = 0);
    ~TestServer();
    TestServer(const TestServer&) = delete;
    TestServer& operator=(const TestServer&) = delete;

    [[nodiscard]] int port() const { return port_; }
    [[nodiscard]] const std::string& device() const { return device_; }

    /// Asked for every request, in the server's thread; empty: everything is answered.
    void script(Script script);
    [[nodiscard]] std::vector<Request> requests() const;
    [[nodiscard]] std::vector<Request> writes() const;
    void forget();
    [[nodiscard]] std::uint16_t holding(int address) const;
    void set_holding(int address, std::uint16_t value);
    void set_input(int address, std::uint16_t value);
    /// What it answers to function 17 from now on (TCP); before, what libmodbus says.
    void identify_as(std::string name);
    /// Waits until a request satisfies `wanted`; false after a minute.
    [[nodiscard]] bool saw(const std::function<bool(const Request&)>& wanted) const;

  private:
    struct Delayed {
        std::chrono::steady_clock::time_point due;
        int client;
        std::vector<std::uint8_t> bytes;
    };
    void run();
    [[nodiscard]] int next_timeout_ms() const;
    void send_delayed();
    void drop(int client);
    void serve(int client);
    [[nodiscard]] Request decode(std::span<const std::uint8_t> query, int client) const;
    [[nodiscard]] std::vector<std::uint8_t> reply_to(std::span<const std::uint8_t> query,
                                                     const Answer& answer);
    void react(const Request& request);

    const Line line_;
    int port_ = 0;
    std::string device_;
    int listener_ = -1, event_ = -1, slave_ = -1;
    int pipe_[2] = {-1, -1};  ///< replies of libmodbus pass here, so that they can be tampered with
    std::vector<int> clients_;
    std::vector<int> connection_of_;  ///< by descriptor
    int connections_ = 0;
    std::vector<Delayed> delayed_;
    _modbus* context_ = nullptr;

    mutable std::mutex mutex_;
    mutable std::condition_variable changed_;
    _modbus_mapping_t* mapping_ = nullptr;
    Script script_;
    std::string identity_;
    std::vector<Request> requests_;
    std::atomic<bool> quit_{false};
    std::thread thread_;
};

}  // namespace vibrig::drivers::test
