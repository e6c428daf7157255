#include "tests/plant/modbus_server.hpp"

#include <arpa/inet.h>
#include <modbus/modbus.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <span>
#include <string_view>
#include <vector>

namespace vibrig::plant {
namespace {

using Query = std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH>;
using Answer = ShakerController::Answer;

constexpr int kConnections = 16;
constexpr int kReadInput = 0x04, kWriteSingle = 0x06, kServerId = 0x11, kWriteMultiple = 0x10,
              kMaskWrite = 0x16, kWriteAndRead = 0x17;

std::uint16_t word(const std::uint8_t* bytes) {
    return static_cast<std::uint16_t>(bytes[0] << 8 | bytes[1]);
}

/// The holding registers a request wants to write.
struct Write {
    bool any = false;
    std::size_t address = 0;
    std::vector<std::uint16_t> values;
};

Write parse_write(const std::uint8_t* pdu, std::size_t length,
                  std::span<const std::uint16_t> holding) {
    Write write;
    const auto list = [&](std::size_t address_at, std::size_t count_at, std::size_t data_at) {
        if (length < data_at) return;
        const std::size_t count = word(pdu + count_at);
        if (length < data_at + 2 * count) return;
        write.any = true;
        write.address = word(pdu + address_at);
        for (std::size_t i = 0; i < count; ++i) write.values.push_back(word(pdu + data_at + 2 * i));
    };
    switch (pdu[0]) {
        case kWriteSingle:
            if (length >= 5) write = {true, word(pdu + 1), {word(pdu + 3)}};
            break;
        case kWriteMultiple:
            list(1, 3, 6);
            break;
        case kWriteAndRead:
            list(5, 7, 10);
            break;
        case kMaskWrite:
            if (length >= 7) {
                const std::size_t address = word(pdu + 1);
                const std::uint16_t old = address < holding.size() ? holding[address] : 0;
                const std::uint16_t keep = word(pdu + 3);
                const auto value =
                    static_cast<std::uint16_t>((old & keep) | (word(pdu + 5) & ~keep));
                write = {true, address, {value}};
            }
            break;
        default:
            break;
    }
    return write;
}

}  // namespace

struct ModbusServer::Link {
    Link(modbus_t* c, const ForeignMap* foreign) : context(c) {
        using proto::RegisterTable;
        const auto size = [&](RegisterTable table, std::size_t own) {
            return static_cast<int>(foreign == nullptr ? own : foreign->size(table));
        };
        mapping = modbus_mapping_new(0, 0, size(RegisterTable::holding, ShakerController::kHolding),
                                     size(RegisterTable::input, ShakerController::kInput));
    }
    ~Link() {
        modbus_mapping_free(mapping);
        modbus_free(context);
    }
    Link(const Link&) = delete;
    Link& operator=(const Link&) = delete;

    modbus_t* context;
    modbus_mapping_t* mapping;
};

ModbusServer::ModbusServer(const std::string& address, SharedRig& rig)
    : address_(address), rig_(rig) {
    const auto fail = [&](const std::string& what) {
        throw PlantError("--modbus " + address + ": " + what);
    };
    if (const auto& map = rig.rig.truth().map; !map.empty())
        foreign_ = std::make_unique<ForeignMap>(read_map(map));
    const bool tcp = address.starts_with("tcp:");
    if (tcp) {
        const auto colon = address.rfind(':');
        const std::string host = colon > 4 ? address.substr(4, colon - 4) : "";
        const std::string port = address.substr(colon + 1);
        int number = -1;
        const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), number);
        in_addr numeric{};
        if (inet_pton(AF_INET, host.c_str(), &numeric) != 1 || error != std::errc{} ||
            end != port.data() + port.size() || number < 0 || number > 65535) {
            fail("expected tcp:ADDRESS:PORT with a numeric address, such as tcp:127.0.0.1:1502");
        }
        link_ = std::make_unique<Link>(modbus_new_tcp(host.c_str(), number), foreign_.get());
        listener_ = modbus_tcp_listen(link_->context, kConnections);
        if (listener_ < 0) fail(std::string("cannot listen: ") + modbus_strerror(errno));
        sockaddr_in bound{};
        socklen_t size = sizeof(bound);
        getsockname(listener_, reinterpret_cast<sockaddr*>(&bound), &size);
        port_ = ntohs(bound.sin_port);
        address_ = "tcp:" + host + ":" + std::to_string(port_);
    } else if (address.starts_with("rtu:") && address.size() > 4) {
        modbus_t* context = modbus_new_rtu(address.c_str() + 4, 19200, 'E', 8, 1);
        if (context == nullptr) fail(modbus_strerror(errno));
        link_ = std::make_unique<Link>(context, foreign_.get());
        modbus_set_slave(context, 1);
        if (modbus_connect(context) != 0)
            fail(std::string("cannot open: ") + modbus_strerror(errno));
    } else {
        fail("expected tcp:ADDRESS:PORT or rtu:DEVICE");
    }
    stop_event_ = eventfd(0, EFD_CLOEXEC);
    thread_ = std::thread([this, tcp] { tcp ? serve_tcp() : serve_rtu(); });
}

ModbusServer::~ModbusServer() {
    const std::uint64_t one = 1;
    if (write(stop_event_, &one, sizeof(one)) == sizeof(one)) thread_.join();
    close(stop_event_);
    if (listener_ >= 0) {
        close(listener_);
    } else {
        modbus_close(link_->context);
    }
}

void ModbusServer::tell_linked(bool linked) {
    const std::scoped_lock lock(rig_.mutex);
    rig_.rig.shaker().linked(linked);
}

void ModbusServer::serve_tcp() {
    tell_linked(false);
    std::vector<pollfd> descriptors{{stop_event_, POLLIN, 0}, {listener_, POLLIN, 0}};
    for (;;) {
        if (poll(descriptors.data(), descriptors.size(), -1) < 0) continue;
        if (descriptors[0].revents != 0) break;
        for (std::size_t i = 2; i < descriptors.size();) {
            if (descriptors[i].revents != 0) {
                modbus_set_socket(link_->context, descriptors[i].fd);
                if (!answer()) {
                    close(descriptors[i].fd);
                    descriptors.erase(descriptors.begin() + static_cast<std::ptrdiff_t>(i));
                    tell_linked(descriptors.size() > 2);
                    continue;
                }
            }
            ++i;
        }
        if (descriptors[1].revents != 0) {
            const int fd = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
            if (fd >= 0 && descriptors.size() < kConnections + 2) {
                descriptors.push_back({fd, POLLIN, 0});
                tell_linked(true);
            } else if (fd >= 0) {
                close(fd);
            }
        }
    }
    for (std::size_t i = 2; i < descriptors.size(); ++i) close(descriptors[i].fd);
}

void ModbusServer::serve_rtu() {
    for (;;) {
        std::array<pollfd, 2> descriptors{
            {{stop_event_, POLLIN, 0}, {modbus_get_socket(link_->context), POLLIN, 0}}};
        if (poll(descriptors.data(), descriptors.size(), -1) < 0) continue;
        if (descriptors[0].revents != 0) return;
        if ((descriptors[1].revents & POLLIN) == 0) return;  // the device is gone
        answer();
    }
}

struct ModbusServer::Outcome {
    Answer answer = Answer::accepted;
    bool failure = false, silent = false, other_device = false;
};

/// What a request does to the controller, and what its registers read after it.
ModbusServer::Outcome ModbusServer::apply(const std::uint8_t* pdu, std::size_t length) {
    const std::scoped_lock lock(rig_.mutex);
    const double now = rig_.now_s();
    Outcome outcome;
    outcome.silent = rig_.faults.active(FaultKind::modbus_silent, now) != nullptr;
    if (outcome.silent) return outcome;
    outcome.other_device =
        pdu[0] == kServerId && rig_.faults.active(FaultKind::other_device, now) != nullptr;
    ShakerController& shaker = rig_.rig.shaker();
    const Fault* wrong = rig_.faults.active(FaultKind::modbus_wrong, now);
    const bool wrong_value = wrong != nullptr && wrong->value != 0;
    outcome.failure = wrong != nullptr && !wrong_value;
    const auto holding = [&]() -> std::span<const std::uint16_t> {
        return foreign_ ? foreign_->holding(shaker) : shaker.holding();
    };
    const Write write = parse_write(pdu, length, holding());
    if (write.any && wrong == nullptr)
        outcome.answer = foreign_ ? foreign_->write(shaker, write.address, write.values)
                                  : shaker.write(write.address, write.values);
    // Reads of what the controller measured; other maps have none.
    if (!foreign_ && pdu[0] == kReadInput && length >= 3 && shaker.psd_refused() &&
        word(pdu + 1) >= ShakerController::kPsdBlock)
        outcome.failure = true;
    const auto as_wrong = [wrong_value](std::uint16_t word) {
        return static_cast<std::uint16_t>(word ^ (wrong_value ? 0x5555 : 0));
    };
    const auto own_input = shaker.input();
    std::ranges::transform(holding(), link_->mapping->tab_registers, as_wrong);
    std::ranges::transform(
        foreign_ ? foreign_->input(shaker) : std::span<const std::uint16_t>(own_input),
        link_->mapping->tab_input_registers, as_wrong);
    return outcome;
}

/// libmodbus names itself, whatever it plays.
int ModbusServer::reply_other(const std::uint8_t* query, std::size_t header) {
    constexpr std::string_view kName = "another controller";
    std::vector<std::uint8_t> reply(query, query + header + 1);
    reply.push_back(static_cast<std::uint8_t>(kName.size() + 1));
    reply.insert(reply.end(), kName.begin(), kName.end());
    reply.push_back(0xff);  // it runs
    if (listener_ < 0)      // with its checksum
        return modbus_send_raw_request(link_->context, reply.data(),
                                       static_cast<int>(reply.size()));
    reply[5] = static_cast<std::uint8_t>(reply.size() - 6);
    return static_cast<int>(
        ::send(modbus_get_socket(link_->context), reply.data(), reply.size(), MSG_NOSIGNAL));
}

bool ModbusServer::answer() {
    Query query{};
    const int received = modbus_receive(link_->context, query.data());
    if (received < 0) return false;
    if (received == 0) return true;  // RTU: a request to another unit
    const auto header = static_cast<std::size_t>(modbus_get_header_length(link_->context));
    const auto length = static_cast<std::size_t>(received);
    if (length <= header) return true;
    const std::uint8_t* pdu = query.data() + header;

    const Outcome outcome = apply(pdu, length - header);
    if (outcome.silent) return true;
    int sent = 0;
    if (outcome.other_device) {
        sent = reply_other(query.data(), header);
    } else if (outcome.failure) {
        sent = modbus_reply_exception(link_->context, query.data(),
                                      MODBUS_EXCEPTION_SLAVE_OR_SERVER_FAILURE);
    } else if (outcome.answer == Answer::illegal_address) {
        sent = modbus_reply_exception(link_->context, query.data(),
                                      MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS);
    } else if (outcome.answer == Answer::illegal_value) {
        sent = modbus_reply_exception(link_->context, query.data(),
                                      MODBUS_EXCEPTION_ILLEGAL_DATA_VALUE);
    } else {
        sent = modbus_reply(link_->context, query.data(), received, link_->mapping);
    }
    return sent >= 0;
}

}  // namespace vibrig::plant
