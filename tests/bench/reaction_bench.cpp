#include <benchmark/benchmark.h>

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

#include "daemon/rt/acquisition.hpp"
#include "daemon/rt/estimator_stage.hpp"
#include "daemon/rt/real_clock.hpp"
#include "test_bench.hpp"
#include "tests/bench/rig_bus.hpp"
#include "tests/unit/daemon/interlock/fake_shaker.hpp"

// How long it takes from what comes in to what goes out: a sample that trips to the stop confirmed
// by a Modbus server, a frame to the filter's estimate. tests/bench/report holds them against the
// goals.

namespace vibrig::bench {
namespace {

using drivers::kMillisecond;
using drivers::kSecond;
using drivers::Time;

double seconds(Time t) { return drivers::to_seconds(t); }

/// Of values in any order, the one that a share of them does not exceed.
Time quantile(std::vector<Time>& values, double share) {
    const auto n = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(n - 1);
    std::nth_element(values.begin(), at, values.end());
    return *at;
}

/// A sample that trips to the stop written and confirmed. `hanging`: while another request waits
/// for an answer that never comes.
void reaction(benchmark::State& state, bool hanging) {
    constexpr std::size_t kTrips = 2000;
    drivers::test::TestServer server;
    rt::RealClock clock;
    const auto control = clock.make_waiter();
    auto settings = drivers::test::settings_for(server);
    settings.poll_period = 2 * kMillisecond;  // soon another request hangs
    const auto shaker = drivers::make_shaker(clock, settings);
    rt::Interlock interlock(
        *shaker, *control,
        {.table_g = 12.0, .witness = {.sample_period = 25 * drivers::kMillisecond}});
    std::atomic<Time> written{0};
    shaker->on_reading([&] { control->notify(); });
    shaker->on_stop_written([&] {
        written = clock.now();
        control->notify();
    });
    std::atomic<int> newest{0}, hung{0};  // connections
    std::atomic<bool> hang{false};
    server.script([&](const drivers::test::Request& request) {
        using drivers::test::Answer;
        newest = request.connection;
        if (!hang || (hung != 0 && hung != request.connection)) return Answer{};
        hung = request.connection;
        return Answer{Answer::Kind::hang, 0, {}};
    });
    shaker->start([] { return true; }, [](drivers::LinkState, const char*) {});
    const auto until = [&](const auto& done) {
        const Time deadline = clock.now() + 20 * kSecond;
        while (!done()) {
            insist(clock.now() < deadline, "the shaker does not answer");
            control->wait_until(clock.now() + kMillisecond);
        }
    };
    drivers::Sample sample;
    sample.quality.fill(drivers::Quality::good);
    drivers::PlatformStatus platform;
    platform.loop_closed = true;
    std::vector<Time> taken;
    for (auto _ : state) {
        for (std::size_t n = 0; n < kTrips; ++n) {
            until([&] {
                return shaker->state() == drivers::LinkState::running && !shaker->stop_pending();
            });
            if (hanging) {
                hung = 0;
                hang = true;
                until([&] { return hung != 0; });
            }
            written = 0;
            interlock.guard(rt::Guard::excitation);
            sample.table_accel = 13;
            const Time in = clock.now();
            interlock.arrived(in);
            interlock.check(sample, platform);
            until([&] { return written != 0; });
            taken.push_back(written - in);
            hang = false;
            sample.table_accel = 0;
            interlock.guard(rt::Guard::idle);
            interlock.acknowledge(interlock.latched());
        }
        state.SetIterationTime(seconds(quantile(taken, 0.999)));
    }
    state.counters["median_us"] = 1e6 * seconds(quantile(taken, 0.5));
    shaker->shut_down();
}

/// From a socket to a thread, from there to another: what waking costs, with nothing done.
class BareWakeUp {
  public:
    BareWakeUp() {
        insist(::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends_.data()) == 0, "socketpair");
        first_ = std::thread([this] {
            can_frame frame{};
            while (::recv(ends_[1], &frame, sizeof frame, 0) > 0) waiter_->notify();
            quit_ = true;
            waiter_->notify();
        });
        second_ = std::thread([this] {
            while (!quit_) {
                if (waiter_->wait_until(drivers::kNever)) ++seen_;
            }
        });
    }
    ~BareWakeUp() {
        ::shutdown(ends_[0], SHUT_RDWR);
        first_.join();
        second_.join();
        ::close(ends_[0]);
        ::close(ends_[1]);
    }
    BareWakeUp(const BareWakeUp&) = delete;
    BareWakeUp& operator=(const BareWakeUp&) = delete;

    Time once() {
        const std::uint64_t before = seen_;
        const can_frame frame{};
        const Time in = clock_.now();
        insist(::send(ends_[0], &frame, sizeof frame, 0) == sizeof frame, "send");
        while (seen_ == before) std::this_thread::yield();
        return clock_.now() - in;
    }

  private:
    rt::RealClock clock_;
    std::unique_ptr<drivers::Waiter> waiter_ = clock_.make_waiter();
    std::array<int, 2> ends_{};
    std::atomic<bool> quit_{false};
    std::atomic<std::uint64_t> seen_{0};
    std::thread first_, second_;
};

/// The frame that completes a sample to the estimate with that sample in it, less the wake-ups of
/// two threads: medians, taken in turn.
void estimate(benchmark::State& state) {
    constexpr Time kPeriod = 5 * kMillisecond;
    constexpr auto kRest = std::chrono::milliseconds(1);
    constexpr std::uint32_t kSamples = 1000;
    RigBus bus("vibrig-reaction-bench-" + std::to_string(::getpid()));
    rt::RealClock clock;
    const auto control = clock.make_waiter(), estimator_waiter = clock.make_waiter();
    FakeShaker shaker;
    rt::Interlock interlock(shaker, *control,
                            {.table_g = 12.0, .witness = {.sample_period = kPeriod}});
    interlock.guard(rt::Guard::excitation);
    rt::Ring<drivers::Sample> ring(4096);
    rt::Ring<rt::Fed> fed(4096);
    estimator::Identification identification{estimator::Settings{}};
    rt::EstimatorStage stage(ring, *estimator_waiter, *control, identification);
    stage.feed_to(fed);
    stage.time_by(clock, kPeriod);
    boost::asio::io_context io(1);
    drivers::CanPortSettings can;
    can.kind = drivers::CanPortSettings::Kind::seqpacket;
    can.path = bus.path;
    const auto port = drivers::make_can_port(io, can);
    drivers::AssemblerSettings settings;
    settings.sample_period = kPeriod;
    rt::Acquisition acquisition(io, *port, test::rig_dbc(), settings, clock, nullptr,
                                {ring, *estimator_waiter, *control, interlock, nullptr, nullptr,
                                 nullptr, nullptr, &stage.hand_over()});
    acquisition.start([](drivers::PortState, const char*) {});
    rt::DwellOrder order;
    order.from = clock.now();
    order.to = order.from + 1000 * kSecond;
    insist(stage.order(order), "a dwell");
    std::thread acquisition_thread([&] { io.run(); });
    std::thread estimator_thread([&] { stage.run(); });
    bus.accept();
    BareWakeUp bare;
    const auto pop = [&fed] { return fed.consume([](const rt::Fed&) {}) > 0; };
    for (auto _ : state) {
        std::vector<Time> with, without;
        Time next = clock.now();
        for (std::uint32_t n = 0; n < kSamples; ++n) {
            control->wait_until(next += kPeriod);
            const auto frames = RigBus::frames(n);
            for (std::size_t i = 0; i + 1 < frames.size(); ++i) bus.send(frames[i]);
            // Both after the same rest: a processor that has slept wakes more slowly.
            std::this_thread::sleep_for(kRest);
            without.push_back(bare.once());
            std::this_thread::sleep_for(kRest);
            while (pop()) {
            }
            const Time in = clock.now();
            bus.send(frames.back());
            // Before the clock knows the rate a sample may not count yet.
            bool came = false;
            while (!came && clock.now() - in < kSecond / 10) {
                came = pop();
                if (!came) std::this_thread::yield();
            }
            if (came) with.push_back(clock.now() - in);
        }
        insist(with.size() > kSamples * 9 / 10, "samples in the filter");
        const Time wake_up = quantile(without, 0.5), whole = quantile(with, 0.5);
        state.SetIterationTime(std::max(1e-9, seconds(whole - wake_up)));
        state.counters["wake_up_us"] = 1e6 * seconds(wake_up);
        state.counters["whole_us"] = 1e6 * seconds(whole);
    }
    acquisition.stop();
    acquisition_thread.join();
    stage.stop();
    estimator_thread.join();
}

BENCHMARK_CAPTURE(reaction, free, false)->Name("reaction_free")->UseManualTime()->Iterations(1);
BENCHMARK_CAPTURE(reaction, hanging, true)
    ->Name("reaction_hanging")
    ->UseManualTime()
    ->Iterations(1);
BENCHMARK(estimate)->Name("estimate_out")->UseManualTime()->Iterations(1);

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
