#include "daemon/serve/metrics.hpp"

#include <malloc.h>
#include <prometheus/text_serializer.h>

#include <cmath>
#include <sstream>
#include <utility>
#include <variant>

#include "daemon/status/values.hpp"
#include "estimator/filter/angles.hpp"

namespace vibrig::serve {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

constexpr std::array<const char*, 3> kAxisLabels{"x", "y", "z"};
constexpr std::array kChannelStates{ChannelState::good,    ChannelState::missing,
                                    ChannelState::flagged, ChannelState::out_of_range,
                                    ChannelState::silent,  ChannelState::never};

class Families {
  public:
    MetricFamily& family(std::string name, std::string help, MetricType type) {
        families_.push_back({std::move(name), std::move(help), type, {}});
        return families_.back();
    }
    void counter(std::string name, std::string help,
                 const std::vector<std::pair<Labels, std::uint64_t>>& values) {
        MetricFamily& to = family(std::move(name), std::move(help), MetricType::Counter);
        for (const auto& [labels, value] : values) {
            ClientMetric metric;
            metric.label = labels;
            metric.counter.value = static_cast<double>(value);
            to.metric.push_back(std::move(metric));
        }
    }
    void counter(std::string name, std::string help, std::uint64_t value) {
        counter(std::move(name), std::move(help), {{{}, value}});
    }
    void gauge(std::string name, std::string help,
               const std::vector<std::pair<Labels, double>>& values) {
        MetricFamily to{std::move(name), std::move(help), MetricType::Gauge, {}};
        for (const auto& [labels, value] : values) {
            if (!std::isfinite(value)) continue;
            ClientMetric metric;
            metric.label = labels;
            metric.gauge.value = value;
            to.metric.push_back(std::move(metric));
        }
        if (!to.metric.empty()) families_.push_back(std::move(to));
    }
    void gauge(std::string name, std::string help, double value) {
        gauge(std::move(name), std::move(help), {{Labels{}, value}});
    }
    /// One class more than bounds: it is open.
    template <typename Bounds, typename Counts>
    void histogram(std::string name, std::string help, const Bounds& bounds_ms,
                   const Counts& counts, double sum_ms) {
        MetricFamily& to = family(std::move(name), std::move(help), MetricType::Histogram);
        ClientMetric metric;
        std::uint64_t sum = 0;
        for (std::size_t i = 0; i < counts.size(); ++i) {
            sum += counts[i];
            const double bound =
                i < bounds_ms.size() ? bounds_ms[i] / 1e3 : std::numeric_limits<double>::infinity();
            metric.histogram.bucket.push_back({sum, bound});
        }
        metric.histogram.sample_count = sum;
        metric.histogram.sample_sum = sum_ms / 1e3;
        to.metric.push_back(std::move(metric));
    }
    [[nodiscard]] std::string text() const {
        std::ostringstream out;
        prometheus::TextSerializer().Serialize(out, families_);
        return out.str();
    }

  private:
    std::vector<MetricFamily> families_;
};

double yes(bool value) { return value ? 1 : 0; }

/// What has no labels is in the table; what is not known now is left out.
void add_values(Families& to, const StatusData& s) {
    for (const StatusValue& row : status_values()) {
        if (row.metric == nullptr) continue;
        const StatusScalar value = row.value(s);
        if (const auto* const flag = std::get_if<bool>(&value)) {
            to.gauge(row.metric, row.help, yes(*flag));
        } else if (const auto* const number = std::get_if<double>(&value)) {
            to.gauge(row.metric, row.help, *number * row.metric_factor);
        } else if (const auto* const count = std::get_if<std::uint64_t>(&value)) {
            if (row.counts) {
                to.counter(row.metric, row.help, *count);
            } else {
                to.gauge(row.metric, row.help, static_cast<double>(*count));
            }
        }
    }
}

void add_campaign(Families& to, const StatusData& s) {
    std::vector<std::pair<Labels, double>> states;
    for (int i = 0; i <= static_cast<int>(kLastCampaignState); ++i) {
        const auto state = static_cast<CampaignState>(i);
        states.push_back({{{"state", name_of(state)}}, yes(state == s.state)});
    }
    to.gauge("vibrig_build_info", "Version of the daemon, and which clock it follows.",
             {{{{"clock", s.clock}, {"version", s.version}}, 1}});
    to.gauge("vibrig_campaign_state", "1 for the state the campaign is in.", states);
    std::uint64_t flagged = 0;
    for (const auto& dwell : s.dwells) flagged += dwell.flagged ? 1 : 0;
    to.gauge("vibrig_campaign_dwells", "Ended dwells of this campaign.",
             {{{{"flagged", "false"}}, static_cast<double>(s.dwells.size() - flagged)},
              {{{"flagged", "true"}}, static_cast<double>(flagged)}});
}

void add_shaker(Families& to, const StatusData& s) {
    constexpr double kGravity = 9.80665;  // m/s^2
    const auto& n = s.shaker_counters;
    std::vector<std::pair<Labels, double>> witnesses;
    for (std::size_t w = 0; w < s.witness_g.size(); ++w) {
        if (s.witness_g[w] >= 0)
            witnesses.emplace_back(Labels{{"witness", w == 0 ? "platform" : "table"}},
                                   s.witness_g[w] * kGravity);
    }
    to.gauge("vibrig_witness_meters_per_second_squared",
             "Peak acceleration at the table as an accelerometer shows it.", witnesses);
    const auto& [platform, table] = s.rest.witnesses;
    std::vector<std::pair<Labels, double>> rest;
    for (const auto& [body, witness] : {std::pair{"platform", platform}, {"table", table}})
        if (const auto rms = witness.rms())
            rest.emplace_back(Labels{{"body", body}}, *rms * kGravity);
    to.gauge("vibrig_rest_rms_meters_per_second_squared", "Of the accelerometers, less the mean.",
             rest);
    to.counter("vibrig_shaker_requests_total", "Modbus requests by how they ended.",
               {{{{"result", "reply"}}, n.replies},
                {{{"result", "timeout"}}, n.timeouts},
                {{{"result", "exception"}}, n.exceptions},
                {{{"result", "wrong_reply"}}, n.wrong_replies},
                {{{"result", "lost"}}, n.lost}});
}

void add_real_time(Families& to, const RealTimeStatus& s) {
    std::vector<std::pair<Labels, double>> priorities;
    std::vector<std::pair<Labels, std::uint64_t>> misses, faults;
    for (const auto& thread : s.threads) {
        const Labels name{{"thread", thread.name}};
        priorities.emplace_back(name, thread.fifo_priority);
        misses.emplace_back(name, thread.deadline_misses);
        faults.push_back({{{"kind", "major"}, {"thread", thread.name}}, thread.major_faults});
        faults.push_back({{{"kind", "minor"}, {"thread", thread.name}}, thread.minor_faults});
    }
    to.gauge("vibrig_thread_fifo_priority", "SCHED_FIFO; 0: ordinary scheduling.", priorities);
    to.counter("vibrig_thread_deadline_misses_total",
               "What a thread did later than a sample period; real clock.", misses);
    to.counter("vibrig_thread_page_faults_total", "Since the thread was set up.", faults);
}

/// What grows here is kept; what is resident also has the places that something freed has left.
void add_memory(Families& to) {
    const auto heap = ::mallinfo2();
    to.gauge("vibrig_heap_used_bytes",
             "Memory that the program has asked for and not given back; 0: not known.",
             static_cast<double>(heap.uordblks + heap.hblkhd));
}

void add_acquisition(Families& to, const StatusData& s) {
    const auto& can = s.can_counters;
    const auto& a = s.assembler;
    using Controller = drivers::ControllerState;
    to.gauge("vibrig_can_controller_state",
             "1 for the state that the CAN controller reports, by error frames.",
             {{{{"state", "active"}}, yes(can.controller == Controller::active)},
              {{{"state", "warning"}}, yes(can.controller == Controller::warning)},
              {{{"state", "passive"}}, yes(can.controller == Controller::passive)},
              {{{"state", "bus_off"}}, yes(can.controller == Controller::bus_off)}});
    to.counter("vibrig_can_frames_dropped_total", "Frames that went no further, by reason.",
               {{{{"reason", "kernel"}}, can.kernel_dropped},
                {{{"reason", "error_frame"}}, can.error_frames},
                {{{"reason", "malformed"}}, can.malformed},
                {{{"reason", "unknown"}}, a.unknown},
                {{{"reason", "duplicate"}}, a.duplicate},
                {{{"reason", "late"}}, a.late},
                {{{"reason", "wrong_length"}}, a.wrong_length}});
    to.counter("vibrig_ring_pushed_samples_total", "Samples offered and taken by the ring.",
               {{{{"ring", "estimator"}}, s.estimator_ring.pushed}});
    to.counter("vibrig_ring_popped_samples_total", "Samples the consumer took.",
               {{{{"ring", "estimator"}}, s.estimator_ring.popped}});
    to.counter("vibrig_ring_dropped_samples_total", "Samples dropped because the ring was full.",
               {{{{"ring", "estimator"}}, s.estimator_ring.dropped}});
    to.histogram("vibrig_acquisition_latency_seconds",
                 "From the kernel's stamp on a frame until its sample is in the rings; real clock.",
                 rt::FrameLatency::kBounds_ms, s.latency.count, s.latency.sum_ms);
    add_real_time(to, s.real_time);
    std::vector<std::pair<Labels, double>> ages, good;
    for (std::size_t c = 0; c < drivers::kChannels; ++c) {
        if (s.channel(c) == ChannelState::unbound) continue;
        const Labels channel{{"channel", name_of(static_cast<drivers::Channel>(c))}};
        if (s.channel_age_s[c] >= 0) ages.emplace_back(channel, s.channel_age_s[c]);
        for (const ChannelState state : kChannelStates) {
            Labels labels = channel;
            labels.push_back({"quality", name_of(state)});
            good.emplace_back(labels, yes(s.channel(c) == state));
        }
    }
    to.gauge("vibrig_channel_age_seconds", "Since the newest good value.", ages);
    to.gauge("vibrig_channel_quality",
             "1 for the quality as it stands now; silent: nothing within the deadline.", good);
}

void add_estimate(Families& to, const StatusData& s) {
    const auto& e = s.estimate;
    std::vector<std::pair<Labels, double>> values, sigmas;
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        if (!e.observable[i]) continue;
        const Labels labels{{"name", estimator::parameter_names()[i]},
                            {"unit", estimator::parameter_unit(i)}};
        values.emplace_back(labels, e.value[i]);
        sigmas.emplace_back(labels, e.sigma[i]);
    }
    to.gauge("vibrig_coefficient", "Gyro error coefficients (IEEE Std 517), in the unit named.",
             values);
    to.gauge("vibrig_coefficient_sigma", "Their standard deviations, in the unit named.", sigmas);
    to.gauge("vibrig_filter_samples", "Samples of this campaign in the filter, by outcome.",
             {{{{"outcome", "used"}}, static_cast<double>(e.used)},
              {{{"outcome", "rejected"}}, static_cast<double>(e.rejected)}});
    std::vector<std::pair<Labels, double>> innovations, walks, sigma_walks, in_force;
    for (std::size_t j = 0; j < kAxisLabels.size(); ++j) {
        const Labels axis{{"axis", kAxisLabels[j]}};
        if (e.samples > 0)
            innovations.emplace_back(axis, e.innovation_arcsec[j] * estimator::kRadPerArcsec);
        const auto& gyro = s.noise.gyros[j];
        const auto& n = gyro.terms[static_cast<std::size_t>(estimator::allan::Term::N)];
        in_force.emplace_back(axis, gyro.in_force);
        if (s.noise.dwells == 0 || !n.detected) continue;
        walks.emplace_back(axis, n.value);
        sigma_walks.emplace_back(axis, n.sigma);
    }
    to.gauge("vibrig_innovation_radians", "Newest innovation of the filter.", innovations);
    to.gauge("vibrig_gyro_random_walk_degrees_per_root_hour",
             "Angle random walk N identified from the dwells.", walks);
    to.gauge("vibrig_gyro_random_walk_sigma_degrees_per_root_hour", "Its standard deviation.",
             sigma_walks);
    to.gauge("vibrig_gyro_random_walk_in_force_degrees_per_root_hour", "N of the filter.",
             in_force);
}

void add_server(Families& to, const ServerStatus& s) {
    std::vector<std::pair<Labels, double>> open, ends;
    std::vector<std::pair<Labels, std::uint64_t>> anew;
    for (const auto& door : s.doors) {
        const Labels name{{"door", door.name}};
        open.emplace_back(name, yes(door.open));
        anew.emplace_back(name, door.made_anew);
    }
    for (const auto& certificate : s.certificates)
        ends.push_back({{{"whose", certificate.whose}}, static_cast<double>(certificate.expires)});
    to.gauge("vibrig_door_open", "1 while the daemon answers there.", open);
    if (!anew.empty())
        to.counter("vibrig_door_made_anew_total",
                   "Times a socket's file had been removed or replaced.", anew);
    to.gauge("vibrig_certificate_expiry_timestamp_seconds",
             "When a certificate ends: the server's, the authority's, and of who is connected.",
             ends);
}

void add_interlock(Families& to, const StatusData& s) {
    std::vector<std::pair<Labels, double>> raised, present, limits, margins;
    for (const auto& row : s.interlock.rows) {
        const Labels name{{"name", row.name}, {"unit", row.unit}};
        if (row.has_limit) {
            present.emplace_back(name, row.present);
            limits.emplace_back(name, row.limit);
            margins.push_back({{{"name", row.name}}, row.margin()});
        }
        raised.push_back({{{"name", row.name}, {"reaction", row.reaction}}, yes(row.raised)});
    }
    to.gauge("vibrig_interlock_raised", "1 while the condition of this row is met.", raised);
    to.gauge("vibrig_interlock_value", "What is judged now, in the unit named.", present);
    to.gauge("vibrig_interlock_limit", "What it is judged by, in the unit named.", limits);
    to.gauge("vibrig_interlock_margin_ratio", "The part of the limit that is left.", margins);
    to.histogram("vibrig_interlock_reaction_seconds",
                 "From the frames that tripped to the stop confirmed by the controller.",
                 s.interlock.reaction_bounds_ms, s.interlock.reaction_counts,
                 s.interlock.reaction_sum_ms);
}

}  // namespace

std::string metrics_text(const StatusData& status, const Api::Traffic& traffic) {
    Families families;
    add_values(families, status);
    add_campaign(families, status);
    add_shaker(families, status);
    add_memory(families);
    add_acquisition(families, status);
    add_estimate(families, status);
    add_interlock(families, status);
    add_server(families, status.server);
    families.counter("vibrig_journal_entries_total", "Entries of the journal.",
                     {{{{"outcome", "written"}}, status.journal.written},
                      {{{"outcome", "dropped"}}, status.journal.dropped}});
    families.counter("vibrig_log_lines_total", "Lines of the log.",
                     {{{{"outcome", "written"}}, status.log.written},
                      {{{"outcome", "dropped"}}, status.log.dropped}});
    if (status.annunciator.command)
        families.counter("vibrig_annunciator_command_runs_total", "Runs of the page command.",
                         {{{{"outcome", "started"}}, status.annunciator.started},
                          {{{"outcome", "failed"}}, status.annunciator.failed},
                          {{{"outcome", "timed_out"}}, status.annunciator.timed_out},
                          {{{"outcome", "left_out"}}, status.annunciator.left_out}});
    if (!status.archive.folder.empty())
        families.counter("vibrig_archive_deliveries_total", "Attempts to deliver a campaign.",
                         {{{{"outcome", "delivered"}}, status.archive.delivered},
                          {{{"outcome", "failed"}}, status.archive.failures}});
    if (!status.mqtt.broker.empty())
        families.counter("vibrig_mqtt_messages_total", "Messages with data for the broker.",
                         {{{{"outcome", "sent"}}, status.mqtt.messages},
                          {{{"outcome", "left_out"}}, status.mqtt.left_out}});
    families.counter("vibrig_server_requests_total", "Requests to the status server.",
                     traffic.requests);
    families.counter("vibrig_server_commands_refused_total", "Commands that were not let through.",
                     traffic.refused);
    families.counter("vibrig_server_connections_refused_total", "Connections turned away.",
                     traffic.turned_away);
    families.counter("vibrig_server_streams_dropped_total", "Streams closed for being too slow.",
                     traffic.streams_dropped);
    families.gauge("vibrig_server_connections", "Open connections, this one included.",
                   static_cast<double>(traffic.connections));
    families.gauge("vibrig_server_streams", "Open WebSocket streams.",
                   static_cast<double>(traffic.streams));
    return families.text();
}

}  // namespace vibrig::serve
