#pragma once

#include <toml++/toml.h>

#include <array>
#include <set>
#include <string>
#include <vector>

namespace vibrig::guard {

/// Takes single keys out of a configuration file, each with its default, and remembers what was
/// wrong and what it believes. What else the file holds is the daemon's affair, if it knows it.
class Keys {
  public:
    /// Throws SettingsError if the text is no TOML.
    Keys(const std::string& text, std::string file);

    [[nodiscard]] std::string text(const std::string& key, const std::string& otherwise);
    [[nodiscard]] bool boolean(const std::string& key, bool otherwise);
    [[nodiscard]] double number(const std::string& key, double otherwise, double low, double high);
    [[nodiscard]] int integer(const std::string& key, int otherwise, int low, int high);
    /// One of the words, by its place in the list.
    [[nodiscard]] std::size_t choice(const std::string& key, std::size_t otherwise,
                                     const std::vector<std::string>& words);
    /// An array of exactly so many numbers; an array of such arrays is read row by row, "key[0]".
    void numbers(const std::string& key, double* values, std::size_t count);
    /// An array of pairs of numbers above 0, the first growing; none, or this word in its place
    /// (empty: no word may be): empty.
    [[nodiscard]] std::vector<std::array<double, 2>> pairs(const std::string& key,
                                                           const std::string& word = {});
    /// "file:line:column: key: found X, expected Y" for a key that is well written and cannot be.
    void refuse(const std::string& key, const std::string& found, const std::string& expected);
    /// When all is read: what is in the tables that were read in, and is neither what was asked for
    /// nor one of these; and tables that are neither those nor one of these.
    void refuse_unknown(const std::set<std::string>& keys, const std::set<std::string>& tables);

    [[nodiscard]] bool stated(const std::string& key) { return at(key).node() != nullptr; }
    /// "file:line:column" of what is stated, else empty.
    [[nodiscard]] std::string place(const std::string& key);

    /// One a line.
    [[nodiscard]] const std::string& problems() const noexcept { return problems_; }
    /// What was taken, as TOML with its origin.
    [[nodiscard]] const std::string& believed() const noexcept { return believed_; }

  private:
    [[nodiscard]] toml::node_view<toml::node> at(const std::string& key) {
        known_.insert(key.substr(0, key.find('[')));
        return table_.at_path(key);
    }
    void look_for_unknown(const toml::table& table, const std::string& prefix);
    [[nodiscard]] bool is_table(const std::string& key) const;
    /// Names of the keys and tables in it, for a person.
    [[nodiscard]] std::string names_in(const std::string& prefix) const;
    [[nodiscard]] std::string placed(const toml::source_region& source) const;
    void wrong(const std::string& key, const toml::node* node, const std::string& found,
               const std::string& expected);
    void believe(const std::string& key, const std::string& value);

    std::string file_;
    toml::table table_;
    std::set<std::string> known_;  ///< what was asked for, and in the end what else there may be
    std::string problems_, believed_;
};

}  // namespace vibrig::guard
