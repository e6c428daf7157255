#include "proto/dbc.hpp"

#include <algorithm>

#include "proto/dbc_parser.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

namespace {

// Ten times the largest vehicle databases; keeps every position in an int and every check quick.
constexpr std::size_t kMaximumFile = std::size_t{16} << 20;

std::string locate(const std::string& file, int line, int column, const std::string& what) {
    if (line < 1) return file + ": " + what;
    return file + ":" + std::to_string(line) + ":" + std::to_string(column) + ": " + what;
}

template <typename Items, typename Test>
auto find_pointer(const Items& items, Test test) noexcept -> decltype(items.data()) {
    const auto found = std::find_if(items.begin(), items.end(), test);
    return found == items.end() ? nullptr : &*found;
}

}  // namespace

DbcError::DbcError(const std::string& file, int line, int column, const std::string& what)
    : std::runtime_error(locate(file, line, column, what)), line_(line), column_(column) {}

const Signal* Message::find(std::string_view signal_name) const noexcept {
    return find_pointer(signals, [&](const Signal& s) { return s.name == signal_name; });
}

const Signal* Message::multiplexor() const noexcept {
    return find_pointer(signals, [](const Signal& s) { return s.is_multiplexor; });
}

const Message* Dbc::find(std::string_view message_name) const noexcept {
    return find_pointer(messages, [&](const Message& m) { return m.name == message_name; });
}

const Message* Dbc::find(std::uint32_t id, bool extended) const noexcept {
    return find_pointer(messages,
                        [&](const Message& m) { return m.id == id && m.extended == extended; });
}

Dbc parse_dbc(std::string_view text, const std::string& file_name) {
    if (text.size() > kMaximumFile) {
        throw DbcError(file_name, 0, 0,
                       "found " + std::to_string(text.size()) + " bytes, expected at most " +
                           std::to_string(kMaximumFile));
    }
    return DbcParser(text, file_name).run();
}

Dbc read_dbc(const std::string& path) {
    std::string text;
    try {
        text = read_whole_file(path, kMaximumFile);
    } catch (const std::runtime_error& error) {
        throw DbcError(path, 0, 0, error.what());
    }
    return parse_dbc(text, path);
}

}  // namespace vibrig::proto
