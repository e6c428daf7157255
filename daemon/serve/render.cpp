#include "daemon/serve/render.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <ctime>

#include "proto/vibrig.pb.h"

namespace vibrig::serve {
namespace {

constexpr int kNarrowest = 20;  // columns
constexpr int kLabel = 11;      // columns of the labels at the left
constexpr int kCell = 26;       // columns of one coefficient
constexpr int kKinds = 10;      // coefficients of one gyro
constexpr int kGyros = 3;

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
    char text[256];
    va_list arguments;
    va_start(arguments, pattern);
    const int length = std::vsnprintf(text, sizeof text, pattern, arguments);
    va_end(arguments);
    return {text,
            std::min<std::size_t>(static_cast<std::size_t>(std::max(length, 0)), sizeof text - 1)};
}

std::string labelled(const char* label, const std::string& text) {
    return format("%-*s", kLabel, label) + text;
}

std::string number(bool known, double value, const char* pattern, const char* unit) {
    if (!known) return std::string("- ") + unit;
    char text[64];
    // The patterns are this file's own.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
    std::snprintf(text, sizeof text, pattern, value);
#pragma GCC diagnostic pop
    return std::string(text) + ' ' + unit;
}

std::string upper(std::string text) {
    for (char& c : text) {
        if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
    }
    return text;
}

std::string place(const v1::Campaign& campaign) {
    std::string text;
    if (campaign.run() > 0) text += format("run %d/%d", campaign.run(), campaign.runs());
    if (campaign.position() > 0) {
        if (!text.empty()) text += ", ";
        text += format("position %d/%d", campaign.position(), campaign.positions());
    }
    return text;
}

std::string angles(const v1::Angles& at) {
    if (!at.has_outer_deg() || !at.has_inner_deg() || !at.has_azimuth_deg()) return {};
    return format("(%g, %g, %g deg)", at.outer_deg(), at.inner_deg(), at.azimuth_deg());
}

/// What the stage with the table at rest is at; empty: there is none.
std::string stage_line(const v1::Campaign& campaign) {
    if (campaign.state() == v1::Campaign::levelling && campaign.level().tilt_arcmin_size() == 2) {
        const v1::Levelling& level = campaign.level();
        return format("%s, %.0f s, %+.2f' %+.2f' of %.2f'", level.verdict().c_str(), level.time_s(),
                      level.tilt_arcmin(0), level.tilt_arcmin(1), level.tolerance_arcmin());
    }
    if (campaign.state() == v1::Campaign::zeroing && campaign.zeros().sigma_mg_size() == 3) {
        const v1::Zeros& zeros = campaign.zeros();
        return format("azimuth slews, %.0f s, x %+.3f y %+.3f z %+.3f mg", zeros.time_s(),
                      zeros.zero_mg(0), zeros.zero_mg(1), zeros.zero_mg(2));
    }
    return {};
}

std::string progress_line(const v1::Campaign& campaign, int width) {
    const double part = std::clamp(campaign.has_progress() ? campaign.progress() : 0.0, 0.0, 1.0);
    std::string text = format(" %5.1f %%", 100 * part);
    if (campaign.has_remaining_s() && campaign.remaining_s() > 0) {
        text += "  " + render_duration(campaign.remaining_s()) + " left";
    }
    const int room = width - static_cast<int>(text.size()) - 2;
    constexpr int kShortestBar = 5;
    constexpr int kLongestBar = 50;
    if (room < kShortestBar) return text;
    const int bar = std::min(room, kLongestBar);
    const int done = static_cast<int>(std::lround(part * bar));
    return '[' + std::string(static_cast<std::size_t>(done), '#') +
           std::string(static_cast<std::size_t>(bar - done), '.') + ']' + text;
}

const char* shaker_state(const v1::Shaker& shaker) {
    if (!shaker.has_state()) return "no reading";
    switch (shaker.state()) {
        case 0:
            return "idle";
        case 1:
            return "ramping";
        case 2:
            return "running";
        case 3:
            return "stopping";
        case 4:
            return "FAULT";
        default:
            return "unknown state";
    }
}

std::string shaker_line(const v1::Status& status) {
    const v1::Shaker& shaker = status.shaker();
    std::string text = shaker_state(shaker);
    text += ", link " + v1::Link::State_Name(shaker.link());
    if (shaker.fault() != 0) text += format(", fault bits 0x%04x", shaker.fault());
    if (shaker.emergency_stop_open()) text += ", EMERGENCY STOP OPEN";
    if (shaker.rest() == "stop not obeyed") {
        text += ", STOP NOT OBEYED, PRESS THE EMERGENCY STOP: " + shaker.not_at_rest();
    } else if (!shaker.rest().empty()) {
        text += ", " + shaker.rest() +
                (shaker.not_at_rest().empty() ? "" : ": " + shaker.not_at_rest());
    }
    return text;
}

std::string platform_line(const v1::Platform& platform) {
    if (platform.quality() == "silent") return "SILENT";
    if (!platform.has_ready()) return "no status yet";
    std::string text = platform.ready() ? "ready" : "NOT READY";
    if (!platform.loop_closed()) text += ", loop open";
    if (!platform.gyros_at_speed()) text += ", gyros not at speed";
    if (platform.fault()) text += ", FAULT";
    if (platform.has_temperature_c()) text += format(", %.2f degC", platform.temperature_c());
    if (platform.slewing())
        text += ", slewing";
    else if (platform.in_position())
        text += ", in position";
    return text;
}

std::string rates_line(const v1::Status& status, const Rates& rates) {
    if (!rates.known) return "-";
    std::string text =
        format("%.1f samples/s, %.1f frames/s", rates.samples_per_s, rates.frames_per_s);
    if (status.clock() != "real") text += format(", rig time x %.1f", rates.speed);
    return text;
}

unsigned long long count(std::uint64_t value) { return value; }

std::string losses_line(const v1::Status& status) {
    const v1::Assembler& assembler = status.assembler();
    return format("kernel %llu, ring %llu, gaps %llu, incomplete %llu, late %llu, duplicate %llu",
                  count(status.can().kernel_dropped()), count(status.estimator_ring().dropped()),
                  count(assembler.gaps()), count(assembler.incomplete()), count(assembler.late()),
                  count(assembler.duplicate()));
}

/// Empty: nothing was measured.
std::string latency_line(const v1::Latency& latency) {
    std::uint64_t batches = 0;
    for (const std::uint64_t n : latency.counts()) batches += n;
    if (batches == 0) return {};
    return format("frame to ring %.3f ms, worst %.2f ms",
                  latency.sum_ms() / static_cast<double>(batches), latency.largest_ms());
}

/// Empty: nothing is known of it.
std::string real_time_line(const v1::RealTime& real_time) {
    std::string text;
    std::uint64_t misses = 0, major = 0, minor = 0;
    for (const auto& thread : real_time.threads()) {
        if (!text.empty()) text += " and ";
        text += thread.fifo_priority() > 0 ? format("FIFO %d", thread.fifo_priority())
                                           : std::string("ordinary");
        misses += thread.deadline_misses();
        major += thread.major_page_faults();
        minor += thread.minor_page_faults();
    }
    if (text.empty()) return {};
    text += real_time.memory_locked() ? ", memory locked" : ", memory not locked";
    text += real_time.deadline_ms() > 0 ? format(", %llu deadlines missed", count(misses))
                                        : std::string(", no deadlines");
    return text + format(", page faults %llu major %llu minor", count(major), count(minor));
}

std::string channels_line(const v1::Sample& sample) {
    std::string bad;
    for (const v1::Channel& channel : sample.channels()) {
        if (channel.quality() == v1::Channel::good || channel.quality() == v1::Channel::unbound) {
            continue;
        }
        if (!bad.empty()) bad += ", ";
        bad += channel.name() + ' ' + upper(v1::Channel::Quality_Name(channel.quality()));
        if (channel.has_age_s()) bad += format(" %.1f s", channel.age_s());
    }
    return bad.empty() ? "all good" : bad;
}

std::string estimate_line(const v1::Estimate& estimate) {
    return format("%llu used, %llu rejected of %llu samples, NIS ", count(estimate.used()),
                  count(estimate.rejected()), count(estimate.samples())) +
           (estimate.has_nis_per_dof() ? format("%.3f", estimate.nis_per_dof()) : "-") +
           format(", %u dwells", estimate.dwells());
}

std::string noise_line(const v1::Noise& noise) {
    std::string text = "N";
    for (const v1::GyroNoise& gyro : noise.gyros()) {
        if (!gyro.has_fit()) return "-";
        const v1::NoiseTerm& n = gyro.fit().n();
        text += n.has_value() ? format(" %.2e", n.value()) : format(" <%.1e", n.below());
    }
    return text + format(" deg/rt-h in %u dwells, %llu alarms", noise.dwells(),
                         count(noise.alarms_total()));
}

std::string cell(const v1::Parameter& parameter) {
    if (!parameter.has_value()) return format("%-6s        -          ", parameter.name().c_str());
    const double value = parameter.value();
    std::string text =
        format(std::abs(value) < 1000 ? "%-6s%9.4f" : "%-6s%9.2e", parameter.name().c_str(), value);
    if (!parameter.has_sigma()) return text;
    const double sigma = parameter.sigma();
    return text +
           format(sigma == 0 || (sigma >= 0.001 && sigma < 100) ? " +-%-7.4f" : " +-%-7.1e", sigma);
}

/// At the end of every line about a rig that is a program.
constexpr const char* kSimulated = "  SIMULATED";
constexpr int kSimulatedColumns = 11;

int room(const v1::Status& status, int width) {
    return std::max(width, kNarrowest) - (status.simulated() ? kSimulatedColumns : 0);
}

std::string marked(const v1::Status& status, const std::string& line, int width) {
    return clipped(line, room(status, width)) + (status.simulated() ? kSimulated : "");
}

std::string padded(std::string text, std::size_t width) {
    if (text.size() < width) text.append(width - text.size(), ' ');
    return text;
}

}  // namespace

Rates rates_between(const v1::Status& before, const v1::Status& after, double wall_s) {
    Rates rates;
    const double elapsed = after.time_s() - before.time_s();
    const bool same_daemon = after.uptime_s() >= before.uptime_s() &&
                             after.can().received() >= before.can().received() &&
                             after.assembler().samples() >= before.assembler().samples();
    if (!same_daemon || !(elapsed > 0) || !(wall_s > 0)) return rates;
    rates.known = true;
    rates.samples_per_s =
        static_cast<double>(after.assembler().samples() - before.assembler().samples()) / elapsed;
    rates.frames_per_s =
        static_cast<double>(after.can().received() - before.can().received()) / elapsed;
    rates.speed = elapsed / wall_s;
    return rates;
}

Lines render_summary(const v1::Status& status, const Rates& rates, int width) {
    const v1::Campaign& campaign = status.campaign();
    const v1::Shaker& shaker = status.shaker();
    Lines lines;
    std::string head = upper(v1::Campaign::State_Name(campaign.state()));
    const std::string where = place(campaign);
    if (!where.empty()) head += "  " + where + ' ' + angles(campaign.position_angles());
    lines.push_back(head);
    if (!campaign.reason().empty()) lines.push_back("why: " + campaign.reason());
    if (const std::string stage = stage_line(campaign); !stage.empty())
        lines.push_back(labelled("stage", stage));
    lines.push_back(progress_line(campaign, room(status, width)));
    lines.push_back(labelled(
        "campaign",
        campaign.name() + (campaign.armed_by().empty() ? std::string(", not armed")
                                                       : ", armed by " + campaign.armed_by())));
    if (!campaign.armed_for().empty()) lines.push_back(labelled("armed for", campaign.armed_for()));
    if (campaign.has_arming_left_s())
        lines.push_back(
            labelled("expires", number(true, campaign.arming_left_s(), "in %.0f", "s")));
    for (const auto& latch : status.interlock().latches()) {
        lines.push_back(labelled(
            "latched", latch.name() + ": " + latch.cause() + ": vibrig ack " + latch.name()));
    }
    lines.push_back(labelled(
        "table", number(campaign.has_command_table_g(), campaign.command_table_g(), "%.4f", "g") +
                     " commanded, " +
                     number(shaker.has_measured_g(), shaker.measured_g(), "%.4f", "g") +
                     " measured, " +
                     number(shaker.has_frequency_hz(), shaker.frequency_hz(), "%.3f", "Hz")));
    lines.push_back(labelled("shaker", shaker_line(status)));
    const v1::Estimate& estimate = status.estimate();
    lines.push_back(
        labelled("vibration",
                 number(estimate.has_amplitude_g(), estimate.amplitude_g(), "%.4f", "g") +
                     " on the platform, " +
                     number(estimate.has_frequency_hz(), estimate.frequency_hz(), "%.3f", "Hz")));
    lines.push_back(labelled("platform", platform_line(status.platform())));
    lines.push_back(labelled(
        "can", v1::Link::State_Name(status.can().link()) +
                   format(", %llu frames, %llu error frames", count(status.can().received()),
                          count(status.can().error_frames()))));
    lines.push_back(labelled("rates", rates_line(status, rates)));
    lines.push_back(labelled("dropped", losses_line(status)));
    if (const std::string latency = latency_line(status.acquisition_latency()); !latency.empty())
        lines.push_back(labelled("latency", latency));
    if (const std::string line = real_time_line(status.real_time()); !line.empty())
        lines.push_back(labelled("real time", line));
    lines.push_back(labelled("channels", channels_line(status.sample())));
    if (!status.clock_misfit().empty())
        lines.push_back(labelled("clock", "MISFIT: " + status.clock_misfit()));
    lines.push_back(labelled("filter", estimate_line(estimate)));
    lines.push_back(labelled("noise", noise_line(status.noise())));
    if (status.has_verdict()) lines.push_back(labelled("verdict", status.verdict().sentence()));
    if (status.has_guard()) {
        const v1::Guard& guard = status.guard();
        lines.push_back(labelled("guard", !guard.heard() ? "NOT HEARD, " + guard.note()
                                          : !guard.text().empty()
                                              ? guard.cause() + ": " + guard.text()
                                              : std::string("watches")));
    }
    if (const v1::Annunciator& horn = status.annunciator(); horn.horn())
        lines.push_back(labelled(
            "horn", horn.pattern() + (horn.confirms() ? "" : ", SILENT: " + horn.horn_note())));
    if (const v1::Mqtt& mqtt = status.mqtt(); !mqtt.broker().empty())
        lines.push_back(labelled(
            "broker", mqtt.broker() + (mqtt.connected() ? ": " : ": DOWN, ") +
                          (mqtt.connected() ? format("%llu messages, %llu left out",
                                                     count(mqtt.messages()), count(mqtt.left_out()))
                                            : mqtt.note())));
    if (status.has_archive()) {
        const v1::Archive& archive = status.archive();
        lines.push_back(labelled(
            "archive",
            format("%llu waiting, %llu delivered", count(archive.waiting()),
                   count(archive.delivered())) +
                (!archive.good()                ? ", DOWN: " + archive.note()
                 : archive.delivering().empty() ? ""
                                                : ", on its way: " + archive.delivering())));
    }
    lines.push_back(labelled("daemon", "vibrigd " + status.version() + ", clock " + status.clock() +
                                           ", up " + render_duration(status.uptime_s())));
    for (std::string& line : lines) line = marked(status, line, width);
    return lines;
}

Lines render_coefficients(const v1::Status& status, int width) {
    const int room_for_them = room(status, width);
    const auto& parameters = status.estimate().parameters();
    const int columns = std::clamp(room_for_them / kCell, 1, kGyros);
    // Three columns are the three gyros with one kind in a row; fewer just list what there is.
    const int rows = columns == kGyros ? kKinds : (parameters.size() + columns - 1) / columns;
    Lines lines;
    for (int row = 0; row < rows; ++row) {
        std::string line;
        const v1::Parameter* last = nullptr;
        for (int column = 0; column < columns; ++column) {
            const int index = column * rows + row;
            if (index >= parameters.size()) continue;
            last = &parameters[index];
            line += padded(cell(*last), kCell);
        }
        if (last == nullptr) continue;
        if (columns == kGyros && room_for_them >= columns * kCell + 10) line += last->unit();
        line.erase(line.find_last_not_of(' ') + 1);
        lines.push_back(marked(status, line, width));
    }
    return lines;
}

Lines render_table(const v1::Status& status, const Rates& rates, int width) {
    Lines lines = render_summary(status, rates, width);
    const Lines coefficients = render_coefficients(status, width);
    lines.emplace_back();
    lines.insert(lines.end(), coefficients.begin(), coefficients.end());
    return lines;
}

std::string render_line(const v1::Status& status) {
    const v1::Campaign& campaign = status.campaign();
    std::string text = format("%10.1f s  %-9s", status.time_s(),
                              v1::Campaign::State_Name(campaign.state()).c_str());
    const std::string where = place(campaign);
    if (!where.empty()) text += "  " + where;
    const std::string at = angles(campaign.position_angles());
    if (!at.empty()) text += ' ' + at;
    if (campaign.has_progress()) text += format("  %.1f %%", 100 * campaign.progress());
    if (campaign.has_command_table_g()) text += format("  %.2f g", campaign.command_table_g());
    if (status.can().link() != v1::Link::running) {
        text += "  can " + v1::Link::State_Name(status.can().link());
    }
    if (status.shaker().link() != v1::Link::running) {
        text += "  shaker " + v1::Link::State_Name(status.shaker().link());
    }
    if (!campaign.reason().empty()) text += "  " + campaign.reason();
    if (const std::string stage = stage_line(campaign); !stage.empty()) text += "  " + stage;
    return marked(status, text, 500);
}

bool same_place(const v1::Status& a, const v1::Status& b) {
    const v1::Campaign& x = a.campaign();
    const v1::Campaign& y = b.campaign();
    return x.state() == y.state() && x.run() == y.run() && x.position() == y.position() &&
           x.reason() == y.reason() && a.can().link() == b.can().link() &&
           a.shaker().link() == b.shaker().link();
}

std::string render_event(const v1::Event& event) {
    const std::time_t seconds = static_cast<std::time_t>(event.utc().seconds());
    std::tm utc{};
    gmtime_r(&seconds, &utc);
    char when[64] = "?";
    std::strftime(when, sizeof when, "%Y-%m-%d %H:%M:%S", &utc);
    return clipped(
        format("%s.%03dZ  %-7s  %-10s  ", when, event.utc().nanos() / 1'000'000,
               v1::Event::Severity_Name(event.severity()).c_str(), event.source().c_str()) +
            event.text(),
        2000);
}

std::string render_duration(double seconds) {
    if (!(seconds >= 0) || seconds > 1e9) return "?";
    const long long whole = std::llround(seconds);
    if (whole >= 3600) return format("%lld h %02lld min", whole / 3600, whole / 60 % 60);
    if (whole >= 60) return format("%lld min %02lld s", whole / 60, whole % 60);
    return format("%lld s", whole);
}

std::string clipped(const std::string& text, int width) {
    std::string out;
    int columns = 0;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        // Bytes 10xxxxxx go on with the character before them.
        const bool begins = (byte & 0xC0) != 0x80;
        if (begins && ++columns > width) break;
        out.push_back(byte < 0x20 || byte == 0x7F ? '?' : c);
    }
    return out;
}

}  // namespace vibrig::serve
