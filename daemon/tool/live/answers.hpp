#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "proto/text.hpp"

namespace vibrig::tool {

/// Answers to questions by their id, a list for a question that comes again. The daemon gives them.
class Answers {
  public:
    explicit Answers(const std::string& path) : path_(path) {
        constexpr std::size_t kLongestFile = std::size_t{1} << 20;
        std::string text;
        try {
            text = proto::read_whole_file(path, kLongestFile);
        } catch (const std::runtime_error& error) {
            throw std::runtime_error(path + ": " + error.what());
        }
        json_ = nlohmann::ordered_json::parse(text, nullptr, false);
        if (!json_.is_object())
            throw std::runtime_error(path + ": expected a JSON object, question to answer");
    }
    [[nodiscard]] const nlohmann::ordered_json& all() const noexcept { return json_; }
    /// Throws std::runtime_error: the file has no answer to what is asked.
    void expect_one_to(const nlohmann::ordered_json& question) const {
        const std::string id = question["id"];
        if (json_.contains(id) || !question["usual"].get<std::string>().empty()) return;
        throw std::runtime_error(path_ + ": found no answer to \"" + id + "\" (" +
                                 question["text"].get<std::string>() + "), expected " +
                                 question["expected"].get<std::string>());
    }

  private:
    std::string path_;
    nlohmann::ordered_json json_;
};

}  // namespace vibrig::tool
