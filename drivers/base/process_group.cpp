#include "drivers/base/process_group.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <unistd.h>

#include <array>
#include <csignal>

namespace vibrig::drivers {

namespace {

/// What posix_spawn does on the way, made and unmade as it wants to be.
struct Actions {
    Actions() noexcept { ::posix_spawn_file_actions_init(&all); }
    ~Actions() { ::posix_spawn_file_actions_destroy(&all); }
    Actions(const Actions&) = delete;
    Actions& operator=(const Actions&) = delete;
    posix_spawn_file_actions_t all{};
};

struct Attributes {
    Attributes() noexcept { ::posix_spawnattr_init(&all); }
    ~Attributes() { ::posix_spawnattr_destroy(&all); }
    Attributes(const Attributes&) = delete;
    Attributes& operator=(const Attributes&) = delete;
    posix_spawnattr_t all{};
};

}  // namespace

int start_process_group(std::vector<std::string> arguments, int in, int out, int error,
                        pid_t& leader) {
    Actions actions;
    const std::array<int, 3> given{in, out, error};
    for (int standard = STDIN_FILENO; standard <= STDERR_FILENO; ++standard) {
        const int from = given[static_cast<std::size_t>(standard)];
        if (from < 0) {
            ::posix_spawn_file_actions_addopen(&actions.all, standard, "/dev/null",
                                               standard == STDIN_FILENO ? O_RDONLY : O_WRONLY, 0);
        } else {
            ::posix_spawn_file_actions_adddup2(&actions.all, from, standard);
        }
    }
    ::posix_spawn_file_actions_addclosefrom_np(&actions.all, STDERR_FILENO + 1);
    Attributes attributes;
    sigset_t none, defaults;
    ::sigemptyset(&none);
    ::sigemptyset(&defaults);
    for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT, SIGTERM, SIGHUP})
        ::sigaddset(&defaults, signal);
    ::posix_spawnattr_setsigmask(&attributes.all, &none);
    ::posix_spawnattr_setsigdefault(&attributes.all, &defaults);
    ::posix_spawnattr_setpgroup(&attributes.all, 0);
    ::posix_spawnattr_setflags(
        &attributes.all,
        static_cast<short>(POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF));
    std::vector<char*> words;
    for (auto& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    return ::posix_spawn(&leader, words[0], &actions.all, &attributes.all, words.data(), environ);
}

}  // namespace vibrig::drivers
