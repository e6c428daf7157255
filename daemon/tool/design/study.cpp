#include <csignal>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "daemon/plot/chart.hpp"
#include "daemon/study/merge.hpp"
#include "daemon/study/reduce.hpp"
#include "daemon/study/run.hpp"
#include "daemon/study/status.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/design/study_output.hpp"
#include "daemon/tool/design/study_submit.hpp"
#include "proto/durable_file.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

using Json = nlohmann::ordered_json;

struct StudyOptions {
    std::string file, folder, shard = "0/1", instruction_set = "baseline";
    unsigned threads = std::max(1U, std::thread::hardware_concurrency());
    double chunk_s = 10;
    std::string output, csv, hdf5, plot;
    std::uint64_t shards = 0;
    std::vector<std::string> sbatch;
    bool json = false, partial = false, compact = false, slurm = false;
};

study::Shard shard_of(const std::string& text) {
    study::Shard shard;
    const auto slash = text.find('/');
    const std::string_view all = text;
    if (slash == std::string::npos || !proto::read_number(all.substr(0, slash), shard.number) ||
        !proto::read_number(all.substr(slash + 1), shard.of) || shard.of < 1 ||
        shard.of > 1'000'000 || shard.number >= shard.of)
        throw study::StudyError("--shard: found '" + proto::printable(text) +
                                "', expected I/N with I from 0 to N - 1, as 0/64 ... 63/64");
    return shard;
}

int plan(const StudyOptions& o) {
    std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is a disk that is full
    const auto folder = study::plan_study(o.file, o.folder, o.instruction_set);
    for (const std::string& warning : folder.study.warnings) std::cerr << warning << '\n';
    if (folder.study.kind != "campaigns" && !o.json) {
        std::cout << o.folder << ": " << folder.tasks()
                  << (folder.study.kind == "recordings" ? " recordings" : " blocks of 10000 trials")
                  << "; instruction set " << folder.instruction_set << ", study "
                  << folder.id_text.substr(0, 16) << '\n';
    } else if (o.json) {
        const Json out{{"folder", o.folder},
                       {"id", folder.id_text},
                       {"tasks", folder.tasks()},
                       {"points", folder.study.points()},
                       {"runs", folder.study.runs}};
        std::cout << proto::json_text(out) << '\n';
    } else {
        std::cout << o.folder << ": " << folder.tasks() << " tasks, " << folder.study.points()
                  << (folder.study.points() == 1 ? " point of " : " points of ")
                  << folder.study.runs << " runs each; instruction set " << folder.instruction_set
                  << ", study " << folder.id_text.substr(0, 16) << '\n';
    }
    return 0;
}

int run(const StudyOptions& o) {
    const auto folder = study::open_study(o.folder);
    study::RunOptions options;
    options.shard = shard_of(o.shard);
    options.threads = o.threads;
    options.chunk_s = o.chunk_s;
    options.tell = [](const std::string& text) { std::cerr << text << '\n'; };
    study::prepare_to_run(folder);
    options.stop = &study::stop_on_signals();
    study::RunReport report;
    {
        studies::RunDisplay display;
        options.progress = [&](const study::RunProgress& p) { display.show(p); };
        report = study::run_study(folder, options);
    }
    if (o.json) {
        const Json out{{"tasks", report.all},
                       {"before", report.before},
                       {"now", report.now},
                       {"failed", report.failed},
                       {"complete", report.complete()}};
        std::cout << proto::json_text(out) << '\n';
    } else {
        std::cout << report.before + report.now << " of " << report.all << " tasks done, "
                  << report.now << " of them now; " << report.failed << " failed\n";
    }
    if (!report.first_failure.empty()) std::cerr << "failed: " << report.first_failure << '\n';
    if (!report.complete()) std::cerr << "interrupted: run it again and it goes on\n";
    return report.complete() && report.failed == 0 ? 0 : kNo;
}

int status(const StudyOptions& o) {
    const auto folder = study::open_study(o.folder);
    const auto status = study::status_of(folder);
    std::cout << (o.json ? proto::json_text(studies::status_json(status)) + "\n"
                         : studies::status_text(status));
    return status.found.contradictions.empty() && status.found.foreign.empty() ? 0 : kNo;
}

void tell(const char* what, const std::vector<std::string>& lines) {
    for (const std::string& line : lines) std::cerr << what << line << '\n';
}

void write_result(const StudyOptions& o, const Json& result) {
    if (!o.output.empty()) proto::write_output(o.output, proto::json_text(result, 1) + "\n");
    if (!o.csv.empty()) proto::write_output(o.csv, studies::result_csv(result));
    if (!o.hdf5.empty()) {
        if (std::filesystem::exists(o.hdf5) && !std::filesystem::is_regular_file(o.hdf5))
            throw std::runtime_error(o.hdf5 +
                                     ": found a device, a pipe or a folder, expected a file: HDF5 "
                                     "goes back and forth in it");
        proto::OutputFile file(o.hdf5);
        std::filesystem::remove(file.place());  // HDF5 makes it anew
        studies::write_hdf5(result, file.place());
        file.finish();
    }
    if (!o.plot.empty()) {
        const std::string remark = studies::write_charts(result, o.plot);
        if (!remark.empty()) std::cerr << o.plot << ": " << remark << '\n';
    }
    std::cout << (o.json ? proto::json_text(result, 1) + "\n" : studies::result_table(result));
}

/// What a study is made of is no place for what comes of it.
void keep_study(const study::Folder& folder, const StudyOptions& o) {
    namespace fs = std::filesystem;
    std::error_code none;
    for (const std::string& output : {o.output, o.csv, o.hdf5, o.plot}) {
        const fs::path place = output.empty() ? fs::path() : fs::absolute(output).parent_path();
        const bool own = !output.empty() && (fs::equivalent(place, folder.parts(), none) ||
                                             (fs::equivalent(place, folder.path, none) &&
                                              study::is_of_plan(fs::path(output).filename())));
        if (own)
            throw study::StudyError(output +
                                    ": found a file of the study that is merged, expected "
                                    "another to write");
    }
}

int merge(const StudyOptions& o) {
    const auto folder = study::open_study(o.folder);
    keep_study(folder, o);
    study::Merged merged(folder);
    study::Reduction reduction(folder);
    for (study::TaskRecord record; merged.next(record);) reduction.add(record.index, record.bytes);
    const study::MergeFindings& found = merged.found();
    tell("unfinished: ", found.unfinished);
    tell("damaged: ", found.damaged);
    tell("foreign: ", found.foreign);
    tell("contradictory: ", found.contradictions);
    if (found.missing_count > 0) {
        std::cerr << "missing: " << found.missing_count << " of " << folder.tasks()
                  << " tasks: " << studies::missing_text(found) << '\n';
    } else if (!found.damaged.empty()) {
        std::cerr
            << "what was damaged another part has: nothing is missing; remove what is damaged\n";
    }
    bool wrong = (!found.damaged.empty() && !o.partial) || !found.foreign.empty() ||
                 !found.contradictions.empty();
    if (found.missing_count > 0 && !o.partial) {
        std::cerr << "no result; `vibrig study run " << o.folder
                  << "` computes what is missing, --partial takes what there is\n";
        return kNo;
    }
    write_result(o, reduction.result(found.missing_count));
    if (o.compact) {
        const study::Compaction done = study::compact(folder);
        tell("kept: ", done.kept);
        if (!done.refused.empty()) std::cerr << "not compacted: " << done.refused << '\n';
        if (done.parts > 0) std::cerr << done.parts << " parts became one\n";
        wrong = wrong || !done.refused.empty();
    }
    return wrong ? kNo : 0;
}

int submit(const StudyOptions& o) {
    if (!o.slurm) throw study::StudyError("submit: expected --slurm; there is no other scheduler");
    const auto folder = study::open_study(o.folder);
    const auto job = studies::submit_to_slurm(folder, o.shards, o.sbatch);
    if (o.json) {
        std::cout << proto::json_text(Json{{"job", job.id}, {"shards", job.shards}}) << '\n';
    } else {
        std::cout << "job " << job.id << ": " << job.shards << " shards; `squeue -j " << job.id
                  << "`, `vibrig study status " << o.folder << "`\n";
    }
    return 0;
}

CLI::App* add_study_command(CLI::App& study, const char* name, const char* what,
                            const std::shared_ptr<StudyOptions>& o, int& exit_code,
                            int (*body)(const StudyOptions&)) {
    CLI::App* command = study.add_subcommand(name, what);
    command->add_flag("--json", o->json, "print it as JSON");
    command->callback(
        [o, &exit_code, body] { exit_code = guarded([&] { return body(*o); }, "study: "); });
    return command;
}

void add_run(CLI::App& study, const std::shared_ptr<StudyOptions>& o, int& exit_code) {
    CLI::App* command = add_study_command(
        study, "run", "Do what is not done of it, on this machine", o, exit_code, run);
    command->add_option("FOLDER", o->folder, "a planned study")->required();
    command->add_option("-j,--threads", o->threads, "default: one for each processor")
        ->check(CLI::Range(1, 1024));
    command->add_option("--shard", o->shard, "I/N: the I-th of N parts, from 0")
        ->capture_default_str();
    add_number(*command, "--chunk", o->chunk_s, "s between two writes", 0.0, 3600.0)
        ->capture_default_str();
    command->footer(
        "Example: vibrig study run s/ -j 8\n"
        "Killed, stopped or interrupted it loses a chunk at most; called again it goes on.\n"
        "Exit codes: 0 all done, 1 a task failed or it was interrupted, 2 bad usage or input, or "
        "the\nresults cannot be stored.");
}

void add_merge(CLI::App& study, const std::shared_ptr<StudyOptions>& o, int& exit_code) {
    CLI::App* command =
        add_study_command(study, "merge", "Statistics over all its tasks", o, exit_code, merge);
    command->add_option("FOLDER", o->folder, "a planned study")->required();
    command->add_option("-o,--output", o->output, "write the result as JSON to this file");
    command->add_option("--csv", o->csv, "write a row for each coefficient and point");
    command->add_option("--hdf5", o->hdf5, "write tables of points and coefficients");
    command->add_option("--plot", o->plot, "write charts (SVG) to this folder")
        ->check(proto::charts(false));
    command->add_flag("--partial", o->partial, "what there is, if something is missing");
    command->add_flag("--compact", o->compact, "afterwards make one part of the closed ones");
    command->footer(
        "Example: vibrig study merge s/ -o result.json --plot charts\n"
        "The result is the same to the last bit, whoever computed which task.\n"
        "Exit codes: 0 done, 1 something is missing, damaged, contradictory or of another study, "
        "each\nnamed (where nothing is missing there is a result all the same), 2 bad usage or "
        "input.");
}

}  // namespace

void add_study(CLI::App& app, int& exit_code) {
    CLI::App* study = app.add_subcommand("study",
                                         "Thousands of simulated campaigns, or of recordings: on "
                                         "this machine, or shared among many");
    study->require_subcommand(1);
    auto o = std::make_shared<StudyOptions>();
    CLI::App* planning =
        add_study_command(*study, "plan", "Fix the list of tasks", o, exit_code, plan);
    planning->add_option("STUDY", o->file, "what is studied (TOML)")->required();
    planning->add_option("-o,--output", o->folder, "folder to make; it must not exist")->required();
    planning
        ->add_option("--instruction-set", o->instruction_set,
                     "of the filter, for all machines: baseline, auto (the best here), or a name")
        ->capture_default_str();
    planning->footer(
        "Example: vibrig study plan STUDY.toml -o s/\n"
        "Exit codes: 0 done, 2 bad usage or input.");
    add_run(*study, o, exit_code);
    CLI::App* submission = add_study_command(
        *study, "submit", "Hand it to a scheduler, as an array of shards", o, exit_code, submit);
    submission->add_option("FOLDER", o->folder, "a planned study, where all nodes see it")
        ->required();
    submission->add_flag("--slurm", o->slurm, "with sbatch");
    submission->add_option("--shards", o->shards, "default: about a minute of work each")
        ->check(CLI::Range(1, 1'000'000));
    submission->add_option("SBATCH", o->sbatch, "options of sbatch, after --");
    submission->footer(
        "Example: vibrig study submit s/ --slurm --shards 64 -- --time=1:00:00 --cpus-per-task=4\n"
        "Exit codes: 0 submitted, 2 bad usage or input, or sbatch refused.");
    CLI::App* look = add_study_command(*study, "status", "What is done, and who is at work", o,
                                       exit_code, status);
    look->add_option("FOLDER", o->folder, "a planned study")->required();
    look->footer(
        "Example: vibrig study status s/\n"
        "Exit codes: 0 fine, 1 a part is contradictory or of another study, 2 bad usage "
        "or input.");
    add_merge(*study, o, exit_code);
    study->footer(
        "Example: vibrig study plan STUDY.toml -o s/ && vibrig study run s/ && vibrig "
        "study merge s/");
}

}  // namespace vibrig::tool
