// vibrig archive type: what the units of a type have in common.
#include <cmath>
#include <cstdio>
#include <iostream>
#include <optional>

#include "daemon/archive/type_statistics.hpp"
#include "daemon/archive/vibration.hpp"
#include "daemon/plan/type_prior.hpp"
#include "daemon/tool/commands.hpp"
#include "daemon/tool/recordings/archive_place.hpp"
#include "estimator/identification/identification.hpp"
#include "proto/text.hpp"

namespace vibrig::tool {

namespace {

struct TypeOptions {
    std::string type, without;
    std::optional<double> at_hz;
    bool simulated = false, json = false;
    ArchiveOptions where = {};
};

void print(const plan::TypePrior& prior) {
    const auto& of = prior.of;
    std::printf("type %s: %zu units, %zu campaigns%s\nquadratic coefficients: %s",
                prior.type.c_str(), of.units, of.campaigns,
                prior.simulated ? " on simulated rigs" : "", prior.vibration.c_str());
    if (prior.of_other_vibration > 0)
        std::printf("; %zu campaigns of another vibration left out", prior.of_other_vibration);
    std::printf("\n\n");
    std::printf("%-11s %12s %14s %18s %15s\n", "coefficient", "mean", "between units",
                "between campaigns", "of another unit");
    for (std::size_t i = 0; i < estimator::kParameters; ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        std::printf("%-11s %12.5f %14.5f %18.5f %15.5f  %s\n", estimator::parameter_names()[i],
                    of.mean(k), std::sqrt(of.between(k, k)), std::sqrt(of.within(k, k)),
                    std::sqrt(of.predicted(k, k)), estimator::parameter_unit(i));
    }
    std::fflush(stdout);
}

int type_statistics(const TypeOptions& o) {
    const auto index = open_index(o.where);
    const auto found =
        archive::campaigns_of_type(*index, o.type, o.without, o.simulated, archive::all_at(o.at_hz),
                                   whereabouts_of(o.where).place.folder);
    if (found.units.size() < estimator::uncertainty::kFewestUnits) {
        std::cerr << index->name() << ": found " << found.units.size() << " units of type '"
                  << proto::printable(o.type) << "' with " << found.campaigns << " campaigns on "
                  << (o.simulated ? "simulated" : "real") << " rigs (" << found.left_out
                  << " not valid or not whole left out"
                  << (found.of_other_vibration > 0
                          ? ", " + std::to_string(found.of_other_vibration) + " not " +
                                found.vibration + " left out"
                          : "")
                  << "), expected at least " << estimator::uncertainty::kFewestUnits << " units\n";
        return kNo;
    }
    const plan::TypePrior prior{o.type, o.simulated,
                                estimator::uncertainty::population_of(found.units), found.vibration,
                                found.of_other_vibration};
    if (o.json) {
        std::cout << plan::to_json(prior) << '\n';
    } else {
        print(prior);
    }
    return 0;
}

}  // namespace

void add_archive_type(CLI::App& group, int& exit_code) {
    const auto [command, options] = add_command<TypeOptions>(
        group, exit_code, "type",
        "What the units of a type have in common, and by how much they differ", type_statistics);
    command.add_option("TYPE", options.type, "as unit.type says it")->required();
    command.add_option("--without", options.without,
                       "leave out the unit with this serial number, of which something is to be "
                       "predicted");
    add_at_hz(command, options.at_hz);
    command.add_flag("--simulated", options.simulated,
                     "of campaigns on simulated rigs (default: on real ones)");
    command.add_flag("--json", options.json, "print it as JSON, with covariances");
    add_archive_options(command, options.where);
    command.footer(
        "Example: vibrig archive type GP-3 --archive /lab/archive\n"
        "Each unit counts once, however many campaigns it has. `of another unit`: the standard\n"
        "deviation by which a unit that is not among them is expected to differ from the mean.\n"
        "Exit codes: 0, 1 fewer than 10 units, 2 bad usage or input.");
}

}  // namespace vibrig::tool
