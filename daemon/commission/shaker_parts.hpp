#pragma once

#include <map>
#include <string>
#include <vector>

#include "daemon/commission/record.hpp"

namespace vibrig::commission {

/// What a person reads off, where the rig itself cannot tell the unit of the amplitude.
struct AmplitudeWitness {
    std::string display;     ///< unit that the controller's display shows; empty: not said
    double reference_g = 0;  ///< peak g at the table by a reference, at the level of the proof
};

/// Units that a display may show: "g peak", "g rms", ...
[[nodiscard]] std::vector<std::string> amplitude_units();

/// What proofs of the safe state show of the shaker: the parts that stand, with their evidence, and
/// of the others why not.
struct ShakerParts {
    std::map<Part, Json> proven;
    std::map<Part, std::string> lacking;
};

/// What a run at 0 g shows (`table_g` 0) and what a proof that shakes shows belong together: both
/// are asked for. `proofs`: made with the keys as they are, oldest first, as the journal keeps them
/// (daemon/campaign/safety_proof.hpp). `buttons_left`: nobody has pressed them in any of them.
[[nodiscard]] ShakerParts shaker_parts(const std::vector<Json>& proofs,
                                       const std::vector<std::string>& buttons_left,
                                       const AmplitudeWitness& witness = {});

}  // namespace vibrig::commission
