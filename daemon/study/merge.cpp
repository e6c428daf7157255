#include "daemon/study/merge.hpp"

#include <algorithm>
#include <filesystem>

namespace vibrig::study {

namespace {

constexpr std::size_t kMostLines = 1000;  // of each kind of trouble
constexpr std::uint64_t kWriteAtOnce = 4 << 20;

void add_line(std::vector<std::string>& lines, const std::string& line) {
    if (lines.size() < kMostLines) lines.push_back(line);
}

}  // namespace

struct Merged::Source {
    Source(const Folder& folder, const PartName& name)
        : part(name), reader(folder.parts() + "/" + name.file, folder.id, folder.tasks()) {}

    PartName part;
    PartReader reader;
    TaskRecord record;
};

Merged::Merged(const Folder& folder) : folder_(folder) {
    std::vector<std::string> others;
    std::vector<std::pair<std::uint64_t, PartName>> first;
    for (const PartName& name : parts_in(folder.parts(), &others)) {
        Source source(folder, name);
        if (advance(source)) first.emplace_back(source.record.index, name);
    }
    for (const std::string& other : others)
        add_line(found_.foreign, other + ": not a part of a study");
    std::ranges::stable_sort(first, {}, &std::pair<std::uint64_t, PartName>::first);
    waiting_.assign(first.begin(), first.end());
}

Merged::~Merged() = default;

bool Merged::advance(Source& source) {
    if (source.reader.next(source.record)) return true;
    const std::string line = source.part.file + ": " + source.reader.why();
    const PartReader::End end = source.reader.end();
    if (end == PartReader::End::whole) {
        read_.insert(source.part.file);
    } else if (end == PartReader::End::foreign) {
        add_line(found_.foreign, line);
    } else if (end == PartReader::End::torn && !source.part.closed) {
        read_.insert(source.part.file);
        add_line(found_.unfinished, line);
    } else {
        add_line(found_.damaged, line);
    }
    return false;
}

/// Those that may hold the index.
void Merged::begin_until(std::uint64_t index) {
    while (!waiting_.empty() && waiting_.front().first <= index) {
        auto source = std::make_unique<Source>(folder_, waiting_.front().second);
        waiting_.pop_front();
        if (advance(*source)) open_.push_back(std::move(source));
    }
}

void Merged::miss(std::uint64_t from, std::uint64_t to) {
    if (from >= to) return;
    found_.missing_count += to - from;
    if (!found_.missing.empty() && found_.missing.back().second + 1 == from) {
        found_.missing.back().second = to - 1;
    } else if (found_.missing.size() < kMostLines) {
        found_.missing.emplace_back(from, to - 1);
    }
}

bool Merged::next(TaskRecord& record) {
    const auto by_index = [](const auto& a, const auto& b) {
        return a->record.index < b->record.index;
    };
    for (;;) {
        if (open_.empty() && !waiting_.empty()) begin_until(waiting_.front().first);
        if (open_.empty() && waiting_.empty()) {
            miss(expected_, folder_.tasks());
            expected_ = folder_.tasks();
            return false;
        }
        if (open_.empty()) continue;
        begin_until((*std::ranges::min_element(open_, by_index))->record.index);
        const Source& first = **std::ranges::min_element(open_, by_index);
        const std::uint64_t index = first.record.index;
        const std::string first_file = first.part.file;
        record = first.record;
        bool agree = true;
        std::uint64_t times = 0;
        for (auto& source : open_) {
            if (source->record.index != index) continue;
            ++times;
            if (source->record.bytes != record.bytes) {
                agree = false;
                add_line(found_.contradictions,
                         "task " + std::to_string(index) + ": " + first_file + " and " +
                             source->part.file + " have different results: a defect or bad memory");
            }
            if (!advance(*source)) source.reset();
        }
        std::erase(open_, nullptr);
        found_.duplicates += times - 1;
        miss(expected_, index);
        expected_ = index + 1;
        if (agree) return true;
        miss(index, index + 1);
    }
}

Compaction compact(const Folder& folder) {
    Compaction out;
    std::vector<PartName> old;
    for (PartName& name : parts_in(folder.parts())) {
        if (name.closed || name.abandoned()) {
            old.push_back(std::move(name));
        } else {
            out.kept.push_back(name.file + ": another process may write it");
        }
    }
    if (old.empty() || (old.size() == 1 && old.front().closed)) return out;
    Merged merged(folder);
    PartWriter writer(folder.parts(), folder.id, {});
    std::vector<TaskRecord> records;
    std::uint64_t bytes = 0;
    for (TaskRecord record; merged.next(record);) {
        bytes += record.bytes.size();
        records.push_back(std::move(record));
        if (bytes < kWriteAtOnce) continue;
        writer.append(records);
        records.clear();
        bytes = 0;
    }
    for (const auto* wrong : {&merged.found().contradictions, &merged.found().foreign}) {
        if (wrong->empty()) continue;
        std::error_code ignored;
        if (!writer.path().empty()) std::filesystem::remove(writer.path(), ignored);
        out.refused = wrong->front();
        return out;
    }
    writer.append(records);
    writer.close();
    for (const PartName& name : old) {
        std::error_code error;
        if (!merged.read_to_its_end(name.file)) {
            out.kept.push_back(name.file + ": damaged, it stays as it is");
        } else if (std::filesystem::remove(folder.parts() + "/" + name.file, error); error) {
            out.kept.push_back(name.file + ": cannot be removed: " + error.message());
        } else {
            ++out.parts;
        }
    }
    return out;
}

}  // namespace vibrig::study
