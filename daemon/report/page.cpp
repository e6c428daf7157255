#include "daemon/report/page.hpp"

#include <spdlog/fmt/fmt.h>

#include <cctype>

#include "daemon/plot/xml_text.hpp"

namespace vibrig::report {

using tool::plot::xml_text;

namespace {

constexpr const char* kStyle = R"(
:root{color-scheme:light dark;--ink:#1b1b1b;--paper:#ffffff;--soft:#5a5f66;--rule:#d9d9d9;--band:#f4f5f7;--bad:#b3261e;--link:#0072b2}
@media (prefers-color-scheme:dark){:root{--ink:#e6e6e6;--paper:#16181c;--soft:#a4abb5;--rule:#3a3d44;--band:#1f2228;--bad:#ff8a80;--link:#56b4e9}}
*{box-sizing:border-box}
body{margin:0 auto;padding:2rem 1.5rem 4rem;max-width:62rem;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,sans-serif}
h1{font-size:1.7rem;line-height:1.2;margin:0 0 .3rem}
h2{font-size:1.2rem;margin:2.4rem 0 .6rem;padding-bottom:.25rem;border-bottom:1px solid var(--rule)}
p{margin:.5rem 0;max-width:48rem}
.sub,figcaption,.fine-print{color:var(--soft)}
nav{margin:1rem 0;display:flex;flex-wrap:wrap;gap:.2rem 1rem;font-size:.9rem}
a{color:var(--link);text-decoration:none}a:hover{text-decoration:underline}
.wide{overflow-x:auto;margin:.6rem 0}
table{border-collapse:collapse;font-variant-numeric:tabular-nums;font-size:.86rem}
th,td{padding:.22rem .45rem;text-align:right;border-bottom:1px solid var(--rule);white-space:nowrap}
th{font-weight:600;vertical-align:bottom;border-bottom:2px solid var(--rule)}
th:first-child,td:first-child{text-align:left;padding-left:.2rem}
table.words th,table.words td{text-align:left;white-space:normal;vertical-align:top}
table.words td:first-child{white-space:nowrap;color:var(--soft)}
table.budget th:last-child,table.budget td:last-child{text-align:left;white-space:normal}
table.matrix th{white-space:normal}
tr:nth-child(even) td{background:var(--band)}
.bad{color:var(--bad);font-weight:600}
figure{margin:1rem 0}figure svg{max-width:100%;height:auto;display:block}
figcaption{font-size:.86rem;max-width:48rem}
pre{font-size:.75rem;overflow-x:auto;background:var(--band);padding:.8rem;border-radius:4px}
summary{cursor:pointer;color:var(--link)}
.sign{display:grid;grid-template-columns:1fr 1fr;gap:3rem;margin-top:3.5rem}
.sign div{border-top:1px solid var(--ink);padding-top:.3rem;color:var(--soft);font-size:.86rem}
.mark{position:fixed;inset:0;z-index:9;pointer-events:none;display:flex;flex-direction:column;gap:6rem;align-items:center;justify-content:center;overflow:hidden}
.mark span{transform:rotate(-35deg);font:700 min(17vw,9rem)/1 system-ui,sans-serif;letter-spacing:.06em;color:var(--bad);opacity:.13}
@page{size:A4;margin:16mm 14mm 18mm;@bottom-right{content:"page " counter(page) " of " counter(pages);font:8pt sans-serif}}
@media print{:root{--ink:#000;--paper:#fff;--soft:#444;--rule:#bbb;--band:#f4f4f4;--bad:#900;--link:#000}
body{max-width:none;padding:0;font-size:10pt}nav,details{display:none}figure svg{max-width:82%}figure,tr{break-inside:avoid}tbody tr:nth-child(-n+3){break-before:avoid}tbody tr:nth-last-child(-n+3){break-before:avoid}h2{break-after:avoid}
table{font-size:7.6pt}th,td{padding:.12rem .4rem}.wide{overflow:visible}}
)";

std::string cell(const std::string& tag, const std::string& text) {
    const bool bad = text.starts_with('!');
    return "<" + tag + (bad ? " class=\"bad\">" : ">") + xml_text(bad ? text.substr(1) : text) +
           "</" + tag + ">";
}

}  // namespace

void Page::section(const std::string& id, const std::string& title) {
    body_ += "<h2 id=\"" + id + "\">" + xml_text(title) + "</h2>\n";
    contents_ += "<a href=\"#" + id + "\">" + xml_text(title) + "</a>\n";
}

void Page::paragraph(const std::string& text) { body_ += "<p>" + xml_text(text) + "</p>\n"; }

void Page::table(const Rows& rows, const std::string& kind) {
    body_ += "<div class=\"wide\"><table" + (kind.empty() ? "" : " class=\"" + kind + "\"") + ">\n";
    for (std::size_t i = 0; i < rows.size(); ++i) {
        body_ += i == 0 ? "<thead><tr>" : "<tr>";
        for (const auto& text : rows[i]) body_ += cell(i == 0 ? "th" : "td", text);
        body_ += i == 0 ? "</tr></thead><tbody>\n" : "</tr>\n";
    }
    body_ += "</tbody></table></div>\n";
}

void Page::figure(const std::string& svg, const std::string& caption) {
    body_ += "<figure>" + svg + "<figcaption>" + xml_text(caption) + "</figcaption></figure>\n";
}

void Page::details(const std::string& summary, const std::string& preformatted) {
    body_ += "<details><summary>" + xml_text(summary) + "</summary><pre>" + xml_text(preformatted) +
             "</pre></details>\n";
}

void Page::foot(const std::string& text) {
    // Whatever somebody wrote: neither the style sheet nor the page ends in it.
    std::string content;
    for (const char one : text) {
        const auto c = static_cast<unsigned char>(one);
        content +=
            std::isalnum(c) != 0 || c >= 0x80 ? std::string(1, one) : fmt::format("\\{:x} ", c);
    }
    foot_ = "@page{@bottom-left{content:\"" + content + "\";font:8pt sans-serif}}\n";
}

void Page::mark(const std::string& word) { mark_ += "<span>" + xml_text(word) + "</span>"; }

std::string Page::html(const std::string& title, const std::vector<std::string>& signatures) const {
    std::string signs;
    for (const auto& who : signatures) signs += "<div>" + xml_text(who) + "</div>";
    const std::size_t head = body_.find("<h2");
    return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
           "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n<title>" +
           xml_text(title) + "</title>\n<style>" + kStyle + foot_ + "</style></head><body>\n" +
           (mark_.empty() ? "" : "<div class=\"mark\" role=\"note\">" + mark_ + "</div>\n") +
           "<h1>" + xml_text(title) + "</h1>\n" + body_.substr(0, head) + "<nav>" + contents_ +
           "</nav>\n" + (head == std::string::npos ? "" : body_.substr(head)) +
           "<div class=\"sign\">" + signs + "</div>\n</body></html>\n";
}

}  // namespace vibrig::report
