#include "daemon/tool/analysis/spectrum_dwells.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace vibrig::tool {

namespace {

using estimator::spectrum::Band;
using SpectraJson = nlohmann::json;

constexpr double kSameFrequency = 0.02;  ///< relative: the rules of the reference frequency

int count_of(const SpectraJson& entry, const char* key, const std::string& place) {
    const auto found = entry.find(key);
    if (found == entry.end() || !found->is_number_integer() || found->get<int>() < 1)
        throw std::runtime_error(place + key + ": found " +
                                 (found == entry.end() ? "nothing" : found->dump()) +
                                 ", expected a number from 1");
    return found->get<int>();
}

std::vector<std::pair<double, double>> lines_of(const SpectraJson& entry,
                                                const std::string& place) {
    const auto found = entry.find("lines");
    if (found == entry.end() || !found->is_array())
        throw std::runtime_error(place + "lines: found " +
                                 (found == entry.end() ? "nothing" : found->dump()) +
                                 ", expected [[hz, g_peak], ..], empty at rest");
    std::vector<std::pair<double, double>> lines;
    for (const SpectraJson& line : *found) {
        const bool good = line.is_array() && line.size() == 2 && line[0].is_number() &&
                          line[1].is_number() && line[0].get<double>() > 0 &&
                          line[1].get<double>() > 0;
        if (!good)
            throw std::runtime_error(place + "lines[" + std::to_string(lines.size()) + "]: found " +
                                     line.dump() + ", expected [hz, g_peak], both above 0");
        lines.emplace_back(line[0].get<double>(), line[1].get<double>());
    }
    return lines;
}

std::vector<Band> bands_of_lines(const std::vector<std::pair<double, double>>& lines) {
    double all = 0;
    for (const auto& [hz, peak] : lines) all += peak * peak;
    std::vector<Band> bands;
    for (const auto& [hz, peak] : lines) bands.push_back({hz, peak * peak / all, 0});
    return bands;
}

bool alike(const std::vector<Band>& a, const std::vector<Band>& b) {
    return a.size() == b.size() &&
           std::equal(a.begin(), a.end(), b.begin(), [](const Band& x, const Band& y) {
               return std::abs(x.hz / y.hz - 1) < kSameFrequency / 10 &&
                      std::abs(x.share - y.share) < 0.01;
           });
}

}  // namespace

Spectra read_spectra(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error(path + ": cannot be read, expected a JSON file");
    const SpectraJson root = SpectraJson::parse(file, nullptr, false);
    if (!root.is_array())
        throw std::runtime_error(path + ": expected a JSON list of {run, position, lines}");
    Spectra spectra;
    for (std::size_t i = 0; i < root.size(); ++i) {
        const std::string place = path + ": [" + std::to_string(i) + "].";
        if (!root[i].is_object())
            throw std::runtime_error(path + ": [" + std::to_string(i) + "]: found " +
                                     root[i].dump() + ", expected {run, position, lines}");
        const std::pair key{count_of(root[i], "run", place), count_of(root[i], "position", place)};
        if (!spectra.emplace(key, lines_of(root[i], place)).second)
            throw std::runtime_error(place + "run: found run " + std::to_string(key.first) +
                                     ", position " + std::to_string(key.second) +
                                     " twice, expected once");
    }
    return spectra;
}

void DwellKinds::add(const std::vector<const proto::RecordingRow*>& rows, const std::string& file) {
    const proto::RecordingRow& first = *rows.front();
    for (const auto* row : rows) {
        if (row->frequency_hz != first.frequency_hz)
            throw std::runtime_error(
                file + ":" + std::to_string(row->line) + ": column frequency_hz: found " +
                std::to_string(row->frequency_hz) + " after " + std::to_string(first.frequency_hz) +
                ", expected one frequency in a dwell");
    }
    const auto found = spectra_.find({first.run, first.position});
    std::vector<Band> bands;
    if (found != spectra_.end()) {
        bands = bands_of_lines(found->second);
    } else if (!spectra_.empty() && first.frequency_hz < 0) {
        throw std::runtime_error(file + ":" + std::to_string(first.line) + ": run " +
                                 std::to_string(first.run) + ", position " +
                                 std::to_string(first.position) +
                                 ": found no spectrum in --spectra, expected one for every dwell");
    } else if (const double hz = first.frequency_hz < 0 ? configured_hz_ : first.frequency_hz;
               hz > 0) {
        bands = {{hz, 1, 0}};
    }
    if (bands.empty())
        of_dwell_.emplace_back();
    else
        of_dwell_.emplace_back(kind_of(std::move(bands)));
}

std::size_t DwellKinds::kind_of(std::vector<Band> bands) {
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
        if (alike(kinds_[k].bands, bands)) return k;
    }
    kinds_.push_back({"", std::move(bands)});
    return kinds_.size() - 1;
}

std::optional<std::size_t> DwellKinds::reference() const {
    std::optional<std::size_t> most;
    long largest = 0;
    for (std::size_t k = 0; k < kinds_.size(); ++k) {
        if (std::abs(kinds_[k].hz() / configured_hz_ - 1) < kSameFrequency) return k;
        const auto count = std::count(of_dwell_.begin(), of_dwell_.end(), std::optional(k));
        if (count <= largest) continue;
        largest = count;
        most = k;
    }
    return most;
}

}  // namespace vibrig::tool
