#include "daemon/serve/status_message.hpp"

#include <google/protobuf/util/time_util.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "daemon/status/values.hpp"
#include "drivers/sample/channels.hpp"
#include "estimator/filter/angles.hpp"
#include "estimator/identification/result.hpp"
#include "proto/text.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {
namespace {

// The schema's enums are the daemon's with "unspecified" put in front.
template <typename Wire, typename Enum>
Wire wire_enum(Enum value) {
    const int number = static_cast<int>(value) + 1;
    return static_cast<Wire>(number);
}
static_assert(static_cast<int>(CampaignState::commissioning) + 1 == v1::Campaign::commissioning);
static_assert(static_cast<int>(drivers::LinkState::fault) + 1 == v1::Link::fault);
static_assert(static_cast<int>(drivers::PortState::fault) + 1 == v1::Link::fault);
static_assert(static_cast<int>(Severity::trip) + 1 == v1::Event::trip);

/// Sets an optional field only with a number that JSON can carry.
template <typename Message>
void set(Message& message, void (Message::*setter)(double), double value) {
    if (std::isfinite(value)) (message.*setter)(value);
}

double finite(double value) { return std::isfinite(value) ? value : 0.0; }

void set_time(google::protobuf::Timestamp& out, std::int64_t utc_ns) {
    out = google::protobuf::util::TimeUtil::NanosecondsToTimestamp(utc_ns);
}

void fill(v1::Frame& out, const FrameStatus& frame) {
    out.set_up(std::string(1, frame.up.sign < 0 ? '-' : '+') + "xyz"[frame.up.axis]);
    for (const int sign : frame.encoder_sign) out.add_encoder_sign(sign);
    for (const double zero : frame.encoder_zero_deg) out.add_encoder_zero_deg(zero);
    for (const double zero : frame.accelerometer_zero_g) out.add_accelerometer_zero_g(zero);
    for (const auto& row : frame.accelerometer_matrix)
        for (const double cell : row) out.add_accelerometer_matrix(cell);
}

void fill(v1::RealTime& out, const StatusData& status) {
    fill_values(out, "real_time.", status);
    for (const RealTimeStatus::Thread& thread : status.real_time.threads) {
        v1::RealTime::Thread& to = *out.add_threads();
        to.set_name(thread.name);
        to.set_fifo_priority(thread.fifo_priority);
        to.set_cpus(thread.cpus);
        to.set_major_page_faults(thread.major_faults);
        to.set_minor_page_faults(thread.minor_faults);
        to.set_deadline_misses(thread.deadline_misses);
        to.set_longest_ms(thread.longest_ms);
    }
    for (const std::string& what : status.real_time.missing)
        out.add_missing(proto::mend_utf8(what));
}

void fill(v1::Server& out, const ServerStatus& server, std::int64_t utc_ns) {
    for (const ServerStatus::Door& door : server.doors) {
        v1::Server::Door& to = *out.add_doors();
        to.set_name(door.name);
        to.set_address(proto::mend_utf8(door.address));
        to.set_open(door.open);
        to.set_note(proto::mend_utf8(door.note));
        to.set_made_anew(door.made_anew);
    }
    for (const CertificateStatus& certificate : server.certificates) {
        constexpr double kDay = 86'400;  // s
        v1::Server::Certificate& to = *out.add_certificates();
        to.set_whose(proto::mend_utf8(certificate.whose));
        set_time(*to.mutable_expires(), certificate.expires * drivers::kSecond);
        to.set_days_left((static_cast<double>(certificate.expires) - drivers::to_seconds(utc_ns)) /
                         kDay);
    }
}

void fill(v1::Shaker& out, const StatusData& status) {
    out.set_link(wire_enum<v1::Link::State>(status.shaker_link));
    fill_values(out, "shaker.", status);
}

void fill(v1::Interlock& out, const InterlockStatus& status) {
    out.set_tripped(status.tripped);
    for (const Latch& latch : status.latches) {
        v1::Interlock::Latch& to = *out.add_latches();
        to.set_name(proto::mend_utf8(latch.name));
        to.set_cause(proto::mend_utf8(latch.cause));
        to.set_armed_by(proto::mend_utf8(latch.armed_by));
        to.set_two_persons(latch.two_persons);
        to.set_first(proto::mend_utf8(latch.first));
        set_time(*to.mutable_utc(), latch.utc_ns);
    }
    for (const InterlockStatus::Row& row : status.rows) {
        v1::Interlock::Row& to = *out.add_rows();
        to.set_name(proto::mend_utf8(row.name));
        to.set_condition(row.condition);
        to.set_reaction(row.reaction);
        if (row.has_limit) set(to, &v1::Interlock::Row::set_limit, row.limit);
        set(to, &v1::Interlock::Row::set_present, row.present);
        set(to, &v1::Interlock::Row::set_margin, row.margin());
        to.set_unit(row.unit);
        to.set_dwell_s(row.dwell_s);
        to.set_latched(row.latched);
        to.set_raised(row.raised);
        if (row.raised) set(to, &v1::Interlock::Row::set_value, row.value);
    }
    for (const double bound : status.reaction_bounds_ms) out.add_reaction_bounds_ms(bound);
    for (const std::uint64_t count : status.reaction_counts) out.add_reaction_counts(count);
    out.set_reaction_largest_ms(status.reaction_largest_ms);
    out.set_reaction_sum_ms(status.reaction_sum_ms);
}

void fill(v1::Can& out, const StatusData& status) {
    out.set_link(wire_enum<v1::Link::State>(status.can));
    fill_values(out, "can.", status);
}

/// The schema has the states by their names.
v1::Channel::Quality wire_state(ChannelState state) {
    v1::Channel::Quality quality{};
    v1::Channel::Quality_Parse(name_of(state), &quality);
    return quality;
}

void fill(v1::Sample& out, const StatusData& status) {
    const drivers::Sample& sample = status.sample;
    fill_values(out, "sample.", status);
    for (std::size_t i = 0; i < drivers::kChannels; ++i) {
        v1::Channel& channel = *out.add_channels();
        const drivers::ChannelRow& row = drivers::kChannelTable[i];
        channel.set_name(row.name);
        channel.set_quality(wire_state(status.channel(i)));
        if (status.channel(i) == ChannelState::good) {
            set(channel, &v1::Channel::set_value, row.value(sample));
        }
        channel.set_unit(row.unit);
        if (status.channel_age_s[i] >= 0) {
            set(channel, &v1::Channel::set_age_s, status.channel_age_s[i]);
        }
    }
}

void fill_parameter(v1::Parameter& out, std::size_t index, double value, double sigma,
                    bool observable) {
    out.set_name(estimator::parameter_names()[index]);
    out.set_unit(estimator::parameter_unit(index));
    out.set_observable(observable);
    if (!observable) return;
    set(out, &v1::Parameter::set_value, value);
    set(out, &v1::Parameter::set_sigma, sigma);
}

void fill(v1::Estimate& out, const StatusData& status) {
    const estimator::Estimate& estimate = status.estimate;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        fill_parameter(*out.add_parameters(), i, estimate.value[i], estimate.sigma[i],
                       estimate.observable[i]);
    }
    fill_values(out, "estimate.", status);
    v1::Innovation& innovation = *out.mutable_innovation();
    if (estimate.samples == 0) return;
    set(innovation, &v1::Innovation::set_x_arcsec, estimate.innovation_arcsec[0]);
    set(innovation, &v1::Innovation::set_y_arcsec, estimate.innovation_arcsec[1]);
    set(innovation, &v1::Innovation::set_z_arcsec, estimate.innovation_arcsec[2]);
}

void fill(v1::Noise& out, const StatusData& status) {
    const NoiseStatus& noise = status.noise;
    fill_values(out, "noise.", status);
    namespace allan = estimator::allan;
    constexpr std::array<const char*, 3> kGyroNames{"x", "y", "z"};
    for (std::size_t j = 0; j < kGyroNames.size(); ++j) {
        const NoiseStatus::Gyro& gyro = noise.gyros[j];
        v1::GyroNoise& to = *out.add_gyros();
        to.set_gyro(kGyroNames[j]);
        set(to, &v1::GyroNoise::set_in_force_deg_per_rt_h, gyro.in_force);
        if (gyro.smallest_change > 0)
            set(to, &v1::GyroNoise::set_smallest_change, gyro.smallest_change);
        for (const auto& point : gyro.points) {
            v1::NoisePoint& at = *to.add_points();
            set(at, &v1::NoisePoint::set_tau_s, point.tau_s);
            set(at, &v1::NoisePoint::set_deviation_deg_h, point.deviation);
            set(at, &v1::NoisePoint::set_expected_deg_h, point.expected);
        }
        if (noise.dwells == 0) continue;
        v1::NoiseFit& fit = *to.mutable_fit();
        const std::array<v1::NoiseTerm*, allan::kTerms> terms{
            fit.mutable_q(), fit.mutable_n(), fit.mutable_b(), fit.mutable_k(), fit.mutable_r()};
        for (std::size_t t = 0; t < allan::kTerms; ++t) {
            v1::NoiseTerm& term = *terms[t];
            term.set_unit(allan::kTermUnits[t]);
            if (gyro.terms[t].detected) {
                set(term, &v1::NoiseTerm::set_value, gyro.terms[t].value);
                set(term, &v1::NoiseTerm::set_sigma, gyro.terms[t].sigma);
            }
            set(term, &v1::NoiseTerm::set_below, gyro.terms[t].below);
        }
    }
    for (const NoiseStatus::Alarm& alarm : noise.alarms) {
        v1::NoiseAlarm& to = *out.add_alarms();
        to.set_run(alarm.run);
        to.set_position(alarm.position);
        to.set_gyro(kGyroNames[std::min<std::size_t>(alarm.gyro, 2)]);
        set(to, &v1::NoiseAlarm::set_tau_s, alarm.tau_s);
        set(to, &v1::NoiseAlarm::set_ratio, alarm.ratio);
        set(to, &v1::NoiseAlarm::set_limit, alarm.limit);
        to.set_reading(alarm.reading);
    }
    if (noise.level.samples == 0) return;
    v1::LevelInnovation& level = *out.mutable_level();
    level.set_samples(noise.level.samples);
    set(level, &v1::LevelInnovation::set_mean_square, noise.level.mean_square);
    level.set_run(noise.level.run);
    level.set_position(noise.level.position);
    for (const double value : noise.level.innovation_deg_h)
        level.add_innovation_deg_h(finite(value));
    for (const double value : noise.level.sigma_deg_h) level.add_sigma_deg_h(finite(value));
}

void fill(v1::Dwell& out, const estimator::DwellSummary& dwell) {
    out.set_run(dwell.run);
    out.set_position(dwell.position);
    out.set_samples(dwell.samples);
    out.set_used(dwell.used);
    out.set_rejected(dwell.rejected);
    out.set_reinitialised(dwell.reinitialised);
    set(out, &v1::Dwell::set_kappa, dwell.kappa);
    set(out, &v1::Dwell::set_amplitude_g, dwell.amplitude_g);
    set(out, &v1::Dwell::set_frequency_hz, dwell.frequency_hz);
    set(out, &v1::Dwell::set_mean_force_g, dwell.mean_force_g);
    set(out, &v1::Dwell::set_nis_per_dof, dwell.nis_per_dof);
    out.set_flagged(dwell.flagged);
    if (dwell.reason != nullptr) out.set_reason(proto::mend_utf8(dwell.reason));
}

}  // namespace

namespace {

void set_field(google::protobuf::Message& out, const google::protobuf::FieldDescriptor& field,
               const StatusScalar& value) {
    using Field = google::protobuf::FieldDescriptor;
    const auto& to = *out.GetReflection();
    const auto count = [&] { return std::get<std::uint64_t>(value); };
    switch (field.cpp_type()) {
        case Field::CPPTYPE_BOOL:
            return to.SetBool(&out, &field, std::get<bool>(value));
        case Field::CPPTYPE_UINT64:
            return to.SetUInt64(&out, &field, count());
        case Field::CPPTYPE_UINT32:
            return to.SetUInt32(&out, &field, static_cast<std::uint32_t>(count()));
        case Field::CPPTYPE_INT32:
            return to.SetInt32(&out, &field, static_cast<std::int32_t>(count()));
        case Field::CPPTYPE_DOUBLE:
            return to.SetDouble(&out, &field, std::get<double>(value));
        default:
            return to.SetString(&out, &field, proto::mend_utf8(std::get<std::string>(value)));
    }
}

}  // namespace

void fill_values(google::protobuf::Message& out, std::string_view part, const StatusData& status) {
    for (const StatusValue& row : status_values()) {
        const std::string_view name = row.field;
        if (name.empty() || !name.starts_with(part) || name.find('.', part.size()) != name.npos)
            continue;
        const StatusScalar value = row.value(status);
        if (std::holds_alternative<std::monostate>(value)) continue;
        set_field(out, *out.GetDescriptor()->FindFieldByName(std::string(name.substr(part.size()))),
                  value);
    }
}

void fill(v1::Levelling& out, const LevellingStatus& levelling) {
    out.set_verdict(levelling.verdict);
    out.set_phase(levelling.phase);
    set(out, &v1::Levelling::set_time_s, levelling.time_s);
    for (const double tilt : levelling.tilt_arcmin) out.add_tilt_arcmin(finite(tilt));
    for (const double tilt : levelling.to_come_arcmin) out.add_to_come_arcmin(finite(tilt));
    for (const double drift : levelling.drift_deg_h) out.add_drift_deg_h(finite(drift));
    set(out, &v1::Levelling::set_tolerance_arcmin, levelling.tolerance_arcmin);
    set(out, &v1::Levelling::set_noise_arcmin, levelling.noise_arcmin);
    if (levelling.limit_arcmin > 0)
        set(out, &v1::Levelling::set_limit_arcmin, levelling.limit_arcmin);
    out.set_done(levelling.done);
    out.set_message(proto::mend_utf8(levelling.message));
}

void fill(v1::Zeros& out, const ZeroStatus& zeros) {
    out.set_running(zeros.running);
    out.set_known(zeros.known);
    set(out, &v1::Zeros::set_time_s, zeros.time_s);
    for (const double zero : zeros.zero_mg) out.add_zero_mg(finite(zero));
    for (const double sigma : zeros.sigma_mg) out.add_sigma_mg(finite(sigma));
    if (zeros.scale_z_sigma > 0) {
        set(out, &v1::Zeros::set_scale_z_ppm, 1e6 * zeros.scale_z);
        set(out, &v1::Zeros::set_scale_z_sigma_ppm, 1e6 * zeros.scale_z_sigma);
        for (std::size_t i = 0; i < 2; ++i) {
            out.add_misalignment_arcsec(finite(zeros.misalignment[i] / estimator::kRadPerArcsec));
            out.add_misalignment_sigma_arcsec(
                finite(zeros.misalignment_sigma[i] / estimator::kRadPerArcsec));
        }
    }
    out.set_repeated_at_end(zeros.repeated);
    for (const double change : zeros.repeated ? zeros.change_mg : std::array<double, 3>{})
        out.add_change_mg(finite(change));
    for (const double sigma : zeros.repeated ? zeros.change_sigma_mg : std::array<double, 3>{})
        out.add_change_sigma_mg(finite(sigma));
    out.set_mark(proto::mend_utf8(zeros.mark));
    out.set_message(proto::mend_utf8(zeros.message));
}

void fill(v1::Campaign& out, const StatusData& status) {
    out.set_state(wire_enum<v1::Campaign::State>(status.state));
    fill_values(out, "campaign.", status);
    v1::Angles& angles = *out.mutable_position_angles();
    if (status.position > 0) {
        set(angles, &v1::Angles::set_outer_deg, status.position_deg[0]);
        set(angles, &v1::Angles::set_inner_deg, status.position_deg[1]);
        set(angles, &v1::Angles::set_azimuth_deg, status.position_deg[2]);
    }
    for (const estimator::DwellSummary& dwell : status.dwells) fill(*out.add_dwells(), dwell);
    if (status.levelling.begun) fill(*out.mutable_level(), status.levelling);
    if (status.zeros.running || status.zeros.known || !status.zeros.message.empty())
        fill(*out.mutable_zeros(), status.zeros);
}

void fill(v1::Status& out, const StatusData& status) {
    set_time(*out.mutable_utc(), status.utc_ns);
    fill_values(out, "", status);
    fill(*out.mutable_campaign(), status);
    fill_checks(out, status);
    fill(*out.mutable_shaker(), status);
    fill(*out.mutable_can(), status);
    fill_values(*out.mutable_assembler(), "assembler.", status);
    fill_values(*out.mutable_estimator_ring(), "estimator_ring.", status);
    fill(*out.mutable_sample(), status);
    fill_values(*out.mutable_platform(), "platform.", status);
    fill(*out.mutable_estimate(), status);
    fill(*out.mutable_interlock(), status.interlock);
    fill_values(*out.mutable_journal(), "journal.", status);
    fill_values(*out.mutable_recorder(), "recorder.", status);
    fill(*out.mutable_noise(), status);
    if (status.verdict.dwells > 0 || status.verdict.complete) fill(*out.mutable_verdict(), status);
    fill_values(*out.mutable_mqtt(), "mqtt.", status);
    fill_values(*out.mutable_log(), "log.", status);
    fill(*out.mutable_server(), status.server, status.utc_ns);
    if (!status.guard.socket.empty()) fill_values(*out.mutable_guard(), "guard.", status);
    if (!status.archive.folder.empty()) fill_values(*out.mutable_archive(), "archive.", status);
    if (status.annunciator.horn || status.annunciator.command)
        fill_values(*out.mutable_annunciator(), "annunciator.", status);
    if (!status.vibration.kind.empty()) {
        v1::Vibration& vibration = *out.mutable_vibration();
        fill_values(vibration, "vibration.", status);
        for (const auto& [hz, density] : status.vibration.psd) {
            v1::Vibration::Point& point = *vibration.add_psd();
            point.set_hz(hz);
            point.set_g2_hz(density);
        }
    }
    fill(*out.mutable_frame(), status.frame);
    fill(*out.mutable_real_time(), status);
    v1::Latency& latency = *out.mutable_acquisition_latency();
    for (const double bound : rt::FrameLatency::kBounds_ms) latency.add_bounds_ms(bound);
    for (const std::uint64_t n : status.latency.count) latency.add_counts(n);
    latency.set_largest_ms(status.latency.largest_ms);
    latency.set_sum_ms(status.latency.sum_ms);
}

namespace {

void fill_weights(auto& out, const std::vector<std::pair<std::string, double>>& weights) {
    for (const auto& [name, weight] : weights)
        (*out.mutable_weights())[proto::mend_utf8(name)] = finite(weight);
}

void fill(v1::Assessed& out, const VerdictStatus& verdict) {
    out.set_dwells(verdict.dwells);
    out.set_verdict(verdict.word);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        v1::Assessed::Coefficient& to = *out.add_parameters();
        to.set_name(estimator::parameter_names()[i]);
        to.set_unit(estimator::parameter_unit(i));
        const auto& [value, u] = (*verdict.coefficients)[i];
        if (!std::isfinite(u)) continue;
        set(to, &v1::Assessed::Coefficient::set_value, value);
        set(to, &v1::Assessed::Coefficient::set_u, u);
    }
    if (!verdict.combinations) return;
    for (const auto& determined : *verdict.combinations) {
        v1::Assessed::Combination& to = *out.add_combinations();
        fill_weights(to, determined.weights);
        set(to, &v1::Assessed::Combination::set_value, determined.value);
        set(to, &v1::Assessed::Combination::set_u, determined.u);
    }
}

}  // namespace

void fill(v1::Parameters& out, const estimator::Result& result, const VerdictStatus& verdict) {
    if (verdict.coefficients) fill(*out.mutable_assessed(), verdict);
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        fill_parameter(*out.add_parameters(), i, result.value[i], result.sigma[i],
                       result.observable[i]);
        google::protobuf::ListValue& row = *out.add_covariance();
        for (std::size_t j = 0; j < estimator::kParameters; ++j) {
            const double value = result.covariance[i][j];
            google::protobuf::Value& cell = *row.add_values();
            if (result.observable[i] && result.observable[j] && std::isfinite(value)) {
                cell.set_number_value(value);
            } else {
                cell.set_null_value(google::protobuf::NULL_VALUE);
            }
        }
    }
    for (const estimator::RunAmplitude& run : result.amplitudes) {
        v1::RunAmplitude& amplitude = *out.add_amplitudes();
        amplitude.set_run(run.run);
        set(amplitude, &v1::RunAmplitude::set_amplitude_g, run.amplitude_g);
        set(amplitude, &v1::RunAmplitude::set_kappa, run.kappa);
        // At rest there is neither.
        if (run.sigma_g > 0) set(amplitude, &v1::RunAmplitude::set_sigma_g, run.sigma_g);
        if (run.frequency_hz > 0)
            set(amplitude, &v1::RunAmplitude::set_frequency_hz, run.frequency_hz);
    }
    for (const estimator::Combination& determined : result.combinations) {
        v1::Combination& combination = *out.add_combinations();
        fill_weights(combination, determined.weights);
        set(combination, &v1::Combination::set_value, determined.value);
        set(combination, &v1::Combination::set_sigma, determined.sigma);
    }
    // No sample in the filter: there is no mean.
    if (result.nis_per_dof > 0) set(out, &v1::Parameters::set_nis, result.nis_per_dof);
    out.set_samples(result.samples);
    out.set_rejected(result.rejected);
    for (const std::string& warning : result.warnings) out.add_warnings(proto::mend_utf8(warning));
}

void fill(v1::Plan& out, const PlanData& plan) {
    out.set_name(proto::mend_utf8(plan.name));
    out.set_adaptive(plan.adaptive);
    out.set_dwell_s(plan.dwell_s);
    out.set_frequency_hz(plan.frequency_hz);
    for (const PlanData::Stop& stop : plan.stops) {
        v1::Plan::Stop& to = *out.add_stops();
        to.set_run(stop.run);
        to.set_position(stop.position);
        v1::Angles& angles = *to.mutable_angles();
        set(angles, &v1::Angles::set_outer_deg, stop.position_deg[0]);
        set(angles, &v1::Angles::set_inner_deg, stop.position_deg[1]);
        set(angles, &v1::Angles::set_azimuth_deg, stop.position_deg[2]);
        to.set_table_g(stop.table_g);
    }
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        v1::Plan::Expected& to = *out.add_expected();
        to.set_name(estimator::parameter_names()[i]);
        to.set_unit(estimator::parameter_unit(i));
        if (plan.sigma[i] > 0) set(to, &v1::Plan::Expected::set_sigma, plan.sigma[i]);
        if (plan.target[i] > 0) set(to, &v1::Plan::Expected::set_target, plan.target[i]);
    }
}

void fill(v1::Event& out, const EventRecord& event) {
    out.set_id(event.id);
    set_time(*out.mutable_utc(), event.utc_ns);
    out.set_time_s(drivers::to_seconds(event.time));
    out.set_severity(wire_enum<v1::Event::Severity>(event.severity));
    out.set_source(proto::mend_utf8(event.source));
    out.set_text(proto::mend_utf8(event.text));
}

}  // namespace vibrig::serve
