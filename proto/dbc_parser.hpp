#pragma once

#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "proto/dbc.hpp"
#include "proto/dbc_scanner.hpp"

namespace vibrig::proto {

/// Reads one DBC text, statement by statement. Used once; throws DbcError.
class DbcParser {
  public:
    DbcParser(std::string_view text, const std::string& file_name);
    [[nodiscard]] Dbc run();

  private:
    using ValueNames = std::map<std::int64_t, std::string>;
    /// What is known about a message besides the message itself, for later statements and checks.
    struct Places {
        std::unordered_map<std::string_view, std::size_t> signal_index;
        std::vector<Position> signals;
    };
    struct Reference {
        Message* message = nullptr;  ///< null: the message that is skipped
        Places* places = nullptr;
    };

    void statement();
    void new_symbols();
    void bit_timing();
    void nodes();
    void message();
    void signal(Message& message, Places& places);
    void multiplexing(Message& message, Signal& signal);
    void bits(const Message& message, Signal& signal);
    void receivers();
    void value_type();
    void value_table();
    void value_names();
    void multiplex_range();
    void attribute();
    void attribute_default();
    void skip_statement();
    void skip_independent_signals();

    [[nodiscard]] Token word(const std::string& expected);
    [[nodiscard]] Token string(const std::string& expected);
    void mark(char expected);
    [[nodiscard]] double number(const std::string& expected);
    [[nodiscard]] std::uint64_t whole_number(std::uint64_t maximum, const std::string& expected);
    [[nodiscard]] std::int64_t raw_value();
    [[nodiscard]] std::uint32_t cycle_time();
    [[nodiscard]] ValueNames value_list();
    [[nodiscard]] Reference message_reference();
    [[nodiscard]] Signal& signal_reference(const Reference& reference);

    DbcScanner scanner_;
    Dbc dbc_;
    std::vector<Places> places_;
    std::unordered_map<std::uint64_t, std::size_t> index_by_id_;  ///< id as the file writes it
    std::unordered_set<std::string_view> message_names_;
    std::unordered_set<std::uint64_t> skipped_ids_;
    std::unordered_map<std::string_view, ValueNames> value_tables_;
    std::uint32_t default_cycle_time_ms_ = 0;
};

}  // namespace vibrig::proto
