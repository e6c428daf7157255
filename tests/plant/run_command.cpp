#include <fcntl.h>
#include <signal.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "proto/durable_file.hpp"
#include "proto/option_value.hpp"
#include "tests/plant/commands.hpp"
#include "tests/plant/control.hpp"
#include "tests/plant/modbus_server.hpp"
#include "tests/plant/simulation.hpp"

namespace vibrig::plant {
namespace {

struct Options {
    std::string can = "vcan0";
    std::string modbus = "tcp:127.0.0.1:1502";
    std::string clock = "rig";
    std::string speed = "max";
    std::string truth;
    std::string write_truth;
    std::string dbc;
    std::string ready_file;
    std::string control;
    std::vector<std::string> faults;
    std::optional<std::uint64_t> seed;
    std::optional<double> warm_up_s;
    std::optional<double> start_temperature_c;
    std::optional<double> duration_s;
    std::optional<double> hold_at_s;
};

class Descriptor {
  public:
    explicit Descriptor(int fd) : fd_(fd) {}
    ~Descriptor() {
        if (fd_ > STDERR_FILENO) close(fd_);
    }
    Descriptor(const Descriptor&) = delete;
    Descriptor& operator=(const Descriptor&) = delete;
    [[nodiscard]] int get() const { return fd_; }

  private:
    int fd_;
};

Truth truth_of(const Options& o) {
    Truth truth = o.truth.empty() ? Truth{} : read_truth(o.truth);
    if (o.seed) truth.seed = *o.seed;
    if (o.warm_up_s) truth.warm_up_s = *o.warm_up_s;
    if (o.start_temperature_c) truth.start_temperature_c = *o.start_temperature_c;
    if (!o.write_truth.empty()) write_truth(truth, o.write_truth);
    return truth;
}

SimulationSettings settings_of(const Options& o) {
    SimulationSettings settings;
    settings.lockstep = o.clock == "rig";
    settings.duration_s = o.duration_s;
    if (o.speed != "max") {
        settings.speed = speed_of(o.speed, "--speed");
        if (!settings.lockstep && settings.speed != 1) {
            throw PlantError("--speed " + o.speed +
                             ": the real clock has speed 1, expected --clock rig");
        }
    }
    return settings;
}

int open_control(const std::string& path) {
    if (path.empty()) return -1;
    if (path == "-") return STDIN_FILENO;
    if (mkfifo(path.c_str(), 0600) != 0 && errno != EEXIST) {
        throw PlantError("--control " + path + ": " + std::strerror(errno) +
                         ", expected - or a FIFO");
    }
    // Read and write, so that it does not end when a writer goes.
    const int fd = open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) throw PlantError("--control " + path + ": " + std::strerror(errno));
    return fd;
}

// A reader sees the whole file or none.
void write_ready_file(const Options& o, const ModbusServer& modbus) {
    const nlohmann::json ready{
        {"can", o.can}, {"modbus", modbus.address()}, {"modbus_port", modbus.port()}};
    proto::write_output(o.ready_file, ready.dump() + "\n");
}

void run(const Options& o) {
    // Before any thread exists, so that all of them leave the signals to the descriptor.
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    signal(SIGPIPE, SIG_IGN);
    const Descriptor stop(signalfd(-1, &signals, SFD_CLOEXEC));

    const SimulationSettings settings = settings_of(o);
    const proto::Dbc dbc =
        o.dbc.empty() ? proto::parse_dbc(proto::rig_dbc_text(), "rig.dbc") : proto::read_dbc(o.dbc);
    const Truth truth = truth_of(o);
    SharedRig shared(truth);
    if (o.hold_at_s) {
        if (!settings.lockstep)
            throw PlantError("--hold-at: the real clock cannot be held, expected --clock rig");
        if (o.control.empty())
            throw PlantError("--hold-at: nobody could let it go on, expected --control");
        shared.hold_at_s = o.hold_at_s;
    }
    for (const std::string& spec : o.faults) shared.faults.add(parse_fault(spec, 0));
    const Descriptor commands(open_control(o.control));
    const std::unique_ptr<Bus> bus = open_bus(o.can);
    ModbusServer modbus(o.modbus, shared);
    Control control(shared);
    Simulation simulation(shared, *bus, dbc, settings, stop.get(), commands.get(),
                          [&] { return control.read(commands.get()); });
    std::printf("vibrig-plant: bus %s, modbus %s, clock %s, seed %llu\n", o.can.c_str(),
                modbus.address().c_str(), o.clock.c_str(),
                static_cast<unsigned long long>(truth.seed));
    std::fflush(stdout);
    if (!o.ready_file.empty()) write_ready_file(o, modbus);
    simulation.run();
    const Simulation::Counters& c = simulation.counters();
    std::printf(
        "vibrig-plant: %.3f s simulated, %llu frames, %llu commands, %llu resent, %llu lost by "
        "faults, %llu dropped\n",
        shared.now_s(), static_cast<unsigned long long>(c.frames),
        static_cast<unsigned long long>(c.commands), static_cast<unsigned long long>(c.resent),
        static_cast<unsigned long long>(shared.faults.lost()),
        static_cast<unsigned long long>(bus->dropped()));
    if (!o.ready_file.empty()) unlink(o.ready_file.c_str());
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
    auto o = std::make_shared<Options>();
    CLI::App* command = app.add_subcommand(
        "run", "Simulate the rig on a CAN bus and a Modbus server (the default)");
    command
        ->add_option("--can", o->can,
                     "SocketCAN interface, or seqpacket:PATH to be the hub of a bus without CAN")
        ->capture_default_str();
    command
        ->add_option("--modbus", o->modbus, "tcp:ADDRESS:PORT (port 0: any free one) or rtu:DEVICE")
        ->capture_default_str();
    command
        ->add_option(
            "--clock", o->clock,
            "rig: lockstep with the daemon; real: as many samples a second as the truth says")
        ->check(CLI::IsMember({"rig", "real"}))
        ->capture_default_str();
    command->add_option("--speed", o->speed, "with --clock rig: at most so many times real time")
        ->capture_default_str();
    command->add_option("--truth", o->truth,
                        "truth file (JSON); default: Table 2 of Tang et al. 2009");
    command->add_option("--write-truth", o->write_truth, "write the truth used to this file");
    command
        ->add_option("--seed", o->seed, "of all noise and faults; default: the truth file's, or 1")
        ->check(proto::whole());
    command->add_option("--warm-up", o->warm_up_s, "until the platform reports ready, s")
        ->check(proto::finite(0.0, 1e6));
    command->add_option("--start-temperature", o->start_temperature_c, "of the platform, degC")
        ->check(proto::finite(-60.0, 150.0));
    command->add_option("--duration", o->duration_s, "end after so many simulated seconds")
        ->check(proto::finite(0.0, 1e9));
    command
        ->add_option(
            "--hold-at", o->hold_at_s,
            "with --clock rig: its time stands still there until the command go or another hold")
        ->check(proto::finite(0.0, 1e9));
    command->add_option("--fault", o->faults, "a fault, see below; may be given several times")
        ->allow_extra_args(false);
    command->add_option("--control", o->control,
                        "take commands, one a line, from this FIFO, or - for standard input");
    command->add_option("--dbc", o->dbc, "messages of the bus; default: the built-in rig.dbc");
    command->add_option("--ready-file", o->ready_file,
                        "write addresses here (JSON) once both servers listen");
    command->footer(fault_help() + "Commands: " + kControlLines +
                    "\nExample:\n  vibrig-plant run --can seqpacket:/tmp/rig.sock --modbus "
                    "tcp:127.0.0.1:0 --seed 7 "
                    "--fault lose=0.01@100..200 --fault stuck:outer@300..301");
    command->callback([o, &exit_code] {
        run(*o);
        exit_code = 0;
    });
}

}  // namespace vibrig::plant
