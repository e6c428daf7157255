#include "daemon/fleet/publisher.hpp"

#include <mosquitto.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <fstream>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <utility>

#include "daemon/fleet/edge_node.hpp"

namespace vibrig::fleet {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kKeepAlive_s = 15;
constexpr auto kConnectTime = std::chrono::seconds(10);
constexpr auto kFarewellTime = std::chrono::seconds(1);
constexpr auto kFirstPause = std::chrono::milliseconds(500);
constexpr auto kLook = std::chrono::milliseconds(100);  // how late a stop is noticed at most
constexpr int kMostOnTheWay = 4;                        // messages the socket has not taken
constexpr int kAtMostOnce = 0, kAtLeastOnce = 1;

void readable(const char* key, const std::string& path) {
    if (!path.empty() && ::access(path.c_str(), R_OK) != 0)
        throw std::runtime_error(std::string("mqtt.") + key + ": found '" + path +
                                 "', expected a file that can be read: " + std::strerror(errno));
}

std::string first_line(const std::string& path) {
    std::ifstream file(path);
    std::string line;
    std::getline(file, line);
    return line;
}

}  // namespace

struct Publisher::Impl {
    /// One connection: a client of its own, since its will names it.
    struct Connection {
        std::unique_ptr<mosquitto, void (*)(mosquitto*)> client{nullptr, mosquitto_destroy};
        bool accepted = false;
        bool wants_birth = false;
        int on_the_way = 0;
        std::string trouble;  ///< what the broker or the library said last
    };

    Impl(const StatusSource& from, const configuration::MqttSettings& given, EventSink to)
        : source(from), settings(given), log(std::move(to)) {
        readable("ca", settings.ca);
        readable("certificate", settings.certificate);
        readable("key", settings.key);
        readable("password_file", settings.password_file);
        if (!settings.password_file.empty()) password = first_line(settings.password_file);
        now.broker = settings.host + ':' + std::to_string(settings.port);
        mosquitto_lib_init();
    }

    /// `self` keeps everything alive for a thread that has to be left behind.
    static void start(const std::shared_ptr<Impl>& self) {
        sigset_t all, before;
        sigfillset(&all);
        pthread_sigmask(SIG_BLOCK, &all, &before);
        self->thread = std::thread([self] {
            pthread_setname_np(pthread_self(), "mqtt");
            self->run();
            const std::lock_guard lock(self->mutex);
            self->finished = true;
            self->stopped.notify_all();
        });
        pthread_sigmask(SIG_SETMASK, &before, nullptr);
    }

    void end() {
        if (!thread.joinable()) return;
        std::unique_lock lock(mutex);
        stop = true;
        stopped.notify_all();
        const bool done =
            stopped.wait_for(lock, kFarewellTime + kLook, [this] { return finished; });
        lock.unlock();
        // Looking up a name cannot be cut short; the daemon does not wait for that.
        done ? thread.join() : thread.detach();
    }

    ~Impl() { mosquitto_lib_cleanup(); }

    [[nodiscard]] bool stopping() const {
        const std::lock_guard lock(mutex);
        return stop;
    }

    [[nodiscard]] std::string topic(const char* kind) const {
        return "spBv1.0/" + settings.group + '/' + kind + '/' + settings.node;
    }

    void run() {
        Clock::duration pause = kFirstPause;
        const auto longest = std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(settings.backoff_max_s));
        while (!stopping()) {
            if (serve_connection()) pause = kFirstPause;
            std::unique_lock lock(mutex);
            stopped.wait_for(lock, std::min(pause, longest), [this] { return stop; });
            pause = std::min(2 * pause, longest);
        }
    }

    /// Until it is lost, or the daemon ends; true: the broker had accepted it.
    bool serve_connection() {
        Connection link;
        node.next_session();
        if (const int error = open(link); error != MOSQ_ERR_SUCCESS) {
            if (!stopping()) lost(link, error);
            return false;
        }
        const auto give_up = Clock::now() + kConnectTime;
        auto due = Clock::now();
        while (!stopping()) {
            const int error = mosquitto_loop(link.client.get(), static_cast<int>(kLook.count()), 1);
            if (error == MOSQ_ERR_SUCCESS && !link.accepted && Clock::now() < give_up) continue;
            if (error != MOSQ_ERR_SUCCESS || !link.accepted) {
                lost(link, error);
                return link.accepted;
            }
            if (link.wants_birth) {
                due = Clock::now() + period();
                publish_birth(link);
            } else if (Clock::now() >= due) {
                due = Clock::now() + period();
                publish_data(link);
            }
        }
        if (link.accepted) say_farewell(link);
        return true;
    }

    [[nodiscard]] Clock::duration period() const {
        return std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(settings.period_s));
    }

    int open(Connection& link) {
        const std::string name = settings.group + '-' + settings.node;
        link.client.reset(mosquitto_new(name.c_str(), true, &link));
        mosquitto* const client = link.client.get();
        if (client == nullptr) return MOSQ_ERR_NOMEM;
        mosquitto_connect_callback_set(client, [](mosquitto*, void* at, int refused) {
            auto& to = *static_cast<Connection*>(at);
            to.accepted = to.wants_birth = refused == 0;
            if (refused != 0) to.trouble = mosquitto_connack_string(refused);
        });
        mosquitto_publish_callback_set(
            client, [](mosquitto*, void* at, int) { --static_cast<Connection*>(at)->on_the_way; });
        mosquitto_message_callback_set(
            client, [](mosquitto*, void* at, const mosquitto_message* message) {
                const std::string_view payload(static_cast<const char*>(message->payload),
                                               static_cast<std::size_t>(message->payloadlen));
                if (EdgeNode::asks_for_birth(payload))
                    static_cast<Connection*>(at)->wants_birth = true;
            });
        mosquitto_log_callback_set(client, [](mosquitto*, void* at, int level, const char* text) {
            if (level == MOSQ_LOG_ERR) static_cast<Connection*>(at)->trouble = text;
        });
        int error = MOSQ_ERR_SUCCESS;
        const auto go_on = [&error](int next) {
            if (error == MOSQ_ERR_SUCCESS) error = next;
        };
        const std::string death = node.death(source.status().utc_ns);
        go_on(mosquitto_will_set(client, topic("NDEATH").c_str(), static_cast<int>(death.size()),
                                 death.data(), kAtLeastOnce, false));
        if (!settings.username.empty())
            go_on(mosquitto_username_pw_set(client, settings.username.c_str(),
                                            password.empty() ? nullptr : password.c_str()));
        if (settings.tls) {
            const auto or_null = [](const std::string& path) {
                return path.empty() ? nullptr : path.c_str();
            };
            constexpr const char* kSystem = "/etc/ssl/certs";
            // A key with a password is refused instead of asked for at a terminal.
            go_on(mosquitto_tls_set(client, or_null(settings.ca),
                                    settings.ca.empty() ? kSystem : nullptr,
                                    or_null(settings.certificate), or_null(settings.key),
                                    [](char*, int, int, void*) { return 0; }));
        }
        if (error == MOSQ_ERR_SUCCESS)
            error =
                mosquitto_connect_async(client, settings.host.c_str(), settings.port, kKeepAlive_s);
        return error;
    }

    void lost(const Connection& link, int error) {
        std::string why = link.trouble;
        if (why.empty())
            why = error == MOSQ_ERR_SUCCESS ? "no answer within 10 s"
                  : error == MOSQ_ERR_ERRNO ? std::strerror(errno)
                                            : mosquitto_strerror(error);
        bool news = false;
        {
            const std::lock_guard lock(mutex);
            news = now.connected || now.note != why;
            now.connected = false;
            now.note = why;
        }
        if (news) log(Severity::warning, "no broker at " + now.broker + ": " + why);
    }

    bool publish(Connection& link, const char* kind, const std::string& payload, int quality) {
        const int error =
            mosquitto_publish(link.client.get(), nullptr, topic(kind).c_str(),
                              static_cast<int>(payload.size()), payload.data(), quality, false);
        if (error == MOSQ_ERR_SUCCESS) ++link.on_the_way;
        return error == MOSQ_ERR_SUCCESS;
    }

    void publish_birth(Connection& link) {
        link.wants_birth = false;
        bool first = false;
        {
            const std::lock_guard lock(mutex);
            first = !std::exchange(now.connected, true);
            now.note.clear();
            now.connections += first ? 1 : 0;
            ++now.births;
        }
        if (first) {
            log(Severity::info, "broker at " + now.broker + ": connected");
            mosquitto_subscribe(link.client.get(), nullptr, topic("NCMD").c_str(), kAtLeastOnce);
        }
        publish(link, "NBIRTH", node.birth(source.status()), kAtMostOnce);
    }

    void publish_data(Connection& link) {
        // Of data the latest counts: the next one has what this one would have had.
        const bool room = link.on_the_way < kMostOnTheWay;
        const std::string payload = room ? node.data(source.status()) : std::string{};
        const bool sent = !payload.empty() && publish(link, "NDATA", payload, kAtMostOnce);
        const std::lock_guard lock(mutex);
        now.messages += sent ? 1 : 0;
        now.left_out += room ? 0 : 1;
    }

    /// A broker publishes the will of a connection that breaks; one that ends has to publish its
    /// own.
    void say_farewell(Connection& link) {
        publish(link, "NDEATH", node.death(source.status().utc_ns), kAtLeastOnce);
        const auto end = Clock::now() + kFarewellTime;
        while (link.on_the_way > 0 && Clock::now() < end &&
               mosquitto_loop(link.client.get(), static_cast<int>(kLook.count()), 1) ==
                   MOSQ_ERR_SUCCESS) {
        }
        mosquitto_disconnect(link.client.get());
    }

    const StatusSource& source;
    const configuration::MqttSettings settings;
    const EventSink log;
    std::string password;
    EdgeNode node;  ///< the publisher's thread
    mutable std::mutex mutex;
    std::condition_variable stopped;
    bool stop = false, finished = false;
    MqttStatus now;  ///< of it `broker` never changes
    std::thread thread;
};

Publisher::Publisher(const StatusSource& source, const configuration::MqttSettings& settings,
                     EventSink log)
    : impl_(std::make_shared<Impl>(source, settings, std::move(log))) {}

Publisher::~Publisher() { impl_->end(); }
void Publisher::start() { Impl::start(impl_); }
void Publisher::stop() { impl_->end(); }

MqttStatus Publisher::status() const {
    const std::lock_guard lock(impl_->mutex);
    return impl_->now;
}

}  // namespace vibrig::fleet
