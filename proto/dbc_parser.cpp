#include "proto/dbc_parser.hpp"

#include <limits>
#include <utility>

#include "proto/dbc_check.hpp"
#include "proto/dbc_keywords.hpp"
#include "proto/text.hpp"

namespace vibrig::proto {

namespace {

constexpr std::uint64_t kExtendedFlag = 0x80000000U;
constexpr std::uint64_t kMaximumWord = std::numeric_limits<std::uint32_t>::max();
// Bounds the pairwise overlap check. A 64-byte message multiplexed by a byte has room for fewer
// signals of practical width.
constexpr std::size_t kMaximumSignals = 4096;
constexpr std::string_view kIndependentSignals = "VECTOR__INDEPENDENT_SIG_MSG";

}  // namespace

DbcParser::DbcParser(std::string_view text, const std::string& file_name)
    : scanner_(text, file_name) {}

Dbc DbcParser::run() {
    if (scanner_.peek().kind == Token::Kind::end) {
        scanner_.fail(scanner_.peek(), "a DBC statement such as VERSION, BU_ or BO_");
    }
    while (scanner_.peek().kind != Token::Kind::end) statement();
    for (std::size_t i = 0; i < dbc_.messages.size(); ++i) {
        Message& message = dbc_.messages[i];
        check_message(message, places_[i].signals, scanner_);
        const std::uint32_t cycle = message.cycle_time_ms.value_or(default_cycle_time_ms_);
        message.cycle_time_ms = cycle > 0 ? std::optional(cycle) : std::nullopt;  // 0: not cyclic
    }
    return std::move(dbc_);
}

void DbcParser::statement() {
    const Token keyword = scanner_.next();
    if (keyword.is_word("VERSION")) {
        (void)string("the version as a string");
    } else if (keyword.is_word("NS_")) {
        new_symbols();
    } else if (keyword.is_word("BS_")) {
        bit_timing();
    } else if (keyword.is_word("BU_")) {
        nodes();
    } else if (keyword.is_word("BO_")) {
        message();
    } else if (keyword.is_word("SG_")) {
        scanner_.fail(keyword, "a message (BO_) before its signals");
    } else if (keyword.is_word("VAL_")) {
        value_names();
    } else if (keyword.is_word("VAL_TABLE_")) {
        value_table();
    } else if (keyword.is_word("SIG_VALTYPE_")) {
        value_type();
    } else if (keyword.is_word("SG_MUL_VAL_")) {
        multiplex_range();
    } else if (keyword.is_word("BA_")) {
        attribute();
    } else if (keyword.is_word("BA_DEF_DEF_")) {
        attribute_default();
    } else if (is_passed_over(keyword)) {
        skip_statement();
    } else {
        scanner_.fail(keyword, "a DBC statement such as BO_, SG_, CM_ or VAL_");
    }
}

void DbcParser::new_symbols() {
    mark(':');
    // The list repeats the keywords; it ends at the first that begins a line or cannot be listed.
    for (;;) {
        const Token& token = scanner_.peek();
        const bool ends = token.is_word("BS_") || token.is_word("BU_") || token.is_word("BO_") ||
                          (is_keyword(token) && token.at.column == 1);
        if (ends || token.kind == Token::Kind::end) return;
        (void)word("a symbol name");
    }
}

void DbcParser::bit_timing() {
    mark(':');
    while (scanner_.peek().kind == Token::Kind::number || scanner_.peek().is_mark(':') ||
           scanner_.peek().is_mark(',')) {
        scanner_.next();
    }
}

void DbcParser::nodes() {
    mark(':');
    while (scanner_.peek().kind == Token::Kind::word && !is_keyword(scanner_.peek())) {
        scanner_.next();
    }
}

void DbcParser::message() {
    const Token id_token = scanner_.peek();
    const std::uint64_t file_id = whole_number(kMaximumWord, "a message id");
    const Token name = word("a message name");
    if (name.text == kIndependentSignals) {
        skipped_ids_.insert(file_id);
        skip_independent_signals();
        return;
    }
    Message message;
    message.name = name.text;
    message.extended = (file_id & kExtendedFlag) != 0;
    const std::uint64_t id = file_id & ~kExtendedFlag;
    if (id > (message.extended ? 0x1fffffffU : 0x7ffU)) {
        scanner_.fail(id_token, message.extended
                                    ? "an extended id up to 0x1FFFFFFF (plus bit 31)"
                                    : "a standard id up to 2047, or bit 31 set for an extended id");
    }
    message.id = static_cast<std::uint32_t>(id);
    if (!index_by_id_.emplace(file_id, dbc_.messages.size()).second) {
        scanner_.fail(id_token, "an id that no other message has");
    }
    if (!message_names_.insert(name.text).second) {
        scanner_.fail(name, "a name that no other message has");
    }
    mark(':');
    message.size = static_cast<std::uint8_t>(whole_number(64, "a size of 0 to 64 bytes"));
    message.sender = word("the sending node").text;
    Places places;
    while (scanner_.peek().is_word("SG_")) signal(message, places);
    dbc_.messages.push_back(std::move(message));
    places_.push_back(std::move(places));
}

void DbcParser::skip_independent_signals() {
    for (;;) {
        const Token& token = scanner_.peek();
        if (token.kind == Token::Kind::end) return;
        if (token.first_on_line && is_keyword(token) && !token.is_word("SG_")) return;
        scanner_.next();
    }
}

void DbcParser::signal(Message& message, Places& places) {
    scanner_.next();
    const Token name = word("a signal name");
    if (!places.signal_index.emplace(name.text, message.signals.size()).second) {
        scanner_.fail(name, "a name that no other signal of message '" + message.name + "' has");
    }
    if (message.signals.size() >= kMaximumSignals) {
        scanner_.fail(name, "at most " + std::to_string(kMaximumSignals) + " signals in a message");
    }
    Signal signal;
    signal.name = name.text;
    multiplexing(message, signal);
    mark(':');
    bits(message, signal);
    mark('(');
    const Token scale = scanner_.peek();
    signal.scale = number("the scale");
    if (signal.scale == 0) scanner_.fail(scale, "a scale other than 0");
    mark(',');
    signal.offset = number("the offset");
    mark(')');
    mark('[');
    const Token minimum = scanner_.peek();
    signal.minimum = number("the minimum");
    mark('|');
    signal.maximum = number("the maximum");
    if (signal.minimum > signal.maximum) {
        scanner_.fail(minimum, "a minimum that is not above the maximum");
    }
    mark(']');
    signal.unit = string_value(string("the unit as a string"));
    receivers();
    places.signals.push_back(name.at);
    message.signals.push_back(std::move(signal));
}

void DbcParser::multiplexing(Message& message, Signal& signal) {
    if (scanner_.peek().kind != Token::Kind::word) return;
    const Token token = scanner_.next();
    if (token.text == "M") {
        const Signal* other = message.multiplexor();
        if (other != nullptr) {
            scanner_.fail(token, "one multiplexor in a message, which is '" + other->name + "'");
        }
        signal.is_multiplexor = true;
        return;
    }
    std::uint32_t value = 0;
    if (token.text[0] != 'm' || !read_number(token.text.substr(1), value)) {
        scanner_.fail(token, token.text[0] == 'm' && token.text.back() == 'M'
                                 ? "M or m<value>: multiplexors of multiplexors are not supported"
                                 : "':', M or m<value>");
    }
    signal.multiplex_value = value;
}

void DbcParser::bits(const Message& message, Signal& signal) {
    const Token start = scanner_.peek();
    signal.start_bit = static_cast<std::uint16_t>(whole_number(511, "a start bit of 0 to 511"));
    mark('|');
    const Token length = scanner_.peek();
    signal.length = static_cast<std::uint16_t>(whole_number(64, "a length of 1 to 64 bits"));
    if (signal.length == 0) scanner_.fail(length, "a length of 1 to 64 bits");
    mark('@');
    const std::string order = "byte order 0 (big endian) or 1 (little endian)";
    signal.order = whole_number(1, order) == 1 ? ByteOrder::little : ByteOrder::big;
    const Token sign = scanner_.next();
    if (!sign.is_mark('+') && !sign.is_mark('-')) {
        scanner_.fail(sign, "'+' (unsigned) or '-' (signed)");
    }
    signal.is_signed = sign.is_mark('-');
    if (!fits_message(signal, message.size)) {
        scanner_.fail_at(start.at, "found signal '" + signal.name + "' with bits outside the " +
                                       std::to_string(message.size) + " bytes of message '" +
                                       message.name + "', expected it inside");
    }
}

void DbcParser::receivers() {
    const auto is_name = [this] {
        const Token& token = scanner_.peek();
        return token.kind == Token::Kind::word && !(token.first_on_line && is_keyword(token));
    };
    while (is_name()) {
        scanner_.next();
        if (!scanner_.peek().is_mark(',')) continue;
        scanner_.next();
        if (!is_name()) scanner_.fail(scanner_.peek(), "a receiving node");
    }
}

}  // namespace vibrig::proto
