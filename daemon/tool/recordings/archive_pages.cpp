#include "daemon/tool/recordings/archive_pages.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "daemon/archive/trend.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/plot/xml_text.hpp"
#include "daemon/results/text_line.hpp"
#include "daemon/serve/api.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "daemon/tool/recordings/trend_output.hpp"
#include "daemon/tool/simulated.hpp"
#include "estimator/identification/identification.hpp"
#include "proto/json_text.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kNewest = 100;             // campaigns on the front page
constexpr std::size_t kLargestFile = 512 << 20;  // larger ones are taken from the file system

constexpr const char* kStyle = R"(:root { color-scheme: light dark; }
body { font: 15px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 75rem; padding: 1rem; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: .25rem .75rem .25rem 0; border-bottom: 1px solid #8884; vertical-align: top; }
td.number, th.number { text-align: right; }
.scroll { overflow-x: auto; }
.charts { display: grid; grid-template-columns: repeat(auto-fill, minmax(22rem, 1fr)); gap: 1rem; }
img { width: 100%; height: auto; }
.not-valid, .outlier { font-weight: bold; color: light-dark(#a40000, #ff8f80); }
.note { opacity: .8; }
)";

/// As it stands in a link.
std::string in_link(const std::string& text) {
    std::string out;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (std::isalnum(byte) != 0 || c == '-' || c == '_' || c == '.' || c == '~') {
            out += c;
            continue;
        }
        out += printed("%%%02X", byte);
    }
    return out;
}

std::string text_of(const std::string& text) {
    return text.empty() ? "&ndash;" : plot::xml_text(text);
}

std::string page(const std::string& title, const std::string& body) {
    return "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
           "content=\"width=device-width, initial-scale=1\"><title>" +
           plot::xml_text(title) +
           "</title><link rel=\"stylesheet\" href=\"/archive.css\"><link rel=\"icon\" "
           "href=\"data:,\"></head><body><p><a href=\"/\">Archive</a></p><main><h1>" +
           plot::xml_text(title) + "</h1>" + body + "</main></body></html>\n";
}

std::string unit_link(const std::string& serial) {
    if (serial.empty()) return "&ndash;";
    return "<a href=\"/unit?serial=" + in_link(serial) + "\">" + plot::xml_text(serial) + "</a>";
}

std::string verdict_of(const std::string& verdict) {
    return verdict == "not valid" ? "<span class=\"not-valid\">not valid</span>" : text_of(verdict);
}

std::string campaign_rows(const std::vector<archive::Entry>& campaigns) {
    std::string rows;
    for (auto one = campaigns.rbegin(); one != campaigns.rend(); ++one)
        rows += "<tr><td>" + minute_text(one->started_utc_ns) +
                "</td><td><a href=\"/campaign?hash=" + one->hash + "\">" +
                plot::xml_text(one->name) + "</a>" + (one->simulated ? " (simulated)" : "") +
                "</td><td>" + unit_link(one->unit_serial) + "</td><td>" + text_of(one->rig) +
                "</td><td>" + text_of(one->state) + "</td><td>" + verdict_of(one->verdict) +
                "</td></tr>";
    return "<div class=\"scroll\"><table><thead><tr><th>started, UTC</th><th>campaign</th>"
           "<th>unit</th><th>rig</th><th>state</th><th>verdict</th></tr></thead><tbody>" +
           rows + "</tbody></table></div>";
}

std::string instability(const archive::Instability& of) {
    if (!of.tested) return "<td class=\"number\">&ndash;</td><td class=\"number\">&ndash;</td>";
    return "<td class=\"number\">" + printed("%.4f", of.value) + "</td><td class=\"number\">" +
           printed("%.2g", of.p) + "</td>";
}

std::vector<archive::Entry> of_unit(archive::Index& index, const std::string& serial) {
    archive::Filter filter;
    filter.serial = serial;
    return index.results(filter);
}

/// Of those on real rigs; where there are none, of the simulated ones, which say so.
archive::Trend unit_trend(std::vector<archive::Entry> campaigns) {
    const bool simulated = std::ranges::all_of(campaigns, &archive::Entry::simulated);
    return archive::trend_of(std::move(campaigns), archive::kShutdownAfterH, simulated);
}

serve::Document chart(const archive::Trend& trend, std::string_view name) {
    for (const auto& of : trend.coefficients)
        if (estimator::parameter_names()[of.position] == name)
            return {200, "image/svg+xml", trend_chart(trend, of)};
    return {404, "", "no such coefficient"};
}

}  // namespace

std::string ArchivePages::front(archive::Index& index) const {
    std::string units;
    for (const auto& unit : index.units())
        units += "<tr><td>" + unit_link(unit.serial) + "</td><td>" + text_of(unit.type) +
                 "</td><td class=\"number\">" + std::to_string(unit.campaigns) + "</td><td>" +
                 minute_text(unit.last_utc_ns) + "</td><td>" + verdict_of(unit.verdict) +
                 "</td></tr>";
    archive::Filter filter;
    filter.newest = kNewest;
    return page(
        "Archive of campaigns",
        "<h2>Units</h2><p class=\"note\">Those of the newest " +
            std::to_string(archive::Index::kOfNewest) +
            " campaigns; any other is at /unit?serial=NUMBER.</p><div class=\"scroll\"><table "
            "id=\"units\"><thead><tr><th>serial "
            "number</th><th>type</th><th class=\"number\">campaigns</th><th>newest, UTC</th>"
            "<th>its verdict</th></tr></thead><tbody>" +
            units + "</tbody></table></div><h2>Newest campaigns</h2>" +
            campaign_rows(index.campaigns(filter)));
}

std::string ArchivePages::unit(const std::vector<archive::Entry>& campaigns) const {
    const std::string& serial = campaigns.front().unit_serial;
    const auto trend = unit_trend(campaigns);
    const std::string words = vibration_words(trend);
    std::string rows, charts, outliers;
    for (const auto& of : trend.coefficients) {
        const std::string name = estimator::parameter_names()[of.position];
        const auto& newest = of.points.back();
        rows += "<tr><th>" + name + "</th><td class=\"number\">" + printed("%.5f", of.mean) +
                "</td><td class=\"number\">" + printed("%.5f", of.mean_low) + " .. " +
                printed("%.5f", of.mean_high) + "</td>" + instability(of.operating) +
                instability(of.shutdown) + "<td class=\"number\">" +
                printed("%.5f", newest.of.value) + " &plusmn; " +
                printed("%.5f", newest.of.expanded) + "</td><td>" +
                estimator::parameter_unit(of.position) + "</td></tr>";
        charts += "<img loading=\"lazy\" alt=\"" + name +
                  " over the campaigns\" src=\"/chart?serial=" + in_link(serial) +
                  "&amp;coefficient=" + name + "\">";
        for (const auto& point : of.points)
            if (point.outlier)
                outliers += "<li class=\"outlier\">" + name + " of " +
                            plot::xml_text(trend.campaigns[point.campaign].key) + ": " +
                            printed("%.5f", point.of.value) + ", t = " + printed("%.1f", point.t) +
                            "</li>";
    }
    return page(
        "Unit " + serial,
        (trend.simulated ? "<p><b>" + std::string(kSimulatedRig) + "</b></p>" : "") +
            (outliers.empty() ? "" : "<h2>Outliers</h2><ul>" + outliers + "</ul>") +
            "<h2>Coefficients</h2><p class=\"note\">A pause of more than 4 h is a shutdown; "
            "p is of the F test without the instability." +
            (trend.elsewhere > 0
                 ? " " + std::to_string(trend.elsewhere) + " campaigns on simulated rigs left out."
                 : "") +
            (words.empty() ? "" : " <span id=\"vibration\">Q" + words.substr(1) + ".</span>") +
            "</p><div class=\"scroll\"><table "
            "id=\"trend\"><thead><tr><th></th><th class=\"number\">mean</th><th "
            "class=\"number\">95 %</th><th class=\"number\">operating instability</th><th "
            "class=\"number\">p</th><th class=\"number\">shutdown instability</th><th "
            "class=\"number\">p</th><th class=\"number\">newest &plusmn; U</th><th></th>"
            "</tr></thead><tbody>" +
            rows + "</tbody></table></div><h2>Campaigns</h2>" + campaign_rows(campaigns) +
            "<h2>Over the campaigns</h2><div class=\"charts\">" + charts + "</div>");
}

std::string ArchivePages::campaign(archive::Index& index, const archive::Entry& entry) const {
    std::string rows, files, around;
    for (std::size_t i = 0; i < entry.coefficients.size(); ++i)
        if (const auto& c = entry.coefficients[i])
            rows += std::string("<tr><th>") + estimator::parameter_names()[i] +
                    "</th><td class=\"number\">" + printed("%.6f", c->value) +
                    "</td><td class=\"number\">" + printed("%.6f", c->u) +
                    "</td><td class=\"number\">" + printed("%.6f", c->expanded) + "</td><td>" +
                    estimator::parameter_unit(i) +
                    (estimator::is_quadratic(i) ? " " + archive::vibration_text(c->at_hz) : "") +
                    "</td></tr>";
    auto all = index.files(entry.key);
    if (fs::exists(fs::path(place_.folder) / entry.key / "report.html"))
        all.push_back({"report.html", 0, ""});
    for (const auto& file : all)
        files += "<li><a href=\"/file?hash=" + entry.hash + "&amp;name=" + in_link(file.name) +
                 "\">" + plot::xml_text(file.name) + "</a>" +
                 (file.bytes > 0 ? " " + std::to_string(file.bytes) + " bytes" : "") + "</li>";
    for (const auto& of : entry.temperatures)
        around += "<li>" + plot::xml_text(of.sensor) + ": " + printed("%.2f", of.mean) +
                  " &deg;C, " + printed("%.2f", of.low) + " .. " + printed("%.2f", of.high) +
                  "</li>";
    for (const auto& of : entry.instruments)
        around += "<li>" +
                  plot::xml_text(of.name + " " + of.serial + " " + of.certificate + " " + of.due) +
                  "</li>";
    return page(entry.name + ", " + minute_text(entry.started_utc_ns),
                "<p>" + verdict_of(entry.verdict) + " " + plot::xml_text(entry.sentence) +
                    "</p><p>Unit " + unit_link(entry.unit_serial) + " " + text_of(entry.unit_type) +
                    ", rig " + text_of(entry.rig) + ", started by " + text_of(entry.started_by) +
                    ", " + text_of(entry.state) + (entry.simulated ? ", simulated" : "") +
                    "; vibrigd " + text_of(entry.version) + ", configuration " +
                    text_of(entry.configuration_hash) +
                    "</p><h2>Coefficients</h2><div class=\"scroll\"><table id=\"coefficients\">"
                    "<thead><tr><th></th><th class=\"number\">value</th><th class=\"number\">u</th>"
                    "<th class=\"number\">U</th><th></th></tr></thead><tbody>" +
                    rows + "</tbody></table></div><h2>Files</h2><ul id=\"files\">" + files +
                    "</ul><h2>Around it</h2><ul>" + around + "</ul>");
}

serve::Document ArchivePages::file(const archive::Entry& entry, std::string_view name) const {
    const fs::path folder = fs::path(place_.folder) / entry.key;
    for (const auto& there : fs::directory_iterator(folder)) {
        // Only what is in the folder, by its own name: a query is no path.
        const std::string own = there.path().filename().string();
        if (own != name || !there.is_regular_file()) continue;
        if (there.file_size() > kLargestFile)
            return {413, "", own + " is too large for a browser: it is in " + folder.string()};
        return {200,
                own.ends_with(".html") ? "text/html; charset=utf-8" : "application/octet-stream",
                proto::read_whole_file(there.path().string(), kLargestFile)};
    }
    return {404, "", "no such file of this campaign"};
}

serve::Document ArchivePages::answer(std::string_view path, std::string_view query) const {
    if (path == "/archive.css") return {200, "text/css; charset=utf-8", kStyle};
    archive::Index index(place_.index, archive::Database::Mode::read);
    if (path == "/") return {200, "text/html; charset=utf-8", front(index)};
    const bool of_campaign = path == "/campaign" || path == "/file";
    if (of_campaign) {
        const auto key = index.key_of(serve::query_value(query, "hash"));
        const auto entry = key ? index.campaign(*key) : std::nullopt;
        if (!entry) return {404, "", "no such campaign in the archive"};
        if (path == "/file") return file(*entry, serve::query_value(query, "name"));
        return {200, "text/html; charset=utf-8", campaign(index, *entry)};
    }
    if (path == "/unit" || path == "/chart" || path == "/api/v1/trend") {
        const std::string serial = serve::query_value(query, "serial");
        auto campaigns = serial.empty() ? std::vector<archive::Entry>{} : of_unit(index, serial);
        if (campaigns.empty()) return {404, "", "no such unit in the archive"};
        if (path == "/unit") return {200, "text/html; charset=utf-8", unit(campaigns)};
        const auto trend = unit_trend(std::move(campaigns));
        if (path == "/chart") return chart(trend, serve::query_value(query, "coefficient"));
        return {200, "application/json",
                proto::json_text(trend_json(serial, trend, archive::kShutdownAfterH))};
    }
    return {404, "", "no such page"};
}

}  // namespace vibrig::tool
