// Ranks of MPI as shards of a study: rank I of N is shard I/N. Nothing is sent between them; what
// holds is in the files, so a job that was killed is simply started again.
#include <mpi.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <chrono>
#include <cstdio>
#include <exception>
#include <string>
#include <thread>

#include "daemon/study/run.hpp"
#include "proto/empty_value.hpp"
#include "proto/option_value.hpp"

namespace {

using namespace vibrig;

constexpr int kFailed = 1, kBadInput = 2;

int run_rank(const std::string& path, study::RunOptions options, int rank, int ranks) {
    try {
        const auto folder = study::open_study(path);
        options.shard = {static_cast<std::uint64_t>(rank), static_cast<std::uint64_t>(ranks)};
        options.tell = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
        study::prepare_to_run(folder);
        options.stop = &study::stop_on_signals();
        const auto report = study::run_study(folder, options);
        if (!report.first_failure.empty())
            std::fprintf(stderr, "rank %d: failed: %s\n", rank, report.first_failure.c_str());
        if (!report.complete())
            std::fprintf(stderr, "rank %d: interrupted: run it again and it goes on\n", rank);
        return report.failed > 0 || !report.complete() ? kFailed : 0;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "rank %d: %s\n", rank, error.what());
        return kBadInput;
    }
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app{"Runs a planned study with MPI; each rank is a shard.", "vibrig-study-mpi"};
    std::string folder;
    study::RunOptions options;
    app.set_version_flag("--version", "vibrig-study-mpi " VIBRIG_VERSION);
    app.add_option("FOLDER", folder, "a planned study, where all nodes see it")->required();
    app.add_option("-j,--threads", options.threads, "of each rank")
        ->check(CLI::Range(1, 1024))
        ->capture_default_str();
    app.add_option("--chunk", options.chunk_s, "s between two writes")
        ->check(proto::finite(0.0, 3600.0))
        ->capture_default_str();
    app.footer(
        "Example: mpirun -n 64 vibrig-study-mpi s/ && vibrig study merge s/\n"
        "A rank that is killed ends the job: start it again, and it goes on.\n"
        "Exit codes: 0 all done, 1 a task failed or it was interrupted, 2 bad usage or input, or "
        "the\nresults cannot be stored.");
    proto::refuse_empty_values(app);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
        return app.exit(error) == 0 ? 0 : kBadInput;
    }
    MPI_Init(&argc, &argv);
    int rank = 0, ranks = 1, worst = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    const int code = run_rank(folder, options, rank, ranks);
    // So that mpirun's exit code is the worst of all, and no rank is killed by another's. MPI's own
    // wait takes a whole processor.
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Iallreduce(&code, &worst, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD, &request);
    for (int done = 0; done == 0;) {
        MPI_Test(&request, &done, MPI_STATUS_IGNORE);
        if (done == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    MPI_Finalize();
    return worst;
}
