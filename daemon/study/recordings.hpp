#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "daemon/study/study.hpp"
#include "daemon/study/worker.hpp"

namespace vibrig::study {

/// Checks the settings and looks for the campaigns below the study's folders, which are those of
/// `file` if they are relative; in the order of their paths. What cannot be read is not left out:
/// its task will say why. Throws StudyError.
[[nodiscard]] std::vector<Recording> find_recordings(const Study& study, const std::string& file);

/// Throws StudyError if some are not where they were planned to be.
void check_recordings(const Study& study);

/// The one whose uncertainty is to be proved. Throws StudyError.
[[nodiscard]] Recording find_recording(const Study& study, const std::string& file);

/// The recording's settings, with the study's in place of theirs.
[[nodiscard]] std::string settings_of_recording(const std::string& configuration,
                                                const std::vector<Setting>& settings);

/// Identifies recordings anew.
class RecordingWorker final : public Worker {
  public:
    explicit RecordingWorker(const Study& study) : study_(study) {}
    /// Throws StudyError if the recording is not what was planned.
    [[nodiscard]] std::string run(std::uint64_t index) override;

  private:
    const Study& study_;
};

/// Old and new of all recordings, those that differ most first.
class RecordingSums {
  public:
    RecordingSums();
    ~RecordingSums();
    void add(const Recording& recording, const std::string& bytes);
    /// And forgets them.
    [[nodiscard]] nlohmann::ordered_json take();

  private:
    struct One;
    std::vector<One> all_;
};

}  // namespace vibrig::study
