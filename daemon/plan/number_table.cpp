#include "daemon/plan/number_table.hpp"

#include <algorithm>
#include <cmath>

#include "daemon/plan/plan_file.hpp"
#include "proto/edits.hpp"
#include "proto/open_end.hpp"
#include "proto/text.hpp"

namespace vibrig::plan {

namespace {

constexpr std::size_t kLargestFile = 16U << 20U;

std::vector<std::string_view> split(std::string_view line) {
    std::vector<std::string_view> fields;
    for (;;) {
        const std::size_t end = std::min(line.find(','), line.size());
        fields.push_back(proto::trimmed(line.substr(0, end)));
        if (end == line.size()) return fields;
        line.remove_prefix(end + 1);
    }
}

std::vector<std::string_view> known_to(const TableForm& form) {
    std::vector<std::string_view> known = form.numbers;
    known.insert(known.end(), form.maybe_numbers.begin(), form.maybe_numbers.end());
    known.insert(known.end(), form.words.begin(), form.words.end());
    return known;
}

/// Those that are known as the form has them.
std::vector<std::string> names_of(const std::vector<std::string_view>& header,
                                  const TableForm& form, const std::string& place) {
    const std::vector<std::string_view> known = known_to(form);
    std::vector<std::string> names;
    for (const std::string_view name : header) {
        const auto found = std::ranges::find_if(
            known, [name](std::string_view one) { return proto::same_name(one, name); });
        names.emplace_back(found == known.end() ? name : *found);
        if (std::ranges::count(names, names.back()) > 1)
            refuse(place, "column " + proto::printable(names.back()) + " twice", "it once");
    }
    refuse_misspelt({names.begin(), names.end()}, known,
                    [&place](const std::string& name) { return place + ": column " + name; });
    return names;
}

/// Of the last line, which has no end. `read`: its last column has to be there.
std::string open_end(const std::vector<std::string_view>& fields, std::size_t columns, bool read,
                     const std::string& place) {
    const auto cut = proto::cut_fields(fields.size(), columns, fields.back(), read);
    if (!cut.empty()) throw PlanFileError(place + ": " + cut);
    return proto::tell_open_end(place, fields.back());
}

}  // namespace

void refuse_misspelt(const std::vector<std::string_view>& keys,
                     const std::vector<std::string_view>& known,
                     const std::function<std::string(const std::string&)>& place_of) {
    const auto among = [](const std::vector<std::string_view>& list, std::string_view name) {
        return std::ranges::find(list, name) != list.end();
    };
    for (const std::string_view key : keys) {
        if (among(known, key)) continue;
        for (const std::string_view name : known) {
            if (among(keys, name) || !proto::misspelt(key, name)) continue;
            std::string all;
            for (const std::string_view one : known)
                all += (all.empty() ? "" : ", ") + std::string(one);
            refuse(place_of(proto::printable(key)), "an unknown key",
                   "a known one, perhaps " + std::string(name) + "; known are " + all);
        }
    }
}

std::optional<std::size_t> NumberTable::find(std::string_view name) const {
    const auto at = std::find(names.begin(), names.end(), name);
    if (at == names.end()) return std::nullopt;
    return static_cast<std::size_t>(at - names.begin());
}

void refuse(const std::string& place, const std::string& found, const std::string& expected) {
    throw PlanFileError(place + ": found " + found + ", expected " + expected);
}

std::string content_of(const std::string& path) {
    try {
        return proto::read_whole_file(path, kLargestFile);
    } catch (const std::runtime_error& error) {
        throw PlanFileError(path + ": " + error.what());
    }
}

NumberTable read_table(const std::string& text, const std::string& path, const TableForm& form) {
    const auto among = [](const std::vector<std::string_view>& list, std::string_view name) {
        return std::find(list.begin(), list.end(), name) != list.end();
    };
    NumberTable table;
    std::string_view rest = proto::without_byte_order_mark(text);
    for (std::size_t number = 1; !rest.empty(); ++number) {
        const std::size_t end = std::min(rest.find('\n'), rest.size());
        const bool open = end == rest.size();
        const auto fields = split(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
        if (fields[0].starts_with('#') || (fields.size() == 1 && fields[0].empty())) continue;
        const std::string place = path + ":" + std::to_string(number);
        if (table.names.empty()) {
            table.names = names_of(fields, form, place);
            continue;
        }
        // Decimal commas, or a header of another file: numbers would be read from beside their
        // columns.
        if (fields.size() > table.names.size()) {
            refuse(place, std::to_string(fields.size()) + " fields",
                   std::to_string(table.names.size()) + " as in the header");
        }
        if (open)
            table.warning = open_end(fields, table.names.size(),
                                     among(form.numbers, table.names.back()), place);
        std::vector<double> row(table.names.size(), std::nan(""));
        std::vector<std::string> words(table.names.size());
        for (std::size_t c = 0; c < table.names.size(); ++c) {
            const std::string_view field = c < fields.size() ? fields[c] : "";
            const bool maybe = among(form.maybe_numbers, table.names[c]);
            if (among(form.words, table.names[c])) words[c] = field;
            if (!maybe && !among(form.numbers, table.names[c])) continue;
            if (maybe && field.empty()) continue;
            if (field.empty() || !proto::read_number(field, row[c]) || !std::isfinite(row[c])) {
                refuse(place + ": column " + table.names[c],
                       field.empty() ? "nothing" : "'" + proto::printable(field) + "'", "a number");
            }
        }
        table.rows.push_back(std::move(row));
        table.words.push_back(std::move(words));
        table.lines.push_back(number);
    }
    if (table.rows.empty()) refuse(path, "no row after a header", "rows of numbers");
    return table;
}

}  // namespace vibrig::plan
