#pragma once

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace vibrig::tool {

/// Answers to questions by their id, a list for a question that comes again.
class Answers {
  public:
    explicit Answers(const std::string& path) : path_(path) {
        std::ifstream file(path);
        if (!file) throw std::runtime_error(path + ": cannot be read");
        json_ = nlohmann::ordered_json::parse(file, nullptr, false);
        if (!json_.is_object())
            throw std::runtime_error(path + ": expected a JSON object, question to answer");
    }
    [[nodiscard]] std::string to(const nlohmann::ordered_json& question) {
        const std::string id = question["id"];
        if (!json_.contains(id)) {
            if (!question["usual"].get<std::string>().empty()) return "";
            throw std::runtime_error(path_ + ": found no answer to \"" + id + "\" (" +
                                     question["text"].get<std::string>() + "), expected " +
                                     question["expected"].get<std::string>());
        }
        nlohmann::ordered_json& answer = json_[id];
        if (answer.is_array() && !answer.empty()) {
            auto first = answer.front();
            if (answer.size() > 1) answer.erase(answer.begin());
            return text_of(first);
        }
        return text_of(answer);
    }

  private:
    static std::string text_of(const nlohmann::ordered_json& value) {
        return value.is_string() ? value.get<std::string>() : value.dump();
    }
    std::string path_;
    nlohmann::ordered_json json_;
};

}  // namespace vibrig::tool
