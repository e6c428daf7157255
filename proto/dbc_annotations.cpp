// The statements that refer to messages read before them.
#include "proto/dbc_keywords.hpp"
#include "proto/dbc_parser.hpp"

namespace vibrig::proto {

namespace {

constexpr std::string_view kCycleTime = "GenMsgCycleTime";

}  // namespace

DbcParser::Reference DbcParser::message_reference() {
    const Token token = scanner_.peek();
    const std::uint64_t id = whole_number(0xffffffffU, "a message id");
    if (skipped_ids_.contains(id)) return {};
    const auto found = index_by_id_.find(id);
    if (found == index_by_id_.end()) scanner_.fail(token, "the id of a message declared above");
    return {&dbc_.messages[found->second], &places_[found->second]};
}

Signal& DbcParser::signal_reference(const Reference& reference) {
    const Token token = word("a signal name");
    const auto found = reference.places->signal_index.find(token.text);
    if (found == reference.places->signal_index.end()) {
        scanner_.fail(token, "a signal of message '" + reference.message->name + "'");
    }
    return reference.message->signals[found->second];
}

void DbcParser::value_type() {
    const Reference reference = message_reference();
    if (reference.message == nullptr) return skip_statement();
    Signal& signal = signal_reference(reference);
    if (scanner_.peek().is_mark(':')) scanner_.next();
    const Token token = scanner_.peek();
    const std::uint64_t type =
        whole_number(3, "value type 0 or 3 (integer), 1 (32-bit float) or 2 (64-bit float)");
    if (type == 1) signal.type = ValueType::float32;
    if (type == 2) signal.type = ValueType::float64;
    const unsigned length = type == 1 ? 32 : 64;
    if ((type == 1 || type == 2) && signal.length != length) {
        scanner_.fail_at(token.at, "found a floating type for signal '" + signal.name + "' of " +
                                       std::to_string(signal.length) + " bits, expected " +
                                       std::to_string(length) + " bits");
    }
    mark(';');
}

DbcParser::ValueNames DbcParser::value_list() {
    ValueNames names;
    while (!scanner_.peek().is_mark(';')) {
        const Token token = scanner_.peek();
        const std::int64_t value = raw_value();
        const std::string name = string_value(string("the value's name as a string"));
        const auto [entry, is_new] = names.emplace(value, name);
        if (!is_new && entry->second != name) {
            scanner_.fail(token, "a value that has no other name ('" + entry->second + "')");
        }
    }
    mark(';');
    return names;
}

void DbcParser::value_table() {
    const Token name = word("a value table's name");
    if (!value_tables_.emplace(name.text, value_list()).second) {
        scanner_.fail(name, "a name that no other value table has");
    }
}

void DbcParser::value_names() {
    // Instead of a message and a signal an environment variable may be named.
    if (scanner_.peek().kind == Token::Kind::word) return skip_statement();
    const Reference reference = message_reference();
    if (reference.message == nullptr) return skip_statement();
    Signal& signal = signal_reference(reference);
    if (scanner_.peek().kind != Token::Kind::word) {
        signal.value_names = value_list();
        return;
    }
    const Token table = scanner_.next();
    const auto found = value_tables_.find(table.text);
    if (found == value_tables_.end()) {
        scanner_.fail(table, "values with names, or a value table declared above");
    }
    signal.value_names = found->second;
    mark(';');
}

void DbcParser::multiplex_range() {
    const Reference reference = message_reference();
    if (reference.message == nullptr) return skip_statement();
    const Token name = scanner_.peek();
    Signal& signal = signal_reference(reference);
    if (!signal.multiplex_value) scanner_.fail(name, "a multiplexed signal (m<value>)");
    const Token by = word("the multiplexor's name");
    const Signal* multiplexor = reference.message->multiplexor();
    if (multiplexor == nullptr || multiplexor->name != by.text) {
        scanner_.fail(by, "the multiplexor of message '" + reference.message->name + "'");
    }
    const auto first =
        static_cast<std::uint32_t>(whole_number(0xffffffffU, "the first multiplex value"));
    mark('-');
    const Token end = scanner_.peek();
    const auto last =
        static_cast<std::uint32_t>(whole_number(0xffffffffU, "the last multiplex value"));
    if (last < first) scanner_.fail(end, "a last value not below the first");
    if (scanner_.peek().is_mark(',')) {
        scanner_.fail(scanner_.peek(), "';': several multiplex ranges are not supported");
    }
    mark(';');
    signal.multiplex_value = first;
    signal.multiplex_last = last;
}

void DbcParser::attribute() {
    const Token name = string("an attribute's name as a string");
    if (name.text != kCycleTime || !scanner_.peek().is_word("BO_")) return skip_statement();
    scanner_.next();
    const Reference reference = message_reference();
    if (reference.message == nullptr) return skip_statement();
    reference.message->cycle_time_ms = cycle_time();
    mark(';');
}

void DbcParser::attribute_default() {
    const Token name = string("an attribute's name as a string");
    if (name.text != kCycleTime) return skip_statement();
    default_cycle_time_ms_ = cycle_time();
    mark(';');
}

void DbcParser::skip_statement() {
    while (!scanner_.peek().is_mark(';')) {
        const Token& token = scanner_.peek();
        if (token.kind == Token::Kind::end || (token.first_on_line && is_keyword(token))) {
            scanner_.fail(token, "the ';' that ends the statement before");
        }
        scanner_.next();
    }
    mark(';');
}

}  // namespace vibrig::proto
