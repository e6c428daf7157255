// What the recorder's thread does for one sample and its frames: rows of the HDF5 file, lines of
// the raw log, both handed to the kernel twice a second, closed segments compressed.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>
#include <string>

#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/raw_log.hpp"
#include "tests/unit/support/temporary_folder.hpp"

namespace vibrig::bench {
namespace {

constexpr int kRate_hz = 1000;
constexpr int kFrames = 10;  ///< of one sample: four sensors' boxes, sync, platform, rig's time

void write_sample(benchmark::State& state) {
    const TemporaryFolder folder;
    record::Head head;
    head.name = head.campaign = "bench";
    configuration::RecordSettings settings;
    settings.keep_free_mb = 0;
    settings.segment_mb = 4;
    record::CampaignWriter writer(folder.file("campaign.h5"), head);
    record::RawLog log(folder.string(), "can0", settings, 1'700'000'000 * drivers::kSecond, {});
    std::mt19937 random(1);
    std::normal_distribution<double> noise;
    drivers::Sample sample;
    record::FrameRecord frame;
    frame.frame.len = 8;
    int n = 0;
    for (auto _ : state) {
        sample.time += drivers::kSecond / kRate_hz;
        ++sample.sequence;
        for (std::size_t k = 0; k < 3; ++k) {
            sample.angle[k] = 0.1 + 2.4e-5 * noise(random);
            sample.force[k] = noise(random);
        }
        writer.put(sample);
        for (int i = 0; i < kFrames; ++i) {
            frame.frame.can_id = static_cast<canid_t>(0x100 + i);
            const auto bits = random();
            for (std::size_t b = 0; b < 4; ++b)
                frame.frame.data[b] = static_cast<std::uint8_t>(bits >> (8 * b));
            frame.time = sample.time + i * drivers::kMicrosecond;
            log.add(frame);
        }
        if (++n % (kRate_hz / 2) == 0) {
            writer.commit();
            log.flush();
        }
    }
    if (log.lost() > 0) state.SkipWithError("the disk refused");
}
BENCHMARK(write_sample)->Name("record_sample");

}  // namespace
}  // namespace vibrig::bench

BENCHMARK_MAIN();
