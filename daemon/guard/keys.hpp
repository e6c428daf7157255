#pragma once

#include <toml++/toml.h>

#include <string>
#include <vector>

namespace vibrig::guard {

/// Takes single keys out of a configuration file, each with its default, and remembers what was
/// wrong and what it believes. What else the file holds is the daemon's affair.
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
    /// "file:line:column: key: found X, expected Y" for a key that is well written and cannot be.
    void refuse(const std::string& key, const std::string& found, const std::string& expected);

    [[nodiscard]] bool stated(const std::string& key) { return at(key).node() != nullptr; }

    /// One a line.
    [[nodiscard]] const std::string& problems() const noexcept { return problems_; }
    /// What was taken, as TOML with its origin.
    [[nodiscard]] const std::string& believed() const noexcept { return believed_; }

  private:
    [[nodiscard]] toml::node_view<toml::node> at(const std::string& key) {
        return table_.at_path(key);
    }
    void wrong(const std::string& key, const toml::node* node, const std::string& found,
               const std::string& expected);
    void believe(const std::string& key, const std::string& value);

    std::string file_;
    toml::table table_;
    std::string problems_, believed_;
};

}  // namespace vibrig::guard
