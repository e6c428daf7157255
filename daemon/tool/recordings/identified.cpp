#include "daemon/tool/recordings/identified.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "daemon/configuration/configuration.hpp"
#include "daemon/record/in_order.hpp"
#include "daemon/record/replay.hpp"
#include "daemon/record/shaken.hpp"
#include "daemon/report/paperwork.hpp"
#include "daemon/results/progress.hpp"
#include "daemon/results/spectrum_result.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/rt/dwell_order.hpp"
#include "daemon/tool/analysis/seen_plan.hpp"
#include "daemon/tool/analysis/spectrum_dwells.hpp"
#include "daemon/tool/analysis/stated_lines.hpp"
#include "daemon/tool/analysis/swept_dwells.hpp"
#include "daemon/tool/recordings/campaign_argument.hpp"
#include "daemon/tool/recordings/replayed_result.hpp"
#include "estimator/identification/identification.hpp"
#include "estimator/level/vibration_level.hpp"
#include "estimator/spectrum/sampling.hpp"
#include "estimator/spectrum/seen.hpp"
#include "estimator/uncertainty/verdict.hpp"
#include "proto/recording_csv.hpp"

namespace vibrig::tool {

namespace {

using proto::RecordingRow;

/// A result, and what of the recording contradicts the configuration.
struct Found {
    estimator::Result result;
    std::string contradiction;  ///< the first; empty: none
    std::vector<estimator::spectrum::SpectralDwell> spectral;
    std::vector<estimator::spectrum::Kind> kinds;
    std::vector<HeldOut> kept_out;          ///< of a CSV file, by its roles
    std::vector<estimator::DwellRow> rows;  ///< of a campaign, those apart included
    estimator::spectrum::Shaken shaken;
};

/// What the filter need not be asked for, of rows in their order: where a dwell begins, and what a
/// plan would have said of it.
class RowsSeen {
  public:
    struct Row {
        estimator::Measurement measurement;
        int run = 0, position = 0;
        bool begins = false;    ///< another dwell
        bool held_out = false;  ///< to prove a result
    };

    explicit RowsSeen(const estimator::Settings& settings) : plan_(settings) {}

    /// One dwell for each stretch of rows with the same run and position: a pair that comes back
    /// begins another.
    [[nodiscard]] Row see(const RecordingRow& row) {
        Row seen{measurement_of(row), row.run, row.position,
                 !any_ || row.run != run_ || row.position != position_, row.held_out};
        if (seen.begins) {
            // The times of the file may go on from dwell to dwell; that they do is known at its
            // end.
            if (any_ && !(row.time_s > last_s_)) common_clock_ = false;
            any_ = true;
            run_ = row.run;
            position_ = row.position;
            plan_.begin_dwell(run_);
        }
        last_s_ = row.time_s;
        plan_.add(seen.measurement);
        return seen;
    }
    [[nodiscard]] bool common_clock() const { return common_clock_; }
    [[nodiscard]] SeenPlan& plan() { return plan_; }

  private:
    SeenPlan plan_;
    bool any_ = false, common_clock_ = true;
    int run_ = 0, position_ = 0;
    double last_s_ = 0;
};

/// Throws where the method fits what is held out.
void hold_out(bool held_out, const estimator::Settings& settings) {
    if (held_out && settings.method != estimator::Method::joint)
        throw std::runtime_error(
            "role: found \"verify\" with estimator.method \"two-step\", which fits all dwells, "
            "expected \"joint\"");
}

/// Through the filter, with room for more dwells as they come.
class RowsIdentified {
  public:
    explicit RowsIdentified(const estimator::Settings& settings)
        : settings_(settings), identification_(settings, room_) {}

    void add(const RowsSeen::Row& row) {
        if (row.begins) begin_dwell(row);
        static_cast<void>(identification_.add(row.measurement));
    }
    Found found(const RowsSeen& seen) {
        if (dwells_ > 0) static_cast<void>(identification_.end_dwell());
        Found found;
        found.result = identification_.result();
        for (auto& row : found.result.rows) row.common_clock = seen.common_clock();
        found.contradiction = tell_doubts(settings_, identification_.means(), found.result);
        for (const estimator::DwellRow& row : identification_.rows())
            if (row.held_out) found.kept_out.push_back({row, {}});
        return found;
    }

  private:
    void begin_dwell(const RowsSeen::Row& row) {
        if (dwells_ > 0) static_cast<void>(identification_.end_dwell());
        if (++dwells_ > room_) identification_.reserve(room_ *= 2);
        estimator::DwellInfo info{row.run, row.position};
        info.begin_s = 0;
        info.held_out = row.held_out;
        hold_out(row.held_out, settings_);
        identification_.begin_dwell(info);
    }

    const estimator::Settings& settings_;
    std::size_t room_ = 1024, dwells_ = 0;
    estimator::Identification identification_;
};

/// A file of any length, in memory that does not grow with it: another thread reads ahead, and does
/// what the filter does not wait for.
Found identify(proto::RecordingReader& file, std::uint64_t size,
               const configuration::Configuration& rig, const std::string& path, bool held_out) {
    const estimator::Settings& settings = rig.estimator;
    struct Block {
        std::vector<RowsSeen::Row> rows;
        std::uint64_t bytes = 0;  ///< of the file, up to its end
    };
    constexpr std::size_t kBlock = 4096;
    RowsSeen seen(settings);
    RowsIdentified identified(settings);
    {
        record::InOrder<Block> blocks(
            [&]() -> std::optional<Block> {
                Block block;
                block.rows.reserve(kBlock);
                RecordingRow row;
                while (block.rows.size() < kBlock && file.next(row))
                    block.rows.push_back(seen.see(row));
                block.bytes = file.bytes();
                return !block.rows.empty() ? std::optional(std::move(block)) : std::nullopt;
            },
            std::identity(), 1);
        Progress progress("identifying");
        while (const auto block = blocks.next()) {
            for (const RowsSeen::Row& row : block->rows) identified.add(row);
            progress.show(block->bytes, std::max(size, block->bytes));
        }
    }
    // A few dwells that a result is tried on determine nothing by themselves.
    if (!held_out) seen.plan().tell();
    Found found = identified.found(seen);
    // All that shook did so at the frequency of the configuration.
    const Spectra none;
    DwellKinds kinds(rig, none);
    const RecordingRow any;
    kinds.add({&any}, {}, path);
    found.kinds = kinds.kinds();
    const auto kind_of = [&kinds](const estimator::DwellRow& row) {
        return row.vibration.kappa > 1 ? kinds.of(0) : std::nullopt;
    };
    for (const estimator::DwellRow& row : found.result.rows)
        found.spectral.push_back({row, kind_of(row), 0});
    for (auto& [row, kind] : found.kept_out)
        if (const auto known = kind_of(row)) kind = found.kinds[*known];
    return found;
}

std::vector<RecordingRow> rows_of(proto::RecordingReader& file) {
    std::vector<RecordingRow> rows(1);
    while (file.next(rows.back())) rows.emplace_back();
    rows.pop_back();
    return rows;
}

struct Dwell {
    int run = 0;
    int position = 0;
    std::vector<const RecordingRow*> rows;
};

/// One dwell for each stretch of rows with the same run and position: a pair that comes back
/// begins another.
std::vector<Dwell> dwells_of(const std::vector<RecordingRow>& rows) {
    std::vector<Dwell> dwells;
    for (const RecordingRow& row : rows) {
        if (dwells.empty() || dwells.back().run != row.run ||
            dwells.back().position != row.position)
            dwells.push_back({row.run, row.position, {}});
        dwells.back().rows.push_back(&row);
    }
    return dwells;
}

/// Out of the dwells.
std::vector<estimator::spectrum::Sweep> take_sweeps(std::vector<Dwell>& dwells,
                                                    const estimator::Settings& settings,
                                                    const std::string& file) {
    std::vector<estimator::spectrum::Sweep> sweeps;
    for (const Dwell& dwell : dwells)
        if (is_sweep(dwell.rows)) sweeps.push_back(sweep_of(settings, dwell.rows, file));
    std::erase_if(dwells, [](const Dwell& dwell) { return is_sweep(dwell.rows); });
    if (dwells.empty())
        throw std::runtime_error(file +
                                 ": found sweeps alone, expected dwells at one frequency as well, "
                                 "which the 30 coefficients are of");
    return sweeps;
}

/// The times of the file go on from dwell to dwell.
bool has_common_clock(const std::vector<Dwell>& dwells) {
    for (std::size_t d = 1; d < dwells.size(); ++d) {
        if (!(dwells[d].rows.front()->time_s > dwells[d - 1].rows.back()->time_s)) return false;
    }
    return true;
}

void expect_sine(const DwellKinds& kinds, const SpectrumRequest& request, const std::string& file) {
    if (!kinds.kinds().empty() && !kinds.reference() && !request.held_out)
        throw std::runtime_error(file +
                                 ": found random vibration alone, expected dwells at one sine "
                                 "frequency at least, which the 30 coefficients are of");
}

/// Of dwells whose column `frequency_hz` has a frequency, which may be that of a table at 0 g.
void warn_of_rest(const std::vector<Dwell>& dwells, const std::vector<std::size_t>& resting,
                  estimator::Result& result) {
    if (resting.empty()) return;
    const Dwell& first = dwells[resting.front()];
    result.warnings.push_back(
        printed("column frequency_hz has a frequency in %zu dwells in which nothing vibrates: they "
                "are taken as rest (the first: line %zu, run %d, position %d, %g Hz)",
                resting.size(), first.rows.front()->line, first.run, first.position,
                first.rows.front()->frequency_hz));
}

/// A frequency of which a harmonic falls on a multiple of the sampling rate, where the recording
/// or its spectra name its frequencies: the level, and with it the row, would be wrong.
void refuse_forbidden(const DwellKinds& kinds, const std::vector<RecordingRow>& rows,
                      const estimator::Settings& settings, const std::string& file, bool spectra) {
    if (rows.front().frequency_hz < 0 && !spectra) return;
    std::vector<double> times_s;
    for (std::size_t i = 0; i < std::min<std::size_t>(rows.size(), 1001); ++i)
        times_s.push_back(rows[i].time_s);
    const double period_s = estimator::median_interval(times_s);
    if (!(period_s > 0)) return;
    namespace spectrum = estimator::spectrum;
    for (const spectrum::Kind& kind : kinds.kinds()) {
        if (!kind.profile.empty()) continue;
        const double hz = kind.hz(), window_s = settings.level_window_s;
        if (!spectrum::forbidden(hz, 1 / period_s, window_s)) continue;
        throw std::runtime_error(
            file +
            printed(": %s: found %g Hz at %g samples/s, of which a harmonic falls on a multiple of "
                    "the rate, expected another: %s",
                    spectra ? "--spectra" : "column frequency_hz", hz, 1 / period_s,
                    spectrum::nearest_free_words(hz, 1 / period_s, window_s).c_str()));
    }
}

/// Divided by what is left of it, a vibration that they hardly see would be anything.
void refuse_unseen(const DwellKinds& kinds, const estimator::Settings& settings,
                   const std::string& file) {
    for (const estimator::spectrum::Kind& kind : kinds.kinds()) {
        const double share =
            estimator::spectrum::seen_of(settings.accelerometer_response, kind.bands).share;
        if (share >= estimator::kLeastSeen) continue;
        const std::string name = kind.profile.empty() ? "" : "profile '" + kind.profile + "' ";
        throw std::runtime_error(
            file + printed(": found %.120sabout %g Hz, of which the accelerometers see %.3g of the "
                           "power, expected half of it at least",
                           name.c_str(), kind.hz(), share));
    }
}

/// Dwells of which the recording says with which frequency they shook, once through the filter.
class DwellsIdentified {
  public:
    DwellsIdentified(const std::vector<Dwell>& dwells, const DwellKinds& kinds,
                     const estimator::Settings& settings, const std::string& file)
        : dwells_(dwells),
          kinds_(kinds),
          settings_(settings),
          file_(file),
          common_clock_(has_common_clock(dwells)),
          identification_(settings, dwells.size()),
          plan_(settings) {
        std::size_t samples = 0, done = 0;
        for (const Dwell& dwell : dwells) samples += dwell.rows.size();
        Progress progress("identifying");
        for (std::size_t d = 0; d < dwells.size(); ++d) {
            const std::size_t before = identification_.rows().size();
            begin_dwell(d);
            for (const RecordingRow* row : dwells[d].rows) {
                const auto measurement = measurement_of(*row);
                static_cast<void>(identification_.add(measurement));
                plan_.add(measurement);
                // Asking a clock costs more than a filter step.
                if (++done % 1024 == 0) progress.show(done, samples);
            }
            static_cast<void>(identification_.end_dwell());
            if (identification_.rows().size() > before) keep(d, identification_.rows().back());
        }
    }

    /// Those that may have been at rest, and were.
    [[nodiscard]] const std::vector<std::size_t>& resting() const { return resting_; }
    [[nodiscard]] Found found(bool held_out) {
        if (!held_out) plan_.tell();
        found_.kinds = kinds_.kinds();
        found_.result = identification_.result();
        found_.contradiction = tell_doubts(settings_, identification_.means(), found_.result);
        return std::move(found_);
    }

  private:
    void begin_dwell(std::size_t d) {
        const Dwell& dwell = dwells_[d];
        const auto kind = kinds_.of(d);
        estimator::DwellInfo info{dwell.run, dwell.position};
        if (common_clock_) info.begin_s = 0;
        info.held_out = dwell.rows.front()->held_out;
        hold_out(info.held_out, settings_);
        info.random = kinds_.random(d);
        if (kind && !is_random(d)) info.frequency_hz = kinds_.kinds()[*kind].hz();
        if (kind)
            info.seen = estimator::spectrum::seen_of(settings_.accelerometer_response,
                                                     kinds_.kinds()[*kind].bands);
        identification_.begin_dwell(info);
        plan_.begin_dwell(dwell.run);
    }
    [[nodiscard]] bool is_random(std::size_t d) const {
        return kinds_.random(d).mean_square_g2 > 0;
    }
    void keep(std::size_t d, const estimator::DwellRow& row) {
        const auto kind = kinds_.of(d);
        const bool shook = row.vibration.kappa > 1;
        if (shook && !kind)
            refuse(d, "a dwell at rest that vibrates by " +
                          std::to_string(std::sqrt(2 * (row.vibration.kappa - 1))) +
                          " g, expected its frequency");
        if (!shook && kind) {
            // As rest, what shook unseen would be gravity's.
            const auto said = kinds_.said_by(d);
            if (said == DwellKinds::Said::stated ||
                (said == DwellKinds::Said::column && !settings_.accelerometer_response.flat()))
                refuse(d, "a dwell in which nothing vibrates, expected " +
                              (is_random(d) ? "profile '" + kinds_.kinds()[*kind].profile + "'"
                                            : printed("%g Hz", kinds_.kinds()[*kind].hz())) +
                              ", with which it is said to have shaken");
            resting_.push_back(d);
        }
        if (shook && !is_random(d) && kinds_.kinds()[*kind].bands.size() > 1)
            expect_lines(d, kinds_.kinds()[*kind].bands);
        if (row.held_out)
            found_.kept_out.push_back(
                {row, shook ? kinds_.kinds()[*kind] : estimator::spectrum::Kind{}});
        else
            found_.spectral.push_back({row, shook ? kind : std::nullopt, row.relative_error});
    }
    void expect_lines(std::size_t d, const std::vector<estimator::spectrum::Band>& lines) const {
        const auto against =
            against_lines(dwells_[d].rows, lines, settings_.accelerometer_response);
        if (!against.empty())
            refuse(d,
                   printed("run %d, position %d: ", dwells_[d].run, dwells_[d].position) + against);
    }
    [[noreturn]] void refuse(std::size_t d, const std::string& what) const {
        throw std::runtime_error(file_ + ":" + std::to_string(dwells_[d].rows.front()->line) +
                                 ": found " + what);
    }

    const std::vector<Dwell>& dwells_;
    const DwellKinds& kinds_;
    const estimator::Settings& settings_;
    const std::string& file_;
    bool common_clock_;
    estimator::Identification identification_;
    SeenPlan plan_;
    Found found_;
    std::vector<std::size_t> resting_;
};

/// A recording that says with which frequency each dwell shook: kept whole, since the frequency
/// that the filter takes is known at its end.
Found identify(const std::vector<RecordingRow>& rows, const std::vector<std::string>& profiles,
               const configuration::Configuration& rig, const SpectrumRequest& request,
               const std::string& file) {
    estimator::Settings settings = rig.estimator;
    std::vector<Dwell> dwells = dwells_of(rows);
    auto sweeps = take_sweeps(dwells, settings, file);
    DwellKinds kinds(rig, request.spectra);
    for (const Dwell& dwell : dwells) kinds.add(dwell.rows, profiles, file);
    std::vector<std::size_t> set_points_at_rest;
    while (true) {
        expect_sine(kinds, request, file);
        const auto reference = kinds.reference();
        settings.frequency_hz =
            reference ? kinds.kinds()[*reference].hz() : rig.estimator.frequency_hz;
        refuse_forbidden(kinds, rows, settings, file, !request.spectra.empty());
        refuse_unseen(kinds, settings, file);
        DwellsIdentified identified(dwells, kinds, settings, file);
        if (identified.resting().empty()) {
            kinds.expect_listed(file);
            Found found = identified.found(request.held_out);
            found.shaken.sweeps = std::move(sweeps);
            warn_of_rest(dwells, set_points_at_rest, found.result);
            return found;
        }
        // What is known to be at rest is no dwell of another frequency, which the filter would
        // leave out: all of it again.
        for (const std::size_t d : identified.resting())
            if (kinds.said_by(d) == DwellKinds::Said::column) set_points_at_rest.push_back(d);
        kinds.put_at_rest(identified.resting());
    }
}

/// Of a campaign's HDF5 file the dwells as they were fed, with the levels commanded.
Found identify(const record::Campaign& campaign, const estimator::Settings& settings) {
    const auto dwells = record::recorded_dwells(campaign);
    SeenPlan plan(settings);
    for (const auto& dwell : dwells) {
        if (dwell.order->sweep.any()) continue;
        plan.begin_dwell(dwell.order->run);
        for (std::size_t i = dwell.first; i < dwell.first + dwell.count; ++i)
            plan.add(
                rt::measurement_of(campaign.samples[i], dwell.order->from, dwell.order->zero_g));
    }
    plan.tell();
    std::optional<dwells::Anew> anew;
    if (campaign.found) anew.emplace(settings, *campaign.found, dwells.size());
    estimator::Identification as_recorded(settings, dwells.size());
    auto& identification = anew ? anew->identification() : as_recorded;
    Progress progress("identifying");
    std::size_t done = 0;
    for (const auto& dwell : dwells)
        record::feed(identification, campaign, dwell,
                     [&](std::size_t, const estimator::StepResult&) {
                         if (++done % 1024 == 0) progress.show(done, campaign.samples.size());
                     });
    Found found;
    found.result = anew ? anew->result() : identification.result();
    record::qualify(campaign, dwells.size(), found.result);
    found.contradiction = tell_doubts(settings, identification.means(), found.result);
    found.rows = identification.rows();
    return found;
}

Found identify_campaign(const std::string& path, const std::string& config, Identified& to) {
    record::Campaign campaign = read_named_campaign(path);
    if (!campaign.incomplete.empty()) throw std::runtime_error(campaign.incomplete);
    if (!config.empty()) record::forget_noise(campaign);
    const auto rig = config.empty() ? report::configuration_of(campaign)
                                    : configuration::load(config, false).configuration;
    to.simulated = campaign.head.simulated;
    to.campaign = names_of(campaign);
    if (campaign.found) {
        to.live = {*campaign.found, record::live_result(campaign, rig.estimator), {}};
        to.live->assessed = estimator::uncertainty::assess(rig.estimator, to.live->result);
    }
    to.settings = dwells::Anew::settings_of(rig.estimator, campaign.found);
    Found found = identify(campaign, to.settings);
    found.shaken = record::shaken_of(campaign, rig);
    return found;
}

/// A folder, an HDF5 file, or the name of a campaign: then there is no such file.
bool is_campaign(const std::string& argument) {
    std::error_code error;
    return !std::filesystem::is_regular_file(argument, error)
               ? std::filesystem::is_directory(argument, error) ||
                     argument.find_first_of("/.") == std::string::npos
               : record::is_hdf5(argument);
}

/// Of a recording whose dwells are to prove a result: those that it holds out itself, or all.
std::vector<HeldOut> held_out_of(const Found& found) {
    if (!found.kept_out.empty()) return found.kept_out;
    std::vector<HeldOut> list;
    for (const auto& dwell : found.spectral)
        list.push_back(
            {dwell.row, dwell.kind ? found.kinds[*dwell.kind] : estimator::spectrum::Kind{}});
    return list;
}

}  // namespace

Identified identify_recording(const std::string& file, const std::string& config,
                              const SpectrumRequest& request) {
    Identified identified;
    Found found;
    if (is_campaign(file)) {
        found = identify_campaign(file, config, identified);
    } else {
        const auto loaded = configuration::load(config, false);
        identified.settings = loaded.configuration.estimator;
        proto::RecordingReader reader(file);
        identified.simulated = loaded.configuration.simulated() || reader.simulated();
        std::error_code unknown;
        const auto size = std::filesystem::file_size(file, unknown);
        const auto& rig = loaded.configuration;
        if (reader.has_frequency() || reader.has_profile() || !request.spectra.empty()) {
            const std::vector<RecordingRow> rows = rows_of(reader);
            found = identify(rows, reader.profiles(), rig, request, file);
        } else {
            found = identify(reader, unknown ? 0 : size, rig, file, request.held_out);
        }
        if (!reader.warning().empty()) found.result.warnings.push_back(reader.warning());
        if (request.held_out) identified.held_out = held_out_of(found);
    }
    identified.result = std::move(found.result);
    auto [assessed, spectrum] =
        assess(identified.settings, {}, identified.result, found.rows, found.shaken, request.form);
    if (assessed.done && found.spectral.size() > kMostSpectralDwells && found.kinds.size() > 1) {
        identified.result.warnings.push_back(
            "found " + std::to_string(found.spectral.size()) + " dwells, expected at most " +
            std::to_string(kMostSpectralDwells) +
            " for coefficients over frequency: those at the reference frequency stand");
    } else if (assessed.done && found.spectral.size() >= 2 &&
               found.spectral.size() <= kMostSpectralDwells) {
        spectrum =
            spectrum_of(identified.settings, std::move(found.spectral), std::move(found.kinds),
                        request.form, std::move(found.shaken.sweeps));
        spectrum->held_out = std::move(found.kept_out);
        adopt(*spectrum, identified.settings, assessed);
    }
    identified.assessed = std::move(assessed);
    identified.spectrum = std::move(spectrum);
    for (const estimator::DwellRow& row : found.rows) {
        if (!row.held_out) continue;
        const auto profile = std::ranges::find_if(
            found.shaken.profiles, [&row](const auto& one) { return one.first == row.profile; });
        if (row.random && profile == found.shaken.profiles.end()) continue;
        const double hz =
            row.commanded_hz > 0 ? row.commanded_hz : identified.settings.frequency_hz;
        identified.held_out.push_back(
            {row, row.random ? profile->second : estimator::spectrum::Kind{"", {{hz, 1, 0}}}});
        if (row.psd > 0 && row.psd <= found.shaken.psds.size())
            identified.held_out.back().kind.bands = found.shaken.psds[row.psd - 1];
    }
    estimator::uncertainty::contradict(identified.assessed.verdict, found.contradiction);
    return identified;
}

estimator::uncertainty::MonteCarlo draw(const Identified& of) {
    if (of.assessed.over_frequency)
        throw std::runtime_error(
            "--monte-carlo: found dwells at several frequencies, expected one frequency");
    Progress progress("drawing");
    const estimator::uncertainty::MonteCarloSettings how;
    return estimator::uncertainty::propagate_distributions(
        of.settings, of.result, of.assessed, how,
        [&](int blocks) { progress.show(static_cast<std::size_t>(blocks), 100); });
}

}  // namespace vibrig::tool
