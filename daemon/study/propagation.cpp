#include "daemon/study/propagation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>

#include "daemon/study/campaign_record.hpp"
#include "daemon/study/identified_recording.hpp"
#include "daemon/study/recordings.hpp"
#include "daemon/study/statistics.hpp"
#include "estimator/uncertainty/monte_carlo.hpp"
#include "proto/json_number.hpp"

namespace vibrig::study {

namespace uncertainty = estimator::uncertainty;
using Json = nlohmann::ordered_json;

namespace {

constexpr char kBlock = 'U', kSimulatedBlock = 'V';
constexpr std::uint64_t kFewest = 2;
// JCGM 101, 8.2: draws that judge a budget are taken to a fifth of its tolerance.
constexpr double kFiner = 5;

}  // namespace

struct PropagationWorker::Model {
    Model(const Recording& recording, const std::vector<Setting>& settings)
        : found(identify_recording(recording, settings)),
          drawing(uncertainty::block_drawing(found.settings, found.assessed)) {
        if (found.assessed.over_frequency)
            throw StudyError(recording.folder +
                             ": found dwells at several frequencies, expected one frequency");
        // That its variances add up would say nothing for a budget that does not hold.
        for (const auto& reason : found.assessed.verdict.reasons)
            if (reason.code == "configuration")
                throw StudyError(recording.folder + ": " + reason.text);
    }

    IdentifiedRecording found;
    uncertainty::BlockDrawing drawing;
};

PropagationWorker::PropagationWorker(const Study& study) : study_(study) {}
PropagationWorker::~PropagationWorker() = default;

std::string PropagationWorker::run(std::uint64_t index) {
    return record_of([&] {
        if (!model_)
            model_ = std::make_unique<Model>(study_.recordings.at(0), study_.configuration);
        const auto block =
            model_->drawing(Draws(study_.seed, index, "trials").bits(), kTrialsOfBlock);
        BlockRecord out{};
        for (std::size_t i = 0; i < out.size(); ++i) {
            const auto& budget = model_->found.assessed.coefficients[i];
            const auto& c = block.coefficients[i];
            out[i] = {budget.value,
                      budget.u,
                      budget.expanded,
                      {c.mean, c.u, c.low, c.high, c.shortest_low, c.shortest_high}};
        }
        std::string bytes(1 + sizeof out, model_->found.simulated ? kSimulatedBlock : kBlock);
        std::memcpy(bytes.data() + 1, out.data(), sizeof out);
        return bytes;
    });
}

struct PropagationSums::Sums {
    int digits = 1;
    std::uint64_t blocks = 0;
    bool stable = false, simulated = false;
    BlockRecord first{};
    std::array<std::array<Sum, kDrawn>, estimator::kParameters> drawn, squares;
    std::map<std::string, std::uint64_t> failures;

    [[nodiscard]] double delta(std::size_t i) const {
        return first[i].u > 0 ? uncertainty::numerical_tolerance(first[i].u, digits) : 0;
    }
    [[nodiscard]] double mean(std::size_t i, std::size_t k) const {
        return drawn[i][k].value() / static_cast<double>(blocks);
    }
    /// Of the blocks' mean. The squares are of what differs from the first block.
    [[nodiscard]] double standard_error(std::size_t i, std::size_t k) const {
        const auto h = static_cast<double>(blocks);
        const double off = mean(i, k) - first[i].drawn[k];
        return std::sqrt(std::max(0.0, squares[i][k].value() / h - off * off) / (h - 1));
    }
    [[nodiscard]] bool settled() const {
        if (blocks < kFewest) return false;
        for (std::size_t i = 0; i < first.size(); ++i) {
            for (std::size_t k = 0; k < 4 && delta(i) > 0; ++k) {
                if (2 * standard_error(i, k) > delta(i) / kFiner) return false;
            }
        }
        return true;
    }
};

PropagationSums::PropagationSums(int digits) : sums_(std::make_unique<Sums>()) {
    sums_->digits = digits;
}
PropagationSums::~PropagationSums() = default;

void PropagationSums::add(const std::string& bytes) {
    Sums& s = *sums_;
    if (bytes.size() != 1 + sizeof(BlockRecord) ||
        (bytes[0] != kBlock && bytes[0] != kSimulatedBlock)) {
        ++s.failures[decode(bytes).failed];
        return;
    }
    s.simulated = s.simulated || bytes[0] == kSimulatedBlock;
    if (s.stable) return;
    BlockRecord block;
    std::memcpy(block.data(), bytes.data() + 1, sizeof block);
    if (s.blocks++ == 0) s.first = block;
    for (std::size_t i = 0; i < block.size(); ++i) {
        for (std::size_t k = 0; k < kDrawn; ++k) {
            const double off = block[i].drawn[k] - s.first[i].drawn[k];
            s.drawn[i][k].add(block[i].drawn[k]);
            s.squares[i][k].add(off * off);
        }
    }
    s.stable = s.settled();
}

Json PropagationSums::json() const {
    const Sums& s = *sums_;
    bool validated = s.blocks > 0;
    Json list = Json::array();
    for (std::size_t i = 0; i < s.first.size() && s.blocks > 0; ++i) {
        Json one{{"name", estimator::parameter_names()[i]}, {"unit", estimator::parameter_unit(i)}};
        const BlockNumbers& budget = s.first[i];
        if (budget.u > 0) {
            const auto end = [&](std::size_t k) {
                return proto::number_or_null(budget.value + s.mean(i, k));
            };
            const double delta = s.delta(i);
            // JCGM 101, 8.1.3
            const double off = std::max(std::abs(-budget.expanded - s.mean(i, 2)),
                                        std::abs(budget.expanded - s.mean(i, 3)));
            one["value"] = proto::number_or_null(budget.value);
            one["mean"] = end(0);
            one["u"] = proto::number_or_null(s.mean(i, 1));
            one["symmetric"] = {end(2), end(3)};
            one["shortest"] = {end(4), end(5)};
            one["gum"] = {{"u", proto::number_or_null(budget.u)},
                          {"low", proto::number_or_null(budget.value - budget.expanded)},
                          {"high", proto::number_or_null(budget.value + budget.expanded)}};
            one["standard_error"] = {{"mean", proto::number_or_null(s.standard_error(i, 0))},
                                     {"u", proto::number_or_null(s.standard_error(i, 1))},
                                     {"low", proto::number_or_null(s.standard_error(i, 2))},
                                     {"high", proto::number_or_null(s.standard_error(i, 3))}};
            one["tolerance"] = proto::number_or_null(delta);
            one["difference"] = proto::number_or_null(off);
            one["validated"] = off <= delta;
            validated = validated && off <= delta;
        }
        list.push_back(one);
    }
    return {{"trials", s.blocks * static_cast<std::uint64_t>(kTrialsOfBlock)},
            {"digits", s.digits},
            {"simulated", s.simulated},
            {"stable", s.stable},
            {"failures", s.failures},
            {"verdict", !s.stable   ? "not stable yet"
                        : validated ? "validated"
                                    : "not validated"},
            {"coefficients", list}};
}

}  // namespace vibrig::study
