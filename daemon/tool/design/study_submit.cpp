#include "daemon/tool/design/study_submit.hpp"

#include <spawn.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "daemon/study/campaigns.hpp"
#include "proto/text.hpp"

extern char** environ;  // NOLINT: POSIX

namespace vibrig::tool::studies {

namespace {

namespace fs = std::filesystem;

constexpr double kShard_s = 60;        // an array task costs 0.3 s to start
constexpr std::uint64_t kMost = 1000;  // MaxArraySize of a Slurm as it comes is 1001

/// In sbatch's file names % begins what it fills in.
std::string without_patterns(const std::string& path) {
    std::string out;
    for (const char c : path) out += c == '%' ? std::string("%%") : std::string(1, c);
    return out;
}

/// For sh: in single quotes.
std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
    return out + "'";
}

class File {
  public:
    explicit File(int file) : file_(file) {
        if (file_ < 0) throw study::StudyError(std::strerror(errno));
    }
    ~File() { ::close(file_); }
    File(const File&) = delete;
    File& operator=(const File&) = delete;
    [[nodiscard]] int number() const { return file_; }
    [[nodiscard]] std::string text() const {
        std::string text;
        std::array<char, 4096> buffer{};
        for (ssize_t n = 0; (n = ::pread(file_, buffer.data(), buffer.size(),
                                         static_cast<off_t>(text.size()))) > 0;)
            text.append(buffer.data(), static_cast<std::size_t>(n));
        return text;
    }

  private:
    int file_;
};

struct Answer {
    int status = 0;
    std::string output, errors;
};

Answer run_program(std::vector<std::string> arguments) {
    const File output(memfd_create("output", MFD_CLOEXEC)),
        errors(memfd_create("errors", MFD_CLOEXEC));
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, output.number(), STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&actions, errors.number(), STDERR_FILENO);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_t child = 0;
    const int error = posix_spawnp(&child, argv[0], &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0)
        throw study::StudyError(arguments[0] + ": cannot be started: " + std::strerror(error) +
                                "; is Slurm installed here?");
    Answer answer;
    while (waitpid(child, &answer.status, 0) < 0 && errno == EINTR) {
    }
    answer.output = output.text();
    answer.errors = errors.text();
    return answer;
}

/// "17", or with a name behind it: "17;cluster".
std::string job_of(const Answer& answer) {
    std::string id = answer.output.substr(0, answer.output.find_first_of(";\n"));
    if (id.empty() || id.find_first_not_of("0123456789") != std::string::npos)
        throw study::StudyError("sbatch: found '" + proto::printable(answer.output) +
                                "', expected the number of a job; it says: " + answer.errors);
    return id;
}

}  // namespace

SlurmJob submit_to_slurm(const study::Folder& folder, std::uint64_t shards,
                         const std::vector<std::string>& options) {
    SlurmJob job;
    const double all_s = static_cast<double>(folder.tasks()) *
                         study::expected_task_s(folder.study, folder.sequences);
    job.shards =
        shards > 0
            ? shards
            : static_cast<std::uint64_t>(std::clamp(
                  all_s / kShard_s, 1.0, static_cast<double>(std::min(kMost, folder.tasks()))));
    const std::string path = fs::canonical(folder.path).string();
    const std::string program = fs::canonical("/proc/self/exe").string();
    fs::create_directories(path + "/log");
    std::vector<std::string> command{"sbatch",
                                     "--parsable",
                                     "--requeue",
                                     "--array=0-" + std::to_string(job.shards - 1),
                                     "--job-name=" + folder.study.name,
                                     "--output=" + without_patterns(path) + "/log/%A_%a.out"};
    command.insert(command.end(), options.begin(), options.end());
    command.push_back("--wrap=exec " + quoted(program) + " study run " + quoted(path) +
                      " --shard \"$SLURM_ARRAY_TASK_ID/" + std::to_string(job.shards) +
                      "\" -j \"${SLURM_CPUS_PER_TASK:-1}\"");
    const Answer answer = run_program(command);
    if (!WIFEXITED(answer.status) || WEXITSTATUS(answer.status) != 0)
        throw study::StudyError("sbatch refused: " + answer.errors + answer.output);
    job.id = job_of(answer);
    return job;
}

}  // namespace vibrig::tool::studies
