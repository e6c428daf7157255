#include "estimator/identification/identification.hpp"

#include <algorithm>
#include <cmath>

#include "estimator/filter/settings_check.hpp"
#include "estimator/identification/identification_impl.hpp"

namespace vibrig::estimator {
namespace {

/// A longer gap is treated as a change of position: the angles start afresh.
constexpr double kLongestPause_s = 1.0;
/// More readings than are missing in it at 10 kHz, where their times lie and leave room for
/// millions.
constexpr double kMostMissing = 20'000;
/// So many stamps in a row before the newest accepted one mean that that one was wrong.
constexpr int kBadTimesBeforeRestart = 5;
/// Of kappa by eq. 13: what it is off by, all quadratic coefficients are.
constexpr double kPaperTolerance = 0.01;

const Settings& checked(const Settings& settings) {
    check(settings);
    return settings;
}

ParameterArray sigma_of(const Solution& solution) noexcept {
    ParameterArray sigma{};
    for (std::size_t i = 0; i < kParameters; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        sigma[i] = std::sqrt(std::max(0.0, solution.covariance(k, k)));
    }
    return sigma;
}

std::vector<double> in_rows(const Covariance& covariance) {
    std::vector<double> rows;
    rows.reserve(kParameters * kParameters);
    for (std::size_t i = 0; i < kParameters; ++i) {
        for (std::size_t j = 0; j < kParameters; ++j) {
            rows.push_back(covariance(static_cast<Eigen::Index>(internal_of(i)),
                                      static_cast<Eigen::Index>(internal_of(j))));
        }
    }
    return rows;
}

template <class T>
void bring_in(std::vector<T>& all, std::size_t most) {
    const std::size_t size = all.size();
    all.resize(std::max(size, most));
    all.resize(size);
}

template <class Container>
bool finite(const Container& values) noexcept {
    return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

Identification::Impl::Impl(const Settings& s, std::size_t max_dwells)
    : settings(checked(s)),
      prior(prior_sigma(s)),
      filters{
          RunFilter(s, s.method == Method::joint || s.all_at_once ? prior : two_step_prior(prior)),
          RunFilter(s, two_step_prior(prior))},
      noise(noise_levels(s)),
      kinematics_(s),
      accelerometer_zero_(s.accelerometer_zero_g[0], s.accelerometer_zero_g[1],
                          s.accelerometer_zero_g[2]),
      stuck_(s),
      saturation_(s.accelerometer_g, s.accelerometer_range_g),
      buffer_(VibrationLevel::kFirstWindow_s,
              std::max(VibrationLevel::kFirstWindow_s, s.level_window_s),
              VibrationLevel::kHighestRate_hz),
      level_(s.level_window_s, s.accelerometer_g, s.frequency_hz),
      sync_(s.frequency_hz),
      paper_(s.frequency_hz, s.forgetting) {
    for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) {
            accelerometer_matrix_(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) =
                s.accelerometer_matrix[r][c];
        }
    }
    reserve(max_dwells);
    solve(solution);
}

void Identification::Impl::reserve(std::size_t max_dwells) {
    dwells.reserve(max_dwells);
    means.reserve(max_dwells);
    rows.reserve(settings.method == Method::joint ? max_dwells : 0);
    paper_starts_.reserve(max_dwells);
}

Reading Identification::Impl::prepare(const Measurement& m) const noexcept {
    Reading reading;
    reading.time_s = m.time_s;
    if (m.angles_good && finite(m.angle_rad)) {
        reading.angles = kinematics_.gimbal_angles(m.angle_rad);
        reading.angles_good = std::abs(reading.angles[1]) <= kMaxInnerAngleRad;
    }
    if (m.force_good && finite(m.force_g)) {
        reading.force =
            accelerometer_matrix_ *
            (Eigen::Vector3d(m.force_g[0], m.force_g[1], m.force_g[2]) - accelerometer_zero_);
        reading.force_good = true;
    }
    return reading;
}

RunFilter* Identification::Impl::filter_of(int run) noexcept {
    if (settings.method == Method::joint) return &filters[0];
    for (RunFilter& candidate : filters) {
        if (candidate.run == 0) candidate.run = run;
        if (candidate.run == run) return &candidate;
    }
    return nullptr;
}

void Identification::Impl::begin_dwell(const DwellInfo& dwell) noexcept {
    if (in_dwell_) end_dwell();
    in_dwell_ = true;
    record_ = {};
    record_.info = dwell;
    buffer_.clear();
    primed_ = false;
    stuck_.clear();
    sync_.clear();
    saturation_.clear();
    bad_times_in_a_row_ = 0;
    walked_.reset();
    power_lost_ = power_lost_ || dwell.power_lost;
    const double hz = dwell.frequency_hz > 0 ? dwell.frequency_hz : settings.frequency_hz;
    random_ = dwell.random.mean_square_g2 > 0;
    swept_ = dwell.sweep.any();
    apart_ = settings.method == Method::joint &&
             (dwell.held_out || random_ || swept_ || !at_reference(settings, hz));
    record_.seen = seen_of(dwell, hz);
    level_.nominal(hz);
    sync_.nominal(hz);
    harmonics_.begin(random_ || swept_ ? 0 : hz, period_s_);
    active_ = filter_of(dwell.run);
    if (active_ == nullptr) {
        refused_run = true;
        return;
    }
    active_->saved = active_->filter.state();
    active_->batch.begin_dwell();
    active_->filter.begin_dwell();
    begin_paper_level();
}

Seen Identification::Impl::seen_of(const DwellInfo& dwell, double hz) const noexcept {
    Seen seen;
    if (dwell.seen) {
        seen = *dwell.seen;
    } else if (!random_) {
        seen = {settings.accelerometer_response.power(hz),
                settings.accelerometer_response.skew_error(hz)};
    } else {
        for (const auto& [profile, of] : settings.seen_profiles) {
            if (profile == dwell.random.profile) seen = of;
        }
    }
    if (!(seen.share > 0)) seen.share = 1;  // not known: refused where it is stated
    return seen;
}

void Identification::Impl::begin_paper_level() noexcept {
    paper_.begin();
    if (active_ != &filters[1] || !(record_.info.table_g >= 0)) return;
    for (const PaperStart& start : paper_starts_) {
        if (start.position != record_.info.position) continue;
        // eq. 17; at a(1) = 0 it divides by zero and is not used.
        if (start.table_g > 0)
            paper_.begin(start.amplitude_g * record_.info.table_g / start.table_g);
        return;
    }
}

StepResult Identification::Impl::add(const Measurement& measurement) noexcept {
    if (!in_dwell_) begin_dwell({});
    ++record_.samples;
    StepResult step;
    if (active_ == nullptr) {
        ++record_.rejected;
        step.outcome = StepOutcome::gated;
        return step;
    }
    const bool first = record_.samples == 1 || (buffer_.empty() && !primed_);
    if (record_.samples == 1) dwell_begin_s_ = measurement.time_s;
    const double dt = measurement.time_s - last_time_s_;
    bool restart = false;
    if (!std::isfinite(measurement.time_s) || (!first && !(dt > 0))) {
        restart =
            std::isfinite(measurement.time_s) && ++bad_times_in_a_row_ >= kBadTimesBeforeRestart;
        if (!restart) {
            ++record_.rejected;
            step.outcome = StepOutcome::bad_time;
            return step;
        }
    }
    bad_times_in_a_row_ = 0;
    if (swept_) return leave_alone(measurement);
    if (!first && (restart || dt > kLongestPause_s)) {
        end_stretch();
        active_->filter.begin_dwell();
    }
    Reading reading = prepare(measurement);
    if (std::abs(reading.angles[1]) > kMaxInnerAngleRad) ++record_.locked;
    if (reading.angles_good && stuck_.stuck(measurement.angle_rad)) {
        reading.angles_good = false;
        ++record_.stuck;
    } else if (!apart_) {
        record_.means.add(measurement);
    }
    if (reading.force_good) {
        ++record_.forces;
        saturation_.add(measurement.force_g);
    }
    return accept(reading);
}

/// A drift that goes through a resonance is none that the filter could follow.
StepResult Identification::Impl::leave_alone(const Measurement& measurement) noexcept {
    StepResult step;
    const bool angles = measurement.angles_good && finite(measurement.angle_rad);
    const bool force = measurement.force_good && finite(measurement.force_g);
    step.outcome = !angles  ? StepOutcome::bad_angles
                   : !force ? StepOutcome::bad_force
                            : StepOutcome::buffered;
    last_time_s_ = measurement.time_s;
    ++(angles && force ? record_.used : record_.rejected);
    if (force) {
        record_.note_swept(measurement.force_g);
        saturation_.add(measurement.force_g);
    }
    primed_ = true;  // no gap to look for
    return step;
}

StepResult Identification::Impl::accept(const Reading& reading) noexcept {
    if (primed_) {
        to_level(reading);
        last_time_s_ = reading.time_s;
        return through_filter(reading);
    }
    if (buffer_.empty()) stretch_begin_s_ = reading.time_s;
    last_time_s_ = reading.time_s;
    buffer_.push(reading);
    if (buffer_.full() && !takes_longer()) return replay();
    StepResult step;
    step.outcome = !reading.angles_good  ? StepOutcome::bad_angles
                   : !reading.force_good ? StepOutcome::bad_force
                                         : StepOutcome::buffered;
    return step;
}

/// Beside a multiple of half the sample rate short windows know no level: those at the beginning
/// of a dwell would show a change that is none.
bool Identification::Impl::takes_longer() noexcept {
    if (random_ || buffer_.waits_for() > VibrationLevel::kFirstWindow_s) return false;
    const double hz = record_.info.frequency_hz;
    const double shortest_s = VibrationLevel::shortest_window_s(hz > 0 ? hz : settings.frequency_hz,
                                                                buffer_.period(period_s_));
    // Beyond the longest window the dwell is refused.
    if (!(shortest_s > VibrationLevel::kFirstWindow_s) || shortest_s > settings.level_window_s)
        return false;
    buffer_.wait_for(shortest_s);
    return true;
}

/// The level of the buffered readings first, then the filter over all of them.
StepResult Identification::Impl::replay() noexcept {
    period_s_ = buffer_.period(period_s_);
    if (!(period_s_ > 0)) {  // a single reading, before any other: no level to be had from it
        record_.rejected += static_cast<std::uint32_t>(buffer_.readings().size());
        buffer_.clear();
        primed_ = false;
        StepResult nothing;
        nothing.outcome = StepOutcome::bad_force;
        return nothing;
    }
    level_.begin(period_s_);
    tensor_.clear();
    vibration_ = {};
    Eigen::Vector3d angles = Eigen::Vector3d::Zero();
    const bool vertical_known = buffer_.median_angles(angles);
    const Eigen::Matrix3d level = kinematics_.pose(angles).level;
    double previous = buffer_.readings().front().time_s - period_s_;
    std::size_t good = 0;
    for (const Reading& reading : buffer_.readings()) {
        const double slots = std::min(
            {std::round((reading.time_s - previous) / period_s_), 1.0 / period_s_, kMostMissing});
        for (double k = 1; k < slots; ++k) {
            level_.add_first_missing();
            tensor_.add_missing();
        }
        record_.note_interval((reading.time_s - previous) / period_s_);
        previous = reading.time_s;
        if (reading.force_good && vertical_known) {
            const Eigen::Vector3d force = level.transpose() * reading.force;
            level_.add_first(force[1]);
            tensor_.add(force);
            if (random_) record_.random_level.add(force[1]);
            ++good;
        } else {
            level_.add_first_missing();
            tensor_.add_missing();
        }
    }
    // With fewer than half of the readings the fit that fills the gaps stands on nothing.
    level_.prime();
    refresh_vibration();
    primed_ = 2 * good >= buffer_.readings().size();
    StepResult step;
    if (primed_) {
        // A few samples tell no level that could be compared with another.
        if (buffer_.full()) record_.note_level(record_.kappa_of(level_.kappa()));
        if (!walked_) let_biases_walk();
        for (const Reading& reading : buffer_.readings()) step = through_filter(reading);
    } else {
        step.outcome = StepOutcome::bad_force;
        record_.rejected += static_cast<std::uint32_t>(buffer_.readings().size());
    }
    buffer_.clear();
    return step;
}

/// From the beginning of the dwell kept before to that of this one; the two-step route, which is
/// the paper's, has constant biases.
void Identification::Impl::let_biases_walk() noexcept {
    walk_begin_s_ = record_.info.begin_s + buffer_.readings().front().time_s;
    walked_ = 0.0;
    if (apart_) {
        // Its drift may be any; nothing of it is kept.
        active_->filter.begin_dwell_after_walk(settings.prior_bias * settings.prior_bias);
        return;
    }
    if (!walked_from_ || settings.method != Method::joint ||
        settings.drift.model == uncertainty::BiasModel::constant)
        return;
    double elapsed_s = walk_begin_s_ - walked_from_->first;
    if (!(elapsed_s > 0)) elapsed_s = walked_from_->second + kAssumedPause_s;
    const double walk = settings.drift.walk_deg_h_rt_h;
    walked_ = walk * walk * elapsed_s / 3600.0;
    active_->filter.begin_dwell_after_walk(*walked_);
}

void Identification::Impl::to_level(const Reading& reading) noexcept {
    const double slots =
        std::min(std::round((reading.time_s - last_time_s_) / period_s_), kMostMissing);
    record_.note_interval((reading.time_s - last_time_s_) / period_s_);
    for (double k = 1; k < slots; ++k) {
        level_.add_missing();
        tensor_.add_missing();
    }
    // The filter's angles, not the encoders': a spike must not tilt the vertical.
    if (reading.force_good) {
        const Eigen::Vector3d force = active_->filter.level().transpose() * reading.force;
        level_.add(force[1]);
        tensor_.add(force);
        if (random_) record_.random_level.add(force[1]);
        harmonics_.add(reading.time_s - dwell_begin_s_, force[1]);
    } else {
        level_.add_missing();
        tensor_.add_missing();
    }
    refresh_vibration();
    record_.note_level(record_.kappa_of(level_.kappa()));
}

/// The shape follows the level; the two-step route has none.
void Identification::Impl::refresh_vibration() noexcept {
    if (random_) {
        // Of the level over seconds the samples know less than the profile does.
        vibration_ = {1 + record_.info.random.mean_square_g2, kVertical};
        return;
    }
    const double kappa = record_.kappa_of(level_.kappa());
    if (vibration_.kappa == kappa) return;
    vibration_.kappa = kappa;
    if (settings.second_moment == SecondMoment::vertical || settings.method != Method::joint ||
        !(vibration_.kappa > 1.0) || !tensor_.due())
        return;
    static_cast<void>(tensor_.shape(settings.accelerometer_g, vibration_.gamma));
}

StepResult Identification::Impl::through_filter(const Reading& reading) noexcept {
    StepResult step;
    if (reading.force_good && settings.method == Method::two_step)
        paper_.add(reading.time_s, reading.force.squaredNorm());
    if (!reading.angles_good) {
        step.outcome = StepOutcome::bad_angles;
    } else {
        const VibrationMoment vibration = settings.method == Method::joint
                                              ? vibration_
                                              : VibrationMoment{paper_.kappa(), kVertical};
        step = active_->filter.step(reading.time_s, reading.angles, vibration);
        innovation_arcsec_ = step.innovation_arcsec;
        if (step.outcome == StepOutcome::used && vibration.kappa > 1.0)
            sync_.add(reading.time_s - dwell_begin_s_, step.innovation_arcsec);
        if (step.outcome == StepOutcome::initialised ||
            step.outcome == StepOutcome::reinitialised) {
            active_->batch.start(reading.time_s, reading.angles);
        } else {
            active_->batch.step(reading.time_s, reading.angles, vibration,
                                step.outcome == StepOutcome::used);
        }
    }
    record_.count(step);
    if (step.outcome == StepOutcome::used && !reading.force_good)
        step.outcome = StepOutcome::bad_force;
    return step;
}

void Identification::Impl::note_shape(double weight) noexcept {
    LevelTensor whole = kVertical;
    if (settings.second_moment == SecondMoment::measured && weight > 0)
        static_cast<void>(tensor_.shape(settings.accelerometer_g, whole));
    record_.shape_weight += weight;
    for (std::size_t k = 0; k < whole.size(); ++k) record_.shape_sum[k] += weight * whole[k];
}

void Identification::Impl::end_stretch() noexcept {
    if (!primed_ && !buffer_.empty()) replay();
    if (primed_) {
        const auto weight = static_cast<double>(level_.count());
        const VibrationLevel::Whole whole = level_.whole();
        record_.level_samples += weight;
        const double kappa = record_.kappa_of(whole.kappa);
        record_.kappa_sum += weight * kappa;
        record_.mean_force_sum += weight * whole.mean_force_g;
        note_shape(weight * (kappa - 1.0));
        if (!random_ && level_.frequency_hz() > 0) {
            record_.frequency_samples += weight;
            record_.frequency_sum += weight * level_.frequency_hz();
        }
        record_.period_s = period_s_;
        record_.span_s = std::max(record_.span_s, last_time_s_ - stretch_begin_s_ + period_s_);
    }
    primed_ = false;
}

/// The two-step route's own level is what its coefficients have; the measured one tells whether it
/// is right. Its noise and the accelerometers' errors stay far below the limit.
void Identification::Impl::take_paper_level(DwellSummary& s) const noexcept {
    const bool off = std::abs(paper_.kappa() - s.kappa) > kPaperTolerance * s.kappa;
    if (off && !swept_ && (!s.flagged || s.followed)) {
        s.flagged = true;
        s.followed = false;
        s.reason =
            "kappa by eq. 13 is more than 1 % off the measured one: the two-step route needs the "
            "exact vibration.frequency_hz, whole blocks of samples and no harmonic";
    }
    s.kappa = paper_.kappa();
    s.amplitude_g = paper_.amplitude_g();
}

DwellSummary Identification::Impl::end_dwell(bool cut_short) noexcept {
    if (!in_dwell_) return {};
    record_.cut_short = cut_short;
    if (active_ != nullptr && !swept_) end_stretch();
    primed_ = false;
    record_.saturated_axis = saturation_.axis();
    DwellVerdict verdict = judge(record_, settings);
    last_random_.reset();
    if (active_ == nullptr) {
        verdict.rejected = verdict.summary.flagged = true;
        verdict.summary.reason = "the two-step route takes two runs only: dwell rejected";
    } else {
        if (settings.method == Method::two_step) take_paper_level(verdict.summary);
        DwellRow row;
        const bool known = !swept_ && row_of(verdict.summary, row);
        const bool kept = known && !verdict.rejected && rows.size() < rows.capacity();
        if (kept) keep_row(row);
        if (random_ && apart_)
            last_random_ = {record_, {}, known ? std::optional(row) : std::nullopt, kept};
        active_->batch.end_dwell(!verdict.rejected && !apart_, walked_.value_or(0.0));
        if (!verdict.rejected && !apart_ && walked_)
            walked_from_.emplace(walk_begin_s_, last_time_s_ - dwell_begin_s_);
        if (verdict.rejected || apart_) active_->filter.restore(active_->saved);
        if (!verdict.rejected) {
            if (!apart_) active_->kappa.add(verdict.summary.kappa);
            nis_sum += record_.nis_sum;
            nis_count += record_.nis_count;
            if (active_ == &filters[0] && settings.method == Method::two_step &&
                paper_starts_.size() < paper_starts_.capacity()) {
                paper_starts_.push_back(
                    {record_.info.position, paper_.amplitude_g(), record_.info.table_g});
            }
        }
    }
    verdict.summary.noise = noise;
    verdict.summary.left_out = verdict.rejected;
    if (last_random_) last_random_->summary = verdict.summary;
    samples += verdict.summary.samples;
    used += verdict.summary.used;
    rejected += verdict.summary.rejected;
    ++dwells_ended;
    if (dwells.size() < dwells.capacity()) {
        dwells.push_back(verdict.summary);
        // What was cut off at the end of its range has another mean.
        means.push_back(record_.saturated_axis >= 0 ? DwellMeans() : record_.means);
    } else {
        ++dwells_not_kept;
    }
    in_dwell_ = false;
    buffer_.clear();
    record_ = {};
    solve(solution);
    return verdict.summary;
}

void Identification::Impl::solved(Estimate& out) const noexcept {
    tell(solution.value, sigma_of(solution), out);
}

void Identification::Impl::estimate(Estimate& out) const noexcept {
    ParameterArray value{}, sigma{};
    if (settings.method == Method::joint || !two_runs()) {
        const UdFilter& state = (active_ != nullptr ? active_ : &filters[0])->filter.state();
        std::copy_n(state.constants(), kParameters, value.begin());
        state.sigma(sigma);
    } else {
        value = solution.value;
        sigma = sigma_of(solution);
    }
    tell(value, sigma, out);
}

void Identification::Impl::tell(const ParameterArray& value, const ParameterArray& sigma,
                                Estimate& out) const noexcept {
    for (std::size_t i = 0; i < kParameters; ++i) {
        out.value[i] = value[internal_of(i)];
        out.sigma[i] = sigma[internal_of(i)];
        out.observable[i] = solution.found.observable[internal_of(i)];
    }
    const bool paper = settings.method == Method::two_step && in_dwell_;
    out.kappa = paper ? paper_.kappa() : level_.kappa();
    out.amplitude_g = paper ? paper_.amplitude_g() : level_.amplitude_g();
    out.frequency_hz = level_.frequency_hz();
    out.samples = samples + record_.samples;
    out.used = used + record_.used;
    out.rejected = rejected + record_.rejected;
    const double count = static_cast<double>(nis_count + record_.nis_count);
    out.nis_per_dof = count > 0 ? (nis_sum + record_.nis_sum) / (3.0 * count) : 0.0;
    out.innovation_arcsec = innovation_arcsec_;
    out.dwells = dwells_ended;
}

Identification::Identification(const Settings& settings, std::size_t max_dwells)
    : impl_(std::make_unique<Impl>(settings, max_dwells)) {}
void Identification::reserve(std::size_t max_dwells) {
    impl_->reserve(max_dwells);
    bring_in(impl_->dwells, max_dwells);
    bring_in(impl_->means, max_dwells);
    if (impl_->settings.method == Method::joint) bring_in(impl_->rows, max_dwells);
}
Identification::~Identification() = default;
Identification::Identification(Identification&&) noexcept = default;
Identification& Identification::operator=(Identification&&) noexcept = default;

void Identification::begin_dwell(const DwellInfo& dwell) noexcept { impl_->begin_dwell(dwell); }
StepResult Identification::add(const Measurement& measurement) noexcept {
    return impl_->add(measurement);
}
DwellSummary Identification::end_dwell(bool cut_short) noexcept {
    return impl_->end_dwell(cut_short);
}
DwellSummary Identification::played(const PlayedRandom& played) noexcept {
    return impl_->played(played);
}
void Identification::estimate(Estimate& out) const noexcept { impl_->estimate(out); }
void Identification::set_noise(const NoiseLevels& levels) noexcept {
    impl_->noise = levels;
    for (RunFilter& run : impl_->filters) {
        run.filter.set_noise(FilterNoise::of(levels));
        run.batch.set_noise(FilterNoise::of(levels));
    }
}
const NoiseLevels& Identification::noise() const noexcept { return impl_->noise; }
void Identification::solved(Estimate& out) const noexcept { impl_->solved(out); }

std::vector<double> Identification::covariance() const {
    return in_rows(impl_->solution.covariance);
}

std::vector<double> Identification::covariance_now() const {
    if (impl_->settings.method != Method::joint) return covariance();
    Covariance covariance;
    impl_->filters[0].filter.state().covariance(covariance.data());
    return in_rows(covariance);
}

}  // namespace vibrig::estimator
