#include "daemon/record/campaign_file.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <fstream>
#include <initializer_list>
#include <new>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <sstream>
#include <string_view>
#include <type_traits>
#include <variant>

#include "daemon/record/campaign_checks.hpp"
#include "daemon/record/campaign_columns.hpp"
#include "daemon/record/campaign_writer.hpp"
#include "daemon/record/digest.hpp"
#include "daemon/record/hdf5.hpp"

namespace vibrig::record {

using hdf5::Array;
using hdf5::File;

namespace {

/// What a column holds; nothing: an older recording, which has no such column.
using Cells = std::variant<std::monostate, std::vector<double>, std::vector<std::int64_t>,
                           std::vector<std::string>>;

/// Columns of one table, as they are visited; as long as the shortest, since a reader may come
/// between two columns.
struct Columns {
    const File& file;
    std::string group;
    std::vector<Cells> cells = {};
    std::size_t rows = static_cast<std::size_t>(-1);

    void operator()(const char* name, const auto& field, const char*, const char*,
                    std::initializer_list<std::size_t> = {}) {
        const auto numbers = numbers_in(field);
        using Number = typename decltype(numbers)::value_type;
        if constexpr (std::same_as<Number, double>) {
            take(name, file.doubles(group + "/" + name), numbers.size());
        } else {
            const auto& found = take(name, file.integers(group + "/" + name), numbers.size());
            const auto end = std::ranges::find(found, hdf5::kUnwritten);
            const auto written = static_cast<std::size_t>(end - found.begin());
            rows = std::min(rows, written / numbers.size());
            check_numbers<Number>(file, group, name, std::span(found).first(written),
                                  numbers.size());
        }
    }
    void newer(const char* name, const auto&... column) {
        if (file.has(group + "/" + name)) {
            (*this)(name, column...);
        } else {
            cells.emplace_back();
        }
    }
    void by_channel(const char* name, const auto&...) {
        const std::string path = group + "/" + name;
        const auto places = file.places(path, channel_names());
        const auto found = file.integers(path);
        const std::size_t length = found.dimensions.at(0);
        std::vector<std::int64_t> all(length * drivers::kChannels,
                                      static_cast<std::int64_t>(drivers::Quality::unbound));
        for (std::size_t i = 0; i < found.values.size(); ++i)
            all[i / places.size() * drivers::kChannels + places[i % places.size()]] =
                found.values[i];
        rows = std::min(rows, length);
        cells.emplace_back(std::move(all));
    }
    void text(const char* name, const auto&...) {
        rows =
            std::min(rows, std::get<3>(cells.emplace_back(file.texts(group + "/" + name))).size());
    }

  private:
    template <typename T>
    const std::vector<T>& take(const char* name, Array<T> array, std::size_t width) {
        std::size_t found = 1;
        for (std::size_t i = 1; i < array.dimensions.size(); ++i) found *= array.dimensions[i];
        if (array.dimensions.empty() || found != width)
            throw hdf5::Error(fmt::format("{}: {}/{}: found {} numbers in a row, expected {}",
                                          file.path(), group, name, found, width));
        rows = std::min(rows, array.dimensions[0]);
        return std::get<std::vector<T>>(cells.emplace_back(std::move(array.values)));
    }
};

void set(auto& field, auto number) {
    field = static_cast<std::remove_reference_t<decltype(field)>>(number);
}
// Anything unknown is not good.
void set(drivers::Quality& quality, std::int64_t number) {
    using enum drivers::Quality;
    quality = number >= 0 && number <= 5 ? static_cast<drivers::Quality>(number) : flagged;
}
void set(estimator::PlayedRandom::Word& word, std::int64_t number) {
    using Word = estimator::PlayedRandom::Word;
    word = number == 0 || number == 1 ? static_cast<Word>(number) : Word::refused;
}
void set(std::string& field, const std::string& text) { field = shown(text); }
void set(Severity& severity, const std::string& word) {
    for (const Severity s : {Severity::warning, Severity::alarm, Severity::trip}) {
        if (word == name_of(s)) severity = s;
    }
}

/// A visitor: puts into its fields what stands in one row of the columns.
struct Take {
    const std::vector<Cells>& columns;
    std::size_t row, next = 0;

    void operator()(const char*, auto&& field, const char*, const char*,
                    std::initializer_list<std::size_t> = {}) {
        const Cells& cells = columns[next++];
        const auto from = [&](const auto* values) {
            if (values == nullptr) return;
            const auto numbers = numbers_in(field);
            for (std::size_t k = 0; k < numbers.size(); ++k)
                set(numbers[k], (*values)[row * numbers.size() + k]);
        };
        if constexpr (std::same_as<typename decltype(numbers_in(field))::value_type, double>) {
            from(std::get_if<std::vector<double>>(&cells));
        } else {
            from(std::get_if<std::vector<std::int64_t>>(&cells));
        }
    }
    void newer(const char* name, auto& field, const char* unit, const char* description) {
        (*this)(name, field, unit, description);
    }
    void by_channel(const auto&... column) { (*this)(column...); }
    void text(const char*, auto& field, const auto&...) {
        set(field, std::get<std::vector<std::string>>(columns[next++])[row]);
    }
};

/// All rows of a table; `like`: as they are before anything is read.
template <typename Row>
std::vector<Row> rows_of(const File& file, const std::string& group, const Row& like = {}) {
    Columns columns{file, group};
    columns_of(like, columns);
    std::vector<Row> rows(columns.rows, like);
    for (std::size_t i = 0; i < rows.size(); ++i) columns_of(rows[i], Take{columns.cells, i});
    return rows;
}

/// Recordings made before there were any have none.
void read_played(const File& file, Campaign& to) {
    if (!file.has("/played")) return;
    to.played = rows_of<Played>(file, "/played");
    for (const PsdLine& line : rows_of<PsdLine>(file, "/psd_lines")) {
        for (Played& played : to.played)
            if (played.from == line.from) played.psd.push_back({line.frequency_hz, line.psd_g2_hz});
    }
    place_played(to);
}

/// Recordings made before there were any have none.
void read_dwell_numbers(const File& file, Campaign& to) {
    if (!file.has("/dwells/rate")) return;
    const auto rows = rows_of<DwellNumbers>(file, "/dwells");
    for (std::size_t i = 0; i < std::min(rows.size(), to.dwells.size()); ++i)
        to.dwells[i].numbers = rows[i];
}

/// Recordings made before there were any have none.
void read_conditions(const File& file, Campaign& to) {
    if (!file.has("/conditions")) return;
    ConditionRow like;
    if (const std::string name = "/conditions/interlock_value"; file.has(name)) {
        const auto dimensions = file.dimensions(name);
        like.interlock_value.resize(dimensions.size() == 2 ? dimensions[1] : 1);
        like.interlock_raised.resize(like.interlock_value.size());
    }
    to.conditions = rows_of(file, "/conditions", like);
}

bool says_simulated(const std::string& result) {
    const auto root = nlohmann::json::parse(result, nullptr, false);
    const auto found = root.is_object() ? root.find("simulated") : root.end();
    return found != root.end() && *found == true;
}

/// What it says of unit and instruments nothing else in the recording knows, and no number shows.
void refuse_changed_configuration(const File& file, const std::string& configuration) {
    std::string expected;
    try {
        expected = file.text("/", kConfigurationDigest);
    } catch (const hdf5::Error&) {
        return;  // of a daemon that wrote none
    }
    if (const std::string found = sha256_of_text(configuration); found != expected)
        throw hdf5::Error(fmt::format(
            "{}: /configuration: found SHA-256 {}, expected {} of attribute {}: it is not what was "
            "recorded",
            file.path(), found, shown(expected), kConfigurationDigest));
}

void read_head(const File& file, Campaign& to) {
    std::string format;
    try {
        format = file.text("/", "format");
    } catch (const hdf5::Error&) {
    }
    if (format != "vibrig-campaign")
        throw hdf5::Error(to.path + ": attribute format: found " +
                          (format.empty() ? "nothing" : "\"" + format + "\"") +
                          ", expected \"vibrig-campaign\"");
    if (const auto version = file.number("/", "format_version"); version != kFormatVersion)
        throw hdf5::Error(fmt::format("{}: format_version: found {}, expected {}", to.path, version,
                                      kFormatVersion));
    Head& head = to.head;
    attributes_of(head, [&](const char* name, auto& field) {
        using Field = std::remove_reference_t<decltype(field)>;
        try {
            if constexpr (std::same_as<Field, std::string>) {
                field = shown(file.text("/", name));
            } else {
                field = checked_number<Field>(file, name);
            }
        } catch (const hdf5::Error&) {
            if (std::string_view(name) != "simulated") throw;
        }
    });
    if (head.part < 1)
        throw hdf5::Error(
            fmt::format("{}: attribute part: found {}, expected 1 or more", to.path, head.part));
    head.configuration = file.read_text("/configuration");
    refuse_changed_configuration(file, head.configuration);
    head.dbc = file.read_text("/dbc");
    head.plan = file.read_text("/plan");
    if (file.has("/interlocks")) head.interlocks = file.read_text("/interlocks");
    if (file.has("/proof")) head.proof = file.read_text("/proof");
    try {
        head.journal_head = file.text("/", "journal_head");
    } catch (const hdf5::Error&) {  // of a daemon that kept no journal, or of one that signed none
    }
    to.state = shown(file.text("/", "state"));
    if (to.state != "running") {
        to.reason = shown(file.text("/", "reason"));
        to.ended_utc_ns = checked_number<drivers::Time>(file, "ended_utc_ns");
        to.mark = shown(file.text("/", "mark"));
    }
    if (file.has("/result")) to.result_json = file.read_text("/result");
    // Recordings of vibrigd 0.1.0 have no attribute; and one that says no is not believed alone.
    head.simulated =
        head.simulated || of_simulated_rig(head.configuration) || says_simulated(to.result_json);
}

}  // namespace

bool of_simulated_rig(const std::string& configuration) {
    std::istringstream lines(configuration);
    for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string key, equals, value;
        if (!(words >> key >> equals >> value)) continue;
        if (key == "commission.simulated" && value == "true") return true;
        if (key == "clock.source" && value == "\"rig\"") return true;
    }
    return false;
}

void place_played(Campaign& campaign) {
    for (Order& order : campaign.orders) {
        if (order.cancel || order.played) continue;
        const auto found = std::ranges::find_if(campaign.played, [&order](const Played& one) {
            return one.from == order.from && one.run == order.run && one.position == order.position;
        });
        if (found == campaign.played.end()) continue;
        order.played = found->random;
        order.played->random.profile = order.random.profile;
        order.played->random.level_db = order.random.level_db;
        order.psd = found->psd;
    }
    std::uint32_t place = 0;
    for (Order& order : campaign.orders)
        if (order.played && order.played->word == estimator::PlayedRandom::Word::good)
            order.played->place = ++place;
}

bool is_hdf5(const std::string& path) {
    std::array<char, 8> head{};
    std::ifstream file(path, std::ios::binary);
    file.read(head.data(), head.size());
    constexpr std::array<char, 8> kSignature{'\x89', 'H', 'D', 'F', '\r', '\n', '\x1a', '\n'};
    return file.good() && head == kSignature;
}

namespace {

void refuse_orders(const File& file, const std::vector<Order>& orders) {
    for (std::size_t i = 0; i < orders.size(); ++i) {
        columns_of(orders[i], Finite{file, "/orders", i});
        if (const drivers::Time length = orders[i].to - orders[i].from; length > kLongestDwell)
            throw hdf5::Error(fmt::format(
                "{}: /orders/to_ns: row {}: found a dwell of {:.0f} s, expected at most {:.0f}",
                file.path(), i + 1, drivers::to_seconds(length),
                drivers::to_seconds(kLongestDwell)));
    }
}

/// Its head alone.
Campaign begin_part(const File& file) {
    Campaign campaign;
    campaign.path = file.path();
    campaign.folder = folder_of(campaign.path);
    read_head(file, campaign);
    return campaign;
}

}  // namespace

Campaign read_part(const std::string& path) try {
    const File file = File::open(path, File::Mode::read);
    Campaign campaign = begin_part(file);
    campaign.samples = rows_of<drivers::Sample>(file, "/samples");
    campaign.orders = rows_of<Order>(file, "/orders");
    refuse_orders(file, campaign.orders);
    read_played(file, campaign);
    Dwell dwell;
    dwell.covariance.resize(estimator::kParameters * estimator::kParameters);
    campaign.dwells = rows_of(file, "/dwells", dwell);
    read_dwell_numbers(file, campaign);
    // Recordings made before there were any have none.
    if (file.has("/sweeps")) campaign.swept = rows_of<SweptRow>(file, "/sweeps");
    campaign.estimates = rows_of<EstimateRow>(file, "/estimates");
    campaign.events = rows_of<EventRecord>(file, "/events");
    for (std::size_t i = 0; i < campaign.events.size(); ++i) campaign.events[i].id = i + 1;
    campaign.gaps = rows_of<Gap>(file, "/gaps");
    read_conditions(file, campaign);
    return campaign;
} catch (const std::bad_alloc&) {
    throw hdf5::Error(path + ": found more in it than there is memory for");
}

namespace {
bool finite(const std::array<double, 3>& values) {
    return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}
}  // namespace

bool angles_known(const drivers::Sample& sample) {
    return sample.angles_good() && finite(sample.angle);
}

bool force_known(const drivers::Sample& sample) {
    return sample.force_good() && finite(sample.force);
}

Campaign read_part_head(const std::string& path) {
    return begin_part(File::open(path, File::Mode::read));
}

Campaign read_part_around(const std::string& path) {
    const File file = File::open(path, File::Mode::read);
    Campaign campaign = begin_part(file);
    read_conditions(file, campaign);
    const auto dwells = file.dimensions("/dwells/time_ns");
    campaign.parts = {{path, campaign.state, 0, dwells.empty() ? 0 : dwells[0]}};
    return campaign;
}

Span part_span(const std::string& path) {
    const auto times = File::open(path, File::Mode::read).integers("/samples/time_ns").values;
    if (times.empty()) return {};
    return {times.front(), times.back(), times.size()};
}

std::string identification_sections(const std::string& configuration) {
    static const std::set<std::string> kSections{
        "site",        "vibration", "platform", "accelerometer", "noise",    "estimator",
        "uncertainty", "drift",     "unit",     "instrument",    "spectrum", "profile"};
    std::istringstream lines(configuration);
    std::string kept;
    for (std::string line; std::getline(lines, line);) {
        if (kSections.contains(line.substr(0, line.find_first_of(". =")))) kept += line + "\n";
    }
    return kept;
}

}  // namespace vibrig::record
