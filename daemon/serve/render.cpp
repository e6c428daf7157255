#include "daemon/serve/render.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>

#include "daemon/serve/value_lines.hpp"
#include "proto/vibrig.pb.h"

namespace vibrig::serve {
namespace {

constexpr int kNarrowest = 20;  // columns
constexpr int kLabel = 11;      // columns of the labels at the left
constexpr int kCell = 26;       // columns of one coefficient
constexpr int kKinds = 10;      // coefficients of one gyro
constexpr int kGyros = 3;

std::string labelled(const char* label, const std::string& text) {
    return fmt::format("{:<{}}{}", label, kLabel, text);
}

std::string upper(std::string text) {
    for (char& c : text) {
        if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
    }
    return text;
}

std::string place(const v1::Campaign& campaign) {
    std::string text;
    if (campaign.run() > 0) text += fmt::format("run {}/{}", campaign.run(), campaign.runs());
    if (campaign.position() > 0) {
        if (!text.empty()) text += ", ";
        text += fmt::format("position {}/{}", campaign.position(), campaign.positions());
    }
    return text;
}

std::string angles(const v1::Angles& at) {
    if (!at.has_outer_deg() || !at.has_inner_deg() || !at.has_azimuth_deg()) return {};
    return fmt::format("({:g}, {:g}, {:g} deg)", at.outer_deg(), at.inner_deg(), at.azimuth_deg());
}

/// What the stage with the table at rest is at; empty: there is none.
std::string stage_line(const v1::Campaign& campaign) {
    if (campaign.state() == v1::Campaign::levelling && campaign.level().tilt_arcmin_size() == 2) {
        const v1::Levelling& level = campaign.level();
        return fmt::format("{}, {:.0f} s, {:+.2f}' {:+.2f}' of {:.2f}'", level.verdict(),
                           level.time_s(), level.tilt_arcmin(0), level.tilt_arcmin(1),
                           level.tolerance_arcmin());
    }
    if (campaign.state() == v1::Campaign::zeroing && campaign.zeros().sigma_mg_size() == 3) {
        const v1::Zeros& zeros = campaign.zeros();
        return fmt::format("azimuth slews, {:.0f} s, x {:+.3f} y {:+.3f} z {:+.3f} mg",
                           zeros.time_s(), zeros.zero_mg(0), zeros.zero_mg(1), zeros.zero_mg(2));
    }
    return {};
}

std::string progress_line(const v1::Campaign& campaign, int width) {
    const double part = std::clamp(campaign.has_progress() ? campaign.progress() : 0.0, 0.0, 1.0);
    std::string text = fmt::format(" {:5.1f} %", 100 * part);
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
    constexpr std::array<const char*, 5> kStates{"idle", "ramping", "running", "stopping", "FAULT"};
    if (!shaker.has_state()) return "no reading";
    const auto state = static_cast<std::size_t>(shaker.state());
    return state < kStates.size() ? kStates[state] : "unknown state";
}

std::string shaker_line(const v1::Status& status) {
    const v1::Shaker& shaker = status.shaker();
    std::string text = shaker_state(shaker);
    text += ", link " + v1::Link::State_Name(shaker.link());
    if (shaker.fault() != 0) text += fmt::format(", fault bits {:#06x}", shaker.fault());
    if (shaker.rest() == "stop not obeyed") {
        text += ", STOP NOT OBEYED, PRESS THE EMERGENCY STOP: " + shaker.not_at_rest();
    } else if (!shaker.rest().empty()) {
        text += ", " + shaker.rest() +
                (shaker.not_at_rest().empty() ? "" : ": " + shaker.not_at_rest());
    }
    return text;
}

std::string platform_head(const v1::Platform& platform) {
    if (platform.quality() == "silent") return "SILENT";
    return platform.has_ready() ? "" : "no status yet";
}

std::string rates_line(const v1::Status& status, const Rates& rates) {
    if (!rates.known) return "-";
    std::string text =
        fmt::format("{:.1f} samples/s, {:.1f} frames/s", rates.samples_per_s, rates.frames_per_s);
    if (status.clock() != "real") text += fmt::format(", rig time x {:.1f}", rates.speed);
    return text;
}

/// Empty: nothing was measured.
std::string latency_line(const v1::Latency& latency) {
    std::uint64_t batches = 0;
    for (const std::uint64_t n : latency.counts()) batches += n;
    if (batches == 0) return {};
    return fmt::format("frame to ring {:.3f} ms, worst {:.2f} ms",
                       latency.sum_ms() / static_cast<double>(batches), latency.largest_ms());
}

/// Empty: nothing is known of it.
std::string real_time_line(const v1::RealTime& real_time) {
    std::string text;
    std::uint64_t misses = 0, major = 0, minor = 0;
    for (const auto& thread : real_time.threads()) {
        if (!text.empty()) text += " and ";
        text += thread.fifo_priority() > 0 ? fmt::format("FIFO {}", thread.fifo_priority())
                                           : std::string("ordinary");
        misses += thread.deadline_misses();
        major += thread.major_page_faults();
        minor += thread.minor_page_faults();
    }
    if (text.empty()) return {};
    text += real_time.memory_locked() ? ", memory locked" : ", memory not locked";
    text += real_time.deadline_ms() > 0 ? fmt::format(", {} deadlines missed", misses)
                                        : std::string(", no deadlines");
    return text + fmt::format(", page faults {} major {} minor", major, minor);
}

std::string channels_line(const v1::Sample& sample) {
    std::string bad;
    for (const v1::Channel& channel : sample.channels()) {
        if (channel.quality() == v1::Channel::good || channel.quality() == v1::Channel::unbound) {
            continue;
        }
        if (!bad.empty()) bad += ", ";
        bad += channel.name() + ' ' + upper(v1::Channel::Quality_Name(channel.quality()));
        if (channel.has_age_s()) bad += fmt::format(" {:.1f} s", channel.age_s());
    }
    return bad.empty() ? "all good" : bad;
}

std::string noise_line(const v1::Noise& noise) {
    std::string text = "N";
    for (const v1::GyroNoise& gyro : noise.gyros()) {
        if (!gyro.has_fit()) return "-";
        const v1::NoiseTerm& n = gyro.fit().n();
        text +=
            n.has_value() ? fmt::format(" {:.2e}", n.value()) : fmt::format(" <{:.1e}", n.below());
    }
    return text + " deg/rt-h";
}

std::string guard_line(const v1::Guard& guard) {
    if (!guard.heard()) return "NOT HEARD, " + guard.note();
    if (!guard.text().empty()) return guard.cause() + ": " + guard.text();
    if (!guard.sees()) return "SEES NO ACCELEROMETER";
    if (!guard.reaches_shaker()) return "DOES NOT REACH THE SHAKER";
    return guard.note().empty() ? "watches" : "watches, " + guard.note();
}

std::string broker_line(const v1::Mqtt& mqtt) {
    return mqtt.broker() + (mqtt.connected() ? fmt::format(": {} messages, {} left out",
                                                           mqtt.messages(), mqtt.left_out())
                                             : ": DOWN, " + mqtt.note());
}

/// Empty: all is well, or nothing is archived.
std::string archive_head(const v1::Archive& archive) {
    if (!archive.good() && !archive.note().empty()) return "DOWN: " + archive.note();
    if (archive.refused() > 0)
        return fmt::format("{} REFUSED: {}", archive.refused(), archive.refused_note());
    return archive.delivering().empty() ? "" : "on its way: " + archive.delivering();
}

std::string cell(const v1::Parameter& parameter) {
    if (!parameter.has_value()) return fmt::format("{:<6}        -          ", parameter.name());
    const double value = parameter.value();
    const std::string text = std::abs(value) < 1000
                                 ? fmt::format("{:<6}{:9.4f}", parameter.name(), value)
                                 : fmt::format("{:<6}{:9.2e}", parameter.name(), value);
    if (!parameter.has_sigma()) return text;
    const double sigma = parameter.sigma();
    return text + (sigma == 0 || (sigma >= 0.001 && sigma < 100)
                       ? fmt::format(" +-{:<7.4f}", sigma)
                       : fmt::format(" +-{:<7.1e}", sigma));
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
    ValueLines values(status);
    Lines lines;
    const auto line = [&](const char* label, const std::string& head = {}) {
        const std::string text = values.take(label, head);
        if (!text.empty()) lines.push_back(labelled(label, text));
    };
    std::string head = upper(v1::Campaign::State_Name(campaign.state()));
    const std::string where = place(campaign);
    if (!where.empty()) head += "  " + where + ' ' + angles(campaign.position_angles());
    lines.push_back(head);
    if (!campaign.reason().empty()) lines.push_back("why: " + campaign.reason());
    line("stage", stage_line(campaign));
    lines.push_back(progress_line(campaign, room(status, width)));
    line("campaign");
    line("armed for");
    line("expires");
    for (const auto& latch : status.interlock().latches())
        line("latched", latch.name() + ": " + latch.cause() + ": vibrig ack " + latch.name());
    line("table");
    line("shaker", shaker_line(status));
    line("vibration");
    line("platform", platform_head(status.platform()));
    line("CAN", v1::Link::State_Name(status.can().link()));
    line("rates", rates_line(status, rates));
    line("samples");
    line("dropped");
    line("latency", latency_line(status.acquisition_latency()));
    line("real time", real_time_line(status.real_time()));
    line("channels", channels_line(status.sample()));
    line("clock");
    line("filter");
    line("noise", noise_line(status.noise()));
    line("verdict");
    if (status.has_guard()) line("guard", guard_line(status.guard()));
    if (const v1::Annunciator& horn = status.annunciator(); horn.horn())
        line("horn", horn.pattern() + (horn.confirms() ? "" : ", SILENT: " + horn.horn_note()));
    if (!status.mqtt().broker().empty()) line("broker", broker_line(status.mqtt()));
    line("archive", archive_head(status.archive()));
    const std::string daemon = values.take("daemon");
    for (const auto& [label, text] : values.left()) lines.push_back(labelled(label.c_str(), text));
    lines.push_back(labelled("daemon", daemon));
    for (std::string& one : lines) one = marked(status, one, width);
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
            line += fmt::format("{:<{}}", cell(*last), kCell);
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
    std::string text = fmt::format("{:10.1f} s  {:<9}", status.time_s(),
                                   v1::Campaign::State_Name(campaign.state()));
    const std::string where = place(campaign);
    if (!where.empty()) text += "  " + where;
    const std::string at = angles(campaign.position_angles());
    if (!at.empty()) text += ' ' + at;
    if (campaign.has_progress()) text += fmt::format("  {:.1f} %", 100 * campaign.progress());
    if (campaign.has_command_table_g())
        text += fmt::format("  {:.2f} g", campaign.command_table_g());
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
        fmt::format("{}.{:03}Z  {:<7}  {:<10}  {}", when, event.utc().nanos() / 1'000'000,
                    v1::Event::Severity_Name(event.severity()), event.source(), event.text()),
        2000);
}

std::string render_duration(double seconds) {
    if (!(seconds >= 0) || seconds > 1e9) return "?";
    const long long whole = std::llround(seconds);
    if (whole >= 3600) return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
    if (whole >= 60) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
    return fmt::format("{} s", whole);
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
